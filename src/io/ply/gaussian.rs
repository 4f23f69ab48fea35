//! The vertices of files of Gaussians: 2D Gaussian splatting's (Huang et al. 2024), and those of 3D Gaussian splatting (Kerbl et al. 2023) that
//! are flat.
//!
//! Numbers are as they are trained: logarithms of standard deviations `scale_0`, `scale_1` and, in three dimensions, `scale_2`; a quaternion
//! `rot_0` (w) to `rot_3` of any length; `opacity` before the logistic function; `f_dc_0` to `f_dc_2` and `f_rest_0` on, the coefficients of
//! spherical harmonics, red, green and blue one after the other. Normals `nx ny nz`, if there are any, are zeros.

use glam::{DQuat, DVec3};

use crate::io::Points;
use crate::io::fault::{Fault, reserve};
use crate::io::points::Flattened;
use crate::scene::gaussian::EXTENT;
use crate::scene::harmonics::{MOST_DEGREE, terms_of};
use crate::scene::{Colors, Harmonics};

/// A Gaussian is flat whose shortest half-axis is at most this part of the middle one.
const FLAT: f64 = 0.1;

/// The part of a file's Gaussians that need not be.
const MOST_THICK: f64 = 0.01;

/// Where the properties of a Gaussian are: each number an index into the columns of the vertices' layout.
#[derive(Clone, Debug)]
pub(super) struct GaussianLayout {
    /// Two or three.
    scales: Vec<usize>,
    rotation: [usize; 4],
    opacity: usize,
    base: [usize; 3],
    degree: u32,
    /// Channel by channel.
    rest: Vec<usize>,
}

impl GaussianLayout {
    /// None if the vertices, whose properties `has` knows and `column` gives places, are no Gaussians.
    pub(super) fn of(
        has: impl Fn(&str) -> bool,
        mut column: impl FnMut(&str) -> Option<usize>,
    ) -> Result<Option<Self>, Fault> {
        if !(has("scale_0") && has("rot_0")) {
            return Ok(None);
        }
        let mut wanted = |name: String| {
            column(&name).ok_or_else(|| {
                Fault::Malformed(format!(
                    "its vertices have scale_0 and rot_0, as Gaussians do, but no property {name}"
                ))
            })
        };
        let dimensions = if has("scale_2") { 3 } else { 2 };
        let scales = (0..dimensions).map(|k| wanted(format!("scale_{k}"))).collect::<Result<_, _>>()?;
        let mut rotation = [0; 4];
        for (k, place) in rotation.iter_mut().enumerate() {
            *place = wanted(format!("rot_{k}"))?;
        }
        let mut base = [0; 3];
        for (k, place) in base.iter_mut().enumerate() {
            *place = wanted(format!("f_dc_{k}"))?;
        }
        let opacity = wanted("opacity".into())?;
        let mut count = 0;
        while has(&format!("f_rest_{count}")) {
            count += 1;
        }
        let Some(degree) = (0..=MOST_DEGREE).find(|degree| 3 * terms_of(*degree) == count) else {
            return Err(Fault::Malformed(format!(
                "its vertices have {count} properties f_rest_0, f_rest_1 and so on, and spherical harmonics of degree 0 to 3 have 0, 9, 24 or 45"
            )));
        };
        let rest = (0..count).map(|k| wanted(format!("f_rest_{k}"))).collect::<Result<_, _>>()?;
        Ok(Some(Self { scales, rotation, opacity, base, degree, rest }))
    }
}

/// The Gaussians of a file while they are being read.
#[derive(Debug)]
pub(super) struct Gaussians<'a> {
    layout: &'a GaussianLayout,
    axes: Vec<[[f32; 3]; 2]>,
    colors: Vec<[f32; 4]>,
    terms: Vec<f32>,
    /// Of ellipsoids the ratio of the shortest half-axis to the middle one.
    ratios: Vec<f32>,
}

impl<'a> Gaussians<'a> {
    /// Room for `rows`.
    pub(super) fn with_capacity(layout: &'a GaussianLayout, rows: u64) -> Result<Self, Fault> {
        let (mut axes, mut colors, mut terms, mut ratios) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        reserve(&mut axes, rows)?;
        reserve(&mut colors, rows)?;
        reserve(&mut terms, rows.saturating_mul(layout.rest.len() as u64))?;
        reserve(&mut ratios, if layout.scales.len() == 3 { rows } else { 0 })?;
        Ok(Self { layout, axes, colors, terms, ratios })
    }

    /// The values of a row, by columns.
    pub(super) fn push(&mut self, value: impl Fn(usize) -> f64) {
        let layout = self.layout;
        let [w, x, y, z] = layout.rotation.map(&value);
        // A rotation of no length becomes one of no number, and so do its half-axes.
        let rotation = DQuat::from_xyzw(x, y, z, w).normalize();
        let deviations = layout.scales.iter().map(|column| value(*column).exp());
        let units = [DVec3::X, DVec3::Y, DVec3::Z];
        let mut axes: Vec<(f64, DVec3)> = deviations.zip(units).collect();
        if axes.len() == 3 {
            // Equal ones stay in the file's order.
            // One that is no number comes first, so that none is left.
            let shortest =
                (0..3).fold(2, |least, k| if axes[k].0 < axes[least].0 || axes[k].0.is_nan() { k } else { least });
            let (thickness, _) = axes.remove(shortest);
            if thickness.is_nan() {
                axes[0].0 = f64::NAN;
            }
            self.ratios.push((thickness / axes[0].0.min(axes[1].0)) as f32);
        }
        let half_axis = |(deviation, unit): (f64, DVec3)| (rotation * unit * (EXTENT * deviation)).as_vec3().to_array();
        self.axes.push([half_axis(axes[0]), half_axis(axes[1])]);
        let constant = 0.5 / std::f64::consts::PI.sqrt();
        let [r, g, b] = layout.base.map(|column| (0.5 + constant * value(column)) as f32);
        let alpha = 1.0 / (1.0 + (-value(layout.opacity)).exp());
        self.colors.push([r, g, b, alpha as f32]);
        let terms = terms_of(layout.degree);
        let of_term = |term: usize| [0, 1, 2].map(|channel| value(layout.rest[channel * terms + term]) as f32);
        self.terms.extend((0..terms).flat_map(of_term));
    }

    /// Puts them into `points`, of which nothing but the positions is there.
    pub(super) fn finish(self, points: &mut Points) {
        points.encoded = true;
        points.axes = Some(self.axes);
        let changes = self.terms.iter().any(|term| *term != 0.0);
        points.colors = match self.layout.degree {
            // Harmonics of nothing are a colour.
            degree if degree > 0 && changes => Harmonics::new(self.colors, degree, self.terms).map(Colors::Harmonics),
            _ => {
                // What is no number stays none.
                let seen = |c: f32| if c < 0.0 { 0.0 } else { c };
                let colors = self.colors.into_iter().map(|[r, g, b, a]| [seen(r), seen(g), seen(b), a]);
                Some(Colors::Linear(colors.collect()))
            }
        };
        points.flattened = flattened(self.ratios);
    }
}

/// What becomes of ellipsoids of these ratios; None if there are none.
fn flattened(mut ratios: Vec<f32>) -> Option<Flattened> {
    if ratios.is_empty() {
        return None;
    }
    let thick = ratios.iter().filter(|ratio| f64::from(**ratio) > FLAT).count() as u64;
    let middle = ratios.len() / 2;
    let (_, median, _) = ratios.select_nth_unstable_by(middle, f32::total_cmp);
    let ratio = f64::from(*median);
    Some(Flattened { count: ratios.len() as u64, thick, ratio })
}

/// Fails for ellipsoids that are no surfels, unless they shall `become` some.
pub(super) fn check(points: &Points, become_flat: bool) -> Result<(), Fault> {
    match points.flattened {
        Some(Flattened { count, thick, ratio }) if !become_flat && thick as f64 > MOST_THICK * count as f64 => {
            Err(Fault::Malformed(format!(
                "{thick} of its {count} Gaussians are ellipsoids thicker than a tenth of their width (half of all than {ratio:.2} of it) \
                 and no surfels: --flatten leaves their shortest axis out"
            )))
        }
        _ => Ok(()),
    }
}
