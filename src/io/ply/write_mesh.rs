//! Writes triangles as PLY, as MeshLab does: texture coordinates in faces, images in comments.

use std::collections::HashMap;
use std::io::Write;
use std::path::Path;

use glam::DVec3;

use super::write::{Color, ColorProperties, Properties, Vertex};
use crate::Result;
use crate::io::Mesh;
use crate::io::atomic::write_whole;
use crate::progress::Progress;

/// The bits of position, normal and colour of a corner. Corners with equal keys share a vertex.
type Key = ([u64; 3], [u32; 3], [u32; 4]);

/// Writes the triangles of `mesh` so that [`read_mesh`](super::read_mesh) returns them.
///
/// Normals are written too, and colours in linear light, including those of materials. The arrays
/// of the mesh must be consistent ([`Mesh::check`]).
///
/// `images` are names of files beside the written one, one for each material that has an image, in
/// the order of materials. Each must hold the image times the diffuse colour
/// ([`Material::painted`](crate::io::Material)). A comment marks the file for
/// [`textures_of_hybrid`](super::textures_of_hybrid).
///
/// # Errors
///
/// [`Error::Write`](crate::Error::Write) if the system cannot write.
pub fn write_mesh(path: &Path, mesh: &Mesh, images: &[String], progress: &dyn Progress) -> Result<()> {
    progress.begin("writing triangles", 0);
    // The index of each material's image.
    let mut image = 0;
    let numbers: Vec<Option<i32>> = mesh
        .materials
        .iter()
        .map(|material| {
            image += i32::from(material.texture.is_some());
            material.texture.as_ref().map(|_| image - 1)
        })
        .collect();
    let number = |triangle: usize| {
        let material = mesh.material.as_ref().and_then(|all| all.get(triangle));
        material
            .and_then(|&material| *numbers.get(material as usize)?)
            .filter(|_| mesh.texture_at(triangle, DVec3::X).is_some())
    };
    let colored = mesh.colors.is_some() || mesh.face_colors.is_some() || mesh.material.is_some();
    let (vertices, corners) = vertices(mesh, colored, |triangle| number(triangle).is_some());
    let properties = Properties {
        double_coordinates: mesh.positions.iter().flatten().any(|c| f64::from(*c as f32) != *c && !c.is_nan()),
        normals: mesh.normals.is_some(),
        colors: if colored { ColorProperties::Linear } else { ColorProperties::Absent },
        up: mesh.up,
        ..Properties::default()
    };
    let painted = mesh.texture.is_some();
    let textures = images.iter().map(|image| format!("TextureFile {image}"));
    let comments: Vec<String> = ["hybrid".to_owned()].into_iter().chain(textures).collect();
    let written = write_whole(path, |out| {
        properties.write_header(out, vertices.len() as u64, &comments)?;
        write!(out, "element face {}\nproperty list uchar uint vertex_indices\n", corners.len())?;
        if painted {
            write!(out, "property list uchar float texcoord\nproperty int texnumber\n")?;
        }
        out.write_all(b"end_header\n")?;
        let mut row = Vec::with_capacity(96);
        for vertex in &vertices {
            row.clear();
            properties.encode(vertex, &mut row);
            out.write_all(&row)?;
        }
        for (triangle, corners) in corners.iter().enumerate() {
            row.clear();
            row.push(3);
            corners.iter().for_each(|corner| row.extend(corner.to_le_bytes()));
            if let Some(places) = mesh.texture.as_ref().and_then(|all| all.get(triangle)) {
                row.push(6);
                places.as_flattened().iter().for_each(|value| row.extend(value.to_le_bytes()));
                // An index past the last image means none.
                row.extend(number(triangle).unwrap_or(images.len() as i32).to_le_bytes());
            }
            out.write_all(&row)?;
        }
        Ok(())
    });
    progress.end();
    written
}

/// The vertices, and the vertex indices of each triangle. Corners under an image are white.
fn vertices(mesh: &Mesh, colored: bool, has_image: impl Fn(usize) -> bool) -> (Vec<Vertex>, Vec<[u32; 3]>) {
    let (mut known, mut all): (HashMap<Key, u32>, Vec<Vertex>) = (HashMap::new(), Vec::new());
    let mut corner = |triangle: usize, k: usize| {
        let position = mesh.positions[mesh.triangles[triangle][k] as usize];
        let normal = mesh.normals.as_ref().map_or([0.0; 3], |normals| normals[triangle][k]);
        let weights = DVec3::AXES[k];
        let color = match (colored, has_image(triangle)) {
            (false, _) => [0.0; 4],
            (true, true) => [1.0; 4],
            (true, false) => mesh.color_at(triangle, weights),
        };
        let key = (position.map(f64::to_bits), normal.map(f32::to_bits), color.map(f32::to_bits));
        *known.entry(key).or_insert_with(|| {
            all.push(Vertex { position, normal, color: Some(Color::Linear(color)), ..Vertex::default() });
            all.len() as u32 - 1
        })
    };
    let corners = (0..mesh.triangles.len()).map(|triangle| [0, 1, 2].map(|k| corner(triangle, k))).collect();
    (all, corners)
}
