//! The surface that is sampled: the triangles of a mesh that have an area, and the mesh's
//! attributes at points of them.

use glam::DVec3;

use crate::error::{Error, Result};
use crate::io::Mesh;
use crate::scene::Bounds;
use crate::surfels::LARGEST_COORDINATE;

/// A triangle that has an area.
#[derive(Clone, Debug)]
pub struct Facet {
    /// The corners, relative to the surface's centre, world units.
    pub corners: [DVec3; 3],
    /// Unit normal.
    pub normal: DVec3,
    /// The area, square world units.
    pub area: f64,
    /// The index among the mesh's triangles.
    pub index: usize,
}

/// The triangles of a mesh that can be sampled.
pub struct MeshSurface<'a> {
    /// The mesh of the triangles.
    pub mesh: &'a Mesh,
    /// The point that all positions are relative to: the middle of the bounds, world coordinates.
    pub center: DVec3,
    /// The bounds of the triangles, relative to the centre.
    pub bounds: Bounds,
    /// The triangles that have an area.
    pub triangles: Vec<Facet>,
    /// Triangles left out because a coordinate is not finite or exceeds [`LARGEST_COORDINATE`].
    pub dropped_non_finite: u64,
    /// Triangles left out because they have no area.
    pub dropped_flat: u64,
}

impl<'a> MeshSurface<'a> {
    /// Collects the triangles of `mesh` that have an area.
    ///
    /// # Errors
    ///
    /// [`Error::EmptyScene`] if no triangle has an area, and the errors of [`Mesh::check`].
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

    /// The sum of the triangles' areas, square world units.
    pub fn area(&self) -> f64 {
        self.triangles.iter().map(|triangle| triangle.area).sum()
    }

    /// The position of a point, relative to the centre, world units.
    pub(super) fn point(&self, at: Place) -> DVec3 {
        let [a, b, c] = self.triangles[at.triangle as usize].corners;
        a * at.weights.x + b * at.weights.y + c * at.weights.z
    }

    /// The unit normal of a point: interpolated from the corners' normals, or the triangle's if
    /// these are missing or cancel.
    pub(super) fn normal(&self, at: Place) -> DVec3 {
        let facet = &self.triangles[at.triangle as usize];
        let unit = |n: [f32; 3]| DVec3::from(n.map(f64::from)).normalize_or_zero();
        let named = self.mesh.normals.as_ref().map(|normals| normals[facet.index].map(unit));
        let mean = named.map(|[a, b, c]| a * at.weights.x + b * at.weights.y + c * at.weights.z);
        mean.and_then(DVec3::try_normalize).unwrap_or(facet.normal)
    }

    /// The texture coordinates of a point, if the mesh has any.
    pub(super) fn texture(&self, at: Place) -> Option<[f32; 2]> {
        self.mesh.texture_at(self.triangles[at.triangle as usize].index, at.weights)
    }

    /// The index of a point's triangle among the mesh's triangles.
    pub(super) fn index(&self, at: Place) -> usize {
        self.triangles[at.triangle as usize].index
    }

    /// Returns the texture number of each of the mesh's triangles, [`u32::MAX`] for none; None if
    /// the mesh has no texture coordinates, or all triangles have the same texture.
    ///
    /// A triangle whose texture coordinates are not finite has none.
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

    /// Whether the mesh has colours of vertices, faces or materials.
    pub fn is_colored(&self) -> bool {
        self.mesh.colors.is_some() || self.mesh.face_colors.is_some() || self.mesh.material.is_some()
    }

    /// The colour of a point: linear RGB, straight alpha.
    pub(super) fn color(&self, at: Place) -> [f32; 4] {
        self.mesh.color_at(self.triangles[at.triangle as usize].index, at.weights)
    }
}

/// A point of the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Place {
    /// An index into [`MeshSurface::triangles`].
    pub triangle: u32,
    /// The weights of the triangle's corners; their sum is 1.
    pub weights: DVec3,
}
