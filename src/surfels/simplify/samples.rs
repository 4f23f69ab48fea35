//! The input of the algorithm: distinct positions, each with a normal, a radius and a colour.

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use crate::Result;
use crate::scene::{Atlas, Bounds, Clip, Scene, Surfel};
use crate::surfels::Coordinates;
use crate::surfels::creases::SMOOTH;
use crate::surfels::positions::DistinctPositions;
use crate::surfels::texture::{around, jumps, typical_change};

/// The surfels of a scene, merged at each distinct position, in an order that depends on the set of
/// positions alone.
///
/// Lengths are in scaled units: see [`DistinctPositions::scale`].
pub(super) struct Samples {
    pub positions: DistinctPositions,
    /// Unit normals: the mean over the surfels at a position, or, if they cancel, the first of them
    /// by coordinates.
    pub normals: Vec<DVec3>,
    /// The surfel at a position, if there is only one.
    pub only: Vec<Option<u32>>,
    /// The largest half-axis of the surfels at a position.
    pub radii: Vec<f64>,
    /// The ends of the surfel at a position, if there is only one.
    pub lines: Vec<Vec<End>>,
    /// Mean linear colour of the surfels at a position, premultiplied by alpha.
    pub colors: Vec<[f64; 4]>,
    /// Texture coordinates in the plane of the atlas, the smallest of several surfels at a
    /// position; empty if surfels have none.
    pub places: Vec<DVec2>,
    /// The layout of the textures in that plane.
    atlas: Atlas,
    /// The typical change of texture coordinates around each point, per scaled unit.
    changes: Vec<f64>,
    /// Whether normals have a side.
    pub oriented: bool,
}

impl Samples {
    /// Merges the surfels of `scene`, with their texture coordinates if they have any.
    pub fn new(scene: &Scene, coordinates: &Coordinates) -> Result<Self> {
        let center = |index: usize| scene.center(index).to_array();
        let centers: Vec<[f64; 3]> = (0..scene.surfels.len()).into_par_iter().map(center).collect();
        let positions = DistinctPositions::new(&centers, &scene.bounds(), DVec3::ZERO)?;
        let count = positions.len();
        // Groups surfels by position. Within a group they are ordered by content, so that sums do
        // not depend on the order of the scene.
        let attributes = |surfel: u32| {
            let normal = unit_normal(&scene.surfels[surfel as usize]);
            let color = scene.colors.linear(surfel as usize).map(f64::from);
            (normal, color)
        };
        let mut of_position: Vec<(u32, u32)> = positions.of_point().iter().copied().zip(0..).collect();
        of_position.par_sort_unstable_by(|a, b| {
            a.0.cmp(&b.0).then_with(|| {
                let ((a, a_color), (b, b_color)) = (attributes(a.1), attributes(b.1));
                let key = |n: DVec3, color: [f64; 4]| [n.x, n.y, n.z, color[0], color[1], color[2], color[3]];
                let pairs = key(a, a_color).into_iter().zip(key(b, b_color));
                pairs.map(|(a, b)| a.total_cmp(&b)).find(|order| order.is_ne()).unwrap_or(std::cmp::Ordering::Equal)
            })
        });
        let mut normals = Vec::with_capacity(count);
        let mut radii = Vec::with_capacity(count);
        let mut colors = Vec::with_capacity(count);
        let mut only = Vec::with_capacity(count);
        let mut lines = Vec::with_capacity(count);
        for group in of_position.chunk_by(|a, b| a.0 == b.0) {
            let (mut normal, mut color, mut radius) = (DVec3::ZERO, [0.0; 4], 0f64);
            for &(_, surfel) in group {
                let (n, [r, g, b, alpha]) = attributes(surfel);
                normal += n;
                for (sum, value) in color.iter_mut().zip([r * alpha, g * alpha, b * alpha, alpha]) {
                    *sum += value / group.len() as f64;
                }
                radius = radius.max(f64::from(scene.surfels[surfel as usize].radius()));
            }
            let first = group.first().map_or(DVec3::Z, |&(_, surfel)| attributes(surfel).0);
            // A sum this short is the rounding error of normals that cancel.
            let cancelled = normal.length() < 1e-3;
            normals.push(if cancelled { first } else { normal.normalize() });
            radii.push(radius * positions.scale());
            colors.push(color);
            only.push(if let &[(_, surfel)] = group { Some(surfel) } else { None });
            lines.push(match (group, scene.clips.as_slice()) {
                (&[(_, surfel)], clips @ [_, ..]) => {
                    ends(&scene.surfels[surfel as usize], &clips[surfel as usize], positions.scale())
                }
                _ => Vec::new(),
            });
        }
        let places = places(&positions, &coordinates.centers);
        let bounds = scene.bounds();
        let scaled = Bounds { min: bounds.min * positions.scale(), max: bounds.max * positions.scale() };
        let change = |_, steps: &[(DVec3, DVec2)]| typical_change(steps);
        let changes = around((positions.as_slice(), &scaled), &places, &coordinates.atlas, change)?;
        let places = places.into_iter().map(|place| DVec2::from_array(place.map(f64::from))).collect();
        let atlas = coordinates.atlas;
        Ok(Self { positions, normals, only, radii, lines, colors, places, atlas, changes, oriented: scene.oriented })
    }

    /// The step from one point to another: in space, scaled units, and in texture coordinates.
    pub fn step(&self, from: u32, to: u32) -> (DVec3, DVec2) {
        let offset = self.positions.position(to) - self.positions.position(from);
        (offset, self.places[to as usize] - self.places[from as usize])
    }

    /// Whether a seam of the texture lies between two points that are near each other.
    pub fn has_seam(&self, a: u32, b: u32) -> bool {
        let [Some(of_a), Some(of_b)] = [a, b].map(|point| self.changes.get(point as usize)) else { return false };
        let [number_a, number_b] = [a, b].map(|point| self.atlas.number(self.places[point as usize].to_array()));
        number_a != number_b || jumps(&self.step(a, b), of_a.max(*of_b))
    }

    pub fn len(&self) -> usize {
        self.normals.len()
    }

    /// Whether the tangent planes of two points differ by less than 30 degrees, so that no edge of
    /// the surface lies between.
    pub fn are_smooth(&self, a: u32, b: u32) -> bool {
        self.normals[a as usize].dot(self.normals[b as usize]).abs() > SMOOTH
    }

    /// Whether two points may lie on the same side of one surface. Points on opposite sides of a
    /// thin body, or on faces that meet at a right angle or a sharper one, do not, however close
    /// they are. If normals have no side, any two points may.
    pub fn same_side(&self, a: u32, b: u32) -> bool {
        !self.oriented || self.normals[a as usize].dot(self.normals[b as usize]) > 0.0
    }
}

/// The smallest texture coordinates at each position.
fn places(positions: &DistinctPositions, coordinates: &[[f32; 2]]) -> Vec<[f32; 2]> {
    let mut places = vec![[f32::INFINITY; 2]; if coordinates.is_empty() { 0 } else { positions.len() }];
    for (own, &position) in coordinates.iter().zip(positions.of_point()) {
        let known = &mut places[position as usize];
        if own[0].total_cmp(&known[0]).then(own[1].total_cmp(&known[1])).is_lt() {
            *known = *own;
        }
    }
    places
}

/// A line in a surfel's plane at which the surface ends.
#[derive(Clone, Copy, Debug)]
pub(super) struct End {
    /// The unit direction from the surfel's centre to the line, in the plane.
    pub toward: DVec3,
    /// The distance of the line from the surfel's centre, scaled units; not negative.
    pub distance: f64,
}

/// The clip lines that cut off a part of a surfel but not its centre.
fn ends(surfel: &Surfel, clip: &Clip, scale: f64) -> Vec<End> {
    let [s, t] = [surfel.s, surfel.t].map(|axis| DVec3::from_array(axis.map(f64::from)));
    let end = |line: &[f32; 3]| {
        let [x, y, z] = line.map(f64::from);
        // The gradient of the line's value, x u + y v + z, per world unit.
        let gradient = s * (x / s.length_squared()) + t * (y / t.length_squared());
        let end = End { toward: -gradient.try_normalize()?, distance: z / gradient.length() * scale };
        (z >= 0.0 && end.distance.is_finite() && z <= x.hypot(y)).then_some(end)
    };
    clip.0.iter().filter_map(end).collect()
}

/// The unit normal, computed in f64 so that the cross product of half-axes does not underflow.
fn unit_normal(surfel: &Surfel) -> DVec3 {
    let [s, t] = [surfel.s, surfel.t].map(|axis| DVec3::from_array(axis.map(f64::from)));
    s.cross(t).try_normalize().unwrap_or(DVec3::Z)
}
