//! The scene: surfels around an origin, their attributes, and the up axis.

use std::sync::Arc;

use glam::DVec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::{Cap, Clip, Colors, Fade, Hierarchy, Listed, Provenance, Surfel, Triangles, Whole};

/// The world axis that points up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Up {
    /// The up axis of most mesh formats.
    #[default]
    Y,
    /// The up axis of survey data.
    Z,
}

impl Up {
    /// The axis as a unit vector.
    pub fn axis(self) -> DVec3 {
        match self {
            Self::Y => DVec3::Y,
            Self::Z => DVec3::Z,
        }
    }

    /// The axis's name, `y` or `z`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Y => "y",
            Self::Z => "z",
        }
    }

    /// The unit vector that replaces the axis as up in a view along the axis.
    pub fn other(self) -> DVec3 {
        match self {
            Self::Y => DVec3::Z,
            Self::Z => DVec3::Y,
        }
    }
}

/// The scene to render, as every reader and generator delivers it.
///
/// Surfel i lies at `origin + surfels[i].center + low[i]`. An f64 origin with f32 offsets keeps
/// georeferenced clouds free of jitter: offsets are as small as the scene, however far away the
/// origin of its map is. Where offsets are large, as in a scene of two distant clusters, `low`
/// holds the digits beyond f32.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Scene {
    /// The origin of the surfel centres, world coordinates.
    pub origin: DVec3,
    /// The surfels, in world units relative to [`Scene::origin`].
    pub surfels: Vec<Surfel>,
    /// The part of each centre beyond f32, world units; empty if it is invisibly small for all
    /// surfels.
    pub low: Vec<[f32; 3]>,
    /// The clip lines of each disk; empty if none is clipped.
    pub clips: Vec<Clip>,
    /// The curvature of each disk; empty if all are flat.
    pub caps: Vec<Cap>,
    /// The third half-axis of each surfel, perpendicular to the two others, world units: the
    /// surfels are 3D Gaussians. Empty if there are none.
    pub thirds: Vec<f32>,
    /// The unit normal of each surfel for shading; empty if these are the normals of the disks'
    /// planes.
    pub normals: Vec<[f32; 3]>,
    /// The fade of each surfel between levels of detail; empty if all are whole.
    pub fades: Vec<Fade>,
    /// One colour for all surfels, or one for each.
    pub colors: Colors,
    /// Whether colours are sRGB codes that are composited as they are, instead of linear light. It
    /// is set if there are Gaussian surfels ([`gaussian`](super::gaussian)).
    pub encoded: bool,
    /// Whether normals were given and thus tell the two sides of a surface apart. Estimated normals
    /// do not.
    pub oriented: bool,
    /// Whether the surfels form closed surfaces and face outward, so that backs are visible only
    /// from inside.
    pub closed: bool,
    /// The levels of detail; the surfels are in the order of this tree.
    pub hierarchy: Option<Arc<Hierarchy>>,
    /// The facts about the whole scene if this is only a part; bounds and ranges are then those of
    /// the whole.
    pub part_of: Option<Box<Whole>>,
    /// Triangles beside the surfels.
    pub triangles: Triangles,
    /// The up axis of cameras that have none of their own.
    pub up: Up,
    /// The input and point that each surfel comes from.
    pub provenance: Provenance,
}

/// The most surfels that [`Scene::core`] samples.
const CORE_SAMPLE: usize = 4096;

/// One in this many sampled surfels may lie beyond each side of the core.
const CORE_CUT: usize = 64;

/// An axis-aligned box in world units; a scene's is relative to [`Scene::origin`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Bounds {
    /// Smallest coordinates, +inf for the empty box.
    pub min: DVec3,
    /// Largest coordinates, -inf for the empty box.
    pub max: DVec3,
}

impl Default for Bounds {
    fn default() -> Self {
        Self::EMPTY
    }
}

impl Bounds {
    /// The empty box.
    pub const EMPTY: Self = Self { min: DVec3::INFINITY, max: DVec3::NEG_INFINITY };

    /// Whether the box is empty.
    pub fn is_empty(&self) -> bool {
        !self.min.cmple(self.max).all()
    }

    /// The centre; zero for the empty box.
    pub fn center(&self) -> DVec3 {
        if self.is_empty() { DVec3::ZERO } else { self.min + (self.max - self.min) * 0.5 }
    }

    /// The edge lengths; zero for the empty box.
    pub fn extent(&self) -> DVec3 {
        if self.is_empty() { DVec3::ZERO } else { self.max - self.min }
    }

    /// The smallest box that holds this one and `point`. A point that is not finite changes
    /// nothing.
    pub fn with_point(self, point: DVec3) -> Self {
        if point.is_finite() { Self { min: self.min.min(point), max: self.max.max(point) } } else { self }
    }

    /// The bounding box of those `points` that are finite.
    pub fn of(points: impl ParallelIterator<Item = DVec3>) -> Self {
        points.fold(|| Self::EMPTY, Self::with_point).reduce(|| Self::EMPTY, Self::union)
    }

    /// The smallest box that holds both boxes.
    pub fn union(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }
}

impl Scene {
    /// The centre of surfel `index` with all its digits, world units relative to [`Scene::origin`].
    pub fn center(&self, index: usize) -> DVec3 {
        let low = self.low.get(index).map_or(DVec3::ZERO, |low| DVec3::from_array(low.map(f64::from)));
        DVec3::from_array(self.surfels[index].center.map(f64::from)) + low
    }

    /// The number of surfels and triangle vertices together.
    pub(crate) fn places(&self) -> usize {
        self.surfels.len() + self.triangles.vertices().len()
    }

    /// The position and size at `index`: centre and radius of a surfel or, after all surfels, a
    /// triangle vertex and the longest edge at it. World units relative to [`Scene::origin`].
    pub(crate) fn place(&self, index: usize) -> (DVec3, f64) {
        match self.surfels.get(index) {
            Some(surfel) => (self.center(index), surfel.radius().into()),
            None => {
                let vertex = index - self.surfels.len();
                (self.triangles.place(vertex), self.triangles.reach(vertex))
            }
        }
    }

    /// The box of surfel centres and triangle vertices without strays, and the number of strays.
    ///
    /// The box is in world units relative to [`Scene::origin`]. A stray lies farther from the box
    /// of nearly all points than sixteen times that box's longest edge. For a part of a scene the
    /// number is 0.
    pub fn body(&self) -> (Bounds, u64) {
        if let Some(whole) = &self.part_of {
            return (whole.body, 0);
        }
        super::body(self.places(), |index| self.place(index).0)
    }

    /// The box of the centres and vertices that the default view shows, and the number of points
    /// outside it.
    ///
    /// The box is in world units relative to [`Scene::origin`]. It leaves out [strays](Self::body)
    /// and small separate groups. A group is small if it has at most 16 points and at most a
    /// thousandth of all points. It is separate if it lies farther from the box of nearly all
    /// points, and from all other groups, than a quarter of that box's longest edge. For a part of
    /// a scene the number is 0.
    pub fn framed(&self) -> (Bounds, u64) {
        if let Some(whole) = &self.part_of {
            return (whole.framed, 0);
        }
        super::framed(&Listed(self.places(), |index| self.place(index)))
    }

    /// The box of the finite surfel centres and triangle vertices, world units relative to
    /// [`Scene::origin`]. Disks extend past it by up to [`Scene::largest_radius`].
    pub fn bounds(&self) -> Bounds {
        if let Some(whole) = &self.part_of {
            return whole.bounds;
        }
        Bounds::of((0..self.places()).into_par_iter().with_min_len(4096).map(|index| self.place(index).0))
    }

    /// The box of nearly all finite surfel centres, or of all vertices if there are only triangles.
    ///
    /// A few points far from all others, such as a scanner's strays, do not widen it. It is
    /// computed from a sample of fixed stride, world units relative to [`Scene::origin`].
    pub fn core(&self) -> Bounds {
        if let Some(whole) = &self.part_of {
            return whole.core;
        }
        let step = core_step(self.surfels.len());
        core_of(self.surfels.iter().step_by(step).map(|surfel| surfel.center)).unwrap_or_else(|| self.bounds())
    }

    /// The smallest and largest premultiplied linear colours `(r a, g a, b a, a)`, component by
    /// component.
    ///
    /// Every product is rounded to f32 once, so the range is the same for any order of surfels. For
    /// harmonics it bounds the colours of all views. Zero for a scene without surfels.
    pub fn color_range(&self) -> ([f32; 4], [f32; 4]) {
        if let Some(whole) = &self.part_of {
            return whole.color;
        }
        if self.surfels.is_empty() {
            return ([0.0; 4], [0.0; 4]);
        }
        // Adding +0 turns -0 into +0, or the order of surfels would determine the sign bit.
        let premultiplied = |[r, g, b, a]: [f32; 4]| [r * a + 0.0, g * a + 0.0, b * a + 0.0, a + 0.0];
        if let Colors::Constant(color) = self.colors {
            let color = premultiplied(color);
            return (color, color);
        }
        let nothing = || ([f32::INFINITY; 4], [f32::NEG_INFINITY; 4]);
        let count = match &self.colors {
            Colors::Constant(_) => 0,
            Colors::Srgb8(codes) => codes.len(),
            Colors::Linear(colors) => colors.len(),
            Colors::Textured(textured) => textured.colors().len(),
            Colors::Harmonics(harmonics) => harmonics.colors().len(),
        };
        let merge = |(low, high): ([f32; 4], [f32; 4]), (other_low, other_high): ([f32; 4], [f32; 4])| {
            let low = std::array::from_fn(|i| f32::min(low[i], other_low[i]));
            let high = std::array::from_fn(|i| f32::max(high[i], other_high[i]));
            (low, high)
        };
        (0..count)
            .into_par_iter()
            .fold(nothing, |range, index| match &self.colors {
                Colors::Harmonics(harmonics) => {
                    let high = premultiplied(harmonics.most(index));
                    merge(range, ([0.0, 0.0, 0.0, high[3]], high))
                }
                colors => {
                    let color = premultiplied(colors.linear(index));
                    merge(range, (color, color))
                }
            })
            .reduce(nothing, merge)
    }

    /// The largest [`Surfel::shorter`], world units; zero without surfels.
    pub fn largest_shorter(&self) -> f32 {
        if let Some(whole) = &self.part_of {
            return whole.largest_shorter;
        }
        self.surfels.par_iter().map(Surfel::shorter).reduce(|| 0.0, f32::max)
    }

    /// The largest sum of [`Surfel::radius`] and the height of the cap, world units; zero without
    /// surfels. No point of a surfel is farther from its centre.
    pub fn largest_radius(&self) -> f32 {
        if let Some(whole) = &self.part_of {
            return whole.largest_radius;
        }
        let height = |index: usize| self.caps.get(index).map_or(0.0, |cap| cap.highest() as f32);
        let reach = |(index, surfel): (usize, &Surfel)| surfel.radius() + height(index);
        self.surfels.par_iter().enumerate().map(reach).reduce(|| 0.0, f32::max)
    }
}

/// The stride at which [`Scene::core`] samples `count` surfels.
pub(crate) fn core_step(count: usize) -> usize {
    count.div_ceil(CORE_SAMPLE).max(1)
}

/// The box of nearly all finite `centers`; None if it has no extent.
pub(crate) fn core_of(centers: impl Iterator<Item = [f32; 3]>) -> Option<Bounds> {
    let sampled: Vec<_> = centers.filter(|center| center.iter().all(|x| x.is_finite())).collect();
    if sampled.is_empty() {
        return None;
    }
    let mut core = Bounds::EMPTY;
    for axis in 0..3 {
        let mut along: Vec<f32> = sampled.iter().map(|center| center[axis]).collect();
        along.sort_unstable_by(f32::total_cmp);
        let cut = along.len() / CORE_CUT;
        let (low, high) = (f64::from(along[cut]), f64::from(along[along.len() - 1 - cut]));
        // A uniform distribution extends past each quantile by this margin.
        let margin = (high - low) / (CORE_CUT - 2) as f64;
        (core.min[axis], core.max[axis]) = (low - margin, high + margin);
    }
    (core.extent() != DVec3::ZERO).then_some(core)
}

/// A centre's rounding error below this fraction of its disk's shorter half-axis is invisible.
const LEAST_PART: f64 = 1.0 / 256.0;

/// Whether an error of the centre, world units, may be visible at the size of its disk.
pub(crate) fn shows(surfel: &Surfel, error: f64) -> bool {
    let [s, t] = [surfel.s, surfel.t].map(|axis| DVec3::from_array(axis.map(f64::from)).length());
    error > LEAST_PART * s.min(t)
}

/// [`Scene::low`] for `surfels` whose exact centres are `center`; empty if f32 centres suffice for
/// all.
///
/// f32 centres suffice for a scene up to 5,000,000 times as wide as its smallest disks.
pub(crate) fn low_parts(surfels: &[Surfel], center: impl Fn(usize) -> DVec3 + Sync) -> Vec<[f32; 3]> {
    let low_of = |index: usize| center(index) - DVec3::from_array(surfels[index].center.map(f64::from));
    if !(0..surfels.len()).into_par_iter().any(|index| shows(&surfels[index], low_of(index).abs().max_element())) {
        return Vec::new();
    }
    (0..surfels.len()).into_par_iter().map(|index| low_of(index).as_vec3().to_array()).collect()
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    fn scene(colors: Colors) -> Scene {
        let surfels = (0..1000)
            .map(|i| Surfel::disk(Vec3::new(i as f32, -(i as f32), 0.5), Vec3::Z, 0.25 + (i == 700) as u8 as f32))
            .collect();
        Scene {
            origin: DVec3::new(6e6, 0.0, 0.0),
            surfels,
            low: vec![],
            colors,
            oriented: true,
            up: Up::Z,
            ..Scene::default()
        }
    }

    #[test]
    fn bounds_are_relative_to_the_origin_and_skip_what_is_not_finite() {
        let mut scene = scene(Colors::Constant([1.0; 4]));
        scene.surfels[3].center[1] = f32::NAN;
        let bounds = scene.bounds();
        assert_eq!(bounds.min, DVec3::new(0.0, -999.0, 0.5));
        assert_eq!(bounds.max, DVec3::new(999.0, 0.0, 0.5));
        assert_eq!(bounds.center(), DVec3::new(499.5, -499.5, 0.5));
        scene.surfels.clear();
        assert!(scene.bounds().is_empty());
        assert_eq!(scene.bounds().extent(), DVec3::ZERO);
    }

    #[test]
    fn a_few_far_centres_do_not_widen_the_core() {
        let mut scene = scene(Colors::Constant([1.0; 4]));
        let (core, bounds) = (scene.core(), scene.bounds());
        assert!((core.min - bounds.min).abs().max_element() < 2.0, "{core:?} {bounds:?}");
        assert!((core.max - bounds.max).abs().max_element() < 2.0, "{core:?} {bounds:?}");
        for (index, far) in [(3, f32::NAN), (4, 1e9), (5, -1e30), (700, 1e9)] {
            scene.surfels[index].center = [far; 3];
        }
        let moved = scene.core();
        assert!((moved.min - core.min).abs().max_element() < 5.0, "{moved:?}");
        assert!((moved.max - core.max).abs().max_element() < 5.0, "{moved:?}");
        scene.surfels.iter_mut().for_each(|surfel| surfel.center = [2.0; 3]);
        assert_eq!(scene.core(), scene.bounds());
        scene.surfels[1].center = [9.0; 3];
        assert_eq!(scene.core(), scene.bounds());
        scene.surfels.clear();
        assert!(scene.core().is_empty());
    }

    #[test]
    fn largest_radius_is_the_longest_half_axis() {
        assert!((scene(Colors::Constant([1.0; 4])).largest_radius() - 1.25).abs() < 1e-6);
    }

    #[test]
    fn color_range_is_premultiplied() {
        let mut colors = vec![[0.5, 0.5, 0.5, 1.0]; 1000];
        colors[10] = [8.0, 2.0, -3.0, 0.5];
        let (low, high) = scene(Colors::Linear(colors)).color_range();
        assert_eq!(low, [0.5, 0.5, -1.5, 0.5]);
        assert_eq!(high, [4.0, 1.0, 0.5, 1.0]);
        let constant = scene(Colors::Constant([1.0, 2.0, 4.0, 0.5])).color_range();
        assert_eq!(constant, ([0.5, 1.0, 2.0, 0.5], [0.5, 1.0, 2.0, 0.5]));
    }
}
