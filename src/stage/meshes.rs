//! The meshes of a scene that are drawn as their triangles: those among the inputs, and those that
//! options or inputs name.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use super::Request;
use super::whole::Made;
use crate::error::{Error, Result};
use crate::io::{self, Mesh, Paint, Points, ReadOptions, Texture};
use crate::options::MeshAs;
use crate::progress::Progress;
use crate::scene::{Colors, Composite};
use crate::surfels::smooth::smooth_normals;
use crate::surfels::{Preparation, with_triangles};

/// Meshes with the paths that they were read from; a mesh in memory has an empty path.
#[derive(Default)]
pub(super) struct Meshes {
    meshes: Vec<Mesh>,
    paths: Vec<PathBuf>,
    /// The number of each mesh among the inputs; meshes that are no inputs follow them.
    numbers: Vec<u32>,
}

/// Returns how the meshes among `inputs` are drawn, and why if nobody said so and they are surfels.
///
/// # Errors
///
/// [`Error::Usage`] if all inputs are drawn as triangles and an option needs surfels.
fn drawn_as(request: &Request<'_>, inputs: &[Points]) -> Result<(MeshAs, Option<String>)> {
    let (drawn_as, needed) = request.scene.options.mesh(request.options);
    // Gaussians are composited from all their fragments.
    let layered = request.options.transparency.composite.is_some_and(|how| how != Composite::Opaque)
        || inputs.iter().any(|points| points.encoded);
    let alone = inputs.iter().all(|points| points.is_mesh() || points.positions.is_empty());
    match (request.triangles().mesh, needed) {
        (Some(MeshAs::Triangles), Some(option)) if alone => Err(Error::Usage(format!(
            "{option} is for surfels, and --mesh triangles draws none: leave one of them out"
        ))),
        (Some(chosen), _) => Ok((chosen, None)),
        (None, None) if layered && inputs.iter().any(|points| points.is_mesh() && is_translucent(points)) => {
            Ok((MeshAs::Surfels, Some("so that all their translucent surfaces show".into())))
        }
        (None, needed) => Ok((drawn_as, needed.map(|option| format!("which {option} is for")))),
    }
}

/// Whether a vertex, a triangle or an image of a mesh has an alpha between 0 and 1.
fn is_translucent(mesh: &Points) -> bool {
    let of_vertices = match &mesh.colors {
        Some(Colors::Constant([.., alpha])) => *alpha < 1.0,
        Some(Colors::Srgb8(colors)) => colors.iter().any(|[.., alpha]| *alpha < 255),
        Some(Colors::Linear(colors)) => colors.iter().any(|[.., alpha]| *alpha < 1.0),
        Some(Colors::Textured(_) | Colors::Harmonics(_)) | None => false,
    };
    let paint = mesh.faces.as_ref().and_then(|faces| faces.paint.as_ref());
    let of_paint = |paint: &Paint| {
        paint.colors.iter().any(|[.., alpha]| *alpha < 1.0) || paint.textures.iter().any(|image| image.is_translucent())
    };
    of_vertices || paint.is_some_and(|paint| of_paint(paint))
}

impl Meshes {
    /// Takes the meshes that are drawn as triangles out of `inputs`, where inputs without points
    /// remain in their places. All meshes get smooth normals if the options ask for it.
    ///
    /// # Errors
    ///
    /// An error of reading an image of `--texture`, and [`Error::Malformed`] if it cannot paint a
    /// mesh.
    pub fn of_inputs(request: &Request<'_>, inputs: &mut [Points], progress: &dyn Progress) -> Result<Self> {
        let mut meshes = Self::default();
        if !inputs.iter().any(Points::is_mesh) {
            let options = request.triangles();
            if (options.smooth.is_some() || options.mesh.is_some()) && options.meshes.is_empty() {
                progress.note("warning: no input is a mesh, so --mesh and --smooth change nothing");
            }
            return Ok(meshes);
        }
        let (drawn_as, because) = drawn_as(request, inputs)?;
        if let Some(because) = because {
            progress.note(&format!("meshes are drawn as surfels, {because} (--mesh chooses)"));
        }
        if let Some(angle) = request.triangles().smooth {
            for Points { positions, faces, .. } in inputs.iter_mut().filter(|points| points.is_mesh()) {
                let faces = faces.as_mut();
                faces.into_iter().for_each(|of| of.normals = Some(smooth_normals(positions, &of.triangles, angle.0)));
            }
        }
        if drawn_as == MeshAs::Surfels {
            return Ok(meshes);
        }
        let textures =
            request.surfels().textures.iter().map(|image| Texture::read(image)).collect::<Result<Vec<_>>>()?;
        for (number, points) in inputs.iter_mut().enumerate().filter(|(_, points)| points.is_mesh()) {
            let path = request.files().paths().get(number).cloned().unwrap_or_default();
            let mut mesh = Mesh::of_points(std::mem::take(points));
            // One image paints all inputs; several belong to the inputs in order.
            if let Some(texture) = textures.get(if textures.len() == 1 { 0 } else { number }) {
                paint(&mut mesh, &path, texture)?;
            }
            meshes.meshes.push(mesh);
            meshes.paths.push(path);
            meshes.numbers.push(number as u32);
        }
        Ok(meshes)
    }

    pub fn is_empty(&self) -> bool {
        self.meshes.is_empty()
    }

    /// Reads the meshes that `--triangles` names, and those `beside` the inputs. A mesh that is
    /// named twice is drawn once.
    ///
    /// # Errors
    ///
    /// An error of reading, and [`Error::Malformed`] if a mesh cannot be painted.
    pub fn read_named(&mut self, request: &Request<'_>, beside: Vec<PathBuf>, progress: &dyn Progress) -> Result<()> {
        let options = request.triangles();
        let mut paths: Vec<PathBuf> = options.meshes.iter().cloned().chain(beside).collect();
        let resolved = |path: &PathBuf| path.canonicalize().unwrap_or_else(|_| path.clone());
        let mut known: BTreeSet<PathBuf> = self.paths.iter().map(resolved).collect();
        paths.retain(|path| known.insert(resolved(path)));
        let read = ReadOptions { ignore_alpha: request.files().options().file.ignore_alpha, ..ReadOptions::default() };
        let mut named =
            paths.iter().map(|path| io::read_mesh_with(path, read.clone(), progress)).collect::<Result<Vec<_>>>()?;
        if let Some(angle) = options.smooth {
            named.iter_mut().for_each(|mesh| {
                mesh.normals = Some(smooth_normals(&mesh.positions, &mesh.triangles, angle.0));
            });
        }
        match options.texture.as_deref() {
            Some(image) if !named.is_empty() => paint_bare(&mut named, &paths, image, progress)?,
            Some(_) if !self.is_empty() => {
                let what = "--triangle-texture paints the meshes of --triangles, and there are none: take --texture";
                return Err(Error::Usage(what.into()));
            }
            _ => {}
        }
        let first = request.scene.count() as u32;
        self.numbers.extend((first..).take(named.len()));
        self.meshes.append(&mut named);
        self.paths.append(&mut paths);
        Ok(())
    }

    /// Joins the triangles of all meshes with a scene of surfels, if there is one.
    ///
    /// # Errors
    ///
    /// [`Error::EmptyScene`] if there are no triangles to draw.
    pub fn joined(self, of_surfels: Option<Made>, progress: &dyn Progress) -> Result<Made> {
        let Self { meshes, paths, numbers } = self;
        meshes.iter().flat_map(|mesh| &mesh.notes).for_each(|line| progress.note(line));
        let (scene, preparation) = of_surfels.unzip();
        let (mut scene, of_triangles) = with_triangles(scene, &meshes).map_err(|error| error.of_inputs(&paths))?;
        scene.provenance.number_meshes(&numbers);
        of_triangles.notes().iter().for_each(|line| progress.note(line));
        let guessed_up = of_triangles.guessed_up;
        Ok((scene, preparation.unwrap_or_else(|| Preparation { guessed_up, ..Preparation::default() })))
    }
}

/// Paints the meshes whose materials have no texture with `image`.
fn paint_bare(meshes: &mut [Mesh], paths: &[PathBuf], image: &Path, progress: &dyn Progress) -> Result<()> {
    let texture = Texture::read(image)?;
    let bare = |mesh: &Mesh| mesh.materials.iter().all(|material| material.texture.is_none());
    if !meshes.iter().any(bare) {
        progress.note("warning: --triangle-texture is not used, as every mesh has a texture of its own");
    }
    let all = meshes.iter_mut().zip(paths).filter(|(mesh, _)| bare(mesh));
    all.into_iter().try_for_each(|(mesh, path)| paint(mesh, path, &texture))
}

/// Paints all triangles of a mesh with an image.
fn paint(mesh: &mut Mesh, path: &Path, texture: &Texture) -> Result<()> {
    if mesh.texture.is_none() {
        return Err(Error::malformed(path, "its triangles have no texture coordinates, so they cannot be painted"));
    }
    mesh.paint(texture.clone());
    Ok(())
}
