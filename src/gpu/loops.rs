//! Decides which modules need loop counters: those with a loop that is not proven to end.
//!
//! wgpu adds to every loop a counter that ends it, because a loop without an end is undefined
//! behaviour on most devices. Counting costs time in every round: on Mesa's llvmpipe a frame takes
//! 1.02 to 1.12 times as long (`benches/optimisations.toml`). A module has no counters if all its
//! loops end by the proof below; every other check of wgpu stays.
//!
//! 1. A **counter** starts anywhere and grows by 1, or by a constant step of at most 256, in every
//!    round. The loop ends once the counter passes a limit that no round changes. The loop ends if
//!    the counter cannot wrap before it passes the limit, that is, if the limit is at most
//!    `2^32 - 1 - 256`. The limits are: constants; sides of the image, which have 15 bits
//!    ([`Camera`](crate::scene::Camera) refuses larger ones), and numbers of its cells and tiles;
//!    and lengths of lists. A list is a range within a binding, so it is shorter than 2^30 words:
//!    `column_of` keeps its start below `arrayLength`, and its end is its start plus the number of
//!    entries that were placed. A tile has two lists. If the counter grows by 1 while it is below
//!    its limit, any limit will do: the counter reaches it before it wraps.
//! 2. A **rectangle** is traversed row by row by a pixel that moves by a step in every round:
//!    `at.x` grows, and past the last column it restarts and `at.y` grows. Columns and rows come
//!    from a splat's bounds, whose numbers have 15 and 16 bits, so each of at most 2^16 rows has at
//!    most 2^16 rounds.
//! 3. A set of **bits** in a word loses one bit in every round, and the loop ends when none is
//!    left: at most 32 rounds.
//! 4. The outer loops of `accumulate_splat` and `list_splat` continue only if the inner loop
//!    advanced in its rectangle (2).
//! 5. A counter **shrinks** by 1 in every round, and the loop ends at a limit of 0 or more that no
//!    round changes. Or it doubles up to a constant, or halves down to 0, in at most 32 rounds. Or
//!    it grows to more than twice its value (`sink`), and the loop ends past the length of a list,
//!    which is shorter than 2^30.
//! 6. Each round of `composite_on` in `layers.wgsl` ends the loop, is the last round, or consumes
//!    the fragment at `first`, as the round's surface reaches at least to that depth. The inner
//!    loop moves `first`, which is a counter (1), past all consumed fragments.
//!
//! A file whose loops end says so in a comment, which names the rules above and the [`code_hash`]
//! of the code that was proven. Whoever changes the code must prove it again. Two kinds of text are
//! excluded: the compare-exchange loop of `accumulator_cas.wgsl`, because by the letter of WGSL a
//! weak exchange may fail any number of times, and texts that are not the built-in ones.

/// Number of loops in a kernel's text. Each loop must start a line.
fn loops(text: &str) -> usize {
    let starts =
        |line: &str| ["for (", "while (", "loop {"].iter().any(|keyword| line.trim_start().starts_with(keyword));
    text.lines().filter(|line| starts(line)).count()
}

/// [`hash`] of a kernel's code: its lines without comments and surrounding space.
fn code_hash(text: &str) -> u64 {
    let code = text.lines().map(|line| line.split("//").next().unwrap_or(line).trim()).filter(|code| !code.is_empty());
    hash(code.flat_map(|code| code.bytes().chain([b'\n'])))
}

/// 64-bit FNV-1a hash (Fowler, Noll, Vo).
pub(super) fn hash(bytes: impl Iterator<Item = u8>) -> u64 {
    bytes.fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3))
}

/// Returns the hash in the comment by which a kernel claims that all its loops end.
fn proven(text: &str) -> Option<u64> {
    let claim = text.lines().find_map(|line| line.strip_prefix("// All loops end, by "))?;
    let (_, hash) = claim.split_once(" of src/gpu/loops.rs: 0x")?;
    u64::from_str_radix(hash, 16).ok()
}

/// Whether a built-in kernel has no loops, or all of them are proven to end.
pub(super) fn all_end(text: &str) -> bool {
    proven(text).map_or_else(|| loops(text) == 0, |hash| code_hash(text) == hash)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::gpu::sources::{FILES, Sources};

    #[test]
    fn every_loop_of_the_kernels_is_in_the_proof_but_one() {
        let open: Vec<_> = FILES.iter().filter(|(_, text)| !all_end(text)).map(|(name, _)| *name).collect();
        assert_eq!(open, ["accumulator_cas.wgsl"]);
        for (file, text) in FILES {
            let Some(hash) = proven(text) else { continue };
            assert_eq!(code_hash(text), hash, "{file} is 0x{:016x} now: prove that its loops end", code_hash(text));
            assert!(loops(text) > 0, "{file} has no loop to prove anything of");
        }
        // Comments do not change the hash; limits do.
        let (_, text) = FILES.iter().find(|(name, _)| *name == "bin.wgsl").unwrap();
        assert!(all_end(&format!("// Read me.\n{text}")));
        assert!(!all_end(&text.replacen("+= ", "-= ", 1)) && text.contains("+= "));
        // A loop in the middle of a line would not be counted.
        for (name, text) in FILES {
            let code = |line: &str| line.split("//").next().unwrap().to_owned();
            let words =
                |line: &str| code(line).split(|c: char| !c.is_alphanumeric() && c != '_').map(str::to_owned).collect();
            let keywords = text.lines().flat_map(|line| -> Vec<String> { words(line) });
            let counted = keywords.filter(|word| matches!(word.as_str(), "for" | "while" | "loop")).count();
            assert_eq!(counted, loops(text), "{name}");
        }
    }

    #[test]
    fn other_texts_are_not_trusted() {
        let built_in = Sources::default();
        assert!(built_in.all_end(&["layout.wgsl", "visibility.wgsl"]));
        assert!(!built_in.all_end(&["layout.wgsl", "accumulator_cas.wgsl"]));
        let changed = built_in.replace("visibility.wgsl", "at.x++;", "at.x--;").unwrap();
        assert!(!changed.all_end(&["layout.wgsl", "visibility.wgsl"]));
        assert!(changed.all_end(&["layout.wgsl"]));
        // With the optimisation off, every loop is counted.
        assert!(!Sources::default().with_counted_loops().all_end(&["layout.wgsl", "visibility.wgsl"]));
    }
}
