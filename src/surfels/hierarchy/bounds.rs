//! What a node shows and holds: its ellipse, its sphere and its cone of normals (Pajarola 2003, sections 3.2 and 3.4). The sphere, by which a cut measures, is
//! larger than what it holds where that does not lie on the node's cap.

use glam::DVec3;
use rayon::prelude::*;

use super::Made;
use super::below::{Below, Disk, Known};
use super::curvature;
use super::lattice::Lattice;
use super::rims::{Bound, Bounding, Curve, ROUNDED_UP, Shape, cone, longest, tilt};
use super::sums::Sums;
use crate::scene::hierarchy::Node;
use crate::scene::{Scene, Surfel};

/// Surfels of a node whose bounds are made by all threads.
const MANY: u64 = 1 << 16;

/// By so many times how far its points lie from a node's cap, root mean square, does a node count as larger than the ball around it, in quadrature: what lies off its cap
/// is what its picture errs by. For as many splats the Dragon's, igea's and autzen's points come nearer to all surfels by 1.1, 0.8 and 0.2 dB with 10, 1.5, 1.2 and 0.0 with
/// this, and 1.9, 2.0 and -0.4 with 30: it is about the largest by which none gets farther.
const OFF_CAP: f64 = 16.0;

/// The most that a node may count as larger than the ball around it, by which it is found to be out of view, too: it is divided a level sooner at most.
const MOST_LARGER: f64 = 2.0;

/// The node of one surfel of `scene`, with its sums; what its f32 centre leaves out comes second.
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

/// The node of more surfels with these sums on `lattice`, which are below `of`; what its f32 centre leaves out comes second. What is right below it is not told yet.
pub(super) fn node<B: Below>(of: B::Key, sums: &Sums, lattice: &Lattice, below: &B, known: &Known) -> Made {
    let Known { origin, oriented, scales, .. } = known;
    let (normal, sided) = sums.normal(*oriented);
    let covariance = sums.covariance(lattice, scales);
    let shape = Shape::of(covariance, normal);
    // As what is stored has it.
    let stored = shape.s.cross(shape.t).normalize();
    let plane = [shape.s.normalize(), shape.t.normalize(), stored];
    let mean = lattice.position(sums.moments.mean());
    let curves = sums.alignment((normal, sided)) >= curvature::LEAST_ALIGNMENT;
    let heights = if curves { curvature::heights(of, below, mean, plane) } else { curvature::FLAT };
    // A paraboloid with its top at the mean would lie off the surface by the mean height: that much to the other side it does not.
    let centers = sums.covariance_of_centers(lattice);
    let top = mean - stored * curvature::mean_height(heights, centers, plane);
    // As a file in world coordinates has it, so that what is read back is the same.
    let top = (origin + top) - origin;
    let rounded = ((origin + top.as_vec3().as_dvec3()) - origin).as_vec3();
    let low = if known.low { top - rounded.as_dvec3() } else { DVec3::ZERO }.as_vec3();
    let center = rounded.as_dvec3() + low.as_dvec3();
    let curve = Curve::of(heights, plane);
    let bounding = Bounding { center, normal: stored, shape, curve, scale: shape.scale() };
    let all = bound(&bounding, (of, sums.moments.count), below, sided);
    let factor = all.rim * ROUNDED_UP;
    let [s, t] = [shape.s, shape.t].map(|axis| (axis * factor).as_vec3().to_array());
    let lengths = [shape.s, shape.t].map(|axis| axis.length() * factor);
    let cap = curvature::cap(heights, lengths);
    let ball = all.radius.max(factor + cap.highest());
    let off = OFF_CAP * curvature::off_cap(heights, [covariance, centers], plane);
    let size = ball.hypot(off).min(MOST_LARGER * ball);
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

/// What bounds all `surfels` below a node: those that could change it are looked at, and what is below a node that could not is passed over. What comes
/// out is what looking at all would, whatever is passed over.
fn bound<B: Below>(of: &Bounding, (key, surfels): (B::Key, u64), below: &B, sided: bool) -> Bound {
    if below.is_leaf(key) || surfels <= MANY {
        return bound_from(of, key, below, sided);
    }
    // By all threads, what is below one node each.
    let mut children = Vec::new();
    below.children(key, |child| children.push((child.key, child.surfels)));
    let one = |child: (B::Key, u64)| bound(of, child, below, sided);
    children.into_par_iter().map(one).reduce(|| Bound::NOTHING, Bound::both)
}

/// That of a set, by one thread.
fn bound_from<B: Below>(of: &Bounding, key: B::Key, below: &B, sided: bool) -> Bound {
    let mut all = Bound::NOTHING;
    let mut open: Vec<(Bound, B::Key)> = Vec::new();
    let push = |key: B::Key, open: &mut Vec<(Bound, B::Key)>| {
        let first = open.len();
        below.children(key, |child| open.push((of.of_node(child.node, child.low), child.key)));
        // What reaches farthest comes first.
        open[first..].sort_by(|a, b| a.0.rim.total_cmp(&b.0.rim));
    };
    // What lies farthest away comes first: then most of the others are of no matter.
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
    // Where normals tell no sides nobody asks how far they turn.
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
