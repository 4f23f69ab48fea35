//! MTL: what the triangles of an OBJ file are made of.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;
use std::sync::Arc;

use crate::io::values::{finite, one_line};
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
    for library in libraries {
        match definitions(&folder.join(library)) {
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
        let read = Texture::read(&folder.join(map.replace('\\', "/"))).map(Arc::new);
        let texture = read.map_err(|error| notes.push(format!("a texture is left out: {error}"))).ok();
        images.push((map.to_owned(), texture.clone()));
        texture
    };
    let material = |name: &String| {
        let Some(found) = defined.iter().find(|material| material.name == *name) else {
            return Material { name: name.clone(), diffuse: [1.0; 4], texture: None };
        };
        let [r, g, b] = found.diffuse.unwrap_or([1.0; 3]).map(finite);
        let alpha = finite(found.dissolve.unwrap_or(1.0)).clamp(0.0, 1.0);
        let texture = found.diffuse_texture.as_deref().and_then(|map| image(file_of(map), notes));
        Material { name: name.clone(), diffuse: [r, g, b, alpha], texture }
    };
    names.iter().map(material).collect()
}

fn definitions(path: &Path) -> io::Result<Vec<tobj::Material>> {
    let mut bytes = Vec::new();
    File::open(path)?.take(LONGEST).read_to_end(&mut bytes)?;
    let text = String::from_utf8_lossy(&bytes);
    let (materials, _) = tobj::load_mtl_buf(&mut text.as_bytes()).map_err(io::Error::other)?;
    Ok(materials)
}

/// The file's name in what follows `map_Kd`: options before it begin with a dash.
fn file_of(map: &str) -> &str {
    if map.starts_with('-') { map.split_whitespace().next_back().unwrap_or(map) } else { map.trim() }
}
