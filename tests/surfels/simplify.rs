//! Simplification of surfels, compared with closed forms.
//!
//! The whole surface must be covered, not only the input points; inputs on which no disk can grow
//! are tested too.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common;

use std::f64::consts::PI;

use common::Random;
use common::meshes::bar;
use common::scenes::generated;
use epsplat::Error;
use epsplat::io::{Mesh, Points};
use epsplat::low_level::metrics::SurfaceDistances;
use epsplat::low_level::metrics::coverage::coverage;
use epsplat::low_level::scene::{Clip, Colors, Scene, Surfel};
use epsplat::low_level::surfels::analytic::{Shape, generate};
use epsplat::low_level::surfels::sampling::voxels::Voxel;
use epsplat::low_level::surfels::sampling::{MeshSurface, Method, Priority, sample};
use epsplat::low_level::surfels::simplify::{
    Options, Report, SplatShape, Tolerance, as_in_the_thesis, grown, simplify, written,
};
use epsplat::low_level::surfels::{Coordinates, build};
use epsplat::low_level::truth::{DiskTree, TriangleTree};
use glam::{DVec3, Vec3};

const DISKS: Options = Options { tolerance: Tolerance::Absolute(0.0), shape: SplatShape::Disk, relaxations: 0 };

fn within(tolerance: f64) -> Options {
    Options { tolerance: Tolerance::Absolute(tolerance), ..DISKS }
}

fn scene(positions: Vec<[f64; 3]>, normals: Option<Vec<[f32; 3]>>) -> Scene {
    build(vec![Points { positions, normals, ..Points::default() }], &()).unwrap().0
}

fn shape(shape: Shape, count: u64) -> Scene {
    generated(shape, count, |_| true)
}

fn run(scene: &Scene, options: Options) -> (Vec<Surfel>, Report) {
    let (simplified, report) = simplify(scene, &options, &()).unwrap();
    assert_eq!(report.selected, simplified.surfels.len() as u64);
    assert_eq!(report.surfels, scene.surfels.len() as u64);
    let [mean, most] = [report.mean_deviation, report.max_deviation];
    assert!(mean <= most && report.selected <= report.before_relaxation, "{report:?}");
    assert!(report.max_deviation <= report.tolerance * (1.0 + 1e-9), "{report:?}");
    (simplified.surfels, report)
}

/// Shrinks a surfel of the result to the size to which it grew; `simplify` writes surfels larger.
fn as_grown(surfel: &Surfel, tolerance: f64) -> Surfel {
    let shrunk = |axis: [f32; 3]| {
        let length = Vec3::from_array(axis).as_dvec3().length();
        axis.map(|c| c * (grown(length, tolerance) / length) as f32)
    };
    Surfel { s: shrunk(surfel.s), t: shrunk(surfel.t), ..*surfel }
}

/// Whether `surfel` is one of `sampled`, unchanged or slightly enlarged.
fn came(surfel: &Surfel, sampled: &[Surfel]) -> bool {
    let along = |own: [f32; 3], other: [f32; 3]| {
        let [own, other] = [own, other].map(|axis| Vec3::from_array(axis).as_dvec3());
        let factor = own.length() / other.length();
        (1.0..1.5).contains(&(factor + 1e-6)) && own.distance(other * factor) < 1e-5 * own.length()
    };
    let same = |other: &Surfel| {
        center(surfel).distance(center(other)) < 1e-6 && along(surfel.s, other.s) && along(surfel.t, other.t)
    };
    sampled.iter().any(same)
}

fn center(surfel: &Surfel) -> DVec3 {
    Vec3::from_array(surfel.center).as_dvec3()
}

/// Disk coordinates (u, v) of `p`, and its height above the disk along the normal, world units.
fn place(surfel: &Surfel, p: DVec3) -> DVec3 {
    let offset = p - center(surfel);
    let [s, t] = [surfel.s, surfel.t].map(|axis| Vec3::from_array(axis).as_dvec3());
    DVec3::new(
        offset.dot(s) / s.length_squared(),
        offset.dot(t) / t.length_squared(),
        offset.dot(s.cross(t).normalize()),
    )
}

/// The number of points spread over the surface that no disk holds.
///
/// A disk, scaled by `shrink`, holds a point above or below it that is at most `height` away.
fn uncovered(surface: Shape, surfels: &[Surfel], shrink: f64, height: f64) -> usize {
    // More points than any test has samples, so most lie between the samples.
    let points = generate(surface, 60_000).map(|sample| DVec3::from_array(sample.position));
    let holds = |surfel: &Surfel, p: DVec3| {
        let at = place(surfel, p);
        at.truncate().length() <= shrink && at.z.abs() <= height
    };
    points.filter(|&p| !surfels.iter().any(|surfel| holds(surfel, p))).count()
}

#[test]
fn a_sphere_needs_as_many_disks_as_its_sagitta_says() {
    let tolerance = 0.004;
    let count = 20_000;
    let sphere = shape(Shape::Sphere, count);
    let (surfels, report) = run(&sphere, within(tolerance));
    assert_eq!(report.beyond_tolerance, 0);
    assert!(report.max_deviation <= tolerance * (1.0 + 1e-6), "{}", report.max_deviation);
    // With the tolerance E, a disk halfway between the heights 1 and 1 - 2 E of a cap has the
    // radius sqrt(1 - (1 - 2 E)²). The first point beyond the disk is at most one spacing farther
    // out.
    let sagitta = (1.0 - (1.0 - 2.0 * tolerance).powi(2)).sqrt();
    let spacing = (Shape::Sphere.area() / count as f64).sqrt();
    let grown = |surfel: &Surfel| f64::from(as_grown(surfel, tolerance).radius());
    let largest = surfels.iter().map(grown).fold(0.0, f64::max);
    let smallest = surfels.iter().map(grown).fold(f64::INFINITY, f64::min);
    assert!(
        smallest >= sagitta - 1e-6 && largest <= sagitta + spacing,
        "{smallest} to {largest}: {sagitta}, {spacing}"
    );
    for surfel in &surfels {
        let distance = center(surfel).length();
        assert!((distance - (1.0 - tolerance)).abs() < 0.25 * tolerance, "{distance}");
        let normal = surfel.normal().as_dvec3().normalize();
        assert!(normal.dot(center(surfel) / distance) > 1.0 - 1e-6);
    }
    // A cap over a disk of radius r has the area 2 pi (1 - sqrt(1 - r^2)). The sphere's area
    // divided by that is a lower bound of the number of disks. Circles that cover a plane overlap
    // by at least 2 pi / sqrt(27) (Kershner 1939); greedy selection needs less than twice that.
    let cap = |radius: f64| 2.0 * PI * (1.0 - (1.0 - radius * radius).sqrt());
    let (fewest, kershner) = (Shape::Sphere.area() / cap(largest), 2.0 * PI / 27f64.sqrt());
    let number = surfels.len() as f64;
    assert!(number >= fewest && number <= 2.0 * kershner * fewest, "{number} of {fewest}");
    // A disk's area is proportional to the tolerance, so a quarter of the tolerance needs four
    // times as many disks.
    let finer = run(&sphere, within(tolerance / 4.0)).0.len() as f64;
    assert!((3.2..5.0).contains(&(finer / number)), "{number}, {finer}");
}

#[test]
fn no_hole_is_left_between_the_points_either() {
    for (surface, count, tolerance) in [(Shape::Sphere, 6_000, 0.004), (Shape::Torus, 12_000, 0.004)] {
        let sampled = shape(surface, count);
        for (splats, relaxations) in [(SplatShape::Disk, 0), (SplatShape::Disk, 3), (SplatShape::Ellipse, 3)] {
            let options = Options { shape: splats, relaxations, ..within(tolerance) };
            let (surfels, _) = run(&sampled, options);
            let surfels: Vec<Surfel> = surfels.iter().map(|surfel| as_grown(surfel, tolerance)).collect();
            // Neighbouring cells are cut in different planes. The factor `grown` allows for
            // the error: the squared ratio of the cells' size to the surface's.
            let grown = 1.005;
            assert_eq!(uncovered(surface, &surfels, grown, 3.0 * tolerance), 0, "{surface:?} {splats:?} {relaxations}");
            // Controls: smaller disks leave holes, and so does leaving out every fourth disk.
            assert!(uncovered(surface, &surfels, 0.85, 3.0 * tolerance) > 0);
            let fewer: Vec<Surfel> = surfels.chunks(4).flat_map(|four| &four[1..]).copied().collect();
            assert!(uncovered(surface, &fewer, grown, 3.0 * tolerance) > 0);
        }
    }
}

#[test]
fn ellipses_and_relaxation_leave_fewer_where_they_can() {
    let number = |scene: &Scene, shape, relaxations| {
        let (_, report) = run(scene, Options { shape, relaxations, ..within(0.002) });
        assert_eq!(report.beyond_tolerance, 0);
        report.selected as f64
    };
    let torus = shape(Shape::Torus, 30_000);
    let disks = number(&torus, SplatShape::Disk, 0);
    assert!(number(&torus, SplatShape::Ellipse, 0) < 0.85 * disks);
    assert!(number(&torus, SplatShape::Disk, 3) < 0.95 * disks);
    // A sphere has the same curvature in all directions, so ellipses have no advantage.
    let sphere = shape(Shape::Sphere, 30_000);
    let ratio = number(&sphere, SplatShape::Ellipse, 0) / number(&sphere, SplatShape::Disk, 0);
    assert!((0.98..1.02).contains(&ratio), "{ratio}");
}

#[test]
fn caps_are_fewer_than_half_of_the_disks_and_leave_no_hole() {
    // A sphere is locally close to a paraboloid; a torus curves both ways.
    for (surface, count, tolerance) in [(Shape::Sphere, 6_000, 0.004), (Shape::Torus, 12_000, 0.004)] {
        let sampled = shape(surface, count);
        let of = |shape: SplatShape| simplify(&sampled, &Options { shape, ..within(tolerance) }, &()).unwrap();
        let ((disks, _), (caps, report)) = (of(SplatShape::Disk), of(SplatShape::Cap));
        assert!(3 * caps.surfels.len() < disks.surfels.len(), "{} {}", caps.surfels.len(), disks.surfels.len());
        assert!(report.max_deviation <= tolerance && report.beyond_tolerance == 0, "{report:?}");
        assert_eq!(caps.caps.len(), caps.surfels.len());
        // Input points lie within the tolerance of a cap; the surface between them may exceed it a
        // little.
        let tree = DiskTree::new(&caps);
        let off = |scene: &DiskTree| {
            let points = generate(surface, 20_000).map(|sample| scene.distance(DVec3::from_array(sample.position)));
            points.fold(0.0, f64::max)
        };
        assert!(off(&tree) < 1.2 * tolerance, "{}", off(&tree));
        // The controls: the same surfels without caps, and one in ten left out.
        let flat = DiskTree::new(&Scene { caps: Vec::new(), ..caps.clone() });
        assert!(off(&flat) > 3.0 * tolerance, "{}", off(&flat));
        let nine = |all: &[usize]| all.chunks(10).flat_map(|ten| ten[1..].to_vec()).collect::<Vec<_>>();
        let kept = nine(&(0..caps.surfels.len()).collect::<Vec<_>>());
        let fewer = Scene {
            surfels: kept.iter().map(|&k| caps.surfels[k]).collect(),
            caps: kept.iter().map(|&k| caps.caps[k]).collect(),
            low: Vec::new(),
            ..caps.clone()
        };
        assert!(off(&DiskTree::new(&fewer)) > 1.2 * tolerance);
    }
}

/// Two sheets of a slab, one spacing apart or less, with normals outward or all upward.
fn slab(gap: f64, outward: bool) -> Scene {
    let (mut positions, mut normals) = (Vec::new(), Vec::new());
    // Different lattices, so that points of one are not exactly above those of the other.
    for (z, up, count) in [(gap, 1.0, 4_000), (0.0, if outward { -1.0 } else { 1.0 }, 3_700)] {
        for sample in generate(Shape::Plane, count) {
            positions.push([sample.position[0], sample.position[1], z]);
            normals.push([0.0, 0.0, up]);
        }
    }
    scene(positions, Some(normals))
}

#[test]
fn splats_do_not_bridge_to_another_sheet() {
    let gap = 0.01;
    let options = within(0.05);
    let (surfels, report) = run(&slab(gap, true), options);
    let off_sheet = |surfels: &[Surfel]| {
        let off = |s: &&Surfel| f64::from(s.center[2]).abs() > 1e-6 && (f64::from(s.center[2]) - gap).abs() > 1e-6;
        surfels.iter().filter(off).count()
    };
    assert_eq!(off_sheet(&surfels), 0);
    assert!(report.max_deviation < 1e-6);
    for (z, up) in [(0.0, -1.0), (gap, 1.0)] {
        let sheet = surfels.iter().filter(|s| s.normal().z * up > 0.0);
        let sheet: Vec<Surfel> = sheet.map(|s| as_grown(s, 0.05)).collect();
        assert!(!sheet.is_empty() && sheet.iter().all(|s| (f64::from(s.center[2]) - z).abs() < 1e-6));
        assert_eq!(uncovered(Shape::Plane, &sheet, 1.0 + 1e-6, 0.02), 0);
    }
    // Control: without opposite normals the sheets are merged.
    assert!(off_sheet(&run(&slab(gap, false), options).0) > 0);
}

#[test]
fn a_surface_with_edges_is_neither_shortened_nor_drawn_out() {
    let plane = shape(Shape::Plane, 10_000);
    let (surfels, report) = run(&plane, within(0.0));
    assert!(report.max_deviation == 0.0 && surfels.len() < 1_000, "{}", surfels.len());
    let surfels: Vec<Surfel> = surfels.iter().map(|s| as_grown(s, 0.0)).collect();
    assert_eq!(uncovered(Shape::Plane, &surfels, 1.0 + 1e-6, 1e-9), 0);
    // The surface extends past the last points by the radius of an input disk, 1.5 spacings. Along
    // the edge, the nearest of these points is at most one spacing away.
    let spacing = (Shape::Plane.area() / 10_000.0).sqrt();
    for surfel in &surfels {
        let grown = f64::from(surfel.radius());
        let past = center(surfel).truncate().abs().max_element() + grown - 1.0;
        assert!(past <= 2.5 * spacing, "{past} of {spacing}");
    }
    // Two faces of a box: no disk extends from one face to the other.
    let (mut positions, mut normals) = (Vec::new(), Vec::new());
    for sample in generate(Shape::Plane, 4_000) {
        let [x, y, _] = sample.position;
        positions.extend([[x, y, 1.0], [1.0, y, x]]);
        normals.extend([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]);
    }
    let (surfels, report) = run(&scene(positions, Some(normals)), within(0.001));
    assert!(report.max_deviation < 1e-6 && surfels.len() < 1_000, "{} {}", surfels.len(), report.max_deviation);
    let top: Vec<Surfel> = surfels.iter().filter(|s| s.normal().z > s.normal().x).copied().collect();
    assert!(top.iter().all(|s| (s.center[2] - 1.0).abs() < 1e-6));
    let flat = |s: Surfel| Surfel { center: [s.center[0], s.center[1], 0.0], ..as_grown(&s, 0.001) };
    let top: Vec<Surfel> = top.into_iter().map(flat).collect();
    assert_eq!(uncovered(Shape::Plane, &top, 1.0 + 1e-6, 1e-5), 0);
}

#[test]
fn at_sharp_edges_each_point_has_a_disk_within_the_tolerance_and_none_is_left_open() {
    let evenly = |surface: &MeshSurface<'_>, voxels: &[Voxel]| Priority::Area.of(surface, voxels);
    let method = Method::Stratified { priority: &evenly, depth: None };
    let tolerance = 0.001;
    let ellipses = Options { shape: SplatShape::Ellipse, relaxations: 2, ..within(tolerance) };
    // Edges of 60 degrees, which no disk spans; and of 120 degrees, where disks must end though the
    // normals are similar.
    for (sides, options) in [(3, within(tolerance)), (6, within(tolerance)), (6, ellipses)] {
        let mesh = bar(sides);
        let (points, _) = sample(&mesh, 6_000, &method, 0, &()).unwrap();
        let positions = points.positions.clone();
        let (sampled, _) = build(vec![points], &()).unwrap();
        let tree = TriangleTree::new(&mesh).unwrap();
        let (simplified, report) = simplify(&sampled, &options, &()).unwrap();
        assert!(report.max_deviation <= tolerance && report.selected < 1500, "{report:?}");
        assert!(report.beyond_tolerance > 0 || sides == 3, "{report:?}");
        let came = |surfel: &Surfel| came(surfel, &sampled.surfels);
        let as_it_grew = |s: &Surfel| if came(s) { *s } else { as_grown(s, tolerance) };
        let surfels: Vec<Surfel> = simplified.surfels.iter().map(as_it_grew).collect();
        let bare = |surfels: &[Surfel]| {
            let holds = |s: &Surfel, p: &[f64; 3]| {
                let at = place(s, DVec3::from_array(*p));
                at.truncate().length() <= 1.0 + 1e-5 && at.z.abs() <= tolerance + 1e-6
            };
            positions.iter().filter(|p| !surfels.iter().any(|s| holds(s, p))).count()
        };
        assert_eq!(bare(&surfels), 0, "{options:?}");
        let seen = |scene: &Scene, side: u32| coverage(&tree, scene, 64, side, &()).unwrap();
        let whole = seen(&simplified, 256);
        assert!(whole.is_hole_free(), "{options:?}: {whole:?}");
        // Without clip lines and at the size to which they grew, which the selection relies on, the
        // disks leave no hole either. Some are written at twice that size: the size of the samples.
        let uncut = |surfels: Vec<Surfel>| Scene { surfels, clips: Vec::new(), ..simplified.clone() };
        let fewer: Vec<Surfel> = surfels.chunks(10).flat_map(|ten| &ten[1..]).copied().collect();
        let least = seen(&uncut(surfels), 128);
        assert!(least.is_hole_free(), "{options:?}: {least:?}");
        // Control: one in ten left out.
        assert!(bare(&fewer) > 0);
        assert!(!seen(&uncut(fewer), 128).is_hole_free());
        // On flat faces disks become as large as the faces and end with them, except those that two
        // lines cannot clip.
        let rims = SurfaceDistances::of(&simplified, &mesh, &tree).unwrap().rims_to_mesh.unwrap();
        let spacing = sampled.surfels.iter().map(|s| f64::from(s.radius())).sum::<f64>() / 6_000.0;
        let largest = simplified.surfels.iter().map(|s| f64::from(s.radius())).fold(0.0, f64::max);
        assert!(rims.percentile_99 < 0.05 * spacing && largest > 6.0 * spacing, "{rims:?} {spacing}");
        // At worst, a disk covers only its own cell, as an input disk does, and is written 1.4
        // times as large.
        let limit = 1.4 * sampled.surfels.iter().map(|s| f64::from(s.radius())).fold(0.0, f64::max);
        assert!(rims.max < limit, "{options:?}: {rims:?} {limit}");
        // Control: disks enlarged by 1.5 stand out more at the edges.
        let longer = |s: &Surfel| Surfel { s: s.s.map(|c| 1.5 * c), t: s.t.map(|c| 1.5 * c), ..*s };
        let surfels = simplified.surfels.iter().map(longer).collect();
        let longer = Scene { surfels, clips: Vec::new(), ..simplified.clone() };
        assert!(SurfaceDistances::of(&longer, &mesh, &tree).unwrap().rims_to_mesh.unwrap().max > limit);
    }
}

/// A closed cylinder along z from -1 to 1 of circumference 2. Its points form the lattice of a
/// plane, its edges are right angles.
fn cylinder(count: u64) -> (Scene, f64) {
    let radius = 1.0 / PI;
    let (mut positions, mut normals) = (Vec::new(), Vec::new());
    for sample in generate(Shape::Plane, count) {
        let [x, y, _] = sample.position;
        let (sin, cos) = (PI * x).sin_cos();
        positions.push([radius * cos, radius * sin, y]);
        normals.push([cos as f32, sin as f32, 0.0]);
        if x.hypot(y) < radius {
            positions.extend([[x, y, 1.0], [x, y, -1.0]]);
            normals.extend([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]);
        }
    }
    let spacing = (Shape::Plane.area() / count as f64).sqrt();
    let radii = Some(vec![1.5 * spacing as f32; positions.len()]);
    let points = Points { positions, normals: Some(normals), radii, ..Points::default() };
    (build(vec![points], &()).unwrap().0, spacing)
}

#[test]
fn ellipses_reach_past_an_edge_no_farther_than_disks_may() {
    let (sampled, spacing) = cylinder(20_000);
    let tolerance = 0.002;
    // Returns how far a disk extends past the end of the cylinder; `whole` below ignores the clip
    // lines.
    let past = |(surfel, clip): (&Surfel, Clip)| {
        let [s, t] = [surfel.s[2], surfel.t[2]].map(f64::from);
        let rim = (0..256).map(|k| (f64::from(k) / 128.0 * PI).sin_cos());
        let along = rim.map(|(v, u)| (s * u + t * v) * clip.reach(u, v) * f64::from(surfel.center[2]).signum());
        f64::from(surfel.center[2]).abs() + along.fold(0.0, f64::max) - 1.0
    };
    let whole = |surfel: &Surfel| past((surfel, Clip::NONE));
    for shape in [SplatShape::Disk, SplatShape::Ellipse] {
        let (simplified, _) = simplify(&sampled, &Options { shape, ..within(tolerance) }, &()).unwrap();
        let Scene { surfels, clips, .. } = simplified;
        // A cell may extend 2.5 spacings past the end. The limit adds eight tolerances, and a fifth
        // of a surfel's radius, by which clipped disks may exceed their cells.
        let radius = f64::from(sampled.surfels.iter().map(|surfel| surfel.radius()).fold(0.0, f32::max));
        let limit = 2.5 * spacing + 8.0 * tolerance + 0.2 * radius;
        let farthest = surfels.iter().zip(clips).map(past).fold(0.0, f64::max);
        assert!(farthest <= limit, "{shape:?}: {farthest} of {limit}");
        // Some ellipses on the cylinder's side extend past its end unless they are clipped, and
        // these are long.
        let ratio = |s: &Surfel| f64::from(Vec3::from_array(s.s).length() / Vec3::from_array(s.t).length()).ln().abs();
        let ending = surfels.iter().filter(|surfel| whole(surfel) > 0.0 && surfel.normal().z.abs() < 0.5);
        let long = ending.clone().filter(|surfel| ratio(surfel) > 3f64.ln()).count();
        assert_eq!(long > 20, shape == SplatShape::Ellipse, "{long}");
        // Control: enlarged by 1.4, ellipses exceed the limit.
        let longer = |s: &Surfel| whole(&Surfel { s: s.s.map(|c| 1.4 * c), t: s.t.map(|c| 1.4 * c), ..*s });
        assert!(shape == SplatShape::Disk || ending.map(longer).fold(0.0, f64::max) > limit);
    }
}

#[test]
fn no_surfel_is_smaller_than_the_one_it_stands_in_for() {
    let mesh = bar(3);
    let evenly = |surface: &MeshSurface<'_>, voxels: &[Voxel]| Priority::Area.of(surface, voxels);
    let (points, _) = sample(&mesh, 2_000, &Method::Stratified { priority: &evenly, depth: None }, 0, &()).unwrap();
    let (sampled, _) = build(vec![points], &()).unwrap();
    let tolerance = 1e-4;
    let (surfels, _) = run(&sampled, within(tolerance));
    let smaller = |surfels: &[Surfel]| {
        let is_smaller = |surfel: &&Surfel| {
            let off = |input: &&Surfel| place(input, center(surfel)).truncate().length();
            let from = sampled.surfels.iter().min_by(|a, b| off(a).total_cmp(&off(b))).unwrap();
            surfel.radius() < 0.999_999 * from.radius()
        };
        surfels.iter().filter(is_smaller).count()
    };
    assert_eq!(smaller(&surfels), 0);
    // Control: at the size to which they grew, some surfels are smaller than the input's.
    assert!(smaller(&surfels.iter().map(|surfel| as_grown(surfel, tolerance)).collect::<Vec<_>>()) > 0);
}

#[test]
fn what_is_written_tells_what_grew() {
    for tolerance in [0.0, 1e-3, 0.1, f64::INFINITY] {
        for length in [1e-6, 0.01, 0.02, 0.1, 0.4, 2.0, 50.0] {
            let larger = written(length, tolerance);
            assert!((1.02..=1.4).contains(&(larger / length)) || larger / length - 1.02 > -1e-12);
            assert!((grown(larger, tolerance) / length - 1.0).abs() < 1e-12, "{length} {tolerance}");
        }
    }
    assert_eq!(written(1.0, 0.025), 1.2);
}

#[test]
fn the_order_of_points_and_the_number_of_threads_change_nothing() {
    let samples: Vec<_> = generate(Shape::Torus, 5_000).collect();
    let mut order: Vec<usize> = (0..samples.len()).collect();
    let result = |order: &[usize]| {
        let points = Points {
            positions: order.iter().map(|&i| samples[i].position).collect(),
            normals: Some(order.iter().map(|&i| samples[i].normal).collect()),
            colors: Some(Colors::Linear(order.iter().map(|&i| [i as f32, 0.5, 1.0, 1.0]).collect())),
            ..Points::default()
        };
        let (scene, _) = build(vec![points], &()).unwrap();
        simplify(&scene, &Options { shape: SplatShape::Ellipse, relaxations: 2, ..within(0.003) }, &()).unwrap()
    };
    let expected = result(&order);
    Random(7).shuffle(&mut order);
    assert_eq!(result(&order), expected);
    for threads in [1, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        assert_eq!(pool.install(|| result(&order)), expected);
    }
}

#[test]
fn inputs_with_nothing_to_grow_on_keep_their_points() {
    let alike = scene(vec![[3.0, 4.0, 5.0]; 5_000], Some(vec![[0.0, 1.0, 0.0]; 5_000]));
    let (surfels, report) = run(&alike, within(0.1));
    assert_eq!((surfels.len(), report.distinct_positions), (1, 1));
    assert!(center(&surfels[0]).distance(DVec3::new(3.0, 4.0, 5.0) - alike.origin) < 1e-6);
    // Normals that cancel: one of them is kept.
    let both: Vec<[f32; 3]> = (0..100).map(|i| [0.0, 0.0, if i % 2 == 0 { 1.0 } else { -1.0 }]).collect();
    let (surfels, _) = run(&scene(vec![[0.0; 3]; 100], Some(both)), within(0.1));
    assert!(surfels.len() == 1 && surfels[0].normal().z.abs() > 0.0);
    for count in 1..=3 {
        let few = (0..count).map(|i| [f64::from(i), f64::from(i * i), 0.0]).collect();
        let (surfels, _) = run(&scene(few, None), within(0.0));
        assert!((1..=count as usize).contains(&surfels.len()));
    }
    // Distant points with different normals: no disk of the sphere can hold such a point, and none
    // grows toward one.
    let mut positions: Vec<[f64; 3]> = generate(Shape::Sphere, 2_000).map(|sample| sample.position).collect();
    let lone = [[50.0, 0.0, 0.0], [0.0, -70.0, 1.0], [20.0, 20.0, 90.0]];
    positions.extend(lone);
    let normals = positions.iter().map(|&p| DVec3::from_array(p).normalize().as_vec3().to_array()).collect();
    let sampled = scene(positions, Some(normals));
    let (surfels, _) = run(&sampled, within(0.02));
    for p in lone {
        let at = surfels.iter().filter(|s| (center(s) + sampled.origin).distance(DVec3::from_array(p)) < 1e-3).count();
        assert_eq!(at, 1, "{p:?}");
    }
    let largest = surfels.iter().max_by(|a, b| a.radius().total_cmp(&b.radius())).unwrap();
    assert!(largest.radius() < 2.0 && surfels.len() < 300, "{largest:?} of {}", surfels.len());
    // A point that is not finite, and points on a line.
    let odd = vec![[f64::NAN, 0.0, 0.0], [0.0; 3], [1.0, 0.0, 0.0], [0.0, f64::INFINITY, 0.0]];
    assert!(!run(&scene(odd, None), within(0.5)).0.is_empty());
    let line: Vec<[f64; 3]> = (0..500).map(|i| [f64::from(i), 0.0, 0.0]).collect();
    let (surfels, _) = run(&scene(line.clone(), None), within(0.1));
    for p in line {
        assert!(surfels.iter().any(|s| place(s, DVec3::from_array(p)).truncate().length() <= 1.0));
    }
}

#[test]
fn colours_are_means_over_what_is_covered() {
    let samples: Vec<_> = generate(Shape::Plane, 5_000).collect();
    let color = |x: f64| if x < 0.0 { [4.0, 0.0, 0.0, 1.0] } else { [0.0, 0.0, 2.0, 1.0] };
    let points = Points {
        positions: samples.iter().map(|sample| sample.position).collect(),
        normals: Some(samples.iter().map(|sample| sample.normal).collect()),
        colors: Some(Colors::Linear(samples.iter().map(|sample| color(sample.position[0])).collect())),
        ..Points::default()
    };
    let (sampled, _) = build(vec![points], &()).unwrap();
    let (simplified, _) = simplify(&sampled, &within(0.01), &()).unwrap();
    let mut mixed = 0;
    for (index, surfel) in simplified.surfels.iter().enumerate() {
        let [r, g, b, a] = simplified.colors.linear(index).map(f64::from);
        // The shares of red and blue in the colour.
        let (red, blue) = (r / 4.0, b / 2.0);
        assert!((red + blue - 1.0).abs() < 1e-5 && g == 0.0 && (a - 1.0).abs() < 1e-6);
        let (x, radius) = (f64::from(surfel.center[0]), f64::from(as_grown(surfel, 0.01).radius()));
        if x.abs() > radius {
            assert_eq!(red.round(), f64::from(u8::from(x < 0.0)));
            assert!(red.min(blue) < 1e-6);
        } else if x.abs() < 0.5 * radius && radius > 0.2 {
            // The fraction of a disk beyond a chord.
            let c = x / radius;
            let share = (c.acos() - c * (1.0 - c * c).sqrt()) / PI;
            assert!((red - share).abs() < 0.1, "{red} {share}");
            mixed += 1;
        }
    }
    assert!(mixed > 0);
}

/// The selection of Tien 2008: for every point there is a disk whose centre is at most `ratio`
/// radii away, and whose plane is at most the tolerance away.
///
/// It needs more disks than `simplify`, and fewer with a greater ratio. The order of points does
/// not matter.
#[test]
fn disks_as_in_the_thesis_conquer_every_point() {
    let (tolerance, sphere) = (0.004, shape(Shape::Sphere, 6_000));
    let by = |scene: &Scene, ratio: f64| {
        let (disks, _, report) = as_in_the_thesis((scene, &Coordinates::default()), tolerance, ratio, &()).unwrap();
        (disks, report)
    };
    let (disks, report) = by(&sphere, 0.6);
    assert_eq!((report.selected, report.surfels), (disks.surfels.len() as u64, 6_000));
    assert!(report.max_deviation <= tolerance * (1.0 + 1e-9) && report.mean_deviation < 0.5 * tolerance, "{report:?}");
    for sample in &sphere.surfels {
        let conquers = |disk: &Surfel| {
            let offset = center(sample) - center(disk);
            let height = offset.dot(disk.normal().as_dvec3().normalize()).abs();
            offset.length() <= 0.6 * f64::from(disk.radius()) * (1.0 + 1e-6) && height <= tolerance * (1.0 + 1e-5)
        };
        assert!(disks.surfels.iter().any(conquers), "{sample:?}");
    }
    let [few, many] = [0.9, 0.4].map(|ratio| by(&sphere, ratio).1.selected);
    let ours = run(&sphere, within(tolerance)).1.selected;
    assert!(ours < few && few < report.selected && report.selected < many, "{ours} {few} {} {many}", report.selected);
    let mut other = sphere.clone();
    Random(4).shuffle(&mut other.surfels);
    let [mut a, mut b] =
        [disks.surfels, by(&other, 0.6).0.surfels].map(|all| all.into_iter().map(|s| s.center).collect::<Vec<_>>());
    [&mut a, &mut b].into_iter().for_each(|all| all.sort_by(|a, b| a.partial_cmp(b).unwrap()));
    assert_eq!(a, b);
    // With so few points, all are neighbours.
    let three = scene(vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], Some(vec![[0.0, 0.0, 1.0]; 3]));
    assert_eq!(by(&three, 1.0).1.selected, 1);
}

/// Disks as in the thesis keep the texture coordinates of the points from which they grew, with
/// slopes that cross no seam.
#[test]
fn disks_as_in_the_thesis_keep_texture_coordinates() {
    // u = x / 2 + 1 / 2 with a seam at x = 0.4, from where on it is 0.3 less; v = 1 / 2 - y / 2.
    let place = |at: DVec3| [0.5 + 0.5 * at.x - if at.x > 0.4 { 0.3 } else { 0.0 }, 0.5 - 0.5 * at.y];
    let plane = shape(Shape::Plane, 2500);
    let wave = |at: DVec3| DVec3::new(at.x, at.y, 0.006 * (9.0 * at.x).sin());
    let mut waved = plane.clone();
    for (surfel, flat) in waved.surfels.iter_mut().zip(&plane.surfels) {
        surfel.center = wave(center(flat)).as_vec3().to_array();
    }
    let centers = waved.surfels.iter().map(|surfel| place(center(surfel)).map(|c| c as f32)).collect();
    let coordinates = Coordinates { centers, slopes: vec![[[0.0; 3]; 2]; 2500], ..Coordinates::default() };
    let (disks, kept, _) = as_in_the_thesis((&waved, &coordinates), 0.004, 0.6, &()).unwrap();
    let count = disks.surfels.len();
    assert!((10..2200).contains(&count) && kept.centers.len() == count && kept.slopes.len() == count, "{count}");
    let mut straight = 0;
    for ((disk, own), [along_u, along_v]) in disks.surfels.iter().zip(&kept.centers).zip(&kept.slopes) {
        let expected = place(center(disk));
        assert!((f64::from(own[0]) - expected[0]).abs() + (f64::from(own[1]) - expected[1]).abs() < 1e-5, "{disk:?}");
        // A disk that reaches no other point on its side of the seam has no slopes.
        if [along_u, along_v].iter().all(|slope| **slope == [0.0; 3]) {
            continue;
        }
        // Slopes across the seam would be as steep as its jump.
        assert!((along_u[0] - 0.5).abs() < 0.1 && (along_v[1] + 0.5).abs() < 0.05, "{disk:?} {along_u:?} {along_v:?}");
        straight += usize::from((along_u[0] - 0.5).abs() < 0.02);
    }
    assert!(straight > count / 2, "{straight} of {count}");
    let (_, none, _) = as_in_the_thesis((&waved, &Coordinates::default()), 0.004, 0.6, &()).unwrap();
    assert_eq!(none, Coordinates::default());
}

#[test]
fn tolerances_are_read_and_refused() {
    assert_eq!("rel:0.001".parse::<Tolerance>().unwrap(), Tolerance::Relative(0.001));
    assert_eq!("abs:2".parse::<Tolerance>().unwrap(), Tolerance::Absolute(2.0));
    for bad in ["", "1", "rel:", "abs:-1", "abs:nan", "abs:inf", "radius:1"] {
        assert!(matches!(bad.parse::<Tolerance>(), Err(Error::Usage(_))), "{bad}");
    }
    let plane = shape(Shape::Plane, 100);
    for bad in [-1.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(simplify(&plane, &within(bad), &()), Err(Error::Usage(_))));
    }
    let diagonal = plane.bounds().extent().length();
    let relative = simplify(&plane, &Options { tolerance: Tolerance::Relative(0.01), ..DISKS }, &()).unwrap();
    assert_eq!(relative, simplify(&plane, &within(0.01 * diagonal), &()).unwrap());
}

#[test]
fn larger_surfels_end_where_those_did_that_they_stand_for() {
    let evenly = |surface: &MeshSurface<'_>, voxels: &[Voxel]| Priority::Area.of(surface, voxels);
    let method = Method::Stratified { priority: &evenly, depth: None };
    for sides in [3, 4] {
        let mesh = bar(sides);
        let tree = TriangleTree::new(&mesh).unwrap();
        let (points, _) = sample(&mesh, 6_000, &method, 0, &()).unwrap();
        let unclipped = Points { clips: None, axes: None, ..points.clone() };
        let [with, without] = [points, unclipped].map(|points| build(vec![points], &()).unwrap().0);
        let (simplified, report) = simplify(&with, &within(0.001), &()).unwrap();
        let (control, report_without) = simplify(&without, &within(0.001), &()).unwrap();
        // Disks clipped at two edges may grow past them, so fewer are needed.
        assert!(report.selected < report_without.selected / 2, "{report:?} {report_without:?}");
        let rims = |scene: &Scene| SurfaceDistances::of(scene, &mesh, &tree).unwrap().rims_to_mesh.unwrap();
        let spacing = with.surfels.iter().map(|s| f64::from(s.radius())).sum::<f64>() / 6_000.0;
        let (ours, theirs) = (rims(&simplified), rims(&Scene { clips: Vec::new(), ..control }));
        assert!(ours.mean < 0.7 * theirs.mean && ours.percentile_99 < 0.8 * spacing, "{ours:?} {theirs:?} {spacing}");
        assert!(coverage(&tree, &simplified, 64, 128, &()).unwrap().is_hole_free());
        // The control: without clip lines, the simplified surfels extend past the edges.
        assert!(rims(&Scene { clips: Vec::new(), ..simplified }).mean > 3.0 * ours.mean);
    }
}

#[test]
fn no_surfel_fills_the_notch_of_a_face() {
    // An L-shaped prism from z = 0 to 1: the square [-1, 1] without its upper right quarter.
    let outline = [[-1.0, -1.0], [1.0, -1.0], [1.0, 0.0], [0.0, 0.0], [0.0, 1.0], [-1.0, 1.0]];
    let positions = [0.0, 1.0].into_iter().flat_map(|z| outline.map(|[x, y]| [x, y, z])).collect();
    let mut triangles = Vec::new();
    for k in 0..6u32 {
        let next = (k + 1) % 6;
        triangles.extend([[k, next, next + 6], [k, next + 6, k + 6]]);
    }
    for [a, b, c] in [[0, 1, 2], [0, 2, 3], [0, 3, 5], [3, 4, 5]] {
        triangles.extend([[a, c, b], [a + 6, b + 6, c + 6]]);
    }
    let mesh = Mesh { positions, triangles, ..Mesh::default() };
    let tree = TriangleTree::new(&mesh).unwrap();
    let evenly = |surface: &MeshSurface<'_>, voxels: &[Voxel]| Priority::Area.of(surface, voxels);
    let (points, _) = sample(&mesh, 6_000, &Method::Stratified { priority: &evenly, depth: None }, 0, &()).unwrap();
    let (sampled, _) = build(vec![points], &()).unwrap();
    let (simplified, report) = simplify(&sampled, &within(0.001), &()).unwrap();
    let rims = SurfaceDistances::of(&simplified, &mesh, &tree).unwrap().rims_to_mesh.unwrap();
    let largest = sampled.surfels.iter().map(|s| f64::from(s.radius())).fold(0.0, f64::max);
    assert!(rims.max < 1.4 * largest, "{rims:?} {largest}");
    assert!(report.selected < 300 && coverage(&tree, &simplified, 64, 128, &()).unwrap().is_hole_free(), "{report:?}");
}
