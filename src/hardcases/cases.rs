//! Hard geometry: disks seen edge-on, through and around the camera, too small, too thin, too
//! large, and at the edge of the image.

use std::f64::consts::TAU;

use glam::DVec3;

use super::HardCase;
use super::staging::{BOTH, Entry, Filling, Stage, build, fraction};
use crate::error::Result;
use crate::scene::Projection;

/// The sentence about the bound of a case that says nothing else: these errors dominate it.
pub const FRAGMENTS: &str =
    "the roundings of rho and depth over the cosine between view ray and normal, pixel by pixel";

/// Builds the cases.
pub fn cases() -> Result<Vec<HardCase>> {
    build(LIST)
}

const LIST: &[Entry] = &[
    Entry {
        name: "edge-on exactly",
        about: "Disks whose planes contain the view rays of a column or row of pixels: they cover nothing and change nothing behind them.",
        bound: "that of the sheet behind: the disks have no fragments",
        size: (65, 49),
        stage: Stage::plain,
        fill: edge_on_exactly,
        projections: BOTH,
    },
    Entry {
        name: "edge-on by 1e-7",
        about: "Disks tilted by 1e-7 to 1e-3 from edge-on, thinner than a millionth of a pixel, each on a column of pixels.",
        bound: "rho in doubled precision (2^-42) over the cosine; depth in f32 over the cosine times the distance from the centre",
        size: (65, 49),
        stage: Stage::plain,
        fill: edge_on_nearly,
        projections: BOTH,
    },
    Entry {
        name: "edge-on, askew",
        about: "The same in a turned view, where no coordinate is a round number.",
        bound: "rho in doubled precision (2^-42) over the cosine; depth in f32 over the cosine times the distance from the centre",
        size: (64, 48),
        stage: Stage::askew,
        fill: edge_on_askew,
        projections: BOTH,
    },
    Entry {
        name: "through the camera plane",
        about: "A floor, a wall and random disks that reach from behind the camera to in front of it: the part in front shows.",
        bound: "records anchored in the image: 15 u of the rows' terms over the cosine",
        size: (72, 60),
        stage: Stage::plain,
        fill: through_the_camera_plane,
        projections: BOTH,
    },
    Entry {
        name: "across the near depth",
        about: "Disks of all slants that the near depth cuts: the part past it shows, to its full width.",
        bound: "records anchored in the image: 15 u of the rows' terms over the cosine",
        size: (72, 60),
        stage: |projection, size| {
            let mut stage = Stage::plain(projection, size)?;
            stage.camera.near = 0.5;
            Ok(stage)
        },
        fill: across_the_near_depth,
        projections: BOTH,
    },
    Entry {
        name: "around the camera",
        about: "The camera in a box of six disks and at the centre of a seventh, which it sees exactly edge-on.",
        bound: "records anchored in the image: 15 u of the rows' terms over the cosine",
        size: (72, 60),
        stage: Stage::plain,
        fill: around_the_camera,
        projections: BOTH,
    },
    Entry {
        name: "inside a splat",
        about: "The camera 1e-4 units above a large disk: depths from the near depth to the disk's rim.",
        bound: "records anchored in the image: 15 u of the rows' terms over the cosine",
        size: (72, 60),
        stage: Stage::plain,
        fill: inside_a_splat,
        projections: BOTH,
    },
    Entry {
        name: "one disk over all",
        about: "One disk with a radius of ten thousand pixels that fills the image: one workgroup draws all of it.",
        bound: FRAGMENTS,
        size: (96, 80),
        stage: Stage::askew,
        fill: one_disk,
        projections: BOTH,
    },
    Entry {
        name: "centre far outside",
        about: "Disks that cover the image from centres five million pixels away, where f32 cannot represent half pixels.",
        bound: "records anchored in the image (pinhole) or 2^22 pixels away (orthographic)",
        size: (64, 48),
        stage: Stage::plain,
        fill: centre_far_outside,
        projections: BOTH,
    },
    Entry {
        name: "1/100 pixel",
        about: "Disks of 1/100 pixel: those on a pixel's centre cover it, those beside it cover nothing.",
        bound: "the centre's pixel in doubled precision, 5 u of a pixel over a radius of 1/100",
        size: (64, 48),
        stage: Stage::askew,
        fill: hundredth_of_a_pixel,
        projections: BOTH,
    },
    Entry {
        name: "anisotropy 1000:1",
        about: "Needles of 20 by 1/50 pixels and ribbons of 1000 by 1, turned every way.",
        bound: "thin records of 36 bits across, 24 along",
        size: (64, 64),
        stage: Stage::askew,
        fill: needles,
        projections: BOTH,
    },
    Entry {
        name: "intersecting sheets",
        about: "Two sheets of disks that cross within the image: each is nearest in its half, and epsilon blends the seam.",
        bound: FRAGMENTS,
        size: (64, 48),
        stage: Stage::askew,
        fill: intersecting,
        projections: BOTH,
    },
    Entry {
        name: "image edges and corners",
        about: "Disks centred on the image's corners, along its edges, and just outside them.",
        bound: FRAGMENTS,
        size: (33, 31),
        stage: Stage::askew,
        fill: edges,
        projections: BOTH,
    },
];

fn edge_on_exactly(stage: &Stage) -> Filling {
    let mut surfels = stage.sheet(5.0, 0.3, |_, _| 4.0);
    let (across, down) = (DVec3::X, DVec3::Y);
    for k in 0..40 {
        // The planes contain the eye: with x = 0 or y = 0 the determinant is exactly zero in any
        // precision.
        let along = 1.5 * (fraction(k, 0) - 0.5);
        let z = 1.0 + 2.0 * fraction(k, 1);
        let (center, side) = if k % 2 == 0 { (down * along, down) } else { (across * along, across) };
        surfels.push(stage.surfel(center + DVec3::Z * z, side * 0.5, DVec3::Z * 0.5));
    }
    Filling::of(surfels, (1.0, 1.0)).with_lone_rims()
}

/// A disk of radius 0.5 at the centre of pixel (x, y). It is tilted by `tilt` from the plane that
/// contains the view ray and the image's vertical.
fn standing(stage: &Stage, x: f64, y: f64, z: f64, tilt: f64) -> crate::scene::Surfel {
    let center = stage.at(x + 0.5, y + 0.5, z);
    let ray = stage.ray(center);
    let side = DVec3::Y.cross(ray).normalize();
    let up = ray.cross(side);
    stage.surfel(center, up * 0.5, (ray + side * tilt).normalize() * 0.5)
}

const TILTS: [f64; 5] = [1e-7, 1e-6, 1e-5, 1e-4, 1e-3];

fn edge_on_nearly(stage: &Stage) -> Filling {
    let mut surfels = Vec::new();
    for (k, tilt) in TILTS.into_iter().enumerate() {
        // On the axis, where centres are exact, and off it.
        surfels.push(standing(stage, 32.0, 6.0 + 9.0 * k as f64, 2.5, tilt));
        surfels.push(standing(stage, 8.0 + 5.0 * k as f64, 24.0, 3.0, tilt));
        surfels.push(standing(stage, 40.0 + 4.0 * k as f64, 20.0, 3.0, -tilt));
    }
    // At tilts of up to 1e-5, the depth's error exceeds epsilon. This concerns nine of fifteen
    // columns, each of 11 to 16 pixels.
    Filling { excused: 0.05, ..Filling::of(surfels, (0.02, 0.2)) }
}

fn edge_on_askew(stage: &Stage) -> Filling {
    let mut surfels = stage.sheet(5.0, 0.3, |_, _| 4.0);
    for (k, tilt) in TILTS.into_iter().cycle().take(20).enumerate() {
        let (x, y) = ((64.0 * fraction(k, 0)).floor(), (48.0 * fraction(k, 1)).floor());
        surfels.push(standing(stage, x, y, 2.0 + fraction(k, 2), tilt));
    }
    // As in edge_on_nearly(), the depth's error exceeds epsilon, in twelve of twenty columns.
    Filling { excused: 0.08, ..Filling::of(surfels, (1.0, 1.0)).with_lone_rims() }
}

fn through_the_camera_plane(stage: &Stage) -> Filling {
    let mut surfels = vec![
        stage.disk(DVec3::new(0.0, 1.0, 0.0), DVec3::new(0.05, -1.0, -0.2), 1000.0),
        stage.disk(DVec3::new(-1.0, 0.0, 0.0), DVec3::new(1.0, 0.05, -0.3), 1000.0),
        stage.disk(DVec3::new(0.0, 0.8, -5.0), DVec3::new(0.0, -1.0, -0.1), 20.0),
    ];
    for k in 0..60 {
        let center = DVec3::new(3.0 * (fraction(k, 0) - 0.5), 3.0 * (fraction(k, 1) - 0.5), fraction(k, 2) - 0.5);
        let normal = DVec3::new(fraction(k, 3) - 0.5, fraction(k, 4) - 0.5, fraction(k, 5) - 0.5);
        surfels.push(stage.disk(center, normal, 0.2 + fraction(k, 1)));
    }
    stage.rims_in(Projection::Orthographic, Filling::of(surfels, (0.7, 1.0)))
}

fn across_the_near_depth(stage: &Stage) -> Filling {
    let disk = |k: usize| {
        let center = stage.at(72.0 * fraction(k, 0), 60.0 * fraction(k, 1), 0.5 + 0.3 * fraction(k, 2));
        let normal = DVec3::new(fraction(k, 3) - 0.5, fraction(k, 4) - 0.5, 0.6 * (fraction(k, 5) - 0.5));
        // Most disks cross the near depth: their half extent in depth is the radius times the sine
        // of the slant.
        stage.disk(center, normal, 0.1 + 0.3 * fraction(k, 5))
    };
    Filling::of((0..100).map(disk).collect(), (0.3, 1.0)).with_lone_rims()
}

fn around_the_camera(stage: &Stage) -> Filling {
    let mut surfels = Vec::new();
    for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
        for side in [1.5, -1.5] {
            surfels.push(stage.disk(axis * side, axis + DVec3::new(0.03, 0.05, -0.04), 5.0));
        }
    }
    surfels.push(stage.surfel(DVec3::ZERO, DVec3::X * 3.0, DVec3::Z * 3.0));
    Filling::of(surfels, (0.99, 1.0))
}

fn inside_a_splat(stage: &Stage) -> Filling {
    let surfels = vec![
        stage.disk(DVec3::new(0.0, 1e-4, 0.0), DVec3::new(0.02, -1.0, -0.03), 3.0),
        stage.disk(DVec3::new(0.0, 0.0, 4.0), DVec3::new(0.1, 0.2, -1.0), 9.0),
    ];
    Filling::of(surfels, (1.0, 1.0))
}

fn one_disk(stage: &Stage) -> Filling {
    let radius = 1e4 * stage.pixel(3.0);
    Filling::of(vec![stage.disk(stage.at(50.0, 20.0, 3.0), DVec3::new(1e-3, 2e-3, -1.0), radius)], (1.0, 1.0))
}

fn centre_far_outside(stage: &Stage) -> Filling {
    let disk = |x: f64, y: f64, z: f64| stage.disk(DVec3::new(x, y, z), DVec3::new(1e-7, 0.0, -1.0), 1e6);
    Filling::of(vec![disk(6e5, 0.0, 5.0), disk(0.0, -7e5, 50.0)], (1.0, 1.0))
}

fn hundredth_of_a_pixel(stage: &Stage) -> Filling {
    let (width, height) = stage.size();
    let mut surfels = Vec::new();
    for k in 0..width * height {
        let (x, y) = ((k % width) as f64 + 0.5, (k / width) as f64 + 0.5);
        let z = 3.0 + 0.02 * fraction(k, 0);
        let angle = TAU * fraction(k, 1);
        // Half of the disks lie beside the pixel's centre.
        let from_center = if (k / width + k % width).is_multiple_of(2) { 0.005 } else { 0.3 };
        let center = stage.at(x + from_center * angle.cos(), y + from_center * angle.sin(), z);
        surfels.push(stage.disk(center, DVec3::new(0.2, 0.1, -1.0), 0.01 * stage.pixel(z)));
    }
    Filling::of(surfels, (0.5, 0.5))
}

fn needles(stage: &Stage) -> Filling {
    let mut surfels = Vec::new();
    for k in 0..1000 {
        let z = 3.0 + 0.02 * fraction(k, 0);
        let center = stage.at(64.0 * fraction(k, 1), 64.0 * fraction(k, 2), z);
        let (sin, cos) = (TAU * fraction(k, 3)).sin_cos();
        let long = DVec3::new(cos, sin, 0.4 * (fraction(k, 4) - 0.5)).normalize();
        let short = long.cross(DVec3::Z).normalize();
        let (length, width) = if k % 50 == 0 { (1000.0, 1.0) } else { (20.0, 0.02) };
        surfels.push(stage.surfel(center, long * length * stage.pixel(z), short * width * stage.pixel(z)));
    }
    Filling { excused: 0.02, ..Filling::of(surfels, (0.3, 1.0)).with_lone_rims() }
}

fn intersecting(stage: &Stage) -> Filling {
    let mut surfels = stage.sheet(4.0, 0.2, |x, _| 3.0 + 0.6 * (x - 32.0) / 32.0);
    surfels.extend(stage.sheet(4.0, 0.2, |x, y| 3.0 - 0.5 * (x - 32.0) / 32.0 + 0.1 * (y - 24.0) / 24.0));
    Filling::of(surfels, (1.0, 1.0)).with_lone_rims()
}

fn edges(stage: &Stage) -> Filling {
    let (width, height) = stage.size();
    let (width, height) = (width as f64, height as f64);
    let mut surfels = Vec::new();
    let mut put = |x: f64, y: f64, radius: f64| {
        let k = surfels.len();
        let normal = DVec3::new(0.5 * (fraction(k, 0) - 0.5), 0.5 * (fraction(k, 1) - 0.5), -1.0);
        surfels.push(stage.disk(stage.at(x, y, 3.0), normal, radius * stage.pixel(3.0)));
    };
    for (x, y) in [(0.0, 0.0), (width, 0.0), (0.0, height), (width, height)] {
        for radius in [0.8, 2.0, 7.0] {
            put(x, y, radius);
            put(x + 0.3 * if x > 0.0 { 1.0 } else { -1.0 }, y, radius + 0.1);
        }
    }
    for k in 0..60 {
        let along = fraction(k, 2);
        let outside = 3.0 * (fraction(k, 3) - 0.5);
        let radius = 0.3 + 3.0 * fraction(k, 4);
        match k % 4 {
            0 => put(along * width, -outside, radius),
            1 => put(along * width, height + outside, radius),
            2 => put(-outside, along * height, radius),
            _ => put(width + outside, along * height, radius),
        }
    }
    Filling::of(surfels, (0.2, 0.9)).with_lone_rims()
}
