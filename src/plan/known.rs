//! Sizes measured in earlier tries and frames of a scene on an adapter. Plans use them, and a frame
//! that needs more is rendered again with what its last try measured.

use super::Band;

/// The most tries of a frame, besides those counted in [`Known::times_cut`]. A try fails for one of
/// five reasons: the cut, the splat slots, the lists of large splats or the lists of all splats are
/// longer than the plan knew, or sums wrap. Each failed try records the missing size, so the next
/// try does not fail for it again. The length of a list may change with the view, so its size is
/// certain only for the present view.
pub const MOST_TRIES: usize = 7;

/// The lists of splats that may touch each cell of the image (`wgsl/tiles/bin.wgsl`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Listed {
    /// Large splats, by blocks of tiles.
    Large,
    /// Small splats that are not hidden, by tiles.
    Small,
}

/// The sizes measured so far; initially none.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Known {
    /// Mean number of tiles that a splat touches in this view, estimated from a sample of surfels.
    pub touched_tiles: f64,
    /// Surfel slots for the cut, by branch, in a scene with levels of detail.
    pub cut: Option<Vec<u64>>,
    /// Whether the cut of this view is already on the device.
    pub chosen: bool,
    /// Whether the splat slots were measured in an earlier view; they include a reserve.
    pub slots: bool,
    /// Whether the last frame had large splats.
    pub large: Option<bool>,
    /// Capacity of the lists of large and of small splats, in entries, once measured.
    pub entries: [Option<u64>; 2],
    /// Whether tiles cannot list all splats, so gathering is off and sums are stored.
    pub crowded: bool,
    /// Bands whose fragments fit in this view, for the rows from the top whose fragments were
    /// counted.
    pub cuts: Option<Vec<Band>>,
    /// Number of retries of this view because a band was cut, its lists ended early, or a list was
    /// longer than known. Each such try reaches farther down the image.
    pub times_cut: usize,
    /// Whether fragment lists end where nothing behind shows ([`veils`](crate::passes::veils)),
    /// because some pixel has more fragments than can be sorted, or some row more than a buffer
    /// holds.
    pub veiled: bool,
    /// Bound on the fragments of any list, if one invocation cannot process the longest list
    /// ([`long_lists`](crate::passes::long_lists)); else 0.
    pub longest_list: u32,
    /// Number of fragments of this view that made a sum of the chosen accumulator wrap.
    pub overflows: u64,
}

impl Known {
    /// Capacity of the lists of large or of small splats, in entries, once measured.
    pub fn entries_of(&self, of: Listed) -> Option<u64> {
        self.entries[of as usize]
    }

    /// Forgets what depends on the view.
    pub fn forget_view(&mut self) {
        (self.overflows, self.chosen) = (0, false);
        (self.cuts, self.times_cut) = (None, 0);
    }

    /// Forgets the sizes of buffers that no longer exist.
    pub fn forget_buffers(&mut self) {
        self.forget_image();
        (self.slots, self.chosen, self.cut) = (false, false, None);
    }

    /// Forgets what depends on the size of the image.
    pub fn forget_image(&mut self) {
        (self.entries, self.large, self.veiled, self.longest_list) = ([None; 2], None, false, 0);
    }
}
