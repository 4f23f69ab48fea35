//! Wavefront OBJ: the vertices of a mesh as points, with normals and radii from its faces; or its triangles as they are.

mod material;
mod source;

use crate::io::fault::{self, Fault};
use crate::io::triangles::Triangles;
use crate::io::{Mesh, Points, Up};
use crate::{Progress, Result};
use source::{Lines, Source};
use std::fs::File;
use std::io::{self, BufReader};
use std::path::Path;

/// Reads the vertices of an OBJ file, one point for each `v` line and in their order, whatever groups and materials
/// the faces are in.
///
/// - Normals: the mean of the `vn` that a vertex's face corners name, where every corner of the file names one; else
///   the mean of its faces' normals, weighted by area. A vertex of no face has none (zero). A file without faces but
///   with one `vn` for each `v` pairs them.
/// - Radii: 1.1 times the smallest with which disks at a triangle's corners cover it, the largest over the vertex's
///   triangles; polygons are fanned into triangles; a vertex of no triangle has none (zero).
/// - Colours: the three numbers after a vertex's coordinates, sRGB-coded in [0, 1], or where any is 2 or more in [0, 255], become
///   linear light; a fourth is alpha.
///
/// Up is y. Lines, points, curves and materials are passed over, so a missing MTL file is no error.
///
/// # Errors
///
/// [`Error::Read`](crate::Error::Read) where the system cannot read, [`Error::Malformed`](crate::Error::Malformed) where
/// a number is none or a face names a vertex or normal that does not exist.
pub fn read(path: &Path, progress: &dyn Progress) -> Result<Points> {
    read_with(path, false, progress, points)
}

/// Reads the triangles of an OBJ file, those of all groups and materials as one mesh, with every `v` line a vertex.
///
/// Polygons are fanned into triangles. Corners have the `vn` they name where every corner of the file names one, else the
/// mesh is faceted; and so with `vt`. Colours are read as by [`read`], and lines, points and curves are passed over too. A
/// file without faces is a mesh without triangles, and no error here.
///
/// Of the materials in the MTL files beside it the diffuse colour `Kd` (linear light), the opacity `d` and the image
/// `map_Kd` (PNG or JPEG, sRGB) are read. Files that cannot be read are left out and named in [`Mesh::notes`].
///
/// # Errors
///
/// As [`read`], and where a face names texture coordinates that do not exist.
pub fn read_mesh(path: &Path, progress: &dyn Progress) -> Result<Mesh> {
    let (mut mesh, libraries, names) = read_with(path, true, progress, mesh)?;
    mesh.materials = material::read(path, &libraries, &names, &mut mesh.notes);
    Ok(mesh)
}

/// Opens the file and makes of its lines and faces what is asked for.
fn read_with<T>(
    path: &Path,
    surface: bool,
    progress: &dyn Progress,
    make: impl Fn(Lines, &[tobj::Model]) -> T,
) -> Result<T> {
    let in_file = |fault: Fault| fault.of(path);
    let file = File::open(path).map_err(Fault::Io).map_err(in_file)?;
    let length = file.metadata().map_err(Fault::Io).map_err(in_file)?.len();
    progress.begin(&format!("reading {}", fault::name(path)), length);
    let parsed = parse(Source::new(BufReader::with_capacity(1 << 18, file), surface, progress));
    let made = parsed.map(|(lines, models)| make(lines, &models));
    progress.end();
    made.map_err(in_file)
}

fn parse<R: io::BufRead>(mut source: Source<'_, R>) -> Result<(Lines, Vec<tobj::Model>), Fault> {
    let options = tobj::LoadOptions {
        triangulate: true,
        ignore_points: true,
        ignore_lines: true,
        ..tobj::LoadOptions::default()
    };
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

/// Each triangle's vertices, by their number in the file, and the normals its corners name, if every corner of the file
/// names one.
fn faces<'a>(lines: &Lines, models: &'a [tobj::Model]) -> impl Iterator<Item = Face> + use<'a> {
    let named = lines.every_corner_has_a_normal;
    models.iter().flat_map(move |tobj::Model { mesh, .. }| {
        let number =
            |index: &u32| mesh.positions.get(3 * *index as usize).map_or(usize::MAX, |number| *number as usize);
        let normal = |index: &u32| mesh.normals.get(3 * *index as usize..)?.first_chunk().copied();
        let mut normals = mesh.normal_indices.as_chunks::<3>().0.iter();
        mesh.indices.as_chunks::<3>().0.iter().map(move |corners| {
            let named = normals.next().filter(|_| named);
            (corners.each_ref().map(number), named.map(|named| named.each_ref().map(normal)))
        })
    })
}

/// The numbers of three vertices, and the normals of the corners.
type Face = ([usize; 3], Option<[Option<[f64; 3]>; 3]>);

fn points(lines: Lines, models: &[tobj::Model]) -> Points {
    let colors = lines.colors();
    let mut triangles = Triangles::new(&lines.positions);
    for (corners, normals) in faces(&lines, models) {
        triangles.add(corners, normals);
    }
    let has_faces = models.iter().any(|model| !model.mesh.indices.is_empty());
    let (face_normals, radii) = triangles.finish();
    let normals = if has_faces {
        Some(face_normals)
    } else {
        Some(lines.normals).filter(|normals| !normals.is_empty() && normals.len() == lines.positions.len())
    };
    Points {
        positions: lines.positions,
        normals,
        radii: has_faces.then_some(radii),
        colors,
        up: Some(Up::Y),
        ..Points::default()
    }
}

/// The mesh without its materials, the libraries they are in, and their names.
fn mesh(lines: Lines, models: &[tobj::Model]) -> (Mesh, Vec<String>, Vec<String>) {
    let (mut triangles, mut normals) = (Vec::new(), Vec::new());
    for (corners, named) in faces(&lines, models) {
        // The parser refuses a face whose vertex does not exist, so every number is one of `positions`.
        triangles.push(corners.map(|corner| u32::try_from(corner).unwrap_or(u32::MAX)));
        normals.extend(named.map(|named| named.map(|n| n.map_or([0.0; 3], |n| n.map(|c| c as f32)))));
    }
    let (mut texture, mut material) = (Vec::new(), Vec::new());
    for tobj::Model { mesh, name } in models {
        let at = |index: &u32| {
            let found = mesh.texcoords.get(2 * *index as usize..).and_then(|rest| rest.first_chunk());
            found.map_or([0.0; 2], |uv: &[f64; 2]| uv.map(|c| c as f32))
        };
        texture.extend(mesh.texcoord_indices.as_chunks::<3>().0.iter().map(|corners| corners.each_ref().map(at)));
        // The name of a group is the number of its material; faces before the first have another.
        let number = name.parse().unwrap_or(u32::MAX);
        material.extend(mesh.indices.as_chunks::<3>().0.iter().map(|_| number));
    }
    let textured = lines.every_corner_has_texture && !texture.is_empty() && texture.len() == triangles.len();
    let colors = lines.colors();
    let mesh = Mesh {
        normals: (!normals.is_empty() && normals.len() == triangles.len()).then_some(normals),
        texture: textured.then_some(texture),
        material: (!lines.materials.is_empty()).then_some(material),
        triangles,
        positions: lines.positions,
        colors,
        up: Some(Up::Y),
        ..Mesh::default()
    };
    (mesh, lines.libraries, lines.materials)
}
