//! A triangle mesh as its file gives it.

mod of_points;

use std::path::PathBuf;
use std::sync::Arc;

use glam::{DVec2, DVec3};

use super::Texture;
use super::points::retain_colors;
use super::textures::Numbers;
use crate::error::{Error, Result};
use crate::scene::color::{DEFAULT_COLOR, mean_color};
use crate::scene::{Colors, Up};

/// A triangle mesh as a file gives it: f64 world coordinates and whatever attributes exist.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// World coordinates of the vertices.
    pub positions: Vec<[f64; 3]>,
    /// The vertices of each triangle as indices into `positions`, counter-clockwise seen from
    /// outside.
    pub triangles: Vec<[u32; 3]>,
    /// A normal per corner of each triangle, any length; zero or non-finite means missing. If None,
    /// the mesh is faceted: a triangle (a, b, c) has the normal `(b - a) x (c - a)`.
    pub normals: Option<Vec<[[f32; 3]; 3]>>,
    /// A colour per vertex.
    pub colors: Option<Colors>,
    /// A linear colour with straight alpha per triangle, where vertices have none.
    pub face_colors: Option<Vec<[f32; 4]>>,
    /// Texture coordinates (u, v) per corner of each triangle, origin bottom left; NaN for
    /// triangles without any.
    pub texture: Option<Vec<[[f32; 2]; 3]>>,
    /// The materials that triangles refer to.
    pub materials: Vec<Material>,
    /// Per triangle an index into `materials`; an index past the end means no material.
    pub material: Option<Vec<u32>>,
    /// The up direction of the format's convention.
    pub up: Option<Up>,
    /// Parts of the mesh that could not be read: one sentence each.
    pub notes: Vec<String>,
}

/// The material of a triangle.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// The name in the file.
    pub name: String,
    /// Diffuse reflectivity: linear RGB with straight alpha.
    pub diffuse: [f32; 4],
    /// The image that is multiplied by `diffuse`.
    pub texture: Option<Arc<Texture>>,
    /// The path of the image.
    pub image: Option<PathBuf>,
}

impl Material {
    /// Whether texture coordinates outside [0, 1] take the edge texels instead of repeating the
    /// image.
    pub fn clamps(&self) -> bool {
        self.texture.as_ref().is_some_and(|texture| texture.clamps())
    }

    /// The image times the diffuse colour, as 8-bit codes; None if there is no image.
    pub fn painted(&self) -> Option<Arc<Texture>> {
        let texture = self.texture.as_ref()?;
        let plain = self.diffuse == [1.0; 4];
        Some(if plain { texture.clone() } else { Arc::new(texture.times(self.diffuse)) })
    }
}

impl Mesh {
    /// Checks that indices are valid and arrays have the right lengths.
    ///
    /// # Errors
    ///
    /// [`Error::Usage`] if a triangle uses a vertex that does not exist, if an array per vertex or
    /// per triangle has another length, or if there are 2^32 triangles or more.
    pub fn check(&self) -> Result<()> {
        let (vertices, triangles) = (self.positions.len(), self.triangles.len());
        let named = self.triangles.as_flattened().iter().all(|&vertex| (vertex as usize) < vertices);
        let colored = match &self.colors {
            Some(Colors::Srgb8(colors)) => colors.len() == vertices,
            Some(Colors::Linear(colors)) => colors.len() == vertices,
            Some(Colors::Textured(textured)) => textured.colors().len() == vertices,
            Some(Colors::Harmonics(harmonics)) => harmonics.colors().len() == vertices,
            Some(Colors::Constant(_)) | None => true,
        };
        let lengths = [
            self.normals.as_ref().map(Vec::len),
            self.face_colors.as_ref().map(Vec::len),
            self.texture.as_ref().map(Vec::len),
            self.material.as_ref().map(Vec::len),
        ];
        let each = lengths.into_iter().flatten().all(|length| length == triangles);
        if named && colored && each && u32::try_from(triangles).is_ok() {
            return Ok(());
        }
        Err(Error::Usage(
            "a mesh must have fewer than 2^32 triangles of existing vertices, as many colours as vertices, and as many \
             normals, texture coordinates and materials as triangles"
                .into(),
        ))
    }

    /// Returns the triangles whose flag is set, with only the vertices and materials that they use.
    #[must_use]
    pub fn part(&self, keep: &[bool]) -> Self {
        fn kept<T: Copy>(all: &[T], keep: &[bool]) -> Vec<T> {
            all.iter().zip(keep).filter(|(_, keep)| **keep).map(|(value, _)| *value).collect()
        }
        let mut triangles = kept(&self.triangles, keep);
        let mut is_named = vec![false; self.positions.len()];
        triangles.as_flattened().iter().for_each(|&vertex| is_named[vertex as usize] = true);
        let mut number = 0;
        let numbers: Vec<u32> = is_named
            .iter()
            .map(|named| {
                number += u32::from(*named);
                number.wrapping_sub(1)
            })
            .collect();
        triangles.as_flattened_mut().iter_mut().for_each(|vertex| *vertex = numbers[*vertex as usize]);
        let colors = self.colors.clone().map(|mut colors| {
            retain_colors(&mut colors, &is_named);
            colors
        });
        let mut material = self.material.as_ref().map(|all| kept(all, keep));
        let mut is_used = vec![false; self.materials.len()];
        material
            .iter()
            .flatten()
            .for_each(|&of| is_used.get_mut(of as usize).into_iter().for_each(|used| *used = true));
        let mut used = 0;
        let before: Vec<u32> = is_used
            .iter()
            .map(|is_used| {
                used += u32::from(*is_used);
                used - u32::from(*is_used)
            })
            .collect();
        material.iter_mut().flatten().for_each(|of| *of = before.get(*of as usize).copied().unwrap_or(used));
        let materials = self.materials.iter().zip(&is_used).filter(|(_, used)| **used).map(|(of, _)| of.clone());
        Self {
            materials: materials.collect(),
            material,
            positions: kept(&self.positions, &is_named),
            triangles,
            normals: self.normals.as_ref().map(|all| kept(all, keep)),
            colors,
            face_colors: self.face_colors.as_ref().map(|all| kept(all, keep)),
            texture: self.texture.as_ref().map(|all| kept(all, keep)),
            up: self.up,
            notes: Vec::new(),
        }
    }

    /// Gives every triangle one white material with this texture.
    pub fn paint(&mut self, texture: Texture) {
        let name = "texture".to_owned();
        self.materials = vec![Material { name, diffuse: [1.0; 4], texture: Some(Arc::new(texture)), image: None }];
        self.material = Some(vec![0; self.triangles.len()]);
    }

    /// Returns the distinct textures of the triangles, and for each triangle the index of its
    /// texture.
    pub fn textures(&self) -> (Vec<Arc<Texture>>, Vec<Option<u32>>) {
        let mut textures = Numbers::default();
        let number = |material: &Material| material.texture.as_ref().map(|texture| textures.of(texture));
        let of_material: Vec<Option<u32>> = self.materials.iter().map(number).collect();
        let material = |triangle: usize| self.material.as_ref()?.get(triangle).copied();
        let of_triangle = |triangle: usize| *of_material.get(material(triangle)? as usize)?;
        let numbers = (0..self.triangles.len()).map(of_triangle).collect();
        (textures.all, numbers)
    }

    /// Texture coordinates on a triangle at the point with these barycentric weights, which add up
    /// to 1; None if the triangle has none.
    pub fn texture_at(&self, triangle: usize, weights: DVec3) -> Option<[f32; 2]> {
        let [a, b, c] = self.texture.as_ref()?.get(triangle)?.map(|[u, v]| DVec2::new(u.into(), v.into()));
        let place = (a * weights.x + b * weights.y + c * weights.z).as_vec2();
        place.is_finite().then(|| place.to_array())
    }

    /// The colour on a triangle at the point with these barycentric weights: linear RGB, straight
    /// alpha.
    ///
    /// The first of these that exists: the texture times its material's diffuse colour, the
    /// interpolated colours of the vertices, the triangle's own colour, the diffuse colour, the
    /// default colour.
    pub fn color_at(&self, triangle: usize, weights: DVec3) -> [f32; 4] {
        if let (Some(material), Some(texel)) = (self.material_of(triangle), self.image_at(triangle, weights)) {
            return std::array::from_fn(|k| texel[k] * material.diffuse[k]);
        }
        match &self.colors {
            Some(colors) => {
                let corners = self.triangles[triangle].map(|vertex| colors.linear(vertex as usize));
                mean_color(corners.into_iter().zip(weights.to_array()))
            }
            None => self.own_color(triangle).unwrap_or(DEFAULT_COLOR),
        }
    }

    /// The colour of a triangle's image at the point with these barycentric weights: linear RGB,
    /// straight alpha; None without an image.
    pub(crate) fn image_at(&self, triangle: usize, weights: DVec3) -> Option<[f32; 4]> {
        let texture = self.material_of(triangle)?.texture.as_ref()?;
        self.texture_at(triangle, weights).map(|[u, v]| texture.at(u, v))
    }

    /// The colour of a triangle, or else the diffuse colour of its material; None without either.
    pub fn own_color(&self, triangle: usize) -> Option<[f32; 4]> {
        let own = self.face_colors.as_ref().and_then(|all| all.get(triangle)).copied();
        own.or_else(|| self.material_of(triangle).map(|material| material.diffuse))
    }

    /// The material of the triangle with this index.
    pub fn material_of(&self, triangle: usize) -> Option<&Material> {
        self.materials.get(*self.material.as_ref()?.get(triangle)? as usize)
    }
}
