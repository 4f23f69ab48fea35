//! The numbers that a triangle's corner is kept as: three f32, or two each where rounding shows.

use glam::DVec3;

/// The numbers that a place is kept as, which tell it from others.
pub(super) trait Place: Copy + Ord + Send + Sync {
    /// The place.
    fn exact(self) -> DVec3;

    /// The nearest f32.
    fn high(self) -> [f32; 3];

    /// The rest after rounding, if it is kept.
    fn low(self) -> Option<[f32; 3]>;
}

/// Bits of f32.
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

/// A place as f32. Adding +0 makes the two zeros one.
pub(super) fn single(place: [f64; 3]) -> Bits {
    place.map(|x| (x as f32 + 0.0).to_bits())
}

/// A place as two f32 each.
pub(super) fn doubled(place: [f64; 3]) -> [Bits; 2] {
    let high = single(place);
    let low = DVec3::from_array(place) - high.exact();
    [high, single(low.to_array())]
}

/// Rounding that is less than this part of a triangle's width does not show, as with surfels.
const LEAST_PART: f64 = 1.0 / 256.0;

/// A triangle narrower than this part of its coordinates may be a line whose corners are rounded.
pub(super) const LEAST_WIDTH: f64 = 1.0 / (1u64 << 50) as f64;

/// Rounding is not reported for triangles narrower than this part of their coordinates: most were
/// meant to be lines.
pub(super) const LEAST_TOLD: f64 = 1.0 / (1u64 << 46) as f64;

/// The largest error of a corner's coordinate as it is kept, if it may show at the triangle's width
/// and the triangle is wider than the part `narrowest` of its coordinates.
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

/// Whether the corners are no line: along some axis, the area exceeds the rounding of its products.
pub(super) fn has_area(corners: [DVec3; 3]) -> bool {
    let [a, b, c] = corners;
    let (ab, ac) = (b - a, c - a);
    let along = |i: usize, k: usize| {
        let (first, second) = (ab[i] * ac[k], ab[k] * ac[i]);
        (first - second).abs() > 4.0 * f64::EPSILON * (first.abs() + second.abs())
    };
    along(0, 1) || along(1, 2) || along(2, 0)
}
