//! Fills the uniform of a view: camera, options and the scene's ranges in the units of the kernels.

use glam::DVec3;

use super::{Facts, Settings, composited};
use crate::gpu::layout::View;
use crate::scene::light::MAX_LIGHTS;
use crate::scene::options::HIGHLIGHT;
use crate::scene::texture::PlaceRange;
use crate::scene::{Atlas, Bounds, Camera, Composite, Light, Projection, Samples, Shading};

/// Splits x into the nearest f32 and the nearest f32 to the remainder.
fn split(x: f64) -> (f32, f32) {
    let high = x as f32;
    (high, (x - f64::from(high)) as f32)
}

fn split_all<const N: usize>(values: [f64; N]) -> ([f32; 4], [f32; 4]) {
    let (mut high, mut low) = ([0.0; 4], [0.0; 4]);
    for (k, value) in values.into_iter().enumerate() {
        (high[k], low[k]) = split(value);
    }
    (high, low)
}

/// The largest coordinate of an outlier in device units, so that squares of lengths stay finite.
const FARTHEST_STRAY: f64 = (1u64 << 60) as f64;

/// The scale from world to device units. It is a power of two. It brings the scene's `body` and the
/// body's distance from the camera to at most 1, and the scene's `bounds` to at most 2^60.
pub fn device_unit(body: &Bounds, bounds: &Bounds, eye: DVec3) -> f64 {
    let reach = |bounds: &Bounds| {
        let corners = [bounds.min, bounds.max].into_iter();
        corners.flat_map(|corner| [corner.abs().max_element(), (corner - eye).abs().max_element()]).fold(0.0, f64::max)
    };
    let reach = reach(body).max(reach(bounds) / FARTHEST_STRAY);
    if reach > 0.0 && reach.is_finite() { (-reach.log2().ceil()).clamp(-126.0, 126.0).exp2() } else { 1.0 }
}

/// An upper bound on epsilon as a fraction of depth. It limits nothing in practice and prevents
/// overflow in products.
const LARGEST_FRACTION: f64 = 1e9;

impl View {
    /// The uniform for `camera` and the scene that `facts` describe.
    pub fn new(facts: &Facts, camera: &Camera, options: &Settings) -> Self {
        let Facts { bounds, body, core, color, .. } = facts;
        let [low, span] = mapped(lit_range([color.0, color.1], options), composited(facts, options));
        let eye_relative = camera.eye - facts.origin;
        let unit = device_unit(body, bounds, eye_relative);
        let (eye, eye_low) = split_all((eye_relative * unit).to_array());
        let (mut rotation, mut rotation_low) = ([[0.0; 4]; 3], [[0.0; 4]; 3]);
        for row in 0..3 {
            (rotation[row], rotation_low[row]) = split_all(camera.rotation.row(row).to_array());
        }
        // Pinhole intrinsics have no length; an orthographic scale is pixels per length.
        let per_unit = match camera.projection {
            Projection::Pinhole => 1.0,
            Projection::Orthographic => 1.0 / unit,
        };
        let (intrinsics, intrinsics_low) =
            split_all([camera.fx * per_unit, camera.fy * per_unit, camera.cx, camera.cy]);
        let (place, atlas, textures) = match facts.texture {
            Some((PlaceRange { middle: [u, v], span, most_reach_2 }, atlas)) => {
                let Atlas { corner: [left, bottom], cell, columns, textures } = atlas;
                ([u, v, span, most_reach_2], [left, bottom, cell, columns as f32], textures)
            }
            None => ([0.0; 4], [0.0; 4], 0),
        };
        let (relative, absolute, of_radius) = options.epsilon.parts();
        let [first, last] = depths(facts, camera);
        Self {
            rotation,
            rotation_low,
            eye,
            eye_low,
            intrinsics,
            intrinsics_low,
            color_low: low,
            color_span: span,
            color_scale: span.map(|s| if s > 0.0 { 1.0 / s } else { 0.0 }),
            background: options.background,
            lights: lights(&options.lights),
            width: camera.width,
            height: camera.height,
            zero: 0,
            unit: unit as f32,
            // Squares of 1 / near must stay finite.
            near: (camera.near * unit).max(1e-18) as f32,
            epsilon_relative: relative as f32,
            epsilon_absolute: (absolute * unit) as f32,
            world: (1.0 / unit) as f32,
            epsilon_radius: of_radius as f32,
            epsilon_deepest: (of_radius * f64::from(facts.drawn_shorter(options)) * unit) as f32,
            farthest: (farthest(facts, camera, options) * unit) as f32,
            middle: (camera.rotation.row(2).dot(core.center() - eye_relative) * unit) as f32,
            epsilon_most: options.epsilon.most().min(LARGEST_FRACTION) as f32,
            first: (first * unit) as f32,
            last: (last * unit) as f32,
            textures,
            place,
            levels: levels(camera, options),
            atlas,
            lens: lens(camera),
        }
    }
}

/// The coefficients of a lens that is no pinhole, in the layout of the kernels; else 0.
fn lens(camera: &Camera) -> [[f32; 4]; 7] {
    let mut rows = [[0.0; 4]; 7];
    if let Some(optics) = &camera.optics {
        for (row, coefficients) in optics.coefficients().into_iter().enumerate() {
            (rows[row], rows[row + 3]) = split_all(coefficients);
        }
        let radii = [optics.limit(), optics.reach(), optics.sure()].map(|radius| radius.min(1e18) as f32);
        rows[6][..3].copy_from_slice(&radii);
        rows[6][3] = f32::from(u8::from(!optics.depth_is_distance()));
    }
    rows
}

/// The nearest and farthest depth of the scene's body, in world units. They are the depths of the
/// box of its centres, extended by the largest radius, but by at most a quarter of the box's
/// diagonal. The farthest is greater than the nearest, and outliers affect neither.
pub fn depths(facts: &Facts, camera: &Camera) -> [f64; 2] {
    let eye = camera.eye - facts.origin;
    let (first, last) = (nearest_of(&facts.body, eye, camera), farthest_of(&facts.body, eye, camera));
    let reach = f64::from(facts.largest_radius).min(0.25 * facts.body.extent().length());
    let first = (first - reach).max(camera.near);
    // If the scene has a single depth, it is the nearest, and the farthest lies just beyond.
    [first, (last + reach).max(first * (1.0 + 1e-6)).max(first + f64::MIN_POSITIVE)]
}

/// A depth beyond every surfel, with a margin for rounding, in world units. If epsilon accepts
/// every depth, this limit keeps the interval over which depths are summed finite and no longer
/// than the scene requires.
pub fn farthest(facts: &Facts, camera: &Camera, options: &Settings) -> f64 {
    let reach = f64::from(facts.drawn_radius(options));
    (farthest_of(&facts.bounds, camera.eye - facts.origin, camera) + reach) * 1.001
}

/// The largest depth of a corner of `bounds`, at least 0; world units.
fn farthest_of(bounds: &Bounds, eye: DVec3, camera: &Camera) -> f64 {
    let corner = |corner: usize| {
        let pick = |axis: usize| if corner >> axis & 1 == 0 { bounds.min[axis] } else { bounds.max[axis] };
        camera.depth(camera.rotation * (DVec3::new(pick(0), pick(1), pick(2)) - eye))
    };
    (0..8).map(corner).fold(0.0, f64::max)
}

/// The least depth of a point of `bounds`, negative behind the camera; world units.
fn nearest_of(bounds: &Bounds, eye: DVec3, camera: &Camera) -> f64 {
    if camera.depth_is_distance() {
        return (eye.clamp(bounds.min, bounds.max) - eye).length();
    }
    let axis = camera.rotation.row(2);
    let least = |k: usize| (axis[k] * (bounds.min[k] - eye[k])).min(axis[k] * (bounds.max[k] - eye[k]));
    least(0) + least(1) + least(2)
}

/// The range of premultiplied colours after lighting; `range` itself unless splats are lit.
fn lit_range([low, high]: [[f32; 4]; 2], options: &Settings) -> [[f32; 4]; 2] {
    if !options.lights_splats() {
        return [low, high];
    }
    let light: f32 = options.lights.iter().map(Light::intensity).sum();
    let highlight = if options.shading == Shading::Phong { HIGHLIGHT as f32 * light } else { 0.0 };
    let mut lit = [low, high];
    for k in 0..3 {
        lit[0][k] = (low[k] * light).min(0.0);
        // A margin for rounding.
        lit[1][k] = ((high[k] * light).max(0.0) + highlight) * 1.000_01;
    }
    lit
}

/// The least value and the span by which colours are mapped to [0, 1] before they are summed.
/// Colours composited fragment by fragment are not summed; their channels stay unmapped where they
/// vary, so that small alphas keep their digits.
fn mapped([low, high]: [[f32; 4]; 2], composite: Composite) -> [[f32; 4]; 2] {
    let summed = !matches!(composite, Composite::Sorted | Composite::Gaussians);
    let of = |k: usize| if summed || low[k] == high[k] { [low[k], high[k] - low[k]] } else { [0.0, 1.0] };
    [std::array::from_fn(|k| of(k)[0]), std::array::from_fn(|k| of(k)[1])]
}

/// The image area below which an octree node is drawn, square pixels, then the width and height of
/// a sample as fractions of a pixel.
fn levels(camera: &Camera, options: &Settings) -> [f32; 4] {
    let Samples { across, down } = options.samples;
    let image = camera.pixels() as f64 / f64::from(across * down);
    [options.detail.pixels(image) as f32, 1.0 / across as f32, 1.0 / down as f32, 0.0]
}

/// The lights in the layout of the kernels: a direction (zero for a headlight) and an intensity.
fn lights(lights: &[Light]) -> [[f32; 4]; MAX_LIGHTS] {
    let mut slots = [[0.0; 4]; MAX_LIGHTS];
    for (slot, light) in slots.iter_mut().zip(lights) {
        *slot = match *light {
            Light::Headlight { intensity } => [0.0, 0.0, 0.0, intensity],
            Light::Directional { toward, intensity } => toward.extend(intensity).to_array(),
        };
    }
    slots
}
