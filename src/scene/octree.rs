//! Point octrees whose levels halve the spacing, as in COPC files, and the choice of the nodes that
//! a picture needs.
//!
//! The points of a node add to those of the nodes above it, so the finest node read at a place
//! determines how densely it is sampled. The selection depends on octree and camera alone.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};

use super::detail::finest;
use super::{Bounds, Camera, Detail, Projection};

/// The nodes of an octree whose root is a cube.
#[derive(Clone, Debug, PartialEq)]
pub struct PointOctree {
    /// The cube's centre, world coordinates.
    pub center: DVec3,
    /// Half the cube's edge, world units.
    pub half: f64,
    /// The spacing of neighbouring points in the root, world units; each level halves it.
    pub spacing: f64,
    /// The nodes, sorted by [`OctreeNode::key`].
    pub nodes: Vec<OctreeNode>,
    /// The bounding box of all points, world coordinates; empty if unknown.
    pub bounds: Bounds,
}

/// A node. It may have no points of its own, only children with points.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OctreeNode {
    /// The level, 0 for the root: the edge of the node's cube is that of the root divided by
    /// `2^level`.
    pub level: u32,
    /// The index of the node's cube in its level, along x, y and z.
    pub place: [u32; 3],
    /// The number of the node's own points.
    pub points: u64,
}

/// The most levels for which a cube's index along an axis fits in 32 bits.
pub const MOST_LEVELS: u32 = 32;

/// The number of points that suffice to find the extent of a scene before a camera is known.
const OVERVIEW: u64 = 50_000;

/// Points outside the view matter up to this distance, in spacings, because the shape of visible
/// points is estimated from their neighbours.
const NEIGHBOURHOOD: f64 = 3.0;

/// Tolerance for places that rounding puts just outside an octree, in units of half its edge.
const PLACES_ROUNDED: f64 = 1e-6;

impl OctreeNode {
    /// The sort key of the nodes: level, then cube.
    pub fn key(&self) -> (u32, [u32; 3]) {
        (self.level, self.place)
    }

    /// The name in COPC: `level-x-y-z`.
    pub fn name(&self) -> String {
        let Self { level, place: [x, y, z], .. } = self;
        format!("{level}-{x}-{y}-{z}")
    }
}

impl PointOctree {
    /// The index of the node at `place` in `level`, if it exists.
    pub fn find(&self, level: u32, place: [u32; 3]) -> Option<usize> {
        self.nodes.binary_search_by_key(&(level, place), OctreeNode::key).ok()
    }

    /// The indices of the children of `node` that exist.
    fn children(&self, node: &OctreeNode) -> impl Iterator<Item = usize> {
        let place = node.place;
        (0..8).filter_map(move |corner| {
            let child = [0, 1, 2].map(|axis| place[axis] << 1 | (corner >> axis & 1));
            self.find(node.level + 1, child)
        })
    }

    /// The number of points in the nodes with these indices.
    pub fn points(&self, nodes: &[usize]) -> u64 {
        nodes.iter().map(|&node| self.nodes[node].points).sum()
    }

    /// The number of levels, from the root to the finest node.
    pub fn levels(&self) -> u32 {
        self.nodes.last().map_or(0, |node| node.level + 1)
    }

    /// An overview for any view: the nodes of the coarsest levels that together have at least
    /// 50,000 points, or all nodes.
    pub fn overview(&self) -> Vec<usize> {
        let of_level = |level: u32| self.nodes.iter().filter(move |node| node.level == level);
        let mut points = 0;
        let levels = (0..self.levels()).take_while(|&level| {
            let enough = points >= OVERVIEW;
            points += of_level(level).map(|node| node.points).sum::<u64>();
            !enough
        });
        let levels = levels.count() as u32;
        (0..self.nodes.len()).filter(|&node| self.nodes[node].level < levels).collect()
    }

    /// Whether all points, and those around them that matter, lie outside the picture. False if
    /// their bounding box is unknown.
    fn is_beside(&self, camera: &Camera) -> bool {
        !self.bounds.is_empty() && is_box_beside(&self.bounds, camera)
    }

    /// The sorted indices of the nodes that a picture needs; none if [`is_box_beside`] the picture.
    ///
    /// They are the nodes in view for which every ancestor is coarse enough to be refined: a disk
    /// with the ancestor's spacing as its radius has an image of at least `size` square pixels.
    fn taken(&self, camera: &Camera, size: f64) -> Vec<usize> {
        let mut open: Vec<usize> = self.find(0, [0; 3]).into_iter().filter(|_| !self.is_beside(camera)).collect();
        let mut taken = Vec::new();
        while let Some(index) = open.pop() {
            let node = &self.nodes[index];
            let shrunk = 0.5f64.powi(node.level as i32);
            let spacing = self.spacing * shrunk;
            let place = DVec3::from_array(node.place.map(|place| (2.0 * f64::from(place) + 1.0) * shrunk - 1.0));
            let at = camera.rotation * (self.center + place * self.half - camera.eye);
            let radius = 3f64.sqrt() * self.half * shrunk;
            let reach = radius + NEIGHBOURHOOD * spacing;
            // The depth extent is that of the cube, not of its bounding sphere.
            let deep = match camera.depth_is_distance() {
                false => self.half * shrunk * camera.rotation.row(2).abs().element_sum(),
                true => radius,
            };
            let depth = camera.depth(at);
            if depth + reach < camera.near || camera.is_beside_image(at, reach, DVec2::ONE) {
                continue;
            }
            taken.push(index);
            let pixels = camera.fx.max(camera.fy)
                / match camera.projection {
                    // Nothing is small at the camera's plane.
                    Projection::Pinhole => (depth - deep).max(0.0),
                    Projection::Orthographic => 1.0,
                };
            if PI * (spacing * pixels).powi(2) >= size {
                open.extend(self.children(node));
            }
        }
        taken.sort_unstable();
        taken
    }
}

/// Whether the points of an octree with this bounding box, world coordinates, are left out of a
/// picture. They and what matters around them lie outside of it.
///
/// The test knows no more than the box, so a file is left out before it is opened. Programs that
/// write COPC choose the spacing in the root so that 128 points lie along an edge of its cube.
pub fn is_box_beside(bounds: &Bounds, camera: &Camera) -> bool {
    const ALONG_EDGE: f64 = 128.0;
    let reach = NEIGHBOURHOOD / ALONG_EDGE * bounds.extent().max_element();
    let half = 0.5 * bounds.extent() + reach;
    let in_camera = |place: DVec3| camera.rotation * (place - camera.eye);
    let corners: [DVec3; 8] = std::array::from_fn(|at| {
        let signs = [at & 1, at >> 1 & 1, at >> 2 & 1].map(|upper| 2.0 * upper as f64 - 1.0);
        in_camera(bounds.center() + half * DVec3::from_array(signs))
    });
    let deepest = match camera.depth_is_distance() {
        false => corners.iter().map(|corner| camera.depth(*corner)).fold(f64::NEG_INFINITY, f64::max),
        true => camera.depth(in_camera(bounds.center())) + half.length(),
    };
    deepest < camera.near || camera.is_body_beside_image(&corners, DVec2::ONE)
}

/// The nodes of each octree that a picture with this `detail` needs.
///
/// For [`Detail::Splats`], it searches the finest size with which at most that many points are
/// read. The roots, and nodes that reach the camera's plane, are always read and may exceed that
/// number.
pub fn taken(octrees: &[PointOctree], camera: &Camera, detail: Detail) -> Vec<Vec<usize>> {
    let of_size = |size: f64| octrees.iter().map(|octree| octree.taken(camera, size)).collect::<Vec<_>>();
    let Detail::Splats(most) = detail else { return of_size(detail.pixels(camera.pixels() as f64)) };
    of_size(finest(|size| {
        let nodes = of_size(size);
        octrees.iter().zip(nodes).map(|(octree, nodes)| octree.points(&nodes)).sum::<u64>() <= most
    }))
}

/// The nodes taken from an octree, compared with all of its nodes.
pub struct Thinned<'a> {
    octree: &'a PointOctree,
    /// Sorted indices of the taken nodes.
    taken: &'a [usize],
    /// The number of points of each node and all nodes below it.
    points: Vec<u64>,
}

impl<'a> Thinned<'a> {
    /// Compares the `taken` nodes, sorted, with all of `octree`. The parent of each taken node must
    /// be taken too.
    pub fn new(octree: &'a PointOctree, taken: &'a [usize]) -> Self {
        let mut points: Vec<u64> = octree.nodes.iter().map(|node| node.points).collect();
        for (index, node) in octree.nodes.iter().enumerate().rev() {
            let above =
                node.level.checked_sub(1).and_then(|level| octree.find(level, node.place.map(|place| place >> 1)));
            if let Some(above) = above {
                points[above] += points[index];
            }
        }
        Self { octree, taken, points }
    }

    /// The estimated size of disks if all points were taken, relative to disks of the taken points.
    ///
    /// Disks are as large as the spacing of the points around `place`, world coordinates on the
    /// surface. The result is 1 where everything was taken, and None outside the octree.
    pub fn part_of_size(&self, place: DVec3) -> Option<f64> {
        let octree = self.octree;
        let within = (place - octree.center) / octree.half;
        // Places are rounded, and so are the faces of the octree.
        if within.abs().max_element() > 1.0 + PLACES_ROUNDED {
            return None;
        }
        let at_level = |level: u32| {
            let side = f64::from(1u32 << level);
            let cube = ((within + 1.0) * 0.5 * side).floor().clamp(DVec3::ZERO, DVec3::splat(side - 1.0));
            octree.find(level, cube.to_array().map(|place| place as u32))
        };
        // Points in the cube of the finest taken node: the node's own, plus a share of its
        // ancestors' points. The share is a quarter per level, as points on a surface divide among
        // four of the eight child cubes.
        let (mut taken, mut all) = (1.0, 1.0);
        let mut above = 0.0;
        for node in (0..octree.levels()).map_while(at_level) {
            if self.taken.binary_search(&node).is_err() {
                return Some(f64::sqrt(taken / all));
            }
            let own = octree.nodes[node].points as f64;
            (taken, all) = ((above + own).max(1.0), (above + self.points[node] as f64).max(1.0));
            above = (above + own) / 4.0;
        }
        Some(1.0)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::scene::{Lens, Up};

    /// A cube of side 2 around the origin with complete levels, every node with `points` points.
    fn full(levels: u32, points: u64) -> PointOctree {
        let mut nodes = Vec::new();
        for level in 0..levels {
            let side = 1 << level;
            let all = (0..side).flat_map(|x| (0..side).flat_map(move |y| (0..side).map(move |z| [x, y, z])));
            nodes.extend(all.map(|place| OctreeNode { level, place, points }));
        }
        PointOctree { center: DVec3::ZERO, half: 1.0, spacing: 0.25, nodes, bounds: Bounds::EMPTY }
    }

    fn camera(eye: DVec3, lens: Lens) -> Camera {
        Camera::look_at((256, 256), lens, eye, DVec3::ZERO, None, Up::Y, 1e-3).unwrap()
    }

    #[test]
    fn a_picture_takes_what_is_seen_large() {
        let octree = full(5, 10);
        let lens = Lens::OrthographicHeight(3.0);
        let camera = camera(DVec3::new(0.0, 0.0, 5.0), lens);
        // At 85.3 pixels per world unit, a disk of the root's spacing covers 1,428 square pixels,
        // and a quarter of that for each further level.
        for (size, levels) in [(1e9, 1), (1500.0, 1), (1400.0, 2), (350.0, 3), (80.0, 4), (20.0, 5), (0.0, 5)] {
            let [nodes] = taken(std::slice::from_ref(&octree), &camera, Detail::Pixels(size)).try_into().unwrap();
            assert!(
                nodes.iter().copied().eq((0..octree.nodes.len()).filter(|&k| octree.nodes[k].level < levels)),
                "{size}"
            );
        }
        // From nearby, near nodes are finer, and nodes outside the view are left out.
        let close = self::camera(DVec3::new(0.0, 0.0, 1.5), Lens::Fov(30.0));
        let nodes = octree.taken(&close, 1400.0);
        let finest = |front: bool| {
            let in_half = |node: &&OctreeNode| (node.place[2] << 1 >> node.level == 1) == front && node.level > 0;
            nodes.iter().map(|&node| &octree.nodes[node]).filter(in_half).map(|node| node.level).max()
        };
        assert!(finest(true) > finest(false), "{:?} {:?}", finest(true), finest(false));
        let outside = octree.find(4, [0, 0, 15]).unwrap();
        assert!(!octree.taken(&close, 0.0).contains(&outside) && octree.taken(&camera, 0.0).contains(&outside));
        // Everything lies behind this camera.
        let away = self::camera(DVec3::new(0.0, 0.0, 9.0), lens);
        let turned = Camera { rotation: glam::DMat3::from_rotation_y(PI) * away.rotation, ..away };
        assert!(octree.taken(&turned, 0.0).is_empty());
    }

    #[test]
    fn a_box_is_beside_the_image_if_all_of_it_is() {
        let side = |x: f64| Bounds { min: DVec3::new(x, -1.0, -1.0), max: DVec3::new(x + 2.0, 1.0, 1.0) };
        let (narrow, wide) = (Lens::OrthographicHeight(2.0), Lens::Fov(90.0));
        let down = |lens| camera(DVec3::new(0.0, 0.0, 3.0), lens);
        // The parallel view sees x from -1 to 1. Points up to 3/128 of the edge beyond it matter.
        for (x, beside) in [(-1.0, false), (0.99, false), (1.04, false), (1.06, true), (-3.04, false), (-3.06, true)] {
            assert_eq!(is_box_beside(&side(x), &down(narrow)), beside, "{x}");
        }
        // At the far side of the box the pinhole sees x up to 4. A ball around this box would reach
        // into the view.
        for (x, beside) in [(3.9, false), (4.2, true)] {
            assert_eq!(is_box_beside(&side(x), &down(wide)), beside, "{x}");
        }
        // A box around the camera, and one behind it, where pixel coordinates change their signs.
        let at = |z: f64| Bounds { min: DVec3::new(-1.0, -1.0, z - 1.0), max: DVec3::new(1.0, 1.0, z + 1.0) };
        assert!(!is_box_beside(&at(3.0), &down(wide)) && is_box_beside(&at(4.2), &down(wide)));
        // An octree whose points lie beside the image is not looked at, although its cube is seen.
        let octree = PointOctree { bounds: side(1.06), ..full(3, 10) };
        assert!(octree.taken(&down(narrow), 0.0).is_empty());
        assert!(!PointOctree { bounds: side(0.9), ..octree }.taken(&down(narrow), 0.0).is_empty());
    }

    #[test]
    fn a_number_of_points_is_kept() {
        let octrees = [full(4, 100), full(3, 7)];
        let camera = camera(DVec3::new(0.3, 0.2, 4.0), Lens::Fov(50.0));
        let all: u64 = octrees.iter().map(|octree| octree.nodes.len() as u64 * octree.nodes[0].points).sum();
        for most in [200, 1_000, 10_000, 30_000, all, 1 << 40] {
            let nodes = taken(&octrees, &camera, Detail::Splats(most));
            let points: u64 = octrees.iter().zip(&nodes).map(|(octree, nodes)| octree.points(nodes)).sum();
            // Depths differ, so nodes of a hundred points are added one at a time.
            assert!(points <= most && points + 1_000 >= most.min(all), "{most}: {points}");
        }
    }

    #[test]
    fn what_was_taken_has_larger_disks_than_all_where_there_is_more() {
        let mut octree = full(3, 100);
        // Remove the finest level of one corner.
        octree.nodes.retain(|node| node.level < 2 || node.place.iter().any(|place| *place > 1));
        let [corner, other] = [DVec3::splat(-0.9), DVec3::splat(0.9)];
        let all: Vec<usize> = (0..octree.nodes.len()).collect();
        for (taken, at_corner, elsewhere) in [
            (1, 100.0 / (100.0 + 800.0 + 5600.0), 100.0 / (100.0 + 800.0 + 5600.0)),
            (9, 1.0, (25.0 + 100.0) / (25.0 + 900.0)),
            (all.len(), 1.0, 1.0),
        ] {
            let thinned = Thinned::new(&octree, &all[..taken]);
            assert_eq!(thinned.part_of_size(corner), Some(f64::sqrt(at_corner)), "{taken}");
            assert_eq!(thinned.part_of_size(other), Some(f64::sqrt(elsewhere)), "{taken}");
            assert_eq!(thinned.part_of_size(DVec3::splat(7.0)), None);
        }
    }

    #[test]
    fn an_overview_has_enough_points_and_whole_levels() {
        let octree = full(4, 1_000);
        // Levels of 1, 8 and 64 nodes.
        assert_eq!(octree.overview().len(), 73);
        assert_eq!(full(4, 1).overview().len(), full(4, 1).nodes.len());
    }
}
