//! From a PLY file to points or a mesh, in one pass and with one small buffer.

use super::contents::Contents;
use super::faces::{Faces, Triangles};
use super::header::{self, Element, Encoding};
use super::vertex::Layout;
use super::{ascii, binary, gaussian, packed};
use crate::io::about::{About, Attribute, Role};
use crate::io::beside::Beside;
use crate::io::fault::{self, Fault};
use crate::io::input::check_regular;
use crate::io::textures::Images;
use crate::io::values::shown;
use crate::io::{Input, Material, Mesh, Paint, Points, ReadOptions, settle_colors};
use crate::io::{closed, triangles};
use crate::scene::{Colors, Whole};
use crate::{Progress, Result};
use std::fs::File;
use std::io::BufReader;
use std::path::{Component, Path, PathBuf};

/// Reads the vertices of a PLY file: ASCII, or binary of either byte order.
///
/// - `x y z` of any scalar type become f64 positions.
/// - `nx ny nz` become normals, `radius` (or else `scale`) radii in world units, by these and other names that programs write.
/// - `sx sy sz` and `tx ty tz`, all six, become half-axes in world units.
/// - `texture_u texture_v` (also `texcoord_u texcoord_v`, `s t`, `u v`) become texture coordinates.
/// - `red green blue` (also `r g b`, `diffuse_red ...`) with optional `alpha`: `uchar` are 8-bit sRGB codes and stay so;
///   what other types range over, all numbers of a scene tell together ([`RawColors`](crate::io::RawColors)): `float` and
///   `double` of 0 to 1 are linear light as they are. Alpha is straight and linear in each case.
/// - `intensity` (also `scalar_Intensity ...`) becomes grey where there are no colours, or all are zero.
///
/// In a mesh, a list `vertex_indices` (or `vertex_index`) in an element `face` or `tristrips`,
/// vertices without normals and radii get them from the triangles around them, as in an OBJ file:
/// normals weighted by area, and radii with which disks cover the triangles. What triangles look
/// like, by colours of their own and by images, is read as [`read_mesh`] reads it.
///
/// Vertices with `scale_0` and `rot_0` are Gaussians, as 2D Gaussian splatting writes them, or flat ones of 3D Gaussian splatting: they get
/// half-axes of so many standard deviations that nothing shows beyond ([`EXTENT`](crate::scene::gaussian::EXTENT)), and colours with alpha that
/// change with the view if the file says so. SuperSplat's compressed files are read too.
/// With `flatten` ellipsoids lose their shortest axis, however thick they are.
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
pub fn read(input: Input, options: &ReadOptions, progress: &dyn Progress) -> Result<Points> {
    let path = input.path.clone();
    let (mut points, mut faces, textures) = contents(input, options, progress)?;
    if faces.triangles.is_empty() {
        return Ok(points);
    }
    choose_colors(&mut points, &mut faces);
    let mut triangles = triangles::Triangles::new(&points.positions);
    faces.triangles.iter().for_each(|corners| triangles.add(corners.map(|corner| corner as usize), None));
    let (normals, radii) = triangles.finish();
    let closed = closed::is_closed(&points.positions, &faces.triangles);
    points.closed = closed && points.normals.as_ref().is_none_or(|given| triangles::agree(given, &normals));
    let named = points.normals.as_ref().map(|given| corners(&faces.triangles, given));
    points.normals.get_or_insert(normals);
    points.of_mesh = points.radii.is_none() && points.axes.is_none();
    points.radii.get_or_insert(radii);
    // Places of vertices alone are those of points, which any image may paint.
    let is_painted = !textures.is_empty() || faces.texture.is_some() || faces.colors.is_some();
    let of_vertices = points.texture.as_ref().filter(|_| is_painted).map(|texture| corners(&faces.triangles, texture));
    let mut mesh = Mesh {
        triangles: faces.triangles,
        face_colors: faces.colors,
        texture: faces.texture.or(of_vertices),
        ..Mesh::default()
    };
    if let Err(error) = paint(&mut mesh, &path, textures, faces.texture_numbers) {
        mesh.notes.push(format!("its images are left out: {error}"));
    }
    let paint = Paint::of(&mesh).map(Box::new);
    points.notes.append(&mut mesh.notes);
    points.faces = Some(crate::io::points::Faces { triangles: mesh.triangles, normals: named, paint });
    Ok(points)
}

/// Reads the triangles of a PLY file: the polygons of the element `face`, concave ones too, and the strips of the element `tristrips`.
///
/// Corners have what their vertices have: normals, colours, texture coordinates; the last from the
/// list `texcoord` of the faces instead, as MeshLab writes it, where every face has one. Triangles
/// have the colours of their faces, `red green blue` with or without `alpha`, if those of vertices
/// do not hide them: integers are codes of sRGB, of 8 bits, or of 16 if there are larger ones than
/// 255, and floats linear light up to 1, or such codes. What comments `TextureFile` name, PNG,
/// JPEG, BMP or TGA beside the file, are the materials, of which a face's `texnumber` is one, or
/// else the first; those that cannot be read are left out and named in [`Mesh::notes`]. A file
/// without faces is a mesh without triangles, and no error here.
///
/// # Errors
///
/// As [`read`], and where images together have more pixels than
/// [`MOST_PIXELS`](crate::io::image::MOST_PIXELS).
pub fn read_mesh(input: Input, options: &ReadOptions, progress: &dyn Progress) -> Result<Mesh> {
    let path = input.path.clone();
    let options = ReadOptions { flatten: true, ..*options };
    let (mut points, mut faces, textures) = contents(input, &options, progress)?;
    choose_colors(&mut points, &mut faces);
    settle_colors(std::slice::from_mut(&mut points));
    let points = points.in_light();
    let triangles = faces.triangles;
    let mut mesh = Mesh {
        normals: points.normals.map(|normals| corners(&triangles, &normals)),
        texture: faces.texture.or_else(|| points.texture.map(|texture| corners(&triangles, &texture))),
        positions: points.positions,
        up: points.up,
        colors: points.colors,
        face_colors: faces.colors,
        triangles,
        notes: points.notes,
        ..Mesh::default()
    };
    paint(&mut mesh, &path, textures, faces.texture_numbers)?;
    Ok(mesh)
}

/// An attribute of vertices, for each corner of the triangles.
fn corners<T: Copy>(triangles: &[[u32; 3]], of_vertices: &[T]) -> Vec<[T; 3]> {
    triangles.iter().map(|corners| corners.map(|vertex| of_vertices[vertex as usize])).collect()
}

/// Leaves the colours of vertices or those of faces: of vertices those count, as they are finer,
/// unless all are one colour, which programs write without being asked.
fn choose_colors(points: &mut Points, faces: &mut Triangles) {
    if faces.colors.is_none() {
        return;
    }
    let are_one = points.raw.as_ref().is_none_or(|raw| raw.is_one_color())
        && match &points.colors {
            Some(Colors::Srgb8(codes)) => codes.windows(2).all(|pair| pair[0] == pair[1]),
            Some(Colors::Linear(colors)) => colors.windows(2).all(|pair| pair[0] == pair[1]),
            Some(_) => false,
            None => true,
        };
    if are_one {
        (points.colors, points.raw) = (None, None);
    } else {
        faces.colors = None;
        points.notes.push("faces have colours too, which those of vertices hide".into());
    }
}

/// Gives a mesh the images of these `names` beside the file at `path` as materials, of which each
/// triangle has one by its number.
fn paint(mesh: &mut Mesh, path: &Path, names: Vec<String>, numbers: Vec<u32>) -> Result<()> {
    let (mut beside, mut images) = (Beside::of(path), Images::default());
    let mut materials = Vec::new();
    for name in names {
        let path = beside.file(&name);
        let texture = images.read(&path, false, &mut mesh.notes)?;
        materials.push(Material { image: texture.is_some().then_some(path), name, diffuse: [1.0; 4], texture });
    }
    // Where an image is missing the colours of the vertices are what is left.
    let painted = mesh.texture.is_some() && materials.iter().any(|material| material.texture.is_some());
    mesh.material = painted.then_some(numbers);
    mesh.materials = materials;
    Ok(())
}

/// The file's description of itself.
fn about(header: &header::Header, vertex: &Element) -> Result<About, Fault> {
    let encoding = match header.encoding {
        Encoding::Ascii => "text",
        Encoding::LittleEndian => "binary, little-endian",
        Encoding::BigEndian => "binary, big-endian",
    };
    let attributes = match packed::is_packed(header) {
        true => packed::WORDS.map(|word| Attribute::new(word, true, Role::Other)).to_vec(),
        false => Layout::of(vertex)?.attributes(vertex),
    };
    Ok(About { format: format!("PLY, {encoding}"), attributes, ..About::default() })
}

/// The textures, and the mesh, that a PLY file at `path` names.
pub(in crate::io) fn companions(file: &mut File, path: &Path) -> Vec<PathBuf> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let Ok(header) = header::read(&mut BufReader::new(file)) else { return Vec::new() };
    let mut files = Beside::of(path);
    let images = header.comments.textures.iter().map(|name| files.file(name));
    images.chain(header.comments.beside.map(|name| beside(folder, &name))).collect()
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

/// The vertices, the triangles, which name vertices that exist, and the names of textures. Colours
/// of vertices are as the file has them.
fn contents(input: Input, options: &ReadOptions, progress: &dyn Progress) -> Result<(Points, Triangles, Vec<String>)> {
    let Input { file, length, path, .. } = input;
    let in_file = |fault: Fault| fault.of(&path);
    let mut reader = BufReader::with_capacity(1 << 16, file);
    let mut header = header::read(&mut reader).map_err(in_file)?;
    header.elements.iter_mut().for_each(|element| element.tints.ignore_alpha = options.ignore_alpha);
    let Some(vertex) = header.elements.iter().find(|element| element.name == "vertex") else {
        return Err(in_file(Fault::Malformed("its header has no element 'vertex'".into())));
    };
    let mesh = header.comments.beside.as_ref().map(|name| mesh_beside(&path, name));
    let mesh = mesh.transpose().map_err(in_file)?;
    progress.begin(&format!("reading {}", fault::name(&path)), vertex.count);
    let mut packed = || {
        let points = packed::read(&mut reader, &header, length, progress)?;
        Ok(Contents { points, faces: Faces::default(), tree: None, whole: None })
    };
    let contents = match header.encoding {
        _ if packed::is_packed(&header) => packed(),
        Encoding::Ascii => ascii::read(reader, &header, length, Faces::default(), progress),
        Encoding::LittleEndian => binary::read::<false>(reader, &header, length, Faces::default(), progress),
        Encoding::BigEndian => binary::read::<true>(reader, &header, length, Faces::default(), progress),
    };
    progress.end();
    let Contents { mut points, faces, tree, whole } = contents.map_err(in_file)?;
    gaussian::check(&points, options.flatten).map_err(in_file)?;
    points.raw.iter_mut().for_each(|raw| raw.name = fault::name(&path));
    if options.describe {
        points.about = Some(Box::new(about(&header, vertex).map_err(in_file)?));
    }
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
