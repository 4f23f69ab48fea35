//! Sums that add up from surfels to nodes and from children to parents. They are whole numbers, so
//! the order of additions does not show.

use glam::DVec3;
use rayon::prelude::*;

use super::lattice::Lattice;
use super::moments::Moments;
use crate::scene::color::srgb8;
use crate::scene::{Colors, Scene, Surfel};
use crate::surfels::eigen::Symmetric3;

/// Units for a normal's coordinate of 1; the sum of 2^32 normals fits an i64.
const NORMAL_ONE: f64 = (1u64 << 30) as f64;

/// Units for a product of 1 of two coordinates of a normal.
const PRODUCT_ONE: f64 = (1u64 << 30) as f64;

/// Units for the whole range of a colour component.
const COLOR_ONE: f64 = (1u64 << 30) as f64;

/// A mean of unit normals that is shorter than this has no direction.
const LEAST_MEAN: f64 = 1e-3;

/// Units for the longest half-axis; the sum of 2^32 products of two half-axes fits an i128.
const AXIS_ONE: f64 = (1u64 << 30) as f64;

/// Maps the attributes of surfels to whole numbers.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scales {
    /// The smallest premultiplied colour. `span` is the largest minus the smallest.
    low: [f64; 4],
    span: [f64; 4],
    /// Whether the colours of surfels are 8-bit codes. The colours of nodes are then rounded to
    /// such codes too.
    coded: bool,
    /// The longest half-axis, world units.
    longest: f64,
}

impl Scales {
    pub fn of(scene: &Scene) -> Self {
        let longest = scene.surfels.par_iter().map(Surfel::radius).reduce(|| 0.0, f32::max);
        Self::within(scene.color_range(), matches!(scene.colors, Colors::Srgb8(_)), longest)
    }

    /// The scales of surfels with this [range of colours](Scene::color_range) and this longest
    /// half-axis; `coded` if their colours are 8-bit codes.
    pub fn within((low, high): ([f32; 4], [f32; 4]), coded: bool, longest: f32) -> Self {
        let [low, high] = [low, high].map(|color| color.map(f64::from));
        Self { low, span: std::array::from_fn(|k| high[k] - low[k]), coded, longest: longest.into() }
    }

    fn units(&self, [r, g, b, a]: [f32; 4]) -> [i64; 4] {
        let premultiplied = [r * a, g * a, b * a, a].map(f64::from);
        std::array::from_fn(|k| {
            let part = if self.span[k] > 0.0 { (premultiplied[k] - self.low[k]) / self.span[k] } else { 0.0 };
            whole(part * COLOR_ONE)
        })
    }

    /// The linear colour with straight alpha for a mean of [`Self::units`].
    fn color(&self, units: [f64; 4]) -> [f32; 4] {
        let [r, g, b, a] = std::array::from_fn(|k| self.low[k] + self.span[k] * (units[k] / COLOR_ONE));
        let color = if a > 0.0 { [r / a, g / a, b / a, a].map(|value| value as f32) } else { [0.0; 4] };
        if self.coded { Colors::Srgb8(vec![srgb8(color)]).linear(0) } else { color }
    }
}

/// The sums over a set of surfels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Sums {
    pub moments: Moments,
    /// Sum of the unit normals.
    normal: [i64; 3],
    /// Sum of n nᵀ over the unit normals n: xx, yy, zz, xy, xz, yz.
    axial: [i64; 6],
    /// Sum of the premultiplied colours.
    color: [i64; 4],
    /// Sum of s sᵀ + t tᵀ over the half-axes: xx, yy, zz, xy, xz, yz.
    disks: [i128; 6],
}

/// Rounds `value`, of magnitude below 2^62, to a whole number. The error is at most half a unit or
/// hardly more; from 2^52 on it is up to one unit.
///
/// The standard library's rounding and its conversion to 128 bits are function calls rather than
/// instructions on many processors.
fn whole(value: f64) -> i64 {
    (value + 0.5f64.copysign(value)) as i64
}

/// The unit normal of a surfel's plane; the world's z axis if the half-axes span no plane.
pub(super) fn normal_of(surfel: &Surfel) -> DVec3 {
    let [s, t] = [surfel.s, surfel.t].map(|axis| DVec3::from_array(axis.map(f64::from)));
    s.cross(t).try_normalize().unwrap_or(DVec3::Z)
}

impl Sums {
    /// Sums the surfels of `scene` from index `first` on, whose centres are `places` on a lattice.
    pub fn of(places: &[[i32; 3]], scene: &Scene, first: usize, scale: &Scales) -> Self {
        let mut all = Self { moments: Moments::of(places.iter().copied()), ..Self::default() };
        let products = |v: DVec3| [v.x * v.x, v.y * v.y, v.z * v.z, v.x * v.y, v.x * v.z, v.y * v.z];
        for index in first..first + places.len() {
            let surfel = &scene.surfels[index];
            let n = normal_of(surfel);
            all.normal.iter_mut().zip(n.to_array()).for_each(|(sum, value)| *sum += whole(value * NORMAL_ONE));
            for axis in [surfel.s, surfel.t].map(|axis| DVec3::from_array(axis.map(f64::from))) {
                let part = if scale.longest > 0.0 { axis / scale.longest } else { DVec3::ZERO };
                let products = products(part * AXIS_ONE);
                all.disks.iter_mut().zip(products).for_each(|(sum, value)| *sum += i128::from(whole(value)));
            }
            all.axial.iter_mut().zip(products(n)).for_each(|(sum, value)| *sum += whole(value * PRODUCT_ONE));
            let color = scale.units(scene.colors.linear(index));
            all.color.iter_mut().zip(color).for_each(|(sum, value)| *sum += value);
        }
        all
    }

    pub fn add(&mut self, other: &Self) {
        self.moments.add(&other.moments);
        self.normal.iter_mut().zip(other.normal).for_each(|(sum, other)| *sum += other);
        self.axial.iter_mut().zip(other.axial).for_each(|(sum, other)| *sum += other);
        self.color.iter_mut().zip(other.color).for_each(|(sum, other)| *sum += other);
        self.disks.iter_mut().zip(other.disks).for_each(|(sum, other)| *sum += other);
    }

    /// The covariance of the centres about their mean (EQ 2), square world units.
    pub fn covariance_of_centers(&self, lattice: &Lattice) -> Symmetric3 {
        let step = 1.0 / lattice.steps;
        self.moments.covariance() * (step * step)
    }

    /// The covariance of the points of all disks about their mean, square world units: the
    /// covariance of the centres plus the mean over the disks of (s sᵀ + t tᵀ) / 4.
    pub fn covariance(&self, lattice: &Lattice, scale: &Scales) -> Symmetric3 {
        let unit = scale.longest / AXIS_ONE;
        let mean = unit * unit / (4.0 * self.moments.count as f64);
        let [xx, yy, zz, xy, xz, yz] = self.disks.map(|sum| sum as f64 * mean);
        self.covariance_of_centers(lattice) + Symmetric3 { xx, yy, zz, xy, xz, yz }
    }

    /// The unit normal, and whether it has a side.
    ///
    /// It is the direction of the mean normal. Where normals have no side or cancel, it is the axis
    /// nearest to all of them, which has no side.
    pub fn normal(&self, oriented: bool) -> (DVec3, bool) {
        let sum = DVec3::from_array(self.normal.map(|value| value as f64 / NORMAL_ONE));
        if oriented && sum.length() > LEAST_MEAN * self.moments.count as f64 {
            return (sum.normalize(), true);
        }
        let [xx, yy, zz, xy, xz, yz] = self.axial.map(|value| value as f64 / PRODUCT_ONE);
        let (_, [.., nearest]) = Symmetric3 { xx, yy, zz, xy, xz, yz }.eigen();
        (nearest, false)
    }

    /// How closely the normals align with `normal`, from 0 to 1 where all are parallel: the length
    /// of their mean, or the root mean square cosine if `normal` has no side.
    pub fn alignment(&self, (normal, sided): (DVec3, bool)) -> f64 {
        let count = self.moments.count as f64;
        if sided {
            return DVec3::from_array(self.normal.map(|value| value as f64 / NORMAL_ONE)).length() / count;
        }
        let [xx, yy, zz, xy, xz, yz] = self.axial.map(|value| value as f64 / PRODUCT_ONE);
        (normal.dot(Symmetric3 { xx, yy, zz, xy, xz, yz }.times(normal)) / count).max(0.0).sqrt()
    }

    /// The mean colour: linear, straight alpha.
    pub fn color(&self, scale: &Scales) -> [f32; 4] {
        scale.color(self.color.map(|sum| sum as f64 / self.moments.count as f64))
    }
}
