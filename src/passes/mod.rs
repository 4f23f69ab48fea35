//! The stages, a file each: the equation with its source, the f64 twin (`reference`) and the GPU's recording
//! (`steps`), and its row (`PASS`). The order of a frame is [`render::sequence`](crate::render).
//!
//! | stage | takes | makes |
//! |---|---|---|
//! | [`order`] | [`Scene`] | the order of its surfels in memory |
//! | [`upload`] | a [`source::Source`] | pages of surfels |
//! | [`branches`], [`select`] | a tree of surfels | the cut that is drawn in place of all |
//! | [`cull`] | surfels, nearest depths so far | the batches that are projected |
//! | [`project`] | surfels | [`splat::Splat`] each |
//! | [`visibility`] | splats | the nearest depth of each pixel |
//! | [`accumulate`] | splats, nearest depths | [`accumulate::PixelSums`] |
//! | [`winner`] | splats | the same of the nearest fragment alone |
//! | [`fragments`], [`long_lists`] | splats | a list of each pixel's fragments |
//! | [`tiles`] | large splats, or all | the same two, or the image |
//! | [`moments`] | splats | what those of a pixel hold back, by depth |
//! | [`oit`] | splats | [`accumulate::PixelSums`] of all of them |
//! | [`individuals`] | sums of an input that is kept apart | what shows of it and of those before |
//! | [`triangles`] | triangles | what the nearest shows of each pixel |
//! | [`covered`] | nearest depths | the tiles that have anything |
//! | [`resolve`], [`join`] | sums, what triangles show | [`Frame`] |
//! | [`layers`], [`sorted`] | lists | [`Frame`] |
//!
//! [`index`] makes a map of its own. [`unseen`] says why none of them shows where none does.
//!
//! [`footprint`] is evaluated inside visibility and accumulate, with the [`homography`] and the [`lowpass`] that [`project`] prepared,
//! and the [`attributes`] that are blended; [`shared`] is what every kernel has.

pub mod accumulate;
pub mod attributes;
pub mod branches;
pub mod covered;
pub mod cull;
pub mod curved;
pub mod facing;
pub mod footprint;
pub mod fragments;
pub mod homography;
pub mod index;
pub mod individuals;
pub mod join;
pub mod layers;
pub mod lit;
pub mod long_lists;
pub mod lowpass;
pub mod moments;
pub mod oit;
pub mod order;
pub mod peel;
pub mod project;
pub mod raster;
pub mod resolve;
pub mod select;
pub mod shared;
pub mod sorted;
pub mod source;
pub mod splat;
pub mod tiles;
pub mod triangles;
pub mod unseen;
pub mod upload;
pub mod veils;
pub mod visibility;
pub mod winner;

use crate::frame::Frame;
use crate::plan::pass::{Making, Module, Pass};
use crate::plan::steps::{Stage, Twin};
use crate::plan::{Facts, Lists, Plan, RenderOptions, SceneNeeds, depths, farthest};
use crate::scene::{Camera, Map, Provenance, Scene};
use splat::Splat;
use triangles::Corner;

/// What a strip of the reference has for the twin of a pass.
pub struct Strip<'a> {
    /// What is rendered.
    pub scene: &'a Scene,
    /// The whole image's.
    pub camera: &'a Camera,
    /// How.
    pub options: &'a RenderOptions,
    /// Those that may touch its rows.
    pub splats: Vec<&'a Splat>,
    /// The scene's triangles' corners, as the camera sees them.
    pub corners: &'a [Corner],
    /// The place of each surfel in the [`order`] in which a device stores them, where a map asks for it.
    pub ranks: Option<&'a [u32]>,
    /// Where the scene's body starts and ends ([`depths`]), camera-space z, world units.
    pub depths: [f64; 2],
    /// [`Scene::largest_shorter`], world units.
    pub largest_shorter: f64,
    /// No surfel lies deeper ([`farthest`]), camera-space z, world units.
    pub farthest: f64,
    /// Its first row.
    pub first_row: u32,
    /// How many it has.
    pub rows: u32,
}

impl<'a> Strip<'a> {
    /// One without rows and splats, of the scene that `facts` are of.
    pub fn of((scene, facts): (&'a Scene, &Facts), camera: &'a Camera, options: &'a RenderOptions) -> Self {
        Self {
            scene,
            camera,
            options,
            splats: Vec::new(),
            corners: &[],
            ranks: None,
            depths: depths(facts, camera),
            largest_shorter: facts.drawn_shorter(options).into(),
            farthest: farthest(facts, camera, options),
            first_row: 0,
            rows: 0,
        }
    }
}

/// A map that a pass of its own makes, from splats and nearest depths, in words of the image that [`resolve`] leaves alone.
pub struct MapPass {
    /// The map.
    pub map: Map,
    /// Its name is the map's.
    pub pass: Pass,
    /// After the image of a band is resolved.
    pub runs: fn(&Plan, usize) -> Stage,
    /// What the host makes of a pixel's words, of the numbers of the surfels in the order in which they are stored.
    pub finish: fn(&mut [f32], &Provenance, &[u32]),
    /// The twin, of what is nearest.
    pub reference: fn(&Strip<'_>, &[visibility::Nearest], &mut Frame),
}

/// Those maps.
pub const MAP_PASSES: [&MapPass; 1] = [&index::MAP];

/// Those that `needs` ask for.
fn own_maps(needs: &SceneNeeds) -> impl Iterator<Item = &'static MapPass> {
    let maps = needs.maps;
    MAP_PASSES.into_iter().filter(move |own| maps.has(own.map))
}

/// The stages of such maps in a band.
pub fn of_maps(plan: &Plan, band: usize) -> impl Iterator<Item = Stage> {
    own_maps(&plan.needs).map(move |own| (own.runs)(plan, band).as_twin(Twin::Map(own.map)))
}

/// Whether a map, or what is sorted, asks for the order in which surfels are stored.
pub fn asks_for_order(needs: &SceneNeeds) -> bool {
    own_maps(needs).next().is_some() || needs.lists == Some(Lists::Sorted)
}

/// Makes of `frame`, as it was read back, what a user is given.
pub fn finish(frame: &mut Frame, needs: &SceneNeeds, provenance: &Provenance, order: &[u32]) {
    for own in own_maps(needs) {
        if let Some(words) = frame.map_mut(own.map) {
            (own.finish)(words, provenance, order);
        }
    }
}

/// The passes whose files every module has.
const PASSES: [&Pass; 25] = [
    &shared::PASS,
    &select::PASS,
    &project::PASS,
    &facing::PASS,
    &cull::PASS,
    &lowpass::PASS,
    &footprint::PASS,
    &visibility::PASS,
    &winner::PASS,
    &fragments::PASS,
    &veils::PASS,
    &long_lists::PASS,
    &oit::PASS,
    &accumulate::PASS,
    &attributes::PASS,
    &lit::PASS,
    &covered::PASS,
    &triangles::PASS,
    &resolve::PASS,
    &join::PASS,
    &individuals::PASS,
    &layers::PASS,
    &sorted::PASS,
    &peel::PASS,
    &raster::PASS,
];

/// The passes of a render with `needs`.
fn passes(needs: &SceneNeeds) -> impl Iterator<Item = &'static Pass> {
    PASSES.into_iter().chain(own_maps(needs).map(|own| &own.pass))
}

/// The modules that a render with `needs` is made of: the first, that of the tiles, and that which chooses a cut, if there are any.
pub fn modules(needs: &SceneNeeds) -> Vec<Module> {
    let tiles = || Module { files: files_with(&tiles::PASS, needs).collect(), kernels: (tiles::PASS.kernels)(needs) };
    // The same one before it is known how much is drawn.
    let cut = || Module { files: first_files(&needs.before_cut()), kernels: select::CHOOSING.into() };
    let kernels = passes(needs).flat_map(|pass| (pass.kernels)(needs)).collect();
    let first = Module { files: first_files(needs), kernels };
    std::iter::once(first).chain(needs.tiles.then(tiles)).chain(needs.levels.then(cut)).collect()
}

/// Files that every module has, and those of one more pass.
fn files_with(own: &Pass, needs: &SceneNeeds) -> impl Iterator<Item = &'static str> {
    PASSES.iter().flat_map(|pass| (pass.files)(needs)).chain((own.files)(needs))
}

/// Those of the first module.
fn first_files(needs: &SceneNeeds) -> Vec<&'static str> {
    let of_maps = own_maps(needs).flat_map(|own| (own.pass.files)(needs));
    files_with(&accumulate::SUMS, needs).chain(of_maps).collect()
}

/// The overridable constants of a render, by name.
pub fn constants(making: &Making<'_>) -> Vec<(&'static str, f64)> {
    passes(making.needs).flat_map(|pass| (pass.constants)(making)).collect()
}
