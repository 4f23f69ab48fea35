//! Comparison of searches with brute force.

#![allow(clippy::unwrap_used)]
use super::*;
use crate::scene::Bounds;
use glam::DVec3;

fn distinct(points: &[[f64; 3]]) -> DistinctPositions {
    let bounds = points.iter().fold(Bounds::EMPTY, |b, p| b.with_point(DVec3::from_array(*p)));
    DistinctPositions::new(points, &bounds, DVec3::ZERO).unwrap()
}

/// Compares the search with brute force, for every `step`-th query.
fn check(points: &[[f64; 3]], count: usize, step: usize) {
    let distinct = distinct(points);
    for (point, &index) in points.iter().zip(distinct.of_point()) {
        assert_eq!((DVec3::from_array(*point) * distinct.scale()).to_array(), distinct.as_slice()[index as usize]);
    }
    let search = NeighbourSearch::new(&distinct, count);
    let (mut found, mut expected) = (Vec::new(), Vec::new());
    for index in (0..distinct.len() as u32).step_by(step) {
        search.nearest(index, &mut found);
        expected.clear();
        expected.extend((0..distinct.len() as u32).filter(|&other| other != index).map(|other| Neighbour {
            squared_distance: distinct.position(index).distance_squared(distinct.position(other)),
            index: other,
        }));
        expected.sort_by(|a, b| a.squared_distance.total_cmp(&b.squared_distance).then(a.index.cmp(&b.index)));
        expected.truncate(count);
        assert_eq!(found, expected, "query {index}");
    }
    for first in [0, distinct.len() / 3] {
        let mut next = first;
        search.of_range(first..distinct.len(), |index, together| {
            assert_eq!(index as usize, next);
            search.nearest(index, &mut found);
            assert_eq!(together, found, "query {index} in its block");
            next += 1;
        });
        assert_eq!(next, distinct.len());
    }
}

/// Pseudorandom numbers in [0, 1).
fn noise(seed: u64) -> impl Iterator<Item = f64> {
    let mut state = seed;
    std::iter::repeat_with(move || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 11) as f64 / (1u64 << 53) as f64
    })
}

fn random(count: usize) -> Vec<[f64; 3]> {
    let mut noise = noise(1);
    (0..count).map(|_| std::array::from_fn(|_| noise.next().unwrap())).collect()
}

#[test]
fn few_points() {
    for count in 0..40 {
        check(&random(count.max(1)), 12, 1);
    }
}

#[test]
fn random_points() {
    check(&random(20_000), 12, 97);
    check(&random(20_000), 1, 97);
}

#[test]
fn coincident_points() {
    check(&vec![[1.0, 2.0, 3.0]; 10_000], 12, 1);
    let two = [[1.0, 2.0, 3.0], [1.0, 2.0, 3.5]];
    check(&(0..10_000).map(|i| two[i % 2]).collect::<Vec<_>>(), 12, 1);
    let mut many = random(100);
    many.extend(vec![[0.5; 3]; 10_000]);
    check(&many, 12, 1);
}

#[test]
fn planes_and_lines() {
    for axis in 0..3 {
        let mut plane = random(100_000);
        plane.iter_mut().for_each(|p| p[axis] = 0.25);
        check(&plane, 12, 4999);
        let mut line = random(50_000);
        line.iter_mut().for_each(|p| *p = std::array::from_fn(|i| if i == axis { p[i] } else { 0.25 }));
        check(&line, 12, 4999);
    }
}

#[test]
fn grids_tie_everywhere() {
    let square: Vec<_> = (0..90_000).map(|i| [(i % 300) as f64, (i / 300) as f64, 7.0]).collect();
    check(&square, 12, 1999);
    let cube: Vec<_> = (0..27_000).map(|i| [(i % 30) as f64, (i / 30 % 30) as f64, (i / 900) as f64]).collect();
    check(&cube, 12, 499);
    check(&cube, 7, 499);
}

#[test]
fn many_at_one_distance() {
    let mut circle: Vec<_> = (0..4_000)
        .map(|i| {
            let (sin, cos) = (i as f64 * 1e-3).sin_cos();
            [cos, sin, 0.0]
        })
        .collect();
    circle.push([0.0; 3]);
    check(&circle, 12, 1);
}

#[test]
fn a_far_outlier() {
    let mut points = random(20_000);
    points.push([1e15, 0.0, 0.0]);
    check(&points, 12, 97);
}

#[test]
fn extreme_sizes() {
    for size in [1e-320, 1e-290, 1e-150, 1e-20, 1e18] {
        let points: Vec<_> = random(500).into_iter().map(|p| p.map(|c| c * size)).collect();
        check(&points, 12, 1);
    }
    let spread: Vec<_> = (0..300).map(|i| [10f64.powi(-i), 0.0, 0.0]).collect();
    let distinct = distinct(&spread);
    let search = NeighbourSearch::new(&distinct, 12);
    let mut found = Vec::new();
    for index in 0..distinct.len() as u32 {
        search.nearest(index, &mut found);
        assert_eq!(found.len(), 12);
        assert!(found.iter().all(|n| n.squared_distance > 0.0));
    }
}
