//! Wavefront OBJ: the vertices of a mesh as points, with normals and radii from its faces; or its triangles as they are.

mod encoding;
mod faces;
mod lines;
mod material;

use crate::io::closed::is_closed;
use crate::io::fault::{self, Fault};
use crate::io::points::Faces;
use crate::io::triangles::Triangles;
use crate::io::{Input, Mesh, Points, Up};
use crate::{Progress, Result};
use lines::Lines;
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

/// Reads the vertices of an OBJ file, one point for each `v` line and in their order, whatever groups and materials
/// the faces are in.
///
/// - Normals: the mean of the `vn` that a vertex's face corners name, where every corner of the file names one; else
///   the mean of its faces' normals, weighted by area. A vertex of no face has none (zero). A file without faces but
///   with one `vn` for each `v` pairs them.
/// - Radii: 1.1 times the smallest with which disks at a triangle's corners cover it, the largest over the vertex's
///   triangles; polygons are made of triangles; a vertex of no triangle has none (zero).
/// - Colours: the three numbers after a vertex's coordinates, sRGB-coded in [0, 1], or where any is 2 or more in [0, 255], become
///   linear light; a fourth is alpha.
///
/// Text may be in UTF-16, of either byte order, if a byte order mark says so. Up is y. Lines, points, curves and materials are passed over, so a missing MTL file is no error.
///
/// # Errors
///
/// [`Error::Read`](crate::Error::Read) where the system cannot read, [`Error::Malformed`](crate::Error::Malformed) where
/// a number is none or a face names a vertex or normal that does not exist; where a file has no normal at all, none is missed.
pub fn read(input: Input, progress: &dyn Progress) -> Result<Points> {
    read_with(input, false, progress, points)
}

/// Reads the triangles of an OBJ file, those of all groups and materials as one mesh, with every `v` line a vertex.
///
/// Polygons are made of triangles, concave ones too. Corners have the `vn` they name where every corner of the file names one, else the
/// mesh is faceted; and so with `vt`. Colours are read as by [`read`], and lines, points and curves are passed over too. A
/// file without faces is a mesh without triangles, and no error here.
///
/// Of the materials in the MTL files beside it the diffuse colour `Kd` (linear light), the opacity `d` and the image
/// `map_Kd` (PNG or JPEG, sRGB) are read. Files that cannot be read are left out and named in [`Mesh::notes`].
///
/// # Errors
///
/// As [`read`], and where a face names texture coordinates that do not exist, in a file that has some.
pub fn read_mesh(input: Input, progress: &dyn Progress) -> Result<Mesh> {
    let path = input.path.clone();
    let (mut mesh, libraries, names) = read_with(input, true, progress, mesh)?;
    mesh.materials = material::read(&path, &libraries, &names, &mut mesh.notes);
    Ok(mesh)
}

/// The libraries that an OBJ file at `path` names, and the images that these name.
pub(super) fn companions(file: &mut File, path: &Path) -> Vec<PathBuf> {
    let length = file.metadata().map_or(0, |there| there.len());
    let named = file.try_clone().and_then(|file| encoding::decoded(BufReader::with_capacity(1 << 18, file), length));
    named.map_or(Vec::new(), |(reader, _)| material::companions(path, &Lines::libraries(reader)))
}

/// Opens the file and makes of its lines and faces what is asked for.
fn read_with<T>(input: Input, surface: bool, progress: &dyn Progress, make: impl Fn(Lines) -> T) -> Result<T> {
    let Input { file, length, path, .. } = input;
    let in_file = |fault: Fault| fault.of(&path);
    let (reader, length) =
        encoding::decoded(BufReader::with_capacity(1 << 18, file), length).map_err(Fault::Io).map_err(in_file)?;
    progress.begin(&format!("reading {}", fault::name(&path)), length);
    let made = Lines::read(reader, surface, progress).map(make);
    progress.end();
    made.map_err(in_file)
}

fn points(lines: Lines) -> Points {
    let colors = lines.colors();
    let mut around = Triangles::new(&lines.positions);
    let (mut triangles, mut named) = (Vec::new(), Vec::new());
    for triangle in lines.triangles() {
        triangles.push(triangle.vertices);
        named.extend(triangle.normals.map(|named| named.map(|normal| normal.map(|c| c as f32))));
        around.add(triangle.vertices.map(|vertex| vertex as usize), triangle.normals.map(|all| all.map(Some)));
    }
    let has_faces = !lines.faces.is_empty();
    let face_as_named = around.face_as_named();
    let (face_normals, radii) = around.finish();
    let paired = || lines.normals.iter().map(|normal| normal.map(|c| c as f32)).collect::<Vec<_>>();
    let normals = match has_faces {
        true => Some(face_normals),
        false => (!lines.normals.is_empty() && lines.normals.len() == lines.positions.len()).then(paired),
    };
    Points {
        normals,
        radii: has_faces.then_some(radii),
        of_mesh: has_faces,
        closed: face_as_named && is_closed(&lines.positions, &triangles),
        colors,
        up: Some(Up::Y),
        faces: has_faces.then(|| {
            let all = named.len() == triangles.len();
            Faces { triangles, normals: all.then_some(named) }
        }),
        positions: lines.positions,
        ..Points::default()
    }
}

/// The mesh without its materials, the libraries they are in, and their names.
fn mesh(lines: Lines) -> (Mesh, Vec<String>, Vec<String>) {
    let (mut vertices, mut normals) = (Vec::new(), Vec::new());
    let (mut texture, mut material) = (Vec::new(), Vec::new());
    for triangle in lines.triangles() {
        vertices.push(triangle.vertices);
        normals.extend(triangle.normals.map(|named| named.map(|normal| normal.map(|c| c as f32))));
        texture.extend(triangle.texture);
        material.push(triangle.material);
    }
    let mesh = Mesh {
        normals: (!normals.is_empty()).then_some(normals),
        texture: (lines.faces.have_texture() && !texture.is_empty()).then_some(texture),
        material: (!lines.materials.is_empty()).then_some(material),
        colors: lines.colors(),
        triangles: vertices,
        positions: lines.positions,
        up: Some(Up::Y),
        ..Mesh::default()
    };
    (mesh, lines.libraries, lines.materials)
}
