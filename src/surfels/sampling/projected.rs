//! Samples at the points that Tien 2008 uses (section 3.2): points in each voxel, projected onto
//! its triangles. A baseline for [`relax`].
//!
//! The thesis does not say where in a voxel the points are. Here the first one is at the centre.
//! Further ones are spread over the box by adding multiples of the powers of 1 / g, modulo 1, with
//! g⁴ = g + 1 (Roberts 2018, "The unreasonable effectiveness of quasirandom sequences").
//!
//! [`relax`]: mod@super::relax

use glam::DVec3;
use rayon::prelude::*;

use super::surface::{MeshSurface, Place};
use super::voxels::Voxel;
use crate::truth::nearest::closest_weights;

/// The first three powers of 1 / g.
const STEP: DVec3 = DVec3::new(0.819_172_513_396_164_4, 0.671_043_606_703_789_2, 0.549_700_477_901_970_1);

/// Places `quotas` samples in each voxel, each at the nearest point of the triangles that reach
/// into the voxel.
pub(super) fn places(surface: &MeshSurface<'_>, voxels: &[Voxel], quotas: &[usize]) -> Vec<Place> {
    let of_voxel = |(voxel, quota): (&Voxel, &usize)| {
        let point = |k: usize| {
            let share = (DVec3::splat(0.5) + STEP * k as f64).map(f64::fract);
            voxel.bounds.min + voxel.bounds.extent() * share
        };
        (0..*quota).filter_map(|k| nearest(surface, voxel, point(k))).collect::<Vec<_>>()
    };
    voxels.par_iter().zip(quotas).flat_map_iter(of_voxel).collect()
}

fn nearest(surface: &MeshSurface<'_>, voxel: &Voxel, point: DVec3) -> Option<Place> {
    let place = |triangle: u32| {
        let weights = closest_weights(point, &surface.triangles[triangle as usize].corners);
        Place { triangle, weights }
    };
    let places = voxel.patches.iter().map(|patch| place(patch.triangle));
    places.min_by(|a, b| {
        let squared = |place: &Place| surface.point(*place).distance_squared(point);
        squared(a).total_cmp(&squared(b))
    })
}
