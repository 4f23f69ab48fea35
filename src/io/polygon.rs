//! Polygons of a mesh as triangles.

use glam::{DVec2, DVec3};

/// A polygon of more corners is fanned whatever its shape: ears take a time of up to their square, or in bad cases their cube.
const MOST_CORNERS: usize = 1 << 10;

/// The triangles that make up a polygon, by the numbers of its `corners` and wound as it is: two fewer than it has corners.
///
/// It is fanned from its first corner if all those triangles are wound as it is, so if it is convex. Of any other, ears are cut off
/// in the plane that its vector area is normal to (Meisters 1975): triangles at a convex corner that hold no other corner. A polygon
/// that crosses itself may have none left; it is fanned too, as no triangles make it up.
pub(super) fn triangles(corners: &[DVec3]) -> Vec<[usize; 3]> {
    let fan: Vec<_> = (2..corners.len()).map(|last| [0, last - 1, last]).collect();
    let area = |[a, b, c]: [usize; 3]| (corners[b] - corners[a]).cross(corners[c] - corners[a]);
    let whole: DVec3 = fan.iter().copied().map(area).sum();
    let wound_alike = fan.iter().all(|&triangle| area(triangle).dot(whole) >= 0.0);
    // What is no number is not wound at all, and has no ears.
    if wound_alike || corners.len() > MOST_CORNERS || !whole.is_finite() {
        return fan;
    }
    ears(&corners.iter().map(|&corner| flat(corner, whole)).collect::<Vec<_>>()).unwrap_or(fan)
}

/// A point without its coordinate along the axis nearest to `normal`: polygons around it turn left.
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

/// Triangles of a polygon that turns left, cut off one after the other; none where it crosses itself.
fn ears(corners: &[DVec2]) -> Option<Vec<[usize; 3]>> {
    let turn = |a: usize, b: usize, c: usize| (corners[b] - corners[a]).perp_dot(corners[c] - corners[a]);
    let holds = |[a, b, c]: [usize; 3], other: usize| {
        // A polygon with a hole comes back to a corner.
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
        // A corner on a straight line goes last: its triangle has no area, from which it would get no normal.
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

    /// Twice the area of a polygon in the plane z = 0, left turns positive.
    fn double_area(corners: &[DVec3]) -> f64 {
        (0..corners.len()).map(|k| corners[k].cross(corners[(k + 1) % corners.len()]).z).sum()
    }

    fn signed(corners: &[DVec3], triangles: &[[usize; 3]]) -> Vec<f64> {
        triangles.iter().map(|triangle| double_area(&triangle.map(|corner| corners[corner]))).collect()
    }

    fn polygon(corners: &[[f64; 2]]) -> Vec<DVec3> {
        corners.iter().map(|&[x, y]| DVec3::new(x, y, 0.0)).collect()
    }

    /// Those of a star, whose fan from any corner is not wound as it is.
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
        // Bent, and so is a fan.
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
        // A square with a square hole, to which and from which a seam leads; and an arrow with a corner amid a side.
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
        // Which a fan does not give.
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
