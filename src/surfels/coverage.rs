//! Whether the surfels of a scene close its surface.

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::estimate::median;
use super::gaps::Cell;
use super::graph::NeighbourGraph;
use super::neighbours::Neighbour;
use super::positions::DistinctPositions;
use crate::scene::{Clip, Scene, Surfel};
use crate::{Progress, Result};

/// Neighbours that gaps are looked for between. Of a random sampling, 16 know too few of the wide ones.
const NEIGHBOURS: usize = 32;

/// The cosine of the angle between surfels of one side: 60 degrees.
const SAME_SIDE: f64 = 0.5;

/// A gap is closed by a disk that reaches it but for rounding.
const ROUNDING: f64 = 1e-5;

/// How dense a scene's surfels are, and how much of the surface they cover.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Coverage {
    /// Median distance from a surfel to the nearest one elsewhere, world units.
    pub spacing: f64,
    /// Share of surfels around which no gap is open.
    pub covered: f64,
    /// Surfels around which a gap is open: on the way to a corner of a centre's Voronoi cell, in the surfel's plane, is a place that
    /// neither its own disk nor one of its 32 nearest neighbours' reaches. Past a line at which the disk ends nothing is to be reached. At a ragged boundary such a place may lie outside.
    pub open: u64,
}

/// Measures how well the surfels of `scene` cover its surface. None if all are at one position.
///
/// # Errors
///
/// [`Error::Usage`](crate::Error::Usage) for more than 2^32 - 1 surfels.
pub fn coverage(scene: &Scene, progress: &dyn Progress) -> Result<Option<Coverage>> {
    let center = |index: usize| scene.center(index).to_array();
    let centers: Vec<[f64; 3]> = (0..scene.surfels.len()).into_par_iter().map(center).collect();
    let distinct = DistinctPositions::new(&centers, &scene.bounds(), DVec3::ZERO)?;
    drop(centers);
    if distinct.len() < 2 {
        return Ok(None);
    }
    let of_position = disks_of(&distinct, scene);
    let at = |position: u32| of_position.of(position);
    progress.begin("looking for gaps", distinct.len() as u64);
    let mut found = vec![(0.0, false); distinct.len()];
    NeighbourGraph::visit(
        (&distinct, NEIGHBOURS, 0),
        |_| true,
        &mut found,
        progress,
        |position, near| {
            let spacing = near.first().map_or(0.0, |nearest| nearest.squared_distance.sqrt());
            (spacing / distinct.scale(), has_open_gap(&distinct, position, near, at))
        },
    );
    progress.end();
    let open = distinct.of_point().par_iter().filter(|position| found[**position as usize].1).count();
    let covered = 1.0 - open as f64 / scene.surfels.len() as f64;
    let spacing = median(&mut found.into_par_iter().map(|(spacing, _)| spacing).collect::<Vec<_>>());
    Ok(spacing.map(|spacing| Coverage { spacing, covered, open: open as u64 }))
}

/// Whether a gap is open around a position, whose disk and those of its neighbours are those `at` them.
fn has_open_gap<'a>(
    distinct: &DistinctPositions,
    position: u32,
    near: &[Neighbour],
    at: impl Fn(u32) -> &'a [(&'a Surfel, Clip)],
) -> bool {
    let here = at(position);
    let Some(&own) = here.first() else { return false };
    let offsets: Vec<DVec3> =
        near.iter().map(|other| distinct.position(other.index) - distinct.position(position)).collect();
    // Past its lines there is no surface, unless the next surfel of the same side is there.
    let side = |disk: &(&Surfel, Clip)| disk.0.normal().as_dvec3().normalize_or_zero();
    let same_side = |disk: &(&Surfel, Clip)| side(disk).dot(side(&own)) > SAME_SIDE;
    let goes_on = |(other, offset): (&Neighbour, &DVec3)| {
        is_past(own, *offset / distinct.scale()) && at(other.index).iter().any(same_side)
    };
    let ends = !near.iter().zip(&offsets).any(goes_on);
    // Within half the distance of the farthest neighbour all that bounds the cell is known.
    let known = 0.5 * offsets.last().map_or(0.0, |farthest| farthest.length());
    let closed = |place: DVec3| {
        let reached = |disks: &[(&Surfel, Clip)], from: DVec3| {
            disks.iter().any(|disk| reaches(*disk, (place - from) / distinct.scale()))
        };
        ends && is_past(own, place / distinct.scale())
            || reached(here, DVec3::ZERO)
            || near.iter().zip(&offsets).any(|(other, from)| reached(at(other.index), *from))
    };
    let normal = own.0.normal().as_dvec3().normalize_or(DVec3::Z);
    let rim = (1.0 + 10.0 * ROUNDING) * f64::from(own.0.radius()) * distinct.scale();
    let corners = Cell::new(&offsets, normal, (2.0 * known, 0.0));
    let mut corners = corners.closed_corners().filter(|corner| corner.length() <= known);
    corners.any(|corner| !closed(corner) || !closed(corner.clamp_length_max(rim)))
}

/// The disks at each position, the largest first.
struct Disks<'a> {
    all: Vec<(&'a Surfel, Clip)>,
    /// Where those of each position begin in `all`; one more at the end.
    starts: Vec<usize>,
}

impl Disks<'_> {
    fn of(&self, position: u32) -> &[(&Surfel, Clip)] {
        &self.all[self.starts[position as usize]..self.starts[position as usize + 1]]
    }
}

fn disks_of<'a>(distinct: &DistinctPositions, scene: &'a Scene) -> Disks<'a> {
    let mut order: Vec<(u32, u32)> = distinct.of_point().iter().copied().zip(0..).collect();
    let smallness = |surfel: u32| -scene.surfels[surfel as usize].radius();
    order
        .par_sort_unstable_by(|a, b| a.0.cmp(&b.0).then(smallness(a.1).total_cmp(&smallness(b.1))).then(a.1.cmp(&b.1)));
    let mut starts = vec![0; distinct.len() + 1];
    order.iter().for_each(|(position, _)| starts[*position as usize + 1] += 1);
    (0..distinct.len()).for_each(|position| starts[position + 1] += starts[position]);
    let disk = |&(_, surfel): &(u32, u32)| {
        (&scene.surfels[surfel as usize], scene.clips.get(surfel as usize).copied().unwrap_or_default())
    };
    Disks { all: order.iter().map(disk).collect(), starts }
}

/// Whether the disk reaches the point at `offset` from its centre, as far as that is in its plane.
fn reaches((surfel, clip): (&Surfel, Clip), offset: DVec3) -> bool {
    let [s, t] = half_axes(surfel);
    let within = offset.length_squared() <= s.length_squared().max(t.length_squared()) * (1.0 + ROUNDING);
    let at = on_disk([s, t], offset);
    within && at.length() <= 1.0 + ROUNDING && clip.inside(at.x, at.y) >= -ROUNDING
}

/// Whether the surface ends on the way from the disk's centre to the point at `offset`, as its lines say.
fn is_past((surfel, clip): (&Surfel, Clip), offset: DVec3) -> bool {
    let at = on_disk(half_axes(surfel), offset);
    clip.inside(at.x, at.y) < 0.0
}

fn half_axes(surfel: &Surfel) -> [DVec3; 2] {
    [surfel.s, surfel.t].map(|axis| DVec3::from_array(axis.map(f64::from)))
}

fn on_disk([s, t]: [DVec3; 2], offset: DVec3) -> DVec2 {
    DVec2::new(offset.dot(s) / s.length_squared(), offset.dot(t) / t.length_squared())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::io::Points;
    use crate::surfels::build;

    #[test]
    fn disks_on_a_grid_are_counted_from_the_size_that_closes_it() {
        let of_radius = |radius: f32| {
            let points = Points {
                positions: (0..2500).map(|i| [f64::from(i % 50) * 0.1, f64::from(i / 50) * 0.1, 0.0]).collect(),
                normals: Some(vec![[0.0, 0.0, 1.0]; 2500]),
                radii: Some(vec![radius; 2500]),
                ..Points::default()
            };
            coverage(&build(vec![points], &()).unwrap().0, &()).unwrap().unwrap()
        };
        // Half the diagonal of a square of the grid; the rim of the grid is no gap.
        let (small, large) = (of_radius(0.0705), of_radius(0.0709));
        assert!((small.spacing - 0.1).abs() < 1e-6, "{small:?}");
        assert_eq!((small.covered, small.open), (0.0, 2500));
        assert_eq!((large.covered, large.open), (1.0, 0));
        let alone = Points { positions: vec![[1.0; 3]; 4], ..Points::default() };
        assert_eq!(coverage(&build(vec![alone], &()).unwrap().0, &()).unwrap(), None);
    }
}
