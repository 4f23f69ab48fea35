//! The `f` lines of an OBJ file, and their triangles.

use glam::DVec3;

use crate::io::fault::Fault;
use crate::io::polygon;
use crate::io::values::shown;

/// Index of an attribute that a corner does not name.
const NONE: u32 = u32::MAX;

/// Index of texture coordinates among vertex, texture coordinates and normal.
const TEXTURE: usize = 1;

/// A corner of a face: indices of its vertex, texture coordinates and normal.
#[derive(Clone, Copy, Debug)]
struct Corner {
    vertex: u32,
    texture: u32,
    normal: u32,
}

/// The faces of a file.
#[derive(Debug, Default)]
pub(super) struct Faces {
    corners: Vec<Corner>,
    /// The end of each face's corners, and its material or [`NONE`].
    faces: Vec<(usize, u32)>,
    /// Some corner has no normal.
    lacks_normal: bool,
    /// Some corner has texture coordinates.
    has_texture: bool,
}

/// The context of a face, by which the numbers of its corners are resolved.
#[derive(Clone, Copy)]
pub(super) struct Numbering {
    /// Vertices, texture coordinates and normals so far; negative numbers count back from these.
    pub(super) counts: [usize; 3],
    /// The line number, for errors.
    pub(super) line: u64,
    /// Whether invalid texture coordinates are an error; otherwise the corner has none.
    pub(super) strict: bool,
}

/// The attributes that corners refer to.
#[derive(Clone, Copy)]
pub(super) struct Named<'a> {
    pub(super) positions: &'a [[f64; 3]],
    pub(super) texture: &'a [[f32; 2]],
    pub(super) normals: &'a [[f64; 3]],
}

/// A triangle of a face.
pub(super) struct Triangle {
    /// The indices of its vertices in the file.
    pub(super) vertices: [u32; 3],
    /// The normals of its corners; None unless every corner of the file names one.
    pub(super) normals: Option<[[f64; 3]; 3]>,
    /// The texture coordinates of its corners; all NaN if one of them has none.
    pub(super) texture: [[f32; 2]; 3],
    /// The index of its material; `u32::MAX` before the first `usemtl`.
    pub(super) material: u32,
}

impl Faces {
    /// Whether there is no face.
    pub(super) fn is_empty(&self) -> bool {
        self.faces.is_empty()
    }

    /// Whether some corner has texture coordinates.
    pub(super) fn have_texture(&self) -> bool {
        self.has_texture
    }

    /// Adds the face of a line's `words`, with the index of its material.
    pub(super) fn add<'w>(
        &mut self,
        words: impl Iterator<Item = &'w [u8]> + Clone,
        Numbering { counts, line, strict }: Numbering,
        material: Option<u32>,
    ) -> Result<(), Fault> {
        let words = words.take_while(|word| !word.starts_with(b"#"));
        // A face of one or two corners has no area.
        if words.clone().count() < 3 {
            return Ok(());
        }
        for word in words {
            let mut parts = word.split(|&byte| byte == b'/').map(Some).chain(std::iter::repeat(None));
            let mut named = |kind: usize| -> Result<Option<u32>, Fault> {
                let part = parts.next().flatten().filter(|part| !part.is_empty());
                let parsed = part.map(|part| part_of(part).ok_or_else(|| no_corner(line, word)));
                let parsed =
                    if kind == TEXTURE && !strict { parsed.and_then(Result::ok) } else { parsed.transpose()? };
                Ok(parsed.map(|number| place(number, counts[kind])))
            };
            let (vertex, texture, normal) = (named(0)?, named(TEXTURE)?, named(2)?);
            let vertex = vertex.ok_or_else(|| no_corner(line, word))?;
            self.lacks_normal |= normal.is_none();
            self.has_texture |= texture.is_some();
            self.corners.push(Corner { vertex, texture: texture.unwrap_or(NONE), normal: normal.unwrap_or(NONE) });
        }
        self.faces.push((self.corners.len(), material.unwrap_or(NONE)));
        Ok(())
    }

    /// Checks that all indices are below `counts`. Some programs write indices of texture
    /// coordinates or normals although the file has none at all; these indices are ignored. Unless
    /// `strict`, every invalid index of texture coordinates is ignored too.
    pub(super) fn check(&mut self, counts: [usize; 3], strict: bool) -> Result<(), Fault> {
        self.has_texture &= counts[TEXTURE] > 0;
        self.lacks_normal |= counts[2] == 0;
        let is_missed = |kind: usize| kind == 0 || counts[kind] > 0 && (strict || kind != TEXTURE);
        for corner in &self.corners {
            let named = [corner.vertex, corner.texture, corner.normal];
            let beyond = |kind: &usize| named[*kind] != NONE && named[*kind] as usize >= counts[*kind];
            if let Some(kind) = (0..3).filter(|&kind| is_missed(kind)).find(beyond) {
                return Err(missing(kind));
            }
        }
        Ok(())
    }

    /// The triangles of all faces.
    pub(super) fn triangles<'a>(&'a self, named: Named<'a>) -> impl Iterator<Item = Triangle> + 'a {
        let position = move |corner: &Corner| {
            named.positions.get(corner.vertex as usize).map_or(DVec3::NAN, |&position| position.into())
        };
        let starts = std::iter::once(0).chain(self.faces.iter().map(|(end, _)| *end));
        let of_face = move |(start, &(end, material)): (usize, &(usize, u32))| {
            let corners = &self.corners[start..end];
            let cut = match corners.len() {
                3 => vec![[0, 1, 2]],
                _ => polygon::triangles(&corners.iter().map(position).collect::<Vec<_>>()),
            };
            cut.into_iter().map(move |three| self.triangle(named, three.map(|k| corners[k]), material))
        };
        starts.zip(&self.faces).flat_map(of_face)
    }

    fn triangle(&self, named: Named<'_>, corners: [Corner; 3], material: u32) -> Triangle {
        let normal = |corner: Corner| named.normals.get(corner.normal as usize).copied().unwrap_or_default();
        let texture = |corner: Corner| named.texture.get(corner.texture as usize).copied().unwrap_or([f32::NAN; 2]);
        let places = corners.map(texture);
        let is_placed = places.as_flattened().iter().all(|turns| turns.is_finite());
        Triangle {
            vertices: corners.map(|corner| corner.vertex),
            normals: (!self.lacks_normal).then(|| corners.map(normal)),
            texture: if is_placed { places } else { [[f32::NAN; 2]; 3] },
            material,
        }
    }
}

fn part_of(part: &[u8]) -> Option<i64> {
    std::str::from_utf8(part).ok()?.parse().ok()
}

/// Converts an OBJ number to an index below `count`: 1 is the first, -1 the last. Invalid numbers
/// give `NONE - 1`, which is out of range but differs from [`NONE`].
fn place(number: i64, count: usize) -> u32 {
    let place = match number {
        1.. => Some(number - 1),
        _ => (count as i64).checked_add(number).filter(|_| number < 0),
    };
    place.and_then(|place| u32::try_from(place).ok()).unwrap_or(NONE - 1).min(NONE - 1)
}

fn no_corner(line: u64, word: &[u8]) -> Fault {
    Fault::Malformed(format!("line {line}: '{}' is not a corner of a face", shown(word)))
}

fn missing(kind: usize) -> Fault {
    let what = ["a vertex that does", "texture coordinates that do", "a normal that does"][kind];
    Fault::Malformed(format!("a face names {what} not exist"))
}
