//! Wavefront OBJ: the vertices of a mesh as points, with normals and radii from its faces; or its triangles as they are.

mod encoding;
mod material;
mod source;

pub(super) use material::companions;

use crate::io::fault::{self, Fault};
use crate::io::triangles::Triangles;
use crate::io::{Input, Mesh, Points, Up, polygon};
use crate::{Progress, Result};
use glam::DVec3;
use source::{Lines, Source};
use std::io::{self, BufReader};

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
/// a number is none or a face names a vertex or normal that does not exist.
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
/// As [`read`], and where a face names texture coordinates that do not exist.
pub fn read_mesh(input: Input, progress: &dyn Progress) -> Result<Mesh> {
    let path = input.path.clone();
    let (mut mesh, libraries, names) = read_with(input, true, progress, mesh)?;
    mesh.materials = material::read(&path, &libraries, &names, &mut mesh.notes);
    Ok(mesh)
}

/// Opens the file and makes of its lines and faces what is asked for.
fn read_with<T>(
    input: Input,
    surface: bool,
    progress: &dyn Progress,
    make: impl Fn(Lines, &[tobj::Model]) -> T,
) -> Result<T> {
    let Input { file, length, path, .. } = input;
    let in_file = |fault: Fault| fault.of(&path);
    let (reader, length) =
        encoding::decoded(BufReader::with_capacity(1 << 18, file), length).map_err(Fault::Io).map_err(in_file)?;
    progress.begin(&format!("reading {}", fault::name(&path)), length);
    let parsed = parse(Source::new(reader, surface, progress));
    let made = parsed.map(|(lines, models)| make(lines, &models));
    progress.end();
    made.map_err(in_file)
}

fn parse<R: io::BufRead>(mut source: Source<'_, R>) -> Result<(Lines, Vec<tobj::Model>), Fault> {
    let options = tobj::LoadOptions { ignore_points: true, ignore_lines: true, ..tobj::LoadOptions::default() };
    // Read line by line: where the parser stops, the source's line is the one it stopped at.
    let loaded =
        tobj::load_obj_buf(&mut BufReader::new(&mut source), &options, |_| Err(tobj::LoadError::OpenFileFailed));
    let lines = source.finish()?;
    let (models, _) = loaded.map_err(|error| {
        Fault::Malformed(match error {
            tobj::LoadError::FaceVertexOutOfBounds => "a face names a vertex that does not exist".into(),
            tobj::LoadError::FaceTexCoordOutOfBounds => "a face names texture coordinates that do not exist".into(),
            tobj::LoadError::FaceNormalOutOfBounds => "a face names a normal that does not exist".into(),
            other => format!("line {}: {other}", lines.count),
        })
    })?;
    Ok((lines, models))
}

/// A triangle of a face.
struct Triangle<'a> {
    /// The numbers of its vertices in the file.
    vertices: [usize; 3],
    /// The normals that its corners name, if every corner of the file names one.
    normals: Option<[Option<[f64; 3]>; 3]>,
    /// The group that it is in, and its corners' places there.
    model: &'a tobj::Model,
    corners: [usize; 3],
}

/// The triangles of all faces.
fn triangles<'a>(lines: &'a Lines, models: &'a [tobj::Model]) -> impl Iterator<Item = Triangle<'a>> {
    models.iter().flat_map(move |model| {
        let mesh = &model.mesh;
        let vertex = move |corner: usize| {
            let number = mesh.indices.get(corner).and_then(|&index| mesh.positions.get(3 * index as usize));
            number.map_or(usize::MAX, |number| *number as usize)
        };
        let normal = move |corner: usize| {
            let index = *mesh.normal_indices.get(corner)?;
            mesh.normals.get(3 * index as usize..)?.first_chunk().copied()
        };
        // Where all faces are triangles, the parser says so by no numbers of corners.
        let all_triangles = mesh.face_arities.is_empty().then(|| std::iter::repeat_n(3, mesh.indices.len() / 3));
        let arities = mesh.face_arities.iter().map(|&corners| corners as usize);
        let mut next = 0;
        let first_and_count = arities.chain(all_triangles.into_iter().flatten()).map(move |count| {
            next += count;
            (next - count, count)
        });
        let polygon = move |(first, count): (usize, usize)| {
            let position = |corner| lines.positions.get(vertex(corner)).map_or(DVec3::NAN, |&at| at.into());
            let of_polygon = match count {
                3 => vec![[0, 1, 2]],
                _ => polygon::triangles(&(first..first + count).map(position).collect::<Vec<_>>()),
            };
            of_polygon.into_iter().map(move |corners| corners.map(|corner| first + corner))
        };
        first_and_count.flat_map(polygon).map(move |corners| Triangle {
            vertices: corners.map(vertex),
            normals: lines.every_corner_has_a_normal.then(|| corners.map(normal)),
            model,
            corners,
        })
    })
}

fn points(lines: Lines, models: &[tobj::Model]) -> Points {
    let colors = lines.colors();
    let mut around = Triangles::new(&lines.positions);
    for triangle in triangles(&lines, models) {
        around.add(triangle.vertices, triangle.normals);
    }
    let has_faces = models.iter().any(|model| !model.mesh.indices.is_empty());
    let (face_normals, radii) = around.finish();
    let normals = if has_faces {
        Some(face_normals)
    } else {
        Some(lines.normals).filter(|normals| !normals.is_empty() && normals.len() == lines.positions.len())
    };
    Points {
        positions: lines.positions,
        normals,
        radii: has_faces.then_some(radii),
        of_mesh: has_faces,
        colors,
        up: Some(Up::Y),
        ..Points::default()
    }
}

/// The mesh without its materials, the libraries they are in, and their names.
fn mesh(lines: Lines, models: &[tobj::Model]) -> (Mesh, Vec<String>, Vec<String>) {
    let (mut vertices, mut normals) = (Vec::new(), Vec::new());
    let (mut texture, mut material) = (Vec::new(), Vec::new());
    for Triangle { vertices: numbers, normals: named, model, corners } in triangles(&lines, models) {
        let tobj::Model { mesh, name } = model;
        // The parser refuses a face whose vertex does not exist, so every number is one of `positions`.
        vertices.push(numbers.map(|number| u32::try_from(number).unwrap_or(u32::MAX)));
        normals.extend(named.map(|named| named.map(|n| n.map_or([0.0; 3], |n| n.map(|c| c as f32)))));
        let at = |corner: usize| {
            let index = *mesh.texcoord_indices.get(corner)?;
            mesh.texcoords.get(2 * index as usize..)?.first_chunk().map(|uv: &[f64; 2]| uv.map(|c| c as f32))
        };
        if let [Some(a), Some(b), Some(c)] = corners.map(at) {
            texture.push([a, b, c]);
        }
        // The name of a group is the number of its material; faces before the first have another.
        material.push(name.parse().unwrap_or(u32::MAX));
    }
    let textured = lines.every_corner_has_texture && !texture.is_empty() && texture.len() == vertices.len();
    let colors = lines.colors();
    let mesh = Mesh {
        normals: (!normals.is_empty() && normals.len() == vertices.len()).then_some(normals),
        texture: textured.then_some(texture),
        material: (!lines.materials.is_empty()).then_some(material),
        triangles: vertices,
        positions: lines.positions,
        colors,
        up: Some(Up::Y),
        ..Mesh::default()
    };
    (mesh, lines.libraries, lines.materials)
}
