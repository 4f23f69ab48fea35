//! A mesh from the points and faces that a file was read as.

use std::collections::HashMap;
use std::sync::Arc;

use super::{Material, Mesh};
use crate::io::points::Faces;
use crate::io::{Paint, Points, Texture};
use crate::scene::color::DEFAULT_COLOR;

impl Points {
    /// Whether these are the vertices of a mesh that may be drawn as its triangles: at least half
    /// of them have one, and none has a radius of its own, as the points of a cloud have.
    pub fn is_mesh(&self) -> bool {
        let Some(faces) = self.faces.as_ref().filter(|_| self.of_mesh) else { return false };
        let mut is_named = vec![false; self.positions.len()];
        faces.triangles.as_flattened().iter().for_each(|vertex| is_named[*vertex as usize] = true);
        2 * is_named.iter().filter(|named| **named).count() >= is_named.len()
    }
}

impl Mesh {
    /// Returns the triangles of `points` with all that the file says about them; no triangles if
    /// there are no faces.
    pub fn of_points(points: Points) -> Self {
        let points = points.in_light();
        let Faces { triangles, normals, paint } = points.faces.unwrap_or_default();
        let places = |of: &Vec<[f32; 2]>| triangles.iter().map(|corners| corners.map(|k| of[k as usize])).collect();
        let mut mesh = Self {
            texture: points.texture.as_ref().map(places),
            positions: points.positions,
            triangles,
            normals,
            colors: points.colors,
            up: points.up,
            notes: points.notes,
            ..Self::default()
        };
        if let Some(paint) = paint {
            mesh.take(*paint);
        }
        let mut is_named = vec![false; mesh.positions.len()];
        mesh.triangles.as_flattened().iter().for_each(|vertex| is_named[*vertex as usize] = true);
        let loose = is_named.iter().filter(|named| !**named).count();
        if loose > 0 {
            mesh.notes.push(format!("{loose} vertices of no triangle were left out"));
        }
        mesh
    }

    /// Gives the triangles their colours and images. Each pair of an image and a colour becomes a
    /// material.
    fn take(&mut self, paint: Paint) {
        let color = |triangle: usize| paint.colors.get(triangle).copied().unwrap_or(DEFAULT_COLOR);
        let mut known: HashMap<(u32, [u32; 4]), u32> = HashMap::new();
        let mut materials = Vec::new();
        let mut material = |triangle: usize| {
            let Some(number) = paint.number(triangle) else { return u32::MAX };
            // Without a colour of its own an image shows as it is.
            let diffuse = if paint.colors.is_empty() { [1.0; 4] } else { color(triangle) };
            *known.entry((number, diffuse.map(f32::to_bits))).or_insert_with(|| {
                let texture: Option<Arc<Texture>> = paint.textures.get(number as usize).cloned();
                materials.push(Material { name: String::new(), diffuse, texture, image: None });
                materials.len() as u32 - 1
            })
        };
        if paint.has_images() {
            self.material = Some((0..self.triangles.len()).map(&mut material).collect());
        }
        self.materials = materials;
        if !paint.colors.is_empty() {
            self.face_colors = Some((0..self.triangles.len()).map(color).collect());
        }
        if !paint.places.is_empty() {
            self.texture = Some(paint.places);
        }
    }
}
