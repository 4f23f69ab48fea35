//! From a PLY file to points or a mesh, in one pass and with one small buffer.

use super::contents::Contents;
use super::faces::{Faces, Triangles};
use super::header::{self, Encoding};
use super::{ascii, binary, gaussian};
use crate::io::fault::{self, Fault};
use crate::io::input::check_regular;
use crate::io::values::shown;
use crate::io::{Input, Material, Mesh, Points, Texture};
use crate::io::{closed, triangles};
use crate::scene::Whole;
use crate::{Progress, Result};
use std::fs::File;
use std::io::BufReader;
use std::path::{Component, Path, PathBuf};
use std::sync::Arc;

/// Reads the vertices of a PLY file: ASCII, or binary of either byte order.
///
/// - `x y z` of any scalar type become f64 positions.
/// - `nx ny nz` become normals, `radius` (or else `scale`) radii in world units.
/// - `sx sy sz` and `tx ty tz`, all six, become half-axes in world units.
/// - `texture_u texture_v` (also `texcoord_u texcoord_v`, `s t`, `u v`) become texture coordinates.
/// - `red green blue` (also `r g b`, `diffuse_red ...`) with optional `alpha`: `uchar` are 8-bit sRGB codes and stay so;
///   `ushort` are 16-bit sRGB codes and become linear light; `float` and `double` are linear light as they are; other
///   integers are taken for 8-bit codes. Alpha is straight and linear in each case.
///
/// In a mesh, a list `vertex_indices` (or `vertex_index`) in an element `face` or `tristrips`, vertices without normals and
/// radii get them from the triangles around them, as in an OBJ file: normals weighted by area, and radii with which disks
/// cover the triangles.
///
/// Vertices with `scale_0` and `rot_0` are Gaussians, as 2D Gaussian splatting writes them, or flat ones of 3D Gaussian splatting: they get
/// half-axes of so many standard deviations that nothing shows beyond ([`EXTENT`](crate::scene::gaussian::EXTENT)), and colours with alpha that
/// change with the view if the file says so. With `flatten` ellipsoids lose their shortest axis, however thick they are.
///
/// A comment `up y` or `up z` in the header says which way is up, `closed` that surfels cover a closed surface, and `triangles NAME` which
/// mesh in the same folder they are drawn beside.
///
/// Other properties are skipped, and so are other elements: those before the last one that is read by their declared
/// shape, those after it without being looked at. Zero vertices are no error here.
///
/// # Errors
///
/// [`Error::Read`](crate::Error::Read) where the system cannot read, [`Error::Malformed`](crate::Error::Malformed) where
/// the header is not PLY's, `x`, `y` or `z` is missing, the file ends before the vertices or faces that its header
/// promises, a number in text is none, a list has a negative length, a face names a vertex that
/// does not exist, or the mesh that it is drawn beside is no regular file in its folder.
pub fn read(input: Input, flatten: bool, progress: &dyn Progress) -> Result<Points> {
    let (mut points, faces, _) = contents(input, (false, flatten), progress)?;
    if faces.triangles.is_empty() {
        return Ok(points);
    }
    let mut triangles = triangles::Triangles::new(&points.positions);
    faces.triangles.iter().for_each(|corners| triangles.add(corners.map(|corner| corner as usize), None));
    let (normals, radii) = triangles.finish();
    let closed = closed::is_closed(&points.positions, &faces.triangles);
    points.closed = closed && points.normals.as_ref().is_none_or(|given| triangles::agree(given, &normals));
    let corners = |given: &Vec<[f32; 3]>| faces.triangles.iter().map(|t| t.map(|v| given[v as usize])).collect();
    let named = points.normals.as_ref().map(corners);
    points.normals.get_or_insert(normals);
    points.of_mesh = points.radii.is_none() && points.axes.is_none();
    points.radii.get_or_insert(radii);
    points.faces = Some(crate::io::points::Faces { triangles: faces.triangles, normals: named });
    Ok(points)
}

/// Reads the triangles of a PLY file: the polygons of the element `face`, concave ones too, and the strips of the element `tristrips`.
///
/// Corners have what their vertices have: normals, colours, texture coordinates; the last from the list `texcoord` of the faces
/// instead, as MeshLab writes it, where every face has one. What comments `TextureFile` name, PNG or JPEG beside the file, are the
/// materials, of which a face's `texnumber` is one, or else the first; those that cannot be read are left out and named in
/// [`Mesh::notes`]. A file without faces is a mesh without triangles, and no error here.
///
/// # Errors
///
/// As [`read`].
pub fn read_mesh(input: Input, progress: &dyn Progress) -> Result<Mesh> {
    let folder = input.path.parent().unwrap_or(Path::new("")).to_owned();
    let (points, faces, textures) = contents(input, (true, true), progress)?;
    let points = points.in_light();
    let Triangles { triangles, texture, texture_numbers } = faces;
    fn corners<T: Copy>(triangles: &[[u32; 3]], of_vertices: &[T]) -> Vec<[T; 3]> {
        triangles.iter().map(|corners| corners.map(|vertex| of_vertices[vertex as usize])).collect()
    }
    let texture = texture.or_else(|| points.texture.map(|texture| corners(&triangles, &texture)));
    let mut notes = Vec::new();
    let mut material = |name: String| {
        let path = beside(&folder, &name);
        let read = Texture::read(&path);
        let texture = read.map(Arc::new).map_err(|error| notes.push(format!("a texture is left out: {error}"))).ok();
        Material { image: texture.is_some().then_some(path), name, diffuse: [1.0; 4], texture }
    };
    let materials: Vec<_> = textures.into_iter().map(&mut material).collect();
    // Where an image is missing the colours of the vertices are what is left.
    let painted = texture.is_some() && materials.iter().any(|material| material.texture.is_some());
    Ok(Mesh {
        normals: points.normals.map(|normals| corners(&triangles, &normals)),
        texture,
        positions: points.positions,
        up: points.up,
        colors: points.colors,
        triangles,
        material: painted.then_some(texture_numbers),
        materials,
        notes,
    })
}

/// The textures, and the mesh, that a PLY file at `path` names.
pub(in crate::io) fn companions(file: &mut File, path: &Path) -> Vec<PathBuf> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let names = |header: header::Header| header.comments.textures.into_iter().chain(header.comments.beside);
    let header = header::read(&mut BufReader::new(file));
    header.map_or(Vec::new(), |header| names(header).map(|name| beside(folder, &name)).collect())
}

/// The textures of the mesh at `path` if `epsplat hybrid` wrote it; None of any other file.
pub fn textures_of_hybrid(path: &Path) -> Option<Vec<PathBuf>> {
    check_regular(path).ok()?;
    let comments = header::read(&mut BufReader::new(File::open(path).ok()?)).ok()?.comments;
    let folder = path.parent().unwrap_or(Path::new(""));
    comments.hybrid.then(|| comments.textures.iter().map(|name| beside(folder, name)).collect())
}

/// A file that is named in the one at `path`, as Windows may write it.
fn beside(folder: &Path, name: &str) -> PathBuf {
    folder.join(name.replace('\\', "/"))
}

/// The mesh that the header of the file at `path` names, which lies in the same folder: a file may
/// come from anywhere, and must not say what else of the machine is read. Whether the mesh exists
/// is told when it is read.
fn mesh_beside(path: &Path, name: &str) -> Result<PathBuf, Fault> {
    let refused = |what: &str| {
        let name = shown(name.as_bytes());
        Err(Fault::Malformed(format!(
            "its header names the triangles of '{name}', {what}: only a file in its own folder is drawn beside it; --triangles names any"
        )))
    };
    let mut parts = Path::new(name).components();
    let plain = matches!((parts.next(), parts.next()), (Some(Component::Normal(part)), None) if part == name);
    if !plain || name.contains(['/', '\\', '\0']) {
        return refused("which is a path and no name");
    }
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mesh = path.parent().unwrap_or(Path::new("")).join(name);
    if mesh.symlink_metadata().is_err() {
        return Ok(mesh);
    }
    if check_regular(&mesh).is_err() {
        return refused("which is no file");
    }
    match (mesh.canonicalize(), folder.canonicalize()) {
        (Ok(end), Ok(folder)) if end.parent() == Some(&folder) => Ok(mesh),
        _ => refused("which leads out of its folder"),
    }
}

/// The vertices, the triangles, which name vertices that exist, and the names of textures. With `surface`, faces may have texture
/// coordinates; with `flatten` Gaussians may be thick.
fn contents(
    input: Input,
    (surface, flatten): (bool, bool),
    progress: &dyn Progress,
) -> Result<(Points, Triangles, Vec<String>)> {
    let Input { file, length, path, .. } = input;
    let in_file = |fault: Fault| fault.of(&path);
    let mut reader = BufReader::with_capacity(1 << 16, file);
    let header = header::read(&mut reader).map_err(in_file)?;
    let Some(vertex) = header.elements.iter().find(|element| element.name == "vertex") else {
        return Err(in_file(Fault::Malformed("its header has no element 'vertex'".into())));
    };
    let mesh = header.comments.beside.as_ref().map(|name| mesh_beside(&path, name));
    let mesh = mesh.transpose().map_err(in_file)?;
    progress.begin(&format!("reading {}", fault::name(&path)), vertex.count);
    let contents = match header.encoding {
        Encoding::Ascii => ascii::read(reader, &header, length, Faces::new(surface), progress),
        Encoding::LittleEndian => binary::read::<false>(reader, &header, length, Faces::new(surface), progress),
        Encoding::BigEndian => binary::read::<true>(reader, &header, length, Faces::new(surface), progress),
    };
    progress.end();
    let Contents { mut points, faces, tree, whole } = contents.map_err(in_file)?;
    gaussian::check(&points, flatten).map_err(in_file)?;
    points.up = header.comments.up;
    points.closed = header.comments.closed;
    points.unsided = header.comments.unsided;
    if let Some(tree) = tree {
        if let Some(what) = tree.fault(points.positions.len()) {
            return Err(in_file(Fault::Malformed(format!("its levels of detail (element node) are no tree: {what}"))));
        }
        let count = |count: usize| u32::try_from(count).unwrap_or(u32::MAX);
        let (surfels, nodes) = (count(points.positions.len()), count(tree.rows.len()));
        points.whole = whole.map(|whole| Box::new(Whole { surfels, nodes, ..whole }));
        points.tree = Some(tree);
    }
    points.beside = mesh;
    let triangles = faces.finish(&points.positions).map_err(in_file)?;
    Ok((points, triangles, header.comments.textures))
}
