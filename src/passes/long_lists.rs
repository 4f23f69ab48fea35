//! Stages 3 and 4 of [`fragments`](super::fragments) on adapters that end an invocation's loops: lists that are too long for one are sorted
//! and composited in rounds, dispatch after dispatch, of which every one does a piece and keeps where it stopped.
//!
//! Mesa's llvmpipe ends the loops of an invocation after 65,535 rounds altogether, silently, and counts every one in which any invocation
//! of the subgroup takes part: where these are in loops within loops, at worst those of all of them. A dispatch does few enough, so the bits
//! are those of a list that is gone through at once.
//!
//! **How many dispatches.** A heap sort of n has n / 2 + n - 1 steps, of fewer than 32 rounds each. Compositing looks at a fragment five
//! times at most, where fronts and backs alternate: as one of its surface, as one of the other side's neighbours, as the end of a run, as
//! told, and as part of the tail. What it looked at last before it stopped it may look at once more.
//!
//! Views without such lists have none of this, unless one of the same size before them had.

use crate::gpu::layout::MOST_ROUNDS;
use crate::plan::Plan;
use crate::plan::pass::Pass;
use crate::plan::steps::{Clear, Kernel, Over, Run, Stage};
use crate::scene::Samples;

/// Steps of a heap sort in a dispatch.
const HEAP_STEPS: u32 = 512;

/// Fragments that a dispatch looks at of a list: 16 invocations of a subgroup take a fourth of what ends them.
const LOOKS: u32 = 1024;

/// Words before those of the first list, and of a list.
const HEAD: u64 = 1;
const WORDS: u64 = 39;

/// The most fragments of a list that one invocation sorts and composites, where a pixel has `samples`, whose lists it goes through
/// together.
///
/// A heap of n takes fewer than n (log2 n + 2) rounds, and fewer than twice that where the lists of a subgroup differ in length.
/// Compositing takes five a fragment, and as many again are left for other invocations of the subgroup, in whose rounds this one waits.
pub fn most_at_once(samples: Samples) -> u32 {
    (MOST_ROUNDS / 16).min(MOST_ROUNDS / 5 / samples.count())
}

/// Words of the buffer that has room for the long lists of so many `fragments`.
pub fn words(fragments: u64, samples: Samples) -> u64 {
    HEAD + WORDS * (fragments / (u64::from(most_at_once(samples)) + 1) + 1)
}

/// The lists that such a buffer of `words` has room for.
pub fn room(words: u64) -> u64 {
    words.saturating_sub(HEAD) / WORDS
}

/// The kernels, files and constants.
pub const PASS: Pass = Pass {
    name: "long_lists",
    files: |needs| match needs.lists {
        None => Vec::new(),
        Some(_) => vec![if needs.long_lists { "long_lists.wgsl" } else { "long_lists_absent.wgsl" }],
    },
    kernels: |needs| if needs.long_lists { vec![FIND, SORT, COMPOSITE] } else { Vec::new() },
    constants: |making| {
        let long = most_at_once(making.needs.samples);
        vec![("LONG", long.into()), ("HEAP_STEPS", HEAP_STEPS.into()), ("LOOKS", LOOKS.into())]
    },
};

const FIND: Kernel = Kernel::new("find_long_lists");
const SORT: Kernel = Kernel::new("sort_long_lists");
const COMPOSITE: Kernel = Kernel::new("composite_long_lists");

fn times(kernel: Kernel, rounds: u64) -> impl Iterator<Item = Run> {
    (0..rounds).map(move |_| Run { kernel, over: Over::LongLists })
}

/// What finds and sorts them, after all other lists are sorted.
pub fn sorts(plan: &Plan, band: usize) -> Option<Stage> {
    let longest = u64::from(plan.longest_list);
    let find = Run { kernel: FIND, over: Over::Pixels };
    let runs = std::iter::once(find).chain(times(SORT, (longest / 2 + longest).div_ceil(HEAP_STEPS.into())));
    let clears = vec![Clear::of("long_lists", 0, HEAD)];
    plan.needs.long_lists.then(|| Stage::new("sort", band, runs.collect()).after(clears))
}

/// What composites them, before pixels are resolved.
pub fn composites(plan: &Plan) -> impl Iterator<Item = Run> {
    let longest = u64::from(plan.longest_list);
    let rounds = (5 * longest).div_ceil(u64::from(LOOKS) - 1) + 1;
    times(COMPOSITE, if plan.needs.long_lists { rounds } else { 0 })
}
