//! The passes of a frame, one file each: the equation with its source, its f64 twin (`reference`),
//! its stages on a device (`steps`), and its row (`PASS`: files, kernels, constants).
//!
//! [`render::sequence`](crate::render) orders them in a frame.
//!
//! | pass | input | output |
//! |---|---|---|
//! | [`order`] | [`Scene`] | the order of its surfels in memory |
//! | [`upload`] | a [`source::Source`] | pages of surfels |
//! | [`branches`], [`select`] | a tree of surfels | the cut that is drawn in place of all surfels |
//! | [`cull`] | surfels, nearest depths so far | the batches to project |
//! | [`project`] | surfels | one [`splat::Splat`] each |
//! | [`visibility`] | splats | the nearest depth of each pixel |
//! | [`accumulate`] | splats, nearest depths | [`accumulate::PixelSums`] |
//! | [`winner`] | splats | sums of the nearest fragment alone |
//! | [`fragments`], [`long_lists`] | splats | a list of each pixel's fragments |
//! | [`tiles`] | large splats, or all | nearest depths and sums, or the image |
//! | [`moments`] | splats | moments of each pixel's optical depth over depth |
//! | [`oit`] | splats | [`accumulate::PixelSums`] of all fragments |
//! | [`individuals`] | the sums of one separate input | the nearest surface of the inputs so far |
//! | [`triangles`] | triangles | the nearest triangle of each pixel, shaded |
//! | [`covered`] | nearest depths | the tiles that are not empty |
//! | [`resolve`], [`join`] | sums, shaded triangles | [`Frame`] |
//! | [`layers`], [`sorted`] | fragment lists | [`Frame`] |
//!
//! [`share`] is the source of a frame that several processes draw together.
//! [`eye_dome`] filters the finished frame.
//! [`index`] makes a map in a pass of its own. [`unseen`] explains why a picture is empty.
//!
//! [`footprint`] is evaluated inside visibility and accumulate, with the [`homography`] and the
//! [`lowpass`] that [`project`] prepared and the [`attributes`] to blend. It also chooses the file
//! of epsilon (`wgsl/visibility/epsilon_*.wgsl`). [`shared`] holds the files of every kernel.
//!
//! # How to add
//!
//! - **An accumulator**: write `wgsl/accumulate/accumulator_NAME.wgsl` with the functions of
//!   `accumulator_fixed32.wgsl` (`quantise`, `term`, `add`, `add_pair`, `settle`, `sum_at`,
//!   `weight_at`) and a row of [`ACCUMULATORS`](crate::plan::ACCUMULATORS): words per sum, needed
//!   features, whether the bits are the same in any order, and a proven bound on its error. Tests
//!   and `epsplat hardcases` loop over that table.
//! - **A map** that a pass of its own makes: write a row of [`MAPS`](crate::scene::MAPS), a pass
//!   with its twin such as [`index`], the pass's row in `MAP_PASSES`, and a kernel in `wgsl/`. The
//!   build finds kernel files by itself. A file with loops names the proof that they end
//!   (`gpu/loops.rs`); without a proof, the loops are counted at run time.
//! - **A kernel function** of your own needs no variant. `--source kernel_ellipse.wgsl=mine.wgsl`,
//!   `sources` of a study, or a [`Replacement`](crate::gpu::Replacement) from Rust replaces a
//!   built-in file by your text. The text of a blending kernel is also evaluated in f64, as its
//!   twin. The report counts weights that are NaN, infinite, negative or above 1, and calls whose
//!   loops do not end.

pub mod accumulate;
pub mod attributes;
pub mod branches;
pub mod conic;
pub mod covered;
pub mod cull;
pub mod curved;
pub mod digest;
pub mod eye_dome;
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
pub mod share;
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
use crate::plan::{Facts, Lists, Plan, SceneNeeds, Settings, depths, farthest};
use crate::scene::{Camera, Map, Provenance, Scene};
use splat::Splat;
use triangles::Corner;

/// The input of the f64 twins: a strip of image rows with its scene, camera and splats.
pub struct Strip<'a> {
    /// The scene to render.
    pub scene: &'a Scene,
    /// The camera of the whole image.
    pub camera: &'a Camera,
    /// How to render it.
    pub options: &'a Settings,
    /// The splats that may touch the strip's rows.
    pub splats: Vec<&'a Splat>,
    /// The corners of the scene's triangles, as the camera sees them.
    pub corners: &'a [Corner],
    /// The rank of each surfel in the [`order`] in which a device stores them, if a map or sorted
    /// lists need it.
    pub ranks: Option<&'a [u32]>,
    /// The nearest and the farthest depth of the scene's body ([`depths`]): camera-space z, world
    /// units.
    pub depths: [f64; 2],
    /// [`Scene::largest_shorter`], world units.
    pub largest_shorter: f64,
    /// The depth beyond which no surfel lies ([`farthest`]): camera-space z, world units.
    pub farthest: f64,
    /// The strip's first row in the image.
    pub first_row: u32,
    /// The number of rows.
    pub rows: u32,
}

impl<'a> Strip<'a> {
    /// Makes a strip without rows and splats; `facts` are those of the scene.
    pub fn of((scene, facts): (&'a Scene, &Facts), camera: &'a Camera, options: &'a Settings) -> Self {
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

/// A map with a pass of its own, made from splats and nearest depths.
///
/// The pass writes the map's words of the image, and [`resolve`] leaves them alone.
pub struct MapPass {
    /// The map that this pass makes.
    pub map: Map,
    /// The pass's kernels and files; it has the name of the map.
    pub pass: Pass,
    /// The stage of a band, which runs after the band's image is resolved.
    pub runs: fn(&Plan, usize) -> Stage,
    /// Turns the map's words, as read back, into its values; the last argument lists the surfels'
    /// numbers in storage order.
    pub finish: fn(&mut [f32], &Provenance, &[u32]),
    /// The f64 twin, given the nearest depths and the triangles.
    pub reference: fn(&Strip<'_>, &[visibility::Nearest], &join::Beside<'_>, &mut Frame),
}

/// All maps that have a pass of their own.
pub const MAP_PASSES: [&MapPass; 1] = [&index::MAP];

/// The maps of [`MAP_PASSES`] that `needs` asks for.
fn own_maps(needs: &SceneNeeds) -> impl Iterator<Item = &'static MapPass> {
    let maps = needs.maps;
    MAP_PASSES.into_iter().filter(move |own| maps.has(own.map))
}

/// The stages that make the maps of [`MAP_PASSES`] in a band.
pub fn of_maps(plan: &Plan, band: usize) -> impl Iterator<Item = Stage> {
    own_maps(&plan.needs).map(move |own| (own.runs)(plan, band).as_twin(Twin::Map(own.map)))
}

/// Whether a map or sorted lists need the order in which surfels are stored.
pub fn asks_for_order(needs: &SceneNeeds) -> bool {
    own_maps(needs).next().is_some() || needs.surface.lists() == Some(Lists::Sorted)
}

/// Converts the maps of `frame`, as read back from the device, to the values that a user gets.
pub fn finish(frame: &mut Frame, needs: &SceneNeeds, provenance: &Provenance, order: &[u32]) {
    for own in own_maps(needs) {
        if let Some(words) = frame.map_mut(own.map) {
            (own.finish)(words, provenance, order);
        }
    }
}

/// The passes whose files every module includes.
const PASSES: [&Pass; 26] = [
    &shared::PASS,
    &select::PASS,
    &project::PASS,
    &facing::PASS,
    &conic::PASS,
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

/// The modules of a render with `needs`: the main module, then, if needed, the module of the tiles,
/// the module that spreads fragments and the module that chooses a cut.
pub fn modules(needs: &SceneNeeds) -> Vec<Module> {
    let with = |own: &Pass| Module { files: files_with(own, needs).collect(), kernels: (own.kernels)(needs) };
    // This module is compiled before the size of the cut is known, so with the needs at that time.
    let cut = || Module { files: first_files(&needs.before_cut()), kernels: select::CHOOSING.into() };
    let kernels = passes(needs).flat_map(|pass| (pass.kernels)(needs)).collect();
    let first = Module { files: first_files(needs), kernels };
    let tiles = needs.surface.tiles().then(|| with(&tiles::PASS));
    let spread = (needs.spreads && !needs.surface.gathers()).then(|| with(&accumulate::SPREADING));
    std::iter::once(first).chain(tiles).chain(spread).chain(needs.levels.then(cut)).collect()
}

/// The files that every module includes, and those of one more pass.
fn files_with(own: &Pass, needs: &SceneNeeds) -> impl Iterator<Item = &'static str> {
    PASSES.iter().flat_map(|pass| (pass.files)(needs)).chain((own.files)(needs))
}

/// The files of the main module.
fn first_files(needs: &SceneNeeds) -> Vec<&'static str> {
    let of_maps = own_maps(needs).flat_map(|own| (own.pass.files)(needs));
    files_with(&accumulate::SUMS, needs).chain(of_maps).collect()
}

/// The overridable constants of a render, as name and value.
pub fn constants(making: &Making<'_>) -> Vec<(&'static str, f64)> {
    passes(making.needs).flat_map(|pass| (pass.constants)(making)).collect()
}
