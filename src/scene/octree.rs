//! Octrees of points of which each level halves the spacing, as COPC files have them: which nodes a picture takes.
//!
//! A node's points add to those of the nodes above it, so a place is sampled as densely as its finest node that is read says. What is taken depends on
//! octree and camera alone.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};

use super::detail::finest;
use super::{Bounds, Camera, Detail, Projection};

/// The nodes of an octree, whose root is a cube.
#[derive(Clone, Debug, PartialEq)]
pub struct PointOctree {
    /// The cube's centre, world coordinates.
    pub center: DVec3,
    /// Half the cube's edge, world units.
    pub half: f64,
    /// The distance of neighbouring points of the root, world units; each level halves it.
    pub spacing: f64,
    /// In order of their keys.
    pub nodes: Vec<OctreeNode>,
    /// The box of all points, world coordinates; that of nothing where nobody knows it.
    pub bounds: Bounds,
}

/// A node, which may have no points but those of the nodes below it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OctreeNode {
    /// The root's is 0, and the cube's edge is divided by 2 to this power.
    pub level: u32,
    /// Which cube of its level it is, along x, y and z.
    pub place: [u32; 3],
    /// Points of its own.
    pub points: u64,
}

/// Levels of a tree whose places are whole numbers of 32 bits.
pub const MOST_LEVELS: u32 = 32;

/// Points that tell where a scene is, before a camera is.
const OVERVIEW: u64 = 50_000;

/// How far from a picture points still change it, in spacings: as neighbours of what is seen, from which its shape is estimated.
const NEIGHBOURHOOD: f64 = 3.0;

/// How far beside an octree a place may be that is of it, in halves of its edge.
const PLACES_ROUNDED: f64 = 1e-6;

impl OctreeNode {
    /// What its order among the nodes follows from.
    pub fn key(&self) -> (u32, [u32; 3]) {
        (self.level, self.place)
    }

    /// As COPC names it: `level-x-y-z`.
    pub fn name(&self) -> String {
        let Self { level, place: [x, y, z], .. } = self;
        format!("{level}-{x}-{y}-{z}")
    }
}

impl PointOctree {
    /// The index of a node, if it is there.
    pub fn find(&self, level: u32, place: [u32; 3]) -> Option<usize> {
        self.nodes.binary_search_by_key(&(level, place), OctreeNode::key).ok()
    }

    /// Those of the eight nodes below one that are there.
    fn children(&self, node: &OctreeNode) -> impl Iterator<Item = usize> {
        let place = node.place;
        (0..8).filter_map(move |corner| {
            let child = [0, 1, 2].map(|axis| place[axis] << 1 | (corner >> axis & 1));
            self.find(node.level + 1, child)
        })
    }

    /// Points of so many nodes, by their indices.
    pub fn points(&self, nodes: &[usize]) -> u64 {
        nodes.iter().map(|&node| self.nodes[node].points).sum()
    }

    /// Levels from the root to the finest node.
    pub fn levels(&self) -> u32 {
        self.nodes.last().map_or(0, |node| node.level + 1)
    }

    /// The nodes of the coarsest levels that have 50,000 points or more together, or all: an overview, whatever the view.
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

    /// The nodes that a picture takes, in order: those in view, and what is below one of whose spacing a disk is seen as large as `size`, square
    /// pixels, or larger.
    fn taken(&self, camera: &Camera, size: f64) -> Vec<usize> {
        let mut open: Vec<usize> = self.find(0, [0; 3]).into_iter().collect();
        let mut taken = Vec::new();
        while let Some(index) = open.pop() {
            let node = &self.nodes[index];
            let shrunk = 0.5f64.powi(node.level as i32);
            let spacing = self.spacing * shrunk;
            let place = DVec3::from_array(node.place.map(|place| (2.0 * f64::from(place) + 1.0) * shrunk - 1.0));
            let at = camera.rotation * (self.center + place * self.half - camera.eye);
            let radius = 3f64.sqrt() * self.half * shrunk;
            let reach = radius + NEIGHBOURHOOD * spacing;
            // Of the cube, not of the ball around it.
            let deep = self.half * shrunk * camera.rotation.row(2).abs().element_sum();
            if at.z + reach < camera.near || camera.is_beside_image(at, reach, DVec2::ONE) {
                continue;
            }
            taken.push(index);
            let pixels = camera.fx.max(camera.fy)
                / match camera.projection {
                    // At the camera's plane nothing is small.
                    Projection::Pinhole => (at.z - deep).max(0.0),
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

/// The nodes of each of `octrees` that a picture with this detail takes. For a number of splats that is the finest size with which no more points are
/// read, but for roots, and for what reaches the camera's plane.
pub fn taken(octrees: &[PointOctree], camera: &Camera, detail: Detail) -> Vec<Vec<usize>> {
    let of_size = |size: f64| octrees.iter().map(|octree| octree.taken(camera, size)).collect::<Vec<_>>();
    let Detail::Splats(most) = detail else { return of_size(detail.pixels(camera.pixels() as f64)) };
    of_size(finest(|size| {
        let nodes = of_size(size);
        octrees.iter().zip(nodes).map(|(octree, nodes)| octree.points(&nodes)).sum::<u64>() <= most
    }))
}

/// What was taken of an octree, beside all of it.
pub struct Thinned<'a> {
    octree: &'a PointOctree,
    /// In order.
    taken: &'a [usize],
    /// Points of each node and of all below it.
    points: Vec<u64>,
}

impl<'a> Thinned<'a> {
    /// Of an octree these nodes, in order, each with the one above it.
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

    /// About how large the disks of all points would be at a place of a surface, world coordinates, in the unit of those of what was taken: disks are
    /// as large as points are far from each other. 1 where everything was taken, and None beside the octree.
    pub fn part_of_size(&self, place: DVec3) -> Option<f64> {
        let octree = self.octree;
        let within = (place - octree.center) / octree.half;
        // Places are rounded, and those at the faces too.
        if within.abs().max_element() > 1.0 + PLACES_ROUNDED {
            return None;
        }
        let at_level = |level: u32| {
            let side = f64::from(1u32 << level);
            let cube = ((within + 1.0) * 0.5 * side).floor().clamp(DVec3::ZERO, DVec3::splat(side - 1.0));
            octree.find(level, cube.to_array().map(|place| place as u32))
        };
        // Points of the last node that was taken, with those of the nodes above it in its cube: of a surface a quarter of a cube's, each time.
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

    /// A cube of side 2 around the origin, all of whose nodes have `points`.
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
        // 85.3 pixels a world unit: a disk of the root's spacing has 1,428 square pixels, those of levels a quarter each.
        for (size, levels) in [(1e9, 1), (1500.0, 1), (1400.0, 2), (350.0, 3), (80.0, 4), (20.0, 5), (0.0, 5)] {
            let [nodes] = taken(std::slice::from_ref(&octree), &camera, Detail::Pixels(size)).try_into().unwrap();
            assert!(
                nodes.iter().copied().eq((0..octree.nodes.len()).filter(|&k| octree.nodes[k].level < levels)),
                "{size}"
            );
        }
        // From near, what is near is finer, and what is beside the picture is left out.
        let close = self::camera(DVec3::new(0.0, 0.0, 1.5), Lens::Fov(30.0));
        let nodes = octree.taken(&close, 1400.0);
        let finest = |front: bool| {
            let in_half = |node: &&OctreeNode| (node.place[2] << 1 >> node.level == 1) == front && node.level > 0;
            nodes.iter().map(|&node| &octree.nodes[node]).filter(in_half).map(|node| node.level).max()
        };
        assert!(finest(true) > finest(false), "{:?} {:?}", finest(true), finest(false));
        let outside = octree.find(4, [0, 0, 15]).unwrap();
        assert!(!octree.taken(&close, 0.0).contains(&outside) && octree.taken(&camera, 0.0).contains(&outside));
        // What lies behind.
        let away = self::camera(DVec3::new(0.0, 0.0, 9.0), lens);
        let turned = Camera { rotation: glam::DMat3::from_rotation_y(PI) * away.rotation, ..away };
        assert!(octree.taken(&turned, 0.0).is_empty());
    }

    #[test]
    fn a_number_of_points_is_kept() {
        let octrees = [full(4, 100), full(3, 7)];
        let camera = camera(DVec3::new(0.3, 0.2, 4.0), Lens::Fov(50.0));
        let all: u64 = octrees.iter().map(|octree| octree.nodes.len() as u64 * octree.nodes[0].points).sum();
        for most in [200, 1_000, 10_000, 30_000, all, 1 << 40] {
            let nodes = taken(&octrees, &camera, Detail::Splats(most));
            let points: u64 = octrees.iter().zip(&nodes).map(|(octree, nodes)| octree.points(nodes)).sum();
            // Nodes of a hundred points come one at a time, as their depths differ.
            assert!(points <= most && points + 1_000 >= most.min(all), "{most}: {points}");
        }
    }

    #[test]
    fn what_was_taken_has_larger_disks_than_all_where_there_is_more() {
        let mut octree = full(3, 100);
        // Of one corner's finest level nothing is there.
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
        // 1, 8 and 64 nodes.
        assert_eq!(octree.overview().len(), 73);
        assert_eq!(full(4, 1).overview().len(), full(4, 1).nodes.len());
    }
}
