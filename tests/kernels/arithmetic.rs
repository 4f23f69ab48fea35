//! The arithmetic of `wgsl/common/arithmetic.wgsl`: its errors against f64, its values outside the
//! range, and the same bits on every adapter.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common;

use common::Random;
use common::evaluated::evaluated;
use epsplat::low_level::gpu::Gpu;

/// A function, its f64 value, and the largest error in units in the last place.
struct Row {
    call: &'static str,
    exact: fn(f64, f64) -> f64,
    /// The device's own operation, where it rounds to nearest.
    native: Option<&'static str>,
    most_ulps: f64,
    /// The range of the logarithms to base 2 of arguments.
    range: [f64; 2],
    /// Whether arguments may be negative.
    signed: bool,
}

const ROWS: [Row; 8] = [
    Row {
        call: "f32_divide(x, y)",
        exact: |x, y| x / y,
        native: Some("x / y"),
        most_ulps: 0.5,
        range: [-60.0, 60.0],
        signed: true,
    },
    Row {
        call: "f32_sqrt(x)",
        exact: |x, _| x.sqrt(),
        native: Some("sqrt(x)"),
        most_ulps: 0.5,
        range: [-126.0, 127.9],
        signed: false,
    },
    // Two roundings.
    Row {
        call: "f32_inverse_sqrt(x)",
        exact: |x, _| 1.0 / x.sqrt(),
        native: Some("1.0 / sqrt(x)"),
        most_ulps: 1.5,
        range: [-126.0, 127.9],
        signed: false,
    },
    Row {
        call: "f32_exp2(x)",
        exact: |x, _| x.exp2(),
        native: None,
        most_ulps: 1.4,
        range: [-30.0, 5.9],
        signed: true,
    },
    Row { call: "f32_exp(x)", exact: |x, _| x.exp(), native: None, most_ulps: 11.4, range: [-30.0, 2.9], signed: true },
    Row {
        call: "f32_log(x)",
        exact: |x, _| x.ln(),
        native: None,
        most_ulps: 1.1,
        range: [-126.0, 127.9],
        signed: false,
    },
    Row {
        call: "f32_log2(x)",
        exact: |x, _| x.log2(),
        native: None,
        most_ulps: 1.1,
        range: [-126.0, 127.9],
        signed: false,
    },
    Row { call: "f32_pow(x, y)", exact: f64::powf, native: None, most_ulps: 1.6, range: [-5.0, 3.9], signed: false },
];

/// Returns the values of the WGSL expression `call` for each pair x, y, as bits.
fn values(gpu: &Gpu, call: &str, inputs: &[[f32; 2]]) -> Vec<u32> {
    // The names x and y are those of the expressions.
    let function = format!("fn value(x: f32, y: f32) -> f32 {{ return {call}; }}");
    evaluated(
        gpu,
        ["vec2<f32>", "u32"],
        &[&function],
        "outputs[index] = bitcast<u32>(value(x.x, x.y));",
        (inputs, inputs.len()),
    )
}

fn inputs(row: &Row) -> Vec<[f32; 2]> {
    let mut random = Random(17);
    let mut number = || {
        let significand = match random.bits() % 8 {
            0 => 1.0,
            1 => 2.0 - f64::from(f32::EPSILON),
            2 => 1.0 + f64::from(f32::EPSILON),
            _ => random.between(1.0, 2.0),
        };
        let negative = row.signed && random.bits().is_multiple_of(2);
        let size = significand * random.between(row.range[0], row.range[1]).floor().exp2();
        if negative { -size as f32 } else { size as f32 }
    };
    (0..1 << 18).map(|_| [number(), number()]).collect()
}

/// The error of `found` in units in the last place of `exact`.
fn ulps(found: f32, exact: f64) -> f64 {
    // A number without its significand is a power of two.
    let power = f64::from_bits(exact.to_bits() & f64::INFINITY.to_bits());
    (f64::from(found) - exact).abs() / (power.max(f64::from(f32::MIN_POSITIVE)) * f64::from(f32::EPSILON))
}

fn adapters() -> Vec<Gpu> {
    [common::gpu(), common::core_gpu(), common::opengl()].into_iter().flatten().collect()
}

#[test]
fn every_function_is_as_exact_as_it_says_and_has_one_set_of_bits() {
    let adapters = adapters();
    if adapters.is_empty() {
        return;
    }
    for row in &ROWS {
        let inputs = inputs(row);
        let expected = values(&adapters[0], row.call, &inputs);
        let errors = inputs.iter().zip(&expected).map(|(&[x, y], &bits)| {
            let exact = (row.exact)(f64::from(x), f64::from(y));
            (ulps(f32::from_bits(bits), exact), x, y)
        });
        let worst = errors.fold((0.0, 0.0, 0.0), |worst, error| if error.0 > worst.0 { error } else { worst });
        println!("{}: {:.4} units in the last place at {}, {}", row.call, worst.0, worst.1, worst.2);
        assert!(worst.0 <= row.most_ulps, "{}: {worst:?}", row.call);
        for gpu in &adapters[1..] {
            let found = values(gpu, row.call, &inputs);
            assert!(found == expected, "{} on {} ({})", row.call, gpu.adapter.name, gpu.adapter.api);
        }
        for gpu in adapters.iter().filter(|gpu| gpu.adapter.rounds_division()) {
            let Some(native) = row.native else { continue };
            assert!(values(gpu, native, &inputs) == expected, "{native} on {}", gpu.adapter.api);
        }
    }
}

/// All 2^23 significands: quotients and roots have no other argument, and logarithms and
/// exponentials have their largest errors there.
#[test]
fn every_significand_is_as_exact_as_it_says() {
    // A call, its f64 value, its largest error, and the exponents of its arguments.
    type Case = (&'static str, fn(f64) -> f64, f64, &'static [i32]);
    let cases: [Case; 6] = [
        ("f32_divide(1.0, x)", |x| 1.0 / x, 0.5, &[0]),
        ("f32_sqrt(x)", f64::sqrt, 0.5, &[0, 1]),
        ("f32_inverse_sqrt(x)", |x| 1.0 / x.sqrt(), 1.5, &[0, 1]),
        ("f32_exp2(x)", f64::exp2, 1.4, &[-2, -1, 0]),
        ("f32_log(x)", f64::ln, 1.1, &[-1, 0]),
        ("f32_log2(x)", f64::log2, 1.1, &[-1, 0]),
    ];
    for gpu in [common::gpu(), common::opengl()].into_iter().flatten() {
        for (call, exact, most, exponents) in cases {
            for exponent in exponents {
                let first = ((exponent + 127) as u32) << 23;
                for inputs in (first..first + (1 << 23)).collect::<Vec<_>>().chunks(1 << 21) {
                    let inputs: Vec<[f32; 2]> = inputs.iter().map(|bits| [f32::from_bits(*bits), 0.0]).collect();
                    for (&[x, _], bits) in inputs.iter().zip(values(&gpu, call, &inputs)) {
                        let error = ulps(f32::from_bits(bits), exact(f64::from(x)));
                        assert!(error <= most, "{call} of {x}: {error} units on {}", gpu.adapter.api);
                    }
                }
            }
        }
    }
}

/// The f32 twin, which has no driver, has the bits of all devices.
#[test]
fn the_f32_twin_has_the_bits_of_devices() {
    let (Some(gpu), twin) = (common::gpu(), Gpu::open(Some("twin")).unwrap()) else { return };
    for row in &ROWS {
        let inputs = &inputs(row)[..1 << 12];
        for call in [Some(row.call), row.native].into_iter().flatten() {
            assert!(values(&twin, call, inputs) == values(&gpu, call, inputs), "{call}");
        }
        // The control: a last digit is noticed.
        let other = format!("{} * 1.0000001", row.call);
        assert!(values(&twin, &other, inputs) != values(&gpu, row.call, inputs), "{other}");
    }
}

/// Conversions of integers round to nearest, ties to even.
#[test]
fn integers_become_the_nearest_numbers() {
    let mut random = Random(5);
    let mut numbers: Vec<u32> = (0..1 << 16).map(|_| (random.bits() >> (random.bits() % 32)) as u32).collect();
    numbers.extend([0, 1, u32::MAX, 0x8000_0080, 0x8000_0180, 0x8000_0081, 0x0100_0001, 0x0100_0003]);
    let inputs: Vec<[f32; 2]> = numbers.iter().map(|&n| [f32::from_bits(n), 0.0]).collect();
    for gpu in adapters() {
        for call in ["f32(bitcast<u32>(x))", "f32_of_u32(bitcast<u32>(x))"] {
            for (&number, found) in numbers.iter().zip(values(&gpu, call, &inputs)) {
                // Drivers may change the bits of a NaN that is passed as a number.
                let same = f32::from_bits(number).is_nan() || found == (number as f32).to_bits();
                assert!(same, "{call} of {number} on {}: {}", gpu.adapter.api, f32::from_bits(found));
            }
        }
    }
}

#[test]
fn numbers_outside_the_range_have_a_value() {
    let (inf, nan, least) = (f32::INFINITY, f32::NAN, f32::MIN_POSITIVE);
    let cases: [(&str, f32, f32, f32); 35] = [
        ("f32_divide(x, y)", 1.0, 0.0, inf),
        ("f32_divide(x, y)", -1.0, 0.0, -inf),
        ("f32_divide(x, y)", 0.0, 3.0, 0.0),
        ("f32_divide(x, y)", 0.0, -3.0, -0.0),
        ("f32_divide(x, y)", 0.0, 0.0, nan),
        ("f32_divide(x, y)", inf, 2.0, inf),
        ("f32_divide(x, y)", inf, -2.0, -inf),
        ("f32_divide(x, y)", 1.0, inf, 0.0),
        ("f32_divide(x, y)", inf, inf, nan),
        ("f32_divide(x, y)", nan, 1.0, nan),
        ("f32_divide(x, y)", 1.0, nan, nan),
        ("f32_divide(x, y)", 1e38, 1e-10, inf),
        ("f32_divide(x, y)", 1e-38, 1e10, 0.0),
        ("f32_divide(x, y)", least, 2.0, 0.0),
        // The largest subnormal result, and the least infinite one.
        ("f32_divide(x, y)", f32::from_bits(0x00ff_ffff), 2.0, 0.0),
        ("f32_divide(x, y)", f32::MAX, f32::from_bits(0x3f7f_ffff), inf),
        ("f32_sqrt(x)", 0.0, 0.0, 0.0),
        ("f32_sqrt(x)", -0.0, 0.0, -0.0),
        ("f32_sqrt(x)", -1.0, 0.0, nan),
        ("f32_sqrt(x)", inf, 0.0, inf),
        ("f32_sqrt(x)", nan, 0.0, nan),
        ("f32_exp(x)", 0.0, 0.0, 1.0),
        ("f32_exp2(x)", -125.0, 0.0, 2.0 * least),
        ("f32_log(x)", 0.0, 0.0, -inf),
        ("f32_log(x)", -1.0, 0.0, nan),
        ("f32_log(x)", inf, 0.0, inf),
        ("f32_log(x)", 1.0, 0.0, 0.0),
        ("f32_log2(x)", 8.0, 0.0, 3.0),
        ("f32_pow(x, y)", 0.0, 2.0, 0.0),
        ("f32_pow(x, y)", 0.0, -2.0, inf),
        ("f32_pow(x, y)", 5.0, 0.0, 1.0),
        ("f32_pow(x, y)", 1.0, 77.0, 1.0),
        ("f32_pow(x, y)", inf, -1.0, 0.0),
        ("max(x, y)", nan, 1.0, 1.0),
        ("min(x, y)", nan, 1.0, 1.0),
    ];
    for gpu in adapters() {
        // Exponentials end at the least and at the largest number.
        for (x, end) in [(-1000.0, -125.9999), (-inf, -125.9999), (128.0, 127.99999), (inf, 200.0)] {
            assert_eq!(values(&gpu, "f32_exp2(x)", &[[x, 0.0]]), values(&gpu, "f32_exp2(x)", &[[end, 0.0]]), "{x}");
        }
        for (call, x, y, expected) in cases {
            let found = f32::from_bits(values(&gpu, call, &[[x, y]])[0]);
            let same = if expected.is_nan() { found.is_nan() } else { found.to_bits() == expected.to_bits() };
            assert!(same, "{call} of {x}, {y} on {}: {found} and not {expected}", gpu.adapter.api);
        }
    }
}
