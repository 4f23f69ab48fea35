//! Stages 3 and 4 of [`fragments`](super::fragments) on adapters that limit an invocation's loops:
//! sorts and composites long lists in rounds.
//!
//! Each dispatch does a part of the work and stores where it stopped. Mesa's llvmpipe silently ends
//! the loops of an invocation after 65,535 rounds in total. It counts a round for all invocations
//! of a subgroup if any of them runs it. With nested loops, an invocation may therefore be charged
//! the rounds of the whole subgroup. Each dispatch stays below the limit, so the bits are those of
//! a list that is processed at once.
//!
//! **Number of dispatches.** A heap sort of n keys has n / 2 + n - 1 steps, of fewer than 32 rounds
//! each. Compositing visits a fragment at most five times, if fronts and backs alternate: as part
//! of its surface, as a neighbour of the other side, as the end of a surface, as already consumed,
//! and as part of the tail. A dispatch may revisit the last fragment of the dispatch before it.
//!
//! Views without long lists have none of these dispatches, unless an earlier view of the same image
//! size had long lists.

use crate::gpu::layout::MOST_ROUNDS;
use crate::plan::Plan;
use crate::plan::pass::Pass;
use crate::plan::steps::{Clear, Kernel, Over, Run, Stage};
use crate::scene::Samples;

/// Steps of a heap sort per dispatch.
const HEAP_STEPS: u32 = 512;

/// Fragments of a list that one dispatch visits. Together, the 16 invocations of a subgroup then
/// take at most a quarter of the rounds that llvmpipe allows.
const LOOKS: u32 = 1024;

/// Words of the buffer before the first list, and words per list.
const HEAD: u64 = 1;
const WORDS: u64 = 40;

/// The most fragments of a list that one invocation sorts and composites. It composites the lists
/// of all `samples` of a pixel.
///
/// A heap sort of n keys takes fewer than n (log2 n + 2) rounds, and fewer than twice that if the
/// lists of a subgroup differ in length. Compositing takes five rounds per fragment, at most
/// [`MOST_ROUNDS`] in all. That is half of llvmpipe's limit; the other half is for rounds in which
/// the invocation waits for others of its subgroup.
pub fn most_at_once(samples: Samples) -> u32 {
    (MOST_ROUNDS / 16).min(MOST_ROUNDS / 5 / samples.count())
}

/// Words of a buffer that holds the state of as many long lists as `fragments` can form.
pub fn words(fragments: u64, samples: Samples) -> u64 {
    HEAD + WORDS * (fragments / (u64::from(most_at_once(samples)) + 1) + 1)
}

/// The number of long lists that a buffer of `words` holds.
pub fn room(words: u64) -> u64 {
    words.saturating_sub(HEAD) / WORDS
}

/// The pass's kernels, files and constants.
pub const PASS: Pass = Pass {
    name: "long_lists",
    files: |needs| match needs.surface.lists() {
        None => Vec::new(),
        Some(_) => vec![if needs.surface.long_lists() { "long_lists.wgsl" } else { "long_lists_absent.wgsl" }],
    },
    kernels: |needs| if needs.surface.long_lists() { vec![FIND, SORT, COMPOSITE] } else { Vec::new() },
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

/// The stage that finds and sorts the long lists, after all others are sorted.
pub fn sorts(plan: &Plan, band: usize) -> Option<Stage> {
    let longest = u64::from(plan.longest_list);
    let find = Run { kernel: FIND, over: Over::Pixels };
    let runs = std::iter::once(find).chain(times(SORT, (longest / 2 + longest).div_ceil(HEAP_STEPS.into())));
    let clears = vec![Clear::of("long_lists", 0, HEAD)];
    plan.needs.surface.long_lists().then(|| Stage::new("sort", band, runs.collect()).after(clears))
}

/// The dispatches that composite the long lists, before pixels are resolved.
pub fn composites(plan: &Plan) -> impl Iterator<Item = Run> {
    let longest = u64::from(plan.longest_list);
    let rounds = (5 * longest).div_ceil(u64::from(LOOKS) - 1) + 1;
    times(COMPOSITE, if plan.needs.surface.long_lists() { rounds } else { 0 })
}
