//! `epsplat simplify`: replaces surfels by fewer, larger ones.

use std::path::PathBuf;
use std::str::FromStr;

use clap::Args;
use epsplat::io::{Points, ply};
use epsplat::low_level::surfels;
use epsplat::low_level::surfels::simplify::{
    Options, Report, SplatShape, Tolerance, as_in_the_thesis, points, simplify_in_texture,
};
use epsplat::options::InputOptions;
use epsplat::{Error, Files, Result};

use super::inputs::help_of_all;
use super::outputs::Source;
use super::progress::Bars;
use super::{note, outputs, print, write_json};

/// Replace surfels by fewer, larger ones within a tolerance, without holes.
///
/// A disk grows around each point as long as all points that it covers lie within the tolerance.
/// Then a few disks are selected that together cover the surface. Flat parts keep few surfels,
/// edges and details keep most. Texture coordinates and their slopes are kept, and no surfel
/// replaces points on both sides of a seam.
#[derive(Args)]
#[command(
    after_help = "Example:\n  epsplat simplify scan.ply -o small.ply --tolerance rel:0.0005 --shape ellipse --relax 3"
)]
pub struct Arguments {
    #[arg(required = true, help = help_of_all("Point clouds or meshes, whose vertices are used"))]
    inputs: Vec<PathBuf>,
    /// Output file: .ply
    #[arg(short, long)]
    output: PathBuf,
    /// Largest distance of points from their surfel: rel:E (of the diagonal) or abs:E (world units)
    ///
    /// The diagonal is that of the points' bounding box
    #[arg(long, default_value = "rel:0.0005")]
    tolerance: Tolerance,
    /// Shape of surfels
    #[arg(long, value_enum, default_value_t = ShapeName::Disk)]
    shape: ShapeName,
    /// Rounds in which surfels move so that fewer are needed; more than 3 hardly change anything
    #[arg(long, value_name = "ROUNDS", default_value_t = 0)]
    relax: u32,
    /// Selection of surfels: cells (without holes) or thesis:R (as in Tien 2008, a baseline)
    ///
    /// With thesis:R each selected disk covers the points within R times its radius (0.5 to 0.7 in
    /// the thesis), and holes may be left
    #[arg(long, value_name = "HOW", default_value = "cells")]
    cover: Cover,
    /// Write counts and deviations as JSON to a file, or to stdout for -
    #[arg(long, value_name = "FILE|-")]
    json: Option<PathBuf>,
    #[command(flatten)]
    reading: InputOptions,
}

#[derive(Clone, Copy, PartialEq, clap::ValueEnum)]
enum ShapeName {
    /// Circles
    Disk,
    /// Also ellipses along the principal curvatures, if they cover more: a fifth fewer surfels
    Ellipse,
    /// Circles and ellipses that curve with the surface: a third to three quarters as many surfels
    Cap,
}

/// How the surfels that cover the surface are selected.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Cover {
    Cells,
    Thesis(f64),
}

impl FromStr for Cover {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let ratio = || text.strip_prefix("thesis:")?.parse().ok().filter(|ratio| *ratio > 0.0 && *ratio <= 1.0);
        match text {
            "cells" => Ok(Self::Cells),
            _ => ratio().map(Self::Thesis).ok_or_else(|| "it is cells, or thesis:R with R from 0 to 1".to_owned()),
        }
    }
}

pub fn run(arguments: &Arguments) -> Result<()> {
    ply::check_extension(&arguments.output)?;
    if arguments.cover != Cover::Cells && !(arguments.shape == ShapeName::Disk && arguments.relax == 0) {
        return Err(Error::Usage(
            "--cover thesis:R selects disks without relaxation: leave --shape and --relax out".into(),
        ));
    }
    let written = [&arguments.output].into_iter().chain(&arguments.json);
    let files = Files::new(&arguments.inputs, &arguments.reading)?;
    outputs::check(Source::of(&files), written)?;
    let bars = Bars::new();
    let inputs = files.read(&bars)?;
    let beside = outputs::beside(&inputs, &arguments.output)?;
    let with_places = inputs.iter().filter(|points| points.texture.is_some()).count();
    if with_places > 0 && inputs.iter().any(|points| points.texture.is_none() && !points.positions.is_empty()) {
        note("warning: texture coordinates are left out, as some inputs have none");
    }
    let (scene, preparation, coordinates) =
        surfels::build_at_vertices(inputs, &bars).map_err(|error| files.named(error))?;
    preparation.notes().iter().for_each(|line| note(line));
    if preparation.estimated_normals > 0 {
        note(&format!(
            "{} normals are missing: estimated ones have no side, so sheets that are closer than their points may merge",
            preparation.estimated_normals
        ));
    }
    let shape = match arguments.shape {
        ShapeName::Disk => SplatShape::Disk,
        ShapeName::Ellipse => SplatShape::Ellipse,
        ShapeName::Cap => SplatShape::Cap,
    };
    let options = Options { tolerance: arguments.tolerance, shape, relaxations: arguments.relax };
    let (simplified, coordinates, report) = match arguments.cover {
        Cover::Cells => simplify_in_texture(&scene, &coordinates, &options, &bars)?,
        Cover::Thesis(ratio) => {
            let tolerance = options.tolerance.in_world(scene.bounds().extent().length());
            as_in_the_thesis((&scene, &coordinates), tolerance, ratio, &bars)?
        }
    };
    let left = Points { beside, ..points(&simplified, coordinates, shape) };
    ply::write_points(&arguments.output, &left, &bars)?;
    match &arguments.json {
        Some(path) => write_json(path, &report),
        None => print(&summary(&report)),
    }
}

fn summary(report: &Report) -> String {
    let share = 100.0 * report.selected as f64 / report.surfels.max(1) as f64;
    let mut text = format!("{} of {} surfels, {share:.1} %", report.selected, report.surfels);
    if report.before_relaxation > report.selected {
        text += &format!(" ({} before relaxation)", report.before_relaxation);
    }
    text += &format!(
        "\ntolerance {:.3e}, deviation of the points at most {:.3e}, on average {:.3e}\n",
        report.tolerance, report.max_deviation, report.mean_deviation
    );
    if report.beyond_tolerance > 0 {
        text += &format!(
            "{} surfels are as large as their own point's cell: they lie at creases, where the surface bends by more than the \
             tolerance from one point to the next\n",
            report.beyond_tolerance
        );
    }
    text
}
