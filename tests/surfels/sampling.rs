//! Sampling of meshes: even, by priority, on the surface and without holes, compared with the
//! uniform baseline.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common;

use std::f64::consts::PI;
use std::path::Path;

use common::meshes::{bar, sphere};
use epsplat::Error;
use epsplat::io::{Mesh, Points, Texture};
use epsplat::low_level::metrics::{SurfaceDistances, coverage};
use epsplat::low_level::scene::{Cap, Clip, Colors, Scene};
use epsplat::low_level::surfels::sampling::voxels::Voxel;
use epsplat::low_level::surfels::sampling::{MeshSurface, Method, Priority, Sampling, sample};
use epsplat::low_level::surfels::{build, curve};
use epsplat::low_level::truth::TriangleTree;
use glam::DVec3;

fn stratified(mesh: &Mesh, count: usize, priority: Priority, depth: Option<u32>, seed: u64) -> (Points, Sampling) {
    let priority = |surface: &MeshSurface<'_>, voxels: &[Voxel]| priority.of(surface, voxels);
    sample(mesh, count, &Method::Stratified { priority: &priority, depth }, seed, &()).unwrap()
}

fn by(mesh: &Mesh, count: usize, priority: Priority) -> Points {
    stratified(mesh, count, priority, None, 0).0
}

fn uniform(mesh: &Mesh, count: usize) -> Points {
    sample(mesh, count, &Method::Uniform, 0, &()).unwrap().0
}

/// The distance of each point to its nearest neighbour.
fn spacings(points: &Points) -> Vec<f64> {
    let all: Vec<DVec3> = points.positions.iter().map(|p| DVec3::from(*p)).collect();
    let nearest = |(i, a): (usize, &DVec3)| {
        let others = all.iter().enumerate().filter(|(j, _)| *j != i);
        others.map(|(_, b)| a.distance(*b)).fold(f64::INFINITY, f64::min)
    };
    all.iter().enumerate().map(nearest).collect()
}

/// The rectangle [0, 2] x [0, 1] of two quads; the right one is divided into `cuts` x `cuts`.
fn strip(cuts: u32) -> Mesh {
    let mut mesh = Mesh::default();
    let mut quad = |low: [f64; 2], size: f64| {
        let first = mesh.positions.len() as u32;
        for [x, y] in [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]] {
            mesh.positions.push([low[0] + size * x, low[1] + size * y, 0.0]);
        }
        mesh.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
    };
    quad([0.0, 0.0], 1.0);
    for k in 0..cuts * cuts {
        let at = [k % cuts, k / cuts].map(|c| f64::from(c) / f64::from(cuts));
        quad([1.0 + at[0], at[1]], 1.0 / f64::from(cuts));
    }
    mesh
}

fn right_of(points: &Points, x: f64) -> usize {
    points.positions.iter().filter(|p| p[0] > x).count()
}

#[test]
fn the_bunny_is_sampled_better_than_by_independent_points() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("data/bunny.obj");
    let mesh = epsplat::io::read_mesh(&path, &()).unwrap();
    let tree = TriangleTree::new(&mesh).unwrap();
    let measured = |points: Points| {
        assert_eq!(points.positions.len(), 5000);
        let (scene, _) = build(vec![points], &()).unwrap();
        let distances = SurfaceDistances::of(&scene, &mesh, &tree).unwrap();
        (distances, coverage(&tree, &scene, 64, 128, &()).unwrap())
    };
    let (ours, seen) = measured(by(&mesh, 5000, Priority::default()));
    let (theirs, seen_theirs) = measured(uniform(&mesh, 5000));
    // Both sets of samples lie on the triangles up to the rounding of f32 coordinates.
    for distances in [&ours, &theirs] {
        assert!(distances.centers_to_mesh.unwrap().max < 1e-6 * tree.radius());
    }
    // Distances from the mesh to the nearest centre. Independent points have a mean of 0.5 /
    // sqrt(density), a hexagonal lattice, which is optimal, has 0.377 / sqrt(density).
    let (near, far) = (ours.mesh_to_centers.unwrap(), theirs.mesh_to_centers.unwrap());
    assert!(near.mean < 0.82 * far.mean && near.percentile_99 < 0.7 * far.percentile_99, "{near:?} {far:?}");
    // Distances from the mesh to the nearest disk, then from the disks' rims to the mesh.
    let (near, far) = (ours.mesh_to_disks.unwrap(), theirs.mesh_to_disks.unwrap());
    // The mean is only slightly better: each disk of the baseline lies in one triangle, and where
    // its large disks overlap, only the nearest counts. But none of our disks is far. A test below
    // shows that each is as near to its own cell as a plane can be.
    assert!(near.mean < far.mean && near.rms < 0.6 * far.rms, "{near:?} {far:?}");
    assert!(near.percentile_99 < 0.5 * far.percentile_99 && near.max < 0.6 * far.max, "{near:?} {far:?}");
    let (near, far) = (ours.rims_to_mesh.unwrap(), theirs.rims_to_mesh.unwrap());
    assert!(near.mean < 0.9 * far.mean && near.percentile_99 < far.percentile_99, "{near:?} {far:?}");
    // Our disks are smaller, and yet leave fewer holes.
    assert!(seen.hole_share.unwrap() < 1e-4, "{seen:?}");
    assert!(seen_theirs.seen.holes > 5 * seen.seen.holes, "{seen:?} {seen_theirs:?}");
}

#[test]
fn a_sphere_is_covered_evenly() {
    let mesh = sphere(5, true);
    let count = 2000;
    let points = by(&mesh, count, Priority::Area);
    let spacing = (4.0 * PI / count as f64).sqrt();
    // Distances to the nearest other sample, in spacings. Independent points have a mean of 1/2,
    // and the smallest distance of 2,000 points is about 1/50. In a hexagonal lattice, the most
    // even one, all are 1.07.
    let nearest = |points: &Points| {
        let all: Vec<f64> = spacings(points).iter().map(|distance| distance / spacing).collect();
        (all.iter().sum::<f64>() / all.len() as f64, all.iter().copied().fold(f64::INFINITY, f64::min))
    };
    let (even, independent) = (nearest(&points), nearest(&uniform(&mesh, count)));
    assert!(even.0 > 0.75 && even.1 > 4.0 * independent.1, "{even:?} {independent:?}");
    assert!(independent.0 < 0.55 && independent.1 < 0.1, "{independent:?}");
    for (position, normal) in points.positions.iter().zip(points.normals.as_ref().unwrap()) {
        let normal = DVec3::from(normal.map(f64::from));
        assert!(DVec3::from(*position).normalize().distance(normal) < 2e-3, "{position:?} {normal}");
    }
    let radii = points.radii.clone().unwrap();
    let in_spacings = |radius: &f32| f64::from(*radius) / spacing;
    assert!(radii.iter().all(|radius| (0.2..2.0).contains(&in_spacings(radius))));
    let ordinary = radii.iter().filter(|radius| (0.7..1.5).contains(&in_spacings(radius))).count();
    assert!(ordinary > count * 97 / 100, "{ordinary}");
    let tree = TriangleTree::new(&mesh).unwrap();
    let (scene, _) = build(vec![points], &()).unwrap();
    assert!(coverage(&tree, &scene, 64, 128, &()).unwrap().is_hole_free());
    // The radii are not larger than necessary: half of them leaves holes.
    assert!(coverage(&tree, &longer(&scene, 0.5), 64, 128, &()).unwrap().hole_share.unwrap() > 0.01);
}

/// The scene with its disks scaled by `factor`, clipped at the same lines.
fn longer(scene: &Scene, factor: f32) -> Scene {
    let mut scene = scene.clone();
    for Clip(lines) in &mut scene.clips {
        lines.iter_mut().for_each(|[u, v, _]| (*u, *v) = (factor * *u, factor * *v));
    }
    for surfel in &mut scene.surfels {
        (surfel.s, surfel.t) = (surfel.s.map(|c| factor * c), surfel.t.map(|c| factor * c));
    }
    scene
}

/// Factor by which written disks exceed the radius that covers their cells.
const OVERLAP: f32 = 1.28;

#[test]
fn flat_sides_are_covered_up_to_sharp_edges_by_disks_that_end_with_their_cells() {
    // A flat cell lies in its disk, which is larger than the cell by `OVERLAP`. Without that factor
    // the disk still hides each point of the cell from every direction, at outlines too. That holds
    // only if cells end at edges: beyond an edge, a part of the cell could be visible from a
    // direction in which the disk is edge-on and covers nothing.
    let cube = epsplat::io::read_mesh(&Path::new(env!("CARGO_MANIFEST_DIR")).join("data/cube.obj"), &()).unwrap();
    for mesh in [cube, bar(3), bar(6)] {
        let tree = TriangleTree::new(&mesh).unwrap();
        let (scene, _) = build(vec![by(&mesh, 1500, Priority::Area)], &()).unwrap();
        let uncovered = |scene: &Scene| coverage(&tree, scene, 64, 96, &()).unwrap().seen.uncovered;
        // The factor 1.00001 allows for the rounding of centres and half-axes to f32.
        let mut least = longer(&scene, 1.000_01 / OVERLAP);
        assert_eq!(uncovered(&least), 0);
        // Controls: disks smaller by 10 %, and one in ten left out.
        assert!(uncovered(&longer(&scene, 0.9 / OVERLAP)) > 0);
        least.clips = least.clips.chunks(10).flat_map(|ten| &ten[1..]).copied().collect();
        least.surfels = least.surfels.chunks(10).flat_map(|ten| &ten[1..]).copied().collect();
        assert!(uncovered(&least) > 0);
    }
}

/// Compares each sample's plane with eight planes that are tilted by `angle`.
///
/// Returns the number of samples for which a tilted plane has no larger mean squared distance to
/// the mesh points of the sample's cell.
fn off_the_nearest_plane(mesh: &Mesh, samples: &Points, angle: f64) -> usize {
    let centers: Vec<DVec3> = samples.positions.iter().map(|p| DVec3::from(*p)).collect();
    let normals = samples.normals.as_ref().unwrap();
    let frame = |normal: &[f32; 3]| {
        let normal = DVec3::from(normal.map(f64::from)).normalize();
        let (s, t) = normal.any_orthonormal_pair();
        [normal, s, t]
    };
    let frames: Vec<[DVec3; 3]> = normals.iter().map(frame).collect();
    // For each cell, sums of squared heights over the plane itself and over the tilted ones.
    let mut squares = vec![[0.0; 9]; centers.len()];
    for point in uniform(mesh, 150_000).positions {
        let point = DVec3::from(point);
        let distance = |&a: &usize| centers[a].distance_squared(point);
        let nearest = (0..centers.len()).min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap();
        let (offset, [normal, s, t]) = (point - centers[nearest], frames[nearest]);
        let height = offset.dot(normal);
        squares[nearest][0] += height * height;
        for k in 0..8 {
            let (sin, cos) = (PI * k as f64 / 4.0).sin_cos();
            let tilted = height * angle.cos() + offset.dot(s * cos + t * sin) * angle.sin();
            squares[nearest][k + 1] += tilted * tilted;
        }
    }
    squares.iter().filter(|[own, tilted @ ..]| tilted.iter().any(|tilted| tilted <= own)).count()
}

#[test]
fn disks_lie_in_the_planes_that_are_nearest_to_their_cells() {
    // A sphere of large facets: a cell spans several, which are not coplanar.
    let mesh = sphere(3, false);
    let samples = by(&mesh, 300, Priority::Area);
    let tilted = |angle: f64| {
        let tilt = |n: [f32; 3]| {
            let normal = DVec3::from(n.map(f64::from));
            (normal + normal.any_orthonormal_vector() * angle).normalize().as_vec3().to_array()
        };
        let normals = samples.normals.as_ref().unwrap().iter().map(|n| tilt(*n)).collect();
        Points { normals: Some(normals), ..samples.clone() }
    };
    // The mean square is a parabola in the tilt, so a plane within `angle` / 2 of the best one
    // beats all planes that are tilted by `angle`. A cell has 500 points, a height of h = 0.015 and
    // an extent of p = 0.06. So the best plane has a random error of h / p / sqrt(500), a
    // hundredth.
    let angle = 0.1;
    assert_eq!(off_the_nearest_plane(&mesh, &samples, angle), 0);
    // Controls: planes that are off by more than half of `angle`, and planes of the facets, which
    // are 0.07 off the sphere's on average.
    assert_eq!(off_the_nearest_plane(&mesh, &tilted(0.75 * angle), angle), 300);
    let places = samples.positions.iter().map(|p| DVec3::from(*p).normalize()).collect::<Vec<_>>();
    let facets = uniform(&mesh, 20_000);
    let facet = |place: &DVec3| {
        let off = |k: &usize| DVec3::from(facets.positions[*k]).distance_squared(*place);
        let nearest = (0..20_000).min_by(|a, b| off(a).total_cmp(&off(b))).unwrap();
        facets.normals.as_ref().unwrap()[nearest]
    };
    let in_facets = Points { normals: Some(places.iter().map(facet).collect()), ..samples.clone() };
    assert!(off_the_nearest_plane(&mesh, &in_facets, angle) > 100);
}

#[test]
fn normals_are_those_of_cells_but_none_blends_across_a_crease() {
    // A sphere of large facets without normals.
    let mesh = sphere(3, false);
    let error = |points: &Points| {
        let normals = points.normals.as_ref().unwrap().iter();
        let angle = |(p, n): (&[f64; 3], &[f32; 3])| DVec3::from(*p).angle_between(DVec3::from(n.map(f64::from)));
        points.positions.iter().zip(normals).map(angle).sum::<f64>() / points.positions.len() as f64
    };
    // The facets' normals are 0.07 off on average. There are 512 facets, so a cell spans two or
    // more.
    let (ours, facets) = (error(&by(&mesh, 300, Priority::Area)), error(&uniform(&mesh, 1000)));
    assert!(ours < 0.6 * facets && facets > 0.03, "{ours} {facets}");
    let cube = epsplat::io::read_mesh(&Path::new(env!("CARGO_MANIFEST_DIR")).join("data/cube.obj"), &()).unwrap();
    let points = by(&Mesh { normals: None, ..cube }, 500, Priority::Area);
    let upright = |n: &[f32; 3]| n.iter().any(|c| c.abs() > 0.999_999);
    assert!(points.normals.unwrap().iter().all(upright));
}

#[test]
fn samples_follow_the_priority() {
    // The right half has 32 triangles, the left half 2, and both have the same area.
    let mesh = strip(4);
    let even = right_of(&by(&mesh, 1000, Priority::Area), 1.0);
    assert!((490..=510).contains(&even), "{even}");
    // 32 of 34 triangles are on the right: 941 samples, of which some at the border move to the
    // left.
    let many = right_of(&by(&mesh, 1000, Priority::Triangles), 1.0);
    assert!((915..=945).contains(&many), "{many}");
    // The priority can be any function of the voxels.
    let only_left = |_: &MeshSurface<'_>, voxels: &[Voxel]| {
        voxels.iter().map(|voxel| if voxel.bounds.center().x < 0.0 { voxel.area } else { 0.0 }).collect()
    };
    let method = Method::Stratified { priority: &only_left, depth: Some(3) };
    let (points, sampling) = sample(&mesh, 100, &method, 0, &()).unwrap();
    assert_eq!((right_of(&points, 1.0), sampling.voxels, sampling.empty_voxels), (0, 8, 4));

    // A flat square beside a sphere of the same area: only the sphere is curved.
    let mut both = sphere(4, false);
    let side = (4.0 * PI).sqrt();
    let first = both.positions.len() as u32;
    both.positions.extend([[2.0, 0.0, 0.0], [2.0 + side, 0.0, 0.0], [2.0 + side, side, 0.0], [2.0, side, 0.0]]);
    both.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
    let flat = right_of(&by(&both, 2000, Priority::Curvature), 1.5);
    assert!((200..300).contains(&flat), "{flat}");
    let even = right_of(&by(&both, 2000, Priority::Area), 1.5);
    assert!((980..1020).contains(&even), "{even}");
}

/// Tien 2008 projects the centre of each voxel to the surface: the samples cover it, but less
/// evenly than relaxed ones.
#[test]
fn projected_samples_cover_the_surface_less_evenly() {
    let mesh = sphere(4, true);
    let tree = TriangleTree::new(&mesh).unwrap();
    let priority = |surface: &MeshSurface<'_>, voxels: &[Voxel]| Priority::Touched.of(surface, voxels);
    let method = Method::Projected { priority: &priority, depth: None };
    let (points, sampling) = sample(&mesh, 3000, &method, 0, &()).unwrap();
    assert_eq!((points.positions.len() as u64, sampling.samples), (3000, 3000));
    let off = points.positions.iter().map(|p| tree.distance(DVec3::from(*p))).fold(0.0, f64::max);
    assert!(off < 1e-9, "{off}");
    let scene = build(vec![points.clone()], &()).unwrap().0;
    assert!(coverage(&tree, &scene, 64, 96, &()).unwrap().is_hole_free());
    let nearest = |points: &Points| spacings(points).into_iter().fold(f64::INFINITY, f64::min);
    assert!(nearest(&points) < 0.3 * nearest(&by(&mesh, 3000, Priority::Area)));
    // The only sample of a voxel lies at the projected centre of the voxel. On this flat mesh, that
    // is the centre of the voxel's box.
    let method = Method::Projected { priority: &|_, voxels| vec![1.0; voxels.len()], depth: Some(4) };
    let mut square = sample(&strip(1), 16, &method, 0, &()).unwrap().0.positions;
    square.sort_by(|a, b| a.partial_cmp(b).unwrap());
    for (k, [x, y, z]) in square.into_iter().enumerate() {
        let [column, row] = [k / 2, k % 2].map(|at| at as f64);
        assert!((x - 0.125 - 0.25 * column).abs() < 1e-9 && (y - 0.25 - 0.5 * row).abs() < 1e-9 && z == 0.0, "{x} {y}");
    }
}

/// Fewer samples than voxels go to the voxels of the highest priority alone, as in Tien 2008; by
/// shares of the priority, a fifth of them lies elsewhere.
#[test]
fn few_projected_samples_lie_where_the_priority_is_highest() {
    let mesh = strip(1);
    let richer = |_: &MeshSurface<'_>, voxels: &[Voxel]| {
        voxels.iter().map(|voxel| if voxel.bounds.center().x > 0.0 { 4.0 } else { 1.0 }).collect()
    };
    let (points, sampling) =
        sample(&mesh, 250, &Method::Projected { priority: &richer, depth: Some(10) }, 0, &()).unwrap();
    assert_eq!((points.positions.len(), right_of(&points, 1.0)), (250, 250));
    assert_eq!((sampling.voxels, sampling.empty_voxels), (1024, 774));
    let (shared, _) = sample(&mesh, 250, &Method::Stratified { priority: &richer, depth: Some(10) }, 0, &()).unwrap();
    let right = right_of(&shared, 1.0);
    assert!((190..=210).contains(&right), "{right}");
}

#[test]
fn a_triangle_counts_wholly_in_each_voxel_that_it_reaches() {
    let surface_mesh = strip(1);
    let seen = std::sync::Mutex::new(Vec::new());
    let both = |surface: &MeshSurface<'_>, voxels: &[Voxel]| {
        let [touched, shared] = [Priority::Touched, Priority::Triangles].map(|priority| priority.of(surface, voxels));
        seen.lock().unwrap().push((touched.iter().sum::<f64>(), shared.iter().sum::<f64>()));
        touched
    };
    sample(&surface_mesh, 64, &Method::Stratified { priority: &both, depth: Some(3) }, 0, &()).unwrap();
    let [(touched, shared)] = seen.into_inner().unwrap()[..] else { panic!("asked twice") };
    // Each of the four triangles spans several of the eight voxels.
    assert!((shared - 4.0).abs() < 1e-9 && touched > 8.0 && touched.fract() == 0.0, "{touched} {shared}");
}

/// The rectangle of [`strip`] with a texture: the left half has one colour, the right half stripes.
fn striped() -> Mesh {
    let mut mesh = strip(1);
    let uv = |vertex: u32| mesh.positions[vertex as usize];
    mesh.texture = Some(mesh.triangles.iter().map(|t| t.map(|v| [0.5 * uv(v)[0] as f32, uv(v)[1] as f32])).collect());
    let texel = |k: u32| if k % 64 < 32 { [0, 0, 255, 255] } else { [[255; 4], [0, 0, 0, 255]][k as usize % 2] };
    mesh.paint(Texture::new(64, 64, (0..64 * 64).map(texel).collect()).unwrap());
    mesh
}

#[test]
fn textures_give_colours_coordinates_and_priority() {
    let mesh = striped();
    let points = by(&mesh, 1000, Priority::Texture);
    let striped = right_of(&points, 1.0);
    // A quarter of the samples is distributed by area, so an eighth lies on the left by area alone.
    // The colour also changes at the two borders of the left half, where the image repeats.
    assert!((750..875).contains(&striped), "{striped}");
    assert!((490..=510).contains(&right_of(&by(&mesh, 1000, Priority::Area), 1.0)));
    let (texture, Some(Colors::Linear(colors))) = (points.texture.as_ref().unwrap(), &points.colors) else {
        panic!("{:?}", points.colors)
    };
    for ((position, uv), color) in points.positions.iter().zip(texture).zip(colors) {
        assert!((f64::from(uv[0]) - 0.5 * position[0]).abs() < 1e-6 && (f64::from(uv[1]) - position[1]).abs() < 1e-6);
        if (0.2..0.8).contains(&position[0]) {
            assert_eq!(*color, [0.0, 0.0, 1.0, 1.0]);
        }
    }
    // Stripes finer than the samples blend to their mean: no sample is black or white by chance.
    let coarse = by(&mesh, 40, Priority::Area);
    let Some(Colors::Linear(colors)) = &coarse.colors else { panic!() };
    let right: Vec<f32> =
        coarse.positions.iter().zip(colors).filter(|(p, _)| p[0] > 1.3).map(|(_, color)| color[0]).collect();
    assert!(right.len() > 8 && right.iter().all(|c| (0.1..0.9).contains(c)), "{right:?}");
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("s.ply");
    epsplat::io::ply::write_points(&path, &points, &()).unwrap();
    let read = epsplat::io::read(&path, &()).unwrap();
    assert_eq!((&read.texture, &read.colors, &read.radii), (&points.texture, &points.colors, &points.radii));
}

#[test]
fn a_seed_gives_the_same_points_on_any_number_of_threads() {
    let mesh = sphere(3, false);
    let run = |threads: usize, seed: u64| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| stratified(&mesh, 700, Priority::Triangles, None, seed).0)
    };
    assert_eq!(run(1, 5), run(4, 5));
    assert_ne!(run(4, 5), run(4, 6));
    assert_ne!(uniform(&mesh, 50), sample(&mesh, 50, &Method::Uniform, 1, &()).unwrap().0);
}

#[test]
fn any_count_and_depth_gives_as_many_samples() {
    let mesh = strip(4);
    for (count, depth) in [(1, None), (3, Some(12)), (50, Some(0)), (50, Some(60)), (777, Some(5)), (777, None)] {
        let (points, sampling) = stratified(&mesh, count, Priority::Area, depth.map(|d: u32| d.min(20)), 0);
        assert_eq!((points.positions.len(), sampling.samples), (count, count as u64), "{depth:?}");
        assert!(points.radii.unwrap().iter().all(|radius| *radius > 0.0 && radius.is_finite()), "{count} {depth:?}");
    }
    let (_, deep) = stratified(&mesh, 3, Priority::Area, Some(8), 0);
    assert_eq!((deep.voxels, deep.empty_voxels), (256, 253));
    assert!(matches!(sample(&mesh, 0, &Method::Uniform, 0, &()), Err(Error::Usage(_))));
}

#[test]
fn what_cannot_be_sampled_is_counted_or_said() {
    let mut mesh = strip(2);
    let good = mesh.triangles.len() as u64;
    let first = mesh.positions.len() as u32;
    mesh.positions.extend([[f64::NAN, 0.0, 0.0], [1e300, 0.0, 0.0], [0.0; 3], [0.0; 3]]);
    // Two triangles are not finite and three have no area. Then follow two duplicates, one of them
    // reversed.
    let bad = [[first, 0, 1], [first + 1, 0, 1], [0, 0, 1], [first + 2, first + 3, 1], [0, first + 2, 0]];
    mesh.triangles.extend(bad);
    mesh.triangles.extend([mesh.triangles[0], [2, 1, 0]]);
    let (points, sampling) = stratified(&mesh, 300, Priority::Area, None, 0);
    assert_eq!((sampling.triangles, sampling.dropped_non_finite, sampling.dropped_flat), (good + 2, 2, 3));
    assert_eq!(sampling.notes().len(), 2);
    assert!(points.positions.iter().flatten().all(|c| c.is_finite()) && points.positions.len() == 300);
    for (mesh, said) in [
        (Mesh { triangles: vec![], ..mesh.clone() }, "no triangles"),
        (Mesh { triangles: bad.to_vec(), ..mesh.clone() }, "none of the mesh's 5 triangles has an area"),
        (Mesh { triangles: vec![[0, 1, 99_999]], ..mesh.clone() }, "triangles of existing vertices"),
        (Mesh { material: Some(vec![]), ..mesh.clone() }, "materials"),
    ] {
        let error = sample(&mesh, 10, &Method::Uniform, 0, &()).unwrap_err().to_string();
        assert!(error.contains(said), "{error}");
    }
}

/// How far disks may extend past an edge, as a fraction of the largest radius. Includes a margin
/// for disks whose cells extend past it.
const PAST: f64 = 0.03;

#[test]
fn disks_end_at_edges_and_borders() {
    let open = |sides: u32| {
        let mut mesh = bar(sides);
        // Removes the ends of the bar.
        mesh.triangles.truncate(2 * sides as usize);
        mesh
    };
    for (mesh, closed) in [(bar(4), true), (bar(3), true), (open(4), false)] {
        let points = by(&mesh, 3000, Priority::Area);
        assert_eq!(points.closed, closed);
        let tree = TriangleTree::new(&mesh).unwrap();
        let (scene, _) = build(vec![points.clone()], &()).unwrap();
        assert!(scene.clips.iter().filter(|clip| !clip.is_none()).count() > 100);
        let rims = |scene: &Scene| SurfaceDistances::of(scene, &mesh, &tree).unwrap().rims_to_mesh.unwrap();
        let radius = f64::from(scene.surfels.iter().map(|surfel| surfel.radius()).fold(0.0, f32::max));
        assert!(rims(&scene).max < PAST * radius, "{:?} {radius}", rims(&scene));
        assert!(coverage(&tree, &scene, 64, 128, &()).unwrap().is_hole_free());
        // The control: unclipped disks.
        let whole = Scene { clips: Vec::new(), ..scene };
        assert!(rims(&whole).max > 10.0 * PAST * radius, "{:?} {radius}", rims(&whole));
    }
    // A smooth surface has no clip lines.
    let smooth = by(&sphere(5, false), 2000, Priority::Area);
    assert!(smooth.clips.is_none() && smooth.axes.is_some() && smooth.radii.is_some());
}

#[test]
fn planes_are_the_surface_s_own_whatever_normals_it_is_lit_by() {
    // A square bar with the normals of a round one.
    let mut mesh = bar(4);
    let outward = |vertex: u32| {
        let [x, y, _] = mesh.positions[vertex as usize];
        DVec3::new(x, y, 0.0).as_vec3().to_array()
    };
    mesh.normals = Some(mesh.triangles.iter().map(|triangle| triangle.map(outward)).collect());
    let points = by(&mesh, 3000, Priority::Area);
    let tree = TriangleTree::new(&mesh).unwrap();
    let (scene, _) = build(vec![points], &()).unwrap();
    let distances = SurfaceDistances::of(&scene, &mesh, &tree).unwrap();
    let radius = f64::from(scene.surfels.iter().map(|surfel| surfel.radius()).fold(0.0, f32::max));
    assert!(distances.rims_to_mesh.unwrap().max < PAST * radius, "{distances:?}");
    let turned = scene.normals.iter().zip(&scene.surfels).filter(|(normal, surfel)| {
        DVec3::from(normal.map(f64::from)).dot(surfel.normal().as_dvec3().normalize()) < 0.9
    });
    assert!(turned.count() > 300, "normals that are not those of the planes");

    // If all normals point inward, the disks are reversed and end at the same edges.
    for normal in mesh.normals.iter_mut().flatten().flatten() {
        *normal = normal.map(|c| -c);
    }
    let (inward, _) = build(vec![by(&mesh, 3000, Priority::Area)], &()).unwrap();
    // At the ends of the bar the shading normals lie in the disks' planes, so they do not select a
    // side.
    let mut pairs = scene.surfels.iter().zip(&inward.surfels).filter(|(a, _)| a.normal().normalize().z.abs() < 0.5);
    assert!(pairs.all(|(a, b)| a.normal().dot(b.normal()) < 0.0));
    assert!(inward.clips.iter().filter(|clip| !clip.is_none()).count() > 300);
    let rims = SurfaceDistances::of(&inward, &mesh, &tree).unwrap().rims_to_mesh.unwrap();
    assert!(rims.max < PAST * radius, "{rims:?}");
}

#[test]
fn caps_are_curved_as_the_mesh_is() {
    // On a fine sphere the rims of caps are much nearer to it than those of disks.
    let mesh = sphere(5, true);
    let tree = TriangleTree::new(&mesh).unwrap();
    let off = |points: Points| {
        let (scene, _) = build(vec![points], &()).unwrap();
        assert!(coverage(&tree, &scene, 64, 128, &()).unwrap().is_hole_free());
        SurfaceDistances::of(&scene, &mesh, &tree).unwrap().rims_to_mesh.unwrap().rms
    };
    let points = by(&mesh, 2000, Priority::Area);
    let curved = curve(points.clone(), &()).unwrap();
    assert_eq!(curved.caps.as_ref().unwrap().len(), 2000);
    let (disks, caps) = (off(points.clone()), off(curved));
    assert!(4.0 * caps < disks, "{caps} {disks}");
    // The sides of a bar are not curved, though it has the normals of a round one.
    let mut mesh = bar(4);
    let outward = |vertex: u32| {
        let [x, y, _] = mesh.positions[vertex as usize];
        DVec3::new(x, y, 0.0).as_vec3().to_array()
    };
    mesh.normals = Some(mesh.triangles.iter().map(|triangle| triangle.map(outward)).collect());
    let caps = curve(by(&mesh, 3000, Priority::Area), &()).unwrap().caps.unwrap();
    let highest = caps.iter().map(Cap::highest).fold(0.0, f64::max);
    assert!(highest < 1e-6, "{highest}");
    // Points without planes get no caps.
    assert!(curve(Points { axes: None, ..points }, &()).unwrap().caps.is_none());
}
