//! `epsplat surfels`: estimates oriented surfels from points.

use std::path::PathBuf;

use clap::Args;
use epsplat::io::ply;
use epsplat::low_level::surfels::{FromPoints, Orientation, Size, from_points};
use epsplat::options::parse::orientation as orientation_of;
use epsplat::options::{InputOptions, LimitOptions};
use epsplat::{Error, Files, Result};

use super::inputs::help_of_all;
use super::outputs::Source;
use super::progress::Bars;
use super::{note, outputs};

/// Make surfels from points and write them as PLY: oriented normals, ellipses without gaps.
///
/// The inputs are joined to one cloud. Normals in the files are used; missing normals are those of
/// a plane fitted to 16 neighbours.
#[derive(Args)]
#[command(after_help = "Examples:\n  epsplat surfels scan.laz -o scan.ply\n  \
    epsplat surfels left.ply right.ply -o room.ply --size ellipse --outliers 3 --orient 0,0,1.6 --orient 4.1,0,1.6")]
pub struct Arguments {
    #[arg(required = true, help = help_of_all("Point clouds, or meshes, whose vertices are used"))]
    inputs: Vec<PathBuf>,
    /// Output file: .ply
    #[arg(short, long)]
    output: PathBuf,
    /// Size and shape of surfels: knn, ellipse, bsp, qsplat, ... (all in --help)
    ///
    /// knn: the smallest ellipse that holds the point's Voronoi cell in the tangent plane; ellipse:
    /// it bounds 8 neighbours in the tangent plane, along the axes of their covariance; bsp,
    /// bsp:circumsphere: disks from clusters of three points, by their mean edge or circumsphere;
    /// bsp:global, bsp:global-circumsphere: one radius for all disks, the mean over such clusters;
    /// qsplat: at each vertex of a mesh, a disk as large as the largest triangle there
    #[arg(long, default_value = "knn")]
    size: Size,
    /// Side of estimated normals: outward (propagate), up, or toward a scanner at X,Y,Z
    ///
    /// propagate carries the side from neighbour to neighbour. For several scanners give the option
    /// once for each: normals point to the nearest one
    #[arg(long, value_name = "propagate|up|X,Y,Z", default_value = "propagate", value_parser = orientation_of,
        allow_hyphen_values = true)]
    orient: Vec<Orientation>,
    /// Estimate all normals, also those that the files have
    #[arg(long)]
    estimate_normals: bool,
    #[command(flatten)]
    reading: InputOptions,
    #[command(flatten)]
    limits: LimitOptions,
}

pub fn run(arguments: &Arguments) -> Result<()> {
    ply::check_extension(&arguments.output)?;
    let options = FromPoints {
        size: arguments.size,
        orientation: orientation(&arguments.orient)?,
        estimate_normals: arguments.estimate_normals,
        limits: arguments.limits.limits(),
    };
    let files = Files::new(&arguments.inputs, &arguments.reading)?;
    outputs::check(Source::of(&files), [&arguments.output])?;
    let bars = Bars::new();
    let inputs = files.read(&bars)?;
    let beside = outputs::beside(&inputs, &arguments.output)?;
    let mut surfels = from_points(inputs, &options, &bars).map_err(|error| files.named(error))?;
    surfels.points.beside = beside;
    ply::write_points(&arguments.output, &surfels.points, &bars)?;
    for line in surfels.notes() {
        note(&line);
    }
    let parts = surfels.parts.map_or(String::new(), |parts| {
        format!(", oriented in {parts} connected part{}", if parts == 1 { "" } else { "s" })
    });
    note(&format!("{}: {} surfels{parts}", arguments.output.display(), surfels.preparation.surfels));
    Ok(())
}

/// Joins several `--orient` options into one orientation.
///
/// # Errors
///
/// [`Error::Usage`] if there are several options and one of them is not the position of a scanner.
fn orientation(given: &[Orientation]) -> Result<Orientation> {
    if let [one] = given {
        return Ok(one.clone());
    }
    let mut scanners = Vec::new();
    for orientation in given {
        let Orientation::Toward(positions) = orientation else {
            return Err(Error::Usage(
                "several --orient options must each be a scanner's position X,Y,Z: give others only once".into(),
            ));
        };
        scanners.extend(positions);
    }
    Ok(Orientation::Toward(scanners))
}
