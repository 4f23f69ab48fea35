//! Triangulation of a mesh's polygons.

use glam::{DVec2, DVec3};

/// The most corners of a polygon for ear clipping, which takes quadratic time, and cubic time at
/// worst. Polygons with more corners become triangle fans, whatever their shape.
const MOST_CORNERS: usize = 1 << 10;

/// Triangulates a polygon: returns `corners.len() - 2` triangles of indices into `corners`, with
/// the polygon's winding.
///
/// The triangles fan out from the first corner if all of them have the polygon's winding, as in a
/// convex polygon. Otherwise ears are cut off in the plane normal to the polygon's vector area:
/// triangles at a convex corner that contain no other corner (Meisters 1975). A polygon that
/// crosses itself may run out of ears; it becomes a fan too, as no triangulation exists.
pub(super) fn triangles(corners: &[DVec3]) -> Vec<[usize; 3]> {
    let fan: Vec<_> = (2..corners.len()).map(|last| [0, last - 1, last]).collect();
    let area = |[a, b, c]: [usize; 3]| (corners[b] - corners[a]).cross(corners[c] - corners[a]);
    let whole: DVec3 = fan.iter().copied().map(area).sum();
    let wound_alike = fan.iter().all(|&triangle| area(triangle).dot(whole) >= 0.0);
    // NaN and infinite corners have no winding and no ears.
    if wound_alike || corners.len() > MOST_CORNERS || !whole.is_finite() {
        return fan;
    }
    ears(&corners.iter().map(|&corner| flat(corner, whole)).collect::<Vec<_>>()).unwrap_or(fan)
}

/// Drops the coordinate along the axis nearest to `normal`, so that a polygon around `normal` turns
/// left.
fn flat(point: DVec3, normal: DVec3) -> DVec2 {
    let DVec3 { x, y, z } = normal.abs();
    let (flat, along) = if z >= x && z >= y {
        (DVec2::new(point.x, point.y), normal.z)
    } else if y >= x {
        (DVec2::new(point.z, point.x), normal.y)
    } else {
        (DVec2::new(point.y, point.z), normal.x)
    };
    if along < 0.0 { DVec2::new(flat.y, flat.x) } else { flat }
}

/// Triangulates a polygon that turns left by cutting off ears. None if the ears run out, as they
/// may if it crosses itself.
fn ears(corners: &[DVec2]) -> Option<Vec<[usize; 3]>> {
    let turn = |a: usize, b: usize, c: usize| (corners[b] - corners[a]).perp_dot(corners[c] - corners[a]);
    let holds = |[a, b, c]: [usize; 3], other: usize| {
        // Corners at the same position do not count: a polygon with a hole visits some corners
        // twice.
        let apart = [a, b, c].iter().all(|&corner| corners[corner] != corners[other]);
        apart && turn(a, b, other) >= 0.0 && turn(b, c, other) >= 0.0 && turn(c, a, other) >= 0.0
    };
    let mut left: Vec<usize> = (0..corners.len()).collect();
    let mut triangles = Vec::with_capacity(left.len().saturating_sub(2));
    while left.len() > 3 {
        let around = |at: usize| [left[(at + left.len() - 1) % left.len()], left[at], left[(at + 1) % left.len()]];
        let is_ear = |at: &usize| {
            let [a, b, c] = around(*at);
            turn(a, b, c) > 0.0 && left.iter().all(|&other| !holds([a, b, c], other))
        };
        // Corners on a straight line are cut last: their triangles have no area, so no normal.
        let is_straight = |at: &usize| {
            let [a, b, c] = around(*at);
            turn(a, b, c) == 0.0
        };
        let ear = (0..left.len()).find(is_ear).or_else(|| (0..left.len()).find(is_straight))?;
        triangles.push(around(ear));
        left.remove(ear);
    }
    triangles.extend(left.first_chunk().copied());
    Some(triangles)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Twice the area of a polygon in the plane z = 0; positive if it turns left.
    fn double_area(corners: &[DVec3]) -> f64 {
        (0..corners.len()).map(|k| corners[k].cross(corners[(k + 1) % corners.len()]).z).sum()
    }

    fn signed(corners: &[DVec3], triangles: &[[usize; 3]]) -> Vec<f64> {
        triangles.iter().map(|triangle| double_area(&triangle.map(|corner| corners[corner]))).collect()
    }

    fn polygon(corners: &[[f64; 2]]) -> Vec<DVec3> {
        corners.iter().map(|&[x, y]| DVec3::new(x, y, 0.0)).collect()
    }

    /// The corners of a star: a fan from any of its corners has triangles of both windings.
    fn star() -> Vec<DVec3> {
        let corner = |k: u32| {
            let radius = if k.is_multiple_of(2) { 1.0 } else { 0.3 };
            radius * DVec3::new((f64::from(k) * 0.6).cos(), (f64::from(k) * 0.6).sin(), 0.0)
        };
        (0..10).map(corner).collect()
    }

    #[test]
    fn convex_polygons_are_fanned() {
        assert_eq!(triangles(&polygon(&[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])), [[0, 1, 2]]);
        let square = polygon(&[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]);
        assert_eq!(triangles(&square), [[0, 1, 2], [0, 2, 3]]);
        // A bent quad still becomes a fan.
        let bent: Vec<_> = square.iter().map(|p| DVec3::new(p.x, p.y, p.x * p.y)).collect();
        assert_eq!(triangles(&bent), [[0, 1, 2], [0, 2, 3]]);
        assert_eq!(triangles(&square[..2]), [[0; 3]; 0]);
    }

    #[test]
    fn concave_polygons_are_made_up_of_triangles_that_are_wound_alike() {
        let comb: Vec<[f64; 2]> = [[0.0, 0.0], [6.0, 0.0]]
            .into_iter()
            .chain((0..6).map(|k| [6.0 - f64::from(k), if k % 2 == 0 { 3.0 } else { 0.5 }]))
            .chain([[0.0, 3.0]])
            .collect();
        // A square with a square hole that a seam connects to the outline, and an arrow with a
        // corner on a straight side.
        let outer = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0], [0.0, 0.0]];
        let hole = [[1.0, 1.0], [1.0, 3.0], [3.0, 3.0], [3.0, 1.0], [1.0, 1.0]];
        let arrow = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [2.0, 2.0], [1.0, 0.3], [0.0, 2.0]];
        let shapes = [polygon(&comb), polygon(&[outer, hole].concat()), polygon(&arrow), star()];
        for (shape, corners) in shapes.iter().enumerate() {
            for first in 0..corners.len() {
                let mut corners = corners.clone();
                corners.rotate_left(first);
                let areas = signed(&corners, &triangles(&corners));
                assert_eq!(areas.len(), corners.len() - 2);
                let sum: f64 = areas.iter().sum();
                assert!((sum - double_area(&corners)).abs() < 1e-12, "{shape} {first}: {areas:?}");
                assert!(areas.iter().all(|&area| area >= 0.0), "{shape} {first}: {areas:?}");
            }
        }
        // A fan has triangles of the wrong winding.
        let fan: Vec<_> = (2..10).map(|last| [0, last - 1, last]).collect();
        assert!(signed(&star(), &fan).iter().any(|&area| area < -0.1));
    }

    #[test]
    fn the_plane_may_be_any() {
        let expected = triangles(&star());
        let axes = [DVec3::X, DVec3::Y, DVec3::Z, DVec3::new(1.0, -2.0, 0.5), DVec3::new(-3.0, 0.1, 0.2)];
        for normal in axes.into_iter().flat_map(|axis| [axis, -axis]) {
            let (right, up) = normal.normalize().any_orthonormal_pair();
            let turned: Vec<_> = star().iter().map(|p| 5.0 + p.x * right + p.y * up).collect();
            assert_eq!(triangles(&turned), expected, "{normal}");
        }
    }

    #[test]
    fn what_has_no_triangles_is_fanned() {
        let bow = polygon(&[[0.0, 0.0], [2.0, 2.0], [2.0, 0.0], [0.0, 1.0]]);
        let beyond = polygon(&[[0.0, 0.0], [f64::NAN, 0.0], [1.0, 1.0], [f64::INFINITY, 1.0]]);
        let one = vec![DVec3::ONE; 4];
        for corners in [bow, beyond, one] {
            assert_eq!(triangles(&corners).len(), 2);
        }
    }
}
