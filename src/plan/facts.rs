//! What a renderer must know of all surfels together, looked up once and not for each frame. No view is in it.

use glam::DVec3;

use super::{MeshFacts, RenderOptions};
use crate::scene::texture::PlaceRange;
use crate::scene::{Atlas, Bounds, Colors, LevelFacts, Scene, Surfel, has_copies};

/// Where a surfel's colour comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ColorNeed {
    /// All surfels share one colour: none is stored, none is accumulated.
    Constant,
    /// A word of 8-bit sRGB each.
    Srgb8,
    /// Four f32 each.
    Linear,
    /// Four f32 each, of the texture's mean over the disk, and a place in the texture, which is looked up once a pixel.
    Textured,
    /// Four f32 each and the terms of spherical harmonics of this degree, which are summed once a splat.
    Harmonics(u32),
}

/// Surfels that are kept in [`Facts::sample`], about.
const SAMPLED: usize = 1024;

/// The ranges that a scene's values lie in, and its counts.
#[derive(Clone, Debug)]
pub struct Facts {
    /// [`Scene::origin`].
    pub origin: DVec3,
    /// Its surfels; where the scene holds a part of them, all.
    pub surfels: u64,
    /// The surfels of each of its inputs that has some ([`Scene::provenance`]), in their order.
    pub individuals: Vec<u64>,
    /// Its triangles.
    pub mesh: MeshFacts,
    /// [`Scene::bounds`].
    pub bounds: Bounds,
    /// The box of [`Scene::body`].
    pub body: Bounds,
    /// [`Scene::core`].
    pub core: Bounds,
    /// Smallest and largest colour, [`Scene::color_range`].
    pub color: ([f32; 4], [f32; 4]),
    /// [`Scene::encoded`].
    pub encoded: bool,
    /// Where the colours come from.
    pub colors: ColorNeed,
    /// The range of places in the textures, and how these lie.
    pub texture: Option<(PlaceRange, Atlas)>,
    /// [`Scene::largest_radius`].
    pub largest_radius: f32,
    /// [`Scene::largest_shorter`].
    pub largest_shorter: f32,
    /// [`Scene::oriented`].
    pub oriented: bool,
    /// [`Scene::closed`].
    pub closed: bool,
    /// Disks end at lines, [`Scene::clips`].
    pub clips: bool,
    /// Disks curve, [`Scene::caps`].
    pub caps: bool,
    /// Surfels have normals of their own, [`Scene::normals`].
    pub own_normals: bool,
    /// There is less than all of some surfel, [`Scene::fades`].
    pub fades: bool,
    /// Centres have trailing parts, [`Scene::low`].
    pub doubled: bool,
    /// One surfel has many copies, which can be drawn as one.
    pub copies: bool,
    /// Of nodes of levels of detail.
    pub levels: Option<LevelFacts>,
    /// Every so many surfels one, and its centre with all digits.
    pub sample: Vec<(Surfel, DVec3)>,
}

impl Facts {
    /// The longest half-axis of what may be drawn, world units.
    pub fn drawn_radius(&self, options: &RenderOptions) -> f32 {
        self.nodes_of(options).map_or(self.largest_radius, |nodes| nodes.largest_radius.max(self.largest_radius))
    }

    /// The longest shorter half-axis of what may be drawn, world units.
    pub fn drawn_shorter(&self, options: &RenderOptions) -> f32 {
        self.nodes_of(options).map_or(self.largest_shorter, |nodes| nodes.largest_shorter.max(self.largest_shorter))
    }

    /// Nodes that may be drawn, of a picture that asks for some.
    pub fn nodes_of(&self, options: &RenderOptions) -> Option<LevelFacts> {
        self.levels.filter(|_| !options.detail.is_finest())
    }

    /// Those of `scene`.
    pub fn of(scene: &Scene) -> Self {
        let ((low, high), has) = (scene.color_range(), scene.has());
        let step = scene.surfels.len().div_ceil(SAMPLED).max(1);
        Self {
            origin: scene.origin,
            surfels: scene.part_of.as_ref().map_or(scene.surfels.len() as u64, |whole| whole.surfels.into()),
            individuals: scene.provenance.ranges(scene.surfels.len() as u64).map(|own| own.end - own.start).collect(),
            mesh: MeshFacts::of(&scene.triangles),
            bounds: scene.bounds(),
            body: scene.body().0,
            core: scene.core(),
            color: (low, high),
            encoded: scene.encoded,
            colors: match &scene.colors {
                Colors::Textured(_) => ColorNeed::Textured,
                _ if low == high => ColorNeed::Constant,
                Colors::Constant(_) => ColorNeed::Constant,
                Colors::Srgb8(_) => ColorNeed::Srgb8,
                Colors::Linear(_) => ColorNeed::Linear,
                Colors::Harmonics(harmonics) => ColorNeed::Harmonics(harmonics.degree()),
            },
            texture: match &scene.colors {
                Colors::Textured(textured) => Some((textured.range(), textured.atlas())),
                _ => None,
            },
            largest_radius: scene.largest_radius(),
            largest_shorter: scene.largest_shorter(),
            oriented: scene.oriented,
            closed: scene.closed,
            clips: has.clips,
            caps: has.caps,
            own_normals: has.normals,
            fades: !scene.fades.is_empty(),
            doubled: has.low,
            copies: has_copies(scene),
            levels: match &scene.part_of {
                Some(whole) => Some(whole.levels),
                None => scene.hierarchy.as_deref().map(LevelFacts::of),
            },
            sample: (0..scene.surfels.len()).step_by(step).map(|k| (scene.surfels[k], scene.center(k))).collect(),
        }
    }
}
