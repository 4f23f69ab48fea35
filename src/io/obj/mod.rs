//! Wavefront OBJ, read as points or as a mesh. Points are the vertices, with normals and radii from
//! the faces.

mod faces;
mod library;
mod lines;
mod material;

use crate::io::about::About;
use crate::io::closed::is_closed;
use crate::io::encoding;
use crate::io::fault::{self, Fault};
use crate::io::input::Local;
use crate::io::points::Faces;
use crate::io::triangles::Triangles;
use crate::io::{Input, Mesh, Paint, Points, RawColors, ReadOptions, Up, settle_colors};
use crate::{Progress, Result};
use lines::Lines;
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

/// Reads the vertices of an OBJ file, one point for each `v` line in their order, whatever groups
/// and materials the faces have.
///
/// - Normals: if every face corner of the file names a `vn`, a vertex gets the mean of those at its
///   corners; otherwise the mean of its faces' normals, weighted by area. A vertex without a face
///   gets zero, which means none. In a file without faces but with as many `vn` as `v`, each `v`
///   gets the `vn` with the same index.
/// - Radii: 1.1 times the covering radius of a triangle, the largest over the vertex's triangles.
///   Disks with the covering radius at the three corners just cover the triangle. Polygons are cut
///   into triangles first. A vertex without a triangle gets zero, which means none.
/// - Colours: the three numbers after a vertex's coordinates, sRGB-coded; the numbers of all
///   vertices decide whether they range to 1 or to 255 ([`RawColors`]). A fourth number is alpha.
///   If no vertex has a colour, those of ZBrush's lines `#MRGB` are used.
/// - Materials and images: those of the triangles, as [`read_mesh`] reads them.
///
/// Text may be in UTF-16 of either byte order, with a byte order mark. Up is y. Lines, points and
/// curves are skipped. A missing MTL file or image is not an error, but named in [`Points::notes`].
///
/// # Errors
///
/// [`Error::Read`](crate::Error::Read) if the system cannot read,
/// [`Error::Malformed`](crate::Error::Malformed) if a word is not a number, or a face names a
/// vertex or normal that does not exist. Normals that faces name are ignored if the file has none
/// at all.
pub fn read(input: Input, options: &ReadOptions, progress: &dyn Progress) -> Result<Points> {
    let path = input.path.clone();
    let mut points = read_with(input, false, progress, |lines| points(lines, &path, options.ignore_alpha))?;
    points.raw.iter_mut().for_each(|raw| raw.name = fault::name(&path));
    points.about = options.describe.then(|| Box::new(About { format: "OBJ".into(), ..About::default() }));
    Ok(points)
}

/// Reads the triangles of an OBJ file as one mesh, whatever their groups and materials. Every `v`
/// line is a vertex.
///
/// Polygons are cut into triangles, concave ones correctly. If every corner of the file names a
/// `vn`, corners have these normals; otherwise the mesh is faceted. A triangle has texture
/// coordinates if all of its corners name a `vt`. Colours are as in [`read`]; lines, points and
/// curves are skipped. A file without faces is a mesh without triangles, which is not an error
/// here.
///
/// MTL files give the diffuse colour `Kd` (linear light), the opacity `d` and the image `map_Kd`
/// (PNG, JPEG, BMP or TGA, sRGB; with `-s`, `-o` and `-clamp`). The case of file names and keywords
/// does not matter. Files that cannot be read are left out and named in [`Mesh::notes`].
///
/// # Errors
///
/// As [`read`]; also if a face names texture coordinates that do not exist, in a file that has
/// some, or if all images together have more pixels than
/// [`MOST_PIXELS`](crate::io::image::MOST_PIXELS).
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

/// The libraries that the OBJ file at `path` names, and the images that these name.
pub(super) fn companions(file: &mut File, path: &Path) -> Vec<PathBuf> {
    let length = file.metadata().map_or(0, |there| there.len());
    let named = file.try_clone().and_then(|file| encoding::decoded(BufReader::with_capacity(1 << 18, file), length));
    named.map_or(Vec::new(), |(reader, _)| material::companions(path, &Lines::libraries(reader)))
}

/// Reads the lines of a file and passes them to `make`.
fn read_with<T>(input: Input, strict: bool, progress: &dyn Progress, make: impl Fn(Lines) -> Result<T>) -> Result<T> {
    let Local { file, length, path } = input.local()?;
    let in_file = |fault: Fault| fault.of(&path);
    let (reader, length) =
        encoding::decoded(BufReader::with_capacity(1 << 18, file), length).map_err(Fault::Io).map_err(in_file)?;
    progress.begin(&format!("reading {}", fault::name(&path)), length);
    let made = Lines::read(reader, strict, progress).map_err(in_file).and_then(make);
    progress.end();
    made
}

/// The vertices of the file at `path`, and the materials of their triangles.
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

/// The mesh without colours and materials, the names of its libraries, and the names of its
/// materials.
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
