//! Times the kernels against a plain program on the same processor.
//!
//! ```text
//! cargo bench --bench scalar [-- --quick] [-- --adapter SUBSTRING]
//! ```
//!
//! [`program`] renders the same picture of an opaque, unlit sphere of 8-bit colours as `epsplat`:
//! the kernels must be worth their cost on a machine that has only a processor. The program's
//! surfels lie in the renderer's order. Its buffers stay from frame to frame, as the renderer's do,
//! so both times are those of a frame alone, from the scene to the image in host memory. Frames of
//! both alternate, so that a busy machine slows both alike; the medians are printed.
//!
//! Before timing, two images are compared with the renderer's: the program's, which must match, and
//! one with a wrong kernel, which must not. Otherwise the benchmark fails.

#![allow(missing_docs)]

mod program;

use std::time::Instant;

use anyhow::{Context, Result, bail, ensure};
use epsplat::io::Points;
use epsplat::low_level::frame::Frame;
use epsplat::low_level::gpu::Gpu;
use epsplat::low_level::metrics::compare;
use epsplat::low_level::plan::Settings;
use epsplat::low_level::render::{Backend, Renderer};
use epsplat::low_level::scene::{Camera, Colors, Epsilon, Kernel, Lens, Scene, Shading};
use epsplat::low_level::surfels::analytic::{Shape, generate};
use epsplat::low_level::surfels::build;
use glam::DVec3;

use program::{Program, THREADS, View};

/// The scenes: number of surfels on the sphere, and their radius in units of the generated one.
const SCENES: [(u64, f32); 4] = [(10_000, 1.0), (100_000, 1.0), (1_000_000, 1.0), (1_000_000, 0.77)];
/// The passes, as the renderer's report names them.
const PASSES: [&str; 4] = ["project", "visibility", "accumulate", "resolve"];
/// The largest RMSE over pixels that both images cover, linear RGBA.
///
/// A few fragments per frame lie so near to epsilon that f32 decides them differently; they make
/// most of the error.
const MOST_RMSE: f64 = 2e-4;
/// The largest share of pixels that only one of the images covers.
const MOST_MISMATCH: f64 = 1e-3;

/// A sphere of `count` surfels, whose radii are `scale` times the generated ones.
fn sphere(count: u64, scale: f32) -> Result<Scene> {
    let samples: Vec<_> = generate(Shape::Sphere, count).collect();
    let opaque = |[r, g, b]: [u8; 3]| [r, g, b, u8::MAX];
    let points = Points {
        positions: samples.iter().map(|s| s.position).collect(),
        normals: Some(samples.iter().map(|s| s.normal).collect()),
        radii: Some(samples.iter().map(|s| scale * s.radius).collect()),
        colors: Some(Colors::Srgb8(samples.iter().map(|s| opaque(s.color)).collect())),
        ..Points::default()
    };
    let (scene, _) = build(vec![points], &())?;
    // The plain program blends all fragments within epsilon, whichever side they show.
    Ok(Scene { oriented: false, ..scene })
}

/// The RMSE of `found` over pixels that `expected` covers too, and the share of pixels that only
/// one of them covers.
fn error(found: &Frame, expected: &Frame) -> Result<[f64; 2]> {
    let both: Vec<_> = found.color.iter().zip(&expected.color).filter(|(a, b)| a[3] > 0.0 && b[3] > 0.0).collect();
    let row = |color: Vec<[f32; 4]>| Frame::of_colors(color.len() as u32, 1, color);
    let [a, b] = [both.iter().map(|(a, _)| **a).collect(), both.iter().map(|(_, b)| **b).collect()].map(row);
    Ok([compare(&a, &b)?.rmse, compare(found, expected)?.coverage_mismatch])
}

/// Whether the errors are small enough for images of the same scene.
fn passes([rmse, mismatch]: [f64; 2]) -> bool {
    rmse < MOST_RMSE && mismatch < MOST_MISMATCH
}

/// Milliseconds of a frame: the total, then each of [`PASSES`].
type Times = [f64; 5];

/// The median of each time.
fn median(times: &[Times]) -> Times {
    std::array::from_fn(|k| {
        let mut values: Vec<f64> = times.iter().map(|frame| frame[k]).collect();
        values.sort_by(f64::total_cmp);
        values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
    })
}

/// The measurements of one scene.
struct Measured {
    /// The radius of a surfel at the centre of the sphere's image, in pixels.
    radius: f64,
    /// RMSE and coverage mismatch of the program, and of the program with a wrong kernel.
    errors: [[f64; 2]; 2],
    scalar: Times,
    epsplat: Times,
}

/// Compares the images, then times `rounds` frames of each program in turns.
fn measure(scene: &Scene, backend: &Backend, rounds: usize) -> Result<Measured> {
    // The plain program supports only this epsilon.
    let epsilon = Epsilon::Relative(0.01);
    let options = Settings { shading: Shading::Unlit, epsilon, ..Settings::default() };
    let camera = Camera::framing((1024, 1024), Lens::Fov(45.0), scene, Camera::default_near(scene))?;
    let mut renderer = Renderer::new(scene, &options, backend)?;
    let (expected, _) = renderer.frame(&camera, &())?;
    let mut program = Program::new(scene, &camera);
    let kernel = Kernel::Ellipse { a: 6.0, n: 2.0, smooth: false };
    let wrong = View::new(scene, &camera, &Settings { kernel, ..options.clone() });
    let control = error(&program.frame(&camera, &wrong).0, &expected)?;
    let view = View::new(scene, &camera, &options);
    let found = error(&program.frame(&camera, &view).0, &expected)?;
    ensure!(passes(found), "the program's image is not the renderer's: RMSE and coverage mismatch are {found:?}");
    ensure!(!passes(control), "a wrong kernel passes for the right one: RMSE and coverage mismatch are {control:?}");
    let (mut scalar, mut epsplat) = (Vec::new(), Vec::new());
    for _ in 0..rounds {
        let start = Instant::now();
        let (_frame, [project, visibility, accumulate, resolve]) = program.frame(&camera, &view);
        scalar.push([start.elapsed().as_secs_f64() * 1e3, project, visibility, accumulate, resolve]);
        let start = Instant::now();
        let (_frame, report) = renderer.frame(&camera, &())?;
        let total = start.elapsed().as_secs_f64() * 1e3;
        // Gathering tiles resolve their pixels while they accumulate, so they report no separate
        // time.
        let of_pass = |pass| report.passes.get(&format!("{pass}_ms")).copied().unwrap_or(0.0);
        let [project, visibility, accumulate, resolve] = PASSES.map(of_pass);
        epsplat.push([total, project, visibility, accumulate, resolve]);
    }
    let radius = f64::from(scene.largest_radius()) * camera.fx / camera.to_camera(DVec3::ZERO).z;
    Ok(Measured { radius, errors: [found, control], scalar: median(&scalar), epsplat: median(&epsplat) })
}

fn main() -> Result<()> {
    let (mut quick, mut wanted) = (false, None);
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            "--bench" => {} // cargo passes it
            "--quick" => quick = true,
            "--adapter" => wanted = Some(arguments.next().context("--adapter needs a part of a name")?),
            other => bail!("{other:?} is not --quick or --adapter SUBSTRING"),
        }
    }
    let gpu = Gpu::open(wanted.as_deref())?;
    let adapter = format!("{} ({}, {})", gpu.adapter.name, gpu.adapter.api, gpu.adapter.kind);
    let backend = Backend::gpu(gpu);
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let rounds = if quick { 3 } else { 9 };
    println!(
        "A plain program on {THREADS} threads, and epsplat on {adapter}: {cores} cores, sphere at 1024x1024, unlit.\n\
         Milliseconds, medians of {rounds} in turns; ratio: epsplat / scalar. Error: RMSE where both cover, and with a wrong kernel.\n"
    );
    let columns = PASSES.map(|pass| format!("{pass:>11}")).concat();
    println!("  surfels  radius, px             frame{columns}  error    wrong");
    for (count, scale) in SCENES {
        let scene = sphere(count, scale)?;
        let Measured { radius, errors: [found, control], scalar, epsplat } =
            measure(&scene, &backend, rounds).with_context(|| format!("{count} surfels"))?;
        let cells = |times: Times| times.map(|time| format!("{time:>11.1}")).concat();
        let ratio: Times = std::array::from_fn(|k| epsplat[k] / scalar[k]);
        let ratio = ratio.map(|ratio| format!("{ratio:>11.2}")).concat();
        println!("{count:>9}  {radius:>10.1}   scalar {}  {:.1e}  {:.1e}", cells(scalar), found[0], control[0]);
        println!("{:21}   epsplat{}\n{:21}   ratio  {ratio}", "", cells(epsplat), "");
    }
    Ok(())
}
