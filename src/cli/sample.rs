//! `epsplat sample`: samples the triangles of a mesh as surfels.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::{Args, ValueEnum};
use epsplat::io::{self, Material, Mesh, Texture};
use epsplat::low_level::surfels::curve;
use epsplat::low_level::surfels::sampling::{MOST, MeshSurface, Method, Priority, sample, voxels::Voxel};
use epsplat::options::FormatOptions;
use epsplat::{Error, Result};

use super::inputs::help_of_mesh;
use super::outputs::Source;
use super::progress::Bars;
use super::{note, outputs};

/// Cover a mesh with a given number of surfels, written as PLY.
///
/// The surfels lie on the mesh's triangles and have its colours, normals and texture coordinates.
/// The mesh is divided into voxels, and the samples are distributed to them by priority: triangles
/// (their number in the voxel), touched (the same, but a triangle counts fully in each voxel that
/// it touches), area, curvature (where the surface bends) or texture (where the colour changes).
#[derive(Args)]
#[command(after_help = "Example:\n  epsplat sample bunny.obj -o surfels.ply --count 60000")]
pub struct Arguments {
    #[arg(help = help_of_mesh("Mesh, - for standard input"))]
    mesh: PathBuf,
    /// Output file: .ply
    #[arg(short, long)]
    output: PathBuf,
    /// Number of samples
    #[arg(long, value_parser = clap::value_parser!(u64).range(1..=MOST as u64))]
    count: u64,
    /// Priority of voxels: triangles, touched (as in Tien 2008), area, curvature or texture
    #[arg(long, default_value = "triangles")]
    priority: Priority,
    /// How samples are placed
    #[arg(long, value_enum, default_value = "stratified")]
    method: Placement,
    /// Shape of surfels
    #[arg(long, value_enum, default_value = "disk")]
    shape: Shape,
    /// Number of halvings of the mesh's box into voxels [default: one voxel per four samples]
    #[arg(long, value_name = "HALVINGS", value_parser = clap::value_parser!(u32).range(0..=60))]
    depth: Option<u32>,
    /// Image for the whole mesh, in place of its own materials: .png, .jpg, .bmp or .tga
    #[arg(long, value_name = "FILE")]
    texture: Option<PathBuf>,
    /// Seed of the random samples; not used by --method projected
    #[arg(long, default_value_t = 0)]
    seed: u64,
    #[command(flatten)]
    input: FormatOptions,
}

#[derive(Clone, Copy, ValueEnum)]
enum Placement {
    /// By the priority of voxels, spread evenly over the triangles
    Stratified,
    /// By the priority of voxels, projected onto their triangles as in Tien 2008: a baseline
    Projected,
    /// Independent random points, by area: a baseline without radii
    Uniform,
}

#[derive(Clone, Copy, PartialEq, ValueEnum)]
enum Shape {
    /// Ellipses in their planes
    Disk,
    /// Ellipses that curve with the surface around them
    Cap,
}

pub fn run(arguments: &Arguments) -> Result<()> {
    io::ply::check_extension(&arguments.output)?;
    let texture = arguments.texture.iter().map(Source::other);
    outputs::check(
        [Source::Cloud(&arguments.mesh, arguments.input.input_format)].into_iter().chain(texture),
        [&arguments.output],
    )?;
    let bars = Bars::new();
    if arguments.shape == Shape::Cap && matches!(arguments.method, Placement::Uniform) {
        return Err(Error::Usage("uniform samples have no half-axes to curve: leave --shape cap out".into()));
    }
    let mut mesh = arguments.input.mesh(&arguments.mesh, &bars)?;
    mesh.notes.iter().for_each(|line| note(line));
    if let Some(path) = &arguments.texture {
        if mesh.texture.is_none() {
            return Err(Error::malformed(&arguments.mesh, "it has no texture coordinates, so it cannot be textured"));
        }
        mesh.paint(Texture::read(path)?);
    }
    let priority = |surface: &MeshSurface<'_>, voxels: &[Voxel]| arguments.priority.of(surface, voxels);
    let method = match arguments.method {
        Placement::Stratified => Method::Stratified { priority: &priority, depth: arguments.depth },
        Placement::Projected => Method::Projected { priority: &priority, depth: arguments.depth },
        Placement::Uniform => Method::Uniform,
    };
    let (points, sampling) = sample(&mesh, arguments.count as usize, &method, arguments.seed, &bars)
        .map_err(|error| error.of_inputs(std::slice::from_ref(&arguments.mesh)))?;
    let points = if arguments.shape == Shape::Cap { curve(points, &bars)? } else { points };
    sampling.notes().iter().for_each(|line| note(line));
    io::ply::write_points(&arguments.output, &points, &bars)?;
    let images = if points.texture_numbers.is_some() { images(&mesh) } else { Vec::new() };
    let voxels = if sampling.voxels > 0 { format!(" in {} voxels", sampling.voxels) } else { String::new() };
    let (samples, triangles) = (sampling.samples, sampling.triangles);
    note(&format!("{}: {samples} surfels from {triangles} triangles{voxels}", arguments.output.display()));
    if !images.is_empty() {
        let painted: String = images.iter().map(|image| format!(" --texture {}", quoted(image))).collect();
        note(&format!("to paint them by their images: epsplat render {}{painted}", quoted(&arguments.output)));
        let dyed = |material: &Material| material.texture.is_some() && material.diffuse != [1.0; 4];
        if mesh.materials.iter().any(dyed) {
            note("the surfels' own colours are images times materials' colours; --texture leaves the latter out");
        }
        if mesh.materials.iter().any(Material::clamps) {
            note("the option -clamp on of materials is ignored by --texture: images repeat beyond their edges");
        }
    }
    Ok(())
}

/// Returns a path as an argument of a shell: in quotes, unless no character has a meaning there.
fn quoted(path: &Path) -> String {
    let path = path.display().to_string();
    let is_plain = |c: char| c.is_alphanumeric() || "/._-+,:@%=".contains(c);
    if path.chars().all(is_plain) { path } else { format!("'{}'", path.replace('\'', "'\\''")) }
}

/// Returns the image files of a mesh's textures, in the order of the textures' numbers.
fn images(mesh: &Mesh) -> Vec<PathBuf> {
    let (textures, _) = mesh.textures();
    let image = |texture: &Arc<Texture>| {
        let own = |material: &&Material| material.texture.as_ref().is_some_and(|own| Arc::ptr_eq(own, texture));
        mesh.materials.iter().find(own).and_then(|material| material.image.clone())
    };
    textures.iter().filter_map(image).collect()
}
