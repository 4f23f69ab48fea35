//! Wavefront OBJ: the vertices of a mesh as points, with normals and radii from its faces; or its triangles as they are.

mod encoding;
mod faces;
mod library;
mod lines;
mod material;

use crate::io::about::About;
use crate::io::closed::is_closed;
use crate::io::fault::{self, Fault};
use crate::io::points::Faces;
use crate::io::triangles::Triangles;
use crate::io::{Input, Mesh, Paint, Points, RawColors, ReadOptions, Up, settle_colors};
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
/// - Colours: the three numbers after a vertex's coordinates, sRGB-coded in [0, 1] or in [0, 255], as all of them say
///   ([`RawColors`]); a fourth is alpha. Where no vertex has any, those of ZBrush's lines `#MRGB`.
/// - What its triangles look like, by materials and images, as [`read_mesh`] reads them.
///
/// Text may be in UTF-16, of either byte order, if a byte order mark says so. Up is y. Lines,
/// points and curves are passed over, and a missing MTL file or image is no error, but named in
/// [`Points::notes`].
///
/// # Errors
///
/// [`Error::Read`](crate::Error::Read) where the system cannot read, [`Error::Malformed`](crate::Error::Malformed) where
/// a number is none or a face names a vertex or normal that does not exist; where a file has no normal at all, none is missed.
pub fn read(input: Input, options: &ReadOptions, progress: &dyn Progress) -> Result<Points> {
    let path = input.path.clone();
    let mut points = read_with(input, false, progress, |lines| points(lines, &path, options.ignore_alpha))?;
    points.raw.iter_mut().for_each(|raw| raw.name = fault::name(&path));
    points.about = options.describe.then(|| Box::new(About { format: "OBJ".into(), ..About::default() }));
    Ok(points)
}

/// Reads the triangles of an OBJ file, those of all groups and materials as one mesh, with every `v` line a vertex.
///
/// Polygons are made of triangles, concave ones too. Corners have the `vn` they name where every
/// corner of the file names one, else the mesh is faceted; a triangle all of whose corners name a
/// `vt` has those. Colours are read as by [`read`], and lines, points and curves are passed over
/// too. A file without faces is a mesh without triangles, and no error here.
///
/// From the MTL files beside it, whatever the case of names and keywords, the reader takes the
/// diffuse colour `Kd` (linear light), the opacity `d` and the image `map_Kd` (PNG, JPEG, BMP or
/// TGA, sRGB; with `-s`, `-o` and `-clamp`). Files that cannot be read are left out and named
/// in [`Mesh::notes`].
///
/// # Errors
///
/// As [`read`], and where a face names texture coordinates that do not exist, in a file that has
/// some, or images together have more pixels than [`MOST_PIXELS`](crate::io::image::MOST_PIXELS).
pub fn read_mesh(input: Input, options: &ReadOptions, progress: &dyn Progress) -> Result<Mesh> {
    let path = input.path.clone();
    read_with(input, true, progress, |lines| {
        let raw = lines.colors(options.ignore_alpha);
        let raw = raw.map(|raw| Box::new(RawColors { name: fault::name(&path), ..raw }));
        let mut colored = Points { raw, ..Points::default() };
        settle_colors(std::slice::from_mut(&mut colored));
        let (mut mesh, libraries, names) = mesh(lines);
        (mesh.colors, mesh.notes) = (colored.colors, colored.notes);
        material::give(&mut mesh, &path, &libraries, names)?;
        Ok(mesh)
    })
}

/// The libraries that an OBJ file at `path` names, and the images that these name.
pub(super) fn companions(file: &mut File, path: &Path) -> Vec<PathBuf> {
    let length = file.metadata().map_or(0, |there| there.len());
    let named = file.try_clone().and_then(|file| encoding::decoded(BufReader::with_capacity(1 << 18, file), length));
    named.map_or(Vec::new(), |(reader, _)| material::companions(path, &Lines::libraries(reader)))
}

/// Opens the file and makes of its lines and faces what is asked for.
fn read_with<T>(input: Input, strict: bool, progress: &dyn Progress, make: impl Fn(Lines) -> Result<T>) -> Result<T> {
    let Input { file, length, path, .. } = input;
    let in_file = |fault: Fault| fault.of(&path);
    let (reader, length) =
        encoding::decoded(BufReader::with_capacity(1 << 18, file), length).map_err(Fault::Io).map_err(in_file)?;
    progress.begin(&format!("reading {}", fault::name(&path)), length);
    let made = Lines::read(reader, strict, progress).map_err(in_file).and_then(make);
    progress.end();
    made
}

/// The vertices of the lines of the file at `path`, and what their triangles look like.
fn points(lines: Lines, path: &Path, ignore_alpha: bool) -> Result<Points> {
    let raw = lines.colors(ignore_alpha).map(Box::new);
    let has_faces = !lines.faces.is_empty();
    let paired = || lines.normals.iter().map(|normal| normal.map(|c| c as f32)).collect::<Vec<_>>();
    let alone = (!has_faces && !lines.normals.is_empty() && lines.normals.len() == lines.positions.len()).then(paired);
    let mut around = Triangles::new(&lines.positions);
    for triangle in lines.triangles() {
        around.add(triangle.vertices.map(|vertex| vertex as usize), triangle.normals.map(|all| all.map(Some)));
    }
    let face_as_named = around.face_as_named();
    let (face_normals, radii) = around.finish();
    let (mut mesh, libraries, names) = mesh(lines);
    if let Err(error) = material::give(&mut mesh, path, &libraries, names) {
        mesh.materials.iter_mut().for_each(|material| material.texture = None);
        mesh.notes.push(format!("the images of its materials are left out: {error}"));
    }
    let paint = Paint::of(&mesh).map(Box::new);
    let Mesh { positions, triangles, normals, notes, .. } = mesh;
    Ok(Points {
        normals: if has_faces { Some(face_normals) } else { alone },
        radii: has_faces.then_some(radii),
        of_mesh: has_faces,
        closed: face_as_named && is_closed(&positions, &triangles),
        raw,
        up: Some(Up::Y),
        faces: has_faces.then_some(Faces { triangles, normals, paint }),
        positions,
        notes,
        ..Points::default()
    })
}

/// The mesh without its colours and materials, the libraries they are in, and their names.
fn mesh(lines: Lines) -> (Mesh, Vec<String>, Vec<String>) {
    let (mut vertices, mut normals) = (Vec::new(), Vec::new());
    let (mut texture, mut material) = (Vec::new(), Vec::new());
    let (has_texture, has_material) = (lines.faces.have_texture(), !lines.materials.is_empty());
    for triangle in lines.triangles() {
        vertices.push(triangle.vertices);
        normals.extend(triangle.normals.map(|named| named.map(|normal| normal.map(|c| c as f32))));
        texture.extend(has_texture.then_some(triangle.texture));
        material.extend(has_material.then_some(triangle.material));
    }
    let mesh = Mesh {
        normals: (!normals.is_empty()).then_some(normals),
        texture: (!texture.is_empty()).then_some(texture),
        material: has_material.then_some(material),
        triangles: vertices,
        positions: lines.positions,
        up: Some(Up::Y),
        ..Mesh::default()
    };
    (mesh, lines.libraries, lines.materials)
}
