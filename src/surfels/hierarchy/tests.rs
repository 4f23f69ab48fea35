#![allow(clippy::unwrap_used)]

use glam::{DVec3, Vec3};

use super::*;
use crate::random::Random;
use crate::scene::{Cap, Surfel};

/// Ellipses at random places on a sphere, in various colours.
fn scene(count: usize, oriented: bool) -> Scene {
    let mut random = Random::stream(3, 0);
    let mut direction = || Vec3::from_array(std::array::from_fn(|_| random.number() as f32 - 0.5)).normalize();
    let surfels = (0..count)
        .map(|k| {
            let (center, n) = (direction(), direction());
            let normal = (center + 0.3 * n).normalize();
            let s = normal.any_orthonormal_vector() * (0.01 + 0.02 * (k % 7) as f32);
            Surfel::ellipse(center, s, normal.cross(s) * 0.5)
        })
        .collect();
    let colors = Colors::Srgb8((0..count).map(|k| [k as u8, (k / 3) as u8, 200, 255 - (k % 90) as u8]).collect());
    let caps = (0..count).map(|k| Cap([-0.001 * (k % 3) as f32, 0.0, 0.0])).collect();
    Scene { surfels, colors, caps, oriented, ..Scene::default() }
}

/// The range of the surfels below a node.
fn below(hierarchy: &Hierarchy, index: usize) -> std::ops::Range<usize> {
    let node = &hierarchy.nodes[index];
    if node.leaf {
        return node.first as usize..(node.first + node.count) as usize;
    }
    let [first, last] = [node.first, node.first + node.count - 1].map(|child| below(hierarchy, child as usize));
    first.start..last.end
}

#[test]
fn a_tree_is_the_same_for_any_order_and_number_of_threads() {
    let given = scene(6000, true);
    let mut order: Vec<u32> = (0..6000).collect();
    let mut random = Random::stream(8, 0);
    (1..6000).rev().for_each(|k| order.swap(k, (random.number() * (k + 1) as f64) as usize));
    let (sorted, tree) = build(given.clone(), &()).unwrap();
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let (other, again) = one.install(|| build(given.taken(&order), &()).unwrap());
    assert_eq!(tree, again);
    let plain = |scene: Scene| Scene { provenance: Default::default(), ..scene };
    assert_eq!(plain(sorted.clone()), plain(other));
    assert_eq!(Hierarchy::check(&tree.nodes, 6000), Ok(()));
    // Each surfel is that of the given scene to which its provenance points.
    assert_eq!(sorted.surfels[17], given.surfels[sorted.provenance.of(17).1 as usize]);
    // A change of one surfel changes the tree.
    let mut moved = given;
    moved.surfels[5].center[0] += 0.1;
    assert_ne!(build(moved, &()).unwrap().1, tree);
}

#[test]
fn a_node_has_the_mean_of_what_is_below_it() {
    let mut given = scene(3000, true);
    given.colors = Colors::Linear((0..3000).map(|k| given.colors.linear(k)).collect());
    let (scene, tree) = build(given, &()).unwrap();
    for index in (0..tree.nodes.len()).step_by(7) {
        let (node, own) = (&tree.nodes[index], below(&tree, index));
        let count = own.len() as f64;
        let mean = own.clone().map(|k| scene.center(k)).sum::<DVec3>() / count;
        // Where the surface curves, the node's centre is shifted along its normal.
        let beside = DVec3::from_array(node.surfel.center.map(f64::from)) - mean;
        assert!(beside.reject_from(sums::normal_of(&node.surfel)).length() < 4e-7, "{index}");
        assert!(beside.length() < 0.3 * f64::from(node.radius), "{index}");
        let normals = own.clone().map(|k| sums::normal_of(&scene.surfels[k])).sum::<DVec3>().normalize();
        assert!(sums::normal_of(&node.surfel).distance(normals) < 1e-5, "{index}");
        let alpha = own.clone().map(|k| f64::from(scene.colors.linear(k)[3])).sum::<f64>() / count;
        let red = own.map(|k| f64::from(scene.colors.linear(k)[0] * scene.colors.linear(k)[3])).sum::<f64>() / count;
        assert!(
            (f64::from(node.color[3]) - alpha).abs() < 1e-6 && (f64::from(node.color[0]) - red / alpha).abs() < 1e-6
        );
    }
}

/// Whether the point at `offset` certainly lies in a node's ellipse.
///
/// Products of f32 numbers are exact in f64, and few f64 additions round by at most 2^-49 of the
/// largest term; the margin of 1e-14 exceeds that.
fn holds(node: &Surfel, offset: DVec3) -> bool {
    let [s, t] = [node.s, node.t].map(|axis| DVec3::from_array(axis.map(f64::from)));
    let part = |axis: DVec3| (offset.dot(axis).abs() + axis.length() * offset.length() * 1e-14) / axis.length_squared();
    part(s).powi(2) + part(t).powi(2) <= 1.0
}

#[test]
fn nodes_hold_what_is_below_them() {
    for (oriented, curved) in [(true, false), (false, false), (true, true)] {
        let mut given = scene(4000, oriented);
        if !curved {
            given.caps.clear();
        }
        let (scene, tree) = build(given, &()).unwrap();
        let (mut tight, mut looked) = (0, 0);
        for (index, node) in tree.nodes.iter().enumerate() {
            let own = below(&tree, index);
            let center = DVec3::from_array(node.surfel.center.map(f64::from));
            let normal = sums::normal_of(&node.surfel);
            let smaller =
                Surfel { s: node.surfel.s.map(|c| 0.99 * c), t: node.surfel.t.map(|c| 0.99 * c), ..node.surfel };
            let mut on_the_rim = false;
            let mut farthest = f64::from(node.surfel.radius()) + node.cap.highest();
            for k in own.clone() {
                let surfel = &scene.surfels[k];
                let [s, t] = [surfel.s, surfel.t].map(|axis| DVec3::from_array(axis.map(f64::from)));
                let offset = scene.center(k) - center;
                let height = scene.caps.get(k).map_or(0.0, Cap::highest);
                let reach = offset.length() + s.length().max(t.length()) + height;
                assert!(reach <= f64::from(node.radius), "{index}");
                farthest = farthest.max(reach);
                let cosine = sums::normal_of(surfel).dot(normal);
                assert!(cosine >= f64::from(node.cone), "{index}: {cosine} {}", node.cone);
                if own.len() == 1 {
                    assert_eq!(node.surfel, *surfel);
                    continue;
                }
                let mut rim = (0..48).map(|k| f64::from(k) * (std::f64::consts::PI / 24.0));
                let rim: [DVec3; 48] = std::array::from_fn(|_| {
                    rim.next().map_or(offset, |angle| offset + s * angle.cos() + t * angle.sin())
                });
                // Project along the node's normal, and along the disk's own or, if that leans too
                // far, a direction between both.
                let own = sums::normal_of(surfel);
                let up = own.dot(normal);
                let across = (own - up * normal) / up;
                let along = normal + across * (4.0 / across.length()).min(1.0);
                let [s, t] = [node.surfel.s, node.surfel.t].map(|axis| DVec3::from_array(axis.map(f64::from)));
                let part = |point: DVec3, axis: DVec3| point.dot(axis) / axis.length_squared();
                let above = |point: DVec3| point.dot(normal) - node.cap.height(part(point, s), part(point, t));
                for shown in [rim, rim.map(|point| point - along * above(point))] {
                    assert!(shown.iter().all(|point| holds(&node.surfel, *point)), "{index}");
                    on_the_rim |= !shown.iter().all(|point| holds(&smaller, *point));
                }
            }
            // Points off the cap double the radius at most; the node of one surfel has the radius
            // of that surfel.
            let most = if own.len() == 1 { 1.0 } else { 2.0 } * farthest * (1.0 + 1e-5);
            assert!(f64::from(node.radius) <= most, "{index}: {} {most}", node.radius);
            // The ellipse of a flat node over flat disks has no margin: it touches a rim.
            assert!(curved || own.len() == 1 || !node.cap.is_flat() || on_the_rim, "{index}");
            looked += usize::from(own.len() > 1);
            tight += usize::from(on_the_rim);
        }
        // Many ellipses touch a rim in one of the two projections. An ellipse is larger than
        // necessary where the cap bends below a disk, or disks have caps.
        assert!(looked > 1000 && (curved || 6 * tight > looked), "{tight} of {looked}");
        assert!(oriented == tree.nodes.iter().any(|node| node.cone > -1.0));
    }
}

#[test]
fn odd_scenes_have_trees_too() {
    let one = Surfel::disk(Vec3::ONE, Vec3::Z, 0.5);
    for surfels in [vec![one], vec![one; 3], vec![one; 100], vec![Surfel { s: [0.0; 3], t: [0.0; 3], ..one }; 20]] {
        let count = surfels.len();
        let (scene, tree) = build(Scene { surfels, oriented: true, ..Scene::default() }, &()).unwrap();
        assert_eq!(Hierarchy::check(&tree.nodes, count), Ok(()));
        assert_eq!((scene.surfels.len(), tree.nodes.len()), (count, 1));
        assert!(tree.nodes[0].radius.is_finite() && tree.nodes[0].surfel.s.iter().all(|c| c.is_finite()));
    }
    let far = |k: usize| Surfel::disk(Vec3::splat(if k == 9 { 1e17 } else { k as f32 * 0.1 }), Vec3::Z, 0.5);
    let (_, tree) = build(Scene { surfels: (0..10).map(far).collect(), ..Scene::default() }, &()).unwrap();
    assert_eq!(tree.levels(), 3);
    assert!(build(Scene::default(), &()).unwrap_err().to_string().contains("without surfels"));
}

/// On a dense surface an ellipse is not much larger than the area that its disks stand for, a unit
/// square each.
#[test]
fn ellipses_are_tight() {
    let disk = |k: usize| Surfel::disk(Vec3::new((k % 64) as f32, (k / 64) as f32, 0.0), Vec3::Z, 0.75);
    let given = Scene { surfels: (0..64 * 64).map(disk).collect(), oriented: true, ..Scene::default() };
    let (_, tree) = build(given, &()).unwrap();
    let (mut worst, mut sum, mut nodes) = (0f32, 0.0, 0);
    for (index, node) in tree.nodes.iter().enumerate().filter(|(_, node)| !(node.leaf && node.count == 1)) {
        let squares = below(&tree, index).len() as f32;
        let ratio = std::f32::consts::PI * node.surfel.normal().length() / squares;
        (worst, sum, nodes) = (worst.max(ratio), sum + ratio, nodes + 1);
    }
    // An ellipse around a square has pi / 2 times its area, and disks reach beyond it by three
    // quarters of a spacing.
    assert!(worst < 7.0 && sum / (nodes as f32) < 4.0, "{worst} {}", sum / nodes as f32);
}
