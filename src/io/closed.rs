//! Whether a mesh is closed and faces outward, so that its back is not visible from outside.

use crate::sets::Sets;
use glam::DVec3;
use rayon::prelude::*;

/// Whether the `triangles` form closed surfaces that face outward.
///
/// Each edge must belong to exactly two triangles that traverse it in opposite directions, and each
/// connected component must enclose a positive volume. Vertices at equal positions are merged.
pub(crate) fn is_closed(positions: &[[f64; 3]], triangles: &[[u32; 3]]) -> bool {
    if triangles.is_empty() {
        return false;
    }
    let triangles: Vec<[u32; 3]> = match pairs(triangles) {
        true => triangles.to_vec(),
        false => {
            let distinct = distinct(positions);
            let welded = triangles.iter().map(|corners| corners.map(|corner| distinct[corner as usize]));
            let welded: Vec<[u32; 3]> = welded.filter(|[a, b, c]| a != b && b != c && c != a).collect();
            if !pairs(&welded) {
                return false;
            }
            welded
        }
    };
    faces_outward(positions, &triangles)
}

/// Whether every directed edge occurs once, and so does its opposite.
fn pairs(triangles: &[[u32; 3]]) -> bool {
    let edge = |a: u32, b: u32| u64::from(a) << 32 | u64::from(b);
    let edges = |[a, b, c]: &[u32; 3]| [edge(*a, *b), edge(*b, *c), edge(*c, *a)];
    let mut along: Vec<u64> = triangles.par_iter().flat_map_iter(edges).collect();
    along.par_sort_unstable();
    let mut against: Vec<u64> = along.par_iter().map(|edge| edge.rotate_left(32)).collect();
    against.par_sort_unstable();
    along.windows(2).all(|pair| pair[0] != pair[1]) && along == against
}

/// For each vertex, the first vertex at the same position.
pub(crate) fn distinct(positions: &[[f64; 3]]) -> Vec<u32> {
    // Adding +0 turns -0 into 0, so that both compare equal.
    let key = |vertex: u32| positions[vertex as usize].map(|c| (c + 0.0).to_bits());
    let mut order: Vec<u32> = (0..positions.len() as u32).collect();
    order.par_sort_unstable_by_key(|&vertex| (key(vertex), vertex));
    let mut first = vec![0; positions.len()];
    for group in order.chunk_by(|&a, &b| key(a) == key(b)) {
        group.iter().for_each(|&vertex| first[vertex as usize] = group[0]);
    }
    first
}

/// Whether each connected component of the `triangles` encloses a positive volume.
fn faces_outward(positions: &[[f64; 3]], triangles: &[[u32; 3]]) -> bool {
    let mut parts = Sets::new(positions.len());
    for &[a, b, c] in triangles {
        parts.unite(a, b);
        parts.unite(b, c);
    }
    let mut volumes = vec![0.0; positions.len()];
    let mut enclosed = vec![false; positions.len()];
    let at = |vertex: u32| DVec3::from(positions[vertex as usize]);
    for &[a, b, c] in triangles {
        let part = parts.least(a) as usize;
        // Relative to a vertex of the component, so that large coordinates do not cost precision.
        let from = at(part as u32);
        volumes[part] += (at(a) - from).dot((at(b) - from).cross(at(c) - from));
        enclosed[part] = true;
    }
    volumes.iter().zip(enclosed).all(|(volume, is_part)| !is_part || *volume > 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    const CORNERS: [[f64; 3]; 4] = [[1e7, 0.0, 0.0], [1e7 + 1.0, 0.0, 0.0], [1e7, 1.0, 0.0], [1e7, 0.0, 1.0]];
    const OUTWARD: [[u32; 3]; 4] = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];

    #[test]
    fn a_tetrahedron_is_closed_unless_it_has_a_hole_or_faces_inward() {
        assert!(is_closed(&CORNERS, &OUTWARD));
        assert!(!is_closed(&CORNERS, &OUTWARD[1..]));
        assert!(!is_closed(&CORNERS, &OUTWARD.map(|[a, b, c]| [a, c, b])));
        let [[a, b, c], others @ ..] = OUTWARD;
        assert!(!is_closed(&CORNERS, &[[a, c, b], others[0], others[1], others[2]]));
        assert!(!is_closed(&CORNERS, &[OUTWARD, OUTWARD].concat()));
        assert!(!is_closed(&CORNERS, &[]));
    }

    #[test]
    fn vertices_at_one_position_are_one_and_each_part_counts() {
        let soup: Vec<[f64; 3]> = OUTWARD.iter().flatten().map(|corner| CORNERS[*corner as usize]).collect();
        let triangles = [[0, 1, 2], [3, 4, 5], [6, 7, 8], [9, 10, 11]];
        assert!(is_closed(&soup, &triangles));
        // A second tetrahedron beside the first: facing outward, and facing inward.
        let both: Vec<[f64; 3]> = CORNERS.into_iter().chain(CORNERS.map(|[x, y, z]| [x, y, z + 9.0])).collect();
        let with = |other: [[u32; 3]; 4]| [OUTWARD, other.map(|corners| corners.map(|corner| corner + 4))].concat();
        assert!(is_closed(&both, &with(OUTWARD)));
        assert!(!is_closed(&both, &with(OUTWARD.map(|[a, b, c]| [a, c, b]))));
    }
}
