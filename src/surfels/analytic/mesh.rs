//! Triangle meshes of the shapes, with vertices on the surface.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

use super::{Shape, TORUS_MAJOR, TORUS_MINOR};
use crate::io::Mesh;
use crate::scene::Colors;

/// Generates a mesh of about `triangles` triangles with the shape's normals and colours at their
/// corners.
///
/// Triangles are counter-clockwise as seen from the side of the normals. The mesh lists one shell,
/// or one crossing square, after the other.
pub fn mesh(shape: Shape, triangles: u64) -> Mesh {
    let mut mesh = Mesh { normals: Some(Vec::new()), colors: Some(Colors::Srgb8(Vec::new())), ..Mesh::default() };
    let triangles = triangles.max(2) as f64;
    // Round shapes have twice as many columns as rows, squares equally many.
    let (square, round) = ((triangles / 2.0).sqrt().round() as u32, (triangles / 4.0).sqrt().round().max(2.0) as u32);
    let sphere = |radius: f64| {
        move |u: f64, v: f64| {
            let (sin, cos) = (PI * v).sin_cos();
            radius * DVec3::new(sin * (TAU * u).sin(), -cos, sin * (TAU * u).cos())
        }
    };
    match shape {
        Shape::Sphere => add(&mut mesh, shape, [2 * round, round], true, sphere(1.0)),
        Shape::Shells => {
            let round = (triangles / 16.0).sqrt().round().max(2.0) as u32;
            super::SHELLS.iter().for_each(|&radius| add(&mut mesh, shape, [2 * round, round], true, sphere(radius)));
        }
        Shape::Torus => add(&mut mesh, shape, [2 * round, round], true, |u, v| {
            let ((sin_u, cos_u), (sin_v, cos_v)) = ((TAU * u).sin_cos(), (TAU * v).sin_cos());
            let from_axis = TORUS_MAJOR + TORUS_MINOR * cos_v;
            DVec3::new(from_axis * cos_u, from_axis * sin_u, TORUS_MINOR * sin_v)
        }),
        Shape::Plane | Shape::Checkerboard | Shape::Text => {
            add(&mut mesh, shape, [square; 2], false, |u, v| DVec3::new(2.0 * u - 1.0, 2.0 * v - 1.0, 0.0));
        }
        Shape::Crossing => {
            let square = (triangles / 4.0).sqrt().round().max(1.0) as u32;
            add(&mut mesh, shape, [square; 2], false, |u, v| DVec3::new(2.0 * u - 1.0, 2.0 * v - 1.0, 0.0));
            add(&mut mesh, shape, [square; 2], false, |u, v| DVec3::new(0.0, 2.0 * u - 1.0, 2.0 * v - 1.0));
        }
    }
    mesh
}

/// Adds a grid of `columns` x `rows` cells over [0, 1] x [0, 1], which `at` maps to the surface.
/// Triangles without area are left out. If the grid is `closed`, the last column joins the first.
fn add(mesh: &mut Mesh, shape: Shape, [columns, rows]: [u32; 2], closed: bool, at: impl Fn(f64, f64) -> DVec3) {
    let first = mesh.positions.len() as u32;
    let (columns, rows) = (columns.max(1), rows.max(1));
    let across = if closed { columns } else { columns + 1 };
    for row in 0..=rows {
        for column in 0..across {
            let p = at(f64::from(column) / f64::from(columns), f64::from(row) / f64::from(rows));
            mesh.positions.push(p.to_array());
            if let Some(Colors::Srgb8(colors)) = &mut mesh.colors {
                let [r, g, b] = shape.color(p);
                colors.push([r, g, b, 255]);
            }
        }
    }
    let vertex = |column: u32, row: u32| first + row * across + column % across;
    for (row, column) in (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column))) {
        let [a, b] = [vertex(column, row), vertex(column + 1, row)];
        let [d, c] = [vertex(column, row + 1), vertex(column + 1, row + 1)];
        for corners in [[a, b, c], [a, c, d]] {
            let [p, q, r] = corners.map(|vertex| DVec3::from_array(mesh.positions[vertex as usize]));
            // At the poles, corners coincide up to rounding.
            if (q - p).cross(r - p).length() < 1e-15 {
                continue;
            }
            let normal = |p: DVec3| shape.normal(p).as_vec3().to_array();
            mesh.triangles.push(corners);
            mesh.normals.iter_mut().for_each(|normals| normals.push([p, q, r].map(normal)));
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn corners_lie_on_the_shape_and_triangles_face_as_it_does() {
        for (shape, name, _) in Shape::ALL {
            for wanted in [2, 1000, 20_000] {
                let mesh = mesh(shape, wanted);
                mesh.check().unwrap();
                let count = mesh.triangles.len() as f64;
                assert!(wanted < 100 || (0.8..1.1).contains(&(count / wanted as f64)), "{name} {wanted}: {count}");
                assert!(mesh.positions.iter().all(|p| shape.distance(DVec3::from_array(*p)).abs() < 1e-12), "{name}");
                let area = |(corners, normals): (&[u32; 3], &[[f32; 3]; 3])| {
                    let [p, q, r] = corners.map(|vertex| DVec3::from_array(mesh.positions[vertex as usize]));
                    let across = (q - p).cross(r - p);
                    // Where the squares cross, a corner of one may get the normal of the other.
                    let faces = |n: &[f32; 3]| across.dot(DVec3::from_array(n.map(f64::from))) > 0.0;
                    assert!(
                        wanted < 100 || shape == Shape::Crossing || normals.iter().all(faces),
                        "{name} {wanted} {p} {q} {r} {normals:?}"
                    );
                    0.5 * across.length()
                };
                let area: f64 = mesh.triangles.iter().zip(mesh.normals.as_ref().unwrap()).map(area).sum();
                assert!(wanted < 100 || (0.96..1.0001).contains(&(area / shape.area())), "{name} {wanted}: {area}");
            }
        }
    }
}
