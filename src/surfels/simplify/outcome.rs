//! Turns selected splats into surfels, and measures how far points lie from them.

use glam::{DVec2, DVec3};
use rayon::prelude::*;
use serde::Serialize;

use super::candidates::Candidates;
use super::cells::{Cells, tangent_basis};
use super::cut::clip;
use super::growing::Cover;
use super::samples::Samples;
use crate::scene::color::srgb8;
use crate::scene::scene::low_parts;
use crate::scene::{Cap, Clip, Colors, Scene, Surfel};
use crate::surfels::Coordinates;
use crate::surfels::texture::{in_world, slopes_along};

/// A half-axis is written longer than it grew by at most this fraction of itself.
const LARGEST_OVERLAP: f64 = 0.4;

/// A half-axis is written longer than it grew by at least this fraction of itself.
const SMALLEST_OVERLAP: f64 = 0.02;

/// Within these limits, a half-axis is written longer than it grew by this many tolerances.
const OVERLAP_IN_TOLERANCES: f64 = 8.0;

/// Returns the smallest half-axis with which a surfel is written if its half-axis grew to `grown`.
/// All lengths are in one unit.
///
/// Disks that just cover the surface together leave slits in oblique views, because they lie at
/// different heights. Two disks within a tolerance E of the surface are at most 2 E apart where
/// they meet; an overlap of 8 E each closes the slit for views up to atan 8, 83 degrees, from the
/// normal. A larger overlap would only show past sharp edges. Between points a rough surface may
/// exceed the tolerance. The input surfels cover it there, so no surfel is written smaller than the
/// one from which it grew.
pub fn written(grown: f64, tolerance: f64) -> f64 {
    let overlap = (OVERLAP_IN_TOLERANCES * tolerance).max(SMALLEST_OVERLAP * grown);
    grown + overlap.min(LARGEST_OVERLAP * grown)
}

/// The inverse of [`written`]: the half-axis that a surfel grew to, or more.
pub fn grown(written: f64, tolerance: f64) -> f64 {
    let between = written - OVERLAP_IN_TOLERANCES * tolerance;
    between.min(written / (1.0 + SMALLEST_OVERLAP)).max(written / (1.0 + LARGEST_OVERLAP))
}

/// The outcome of a simplification. Lengths are in world units.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Report {
    /// Input surfels.
    pub surfels: u64,
    /// Distinct positions among them.
    pub distinct_positions: u64,
    /// Selected surfels.
    pub selected: u64,
    /// Selected surfels before relaxation.
    pub before_relaxation: u64,
    /// The tolerance of the options.
    pub tolerance: f64,
    /// The largest distance of a point, along the normal, from the plane or the cap of a selected
    /// surfel that covers its cell or a part of it. It is at most the tolerance, up to rounding.
    pub max_deviation: f64,
    /// The mean of these distances over points and the selected surfels that cover their cells,
    /// weighted by the covered area.
    pub mean_deviation: f64,
    /// Selected surfels at creases, where the surface bends by more than the tolerance within the
    /// cell of their own point, which they cover. Some points over or under them are beyond the
    /// tolerance, but these surfels cover nothing of the cells of such points.
    pub beyond_tolerance: u64,
}

/// Distances of points from the surfels that cover them, world units.
pub(super) struct Deviations {
    pub max: f64,
    pub mean: f64,
}

/// The gradients of u and v, per world unit.
pub(super) type Slopes = [[f32; 3]; 2];

/// A selected splat, as it is written.
struct Chosen {
    /// The centre relative to the scene's origin, world units.
    center: DVec3,
    surfel: Surfel,
    clip: Clip,
    cap: Cap,
    color: [f32; 4],
    /// Texture coordinates at the centre and their slopes; zero without texture coordinates.
    place: ([f32; 2], Slopes),
    /// Sums over the covered cells of area times deviation, and of area.
    sums: [f64; 2],
    /// The largest deviation, world units.
    largest: f64,
}

impl Chosen {
    fn of(
        index: u32,
        (scene, slopes): (&Scene, &[Slopes]),
        (samples, cells): (&Samples, &Cells),
        candidates: &Candidates,
        tolerance: f64,
    ) -> Self {
        let covers = candidates.covers(index);
        let chosen = match *covers {
            [cover] => Self::alone(cover, scene, samples, cells),
            _ => None,
        }
        .unwrap_or_else(|| Self::grown(index, samples, cells, candidates, tolerance));
        let point = candidates.splats[index as usize].point;
        let (center, fitted) = place(&chosen.surfel, point, covers, samples, cells);
        // A surfel that stands for itself alone keeps its own slopes.
        let given = match (covers.len(), samples.only[point as usize]) {
            (1, Some(own)) => {
                slopes.get(own as usize).filter(|slopes| slopes.as_flattened().iter().any(|gain| *gain != 0.0))
            }
            _ => None,
        };
        Self { place: (center, given.copied().unwrap_or(fitted)), ..chosen }
    }

    /// A splat that stands for one surfel is that surfel, enlarged if necessary to hold its cell.
    /// None if several surfels share the position, as in a file that was read twice.
    fn alone(Cover { cell, pieces }: Cover, scene: &Scene, samples: &Samples, cells: &Cells) -> Option<Self> {
        let index = samples.only[cell as usize]? as usize;
        let surfel = scene.surfels[index];
        let scale = samples.positions.scale();
        let [s, t] = [surfel.s, surfel.t].map(|axis| DVec3::from_array(axis.map(f64::from)));
        let inverse = [s, t].map(|axis| axis / (axis.length_squared() * scale));
        let basis = tangent_basis(samples.normals[cell as usize]);
        let on_disk = |corner: &DVec2| {
            let corner = basis[0] * corner.x + basis[1] * corner.y;
            DVec2::new(corner.dot(inverse[0]), corner.dot(inverse[1])).length()
        };
        let held = cells.corners(cell).iter().map(on_disk).fold(0.0, f64::max);
        let factor = (held * (1.0 + SMALLEST_OVERLAP)).max(1.0);
        let [s, t] = [s, t].map(|axis| (axis * factor).as_vec3().to_array());
        let clip = scene.clips.get(index).copied().unwrap_or_default();
        let cap = scene.caps.get(index).copied().unwrap_or_default();
        Some(Self {
            center: samples.positions.position(cell) / scale,
            surfel: Surfel { s, t, ..surfel },
            clip: Clip(clip.0.map(|[x, y, z]| [x, y, (f64::from(z) / factor) as f32])).usable(),
            cap: Cap(cap.0.map(|height| (f64::from(height) * factor * factor) as f32))
                .usable(f64::from(surfel.radius()) * factor),
            color: mean_color(samples.colors[cell as usize], 1.0),
            place: Default::default(),
            sums: [0.0, cells.area(cell, pieces)],
            largest: 0.0,
        })
    }

    fn grown(index: u32, samples: &Samples, cells: &Cells, candidates: &Candidates, tolerance: f64) -> Self {
        let scale = samples.positions.scale();
        let splat = &candidates.splats[index as usize];
        let normal = splat.normal;
        let center = samples.positions.position(splat.point) + normal * splat.shift;
        let basis = tangent_basis(normal);
        let (mut color, mut sums, mut largest) = ([0.0; 4], [0.0; 2], 0f64);
        for cover in candidates.covers(index) {
            let area = cells.area(cover.cell, cover.pieces);
            let offset = samples.positions.position(cover.cell) - center;
            let at = DVec2::new(offset.dot(basis[0]), offset.dot(basis[1]));
            let deviation = splat.bend.over(at, offset.dot(normal)).abs() / scale;
            largest = largest.max(deviation);
            sums = [sums[0] + area * deviation, sums[1] + area];
            for (sum, value) in color.iter_mut().zip(samples.colors[cover.cell as usize]) {
                *sum += area * value;
            }
        }
        let world = |v: DVec3| (v / scale).as_vec3().to_array();
        let axes = splat.axes.map(|axis| {
            let length = axis.length();
            // Disks that meet where the surface bends by more than the tolerance are farther apart,
            // and get the largest overlap.
            let tolerance = if splat.deviation > tolerance { f64::INFINITY } else { tolerance };
            axis * (written(length, tolerance).max(samples.radii[splat.point as usize]) / length)
        });
        let clip = clip(
            samples,
            cells,
            candidates.covers(index),
            (center, axes),
            (largest * scale, samples.radii[splat.point as usize]),
        );
        let Cap(heights) = splat.bend.cap(axes.map(|axis| DVec2::new(axis.dot(basis[0]), axis.dot(basis[1]))));
        let [s, t] = axes.map(world);
        // The cap is limited as when the file is read, because the splat of a tiny patch may be
        // written as large as its sample.
        let longer = axes[0].length().max(axes[1].length()) / scale;
        let cap = Cap(heights.map(|height| (f64::from(height) / scale) as f32)).usable(longer);
        let color = mean_color(color, sums[1]);
        let surfel = Surfel { center: world(center), s, t };
        let place = Default::default();
        Self { center: center / scale, surfel, clip, cap, color, place, sums, largest }
    }
}

/// The texture coordinates at the point from which a splat grew, and their slopes, fitted to the
/// covered cells and the point's neighbours.
fn place(surfel: &Surfel, point: u32, covers: &[Cover], samples: &Samples, cells: &Cells) -> ([f32; 2], Slopes) {
    let Some(own) = samples.places.get(point as usize) else { return Default::default() };
    let axes = [surfel.s, surfel.t].map(|axis| DVec3::from_array(axis.map(f64::from)));
    let others = covers.iter().map(|cover| cover.cell).chain(cells.neighbours(point).iter().copied());
    let steps = others.filter(|other| *other != point && !samples.has_seam(point, *other)).map(|other| {
        let (offset, gain) = samples.step(point, other);
        (offset / samples.positions.scale(), gain)
    });
    (own.as_vec2().to_array(), in_world(slopes_along(axes, steps), axes))
}

/// The linear colour with straight alpha for a sum of premultiplied colours over `area`.
pub(super) fn mean_color([r, g, b, alpha]: [f64; 4], area: f64) -> [f32; 4] {
    let opaque = if alpha > 0.0 { alpha } else { f64::INFINITY };
    [r / opaque, g / opaque, b / opaque, alpha / area].map(|c| c as f32)
}

/// Makes a scene like `scene` of the selected splats; `tolerance` is in scaled units.
pub(super) fn scene(
    (scene, slopes): (&Scene, &[Slopes]),
    samples: &Samples,
    cells: &Cells,
    candidates: &Candidates,
    selected: &[u32],
    tolerance: f64,
) -> (Scene, Coordinates, Deviations) {
    let chosen: Vec<Chosen> = selected
        .par_iter()
        .map(|&index| Chosen::of(index, (scene, slopes), (samples, cells), candidates, tolerance))
        .collect();
    let colors = match scene.colors {
        Colors::Constant(color) => Colors::Constant(color),
        Colors::Srgb8(_) => Colors::Srgb8(chosen.iter().map(|chosen| srgb8(chosen.color)).collect()),
        Colors::Linear(_) | Colors::Textured(_) | Colors::Harmonics(_) => {
            Colors::Linear(chosen.iter().map(|chosen| chosen.color).collect())
        }
    };
    let [moment, area] = chosen.iter().fold([0.0; 2], |sum, chosen| [sum[0] + chosen.sums[0], sum[1] + chosen.sums[1]]);
    let max = chosen.iter().map(|chosen| chosen.largest).fold(0.0, f64::max);
    let deviations = Deviations { max, mean: moment / area };
    let surfels: Vec<_> = chosen.iter().map(|chosen| chosen.surfel).collect();
    let low = low_parts(&surfels, |index| chosen[index].center);
    let mut coordinates = Coordinates::default();
    if !samples.places.is_empty() {
        (coordinates.centers, coordinates.slopes) = chosen.iter().map(|chosen| chosen.place).unzip();
    }
    let clips: Vec<Clip> = chosen.iter().map(|chosen| chosen.clip).collect();
    let caps: Vec<Cap> = chosen.iter().map(|chosen| chosen.cap).collect();
    (
        Scene {
            origin: scene.origin,
            surfels,
            low,
            clips: if clips.iter().all(Clip::is_none) { Vec::new() } else { clips },
            caps: if caps.iter().all(Cap::is_flat) { Vec::new() } else { caps },
            colors,
            encoded: scene.encoded,
            oriented: scene.oriented,
            closed: scene.closed,
            up: scene.up,
            ..Scene::default()
        },
        coordinates,
        deviations,
    )
}
