//! The files that a file refers to, directly or indirectly: meshes, material libraries, images.

use std::collections::BTreeSet;
use std::io::Seek;
use std::path::{Path, PathBuf};

use super::{Format, Input, obj, ply};
use crate::{Error, Result};

/// All files that are read together with the one at `path`, whether they exist or not.
///
/// A PLY file may name a mesh and textures. An OBJ file may name material libraries, which may name
/// images. A glTF file may name buffers and images. A named mesh is searched in turn. The list is
/// empty for other files, and for files that cannot be read. The file is opened as by
/// [`Input::open`]. A pipe is read to its end, and the next [`Input::open`] uses the copy.
///
/// # Errors
///
/// The errors of [`Input::open`] for a pipe, because it cannot be opened again.
pub fn companions(path: &Path, format: Option<Format>) -> Result<Vec<PathBuf>> {
    let mut found = names_in(path, format, is_stream(path))?;
    let mut known: BTreeSet<PathBuf> = found.iter().cloned().collect();
    let mut looked_at = 0;
    while looked_at < found.len() {
        // An image names no files: its first bytes show that it is no mesh.
        for named in names_in(&found[looked_at], None, false).unwrap_or_default() {
            if known.insert(named.clone()) {
                found.push(named);
            }
        }
        looked_at += 1;
    }
    Ok(found)
}

fn is_stream(path: &Path) -> bool {
    path == Path::new("-") || std::fs::metadata(path).is_ok_and(|there| !there.is_file() && !there.is_dir())
}

/// The files that a file names directly.
fn names_in(path: &Path, format: Option<Format>, stream: bool) -> Result<Vec<PathBuf>> {
    // A pipe that another file names is never opened.
    if !stream && !std::fs::metadata(path).is_ok_and(|there| there.is_file()) {
        return Ok(Vec::new());
    }
    let mut input = match Input::open(path, format) {
        Ok(input) => input,
        Err(error) if stream => return Err(error),
        Err(_) => return Ok(Vec::new()),
    };
    // Names are relative to the folder that readers use; for standard input this is the current
    // folder.
    let own = if path == Path::new("-") { Path::new("") } else { path };
    // Only files of this system are searched for names.
    let Some(source) = input.source.file() else { return Ok(Vec::new()) };
    let named = match input.format {
        Format::Ply => ply::companions(source, own),
        Format::Obj => obj::companions(source, own),
        #[cfg(feature = "gltf")]
        Format::Gltf => super::gltf::companions(source, own),
        _ => Vec::new(),
    };
    let ready = if stream { input.keep(path) } else { input.source.rewind() };
    ready.map_err(|error| Error::read(path, error))?;
    Ok(named)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use std::fs;

    #[test]
    fn meshes_name_their_libraries_and_images() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let of = |name: &str, text: &str| {
            fs::write(at(name), text).unwrap();
            companions(&at(name), None).unwrap()
        };
        fs::write(at("a.mtl"), "newmtl x\nmap_Kd -s 2 2 wood fine.png\n\tbump  sub\\b.jpg\nKd 1 1 1\n").unwrap();
        let named = of("m.OBJ", "mtllib lost.mtl\nv 0 0 0\n  mtllib a.mtl\r\n");
        assert_eq!(named, ["lost.mtl", "a.mtl", "wood fine.png", "sub/b.jpg"].map(at));
        let header =
            "ply\nformat ascii 1.0\ncomment TextureFile t.png\nelement vertex 0\nproperty float x\nend_header\n";
        assert_eq!(of("m.ply", header), [at("t.png")]);
        assert!(of("m.las", header).is_empty() && of("bad.ply", "ply\n").is_empty());
        assert!(companions(&at("none.obj"), None).unwrap().is_empty());
        assert!(companions(folder.path(), None).unwrap().is_empty());
        // The extension does not matter if the format is given, and the text may be UTF-16.
        let utf16: Vec<u8> = "\u{feff}mtllib a.mtl\n".encode_utf16().flat_map(u16::to_le_bytes).collect();
        fs::write(at("m.dat"), utf16).unwrap();
        assert!(companions(&at("m.dat"), None).unwrap().is_empty());
        assert_eq!(companions(&at("m.dat"), Some(Format::Obj)).unwrap(), named[1..]);
        assert_eq!(of("p.dat", header), [at("t.png")]);
    }

    #[test]
    fn what_is_named_names_others_in_turn_and_a_circle_ends() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let ply = |comments: &str| {
            format!(
                "ply\nformat ascii 1.0\ncomment epsplat 1\n{comments}element vertex 0\nproperty float x\nend_header\n"
            )
        };
        fs::write(at("a.ply"), ply("comment triangles b.obj\n")).unwrap();
        fs::write(at("b.obj"), "mtllib c.mtl\n").unwrap();
        fs::write(at("c.mtl"), "newmtl x\nMAP_KD d.png\n").unwrap();
        assert_eq!(companions(&at("a.ply"), None).unwrap(), ["b.obj", "c.mtl", "d.png"].map(at));
        fs::write(at("e.ply"), ply("comment triangles f.ply\n")).unwrap();
        fs::write(at("f.ply"), ply("comment triangles e.ply\ncomment TextureFile g.png\n")).unwrap();
        assert_eq!(companions(&at("e.ply"), None).unwrap(), ["f.ply", "g.png", "e.ply"].map(at));
    }
}
