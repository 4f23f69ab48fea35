//! `epsplat coverage`: measures holes between surfels that represent a mesh, and distances to the
//! mesh.

use std::fmt::Write;
use std::path::PathBuf;

use clap::Args;
use epsplat::low_level::metrics::SurfaceDistances;
use epsplat::low_level::metrics::coverage::{Coverage, DEFAULT_SIDE, DEFAULT_VIEWS, coverage};
use epsplat::low_level::surfels::build;
use epsplat::low_level::truth::TriangleTree;
use epsplat::options::InputOptions;
use epsplat::{Error, Files, Progress, Result, io};
use serde::Serialize;

use super::inputs::{help_of_all, help_of_mesh};
use super::outputs::Source;
use super::progress::Bars;
use super::{note, outputs, print, write_json};

/// Measure holes between surfels that represent a mesh, and the surfels' distance from the mesh.
///
/// Rays are cast at the mesh from all directions. A ray is covered if it hits a disk near the point
/// where the ray first meets the mesh, at most the disk's radius away. An uncovered ray counts as
/// an edge if it lies at an outline or a step in depth, which flat disks cut off, and otherwise as
/// a hole. Nothing is rendered, so no filter and no epsilon hides a hole.
#[derive(Args)]
#[command(after_help = "Example:\n  epsplat coverage surfels.ply --mesh bunny.obj --json -")]
pub struct Arguments {
    #[arg(required = true, help = help_of_all("Files of surfels, or of points, whose radii are then estimated"))]
    surfels: Vec<PathBuf>,
    #[arg(long, help = help_of_mesh("Mesh that the surfels represent"))]
    mesh: PathBuf,
    /// Number of directions to cast rays from
    #[arg(long, default_value_t = DEFAULT_VIEWS, value_parser = clap::value_parser!(u32).range(1..=65_536))]
    views: u32,
    /// Rays along each side of a direction's square grid
    #[arg(long, value_name = "RAYS", default_value_t = DEFAULT_SIDE, value_parser = clap::value_parser!(u32).range(1..=8192))]
    side: u32,
    /// Write the measures as JSON to a file, or to stdout for - (in place of the table)
    #[arg(long, value_name = "FILE|-")]
    json: Option<PathBuf>,
    #[command(flatten)]
    reading: InputOptions,
}

#[derive(Serialize)]
struct Outcome {
    surfels: u64,
    triangles: u64,
    /// Diagonal of the mesh's bounding box, world units.
    diagonal: f64,
    hole_free: bool,
    #[serde(flatten)]
    coverage: Coverage,
    #[serde(flatten)]
    distances: SurfaceDistances,
}

pub fn run(arguments: &Arguments) -> Result<()> {
    let files = Files::new(&arguments.surfels, &arguments.reading)?;
    let read = Source::of(&files).chain([Source::cloud(&arguments.mesh)]);
    outputs::check(read, &arguments.json)?;
    let bars = Bars::new();
    let mesh = io::read_mesh(&arguments.mesh, &bars)?;
    let triangles = TriangleTree::new(&mesh)?;
    if triangles.is_empty() {
        return Err(Error::malformed(&arguments.mesh, "it has no triangle with an area, so there is nothing to cover"));
    }
    let points = files.read(&bars)?;
    let (scene, preparation) = build(points, &bars).map_err(|error| files.named(error))?;
    preparation.notes().iter().for_each(|line| note(line));
    if preparation.estimated_radii > 0 {
        note(&format!("{} surfels have no radius: it is estimated from neighbours", preparation.estimated_radii));
    }
    mesh.notes.iter().for_each(|line| note(line));
    let dropped = mesh.triangles.len() - triangles.len();
    if dropped > 0 {
        note(&format!(
            "{dropped} triangles were dropped: they have no area, or a coordinate is not finite or too large"
        ));
    }
    let coverage = coverage(&triangles, &scene, arguments.views, arguments.side, &bars)?;
    bars.begin("measuring distances", 0);
    let distances = SurfaceDistances::of(&scene, &mesh, &triangles)?;
    bars.end();
    let outcome = Outcome {
        surfels: scene.surfels.len() as u64,
        triangles: triangles.len() as u64,
        diagonal: 2.0 * triangles.radius(),
        hole_free: coverage.is_hole_free(),
        coverage,
        distances,
    };
    match &arguments.json {
        Some(path) => write_json(path, &outcome),
        None => print(&table(&outcome)),
    }
}

fn table(outcome: &Outcome) -> String {
    let mut text = String::new();
    let Outcome { coverage: seen, distances, diagonal, .. } = outcome;
    let percent = |share: f64| format!("{:.4} %", 100.0 * share);
    // Writing to a string cannot fail.
    let _ = writeln!(text, "{} surfels on {} triangles", outcome.surfels, outcome.triangles);
    let _ = writeln!(
        text,
        "{} views of {}x{} rays, {:.3e} apart: {} of the diagonal\n",
        seen.views,
        seen.side,
        seen.side,
        seen.ray_spacing,
        percent(seen.ray_spacing / diagonal)
    );
    let counted = |part: u64, share: Option<f64>| {
        format!("{part:>9} of {} rays, {}", seen.seen.rays, percent(share.unwrap_or(0.0)))
    };
    let _ = writeln!(text, "uncovered  {}", counted(seen.seen.uncovered, seen.uncovered_share));
    let _ = writeln!(text, "holes      {}", counted(seen.seen.holes, seen.hole_share));
    match &seen.worst_view {
        None => {
            let _ = writeln!(text, "hole-free  from all {} views; the uncovered rays lie at edges", seen.views);
        }
        Some(worst) => {
            let [x, y, z] = worst.from;
            let _ = writeln!(
                text,
                "           in {} of {} views; most, {}, from the direction {x:.3},{y:.3},{z:.3}",
                seen.views_with_holes,
                seen.views,
                percent(worst.hole_share)
            );
        }
    }
    let columns = ["mean", "rms", "99 %", "max"].map(|column| format!("  {column:>9} {:>9}", "of diag."));
    let _ = writeln!(text, "\n{:18}{}", "distance", columns.concat());
    let rows = [
        ("centres to mesh", &distances.centers_to_mesh),
        ("rims to mesh", &distances.rims_to_mesh),
        ("mesh to centres", &distances.mesh_to_centers),
        ("mesh to disks", &distances.mesh_to_disks),
    ];
    for (name, distances) in rows {
        if let Some(d) = distances {
            let _ = write!(text, "{name:18}");
            for value in [d.mean, d.rms, d.percentile_99, d.max] {
                let _ = write!(text, "  {value:>9.2e} {:>9}", percent(value / diagonal));
            }
            text.push('\n');
        }
    }
    text
}
