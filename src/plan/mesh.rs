//! Facts of a scene's triangles, and what the kernels need for them.

use std::borrow::Cow;

use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::scene::{Bounds, Camera, Join, Mipmap, Projection, Triangles};

/// Counts, attributes and bounding box of a scene's triangles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MeshFacts {
    /// Number of distinct corner positions.
    pub vertices: u64,
    /// Number of triangles.
    pub triangles: u64,
    /// Whether corners have normals.
    pub normals: bool,
    /// Whether corners differ in colour.
    pub colored: bool,
    /// Whether triangles have textures.
    pub textured: bool,
    /// Whether points of triangles are left out, because their image is transparent there.
    pub cut: bool,
    /// Whether corner positions have low parts ([`Triangles::low`]).
    pub doubled: bool,
    /// The bounding box of all corners, in world units relative to the scene's origin.
    pub bounds: Bounds,
}

/// Border around the image, in pixels, within which a box still counts as visible.
const BORDER: f64 = 1.0;

/// Whether the view of `camera` may show part of a box relative to `origin`. It shows nothing of a
/// box that lies entirely before the near depth or beyond one side of the image.
pub(crate) fn in_view(bounds: &Bounds, origin: DVec3, camera: &Camera) -> bool {
    if camera.optics.is_some() {
        return !bounds.is_empty();
    }
    let corner = |k: usize| {
        let [x, y, z] = [0, 1, 2].map(|axis| if k >> axis & 1 == 0 { bounds.min[axis] } else { bounds.max[axis] });
        camera.to_camera(origin + DVec3::new(x, y, z))
    };
    let [width, height] = [camera.width, camera.height].map(f64::from);
    // Distance of a corner inside each limit; for a pinhole it is multiplied by the depth. Each
    // distance is linear in the position, so the corners bound the whole box.
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
    /// Returns the facts of `triangles`.
    pub fn of(triangles: &Triangles) -> Self {
        Self {
            vertices: triangles.vertices().len() as u64,
            triangles: triangles.len() as u64,
            normals: !triangles.normals().is_empty(),
            colored: triangles.colors().len() > 1,
            textured: !triangles.paint().is_empty(),
            cut: triangles.are_cut(),
            doubled: !triangles.low().is_empty(),
            bounds: bounds_of(triangles),
        }
    }
}

/// The bounding box of the corners of `triangles`, in world units relative to the scene's origin.
pub(crate) fn bounds_of(triangles: &Triangles) -> Bounds {
    let wide = |part: &[f32; 3]| DVec3::from_array(part.map(f64::from));
    let low = |vertex: usize| triangles.low().get(vertex).map_or(DVec3::ZERO, wide);
    let corners = triangles.vertices().iter().enumerate().map(|(vertex, high)| wide(high) + low(vertex));
    corners.fold(Bounds::EMPTY, Bounds::with_point)
}

/// The needs of triangles.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct MeshNeeds {
    /// How splats and triangles are joined where they meet.
    pub join: Join,
    /// Corners have normals; otherwise triangles are flat facets.
    pub normals: bool,
    /// Corners differ in colour.
    pub colored: bool,
    /// Triangles have textures.
    pub textured: bool,
    /// Points of triangles are left out, because their image is transparent there.
    pub cut: bool,
    /// The f32 positions of corners omit visible digits, so their low parts are stored too.
    pub doubled: bool,
    /// Triangles that face away are left out.
    pub cull_back: bool,
    /// The nearest triangle is found in one pass, by 64-bit atomics.
    pub once: bool,
    /// The surfels' colours are sRGB codes, so those of triangles are encoded before they are
    /// joined.
    pub coded: bool,
}

impl MeshNeeds {
    /// Words of the normals of a triangle's three corners.
    pub fn normal_words(&self) -> u32 {
        if self.normals { 9 } else { 0 }
    }

    /// Word offset of the texture coordinates in a triangle's attributes.
    pub fn places_at(&self) -> u32 {
        self.normal_words() + if self.colored { 12 } else { 0 }
    }

    /// Words of a triangle's attributes: normals, colours, texture coordinates, the texture's
    /// number, and the least alpha that shows if points are left out.
    pub fn words(&self) -> u32 {
        self.places_at() + if self.textured { 7 + u32::from(self.cut) } else { 0 }
    }

    /// The positions of corners: three words per vertex, or six with the low parts last.
    pub fn places<'a>(&self, triangles: &'a Triangles) -> Cow<'a, [f32]> {
        let vertices = triangles.vertices();
        if !self.doubled {
            return vertices.as_flattened().into();
        }
        vertices.iter().zip(triangles.low()).flat_map(|(high, low)| high.iter().chain(low).copied()).collect()
    }

    /// The attributes of `triangles`, one record each. If all have one colour, its twelve words
    /// precede the records. `others` textures precede those of the triangles.
    pub fn records(&self, triangles: &Triangles, others: u32) -> Vec<f32> {
        let common = triangles.colors().first().filter(|_| !self.colored).into_iter().flatten().flatten().copied();
        let mut words: Vec<f32> = common.collect();
        for triangle in 0..if self.words() > 0 { triangles.len() } else { 0 } {
            words.extend(triangles.normals().get(triangle).into_iter().flatten().flatten());
            words.extend(triangles.colors().get(triangle).filter(|_| self.colored).into_iter().flatten().flatten());
            if let Some(painted) = triangles.paint().get(triangle) {
                words.extend(painted.places.as_flattened());
                // The texture's number plus 1, or 0 for none. It is stored as a number, because an
                // f32 need not keep bits.
                words.push(painted.texture.checked_add(others + 1).unwrap_or(0) as f32);
                let least = triangles.textures().get(painted.texture as usize).map_or(0.0, Mipmap::least_alpha);
                words.extend(self.cut.then_some(least));
            }
        }
        words
    }
}

/// The bit of a width that is set if coordinates outside [0, 1] take the image's edge texels. No
/// image is that wide.
const CLAMPS: u32 = 1 << 31;

/// Packs textures into u32 words: the offset of each texture's head, then per texture its head and
/// texels. A head has the number of levels and, for each level, width, height and offset of the
/// texels. The width has `CLAMPS` set if the edges of the image are clamped.
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
