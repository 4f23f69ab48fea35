//! Which kernels a render is made of: the files that are joined, the numbers that are set, and the room a pixel takes.
//! [`SceneNeeds`] is the only key.

use std::sync::Arc;

use super::accumulate;
use super::lowpass::Design;
use super::{covered, cull, lowpass, raster};
use crate::error::Result;
use crate::gpu::kernel::Program;
use crate::gpu::layout::{LARGE_BY_TILES, LARGE_BY_WORKGROUPS, TILE_ROWS_PLAIN, TILE_ROWS_SHARED};
use crate::gpu::{Gpu, Sources};
use crate::plan::{
    AccumulatorRow, ColorNeed, Optimisation, Organisation, PixelLayout, RasterDepth, RenderOptions, SceneNeeds,
    color_channels,
};
use crate::scene::{Kernel, KernelShape, LowPass, Projection, Shading};

/// The entry points that a render with `needs` dispatches.
fn stages(needs: &SceneNeeds) -> Vec<&'static str> {
    let mut stages = vec!["project", "arrange_rare", "project_rare", "arrange", "list_covered", "arrange_covered"];
    if needs.raster.is_none() {
        stages.extend(["visibility", "visibility_large", "occlude"]);
    }
    if needs.raster.is_none() && !needs.gather {
        stages.extend(["accumulate", "accumulate_large"]);
    }
    if !needs.gather {
        stages.push("resolve");
    }
    if needs.cull {
        stages.extend(["cull_near", "cull_far", "occlude_open"]);
    }
    stages
}

/// The entry points of the tiles.
fn tile_stages(needs: &SceneNeeds) -> Vec<&'static str> {
    let mut stages = vec!["bin_count_large", "bin_scan_large", "bin_place_large", "tile_visibility"];
    if needs.gather {
        stages.extend(["bin_count", "bin_scan", "bin_place", "tile_resolve"]);
    } else {
        stages.push("tile_accumulate");
    }
    stages
}

/// A render's kernels, before they are compiled.
#[derive(Clone, Debug)]
pub struct Variant {
    /// The key.
    pub needs: SceneNeeds,
    /// How sums are kept.
    pub accumulator: &'static AccumulatorRow,
    /// The room a pixel takes.
    pub pixel: PixelLayout,
    /// Tiles that nothing covers are resolved too.
    pub lists_empty: bool,
    /// Overridable constants by name; a module takes those it declares.
    pub constants: Vec<(&'static str, f64)>,
}

impl Variant {
    /// The kernels for `surfels` surfels with these needs.
    pub fn of(needs: &SceneNeeds, options: &RenderOptions, surfels: u64) -> Result<Self> {
        let accumulator = needs.accumulator.row();
        let constants = overrides(needs, options, accumulator.fraction_bits(surfels));
        let lists_empty = covered::lists_empty(options);
        Ok(Self { needs: *needs, accumulator, pixel: PixelLayout::of(needs), lists_empty, constants })
    }

    /// The compiled kernels; `gpu` keeps them.
    pub fn compile(&self, gpu: &Gpu, sources: &Sources) -> Result<Arc<Program>> {
        let draws = self.needs.raster.map_or_else(Vec::new, |raster| raster::draws(raster, self.pixel));
        gpu.programs.get(gpu, (sources, &files(&self.needs)), &stages(&self.needs), &draws, &self.constants)
    }

    /// The compiled kernels of the tiles; `gpu` keeps them.
    pub fn compile_tiles(&self, gpu: &Gpu, sources: &Sources) -> Result<Arc<Program>> {
        gpu.programs.get(gpu, (sources, &tile_files(&self.needs)), &tile_stages(&self.needs), &[], &self.constants)
    }

    /// u32 words of a pixel's sums in storage; the rasteriser's are in textures, those of tiles that gather in registers.
    pub fn sum_words(&self) -> u32 {
        if self.needs.raster.is_some() || self.needs.gather { 0 } else { self.pixel.channels * self.accumulator.words }
    }
}

/// The modules that a render with `needs` is made of: their files, and the entry points that it dispatches.
pub fn modules(needs: &SceneNeeds) -> Vec<(Vec<&'static str>, Vec<&'static str>)> {
    let mut modules = vec![(files(needs), stages(needs))];
    if needs.tiles {
        modules.push((tile_files(needs), tile_stages(needs)));
    }
    modules
}

/// The files of a render's first module.
fn files(needs: &SceneNeeds) -> Vec<&'static str> {
    let pick = |needed, file, absent| if needed { file } else { absent };
    let mut files = vec![
        "layout.wgsl",
        pick(needs.long_words, "words_long.wgsl", "words.wgsl"),
        "records.wgsl",
        "double.wgsl",
        "rows.wgsl",
        match needs.projection {
            Projection::Pinhole => "camera_pinhole.wgsl",
            Projection::Orthographic => "camera_orthographic.wgsl",
        },
        pick(needs.doubled, "center_doubled.wgsl", "center.wgsl"),
        pick(needs.copies, "copies.wgsl", "copies_absent.wgsl"),
        "project.wgsl",
        pick(needs.cull, "cull.wgsl", "cull_absent.wgsl"),
        "footprint.wgsl",
        "blend.wgsl",
        pick(needs.epsilon_radius, "epsilon_radius.wgsl", "epsilon.wgsl"),
        match needs.kernel {
            KernelShape::Gaussian => "kernel_gaussian.wgsl",
            KernelShape::Ellipse => "kernel_ellipse.wgsl",
            KernelShape::Hat => "kernel_hat.wgsl",
            KernelShape::Constant => "kernel_constant.wgsl",
        },
        "covered.wgsl",
        "resolve.wgsl",
        pick(has_maps(needs), "image_maps.wgsl", "image_color.wgsl"),
        pick(needs.normal, "normal.wgsl", "normal_absent.wgsl"),
        pick(needs.normal_map, "normal_map.wgsl", "normal_map_absent.wgsl"),
        pick(needs.weight_map, "weight_map.wgsl", "weight_map_absent.wgsl"),
        pick(needs.count, "count.wgsl", "count_absent.wgsl"),
        match needs.shading {
            Shading::Unlit => "shade_unlit.wgsl",
            Shading::Lambert => "shade_lambert.wgsl",
            Shading::Phong => "shade_phong.wgsl",
        },
    ];
    let depth = match needs.raster {
        None => {
            files.extend(["visibility.wgsl", "occlusion.wgsl", "accumulate.wgsl"]);
            files.extend(accumulate::files(needs));
            "depth.wgsl"
        }
        Some(raster) => {
            files.extend(["raster.wgsl", "accumulator_raster.wgsl", raster::targets_file(needs)]);
            match raster.depth {
                RasterDepth::Exact => {
                    files.push("raster_exact.wgsl");
                    "depth.wgsl"
                }
                RasterDepth::Offset | RasterDepth::Ray => {
                    files.push("raster_offset.wgsl");
                    "depth_whole.wgsl"
                }
            }
        }
    };
    files.push(pick(needs.depth, depth, "depth_absent.wgsl"));
    match needs.low_pass {
        LowPass::None => files.push("lowpass_none.wgsl"),
        LowPass::Max => files.extend(["filter.wgsl", "lowpass_max.wgsl"]),
        LowPass::Ewa => files.extend(["filter.wgsl", "lowpass_ewa.wgsl"]),
    }
    match needs.color {
        ColorNeed::Constant => files.push("color_constant.wgsl"),
        ColorNeed::Srgb8 => files.extend(["color_srgb8.wgsl", "srgb.wgsl", "color_sums.wgsl"]),
        ColorNeed::Linear => files.extend(["color_linear.wgsl", "color_sums.wgsl"]),
        ColorNeed::Textured => files.extend(["color_textured.wgsl", "srgb.wgsl", "color_sums.wgsl"]),
    }
    files.push(pick(needs.color == ColorNeed::Textured, "texture.wgsl", "texture_absent.wgsl"));
    files
}

/// Whether pixels of the image have more than a colour.
fn has_maps(needs: &SceneNeeds) -> bool {
    needs.normal_map || needs.depth || needs.weight_map || needs.count
}

/// The files of the tiles' module.
fn tile_files(needs: &SceneNeeds) -> Vec<&'static str> {
    let stored = accumulate::files(needs);
    let mut files: Vec<_> = files(needs).into_iter().filter(|file| !stored.contains(file)).collect();
    files.extend(accumulate::tile_files(needs));
    let pick = |needed, file, absent| if needed { file } else { absent };
    files.extend(["bin.wgsl", "tile.wgsl", "tile_reach.wgsl"]);
    files.push(pick(needs.low_pass == LowPass::None, "tile_filter_absent.wgsl", "tile_filter.wgsl"));
    files.push(pick(needs.gather, "tile_small.wgsl", "tile_small_absent.wgsl"));
    files.push(pick(needs.subgroups, "splat_shared.wgsl", "splat_plain.wgsl"));
    files
}

/// Pixels of a tile, down.
pub fn tile_rows(needs: &SceneNeeds) -> u32 {
    if needs.subgroups { TILE_ROWS_SHARED } else { TILE_ROWS_PLAIN }
}

/// Splats whose bounds hold more pixels than this are large.
fn large(needs: &SceneNeeds, options: &RenderOptions) -> u32 {
    match (needs.tiles, options.organisation) {
        (true, Organisation::Tile) => 0,
        (true, _) => LARGE_BY_TILES,
        (false, _) => LARGE_BY_WORKGROUPS,
    }
}

/// The overridable constants of a render, by name.
pub fn overrides(needs: &SceneNeeds, options: &RenderOptions, fraction_bits: u32) -> Vec<(&'static str, f64)> {
    let layout = PixelLayout::of(needs);
    let mut constants = vec![
        ("LARGE", large(needs, options).into()),
        ("TILE_ROWS", tile_rows(needs).into()),
        ("LIST_EMPTY", u32::from(covered::lists_empty(options)).into()),
        ("HIDES", u32::from(options.has(Optimisation::Hiding)).into()),
        ("CHANNELS", layout.channels.into()),
        ("FRACTION_BITS", fraction_bits.into()),
        ("COLOR_CHANNELS", color_channels(needs).into()),
        ("NORMAL_CHANNEL", layout.normal_channel.into()),
        ("LIGHTS", options.lights.len() as f64),
        ("TURN_NORMALS", u32::from(needs.turn_normals).into()),
        ("DEPTH_CHANNEL", layout.depth_channel.into()),
        ("COUNT_CHANNEL", layout.count_channel.into()),
        ("PLACE_CHANNEL", layout.place_channel.into()),
        ("IMAGE_WORDS", layout.image_words.into()),
        ("NORMAL_IMAGE", layout.normal_image.into()),
        ("DEPTH_IMAGE", layout.depth_image.into()),
        ("WEIGHT_IMAGE", layout.weight_image.into()),
        ("COUNT_IMAGE", layout.count_image.into()),
    ];
    match options.kernel {
        Kernel::Gaussian { sigma } => constants.push(("KERNEL_FALL", 0.5 / (sigma * sigma))),
        Kernel::Ellipse { a, n, smooth } => {
            let step = if smooth { (-a).exp() } else { 0.0 };
            constants.extend([("KERNEL_A", a), ("KERNEL_N", n), ("KERNEL_STEP", step)]);
        }
        Kernel::Hat | Kernel::Constant => {}
    }
    if let Some(raster) = needs.raster {
        constants.push(("VERTICES", raster::vertices(needs).into()));
        constants.push(("BLEND_SCALE", raster::blend_scale(raster.format)));
        // The visibility pass's pipeline says otherwise.
        constants.push(("MOVED", 0.0));
        constants.push(("ALONG_RAY", u32::from(raster.depth == RasterDepth::Ray).into()));
    }
    if needs.shading == Shading::Phong {
        constants.push(("SHININESS", options.shininess.into()));
    }
    if needs.cull {
        constants.push(("FILTER_REACH", cull::filter_reach(&Design::of(options))));
    }
    if needs.low_pass == LowPass::Ewa {
        constants.push(("FILTER_BLUR", lowpass::blur(options.kernel)));
    }
    constants
}
