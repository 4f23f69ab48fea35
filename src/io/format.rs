//! The supported formats, and how the format of a file is detected.

use std::path::Path;
use std::str::FromStr;

use super::off;
use super::values::BYTE_ORDER_MARK;
use crate::address;

/// A format of points or meshes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Polygon File Format (Turk 1994).
    Ply,
    /// LAS, or its compressed form LAZ.
    Las,
    /// Wavefront OBJ.
    Obj,
    /// ASTM E2807; needs the feature `e57`.
    E57,
    /// Point Cloud Library; needs the feature `pcd`.
    Pcd,
    /// Text with a point per line.
    Xyz,
    /// Text of a scanner with the number of points in front.
    Pts,
    /// Text of a scanner with the pose of each scan.
    Ptx,
    /// Triangles of stereolithography, in binary or text.
    Stl,
    /// Polygons of Geomview.
    Off,
    /// Scenes of glTF 2.0, in text or binary; needs the feature `gltf`.
    Gltf,
}

/// A format that is known by name and not read.
struct Unread {
    extensions: &'static [&'static str],
    /// The first bytes; empty if the format has no signature.
    start: &'static [u8],
    what: &'static str,
    /// Advice for users.
    instead: &'static str,
}

/// Advice for formats of Gaussians.
const BY_SPLATS: &str = "convert it to PLY with SuperSplat or splat-transform";

/// Advice for formats of meshes.
const BY_MESHES: &str = "convert it to glTF, PLY or OBJ, for example with Blender or with `assimp export`";

const UNREAD: [Unread; 7] = [
    Unread { extensions: &["spz"], start: b"NGSP", what: "an SPZ file of Gaussians", instead: BY_SPLATS },
    Unread { extensions: &["splat"], start: b"", what: "a .splat file of Gaussians", instead: BY_SPLATS },
    Unread { extensions: &["ksplat"], start: b"", what: "a .ksplat file of Gaussians", instead: BY_SPLATS },
    Unread { extensions: &["sog"], start: b"", what: "a SOG file of Gaussians", instead: BY_SPLATS },
    Unread { extensions: &["fbx"], start: b"Kaydara FBX", what: "an FBX file", instead: BY_MESHES },
    Unread { extensions: &["3mf"], start: b"", what: "a 3MF file", instead: BY_MESHES },
    Unread { extensions: &["dae"], start: b"", what: "a COLLADA file", instead: BY_MESHES },
];

impl Format {
    /// File extensions of the formats that this build reads.
    pub const READ: &[(&str, Self)] = &[
        ("ply", Self::Ply),
        ("las", Self::Las),
        ("laz", Self::Las),
        ("obj", Self::Obj),
        #[cfg(feature = "e57")]
        ("e57", Self::E57),
        #[cfg(feature = "pcd")]
        ("pcd", Self::Pcd),
        ("xyz", Self::Xyz),
        ("txt", Self::Xyz),
        ("csv", Self::Xyz),
        ("asc", Self::Xyz),
        ("pts", Self::Pts),
        ("ptx", Self::Ptx),
        ("stl", Self::Stl),
        ("off", Self::Off),
        #[cfg(feature = "gltf")]
        ("glb", Self::Gltf),
        #[cfg(feature = "gltf")]
        ("gltf", Self::Gltf),
    ];

    /// The formats that hold meshes.
    pub const MESHES: &[Self] = &[Self::Obj, Self::Ply, Self::Stl, Self::Off, Self::Gltf];

    /// Whether a name is that of a LAS file.
    pub(crate) fn is_las(path: &Path) -> bool {
        Self::of_name(&address::shown(path)) == Some(Self::Las)
    }

    /// Whether the reader of a remote file of this format asks for parts of it.
    #[cfg(feature = "http")]
    pub(super) fn is_read_in_part(self) -> bool {
        matches!(self, Self::Las | Self::Ply)
    }

    /// The names in [`Self::READ`] as a part of a sentence: `PLY, LAS, LAZ and OBJ`.
    pub fn sentence() -> String {
        Self::joined(Self::READ.iter().map(|(name, _)| *name))
    }

    /// File extensions of [`Self::MESHES`].
    pub fn mesh_names() -> impl Iterator<Item = &'static str> {
        Self::READ.iter().filter(|row| Self::MESHES.contains(&row.1)).map(|(name, _)| *name)
    }

    /// [`Self::mesh_names`] as a part of a sentence.
    pub fn meshes_sentence() -> String {
        Self::joined(Self::mesh_names())
    }

    fn joined<'a>(names: impl Iterator<Item = &'a str>) -> String {
        let names: Vec<_> = names.map(str::to_ascii_uppercase).collect();
        match names.split_last() {
            Some((last, others)) if !others.is_empty() => format!("{} and {last}", others.join(", ")),
            _ => names.concat(),
        }
    }

    /// The format that a file's extension (upper or lower case) names, even if this build cannot
    /// read it.
    pub(super) fn of_name(path: &Path) -> Option<Self> {
        match path.extension()?.to_str()?.to_ascii_lowercase().as_str() {
            "e57" => Some(Self::E57),
            "pcd" => Some(Self::Pcd),
            "glb" | "gltf" => Some(Self::Gltf),
            other => other.parse().ok(),
        }
    }

    /// Describes a file of a known but unsupported format, by its extension or first bytes.
    pub(super) fn unread(path: &Path, start: &[u8]) -> Option<String> {
        let extension = path.extension().and_then(|extension| extension.to_str()).map(str::to_ascii_lowercase);
        let named = |name: &str| extension.as_deref() == Some(name);
        if start.starts_with(&[0x1f, 0x8b]) && !named("spz") {
            return Some("it is compressed by gzip: unpack it first".into());
        }
        let starts = |row: &&Unread| !row.start.is_empty() && start.starts_with(row.start);
        let is_named = |row: &&Unread| row.extensions.iter().any(|name| named(name));
        let Unread { what, instead, .. } = UNREAD.iter().find(starts).or_else(|| UNREAD.iter().find(is_named))?;
        Some(format!("it is {what}, which is not read: {instead}"))
    }

    /// The format that a file's first bytes identify. OBJ files have no signature.
    pub(super) fn of_start(start: &[u8]) -> Option<Self> {
        if start.starts_with(b"LASF") {
            return Some(Self::Las);
        }
        if start.starts_with(b"ASTM") {
            return Some(Self::E57);
        }
        if start.starts_with(b"glTF") || is_json(start) {
            return Some(Self::Gltf);
        }
        let text = start.strip_prefix(BYTE_ORDER_MARK).unwrap_or(start);
        if text.strip_prefix(b"ply").is_some_and(|rest| rest.first().is_some_and(u8::is_ascii_whitespace)) {
            return Some(Self::Ply);
        }
        let word_end = text.iter().position(|byte| !byte.is_ascii_alphabetic()).unwrap_or(text.len());
        match &text[..word_end] {
            b"solid" => return Some(Self::Stl),
            word if off::is_first_word(word) => return Some(Self::Off),
            _ => {}
        }
        let comment = text.strip_prefix(b"#").unwrap_or_default().trim_ascii_start();
        let begins = |text: &[u8], word: &[u8]| text.get(..word.len()).is_some_and(|t| t.eq_ignore_ascii_case(word));
        (begins(comment, b".PCD") || begins(text, b"VERSION ") || begins(text, b"FIELDS ")).then_some(Self::Pcd)
    }
}

impl Format {
    /// The reason why the first bytes of a stream cannot be of this format; None if they can.
    pub(super) fn fault_of_start(self, start: &[u8]) -> Option<String> {
        let name = format!("{self:?}").to_ascii_uppercase();
        let fits = match self {
            Self::Ply | Self::Las | Self::E57 | Self::Gltf => Self::of_start(start) == Some(self),
            // The header of a binary file may be zero, but not the number of triangles after it.
            Self::Stl => start.is_empty() || start.iter().any(|byte| *byte != 0),
            // Text may begin with anything but two zero bytes; in UTF-16, every other byte may be
            // zero.
            Self::Obj | Self::Pcd | Self::Xyz | Self::Pts | Self::Ptx | Self::Off => !start.starts_with(&[0, 0]),
        };
        let first = if self == Self::Ply { "line is not 'ply'" } else { "bytes do not match that format" };
        (!fits).then(|| format!("it is not a {name} file: its first {first}"))
    }
}

/// Whether text starts with an object in JSON.
fn is_json(start: &[u8]) -> bool {
    let text = start.strip_prefix(BYTE_ORDER_MARK).unwrap_or(start).trim_ascii_start();
    text.strip_prefix(b"{").is_some_and(|rest| rest.trim_ascii_start().starts_with(b"\""))
}

impl FromStr for Format {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let known = Self::READ.iter().find(|(name, _)| *name == text);
        known.map(|(_, format)| *format).ok_or_else(|| format!("{} files are read, not `{text}`", Self::sentence()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_of_gaussians_that_are_not_read_are_named() {
        let unread = |name: &str, start: &[u8]| Format::unread(Path::new(name), start).unwrap_or_default();
        for (name, start, word) in [
            ("a.spz", &b"\x1f\x8b\x08\x00"[..], "SPZ"),
            ("a.SPZ", b"NGSP\x04\0\0\0", "SPZ"),
            ("a.bin", b"NGSP\x02\0\0\0", "SPZ"),
            ("-", b"NGSP\x03\0\0\0", "SPZ"),
            ("a.splat", b"\0\0\x80\x3f", ".splat"),
            ("a.Splat", b"", ".splat"),
            ("a.ksplat", b"\0\x01", ".ksplat"),
            ("a.sog", b"PK\x03\x04", "SOG"),
            ("a.ply.gz", b"\x1f\x8b\x08", "gzip"),
        ] {
            assert!(unread(name, start).contains(word), "{name}: {}", unread(name, start));
        }
        assert_eq!(unread("a.bin", b"1 2 3"), "");
    }
}
