//! Smooth normals of a mesh: each corner of a triangle gets the mean normal of the triangles that
//! lie around it without a crease between them.
//!
//! The triangles at a vertex are joined where two of them share a side and their normals differ by
//! at most the angle of creases. All corners of such a fan have one normal, so no side but a crease
//! shows in the shading. Each triangle is weighted by its angle at the vertex, so that the result
//! does not depend on how polygons are cut into triangles (Thürmer and Wüthrich 1998).

use std::cmp::Ordering;

use glam::DVec3;
use rayon::prelude::*;

use crate::sets::Sets;

/// A corner: the number of its triangle and the place in it.
#[derive(Clone, Copy)]
struct Corner {
    triangle: u32,
    place: u8,
}

/// Returns the normals at the corners of `triangles`: unit vectors, or zero where all triangles
/// around have no area.
///
/// `positions` are in world units; vertices with equal positions count as one. `angle` is the
/// largest angle between the normals of two triangles that are joined, degrees. Vertices that do
/// not exist are left out.
pub fn smooth_normals(positions: &[[f64; 3]], triangles: &[[u32; 3]], angle: f64) -> Vec<[[f32; 3]; 3]> {
    let place = |vertex: u32| positions.get(vertex as usize).map_or(DVec3::NAN, |place| DVec3::from_array(*place));
    let facets: Vec<DVec3> = triangles
        .par_iter()
        .map(|corners| {
            let mut places = corners.map(place);
            // The first corner must not depend on the file, as rounding depends on it.
            let order = |k: &usize| places[*k].to_array().map(f64::to_bits);
            let first = (0..3).min_by_key(order).unwrap_or(0);
            places.rotate_left(first);
            let [a, b, c] = places;
            (b - a).cross(c - a).normalize_or_zero()
        })
        .collect();
    let welded = welded(positions);
    let corners = corners_of_vertices(&welded, triangles);
    let fans = corners.par_chunk_by(|a, b| vertex(&welded, triangles, *a) == vertex(&welded, triangles, *b));
    // Two computed normals of one plane may have a cosine that is a rounding below 1.
    let least = angle.to_radians().cos() - 1e-12;
    let of_fans: Vec<(Corner, [f32; 3])> = fans
        .flat_map_iter(|around| {
            let ends = |corner: Corner| {
                let of = triangles[corner.triangle as usize];
                [1, 2].map(|step| welded[of[(usize::from(corner.place) + step) % 3] as usize])
            };
            let sets = joined(around, ends, |triangle| facets[triangle as usize], least);
            let weighted = |corner: &Corner| {
                let of = triangles[corner.triangle as usize];
                let [at, next, last] = [0, 1, 2].map(|step| place(of[(usize::from(corner.place) + step) % 3]));
                let angle = (next - at).angle_between(last - at);
                if angle.is_finite() { facets[corner.triangle as usize] * angle } else { DVec3::ZERO }
            };
            // Sums in the order of their terms do not depend on the order of triangles.
            let mut terms: Vec<(u32, DVec3)> =
                around.iter().zip(&sets).map(|(corner, set)| (*set, weighted(corner))).collect();
            terms.sort_unstable_by(|(a, p), (b, q)| a.cmp(b).then_with(|| in_order(*p, *q)));
            let mut sums = vec![DVec3::ZERO; around.len()];
            terms.into_iter().for_each(|(set, term)| sums[set as usize] += term);
            let normal = move |(corner, set): (&Corner, u32)| {
                (*corner, sums[set as usize].normalize_or_zero().as_vec3().to_array())
            };
            around.iter().zip(sets).map(normal)
        })
        .collect();
    let mut normals = vec![[[0.0; 3]; 3]; triangles.len()];
    of_fans.into_iter().for_each(|(corner, normal)| {
        normals[corner.triangle as usize][usize::from(corner.place)] = normal;
    });
    normals
}

/// Returns for each vertex the first one with the same position.
fn welded(positions: &[[f64; 3]]) -> Vec<u32> {
    // Adding +0 turns -0 into 0.
    let key = |vertex: &u32| positions[*vertex as usize].map(|x| (x + 0.0).to_bits());
    let mut order: Vec<u32> = (0..positions.len() as u32).collect();
    order.par_sort_unstable_by_key(|vertex| (key(vertex), *vertex));
    let mut first = vec![0; positions.len()];
    for same in order.chunk_by(|a, b| key(a) == key(b)) {
        same.iter().for_each(|vertex| first[*vertex as usize] = same[0]);
    }
    first
}

fn vertex(welded: &[u32], triangles: &[[u32; 3]], corner: Corner) -> u32 {
    welded[triangles[corner.triangle as usize][usize::from(corner.place)] as usize]
}

/// Lists the corners of all triangles, those of one vertex together, in the order of triangles.
fn corners_of_vertices(welded: &[u32], triangles: &[[u32; 3]]) -> Vec<Corner> {
    let exists = |triangle: &&[u32; 3]| triangle.iter().all(|vertex| (*vertex as usize) < welded.len());
    let mut corners: Vec<Corner> = triangles
        .iter()
        .enumerate()
        .filter(|(_, triangle)| exists(triangle))
        .flat_map(|(number, _)| [0, 1, 2].map(|place| Corner { triangle: number as u32, place }))
        .collect();
    corners.par_sort_unstable_by_key(|corner| (vertex(welded, triangles, *corner), corner.triangle, corner.place));
    corners
}

/// The most triangles at a side of which each is compared with each.
const FEW: usize = 16;

/// An order of vectors.
fn in_order(p: DVec3, q: DVec3) -> Ordering {
    let each = p.to_array().into_iter().zip(q.to_array()).map(|(a, b)| a.total_cmp(&b));
    each.fold(Ordering::Equal, Ordering::then)
}

/// Returns for each corner around a vertex the number of its fan. `ends` are the other two vertices
/// of a corner's triangle, and `facet` gives a triangle's normal. Two triangles at a side are
/// joined if the cosine between their normals is at least `least`.
fn joined(around: &[Corner], ends: impl Fn(Corner) -> [u32; 2], facet: impl Fn(u32) -> DVec3, least: f64) -> Vec<u32> {
    let numbered = around.iter().zip(0..);
    let mut sides: Vec<(u32, u32)> =
        numbered.flat_map(|(corner, number)| ends(*corner).map(|end| (end, number))).collect();
    sides.sort_unstable();
    let mut sets = Sets::new(around.len());
    for at_side in sides.chunk_by(|a, b| a.0 == b.0) {
        let normal = |number: u32| facet(around[number as usize].triangle);
        let mut numbers: Vec<u32> = at_side.iter().map(|(_, number)| *number).collect();
        numbers.retain(|number| normal(*number) != DVec3::ZERO);
        let mut unite = |a: u32, b: u32| {
            if normal(a).dot(normal(b)) >= least {
                sets.unite(a, b);
            }
        };
        if numbers.len() <= FEW {
            let pairs = numbers.iter().enumerate().flat_map(|(k, a)| numbers[k + 1..].iter().map(move |b| (*a, *b)));
            pairs.for_each(|(a, b)| unite(a, b));
        } else {
            numbers.sort_unstable_by(|a, b| in_order(normal(*a), normal(*b)));
            numbers.windows(2).for_each(|pair| unite(pair[0], pair[1]));
        }
    }
    sets.all()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A roof of two unit squares that meet at the y axis, each `slope` degrees off the horizontal.
    fn roof(slope: f64) -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
        let (sine, cosine) = slope.to_radians().sin_cos();
        let at = |side: f64, y: f64| [side * cosine, y, -sine];
        let positions = vec![at(-1.0, 0.0), [0.0; 3], at(1.0, 0.0), at(-1.0, 1.0), [0.0, 1.0, 0.0], at(1.0, 1.0)];
        (positions, vec![[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4]])
    }

    #[test]
    fn a_crease_is_kept_and_a_smaller_angle_is_blended() {
        // The two sides of this roof meet at 40 degrees.
        let (positions, triangles) = roof(20.0);
        let sharp = smooth_normals(&positions, &triangles, 39.9);
        let (sine, cosine) = 20f64.to_radians().sin_cos();
        for (triangle, normals) in sharp.iter().enumerate() {
            let side = if triangle < 2 { -1.0 } else { 1.0 };
            for normal in normals {
                let off = DVec3::new(side * sine, 0.0, cosine).distance(DVec3::from_array(normal.map(f64::from)));
                assert!(off < 1e-6, "{triangle}: {normal:?}");
            }
        }
        let smooth = smooth_normals(&positions, &triangles, 40.1);
        // Each side has a right angle at the ridge, however it is cut into triangles.
        for (triangle, normals) in smooth.iter().enumerate() {
            for (place, normal) in normals.iter().enumerate() {
                let is_ridge = [1, 4].contains(&triangles[triangle][place]);
                assert_eq!(normal[2] > 0.999_999, is_ridge, "{triangle} {place}: {normal:?}");
            }
        }
    }

    #[test]
    fn equal_positions_count_as_one_vertex() {
        let (positions, triangles) = roof(20.0);
        let apart: Vec<[f64; 3]> = triangles.as_flattened().iter().map(|&vertex| positions[vertex as usize]).collect();
        let numbers: Vec<[u32; 3]> = (0..4).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
        assert_eq!(smooth_normals(&apart, &numbers, 60.0), smooth_normals(&positions, &triangles, 60.0));
    }

    /// A pyramid without a base, each side of it twice with opposite fronts: four triangles at each
    /// edge. Their order and the first corner of each change no bit.
    #[test]
    fn the_order_of_triangles_and_corners_shows_nowhere() {
        let positions = vec![[0.0, 0.0, 0.31], [1.0, 0.1, 0.0], [0.2, 1.0, 0.03], [-1.0, 0.3, 0.0], [0.1, -1.1, 0.0]];
        let sides: Vec<[u32; 3]> = vec![[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 1]];
        let back = sides.iter().map(|[a, b, c]| [*a, *c, *b]);
        let apart: Vec<[u32; 3]> = sides.iter().copied().chain(back).collect();
        let expected = smooth_normals(&positions, &apart, 50.0);
        // The fronts of all sides are joined, and so are the backs.
        assert!(expected[..4].iter().all(|normals| normals[0] == expected[0][0] && normals[0][2] > 0.9));
        for step in 1..8 {
            let order: Vec<usize> = (0..8).map(|k| (k * 5 + step) % 8).collect();
            let turned: Vec<[u32; 3]> = order
                .iter()
                .map(|&k| {
                    let mut corners = apart[k];
                    corners.rotate_left((k + step) % 3);
                    corners
                })
                .collect();
            let normals = smooth_normals(&positions, &turned, 50.0);
            for (at, &k) in order.iter().enumerate() {
                let mut own = normals[at];
                own.rotate_right((k + step) % 3);
                assert_eq!(own, expected[k], "{step} {k}");
            }
        }
    }

    /// The largest angle, degrees, between a smooth normal and that of the sphere, for an
    /// octahedron whose triangles are divided into four this many times.
    fn worst_of_sphere(divisions: usize) -> f64 {
        let mut triangles: Vec<[DVec3; 3]> = Vec::new();
        for (x, y, z) in
            [(1, 1, 1), (1, 1, -1), (1, -1, 1), (1, -1, -1), (-1, 1, 1), (-1, 1, -1), (-1, -1, 1), (-1, -1, -1)]
        {
            let (a, b, c) = (DVec3::X * f64::from(x), DVec3::Y * f64::from(y), DVec3::Z * f64::from(z));
            triangles.push(if x * y * z > 0 { [a, b, c] } else { [a, c, b] });
        }
        for _ in 0..divisions {
            let divided = |[a, b, c]: [DVec3; 3]| {
                let [ab, bc, ca] = [a + b, b + c, c + a].map(DVec3::normalize);
                [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
            };
            triangles = triangles.into_iter().flat_map(divided).collect();
        }
        let positions: Vec<[f64; 3]> = triangles.as_flattened().iter().map(|place| place.to_array()).collect();
        let numbers: Vec<[u32; 3]> = (0..triangles.len() as u32).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
        let normals = smooth_normals(&positions, &numbers, 30.0);
        let worst = normals.as_flattened().iter().zip(&positions).map(|(normal, place)| {
            DVec3::from_array(normal.map(f64::from)).angle_between(DVec3::from_array(*place)).to_degrees()
        });
        worst.fold(0.0, f64::max)
    }

    #[test]
    fn a_finer_sphere_gets_closer_to_its_own_normals() {
        // The error is in proportion to the lengths of sides, which each division halves.
        let errors = [2, 3, 4, 5].map(worst_of_sphere);
        assert!(errors.windows(2).all(|pair| pair[1] < 0.51 * pair[0]) && errors[3] < 0.3, "{errors:?}");
    }
}
