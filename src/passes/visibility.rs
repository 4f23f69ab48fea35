//! Stage 2: the nearest depth at every pixel, `min z` over the splats that cover it (paper 000, section 5.3, first
//! pass; there the tolerance is added to the depths, here to the comparison, which is exact).
//!
//! On the device depths are positive f32, whose bits order as u32: an atomic min. They are kept as what they lack to +inf, so
//! that it is an atomic max over a buffer of zeros. What is then farthest in each tile of
//! pixels lets the next pass leave out splats that are hidden altogether.

use super::covered::Covered;
use super::cull::Part;
use super::footprint::footprint;
use super::project::{Splat, SplatBuffer};
use super::{Recorder, Rows};
use crate::error::Result;
use crate::gpu::Gpu;
use crate::gpu::buffers::Buffer;
use crate::gpu::kernel::{Grid, grid};
use crate::scene::{Camera, LowPass};

/// The twin: nearest depths of the rows `first_row..first_row + rows`, +inf where nothing is.
pub fn reference<'a>(
    splats: impl Iterator<Item = &'a Splat>,
    camera: &Camera,
    low_pass: LowPass,
    first_row: u32,
    rows: u32,
) -> Vec<f64> {
    let mut nearest = vec![f64::INFINITY; camera.width as usize * rows as usize];
    for splat in splats {
        for y in splat.first[1].max(first_row)..=splat.last[1].min(first_row + rows - 1) {
            let row = (y - first_row) as usize * camera.width as usize;
            for x in splat.first[0]..=splat.last[0] {
                if let Some((hit, _)) = footprint(splat, camera, low_pass, x, y).filter(|(i, _)| i.hit(camera)) {
                    let pixel = &mut nearest[row + x as usize];
                    *pixel = pixel.min(hit.depth);
                }
            }
        }
    }
    nearest
}

/// The nearest depth of each pixel of some rows, device units, as what its bits lack to those of +inf.
pub struct VisibilityBuffer {
    /// One word a pixel, then one a tile (occlusion.wgsl), then the covered tiles.
    pub nearest: Buffer<u32>,
}

impl VisibilityBuffer {
    /// Room for each of `bands`.
    pub fn new(gpu: &Gpu, bands: &[Rows]) -> Result<Self> {
        let words = bands.iter().map(|rows| rows.pixels + rows.tiles + Covered::room(rows)).max().unwrap_or(0);
        Ok(Self { nearest: Buffer::indirect(gpu, "nearest depths", words)? })
    }

    /// Where the covered tiles of `rows` are listed.
    pub fn covered(&self, rows: &Rows) -> Covered<'_> {
        Covered::new(&self.nearest, rows.pixels + rows.tiles)
    }
}

/// Records the pass of `part` of the small splats over `rows`.
pub fn record(
    recorder: &mut Recorder<'_>,
    (splats, part): (&SplatBuffer, Part),
    rows: &Rows,
    buffer: &VisibilityBuffer,
) -> Result<()> {
    let clear = |encoder: &mut wgpu::CommandEncoder| {
        if part != Part::Far {
            encoder.clear_buffer(&buffer.nearest.raw, 0, Some(rows.pixels * 4));
        }
    };
    splats.dispatch(recorder, ("visibility", part), rows, &[("nearest", buffer.nearest.bound())], clear)
}

/// Records the pass of the large splats over `rows`, a workgroup each.
pub fn record_large(
    recorder: &mut Recorder<'_>,
    splats: &SplatBuffer,
    rows: &Rows,
    buffer: &VisibilityBuffer,
) -> Result<()> {
    let buffers = [("nearest", buffer.nearest.bound())];
    splats.dispatch_large(recorder, ("visibility", "visibility_large"), rows, &buffers)
}

/// Records the farthest of the nearest depths in each tile; after [`Part::Near`], what is empty hides nothing.
pub fn occlude(recorder: &mut Recorder<'_>, part: Part, rows: &Rows, buffer: &VisibilityBuffer) -> Result<()> {
    let stage = if part == Part::Near { "occlude_open" } else { "occlude" };
    over(recorder, stage, (rows, rows.tiles), buffer)
}

/// Records a kernel over the depths alone.
fn over(
    recorder: &mut Recorder<'_>,
    stage: &str,
    (rows, invocations): (&Rows, u64),
    buffer: &VisibilityBuffer,
) -> Result<()> {
    let (gpu, program) = (recorder.gpu, recorder.program);
    let bound = [("view", recorder.view.bound()), ("band", rows.uniform.bound()), ("nearest", buffer.nearest.bound())];
    recorder.timing.pass(
        gpu,
        "visibility",
        |_| {},
        |pass| program.dispatch(gpu, pass, stage, &bound, Grid::Of(grid(gpu, invocations)?)),
    )
}
