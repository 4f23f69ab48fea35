#![allow(clippy::unwrap_used)]

use glam::{DVec3, Vec3};

use super::*;
use crate::random::Random;
use crate::scene::{Cap, Surfel};

/// Ellipses at random places around a sphere, in random colours.
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

/// The surfels below a node, as a range.
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
    // The surfels are the scene's.
    assert_eq!(sorted.surfels[17], given.surfels[sorted.provenance.of(17).1 as usize]);
    // Another surfel is another tree.
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
        // Up to where the surface is, if it curves: along the normal.
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

/// Whether sums of products of f32 numbers, which f64 has exactly, say that a corner lies in a node's ellipse: with the rounding of few f64
/// additions, 2^-49 of the largest term, on the safe side.
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
                // Along the node's normal, and along its own, or along one between both.
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
            // What lies off the cap makes it twice as large at most, and one surfel is itself.
            let most = if own.len() == 1 { 1.0 } else { 2.0 } * farthest * (1.0 + 1e-5);
            assert!(f64::from(node.radius) <= most, "{index}: {} {most}", node.radius);
            // Of a flat node over flat disks nothing is added to what is shown.
            assert!(curved || own.len() == 1 || !node.cap.is_flat() || on_the_rim, "{index}");
            looked += usize::from(own.len() > 1);
            tight += usize::from(on_the_rim);
        }
        // A rim is on that of many nodes, shown along one or the other; where a cap bends below a disk, or disks are caps, it is farther than it need be.
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

/// Of a dense surface a node is not much larger than what it stands for: its area against the sum of its disks' that do not overlap.
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
    // An ellipse around a square has pi / 2 of its area, and disks reach out by three quarters of a spacing.
    assert!(worst < 7.0 && sum / (nodes as f32) < 4.0, "{worst} {}", sum / nodes as f32);
}
