//! Stage 4: sums become the image: divide by the weight (paper 000, section 5.4), shade, put over the background.

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::accumulate::PixelSums;
use super::covered::Covered;
use super::variant::Variant;
use super::{Recorder, Rows};
use crate::error::Result;
use crate::frame::Frame;
use crate::gpu::Gpu;
use crate::gpu::buffers::{Buffer, Readback};
use crate::gpu::kernel::Bound;
use crate::plan::RenderOptions;
use crate::scene::options::HIGHLIGHT;
use crate::scene::{Camera, Colors, Light, Scene, Shading};

/// The twin: resolves `sums`, which start at row `first_row` of the image, into `frame`, which holds just their rows.
pub fn reference(
    sums: &[PixelSums],
    scene: &Scene,
    camera: &Camera,
    options: &RenderOptions,
    first_row: u32,
    frame: &mut Frame,
) {
    for (pixel, sum) in sums.iter().enumerate() {
        let (x, y) = (pixel as u32 % camera.width, pixel as u32 / camera.width + first_row);
        let background = options.background.map(f64::from);
        let (mut color, mut depth, mut normal) = (background, f64::INFINITY, DVec3::ZERO);
        if sum.weight > 0.0 {
            let blended = sum.color.map(|c| c / sum.weight);
            let mean = match &scene.colors {
                Colors::Textured(textured) => textured.resolve(sum.place.map(|total| total / sum.weight), blended),
                _ => blended,
            };
            let alpha = mean[3];
            let straight = DVec3::new(mean[0], mean[1], mean[2]) / if alpha > 0.0 { alpha } else { f64::INFINITY };
            normal = unit_or_zero(DVec3::from_array(sum.normal) / sum.weight);
            let shaded = shade(straight, normal, camera, options, DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5));
            color = over([shaded.x, shaded.y, shaded.z, alpha], background);
            depth = sum.depth / sum.weight;
        }
        frame.color[pixel] = color.map(|c| c as f32);
        let set = |map: &mut Option<Vec<f32>>, value: f64| {
            if let Some(map) = map {
                map[pixel] = value as f32;
            }
        };
        set(&mut frame.depth, depth);
        set(&mut frame.weight, sum.weight);
        set(&mut frame.count, f64::from(sum.count));
        set(&mut frame.decision, sum.decision);
        if let Some(map) = &mut frame.normal {
            map[pixel] = normal.as_vec3().to_array();
        }
    }
}

/// The normalised mean; 0 where opposite normals cancel.
fn unit_or_zero(mean: DVec3) -> DVec3 {
    if mean.length_squared() > 1e-12 { mean.normalize() } else { DVec3::ZERO }
}

/// The linear colour that a surface of colour `straight` and unit `normal` has at the image point `at`, pixels.
pub(crate) fn shade(straight: DVec3, normal: DVec3, camera: &Camera, options: &RenderOptions, at: DVec2) -> DVec3 {
    match options.shading {
        Shading::Unlit => straight,
        Shading::Lambert => {
            straight * irradiances(normal, camera, &options.lights, at).map(|(light, _)| light).sum::<f64>()
        }
        Shading::Phong => {
            let exponent = f64::from(options.shininess);
            let lights = irradiances(normal, camera, &options.lights, at);
            let (diffuse, highlight) = lights.fold((0.0, 0.0), |(diffuse, highlight), (light, mirrored)| {
                (diffuse + light, highlight + light * mirrored.max(0.0).powf(exponent))
            });
            straight * diffuse + HIGHLIGHT * highlight
        }
    }
}

/// For each light at an image point its intensity times its cosine (the headlight lights both sides, a directional light the
/// side the normal is on), and the cosine between its mirrored direction and the one toward the eye.
fn irradiances(normal: DVec3, camera: &Camera, lights: &[Light], at: DVec2) -> impl Iterator<Item = (f64, f64)> {
    let toward_eye = -camera.ray(at.x, at.y).normalize();
    lights.iter().map(move |light| {
        let (toward, intensity) = match *light {
            Light::Headlight { intensity } => (toward_eye, intensity),
            Light::Directional { toward, intensity } => (toward.as_dvec3(), intensity),
        };
        let facing = normal.dot(toward);
        let received = if matches!(light, Light::Headlight { .. }) { facing.abs() } else { facing.max(0.0) };
        let mirrored = 2.0 * facing * normal.dot(toward_eye) - toward.dot(toward_eye);
        (f64::from(intensity) * received, mirrored)
    })
}

/// Straight alpha over straight alpha.
pub(crate) fn over(front: [f64; 4], back: [f64; 4]) -> [f64; 4] {
    let behind = back[3] * (1.0 - front[3]);
    let alpha = front[3] + behind;
    if alpha > 0.0 {
        let blend = |k: usize| (front[k] * front[3] + back[k] * behind) / alpha;
        [blend(0), blend(1), blend(2), alpha]
    } else {
        [0.0; 4]
    }
}

/// Resolved pixels of some rows.
pub struct ImageBuffer {
    /// [`PixelLayout::image_words`](super::variant::PixelLayout::image_words) a pixel.
    pub image: Buffer<f32>,
    readback: Readback,
}

impl ImageBuffer {
    /// Room for `pixels`.
    pub fn new(gpu: &Gpu, variant: &Variant, pixels: u64) -> Result<Self> {
        let record = u64::from(variant.pixel.image_words);
        let image = Buffer::readable(gpu, "image", pixels * record)?;
        let readback = Readback::new(gpu, &image, pixels * record * 4, record * 4);
        Ok(Self { image, readback })
    }

    /// Clears what covered tiles do not write, and their list.
    pub(crate) fn clear(
        &self,
        variant: &Variant,
        encoder: &mut wgpu::CommandEncoder,
        rows: &Rows,
        covered: Covered<'_>,
    ) {
        covered.clear(encoder);
        if !variant.lists_empty {
            let bytes = rows.pixels * u64::from(variant.pixel.image_words) * 4;
            encoder.clear_buffer(&self.image.raw, 0, Some(bytes));
        }
    }

    /// Memory that it takes, bytes, with what the host reads it through.
    pub fn bytes(&self) -> u64 {
        self.image.bytes() + self.readback.bytes()
    }
}

/// Records the pass over the covered tiles of `rows`, whose sums `sums` binds.
pub fn record(
    recorder: &mut Recorder<'_>,
    rows: &Rows,
    (covered, sums): (Covered<'_>, Bound<'_>),
    buffer: &ImageBuffer,
) -> Result<()> {
    let (gpu, program) = (recorder.gpu, recorder.program);
    let own = [("view", recorder.view.bound()), ("band", rows.uniform.bound()), ("image", buffer.image.bound())];
    let sums: Bound<'_> = own.into_iter().chain(sums).collect();
    let bound: Bound<'_> = sums.iter().cloned().chain([("visible", covered.bound())]).collect();
    let variant = recorder.variant;
    let clear = |encoder: &mut wgpu::CommandEncoder| buffer.clear(variant, encoder, rows, covered);
    recorder.timing.pass(gpu, "resolve", clear, |pass| {
        covered.record((gpu, program), pass, rows, &sums)?;
        program.dispatch(gpu, pass, "resolve", &bound, covered.each())
    })
}

/// Reads resolved rows back into `frame`.
pub fn read_back(recorder: &Recorder<'_>, rows: &Rows, buffer: &ImageBuffer, frame: &mut Frame) -> Result<()> {
    let layout = recorder.variant.pixel;
    let record = layout.image_words as usize * 4;
    let start = rows.first as usize * frame.width as usize;
    buffer.readback.visit(recorder.gpu, &buffer.image, rows.pixels * record as u64, |offset, bytes| {
        let first = start + offset as usize / record;
        let pixels = bytes.len() / record;
        // Word `word` of each pixel on, in a map of N values a pixel.
        fn copy<const N: usize>(map: &mut [[f32; N]], bytes: &[u8], record: usize, word: u32) {
            let at = word as usize * 4;
            map.par_iter_mut().zip(bytes.par_chunks_exact(record)).with_min_len(1 << 14).for_each(|(value, bytes)| {
                *value = bytemuck::pod_read_unaligned(&bytes[at..at + 4 * N]);
            });
        }
        let range = first..first + pixels;
        copy(&mut frame.color[range.clone()], bytes, record, 0);
        if let Some(map) = &mut frame.normal {
            copy(&mut map[range.clone()], bytes, record, layout.normal_image);
        }
        let maps = [
            (&mut frame.depth, layout.depth_image),
            (&mut frame.weight, layout.weight_image),
            (&mut frame.count, layout.count_image),
        ];
        for (map, word) in maps {
            if let Some(map) = map {
                copy(bytemuck::cast_slice_mut::<f32, [f32; 1]>(&mut map[range.clone()]), bytes, record, word);
            }
        }
    })
}
