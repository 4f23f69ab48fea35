//! The nearest primitive in a tree of boxes, and the nearest point of a triangle.

use glam::{DVec3, Vec3A};
use obvhs::bvh2::Bvh2;

/// Returns the least `squared_distance` over the tree's primitives, and the index of that
/// primitive; +inf and None for an empty tree.
///
/// Each box must contain its primitive, as boxes farther than the best distance so far are skipped.
pub(super) fn nearest(tree: &Bvh2, point: DVec3, squared_distance: impl Fn(usize) -> f64) -> (f64, Option<usize>) {
    let mut least = f64::INFINITY;
    let mut nearest = None;
    let to_box =
        |node: u32| tree.nodes.get(node as usize).map(|found| (box_squared_distance(found.aabb(), point), node));
    let mut open = Vec::with_capacity(64);
    open.extend(to_box(0));
    while let Some((bound, node)) = open.pop() {
        // NaN, from a point that is not finite, is skipped too.
        if bound.partial_cmp(&least) != Some(std::cmp::Ordering::Less) {
            continue;
        }
        let node = &tree.nodes[node as usize];
        if node.is_leaf() {
            let entries = node.first_index as usize..(node.first_index + node.prim_count) as usize;
            for primitive in &tree.primitive_indices[entries] {
                let squared = squared_distance(*primitive as usize);
                if squared < least {
                    (least, nearest) = (squared, Some(*primitive as usize));
                }
            }
        } else {
            let mut children = [to_box(node.first_index), to_box(node.first_index + 1)];
            // The nearer child is popped first.
            children.sort_by(|a, b| b.map_or(0.0, |b| b.0).total_cmp(&a.map_or(0.0, |a| a.0)));
            open.extend(children.into_iter().flatten());
        }
    }
    (least, nearest)
}

fn box_squared_distance(bounds: &obvhs::aabb::Aabb, point: DVec3) -> f64 {
    let [low, high] = [bounds.min, bounds.max].map(|corner: Vec3A| corner.as_dvec3());
    (low - point).max(point - high).max(DVec3::ZERO).length_squared()
}

/// The squared distance of a point from a triangle that has an area.
pub(super) fn triangle_squared_distance(point: DVec3, corners: &[DVec3; 3]) -> f64 {
    let weights = closest_weights(point, corners);
    point.distance_squared(corners[0] * weights.x + corners[1] * weights.y + corners[2] * weights.z)
}

/// The barycentric weights of the point of a triangle that is nearest to `point`. The triangle must
/// have an area.
pub(crate) fn closest_weights(point: DVec3, corners: &[DVec3; 3]) -> DVec3 {
    let [a, b, c] = *corners;
    let normal = (b - a).cross(c - a);
    // Areas of the triangles of the point and each edge, seen along the normal, up to one common
    // factor.
    let area = |from: DVec3, to: DVec3| (to - from).cross(point - from).dot(normal);
    let areas = DVec3::new(area(b, c), area(c, a), area(a, b));
    // Above the triangle the nearest point is the foot of the perpendicular; otherwise it lies on
    // an edge.
    if areas.min_element() >= 0.0 {
        return areas / areas.element_sum();
    }
    let on_edge = |from: usize, to: usize| {
        let (start, edge) = (corners[from], corners[to] - corners[from]);
        let along = ((point - start).dot(edge) / edge.length_squared()).clamp(0.0, 1.0);
        let mut weights = [0.0; 3];
        (weights[from], weights[to]) = (1.0 - along, along);
        (point.distance_squared(start + edge * along), DVec3::from(weights))
    };
    let edges = [on_edge(0, 1), on_edge(1, 2), on_edge(2, 0)];
    let nearest =
        edges.into_iter().fold((f64::INFINITY, DVec3::X), |best, edge| if edge.0 < best.0 { edge } else { best });
    nearest.1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_triangle_is_as_far_as_its_nearest_point() {
        let corners = [DVec3::new(0.1, 0.2, 0.0), DVec3::new(2.0, 0.1, 0.5), DVec3::new(0.4, 1.5, -0.3)];
        let mut state = 1u64;
        let mut next = || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 11) as f64 / (1u64 << 53) as f64
        };
        let (mut faces, mut edges) = (0, 0);
        for _ in 0..300 {
            let point = DVec3::new(4.0 * next() - 1.0, 4.0 * next() - 1.0, 2.0 * next() - 1.0);
            let mut sampled = f64::INFINITY;
            let (mut on_edge, n) = (false, 200);
            for i in 0..=n {
                for j in 0..=n - i {
                    let (u, v) = (f64::from(i) / f64::from(n), f64::from(j) / f64::from(n));
                    let at = corners[0] + (corners[1] - corners[0]) * u + (corners[2] - corners[0]) * v;
                    if point.distance(at) < sampled {
                        (sampled, on_edge) = (point.distance(at), i == 0 || j == 0 || i + j == n);
                    }
                }
            }
            let distance = triangle_squared_distance(point, &corners).sqrt();
            // The nearest sample lies within half a step of the nearest point.
            assert!(distance <= sampled + 1e-12 && sampled < distance.hypot(0.01), "{distance} {sampled}");
            if on_edge { edges += 1 } else { faces += 1 }
        }
        assert!(faces > 20 && edges > 100);
    }
}
