//! MTL: what the triangles of an OBJ file are made of.

use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::encoding;
use crate::io::input::check_regular;
use crate::io::values::{BYTE_ORDER_MARK, finite, one_line};
use crate::io::{Material, Texture};

/// No material library is longer, in bytes.
const LONGEST: u64 = 1 << 24;

/// The materials of `names`, in their order, from the `libraries` that an OBJ file names. What cannot be read is said in
/// `notes`; a material that no library defines is white.
///
/// `Kd` is linear light, as a reflectivity is; `d` is alpha; an image of `map_Kd` is sRGB.
pub(super) fn read(path: &Path, libraries: &[String], names: &[String], notes: &mut Vec<String>) -> Vec<Material> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut defined = Vec::new();
    for library in libraries.iter().flat_map(|line| names_in(folder, line)) {
        match definitions(&beside(folder, library)) {
            Ok(materials) => defined.extend(materials),
            Err(error) => {
                notes.push(format!("the materials in {library} are left out: {}", one_line(&error.to_string())))
            }
        }
    }
    let mut images: Vec<(String, Option<Arc<Texture>>)> = Vec::new();
    let mut image = |map: &str, notes: &mut Vec<String>| {
        if let Some((_, known)) = images.iter().find(|(name, _)| name == map) {
            return known.clone();
        }
        let read = Texture::read(&beside(folder, map)).map(Arc::new);
        let texture = read.map_err(|error| notes.push(format!("a texture is left out: {error}"))).ok();
        images.push((map.to_owned(), texture.clone()));
        texture
    };
    let material = |name: &String| {
        let Some(found) = defined.iter().find(|material| material.name == *name) else {
            return Material { name: name.clone(), diffuse: [1.0; 4], texture: None, image: None };
        };
        let [r, g, b] = found.diffuse.unwrap_or([1.0; 3]).map(finite);
        let alpha = finite(found.dissolve.unwrap_or(1.0)).clamp(0.0, 1.0);
        let map = found.diffuse_texture.as_deref().map(file_of);
        let texture = map.and_then(|map| image(map, notes));
        let image = map.map(|map| beside(folder, map)).filter(|_| texture.is_some());
        Material { name: name.clone(), diffuse: [r, g, b, alpha], texture, image }
    };
    names.iter().map(material).collect()
}

/// The `libraries` that the OBJ file at `path` names, and the images that these name.
pub(super) fn companions(path: &Path, libraries: &[String]) -> Vec<PathBuf> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut files = Vec::new();
    for library in libraries.iter().flat_map(|line| names_in(folder, line)) {
        let library = beside(folder, library);
        let text = text_of(&library).unwrap_or_default();
        files.push(library);
        let images = text.lines().filter_map(|line| {
            let (keyword, image) = first_word(line.trim());
            let keyword = keyword.to_ascii_lowercase();
            let map =
                keyword.starts_with("map_") || matches!(&keyword[..], "bump" | "disp" | "decal" | "norm" | "refl");
            map.then(|| beside(folder, file_of(image)))
        });
        files.extend(images);
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

fn definitions(path: &Path) -> io::Result<Vec<tobj::Material>> {
    // At one line that it cannot read the parser gives up on all materials, so it is given no other lines than it must.
    let read = |line: &&str| matches!(line.split_whitespace().next(), Some("newmtl" | "Kd" | "d" | "map_Kd"));
    let text: Vec<String> = text_of(path)?.lines().filter(read).map(str::to_owned).collect();
    let (materials, _) = tobj::load_mtl_buf(&mut text.join("\n").as_bytes()).map_err(io::Error::other)?;
    Ok(materials)
}

/// A file that is named in one of `folder`, as Windows may write it.
fn beside(folder: &Path, name: &str) -> PathBuf {
    folder.join(name.replace('\\', "/"))
}

/// The files that follow `mtllib`: several between spaces, or one with spaces in its name.
fn names_in<'l>(folder: &Path, line: &'l str) -> Vec<&'l str> {
    let exists = |name: &str| beside(folder, name).exists();
    if !exists(line) && line.split_whitespace().any(exists) { line.split_whitespace().collect() } else { vec![line] }
}

/// The file's name, which may have spaces, in what follows `map_Kd`: options come before it.
fn file_of(map: &str) -> &str {
    let mut rest = map.trim();
    while rest.starts_with('-') {
        let (option, mut beyond) = first_word(rest);
        let (least, most) = match option {
            "-o" | "-s" | "-t" => (1, 3),
            "-mm" => (2, 2),
            "-blendu" | "-blendv" | "-bm" | "-boost" | "-cc" | "-clamp" | "-imfchan" | "-texres" | "-type" => (1, 1),
            _ => return rest,
        };
        for argument in 0..most {
            let (word, after) = first_word(beyond);
            if argument >= least && word.parse::<f64>().is_err() {
                break;
            }
            beyond = after;
        }
        rest = beyond;
    }
    rest
}

/// A text's first word, and what follows it.
fn first_word(text: &str) -> (&str, &str) {
    let (word, rest) = text.split_once(char::is_whitespace).unwrap_or((text, ""));
    (word, rest.trim_start())
}
