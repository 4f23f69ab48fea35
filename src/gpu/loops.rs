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
//! 2. A **rectangle** is passed in rows by a pixel that grows by a step in each round: `at.x` grows, and where it passes the last
//!    column it starts again with `at.y` grown. Columns and rows come from a splat's bounds, whose numbers have 15 and 16 bits, so
//!    each of at most 2^16 rows has at most 2^16 rounds.
//! 3. A set of **bits** in a word loses one in each round, and the loop ends when none is left: at most 32 rounds.
//! 4. The outer loop of `accumulate_splat` goes on only if its inner one moved on in its rectangle (2).
//!
//! The compare and exchange of `accumulator_cas.wgsl` is left out: a weak exchange may fail any number of times by the letter of
//! WGSL. So are texts that are not the built-in ones.

use super::Gpu;
use super::kernel::Sources;

/// Files with loops that all end by the proof above: how many they have, and by which of its parts.
const ENDING: &[(&str, usize, &[u32])] = &[
    ("accumulate.wgsl", 2, &[2, 4]),
    ("accumulator_fixed.wgsl", 1, &[3]),
    ("accumulator_fixed_pairs.wgsl", 2, &[1, 3]),
    ("accumulator_raster.wgsl", 2, &[1]),
    ("bin.wgsl", 5, &[1]),
    ("camera_pinhole.wgsl", 2, &[1]),
    ("center.wgsl", 1, &[1]),
    ("center_doubled.wgsl", 1, &[1]),
    ("color_sums.wgsl", 1, &[1]),
    ("covered.wgsl", 1, &[1]),
    ("cull.wgsl", 2, &[1]),
    ("image_maps.wgsl", 1, &[1]),
    ("normal.wgsl", 1, &[1]),
    ("normal_map.wgsl", 1, &[1]),
    ("occlusion.wgsl", 4, &[1]),
    ("project.wgsl", 3, &[1]),
    ("resolve.wgsl", 1, &[1]),
    ("shade_lambert.wgsl", 1, &[1]),
    ("shade_phong.wgsl", 1, &[1]),
    ("texture.wgsl", 1, &[1]),
    ("tile.wgsl", 11, &[1, 3]),
    ("tile_sums.wgsl", 1, &[1]),
    ("visibility.wgsl", 3, &[1, 2]),
];

/// Loops in a kernel's text, each of which starts a line.
fn loops(text: &str) -> usize {
    let starts =
        |line: &str| ["for (", "while (", "loop {"].iter().any(|keyword| line.trim_start().starts_with(keyword));
    text.lines().filter(|line| starts(line)).count()
}

/// Whether all loops of a built-in kernel file end.
pub(super) fn all_end(file: &str, text: &str) -> bool {
    loops(text) == ENDING.iter().find(|(name, ..)| *name == file).map_or(0, |(_, count, _)| *count)
}

/// The module of `files` of `sources`, whose joined text is `text`.
pub(super) fn module(gpu: &Gpu, sources: &Sources, files: &[&str], text: String) -> wgpu::ShaderModule {
    let descriptor =
        wgpu::ShaderModuleDescriptor { label: Some("epsplat"), source: wgpu::ShaderSource::Wgsl(text.into()) };
    if !sources.all_end(files) {
        return gpu.device.create_shader_module(descriptor);
    }
    let checks = wgpu::ShaderRuntimeChecks { force_loop_bounding: false, ..wgpu::ShaderRuntimeChecks::checked() };
    // SAFETY: of all run-time checks the bounds of loops alone are left out, and each loop of these files ends (see above).
    #[allow(unsafe_code)]
    unsafe {
        gpu.device.create_shader_module_trusted(descriptor, checks)
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::gpu::kernel::FILES;

    #[test]
    fn every_loop_of_the_kernels_is_in_the_proof_but_one() {
        let open: Vec<_> = FILES.iter().filter(|(name, text)| !all_end(name, text)).map(|(name, _)| *name).collect();
        assert_eq!(open, ["accumulator_cas.wgsl"]);
        for (file, ..) in ENDING {
            assert!(FILES.iter().any(|(name, _)| name == file), "{file} has no kernel");
        }
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
    }
}
