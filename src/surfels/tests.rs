#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]
use proptest::prelude::*;

use super::*;
use crate::Error;
use crate::scene::color::DEFAULT_COLOR;
use crate::scene::{Colors, Scene, Surfel};

fn cloud(positions: Vec<[f64; 3]>) -> Points {
    Points { positions, ..Points::default() }
}

fn noise(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed;
    move || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 11) as f64 / (1u64 << 53) as f64
    }
}

fn sphere(count: u64) -> Vec<[f64; 3]> {
    analytic::generate(analytic::Shape::Sphere, count).map(|s| s.position).collect()
}

fn assert_sound(scene: &Scene) {
    for surfel in &scene.surfels {
        assert!(bytemuck::cast_ref::<_, [f32; 9]>(surfel).iter().all(|c| c.is_finite()), "{surfel:?}");
        assert!(surfel.radius() > 0.0 && surfel.normal().abs().max_element() > 0.0, "{surfel:?}");
        assert!(
            (Vec3::from_array(surfel.s) / surfel.radius()).dot(Vec3::from_array(surfel.t) / surfel.radius()).abs()
                < 1e-5
        );
    }
}

#[test]
fn nothing_to_draw_is_said_in_one_sentence() {
    for (inputs, word) in [
        (vec![], "no input"),
        (vec![Points::default()], "holds no points"),
        (vec![cloud(vec![[f64::NAN, 0.0, 0.0], [1e200, 0.0, 0.0]])], "none of the 2 points"),
    ] {
        let error = build(inputs, &()).unwrap_err();
        assert!(matches!(error, Error::EmptyScene(_)) && error.to_string().contains(word), "{error}");
    }
}

#[test]
fn unusable_points_are_dropped_with_their_attributes() {
    let input = Points {
        positions: vec![[0.0; 3], [f64::INFINITY, 0.0, 0.0], [1.0, 0.0, 0.0]],
        normals: Some(vec![[0.0, 0.0, 2.0], [1.0, 0.0, 0.0], [0.0, 1e-30, 0.0]]),
        radii: Some(vec![0.5, 1.0, 0.25]),
        colors: Some(Colors::Srgb8(vec![[1; 4], [2; 4], [3; 4]])),
        ..Points::default()
    };
    let (scene, preparation) = build(vec![input], &()).unwrap();
    assert_eq!(scene.colors, Colors::Srgb8(vec![[1; 4], [3; 4]]));
    assert_eq!(scene.surfels[0], Surfel::disk(Vec3::ZERO, Vec3::Z, 0.5));
    assert_eq!(scene.surfels[1], Surfel::disk(Vec3::X, Vec3::Y, 0.25));
    let expected =
        Preparation { points: 3, dropped_non_finite: 1, surfels: 2, guessed_up: true, ..Preparation::default() };
    assert_eq!(preparation, expected);
}

#[test]
fn half_axes_come_before_normals_and_radii() {
    let unusable = [
        [[0.0; 3]; 2],
        [[1.0, 0.0, 0.0], [2.0, 0.0, 0.0]],
        [[f32::NAN, 1.0, 0.0], [0.0, 0.0, 1.0]],
        [[1e-30, 0.0, 0.0], [0.0, 1.0, 0.0]],
    ];
    let given = [[0.0, 3.0, 0.0], [0.0, 0.0, 0.5]];
    let input = Points {
        positions: (0..5).map(|i| [f64::from(i), 0.0, 0.0]).collect(),
        normals: Some(vec![[0.0, 0.0, 1.0]; 5]),
        radii: Some(vec![0.25; 5]),
        axes: Some(unusable.into_iter().chain([given]).collect()),
        ..Points::default()
    };
    let (scene, preparation) = build(vec![input.clone()], &()).unwrap();
    assert_eq!((preparation.estimated_normals, preparation.estimated_radii, scene.oriented), (0, 0, true));
    for (i, surfel) in scene.surfels[..4].iter().enumerate() {
        assert_eq!(*surfel, Surfel::disk(Vec3::X * i as f32, Vec3::Z, 0.25));
    }
    assert_eq!((scene.surfels[4].s, scene.surfels[4].t), (given[0], given[1]));
    assert_eq!(scene.surfels[4].normal().normalize(), Vec3::X);
    let without = Points { normals: None, radii: None, ..input };
    let (_, preparation) = build(vec![without], &()).unwrap();
    assert_eq!((preparation.estimated_normals, preparation.estimated_radii), (4, 4));
}

#[test]
fn several_inputs_make_one_scene() {
    let mut with_normals = cloud(sphere(500));
    with_normals.normals = Some(with_normals.positions.iter().map(|p| p.map(|c| c as f32)).collect());
    with_normals.up = Some(Up::Y);
    let mut with_radii = cloud(sphere(300));
    with_radii.radii = Some(vec![0.125; 300]);
    with_radii.colors = Some(Colors::Linear(vec![[2.0, 0.0, 0.0, 1.0]; 300]));
    with_radii.up = Some(Up::Z);
    let (scene, preparation) = build(vec![with_normals, with_radii], &()).unwrap();
    assert_eq!((preparation.estimated_normals, preparation.estimated_radii), (300, 500));
    assert_eq!(scene.up, Up::Z);
    assert_eq!(scene.surfels.len(), 800);
    assert_eq!(scene.colors.linear(499), DEFAULT_COLOR);
    assert_eq!(scene.colors.linear(500), [2.0, 0.0, 0.0, 1.0]);
    assert!((scene.surfels[600].radius() - 0.125).abs() < 1e-6);
    assert_sound(&scene);
}

#[test]
fn short_attributes_are_missing_attributes() {
    let mut input = cloud(sphere(100));
    input.normals = Some(vec![[0.0, 0.0, 1.0]; 40]);
    input.radii = Some(vec![1.0; 300]);
    let (scene, preparation) = build(vec![input], &()).unwrap();
    assert_eq!((preparation.estimated_normals, preparation.estimated_radii), (60, 0));
    assert_sound(&scene);
}

#[test]
fn one_position_is_one_disk_facing_up() {
    for count in [1, 3, 10_000] {
        let (scene, preparation) = build(vec![cloud(vec![[5.0, -3.0, 2e6]; count])], &()).unwrap();
        assert!(scene.surfels.iter().all(|s| *s == scene.surfels[0]));
        assert_eq!(scene.surfels[0].normal().normalize(), scene.up.axis().as_vec3());
        assert!((scene.surfels[0].radius() - 0.5).abs() < 1e-6);
        assert_eq!((preparation.distinct_positions, preparation.median_spacing), (Some(1), None));
    }
}

#[test]
fn sphere_normals_and_radii_are_near_the_truth() {
    for (count, worst_degrees) in [(1_000, 3.0), (100_000, 0.3)] {
        let positions = sphere(count);
        let (scene, preparation) = build(vec![cloud(positions.clone())], &()).unwrap();
        let spacing = (4.0 * std::f64::consts::PI / count as f64).sqrt();
        for (surfel, position) in scene.surfels.iter().zip(&positions) {
            let truth = DVec3::from_array(*position);
            let cosine = surfel.normal().as_dvec3().normalize().dot(truth).abs();
            assert!(cosine > f64::to_radians(worst_degrees).cos(), "{position:?} {}", cosine.acos().to_degrees());
            let ratio = f64::from(surfel.radius()) / spacing;
            assert!((0.7..1.3).contains(&ratio), "{ratio}");
        }
        assert!((0.7..1.1).contains(&(preparation.median_spacing.unwrap() / spacing)));
    }
}

/// Whether a point of the plane z = 0 lies inside a surfel in that plane.
fn holds(surfel: &Surfel, [x, y]: [f64; 2]) -> bool {
    let place = DVec3::new(x - f64::from(surfel.center[0]), y - f64::from(surfel.center[1]), 0.0);
    let along = |axis: [f32; 3]| {
        let axis = DVec3::from_array(axis.map(f64::from));
        place.dot(axis) / axis.length_squared()
    };
    along(surfel.s).hypot(along(surfel.t)) <= 1.0
}

#[test]
fn a_random_plane_is_covered() {
    let mut next = noise(7);
    let count = 40_000;
    let positions: Vec<_> = (0..count).map(|_| [next(), next(), 0.0]).collect();
    let (scene, _) = build(vec![cloud(positions)], &()).unwrap();
    const CELLS: usize = 100;
    let mut cells = vec![Vec::new(); CELLS * CELLS];
    for surfel in &scene.surfels {
        let cell = surfel.center.map(|c| ((c * CELLS as f32) as usize).min(CELLS - 1));
        cells[cell[1] * CELLS + cell[0]].push(*surfel);
    }
    let samples = 100_000;
    let mut holes = 0;
    for _ in 0..samples {
        let (x, y) = (0.05 + 0.9 * next(), 0.05 + 0.9 * next());
        let (column, row) = ((x * CELLS as f64) as usize, (y * CELLS as f64) as usize);
        let covered = (row - 3..=row + 3)
            .flat_map(|r| &cells[r * CELLS + column - 3..=r * CELLS + column + 3])
            .flatten()
            .any(|surfel| holds(surfel, [x, y]));
        holes += u32::from(!covered);
    }
    // The radius of the circle with the same area.
    let mean_radius =
        scene.surfels.iter().map(|s| f64::from(s.normal().length()).sqrt()).sum::<f64>() / f64::from(count);
    println!(
        "holes {} mean radius {} spacings",
        f64::from(holes) / f64::from(samples),
        mean_radius * f64::from(count).sqrt()
    );
    // Disks with the mean distance to 8 neighbours as their radius leave 400.
    assert!(holes <= 8, "{holes} of {samples}");
    // Nor are the disks so large that nothing is sharp.
    assert!(mean_radius * f64::from(count).sqrt() < 1.35, "{mean_radius}");
    let told = coverage(&scene, &()).unwrap().unwrap();
    assert!(told.covered > 0.995 && told.covered < 1.0, "{told:?}");
    // A scene with holes is not reported as covered.
    let mut small = scene;
    small.surfels.iter_mut().for_each(|surfel| {
        (surfel.s, surfel.t) = (surfel.s.map(|c| c * 0.65), surfel.t.map(|c| c * 0.65));
    });
    let told = coverage(&small, &()).unwrap().unwrap();
    assert!(told.covered < 0.97 && told.open > 1000, "{told:?}");
}

#[test]
fn outliers_do_not_fly() {
    let mut positions = sphere(10_000);
    positions.extend([[50.0, 0.0, 0.0], [0.0, 80.0, 0.1]]);
    let (scene, _) = build(vec![cloud(positions)], &()).unwrap();
    assert!(scene.largest_radius() < 0.25, "{}", scene.largest_radius());
}

#[test]
fn any_order_gives_the_same_bits() {
    let mut next = noise(3);
    let mut positions = sphere(5_000);
    positions.extend((0..900).map(|i| [f64::from(i % 30) * 0.01, f64::from(i / 30) * 0.01, 2.0]));
    positions.extend(
        (0..1000).map(|i| [f64::from(i % 10) * 0.05, f64::from(i / 10 % 10) * 0.05, 3.0 + f64::from(i / 100) * 0.05]),
    );
    positions.extend(vec![[0.5, 0.25, -0.0]; 100]);
    positions.extend(vec![[0.5, 0.25, 0.0]; 100]);
    positions.extend((0..500).map(|i| [f64::from(i), 7.0, 7.0]));
    positions.iter_mut().for_each(|p| p[0] += 3.5e6);
    let (first, _) = build(vec![cloud(positions.clone())], &()).unwrap();
    for _ in 0..3 {
        let mut order: Vec<usize> = (0..positions.len()).collect();
        for i in (1..order.len()).rev() {
            order.swap(i, (next() * (i + 1) as f64) as usize);
        }
        let (shuffled, _) = build(vec![cloud(order.iter().map(|&i| positions[i]).collect())], &()).unwrap();
        assert_eq!(shuffled.origin, first.origin);
        for (&i, surfel) in order.iter().zip(&shuffled.surfels) {
            let bits = |s: &Surfel| bytemuck::cast::<_, [u32; 9]>(*s);
            assert_eq!(bits(surfel), bits(&first.surfels[i]));
        }
    }
}

#[test]
fn origin_keeps_small_coordinates_and_moves_far_ones() {
    let bounds = |low: [f64; 3], high: [f64; 3]| Bounds { min: low.into(), max: high.into() };
    assert_eq!(origin_for(&bounds([0.0; 3], [1.0; 3])), DVec3::ZERO);
    assert_eq!(origin_for(&bounds([0.1; 3], [0.1; 3])), DVec3::ZERO);
    let utm = bounds([5e5, 6.1e6, 12.0], [501000.0, 6.101e6, 90.0]);
    let origin = origin_for(&utm);
    assert_eq!(origin.z, 0.0);
    assert!((origin.x - 500500.0).abs() <= 32.0 && (origin.y - 6100500.0).abs() <= 32.0, "{origin}");
    let mut next = noise(5);
    for _ in 0..10_000 {
        let point = 6.1e6 + 1000.0 * next();
        let back = origin.y + f64::from((point - origin.y) as f32);
        assert!((back - point).abs() < 1e-4);
    }
    assert!(origin_for(&bounds([1e18, 0.0, 0.0], [1e18, 1e-300, 0.0])).is_finite());
}

#[test]
fn up_follows_the_inputs_then_the_shape() {
    let flat = vec![[0.0; 3], [10.0, 0.0, 1.0], [0.0, 10.0, 0.0]];
    let up = |points: Points| build(vec![points], &()).unwrap().0.up;
    assert_eq!(up(cloud(flat.clone())), Up::Z);
    assert_eq!(up(Points { up: Some(Up::Y), ..cloud(flat) }), Up::Y);
    assert_eq!(up(cloud(sphere(100))), Up::Y);
}

fn coordinate() -> impl Strategy<Value = f64> {
    prop_oneof![
        8 => (-3i32..3).prop_map(f64::from),
        4 => -1.0..1.0f64,
        1 => Just(-0.0),
        1 => prop_oneof![Just(f64::NAN), Just(f64::INFINITY), Just(1e300), Just(-1e18), Just(1e18), Just(1e-310)],
        1 => any::<f64>(),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]
    #[test]
    fn any_cloud_gives_sound_surfels(
        positions in prop::collection::vec(prop::array::uniform3(coordinate()), 0..60),
        repeats in 1usize..4,
        collinear in any::<bool>(),
        normals in prop::option::of(prop::collection::vec(prop::array::uniform3(any::<f32>()), 0..60)),
        radii in prop::option::of(prop::collection::vec(any::<f32>(), 0..60)),
        axes in prop::option::of(prop::collection::vec(prop::array::uniform2(prop::array::uniform3(any::<f32>())), 0..60)),
        colors in prop::option::of(prop::collection::vec(prop::array::uniform4(any::<f32>()), 0..60)),
        scale in prop_oneof![3 => Just(1.0), 1 => Just(1e-150), 1 => Just(1e-30), 1 => Just(1e17)],
    ) {
        let mut positions: Vec<[f64; 3]> = positions.iter().map(|p| p.map(|c| c * scale)).collect();
        if collinear {
            positions.iter_mut().for_each(|p| *p = [p[0], p[0] * 2.0, p[0] * -0.5]);
        }
        let total = positions.len() * repeats;
        let input = Points {
            positions: positions.iter().cycle().take(total).copied().collect(),
            normals,
            radii,
            axes,
            colors: colors.map(Colors::Linear),
            ..Points::default()
        };
        match build(vec![input], &()) {
            Ok((scene, preparation)) => {
                assert_sound(&scene);
                prop_assert!(scene.origin.is_finite());
                prop_assert_eq!(scene.surfels.len() as u64 + preparation.dropped_non_finite, total as u64);
                for i in 0..scene.surfels.len() {
                    prop_assert!(scene.colors.linear(i).iter().all(|c| c.is_finite()));
                }
                let (low, high) = scene.color_range();
                prop_assert!(low.iter().zip(high).all(|(l, h)| *l <= h && l.is_finite() && h.is_finite()));
            }
            Err(error) => prop_assert!(matches!(error, Error::EmptyScene(_))),
        }
    }
}
