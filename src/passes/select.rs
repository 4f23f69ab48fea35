//! Stage 0 with levels of detail: chooses the cut, which is drawn in place of all surfels (Pajarola
//! 2003, section 5.1, step 1).
//!
//! The tree is walked from the root down. A node is skipped if it is out of view or, with back-face
//! culling, if everything below it faces away. A node that appears smaller than the requested size
//! is drawn. With culling, its own plane must also face the viewer: otherwise the node would be
//! culled although surfels below it may be visible. Any other leaf is replaced by its surfels, any
//! other node by its children. The cut depends only on the tree, the camera and [`Wanted`], the
//! options of the cut.
//!
//! With culling, surfels that face away are left out of the cut too. Those that face away by less
//! than rounding errors are kept; pass [`project`](super::project) leaves them out.
//!
//! With fades, the cuts of [`STEPS`] sizes, from half the requested size up, are drawn at once. A
//! node or surfel belongs to the cuts of its [`Fade`](crate::scene::Fade), which follows from its
//! size and the sizes of the nodes above it. When a node's size passes one of the `STEPS` sizes,
//! its weight changes by only `1 / STEPS`. No cut draws a node larger than the requested size.
//!
//! On a device the tree is stored as [`branches`](super::branches), which are processed one after
//! the other. Pages then read the chosen surfels and nodes from the branch, so no later pass
//! depends on trees.

use glam::{DVec2, DVec3};

use super::cull;
use super::lowpass::Design;
use crate::plan::Settings;
use crate::plan::pass::Pass;
use crate::plan::steps::{Kernel, Over, Run};
use crate::scene::cut::Fate;
use crate::scene::detail::finest;
use crate::scene::fade::STEPS;
use crate::scene::hierarchy::{FAN_OUT, Node};
use crate::scene::{Camera, Cull, Cut, Detail, DetailMeasure, Hierarchy, Projection, Scene};

/// The pass's files and constants. Its kernels are [`CHOOSING`].
pub const PASS: Pass = Pass {
    name: "select",
    files: |needs| {
        let low = if needs.doubled { "low_part.wgsl" } else { "low_part_absent.wgsl" };
        let fades = if needs.fades { "select_fades.wgsl" } else { "select_fades_absent.wgsl" };
        let backs = if needs.curved { "backs_curved.wgsl" } else { "backs_flat.wgsl" };
        if needs.levels {
            vec!["select.wgsl", "judge.wgsl", backs, "balls_cut.wgsl", fades, low]
        } else {
            vec!["select_absent.wgsl"]
        }
    },
    kernels: |_| Vec::new(),
    constants: |making| match making.needs.levels {
        true => {
            let is = |measure: DetailMeasure| u32::from(making.options.detail_measure == measure).into();
            let cones = making.needs.cull_back || making.options.cull == Cull::Cones;
            vec![
                ("MEASURES_EXTENT", is(DetailMeasure::Extent)),
                ("MEASURES_SQUARE", is(DetailMeasure::Square)),
                ("CULL_CONES", u32::from(cones).into()),
            ]
        }
        false => Vec::new(),
    },
};

const SELECT_TOP: Kernel = Kernel::new("select_top");
const SELECT_JUDGE: Kernel = Kernel::new("select_judge");
const SELECT_SUM: Kernel = Kernel::new("select_sum");
const SELECT_SPREAD: Kernel = Kernel::new("select_spread");

/// The kernels that choose the cut. Later steps depend on its size, so these kernels are compiled
/// before all others.
pub const CHOOSING: [Kernel; 4] = [SELECT_TOP, SELECT_JUDGE, SELECT_SUM, SELECT_SPREAD];

/// The dispatches that choose the cut of a branch: one for the small levels, which one workgroup
/// judges, and three for each of its `large_levels`.
pub fn choose(large_levels: u32) -> Vec<Run> {
    let level = [
        Run { kernel: SELECT_JUDGE, over: Over::Judged },
        Run { kernel: SELECT_SUM, over: Over::Once },
        Run { kernel: SELECT_SPREAD, over: Over::Spread },
    ];
    let mut runs = vec![Run { kernel: SELECT_TOP, over: Over::Once }];
    runs.extend((0..large_levels).flat_map(|_| level));
    runs
}

/// The options of a cut.
#[derive(Clone, Copy, Debug)]
pub struct Wanted {
    /// The size in the image. A node that appears smaller is drawn in place of its children or
    /// surfels.
    pub detail: Detail,
    /// How the size of a node is measured.
    pub measure: DetailMeasure,
    /// Whether nodes are left out if everything below them faces away.
    pub cones: bool,
    /// Whether surfels that face away are left out too.
    pub backs_out: bool,
    /// Whether the curvature of surfels is drawn.
    pub caps: bool,
    /// Whether coarser and finer cuts fade into each other.
    pub fades: bool,
    /// How far outside the image, in pixels, a node is still drawn: the reach of the low-pass
    /// ([`cull::filter_reach`]) plus two samples.
    pub margin: DVec2,
}

impl Wanted {
    /// The cut of a picture with `options`; `backs_out` says whether backs are left out.
    pub fn of(options: &Settings, backs_out: bool) -> Self {
        let samples = DVec2::new(options.samples.across.into(), options.samples.down.into());
        let margin = (cull::filter_reach(&Design::of(options)) + 2.0) / samples;
        let Settings { detail, detail_measure: measure, detail_fades: fades, .. } = *options;
        let cones = backs_out || options.cull == Cull::Cones;
        Self { detail, measure, cones, backs_out, caps: options.draws_caps(), fades, margin }
    }
}

/// Converts a requested number of splats to a node size in square pixels for the view of the
/// image's `camera`. Returns any other request as it is.
///
/// A smaller size draws more splats, with few exceptions: a node at the image's edge may be divided
/// into children that are mostly out of view. So a search by powers of two, then by bisection,
/// finds a size that draws at most the requested number, and hardly fewer. Nodes that reach the
/// near depth are divided at any size, so even the coarsest cut may draw more than requested.
/// Single surfels that face away count, as they may not be in memory yet. With
/// fades, some sizes may draw more splats than there are surfels. If the request allows the
/// smallest size, that size is returned without a search.
pub fn sized(hierarchy: &Hierarchy, origin: DVec3, camera: &Camera, wanted: &Wanted) -> Detail {
    let Detail::Splats(splats) = wanted.detail else { return wanted.detail };
    let fits_at = |size: f64| {
        let wanted = Wanted { detail: Detail::Pixels(size), ..*wanted };
        bounded(hierarchy, (origin, camera), &wanted, splats, |_| false).is_some()
    };
    // The size found is just above the size of some node, which a device may round to the other
    // side of it. The returned size is therefore slightly larger, and it must fit too.
    let fits = |size: f64| fits_at(size) && fits_at(size * SIZE_SLACK);
    let size = if wanted.fades && fits(SMALLEST) { SMALLEST } else { finest(fits) };
    Detail::Pixels(size * SIZE_SLACK)
}

/// A size in square pixels that is smaller than any node's.
const SMALLEST: f64 = 1e-30;

/// The factor by which a device may err in the size of a node.
const SIZE_SLACK: f64 = 1.0 + 1e-5;

/// A device's error in a ball's position and radius, relative to the ball's distance.
const BALL_ROUNDING: f64 = 1e-6;

/// A device's error in a sine.
const SINE_SLACK: f64 = 1e-5;

/// The cut of `scene`, whose tree is `hierarchy`, in the view of `camera`.
pub fn reference(scene: &Scene, hierarchy: &Hierarchy, camera: &Camera, wanted: &Wanted) -> Cut {
    let away = |index: u32| wanted.backs_out && shows_back(scene, index as usize, camera, wanted.caps);
    bounded(hierarchy, (scene.origin, camera), wanted, u64::MAX, away).unwrap_or_default()
}

/// The cut without the surfels that are `away`; `None` if it has more than `most` surfels and
/// nodes. Node positions are relative to the origin in `at`.
fn bounded(
    hierarchy: &Hierarchy,
    at: (DVec3, &Camera),
    wanted: &Wanted,
    most: u64,
    away: impl Fn(u32) -> bool,
) -> Option<Cut> {
    let fate = |index: u32| fate(&hierarchy.nodes[index as usize], hierarchy.low(index), at, wanted, 0.0);
    // Crowded leaves, whose surfels coincide, keep all of them.
    let few = |leaf: &Node| leaf.count as usize <= FAN_OUT;
    Cut::of(hierarchy, most, fate, |leaf, surfel| few(leaf) && away(surfel))
}

/// Whether no pixel can show the front of a surfel, by more than a device's error. If `caps` is
/// set, surfels may curve ([`Curve::faces_away`](super::curved::Curve::faces_away)).
fn shows_back(scene: &Scene, index: usize, camera: &Camera, caps: bool) -> bool {
    let [s, t] = [scene.surfels[index].s, scene.surfels[index].t].map(|axis| DVec3::from_array(axis.map(f64::from)));
    let relative = scene.center(index) - (camera.eye - scene.origin);
    let (ray, closeness) = match camera.projection {
        Projection::Pinhole => (relative.normalize_or_zero(), relative.length().recip()),
        Projection::Orthographic => (camera.rotation.row(2), 0.0),
    };
    let across = s.cross(t);
    let (size, n) = (across.length(), across.normalize_or_zero());
    let cap = scene.caps.get(index).copied().filter(|_| caps).unwrap_or_default();
    let [uu, uv, vv] = cap.0.map(|height| f64::from(height).abs());
    let high = (cap.extremes()[1] * closeness).min(1.0);
    let lean = cap.slope(ray.dot(t.cross(n)), ray.dot(n.cross(s))).length() + size * high;
    let magnitude = s.length() * t.length() + (uu + 2.0 * uv + vv) * (s.length() + t.length());
    ray.dot(across) - lean > SINE_SLACK * magnitude
}

/// Whether a render may need the children or surfels of a node: whether the twin, or a device
/// within its error, may divide the node in some of the wanted cuts.
///
/// The tree's positions are relative to the origin in `at`. `low` is the part of the node's centre
/// that f32 leaves out.
pub fn may_divide(node: &Node, low: DVec3, at: (DVec3, &Camera), wanted: &Wanted) -> bool {
    // A leaf of one surfel is always drawn as that surfel.
    matches!(fate(node, low, at, wanted, 1.0), Fate::Divided(cuts) if cuts > 0 || (node.leaf && node.count == 1))
}

/// Decides whether a node is unseen, drawn or divided.
///
/// `slack` is a tolerance in units of the device's error: with it, nodes that are nearly in view
/// count as in view, and nodes that are nearly divided count as divided.
fn fate(node: &Node, low: DVec3, (origin, camera): (DVec3, &Camera), wanted: &Wanted, slack: f64) -> Fate {
    let Wanted { detail, measure, cones, backs_out, fades, margin, .. } = *wanted;
    let size = detail.pixels(camera.pixels() as f64);
    let center = DVec3::from_array(node.surfel.center.map(f64::from)) + low - (camera.eye - origin);
    let radius = f64::from(node.radius) + (1.0 + slack) * BALL_ROUNDING * center.length();
    let at = camera.rotation * center;
    let [turned, spread] = if cones { turned_away(node, (center, radius), camera) } else { [-1.0, 0.0] };
    let outside = at.z + radius < camera.near || camera.is_beside_image(at, radius, margin * (1.0 + slack));
    if outside || turned > spread + (1.0 + slack) * SINE_SLACK {
        return Fate::Unseen;
    }
    // The image of a node that reaches the near depth has no meaningful size.
    let near = at.z - radius <= camera.near;
    let seen = if near { f64::INFINITY } else { measure.of(node, center, camera) };
    let seen = seen * (1.0 + slack * (SIZE_SLACK - 1.0));
    // A node whose plane faces away would be culled even if surfels below it are visible, so it is
    // divided.
    if !backs_out || turned <= -slack * SINE_SLACK { Fate::Divided(divided(seen, size, fades)) } else { Fate::DIVIDED }
}

/// The number of cuts that divide a node of apparent size `seen`, where the requested size is
/// `size`. If only some cuts divide it, these are the finest ones.
///
/// Without fades there is one cut, which counts as all [`STEPS`].
fn divided(seen: f64, size: f64, fades: bool) -> u8 {
    let steps = f64::from(STEPS);
    match fades {
        // Tested first, as `size` may be 0.
        true if seen >= size => STEPS,
        true => (steps * (2.0 * seen / size - 1.0) + 1.0).floor().clamp(0.0, steps) as u8,
        false if seen < size => 0,
        false => STEPS,
    }
}

/// Two sines: by how much a node's normal points away from the eye, and the limit above which
/// everything below the node faces away, wherever in the node's ball it lies (specification S12).
///
/// The limit is the sine of the sum of the cone's angle and the ball's half-angle, if that sum is
/// less than a right angle; else 1.
fn turned_away(node: &Node, (center, radius): (DVec3, f64), camera: &Camera) -> [f64; 2] {
    let (toward, ball) = match camera.projection {
        Projection::Pinhole => {
            let distance = center.length();
            (-center / distance, (radius / distance).min(1.0))
        }
        Projection::Orthographic => (-camera.rotation.row(2), 0.0),
    };
    // Cosine and sine of each angle (the ball's at most a right angle), and of their sum.
    let across = |one: f64| (1.0 - one * one).sqrt();
    let cone = f64::from(node.cone).clamp(-1.0, 1.0);
    let cone = DVec2::new(cone, across(cone));
    let spread = cone.rotate(DVec2::new(across(ball), ball));
    let [s, t] = [node.surfel.s, node.surfel.t].map(|axis| DVec3::from_array(axis.map(f64::from)));
    [-toward.dot(s.cross(t).normalize_or_zero()), if spread.x > 0.0 { spread.y } else { 1.0 }]
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use glam::Vec3;

    use super::*;
    use crate::scene::{Cap, Colors, Fade, Lens, Scene, Surfel, Up};
    use crate::surfels::analytic::{Shape, generate};
    use crate::surfels::hierarchy;

    fn sphere() -> (Scene, std::sync::Arc<Hierarchy>) {
        let surfel = |position: [f64; 3]| {
            Surfel::disk(DVec3::from_array(position).as_vec3(), DVec3::from_array(position).as_vec3(), 0.03)
        };
        let surfels: Vec<Surfel> = generate(Shape::Sphere, 8000).map(|sample| surfel(sample.position)).collect();
        let colors = Colors::Srgb8((0..8000).map(|k| [k as u8, 9, 80, 255]).collect());
        hierarchy::build(Scene { surfels, colors, oriented: true, ..Scene::default() }, &()).unwrap()
    }

    fn camera(eye: DVec3, lens: Lens) -> Camera {
        Camera::look_at((300, 300), lens, eye, DVec3::ZERO, None, Up::Y, 1e-3).unwrap()
    }

    fn wanted(detail: Detail, measure: DetailMeasure, backs_out: bool) -> Wanted {
        let options = Settings { detail, detail_measure: measure, ..Settings::default() };
        Wanted::of(&options, backs_out)
    }

    /// The surfels below a node.
    fn below(tree: &Hierarchy, index: u32) -> Vec<u32> {
        let Node { first, count, leaf, .. } = tree.nodes[index as usize];
        if leaf {
            (first..first + count).collect()
        } else {
            (first..first + count).flat_map(|child| below(tree, child)).collect()
        }
    }

    #[test]
    fn every_surfel_in_view_is_drawn_or_stood_for_once() {
        let (scene, tree) = sphere();
        for (eye, lens) in
            [(DVec3::new(0.0, 0.7, 3.0), Lens::Fov(50.0)), (DVec3::new(0.0, 0.7, 3.0), Lens::OrthographicHeight(2.4))]
        {
            let camera = camera(eye, lens);
            let mut last = usize::MAX;
            for size in [0.0, 250.0, 1000.0, 6000.0, 1e9] {
                for measure in [DetailMeasure::Area, DetailMeasure::Extent] {
                    let cut = reference(&scene, &tree, &camera, &wanted(Detail::Pixels(size), measure, false));
                    let drawn = cut.surfels.iter().flat_map(|(range, _)| range.clone());
                    let mut all: Vec<u32> =
                        cut.nodes.iter().flat_map(|&(index, _)| below(&tree, index)).chain(drawn).collect();
                    all.sort_unstable();
                    assert!(all.iter().copied().eq(0..8000), "{size}");
                    let seen = |index: &u32| {
                        let node = &tree.nodes[*index as usize];
                        measure.of(node, tree_center(&tree, *index) - camera.eye, &camera)
                    };
                    assert!(cut.nodes.iter().all(|(index, _)| seen(index) < size));
                    if measure == DetailMeasure::Extent {
                        assert!(cut.len() < last || size == 0.0, "{size}: {}", cut.len());
                        last = cut.len();
                    }
                    let drawn = cut.scene(&scene, &tree, true);
                    assert_eq!((drawn.surfels.len(), drawn.colors.linear(cut.len() - 1)[3]), (cut.len(), 1.0));
                }
            }
            assert_eq!(last, 1);
        }
    }

    /// The part of a fading cut that belongs to one size equals the cut of that size without fades.
    #[test]
    fn cuts_that_fade_are_cuts_of_sizes_from_half_on() {
        let (scene, tree) = sphere();
        let camera = camera(DVec3::new(0.0, 0.7, 2.0), Lens::Fov(50.0));
        let of = |size: f64, fades: bool| {
            let wanted = Wanted { fades, ..wanted(Detail::Pixels(size), DetailMeasure::Extent, false) };
            reference(&scene, &tree, &camera, &wanted)
        };
        for size in [1000.0, 4000.0] {
            let all = of(size, true);
            let mut sizes = std::collections::BTreeSet::new();
            for number in 0..STEPS {
                let has = |fade: &Fade| (fade.from..fade.to).contains(&number);
                let nodes = all.nodes.iter().filter(|(_, fade)| has(fade)).map(|(node, _)| (*node, Fade::WHOLE));
                let surfels = all.surfels.iter().filter(|(_, fade)| has(fade));
                let surfels = surfels.map(|(range, _)| (range.clone(), Fade::WHOLE));
                let one = Cut { nodes: nodes.collect(), surfels: surfels.collect() };
                assert_eq!(one, of(size * (0.5 + f64::from(number) / 128.0), false), "{size} {number}");
                sizes.insert(one.len());
            }
            assert!(sizes.len() > 20, "{sizes:?}");
        }
    }

    /// At most the requested number is drawn, and hardly fewer.
    #[test]
    fn a_number_of_splats_is_kept() {
        let (scene, tree) = sphere();
        let camera = camera(DVec3::new(0.0, 0.7, 3.0), Lens::Fov(50.0));
        let few = [(1, 1), (10, 1), (300, 250), (2000, 1900), (7999, 7900), (8000, 8000), (1 << 40, 8000)];
        let fading = [(1, 1), (10, 1), (300, 220), (2000, 1900), (8000, 8000), (9000, 8000)];
        let all = few.map(|case| (case, false)).into_iter().chain(fading.map(|case| (case, true)));
        for ((splats, least), detail_fades) in all {
            let options = Settings { detail: Detail::Splats(splats), detail_fades, ..Settings::default() };
            let wanted = Wanted::of(&options, false);
            let detail = sized(&tree, DVec3::ZERO, &camera, &wanted);
            let drawn = reference(&scene, &tree, &camera, &Wanted { detail, ..wanted }).len() as u64;
            assert!((least..=splats).contains(&drawn), "{splats}: {drawn} at {detail:?}");
        }
    }

    fn tree_center(tree: &Hierarchy, index: u32) -> DVec3 {
        DVec3::from_array(tree.nodes[index as usize].surfel.center.map(f64::from))
    }

    /// The angles of cone and ball add up for all values.
    #[test]
    fn a_cone_and_a_ball_turn_by_their_angles_together() {
        let camera = camera(DVec3::new(0.0, 0.0, 3.0), Lens::Fov(50.0));
        let surfel = Surfel { center: [0.0; 3], s: [1.0, 0.0, 0.0], t: [0.0, 0.8, 0.6] };
        for cone in [-1.0, -0.7, -0.01, 0.0, 0.01, 0.5, 0.99, 1.0] {
            for (center, radius) in [(0.5, 0.0), (2.0, 0.1), (2.0, 1.0), (2.0, 1.99), (2.0, 2.0), (1.0, 5.0)] {
                let node =
                    Node { surfel, cap: Cap::FLAT, color: [1.0; 4], radius, cone, first: 0, count: 1, leaf: true };
                let radius = f64::from(radius);
                let angle = f64::from(cone).acos() + (radius / center).min(1.0).asin();
                let expected = if angle < std::f64::consts::FRAC_PI_2 { angle.sin() } else { 1.0 };
                let [turned, spread] = turned_away(&node, (DVec3::NEG_Z * center, radius), &camera);
                assert!((spread - expected).abs() < 1e-12, "{cone} {center} {radius}: {spread} {expected}");
                assert!((turned + 0.8).abs() < 1e-7, "{turned}");
            }
        }
    }

    /// Surfels that are left out are out of view or face away, and some are left out.
    #[test]
    fn what_is_left_out_cannot_be_seen() {
        let (scene, tree) = sphere();
        // Seen from within, and from close by.
        for (eye, back) in
            [(DVec3::new(0.0, 0.0, 0.4), false), (DVec3::new(0.2, 0.1, 1.6), false), (DVec3::new(0.2, 0.1, 1.6), true)]
        {
            let camera = camera(eye, Lens::Fov(40.0));
            let cut = reference(&scene, &tree, &camera, &wanted(Detail::FINEST, DetailMeasure::Area, back));
            let drawn: std::collections::BTreeSet<u32> =
                cut.surfels.iter().flat_map(|(range, _)| range.clone()).collect();
            assert!(cut.nodes.is_empty() && drawn.len() < 5000 && drawn.len() > 50, "{}", drawn.len());
            for index in (0..8000u32).filter(|index| !drawn.contains(index)) {
                let surfel = &scene.surfels[index as usize];
                let center = DVec3::from_array(surfel.center.map(f64::from));
                let at = camera.rotation * (center - camera.eye);
                let (x, y) = (at.x / at.z * camera.fx + camera.cx, at.y / at.z * camera.fy + camera.cy);
                let outside = at.z <= 0.0 || !(0.0..300.0).contains(&x) || !(0.0..300.0).contains(&y);
                let away = Vec3::from_array(surfel.center).dot((camera.eye - center).as_vec3()) < 0.0;
                assert!(outside || (back && away), "{index}: {x} {y}");
            }
            let turned = |index: &u32| shows_back(&scene, *index as usize, &camera, true);
            assert_eq!(drawn.iter().any(turned), !back);
        }
    }
}
