//! `epsplat hybrid`: surfels where the triangles of a mesh are smaller than pixels, and the other triangles.

use std::path::{Path, PathBuf};

use clap::Args;
use epsplat::io::{self, Material, Texture};
use epsplat::surfels::hybrid::{Report, hybrid, pixel};
use epsplat::{Error, Result};

use super::progress::Bars;
use super::reading::{InputFormat, named};
use super::{note, outputs, print, write_json};

/// Write a mesh as surfels where its triangles are much smaller than pixels, and as triangles elsewhere.
///
/// Where triangles have less than a twentieth of a square pixel they become surfels, four for each pixel; larger ones stay as they are. Surfels are written to OUT.ply, triangles beside it to OUT.mesh.ply, and their images to
/// OUT.mesh-1.png and so on; `epsplat render OUT.ply` draws both.
#[derive(Args)]
#[command(
    after_help = "Example:\n  epsplat hybrid dragon.ply -o far.ply --pixels 400\n  epsplat render far.ply -o far.png"
)]
pub struct Arguments {
    /// The mesh: .obj or .ply; - is standard input
    mesh: PathBuf,
    #[command(flatten)]
    input: InputFormat,
    /// The file of the surfels: .ply
    #[arg(short, long)]
    output: PathBuf,
    /// How many pixels the diagonal of the mesh's box will be seen as long as
    #[arg(long, value_name = "N", default_value = "1000", value_parser = pixels)]
    pixels: f64,
    /// An image for the whole mesh, in place of its own materials: .png, .jpg, .bmp or .tga
    #[arg(long, value_name = "FILE")]
    texture: Option<PathBuf>,
    /// What became of the mesh as JSON, to a file or - for stdout
    #[arg(long, value_name = "FILE|-")]
    json: Option<PathBuf>,
}

fn pixels(text: &str) -> std::result::Result<f64, String> {
    let number = text.parse().ok().filter(|number| (1.0..=1e6).contains(number));
    number.ok_or_else(|| "it is a number of pixels from 1 to 1000000".into())
}

pub fn run(arguments: &Arguments) -> Result<()> {
    io::ply::check_extension(&arguments.output)?;
    let beside = arguments.output.with_extension("mesh.ply");
    outputs::check_named_in_ply(beside.file_name().map_or(Path::new(""), Path::new))?;
    let inputs = || [&arguments.mesh].into_iter().chain(&arguments.texture);
    let written = || [&arguments.output, &beside].into_iter().chain(&arguments.json);
    outputs::check(inputs(), written())?;
    let bars = Bars::new();
    let mut mesh = arguments.input.mesh(&arguments.mesh, &bars)?;
    mesh.notes.iter().for_each(|line| note(line));
    if let Some(path) = &arguments.texture {
        if mesh.texture.is_none() {
            return Err(Error::malformed(&arguments.mesh, "it has no texture coordinates, so it cannot be textured"));
        }
        mesh.paint(Texture::read(path)?);
    }
    let pixel = pixel(&mesh, arguments.pixels)
        .ok_or_else(|| Error::malformed(&arguments.mesh, "it has no triangles whose corners are finite and apart"))?;
    let divided = hybrid(&mesh, pixel, &bars).map_err(|error| named(error, std::slice::from_ref(&arguments.mesh)))?;
    let painted = divided.triangles.iter().filter(|mesh| mesh.texture.is_some());
    let images: Vec<_> = painted.flat_map(|mesh| &mesh.materials).filter_map(Material::painted).collect();
    let paths: Vec<PathBuf> =
        (1..=images.len()).map(|k| arguments.output.with_extension(format!("mesh-{k}.png"))).collect();
    outputs::check(inputs(), written().chain(&paths))?;
    if divided.triangles.iter().flat_map(|mesh| &mesh.materials).any(Material::clamps) {
        note("materials say -clamp on, which a PLY file cannot: their images are repeated beyond their edges");
    }
    for (image, path) in images.iter().zip(&paths) {
        io::png::write_texture(path, image)?;
    }
    if let Some(mesh) = &divided.triangles {
        io::ply::write_mesh(&beside, mesh, &paths.iter().map(|path| name(path)).collect::<Vec<_>>(), &bars)?;
    }
    let mut points = divided.surfels.unwrap_or_default();
    points.beside = divided.triangles.is_some().then(|| name(&beside).into());
    io::ply::write_points(&arguments.output, &points, &bars)?;
    match &arguments.json {
        Some(path) => write_json(path, &divided.report),
        None => print(&summary(&divided.report, &arguments.output)),
    }
}

fn name(path: &Path) -> String {
    path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned())
}

fn summary(report: &Report, output: &Path) -> String {
    format!(
        "{} of {} triangles stay, {} surfels for the others, where a pixel is {:.3e} wide: `epsplat render {}` draws both\n",
        report.kept,
        report.triangles,
        report.surfels,
        report.pixel,
        output.display()
    )
}
