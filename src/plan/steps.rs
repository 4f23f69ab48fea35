//! What a frame does, as data: stages of kernels, each over something, and what is looked at in between. A list of steps is made
//! without a device, and one executor runs it.

use super::known::Listed;
use crate::gpu::layout::WORKGROUP;
use crate::scene::Map;

/// A kernel: an entry point of WGSL, and the invocations of its workgroup.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Kernel {
    /// Its name in WGSL.
    pub name: &'static str,
    /// Invocations of a workgroup.
    pub workgroup: [u32; 3],
    /// The lists that it sees as `lists`.
    pub lists: Option<Listed>,
}

impl Kernel {
    /// One of [`WORKGROUP`] invocations.
    pub const fn new(name: &'static str) -> Self {
        Self::of(name, [WORKGROUP, 1, 1])
    }

    /// One of another workgroup.
    pub const fn of(name: &'static str, workgroup: [u32; 3]) -> Self {
        Self { name, workgroup, lists: None }
    }

    /// One that makes lists.
    pub const fn listing(name: &'static str, workgroup: [u32; 3], lists: Listed) -> Self {
        Self { name, workgroup, lists: Some(lists) }
    }
}

/// Which batches a stage draws.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// Every one that is projected: of all there are, or where some are left out, the near and the far ones.
    All,
    /// In view and nearer than the middle of the scene.
    Near,
    /// In view, farther, and not hidden by the near ones.
    Far,
}

/// What a kernel is dispatched over. A kernel that binds a page's buffer is dispatched for each page.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Over {
    /// An invocation for each slot of a page's splats.
    Slots(Part),
    /// An invocation for each batch of a page.
    Batches,
    /// An invocation for [`JUDGED`](crate::gpu::layout::JUDGED) nodes each of a level of a branch that is come to, as the device counted them.
    Judged,
    /// The same, after the next level's are known.
    Spread,
    /// Workgroups for the splats that take long to project, as the device counted them.
    Rare,
    /// A workgroup for each large splat.
    Large,
    /// An invocation for each vertex of the triangles.
    Vertices,
    /// An invocation for each triangle.
    Triangles,
    /// A workgroup for each large triangle, as the device counted them.
    LargeTriangles,
    /// A workgroup for each tile in which triangles show.
    TriangleTiles,
    /// A workgroup for each triangle that f32 does not tell.
    RareTriangles,
    /// An invocation for each large splat, to list it.
    Listing,
    /// An invocation for each row of the band.
    Rows,
    /// An invocation for each pixel of the band.
    Pixels,
    /// An invocation for each tile of pixels by which hidden splats are told.
    Occlusion,
    /// Eight invocations, a row of pixels, for each tile that large splats are drawn by.
    Tiles,
    /// An invocation for each list that is gone through in rounds, of which there may be fewer.
    LongLists,
    /// A workgroup for each tile that anything covers.
    Covered,
    /// A workgroup for eight such tiles.
    CoveredEights,
    /// One workgroup.
    Once,
}

/// A dispatch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Run {
    /// The kernel.
    pub kernel: Kernel,
    /// And over what.
    pub over: Over,
}

/// Words of a buffer, by its name in WGSL, that become 0: of each page, if pages have it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Clear {
    /// The buffer.
    pub buffer: &'static str,
    /// The first word.
    pub first: u64,
    /// How many; None for all that follow.
    pub count: Option<u64>,
}

impl Clear {
    /// The words of `buffer` from `first` on, `count` of them.
    pub fn of(buffer: &'static str, first: u64, count: u64) -> Self {
        Self { buffer, first, count: Some(count) }
    }
}

/// What the f64 reference does in one go.
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
    /// [`individuals`](crate::passes::individuals): what one of them shows, where it is nearest.
    Individual(usize),
    /// [`triangles`](crate::passes::triangles): what they show.
    Triangles,
    /// [`resolve`](crate::passes::resolve): the image.
    Resolve,
    /// [`layers`](crate::passes::layers): the image, of lists.
    Layers,
    /// [`sorted`](crate::passes::sorted): the image, of lists.
    Sorted,
    /// A map that has a pass of its own.
    Map(Map),
}

impl Twin {
    /// The pass whose it is.
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
    /// The pass that they count for.
    pub pass: &'static str,
    /// The band of the image.
    pub band: usize,
    /// One page, or all.
    pub page: Option<usize>,
    /// What is cleared before.
    pub clears: Vec<Clear>,
    /// The dispatches.
    pub runs: Vec<Run>,
    /// What the reference does here; nothing in a stage that does a part of another's work, or none that shows.
    pub twin: Option<Twin>,
}

impl Stage {
    /// One of `pass` over all pages in `band`, without clears.
    pub fn new(pass: &'static str, band: usize, runs: Vec<Run>) -> Self {
        Self { pass, band, page: None, clears: Vec::new(), runs, twin: None }
    }

    /// This stage, before which `clears` are done.
    pub fn after(self, clears: Vec<Clear>) -> Self {
        Self { clears, ..self }
    }

    /// This stage on one page.
    pub fn of_page(self, page: usize) -> Self {
        Self { page: Some(page), ..self }
    }

    /// This stage, which the reference does in another's place.
    pub fn without_twin(self) -> Self {
        Self { twin: None, ..self }
    }

    /// This stage, in whose place the reference has `twin`.
    pub fn as_twin(self, twin: Twin) -> Self {
        Self { twin: Some(twin), ..self }
    }
}

/// Something that is looked at on the device in the middle of a frame, because buffers are sized by it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Look {
    /// The surfels of a cut.
    Cut,
    /// The slots that the listed batches of a part take.
    Slots(Part),
    /// What lists hold that these stages count.
    Lists(Listed, Vec<Stage>),
    /// The fragments of a band.
    Fragments(usize),
}

/// A step of a frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Step {
    /// The cut of a tree, branch by branch, if an earlier try has not chosen it.
    Select,
    /// Kernels.
    Stage(Stage),
    /// Makes room by what is there.
    Look(Look),
    /// Large splats, after a look at them: by tiles if there are any and lists hold them, else by a workgroup each.
    Large {
        /// With lists.
        by_tiles: Vec<Stage>,
        /// Without.
        by_workgroups: Vec<Stage>,
    },
    /// The rasteriser's visibility and attribute pass.
    Draw,
    /// The rasteriser's visibility pass of triangles.
    DrawTriangles,
    /// Rows of the image go to the host.
    ReadBack(usize),
}
