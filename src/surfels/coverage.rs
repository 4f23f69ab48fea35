//! Whether the surfels of a scene close its surface.

use glam::DVec3;
use rayon::prelude::*;

use super::estimate::median;
use super::graph::NeighbourGraph;
use super::positions::DistinctPositions;
use super::sizes::offsets;
use crate::scene::{Scene, Surfel};
use crate::{Progress, Result};

/// How many neighbours of a surfel are looked at: those of a square grid.
const NEIGHBOURS: usize = 4;

/// The part of the way to its neighbours that a disk has to reach: from the corner of an equilateral triangle to its middle.
const REACH: f64 = 0.577_350_269_189_625_8;

/// How dense a scene's surfels are, and how much of the surface they cover.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Coverage {
    /// Median distance from a surfel to the nearest one elsewhere, world units.
    pub spacing: f64,
    /// Share of surfels that reach at least 1/sqrt(3) of the way to each of their 4 nearest neighbours, in their own plane.
    /// Disks that do not leave holes even where they lie in equilateral triangles, which is where they cover most.
    pub covered: f64,
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
    let graph = NeighbourGraph::new(&distinct, NEIGHBOURS, progress);
    let spacing = |index| Some(offsets(&distinct, &graph, index, 1).next()?.length() / distinct.scale());
    let spacings = (0..distinct.len() as u32).into_par_iter().filter_map(spacing).collect();
    let covers = |(surfel, &position): (&Surfel, &u32)| {
        let near = offsets(&distinct, &graph, position, NEIGHBOURS).map(|offset| offset / distinct.scale());
        reaches(surfel, near)
    };
    let covered = scene.surfels.par_iter().zip(distinct.of_point()).filter(|pair| covers(*pair)).count();
    Ok(median(spacings).map(|spacing| Coverage { spacing, covered: covered as f64 / scene.surfels.len() as f64 }))
}

/// Whether the disk holds the points at [`REACH`] times the `offsets` from its centre, as far as they are in its plane.
fn reaches(surfel: &Surfel, mut offsets: impl Iterator<Item = DVec3>) -> bool {
    let [s, t] = [surfel.s, surfel.t].map(|axis| DVec3::from_array(axis.map(f64::from)));
    offsets.all(|offset| {
        let (u, v) = (offset.dot(s) / s.length_squared(), offset.dot(t) / t.length_squared());
        REACH * u.hypot(v) <= 1.0
    })
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
        // At the rim of the grid the third and fourth neighbours are farther.
        let (small, large) = (of_radius(0.0572), of_radius(0.0582));
        assert!((small.spacing - 0.1).abs() < 1e-6, "{small:?}");
        assert_eq!(small.covered, 0.0);
        assert!((large.covered - 48.0 * 48.0 / 2500.0).abs() < 1e-12, "{large:?}");
        assert_eq!(of_radius(0.2).covered, 1.0);
        let alone = Points { positions: vec![[1.0; 3]; 4], ..Points::default() };
        assert_eq!(coverage(&build(vec![alone], &()).unwrap().0, &()).unwrap(), None);
    }
}
