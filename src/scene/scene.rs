//! The scene: surfels around an origin, their colours, and which way is up.

use std::sync::Arc;

use glam::DVec3;
use rayon::prelude::*;

use super::{Cap, Clip, Colors, Fade, Hierarchy, Listed, Provenance, Surfel, Triangles, Whole};

/// The world axis that points up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Up {
    /// Most mesh formats.
    #[default]
    Y,
    /// Survey data.
    Z,
}

impl Up {
    /// The unit vector of the axis.
    pub fn axis(self) -> DVec3 {
        match self {
            Self::Y => DVec3::Y,
            Self::Z => DVec3::Z,
        }
    }

    /// `y` or `z`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Y => "y",
            Self::Z => "z",
        }
    }

    /// The unit vector that serves as up in a view along the axis.
    pub fn other(self) -> DVec3 {
        match self {
            Self::Y => DVec3::Z,
            Self::Z => DVec3::Y,
        }
    }
}

/// What is rendered, as every reader and generator delivers it.
///
/// Surfel i lies at `origin + surfels[i].center + low[i]`. Splitting a world coordinate into an f64 origin and an f32 offset
/// keeps georeferenced clouds free of jitter: offsets are as small as the scene, however far away its map origin is. Where they
/// are not small, as in a scene of two distant clusters, `low` has the digits that an f32 has no room for.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Scene {
    /// World coordinates of the point that surfel centres are relative to.
    pub origin: DVec3,
    /// The surfels, in world units relative to [`Scene::origin`].
    pub surfels: Vec<Surfel>,
    /// What the f32 centres leave out, world units: one for each surfel, or none at all where it is less than anybody sees.
    pub low: Vec<[f32; 3]>,
    /// Where disks end before their rims: one for each surfel, or none at all.
    pub clips: Vec<Clip>,
    /// How disks curve: one for each surfel, or none at all where all are flat.
    pub caps: Vec<Cap>,
    /// The unit normals that light sees, where they are others than those of the disks' planes: one for each surfel, or none at all.
    pub normals: Vec<[f32; 3]>,
    /// How much of each surfel there is: one for each, or none at all where all are whole.
    pub fades: Vec<Fade>,
    /// One colour for all, or one for each surfel in the same order.
    pub colors: Colors,
    /// They are codes of sRGB, as displays take them, instead of linear light, and are composited as they are: the surfels are Gaussians
    /// ([`gaussian`](super::gaussian)), or among some.
    pub encoded: bool,
    /// Normals were given, so they tell the two sides of a surface apart; estimated ones do not.
    pub oriented: bool,
    /// The surfels close their surfaces and face outward, so that their backs are seen from inside alone.
    pub closed: bool,
    /// Levels of detail of the surfels, which are in the order of the tree.
    pub hierarchy: Option<Arc<Hierarchy>>,
    /// Surfels and levels are a part of this: its bounds and ranges are those of the scene.
    pub part_of: Option<Box<Whole>>,
    /// Triangles beside the surfels.
    pub triangles: Triangles,
    /// The axis a camera without instructions takes as up.
    pub up: Up,
    /// Which points of which inputs the surfels are.
    pub provenance: Provenance,
}

/// Surfels that [`Scene::core`] looks at, at most.
const CORE_SAMPLE: usize = 4096;

/// One in so many of them may lie beyond each of its sides.
const CORE_CUT: usize = 64;

/// An axis-aligned box, world units; for a scene relative to [`Scene::origin`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Smallest coordinates, +inf when nothing is inside.
    pub min: DVec3,
    /// Largest coordinates, -inf when nothing is inside.
    pub max: DVec3,
}

impl Default for Bounds {
    fn default() -> Self {
        Self::EMPTY
    }
}

impl Bounds {
    /// The box around nothing.
    pub const EMPTY: Self = Self { min: DVec3::INFINITY, max: DVec3::NEG_INFINITY };

    /// Whether nothing is inside.
    pub fn is_empty(&self) -> bool {
        !self.min.cmple(self.max).all()
    }

    /// The middle; zero for the empty box.
    pub fn center(&self) -> DVec3 {
        if self.is_empty() { DVec3::ZERO } else { self.min + (self.max - self.min) * 0.5 }
    }

    /// The lengths of the edges; zero for the empty box.
    pub fn extent(&self) -> DVec3 {
        if self.is_empty() { DVec3::ZERO } else { self.max - self.min }
    }

    /// The smallest box that holds this one and `point`; a non-finite point changes nothing.
    pub fn with_point(self, point: DVec3) -> Self {
        if point.is_finite() { Self { min: self.min.min(point), max: self.max.max(point) } } else { self }
    }

    /// The smallest box of the finite ones of `points`.
    pub fn of(points: impl ParallelIterator<Item = DVec3>) -> Self {
        points.fold(|| Self::EMPTY, Self::with_point).reduce(|| Self::EMPTY, Self::union)
    }

    /// The smallest box that holds both.
    pub fn union(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }
}

impl Scene {
    /// The centre of surfel `index`, world units relative to [`Scene::origin`], with all its digits.
    pub fn center(&self, index: usize) -> DVec3 {
        let low = self.low.get(index).map_or(DVec3::ZERO, |low| DVec3::from_array(low.map(f64::from)));
        DVec3::from_array(self.surfels[index].center.map(f64::from)) + low
    }

    /// The surfels and the corners of triangles: how many places the scene has.
    pub(crate) fn places(&self) -> usize {
        self.surfels.len() + self.triangles.vertices().len()
    }

    /// A surfel's centre and radius, or past them a triangle's corner and the longest edge there; world units relative to [`Scene::origin`].
    pub(crate) fn place(&self, index: usize) -> (DVec3, f64) {
        match self.surfels.get(index) {
            Some(surfel) => (self.center(index), surfel.radius().into()),
            None => {
                let vertex = index - self.surfels.len();
                (self.triangles.place(vertex), self.triangles.reach(vertex))
            }
        }
    }

    /// The box of the surfel centres and the triangles' corners without those few that stray, world units relative to [`Scene::origin`], and how many
    /// do: a point strays that lies farther from the box of nearly all than sixteen times its longest edge.
    pub fn body(&self) -> (Bounds, u64) {
        if let Some(whole) = &self.part_of {
            return (whole.body, 0);
        }
        super::body(self.places(), |index| self.place(index).0)
    }

    /// The box of the centres and corners that the default view shows, world units relative to [`Scene::origin`], and how many it leaves out: those
    /// that [stray](Self::body), and groups of at most 16 points, and a thousandth of all, that lie farther than a quarter of the
    /// longest edge of the box of nearly all from that box and from all others.
    pub fn framed(&self) -> (Bounds, u64) {
        if let Some(whole) = &self.part_of {
            return (whole.framed, 0);
        }
        super::framed(&Listed(self.places(), |index| self.place(index)))
    }

    /// The box of the finite surfel centres and of the triangles' corners, world units relative to [`Scene::origin`]; disks reach past it by up to
    /// [`Scene::largest_radius`].
    pub fn bounds(&self) -> Bounds {
        if let Some(whole) = &self.part_of {
            return whole.bounds;
        }
        Bounds::of((0..self.places()).into_par_iter().with_min_len(4096).map(|index| self.place(index).0))
    }

    /// A box of nearly all finite surfel centres, or of all corners where there are only triangles, in the same space: those few that lie far from all others, as scanners' stray
    /// points do, do not widen it. Of a sample, the same each time.
    pub fn core(&self) -> Bounds {
        if let Some(whole) = &self.part_of {
            return whole.core;
        }
        let step = core_step(self.surfels.len());
        core_of(self.surfels.iter().step_by(step).map(|surfel| surfel.center)).unwrap_or_else(|| self.bounds())
    }

    /// Smallest and largest premultiplied linear colour `(r a, g a, b a, a)` of the scene, each component on its own,
    /// every product rounded to f32 once. Of harmonics the range that no view exceeds. The same for any order of surfels; zero for a
    /// scene without surfels.
    pub fn color_range(&self) -> ([f32; 4], [f32; 4]) {
        if let Some(whole) = &self.part_of {
            return whole.color;
        }
        if self.surfels.is_empty() {
            return ([0.0; 4], [0.0; 4]);
        }
        // Adding +0 makes the two zeros one, or their order would show in the sign bit of the result.
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

    /// The largest [`Surfel::shorter`], world units; zero for a scene without surfels.
    pub fn largest_shorter(&self) -> f32 {
        if let Some(whole) = &self.part_of {
            return whole.largest_shorter;
        }
        self.surfels.par_iter().map(Surfel::shorter).reduce(|| 0.0, f32::max)
    }

    /// The largest [`Surfel::radius`] with the height of its cap, world units: no point of a surfel is farther from its centre. Zero for
    /// a scene without surfels.
    pub fn largest_radius(&self) -> f32 {
        if let Some(whole) = &self.part_of {
            return whole.largest_radius;
        }
        let height = |index: usize| self.caps.get(index).map_or(0.0, |cap| cap.highest() as f32);
        let reach = |(index, surfel): (usize, &Surfel)| surfel.radius() + height(index);
        self.surfels.par_iter().enumerate().map(reach).reduce(|| 0.0, f32::max)
    }
}

/// How many surfels of `count` are passed over for each that [`Scene::core`] looks at, and that one.
pub(crate) fn core_step(count: usize) -> usize {
    count.div_ceil(CORE_SAMPLE).max(1)
}

/// The box of nearly all of the finite ones of some centres; None if it has no extent.
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
        // An even distribution reaches past both by as much.
        let margin = (high - low) / (CORE_CUT - 2) as f64;
        (core.min[axis], core.max[axis]) = (low - margin, high + margin);
    }
    (core.extent() != DVec3::ZERO).then_some(core)
}

/// A centre whose rounding to f32 is less than this part of its disk's shorter half-axis is as good as any.
const LEAST_PART: f64 = 1.0 / 256.0;

/// Whether a centre's `error`, world units, may show at the size of its disk.
pub(crate) fn shows(surfel: &Surfel, error: f64) -> bool {
    let [s, t] = [surfel.s, surfel.t].map(|axis| DVec3::from_array(axis.map(f64::from)).length());
    error > LEAST_PART * s.min(t)
}

/// [`Scene::low`] of `surfels`, whose centres are `center` with all their digits: nothing where f32 serves for all of them. An
/// f32 serves for a scene 5,000,000 times as wide as its smallest disks.
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
