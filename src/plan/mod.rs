//! What a frame is made of, before a device is asked for anything: a pure function of what is known of the scene, the adapter, the
//! view and the options.

mod accumulator;
pub mod check;
mod composited;
mod cuts;
mod facts;
mod fragment;
pub mod known;
mod mesh;
mod needs;
mod optimisation;
mod options;
pub mod pass;
mod pixel;
mod raster;
pub mod steps;
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
pub use needs::{EpsilonForm, SMALL_WEIGHT, SceneNeeds, Sides, Winner, culls_back};
pub use optimisation::Optimisation;
pub use options::{BackendName, Organisation, RenderOptions};
pub use pixel::{COLOR_CHANNEL, PixelLayout, color_channels};
pub use raster::{BlendFormat, Raster, RasterDepth};
pub use surfel::{SurfelLayout, splat_words};
pub use view::{depths, device_unit, farthest};

use std::ops::Range;

use crate::error::Result;
use crate::gpu::adapter::AdapterDescription;
use crate::gpu::layout::{BATCH, ONE};
use crate::passes::individuals;
use crate::passes::moments::MOMENT_WORDS;
use crate::passes::peel::PEELED_WORDS;
use crate::passes::triangles::TRIANGLE_PIXEL_WORDS;
use crate::passes::veils::VEIL_WORDS;
use crate::scene::Camera;
use known::Listed;
use steps::Part;

/// How a frame is rendered.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// What exists: the key of the kernels.
    pub needs: SceneNeeds,
    /// The room that a pixel takes.
    pub pixel: PixelLayout,
    /// u32 words of a pixel's sums in storage; the rasteriser's are in textures, those of tiles that gather in registers.
    pub sum_words: u32,
    /// Units of a weight of 1 in the sums of `fixed`.
    pub one: u64,
    /// Columns of samples.
    pub width: u32,
    /// The rows of samples that buffers hold at a time.
    pub bands: Vec<Band>,
    /// The scene's triangles.
    pub mesh: MeshFacts,
    /// Pages that the surfels fill, where each is drawn by itself.
    pub pages: usize,
    /// Surfels of a cut that pages have room for, branch by branch, once that is known; of a scene of which one is drawn.
    pub cut: Option<Vec<u64>>,
    /// Those of each individual, where they are kept apart.
    pub individuals: Vec<Range<usize>>,
    /// No list is longer than this, if some are gone through in rounds.
    pub longest_list: u32,
    /// Pixels that nothing covers differ from 0.
    pub lists_empty: bool,
    /// Each band has splats of its own: what is drawn first in it hides what is drawn later, and hidden splats are struck out.
    pub projects_each_band: bool,
    /// The slots of splats are counted on the way.
    pub looks_for_slots: bool,
    /// Large splats are drawn by tiles, not by a workgroup each.
    pub large_by_tiles: bool,
    /// The entries of lists are counted on the way: of the large splats, of the small ones.
    pub looks_for_lists: [bool; 2],
}

/// The words that a pixel takes at most in a buffer that some renders alone have.
fn most_words(needs: &SceneNeeds) -> u32 {
    let of = |has: bool, words: u32| if has { words } else { 0 };
    let peeled = of(needs.peels.is_some(), PEELED_WORDS);
    let moments = of(needs.oit == Some(Oit::Moments), MOMENT_WORDS);
    // Four words a tile of 64 pixels, or of fewer at the image's edges, are less than one more a pixel, but for images of a few pixels.
    let triangles = of(needs.mesh.is_some(), TRIANGLE_PIXEL_WORDS + 1);
    peeled.max(moments).max(triangles).max(individuals::words(needs)).max(of(needs.veils, VEIL_WORDS))
}

/// Surfels that blend with each other, at most: of one page tiles gather them.
fn most_together((facts, drawn): (&Facts, u64), needs: &SceneNeeds) -> u64 {
    let largest = facts.individuals.iter().copied().max();
    largest.filter(|_| needs.separate).unwrap_or(drawn)
}

/// The pages that so many surfels each fill, which are kept apart.
fn pages_of(apart: &[u64], most: u64) -> Vec<Range<usize>> {
    let mut end = 0;
    let pages = apart.iter().map(|surfels| {
        let first = end;
        end += surfels.div_ceil(most) as usize;
        first..end
    });
    pages.collect()
}

/// Whether tiles sum the splats of a page, if all that blend are in one.
fn gathers(needs: &SceneNeeds, options: &RenderOptions, known: &Known) -> bool {
    let pays = match options.organisation {
        Organisation::Auto => needs.subgroups && known.touched_tiles >= tuning::GATHERED_TOUCHED_TILES,
        Organisation::Tile => true,
        Organisation::Scatter => false,
    };
    needs.may_gather() && pays && !known.crowded && options.has(Optimisation::Gathering)
}

/// Whether batches that are hidden or out of view are left out. Of cuts none is: what is out of view is in none, and to bound their batches
/// anew for each frame takes longer than drawing what is hidden, except where most is.
fn culls(drawn: u64, needs: &SceneNeeds, camera: &Camera, options: &RenderOptions) -> bool {
    // The rasteriser draws every splat.
    options.has(Optimisation::Culling)
        && tuning::PIXELS_A_CULLED_SURFEL * drawn > camera.pixels() as u64
        && !needs.levels
        && !needs.copies
        && needs.lists.is_none()
        && needs.oit.is_none()
        && !needs.separate
        && needs.raster.is_none()
}

impl Plan {
    /// The plan for a view by `camera`, whose pixels are the samples ([`Camera::sampled`]), of the scene that `facts` are of.
    ///
    /// # Errors
    /// [`Error::Usage`](crate::Error::Usage) for what does not go together, and a limit of the adapter.
    pub fn of(
        facts: &Facts,
        adapter: &AdapterDescription,
        camera: &Camera,
        options: &RenderOptions,
        known: &Known,
    ) -> Result<Self> {
        let accumulator = if known.overflows > 0 { Accumulator::Fixed } else { options.accumulator };
        let options = &RenderOptions { accumulator, ..options.clone() };
        let needs = SceneNeeds::of(facts, adapter, camera, options);
        check::on_adapter(adapter, &needs, camera)?;
        let pixel = PixelLayout::of(&needs);
        let page = page_surfels(adapter, &needs);
        let cut = known.cut.clone().filter(|_| needs.levels);
        // Branches have pages of their own.
        let apart = if needs.levels { cut.clone().unwrap_or_default() } else { vec![facts.surfels] };
        let (drawn, pages) = (apart.iter().sum(), pages_of(&apart, page).last().map_or(0, |last| last.end));
        let in_one = (pages == 1 || needs.separate) && (1..=page).contains(&most_together((facts, drawn), &needs));
        let gather = in_one && gathers(&needs, options, known);
        let cull = page >= BATCH.into() && culls(drawn, &needs, camera, options);
        let individuals = if needs.separate { pages_of(&facts.individuals, page) } else { Vec::new() };
        let veils = needs.lists == Some(Lists::Sorted) && known.veiled;
        let long_lists = needs.lists.is_some() && known.longest_list > 0;
        let needs = SceneNeeds { gather, cull, veils, long_lists, ..needs };
        // Tiles that gather store no sums.
        let sum_words = if gather { 0 } else { pixel.sum_words(&needs) };
        let head = if sum_words > 0 { needs.accumulator.row().head_words() } else { 0 };
        let words = sum_words.max(pixel.image_words).max(most_words(&needs));
        let whole = || bands(adapter, camera, needs.samples.down, words, head);
        let bands = known.cuts.clone().map_or_else(whole, Ok)?;
        let several = bands.len() > 1;
        if several && needs.peels.is_some() {
            let what =
                "the rasteriser peels layers of the whole image, and this one is too large: choose a smaller one";
            return Err(adapter.error(what));
        }
        let looks = [Listed::Large, Listed::Small].map(|of| {
            let wanted = match of {
                Listed::Large => needs.tiles && (gather || known.large != Some(false)),
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
            lists_empty: options.shows_where_nothing_is() || needs.peels.is_some(),
            projects_each_band: several && (cull || gather),
            looks_for_slots: cull && (several || !known.slots),
            large_by_tiles: needs.tiles && (looks[0] || known.entries_of(Listed::Large).is_some()),
            looks_for_lists: looks,
        })
    }

    /// The plan of the f64 reference, which draws strips of rows of samples: no device is asked for anything, and nothing is left out.
    pub fn of_reference(facts: &Facts, camera: &Camera, options: &RenderOptions) -> Self {
        let needs = SceneNeeds::of_picture(facts, camera, options);
        let individuals = if needs.separate { pages_of(&facts.individuals, u64::MAX) } else { Vec::new() };
        Self {
            // What a device draws in another way, the twins draw as all else.
            needs: SceneNeeds {
                raster: None,
                tiles: false,
                lists: Lists::of(facts, options),
                peels: None,
                // It is given the cut alone.
                levels: false,
                ..needs
            },
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

    /// How large a cut is is not known yet.
    pub fn looks_for_cut(&self) -> bool {
        self.needs.levels && self.cut.is_none()
    }

    /// Pages whose surfels blend with each other: all, or those of each individual.
    pub fn together(&self) -> Vec<Range<usize>> {
        if self.needs.separate { self.individuals.clone() } else { std::iter::once(0..self.pages).collect() }
    }

    /// Whether splats are projected in `band`, and what is unknown of them is looked at.
    pub fn projects_in(&self, band: usize) -> bool {
        band == 0 || self.projects_each_band
    }

    /// Pixels of the image in a band, whose own are samples.
    pub fn image_pixels(&self, band: usize) -> u64 {
        self.bands[band].pixels / u64::from(self.needs.samples.count())
    }

    /// The parts that are drawn one after the other.
    pub fn parts(&self) -> &'static [Part] {
        if self.needs.cull { &[Part::Near, Part::Far] } else { &[Part::All] }
    }
}
