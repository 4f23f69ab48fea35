//! Stages 2 and 3 by the rasteriser (Botsch et al. 2005), the baseline for the compute kernels.
//!
//! The splats are those of [`project`](super::project). Footprint and attributes use the WGSL of
//! the compute kernels. A quad covers the pixels that a splat may touch. The **visibility pass**
//! stores the nearest depth in a depth buffer. The **attribute pass** adds each accepted fragment's
//! terms by additive blending, four channels per target. Then [`resolve`](super::resolve) reads the
//! targets. [`RasterDepth`] says how fragments are accepted:
//!
//! - **exact**: fragments write their own depth, scaled by a power of two, and the attribute pass
//!   compares in the shader. It accepts exactly the fragments that the compute kernels accept.
//! - **offset**: the quads lie in the disks' planes, and the rasteriser interpolates and compares
//!   depths. Both sides of a surface are blended, with normals as they are given, as in the papers.
//!   Depths err by the rasteriser's interpolation (a fragment within about 2^-20 of epsilon may be
//!   decided otherwise), absolute tolerances are applied at the quads' corners, and a plane that
//!   passes through the eye within its quad becomes bent. OpenGL cannot represent these depths. It
//!   maps them to the range -1 to 1, in which far depths lie near -1 and keep no digits; other APIs
//!   store them near 0.
//!
//! Triangles are drawn first, and write their numbers to a texture. The rasteriser determines their
//! coverage and interpolates their depths. The nearest triangle is shaded as in the compute path
//! ([`triangles`]).
//!
//! **Error.** In a floating format of unit roundoff r (2^-11 or 2^-24), a sum of n terms errs by at
//! most `n r` of itself, so a mean errs by `2 n r + 4 u` with u = 2^-24. An 8-bit sum holds
//! [`BlendFormat::MOST_WEIGHTS_8`] = 8 weights in steps of 1/255 of that, and each of the n
//! additions errs by half a step: a mean errs by `8 n / (255 w)` for a summed weight w. Anything
//! above 8 weights is lost. Blending rounds in the order of the quads, so the image depends on the
//! order of the surfels.

use super::triangles;
use crate::gpu::program::Draw;
use crate::plan::pass::Pass;
use crate::plan::steps::Step;
use crate::plan::{BlendFormat, PixelLayout, Plan, Raster, RasterDepth, SceneNeeds};

/// The pass's files and constants; its pipelines are those of [`draws`].
pub const PASS: Pass = Pass {
    name: "raster",
    files: |needs| match needs.surface.raster() {
        None => Vec::new(),
        Some(raster) => {
            let mut files = vec!["raster.wgsl", "accumulator_raster.wgsl", targets_file(needs)];
            let peeled =
                if needs.surface.peels().is_some() { "raster_peeled.wgsl" } else { "raster_peeled_absent.wgsl" };
            let own: &[&str] = match (raster.depth, needs.surface.shows_nearest()) {
                (RasterDepth::Exact, false) => &["raster_own_depths.wgsl", "raster_exact.wgsl", peeled],
                (RasterDepth::Exact, true) => &["raster_own_depths.wgsl", "raster_nearest_exact.wgsl"],
                (RasterDepth::Offset, false) => &["raster_offset.wgsl"],
                (RasterDepth::Offset, true) => &["raster_nearest_offset.wgsl"],
            };
            files.extend(own);
            files
        }
    },
    kernels: |_| Vec::new(),
    constants: |making| match making.needs.surface.raster() {
        None => Vec::new(),
        Some(raster) => vec![
            ("VERTICES", vertices(making.needs).into()),
            ("BLEND_SCALE", if making.needs.surface.shows_nearest() { 1.0 } else { blend_scale(raster.format) }),
            // The visibility pass's pipeline overrides this.
            ("MOVED", 0.0),
        ],
    },
};

/// Vertices per splat; see raster.wgsl.
pub fn vertices(needs: &SceneNeeds) -> u32 {
    if needs.surface.by_triangles() { 3 } else { 6 }
}

/// The file that declares as many targets as `needs` requires.
fn targets_file(needs: &SceneNeeds) -> &'static str {
    match PixelLayout::of(needs).targets() {
        1 => "raster_targets_1.wgsl",
        2 => "raster_targets_2.wgsl",
        // Weight, four of colour, a gap, three of the normal, depth and its weights, count: at most
        // twelve channels.
        _ => "raster_targets_3.wgsl",
    }
}

/// The factor on terms, so that a target of `format` can hold their sums.
fn blend_scale(format: BlendFormat) -> f64 {
    match format {
        BlendFormat::Rgba8Unorm => 1.0 / f64::from(BlendFormat::MOST_WEIGHTS_8),
        BlendFormat::Rgba16Float | BlendFormat::Rgba32Float => 1.0,
    }
}

/// The texture format of the blended targets.
pub fn texture_format(format: BlendFormat) -> wgpu::TextureFormat {
    match format {
        BlendFormat::Rgba8Unorm => wgpu::TextureFormat::Rgba8Unorm,
        BlendFormat::Rgba16Float => wgpu::TextureFormat::Rgba16Float,
        BlendFormat::Rgba32Float => wgpu::TextureFormat::Rgba32Float,
    }
}

/// The texture format of nearest depths.
pub const DEPTH_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;

/// The pipelines of the two passes and of triangles. If only the nearest fragment shows, a single
/// pipeline draws it, and its terms replace those of other fragments.
pub fn draws(raster: Raster, needs: &SceneNeeds) -> Vec<Draw> {
    let pixel = PixelLayout::of(needs);
    let depth = |compare, write| {
        Some(wgpu::DepthStencilState {
            format: DEPTH_FORMAT,
            depth_write_enabled: Some(write),
            depth_compare: Some(compare),
            stencil: Default::default(),
            bias: Default::default(),
        })
    };
    let (near_first, test) = match raster.depth {
        RasterDepth::Exact => (wgpu::CompareFunction::Less, None),
        // With offsets, depths are largest in front.
        RasterDepth::Offset => (wgpu::CompareFunction::Greater, depth(wgpu::CompareFunction::GreaterEqual, false)),
    };
    let add = wgpu::BlendComponent {
        src_factor: wgpu::BlendFactor::One,
        dst_factor: wgpu::BlendFactor::One,
        operation: wgpu::BlendOperation::Add,
    };
    let target = wgpu::ColorTargetState {
        format: texture_format(raster.format),
        blend: Some(wgpu::BlendState { color: add, alpha: add }),
        write_mask: wgpu::ColorWrites::ALL,
    };
    let draw = |name, (vertex, fragment), targets, depth, moved: bool| Draw {
        name,
        vertex,
        fragment,
        targets,
        depth,
        constant: Some(("MOVED", u32::from(moved).into())),
    };
    if needs.surface.shows_nearest() {
        let replaced = wgpu::ColorTargetState { blend: None, ..target };
        let entries = ("shape_with_attributes", "raster_nearest");
        return vec![draw(
            "nearest",
            entries,
            vec![replaced; pixel.targets() as usize],
            depth(near_first, true),
            false,
        )];
    }
    let of_triangles = needs.mesh.map(|_| triangles::draw());
    let shape = if needs.surface.peels().is_some() { "shape_to_peel" } else { "shape" };
    [
        draw("visibility", (shape, "raster_visibility"), vec![], depth(near_first, true), true),
        draw(
            "accumulate",
            ("shape_with_attributes", "raster_attributes"),
            vec![target; pixel.targets() as usize],
            test,
            false,
        ),
    ]
    .into_iter()
    .chain(of_triangles)
    .collect()
}

/// The step that draws both passes, over the whole image.
pub const STEP: Step = Step::Draw;

/// The names of the blended targets in WGSL.
pub const SUM_NAMES: [&str; 3] = ["sums_0", "sums_1", "sums_2"];

/// The number of vertices of `slots` splats; `None` if a draw cannot have so many. A binding for
/// them would take 45 GB.
pub fn vertices_of(plan: &Plan, slots: u64) -> Option<u32> {
    u32::try_from(slots * u64::from(vertices(&plan.needs))).ok()
}
