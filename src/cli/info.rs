//! `epsplat info`: what a file holds, and what a renderer would make of it.

use std::fmt::Write;
use std::path::PathBuf;

use clap::Args;
use epsplat::io::{self, Points};
use epsplat::scene::Colors;
use epsplat::surfels::{self, Preparation};
use epsplat::{Error, Result};
use serde::Serialize;

use super::progress::Bars;
use super::{print, write_json};

/// What a file holds, and what a renderer would make of it.
#[derive(Args)]
#[command(after_help = "Example:\n  epsplat info scan.laz")]
pub struct Arguments {
    /// A point cloud or mesh
    input: PathBuf,
    /// The same as JSON, to a file or - for stdout
    #[arg(long, value_name = "FILE|-")]
    json: Option<PathBuf>,
}

#[derive(Serialize)]
struct Info {
    points: u64,
    normals: bool,
    radii: bool,
    colors: &'static str,
    up: &'static str,
    /// World coordinates of the smallest box.
    min: [f64; 3],
    max: [f64; 3],
    /// Subtracted before coordinates become f32.
    origin: [f64; 3],
    largest_radius: f64,
    preparation: Preparation,
}

pub fn run(arguments: &Arguments) -> Result<()> {
    let bars = Bars::new();
    let points = io::read(&arguments.input, &bars)?;
    let held = (points.positions.len() as u64, points.normals.is_some(), points.radii.is_some(), colors(&points));
    let (scene, preparation) = surfels::build(vec![points], &bars)
        .map_err(|e| if let Error::EmptyScene(what) = e { Error::malformed(&arguments.input, what) } else { e })?;
    let bounds = scene.bounds();
    let info = Info {
        points: held.0,
        normals: held.1,
        radii: held.2,
        colors: held.3,
        up: match scene.up {
            epsplat::scene::Up::Y => "y",
            epsplat::scene::Up::Z => "z",
        },
        min: (bounds.min + scene.origin).to_array(),
        max: (bounds.max + scene.origin).to_array(),
        origin: scene.origin.to_array(),
        largest_radius: scene.largest_radius().into(),
        preparation,
    };
    match &arguments.json {
        Some(path) => write_json(path, &info),
        None => print(&table(&arguments.input, &info)),
    }
}

fn colors(points: &Points) -> &'static str {
    match points.colors {
        None => "none",
        Some(Colors::Srgb8(_)) => "8-bit sRGB",
        Some(Colors::Linear(_) | Colors::Constant(_)) => "float",
    }
}

fn table(input: &std::path::Path, info: &Info) -> String {
    let mut text = String::new();
    let given = |on| if on { "given" } else { "none, estimated from neighbours" };
    let vector = |v: [f64; 3]| v.map(|c| c.to_string()).join(", ");
    // Writing to a string cannot fail.
    let _ = writeln!(text, "{}", input.display());
    let _ = writeln!(text, "  points    {}", info.points);
    let _ = writeln!(text, "  normals   {}", given(info.normals));
    let _ = writeln!(text, "  radii     {}", given(info.radii));
    let _ = writeln!(text, "  colours   {}", info.colors);
    let _ = writeln!(text, "  box       {} to {}", vector(info.min), vector(info.max));
    let _ = writeln!(text, "  up        {}", info.up);
    if let Some(spacing) = info.preparation.median_spacing {
        let _ = writeln!(text, "  spacing   {spacing:.4} (median distance to the nearest other point)");
    }
    let _ = writeln!(
        text,
        "A renderer makes {} surfels of it, radius up to {:.4},",
        info.preparation.surfels, info.largest_radius
    );
    let _ = writeln!(text, "in f32 relative to the origin {}.", vector(info.origin));
    for note in info.preparation.notes() {
        let _ = writeln!(text, "{note}");
    }
    text
}
