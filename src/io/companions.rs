//! The files that a mesh names: material libraries, and images.

use std::fs::{self, File};
use std::io::{self, BufRead, BufReader};
use std::path::{Path, PathBuf};

use super::{obj, ply};

/// The files that the mesh at `path` names, whether they exist or not: the material libraries of an OBJ file and the images that
/// these name, the textures of a PLY file. None for other files, and for what cannot be read.
pub fn companions(path: &Path) -> Vec<PathBuf> {
    // A pipe can be read only once.
    if !fs::metadata(path).is_ok_and(|there| there.is_file()) {
        return Vec::new();
    }
    let extension = path.extension().map(|extension| extension.to_string_lossy().to_ascii_lowercase());
    match extension.as_deref() {
        Some("obj") => libraries(path).map_or(Vec::new(), |libraries| obj::companions(path, &libraries)),
        Some("ply") => ply::companions(path),
        _ => Vec::new(),
    }
}

/// What the lines `mtllib` of an OBJ file name.
fn libraries(path: &Path) -> io::Result<Vec<String>> {
    let mut reader = BufReader::with_capacity(1 << 18, File::open(path)?);
    let (mut line, mut libraries) = (Vec::new(), Vec::new());
    while reader.read_until(b'\n', &mut line)? > 0 {
        if let Some(names) = line.trim_ascii().strip_prefix(b"mtllib") {
            libraries.push(String::from_utf8_lossy(names.trim_ascii()).into_owned());
        }
        line.clear();
    }
    Ok(libraries)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn meshes_name_their_libraries_and_images() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let of = |name: &str, text: &str| {
            fs::write(at(name), text).unwrap();
            companions(&at(name))
        };
        fs::write(at("a.mtl"), "newmtl x\nmap_Kd -s 2 2 wood fine.png\n\tbump  sub\\b.jpg\nKd 1 1 1\n").unwrap();
        let named = of("m.OBJ", "mtllib lost.mtl\nv 0 0 0\n  mtllib a.mtl\r\n");
        assert_eq!(named, ["lost.mtl", "a.mtl", "wood fine.png", "sub/b.jpg"].map(at));
        let header =
            "ply\nformat ascii 1.0\ncomment TextureFile t.png\nelement vertex 0\nproperty float x\nend_header\n";
        assert_eq!(of("m.ply", header), [at("t.png")]);
        assert!(of("m.las", header).is_empty() && of("bad.ply", "ply\n").is_empty());
        assert!(companions(&at("none.obj")).is_empty() && companions(folder.path()).is_empty());
    }
}
