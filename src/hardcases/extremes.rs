//! Hard numbers: a million fragments, far and tiny coordinates, depths and tolerances at their
//! limits, colours of many decades, images of one pixel.

use glam::DVec3;

use super::HardCase;
use super::cases::FRAGMENTS;
use super::staging::{BOTH, Entry, Filling, Stage, build, fraction};
use crate::error::Result;
use crate::plan::Accumulator;
use crate::scene::{Epsilon, Kernel, Projection, Surfel};

/// Builds the cases.
pub fn cases() -> Result<Vec<HardCase>> {
    build(LIST)
}

/// The reason why f32 sums fail.
const SUMS: &str = "a sum of n terms in f32 errs by up to n 2^-24 of itself, and its roundings depend on the order";
const WIDE: &str = "the accumulator's 2^-32 of the scene's range of colours, over the mean weight";
const DIGITS: &str =
    "as in a scene of size one: positions are f32 relative to the scene's origin, the eye has doubled precision";
const EPSILON: &str = "decisions at least 3e-6 from epsilon's limit must agree; values as usual";

macro_rules! entry {
    ($name:literal, $about:literal, $bound:expr, $size:expr, $stage:expr, $fill:expr) => {
        Entry { name: $name, about: $about, bound: $bound, size: $size, stage: $stage, fill: $fill, projections: BOTH }
    };
}

const LIST: &[Entry] = &[
    Entry {
        name: "a million disks on a pixel",
        about: "A million disks of half a pixel on one pixel: sums of a million terms, all at one address.",
        bound: "2^-32 over the mean weight, for any number of terms",
        size: (32, 32),
        stage: Stage::askew,
        fill: million,
        // The sums of the orthographic projection are the same.
        projections: &[Projection::Pinhole],
    },
    entry!(
        "depth ratio 1e7",
        "Depths from twice the near depth to ten million times that, side by side in one image.",
        FRAGMENTS,
        (64, 48),
        Stage::askew,
        depth_ratio
    ),
    entry!(
        "UTM, millimetres",
        "Disks of millimetres at map coordinates of 6e6 metres.",
        DIGITS,
        (64, 48),
        |projection, size| Stage::placed(projection, size, DVec3::new(4.4e5, 6.26e6, 1200.5), 0.02),
        rough
    ),
    entry!(
        "UTM, a kilometre off",
        "The same a kilometre from the scene's origin, where f32 has steps of 1/16 millimetre and the eye lies between two.",
        DIGITS,
        (64, 48),
        |projection, size| {
            let mut stage = Stage::placed(projection, size, DVec3::new(4.4e5, 6.26e6, 1200.5), 0.02)?;
            stage.camera.eye += DVec3::new(1_000.012_345, -300.054_321, 70.023_456);
            Ok(stage)
        },
        rough
    ),
    entry!(
        "coordinates of 1e-6",
        "A scene with a size of 1e-6.",
        DIGITS,
        (64, 48),
        |projection, size| Stage::placed(projection, size, DVec3::ZERO, 1e-6),
        rough
    ),
    entry!(
        "coordinates of 1e12",
        "A scene with a size of 1e12.",
        DIGITS,
        (64, 48),
        |projection, size| Stage::placed(projection, size, DVec3::ZERO, 1e12),
        rough
    ),
    entry!(
        "sheets closer than epsilon",
        "Two sheets half an epsilon apart are one surface.",
        EPSILON,
        (48, 48),
        Stage::plain,
        |stage| sheets(stage, |_| 2.005, 0.01)
    ),
    entry!(
        "sheets 3e-6 about epsilon",
        "Two sheets whose distance differs from epsilon by 3e-6 of the depth: blended on the left, separate on the right.",
        EPSILON,
        (48, 48),
        Stage::plain,
        |stage| sheets(stage, |x| if x < 24.0 { 2.01 * (1.0 - 3e-6) } else { 2.01 * (1.0 + 3e-6) }, 0.01)
    ),
    entry!(
        "sheets an epsilon apart",
        "Two sheets exactly an epsilon apart: either decision is right in every pixel, but none is lost and none is NaN.",
        "none on values, as all pixels are within 1e-6 of a decision",
        (48, 48),
        Stage::plain,
        |stage| sheets(stage, |_| 2.01, 1.0)
    ),
    entry!(
        "sheets farther than epsilon",
        "Two sheets two epsilons apart: only the nearer one shows.",
        EPSILON,
        (48, 48),
        Stage::plain,
        |stage| sheets(stage, |_| 2.02, 0.01)
    ),
    entry!(
        "equal depths",
        "Two hundred overlapping disks in one plane, parallel to the image: no depth decides, all blend.",
        FRAGMENTS,
        (48, 48),
        Stage::plain,
        equal_depths
    ),
    entry!(
        "epsilon without bound",
        "An epsilon of 1e300 accepts every disk of two sheets, one ten times as far away as the other.",
        "depths in units of 2^-32 of the scene's depth over the mean weight",
        (48, 48),
        Stage::askew,
        unbounded
    ),
    entry!(
        "epsilon along the ray",
        "Two sheets 0.01 units apart, and an epsilon of 0.0105 along the ray: toward the corners it ends between the sheets.",
        FRAGMENTS,
        (64, 48),
        Stage::askew,
        along_rays
    ),
    entry!(
        "only the kernel's tail, smooth",
        "Every pixel is reached only by the rims of four disks, where the weight has its least value, 1/1024.",
        "2^-32 over weights of 1/1024: 2^-22 per fragment",
        (32, 32),
        Stage::askew,
        |stage| tail(stage, Kernel::Ellipse { a: 6.0, n: 3.0, smooth: true })
    ),
    entry!(
        "only the kernel's tail, hat",
        "Every pixel is reached only by the rims of four disks, where the weight 1 - rho is 1/200.",
        "the rounding of rho over a weight of 1/200",
        (32, 32),
        Stage::askew,
        |stage| tail(stage, Kernel::Cone { power: 1.0 })
    ),
    entry!(
        "only the kernel's tail, steep",
        "Every pixel is reached only by the rims of four disks. The kernel is exp(-50) there: the weight has its least value, 2^-24.",
        "2^-51 over weights of 2^-24: 2^-27 per fragment, and the rounding of rho",
        (32, 32),
        Stage::askew,
        |stage| tail(stage, Kernel::Ellipse { a: 50.0, n: 5.0, smooth: false })
    ),
    entry!(
        "a kernel of exp(-50)",
        "A wavy sheet drawn by the steepest kernel of paper 000's Figure 10: weights of 1 and of 2^-24 meet in a pixel.",
        FRAGMENTS,
        (48, 48),
        Stage::askew,
        |stage| rough(stage).kernel(Kernel::Ellipse { a: 50.0, n: 5.0, smooth: false })
    ),
    entry!(
        "a cone's rim",
        "A wavy sheet drawn by (1 - rho)^1.5, which is flat at the rim.",
        FRAGMENTS,
        (48, 48),
        Stage::askew,
        |stage| rough(stage).kernel(Kernel::Cone { power: 1.5 })
    ),
    entry!(
        "colours of 1e5 beside 1e-5",
        "A sheet whose right half has colours of 1e5 and 1e-5 side by side, and the left of 1e-5 only.",
        WIDE,
        (48, 48),
        Stage::askew,
        high_dynamic_range
    ),
    entry!(
        "negative colours",
        "Colours between -3 and 2: no display shows them, but filters and attributes produce them.",
        WIDE,
        (48, 48),
        Stage::askew,
        |stage| Filling { colors: Some(colors(stage, |k, axis| 5.0 * fraction(k, axis) - 3.0)), ..rough(stage) }
    ),
    entry!(
        "alpha of 1/255",
        "Nearly transparent disks among opaque ones: the mean is divided by the mean alpha.",
        "2^-32 of the range, over the mean weight and the pixel's alpha",
        (48, 48),
        Stage::askew,
        thin_alpha
    ),
    entry!("one pixel", "An image of one pixel.", FRAGMENTS, (1, 1), Stage::askew, without_rims),
    entry!("17 by 3 pixels", "An image that fills no workgroup.", FRAGMENTS, (17, 3), Stage::askew, rough),
    entry!(
        "4097 by 1 pixels",
        "One row, wider than a power of two; a pinhole sees its ends at a slant of 1:2000.",
        FRAGMENTS,
        (4097, 1),
        Stage::askew,
        |stage| Filling { excused: 0.02, ..Filling::of(stage.sheet(6.0, 0.0, |_, _| 3.0), (0.9, 1.0)) }
    ),
    entry!("1 by 300 pixels", "One column.", FRAGMENTS, (1, 300), Stage::askew, rough),
];

fn million(stage: &Stage) -> Filling {
    let surfels = (0..1_000_000).map(|k| {
        let (x, y) = (16.3 + 0.4 * fraction(k, 0), 16.3 + 0.4 * fraction(k, 1));
        let z = 3.0 + 0.01 * fraction(k, 2);
        let normal = DVec3::new(0.4 * (fraction(k, 3) - 0.5), 0.4 * (fraction(k, 4) - 0.5), -1.0);
        stage.disk(stage.at(x, y, z), normal, 0.45 * stage.pixel(z))
    });
    Filling::of(surfels.collect(), (1.0 / 1024.0, 1.0 / 1024.0)).expect(&[Accumulator::Float, Accumulator::Cas], SUMS)
}

fn depth_ratio(stage: &Stage) -> Filling {
    let near = 2.0 * super::staging::NEAR;
    Filling {
        excused: 0.02,
        ..Filling::of(stage.sheet(4.0, 0.3, |x, _| near * 10f64.powf(7.0 * x / 64.0)), (0.9, 1.0)).with_lone_rims()
    }
}

/// The sheet of [`rough`] in an image so small that no pixel is reached by rims only.
fn without_rims(stage: &Stage) -> Filling {
    Filling { expected: Vec::new(), ..rough(stage) }
}

/// A wavy sheet.
fn rough(stage: &Stage) -> Filling {
    Filling::of(stage.sheet(4.0, 0.4, |x, y| 3.0 + 0.1 * (0.3 * x).sin() * (0.2 * y).cos()), (0.99, 1.0))
        .with_lone_rims()
}

/// Returns a colour for each disk of [`rough`]; `value` takes the disk's index and an axis of
/// [`fraction`].
fn colors(stage: &Stage, value: impl Fn(usize, usize) -> f64) -> Vec<[f32; 4]> {
    let count = rough(stage).surfels.len();
    (0..count).map(|k| [value(k, 3) as f32, value(k, 4) as f32, value(k, 5) as f32, 1.0]).collect()
}

fn sheets(stage: &Stage, behind: impl Fn(f64) -> f64, excused: f64) -> Filling {
    let mut surfels = stage.sheet(4.0, 0.0, |_, _| 2.0);
    surfels.extend(stage.sheet(4.0, 0.0, |x, _| behind(x)));
    let mut filling = Filling { excused, ..Filling::of(surfels, (1.0, 1.0)) };
    filling.options.epsilon = Epsilon::Absolute(0.01);
    filling
}

fn along_rays(stage: &Stage) -> Filling {
    let mut filling = sheets(stage, |_| 2.01, 0.03);
    filling.options.epsilon = Epsilon::Ray(0.0105);
    filling
}

fn equal_depths(stage: &Stage) -> Filling {
    let disk = |k: usize| -> Surfel {
        let center = stage.at(48.0 * fraction(k, 0), 48.0 * fraction(k, 1), 2.0);
        stage.surfel(center, DVec3::X * (0.1 + 0.3 * fraction(k, 2)), DVec3::NEG_Y * (0.1 + 0.3 * fraction(k, 3)))
    };
    stage.rims_in(Projection::Orthographic, Filling::of((0..200).map(disk).collect(), (0.9, 1.0)))
}

fn unbounded(stage: &Stage) -> Filling {
    let mut surfels = stage.sheet(5.0, 0.3, |_, _| 3.0);
    surfels.extend(stage.sheet(5.0, 0.3, |_, _| 30.0));
    let mut filling = Filling::of(surfels, (1.0, 1.0));
    filling.options.epsilon = Epsilon::Absolute(1e300);
    filling
}

fn tail(stage: &Stage, kernel: Kernel) -> Filling {
    let (width, height) = stage.size();
    let mut surfels = Vec::new();
    for k in 0..width * height * 4 {
        let (x, y) = ((k / 4 % width) as f64 + 0.5, (k / 4 / width) as f64 + 0.5);
        let (dx, dy) = [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)].get(k % 4).copied().unwrap_or_default();
        // The next pixel's centre is 0.5125 pixels from the disk's centre: outside the disk.
        let center = stage.at(x + 0.4875 * dx, y + 0.4875 * dy, 3.0);
        let normal = DVec3::NEG_Z;
        surfels.push(stage.disk(center, normal, 0.49 * stage.pixel(3.0)));
    }
    Filling::of(surfels, (1.0, 1.0)).kernel(kernel).with_lone_rims()
}

fn high_dynamic_range(stage: &Stage) -> Filling {
    let rough = rough(stage);
    let columns = 48 / 4 + 2;
    let value = |k: usize, axis: usize| {
        let bright = k % columns > columns / 2 && k.is_multiple_of(2);
        ((if bright { 1e5 } else { 1e-5 }) * (1.0 + 3.0 * fraction(k, axis))) as f32
    };
    let color = |k: usize| [value(k, 3), value(k, 4), value(k, 5), 1.0];
    Filling { colors: Some((0..rough.surfels.len()).map(color).collect()), smallest: Some(1e-5), ..rough }
}

fn thin_alpha(stage: &Stage) -> Filling {
    let mut colors = colors(stage, fraction);
    for (k, color) in colors.iter_mut().enumerate() {
        color[3] = if k % 3 == 0 { 1.0 } else { 1.0 / 255.0 };
    }
    Filling { colors: Some(colors), ..rough(stage) }
}
