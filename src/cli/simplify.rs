//! `epsplat simplify`: fewer, larger surfels for the same surface.

use std::path::{Path, PathBuf};

use clap::Args;
use epsplat::Result;
use epsplat::io::{Points, ply};
use epsplat::surfels;
use epsplat::surfels::simplify::{Options, Report, SplatShape, Tolerance, points, simplify_in_texture};

use super::progress::Bars;
use super::reading::{Reading, help_of, named};
use super::{note, outputs, print, write_json};

/// Replace the surfels of a smooth surface by fewer, larger ones that lie within a tolerance of them, without holes.
///
/// Around each point the largest disk is grown that no point inside is farther from than the tolerance. Of these as few
/// as possible are taken that cover the surface together. Flat parts keep few surfels, edges and details keep theirs.
/// Texture coordinates stay, with their slopes, and no surfel lies across a seam of them.
#[derive(Args)]
#[command(
    after_help = "Example:\n  epsplat simplify scan.ply -o small.ply --tolerance rel:0.0005 --shape ellipse --relax 3"
)]
pub struct Arguments {
    #[arg(required = true, help = help_of("Point clouds or meshes, of which the vertices are taken"))]
    inputs: Vec<PathBuf>,
    #[command(flatten)]
    reading: Reading,
    /// The file: .ply
    #[arg(short, long)]
    output: PathBuf,
    /// How far points may lie from their surfel: rel:E (fraction of the diagonal of their box) or abs:E (world units)
    #[arg(long, default_value = "rel:0.0005")]
    tolerance: Tolerance,
    /// What surfels grow to
    #[arg(long, value_enum, default_value_t = ShapeName::Disk)]
    shape: ShapeName,
    /// Rounds in which surfels move until some are not needed; more than 3 hardly change anything
    #[arg(long, value_name = "ROUNDS", default_value_t = 0)]
    relax: u32,
    /// Counts and deviations as JSON, to a file or - for stdout
    #[arg(long, value_name = "FILE|-")]
    json: Option<PathBuf>,
}

#[derive(Clone, Copy, clap::ValueEnum)]
enum ShapeName {
    /// Circles
    Disk,
    /// Ellipses along the principal curvatures where they cover more: a fifth fewer
    Ellipse,
    /// Circles and ellipses that curve as the surface does: a third to three quarters as many
    Cap,
}

pub fn run(arguments: &Arguments) -> Result<()> {
    ply::check_extension(&arguments.output)?;
    outputs::check(&arguments.inputs, [&arguments.output].into_iter().chain(&arguments.json))?;
    let bars = Bars::new();
    let inputs = arguments.reading.all(&arguments.inputs, &bars)?;
    // What they are drawn beside stays beside those that are left.
    let beside = inputs.iter().find_map(|points| points.beside.clone()).filter(|_| inputs.len() == 1);
    let beside = beside.map(|mesh| seen_from(&arguments.output, mesh));
    let (scene, preparation, coordinates) =
        surfels::build_at_vertices(inputs, &bars).map_err(|error| named(error, &arguments.inputs))?;
    preparation.notes().iter().for_each(|line| note(line));
    if preparation.estimated_normals > 0 {
        note(&format!(
            "{} normals are missing: estimated ones have no side, so sheets that lie closer than points do may become one",
            preparation.estimated_normals
        ));
    }
    let shape = match arguments.shape {
        ShapeName::Disk => SplatShape::Disk,
        ShapeName::Ellipse => SplatShape::Ellipse,
        ShapeName::Cap => SplatShape::Cap,
    };
    let options = Options { tolerance: arguments.tolerance, shape, relaxations: arguments.relax };
    let (simplified, coordinates, report) = simplify_in_texture(&scene, &coordinates.centers, &options, &bars)?;
    let left = Points { beside, ..points(&simplified, coordinates, shape) };
    ply::write_points(&arguments.output, &left, &bars)?;
    match &arguments.json {
        Some(path) => write_json(path, &report),
        None => print(&summary(&report)),
    }
}

/// A file as one that is written names it: by its name where they are in one folder.
fn seen_from(output: &Path, file: PathBuf) -> PathBuf {
    match file.file_name() {
        Some(name) if output.parent() == file.parent() => name.into(),
        _ => std::path::absolute(&file).unwrap_or(file),
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
            "{} surfels at creases, where the surface bends by more than the tolerance from a point to the next, are as large as \
             the cell of their own point\n",
            report.beyond_tolerance
        );
    }
    text
}
