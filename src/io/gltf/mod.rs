//! glTF 2.0, as text (`.gltf`) or binary (`.glb`).

mod accessor;
mod buffers;
mod document;
mod materials;
mod nodes;
mod parts;

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use ::gltf::json::mesh::{Mode, Primitive, Semantic};
use ::gltf::json::validation::Checked;

use crate::io::about::{About, Attribute, Role};
use crate::io::beside::Beside;
use crate::io::fault::{self, Fault, reserve};
use crate::io::input::Local;
use crate::io::triangles::{Triangles, give_faces};
use crate::io::values::shown;
use crate::io::{Input, Paint, Points, ReadOptions, Up, dimensions};
use crate::scene::Colors;
use crate::{Progress, Result};
use buffers::Buffers;
use document::{Document, malformed};
use materials::Materials;
use nodes::Placed;
use parts::{Parts, Source, mode, size};

/// The most vertices and corners that a scene may have because its nodes share meshes: this many,
/// and so many more for each byte of its files. A vertex takes about a hundred bytes of memory.
const MOST_SHARED: u64 = 1 << 24;
const MOST_SHARED_PER_BYTE: u64 = 4;

/// Reads the default scene of a glTF file: its triangles, or its points if it has no triangles. If
/// no scene is the default, all nodes belong to it.
///
/// - Positions are those of the world: the transforms of nodes are applied in f64, and normals
///   follow by the inverse transpose. A transform that mirrors turns the winding. Up is y.
/// - Triangles come from triangles, strips and fans. Vertices of no triangle are left out. Lines
///   are left out with a note.
/// - Colours are linear: that of a vertex is `COLOR_0` times the base colour of its material. An
///   image is multiplied by the base colour, and by `COLOR_0` if all vertices of a primitive share
///   it. Texture coordinates may be transformed (`KHR_texture_transform`), and their origin becomes
///   bottom left.
/// - Alphas are ignored for `OPAQUE`, become 0 or 1 for `MASK` (those of texels before images are
///   filtered), and stay for `BLEND`.
/// - Buffers and images may lie in the file, in data URIs, or in files beside it. Accessors may be
///   sparse, normalized or quantised.
///
/// Skins, morph targets, animations and instances are not applied, and named in [`Points::notes`];
/// so are images that cannot be read.
///
/// # Errors
///
/// [`Error::Read`](crate::Error::Read) where the system cannot read,
/// [`Error::Malformed`](crate::Error::Malformed) if the file violates its format, ends early or
/// needs an extension that is not read, such as one that compresses geometry; also if its nodes
/// repeat meshes beyond the limit for a file of its size.
pub fn read(input: Input, options: &ReadOptions, progress: &dyn Progress) -> Result<Points> {
    let Local { mut file, length, path } = input.local()?;
    progress.begin(&format!("reading {}", fault::name(&path)), length);
    let read = bytes_of(&mut file, length).and_then(|bytes| {
        progress.advance(length);
        points(&bytes, &path, options)
    });
    progress.end();
    read.map_err(|fault| fault.of(&path))
}

/// The files that the glTF file at `path` names: buffers and images. Empty if it cannot be read.
pub(super) fn companions(file: &mut File, path: &Path) -> Vec<PathBuf> {
    let length = file.metadata().map_or(0, |metadata| metadata.len());
    let document = bytes_of(file, length).and_then(|bytes| Document::of(&bytes));
    let Ok(Document { root, .. }) = document else { return Vec::new() };
    let mut beside = Beside::of(path);
    let uris = root.buffers.iter().map(|buffer| &buffer.uri).chain(root.images.iter().map(|image| &image.uri));
    let files = uris.flatten().filter(|uri| buffers::data_of(uri).is_none());
    files.filter_map(|uri| buffers::file_of(uri, &mut beside).ok()).collect()
}

fn bytes_of(file: &mut File, length: u64) -> std::result::Result<Vec<u8>, Fault> {
    let mut bytes = Vec::new();
    reserve(&mut bytes, length)?;
    file.take(length).read_to_end(&mut bytes)?;
    Ok(bytes)
}

fn points(bytes: &[u8], path: &Path, options: &ReadOptions) -> std::result::Result<Points, Fault> {
    let document = Document::of(bytes)?;
    let buffers = Buffers::of(&document, bytes, path);
    let placed = nodes::placed(&document)?;
    check_size(&document, &placed, bytes.len() as u64 + buffers.length())?;
    let mut materials = Materials::of(&document, &buffers, path, options.ignore_alpha);
    let source = Source { document: &document, buffers: &buffers };
    let (mut mesh, mut cloud, mut found) = (Parts::default(), Parts::default(), Found::default());
    for of in &placed {
        found.add_node(of);
        for primitive in primitives(&document, of)? {
            match mode(primitive)? {
                Mode::Lines | Mode::LineLoop | Mode::LineStrip => found.has_lines = true,
                Mode::Points => cloud.add(source, primitive, &mut materials, &of.to_world)?,
                _ => mesh.add(source, primitive, &mut materials, &of.to_world)?,
            }
            found.add_primitive(primitive, &mut materials)?;
        }
    }
    let is_mesh = !mesh.triangles.is_empty();
    found.hidden = if is_mesh { cloud.positions.len() } else { 0 };
    let notes = found.notes(&document).chain(materials.notes()).collect();
    let mut points = if is_mesh { of_mesh(mesh, materials) } else { of_cloud(cloud) };
    (points.up, points.notes) = (Some(Up::Y), notes);
    points.about = options.describe.then(|| Box::new(about(&document, found.attributes)));
    dimensions::of_positions(&mut points, &options.wanted)?;
    Ok(points)
}

/// The primitives of a mesh in its place.
fn primitives<'a>(document: &'a Document, of: &Placed) -> std::result::Result<&'a [Primitive], Fault> {
    let mesh = document.root.meshes.get(of.mesh);
    let mesh = mesh.ok_or_else(|| malformed(format!("it names the mesh {}, which does not exist", of.mesh)))?;
    Ok(&mesh.primitives)
}

/// Refuses a scene that would need memory out of proportion to the `length` of its files.
fn check_size(document: &Document, placed: &[Placed], length: u64) -> std::result::Result<(), Fault> {
    let most = MOST_SHARED + MOST_SHARED_PER_BYTE * length;
    let mut sizes: Vec<Option<u64>> = vec![None; document.root.meshes.len()];
    let mut all = 0u64;
    for of in placed {
        let primitives = primitives(document, of)?;
        let size = match sizes[of.mesh] {
            Some(known) => known,
            None => {
                primitives.iter().try_fold(1, |sum: u64, own| size(document, own).map(|own| sum.saturating_add(own)))?
            }
        };
        sizes[of.mesh] = Some(size);
        all = all.saturating_add(size);
    }
    if all > most {
        return Err(malformed(format!(
            "its scene has {all} vertices and corners, more than {most}, the limit for files of {length} bytes"
        )));
    }
    Ok(())
}

/// Facts about a scene for notes and descriptions.
#[derive(Default)]
struct Found {
    has_lines: bool,
    has_skins: bool,
    has_instances: bool,
    /// The number of points that are not drawn.
    hidden: usize,
    has_targets: bool,
    /// The names of the attributes, and whether they are used.
    attributes: BTreeMap<String, bool>,
}

impl Found {
    fn add_node(&mut self, of: &Placed) {
        self.has_skins |= of.has_skin;
        self.has_instances |= of.has_instances;
    }

    fn add_primitive(
        &mut self,
        primitive: &Primitive,
        materials: &mut Materials<'_>,
    ) -> std::result::Result<(), Fault> {
        self.has_targets |= primitive.targets.as_ref().is_some_and(|targets| !targets.is_empty());
        let set = materials.look(primitive.material)?.map.map(|map| map.set);
        for semantic in primitive.attributes.keys() {
            let Checked::Valid(own) = semantic else { continue };
            let is_used = match own {
                Semantic::Positions | Semantic::Normals | Semantic::Colors(0) => true,
                Semantic::TexCoords(of) => Some(*of) == set,
                _ => false,
            };
            *self.attributes.entry(semantic.to_string()).or_default() |= is_used;
        }
        Ok(())
    }

    /// Sentences about what is not drawn as the file says.
    fn notes(&self, document: &Document) -> impl Iterator<Item = String> + use<> {
        let hidden = format!("{} points are left out, as the file has triangles too", self.hidden);
        let told = |is_so: bool, note: &str| is_so.then(|| note.to_owned());
        [
            told(self.hidden > 0, &hidden),
            told(self.has_lines, "lines are left out"),
            told(self.has_skins, "meshes with skins are drawn as they are stored, without the pose of their skin"),
            told(self.has_targets, "morph targets are left out: meshes have their base shape"),
            told(document.animations > 0, "animations are left out: the scene is drawn at rest"),
            told(self.has_instances, "nodes with instances are drawn once, as EXT_mesh_gpu_instancing is not read"),
        ]
        .into_iter()
        .flatten()
    }
}

/// The triangles with all that the file says about them.
fn of_mesh(mut parts: Parts, materials: Materials<'_>) -> Points {
    parts.fill();
    let paint = Paint {
        colors: if parts.has_materials || parts.has_colors { parts.paints } else { Vec::new() },
        textures: if parts.has_images { materials.numbers.all } else { Vec::new() },
        numbers: parts.numbers,
        places: parts.places,
    };
    let paint = (paint != Paint::default()).then(|| Box::new(paint));
    let mut points = Points {
        positions: parts.positions,
        normals: parts.has_normals.then_some(parts.normals),
        colors: parts.has_colors.then_some(Colors::Linear(parts.colors)),
        ..Points::default()
    };
    give_faces(&mut points, parts.triangles, paint);
    fill_normals(&mut points);
    points
}

/// Gives vertices without normals the normals of their triangles, beside others that have some.
/// Their corners keep none, so these triangles are flat, as the format demands.
fn fill_normals(points: &mut Points) {
    let (Some(normals), Some(faces)) = (&mut points.normals, &points.faces) else { return };
    let is_missing = |normal: &[f32; 3]| *normal == [0.0; 3];
    if faces.normals.is_none() || !normals.iter().any(is_missing) {
        return;
    }
    let mut around = Triangles::new(&points.positions);
    faces.triangles.iter().for_each(|corners| around.add(corners.map(|corner| corner as usize), None));
    let (own, _) = around.finish();
    normals.iter_mut().zip(own).filter(|(normal, _)| is_missing(normal)).for_each(|(normal, own)| *normal = own);
}

fn of_cloud(parts: Parts) -> Points {
    let is_colored = parts.has_colors || parts.has_materials;
    Points {
        normals: parts.has_normals.then_some(parts.normals),
        colors: is_colored.then_some(Colors::Linear(parts.colors)),
        positions: parts.positions,
        ..Points::default()
    }
}

/// The file's description of itself.
fn about(document: &Document, attributes: BTreeMap<String, bool>) -> About {
    let root = &document.root;
    let form = if document.binary.is_some() { "binary" } else { "text" };
    let counts = [
        (root.nodes.len(), "node"),
        (root.meshes.len(), "mesh"),
        (root.materials.len(), "material"),
        (root.images.len(), "image"),
    ];
    let counted = |(count, what): (usize, &str)| match (count, what) {
        (0, _) => None,
        (1, _) => Some(format!(", 1 {what}")),
        (_, "mesh") => Some(format!(", {count} meshes")),
        _ => Some(format!(", {count} {what}s")),
    };
    let counts: String = counts.into_iter().filter_map(counted).collect();
    let role = |name: &str| if name == "COLOR_0" { Role::Color } else { Role::Other };
    let attributes = attributes.into_iter().map(|(name, used)| Attribute::new(name.as_str(), used, role(&name)));
    About {
        format: format!("glTF {}, {form}{counts}", shown(root.asset.version.as_bytes())),
        software: root.asset.generator.as_ref().map(|generator| shown(generator.as_bytes())),
        attributes: attributes.collect(),
        ..About::default()
    }
}
