//! Stage 4: makes the image from the sums. They are divided by the weight (paper 000, section 5.4),
//! shaded, and composited over the background.

use glam::{DVec3, DVec4};
use rayon::prelude::*;

use super::accumulate::PixelSums;
use super::join::Beside;
use super::visibility::Nearest;
use super::{covered, individuals, join, long_lists};
use crate::frame::Frame;
use crate::plan::pass::Pass;
use crate::plan::steps::{Kernel, Over, Run, Stage, Twin};
use crate::plan::{Lists, PixelLayout, Plan, Settings};
use crate::scene::maps::SURFACES;
use crate::scene::options::HIGHLIGHT;
use crate::scene::{Camera, Colors, Light, MAPS, Map, Samples, Scene, Shading};

/// The f64 twin: the surface that each pixel's splats show.
///
/// `sums` start at row `first_row` of the image. `nearest` may be empty; then the surfaces' `front`
/// is +inf.
pub fn surfaces(
    sums: &[PixelSums],
    nearest: &[Nearest],
    (scene, camera, options): (&Scene, &Camera, &Settings),
    first_row: u32,
) -> Vec<Surface> {
    let of = |(pixel, sum): (usize, &PixelSums)| {
        let (weight, count, decision) = (sum.weight, sum.count, sum.decision);
        if weight == 0.0 {
            return Surface { decision, ..Surface::NOTHING };
        }
        let at = (pixel as u32 % camera.width, pixel as u32 / camera.width + first_row);
        let (color, normal) = surface(sum, scene, camera, options, at);
        let place = match &scene.colors {
            Colors::Textured(textured) => textured.place_at(sum.place.map(|total| total / weight)),
            _ => [0.0; 2],
        };
        let (depth, front) = (sum.depth / sum.depth_weight, nearest.get(pixel).map_or(f64::INFINITY, |n| n.depth));
        Surface { color, normal, place, depth, front, weight, count, decision }
    };
    sums.iter().enumerate().map(of).collect()
}

/// The f64 twin: writes `surfaces`, joined with triangles if there are any, to `frame`, which has
/// only the rows of `surfaces`.
pub fn reference(surfaces: &[Surface], beside: &Beside<'_>, options: &Settings, frame: &mut Frame) {
    for (pixel, of_splats) in surfaces.iter().enumerate() {
        let surface = match beside.triangles.get(pixel) {
            None => *of_splats,
            Some(triangle) => join::joined(of_splats, triangle, beside, options),
        };
        let background = options.background.map(f64::from);
        let Surface { color, normal, place: [u, v], depth, weight, count, decision, .. } = surface;
        let shown = if surface.exists() { over(color, background) } else { background };
        frame.color[pixel] = shown.map(|c| c as f32);
        set(frame, pixel, Map::Depth, &[depth]);
        set(frame, pixel, Map::Normal, &normal.to_array());
        set(frame, pixel, Map::TexZ, &[u, v, depth]);
        set(frame, pixel, Map::Weight, &[weight]);
        set(frame, pixel, Map::Count, &[f64::from(count)]);
        set(frame, pixel, Map::Decision, &[decision]);
        set(frame, pixel, Map::Transmittance, &[1.0 - color[3]]);
        set(frame, pixel, Map::Layers, &[f64::from(u8::from(surface.exists()))]);
    }
}

/// The surface that a pixel shows.
#[derive(Clone, Copy, Debug)]
pub struct Surface {
    /// Straight linear colour and alpha, lit.
    pub color: [f64; 4],
    /// World space, unit length.
    pub normal: DVec3,
    /// The mean texture coordinates of the surfels.
    pub place: [f64; 2],
    /// Its depth ([`Camera::depth`]), world units.
    pub depth: f64,
    /// The depth of the nearest fragment ([`Camera::depth`]), world units.
    pub front: f64,
    /// The sum of weights; 1 for a triangle.
    pub weight: f64,
    /// The number of fragments; 1 for a triangle.
    pub count: u32,
    /// See [`Map::Decision`].
    pub decision: f64,
}

impl Surface {
    /// An empty pixel.
    pub const NOTHING: Self = Self {
        color: [0.0; 4],
        normal: DVec3::ZERO,
        place: [0.0; 2],
        depth: f64::INFINITY,
        front: f64::INFINITY,
        weight: 0.0,
        count: 0,
        decision: f64::INFINITY,
    };

    /// Whether the pixel is not empty.
    pub fn exists(&self) -> bool {
        self.weight > 0.0
    }
}

/// Sets a pixel of a map, if the frame has that map.
pub(super) fn set(frame: &mut Frame, pixel: usize, map: Map, values: &[f64]) {
    let of_pixel = frame.map_mut(map).and_then(|all| all.chunks_exact_mut(map.width()).nth(pixel));
    of_pixel.into_iter().flatten().zip(values).for_each(|(into, value)| *into = *value as f32);
}

/// The straight colour and the normal that the pixel's `sum` resolves to; its weight must not be 0.
pub(super) fn surface(
    sum: &PixelSums,
    scene: &Scene,
    camera: &Camera,
    options: &Settings,
    (x, y): (u32, u32),
) -> ([f64; 4], DVec3) {
    let blended = sum.color.map(|c| c / sum.weight);
    let mean = match &scene.colors {
        Colors::Textured(textured) => textured.resolve(sum.place.map(|total| total / sum.weight), blended),
        _ => blended,
    };
    // Each summed normal was turned toward the viewer.
    let turned = unit_or_zero(DVec3::from_array(sum.normal) / sum.weight);
    let normal = if sum.back { -turned } else { turned };
    let mut color = shaded(mean, normal, camera, options, (x, y));
    if options.composite.is_order_free() {
        color[3] = -(-sum.held_back).exp_m1();
    }
    (color, normal)
}

/// Converts a premultiplied colour to a straight one, and multiplies its alpha by the opacity.
///
/// The colour is lit with the unit `normal`, unless splats were lit before.
pub(super) fn shaded(
    [r, g, b, alpha]: [f64; 4],
    normal: DVec3,
    camera: &Camera,
    options: &Settings,
    (x, y): (u32, u32),
) -> [f64; 4] {
    let straight = DVec3::new(r, g, b) / if alpha > 0.0 { alpha } else { f64::INFINITY };
    let toward_eye = -camera.ray(f64::from(x) + 0.5, f64::from(y) + 0.5).normalize();
    let lit = options.lights_splats();
    let shaded = if lit { straight } else { shade(straight, normal, toward_eye, options) };
    [shaded.x, shaded.y, shaded.z, alpha * f64::from(options.opacity)]
}

/// The mean, normalised; 0 where opposite normals cancel.
fn unit_or_zero(mean: DVec3) -> DVec3 {
    if mean.length_squared() > 1e-12 { mean.normalize() } else { DVec3::ZERO }
}

/// The f64 twin for several `samples` per pixel: the mean of the premultiplied colours of `fine`,
/// whose pixels are the samples, and their smallest [`Map::Decision`].
pub fn mean_of_samples(fine: &Frame, samples: Samples) -> Frame {
    let (across, down) = (samples.across as usize, samples.down as usize);
    let (width, height) = (fine.width as usize / across, fine.height as usize / down);
    let share = 1.0 / f64::from(samples.count());
    let pixel = |pixel: usize| {
        let (x, y) = (pixel % width * across, pixel / width * down);
        let sampled = (0..down).flat_map(|j| (0..across).map(move |i| (y + j) * width * across + x + i));
        let mean = sampled.fold(DVec4::ZERO, |sum, sample| {
            let [r, g, b, a] = fine.color[sample].map(f64::from);
            sum + share * DVec4::new(r * a, g * a, b * a, a)
        });
        if mean.w > 0.0 { (mean.truncate() / mean.w).extend(mean.w).to_array().map(|c| c as f32) } else { [0.0; 4] }
    };
    let mean = Frame::of_colors(width as u32, height as u32, (0..width * height).map(pixel).collect());
    // A pixel is as near to a decision as the nearest of its samples.
    let Some(decisions) = fine.map(Map::Decision) else { return mean };
    let least = |pixel: usize| {
        let (x, y) = (pixel % width * across, pixel / width * down);
        let sampled = (0..down).flat_map(|j| (0..across).map(move |i| (y + j) * width * across + x + i));
        sampled.map(|sample| decisions[sample]).fold(f32::INFINITY, f32::min)
    };
    mean.with(Map::Decision, (0..width * height).map(least).collect())
}

/// The linear colour that a surface of colour `straight` and unit `normal` sends in the unit
/// direction `toward_eye`.
pub(super) fn shade(straight: DVec3, normal: DVec3, toward_eye: DVec3, options: &Settings) -> DVec3 {
    match options.shading {
        Shading::Unlit => straight,
        Shading::Lambert => {
            straight * irradiances(normal, toward_eye, &options.lights).map(|(light, _)| light).sum::<f64>()
        }
        Shading::Phong => {
            let exponent = f64::from(options.shininess);
            let lights = irradiances(normal, toward_eye, &options.lights);
            let (diffuse, highlight) = lights.fold((0.0, 0.0), |(diffuse, highlight), (light, mirrored)| {
                (diffuse + light, highlight + light * mirrored.max(0.0).powf(exponent))
            });
            straight * diffuse + HIGHLIGHT * highlight
        }
    }
}

/// For each light, the received intensity and the cosine between its mirrored direction and the
/// eye.
///
/// The received intensity is the intensity times the cosine at the surface. A headlight lights both
/// sides, a directional light only the side that the normal is on.
fn irradiances(normal: DVec3, toward_eye: DVec3, lights: &[Light]) -> impl Iterator<Item = (f64, f64)> {
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

/// Composites straight alpha over straight alpha.
pub(super) fn over(front: [f64; 4], back: [f64; 4]) -> [f64; 4] {
    let behind = back[3] * (1.0 - front[3]);
    let alpha = front[3] + behind;
    if alpha > 0.0 {
        let blend = |k: usize| (front[k] * front[3] + back[k] * behind) / alpha;
        [blend(0), blend(1), blend(2), alpha]
    } else {
        [0.0; 4]
    }
}

/// The pass's kernels, files and constants.
pub const PASS: Pass = Pass {
    name: "resolve",
    files: |needs| {
        let pick = |needed, file, absent| if needed { file } else { absent };
        vec![
            "resolve.wgsl",
            pick(needs.samples == Samples::ONE, "resolve_pixels.wgsl", "resolve_samples.wgsl"),
            pick(
                needs.surface.lists().is_some() || needs.surface.peels().is_some(),
                "resolve_lists.wgsl",
                "resolve_surface.wgsl",
            ),
            pick(!needs.maps.is_empty(), "image_maps.wgsl", "image_color.wgsl"),
            "maps.wgsl",
            match needs.shading {
                Shading::Unlit => "shade_unlit.wgsl",
                Shading::Lambert => "shade_lambert.wgsl",
                Shading::Phong => "shade_phong.wgsl",
            },
        ]
    },
    kernels: |needs| if needs.surface.gathers() && !needs.surface.separate() { Vec::new() } else { vec![RESOLVE] },
    constants: |making| {
        let layout = PixelLayout::of(making.needs);
        let mut constants =
            vec![("LIGHTS", making.options.lights.len() as f64), ("IMAGE_WORDS", layout.image_words.into())];
        constants.push(("OPACITY", making.options.opacity.into()));
        let words = MAPS.iter().zip(layout.map_words);
        constants.extend(words.filter_map(|(row, word)| Some((row.image_word?, f64::from(word)))));
        let Samples { across, down } = making.needs.samples;
        constants.extend([("SAMPLES_ACROSS", across.into()), ("SAMPLES_DOWN", down.into())]);
        if making.needs.shading == Shading::Phong {
            constants.push(("SHININESS", making.options.shininess.into()));
        }
        constants
    },
};

const RESOLVE: Kernel = Kernel::new("resolve");

/// The stage that resolves the covered tiles.
pub fn steps(plan: &Plan, band: usize) -> Stage {
    let surface = plan.needs.surface;
    // Without separate inputs the visibility pass has listed the covered tiles, and the rasteriser
    // has no such pass.
    let lists = match (surface.separate(), surface.raster()) {
        (true, _) => Some(individuals::LISTS),
        (false, Some(_)) => Some(covered::LISTS),
        (false, None) => None,
    };
    let clears = lists.map(|_| covered::restart(plan, band)).into_iter().chain(covered::clear(plan, band));
    let mut runs: Vec<Run> = lists.into_iter().collect();
    runs.extend(long_lists::composites(plan));
    runs.push(Run { kernel: RESOLVE, over: Over::Covered });
    let twin = match plan.needs.surface.lists() {
        None => Twin::Resolve,
        Some(Lists::Layers) => Twin::Layers,
        Some(Lists::Sorted) => Twin::Sorted,
    };
    Stage::new("resolve", band, runs).after(clears.collect()).as_twin(twin)
}

/// Words per pixel of [`Map::Surfaces`].
const WORDS_OF_SURFACES: usize = 2 * SURFACES;

/// Appends the resolved pixels in `bytes` to those of `frame`. The caller updates the frame's
/// height, because only the caller knows when rows are complete.
pub fn unpack(layout: &PixelLayout, bytes: &[u8], frame: &mut Frame) {
    let record = layout.image_words as usize * 4;
    let colors = bytes.par_chunks_exact(record).with_min_len(1 << 14);
    let first = frame.extend(colors.map(|bytes| bytemuck::pod_read_unaligned(&bytes[..16])));
    put_maps(layout, bytes, frame, first);
}

/// Overwrites pixels of `frame`, from pixel `first` on, by the resolved ones in `bytes`.
pub fn put(layout: &PixelLayout, bytes: &[u8], frame: &mut Frame, first: usize) {
    let pixels = bytes.chunks_exact(layout.image_words as usize * 4);
    let colors = frame.color[first..].iter_mut().zip(pixels);
    colors.for_each(|(color, bytes)| *color = bytemuck::pod_read_unaligned(&bytes[..16]));
    put_maps(layout, bytes, frame, first);
}

fn put_maps(layout: &PixelLayout, bytes: &[u8], frame: &mut Frame, first: usize) {
    let record = layout.image_words as usize * 4;
    // Copies N words of each pixel, from `word` on.
    fn copy<const N: usize>(map: &mut [[f32; N]], bytes: &[u8], record: usize, word: u32) {
        let at = word as usize * 4;
        map.par_iter_mut().zip(bytes.par_chunks_exact(record)).with_min_len(1 << 14).for_each(|(value, bytes)| {
            *value = bytemuck::pod_read_unaligned(&bytes[at..at + 4 * N]);
        });
    }
    for (row, word) in MAPS.iter().zip(layout.map_words).filter(|(row, _)| row.image_word.is_some()) {
        let width = row.map.width();
        let Some(map) = frame.map_mut(row.map) else { continue };
        let map = &mut map[first * width..];
        match width {
            1 => copy::<1>(bytemuck::cast_slice_mut(map), bytes, record, word),
            2 => copy::<2>(bytemuck::cast_slice_mut(map), bytes, record, word),
            WORDS_OF_SURFACES => copy::<WORDS_OF_SURFACES>(bytemuck::cast_slice_mut(map), bytes, record, word),
            _ => copy::<3>(bytemuck::cast_slice_mut(map), bytes, record, word),
        }
    }
}
