//! The header of a PLY file (Turk 1994): encoding, elements and their properties.

use super::vertex::is_tree;
use crate::io::fault::Fault;
use crate::io::values::{BYTE_ORDER_MARK, line_end, shown};
use crate::io::{Up, Wanted};
use std::io::{BufRead, Read};

/// Longest line of a header, bytes. Comments can be long: some hold a processing history.
const LINE_LIMIT: u64 = 1 << 16;

/// The encoding of the values after the header.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    Ascii,
    LittleEndian,
    BigEndian,
}

/// The type of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Scalar {
    /// Parses a type name: those of the original format (`uchar`), and those with sizes (`uint8`).
    fn parse(name: &str) -> Option<Self> {
        Some(match name {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return None,
        })
    }

    /// Size in a binary file, bytes.
    pub(super) fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    pub(super) fn is_float(self) -> bool {
        matches!(self, Self::F32 | Self::F64)
    }
}

/// The type of a property: one number, or a list with a length in front.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Scalar(Scalar),
    List { count: Scalar, item: Scalar },
}

/// A property of an element.
#[derive(Clone, Debug)]
pub(super) struct Property {
    pub(super) name: String,
    pub(super) kind: Kind,
}

/// An element: `count` rows with the same properties.
#[derive(Clone, Debug)]
pub(super) struct Element {
    pub(super) name: String,
    pub(super) count: u64,
    pub(super) properties: Vec<Property>,
    pub(super) tints: Tints,
    /// Attributes that options ask for.
    pub(super) wanted: Wanted,
}

/// How the colours of rows are interpreted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Tints {
    /// epsplat wrote the file, so floats are known to be linear light.
    pub(super) own: bool,
    /// Alphas are ignored.
    pub(super) ignore_alpha: bool,
}

/// A parsed header.
#[derive(Clone, Debug)]
pub(super) struct Header {
    pub(super) encoding: Encoding,
    pub(super) elements: Vec<Element>,
    pub(super) comments: Comments,
    /// Lines up to and including `end_header`; an ASCII file's first value is on the next line.
    pub(super) lines: u64,
    /// The byte that ends a line.
    pub(super) line_end: u8,
}

/// Comments that readers act on. All but `textures` are epsplat's own.
#[derive(Clone, Debug, Default)]
pub(super) struct Comments {
    /// `TextureFile NAME`, which MeshLab writes: images of the mesh.
    pub(super) textures: Vec<String>,
    /// `up y` or `up z`: the axis that points up.
    pub(super) up: Option<Up>,
    /// `triangles NAME`: a mesh file that is drawn together with the surfels.
    pub(super) beside: Option<String>,
    /// `closed`: the surfels cover a closed surface.
    pub(super) closed: bool,
    /// `unsided`: normals do not tell the two sides of a surface apart.
    pub(super) unsided: bool,
    /// `hybrid`: the file is a mesh that `epsplat hybrid` writes beside surfels.
    pub(super) hybrid: bool,
    /// `epsplat VERSION`: epsplat wrote the file.
    own: bool,
}

impl Comments {
    fn hear(&mut self, comment: &str) {
        self.textures.extend(comment.strip_prefix("TextureFile ").map(|name| name.trim().to_owned()));
        let says_up = |up: &Up| comment.split_ascii_whitespace().eq(["up", up.name()]);
        self.up = [Up::Y, Up::Z].into_iter().find(says_up).or(self.up);
        self.closed |= comment == "closed";
        self.unsided |= comment == "unsided";
        self.own |= comment.starts_with("epsplat ");
        self.hybrid |= self.own && comment == "hybrid";
        // Other programs may use the same comment for something else.
        let named = comment.strip_prefix("triangles ").filter(|_| self.own);
        self.beside = named.map(|name| name.trim().to_owned()).or(self.beside.take());
    }
}

/// Reads a header up to and including the line `end_header`.
pub(super) fn read(reader: &mut impl BufRead) -> Result<Header, Fault> {
    let line_end = line_end(reader)?;
    let mut line = Vec::new();
    let mut encoding = None;
    let mut elements: Vec<Element> = Vec::new();
    let mut comments = Comments::default();
    for number in 1.. {
        line.clear();
        reader.take(LINE_LIMIT).read_until(line_end, &mut line)?;
        if number == 1 {
            if line.strip_prefix(BYTE_ORDER_MARK).unwrap_or(&line).trim_ascii_end() != b"ply" {
                return Err(Fault::Malformed("it is not a PLY file: its first line is not 'ply'".into()));
            }
            continue;
        }
        let complete = line.last() == Some(&line_end);
        let text = String::from_utf8_lossy(&line);
        let mut words = text.split_ascii_whitespace();
        let keyword = words.next();
        // If no values follow, the last line may lack its line end.
        if !complete && keyword != Some("end_header") {
            return Err(Fault::Malformed(if line.len() as u64 == LINE_LIMIT {
                format!("line {number} of the PLY header is longer than {LINE_LIMIT} bytes")
            } else {
                format!("the file ends inside the PLY header, at line {number}")
            }));
        }
        let malformed =
            |what: &str| Fault::Malformed(format!("line {number}: {what}: '{}'", shown(text.trim().as_bytes())));
        match keyword {
            None | Some("obj_info") => {}
            Some("comment") => {
                comments.hear(text.trim().strip_prefix("comment").unwrap_or_default().trim());
            }
            Some("format") => {
                let unread = "not a supported PLY format (ascii, binary_little_endian or binary_big_endian 1.0)";
                encoding = Some(format(words).ok_or_else(|| malformed(unread))?);
            }
            Some("element") => {
                let (Some(name), Some(count), None) = (words.next(), words.next(), words.next()) else {
                    return Err(malformed("an element needs a name and a count"));
                };
                let count = count.parse().map_err(|_| malformed("the element's count is not a number of rows"))?;
                elements.push(Element {
                    name: name.to_owned(),
                    count,
                    properties: Vec::new(),
                    tints: Tints::default(),
                    wanted: Wanted::default(),
                });
            }
            Some("property") => {
                let property = property(words).ok_or_else(|| malformed("not a property"))?;
                let element = elements.last_mut().ok_or_else(|| malformed("a property before any element"))?;
                element.properties.push(property);
            }
            Some("end_header") => {
                let encoding = encoding.ok_or_else(|| malformed("the PLY header has no format line"))?;
                let own = comments.own || elements.iter().any(is_tree);
                elements.iter_mut().for_each(|element| element.tints.own = own);
                return Ok(Header { encoding, elements, comments, lines: number, line_end });
            }
            Some(_) => return Err(malformed("not a PLY header line")),
        }
    }
    Err(Fault::Malformed("the PLY header has no end".into()))
}

/// Parses `ENCODING VERSION`; the version may be missing.
fn format<'a>(mut words: impl Iterator<Item = &'a str>) -> Option<Encoding> {
    let encoding = match words.next()? {
        "ascii" => Encoding::Ascii,
        "binary_little_endian" => Encoding::LittleEndian,
        "binary_big_endian" => Encoding::BigEndian,
        _ => return None,
    };
    words.next().is_none_or(|version| version == "1.0").then_some(encoding)
}

/// Parses `TYPE NAME` or `list COUNT ITEM NAME`.
fn property<'a>(mut words: impl Iterator<Item = &'a str>) -> Option<Property> {
    let kind = match words.next()? {
        "list" => {
            let count = Scalar::parse(words.next()?).filter(|count| !count.is_float())?;
            Kind::List { count, item: Scalar::parse(words.next()?)? }
        }
        scalar => Kind::Scalar(Scalar::parse(scalar)?),
    };
    // The format does not allow spaces in names, but programs write names of scalar fields with
    // spaces.
    let name = words.collect::<Vec<_>>().join(" ");
    (!name.is_empty()).then_some(Property { name, kind })
}
