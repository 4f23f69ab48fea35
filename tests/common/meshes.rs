//! Meshes of shapes that have a formula.

use std::collections::HashMap;
use std::f64::consts::TAU;

use epsplat::io::Mesh;
use glam::DVec3;

/// A unit sphere: an octahedron whose faces are split into four `cuts` times, with or without
/// corner normals.
pub fn sphere(cuts: u32, smooth: bool) -> Mesh {
    let mut positions = DVec3::AXES.iter().flat_map(|&axis| [axis, -axis]).collect::<Vec<_>>();
    let mut triangles = Vec::new();
    for (x, y, z) in [0, 1].into_iter().flat_map(|x| [2, 3].into_iter().flat_map(move |y| [(x, y, 4), (x, y, 5)])) {
        // An even number of negative axes keeps the orientation of (x, y, z).
        triangles.push(if (x + y + z) % 2 == 0 { [x, y, z] } else { [x, z, y] });
    }
    for _ in 0..cuts {
        let mut middles = HashMap::new();
        let mut middle = |a: u32, b: u32| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                positions.push((positions[a as usize] + positions[b as usize]).normalize());
                positions.len() as u32 - 1
            })
        };
        triangles = triangles
            .iter()
            .flat_map(|&[a, b, c]| {
                let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
                [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
            })
            .collect();
    }
    let corner = |vertex: u32| positions[vertex as usize].as_vec3().to_array();
    let normals = smooth.then(|| triangles.iter().map(|triangle| triangle.map(corner)).collect());
    Mesh { positions: positions.iter().map(DVec3::to_array).collect(), triangles, normals, ..Mesh::default() }
}

/// A bar along z from -1 to 1, whose profile is a regular polygon with `sides` sides and radius
/// 0.6.
pub fn bar(sides: u32) -> Mesh {
    let at = |k: u32, z: f64| {
        let (sin, cos) = (TAU * f64::from(k) / f64::from(sides)).sin_cos();
        [0.6 * cos, 0.6 * sin, z]
    };
    let positions = (0..sides).flat_map(|k| [at(k, -1.0), at(k, 1.0)]).collect();
    let side = |k: u32| {
        let [a, b] = [2 * k, 2 * ((k + 1) % sides)];
        [[a, b, b + 1], [a, b + 1, a + 1]]
    };
    let ends = (1..sides - 1).flat_map(|k| [[0, 2 * k + 2, 2 * k], [1, 2 * k + 1, 2 * k + 3]]);
    Mesh { positions, triangles: (0..sides).flat_map(side).chain(ends).collect(), ..Mesh::default() }
}
