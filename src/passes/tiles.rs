//! Stages 2 and 3 for large splats: the same minima and sums as [`visibility`](super::visibility) and
//! [`accumulate`](super::accumulate) make, to the bit, a tile of the image at a time.
//!
//! A splat of a few pixels costs least if its invocation adds its fragments to memory (scatter); of one of thousands each
//! fragment would wait for its atomics. So splats whose bounds hold more than [`LARGE_BY_TILES`](crate::gpu::layout::LARGE_BY_TILES) pixels are
//! binned: each tile of [`TILE_SIZE`] pixels has a list of those that may touch it, made by count, scan and place, and a
//! workgroup that keeps its pixels' nearest depths, and then their sums, in registers. All splats share the nearest depths
//! before any is accumulated. Opaque blending within epsilon does not ask for an order, so no list is sorted.
//!
//! What room the lists need is read from the device once; a later frame that needs more is rendered again.

use std::sync::Arc;

use super::accumulate::AttributeBuffer;
use super::project::SplatBuffer;
use super::visibility::VisibilityBuffer;
use super::{Recorder, Rows};
use crate::error::Result;
use crate::gpu::Gpu;
use crate::gpu::buffers::Buffer;
use crate::gpu::kernel::{Bound, Grid, Program};
use crate::gpu::layout::{LargeAttributes, QUEUE_TILE_GRID, Splat, TILE_SIZE};

/// The tiles of an image.
pub struct Tiles {
    program: Arc<Program>,
    width: u32,
    /// Where each list ends, and what the frame needed.
    ends: Buffer<u32>,
    lists: Buffer<u32>,
    /// The large splats of a page.
    larges: Buffer<Splat>,
    attributes: Buffer<LargeAttributes>,
}

/// What the tiles of a frame hold at most.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Room {
    /// Large splats of a page.
    pub splats: u64,
    /// Entries of all lists of a page.
    pub entries: u64,
    /// Entries of the longest list.
    pub longest: u64,
}

impl Room {
    /// Whether this is enough for `needed`.
    fn holds(self, needed: Self) -> bool {
        needed.splats <= self.splats && needed.entries <= self.entries && needed.longest <= self.longest
    }
}

impl Tiles {
    /// Tiles for each of `bands` of an image of `width` columns, drawn by `program`.
    fn new(gpu: &Gpu, program: Arc<Program>, width: u32, bands: &[Rows], room: Room) -> Result<Self> {
        let most = bands.iter().map(|rows| grid(width, rows)).map(|[x, y]| u64::from(x) * u64::from(y)).max();
        Ok(Self {
            program,
            width,
            ends: Buffer::storage(gpu, "tiles", most.unwrap_or(0) + 3)?,
            lists: Buffer::storage(gpu, "lists of tiles", room.entries)?,
            larges: Buffer::storage(gpu, "large splats", room.splats)?,
            attributes: Buffer::storage(gpu, "attributes of large splats", room.splats)?,
        })
    }

    /// Tiles with room for the large splats that are projected now, and a quarter more for the next view; `None` if there are
    /// none, or more than a binding or a list holds: then workgroups draw them.
    pub fn measured(
        recorder: &mut Recorder<'_>,
        splats: &SplatBuffer,
        bands: &[Rows],
        width: u32,
        program: impl FnOnce() -> Result<Arc<Program>>,
    ) -> Result<Option<Self>> {
        let gpu = recorder.gpu;
        if splats.most_large(gpu)? == 0 {
            return Ok(None);
        }
        let empty = Self::new(gpu, program()?, width, bands, Room::default())?;
        for rows in bands {
            for (index, page) in splats.pages.iter().enumerate() {
                let bound = splats.bindings(index, &empty.bindings(recorder, rows));
                let fresh = rows.first == 0 && index == 0;
                empty.bin(recorder, ("visibility", &["tile_count", "tile_scan"]), fresh, &page.queue, &bound)?;
            }
        }
        let needed = empty.needed(gpu, splats)?;
        let more = |count: u64| count + count / 4;
        let room = Room { splats: more(needed.splats), entries: more(needed.entries), longest: needed.longest };
        let most = Room {
            splats: (gpu.buffer_limit() / size_of::<Splat>() as u64).min(MOST_PLACES),
            entries: gpu.buffer_limit() / 4,
            longest: LONGEST,
        };
        if most.holds(room) { Self::new(gpu, empty.program, width, bands, room).map(Some) } else { Ok(None) }
    }

    /// The same for another variant of the kernels.
    pub(crate) fn of_variant(self, program: Arc<Program>) -> Self {
        Self { program, ..self }
    }

    /// Device memory that they take, bytes.
    pub fn bytes(&self) -> u64 {
        self.ends.bytes() + self.lists.bytes() + self.larges.bytes() + self.attributes.bytes()
    }

    /// Whether there was room for the frame; if not, the image is wrong.
    pub fn held(&self, gpu: &Gpu, splats: &SplatBuffer) -> Result<bool> {
        let room = Room { splats: self.larges.len, entries: self.lists.len, longest: LONGEST };
        Ok(room.holds(self.needed(gpu, splats)?))
    }

    /// What a page and band needed at most in this frame.
    fn needed(&self, gpu: &Gpu, splats: &SplatBuffer) -> Result<Room> {
        let words = self.ends.read(gpu, self.ends.len)?;
        let [.., entries, longest] = words[..] else { return Ok(Room::default()) };
        Ok(Room { splats: splats.most_large(gpu)?, entries: entries.into(), longest: longest.into() })
    }

    /// What the kernels bind, beside what they draw.
    fn bindings<'a>(&'a self, recorder: &Recorder<'a>, rows: &'a Rows) -> Bound<'a> {
        vec![
            ("view", recorder.view.bound()),
            ("band", rows.uniform.bound()),
            ("ends", self.ends.bound()),
            ("listed_ends", self.ends.bound()),
            ("lists", self.lists.bound()),
            ("tile_lists", self.lists.bound()),
            ("larges", self.larges.bound()),
            ("attributes_of_larges", self.attributes.bound()),
            ("large_splats", self.larges.bound()),
            ("large_splat_words", self.larges.bound()),
            ("large_attributes", self.attributes.bound()),
            ("large_attribute_words", self.attributes.bound()),
        ]
    }
}

/// Tiles of `rows`, across and down.
fn grid(width: u32, rows: &Rows) -> [u32; 2] {
    [width.div_ceil(TILE_SIZE[0]), rows.count.div_ceil(TILE_SIZE[1])]
}

/// The longest list that is drawn: Mesa's llvmpipe ends the loops of an invocation after 65,535 rounds in all, and an entry
/// takes up to three.
const LONGEST: u64 = 16_384;

/// An entry has 24 bits for a splat's place.
const MOST_PLACES: u64 = 1 << 24;

/// Records the visibility pass of the large splats over `rows`.
pub fn visibility(
    recorder: &mut Recorder<'_>,
    splats: &SplatBuffer,
    rows: &Rows,
    tiles: &Tiles,
    buffer: &VisibilityBuffer,
) -> Result<()> {
    let stages = ("visibility", "tile_visibility");
    tiles.record(recorder, stages, true, splats, rows, &[("nearest", buffer.nearest.bound())])
}

/// Records the attribute pass of the large splats over `rows`.
pub fn accumulate(
    recorder: &mut Recorder<'_>,
    splats: &SplatBuffer,
    rows: &Rows,
    tiles: &Tiles,
    (visible, buffer): (&VisibilityBuffer, &AttributeBuffer),
) -> Result<()> {
    // Of one page the lists stay from the first pass to the second.
    let bins = splats.pages.len() > 1;
    tiles.record(recorder, ("accumulate", "tile_accumulate"), bins, splats, rows, &buffer.bindings(visible))
}

impl Tiles {
    /// Records `kernel` over the tiles of `rows`, as a part of `stage`. Its lists are made before if it `bins`.
    fn record(
        &self,
        recorder: &mut Recorder<'_>,
        (stage, kernel): (&'static str, &'static str),
        bins: bool,
        splats: &SplatBuffer,
        rows: &Rows,
        buffers: &[(&str, wgpu::BindingResource<'_>)],
    ) -> Result<()> {
        let gpu = recorder.gpu;
        let grid = grid(self.width, rows).into();
        let mut own = self.bindings(recorder, rows);
        own.extend_from_slice(buffers);
        for (index, page) in splats.pages.iter().enumerate() {
            let bound = splats.bindings(index, &own);
            if bins {
                let fresh = kernel == "tile_visibility" && rows.first == 0 && index == 0;
                self.bin(recorder, (stage, &["tile_count", "tile_scan", "tile_place"]), fresh, &page.queue, &bound)?;
            }
            recorder.timing.pass(
                gpu,
                stage,
                |_| {},
                |pass| self.program.dispatch(gpu, pass, kernel, &bound, Grid::Of(grid)),
            )?;
        }
        Ok(())
    }

    /// Records `kernels` of the lists of one page's large splats. What the frame needs is not known yet if it is `fresh`.
    fn bin(
        &self,
        recorder: &mut Recorder<'_>,
        (stage, kernels): (&'static str, &[&str]),
        fresh: bool,
        queue: &Buffer<u32>,
        bound: &[(&str, wgpu::BindingResource<'_>)],
    ) -> Result<()> {
        let gpu = recorder.gpu;
        // The last two words are what it needs.
        let words = if fresh { self.ends.len } else { self.ends.len - 2 };
        let clear = |encoder: &mut wgpu::CommandEncoder| encoder.clear_buffer(&self.ends.raw, 0, Some(words * 4));
        recorder.timing.pass(gpu, stage, clear, |pass| {
            for &kernel in kernels {
                let groups = match kernel {
                    "tile_scan" => Grid::Of((1, 1)),
                    _ => Grid::In(&queue.raw, u64::from(QUEUE_TILE_GRID) * 4),
                };
                self.program.dispatch(gpu, pass, kernel, bound, groups)?;
            }
            Ok(())
        })
    }
}
