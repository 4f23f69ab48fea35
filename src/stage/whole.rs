//! Builds the scene of a picture from all inputs and triangle meshes.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::Request;
use super::coloring::by_normals;
use super::meshes::Meshes;
use crate::address;
use crate::error::{Error, Result};
use crate::io::{ColorBy, Points, Texture};
use crate::options::{MeshAs, RenderOptions, Suggested};
use crate::plan::check::textured;
use crate::plan::{Facts, composited};
use crate::progress::Progress;
use crate::scene::{Blend, ColorKey, Colors, Composite, Map, PointSize, Scene};
use crate::surfels::{self, FromPoints, Preparation, Surfels, from_points};

/// A scene, and counts of how its points became surfels.
pub(super) type Made = (Scene, Preparation);

/// The surfels and triangles of all inputs, shared by all renderers that draw them.
#[derive(Clone)]
pub(super) struct Whole {
    pub scene: Arc<Scene>,
    /// Counts of how its points became surfels.
    pub preparation: Preparation,
    /// Notes of reading and building.
    pub notes: Vec<String>,
    /// The meaning of colours, if they show an attribute.
    pub key: Option<ColorKey>,
}

/// The choices of a picture on which its surfels depend.
#[derive(Clone, Copy, PartialEq)]
pub(super) struct Making {
    /// The size of points that face the camera.
    facing: Option<PointSize>,
    /// How meshes are drawn.
    mesh: MeshAs,
    /// Surfels are painted by the images of their meshes' materials.
    paints: bool,
    /// How surfaces show through each other: [`seen_through`].
    composite: Composite,
    transparent: bool,
    /// Levels of detail are needed. Building them reorders the surfels.
    levels: bool,
}

impl Making {
    pub fn of(request: &Request<'_>) -> Self {
        let RenderOptions { points, transparency, maps, .. } = request.options;
        let settings = request.options.settle(request.backend(), Suggested::default());
        Self {
            facing: points.facing.map(|_| points.point_size.unwrap_or_default()),
            mesh: request.scene.options.mesh(request.options).0,
            paints: paints(request),
            composite: settings.composite,
            levels: !settings.detail.is_finest(),
            transparent: transparency.opacity.is_some_and(|opacity| opacity < 1.0) || maps.aov.contains(&Map::Surfaces),
        }
    }
}

/// Reads all inputs and meshes into one scene.
pub(super) fn scene(request: &Request<'_>, progress: &dyn Progress) -> Result<(Made, Option<ColorKey>)> {
    let (points, key) = request.points(progress)?;
    if let Some(read) = request.read {
        read(&points);
    }
    Ok((scene_of(request, points, progress)?, key))
}

/// Builds one scene from the points of the inputs, reading the triangle meshes to draw with them.
pub(super) fn scene_of(request: &Request<'_>, mut inputs: Vec<Points>, progress: &dyn Progress) -> Result<Made> {
    let mut meshes = Meshes::of_inputs(request, &mut inputs, progress)?;
    if inputs.is_empty() && !request.surfels().textures.is_empty() {
        let what = "--texture paints surfels, and there are none: take --triangle-texture for triangles";
        return Err(Error::Usage(what.into()));
    }
    // Inputs with neither points nor triangles fail in `surfels_of`, whose error says so.
    let none = !inputs.is_empty() && meshes.is_empty() && inputs.iter().all(|points| points.beside.is_none());
    // A file of `epsplat hybrid` names the mesh of its remaining triangles.
    let beside = inputs.iter().filter_map(|points| points.beside.clone()).collect();
    let of_surfels = if none || inputs.iter().any(|points| !points.positions.is_empty()) {
        Some(surfels_of(request, inputs, progress)?)
    } else {
        inputs.iter().flat_map(|points| &points.unread).for_each(|line| progress.note(line));
        None
    };
    meshes.read_named(request, beside, progress)?;
    if meshes.is_empty() {
        request.check_triangles(false)?;
        return of_surfels.ok_or_else(|| Error::Usage("there is nothing to render: name a file".into()));
    }
    meshes.joined(of_surfels, progress)
}

/// Returns true if these options can paint surfels with the images of their meshes' materials.
///
/// Otherwise each surfel has the mean colour of its part of the image.
fn paints(request: &Request<'_>) -> bool {
    let levels = &request.options.levels;
    let finest = levels.lod.is_none() && levels.splats.is_none();
    let reference = request.is_reference();
    let settings = request.settings();
    finest && settings.is_ok_and(|settings| textured(&settings, reference).is_ok() && settings.blend != Blend::Nearest)
}

/// Builds the surfels of all inputs, and colours them if the options ask for colours by normals.
pub(super) fn surfels_of(request: &Request<'_>, inputs: Vec<Points>, progress: &dyn Progress) -> Result<Made> {
    let (mut scene, preparation) = uncolored(request, inputs, progress)?;
    if let Some(factor) = request.surfels().radius_scale {
        scene.enlarge(factor as f32);
    }
    match request.scene.options.colors.color_by {
        Some(ColorBy::Normal) => Ok((by_normals(scene), preparation)),
        _ => Ok((scene, preparation)),
    }
}

fn uncolored(request: &Request<'_>, inputs: Vec<Points>, progress: &dyn Progress) -> Result<Made> {
    let mut textures =
        request.surfels().textures.iter().map(|image| Texture::read(image)).collect::<Result<Vec<_>>>()?;
    let bare = |points: &Points| !points.has_places() && !points.positions.is_empty();
    if !textures.is_empty() && inputs.iter().any(bare) {
        let paths =
            request.files().paths().iter().zip(&inputs).filter(|(_, points)| bare(points)).map(|(path, _)| path);
        // The places of meshes that the images paint as triangles hold no points.
        let paints_triangles = inputs.iter().any(|points| points.positions.is_empty());
        if !inputs.iter().any(Points::has_places) && !paints_triangles {
            let what = "its points have no texture coordinates, so they cannot be textured: use `epsplat sample` to make surfels of a mesh with texture coordinates";
            let unnamed = Path::new("the scene");
            return Err(Error::malformed(paths.clone().next().map_or(unnamed, PathBuf::as_path), what));
        }
        let mut names = paths.map(|path| address::shown(path).display().to_string()).collect::<Vec<_>>().join(", ");
        if names.is_empty() {
            names = "the scene".to_owned();
        }
        progress.note(&format!(
            "{names}: no texture coordinates, so the points have their own colours in spite of --texture"
        ));
        if !inputs.iter().any(Points::has_places) {
            textures.clear();
        }
    }
    let limits = request.surfels().limits.limits();
    let in_file = |error| request.files().named(error);
    if let Some(size) = request.surfels().size {
        let options = FromPoints { size, limits, ..FromPoints::default() };
        let Surfels { points, preparation, .. } = from_points(inputs, &options, progress).map_err(in_file)?;
        // No limits here: `from_points` has already dropped outliers and limited half-axes.
        let (scene, of_scene) = surfels::build(vec![points], progress).map_err(in_file)?;
        let Preparation { guessed_up, strays, rounding, .. } = of_scene;
        return Ok((
            seen_through(scene, request, progress),
            Preparation { guessed_up, strays, rounding, ..preparation },
        ));
    }
    let built = match request.options.points.facing {
        Some(_) => {
            surfels::build_facing(inputs, request.options.points.point_size.unwrap_or_default(), &limits, progress)
        }
        None if textures.is_empty() && paints(request) => surfels::build_painted(inputs, &limits, progress),
        None => surfels::build_within(inputs, textures, &limits, progress),
    };
    let (scene, preparation) = built.map_err(in_file)?;
    Ok((seen_through(scene, request, progress), preparation))
}

/// Replaces texture coordinates by each surfel's mean colour if the scene is transparent.
///
/// The fragment lists of transparent pictures store no texture coordinates.
fn seen_through(scene: Scene, request: &Request<'_>, progress: &dyn Progress) -> Scene {
    let Colors::Textured(textured) = &scene.colors else { return scene };
    let settings = request.options.settle(request.backend(), Suggested::default());
    if settings.composite == Composite::Opaque || composited(&Facts::of(&scene), &settings) == Composite::Opaque {
        return scene;
    }
    progress.note("the picture is transparent, so each surfel has the mean colour of its texture");
    Scene { colors: Colors::Linear(textured.colors().to_vec()), ..scene }
}
