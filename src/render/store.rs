//! Owns the buffers of a scene and its frames, by their names in WGSL.

use std::collections::BTreeMap;

use super::page::{Branch, Page, of_selection};
use super::targets::Targets;
use crate::error::Result;
use crate::gpu::Gpu;
use crate::gpu::buffers::{Buffer, Readback};
use crate::gpu::kernel::Groups;
use crate::gpu::layout::{BATCH, Band as BandUniform, View};
use crate::passes::tiles::{list_name, list_words};
use crate::passes::triangles::{self, NEAREST_TRIANGLE_WORDS};
use crate::passes::upload::Uploaded;
use crate::passes::{asks_for_order, covered, fragments, long_lists, visibility};
use crate::plan::extra::EXTRA;
use crate::plan::known::Listed;
use crate::plan::{
    Band, FragmentLayout, KEY_WORDS, Known, Plan, Raster, SceneNeeds, SurfelLayout, page_surfels, splat_words,
};
use crate::scene::Samples;

/// Aliases of buffers: the WGSL name where kernels access a buffer in another mode (read or write),
/// and the name under which it is stored.
const ALIASES: [(&str, &str); 20] = [
    ("selected", "selection"),
    ("chosen", "attributes"),
    ("projected", "splats"),
    ("queued", "queue"),
    ("listed", "rare"),
    ("surviving", "drawn"),
    ("boxed", "boxes"),
    ("visible", "nearest"),
    ("added", "sums"),
    ("winners", "sums"),
    ("indexed", "image"),
    ("list_starts", "starts"),
    ("found_lists", "long_lists"),
    ("told", "peeled"),
    ("corners_seen", "corners"),
    ("queued_triangles", "large_triangles"),
    ("listed_triangles", "rare_triangles"),
    ("named_triangles", "nearest_triangles"),
    ("beside", "triangle_pixels"),
    ("tiles_of_triangles", "triangle_tiles"),
];

/// Names of the buffers that each page, or its branch, has of its own.
const PAGED: [&str; 10] =
    ["attributes", "balls", "boxes", "drawn", "page", "queue", "rare", "rest", "splats", "surfels"];

/// Returns the name under which a buffer is stored.
pub(super) fn kept(name: &str) -> &str {
    ALIASES.iter().find(|(alias, _)| *alias == name).map_or(name, |(_, kept)| kept)
}

/// Buffers by name.
pub(super) type Named = BTreeMap<&'static str, Buffer<u32>>;

fn bytes(named: &Named) -> u64 {
    named.values().map(Buffer::bytes).sum()
}

/// Properties of a plan that determine the buffers of a frame's pixels.
#[derive(Clone, PartialEq)]
struct Made {
    width: u32,
    samples: Samples,
    bands: Vec<Band>,
    sum_words: u32,
    image_words: u32,
    lists: bool,
    /// The words per pixel of each buffer that only some renders have.
    extra: [u32; EXTRA.len()],
    mesh: bool,
    raster: Option<(Raster, u32)>,
}

/// Properties of a render's needs that determine the buffers of surfels and splats.
#[derive(Clone, Copy, PartialEq)]
struct Uploading {
    /// Identical surfels are stored once.
    copies: bool,
    /// Each input has pages of its own.
    separate: bool,
    /// Levels of detail: the octree is uploaded.
    levels: bool,
    surfel: SurfelLayout,
    splat_words: u64,
    /// Each surfel has two splats.
    twice: bool,
    /// The numbers of the surfels in their source are kept on the host.
    order: bool,
    /// Triangles are uploaded.
    mesh: bool,
}

impl Uploading {
    fn of(needs: &SceneNeeds) -> Self {
        let (surfel, splat_words) = (SurfelLayout::of(needs), splat_words(needs));
        let order = asks_for_order(needs) && !needs.levels;
        let mesh = needs.mesh.is_some();
        Self {
            copies: needs.surface.copies(),
            separate: needs.surface.separate(),
            levels: needs.levels,
            surfel,
            splat_words,
            twice: needs.twice(),
            order,
            mesh,
        }
    }
}

/// All buffers of a scene and its frames.
pub struct Store {
    /// The pages of surfels.
    pub pages: Vec<Page>,
    /// The branches of the octree, if a cut is drawn.
    pub branches: Vec<Branch>,
    /// Surfel slots of the pages, by branch, if a cut is drawn.
    rooms: Vec<u64>,
    /// The properties for which the scene was uploaded.
    uploaded: Uploading,
    shared: Named,
    made: Option<Made>,
    /// Buffers of the pixels of one band.
    frame: Named,
    bands: Vec<Buffer<BandUniform>>,
    /// Capacity of the lists of large and of small splats, in entries.
    entries: [u64; 2],
    readback: Option<Readback>,
    /// The bind groups of all dispatches so far.
    pub(super) groups: Groups,
    /// The rasteriser's textures.
    pub targets: Option<Targets>,
    /// The numbers of the surfels of all pages in their source; empty unless a map asks for them.
    pub order: Vec<u32>,
}

impl Store {
    /// Creates the store for a scene `uploaded` for `needs`, without buffers for pixels.
    pub fn new(gpu: &Gpu, uploaded: Uploaded, needs: &SceneNeeds) -> Result<Self> {
        let (mut first, mut order) = (uploaded.first, Vec::new());
        let pages = uploaded.pages.into_iter().map(|page| {
            let (before, surfels) = (first, page.numbers.len() as u32);
            first += surfels;
            if asks_for_order(needs) {
                order.extend(&page.numbers);
            }
            Page::new(gpu, page, before, needs)
        });
        let pages = pages.collect::<Result<_>>()?;
        let mut shared = Named::from_iter(uploaded.shared);
        if needs.levels {
            shared.extend(of_selection(gpu, &uploaded.branches, needs)?);
        }
        let branches = uploaded.branches.into_iter().map(|branch| Branch {
            large_levels: branch.large_levels,
            chosen: branch.chosen,
            buffers: Named::from_iter(branch.buffers),
        });
        let branches = branches.collect();
        Ok(Self {
            uploaded: Uploading::of(needs),
            pages,
            branches,
            rooms: Vec::new(),
            shared,
            made: None,
            frame: Named::new(),
            bands: Vec::new(),
            entries: [0; 2],
            readback: None,
            groups: Groups::default(),
            targets: None,
            order,
        })
    }

    /// Returns whether the uploaded buffers serve a render with `needs`. Renders of one scene may
    /// differ: whether copies are drawn once depends on the accumulator, maps may need more
    /// attributes than colours, and triangles are uploaded only once a view may show them.
    pub fn serves(&self, needs: &SceneNeeds) -> bool {
        let wanted = Uploading::of(needs);
        let Uploading { order, mesh, .. } = self.uploaded;
        (order || !wanted.order) && (mesh || !wanted.mesh) && self.uploaded == Uploading { order, mesh, ..wanted }
    }

    /// Creates the buffers of `plan` that do not exist yet or have another size.
    pub fn fit(&mut self, gpu: &Gpu, plan: &Plan, known: &Known) -> Result<()> {
        let raster = plan.needs.surface.raster().map(|raster| (raster, plan.pixel.targets()));
        let (width, bands) = (plan.width, plan.bands.clone());
        let (sum_words, image_words) = (plan.sum_words, plan.pixel.image_words);
        let (samples, lists) = (plan.needs.samples, plan.needs.surface.lists().is_some());
        let extra = EXTRA.each_ref().map(|extra| (extra.words)(&plan.needs));
        let mesh = plan.needs.mesh.is_some();
        let made = Made { width, samples, bands, sum_words, image_words, lists, extra, mesh, raster };
        let fresh = self.made.as_ref() != Some(&made);
        if fresh {
            // Frees the old buffers before new ones are allocated.
            self.groups.forget();
            (self.made, self.targets, self.readback) = (None, None, None);
            self.frame.clear();
        }
        if let Some(rooms) = plan.cut.as_ref().filter(|rooms| **rooms != self.rooms) {
            // Frees the old pages before new ones are allocated.
            self.groups.forget();
            (self.pages, self.rooms) = (Vec::new(), Vec::new());
            let most = page_surfels(&gpu.adapter, &plan.needs);
            for (number, (branch, room)) in self.branches.iter().zip(rooms).enumerate() {
                for first in (0..*room).step_by(most as usize) {
                    self.pages.push(Page::of_cut(gpu, most.min(room - first), (number, branch, first), &plan.needs)?);
                }
            }
            self.rooms.clone_from(rooms);
        }
        for page in 0..self.pages.len() {
            let Page { surfels, slots, .. } = self.pages[page];
            // Pages that were made anew have no slots. A frame that does not look for the slots
            // that it needs gets all of them.
            if !plan.needs.cull || (slots == 0 && !plan.looks_for_slots) {
                let splats = if plan.needs.twice() { 2 * surfels } else { surfels };
                self.grow(gpu, page, splats.next_multiple_of(if plan.needs.cull { BATCH.into() } else { 1 }))?;
            }
        }
        if fresh {
            self.make_pixels(gpu, plan)?;
            self.made = Some(made);
        }
        for of in [Listed::Large, Listed::Small] {
            let wanted = match of {
                Listed::Large => plan.large_by_tiles,
                Listed::Small => plan.needs.surface.gathers(),
            };
            if wanted && !self.frame.contains_key(list_name(of)) {
                self.make_lists(gpu, plan, of, known.entries_of(of).unwrap_or(0))?;
            }
        }
        Ok(())
    }

    fn make_pixels(&mut self, gpu: &Gpu, plan: &Plan) -> Result<()> {
        let most = |words: &dyn Fn(&Band) -> u64| plan.bands.iter().map(words).max().unwrap_or(0);
        let pixels = most(&|band| band.pixels);
        let uniform = |band: &Band| {
            let value = BandUniform { first_row: band.first, rows: band.rows, padding_0: 0, padding_1: 0 };
            Buffer::uniform(gpu, "band", &value)
        };
        self.bands = plan.bands.iter().map(uniform).collect::<Result<_>>()?;
        let nearest = match plan.needs.surface.raster() {
            None => Buffer::exchanged(gpu, "nearest depths", most(&visibility::nearest_words))?,
            Some(raster) => {
                self.targets = Some(Targets::new(gpu, raster, plan)?);
                Buffer::indirect(gpu, "covered tiles", most(&covered::words))?
            }
        };
        self.frame.insert("nearest", nearest);
        if plan.needs.surface.lists().is_some() {
            let words = most(&fragments::start_words);
            self.frame.insert("starts", Buffer::storage(gpu, "starts of lists", words)?);
        }
        for extra in &EXTRA {
            let words = pixels * u64::from((extra.words)(&plan.needs));
            if words > 0 {
                self.frame.insert(extra.name, Buffer::storage(gpu, extra.label, words)?);
            }
        }
        if plan.needs.mesh.is_some() {
            // The rasteriser stores nearest triangles in a texture, so one word suffices for the
            // binding.
            let words =
                if plan.needs.surface.raster().is_some() { 1 } else { pixels * u64::from(NEAREST_TRIANGLE_WORDS) };
            self.frame.insert("nearest_triangles", Buffer::storage(gpu, "nearest triangles", words)?);
            let words = most(&triangles::pixel_words);
            self.frame.insert("triangle_pixels", Buffer::storage(gpu, "pixels of triangles", words)?);
            let words = most(&triangles::tile_words);
            self.frame.insert("triangle_tiles", Buffer::indirect(gpu, "tiles of triangles", words)?);
        }
        if plan.sum_words > 0 {
            let words = plan.needs.accumulator.row().head_words() + pixels * u64::from(plan.sum_words);
            self.frame.insert("sums", Buffer::exchanged(gpu, "weighted sums", words)?);
        }
        let record = u64::from(plan.pixel.image_words);
        let words = record * (0..plan.bands.len()).map(|band| plan.image_pixels(band)).max().unwrap_or(0);
        let image = Buffer::readable(gpu, "image", words)?;
        self.readback = Some(Readback::new(gpu, &image, words * 4, record * 4));
        self.frame.insert("image", image);
        let view = Buffer::<View>::uniform(gpu, "view", &bytemuck::Zeroable::zeroed())?;
        self.frame.insert("view", view.words());
        Ok(())
    }

    /// Replaces the lists of a kind by lists with a capacity of `entries`.
    pub fn make_lists(&mut self, gpu: &Gpu, plan: &Plan, of: Listed, entries: u64) -> Result<()> {
        self.groups.forget();
        self.frame.remove(list_name(of));
        let lists = Buffer::storage(gpu, "lists of splats", self.list_words(plan, of) + entries)?;
        self.frame.insert(list_name(of), lists);
        self.entries[of as usize] = entries;
        Ok(())
    }

    /// Makes the buffers of fragments hold `count` fragments. New buffers get an eighth more, up to
    /// `most`, for the next band or view.
    pub fn make_fragments(&mut self, gpu: &Gpu, plan: &Plan, count: u64, most: u64) -> Result<()> {
        let record = u64::from(FragmentLayout::of(&plan.needs).words);
        let buffers = [("keys", "depths of fragments", KEY_WORDS), ("fragments", "fragments", record)];
        let holds = |(name, _, words): &(&str, &str, u64)| {
            self.frame.get(name).is_some_and(|buffer| buffer.len >= count * words)
        };
        if !buffers.iter().all(holds) {
            // Frees the old buffers before new ones are allocated.
            self.groups.forget();
            buffers.iter().for_each(|(name, ..)| drop(self.frame.remove(name)));
            for (name, what, words) in buffers {
                let room = (count + count / 8).min(most).max(1);
                self.frame.insert(name, Buffer::storage(gpu, what, room * words)?);
            }
        }
        if plan.needs.surface.long_lists() {
            let words = long_lists::words(self.fragments().max(count), plan.needs.samples);
            if self.frame.get("long_lists").is_none_or(|kept| kept.len < words) {
                self.groups.forget();
                self.frame.insert("long_lists", Buffer::storage(gpu, "long lists", words)?);
            }
        }
        Ok(())
    }

    /// The number of fragments that the buffers hold.
    pub fn fragments(&self) -> u64 {
        self.frame.get("keys").map_or(0, |keys| keys.len / KEY_WORDS)
    }

    /// Grows the buffers of a page to at least `slots` splats and keeps their contents.
    pub fn grow(&mut self, gpu: &Gpu, page: usize, slots: u64) -> Result<()> {
        if self.pages[page].slots < slots {
            self.groups.forget();
            self.pages[page].grow(gpu, slots)?;
        }
        Ok(())
    }

    /// u32 words of the lists of a kind before their entries, for the band that needs most.
    pub fn list_words(&self, plan: &Plan, of: Listed) -> u64 {
        plan.bands.iter().map(|band| list_words(plan, of, band)).max().unwrap_or(0)
    }

    /// Capacity of the lists of a kind, in entries.
    pub fn entries(&self, of: Listed) -> u64 {
        self.entries[of as usize]
    }

    /// Writes the view uniform.
    pub fn set_view(&self, gpu: &Gpu, view: &View) {
        if let Some(buffer) = self.frame.get("view") {
            buffer.put(gpu, bytemuck::bytes_of(view));
        }
    }

    /// The buffer of this name that all pages share.
    pub fn buffer(&self, name: &str) -> Option<&Buffer<u32>> {
        let name = kept(name);
        self.frame.get(name).or_else(|| self.shared.get(name))
    }

    /// Returns whether each page, or its branch, has its own buffer of this name.
    pub fn is_paged(name: &str) -> bool {
        PAGED.contains(&kept(name))
    }

    /// For each branch the buffer and the word at which the size of its cut is stored; none unless
    /// a cut is drawn.
    pub fn chosen(&self) -> impl Iterator<Item = (&Buffer<u32>, u64)> {
        self.branches.iter().filter_map(|branch| Some((branch.buffers.get("attributes")?, branch.chosen.into())))
    }

    /// The binding of a variable of a kernel that makes the cut of `branch`.
    pub fn binding_of_branch(&self, name: &str, branch: usize) -> Option<wgpu::BindingResource<'_>> {
        let own = self.branches.get(branch)?.buffers.get(kept(name));
        own.or_else(|| self.buffer(name)).map(Buffer::bound)
    }

    /// The binding of a kernel's variable for a page and a band.
    pub fn binding(&self, name: &str, page: usize, band: usize) -> Option<wgpu::BindingResource<'_>> {
        if name == "band" {
            return self.bands.get(band).map(Buffer::bound);
        }
        let paged = || self.pages.get(page)?.buffer(name);
        let of_branch = || self.branches.get(self.pages.get(page)?.branch?)?.buffers.get(kept(name));
        let buffer = paged().or_else(of_branch).or_else(|| self.buffer(name)).map(Buffer::bound);
        buffer.or_else(|| self.targets.as_ref()?.binding(name))
    }

    /// The image and its staging buffers.
    pub fn image(&self) -> Option<(&Buffer<u32>, &Readback)> {
        self.buffer("image").zip(self.readback.as_ref())
    }

    /// Device memory in bytes: of surfels and splats, and of pixels.
    pub fn bytes(&self) -> (u64, u64) {
        let pages = self.pages.iter().map(|page| &page.buffers);
        let branches = self.branches.iter().map(|branch| &branch.buffers);
        let splats = pages.chain(branches).map(bytes).sum::<u64>() + bytes(&self.shared);
        let bands = self.bands.iter().map(Buffer::bytes).sum::<u64>();
        let others = self.readback.as_ref().map_or(0, Readback::bytes) + self.targets.as_ref().map_or(0, |t| t.bytes);
        (splats, bytes(&self.frame) + bands + others)
    }
}
