//! The double-f32 arithmetic of `wgsl/common/double.wgsl` on the device, against f64.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common;

use common::Random;
use common::evaluated::{evaluated, file};
use epsplat::low_level::gpu::Gpu;

/// Writes one result of a pair of doubles.
const PUT: &str = "
fn put(index: u32, which: u32, value: Double) {
    outputs[index * 5u + which] = vec2<f32>(value.high, value.low);
}";

/// Applies every function to one pair of doubles.
const STATEMENTS: &str = "
    let a = Double(x.x, x.y);
    let b = Double(x.z, x.w);
    put(index, 0u, two_sum(a.high, b.high));
    put(index, 1u, two_product(a.high, b.high));
    put(index, 2u, sum(a, b));
    put(index, 3u, product(a, b));
    put(index, 4u, quotient(a, b));";

const NAMES: [&str; 6] = ["two_sum", "two_product", "sum", "product", "quotient", "tail"];

/// Pairs of doubles of both signs. Their exponents differ by up to 12, their significands are
/// random, short, or all ones.
fn pairs() -> Vec<[f32; 4]> {
    let mut random = Random(11);
    let mut double = |near: f64| {
        let significand = match random.bits() % 8 {
            0 => 1.0 + (random.bits() % 4) as f64 * 0.25,
            1 => 2.0 - f64::from(f32::EPSILON),
            _ => random.between(1.0, 2.0),
        };
        let sign = if random.bits().is_multiple_of(2) { 1.0 } else { -1.0 };
        let exponent = near + random.between(-12.0, 12.0).round();
        let value = sign * significand * exponent.exp2();
        let high = value as f32;
        let low = if random.bits().is_multiple_of(8) { 0.0 } else { (value - f64::from(high)) as f32 };
        (exponent, [high, low])
    };
    let mut all = Vec::new();
    for k in 0..20_000 {
        let (exponent, a) = double(f64::from(k % 41 - 20));
        let (_, b) = double(exponent);
        all.push([a[0], a[1], b[0], b[1]]);
    }
    // Sums that cancel to the last bits.
    for k in 0..2000u32 {
        let a = 1.0 + k as f32 / 2000.0;
        let b = -f32::from_bits(a.to_bits() + k % 5);
        all.push([a, 0.0, b, 0.0]);
    }
    all
}

/// Returns the largest error of each function, then the largest ratio of trailing to leading part.
///
/// The errors of `two_sum` and `two_product` are absolute. That of `sum` is relative to the
/// magnitudes of its terms, those of `product` and `quotient` are relative to the result.
fn errors(gpu: &Gpu, double: &str) -> [f64; 6] {
    let pairs = pairs();
    let types = ["vec4<f32>", "vec2<f32>"];
    let results: Vec<[f32; 2]> = evaluated(gpu, types, &[double, PUT], STATEMENTS, (&pairs, 5 * pairs.len()));
    let wide = |high: f32, low: f32| f64::from(high) + f64::from(low);
    let mut worst = [0f64; 6];
    for (pair, results) in pairs.iter().zip(results.chunks_exact(5)) {
        let (a, b) = (wide(pair[0], pair[1]), wide(pair[2], pair[3]));
        let (a_high, b_high) = (f64::from(pair[0]), f64::from(pair[2]));
        let got: Vec<f64> = results.iter().map(|r| wide(r[0], r[1])).collect();
        let now = [
            (got[0] - (a_high + b_high)).abs(),
            (got[1] - a_high * b_high).abs(),
            (got[2] - (a + b)).abs() / (a.abs() + b.abs()),
            (got[3] - a * b).abs() / (a * b).abs(),
            (got[4] - a / b).abs() / (a / b).abs(),
            results.iter().map(|r| tail(*r)).fold(0.0, f64::max),
        ];
        for (worst, now) in worst.iter_mut().zip(now) {
            *worst = if now.is_nan() { f64::INFINITY } else { worst.max(now) };
        }
    }
    worst
}

/// The ratio of the trailing part to the leading one.
fn tail([high, low]: [f32; 2]) -> f64 {
    if low == 0.0 { 0.0 } else { f64::from((low / high).abs()) }
}

fn original() -> &'static str {
    file("double.wgsl")
}

fn changed(from: &str, to: &str) -> String {
    assert_eq!(original().matches(from).count(), 1, "{from}");
    original().replace(from, to)
}

fn in_words(errors: &[f64; 6]) -> String {
    NAMES.iter().zip(errors).map(|(name, error)| format!("{name} {error:.2e}")).collect::<Vec<_>>().join(", ")
}

#[test]
fn doubled_arithmetic_keeps_44_bits() {
    // OpenGL has barriers in place of Vulkan's decoration (src/gpu/exact).
    for gpu in [common::gpu(), common::opengl()].into_iter().flatten() {
        let errors = errors(&gpu, original());
        eprintln!("{}: {}", gpu.adapter.name, in_words(&errors));
        assert_eq!(errors[..2], [0.0, 0.0], "the exact ones: {}", in_words(&errors));
        let limit = (-44f64).exp2();
        assert!(errors[5] <= 1.0 / 16_777_216.0, "a trailing part of more than half a unit: {}", in_words(&errors));
        assert!(errors[2..5].iter().all(|error| *error <= limit), "over {limit:e}: {}", in_words(&errors));
    }
}

#[test]
fn the_comparison_notices_lost_digits() {
    let Some(gpu) = common::gpu() else { return };
    let whole = changed("bitcast<f32>(bitcast<u32>(x) & 0xfffff000u)", "x");
    let unsplit = errors(&gpu, &whole);
    assert!(unsplit[1] > 0.0, "an unsplit product counts as exact: {}", in_words(&unsplit));
    assert!(unsplit[3] > 1e-9, "{}", in_words(&unsplit));
    let sloppy = errors(&gpu, &changed("high.low + (a.low + b.low)", "high.low + a.low"));
    assert!(sloppy[2] > 1e-10, "{}", in_words(&sloppy));
    let coarse = errors(&gpu, &changed("rest / b.high);", "0.0);"));
    assert!(coarse[4] > 1e-10, "{}", in_words(&coarse));
}
