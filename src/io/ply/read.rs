//! Reads a PLY file as points or as a mesh, in one pass and with one small buffer.

use super::contents::Contents;
use super::faces::{Faces, Triangles};
use super::header::{self, Element, Encoding};
use super::vertex::Layout;
use super::{ascii, binary, gaussian, packed};
use crate::io::about::{About, Attribute, Role};
use crate::io::beside::Beside;
use crate::io::dimensions::of_positions;
use crate::io::fault::{self, Fault};
use crate::io::input::Local;
use crate::io::input::check_regular;
use crate::io::textures::Images;
use crate::io::triangles::{corners, give_faces};
use crate::io::values::shown;
use crate::io::{Input, Material, Mesh, Paint, Points, ReadOptions, settle_colors};
use crate::scene::{Colors, Whole};
use crate::{Progress, Result};
use std::fs::File;
use std::io::BufReader;
use std::path::{Component, Path, PathBuf};

/// Reads the vertices of a PLY file: ASCII, or binary of either byte order.
///
/// - `x y z` of any scalar type become f64 positions.
/// - `nx ny nz` become normals, and `radius` (or else `scale`) becomes radii in world units. Other
///   common names are accepted, too.
/// - `sx sy sz` and `tx ty tz`, if all six exist, become half-axes in world units.
/// - `texture_u texture_v` (also `texcoord_u texcoord_v`, `s t`, `u v`) become texture coordinates.
/// - `red green blue` (also `r g b`, `diffuse_red ...`) with optional `alpha` become colours.
///   Numbers of type `uchar` are 8-bit sRGB codes and stay so. The range of other types is found
///   from all numbers of a scene ([`RawColors`](crate::io::RawColors)); `float` and `double` from 0
///   to 1 are linear light. Alpha is always straight and linear.
/// - `intensity` (also `scalar_Intensity ...`) becomes grey if colours are missing or all zero.
///
/// A file with a list `vertex_indices` (or `vertex_index`) in an element `face` or `tristrips` is a
/// mesh. Its vertices without normals or radii get them from their triangles, as in an OBJ file:
/// normals weighted by area, and radii with which disks cover the triangles. The colours and images
/// of triangles are read as by [`read_mesh`].
///
/// Vertices with `scale_0` and `rot_0` are Gaussians, of 2D Gaussian splatting or flat ones of 3D
/// Gaussian splatting. Their half-axes are [`EXTENT`](crate::scene::gaussian::EXTENT) standard
/// deviations, beyond which nothing shows, and their colours have alpha and depend on the view if
/// the file says so. SuperSplat's compressed files are read too. With [`ReadOptions::flatten`],
/// ellipsoids of any thickness lose their shortest axis; with [`ReadOptions::solid`], thick ones
/// keep it.
///
/// Comments in the header: `up y` or `up z` names the axis that points up; `closed` says that
/// surfels cover a closed surface; `triangles NAME` names a mesh in the same folder that is drawn
/// together with them.
///
/// Other properties and elements are skipped; elements after the last one that is used are not even
/// parsed. A file without vertices is valid.
///
/// # Errors
///
/// [`Error::Read`](crate::Error::Read) if the system cannot read,
/// [`Error::Malformed`](crate::Error::Malformed) if the header is not a PLY header, `x`, `y` or `z`
/// is missing, the file ends before the vertices or faces that its header promises, a word of an
/// ASCII file is not a number, a list has a negative length, a face names a vertex that does not
/// exist, or the mesh that `triangles` names is not a regular file in the same folder.
pub fn read(input: Input, options: &ReadOptions, progress: &dyn Progress) -> Result<Points> {
    let path = input.path.clone();
    let (mut points, mut faces, textures) = contents(input, options, progress)?;
    if faces.triangles.is_empty() {
        return Ok(points);
    }
    choose_colors(&mut points, &mut faces);
    // Triangles get the texture coordinates of vertices only if the file names images or its faces
    // have colours. Otherwise only the points have them, for any image.
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
    give_faces(&mut points, mesh.triangles, paint);
    Ok(points)
}

/// Reads the triangles of a PLY file: polygons of the element `face`, concave ones too, and strips
/// of `tristrips`.
///
/// Corners have the normals, colours and texture coordinates of their vertices. If every face has a
/// list `texcoord`, as MeshLab writes it, texture coordinates are taken from there.
///
/// Faces may have colours, `red green blue` with or without `alpha`; colours of vertices take
/// precedence unless all of them are the same. Integers are sRGB codes of 8 bits, or of 16 bits if
/// some exceed 255. Floats are linear light if none exceeds 1, else sRGB codes like integers.
///
/// The images (PNG, JPEG, BMP or TGA beside the file) that comments `TextureFile` name are the
/// materials. `texnumber` of a face is the index of its material, 0 if absent. Images that cannot
/// be read are left out and named in [`Mesh::notes`]. A file without faces is a mesh without
/// triangles.
///
/// # Errors
///
/// As [`read`], and if all images together have more pixels than
/// [`MOST_PIXELS`](crate::io::image::MOST_PIXELS).
pub fn read_mesh(input: Input, options: &ReadOptions, progress: &dyn Progress) -> Result<Mesh> {
    let path = input.path.clone();
    let options = ReadOptions { flatten: true, ..options.clone() };
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

/// Keeps either the colours of vertices or those of faces. Colours of vertices are finer, so they
/// are kept unless all are the same: programs write a single colour for all vertices unasked.
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
        points.notes.push("faces have colours too, which are ignored, as vertices have some".into());
    }
}

/// Gives a mesh the images `names` beside the file at `path` as materials; `numbers` are the
/// indices of the triangles' materials.
fn paint(mesh: &mut Mesh, path: &Path, names: Vec<String>, numbers: Vec<u32>) -> Result<()> {
    let (mut beside, mut images) = (Beside::of(path), Images::default());
    let mut materials = Vec::new();
    for name in names {
        let path = beside.file(&name);
        let texture = images.read(&path, false, &mut mesh.notes)?;
        materials.push(Material { image: texture.is_some().then_some(path), name, diffuse: [1.0; 4], texture });
    }
    // If no image can be read, the colours of the vertices are drawn.
    let painted = mesh.texture.is_some() && materials.iter().any(|material| material.texture.is_some());
    mesh.material = painted.then_some(numbers);
    mesh.materials = materials;
    Ok(())
}

/// The description of the file: its format and attributes.
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

/// The textures and the mesh that the header of the PLY file at `path` names.
pub(in crate::io) fn companions(file: &mut File, path: &Path) -> Vec<PathBuf> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let Ok(header) = header::read(&mut BufReader::new(file)) else { return Vec::new() };
    let mut files = Beside::of(path);
    let images = header.comments.textures.iter().map(|name| files.file(name));
    images.chain(header.comments.beside.map(|name| beside(folder, &name))).collect()
}

/// The textures of the mesh at `path` if `epsplat hybrid` wrote it, else None.
pub fn textures_of_hybrid(path: &Path) -> Option<Vec<PathBuf>> {
    check_regular(path).ok()?;
    let comments = header::read(&mut BufReader::new(File::open(path).ok()?)).ok()?.comments;
    let folder = path.parent().unwrap_or(Path::new(""));
    comments.hybrid.then(|| comments.textures.iter().map(|name| beside(folder, name)).collect())
}

/// The path of a file that a header names. The name may have Windows backslashes.
fn beside(folder: &Path, name: &str) -> PathBuf {
    folder.join(name.replace('\\', "/"))
}

/// The path of the mesh that the header of the file at `path` names. Only a regular file in the
/// same folder is accepted, as a file may come from anywhere and must not choose what else is read.
/// A mesh that does not exist is an error only when it is read.
fn mesh_beside(path: &Path, name: &str) -> Result<PathBuf, Fault> {
    let refused = |what: &str| {
        let name = shown(name.as_bytes());
        Err(Fault::Malformed(format!(
            "its header names the mesh '{name}' to draw beside it, {what}: only a file in its own folder is accepted; use --triangles for others"
        )))
    };
    let mut parts = Path::new(name).components();
    let plain = matches!((parts.next(), parts.next()), (Some(Component::Normal(part)), None) if part == name);
    if !plain || name.contains(['/', '\\', '\0']) {
        return refused("which is a path, not a name");
    }
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mesh = path.parent().unwrap_or(Path::new("")).join(name);
    if mesh.symlink_metadata().is_err() {
        return Ok(mesh);
    }
    if check_regular(&mesh).is_err() {
        return refused("which is not a regular file");
    }
    match (mesh.canonicalize(), folder.canonicalize()) {
        (Ok(end), Ok(folder)) if end.parent() == Some(&folder) => Ok(mesh),
        _ => refused("which leads out of its folder"),
    }
}

/// Reads the vertices, the triangles and the names of textures, and checks the vertex indices of
/// triangles. Colours of vertices stay as they are in the file.
fn contents(input: Input, options: &ReadOptions, progress: &dyn Progress) -> Result<(Points, Triangles, Vec<String>)> {
    let Local { file, length, path } = input.local()?;
    let in_file = |fault: Fault| fault.of(&path);
    let mut reader = BufReader::with_capacity(1 << 16, file);
    let mut header = header::read(&mut reader).map_err(in_file)?;
    for element in &mut header.elements {
        element.tints.ignore_alpha = options.ignore_alpha;
        if element.name == "vertex" && !packed::is_packed_element(element) {
            element.wanted = options.wanted.clone();
        }
    }
    let Some(vertex) = header.elements.iter().find(|element| element.name == "vertex") else {
        return Err(in_file(Fault::Malformed("its header has no element 'vertex'".into())));
    };
    let mesh = header.comments.beside.as_ref().map(|name| mesh_beside(&path, name));
    let mesh = mesh.transpose().map_err(in_file)?;
    progress.begin(&format!("reading {}", fault::name(&path)), vertex.count);
    let mut packed = || {
        let points = packed::read(&mut reader, &header, length, progress)?;
        Ok(Contents { points, ..Contents::default() })
    };
    let contents = match header.encoding {
        _ if packed::is_packed(&header) => packed(),
        Encoding::Ascii => ascii::read(reader, &header, length, Faces::default(), progress),
        Encoding::LittleEndian => binary::read::<false>(reader, &header, length, Faces::default(), progress),
        Encoding::BigEndian => binary::read::<true>(reader, &header, length, Faces::default(), progress),
    };
    progress.end();
    let Contents { mut points, faces, tree, whole, collector } = contents.map_err(in_file)?;
    gaussian::settle(&mut points, [options.flatten, options.solid]).map_err(in_file)?;
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
    match collector {
        Some(collector) => collector.finish(&mut points, !triangles.triangles.is_empty()),
        None => of_positions(&mut points, &options.wanted),
    }
    .map_err(in_file)?;
    Ok((points, triangles, header.comments.textures))
}
