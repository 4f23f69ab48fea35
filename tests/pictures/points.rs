//! Surfels from points: errors and sides of normals, sizes of surfels, and degenerate clouds.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common;

use std::path::Path;

use epsplat::Error;
use epsplat::io::{self, Points};
use epsplat::low_level::scene::{Colors, Scene};
use epsplat::low_level::surfels::analytic::{Sample, Shape, generate};
use epsplat::low_level::surfels::{
    FromPoints, Limits, Orientation, Preparation, Size, Surfels, Triangle, build, build_within, from_points,
};
use glam::DVec3;

/// Pseudo-random numbers in [0, 1).
fn noise(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed;
    move || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 11) as f64 / (1u64 << 53) as f64
    }
}

fn cloud(positions: Vec<[f64; 3]>) -> Points {
    Points { positions, ..Points::default() }
}

fn samples(shape: Shape, count: u64) -> (Vec<[f64; 3]>, Vec<[f32; 3]>) {
    generate(shape, count).map(|Sample { position, normal, .. }| (position, normal)).unzip()
}

fn surfels(points: Points, options: &FromPoints) -> Surfels {
    from_points(vec![points], options, &()).unwrap()
}

/// The angles between true normals and those of `surfels`, in radians.
fn angles(surfels: &Surfels, truth: &[[f32; 3]]) -> Vec<f64> {
    let vector = |n: &[f32; 3]| DVec3::from_array(n.map(f64::from)).normalize();
    let normals = surfels.points.normals.as_ref().unwrap();
    // From the cross and the dot product, because the cosine alone loses small angles.
    let angle = |(a, b): (DVec3, DVec3)| a.cross(b).length().atan2(a.dot(b));
    truth.iter().map(vector).zip(normals.iter().map(vector)).map(angle).collect()
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

fn flipped(angles: &[f64]) -> usize {
    angles.iter().filter(|angle| **angle > std::f64::consts::FRAC_PI_2).count()
}

fn within(outliers: Option<f64>, largest_ratio: f64) -> FromPoints {
    FromPoints { limits: Limits { outliers, largest_ratio, ..Limits::default() }, ..FromPoints::default() }
}

fn up() -> FromPoints {
    FromPoints { orientation: Orientation::Up, ..FromPoints::default() }
}

/// A fitted normal is off by at most k h/2, for a surface of curvature at most k.
///
/// The surface is within k h²/2 of the tangent plane where 16 neighbours reach as far as h. A
/// fitted plane's slope is cov(x, z)/var(x), so at most sd(z)/sd(x). Here sd(z) is at most half the
/// range, k h²/4, and sd(x) is h/2 for points that fill a disk.
#[test]
fn normals_of_smooth_surfaces_are_within_their_curvature_and_outward() {
    for (shape, curvature) in [(Shape::Sphere, 1.0), (Shape::Torus, 2.5)] {
        let count = 20_000;
        let (positions, truth) = samples(shape, count);
        // 17 points fill the disk of radius h; where the lattice is uneven they reach up to 1.5 h.
        let reach = 1.5 * (17.0 * shape.area() / count as f64 / std::f64::consts::PI).sqrt();
        let bound = curvature * reach / 2.0;
        let found = angles(&surfels(cloud(positions.clone()), &FromPoints::default()), &truth);
        let worst = found.iter().copied().fold(0.0, f64::max);
        println!(
            "{shape:?}: mean {:.4} worst {:.4} bound {:.4} degrees",
            mean(&found).to_degrees(),
            worst.to_degrees(),
            bound.to_degrees()
        );
        assert_eq!(flipped(&found), 0);
        assert!(worst < bound, "{shape:?}: {worst} {bound}");
        // Controls: noise breaks the bound, and normals oriented by `Up` face either side.
        let mut next = noise(1);
        let rough = positions.iter().map(|p| p.map(|c| c + 0.5 * reach * (next() - 0.5))).collect();
        let control = angles(&surfels(cloud(rough), &FromPoints::default()), &truth);
        assert!(control.iter().copied().fold(0.0, f64::max) > bound);
        let control = flipped(&angles(&surfels(cloud(positions), &up()), &truth));
        assert!(control > count as usize / 3, "{control}");
    }
}

/// Noise of standard deviation s in z tilts fitted normals by 0.262 s on average.
///
/// The slopes of a plane through n points have the deviation s / sqrt(n var(x)) along each axis. 17
/// points at one per unit area fill a disk of h^2 = 17/pi, in which var(x) = h^2/4. The angle
/// is the length of two such slopes, Rayleigh distributed with a mean of sqrt(pi/2) times that
/// deviation.
#[test]
fn noise_tilts_normals_as_least_squares_says() {
    let mut next = noise(2);
    let side = 250;
    for deviation in [0.05, 0.1, 0.2] {
        // One point anywhere in each unit square: on a grid many neighbours are equally far, and
        // noise would decide which of them are chosen.
        let positions = (0..side * side).map(|i| {
            let normal = (0..12).map(|_| next()).sum::<f64>() - 6.0;
            [f64::from(i % side) + next(), f64::from(i / side) + next(), deviation * normal]
        });
        let surfels = surfels(cloud(positions.collect()), &FromPoints::default());
        let mut found = angles(&surfels, &vec![[0.0, 0.0, 1.0]; (side * side) as usize]);
        assert_eq!(flipped(&found), 0, "a sheet that lies faces up");
        // Points away from the plane's edge, at which neighbours spread less.
        let inside = |i: usize| (3..side as usize - 3).contains(&(i % 250)) && (3..247).contains(&(i / 250));
        let mut index = 0..;
        found.retain(|_| index.next().is_some_and(inside));
        let expected = 0.262 * deviation;
        let ratio = mean(&found) / expected;
        println!("noise {deviation}: mean {:.3} degrees, {ratio:.3} of theory", mean(&found).to_degrees());
        // With 8 neighbours the ratio would be 1.9.
        assert!((0.9..1.1).contains(&ratio), "{ratio}");
    }
}

#[test]
fn coarse_models_with_thin_parts_face_outward() {
    let mut points = io::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("data/bunny.obj"), &()).unwrap();
    let truth = points.normals.take().unwrap();
    let found = angles(&surfels(points.clone(), &FromPoints::default()), &truth);
    let mut sorted = found.clone();
    sorted.sort_by(f64::total_cmp);
    let percentile_99 = sorted[sorted.len() * 99 / 100].to_degrees();
    let mean = mean(&found).to_degrees();
    println!(
        "bunny: mean {mean:.2} degrees, 99th percentile {percentile_99:.1}, worst {:.1}",
        sorted[1838].to_degrees()
    );
    // At the ears' tips, opposite sides are closer to each other than points are on one side.
    // Planes fitted to all neighbours would stand across the ears: 3 normals would err by more than
    // 90 degrees, with a mean error of 7.1 and a 99th percentile of 47 degrees.
    assert_eq!(flipped(&found), 0);
    assert!(mean < 6.5 && percentile_99 < 35.0, "{mean} {percentile_99}");
    assert!(flipped(&angles(&surfels(points, &up()), &truth)) > 500);
}

#[test]
fn every_part_faces_outward_on_its_own() {
    let (mut positions, mut truth) = samples(Shape::Sphere, 3000);
    for (shift, count) in [(5.0, 2000), (-4.0, 40)] {
        let (more, normals) = samples(Shape::Torus, count);
        positions.extend(more.into_iter().map(|[x, y, z]| [x, y + shift, z]));
        truth.extend(normals);
    }
    let surfels = surfels(cloud(positions), &FromPoints::default());
    assert_eq!(surfels.parts, Some(3));
    assert_eq!(flipped(&angles(&surfels, &truth)[..5000]), 0);
}

#[test]
fn normals_turn_toward_the_nearest_scanner() {
    let (positions, truth) = samples(Shape::Sphere, 5000);
    let toward = |scanners: &[[f64; 3]]| FromPoints {
        orientation: Orientation::Toward(scanners.iter().map(|at| DVec3::from_array(*at)).collect()),
        ..FromPoints::default()
    };
    let flips = |scanners: &[[f64; 3]]| flipped(&angles(&surfels(cloud(positions.clone()), &toward(scanners)), &truth));
    assert_eq!(flips(&[[0.1, 0.0, 0.0]]), 5000, "all face a scanner inside");
    assert_eq!(
        flips(&[
            [20.0, 0.0, 0.0],
            [-20.0, 0.0, 0.0],
            [0.0, 20.0, 0.0],
            [0.0, -20.0, 0.0],
            [0.0, 0.0, 20.0],
            [0.0, 0.0, -20.0]
        ]),
        0
    );
    // With one scanner only, normals on the far side face it too, and so inward. The horizon is at
    // x = 1/20.
    let one = flips(&[[20.0, 0.0, 0.0]]);
    assert!((one as f64 - 5000.0 * (1.0 + 0.05) / 2.0).abs() < 50.0, "{one}");
}

#[test]
fn given_normals_stay_and_say_which_side_is_which() {
    let (positions, truth) = samples(Shape::Sphere, 4000);
    let inward: Vec<[f32; 3]> = truth.iter().map(|n| n.map(|c| -c)).collect();
    let mut points = cloud(positions);
    // Twenty given normals, all inward, one of length 8; the others are zero and will be estimated.
    let mut few = vec![[0.0; 3]; 4000];
    few[..20].copy_from_slice(&inward[..20]);
    few[7] = few[7].map(|c| c * 8.0);
    points.normals = Some(few);
    let made = surfels(points.clone(), &FromPoints::default());
    assert_eq!(made.preparation.estimated_normals, 3980);
    assert!(angles(&made, &inward)[..20].iter().all(|angle| *angle < 1e-6));
    assert_eq!(flipped(&angles(&made, &inward)), 0);
    let again = surfels(points, &FromPoints { estimate_normals: true, ..FromPoints::default() });
    assert_eq!((again.preparation.estimated_normals, flipped(&angles(&again, &truth))), (4000, 0));
    // Two normals at one position, as at an edge of a mesh, both stay.
    let mut edge = cloud(samples(Shape::Plane, 400).0);
    edge.positions.push(edge.positions[0]);
    let mut normals = vec![[0.0, 0.0, 1.0]; 401];
    normals[400] = [1.0, 0.0, 0.0];
    edge.normals = Some(normals.clone());
    let made = surfels(edge, &FromPoints { size: Size::Ellipse, ..FromPoints::default() });
    assert_eq!(made.points.normals.as_ref().unwrap(), &normals);
    for ([s, t], normal) in made.points.axes.unwrap().into_iter().zip(normals) {
        let [s, t] = [s, t].map(|axis| DVec3::from_array(axis.map(f64::from)));
        assert!(s.cross(t).normalize().distance(DVec3::from_array(normal.map(f64::from))) < 1e-6);
    }
}

#[test]
fn normals_whose_sides_are_random_have_none() {
    let mut random = noise(7);
    let mut of = |(positions, truth): (Vec<[f64; 3]>, Vec<[f32; 3]>), share: f64| {
        let normals = truth.iter().map(|n| if random() < share { n.map(|c| -c) } else { *n }).collect();
        let points = Points { normals: Some(normals), ..cloud(positions) };
        let made = surfels(points.clone(), &FromPoints::default());
        let (scene, preparation) = build(vec![points], &()).unwrap();
        assert_eq!(made.preparation.opposed_normals, preparation.opposed_normals);
        let told = preparation.notes().iter().any(|note| note.contains("face either way"));
        assert_eq!(told, !scene.oriented);
        (scene.oriented, preparation.opposed_normals)
    };
    for shape in [Shape::Sphere, Shape::Torus] {
        assert_eq!(of(samples(shape, 4000), 0.0), (true, 0));
        let (oriented, opposed) = of(samples(shape, 4000), 0.5);
        assert!(!oriented && (1800..2200).contains(&opposed), "{opposed}");
        assert!(of(samples(shape, 4000), 0.05).0);
    }
    // Two sheets closer to each other than their points are apart: their normals are opposed, but
    // neighbours in one sheet agree.
    let (mut positions, mut normals) = samples(Shape::Plane, 2000);
    positions.extend(positions.clone().iter().map(|[x, y, z]| [*x, *y, z - 0.01]));
    normals.extend(normals.clone().iter().map(|n| n.map(|c| -c)));
    assert!(of((positions, normals), 0.0).0);
}

const SIZES: [Size; 6] = [
    Size::Knn,
    Size::Ellipse,
    Size::Bsp(Triangle::MeanEdge),
    Size::Bsp(Triangle::Circumsphere),
    Size::BspGlobal(Triangle::MeanEdge),
    Size::BspGlobal(Triangle::Circumsphere),
];

/// Makes surfels and checks that their normals, radii and half-axes are finite and consistent.
fn sound(positions: Vec<[f64; 3]>, size: Size) -> Surfels {
    let made = surfels(cloud(positions), &FromPoints { size, ..FromPoints::default() });
    let Points { positions, normals, radii, axes, .. } = &made.points;
    assert_eq!(positions.len() as u64, made.preparation.surfels);
    let vector = |n: &[f32; 3]| DVec3::from_array(n.map(f64::from));
    assert!(normals.as_ref().unwrap().iter().all(|n| (vector(n).length() - 1.0).abs() < 1e-6), "{size:?}");
    assert!(radii.as_ref().unwrap().iter().all(|r| r.is_finite() && *r > 0.0), "{size:?} {radii:?}");
    assert_eq!(axes.is_some(), matches!(size, Size::Knn | Size::Ellipse));
    for (([s, t], normal), radius) in axes.iter().flatten().zip(normals.as_ref().unwrap()).zip(radii.as_ref().unwrap())
    {
        let [s, t] = [vector(s), vector(t)];
        assert!(s.cross(t).normalize().distance(vector(normal)) < 1e-5);
        assert!((s.length().max(t.length()) / f64::from(*radius) - 1.0).abs() < 1e-6);
    }
    made
}

#[test]
fn degenerate_clouds_have_surfels() {
    for size in SIZES {
        for count in 1..12 {
            let line = (0..count).map(|i| [f64::from(i), f64::from(i) * 2.0, -1.0]).collect();
            let made = sound(line, size);
            let spans_none = matches!(size, Size::Bsp(_)) && count > 1;
            assert_eq!(made.collinear, if spans_none { count as u64 } else { 0 }, "{size:?}");
        }
        let alone = sound(vec![[1.0, 2.0, 3.0]; 5000], size);
        assert_eq!(alone.points.radii.as_ref().unwrap()[..2], [0.5, 0.5]);
        assert!(
            alone.notes().iter().any(|note| note == "4999 points coincide with another one"),
            "{:?}",
            alone.notes()
        );
        let mut many = samples(Shape::Sphere, 500).0;
        many.extend(vec![[1.0, 0.0, 0.0]; 3000]);
        many.extend([[f64::NAN, 0.0, 0.0], [0.0, f64::INFINITY, 0.0], [0.0, 0.0, 1e300]]);
        let made = sound(many, size);
        assert_eq!((made.preparation.dropped_non_finite, made.preparation.surfels), (3, 3500));
        // The circumcircle of an obtuse triangle may be as large as the sphere.
        let largest = if size == Size::Bsp(Triangle::Circumsphere) { 2.0 } else { 0.5 };
        assert!(made.points.radii.unwrap().iter().all(|r| *r < largest), "{size:?}");
        for scale in [1e-150, 1e-17, 1e17] {
            sound(samples(Shape::Torus, 300).0.into_iter().map(|p| p.map(|c| c * scale)).collect(), size);
        }
    }
    for points in [cloud(vec![]), cloud(vec![[f64::NAN; 3]; 3])] {
        assert!(matches!(from_points(vec![points], &FromPoints::default(), &()), Err(Error::EmptyScene(_))));
    }
}

#[test]
fn options_out_of_range_are_refused() {
    let usual = FromPoints::default;
    for options in [
        within(Some(-1.0), 2.0),
        within(Some(f64::NAN), 2.0),
        within(None, 0.5),
        within(None, f64::NAN),
        FromPoints { orientation: Orientation::Toward(vec![]), ..usual() },
        FromPoints { orientation: Orientation::Toward(vec![DVec3::NAN]), ..usual() },
    ] {
        assert!(matches!(from_points(vec![cloud(vec![[0.0; 3]])], &options, &()), Err(Error::Usage(_))), "{options:?}");
    }
}

#[test]
fn outliers_are_dropped_and_counted_with_their_attributes() {
    let (mut positions, truth) = samples(Shape::Sphere, 5000);
    positions.insert(100, [4.0, 0.0, 0.0]);
    positions.push([0.0, 0.0, -3.0]);
    let colors = (0..5002).map(|i| [i as u8, (i >> 8) as u8, 0, 255]).collect();
    let texture: Vec<_> = (0..5002).map(|i| [i as f32, 0.5]).collect();
    let points = Points { colors: Some(Colors::Srgb8(colors)), texture: Some(texture), ..cloud(positions) };
    let made = surfels(points.clone(), &within(Some(5.0), 2.0));
    assert_eq!((made.preparation.dropped_outliers, made.preparation.surfels), (2, 5000));
    assert_eq!(flipped(&angles(&made, &truth)), 0);
    assert_eq!(made.points.texture.as_ref().unwrap()[99..101], [[99.0, 0.5], [101.0, 0.5]]);
    assert!(matches!(made.points.colors, Some(Colors::Srgb8(ref codes)) if codes[100] == [101, 0, 0, 255]));
    assert!(made.notes()[0].starts_with("2 points were dropped"), "{:?}", made.notes());
    assert_eq!(surfels(points, &within(Some(1e3), 2.0)).preparation.dropped_outliers, 0);
}

#[test]
fn a_scene_of_points_has_the_same_limits() {
    let (mut positions, _) = samples(Shape::Plane, 10_000);
    let count = positions.len();
    // A sparse strip beside the dense square, and one point far above it.
    positions.extend((0..40).map(|k| [1.15 + 0.1 * f64::from(k % 2), -0.9 + 0.045 * f64::from(k), 0.0]));
    positions.push([0.0, 0.0, 0.6]);
    let scene = |points: Points, limits: Limits| build_within(vec![points], vec![], &limits, &()).unwrap();
    let radii = |made: &(Scene, Preparation)| made.0.surfels.iter().map(|s| s.radius()).collect::<Vec<_>>();
    let free = scene(cloud(positions.clone()), Limits { largest_ratio: f64::INFINITY, ..Limits::default() });
    let limited = scene(cloud(positions.clone()), Limits::default());
    let changed = radii(&free).iter().zip(radii(&limited)).filter(|(free, limited)| *free > limited).count() as u64;
    assert!(changed > 0 && changed < 100, "{changed}");
    // The limit by the median of all points always applies, and may also limit some of these
    // points.
    let counted = changed.max(free.1.limited_by_neighbours.unwrap())..=changed + free.1.limited_by_neighbours.unwrap();
    assert!(counted.contains(&limited.1.limited_by_neighbours.unwrap()), "{counted:?}");
    assert!(limited.1.notes().iter().any(|note| note.contains("neighbours allow")), "{:?}", limited.1.notes());
    assert!(radii(&limited).iter().zip(radii(&free)).all(|(limited, free)| *limited <= free));
    // The disk of the distant point is limited to about three times a typical radius.
    let typical = radii(&limited)[count / 2];
    assert!(radii(&limited)[count + 40] <= 3.1 * typical, "{} {typical}", radii(&limited)[count + 40]);
    // Given radii are not limited, however large; missing ones are.
    let mut given = vec![0.0; positions.len()];
    given[count + 40] = 7.5;
    let made = scene(Points { radii: Some(given), ..cloud(positions.clone()) }, Limits::default());
    assert_eq!(radii(&made)[count + 40], 7.5);
    // The order of points does not matter.
    let reversed = scene(cloud(positions.iter().rev().copied().collect()), Limits::default());
    assert_eq!(radii(&reversed).into_iter().rev().collect::<Vec<_>>(), radii(&limited));
    // The scene drops the same outliers as `surfels`, and its surfels keep the numbers of their
    // points.
    let limits = Limits { outliers: Some(5.0), ..Limits::default() };
    positions.insert(7, [0.0, 0.3, -0.9]);
    let (dropped, preparation) = scene(cloud(positions.clone()), limits);
    let made = surfels(cloud(positions), &FromPoints { limits, ..FromPoints::default() });
    assert_eq!(preparation.dropped_outliers, made.preparation.dropped_outliers);
    assert!(
        preparation.dropped_outliers >= 2 && preparation.surfels + preparation.dropped_outliers == count as u64 + 42
    );
    assert_eq!((dropped.provenance.of(6), dropped.provenance.of(7)), ((0, 6), (0, 8)));
}

#[test]
fn no_disk_flies_past_its_neighbours() {
    for size in SIZES {
        let (mut positions, _) = samples(Shape::Plane, 10_000);
        let usual = surfels(cloud(positions.clone()), &FromPoints { size, ..within(None, f64::INFINITY) });
        let typical = usual.points.radii.unwrap()[5000];
        // This point is farther from the sheet than neighbours in it are apart, but too near for
        // the limit by the median of all points.
        positions.push([0.0, 0.0, 0.12]);
        let last = |largest_ratio: f64| {
            let made = surfels(cloud(positions.clone()), &FromPoints { size, ..within(None, largest_ratio) });
            (made.points.radii.unwrap()[10_000], made.preparation.limited_by_neighbours.unwrap_or(0))
        };
        let ((free, none), (limited, some)) = (last(f64::INFINITY), last(2.0));
        if let Size::Bsp(_) = size {
            assert!(free > 2.5 * typical && some > 0 && none == 0, "{size:?} {free} {typical} {some} {none}");
        }
        // Other sizes may need no limit: a mean distance has its own, and an ellipse in the sheet's
        // plane ignores the point's height above the sheet.
        assert!(limited <= free);
        assert!(limited < 2.5 * typical && limited > 0.2 * typical, "{size:?} {limited} {typical}");
    }
}

#[test]
fn ellipses_follow_scan_lines() {
    // Points 1 apart on lines 2.5 apart: a point's 8 nearest neighbours are on three lines.
    let positions: Vec<_> = (0..10_000).map(|i| [f64::from(i % 100), 2.5 * f64::from(i / 100), 0.0]).collect();
    let made = surfels(cloud(positions.clone()), &FromPoints { size: Size::Ellipse, ..FromPoints::default() });
    let middle = 50 * 100 + 50;
    let [s, t] = made.points.axes.as_ref().unwrap()[middle].map(|axis| DVec3::from_array(axis.map(f64::from)));
    // 4 neighbours on the line, at 1 and 2; 2 on each line beside it, at (0, 2.5) and at one of the
    // ties (±1, 2.5).
    assert!((s.normalize().dot(DVec3::Y)).abs() > 0.9 && s.length() / t.length() > 1.2, "{s} {t}");
    let reach = |o: DVec3| (o.dot(s) / s.length_squared()).hypot(o.dot(t) / t.length_squared());
    for offset in [DVec3::X * 2.0, DVec3::Y * 2.5, DVec3::X, DVec3::NEG_Y * 2.5] {
        assert!(reach(offset) <= 1.0 + 1e-6, "{offset}");
    }
    // A disk that reaches the next line has a larger area.
    assert!(s.length() * t.length() < 2.5 * 2.5 * 1.2, "{s} {t}");
}

#[test]
fn clusters_of_three_give_the_sizes_of_their_triangles() {
    // Triangles with edges 3, 4, 5, far apart: each is a cluster, and its longest edge is a
    // diameter of its circumcircle.
    let triangle = [[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [0.0, 4.0, 0.0]];
    let positions: Vec<_> = (0..300).map(|i| triangle[i % 3].map(|c| c + 100.0 * (i / 3) as f64)).collect();
    let of = |size: fn(Triangle) -> Size| [(size(Triangle::MeanEdge), 4.0), (size(Triangle::Circumsphere), 5.0)];
    for (measure, expected) in of(Size::Bsp).into_iter().chain(of(Size::BspGlobal)) {
        let options = FromPoints { size: measure, ..FromPoints::default() };
        let made = surfels(cloud(positions.clone()), &options);
        assert!(made.points.radii.as_ref().unwrap().iter().all(|r| (r - expected).abs() < 1e-5), "{measure:?}");
        assert_eq!(made.collinear, 0);
    }
}

#[test]
fn no_order_and_no_number_of_threads_changes_a_bit() {
    let mut positions = samples(Shape::Torus, 6000).0;
    positions.extend(samples(Shape::Sphere, 500).0.into_iter().map(|p| p.map(|c| 4.0 + c * 0.1)));
    positions.extend((0..900).map(|i| [f64::from(i % 30) * 0.1, f64::from(i / 30) * 0.1, 2.0]));
    positions.extend(vec![[0.5, 0.25, 3.0]; 50]);
    positions.iter_mut().for_each(|p| p[1] += 5.5e6);
    for size in SIZES {
        let options = FromPoints { size, ..within(Some(4.0), 2.0) };
        let rows = |made: Surfels| -> Vec<_> {
            let Points { positions, normals, radii, axes, .. } = made.points;
            let axes = axes.unwrap_or_else(|| vec![[[0.0; 3]; 2]; positions.len()]);
            let rest = normals.unwrap().into_iter().zip(radii.unwrap()).zip(axes);
            let bits = |((n, r), [s, t]): (([f32; 3], f32), [[f32; 3]; 2])| {
                [n, s, t]
                    .map(|v| v.map(f32::to_bits))
                    .as_flattened()
                    .iter()
                    .copied()
                    .chain([r.to_bits()])
                    .collect::<Vec<_>>()
            };
            let mut rows: Vec<_> = positions.iter().map(|p| p.map(f64::to_bits)).zip(rest.map(bits)).collect();
            rows.sort_unstable();
            rows
        };
        let threads = |count| rayon::ThreadPoolBuilder::new().num_threads(count).build().unwrap();
        let first = rows(threads(1).install(|| surfels(cloud(positions.clone()), &options)));
        let mut next = noise(9);
        for count in [2, 5] {
            let mut shuffled = positions.clone();
            for i in (1..shuffled.len()).rev() {
                shuffled.swap(i, (next() * (i + 1) as f64) as usize);
            }
            assert!(rows(threads(count).install(|| surfels(cloud(shuffled), &options))) == first, "{size:?} {count}");
        }
    }
}

#[test]
fn georeferenced_coordinates_stay_to_the_last_digit() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("far.ply");
    let positions: Vec<_> =
        samples(Shape::Torus, 2000).0.into_iter().map(|[x, y, z]| [x + 636_000.001, y + 6_123_456.789, z]).collect();
    let made = surfels(cloud(positions.clone()), &FromPoints { size: Size::Ellipse, ..FromPoints::default() });
    assert_eq!(made.points.positions, positions);
    io::ply::write_points(&path, &made.points, &()).unwrap();
    let read = io::read(&path, &()).unwrap();
    assert_eq!(read, made.points);
    // At such coordinates f32 has steps of half a unit.
    assert!((f64::from(6_123_456.789f32) - 6_123_456.789).abs() > 0.01);
}

#[test]
fn surfels_of_given_normals_end_at_sharp_edges() {
    use epsplat::low_level::metrics::{SurfaceDistances, coverage};
    use epsplat::low_level::surfels::sampling::voxels::Voxel;
    use epsplat::low_level::surfels::sampling::{MeshSurface, Method, Priority, sample};
    let mesh = common::meshes::bar(4);
    let evenly = |surface: &MeshSurface<'_>, voxels: &[Voxel]| Priority::Area.of(surface, voxels);
    let (sampled, _) = sample(&mesh, 4000, &Method::Stratified { priority: &evenly, depth: None }, 0, &()).unwrap();
    let tree = epsplat::low_level::truth::TriangleTree::new(&mesh).unwrap();
    for size in [Size::Knn, Size::Ellipse] {
        let options = FromPoints { size, ..FromPoints::default() };
        let of = |normals: Option<Vec<[f32; 3]>>| {
            surfels(Points { normals, ..cloud(sampled.positions.clone()) }, &options).points
        };
        let points = of(sampled.normals.clone());
        let cut = points.clips.as_ref().unwrap().iter().filter(|clip| !clip.is_none()).count();
        assert!((200..1500).contains(&cut), "{cut}");
        let (scene, _) = build(vec![points], &()).unwrap();
        let rims = |scene: &Scene| SurfaceDistances::of(scene, &mesh, &tree).unwrap().rims_to_mesh.unwrap();
        let whole = Scene { clips: Vec::new(), ..scene.clone() };
        assert!(rims(&scene).mean < 0.2 * rims(&whole).mean, "{:?} {:?}", rims(&scene), rims(&whole));
        let holes = |scene: &Scene| coverage(&tree, scene, 64, 128, &()).unwrap().seen.holes;
        assert!(holes(&scene) <= holes(&whole) + 5, "{} {}", holes(&scene), holes(&whole));
        // Estimated normals turn over several points, so they give no edges; nor does a smooth
        // cloud.
        assert!(of(None).clips.is_none());
        let (positions, normals) = samples(Shape::Sphere, 3000);
        let smooth = surfels(Points { normals: Some(normals), ..cloud(positions) }, &options);
        assert!(smooth.points.clips.is_none());
    }
}
