//! The ellipse, the bounding sphere and the cone of normals of a node (Pajarola 2003, sections 3.2
//! and 3.4). The sphere, by which cuts measure nodes, is larger than necessary where the surfels
//! lie off the node's cap.

use glam::DVec3;
use rayon::prelude::*;

use super::below::{Below, Disk, Known};
use super::curvature;
use super::lattice::Lattice;
use super::rims::{Bound, Bounding, Curve, ROUNDED_UP, Shape, cone, longest, tilt};
use super::sums::Sums;
use super::{Made, NodeBounds};
use crate::scene::hierarchy::Node;
use crate::scene::{Scene, Surfel};

/// A node of more surfels than this is bounded by all threads.
const MANY: u64 = 1 << 16;

/// Weight of the root mean square distance of a node's points from its cap, which is added in
/// quadrature to the radius of its sphere: points off the cap are the error of the node's picture.
///
/// For equal numbers of splats, this weight brings pictures of the Dragon, igea and autzen nearer
/// to those of all surfels. The gains are 1.1, 0.8 and 0.2 dB with a weight of 10; 1.5, 1.2 and 0.0
/// dB with 16; and 1.9, 2.0 and -0.4 dB with 30. So 16 is about the largest weight that makes none
/// of them worse.
const OFF_CAP: f64 = 16.0;

/// The largest factor by which points off the cap enlarge a node's sphere. It is limited because
/// the sphere also decides whether the node is out of view. With this limit, a node is divided at
/// most one level sooner.
const MOST_LARGER: f64 = 2.0;

/// Returns the node of the single surfel `index` of `scene`, whose sums are `sums`, and the part of
/// the node's centre beyond f32.
pub(super) fn of_one(scene: &Scene, index: usize, sums: &Sums, known: &Known) -> Made {
    let Disk { surfel, cap, .. } = Disk::of(scene, index);
    let [s, t] = [surfel.s, surfel.t].map(|axis| DVec3::from_array(axis.map(f64::from)));
    let node = Node {
        surfel,
        cap,
        color: sums.color(&known.scales),
        radius: ((longest([s.dot(s), s.dot(t), t.dot(t)]) + cap.highest()) * ROUNDED_UP) as f32,
        cone: cone(sums.normal(known.oriented).1, tilt(&surfel, &cap).cos()),
        first: index as u32,
        count: 1,
        leaf: true,
    };
    (node, scene.low.get(index).copied().unwrap_or_default())
}

/// Returns the node with the key `of`, and the part of its centre beyond f32. `sums` are the sums
/// of its surfels, with moments on `lattice`.
///
/// The caller sets the node's `first`, `count` and `leaf`.
pub(super) fn node<B: Below>(of: B::Key, sums: &Sums, lattice: &Lattice, below: &B, known: &Known) -> Made {
    let Known { origin, oriented, scales, bounds, .. } = known;
    let (normal, sided) = sums.normal(*oriented);
    let covariance = sums.covariance(lattice, scales);
    let shape = match bounds {
        NodeBounds::Rims => Shape::of(covariance, normal),
        NodeBounds::Squares | NodeBounds::Cones => Shape::of(sums.covariance_of_centers(lattice), normal),
    };
    // The normal of the half-axes as they are stored, rounded.
    let stored = shape.s.cross(shape.t).normalize();
    let plane = [shape.s.normalize(), shape.t.normalize(), stored];
    let mean = lattice.position(sums.moments.mean());
    let curves = !bounds.of_squares() && sums.alignment((normal, sided)) >= curvature::LEAST_ALIGNMENT;
    let heights = if curves { curvature::heights(of, below, mean, plane) } else { curvature::FLAT };
    // A paraboloid with its apex at the mean would lie off the surface by its mean height, so the
    // apex is shifted by as much to the other side.
    let centers = sums.covariance_of_centers(lattice);
    let top = mean - stored * curvature::mean_height(heights, centers, plane);
    // Round as a file in world coordinates does, so that reading it gives the same centre.
    let top = (origin + top) - origin;
    let rounded = ((origin + top.as_vec3().as_dvec3()) - origin).as_vec3();
    let low = if known.low { top - rounded.as_dvec3() } else { DVec3::ZERO }.as_vec3();
    let center = rounded.as_dvec3() + low.as_dvec3();
    let curve = Curve::of(heights, plane);
    let bounding = Bounding { center, normal: stored, shape, curve, scale: shape.scale(), bounds: *bounds };
    let all = bound(&bounding, (of, sums.moments.count), below, sided);
    let factor = all.rim * ROUNDED_UP;
    let [s, t] = [shape.s, shape.t].map(|axis| (axis * factor).as_vec3().to_array());
    let lengths = [shape.s, shape.t].map(|axis| axis.length() * factor);
    let cap = match bounds {
        NodeBounds::Cones if sided => curvature::cone(all.cosine, lengths),
        _ => curvature::cap(heights, lengths),
    };
    let ball = all.radius.max(factor + cap.highest());
    let off = OFF_CAP * curvature::off_cap(heights, [covariance, centers], plane);
    let size = match bounds {
        NodeBounds::Rims => ball.hypot(off).min(MOST_LARGER * ball),
        NodeBounds::Squares | NodeBounds::Cones => ball,
    };
    let node = Node {
        surfel: Surfel { center: rounded.to_array(), s, t },
        cap,
        color: sums.color(scales),
        radius: (size * ROUNDED_UP) as f32,
        cone: cone(sided, all.cosine),
        first: 0,
        count: 0,
        leaf: true,
    };
    (node, low.to_array())
}

/// Bounds all `surfels` below a node. Nodes that cannot change the result are skipped.
fn bound<B: Below>(of: &Bounding, (key, surfels): (B::Key, u64), below: &B, sided: bool) -> Bound {
    if below.is_leaf(key) || surfels <= MANY {
        return bound_from(of, key, below, sided);
    }
    // In parallel over the children.
    let mut children = Vec::new();
    below.children(key, |child| children.push((child.key, child.surfels)));
    let one = |child: (B::Key, u64)| bound(of, child, below, sided);
    children.into_par_iter().map(one).reduce(|| Bound::NOTHING, Bound::both)
}

/// As [`bound`], by one thread.
fn bound_from<B: Below>(of: &Bounding, key: B::Key, below: &B, sided: bool) -> Bound {
    let mut all = Bound::NOTHING;
    let mut open: Vec<(Bound, B::Key)> = Vec::new();
    let push = |key: B::Key, open: &mut Vec<(Bound, B::Key)>| {
        let first = open.len();
        below.children(key, |child| open.push((of.of_node(child.node, child.low), child.key)));
        // The child with the largest rim is last, as `open` is a stack.
        open[first..].sort_by(|a, b| a.0.rim.total_cmp(&b.0.rim));
    };
    // The farthest disk comes first, because most other disks cannot change the bounds after it.
    let mut disks: Vec<(f64, Disk)> = Vec::new();
    let mut look = |key: B::Key, most: &Bound, all: &mut Bound| {
        if most.rim <= all.rim {
            return below.disks(key, |disk| *all = all.both(of.of(&disk, all, most)));
        }
        disks.clear();
        below.disks(key, |disk| disks.push((of.shape.seen(disk.center - of.center).length_squared(), disk)));
        if let Some(farthest) = (0..disks.len()).max_by(|a, b| disks[*a].0.total_cmp(&disks[*b].0)) {
            disks.swap(0, farthest);
        }
        disks.iter().for_each(|(_, disk)| *all = all.both(of.of(disk, all, most)));
    };
    // If normals have no side, a node's cone is -1, so cosines are not needed.
    let asked = |most: Bound| if sided { most } else { Bound { cosine: 1.0, ..most } };
    if below.is_leaf(key) {
        look(key, &asked(Bound::ALL), &mut all)
    } else {
        push(key, &mut open)
    }
    while let Some((most, child)) = open.pop() {
        let most = asked(most);
        let changes = most.rim > all.rim || most.radius > all.radius || most.cosine < all.cosine;
        match changes {
            true if below.is_leaf(child) => look(child, &most, &mut all),
            true => push(child, &mut open),
            false => {}
        }
    }
    all
}
