//! The supported formats, and how the format of a file is detected.

use std::path::Path;
use std::str::FromStr;

use super::values::BYTE_ORDER_MARK;

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
}

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
    ];

    /// The names in [`Self::READ`] as a part of a sentence: `PLY, LAS, LAZ and OBJ`.
    pub fn sentence() -> String {
        let names: Vec<_> = Self::READ.iter().map(|(name, _)| name.to_ascii_uppercase()).collect();
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
            other => other.parse().ok(),
        }
    }

    /// Describes a file of a known but unsupported format, by its extension or first bytes.
    pub(super) fn unread(path: &Path, start: &[u8]) -> Option<String> {
        let extension = path.extension().and_then(|extension| extension.to_str()).map(str::to_ascii_lowercase);
        let named = |name: &str| extension.as_deref() == Some(name);
        let what = match start {
            [b'N', b'G', b'S', b'P', ..] => "an SPZ file of Gaussians",
            [0x1f, 0x8b, ..] if named("spz") => "an SPZ file of Gaussians",
            [0x1f, 0x8b, ..] => return Some("it is compressed by gzip: unpack it first".into()),
            _ if named("spz") => "an SPZ file of Gaussians",
            _ if named("splat") => "a .splat file of Gaussians",
            _ if named("ksplat") => "a .ksplat file of Gaussians",
            _ if named("sog") => "a SOG file of Gaussians",
            _ => return None,
        };
        Some(format!("it is {what}, which is not read: convert it to PLY with SuperSplat or splat-transform"))
    }

    /// The format that a file's first bytes identify. OBJ files have no signature.
    pub(super) fn of_start(start: &[u8]) -> Option<Self> {
        if start.starts_with(b"LASF") {
            return Some(Self::Las);
        }
        if start.starts_with(b"ASTM") {
            return Some(Self::E57);
        }
        let text = start.strip_prefix(BYTE_ORDER_MARK).unwrap_or(start);
        if text.strip_prefix(b"ply").is_some_and(|rest| rest.first().is_some_and(u8::is_ascii_whitespace)) {
            return Some(Self::Ply);
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
            Self::Ply | Self::Las | Self::E57 => Self::of_start(start) == Some(self),
            // Text may begin with anything but two zero bytes; in UTF-16, every other byte may be
            // zero.
            Self::Obj | Self::Pcd => !start.starts_with(&[0, 0]),
        };
        let first = if self == Self::Ply { "line is not 'ply'" } else { "bytes do not match that format" };
        (!fits).then(|| format!("it is not a {name} file: its first {first}"))
    }
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
