//! Vertices that are Gaussians: 2D Gaussian splatting (Huang et al. 2024), and 3D Gaussian
//! splatting (Kerbl et al. 2023), whose Gaussians are surfels where they are flat.
//!
//! The file holds the parameters as they are trained. `scale_0`, `scale_1` and, in three
//! dimensions, `scale_2` are logarithms of standard deviations. `rot_0` (w) to `rot_3` are a
//! quaternion of any length. `opacity` is the argument of the logistic function. `f_dc_0` to
//! `f_dc_2` and `f_rest_0`, `f_rest_1` and so on are coefficients of spherical harmonics: those of
//! red, then of green, then of blue. Normals `nx ny nz`, if present, are zeros and ignored.
//!
//! Without `f_dc_0` the colour is `red green blue`, as nerfstudio exports it: sRGB codes from 0 to
//! 255 (`ushort`: to 65535; `float`: to 1). With `f_dc_0`, `red green blue` are ignored, as in the
//! method's own viewer.
//!
//! `filter_3D` is the standard deviation f of a filter (Mip-Splatting, Yu et al. 2024). Each
//! standard deviation s becomes `sqrt(s^2 + f^2)`, and the opacity is multiplied by
//! `sqrt(det s^2 / det(s^2 + f^2))`.

use glam::{DQuat, DVec3};

use super::header::Scalar;
use crate::io::Points;
use crate::io::fault::{Fault, reserve};
use crate::io::points::Flattened;
use crate::scene::gaussian::EXTENT;
use crate::scene::harmonics::{MOST_DEGREE, terms_of};
use crate::scene::{Colors, Harmonics};

/// A Gaussian counts as flat if its shortest half-axis is at most this fraction of the middle one.
const FLAT: f64 = 0.1;

/// Largest fraction of a file's Gaussians that may be thicker than [`FLAT`].
const MOST_THICK: f64 = 0.01;

/// The constant spherical harmonic, `1 / (2 sqrt(pi))`.
pub(super) const CONSTANT: f64 = 0.282_094_791_773_878_14;

/// Where the properties of a Gaussian are: each number is an index into the columns of the vertex
/// layout.
#[derive(Clone, Debug)]
pub(super) struct GaussianLayout {
    /// Two or three columns.
    pub(super) scales: Vec<usize>,
    pub(super) rotation: [usize; 4],
    pub(super) opacity: usize,
    pub(super) base: Base,
    pub(super) degree: u32,
    /// Coefficients beyond the constant one: those of red, then of green, then of blue.
    pub(super) rest: Vec<usize>,
    /// The standard deviation of the filter of Mip-Splatting.
    pub(super) filter: Option<usize>,
}

/// The part of the colour that does not depend on the view.
#[derive(Clone, Copy, Debug)]
pub(super) enum Base {
    /// Coefficients of the constant harmonic.
    Constant([usize; 3]),
    /// sRGB codes: the column and the full value of each channel.
    Codes([(usize, f64); 3]),
}

impl Base {
    /// Finds the columns: `f_dc_0` to `f_dc_2`, or else `red green blue`.
    fn of(
        has: impl Fn(&str) -> bool,
        mut wanted: impl FnMut(String) -> Result<(usize, Scalar), Fault>,
    ) -> Result<Self, Fault> {
        let names = ["red", "green", "blue"];
        if has("f_dc_0") || !names.iter().all(|name| has(name)) {
            let mut base = [0; 3];
            for (k, place) in base.iter_mut().enumerate() {
                (*place, _) = wanted(format!("f_dc_{k}"))?;
            }
            return Ok(Self::Constant(base));
        }
        let mut codes = [(0, 1.0); 3];
        for (code, name) in codes.iter_mut().zip(names) {
            let (place, scalar) = wanted(name.into())?;
            *code = (place, most_code(scalar));
        }
        Ok(Self::Codes(codes))
    }

    /// The colour in sRGB codes from 0 to 1.
    fn color(&self, value: &impl Fn(usize) -> f64) -> [f64; 3] {
        match self {
            Self::Constant(base) => base.map(|column| 0.5 + CONSTANT * value(column)),
            Self::Codes(codes) => codes.map(|(column, most)| value(column) / most),
        }
    }
}

/// The full value of a colour code: 65535 for `ushort`, 1 for floats, 255 for all other types.
fn most_code(scalar: Scalar) -> f64 {
    match scalar {
        Scalar::U16 => 65535.0,
        Scalar::F32 | Scalar::F64 => 1.0,
        _ => 255.0,
    }
}

impl GaussianLayout {
    /// Finds the columns of a Gaussian; `has` says whether a property exists, `column` adds its
    /// column. Returns None if the vertices are not Gaussians.
    pub(super) fn of(
        has: impl Fn(&str) -> bool,
        mut column: impl FnMut(&str) -> Option<(usize, Scalar)>,
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
        let base = Base::of(&has, &mut wanted)?;
        let mut wanted = |name: String| wanted(name).map(|(place, _)| place);
        let dimensions = if has("scale_2") { 3 } else { 2 };
        let scales = (0..dimensions).map(|k| wanted(format!("scale_{k}"))).collect::<Result<_, _>>()?;
        let mut rotation = [0; 4];
        for (k, place) in rotation.iter_mut().enumerate() {
            *place = wanted(format!("rot_{k}"))?;
        }
        let opacity = wanted("opacity".into())?;
        let filter = if has("filter_3D") { Some(wanted("filter_3D".into())?) } else { None };
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
        Ok(Some(Self { scales, rotation, opacity, base, degree, rest, filter }))
    }
}

/// Collects the Gaussians of a file row by row.
#[derive(Debug)]
pub(super) struct Gaussians<'a> {
    layout: &'a GaussianLayout,
    axes: Vec<[[f32; 3]; 2]>,
    colors: Vec<[f32; 4]>,
    terms: Vec<f32>,
    /// Shortest half-axis over the middle one, of each ellipsoid that can be drawn.
    ratios: Vec<f32>,
    /// Shortest half-axis of each ellipsoid, world units.
    thirds: Vec<f32>,
}

impl<'a> Gaussians<'a> {
    /// Reserves memory for `rows` Gaussians.
    pub(super) fn with_capacity(layout: &'a GaussianLayout, rows: u64) -> Result<Self, Fault> {
        let (mut axes, mut colors, mut terms) = (Vec::new(), Vec::new(), Vec::new());
        let (mut ratios, mut thirds) = (Vec::new(), Vec::new());
        reserve(&mut axes, rows)?;
        reserve(&mut colors, rows)?;
        reserve(&mut terms, rows.saturating_mul(layout.rest.len() as u64))?;
        for lengths in [&mut ratios, &mut thirds] {
            reserve(lengths, if layout.scales.len() == 3 { rows } else { 0 })?;
        }
        Ok(Self { layout, axes, colors, terms, ratios, thirds })
    }

    /// Adds a Gaussian at `position`; `value(column)` gives its numbers.
    pub(super) fn push(&mut self, position: [f64; 3], value: impl Fn(usize) -> f64) {
        let layout = self.layout;
        let [w, x, y, z] = layout.rotation.map(&value);
        // A zero quaternion gives NaN half-axes.
        let rotation = DQuat::from_xyzw(x, y, z, w).normalize();
        let mut opacity = 1.0 / (1.0 + (-value(layout.opacity)).exp());
        let mut deviations: Vec<f64> = layout.scales.iter().map(|column| value(*column).exp()).collect();
        if let Some(filter) = layout.filter {
            opacity *= widened(&mut deviations, value(filter));
        }
        let units = [DVec3::X, DVec3::Y, DVec3::Z];
        let mut axes: Vec<(f64, DVec3)> = deviations.into_iter().zip(units).collect();
        let mut ratio = None;
        if axes.len() == 3 {
            // The shortest deviation is removed; the other two keep the file's order. A NaN counts
            // as the shortest and is passed on to a remaining half-axis, so that the Gaussian is
            // not drawn.
            let shortest =
                (0..3).fold(2, |least, k| if axes[k].0 < axes[least].0 || axes[k].0.is_nan() { k } else { least });
            let (thickness, _) = axes.remove(shortest);
            if thickness.is_nan() {
                axes[0].0 = f64::NAN;
            }
            self.thirds.push((EXTENT * thickness) as f32);
            ratio = Some((thickness / axes[0].0.min(axes[1].0)) as f32);
        }
        let half_axis = |(deviation, unit): (f64, DVec3)| (rotation * unit * (EXTENT * deviation)).as_vec3().to_array();
        let axes = [half_axis(axes[0]), half_axis(axes[1])];
        let [r, g, b] = layout.base.color(&value);
        let color = [r, g, b, opacity].map(|value| value as f32);
        // Postshot leaves rows of zeros, which have no rotation: they must not count as thick.
        let numbers = axes.as_flattened().iter().chain(&color);
        let is_drawn = numbers.into_iter().all(|x| x.is_finite()) && position.iter().all(|x| x.is_finite());
        self.ratios.extend(ratio.filter(|ratio| is_drawn && !ratio.is_nan()));
        self.axes.push(axes);
        self.colors.push(color);
        let terms = terms_of(layout.degree);
        let of_term = |term: usize| [0, 1, 2].map(|channel| value(layout.rest[channel * terms + term]) as f32);
        self.terms.extend((0..terms).flat_map(of_term));
    }

    /// Moves the Gaussians into `points`, which holds nothing but their positions so far.
    pub(super) fn finish(self, points: &mut Points) {
        points.encoded = true;
        points.axes = Some(self.axes);
        let changes = self.terms.iter().any(|term| *term != 0.0);
        points.colors = match self.layout.degree {
            // Harmonics whose coefficients are all zero are a plain colour.
            degree if degree > 0 && changes => Harmonics::new(self.colors, degree, self.terms).map(Colors::Harmonics),
            _ => {
                // Not `max`, as NaN must stay NaN.
                let seen = |c: f32| if c < 0.0 { 0.0 } else { c };
                let colors = self.colors.into_iter().map(|[r, g, b, a]| [seen(r), seen(g), seen(b), a]);
                Some(Colors::Linear(colors.collect()))
            }
        };
        points.flattened = flattened(self.ratios);
        points.thirds = points.flattened.map(|_| self.thirds);
    }
}

/// Adds the filter's variance to each standard deviation; returns the factor on the opacity.
fn widened(deviations: &mut [f64], filter: f64) -> f64 {
    let mut left = 1.0;
    for deviation in deviations {
        let wider = deviation.hypot(filter);
        // Without a filter, a deviation of 0 gives the factor 1 and not 0 / 0.
        left *= if filter == 0.0 { 1.0 } else { *deviation / wider };
        *deviation = wider;
    }
    left
}

/// Counts the ratios above [`FLAT`], and finds the median of all ratios. None if there are no
/// ratios.
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

/// Decides what the ellipsoids of a file are: surfels, or 3D Gaussians if too many are thick.
///
/// They become surfels anyway if `become_flat` is set. If `stay_solid` is not set, thick ones are
/// refused.
pub(super) fn settle(points: &mut Points, [become_flat, stay_solid]: [bool; 2]) -> Result<(), Fault> {
    let Some(Flattened { count, thick, ratio }) = points.flattened else { return Ok(()) };
    if become_flat || thick as f64 <= MOST_THICK * count as f64 {
        points.thirds = None;
        return Ok(());
    }
    if stay_solid {
        points.flattened = None;
        return Ok(());
    }
    Err(Fault::Malformed(format!(
        "{thick} of its {count} Gaussians are ellipsoids thicker than a tenth of their width (median: {ratio:.2}), \
         not surfels: use --flatten to leave their shortest axis out"
    )))
}
