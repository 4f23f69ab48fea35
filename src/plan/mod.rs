//! Plans a frame before any device is used. A plan is a pure function of the scene's facts, the
//! sizes measured so far, the adapter, the view and the options.

mod accumulator;
pub mod check;
mod composited;
mod cuts;
pub mod extra;
mod facts;
mod fragment;
pub mod known;
mod mesh;
mod needs;
mod optimisation;
pub mod pass;
mod pixel;
mod raster;
mod settings;
pub mod steps;
mod surface;
mod surfel;
pub mod tuning;
mod view;

pub use accumulator::{ACCUMULATORS, Accumulator, AccumulatorRow, Features, wide_bits};
pub use composited::{Lists, Oit, composited};
pub use cuts::{Band, bands, page_surfels};
pub use facts::{ColorNeed, Facts};
pub use fragment::{FragmentLayout, KEY_WORDS};
pub use known::Known;
pub use mesh::{MeshFacts, MeshNeeds, texture_words};
pub(crate) use mesh::{bounds_of, in_view};
pub use needs::{EpsilonForm, SMALL_WEIGHT, SceneNeeds, Sides, culls_back};
pub use optimisation::Optimisation;
pub use pixel::{COLOR_CHANNEL, NO_MAP, PixelLayout, color_channels};
pub use raster::{BlendFormat, Raster, RasterDepth};
pub use settings::{BackendName, Organisation, Settings};
pub use surface::{Fetch, Rasterised, Splats, Surface, Winner};
pub use surfel::{SurfelLayout, splat_words};
pub use view::{depths, device_unit, farthest};

use std::ops::Range;

use crate::error::Result;
use crate::gpu::adapter::AdapterDescription;
use crate::gpu::layout::{BATCH, ONE};
use crate::scene::Camera;
use extra::most_words;
use known::Listed;
use steps::Part;

/// A frame's buffers, bands and pages, and the needs that select its kernels.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// The needs of scene and options; the key of the compiled kernels.
    pub needs: SceneNeeds,
    /// The layout of a pixel's sums and of its image record.
    pub pixel: PixelLayout,
    /// u32 words of a pixel's sums in storage; 0 if the rasteriser's textures or the registers of
    /// gathering tiles hold them.
    pub sum_words: u32,
    /// The weight 1 in units of the sums of `fixed`.
    pub one: u64,
    /// Width of the image in samples.
    pub width: u32,
    /// The bands of sample rows; buffers hold one band at a time.
    pub bands: Vec<Band>,
    /// The facts of the scene's triangles.
    pub mesh: MeshFacts,
    /// Number of pages of surfels. Each separate input, and each branch of a cut, has its own
    /// pages.
    pub pages: usize,
    /// Surfel slots for the cut, by branch; `None` if no cut is drawn or its size is not known yet.
    pub cut: Option<Vec<u64>>,
    /// The pages of each separate input; empty unless inputs are kept separate.
    pub individuals: Vec<Range<usize>>,
    /// Upper bound on the length of fragment lists if some are processed in rounds; else 0.
    pub longest_list: u32,
    /// Whether empty pixels differ from 0 in the image, so that empty tiles are resolved too.
    pub lists_empty: bool,
    /// Whether splats are projected again in each band. Splats that are drawn first in a band hide
    /// others, which are left out of the band's list.
    pub projects_each_band: bool,
    /// Whether the frame reads back how many splat slots it needs before it projects.
    pub looks_for_slots: bool,
    /// Whether large splats are drawn by tiles instead of one workgroup each.
    pub large_by_tiles: bool,
    /// Whether the frame reads back how many entries it needs in the lists of large and of small
    /// splats.
    pub looks_for_lists: [bool; 2],
}

/// The largest number of surfels that blend with each other. Tiles gather them only if they fit one
/// page.
fn most_together((facts, drawn): (&Facts, u64), needs: &SceneNeeds) -> u64 {
    let largest = facts.individuals.iter().copied().max();
    largest.filter(|_| needs.surface.separate()).unwrap_or(drawn)
}

/// The range of pages of each group, at `most` surfels per page. `apart` has the groups' sizes;
/// groups share no page.
fn pages_of(apart: &[u64], most: u64) -> Vec<Range<usize>> {
    let mut end = 0;
    let pages = apart.iter().map(|surfels| {
        let first = end;
        end += surfels.div_ceil(most) as usize;
        first..end
    });
    pages.collect()
}

/// Whether tiles sum all splats, if those that blend with each other fit one page.
fn gathers(needs: &SceneNeeds, options: &Settings, known: &Known) -> bool {
    let pays = match options.organisation {
        Organisation::Auto => {
            needs.surface.fetch() == Some(Fetch::Shared) && known.touched_tiles >= tuning::GATHERED_TOUCHED_TILES
        }
        Organisation::Tile => true,
        Organisation::Scatter => false,
    };
    needs.may_gather() && pays && !known.crowded && options.has(Optimisation::Gathering)
}

/// Whether batches that are hidden or out of view are culled.
fn culls(drawn: u64, needs: &SceneNeeds, camera: &Camera, options: &Settings) -> bool {
    let worth = if needs.levels { tuning::PIXELS_A_CULLED_CHOICE } else { tuning::PIXELS_A_CULLED_SURFEL };
    // The rasteriser draws every splat.
    options.has(Optimisation::Culling)
        && worth * drawn > camera.pixels() as u64
        && !needs.surface.copies()
        && needs.surface.lists().is_none()
        && needs.surface.oit().is_none()
        && !needs.surface.separate()
        && needs.surface.raster().is_none()
}

impl Plan {
    /// Plans the frame for a view of the scene that `facts` describe. The pixels of `camera` are
    /// the samples ([`Camera::sampled`]).
    ///
    /// # Errors
    /// [`Error::Limit`](crate::Error::Limit) if one row of the image needs more than a buffer, and
    /// an error of the adapter if it lacks what the options need.
    pub fn of(
        facts: &Facts,
        adapter: &AdapterDescription,
        camera: &Camera,
        options: &Settings,
        known: &Known,
    ) -> Result<Self> {
        let accumulator = if known.overflows > 0 { Accumulator::Fixed } else { options.accumulator };
        let options = &Settings { accumulator, ..options.clone() };
        let needs = SceneNeeds::of(facts, adapter, camera, options);
        check::on_adapter(adapter, &needs, camera)?;
        let pixel = PixelLayout::of(&needs);
        let page = page_surfels(adapter, &needs);
        let cut = known.cut.clone().filter(|_| needs.levels);
        // Each branch has its own pages.
        let apart = if needs.levels { cut.clone().unwrap_or_default() } else { vec![facts.here()] };
        let (drawn, pages) = (apart.iter().sum(), pages_of(&apart, page).last().map_or(0, |last| last.end));
        let in_one =
            (pages == 1 || needs.surface.separate()) && (1..=page).contains(&most_together((facts, drawn), &needs));
        let gather = in_one && gathers(&needs, options, known);
        // A lens has no planes at the edges of its image.
        let cull = needs.lens.is_none() && page >= BATCH.into() && culls(drawn, &needs, camera, options);
        let individuals = if needs.surface.separate() { pages_of(&facts.individuals, page) } else { Vec::new() };
        let surface = needs.surface.sized(gather, known.veiled, known.longest_list > 0);
        let needs = SceneNeeds { surface, cull, ..needs };
        // Gathering tiles keep sums in registers.
        let sum_words = if gather { 0 } else { pixel.sum_words(&needs) };
        let head = if sum_words > 0 { needs.accumulator.row().head_words() } else { 0 };
        let words = sum_words.max(pixel.image_words).max(most_words(&needs));
        let whole = || bands(adapter, camera, needs.samples.down, words, head);
        let bands = known.cuts.clone().map_or_else(whole, Ok)?;
        let several = bands.len() > 1;
        if several && needs.surface.peels().is_some() {
            let what =
                "the rasteriser peels layers of the whole image, and this one is too large: choose a smaller one";
            return Err(adapter.error(what));
        }
        let projects_each_band = several && (cull || gather);
        let splits = tuning::splits(adapter, options.has(Optimisation::Splitting));
        let draws_projected = !splits && (!several || projects_each_band) && needs.surface.draws_small_once();
        let needs = SceneNeeds { draws_projected, ..needs };
        let looks = [Listed::Large, Listed::Small].map(|of| {
            let wanted = match of {
                Listed::Large => needs.surface.tiles() && (gather || known.large != Some(false)),
                Listed::Small => gather,
            };
            wanted && known.entries_of(of).is_none()
        });
        Ok(Self {
            needs,
            pixel,
            sum_words,
            one: if needs.wide_sums { 1 << wide_bits(options, facts.surfels) } else { ONE.into() },
            width: camera.width,
            bands,
            mesh: facts.mesh,
            pages: individuals.last().map_or(pages, |last| last.end),
            cut,
            individuals,
            longest_list: known.longest_list,
            lists_empty: options.shows_where_nothing_is() || needs.surface.peels().is_some(),
            projects_each_band,
            looks_for_slots: cull && (several || !known.slots),
            large_by_tiles: needs.surface.tiles() && (looks[0] || known.entries_of(Listed::Large).is_some()),
            looks_for_lists: looks,
        })
    }

    /// Plans the frame of the f64 reference, in strips of sample rows; nothing is culled.
    pub fn of_reference(facts: &Facts, camera: &Camera, options: &Settings) -> Self {
        // The twins have one path where a device has several ways to draw.
        let scattered = Settings { raster: None, organisation: Organisation::Scatter, ..options.clone() };
        let needs = SceneNeeds::of_picture(facts, camera, &scattered);
        let individuals = if needs.surface.separate() { pages_of(&facts.individuals, u64::MAX) } else { Vec::new() };
        Self {
            // The reference gets a scene that holds only the cut.
            needs: SceneNeeds { levels: false, ..needs },
            pixel: PixelLayout::of(&needs),
            sum_words: 0,
            one: 1,
            width: camera.width,
            bands: cuts::strips(camera, tuning::REFERENCE_ROWS),
            mesh: facts.mesh,
            pages: individuals.len().max(1),
            cut: None,
            individuals,
            longest_list: 0,
            lists_empty: options.shows_where_nothing_is(),
            projects_each_band: false,
            looks_for_slots: false,
            large_by_tiles: false,
            looks_for_lists: [false; 2],
        }
    }

    /// Whether the size of the cut is not known yet.
    pub fn looks_for_cut(&self) -> bool {
        self.needs.levels && self.cut.is_none()
    }

    /// The groups of pages whose surfels blend with each other: all pages, or those of each
    /// separate input.
    pub fn together(&self) -> Vec<Range<usize>> {
        if self.needs.surface.separate() { self.individuals.clone() } else { std::iter::once(0..self.pages).collect() }
    }

    /// Whether splats are projected, and their unknown counts read back, in `band`.
    pub fn projects_in(&self, band: usize) -> bool {
        band == 0 || self.projects_each_band
    }

    /// Number of image pixels in a band; `Band::pixels` counts samples.
    pub fn image_pixels(&self, band: usize) -> u64 {
        self.bands[band].pixels / u64::from(self.needs.samples.count())
    }

    /// The parts of the batches, in drawing order.
    pub fn parts(&self) -> &'static [Part] {
        if self.needs.cull { &[Part::Near, Part::Far] } else { &[Part::All] }
    }
}
