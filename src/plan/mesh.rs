//! What a renderer must know of the triangles of a scene, and what they need.

use std::borrow::Cow;

use glam::DVec3;

use crate::scene::{Bounds, Camera, Join, Mipmap, Projection, Triangles};

/// The counts of a scene's triangles, and what they have.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
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
    /// The box of all corners, world units relative to the scene's origin.
    pub bounds: Bounds,
}

/// Pixels about the image in which a box still counts as seen.
const BORDER: f64 = 1.0;

/// Whether the view of `camera` may show something of a box at `origin`: not if all of it lies
/// before the near depth or beyond one side of the image.
pub(crate) fn in_view(bounds: &Bounds, origin: DVec3, camera: &Camera) -> bool {
    let corner = |k: usize| {
        let [x, y, z] = [0, 1, 2].map(|axis| if k >> axis & 1 == 0 { bounds.min[axis] } else { bounds.max[axis] });
        camera.to_camera(origin + DVec3::new(x, y, z))
    };
    let [width, height] = [camera.width, camera.height].map(f64::from);
    // How far inside each limit a corner lies, in pixels times depth for a pinhole: linear, so that
    // corners tell of the whole box.
    let inside = |p: DVec3| {
        let depth = if camera.projection == Projection::Pinhole { p.z } else { 1.0 };
        let (x, y) = (camera.fx * p.x + camera.cx * depth, camera.fy * p.y + camera.cy * depth);
        let border = BORDER * depth;
        [p.z - camera.near, x + border, (width * depth + border) - x, y + border, (height * depth + border) - y]
    };
    let corners: [[f64; 5]; 8] = std::array::from_fn(|k| inside(corner(k)));
    !bounds.is_empty() && (0..5).all(|limit| corners.iter().any(|inside| inside[limit] >= 0.0))
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
            bounds: bounds_of(triangles),
        }
    }
}

/// The box of the corners of `triangles`, world units relative to the scene's origin.
pub(crate) fn bounds_of(triangles: &Triangles) -> Bounds {
    let wide = |part: &[f32; 3]| DVec3::from_array(part.map(f64::from));
    let low = |vertex: usize| triangles.low().get(vertex).map_or(DVec3::ZERO, wide);
    let corners = triangles.vertices().iter().enumerate().map(|(vertex, high)| wide(high) + low(vertex));
    corners.fold(Bounds::EMPTY, Bounds::with_point)
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
    /// The surfels' colours are codes of sRGB, and so those of triangles become codes before they
    /// are joined.
    pub coded: bool,
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

/// The words of textures on a device: where each one's head is, then the heads, the number of
/// levels and of each its width, its height and where its texels are, then the texels. A width has
/// `CLAMPS` beside it where the edges of the image go on.
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
