//! Stage 0 of scenes with levels of detail: the cut, which is drawn in place of all surfels (Pajarola 2003, section 5.1, step 1).
//!
//! From the root down: what is out of view, or all turned away where backs are left out, is passed over; a node that is seen smaller than the size
//! asked for is drawn, but where backs are left out none that would be though some of what is below would not; of a leaf that is not, its surfels
//! are; and of other nodes what is below. The cut depends on the tree, the camera and on whether backs are left out alone.
//!
//! On a device the tree lies in [`branches`](super::branches), which are gone through one after the other, and what was chosen of each is copied to the
//! pages that surfels are drawn from: nothing that follows knows of trees.

use std::f64::consts::FRAC_PI_2;
use std::ops::Range;

use glam::DVec3;
use rayon::prelude::*;

use super::cull;
use super::lowpass::Design;
use crate::plan::pass::Pass;
use crate::plan::steps::{Kernel, Over, Run};
use crate::plan::{RenderOptions, SurfelLayout};
use crate::scene::color::srgb8;
use crate::scene::hierarchy::Node;
use crate::scene::{Camera, Cap, Clip, Colors, Detail, DetailMeasure, Hierarchy, Projection, Scene, Surfel};

/// The pass's kernels, files and constants.
pub const PASS: Pass = Pass {
    name: "select",
    files: |needs| match (needs.levels, SurfelLayout::of(needs).words > 0) {
        (true, true) => vec!["select.wgsl", "gather.wgsl"],
        (true, false) => vec!["select.wgsl", "gather_absent.wgsl"],
        (false, _) => vec!["select_absent.wgsl"],
    },
    kernels: |needs| match needs.levels {
        true => vec![SELECT_ROOTS, SELECT_JUDGE, SELECT_SUM, SELECT_SPREAD, SELECT_GATHER],
        false => Vec::new(),
    },
    constants: |making| match making.needs.levels {
        true => {
            vec![("MEASURES_EXTENT", u32::from(making.options.detail_measure == DetailMeasure::Extent).into())]
        }
        false => Vec::new(),
    },
};

const SELECT_ROOTS: Kernel = Kernel::of("select_roots", [1, 1, 1]);
const SELECT_JUDGE: Kernel = Kernel::new("select_judge");
const SELECT_SUM: Kernel = Kernel::new("select_sum");
const SELECT_SPREAD: Kernel = Kernel::new("select_spread");
/// It copies to the pages, one after the other.
pub(crate) const SELECT_GATHER: Kernel = Kernel::new("select_gather");

/// The dispatches that choose what of a branch with so many levels is drawn, and then copy it if it is `gathered`.
pub fn runs(levels: u32, gathered: bool) -> Vec<Run> {
    let level = [
        Run { kernel: SELECT_JUDGE, over: Over::Judged },
        Run { kernel: SELECT_SUM, over: Over::Once },
        Run { kernel: SELECT_SPREAD, over: Over::Spread },
    ];
    let mut runs = vec![Run { kernel: SELECT_ROOTS, over: Over::Once }];
    runs.extend((0..levels).flat_map(|_| level));
    runs.extend(gathered.then_some(Run { kernel: SELECT_GATHER, over: Over::Chosen }));
    runs
}

/// Words of [`Over`]'s grids in the state of a cut, `selection` (`wgsl/select.wgsl`).
pub(crate) const JUDGE_GRID: u64 = 7;
pub(crate) const SPREAD_GRID: u64 = 10;
pub(crate) const GATHER_GRID: u64 = 13;

/// Words of that state.
pub(crate) const SELECTION_WORDS: u64 = 16;

/// What is drawn of a tree.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cut {
    /// Nodes, by their numbers, which ascend.
    pub nodes: Vec<u32>,
    /// Surfels of leaves, in the order of the tree.
    pub surfels: Vec<Range<u32>>,
}

/// Which cut is wanted.
#[derive(Clone, Copy, Debug)]
pub struct Wanted {
    /// The size of what is drawn in place of what is below it.
    pub detail: Detail,
    /// How that is measured.
    pub measure: DetailMeasure,
    /// Surfels that face away are left out.
    pub backs_out: bool,
    /// How far a low-pass may reach past a surfel, pixels ([`cull::filter_reach`]).
    pub filter_reach: f64,
}

impl Wanted {
    /// That of a picture with `options`, of which backs are left out or not.
    pub fn of(options: &RenderOptions, backs_out: bool) -> Self {
        let filter_reach = cull::filter_reach(&Design::of(options));
        Self { detail: options.detail, measure: options.detail_measure, backs_out, filter_reach }
    }
}

/// What becomes of a node.
enum Fate {
    Unseen,
    Drawn,
    /// Its children, or its surfels.
    Divided,
}

/// The cut of `hierarchy`, which is relative to `origin`, in the view of `camera`.
pub fn reference(hierarchy: &Hierarchy, origin: DVec3, camera: &Camera, wanted: &Wanted) -> Cut {
    let Wanted { detail, measure, backs_out, filter_reach } = *wanted;
    let eye = camera.eye - origin;
    let size = detail.pixels(camera.pixels() as f64);
    let fate = |index: u32| {
        let node = &hierarchy.nodes[index as usize];
        let low = hierarchy.low.get(index as usize).map_or(DVec3::ZERO, |low| DVec3::from_array(low.map(f64::from)));
        let center = DVec3::from_array(node.surfel.center.map(f64::from)) + low - eye;
        let [turned, spread] = if backs_out { turned_away(node, center, camera) } else { [-1.0, 0.0] };
        if is_unseen(node, center, camera, filter_reach) || turned > spread {
            return Fate::Unseen;
        }
        let seen =
            if reaches_eye(node, center, camera) { f64::INFINITY } else { measure.of(&node.surfel, center, camera) };
        // The plane of one that faces away is left out, whatever is below it.
        if seen < size && turned <= 0.0 { Fate::Drawn } else { Fate::Divided }
    };
    let mut cut = Cut::default();
    let mut frontier: Vec<u32> = vec![0];
    while !frontier.is_empty() {
        let fates: Vec<Fate> = frontier.par_iter().with_min_len(256).map(|&index| fate(index)).collect();
        let mut below = Vec::new();
        for (index, fate) in frontier.into_iter().zip(fates) {
            let Node { first, count, leaf, .. } = hierarchy.nodes[index as usize];
            match fate {
                Fate::Unseen => {}
                // One surfel is itself, with its lines and its cap.
                Fate::Drawn if leaf && count == 1 => cut.surfels.push(first..first + 1),
                Fate::Drawn => cut.nodes.push(index),
                Fate::Divided if leaf => cut.surfels.push(first..first + count),
                Fate::Divided => below.extend(first..first + count),
            }
        }
        frontier = below;
    }
    cut.nodes.sort_unstable();
    cut.surfels.sort_unstable_by_key(|range| range.start);
    cut
}

/// Whether the ball around all below a node reaches the near depth, so that its place in the image says nothing.
fn reaches_eye(node: &Node, center: DVec3, camera: &Camera) -> bool {
    (camera.rotation * center).z - f64::from(node.radius) <= camera.near
}

/// Whether nothing below a node is in view: the ball around it is before the near depth or beside the image, farther than a low-pass
/// reaches.
fn is_unseen(node: &Node, center: DVec3, camera: &Camera, filter_reach: f64) -> bool {
    let at = camera.rotation * center;
    if at.z + f64::from(node.radius) < camera.near {
        return true;
    }
    let image = cull::reference(at, node.radius.into(), camera, filter_reach);
    image.is_some_and(|[low, high]| {
        let last = [camera.width, camera.height].map(|side| f64::from(side) - 1.0);
        high.x < 0.0 || high.y < 0.0 || low.x > last[0] || low.y > last[1]
    })
}

/// The sine by which a node's normal points away from the eye, and that past which all below it does, whatever point of the ball around it is looked
/// at (specification S12): that of its cone and the ball's half-angle together, if they are less than a right angle; else 1.
fn turned_away(node: &Node, center: DVec3, camera: &Camera) -> [f64; 2] {
    let (toward, ball) = match camera.projection {
        Projection::Pinhole => {
            let distance = center.length();
            (-center / distance, (f64::from(node.radius) / distance).min(1.0).asin())
        }
        Projection::Orthographic => (-camera.rotation.row(2), 0.0),
    };
    let spread = f64::from(node.cone).clamp(-1.0, 1.0).acos() + ball;
    let [s, t] = [node.surfel.s, node.surfel.t].map(|axis| DVec3::from_array(axis.map(f64::from)));
    [-toward.dot(s.cross(t).normalize_or_zero()), if spread < FRAC_PI_2 { spread.sin() } else { 1.0 }]
}

impl Cut {
    /// How many surfels are drawn.
    pub fn len(&self) -> usize {
        self.nodes.len() + self.surfels.iter().map(|range| range.len()).sum::<usize>()
    }

    /// Whether nothing is drawn.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The surfels of leaves and then the nodes, as a scene like `scene`, which they are cut from. Nodes end at no lines and are flat.
    pub fn scene(&self, scene: &Scene, hierarchy: &Hierarchy) -> Scene {
        let indices: Vec<u32> = self.surfels.iter().flat_map(Clone::clone).collect();
        let nodes = || self.nodes.iter().map(|&index| &hierarchy.nodes[index as usize]);
        let mut cut = scene.taken(&indices);
        cut.surfels.extend(nodes().map(|node| node.surfel));
        let count = cut.surfels.len();
        if !scene.low.is_empty() {
            cut.low.extend(self.nodes.iter().map(|&index| hierarchy.low[index as usize]));
        }
        if !scene.clips.is_empty() {
            cut.clips.resize(count, Clip::NONE);
        }
        if !scene.caps.is_empty() {
            cut.caps.resize(count, Cap::FLAT);
        }
        let plane = |surfel: &Surfel| surfel.normal().normalize_or_zero().to_array();
        if !scene.normals.is_empty() {
            cut.normals.extend(nodes().map(|node| plane(&node.surfel)));
        }
        match &mut cut.colors {
            Colors::Srgb8(codes) => codes.extend(nodes().map(|node| srgb8(node.color))),
            Colors::Linear(colors) => colors.extend(nodes().map(|node| node.color)),
            // One for all, and others have no levels of detail.
            Colors::Constant(_) | Colors::Textured(_) | Colors::Harmonics(_) => {}
        }
        cut
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use glam::Vec3;

    use super::*;
    use crate::scene::{Lens, Up};
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
        let options = RenderOptions { detail, detail_measure: measure, ..RenderOptions::default() };
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
                    let cut = reference(&tree, DVec3::ZERO, &camera, &wanted(Detail::Pixels(size), measure, false));
                    let drawn = cut.surfels.iter().flat_map(Clone::clone);
                    let mut all: Vec<u32> =
                        cut.nodes.iter().flat_map(|&index| below(&tree, index)).chain(drawn).collect();
                    all.sort_unstable();
                    assert!(all.iter().copied().eq(0..8000), "{size}");
                    let seen = |index: &u32| {
                        measure.of(
                            &tree.nodes[*index as usize].surfel,
                            tree_center(&tree, *index) - camera.eye,
                            &camera,
                        )
                    };
                    assert!(cut.nodes.iter().all(|index| seen(index) < size));
                    if measure == DetailMeasure::Extent {
                        assert!(cut.len() < last || size == 0.0, "{size}: {}", cut.len());
                        last = cut.len();
                    }
                    let drawn = cut.scene(&scene, &tree);
                    assert_eq!((drawn.surfels.len(), drawn.colors.linear(cut.len() - 1)[3]), (cut.len(), 1.0));
                }
            }
            assert_eq!(last, 1);
        }
    }

    fn tree_center(tree: &Hierarchy, index: u32) -> DVec3 {
        DVec3::from_array(tree.nodes[index as usize].surfel.center.map(f64::from))
    }

    /// What is passed over is out of view, or faces away; and some is.
    #[test]
    fn what_is_left_out_cannot_be_seen() {
        let (scene, tree) = sphere();
        // From within, and from near.
        for (eye, back) in
            [(DVec3::new(0.0, 0.0, 0.4), false), (DVec3::new(0.2, 0.1, 1.6), false), (DVec3::new(0.2, 0.1, 1.6), true)]
        {
            let camera = camera(eye, Lens::Fov(40.0));
            let cut = reference(&tree, DVec3::ZERO, &camera, &wanted(Detail::FINEST, DetailMeasure::Area, back));
            let drawn: std::collections::BTreeSet<u32> = cut.surfels.iter().flat_map(Clone::clone).collect();
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
        }
    }
}
