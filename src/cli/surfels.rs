//! `epsplat surfels`: oriented surfels from points.

use std::path::PathBuf;

use clap::Args;
use epsplat::io::ply;
use epsplat::surfels::{FromPoints, Orientation, Size, from_points};
use epsplat::{Error, Result};

use super::parse::parse_orientation;
use super::progress::Bars;
use super::reading::{LimitArguments, Reading, help_of_all, named};
use super::{note, outputs};

/// Make surfels from points and write them as PLY: normals with a side, ellipses without gaps.
///
/// The inputs become one cloud. Given normals stay; the others are those of a plane through 16
/// neighbours.
#[derive(Args)]
#[command(after_help = "Examples:\n  epsplat surfels scan.laz -o scan.ply\n  \
    epsplat surfels left.ply right.ply -o room.ply --size ellipse --outliers 3 --orient 0,0,1.6 --orient 4.1,0,1.6")]
pub struct Arguments {
    #[arg(required = true, help = help_of_all("Point clouds, or meshes, of which the vertices are taken"))]
    pub(super) inputs: Vec<PathBuf>,
    #[command(flatten)]
    pub(super) reading: Reading,
    /// The file: .ply
    #[arg(short, long)]
    output: PathBuf,
    /// knn: the ellipse that holds what is nearer to a point than to its neighbours; ellipse: the one that bounds 8 neighbours in the tangent
    /// plane; bsp, bsp:circumsphere: disks from clusters of three points, by their mean edge or circumsphere; bsp:global,
    /// bsp:global-circumsphere: one disk for all, of such clusters' mean; qsplat: as large as the largest triangle at a mesh's vertex
    #[arg(long, default_value = "knn")]
    size: Size,
    /// Which side estimated normals point to: propagate from neighbour to neighbour, outward; X,Y,Z, toward the nearest
    /// scanner (once for each); up
    #[arg(long, value_name = "propagate|up|X,Y,Z", default_value = "propagate", value_parser = parse_orientation,
        allow_hyphen_values = true)]
    orient: Vec<Orientation>,
    /// Estimate normals even where they are given
    #[arg(long)]
    estimate_normals: bool,
    #[command(flatten)]
    limits: LimitArguments,
}

pub fn run(arguments: &Arguments) -> Result<()> {
    ply::check_extension(&arguments.output)?;
    let options = FromPoints {
        size: arguments.size,
        orientation: orientation(&arguments.orient)?,
        estimate_normals: arguments.estimate_normals,
        limits: arguments.limits.limits(),
    };
    outputs::check(arguments.reading.sources(&arguments.inputs), [&arguments.output])?;
    let bars = Bars::new();
    let inputs = arguments.reading.all(&arguments.inputs, &bars)?;
    let beside = outputs::beside(&inputs, &arguments.output)?;
    let mut surfels = from_points(inputs, &options, &bars).map_err(|error| named(error, &arguments.inputs))?;
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

/// Joins several --orient: the positions of several scanners make one orientation.
fn orientation(given: &[Orientation]) -> Result<Orientation> {
    if let [one] = given {
        return Ok(one.clone());
    }
    let mut scanners = Vec::new();
    for orientation in given {
        let Orientation::Toward(positions) = orientation else {
            return Err(Error::Usage(
                "--orient is given once, or several times with the position of a scanner each".into(),
            ));
        };
        scanners.extend(positions);
    }
    Ok(Orientation::Toward(scanners))
}
