//! Sizes from clusters of three points, by binary space partition along principal axes.
//!
//! The source is "a simple scheme to render point-sampled surfaces", section 3.3. A set of points
//! is split by a plane perpendicular to the eigenvector of the largest eigenvalue of the set's
//! covariance. Its parts are split in the same way, until a cluster holds exactly three points that
//! are not collinear. The triangle that they span gives the size of all three. The paper finds such
//! clusters by their eigenvalues l0 <= l1 <= l2: three points have no surface variation, l0 / (l0 +
//! l1 + l2) = 0, and are collinear if l1 is zero as well.
//!
//! The paper does not say where the plane lies. In [`bsp_radii`] it splits off a multiple of three
//! points, as near to the middle as possible, so that all clusters but the last have three points,
//! and the last one up to five.
//!
//! In [`common_radius`] all surfels have one radius, as the section says literally. Planes go
//! through centroids, as in the clustering that it is based on (Pauly et al. 2002), so clusters end
//! with one to three points. The radius is the mean over the clusters of three points that are not
//! collinear. Two rules keep the mean from following a few bad clusters, which the paper's models
//! may not have had. Circumspheres of nearly collinear points do not count ([`NEARLY_COLLINEAR`]),
//! as they may be as large as the model. Three points count only if they were split from a cluster
//! that is nearly a plane ([`MOST_VARIATION`]).

use glam::DVec3;
use rayon::prelude::*;

use super::Triangle;
use crate::Progress;
use crate::surfels::eigen::Symmetric3;
use crate::surfels::positions::DistinctPositions;

/// A position in a cluster. `value` is its coordinate along the axis of the split, and finally its
/// size.
#[derive(Clone, Copy)]
struct Member {
    value: f64,
    index: u32,
}

/// Clusters up to this many points are split by one thread.
const SEQUENTIAL: usize = 4096;

/// A cluster of fewer points than this is not split.
const TWO_TRIANGLES: usize = 6;

/// Below this ratio of the eigenvalues l1 and l2, the rounding of coordinates leaves open whether
/// three points lie on a line, and they count as collinear.
const COLLINEAR: f64 = 1e-12;

/// In [`common_radius`] the circumsphere of three points does not count if l1 is less than this
/// share of the sum of their eigenvalues, which is 0.5 for an equilateral triangle.
///
/// On the Dragon's 435,545 distinct vertices, whose triangles have slivers, the mean diameter is
/// 4 % of the model's diagonal without this rule.
const NEARLY_COLLINEAR: f64 = 0.02;

/// In [`common_radius`] a cluster of three counts only if the surface variation of the cluster that
/// it was split from is at most this; 1/3 is that of a cloud without any direction. Larger ones
/// mix several sheets, or noise.
const MOST_VARIATION: f64 = 0.1;

/// The surface variation of a set of points with these eigenvalues of its covariance, in ascending
/// order: 0 for points of a plane, 1/3 for those of a ball (Pauly et al. 2002).
fn surface_variation([l0, l1, l2]: [f64; 3]) -> f64 {
    let sum = l0 + l1 + l2;
    if sum > 0.0 { (l0 / sum).max(0.0) } else { 0.0 }
}

/// Returns the radius of each position's disk, scaled units, and the number of positions whose
/// cluster is collinear.
///
/// Positions in such a cluster get the mean length of the edges; a position that is alone gets 0.
pub(crate) fn bsp_radii(distinct: &DistinctPositions, triangle: Triangle, progress: &dyn Progress) -> (Vec<f64>, u64) {
    progress.begin("splitting into clusters", distinct.len() as u64);
    let mut members: Vec<Member> =
        (0..distinct.len() as u32).into_par_iter().map(|index| Member { value: 0.0, index }).collect();
    let collinear = split(distinct, triangle, &mut members, progress);
    let mut radii = vec![0.0; distinct.len()];
    for member in &members {
        radii[member.index as usize] = member.value;
    }
    progress.end();
    (radii, collinear)
}

/// Splits a cluster until its parts are small enough and sets the sizes of its members. Returns the
/// number of members in collinear clusters.
fn split(distinct: &DistinctPositions, triangle: Triangle, cluster: &mut [Member], progress: &dyn Progress) -> u64 {
    let count = cluster.len();
    if count < TWO_TRIANGLES {
        return measure(distinct, triangle, cluster);
    }
    along_principal_axis(distinct, cluster);
    let middle = count / TWO_TRIANGLES * (TWO_TRIANGLES / 2);
    cluster.select_nth_unstable_by(middle, |a, b| a.value.total_cmp(&b.value).then(a.index.cmp(&b.index)));
    let (low, high) = cluster.split_at_mut(middle);
    let mut low = || split(distinct, triangle, low, progress);
    let mut high = || split(distinct, triangle, high, progress);
    let (low, high) = if count > SEQUENTIAL { rayon::join(low, high) } else { (low(), high()) };
    if count > SEQUENTIAL && count <= 2 * SEQUENTIAL {
        progress.advance(count as u64);
    }
    low + high
}

/// Sets `value` to the offset of each member from the centroid along the axis of the largest
/// variance. Returns the eigenvalues of the cluster's scatter matrix in ascending order, in an
/// arbitrary unit.
fn along_principal_axis(distinct: &DistinctPositions, cluster: &mut [Member]) -> [f64; 3] {
    let at = |member: &Member| distinct.position(member.index);
    let mean = cluster.iter().map(at).sum::<DVec3>() / cluster.len() as f64;
    let largest = cluster.iter().fold(0.0, |m: f64, member| m.max((at(member) - mean).abs().max_element()));
    // Offsets are scaled to at most 1, so that squares are as exact for small clusters as for large
    // ones. Positions are distinct, so `largest` is not 0.
    let (values, axes) = Symmetric3::scatter(cluster.iter().map(|member| (at(member) - mean) / largest)).eigen();
    for member in &mut *cluster {
        member.value = axes[2].dot(at(member) - mean);
    }
    values
}

/// Sets the sizes of the members of a cluster of up to five points. Returns the number of those in
/// collinear clusters.
fn measure(distinct: &DistinctPositions, triangle: Triangle, cluster: &mut [Member]) -> u64 {
    let corners: Vec<DVec3> = cluster.iter().map(|member| distinct.position(member.index)).collect();
    let mut collinear = 0;
    for (own, member) in corners.iter().zip(cluster) {
        // The edges to the other members. In a cluster of three, the two shortest are all of them.
        let mut edges: Vec<DVec3> =
            corners.iter().map(|corner| corner - own).filter(|edge| *edge != DVec3::ZERO).collect();
        edges.sort_by(|a, b| a.length_squared().total_cmp(&b.length_squared()));
        member.value = match edges[..] {
            [] => 0.0,
            [edge] => {
                collinear += 1;
                edge.length()
            }
            [a, b, ..] => {
                let size = triangle_size(triangle, a, b);
                collinear += u64::from(size.is_none());
                size.unwrap_or_else(|| mean_edge(a, b))
            }
        };
    }
    collinear
}

/// Sums over the clusters of one part of the tree.
#[derive(Clone, Copy, Default)]
struct Clusters {
    /// The sum of the sizes of clusters that span a triangle, and their number.
    triangles: (f64, u64),
    /// The sum of the edge lengths of other clusters, and their number.
    edges: (f64, u64),
}

impl Clusters {
    fn and(self, other: Self) -> Self {
        let add = |a: (f64, u64), b: (f64, u64)| (a.0 + b.0, a.1 + b.1);
        Self { triangles: add(self.triangles, other.triangles), edges: add(self.edges, other.edges) }
    }
}

/// Returns one radius for all positions, scaled units: the mean size of the clusters of three.
///
/// If none spans a triangle, it is the mean length of the edges in clusters; if there are no edges,
/// 0.
pub(crate) fn common_radius(distinct: &DistinctPositions, triangle: Triangle, progress: &dyn Progress) -> f64 {
    progress.begin("splitting into clusters", distinct.len() as u64);
    let mut members: Vec<Member> = (0..distinct.len() as u32).map(|index| Member { value: 0.0, index }).collect();
    let Clusters { triangles, edges } = split_at_means(distinct, triangle, (&mut members, 0.0), progress);
    progress.end();
    match (triangles, edges) {
        ((sum, count), _) if count > 0 => sum / count as f64,
        (_, (sum, count)) if count > 0 => sum / count as f64,
        _ => 0.0,
    }
}

/// Splits a cluster at centroids until its parts have at most three points. `variation` is the
/// surface variation of the cluster that it was split from.
///
/// The recursion depth is limited: each cut leaves points on both sides, and coordinates have too
/// few digits and exponents for thousands of successive cuts that split off only a point or two.
fn split_at_means(
    distinct: &DistinctPositions,
    triangle: Triangle,
    (cluster, variation): (&mut [Member], f64),
    progress: &dyn Progress,
) -> Clusters {
    let count = cluster.len();
    let at = |member: &Member| distinct.position(member.index);
    if let [a, b, c] = cluster {
        let (b, c) = (at(b) - at(a), at(c) - at(a));
        return match triangle_size(triangle, b, c) {
            Some(size) if variation <= MOST_VARIATION && !is_sliver(triangle, (b, c)) => {
                Clusters { triangles: (size, 1), ..Clusters::default() }
            }
            _ => Clusters { edges: (mean_edge(b, c), 1), ..Clusters::default() },
        };
    }
    if let [a, b] = cluster {
        return Clusters { edges: (at(a).distance(at(b)), 1), ..Clusters::default() };
    }
    if count < 2 {
        return Clusters::default();
    }
    let variation = surface_variation(along_principal_axis(distinct, cluster));
    cluster.sort_unstable_by(|a, b| a.value.total_cmp(&b.value).then(a.index.cmp(&b.index)));
    // If the points differ by less than the rounding error of the mean, all may lie on one side of
    // it.
    let middle = match cluster.partition_point(|member| member.value < 0.0) {
        below if below == 0 || below == count => count / 2,
        below => below,
    };
    let (low, high) = cluster.split_at_mut(middle);
    let mut low = || split_at_means(distinct, triangle, (low, variation), progress);
    let mut high = || split_at_means(distinct, triangle, (high, variation), progress);
    let (low, high) = if count > SEQUENTIAL { rayon::join(low, high) } else { (low(), high()) };
    if count > SEQUENTIAL && count <= 2 * SEQUENTIAL {
        progress.advance(count as u64);
    }
    low.and(high)
}

/// Whether the triangle with corners at 0, `a` and `b` is too narrow for its circumsphere to count.
fn is_sliver(triangle: Triangle, (a, b): (DVec3, DVec3)) -> bool {
    triangle == Triangle::Circumsphere && is_nearly_collinear(a, b)
}

fn is_nearly_collinear(a: DVec3, b: DVec3) -> bool {
    let longest = a.length().max(b.length()).max(a.distance(b));
    let corners = [DVec3::ZERO, a / longest, b / longest];
    let mean = corners.iter().sum::<DVec3>() / 3.0;
    let (values, _) = Symmetric3::scatter(corners.into_iter().map(|corner| corner - mean)).eigen();
    values[1] < NEARLY_COLLINEAR * (values[0] + values[1] + values[2])
}

fn mean_edge(a: DVec3, b: DVec3) -> f64 {
    (a.length() + b.length() + a.distance(b)) / 3.0
}

/// The size of the triangle with corners at 0, `a` and `b`; None if they are collinear.
fn triangle_size(triangle: Triangle, a: DVec3, b: DVec3) -> Option<f64> {
    let longest = a.length().max(b.length()).max(a.distance(b));
    // The unit is the longest edge. The scatter matrix has l1 l2 = (doubled area)^2 / 3, and l2 is
    // 1/2 to 2/3, so (doubled area)^2 is l1 / l2 within a third.
    let (a, b) = (a / longest, b / longest);
    let doubled_area = a.cross(b).length();
    if doubled_area * doubled_area <= COLLINEAR {
        return None;
    }
    Some(
        longest
            * match triangle {
                Triangle::MeanEdge => mean_edge(a, b),
                Triangle::Circumsphere => a.length() * b.length() * a.distance(b) / doubled_area,
            },
    )
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::scene::Bounds;

    fn distinct(positions: &[[f64; 3]]) -> DistinctPositions {
        let bounds = Bounds::of(positions.par_iter().map(|position| DVec3::from_array(*position)));
        DistinctPositions::new(positions, &bounds, DVec3::ZERO).unwrap()
    }

    fn variation(points: &[DVec3]) -> f64 {
        let mean = points.iter().sum::<DVec3>() / points.len() as f64;
        surface_variation(Symmetric3::scatter(points.iter().map(|point| point - mean)).eigen().0)
    }

    #[test]
    fn surface_variation_is_0_for_planes_and_a_third_without_direction() {
        let axes = [DVec3::X, DVec3::Y, DVec3::Z];
        let all: Vec<DVec3> = axes.into_iter().flat_map(|axis| [axis, -axis]).collect();
        assert!((variation(&all) - 1.0 / 3.0).abs() < 1e-12);
        assert!(variation(&all[..4]) < 1e-12 && variation(&[DVec3::X, DVec3::Y, DVec3::Z]) < 1e-12);
        // Half as high as wide: variances 1, 1 and 1/4.
        let low: Vec<DVec3> = all.iter().map(|point| *point * DVec3::new(1.0, 1.0, 0.5)).collect();
        assert!((variation(&low) - 0.25 / 2.25).abs() < 1e-12);
        assert_eq!(surface_variation([0.0; 3]), 0.0);
    }

    /// A grid in which every third point has a twin close by, so that many triangles are slivers.
    #[test]
    fn slivers_do_not_determine_the_common_radius() {
        let mut positions = Vec::new();
        for (x, y) in (0..60).flat_map(|x| (0..60).map(move |y| (f64::from(x), f64::from(y)))) {
            let jitter = 1e-4 * (x * 12.9898 + y * 78.233).sin();
            positions.push([x, y + jitter, 0.0]);
            if (x + y) % 3.0 == 0.0 {
                positions.push([x + 0.01, y - jitter, 0.0]);
            }
        }
        let distinct = distinct(&positions);
        let scale = distinct.scale();
        let diameter = common_radius(&distinct, Triangle::Circumsphere, &()) / scale;
        let edge = common_radius(&distinct, Triangle::MeanEdge, &()) / scale;
        assert!((0.7..2.0).contains(&diameter) && (0.6..1.5).contains(&edge), "{diameter} {edge}");
        // The control: each of these slivers counts as a triangle without the rule.
        let (a, b) = (DVec3::new(0.01, 2e-4, 0.0), DVec3::new(1.0, 1e-4, 0.0));
        assert!(is_nearly_collinear(a, b) && triangle_size(Triangle::Circumsphere, a, b).unwrap() > 30.0);
        assert!(!is_nearly_collinear(DVec3::X, DVec3::Y) && !is_nearly_collinear(DVec3::X, DVec3::new(0.5, 0.3, 0.0)));
    }
}
