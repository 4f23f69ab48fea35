//! Tests of fewer points than neighbours, down to one, and of coincident points.
#![allow(clippy::unwrap_used)]

use super::*;
use crate::random::Random;
use crate::scene::{PointSize, Scene};

/// The arrangements of points: in a cube, in a plane, on a line, on a sphere, and in a cube with
/// all but one of them close together.
const WAYS: u64 = 5;

fn points(way: u64, count: usize, scale: f64) -> Vec<[f64; 3]> {
    let mut random = Random::stream(way, count as u64);
    let mut place = |k: usize| {
        let [x, y, z] = [(); 3].map(|()| random.number() - 0.5);
        let at = match way {
            0 => DVec3::new(x, y, z),
            1 => DVec3::new(x, y, 0.2 * x),
            2 => DVec3::new(x, 2.0 * x, -x),
            3 => DVec3::new(x, y, z).normalize(),
            _ => DVec3::new(x, y, z) * if k == 0 { 1.0 } else { 1e-3 },
        };
        (at * scale).to_array()
    };
    (0..count).map(&mut place).collect()
}

fn cloud(positions: Vec<[f64; 3]>) -> Points {
    Points { positions, ..Points::default() }
}

/// The distances of each point to the nearest and to the farthest other one.
fn distances(points: &[[f64; 3]]) -> Vec<[f64; 2]> {
    let places: Vec<DVec3> = points.iter().copied().map(DVec3::from_array).collect();
    let of = |at: &DVec3| {
        let others = places.iter().map(|other| other.distance(*at)).filter(|distance| *distance > 0.0);
        others.fold([f64::INFINITY, 0.0], |[least, most]: [f64; 2], d| [least.min(d), most.max(d)])
    };
    places.iter().map(of).collect()
}

/// The median distance to the nearest other point; the upper one of two middle values.
fn median(points: &[[f64; 3]]) -> f64 {
    let mut nearest: Vec<f64> = distances(points).into_iter().map(|[nearest, _]| nearest).collect();
    nearest.sort_by(f64::total_cmp);
    nearest[nearest.len() / 2]
}

/// The longer half-axes of the surfels that `size` makes, or [`build`] for `None`.
fn radii(size: Option<Size>, positions: &[[f64; 3]], limits: Limits) -> Vec<f64> {
    let input = cloud(positions.to_vec());
    let scene = |scene: Scene| scene.surfels.iter().map(|surfel| f64::from(surfel.radius())).collect();
    match size {
        Some(size) => {
            let options = FromPoints { size, limits, ..FromPoints::default() };
            let made = from_points(vec![input], &options, &()).unwrap();
            assert!(made.points.normals.unwrap().iter().all(|normal| unit(*normal).is_some()));
            made.points.radii.unwrap().into_iter().map(f64::from).collect()
        }
        None => scene(build_within(vec![input], Vec::new(), &limits, &()).unwrap().0),
    }
}

fn sizes() -> impl Iterator<Item = Option<Size>> {
    Size::ALL.into_iter().map(|(size, _)| Some(size)).filter(|size| *size != Some(Size::Qsplat)).chain([None])
}

#[test]
fn surfels_of_a_few_points_are_as_large_as_these_lie_apart() {
    let unlimited = Limits { largest_ratio: f64::INFINITY, ..Limits::default() };
    for way in 0..WAYS {
        for count in 2..=17 {
            let at = |scale: f64| points(way, count, scale);
            let all = distances(&at(1.0));
            let least = all.iter().fold(f64::INFINITY, |least, [nearest, _]| least.min(*nearest));
            let most = all.iter().fold(0.0, |most: f64, [_, farthest]| most.max(*farthest));
            for size in sizes() {
                let made = radii(size, &at(1.0), unlimited);
                assert_eq!(made.len(), count);
                for (radius, [_, farthest]) in made.iter().zip(&all) {
                    let of_all = matches!(size, Some(Size::BspGlobal(_) | Size::Bsp(_)));
                    let high = if of_all { most } else { *farthest };
                    // A circle through the corners of a sliver may have any size.
                    let circle = size.is_some_and(|size| {
                        matches!(size, Size::Bsp(Triangle::Circumsphere) | Size::BspGlobal(Triangle::Circumsphere))
                    });
                    assert!(*radius > 0.3 * least, "{size:?} {way} {count}: {radius} {least}");
                    assert!(circle || *radius < 3.0 * high, "{size:?} {way} {count}: {radius} {high}");
                }
                for scale in [f64::exp2(-20.0), f64::exp2(30.0)] {
                    for (scaled, radius) in radii(size, &at(scale), unlimited).iter().zip(&made) {
                        assert!((scaled / scale / radius - 1.0).abs() < 1e-5, "{size:?} {way} {count} {scale}");
                    }
                }
            }
        }
    }
}

#[test]
fn points_facing_the_camera_have_the_spacing_of_a_few() {
    let common = |positions: Vec<[f64; 3]>| {
        let (scene, preparation) =
            build_facing(vec![cloud(positions)], PointSize::default(), &Limits::default(), &()).unwrap();
        (f64::from(scene.surfels[0].radius()), preparation.common_radius)
    };
    for way in 0..WAYS {
        for count in 2..=16 {
            for scale in [1e-6, 1.0, 1e6] {
                let positions = points(way, count, scale);
                let (radius, told) = common(positions.clone());
                assert!((radius / (1.8 * median(&positions)) - 1.0).abs() < 1e-6, "{way} {count}: {radius}");
                assert_eq!(told.map(|(points, _)| points), Some(count as u64));
                for copies in [2, 9, 40] {
                    let all = (0..copies).flat_map(|_| positions.iter().copied()).collect();
                    assert_eq!(common(all).0, radius, "{way} {count} {copies}");
                }
            }
        }
    }
    // One position determines no spacing.
    assert_eq!(common(vec![[3.0; 3]; 7]), (0.5, None));
}

#[test]
fn points_at_one_place_are_sized_as_one() {
    for size in sizes() {
        for count in 1..=9 {
            let positions = points(0, count, 1.0);
            let alone = radii(size, &positions, Limits::default());
            for copies in [2, 17] {
                let all: Vec<[f64; 3]> = (0..copies).flat_map(|_| positions.iter().copied()).collect();
                let made = radii(size, &all, Limits::default());
                assert_eq!(made, alone.repeat(copies), "{size:?} {count} {copies}");
            }
            assert!(count > 1 || alone == [0.5], "{size:?} {alone:?}");
        }
    }
}

#[test]
fn a_few_points_are_no_outliers_of_each_other() {
    for way in 0..WAYS {
        for count in 1..=16usize {
            for deviations in [0.0, 1.0, 3.0] {
                let limits = Limits { outliers: Some(deviations), ..Limits::default() };
                let kept = radii(None, &points(way, count, 1.0), limits).len();
                assert!(kept > 0 && (count > 2 || kept == count), "{way} {count} {deviations}: {kept}");
            }
        }
    }
}

#[test]
fn coverage_of_a_few_is_told() {
    for way in 0..WAYS {
        for count in 1..=16usize {
            let positions = points(way, count, 1.0);
            let (scene, preparation) = build(vec![cloud(positions.clone())], &()).unwrap();
            let told = coverage(&scene, &()).unwrap();
            assert_eq!(told.is_some(), count > 1);
            let Some(told) = told else { continue };
            assert!((0.0..=1.0).contains(&told.covered), "{told:?}");
            for spacing in [told.spacing, preparation.median_spacing.unwrap()] {
                assert!((spacing / median(&positions) - 1.0).abs() < 1e-3, "{way} {count}: {spacing}");
            }
        }
    }
}

#[test]
fn neighbours_along_the_normal_say_how_large_an_ellipse_is() {
    for count in 2..=9 {
        let positions: Vec<[f64; 3]> = (0..count).map(|k| [0.0, 0.0, 1e-6 * f64::from(k)]).collect();
        let normals = Some(vec![[0.0, 0.0, 1.0]; positions.len()]);
        for size in [Size::Knn, Size::Ellipse] {
            let input = Points { normals: normals.clone(), ..cloud(positions.clone()) };
            let made = from_points(vec![input], &FromPoints { size, ..FromPoints::default() }, &()).unwrap();
            let radii = made.points.radii.unwrap();
            assert!(radii.iter().all(|radius| (3e-7..2e-5).contains(radius)), "{size:?} {count}: {radii:?}");
        }
    }
}
