//! Colours and images of the triangles of a mesh, beside the colours of its vertices.

use std::sync::Arc;

use super::{Mesh, Texture};
use crate::scene::color::DEFAULT_COLOR;

/// Colours and images per triangle.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Paint {
    /// Linear colours with straight alpha, per triangle: its own colour, or its material's.
    ///
    /// If a triangle has an image, the image is multiplied by this colour. If it has none, colours
    /// of the vertices take precedence over this colour. Empty if no triangle has a colour.
    pub colors: Vec<[f32; 4]>,
    /// The distinct images of the materials.
    pub textures: Vec<Arc<Texture>>,
    /// Per triangle an index into `textures`; [`u32::MAX`] means none. Empty if no triangle has an
    /// image.
    pub numbers: Vec<u32>,
    /// Texture coordinates per corner of each triangle, origin bottom left; NaN for triangles
    /// without any. Empty if no triangle has any.
    pub places: Vec<[[f32; 2]; 3]>,
}

impl Paint {
    /// The paint of a mesh; None if its triangles have no colours, images or texture coordinates.
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

    /// The index of a triangle's image; None without an image.
    pub fn number(&self, triangle: usize) -> Option<u32> {
        self.numbers.get(triangle).copied().filter(|number| *number != u32::MAX)
    }

    /// Whether any triangle has an image.
    pub fn has_images(&self) -> bool {
        self.numbers.iter().any(|number| *number != u32::MAX)
    }
}
