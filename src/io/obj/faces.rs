//! The `f` lines of an OBJ file, and the triangles that they make.

use glam::DVec3;

use crate::io::fault::Fault;
use crate::io::polygon;
use crate::io::values::shown;

/// The number of what a corner does not name.
const NONE: u32 = u32::MAX;

/// Texture coordinates among vertex, texture coordinates and normal.
const TEXTURE: usize = 1;

/// A corner of a face: which vertex, texture coordinates and normal of the file it names.
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
    /// Of each face where its corners end, and its material or [`NONE`].
    faces: Vec<(usize, u32)>,
    /// A corner without a normal, or without texture coordinates, was among them.
    lacks_normal: bool,
    lacks_texture: bool,
}

/// What corners name.
#[derive(Clone, Copy)]
pub(super) struct Named<'a> {
    pub(super) positions: &'a [[f64; 3]],
    pub(super) texture: &'a [[f32; 2]],
    pub(super) normals: &'a [[f64; 3]],
}

/// A triangle of a face.
pub(super) struct Triangle {
    /// The numbers of its vertices in the file.
    pub(super) vertices: [u32; 3],
    /// The normals that its corners name, if every corner of the file names one.
    pub(super) normals: Option<[[f64; 3]; 3]>,
    /// Its corners' texture coordinates, if every corner of the file names some.
    pub(super) texture: Option<[[f32; 2]; 3]>,
    /// The number of its material; `u32::MAX` before the first `usemtl`.
    pub(super) material: u32,
}

impl Faces {
    /// There is none.
    pub(super) fn is_empty(&self) -> bool {
        self.faces.is_empty()
    }

    /// Every corner names texture coordinates.
    pub(super) fn have_texture(&self) -> bool {
        !self.lacks_texture && !self.is_empty()
    }

    /// Adds the face of a line's `words`, of which a number below 0 counts back from the `count`s of what the file has so far; texture
    /// coordinates only if they are wanted.
    pub(super) fn add<'w>(
        &mut self,
        words: impl Iterator<Item = &'w [u8]> + Clone,
        counts: [usize; 3],
        (wants_texture, material, line): (bool, Option<usize>, u64),
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
                let wanted = part.filter(|_| kind != TEXTURE || wants_texture);
                let parsed = wanted.map(|part| part_of(part).ok_or_else(|| no_corner(line, word))).transpose()?;
                Ok(parsed.map(|number| place(number, counts[kind])))
            };
            let (vertex, texture, normal) = (named(0)?, named(TEXTURE)?, named(2)?);
            let vertex = vertex.ok_or_else(|| no_corner(line, word))?;
            self.lacks_normal |= normal.is_none();
            self.lacks_texture |= texture.is_none();
            self.corners.push(Corner { vertex, texture: texture.unwrap_or(NONE), normal: normal.unwrap_or(NONE) });
        }
        self.faces.push((self.corners.len(), material.map_or(NONE, |number| number as u32)));
        Ok(())
    }

    /// Fails if a corner names what the file, which has so many of each, has not. Of texture coordinates or normals that a file has none of at
    /// all none is missed: programs write their numbers anyway.
    pub(super) fn check(&mut self, counts: [usize; 3]) -> Result<(), Fault> {
        self.lacks_texture |= counts[TEXTURE] == 0;
        self.lacks_normal |= counts[2] == 0;
        for corner in &self.corners {
            let named = [corner.vertex, corner.texture, corner.normal];
            let beyond = |kind: &usize| named[*kind] != NONE && named[*kind] as usize >= counts[*kind];
            if let Some(kind) = (0..3).filter(|&kind| kind == 0 || counts[kind] > 0).find(beyond) {
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
        let texture = |corner: Corner| named.texture.get(corner.texture as usize).copied().unwrap_or_default();
        Triangle {
            vertices: corners.map(|corner| corner.vertex),
            normals: (!self.lacks_normal).then(|| corners.map(normal)),
            texture: (!self.lacks_texture).then(|| corners.map(texture)),
            material,
        }
    }
}

fn part_of(part: &[u8]) -> Option<i64> {
    std::str::from_utf8(part).ok()?.parse().ok()
}

/// The place of the `number`th of `count`, the first of which is 1, or, from the last one back, -1; of one that cannot be the place
/// after all there may be.
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
