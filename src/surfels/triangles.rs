//! Converts meshes to the triangles of a scene.

use glam::DVec3;
use rayon::prelude::*;

use super::build::LARGEST_PLACE;
use super::{LARGEST_COORDINATE, guess_up, origin_for, unit};
use crate::io::textures::Numbers;
use crate::io::{Material, Mesh};
use crate::scene::color::DEFAULT_COLOR;
use crate::scene::{Bounds, SMALLEST_SCENE, Scene, Triangle, Triangles};
use crate::{Error, Result};

/// The preparation of meshes for a scene.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct MeshPreparation {
    /// The number of triangles of all meshes.
    pub given: u64,
    /// The number of triangles in the scene.
    pub triangles: u64,
    /// The number of triangles that were left out because a coordinate is not finite or exceeds
    /// [`LARGEST_COORDINATE`].
    pub dropped_non_finite: u64,
    /// The number of triangles that were left out because their area is zero within the precision
    /// of their coordinates.
    pub dropped_degenerate: u64,
    /// The number of triangles with a colour that was not finite and became [`DEFAULT_COLOR`], or
    /// an alpha outside [0, 1] that was clamped.
    pub replaced_colors: u64,
    /// The largest rounding error of a corner's coordinate, world units, among the errors that may
    /// be visible: more than 1/256 of the triangle's width, although coordinates are stored as two
    /// f32. None if there are no such errors.
    pub rounding: Option<f64>,
    /// Whether the up axis was guessed, because no mesh states it.
    pub guessed_up: bool,
}

impl MeshPreparation {
    /// Sentences for the user, one for each kind of loss or replacement.
    pub fn notes(&self) -> Vec<String> {
        let counted = |count: u64, what: &str| (count > 0).then(|| format!("{count} triangles {what}"));
        [
            counted(self.dropped_non_finite, "left out: a coordinate is not finite or too large"),
            counted(self.dropped_degenerate, "left out: their area is zero within the precision of their coordinates"),
            counted(self.replaced_colors, "had a colour that is not finite or an alpha outside 0 to 1, which was replaced"),
            self.rounding.map(|error| {
                format!("the narrowest triangles lie so far from others that their coordinates err by up to {error:.2e} world units")
            }),
        ]
        .into_iter()
        .flatten()
        .collect()
    }
}

/// Adds the triangles of `meshes` to `scene`, which must not have any, or builds a scene of them
/// alone.
///
/// Corners are relative to the scene's origin; an existing scene keeps its own. Triangles have the
/// colours and normals of their corners, or the normals of their planes where those are missing.
///
/// # Errors
///
/// [`Error::EmptyScene`] if no mesh has a usable triangle or the scene is too small, and
/// [`Error::Usage`] if `scene` already has triangles or the parts of a mesh do not fit each other.
pub fn with_triangles(scene: Option<Scene>, meshes: &[Mesh]) -> Result<(Scene, MeshPreparation)> {
    meshes.iter().try_for_each(Mesh::check)?;
    if scene.as_ref().is_some_and(|scene| !scene.triangles.is_empty()) {
        return Err(Error::Usage("a scene that has triangles takes no more: give all meshes at once".into()));
    }
    let place = |mesh: &Mesh, vertex: u32| DVec3::from_array(mesh.positions[vertex as usize]);
    let usable = |mesh: &Mesh, corners: &[u32; 3]| {
        corners.iter().all(|&vertex| place(mesh, vertex).abs().cmple(DVec3::splat(LARGEST_COORDINATE)).all())
    };
    let places = |mesh: &Mesh| {
        let of = mesh.triangles.par_iter().filter(|corners| usable(mesh, corners));
        Bounds::of(of.flat_map_iter(|corners| corners.map(|vertex| place(mesh, vertex))))
    };
    let bounds = meshes.iter().map(places).fold(Bounds::EMPTY, Bounds::union);
    let mut preparation = MeshPreparation::default();
    let mut scene = scene.unwrap_or_else(|| {
        let given = meshes.iter().find_map(|mesh| mesh.up);
        preparation.guessed_up = given.is_none();
        let up = given.unwrap_or_else(|| guess_up(&bounds));
        Scene { origin: origin_for(&bounds), oriented: true, up, ..Scene::default() }
    });
    let (mut all, mut faces, mut textures) = (Vec::new(), Vec::new(), Numbers::default());
    for (mesh, of_mesh) in meshes.iter().zip(0..) {
        preparation.given += mesh.triangles.len() as u64;
        // The index of each material's texture, which meshes may share.
        let number = |of: &Material| of.texture.as_ref().map(|texture| textures.of(texture));
        let numbers: Vec<Option<u32>> = mesh.materials.iter().map(number).collect();
        let of = mesh.triangles.par_iter().enumerate().filter(|(_, corners)| usable(mesh, corners));
        faces.par_extend(of.clone().map(|(index, _)| [of_mesh, index as u32]));
        let made: Vec<(Triangle, bool)> = of.map(|(index, _)| triangle(mesh, index, scene.origin, &numbers)).collect();
        preparation.dropped_non_finite += (mesh.triangles.len() - made.len()) as u64;
        preparation.replaced_colors += made.iter().filter(|(_, replaced)| *replaced).count() as u64;
        all.extend(made.into_iter().map(|(triangle, _)| triangle));
    }
    let (triangles, order) = Triangles::textured_in_order(&all, &textures.all);
    scene.triangles = triangles;
    scene.provenance.set_faces(order.iter().map(|given| faces[*given as usize]).collect());
    preparation.rounding = Triangles::rounding(&all);
    preparation.triangles = scene.triangles.len() as u64;
    preparation.dropped_degenerate = all.len() as u64 - preparation.triangles;
    if scene.triangles.is_empty() {
        return Err(Error::EmptyScene(format!(
            "there are no triangles to draw: of the {} given, none has finite corners and an area beyond the precision of its coordinates",
            preparation.given
        )));
    }
    let size = scene.bounds().extent().max_element();
    if size < SMALLEST_SCENE {
        return Err(Error::EmptyScene(format!(
            "the scene is {size:.1e} world units wide, but only scenes of {SMALLEST_SCENE:e} to {LARGEST_COORDINATE:e} can be drawn: scale it"
        )));
    }
    Ok((scene, preparation))
}

/// Returns triangle `index` relative to `origin`, and whether one of its colours was replaced.
/// `numbers` are the texture indices of the materials.
fn triangle(mesh: &Mesh, index: usize, origin: DVec3, numbers: &[Option<u32>]) -> (Triangle, bool) {
    let corners = mesh.triangles[index].map(|vertex| DVec3::from_array(mesh.positions[vertex as usize]) - origin);
    let facet = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize_or_zero().as_vec3();
    let normals =
        mesh.normals.as_ref().map(|normals| normals[index].map(|normal| unit(normal).unwrap_or(facet).to_array()));
    let material = mesh.material.as_ref().and_then(|of| of.get(index)).map(|of| *of as usize);
    let number = material.and_then(|of| *numbers.get(of)?);
    let places = mesh.texture.as_ref().and_then(|places| places.get(index));
    let usable = |places: &[[f32; 2]; 3]| places.as_flattened().iter().all(|turns| turns.abs() <= LARGEST_PLACE);
    let texture = number.zip(places.copied().filter(usable));
    let mut replaced = false;
    let mut color = |weights: DVec3| {
        // The colour that a texture is multiplied by.
        let diffuse = texture.and(mesh.material_of(index)).map(|material| material.diffuse);
        let given = diffuse.unwrap_or_else(|| mesh.color_at(index, weights));
        let sound = given.iter().all(|value| value.is_finite());
        let [r, g, b, alpha] = if sound { given } else { DEFAULT_COLOR };
        let within = alpha.clamp(0.0, 1.0);
        replaced |= !sound || within != alpha;
        // Adding +0 turns -0 into 0.
        [r * within, g * within, b * within, within].map(|value| value + 0.0)
    };
    let colors = [DVec3::X, DVec3::Y, DVec3::Z].map(&mut color);
    (Triangle { corners: corners.map(|corner| corner.to_array()), normals, colors, texture }, replaced)
}
