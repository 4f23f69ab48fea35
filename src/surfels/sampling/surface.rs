//! The surface that is sampled: the triangles of a mesh that have an area, and what the mesh says at a point of them.

use glam::DVec3;

use crate::error::{Error, Result};
use crate::io::Mesh;
use crate::scene::Bounds;
use crate::surfels::LARGEST_COORDINATE;

/// A triangle that has an area.
#[derive(Clone, Debug)]
pub struct Facet {
    /// Relative to the surface's centre, world units.
    pub corners: [DVec3; 3],
    /// Unit.
    pub normal: DVec3,
    /// Square world units.
    pub area: f64,
    /// Which of the mesh's triangles.
    pub index: usize,
}

/// The triangles of a mesh that can be sampled.
pub struct MeshSurface<'a> {
    /// Where they are from.
    pub mesh: &'a Mesh,
    /// World coordinates of the point that all others are relative to.
    pub center: DVec3,
    /// Of the triangles, relative to the centre.
    pub bounds: Bounds,
    /// The triangles.
    pub triangles: Vec<Facet>,
    /// Triangles left out because a coordinate is not finite or exceeds [`LARGEST_COORDINATE`].
    pub dropped_non_finite: u64,
    /// Triangles left out because they have no area.
    pub dropped_flat: u64,
}

impl<'a> MeshSurface<'a> {
    /// The triangles of `mesh` that have an area.
    ///
    /// # Errors
    ///
    /// [`Error::EmptyScene`] if there is none, and what [`Mesh::check`] fails with.
    pub fn new(mesh: &'a Mesh) -> Result<Self> {
        mesh.check()?;
        let corner = |vertex: &u32| DVec3::from(mesh.positions[*vertex as usize]);
        let finite = |corners: &[DVec3; 3]| {
            corners.iter().all(|corner| corner.abs().cmple(DVec3::splat(LARGEST_COORDINATE)).all())
        };
        let all = mesh.triangles.iter().enumerate().map(|(index, vertices)| (index, vertices.each_ref().map(corner)));
        let within = all.clone().filter(|(_, corners)| finite(corners));
        let bounds = within
            .clone()
            .flat_map(|(_, corners)| corners)
            .fold(Bounds::EMPTY, |bounds, corner| bounds.with_point(corner));
        let center = bounds.center();
        let triangles: Vec<Facet> = within
            .clone()
            .filter_map(|(index, corners)| {
                let [a, b, c] = corners.map(|corner| corner - center);
                let double = (b - a).cross(c - a);
                let normal = double.try_normalize()?;
                Some(Facet { corners: [a, b, c], normal, area: 0.5 * double.length(), index })
            })
            .collect();
        let usable = within.count();
        if triangles.is_empty() {
            return Err(Error::EmptyScene(match mesh.triangles.len() {
                0 => "the mesh has no triangles, so there is nothing to sample".to_owned(),
                count => format!("none of the mesh's {count} triangles has an area, so there is nothing to sample"),
            }));
        }
        let bounds = Bounds { min: bounds.min - center, max: bounds.max - center };
        let dropped_non_finite = (mesh.triangles.len() - usable) as u64;
        let dropped_flat = (usable - triangles.len()) as u64;
        Ok(Self { mesh, center, bounds, triangles, dropped_non_finite, dropped_flat })
    }

    /// Square world units.
    pub fn area(&self) -> f64 {
        self.triangles.iter().map(|triangle| triangle.area).sum()
    }

    /// The point with these corner weights, relative to the centre.
    pub(super) fn point(&self, at: Place) -> DVec3 {
        let [a, b, c] = self.triangles[at.triangle as usize].corners;
        a * at.weights.x + b * at.weights.y + c * at.weights.z
    }

    /// The unit normal there: that of the corners, interpolated, or, where they are missing or cancel, the triangle's.
    pub(super) fn normal(&self, at: Place) -> DVec3 {
        let facet = &self.triangles[at.triangle as usize];
        let unit = |n: [f32; 3]| DVec3::from(n.map(f64::from)).normalize_or_zero();
        let named = self.mesh.normals.as_ref().map(|normals| normals[facet.index].map(unit));
        let mean = named.map(|[a, b, c]| a * at.weights.x + b * at.weights.y + c * at.weights.z);
        mean.and_then(DVec3::try_normalize).unwrap_or(facet.normal)
    }

    /// Texture coordinates there, if the mesh has any.
    pub(super) fn texture(&self, at: Place) -> Option<[f32; 2]> {
        self.mesh.texture_at(self.triangles[at.triangle as usize].index, at.weights)
    }

    /// Which of the mesh's triangles a point is on.
    pub(super) fn index(&self, at: Place) -> usize {
        self.triangles[at.triangle as usize].index
    }

    /// The number of each of the mesh's triangles' texture, if there are several, or some triangles
    /// have none or no place in it; [`u32::MAX`] means none.
    pub(super) fn texture_numbers(&self) -> Option<Vec<u32>> {
        let places = self.mesh.texture.as_ref()?;
        let (textures, numbers) = self.mesh.textures();
        let otherwise = if textures.is_empty() { 0 } else { u32::MAX };
        let number = |(number, places): (Option<u32>, &[[f32; 2]; 3])| {
            let is_placed = places.as_flattened().iter().all(|turns| turns.is_finite());
            if is_placed { number.unwrap_or(otherwise) } else { u32::MAX }
        };
        let numbers: Vec<u32> = numbers.into_iter().zip(places).map(number).collect();
        (textures.len() > 1 || numbers.iter().any(|number| *number != 0)).then_some(numbers)
    }

    /// Whether the mesh says anything of colours.
    pub fn is_colored(&self) -> bool {
        self.mesh.colors.is_some() || self.mesh.face_colors.is_some() || self.mesh.material.is_some()
    }

    /// The colour there: linear RGB, straight alpha.
    pub(super) fn color(&self, at: Place) -> [f32; 4] {
        self.mesh.color_at(self.triangles[at.triangle as usize].index, at.weights)
    }
}

/// A point of the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Place {
    /// Which of [`MeshSurface::triangles`].
    pub triangle: u32,
    /// Of its corners; their sum is 1.
    pub weights: DVec3,
}
