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
//! collinear.

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
/// variance.
fn along_principal_axis(distinct: &DistinctPositions, cluster: &mut [Member]) {
    let at = |member: &Member| distinct.position(member.index);
    let mean = cluster.iter().map(at).sum::<DVec3>() / cluster.len() as f64;
    let largest = cluster.iter().fold(0.0, |m: f64, member| m.max((at(member) - mean).abs().max_element()));
    // Offsets are scaled to at most 1, so that squares are as exact for small clusters as for large
    // ones. Positions are distinct, so `largest` is not 0.
    let (_, axes) = Symmetric3::scatter(cluster.iter().map(|member| (at(member) - mean) / largest)).eigen();
    for member in &mut *cluster {
        member.value = axes[2].dot(at(member) - mean);
    }
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
    let Clusters { triangles, edges } = split_at_means(distinct, triangle, &mut members, progress);
    progress.end();
    match (triangles, edges) {
        ((sum, count), _) if count > 0 => sum / count as f64,
        (_, (sum, count)) if count > 0 => sum / count as f64,
        _ => 0.0,
    }
}

/// Splits a cluster at centroids until its parts have at most three points.
///
/// The recursion depth is limited: each cut leaves points on both sides, and coordinates have too
/// few digits and exponents for thousands of successive cuts that split off only a point or two.
fn split_at_means(
    distinct: &DistinctPositions,
    triangle: Triangle,
    cluster: &mut [Member],
    progress: &dyn Progress,
) -> Clusters {
    let count = cluster.len();
    let at = |member: &Member| distinct.position(member.index);
    if let [a, b, c] = cluster {
        let (b, c) = (at(b) - at(a), at(c) - at(a));
        return match triangle_size(triangle, b, c) {
            Some(size) => Clusters { triangles: (size, 1), ..Clusters::default() },
            None => Clusters { edges: (mean_edge(b, c), 1), ..Clusters::default() },
        };
    }
    if let [a, b] = cluster {
        return Clusters { edges: (at(a).distance(at(b)), 1), ..Clusters::default() };
    }
    if count < 2 {
        return Clusters::default();
    }
    along_principal_axis(distinct, cluster);
    cluster.sort_unstable_by(|a, b| a.value.total_cmp(&b.value).then(a.index.cmp(&b.index)));
    // If the points differ by less than the rounding error of the mean, all may lie on one side of
    // it.
    let middle = match cluster.partition_point(|member| member.value < 0.0) {
        below if below == 0 || below == count => count / 2,
        below => below,
    };
    let (low, high) = cluster.split_at_mut(middle);
    let mut low = || split_at_means(distinct, triangle, low, progress);
    let mut high = || split_at_means(distinct, triangle, high, progress);
    let (low, high) = if count > SEQUENTIAL { rayon::join(low, high) } else { (low(), high()) };
    if count > SEQUENTIAL && count <= 2 * SEQUENTIAL {
        progress.advance(count as u64);
    }
    low.and(high)
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
