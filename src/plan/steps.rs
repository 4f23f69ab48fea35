//! Describes a frame as data: stages of kernels with the extent of each dispatch, and the counts
//! that are read back in between. A list of steps is made without a device, and one executor runs
//! it.

use super::known::Listed;
use crate::gpu::layout::WORKGROUP;
use crate::scene::Map;

/// A kernel: an entry point in WGSL with its workgroup size.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Kernel {
    /// Name of the entry point.
    pub name: &'static str,
    /// Workgroup size in x, y and z.
    pub workgroup: [u32; 3],
    /// The lists that its variable `lists` is bound to.
    pub lists: Option<Listed>,
}

impl Kernel {
    /// Creates a kernel with workgroups of [`WORKGROUP`] invocations in x.
    pub const fn new(name: &'static str) -> Self {
        Self::of(name, [WORKGROUP, 1, 1])
    }

    /// Creates a kernel with another workgroup size.
    pub const fn of(name: &'static str, workgroup: [u32; 3]) -> Self {
        Self { name, workgroup, lists: None }
    }

    /// Creates a kernel that binds the lists of large or of small splats.
    pub const fn listing(name: &'static str, workgroup: [u32; 3], lists: Listed) -> Self {
        Self { name, workgroup, lists: Some(lists) }
    }
}

/// The batches of surfels that a stage draws.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// All projected batches: all there are or, with culling, the near and the far ones.
    All,
    /// Batches in view and nearer than the middle of the scene.
    Near,
    /// Batches in view, farther away, and not hidden by the near ones.
    Far,
}

/// The extent of a dispatch. A kernel that binds a buffer of a page is dispatched once per page.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Over {
    /// One invocation per splat slot of a page.
    Slots(Part),
    /// One invocation per batch of a page.
    Batches,
    /// One invocation per [`JUDGED`](crate::gpu::layout::JUDGED) nodes that were reached in one
    /// level of a branch, as the device counted them.
    Judged,
    /// Like `Judged`, once the nodes of the next level are known.
    Spread,
    /// As many workgroups as the device counted for the splats that are slow to project.
    Rare,
    /// One workgroup per large splat.
    Large,
    /// One invocation per vertex of the triangles.
    Vertices,
    /// One invocation per triangle.
    Triangles,
    /// One workgroup per large triangle, as the device counted them.
    LargeTriangles,
    /// One workgroup per tile in which triangles show.
    TriangleTiles,
    /// One workgroup per triangle whose intersections f32 cannot resolve.
    RareTriangles,
    /// One invocation per large splat, to add it to lists.
    Listing,
    /// One invocation per row of the band.
    Rows,
    /// One invocation per pixel of the band.
    Pixels,
    /// One invocation per tile of the occlusion test.
    Occlusion,
    /// The same tiles in squares of 8 x 8, a workgroup for each.
    OcclusionBlocks,
    /// All tiles of the large splats: eight invocations for each, or one workgroup where a tile has
    /// an invocation for each pixel.
    Tiles,
    /// One invocation per list that may be processed in rounds; there may be fewer such lists.
    LongLists,
    /// One workgroup per covered tile.
    Covered,
    /// One workgroup per eight covered tiles.
    CoveredEights,
    /// One workgroup.
    Once,
}

/// One kernel and its extent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Run {
    /// The kernel to dispatch.
    pub kernel: Kernel,
    /// The extent of the dispatch.
    pub over: Over,
}

/// A range of a buffer that is set to 0. If each page has the buffer, the range is cleared in every
/// page.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Clear {
    /// Name of the buffer in WGSL.
    pub buffer: &'static str,
    /// The first u32 word.
    pub first: u64,
    /// Number of words; `None` to the end.
    pub count: Option<u64>,
}

impl Clear {
    /// Clears `count` words of `buffer` from `first` on.
    pub fn of(buffer: &'static str, first: u64, count: u64) -> Self {
        Self { buffer, first, count: Some(count) }
    }
}

/// A function of the f64 reference that does the work of one or more stages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Twin {
    /// [`project`](crate::passes::project): splats.
    Project,
    /// [`visibility`](crate::passes::visibility): nearest depths.
    Visibility,
    /// [`accumulate`](mod@crate::passes::accumulate): sums.
    Accumulate,
    /// [`oit`](crate::passes::oit): sums.
    Oit,
    /// [`individuals`](crate::passes::individuals): the surface of one separate input, where it is
    /// the nearest.
    Individual(usize),
    /// [`triangles`](crate::passes::triangles): the surfaces of triangles.
    Triangles,
    /// [`resolve`](crate::passes::resolve): the image.
    Resolve,
    /// [`layers`](crate::passes::layers): the image from lists, blended by surface.
    Layers,
    /// [`sorted`](crate::passes::sorted): the image from lists, composited fragment by fragment.
    Sorted,
    /// A map with a pass of its own.
    Map(Map),
}

impl Twin {
    /// Name of the pass that its time is added to.
    pub fn pass(self) -> &'static str {
        match self {
            Self::Project => "project",
            Self::Visibility => "visibility",
            Self::Triangles => "triangles",
            Self::Accumulate | Self::Oit => "accumulate",
            Self::Individual(_) | Self::Resolve | Self::Layers | Self::Sorted => "resolve",
            Self::Map(map) => map.row().name,
        }
    }
}

/// Dispatches that are timed together.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Stage {
    /// Name of the pass that their time is added to.
    pub pass: &'static str,
    /// Index of the band of the image.
    pub band: usize,
    /// The only page to dispatch, or `None` for all pages.
    pub page: Option<usize>,
    /// Ranges of buffers that are cleared first.
    pub clears: Vec<Clear>,
    /// The dispatches, in order.
    pub runs: Vec<Run>,
    /// The reference's counterpart; `None` if the twin of another stage includes this work, or if
    /// the work does not affect the image.
    pub twin: Option<Twin>,
}

impl Stage {
    /// Creates a stage of `pass` over all pages in `band`, without clears.
    pub fn new(pass: &'static str, band: usize, runs: Vec<Run>) -> Self {
        Self { pass, band, page: None, clears: Vec::new(), runs, twin: None }
    }

    /// This stage, preceded by `clears`.
    pub fn after(self, clears: Vec<Clear>) -> Self {
        Self { clears, ..self }
    }

    /// This stage, on one page only.
    pub fn of_page(self, page: usize) -> Self {
        Self { page: Some(page), ..self }
    }

    /// This stage without a twin: the reference does its work elsewhere.
    pub fn without_twin(self) -> Self {
        Self { twin: None, ..self }
    }

    /// This stage with the counterpart `twin`.
    pub fn as_twin(self, twin: Twin) -> Self {
        Self { twin: Some(twin), ..self }
    }
}

/// A count that is read back in the middle of a frame, because it determines the sizes of buffers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Look {
    /// Number of surfels and nodes in the cut.
    Cut,
    /// Splat slots that the listed batches of a part need.
    Slots(Part),
    /// Entries of the lists that these stages count.
    Lists(Listed, Vec<Stage>),
    /// Number of fragments in a band.
    Fragments(usize),
}

/// Values of pixels that processes exchange if they draw a frame together
/// ([`exchange`](crate::render::exchange)).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Exchanged {
    /// The triangles of each pixel, shaded. Every process draws all of them.
    Triangles,
    /// Numbers of each pixel, which are reduced over all processes.
    Numbers(Reduced),
    /// The fragments of each pixel's list.
    Fragments,
}

/// Numbers of pixels that are reduced over the processes that draw a frame together.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Reduced {
    /// The nearest depths: the nearest one counts, and every process needs it.
    Nearest,
    /// The colours of nearest fragments, with their depths if these are in the same number: the
    /// greatest counts.
    Winners,
    /// The numbers of fragments of lists, which are added up.
    Counts,
    /// Sums in the buffer of this name ([`EXTRA`](super::extra::EXTRA)), which are added up, and
    /// every process needs the results.
    Common(&'static str),
    /// The sums, which are added up.
    Sums,
}

/// One step of a frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Step {
    /// Chooses the cut of the octree, branch by branch, unless an earlier try chose it.
    Select,
    /// Dispatches kernels.
    Stage(Stage),
    /// Reads a count and resizes buffers by it.
    Look(Look),
    /// Exchanges values of a band's pixels, if several processes draw the frame. Otherwise nothing
    /// is done.
    Exchange(Exchanged, usize),
    /// Draws the large splats after their lists were measured: by tiles if there are any large
    /// splats and the lists hold them, else by one workgroup each.
    Large {
        /// Stages that use tile lists.
        by_tiles: Vec<Stage>,
        /// Stages with one workgroup per large splat.
        by_workgroups: Vec<Stage>,
    },
    /// Draws the rasteriser's visibility and attribute passes.
    Draw,
    /// Draws the rasteriser's visibility pass of triangles.
    DrawTriangles,
    /// Copies the image rows of a band to the host.
    ReadBack(usize),
}
