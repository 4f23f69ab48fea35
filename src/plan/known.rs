//! What earlier tries and frames have shown of a scene on an adapter: a plan goes by it, and a frame that turns out to need more is
//! rendered again with what it taught.

use super::Band;

/// Times that a frame is rendered at most. A try fails for one of five reasons: cuts, slots, lists of large splats, lists of all, sums that
/// wrap; and each teaches what ends it, or, of a list whose length a view changes, what ends it in this view.
pub const MOST_TRIES: usize = 7;

/// Lists of the splats that may touch each cell of the image (`wgsl/bin.wgsl`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Listed {
    /// The large ones, by blocks of tiles.
    Large,
    /// The small ones that are not hidden, by tiles.
    Small,
}

/// What is known; at first nothing.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Known {
    /// Tiles that a splat touches on average in this view, by a sample.
    pub touched_tiles: f64,
    /// Surfels of a cut that there is room for, branch by branch, of a scene with levels of detail.
    pub cut: Option<Vec<u64>>,
    /// The cut of this view is chosen.
    pub chosen: bool,
    /// The slots of splats were counted for an earlier view, which has left some spare.
    pub slots: bool,
    /// Whether the last frame had large splats.
    pub large: Option<bool>,
    /// Entries of the lists of large and of small splats that there is room for, and how many of them.
    pub entries: [Option<u64>; 2],
    /// There are more splats than tiles can list, so that their sums are stored.
    pub crowded: bool,
    /// Bands whose fragments fit, in this view, as far as bands were looked at.
    pub cuts: Option<Vec<Band>>,
    /// How often a band of this view was cut, or its lists were longer than was known: each time the next try comes farther down the image.
    pub times_cut: usize,
    /// A pixel has more fragments than are sorted, or a row more than a buffer holds: lists end where nothing more shows
    /// ([`veils`](crate::passes::veils)).
    pub veiled: bool,
    /// Fragments of the longest list, if one invocation cannot go through it ([`long_lists`](crate::passes::long_lists)); else 0.
    pub longest_list: u32,
    /// Fragments of this view that made a sum of the accumulator that was asked for wrap.
    pub overflows: u64,
}

impl Known {
    /// Entries of these lists that there is room for.
    pub fn entries_of(&self, of: Listed) -> Option<u64> {
        self.entries[of as usize]
    }

    /// Forgets what holds for one view.
    pub fn forget_view(&mut self) {
        (self.overflows, self.chosen) = (0, false);
        (self.cuts, self.times_cut) = (None, 0);
    }

    /// Forgets what buffers have room for.
    pub fn forget_buffers(&mut self) {
        self.forget_image();
        (self.slots, self.chosen, self.cut) = (false, false, None);
    }

    /// Forgets what holds for one size of image.
    pub fn forget_image(&mut self) {
        (self.entries, self.large, self.veiled, self.longest_list) = ([None; 2], None, false, 0);
    }
}
