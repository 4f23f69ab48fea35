//! Looks of the triangles of a mesh, beside the colours of its vertices.

use std::sync::Arc;

use super::{Mesh, Texture};
use crate::scene::color::DEFAULT_COLOR;

/// Colours and images of triangles.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Paint {
    /// The linear colour of each, straight alpha: its own, or its material's, with which its image
    /// is multiplied. Where a triangle has no image, the colours of its vertices hide it. None
    /// where no triangle has any.
    pub colors: Vec<[f32; 4]>,
    /// The images of the materials, each once.
    pub textures: Vec<Arc<Texture>>,
    /// Which of them each triangle has; [`u32::MAX`] means none. None where no triangle has any.
    pub numbers: Vec<u32>,
    /// The corners' texture coordinates, origin bottom left; not a number for triangles without.
    /// None where no triangle has any.
    pub places: Vec<[[f32; 2]; 3]>,
}

impl Paint {
    /// The paint of a mesh; None where its triangles have nothing but what its vertices have.
    pub fn of(mesh: &Mesh) -> Option<Self> {
        let has_colors = mesh.face_colors.is_some() || mesh.material.is_some();
        let places = mesh.texture.clone().unwrap_or_default();
        let (textures, numbers) = if places.is_empty() { Default::default() } else { mesh.textures() };
        let is_painted = numbers.iter().any(Option::is_some);
        let color = |triangle: usize| match mesh.material_of(triangle).filter(|of| of.texture.is_some()) {
            Some(material) if !places.is_empty() => material.diffuse,
            _ => mesh.own_color(triangle).unwrap_or(DEFAULT_COLOR),
        };
        let colors = (0..mesh.triangles.len()).filter(|_| has_colors).map(color).collect();
        let number = |(number, places): (Option<u32>, &[[f32; 2]; 3])| {
            let is_placed = places.as_flattened().iter().all(|turns| turns.is_finite());
            number.filter(|_| is_placed).unwrap_or(u32::MAX)
        };
        let numbers = numbers.into_iter().zip(&places).filter(|_| is_painted).map(number).collect();
        let paint = Self { colors, textures, numbers, places };
        (paint != Self::default()).then_some(paint)
    }

    /// The number of a triangle's image, if it has one.
    pub fn number(&self, triangle: usize) -> Option<u32> {
        self.numbers.get(triangle).copied().filter(|number| *number != u32::MAX)
    }

    /// Whether triangles are painted with images.
    pub fn has_images(&self) -> bool {
        self.numbers.iter().any(|number| *number != u32::MAX)
    }
}
