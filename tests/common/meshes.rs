//! Meshes of shapes that have a formula.

use std::collections::HashMap;

use epsplat::io::Mesh;
use glam::DVec3;

/// The unit sphere as an octahedron whose faces were cut in four `cuts` times, with normals at its corners or without.
pub fn sphere(cuts: u32, smooth: bool) -> Mesh {
    let mut positions = DVec3::AXES.iter().flat_map(|&axis| [axis, -axis]).collect::<Vec<_>>();
    let mut triangles = Vec::new();
    for (x, y, z) in [0, 1].into_iter().flat_map(|x| [2, 3].into_iter().flat_map(move |y| [(x, y, 4), (x, y, 5)])) {
        // An even number of negative half-axes keeps the turn of (x, y, z).
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
