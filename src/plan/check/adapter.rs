//! Checks that an adapter supports what a render needs.

use crate::error::{Error, Result};
use crate::gpu::adapter::AdapterDescription;
use crate::plan::{Accumulator, BlendFormat, Features, Fetch, PixelLayout, RasterDepth, SceneNeeds};
use crate::scene::Camera;

/// Fails if `adapter` lacks what `needs` require.
///
/// # Errors
/// A sentence that says what is missing and what to do.
pub fn on_adapter(adapter: &AdapterDescription, needs: &SceneNeeds, camera: &Camera) -> Result<()> {
    if needs.surface.fetch() == Some(Fetch::Shared) && !adapter.subgroups {
        return Err(adapter.error("tiles share splats by subgroups, which this adapter lacks: take --fetch staged"));
    }
    match needs.surface.raster() {
        None => sums(adapter, needs.accumulator),
        Some(_) => rasteriser(adapter, needs, camera),
    }
}

/// Fails if `adapter` lacks the atomics of `accumulator`.
///
/// # Errors
/// A sentence that says what is missing and what to do.
pub fn sums(adapter: &AdapterDescription, accumulator: Accumulator) -> Result<()> {
    let (has, what) = match accumulator.row().features {
        Features::None => return Ok(()),
        Features::AtomicsU64 => (adapter.atomics_u64, "64-bit atomics"),
        Features::AtomicsF32 => (adapter.atomics_f32, "f32 atomic add"),
    };
    if has {
        return Ok(());
    }
    Err(adapter.error(format!("the accumulator {accumulator} needs {what}, which this adapter lacks: take fixed")))
}

fn rasteriser(adapter: &AdapterDescription, needs: &SceneNeeds, camera: &Camera) -> Result<()> {
    let Some(raster) = needs.surface.raster() else { return Ok(()) };
    let limit = |limit, available: u32, needed: u32, what: &str| match needed > available {
        false => Ok(()),
        true => Err(Error::Limit {
            adapter: adapter.name.clone(),
            limit,
            available: available.into(),
            needed: needed.into(),
            what: what.into(),
        }),
    };
    if !adapter.vertex_storage {
        return Err(
            adapter.error("vertex shaders cannot read the splats here: take --backend gpu, or another --adapter")
        );
    }
    if needs.mesh.is_some() && adapter.api == "gl" {
        let what = "OpenGL interpolates depths of triangles too coarsely: take --backend gpu, or another --adapter";
        return Err(adapter.error(what));
    }
    if raster.depth != RasterDepth::Exact && adapter.api == "gl" {
        return Err(
            adapter.error("OpenGL interpolates depths too coarsely: take --raster-depth exact, or another --adapter")
        );
    }
    if raster.format == BlendFormat::Rgba32Float && !adapter.blends_f32 {
        return Err(adapter.error("this adapter does not blend into 32-bit floats: take --blend-format rgba16float"));
    }
    let side = camera.width.max(camera.height);
    let most = adapter.max_texture_dimension_2d;
    limit("max_texture_dimension_2d", most, side, "for the image; choose a smaller one")?;
    let bytes = raster.format.bytes() * PixelLayout::of(needs).targets();
    let most = adapter.max_color_attachment_bytes_per_sample;
    limit(
        "max_color_attachment_bytes_per_sample",
        most,
        bytes,
        "for the sums; ask for fewer maps, or take --blend-format rgba16float",
    )
}
