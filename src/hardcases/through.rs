//! Surfaces that show through each other.

use glam::DVec3;

use super::HardCase;
use super::staging::{BOTH, Entry, Filling, Stage, build, fraction};
use crate::error::Result;
use crate::scene::composite::ALL_LAYERS;
use crate::scene::{Composite, Kernel, Surfel, Tail, gaussian};

/// Builds the cases.
pub fn cases() -> Result<Vec<HardCase>> {
    build(LIST)
}

/// The parts of the cases' bounds.
const THROUGH: &str = "each surface's bound times the transmittance in front of it, and six roundings per surface";

const LAYERS: Composite = Composite::Layers(ALL_LAYERS);

const LIST: &[Entry] = &[
    Entry {
        name: "sheets behind one another",
        about: "Six sheets of disks with alphas from 0.1 to 0.9, ten epsilons apart.",
        bound: THROUGH,
        size: (48, 40),
        stage: Stage::askew,
        fill: |stage| through(LAYERS, (0.9, 1.0), sheets(stage, 6, 0.1)),
        projections: BOTH,
    },
    Entry {
        name: "a hundred layers",
        about: "A hundred disks over the whole image, an epsilon and a half apart, each of alpha 0.05.",
        bound: THROUGH,
        size: (24, 20),
        stage: Stage::plain,
        fill: |stage| through(LAYERS, (1.0, 1.0), disks(stage, 100, 0.015)).alphas(|_| 0.05),
        projections: BOTH,
    },
    Entry {
        name: "layers closer than epsilon",
        about: "Disks a third of an epsilon apart, which form one surface of thirty epsilons, and disks behind a gap.",
        bound: THROUGH,
        size: (24, 20),
        stage: Stage::plain,
        fill: |stage| {
            let mut all = disks(stage, 90, 0.0033);
            all.extend(disks(stage, 3, 0.8));
            through(LAYERS, (1.0, 1.0), all)
        },
        projections: BOTH,
    },
    Entry {
        name: "a tail of most of the weight",
        about: "Thirty surfaces: two are layers, and the rest is one tail.",
        bound: THROUGH,
        size: (24, 20),
        stage: Stage::plain,
        fill: |stage| through(Composite::Layers(2), (1.0, 1.0), disks(stage, 30, 0.02)).alphas(|_| 0.1),
        projections: BOTH,
    },
    Entry {
        name: "alphas of nothing and nearly all",
        about: "Sheets of alpha 0, 1 - 2^-8, 1/2 and 1 behind one another, and a hidden one behind these.",
        bound: THROUGH,
        size: (48, 40),
        stage: Stage::askew,
        fill: |stage| {
            let surfels = sheets(stage, 5, 0.1);
            let of_sheet = surfels.len() / 5;
            let alphas = |k: usize| [0.0, 1.0 - 1.0 / 256.0, 0.5, 1.0, 0.7][k / of_sheet];
            let mut filling = through(LAYERS, (0.9, 1.0), surfels).alphas(alphas);
            filling.options.opacity = 1.0;
            filling
        },
        projections: BOTH,
    },
    Entry {
        name: "sheets that cross",
        about: "Two sheets that pass through each other: each is nearer in one half.",
        bound: THROUGH,
        size: (48, 40),
        stage: Stage::askew,
        fill: |stage| {
            let mut all = stage.sheet(3.0, 0.0, |x, _| 3.0 + 0.02 * (x - 24.0));
            all.extend(stage.sheet(3.0, 0.0, |x, _| 3.0 - 0.02 * (x - 24.0)));
            let filling = through(LAYERS, (0.9, 1.0), all);
            Filling { excused: 0.3, ..filling }
        },
        projections: BOTH,
    },
    Entry {
        name: "many fragments, one by one",
        about: "Eight sheets of disks with different colours; fragments are composited one by one.",
        bound: THROUGH,
        size: (48, 40),
        stage: Stage::askew,
        fill: |stage| {
            let filling = through(Composite::Sorted, (0.9, 1.0), sheets(stage, 8, 0.05));
            Filling { excused: 0.05, ..filling }
        },
        projections: BOTH,
    },
    Entry {
        name: "by the rules of Gaussians",
        about: "Eight sheets of disks with alphas of 0.01 to 1: faint fragments and those behind opaque ones are left out.",
        bound: THROUGH,
        size: (48, 40),
        stage: Stage::askew,
        fill: |stage| {
            let alphas = |k: usize| [1.0, 0.01, 0.5, 0.999, 0.3, 0.06, 0.95][k % 7];
            let mut filling = through(Composite::Gaussians, (0.9, 1.0), sheets(stage, 8, 0.05)).alphas(alphas);
            filling.options.kernel = gaussian::KERNEL;
            filling.options.opacity = 1.0;
            Filling { excused: 0.05, ..filling }
        },
        projections: BOTH,
    },
    Entry {
        name: "many at one place, one by one",
        about: "Two hundred disks at one place: their colours decide which comes first.",
        bound: THROUGH,
        size: (24, 20),
        stage: Stage::plain,
        fill: |stage| {
            let disk = disks(stage, 1, 1.0);
            through(Composite::Sorted, (1.0, 1.0), vec![disk[0]; 200]).alphas(|_| 0.02)
        },
        projections: BOTH,
    },
];

fn through(composite: Composite, covered: (f64, f64), surfels: Vec<Surfel>) -> Filling {
    let count = surfels.len();
    let mut filling = Filling::of(surfels, covered);
    filling.options.composite = composite;
    filling.options.opacity = 0.9;
    filling.options.tail = Tail::Sum;
    filling.options.kernel = Kernel::Ellipse { a: 6.0, n: 3.0, smooth: false };
    let color = |k: usize| {
        let [r, g, b, a] = [0, 1, 2, 3].map(|axis| fraction(k, axis) as f32);
        [r, g, b, 0.1 + 0.8 * a]
    };
    filling.colors = Some((0..count).map(color).collect());
    filling
}

impl Filling {
    /// Sets the alpha of each surfel.
    fn alphas(mut self, alpha: impl Fn(usize) -> f32) -> Self {
        self.colors.iter_mut().flatten().enumerate().for_each(|(k, color)| color[3] = alpha(k));
        self
    }
}

/// Disks that face the camera, each over the whole image. Neighbouring depths differ by `apart`
/// times the depth.
fn disks(stage: &Stage, count: usize, apart: f64) -> Vec<Surfel> {
    let (width, height) = stage.size();
    let middle = (0.5 * width as f64, 0.5 * height as f64);
    let disk = |k: usize| {
        let z = 3.0 * (1.0 + apart).powi(k as i32);
        let center = stage.at(middle.0, middle.1, z);
        stage.disk(center, DVec3::NEG_Z, 1.2 * (width + height) as f64 * stage.pixel(z))
    };
    (0..count).map(disk).collect()
}

/// Sheets of small disks. Neighbouring depths differ by `apart` times the depth.
fn sheets(stage: &Stage, count: usize, apart: f64) -> Vec<Surfel> {
    (0..count).flat_map(|k| stage.sheet(4.0, 0.02, |_, _| 3.0 * (1.0 + apart).powi(k as i32))).collect()
}
