//! Intervals that must contain each pixel's depth and sums on the device, around the values of the
//! twins.
//!
//! A fragment that the bounds leave undecided (at a rim, at epsilon, at the near depth) may be in
//! or out; all others must be as in the twin. No pixel is excused, and the undecided ones are
//! counted.

use epsplat::low_level::passes::footprint::footprint;
use epsplat::low_level::passes::splat::Splat;
use epsplat::low_level::plan::{Facts, Settings, Sides};
use epsplat::low_level::scene::{Camera, Epsilon, Kernel, LowPass, Scene};

use super::UNIT;
use epsplat::low_level::hardcases::precision::{E, Precision};

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    pub low: f64,
    pub high: f64,
}

impl Interval {
    pub const ZERO: Self = Self { low: 0.0, high: 0.0 };

    pub fn holds(&self, value: f64) -> bool {
        self.low <= value && value <= self.high
    }

    /// `high / low - 1`, or infinity if the interval reaches zero or infinity.
    pub fn relative_width(&self) -> f64 {
        if self.low > 0.0 && self.high.is_finite() { self.high / self.low - 1.0 } else { f64::INFINITY }
    }

    fn add(&mut self, low: f64, high: f64) {
        self.low += low;
        self.high += high;
    }
}

/// The enclosure of one pixel.
#[derive(Clone, Debug)]
pub struct Pixel {
    /// Nearest depth, world units. The upper end is infinite if the pixel may be background.
    pub nearest: Interval,
    pub count: (u32, u32),
    pub weight: Interval,
    /// Weighted sums of colours that are mapped to [0, 1].
    pub color: [Interval; 4],
    pub normal: [Interval; 3],
    /// Bounds of the depths of all accepted fragments, and so of their mean; world units.
    pub depth: Interval,
    /// Largest relative width of a depth interval, over the pixel's fragments.
    pub depth_error: f64,
    /// For front faces (0) and back faces (1): the least possible depth, and an upper bound of the
    /// nearest depth.
    pub sides: [Interval; 2],
}

impl Pixel {
    /// Whether the nearest fragment is a back face; `None` if undecided.
    fn back(&self) -> Option<bool> {
        let [front, back] = self.sides;
        let nearer = |a: Interval, b: Interval| a.high < b.low;
        if nearer(front, back) { Some(false) } else { nearer(back, front).then_some(true) }
    }

    /// Whether every fragment is surely in or surely out.
    pub fn decided(&self) -> bool {
        self.count.0 == self.count.1
    }
}

/// Absolute error of a kernel weight at rho.
///
/// WGSL allows exp an error of 3 + 2 |x| ulp, and sqrt that of `1 / inverseSqrt`, 5 ulp; the
/// argument of exp is rounded three times.
fn weight_error(kernel: Kernel, rho: f64) -> f64 {
    let exponential =
        |exponent: f64, power: f64| (-exponent).exp() * ((3.0 + 2.0 * exponent) * 2.0 * E + power * exponent * E);
    match kernel {
        Kernel::Gaussian { sigma } => exponential(0.5 * (rho / sigma).powi(2), 3.0),
        Kernel::Ellipse { a, n, smooth } => {
            // pow is exp2(y log2 x): its error grows with the logarithm, which is small where the
            // weight is large.
            let power = if [2.0, 3.0, 4.0].contains(&n) { 3.0 } else { 64.0 };
            let error = exponential(a * rho.powf(n), power);
            // The step, 1 - step, the difference and the quotient are all rounded.
            if smooth { (error + 5.0 * E) / (1.0 - (-a).exp()) } else { error }
        }
        // 1 - rho has an error of 11 E and is raised to the power. Tests only use powers that the
        // kernel computes by products.
        Kernel::Cone { power } => {
            let height = (1.0 - rho).max(0.0);
            (height + 11.0 * E).powf(power) - height.powf(power) + 12.0 * E * height.powf(power)
        }
        Kernel::Constant => 0.0,
    }
}

struct Candidate {
    pixel: usize,
    depth: Interval,
    rho: Interval,
    sure: bool,
    splat: usize,
}

/// Computes the enclosure of each pixel of an image.
pub fn enclose(scene: &Scene, camera: &Camera, options: &Settings, splats: &[Splat]) -> Vec<Pixel> {
    let (width, height) = (camera.width, camera.height);
    let blank = Pixel {
        nearest: Interval { low: f64::INFINITY, high: f64::INFINITY },
        count: (0, 0),
        weight: Interval::ZERO,
        color: [Interval::ZERO; 4],
        normal: [Interval::ZERO; 3],
        depth: Interval { low: f64::INFINITY, high: f64::NEG_INFINITY },
        depth_error: 0.0,
        sides: [Interval { low: f64::INFINITY, high: f64::INFINITY }; 2],
    };
    // One bit of a stored depth tells front from back faces, which costs precision.
    let sided = Sides::of(&Facts::of(scene), camera, options) == Sides::Nearest;
    let of_side = if sided { 2.0 * E } else { 0.0 };
    let mut pixels = vec![blank; camera.pixels()];
    let mut candidates = Vec::new();
    let mut open = vec![false; splats.len()];
    for (index, splat) in splats.iter().enumerate() {
        let precision = Precision::of(splat, scene, camera);
        open[index] = precision.side_is_open();
        // Searches one pixel more on each side, as pixels outside the twin's bounds must fail the
        // other tests too.
        for y in splat.first[1].saturating_sub(1)..=(splat.last[1] + 1).min(height - 1) {
            for x in splat.first[0].saturating_sub(1)..=(splat.last[0] + 1).min(width - 1) {
                let Some((at, _)) = footprint(splat, camera, LowPass::None, x, y) else { continue };
                let bound = precision.fragment(splat, x, y, &at);
                let rho = at.rho2.sqrt();
                let rho = Interval { low: (rho - bound.rho).max(0.0), high: rho + bound.rho };
                let span = at.depth.abs() * (bound.depth + of_side);
                let depth = Interval { low: at.depth - span, high: at.depth + span };
                let near = camera.near;
                if rho.low > 1.0 || depth.high < near * (1.0 - 4.0 * E) || rho.low.is_nan() {
                    continue;
                }
                let sure = rho.high <= 1.0 && depth.low >= near * (1.0 + 4.0 * E) && !open[index];
                let pixel = y as usize * width as usize + x as usize;
                let Pixel { nearest, sides, .. } = &mut pixels[pixel];
                let least = depth.low.max(near * (1.0 - 4.0 * E));
                nearest.low = nearest.low.min(least);
                for (_, side) in
                    sides.iter_mut().enumerate().filter(|(k, _)| open[index] || *k == usize::from(sided && splat.away))
                {
                    side.low = side.low.min(least);
                }
                if sure {
                    nearest.high = nearest.high.min(depth.high);
                    let side = &mut sides[usize::from(sided && splat.away)];
                    side.high = side.high.min(depth.high);
                }
                candidates.push(Candidate { pixel, depth, rho, sure, splat: index });
            }
        }
    }
    accumulate((scene, camera), options, splats, &candidates, &open, &mut pixels);
    pixels
}

fn accumulate(
    (scene, camera): (&Scene, &Camera),
    options: &Settings,
    splats: &[Splat],
    candidates: &[Candidate],
    open: &[bool],
    pixels: &mut [Pixel],
) {
    let (low, high) = scene.color_range();
    let (_, _, of_radius) = options.epsilon.parts();
    // Rounding of the comparison with the farthest accepted depth; a radius adds eight roundings.
    let of_ray = matches!(options.epsilon, Epsilon::Ray(_));
    let rounding = if of_radius > 0.0 || of_ray { 12.0 * E } else { 4.0 * E };
    for candidate in candidates {
        let splat = &splats[candidate.splat];
        let pixel = &mut pixels[candidate.pixel];
        let radius = f64::from(scene.surfels[splat.surfel as usize].shorter());
        let (x, y) = (candidate.pixel as u32 % camera.width, candidate.pixel as u32 / camera.width);
        let back = |front: f64| options.epsilon.farthest(front, radius, camera.along_axis(x, y));
        if candidate.depth.low > back(pixel.nearest.high) * (1.0 + rounding) {
            continue;
        }
        let side = pixel.back();
        if side.is_some_and(|back| back != (splat.away && splat.sides == Sides::Nearest)) && !open[candidate.splat] {
            continue;
        }
        // A fragment is surely accepted only if it is in front of the limit for the least possible
        // nearest depth.
        let sure =
            candidate.sure && side.is_some() && candidate.depth.high <= back(pixel.nearest.low) * (1.0 - rounding);
        let weight_at = |rho: f64| options.kernel.weight(rho.min(1.0).powi(2));
        let error_at = |rho: f64| weight_error(options.kernel, rho.min(1.0));
        let (near_rim, near_center) = (candidate.rho.high, candidate.rho.low);
        let least = if sure { (weight_at(near_rim) - error_at(near_rim)).max(0.0) } else { 0.0 };
        let most = weight_at(near_center) + error_at(near_center);
        // Rounding to whole units costs one unit for the weight and one more for each term; a term
        // is rounded to f32 first.
        let add = |sum: &mut Interval, value: Interval, units: f64| {
            let low = (least * (value.low - 5.0 * E).max(0.0) - units * UNIT).max(0.0);
            let high = most * (value.high + 5.0 * E).min(1.0) + units * UNIT;
            sum.add(if sure { low } else { 0.0 }, high);
        };
        add(&mut pixel.weight, Interval { low: 1.0, high: 1.0 }, 1.0);
        let [r, g, b, alpha] = scene.colors.linear(splat.surfel as usize);
        for (k, value) in [r * alpha, g * alpha, b * alpha, alpha].into_iter().enumerate() {
            let span = f64::from(high[k]) - f64::from(low[k]);
            let mapped = if span > 0.0 { (f64::from(value) - f64::from(low[k])) / span } else { 0.0 };
            // The difference from the low end is accurate only to 1 E of the larger magnitude.
            let blur = if span > 0.0 { 2.0 * E * f64::from(low[k].abs().max(high[k].abs())) / span } else { 0.0 };
            add(&mut pixel.color[k], Interval { low: mapped - blur, high: mapped + blur }, 2.0);
        }
        for (k, value) in splat.normal.to_array().into_iter().enumerate() {
            let size = if open[candidate.splat] && !scene.oriented { value.abs() } else { f64::NAN };
            let mapped = match size.is_nan() {
                true => Interval { low: value * 0.5 + 0.5 - 4.0 * E, high: value * 0.5 + 0.5 + 4.0 * E },
                false => Interval { low: 0.5 - 0.5 * size - 4.0 * E, high: 0.5 + 0.5 * size + 4.0 * E },
            };
            add(&mut pixel.normal[k], mapped, 2.0);
        }
        pixel.depth.low = pixel.depth.low.min(candidate.depth.low);
        pixel.depth.high = pixel.depth.high.max(candidate.depth.high);
        pixel.depth_error = pixel.depth_error.max(candidate.depth.relative_width());
        pixel.count.0 += u32::from(sure);
        pixel.count.1 += 1;
    }
}
