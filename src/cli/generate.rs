//! `epsplat generate`: writes analytic shapes with exact normals, radii and colours.

use std::path::PathBuf;

use clap::Args;
use epsplat::io::ply;
use epsplat::low_level::surfels::analytic::{Shape, gaussians, generate};
use epsplat::{Progress, Result};

use super::progress::Bars;
use super::{note, outputs};

/// Write an analytic shape as PLY: surfels with exact normals, radii and colours.
///
/// SHAPE is sphere (unit radius), shells (spheres of radii 1, 0.75, 0.5 and 0.25), torus (radii 1
/// and 0.4), crossing (two squares), plane (a square of side 2, one colour), checkerboard (the
/// plane with 32x32 squares) or text (the plane with lines of text, each line half as high as the
/// line above). Radii are 1.5 times the spacing.
#[derive(Args)]
#[command(after_help = "Example:\n  epsplat generate sphere --count 1000000 -o sphere.ply\n  \
    epsplat generate torus --count 20000 --texture -o torus.ply\n  \
    epsplat generate torus --count 100000 --gaussians -o gaussians.ply")]
pub struct Arguments {
    /// Shape: sphere, shells, torus, crossing, plane, checkerboard or text
    shape: Shape,
    /// Number of surfels
    #[arg(long, value_parser = clap::value_parser!(u64).range(1..=4_000_000_000))]
    count: u64,
    /// Also write texture coordinates, for render --texture
    ///
    /// On spheres they are the angle around the upward axis and the latitude, on the torus the
    /// angles around the axis and around the tube, and on squares the positions across and up
    #[arg(long)]
    texture: bool,
    /// Write Gaussian surfels instead, in the format of 2D Gaussian splatting
    ///
    /// The Gaussians have opacities of 0.1 to 0.95. Their colours are spherical harmonics of degree
    /// 3, which show a light beside the eye
    #[arg(long, conflicts_with = "texture")]
    gaussians: bool,
    /// Output file: .ply
    #[arg(short, long)]
    output: PathBuf,
}

pub fn run(arguments: &Arguments) -> Result<()> {
    ply::check_extension(&arguments.output)?;
    outputs::check([], [&arguments.output])?;
    let bars = Bars::new();
    if arguments.gaussians {
        ply::write_points(&arguments.output, &gaussians(arguments.shape, arguments.count), &bars)?;
        note(&format!("{}: {} Gaussians", arguments.output.display(), arguments.count));
        return Ok(());
    }
    bars.begin("writing surfels", arguments.count);
    let vertices = generate(arguments.shape, arguments.count).enumerate().map(|(index, sample)| {
        // The progress bar takes a lock, so it does not advance for each surfel.
        if index % 65_536 == 65_535 {
            bars.advance(65_536);
        }
        let [r, g, b] = sample.color;
        ply::Vertex {
            position: sample.position,
            normal: sample.normal,
            radius: sample.radius,
            color: Some(ply::Color::Srgb8([r, g, b, 255])),
            texture: arguments.shape.texture_at(sample.position.into()),
            ..ply::Vertex::default()
        }
    });
    let properties = ply::Properties {
        normals: true,
        radii: true,
        colors: ply::ColorProperties::Srgb8,
        texture: arguments.texture,
        up: Some(arguments.shape.up()),
        ..ply::Properties::default()
    };
    ply::write(&arguments.output, properties, arguments.count, vertices)?;
    bars.end();
    note(&format!("{}: {} surfels", arguments.output.display(), arguments.count));
    Ok(())
}
