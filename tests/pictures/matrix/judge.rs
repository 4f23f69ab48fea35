//! Judges the frames of a combination: the same bits in all forms, and the reference's values at
//! decided pixels.

use epsplat::low_level::frame::Frame;
use epsplat::low_level::plan::AccumulatorRow;
use epsplat::low_level::scene::{Camera, Map, Scene};

use crate::common::Random;

/// The decision margin below which rounding decides a pixel, so that it is not compared.
const DECIDED: f32 = 1e-4;

/// The largest difference of values, as a fraction of the larger of 1 and the reference's value.
const APART: f32 = 3e-4;

/// The largest difference for textured surfels.
///
/// Texture coordinates err with the inverse square of the cosine at which a surfel is seen. A large
/// error changes a pixel from the texture to blended colours. `tests/pictures/texture` bounds that
/// change; here a share of [`STRAYING`] pixels may differ by more.
const APART_OF_TEXTURES: f32 = 3e-3;

/// The share of decided pixels of textured surfels that may differ by more than that.
const STRAYING: f64 = 0.03;

/// Copies of a scene and of its view that [`moved`] makes.
const MOVED: usize = 8;

/// The largest relative change of a number that [`moved`] makes: a few roundings of f32.
const MOVE: f64 = 4.0 / 16_777_216.0;

/// The largest ratio of a difference from the reference to the reference's own change between
/// moved copies.
const BEYOND_MOVED: f32 = 4.0;

/// The error allowed in the colours and in the maps of each pixel because sums have few digits
/// ([`of_sums`]).
pub struct Digits {
    pub color: Vec<f32>,
    pub maps: Vec<f32>,
}

/// Copies of a scene and of its view whose numbers differ by up to [`MOVE`].
///
/// Where the reference draws these copies differently, f32 cannot know the pixel: a cap seen at its
/// outline, two normals that nearly cancel. A fault of a kernel is larger than this change.
pub fn moved(scene: &Scene, camera: &Camera) -> Vec<(Scene, Camera)> {
    let random = &mut Random(1);
    let of = |random: &mut Random| {
        let (mut scene, mut camera) = (scene.clone(), camera.clone());
        let mut factor = || 1.0 + random.between(-MOVE, MOVE);
        let mut numbers: Vec<&mut f32> = scene
            .surfels
            .iter_mut()
            .flat_map(|surfel| [&mut surfel.center, &mut surfel.s, &mut surfel.t])
            .flatten()
            .collect();
        numbers.extend(scene.caps.iter_mut().flat_map(|cap| &mut cap.0));
        numbers.into_iter().for_each(|number| *number = (f64::from(*number) * factor()) as f32);
        let Camera { fx, fy, cx, cy, .. } = &mut camera;
        [fx, fy, cx, cy].into_iter().for_each(|number| *number *= factor());
        (scene, camera)
    };
    (0..MOVED).map(|_| of(random)).collect()
}

/// All bits of a frame's colours and maps, by name, without the map `but`.
fn parts(frame: &Frame, but: Option<Map>) -> Vec<(&'static str, Vec<u32>)> {
    let color = frame.color.iter().flatten().map(|value| value.to_bits()).collect();
    let maps = frame.maps();
    let of_map = |map: Map| (map.row().name, frame.map(map).unwrap().iter().map(|value| value.to_bits()).collect());
    [("color", color)].into_iter().chain(maps.iter().filter(|map| Some(*map) != but).map(of_map)).collect()
}

/// Describes the values whose bits differ between two frames, without the map `but`; empty if none.
pub fn bits_apart(one: &Frame, other: &Frame, but: Option<Map>) -> String {
    let pairs = parts(one, but).into_iter().zip(parts(other, but));
    let told = pairs.filter_map(|((name, a), (other_name, b))| {
        assert_eq!((name, a.len()), (other_name, b.len()));
        let each = a.len() / one.color.len();
        let differing: Vec<usize> = (0..a.len()).filter(|&k| a[k] != b[k]).collect();
        let first = *differing.first()?;
        let (x, y) = (first / each % one.width as usize, first / each / one.width as usize);
        let values = (f32::from_bits(a[first]), f32::from_bits(b[first]));
        Some(format!("{} of {} values of {name} ({values:?} at {x},{y})", differing.len(), a.len()))
    });
    told.collect::<Vec<_>>().join(", ")
}

/// The number of pixels that the reference leaves to rounding.
pub fn undecided(reference: &Frame) -> usize {
    reference.map(Map::Decision).unwrap().iter().filter(|decision| **decision < DECIDED).count()
}

/// The bound on the error of each pixel's means, by [`AccumulatorRow::error_bound`], in a scene of
/// `surfels` surfels whose attributes span `span`.
///
/// `each` is the reference's frame with one pixel per sample and with maps of counts and weights;
/// `[across, down]` of its pixels are the samples of one pixel. A mean of tiny weights may be
/// anything, so a bound is never more than the span.
pub fn of_sums(
    each: &Frame,
    [across, down]: [usize; 2],
    (row, surfels, span): (&AccumulatorRow, u64, f64),
) -> Vec<f32> {
    let bits = row.fraction_bits(surfels);
    let (counts, weights) = (each.map(Map::Count).unwrap(), each.map(Map::Weight).unwrap());
    let width = each.width as usize / across;
    let mut apart = vec![0.0; counts.len() / (across * down)];
    for (k, (&count, &weight)) in counts.iter().zip(weights).enumerate().filter(|(_, (count, _))| **count > 0.0) {
        let (x, y) = (k % each.width as usize / across, k / each.width as usize / down);
        let bound = (row.error_bound)(f64::from(count), f64::from(weight), bits).min(1.0);
        apart[y * width + x] += (span * bound / (across * down) as f64) as f32;
    }
    apart
}

/// Describes the decided pixels whose colour or maps differ from the `reference`; empty if none.
///
/// A pixel may differ as far as `digits` say, and [`BEYOND_MOVED`] times as far as the reference's
/// frames of [`moved`] scenes differ.
pub fn wrong(frame: &Frame, reference: &Frame, moved: &[Frame], digits: &Digits, painted: bool) -> String {
    let decision = reference.map(Map::Decision).unwrap();
    let limit = if painted { APART_OF_TEXTURES } else { APART };
    let decided: Vec<usize> = (0..decision.len()).filter(|pixel| decision[*pixel] >= DECIDED).collect();
    let straying = if painted { (STRAYING * decided.len() as f64).ceil() as usize } else { 0 };
    let mut told = Vec::new();
    let mut tell = |name: &str, digits: &[f32], of: &dyn Fn(&Frame, usize) -> Vec<f32>| {
        let near = |pixel: usize, k: usize| {
            let (ours, theirs) = (of(frame, pixel)[k], of(reference, pixel)[k]);
            let change = moved.iter().map(|moved| (of(moved, pixel)[k] - theirs).abs()).fold(0.0, f32::max);
            let most = limit * theirs.abs().max(1.0) + digits[pixel] + BEYOND_MOVED * change;
            ours == theirs || (theirs.is_finite() && (ours - theirs).abs() <= most)
        };
        let differs = |pixel: &usize| (0..of(frame, *pixel).len()).any(|k| !near(*pixel, k));
        let pixels: Vec<usize> = decided.iter().copied().filter(differs).collect();
        let Some(first) = pixels.first().filter(|_| pixels.len() > straying) else { return };
        let place = (first % frame.width as usize, first / frame.width as usize);
        let values = (of(frame, *first), of(reference, *first));
        told.push(format!("{} pixels of {name} ({values:?} at {place:?})", pixels.len()));
    };
    tell("color", &digits.color, &|frame, pixel| {
        let [r, g, b, a] = frame.color[pixel];
        vec![r * a, g * a, b * a, a]
    });
    // The decision margin does not cover which of two surfels weighs more, so the index map is left
    // out.
    for map in frame.maps().iter().filter(|map| *map != Map::Index) {
        let width = map.width();
        tell(map.row().name, &digits.maps, &|frame, pixel| {
            frame.map(map).unwrap()[pixel * width..(pixel + 1) * width].to_vec()
        });
    }
    told.join(", ")
}
