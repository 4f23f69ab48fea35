//! `epsplat hybrid`: replaces the triangles of a mesh that are smaller than pixels by surfels.

use std::path::{Path, PathBuf};

use clap::Args;
use epsplat::io::{self, Material, Mesh, Texture};
use epsplat::low_level::surfels::hybrid::{Report, hybrid, pixel};
use epsplat::options::FormatOptions;
use epsplat::{Error, Result};
use serde::Serialize;

use super::inputs::help_of_mesh;
use super::outputs::Source;
use super::progress::Bars;
use super::{note, outputs, print, write_json};

/// Divide a mesh into surfels, where its triangles are tiny, and triangles elsewhere.
///
/// Triangles smaller than a twentieth of a square pixel become surfels, four for each pixel; larger
/// triangles are kept. Surfels are written to OUT.ply, triangles to OUT.mesh.ply beside it, and
/// images to OUT.mesh-1.png and so on; `epsplat render OUT.ply` draws both. An existing file with
/// such a name is replaced, or removed if it is not needed, but only if an earlier run wrote it.
#[derive(Args)]
#[command(
    after_help = "Example:\n  epsplat hybrid dragon.ply -o far.ply --pixels 400\n  epsplat render far.ply -o far.png"
)]
pub struct Arguments {
    #[arg(help = help_of_mesh("Mesh, - for standard input"))]
    mesh: PathBuf,
    /// Output file of the surfels: .ply
    #[arg(short, long)]
    output: PathBuf,
    /// Length of the diagonal of the mesh's bounding box in the pictures, in pixels
    #[arg(long, value_name = "N", default_value = "1000", value_parser = pixels)]
    pixels: f64,
    /// Image for the whole mesh, in place of its own materials: .png, .jpg, .bmp or .tga
    #[arg(long, value_name = "FILE")]
    texture: Option<PathBuf>,
    /// Write counts and file names as JSON to a file, or to stdout for -
    #[arg(long, value_name = "FILE|-")]
    json: Option<PathBuf>,
    #[command(flatten)]
    input: FormatOptions,
}

fn pixels(text: &str) -> std::result::Result<f64, String> {
    let number = text.parse().ok().filter(|number| (1.0..=1e6).contains(number));
    number.ok_or_else(|| "it is a number of pixels from 1 to 1000000".into())
}

/// The JSON report.
#[derive(Serialize)]
struct Outcome {
    #[serde(flatten)]
    report: Report,
    /// The file of the kept triangles, if there are any, and the files of their images.
    files: Vec<PathBuf>,
}

pub fn run(arguments: &Arguments) -> Result<()> {
    io::ply::check_extension(&arguments.output)?;
    let beside = arguments.output.with_extension("mesh.ply");
    outputs::check_named_in_ply(beside.file_name().map_or(Path::new(""), Path::new))?;
    let earlier = Earlier::of(&arguments.output, &beside)?;
    let read = || [&arguments.mesh].into_iter().chain(&arguments.texture).map(Source::other);
    let written = || [&arguments.output, &beside].into_iter().chain(&arguments.json);
    outputs::check(read(), written())?;
    let second = outputs::all_named([Source::Cloud(&arguments.mesh, arguments.input.input_format)])?;
    let read = || read().chain(second.iter().map(Source::other));
    outputs::check_distinct(read(), written())?;
    let bars = Bars::new();
    let mesh = mesh(arguments, &bars)?;
    let pixel = pixel(&mesh, arguments.pixels)
        .ok_or_else(|| Error::malformed(&arguments.mesh, "it has no triangles whose corners are finite and apart"))?;
    let divided =
        hybrid(&mesh, pixel, &bars).map_err(|error| error.of_inputs(std::slice::from_ref(&arguments.mesh)))?;
    let painted = divided.triangles.iter().filter(|mesh| mesh.texture.is_some());
    let images: Vec<_> = painted.flat_map(|mesh| &mesh.materials).filter_map(Material::painted).collect();
    let paths: Vec<PathBuf> = (1..=images.len()).map(|k| image(&arguments.output, k)).collect();
    paths.iter().try_for_each(|path| earlier.check_image(path))?;
    outputs::check(read(), written().chain(&paths))?;
    if divided.triangles.iter().flat_map(|mesh| &mesh.materials).any(Material::clamps) {
        note("a PLY file cannot store the option -clamp on of materials: their images repeat beyond their edges");
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
    let files: Vec<PathBuf> = divided.triangles.iter().map(|_| beside.clone()).chain(paths).collect();
    earlier.remove_but(&files)?;
    for (index, file) in files.iter().enumerate() {
        let what = if index == 0 { "the triangles that stay" } else { "an image of these triangles" };
        note(&format!("{}: {what}", file.display()));
    }
    let outcome = Outcome { report: divided.report, files };
    match &arguments.json {
        Some(path) => write_json(path, &outcome),
        None => print(&summary(&outcome.report, &arguments.output)),
    }
}

/// Reads the mesh, and paints it with the image of `--texture` if that is given.
fn mesh(arguments: &Arguments, bars: &Bars) -> Result<Mesh> {
    let mut mesh = arguments.input.mesh(&arguments.mesh, bars)?;
    mesh.notes.iter().for_each(|line| note(line));
    if let Some(path) = &arguments.texture {
        if mesh.texture.is_none() {
            return Err(Error::malformed(&arguments.mesh, "it has no texture coordinates, so it cannot be textured"));
        }
        mesh.paint(Texture::read(path)?);
    }
    Ok(mesh)
}

/// Returns the path of image number `k`, counted from 1.
fn image(output: &Path, k: usize) -> PathBuf {
    output.with_extension(format!("mesh-{k}.png"))
}

/// Files of triangles and images that an earlier run wrote beside the output.
///
/// No option names these files, so the command replaces them only if an earlier run wrote them.
struct Earlier(Vec<PathBuf>);

impl Earlier {
    /// Finds the files of an earlier run with this output.
    ///
    /// # Errors
    ///
    /// [`Error::Usage`] if a file at `beside` was not written by `epsplat hybrid`.
    fn of(output: &Path, beside: &Path) -> Result<Self> {
        let textures = io::ply::textures_of_hybrid(beside);
        if textures.is_none() && beside.symlink_metadata().is_ok() {
            return Err(not_ours(beside));
        }
        let own = |(k, texture): (usize, &PathBuf)| (image(output, k) == *texture).then(|| texture.clone());
        let images = textures.iter().flatten().enumerate().map(|(index, texture)| (index + 1, texture)).filter_map(own);
        Ok(Self(textures.iter().map(|_| beside.to_owned()).chain(images).collect()))
    }

    /// Fails if a file at `path` exists that the earlier run did not write.
    fn check_image(&self, path: &Path) -> Result<()> {
        let known = self.0.iter().any(|file| file == path);
        if known || path.symlink_metadata().is_err() { Ok(()) } else { Err(not_ours(path)) }
    }

    /// Removes the files of the earlier run that this run did not write, as no PLY file names them
    /// any more.
    fn remove_but(&self, written: &[PathBuf]) -> Result<()> {
        for file in self.0.iter().filter(|file| !written.contains(file) && file.symlink_metadata().is_ok()) {
            std::fs::remove_file(file).map_err(|error| Error::write(file, error))?;
            note(&format!("{}: removed, as this run does not need the file of an earlier one", file.display()));
        }
        Ok(())
    }
}

fn not_ours(path: &Path) -> Error {
    Error::Usage(format!(
        "{} would be overwritten, and `epsplat hybrid` did not write it for this output: choose another name for the output, \
         or remove that file",
        path.display()
    ))
}

fn name(path: &Path) -> String {
    path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned())
}

fn summary(report: &Report, output: &Path) -> String {
    format!(
        "{} of {} triangles stay, {} surfels replace the others, for pixels {:.3e} wide: `epsplat render {}` draws both\n",
        report.kept,
        report.triangles,
        report.surfels,
        report.pixel,
        output.display()
    )
}
