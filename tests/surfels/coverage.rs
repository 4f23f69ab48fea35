//! The uncovered parts of a mesh and the distances of surfels from it, compared with closed forms.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common;

use std::f64::consts::PI;
use std::path::Path;

use common::meshes::sphere;
use common::scenes::generated;
use epsplat::io::{Mesh, Points};
use epsplat::low_level::metrics::{Coverage, SurfaceDistances, coverage};
use epsplat::low_level::scene::Scene;
use epsplat::low_level::surfels::analytic::Shape;
use epsplat::low_level::surfels::{FromPoints, Size, Triangle, build, from_points};
use epsplat::low_level::truth::TriangleTree;

fn square() -> Mesh {
    Mesh {
        positions: vec![[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    }
}

fn seen(mesh: &Mesh, scene: &Scene) -> Coverage {
    coverage(&TriangleTree::new(mesh).unwrap(), scene, 64, 128, &()).unwrap()
}

#[test]
fn a_sphere_is_covered_until_surfels_are_missing() {
    let mesh = sphere(6, false);
    let whole = seen(&mesh, &generated(Shape::Sphere, 5000, |_| true));
    // Each view sees a disk of area pi.
    let expected = 64.0 * PI / whole.ray_spacing.powi(2);
    assert!((whole.seen.rays as f64 / expected - 1.0).abs() < 0.01, "{whole:?}");
    assert!(whole.seen.uncovered == 0 && (whole.views_with_holes, whole.worst_view) == (0, None), "{whole:?}");
    // All views together distribute the rays on a convex surface in proportion to its area. The
    // disks around the missing cap reach into it by their radius, 0.075.
    let cap = |angle: f64| 0.5 * (1.0 - angle.cos());
    for angle in [0.3, 0.8, 0.5 * PI] {
        let holed = seen(&mesh, &generated(Shape::Sphere, 5000, |sample| sample.position[2] < angle.cos()));
        let share = holed.uncovered_share.unwrap();
        // The mesh is closed, so each ray through the hole meets disks of the far side, which must
        // not count.
        assert!(
            cap(angle - 0.08) < share && share < cap(angle),
            "{angle}: {share}, {} to {}",
            cap(angle - 0.08),
            cap(angle)
        );
        // All uncovered rays except those at the outline are holes.
        assert!(holed.hole_share.unwrap() > 0.9 * share);
        let worst = holed.worst_view.unwrap();
        assert!(!holed.is_hole_free() && worst.from[2] > 0.9 && worst.hole_share > 1.5 * share, "{worst:?}");
    }
}

/// Sizes from clusters of three points (paper 001, section 3.3) cover the bunny. One radius for all
/// covers even points only.
#[test]
fn sizes_by_clusters_cover_a_scan() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("data/bunny.obj");
    let mesh = epsplat::io::read_mesh(&file, &()).unwrap();
    let made = |positions: Vec<[f64; 3]>, size: Size| {
        let options = FromPoints { size, ..FromPoints::default() };
        from_points(vec![Points { positions, ..Points::default() }], &options, &()).unwrap()
    };
    let of = |size: Size, factor: f32| {
        let points = made(mesh.positions.clone(), size).points;
        let (mut scene, _) = build(vec![points], &()).unwrap();
        scene.enlarge(factor);
        coverage(&TriangleTree::new(&mesh).unwrap(), &scene, 16, 128, &()).unwrap().hole_share.unwrap()
    };
    for size in [Size::Bsp(Triangle::MeanEdge), Size::Bsp(Triangle::Circumsphere), Size::BspGlobal(Triangle::MeanEdge)]
    {
        let [whole, part] = [1.0, 0.35].map(|factor| of(size, factor));
        // The control: disks a third as large leave holes.
        assert!(whole < 1e-3 && part > 0.01, "{size:?} {whole} {part}");
    }
    let note = |step: f64| {
        let fine = (0..2500).map(|k| [f64::from(k % 50) * 0.2, f64::from(k / 50) * 0.2, 0.0]);
        let coarse = (0..100).map(|k| [20.0 + f64::from(k % 10) * step, f64::from(k / 10) * step, 0.0]);
        let made = made(fine.chain(coarse).collect(), Size::BspGlobal(Triangle::MeanEdge));
        (made.sparse, made.notes().iter().any(|note| note.contains("too sparse for one radius")))
    };
    let ((many, said), (few, _)) = (note(1.0), note(0.2));
    assert!((90..=130).contains(&many) && said && few < 25, "{many} {said} {few}");
}

#[test]
fn a_single_missing_surfel_of_a_sparse_sphere_is_a_hole() {
    // A radius of 0.7 spacings just closes square cells of four samples; this lattice has other
    // cells, so some stay open.
    let scene = |factor: f32| {
        let mut scene = generated(Shape::Sphere, 2000, |_| true);
        for surfel in &mut scene.surfels {
            (surfel.s, surfel.t) = (surfel.s.map(|c| c * factor), surfel.t.map(|c| c * factor));
        }
        scene
    };
    let mesh = sphere(5, false);
    assert!(seen(&mesh, &scene(1.0)).is_hole_free());
    let gaping = seen(&mesh, &scene(0.4));
    // Disks with a radius of 0.6 spacings have 0.36 pi = 1.13 times the surface's area. Circles
    // that cover a plane need 2 pi / sqrt(27) = 1.21 (Kershner 1939), so there are gaps.
    assert!(gaping.hole_share.unwrap() > 0.005 && gaping.views_with_holes == 64, "{gaping:?}");
    let touching = seen(&mesh, &scene(0.2));
    // With a radius of 0.3 spacings the disks do not overlap, and cover 0.09 pi of the surface.
    assert!((touching.uncovered_share.unwrap() - (1.0 - 0.09 * PI)).abs() < 0.02, "{touching:?}");
}

#[test]
fn a_hole_in_a_square_has_its_area() {
    let keep = |radius: f64| generated(Shape::Plane, 20_000, move |s| s.position[0].hypot(s.position[1]) > radius);
    assert!(seen(&square(), &keep(0.0)).is_hole_free());
    // The disks' radius is 0.0212.
    let holed = seen(&square(), &keep(0.4)).uncovered_share.unwrap();
    assert!((PI * 0.375f64.powi(2) / 4.0..PI * 0.4f64.powi(2) / 4.0).contains(&holed), "{holed}");
    // Disks farther from the surface than their radius cover nothing, though a render from the
    // front would show no hole.
    let lifted = |height: f32| {
        let mut scene = keep(0.0);
        scene.surfels.iter_mut().for_each(|surfel| surfel.center[2] = height);
        seen(&square(), &scene).uncovered_share.unwrap()
    };
    assert!(lifted(0.022) == 1.0 && lifted(0.005) < 0.3, "{}", lifted(0.005));
}

#[test]
fn distances_are_those_by_which_surfels_are_moved() {
    let distances =
        |scene: &Scene, mesh: &Mesh| SurfaceDistances::of(scene, mesh, &TriangleTree::new(mesh).unwrap()).unwrap();
    let mut scene = generated(Shape::Plane, 1000, |s| s.position.iter().all(|c| c.abs() < 0.8));
    let on = distances(&scene, &square()).centers_to_mesh.unwrap();
    assert!(on.mean <= on.max && on.max < 1e-14, "{on:?}");
    for (k, surfel) in scene.surfels.iter_mut().enumerate() {
        surfel.center[2] = if k % 50 == 0 { -0.5 } else { 0.25 };
    }
    let moved = distances(&scene, &square());
    let (centers, rims) = (moved.centers_to_mesh.unwrap(), moved.rims_to_mesh.unwrap());
    let far = scene.surfels.len().div_ceil(50) as f64 / scene.surfels.len() as f64;
    assert!((centers.mean - (0.25 + 0.25 * far)).abs() < 1e-12 && centers.rms > centers.mean, "{centers:?}");
    assert!((centers.percentile_99 - 0.5).abs().max((centers.max - 0.5).abs()) < 1e-12, "{centers:?}");
    // The disks are parallel to the square and inside it.
    assert!((rims.mean - centers.mean).abs() < 1e-7);

    // The rim of a tangent disk of radius r is sqrt(1 + r r) - 1 above the unit sphere.
    let scene = generated(Shape::Sphere, 500, |_| true);
    let rims = distances(&scene, &sphere(7, false)).rims_to_mesh.unwrap();
    let expected = f64::from(scene.surfels[0].radius()).hypot(1.0) - 1.0;
    // The facets lie up to 1e-4 inside the sphere.
    assert!((rims.mean - expected).abs() < 1e-4 && (rims.max - expected).abs() < 1.5e-4, "{rims:?} {expected}");

    let nothing = TriangleTree::new(&Mesh::default()).unwrap();
    assert!(SurfaceDistances::of(&scene, &Mesh::default(), &nothing).is_err());
    let unseen = coverage(&nothing, &scene, 2, 8, &()).unwrap();
    assert!((unseen.seen.rays, unseen.uncovered_share) == (0, None) && !unseen.is_hole_free());
    assert!(coverage(&nothing, &scene, 0, 8, &()).is_err() && coverage(&nothing, &scene, 1, 0, &()).is_err());
}
