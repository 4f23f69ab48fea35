//! MTL: the materials of an OBJ file's triangles.

use std::collections::HashMap;
use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::{Path, PathBuf};

use super::library::{ColorMap, Definition, color_map, definitions, first_word};
use crate::Result;
use crate::io::beside::Beside;
use crate::io::encoding;
use crate::io::input::check_regular;
use crate::io::textures::Images;
use crate::io::values::{BYTE_ORDER_MARK, finite, one_line, shown};
use crate::io::{Material, Mesh};

/// Longest material library, bytes; the rest is ignored.
const LONGEST: u64 = 1 << 24;

/// Gives `mesh` its materials. Triangles have indices into `names`; `libraries` are the texts after
/// `mtllib` in the OBJ file at `path`. Texture coordinates are mapped by the options `-s` and `-o`
/// of the images.
///
/// Libraries and images that cannot be read are named in the notes of the mesh. A material that no
/// library defines is white. If none is defined at all, no triangle has a material.
///
/// `Kd` is linear light, as a reflectivity is; `d` is alpha; an image of `map_Kd` is sRGB.
///
/// # Errors
///
/// [`Error::Malformed`](crate::Error::Malformed) if all images together have too many pixels.
pub(super) fn give(mesh: &mut Mesh, path: &Path, libraries: &[String], names: Vec<String>) -> Result<()> {
    let mut beside = Beside::of(path);
    let defined = defined(&mut beside, libraries, &mut mesh.notes);
    if defined.is_empty() {
        mesh.material = None;
        return Ok(());
    }
    let (mut images, mut maps) = (Images::default(), Vec::with_capacity(names.len()));
    for name in names {
        let found = defined.get(&name);
        let map = found.and_then(|found| found.map.as_ref());
        let file = map.map(|map| beside.file(&map.name));
        let texture = match (map, &file) {
            (Some(map), Some(file)) => images.read(file, map.clamps, &mut mesh.notes)?,
            _ => None,
        };
        let diffuse = found.map_or([1.0; 4], diffuse);
        if texture.is_some() && diffuse[..3] == [0.0; 3] {
            let name = shown(name.as_bytes());
            mesh.notes.push(format!(
                "the material {name} is black, as its image is multiplied by its colour Kd, which is 0 0 0: set Kd 1 1 1 to show the image"
            ));
        }
        maps.push(map.filter(|_| texture.is_some()));
        mesh.materials.push(Material { name, diffuse, image: file.filter(|_| texture.is_some()), texture });
    }
    place(mesh, &maps);
    Ok(())
}

fn diffuse(definition: &Definition) -> [f32; 4] {
    let [r, g, b] = definition.diffuse.unwrap_or([1.0; 3]).map(finite);
    [r, g, b, finite(definition.dissolve.unwrap_or(1.0)).clamp(0.0, 1.0)]
}

/// Maps texture coordinates to positions in the images of their materials.
fn place(mesh: &mut Mesh, maps: &[Option<&ColorMap>]) {
    let (Some(places), Some(materials)) = (&mut mesh.texture, &mesh.material) else { return };
    for (places, material) in places.iter_mut().zip(materials) {
        let map = maps.get(*material as usize).copied().flatten();
        if let Some(map) = map.filter(|map| !map.is_plain()) {
            places.iter_mut().for_each(|place| *place = map.place(*place));
        }
    }
}

/// The materials of all libraries by name; the first definition of a name counts.
fn defined(beside: &mut Beside, libraries: &[String], notes: &mut Vec<String>) -> HashMap<String, Definition> {
    let mut defined = HashMap::new();
    for library in libraries.iter().flat_map(|line| names_in(beside, line)).collect::<Vec<_>>() {
        match text_of(&beside.file(library)) {
            Ok(text) => {
                definitions(&text).into_iter().for_each(|(name, own)| {
                    defined.entry(name).or_insert(own);
                });
            }
            Err(error) => {
                notes.push(format!("the materials in {library} are left out: {}", one_line(&error.to_string())))
            }
        }
    }
    defined
}

/// The paths of the `libraries` that the OBJ file at `path` names, and of the images that the
/// libraries name.
pub(super) fn companions(path: &Path, libraries: &[String]) -> Vec<PathBuf> {
    let mut beside = Beside::of(path);
    let mut files = Vec::new();
    for library in libraries.iter().flat_map(|line| names_in(&mut beside, line)).collect::<Vec<_>>() {
        let library = beside.file(library);
        let text = text_of(&library).unwrap_or_default();
        files.push(library);
        for line in text.lines() {
            let (keyword, image) = first_word(line.trim());
            let keyword = keyword.to_ascii_lowercase();
            let is_map =
                keyword.starts_with("map_") || matches!(keyword.as_str(), "bump" | "disp" | "decal" | "norm" | "refl");
            if let Some(map) = color_map(image).filter(|_| is_map) {
                files.push(beside.file(&map.name));
            }
        }
    }
    files
}

fn text_of(path: &Path) -> io::Result<String> {
    check_regular(path)?;
    let mut bytes = Vec::new();
    let (reader, _) = encoding::decoded(BufReader::new(File::open(path)?), LONGEST)?;
    reader.take(LONGEST).read_to_end(&mut bytes)?;
    Ok(String::from_utf8_lossy(bytes.strip_prefix(BYTE_ORDER_MARK).unwrap_or(&bytes)).into_owned())
}

/// The file names after `mtllib`: several, separated by spaces, or one that contains spaces.
fn names_in<'l>(beside: &mut Beside, line: &'l str) -> Vec<&'l str> {
    let mut exists = |name: &str| beside.file(name).exists();
    if !exists(line) && line.split_whitespace().any(&mut exists) {
        line.split_whitespace().collect()
    } else {
        vec![line]
    }
}
