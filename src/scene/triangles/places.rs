//! Stored positions of triangle corners: three f32, or pairs of f32 where the rounding of one is
//! visible.

use glam::DVec3;

/// A stored position, whose bits are compared for equality and order.
pub(super) trait Place: Copy + Ord + Send + Sync {
    /// The position in f64.
    fn exact(self) -> DVec3;

    /// The position rounded to f32.
    fn high(self) -> [f32; 3];

    /// The part beyond f32, if it is stored.
    fn low(self) -> Option<[f32; 3]>;
}

/// The bits of three f32 coordinates.
type Bits = [u32; 3];

impl Place for Bits {
    fn exact(self) -> DVec3 {
        DVec3::from_array(self.high().map(f64::from))
    }

    fn high(self) -> [f32; 3] {
        self.map(f32::from_bits)
    }

    fn low(self) -> Option<[f32; 3]> {
        None
    }
}

impl Place for [Bits; 2] {
    fn exact(self) -> DVec3 {
        self[0].exact() + self[1].exact()
    }

    fn high(self) -> [f32; 3] {
        self[0].high()
    }

    fn low(self) -> Option<[f32; 3]> {
        Some(self[1].high())
    }
}

/// Rounds a position to f32. Adding +0 turns -0 into +0.
pub(super) fn single(place: [f64; 3]) -> Bits {
    place.map(|x| (x as f32 + 0.0).to_bits())
}

/// Splits a position into two f32 per coordinate.
pub(super) fn doubled(place: [f64; 3]) -> [Bits; 2] {
    let high = single(place);
    let low = DVec3::from_array(place) - high.exact();
    [high, single(low.to_array())]
}

/// A rounding error below this fraction of a triangle's width is invisible, as for surfels.
const LEAST_PART: f64 = 1.0 / 256.0;

/// A triangle narrower than this fraction of its coordinates may be a line with rounded corners.
pub(super) const LEAST_WIDTH: f64 = 1.0 / (1u64 << 50) as f64;

/// Rounding is not reported for triangles narrower than this fraction of their coordinates: most of
/// them were meant to be lines.
pub(super) const LEAST_TOLD: f64 = 1.0 / (1u64 << 46) as f64;

/// The largest rounding error of a corner's coordinate; None if it is invisible at the triangle's
/// width.
///
/// None also if the triangle is not wider than the fraction `narrowest` of its coordinates.
pub(super) fn shown_error<P: Place>(corners: [[f64; 3]; 3], stored: fn([f64; 3]) -> P, narrowest: f64) -> Option<f64> {
    let places = corners.map(DVec3::from_array);
    let error = corners.map(|corner| (DVec3::from_array(corner) - stored(corner).exact()).abs().max_element());
    let error = error.into_iter().fold(0.0, f64::max);
    if error == 0.0 || !error.is_finite() {
        return None;
    }
    let [a, b, c] = places;
    let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
    let width = (b - a).cross(c - a).length() / longest;
    let size = places.into_iter().fold(0.0, |size: f64, place| size.max(place.abs().max_element()));
    (width > narrowest * size && error > LEAST_PART * width).then_some(error)
}

/// Whether the corners are not collinear: along some axis, the area exceeds the rounding error of
/// its products.
pub(super) fn has_area(corners: [DVec3; 3]) -> bool {
    let [a, b, c] = corners;
    let (ab, ac) = (b - a, c - a);
    let along = |i: usize, k: usize| {
        let (first, second) = (ab[i] * ac[k], ab[k] * ac[i]);
        (first - second).abs() > 4.0 * f64::EPSILON * (first.abs() + second.abs())
    };
    along(0, 1) || along(1, 2) || along(2, 0)
}
