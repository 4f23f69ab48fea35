//! Which kernels' loops are known to end, and modules of them.
//!
//! wgpu gives every loop a counter that ends it, as a loop without an end is undefined behaviour on most devices. Counting takes
//! time in every round: on Mesa's llvmpipe 1.02 to 1.12 of a frame's (`benches/optimisations.toml`).
//! The counters are left out of modules all of whose loops end by the following proof; every other check of wgpu stays.
//!
//! 1. A **counter** starts somewhere, grows by 1 or by a constant step of at most 256 in each round whatever happens in it, and
//!    the loop ends once it passes a limit that no round changes. It ends if the counter cannot wrap on its way past the limit,
//!    thus if the limit is at most 2^32 - 1 - 256. Limits are: constants; sides of the image, which have 15 bits
//!    ([`Camera`](crate::scene::Camera) refuses larger ones), and cells and tiles of it; and lengths of lists, of which each is a
//!    range within a binding (`column_of` holds it below `arrayLength`, and its end is its start plus what was placed), thus
//!    shorter than 2^30 words, and a tile has two.
//!    Where it grows by 1 as long as it is below its limit any limit will do: it comes there before it wraps.
//! 2. A **rectangle** is passed in rows by a pixel that grows by a step in each round: `at.x` grows, and where it passes the last
//!    column it starts again with `at.y` grown. Columns and rows come from a splat's bounds, whose numbers have 15 and 16 bits, so
//!    each of at most 2^16 rows has at most 2^16 rounds.
//! 3. A set of **bits** in a word loses one in each round, and the loop ends when none is left: at most 32 rounds.
//! 4. The outer loops of `accumulate_splat` and `list_splat` go on only if the inner one moved on in its rectangle (2).
//! 5. A counter **shrinks** by 1 in each round, and the loop ends at 0 or at a limit that no round changes, which is not below 0; or it
//!    grows to more than twice itself (`sink`) and the loop ends past the length of a list, which is shorter than 2^30.
//! 6. Each round of `composite_on` in `layers.wgsl` ends the loop, or tells the fragment at `first`, as its surface reaches at least as deep,
//!    or is the last; and the inner loop moves `first`, which is a counter (1), past all that is told.
//!
//! A file of loops that end says so in a comment: by which of these, and the [`code_hash`] of what was proven. Whoever changes its
//! code proves it again. The compare and exchange of `accumulator_cas.wgsl` is left out: a weak exchange may fail any number of times
//! by the letter of WGSL. So are texts that are not the built-in ones.

/// Loops in a kernel's text, each of which starts a line.
fn loops(text: &str) -> usize {
    let starts =
        |line: &str| ["for (", "while (", "loop {"].iter().any(|keyword| line.trim_start().starts_with(keyword));
    text.lines().filter(|line| starts(line)).count()
}

/// The 64-bit FNV-1a hash (Fowler, Noll, Vo) of a kernel's code: of its lines without comments and the space around them.
fn code_hash(text: &str) -> u64 {
    let code = text.lines().map(|line| line.split("//").next().unwrap_or(line).trim()).filter(|code| !code.is_empty());
    code.flat_map(|code| code.bytes().chain([b'\n']))
        .fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3))
}

/// The hash of the code whose loops a kernel's comment says to end.
fn proven(text: &str) -> Option<u64> {
    let claim = text.lines().find_map(|line| line.strip_prefix("// All loops end, by "))?;
    let (_, hash) = claim.split_once(" of src/gpu/loops.rs: 0x")?;
    u64::from_str_radix(hash, 16).ok()
}

/// Whether all loops of a built-in kernel end.
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
        // A comment is no code; a limit is.
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
        // Whoever leaves the optimisation out has every loop counted.
        assert!(!Sources::default().with_counted_loops().all_end(&["layout.wgsl", "visibility.wgsl"]));
    }
}
