//! Meshes with so few vertices that the disks at them do not look like the mesh.

use glam::DVec3;

use super::estimate::median;
use crate::io::Points;
use crate::scene::body;

/// The median radius, in diagonals of the mesh's box, from which on disks show as disks: about that of a sphere of 500 vertices.
const COARSE: f64 = 0.03;

/// Whether `points` are the vertices of a mesh that is too coarse to be drawn by a disk at each of them: the median radius, in
/// diagonals of their box, if it shows. `sample` in [`sampling`](super::sampling) covers such a mesh.
pub fn coarse(points: &Points) -> Option<f64> {
    let radii = points.radii.as_ref().filter(|_| points.of_mesh)?;
    let (body, _) = body(points.positions.len(), |index| DVec3::from_array(points.positions[index]));
    let given = radii.iter().map(|radius| f64::from(*radius)).filter(|radius| *radius > 0.0);
    let share = median(&mut given.collect::<Vec<_>>())? / body.extent().length();
    (share > COARSE).then_some(share)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn large_disks_of_a_mesh_are_coarse() {
        let of = |radius: f32, of_mesh: bool| {
            let positions = (0..100).map(|k| [f64::from(k), 0.0, 0.0]).collect();
            coarse(&Points { positions, radii: Some(vec![radius; 100]), of_mesh, ..Points::default() })
        };
        assert_eq!(of(9.9, true), Some(f64::from(9.9f32) / 99.0));
        assert_eq!((of(9.9, false), of(2.0, true)), (None, None));
        assert_eq!(coarse(&Points { of_mesh: true, ..Points::default() }), None);
    }
}
