//! Sizes of the vertices of a mesh from their triangles, as in QSplat (Rusinkiewicz and Levoy 2000,
//! section 3.1).
//!
//! The sphere around each vertex is as large as the largest bounding circle of the triangles that
//! touch it, so that the spheres at its corners cover each triangle.

use glam::DVec3;

use crate::io::Points;
use crate::{Error, Result};

/// Sets the radii of the vertices of `points`, world units; 0 for vertices without a triangle.
///
/// # Errors
///
/// [`Error::Usage`] if there are no triangles.
pub(crate) fn measure(points: &mut Points) -> Result<()> {
    let Some(faces) = &points.faces else {
        return Err(Error::Usage("--size qsplat needs triangles, and an input has none: take another size".into()));
    };
    let mut radii = vec![0.0f32; points.positions.len()];
    for triangle in &faces.triangles {
        let radius = bounding_circle(triangle.map(|vertex| DVec3::from_array(points.positions[vertex as usize])));
        for &vertex in triangle {
            let own = &mut radii[vertex as usize];
            *own = own.max(radius as f32);
        }
    }
    points.radii = Some(radii);
    Ok(())
}

/// The radius of the smallest circle around a triangle: half the longest edge if the angle opposite
/// is 90 degrees or more, else the circumradius.
fn bounding_circle([a, b, c]: [DVec3; 3]) -> f64 {
    let mut edges = [a.distance(b), b.distance(c), c.distance(a)];
    edges.sort_by(f64::total_cmp);
    let [short, middle, long] = edges;
    if short.hypot(middle) <= long {
        return 0.5 * long;
    }
    short * middle * long / (2.0 * (b - a).cross(c - a).length())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::io::points::Faces;

    #[test]
    fn the_largest_triangle_at_a_vertex_says_its_size() {
        let positions = vec![[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [0.0, 4.0, 0.0], [-1.0, 0.1, 0.0], [9.0, 9.0, 9.0]];
        let faces = Faces { triangles: vec![[0, 1, 2], [0, 2, 3]], normals: None, paint: None };
        let mut points = Points { positions, faces: Some(faces), ..Points::default() };
        measure(&mut points).unwrap();
        let radii = points.radii.unwrap();
        // A right triangle, and an obtuse one whose obtuse angle is not at a shared corner.
        let obtuse = bounding_circle([[0.0, 0.0, 0.0], [0.0, 4.0, 0.0], [-1.0, 0.1, 0.0]].map(DVec3::from_array));
        assert_eq!(radii, [2.5, 2.5, 2.5, obtuse as f32, 0.0]);
        let equal = bounding_circle([DVec3::X, DVec3::Y, DVec3::Z]);
        assert!((equal - (2.0f64 / 3.0).sqrt()).abs() < 1e-15);
        assert!(measure(&mut Points::default()).is_err());
    }
}
