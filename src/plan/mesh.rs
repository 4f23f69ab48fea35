//! What a renderer must know of the triangles of a scene, and what they need.

use std::borrow::Cow;

use crate::scene::{Join, Mipmap, Triangles};

/// The counts of a scene's triangles, and what they have.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MeshFacts {
    /// Different places of corners.
    pub vertices: u64,
    /// Triangles.
    pub triangles: u64,
    /// Corners have normals.
    pub normals: bool,
    /// Corners differ in colour.
    pub colored: bool,
    /// Triangles are painted with textures.
    pub textured: bool,
    /// Corners have trailing parts, [`Triangles::low`].
    pub doubled: bool,
}

impl MeshFacts {
    /// Those of `triangles`.
    pub fn of(triangles: &Triangles) -> Self {
        Self {
            vertices: triangles.vertices().len() as u64,
            triangles: triangles.len() as u64,
            normals: !triangles.normals().is_empty(),
            colored: triangles.colors().len() > 1,
            textured: !triangles.paint().is_empty(),
            doubled: !triangles.low().is_empty(),
        }
    }
}

/// What triangles need.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct MeshNeeds {
    /// What shows where they meet splats.
    pub join: Join,
    /// Corners have normals; else triangles are facets.
    pub normals: bool,
    /// Corners differ in colour.
    pub colored: bool,
    /// Triangles are painted with textures.
    pub textured: bool,
    /// The f32 places of corners leave out digits that show, so trailing parts are stored too.
    pub doubled: bool,
    /// The nearest one is found in one pass, by 64-bit atomics.
    pub once: bool,
}

impl MeshNeeds {
    /// Words of the normals of a triangle's corners.
    pub fn normal_words(&self) -> u32 {
        if self.normals { 9 } else { 0 }
    }

    /// Where the places in a texture start in a triangle's attributes.
    pub fn places_at(&self) -> u32 {
        self.normal_words() + if self.colored { 12 } else { 0 }
    }

    /// Words of a triangle's attributes: normals, then colours, then places in a texture and its number.
    pub fn words(&self) -> u32 {
        self.places_at() + if self.textured { 7 } else { 0 }
    }

    /// The places of corners: three words a vertex, or six with trailing parts behind.
    pub fn places<'a>(&self, triangles: &'a Triangles) -> Cow<'a, [f32]> {
        let vertices = triangles.vertices();
        if !self.doubled {
            return vertices.as_flattened().into();
        }
        vertices.iter().zip(triangles.low()).flat_map(|(high, low)| high.iter().chain(low).copied()).collect()
    }

    /// The attributes of `triangles`, a record each; before them, if all have one colour, the twelve words of that. Before their textures
    /// are so many others.
    pub fn records(&self, triangles: &Triangles, others: u32) -> Vec<f32> {
        let common = triangles.colors().first().filter(|_| !self.colored).into_iter().flatten().flatten().copied();
        let mut words: Vec<f32> = common.collect();
        for triangle in 0..if self.words() > 0 { triangles.len() } else { 0 } {
            words.extend(triangles.normals().get(triangle).into_iter().flatten().flatten());
            words.extend(triangles.colors().get(triangle).filter(|_| self.colored).into_iter().flatten().flatten());
            if let Some(painted) = triangles.paint().get(triangle) {
                words.extend(painted.places.as_flattened());
                // One more, and 0 of none: as a number, not as bits, which no f32 need keep.
                words.push(painted.texture.checked_add(others + 1).unwrap_or(0) as f32);
            }
        }
        words
    }
}

/// The bit of a width that says that edges go on beyond [0, 1]. No image is so wide.
const CLAMPS: u32 = 1 << 31;

/// The words of textures on a device: where each one's head is, then the heads, the number of levels and of each its width, its height and where
/// its texels are, then the texels. A width has [`CLAMPS`] beside it where the edges of the image go on.
pub fn texture_words(textures: &[&Mipmap]) -> Vec<u32> {
    let mut words = vec![0; textures.len()];
    for (number, mipmap) in textures.iter().enumerate() {
        words[number] = words.len() as u32;
        let levels = mipmap.levels();
        words.push(levels.len() as u32);
        let mut texels = words.len() + 3 * levels.len();
        for level in levels {
            let [width, height] = level.size();
            words.extend([if level.clamps() { width | CLAMPS } else { width }, height]);
            words.push(texels as u32);
            texels += level.texels().len();
        }
        words.extend(levels.iter().flat_map(|level| level.texels()).map(|code| u32::from_le_bytes(*code)));
    }
    words
}
