//! Facts of all surfels together, computed once per scene. They do not depend on the view.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::{MeshFacts, Settings};
use crate::scene::texture::PlaceRange;
use crate::scene::{Atlas, Bounds, Colors, LevelFacts, Scene, Surfel, has_copies};

/// The source of a surfel's colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum ColorNeed {
    /// All surfels share one colour: none is stored or accumulated.
    Constant,
    /// One word of 8-bit sRGB each.
    Srgb8,
    /// Four f32 each.
    Linear,
    /// Four f32 each for the texture's mean colour over the disk, and texture coordinates. The
    /// texture is looked up once per pixel.
    Textured,
    /// Four f32 each, and the terms of spherical harmonics of this degree, which are summed once
    /// per splat.
    Harmonics(u32),
}

/// Approximate number of surfels in [`Facts::sample`].
const SAMPLED: usize = 1024;

/// The ranges of a scene's values, and its counts.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Facts {
    /// [`Scene::origin`].
    pub origin: DVec3,
    /// Number of surfels of the whole scene, even if only a part is in memory.
    pub surfels: u64,
    /// Number of surfels of the share of the scene that is drawn here
    /// ([`share`](crate::passes::share)); `None` if all are.
    pub share: Option<u64>,
    /// Number of surfels of each non-empty input ([`Scene::provenance`]), in the order of the
    /// inputs.
    pub individuals: Vec<u64>,
    /// Facts of the scene's triangles.
    pub mesh: MeshFacts,
    /// [`Scene::bounds`].
    pub bounds: Bounds,
    /// The bounding box of [`Scene::body`].
    pub body: Bounds,
    /// [`Scene::core`].
    pub core: Bounds,
    /// Smallest and largest value of each colour channel, [`Scene::color_range`].
    pub color: ([f32; 4], [f32; 4]),
    /// [`Scene::encoded`].
    pub encoded: bool,
    /// The source of colours.
    pub colors: ColorNeed,
    /// The range of places in the textures, and the layout of the texture atlas.
    pub texture: Option<(PlaceRange, Atlas)>,
    /// [`Scene::largest_radius`].
    pub largest_radius: f32,
    /// [`Scene::largest_shorter`].
    pub largest_shorter: f32,
    /// [`Scene::oriented`].
    pub oriented: bool,
    /// [`Scene::closed`].
    pub closed: bool,
    /// Whether disks are clipped by lines, [`Scene::clips`].
    pub clips: bool,
    /// Whether disks are curved, [`Scene::caps`].
    pub caps: bool,
    /// Whether surfels are 3D Gaussians, [`Scene::thirds`].
    pub solid: bool,
    /// Whether surfels have normals of their own, [`Scene::normals`].
    pub own_normals: bool,
    /// Whether surfels belong to fading cuts, [`Scene::fades`].
    pub fades: bool,
    /// Whether centres have low parts, [`Scene::low`].
    pub doubled: bool,
    /// Whether one surfel has many copies, which can be drawn as one.
    pub copies: bool,
    /// Facts of the octree's nodes, if there are levels of detail.
    pub levels: Option<LevelFacts>,
    /// Every n-th surfel of the scene, with its centre in f64.
    #[serde(skip)]
    pub sample: Vec<(Surfel, DVec3)>,
}

impl Facts {
    /// Number of surfels that are drawn here: those of a share of the scene, or all.
    pub fn here(&self) -> u64 {
        self.share.unwrap_or(self.surfels)
    }

    /// The longest half-axis of all surfels and nodes that may be drawn, world units.
    pub fn drawn_radius(&self, options: &Settings) -> f32 {
        self.nodes_of(options).map_or(self.largest_radius, |nodes| nodes.largest_radius.max(self.largest_radius))
    }

    /// The largest shorter half-axis of all surfels and nodes that may be drawn, world units.
    pub fn drawn_shorter(&self, options: &Settings) -> f32 {
        self.nodes_of(options).map_or(self.largest_shorter, |nodes| nodes.largest_shorter.max(self.largest_shorter))
    }

    /// Facts of the nodes that may be drawn; `None` if the options ask for the finest level.
    pub fn nodes_of(&self, options: &Settings) -> Option<LevelFacts> {
        self.levels.filter(|_| !options.detail.is_finest())
    }

    /// Returns the facts of `scene`.
    pub fn of(scene: &Scene) -> Self {
        let ((low, high), has) = (scene.color_range(), scene.has());
        let step = scene.surfels.len().div_ceil(SAMPLED).max(1);
        Self {
            origin: scene.origin,
            surfels: scene.part_of.as_ref().map_or(scene.surfels.len() as u64, |whole| whole.surfels.into()),
            share: None,
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
            solid: !scene.thirds.is_empty(),
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
