//! Shares of files of surfels, which processes read alone: together they are the scene of one
//! process, and each knows the facts about all.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use epsplat::io::{self, Input, Points, ply};
use epsplat::low_level::scene::{Colors, Scene};
use epsplat::low_level::surfels::hierarchy::out_of_core;
use epsplat::low_level::surfels::{self, Preparation};

use crate::common::Random;
use crate::common::network::Threads;

type Shared = Option<(Scene, Preparation)>;

/// Disks on a sphere, with colours.
fn sphere(count: usize, center: [f64; 3], radius: f64) -> Points {
    let random = &mut Random(count as u64);
    let mut direction = || {
        let all = [0; 3].map(|_| random.unit() - 0.5);
        let length = all.iter().map(|x| x * x).sum::<f64>().sqrt();
        all.map(|x| x / length)
    };
    let normals: Vec<[f64; 3]> = (0..count).map(|_| direction()).collect();
    let size = (radius * 3.0 / (count as f64).sqrt()) as f32;
    Points {
        positions: normals.iter().map(|normal| [0, 1, 2].map(|k| center[k] + radius * normal[k])).collect(),
        normals: Some(normals.iter().map(|normal| normal.map(|x| x as f32)).collect()),
        radii: Some((0..count).map(|k| size * (1.0 + 0.1 * (k % 5) as f32)).collect()),
        colors: Some(Colors::Srgb8((0..count).map(|k| [k as u8, (k / 3) as u8, 200, 255]).collect())),
        ..Points::default()
    }
}

/// The shares that `of` processes make of the files.
fn shared(paths: &[std::path::PathBuf], of: usize) -> Vec<Shared> {
    let threads = Threads::new(of);
    let members: Vec<_> = (0..of).map(|rank| threads.member(rank)).collect();
    std::thread::scope(|scope| {
        let share = |rank: usize| {
            let member = &members[rank];
            scope.spawn(move || {
                let open = |path: &std::path::PathBuf| {
                    ply::Rows::open(Input::open(path, None).unwrap(), false).unwrap().unwrap()
                };
                let mut files: Vec<_> = paths.iter().map(open).collect();
                ply::Rows::settle_colors(&mut files).unwrap();
                out_of_core::share(&files, member, &()).unwrap()
            })
        };
        let running: Vec<_> = (0..of).map(share).collect();
        running.into_iter().map(|thread| thread.join().unwrap()).collect()
    })
}

fn written(folder: &std::path::Path, inputs: &[Points]) -> Vec<std::path::PathBuf> {
    let write = |(k, points): (usize, &Points)| {
        let path = folder.join(format!("{k}.ply"));
        ply::write_points(&path, points, &()).unwrap();
        path
    };
    inputs.iter().enumerate().map(write).collect()
}

/// The bits of a surfel of a scene.
fn bits(scene: &Scene, k: usize) -> (Vec<u32>, Vec<u32>) {
    let surfel = scene.surfels[k];
    let low = scene.low.get(k).copied().unwrap_or_default();
    let normal = scene.normals.get(k).copied().unwrap_or_default();
    let color = scene.colors.linear(k);
    let all = [surfel.center, surfel.s, surfel.t, low, normal].concat();
    (all.into_iter().map(f32::to_bits).collect(), color.map(f32::to_bits).to_vec())
}

#[test]
fn shares_are_the_scene_together() {
    let with = |points: Points, change: fn(&mut Points)| {
        let mut points = points;
        change(&mut points);
        points
    };
    let scenes: [(&str, Vec<Points>); 6] = [
        ("plain", vec![sphere(3000, [0.0; 3], 1.0)]),
        ("at world coordinates", vec![sphere(2500, [4.5e5, 6.2e6, 80.5], 30.0)]),
        ("several", vec![sphere(2000, [0.0; 3], 1.0), sphere(700, [4.0, 0.0, 1.0], 0.5)]),
        ("with strays", vec![sphere(5000, [0.0; 3], 1.0), sphere(3, [3e9, 1.0, 0.0], 0.5)]),
        ("with a bird", vec![sphere(4000, [0.0; 3], 1.0), sphere(2, [9.0, 0.5, 0.0], 0.01)]),
        ("of one colour", vec![with(sphere(900, [0.0; 3], 1.0), |points| points.colors = None)]),
    ];
    for (name, inputs) in scenes {
        let folder = tempfile::tempdir().unwrap();
        let paths = written(folder.path(), &inputs);
        let read = paths.iter().map(|path| io::read(path, &()).unwrap()).collect();
        let (whole, preparation) = surfels::build(read, &()).unwrap();
        let mut all: Vec<_> = (0..whole.surfels.len()).map(|k| bits(&whole, k)).collect();
        all.sort_unstable();
        for of in [1, 2, 3, 7] {
            let shares: Vec<_> = shared(&paths, of).into_iter().map(Option::unwrap).collect();
            let mut joined: Vec<_> =
                shares.iter().flat_map(|(scene, _)| (0..scene.surfels.len()).map(|k| bits(scene, k))).collect();
            joined.sort_unstable();
            assert!(joined == all, "{name} {of}");
            for (scene, own) in &shares {
                let facts = |scene: &Scene| {
                    let boxes = (scene.bounds(), scene.body().0, scene.core(), scene.framed().0);
                    let largest = (scene.largest_radius(), scene.largest_shorter());
                    let said = (scene.oriented, scene.closed, scene.up, scene.encoded);
                    (scene.origin, boxes, scene.color_range(), largest, said, scene.has())
                };
                assert_eq!(facts(scene), facts(&whole), "{name} {of}");
                assert_eq!(std::mem::discriminant(&scene.colors), std::mem::discriminant(&whole.colors), "{name} {of}");
                let counts = |made: &Preparation| (made.points, made.surfels, made.strays, made.guessed_up);
                assert_eq!(counts(own), counts(&preparation), "{name} {of}");
                // No process holds much more than its part.
                assert!(scene.surfels.len() <= whole.surfels.len() / of + 33, "{name} {of}");
            }
        }
    }
}

/// All processes learn that one of them found a point whose surfel depends on others.
#[test]
fn points_that_need_others_have_no_shares() {
    let changes: [fn(&mut Points); 4] = [
        |points| points.normals.as_mut().unwrap()[2900] = [0.0; 3],
        |points| points.radii.as_mut().unwrap()[17] = -1.0,
        |points| points.positions[1500][1] = f64::NAN,
        |points| points.positions.fill([1.0, 2.0, 3.0]),
    ];
    for (number, change) in changes.into_iter().enumerate() {
        let mut points = sphere(3000, [0.0; 3], 1.0);
        change(&mut points);
        let folder = tempfile::tempdir().unwrap();
        let paths = written(folder.path(), &[points]);
        assert!(shared(&paths, 3).iter().all(Option::is_none), "{number}");
    }
}
