//! Hard outlines: disks that end at lines in their planes, surfaces with two sides, and pixels with
//! many samples.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

use super::HardCase;
use super::staging::{BOTH, Entry, Filling, Stage, build, fraction};
use crate::error::Result;
use crate::scene::{Clip, Samples, Surfel};

/// Builds the cases.
pub fn cases() -> Result<Vec<HardCase>> {
    build(LIST)
}

/// The parts of the cases' bounds.
const LINES: &str = "the distance inside a line: the line's length times the error of (u, v), and 10 u of itself";
const SIDES: &str = "the distance inside a side: the error of (u, v), and 50 u of itself";
const MEAN: &str = "the mean of the samples' bounds, each derived from the sample's own fragments";

const LIST: &[Entry] = &[
    Entry {
        name: "disks cut by lines",
        about: "Disks and needles that lines cut: through the centre, near the rim, past it, to slivers, and to nothing.",
        bound: LINES,
        size: (64, 48),
        stage: Stage::askew,
        fill: cut_disks,
        projections: BOTH,
    },
    Entry {
        name: "triangles cut by lines",
        about: "The same disks and needles as triangles: lines cut polygons.",
        bound: SIDES,
        size: (64, 48),
        stage: Stage::askew,
        fill: |stage| Filling { covered: (0.5, 0.8), ..cut_disks(stage).outline(3) },
        projections: BOTH,
    },
    Entry {
        name: "cut disks, edge-on",
        about: "Half disks tilted by 1e-5 to 1e-2 from edge-on, cut along the view or across it, in front of a sheet.",
        bound: LINES,
        size: (64, 48),
        stage: Stage::askew,
        fill: cut_edge_on,
        projections: BOTH,
    },
    Entry {
        name: "a disk over all, cut at a corner",
        about: "A disk with a radius of ten thousand pixels whose two lines meet in the image, seen at a slant.",
        bound: LINES,
        size: (96, 80),
        stage: Stage::askew,
        fill: corner_of_a_large_disk,
        projections: BOTH,
    },
    Entry {
        name: "two halves of a disk",
        about: "Disks in two halves that meet at a line: each fragment belongs to one half, or to both on the line itself.",
        bound: LINES,
        size: (64, 48),
        stage: Stage::askew,
        fill: halves,
        projections: BOTH,
    },
    Entry {
        name: "fronts and backs that cross",
        about: "A front and a back sheet that cross at a slant, all within epsilon: each pixel shows the nearer side.",
        bound: "which side is nearest is known up to the depths' bounds and one unit in their last place",
        size: (64, 48),
        stage: Stage::askew,
        fill: sides_that_cross,
        projections: BOTH,
    },
    Entry {
        name: "16 samples, thin parts",
        about: "Needles thinner than a sample and disks as small as one, all translucent, over nothing.",
        bound: MEAN,
        size: (40, 32),
        stage: Stage::askew,
        fill: thin_parts,
        projections: BOTH,
    },
    Entry {
        name: "8 samples, cut and crossing",
        about: "Two sheets of cut disks that pass through each other, with a grid of samples that is not square.",
        bound: MEAN,
        size: (40, 32),
        stage: Stage::askew,
        fill: cut_and_crossing,
        projections: BOTH,
    },
    Entry {
        name: "4 samples, near the camera plane",
        about: "Random disks from behind the camera to in front of it, from a fraction of a pixel to the whole image.",
        bound: MEAN,
        size: (36, 30),
        stage: Stage::plain,
        fill: near_with_samples,
        projections: BOTH,
    },
];

/// A clip line at `offset` radii from the centre; the side toward `angle` is kept.
fn line(angle: f64, offset: f64) -> [f32; 3] {
    [angle.cos() as f32, angle.sin() as f32, -offset as f32]
}

fn samples(across: u32, down: u32, filling: Filling) -> Filling {
    let mut filling = filling;
    filling.options.samples = Samples { across, down };
    filling
}

/// Returns disk number `k` of a series over the image, at about depth `z`, with a radius of
/// `pixels`.
fn scattered(stage: &Stage, k: usize, z: f64, pixels: f64) -> Surfel {
    let (width, height) = stage.size();
    let z = z + 0.02 * fraction(k, 0);
    let center = stage.at(width as f64 * fraction(k, 1), height as f64 * fraction(k, 2), z);
    let normal = DVec3::new(fraction(k, 3) - 0.5, fraction(k, 4) - 0.5, -1.0);
    stage.disk(center, normal, pixels * stage.pixel(z))
}

fn cut_disks(stage: &Stage) -> Filling {
    let (mut surfels, mut clips) = (Vec::new(), Vec::new());
    for k in 0..240 {
        let mut surfel = scattered(stage, k, 3.0, 2.0 + 5.0 * fraction(k, 5));
        if k % 4 == 0 {
            surfel.t = surfel.t.map(|c| 0.02 * c);
        }
        surfels.push(surfel);
        let angle = TAU * fraction(k, 3);
        clips.push(match k % 6 {
            0 => Clip([line(angle, 0.0), Clip::NONE.0[0]]),
            1 => Clip([line(angle, 0.9), line(angle + 1.0, 0.0)]),
            // A sliver between two nearly equal lines.
            2 => Clip([line(angle, 0.1), line(angle + PI, -0.12)]),
            3 => Clip([line(angle, -0.5), line(angle + 2.0, -0.3)]),
            // Lines past the rim, on one side or the other, keep the whole disk or nothing.
            4 => Clip([line(angle, -1.5), line(angle, if k % 12 == 4 { 1.5 } else { -2.0 })]),
            _ => Clip::NONE,
        });
    }
    Filling { clips, excused: 0.02, ..Filling::of(surfels, (0.7, 1.0)).with_lone_rims() }
}

fn cut_edge_on(stage: &Stage) -> Filling {
    let mut surfels = stage.sheet(5.0, 0.3, |_, _| 4.0);
    let mut clips = vec![Clip::NONE; surfels.len()];
    for k in 0..40 {
        let center = stage.at(64.0 * fraction(k, 0), 48.0 * fraction(k, 1), 2.0 + fraction(k, 2));
        let ray = stage.ray(center);
        let side = DVec3::new(fraction(k, 3) - 0.5, fraction(k, 4) - 0.5, 0.1).cross(ray).normalize();
        let tilt = 10f64.powf(-5.0 + 3.0 * fraction(k, 5));
        let away = (ray + ray.cross(side) * tilt).normalize();
        surfels.push(stage.surfel(center, side * 0.5, away * 0.5));
        let angle = if k % 2 == 0 { 0.0 } else { 0.5 * PI };
        clips.push(Clip([line(angle, 0.3 * (fraction(k, 1) - 0.5)), Clip::NONE.0[0]]));
    }
    Filling { clips, excused: 0.08, ..Filling::of(surfels, (1.0, 1.0)).with_lone_rims() }
}

fn corner_of_a_large_disk(stage: &Stage) -> Filling {
    let radius = 1e4 * stage.pixel(3.0);
    let disk = stage.disk(stage.at(50.0, 20.0, 3.0), DVec3::new(0.3, 0.2, -1.0), radius);
    Filling { clips: vec![Clip([line(0.7, 1e-3), line(2.0, -2e-3)])], ..Filling::of(vec![disk], (0.05, 0.95)) }
}

fn halves(stage: &Stage) -> Filling {
    let (mut surfels, mut clips) = (Vec::new(), Vec::new());
    for k in 0..60 {
        let surfel = scattered(stage, k, 3.0, 3.0 + 6.0 * fraction(k, 5));
        let (angle, offset) = (TAU * fraction(k, 3), fraction(k, 4) - 0.5);
        for side in [line(angle, offset), line(angle + PI, -offset)] {
            surfels.push(surfel);
            clips.push(Clip([side, Clip::NONE.0[0]]));
        }
    }
    Filling { clips, excused: 0.02, ..Filling::of(surfels, (0.6, 1.0)).with_lone_rims() }
}

fn sides_that_cross(stage: &Stage) -> Filling {
    let mut surfels = stage.sheet(5.0, 0.2, |x, y| 3.0 + 0.01 * (x - 32.0) / 32.0 + 0.004 * (y - 24.0) / 24.0);
    let fronts = surfels.len();
    surfels.extend(stage.sheet(4.0, 0.2, |x, _| 3.0 - 0.01 * (x - 32.0) / 32.0));
    for back in &mut surfels[fronts..] {
        std::mem::swap(&mut back.s, &mut back.t);
    }
    Filling { excused: 0.02, ..Filling::of(surfels, (0.99, 1.0)).with_lone_rims() }
}

fn thin_parts(stage: &Stage) -> Filling {
    let mut surfels = Vec::new();
    for k in 0..60 {
        let mut surfel = scattered(stage, k, 3.0, if k % 3 == 0 { 0.25 } else { 12.0 });
        if k % 3 > 0 {
            surfel.t = surfel.t.map(|c| c * if k % 3 == 1 { 0.004 } else { 0.02 });
        }
        surfels.push(surfel);
    }
    let colors = (0..surfels.len()).map(|k| [2, 3, 4, 5].map(|axis| 0.1 + 0.9 * fraction(k, axis) as f32)).collect();
    let filling = Filling { colors: Some(colors), excused: 0.04, ..Filling::of(surfels, (0.02, 0.9)) };
    samples(4, 4, filling.with_lone_rims())
}

fn cut_and_crossing(stage: &Stage) -> Filling {
    let mut surfels = stage.sheet(4.0, 0.2, |x, _| 3.0 + 0.6 * (x - 20.0) / 20.0);
    surfels.extend(stage.sheet(4.0, 0.2, |x, y| 3.0 - 0.5 * (x - 20.0) / 20.0 + 0.1 * (y - 16.0) / 16.0));
    let clip = |k: usize| Clip([line(TAU * fraction(k, 3), -0.4 * fraction(k, 4)), line(TAU * fraction(k, 5), -0.6)]);
    let clips = (0..surfels.len()).map(clip).collect();
    samples(2, 4, Filling { clips, excused: 0.04, ..Filling::of(surfels, (0.9, 1.0)).with_lone_rims() })
}

fn near_with_samples(stage: &Stage) -> Filling {
    let disk = |k: usize| {
        let center = DVec3::new(3.0 * (fraction(k, 0) - 0.5), 3.0 * (fraction(k, 1) - 0.5), fraction(k, 2) - 0.3);
        let normal = DVec3::new(fraction(k, 3) - 0.5, fraction(k, 4) - 0.5, fraction(k, 5) - 0.5);
        stage.disk(center, normal, 0.02 * 2f64.powf(6.0 * fraction(k, 1)))
    };
    samples(2, 2, Filling::of((0..80).map(disk).collect(), (0.2, 1.0)).with_lone_rims())
}
