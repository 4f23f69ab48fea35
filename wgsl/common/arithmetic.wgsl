// Operations on f32 whose bits every adapter shares. WGSL leaves their last digits to the driver:
// a quotient may be off by 2.5 units in the last place, a power by any number.
//
// src/gpu/exact appends this file to every module and calls these functions in place of WGSL's own
// operations, so kernels say a / b and exp(x). These functions use sums and products, which
// src/gpu/spirv.rs and src/gpu/exact keep apart, comparisons, and integers. Quotients and roots
// start from the driver's own, and an exact integer remainder corrects them, so the start does not
// show. Subnormal arguments count as 0, and subnormal results of quotients, roots and powers are 0.
// tests/kernels/arithmetic.rs measures the errors.

const F32_SIGN: u32 = 0x80000000u;
const F32_INFINITY: u32 = 0x7f800000u;
const F32_NAN: u32 = 0x7fc00000u;
const F32_ONE: u32 = 0x800000u;
const F32_FRACTION: u32 = 0x7fffffu;

fn f32_mix(a: f32, b: f32, share: f32) -> f32 {
    return a * (1.0 - share) + b * share;
}

// Rounds to nearest, ties to even. Some drivers round twice above 2^31; both halves are exact.
fn f32_of_u32(x: u32) -> f32 {
    return f32(i32(x >> 16u)) * 65536.0 + f32(i32(x & 0xffffu));
}

// The f32 of a sign, a biased exponent and a significand of 2^23 to 2^24; infinite or 0 where the
// exponent is out of range.
fn f32_composed(sign: u32, exponent: i32, significand: u32) -> u32 {
    let bits = (u32(clamp(exponent, 0, 255)) << 23u) + (significand - F32_ONE);
    let finite = select(bits, F32_INFINITY, bits >= F32_INFINITY);
    // A significand that was rounded up to 2^24 lifts the exponent from 0 to 1.
    return sign | select(finite, 0u, exponent < 0 || bits < F32_ONE);
}

// a / b, rounded to nearest.
fn f32_divide(a: f32, b: f32) -> f32 {
    let x = bitcast<u32>(a);
    let y = bitcast<u32>(b);
    let sign = (x ^ y) & F32_SIGN;
    let of_x = (x >> 23u) & 0xffu;
    let of_y = (y >> 23u) & 0xffu;
    let m = (x & F32_FRACTION) | F32_ONE;
    let n = (y & F32_FRACTION) | F32_ONE;
    // The quotient of the significands as an integer of 25 bits, with its remainder modulo 2^32.
    let below = m < n;
    let inverse = 1.0 / f32(i32(n));
    let start = f32(i32(m)) * inverse * select(16777216.0, 33554432.0, below);
    let first = i32(start);
    let rest = i32((m << select(24u, 25u, below)) - u32(first) * n);
    let step = i32(floor(f32(rest) * inverse));
    let near = rest - step * i32(n);
    let by = select(select(0, 1, near >= i32(n)), -1, near < 0);
    let quotient = u32(first + step + by);
    // The 25th bit rounds. A tie would need a product of more than 48 bits.
    let bits = f32_composed(sign, i32(of_x) - i32(of_y) + select(127, 126, below), (quotient + 1u) >> 1u);
    let is_nan = (x & ~F32_SIGN) > F32_INFINITY || (y & ~F32_SIGN) > F32_INFINITY
        || (of_x == 0u && of_y == 0u) || (of_x == 255u && of_y == 255u);
    let none = of_x == 0u || of_y == 255u;
    let endless = of_x == 255u || of_y == 0u;
    return bitcast<f32>(select(select(select(bits, sign, none), sign | F32_INFINITY, endless), F32_NAN, is_nan));
}

// The square root, rounded to nearest.
fn f32_sqrt(a: f32) -> f32 {
    let x = bitcast<u32>(a);
    let exponent = i32((x >> 23u) & 0xffu) - 127;
    let odd = exponent & 1;
    let m = ((x & F32_FRACTION) | F32_ONE) << u32(odd);
    // The root of the significand as an integer of 25 bits, with its remainder modulo 2^32.
    let start = sqrt(f32(i32(m)) * 0.00000011920928955078125) * 16777216.0;
    let first = i32(start);
    let rest = i32((m << 25u) - u32(first) * u32(first));
    let step = i32(floor(f32(rest) * (0.5 / start)));
    let second = first + step;
    let near = rest - step * (first + second);
    let by = select(select(0, 1, near > 2 * second), -1, near < 0);
    let bits = f32_composed(0u, ((exponent - odd) >> 1u) + 127, u32(second + by + 1) >> 1u);
    let none = (x & F32_INFINITY) == 0u;
    let special = select(select(x, F32_NAN, x > F32_INFINITY), x & F32_SIGN, none);
    return bitcast<f32>(select(bits, special, none || x >= F32_INFINITY));
}

// 1 / sqrt(x) with two roundings.
fn f32_inverse_sqrt(x: f32) -> f32 {
    return f32_divide(1.0, f32_sqrt(x));
}

fn f32_inverse_sqrt_native(x: f32) -> f32 {
    return 1.0 / sqrt(x);
}

// Adding this number to one of less than 2^22 rounds that to a whole number, which the lowest bits
// of the sum hold.
const F32_WHOLE: f32 = 12582912.0;

// Whether x is NaN. Compilers may drop a comparison of x with itself.
fn f32_is_nan(x: f32) -> bool {
    return (bitcast<u32>(x) & ~F32_SIGN) > F32_INFINITY;
}

// x, or the nearest of -125.9999 and 127.99999; one of them for NaN. One integer operation serves
// each end: bits of negative numbers are largest as u32 and fall with the number, those of positive
// ones are largest as i32.
fn f32_bounded(x: f32) -> f32 {
    return bitcast<f32>(min(i32(min(bitcast<u32>(x), 0xc2fbfff3u)), 0x42ffffff));
}

// 2^(whole - F32_WHOLE + f), |f| at most 1/2 + 2^-10.
fn f32_raised(whole: f32, f: f32) -> f32 {
    let square = f * f;
    let first = 0.6931471824645996 + f * 0.24022650718688965;
    let second = 0.055503569543361664 + f * 0.009618083015084267;
    let third = 0.0013390863314270973 + f * 0.00015453163359779865;
    let y = 1.0 + f * (first + square * (second + square * third));
    return bitcast<f32>(bitcast<u32>(y) + (bitcast<u32>(whole) << 23u));
}

// 2^x. Below -125.9999 and above 127.99999 it is the value there.
fn f32_exp2(x: f32) -> f32 {
    let bounded = f32_bounded(x);
    let whole = bounded + F32_WHOLE;
    return f32_raised(whole, bounded - (whole - F32_WHOLE));
}

// e^x, with a relative error of 2^-24 (2.8 + 1.3 |x|): the product is rounded.
fn f32_exp(x: f32) -> f32 {
    return f32_exp2(x * 1.4426950216293335);
}

// The parts of a logarithm: x = 2^exponent (1 + t), and ln(1 + t) = t - t^2 / 2 + t^3 tail.
struct F32Log {
    exponent: f32,
    t: f32,
    tail: f32,
}

fn f32_log_parts(x: f32) -> F32Log {
    // The significand is from sqrt(1/2) to sqrt(2).
    let bits = bitcast<u32>(x) + (F32_ONE - 0x3504f3u);
    let t = bitcast<f32>((bits & F32_FRACTION) + 0x3f3504f3u) - 1.0;
    let p = 0.11685419827699661 + t * (-0.11479733884334564 + t * 0.06971611827611923);
    let q = -0.1666780263185501 + t * (0.14249058067798615 + t * (-0.12425687164068222 + t * p));
    let tail = 0.3333333134651184 + t * (-0.2499999701976776 + t * (0.20000715553760529 + t * q));
    return F32Log(f32(i32(bits >> 23u) - 127), t, tail);
}

// `value` where x is positive and finite; else the logarithm of 0, of a negative number, of
// infinity or of NaN.
fn f32_log_of(x: f32, value: f32) -> f32 {
    let bits = bitcast<u32>(x);
    let none = (bits & F32_INFINITY) == 0u;
    let special = select(select(bits, F32_NAN, bits > F32_INFINITY), F32_SIGN | F32_INFINITY, none);
    return bitcast<f32>(select(bitcast<u32>(value), special, none || bits >= F32_INFINITY));
}

fn f32_log(x: f32) -> f32 {
    let parts = f32_log_parts(x);
    let square = parts.t * parts.t;
    let low = square * (parts.t * parts.tail - 0.5) - parts.exponent * 0.00021219444;
    return f32_log_of(x, (parts.t + low) + parts.exponent * 0.693359375);
}

// log2(x) as high + low.
fn f32_log2_parts(x: f32) -> vec2<f32> {
    let parts = f32_log_parts(x);
    let t = parts.t;
    // -t^2 / 2 exactly, by halves of t with 12 bits.
    let upper = bitcast<f32>(bitcast<u32>(t) & 0xfffff000u);
    let lower = t - upper;
    let square = t * t;
    let square_low = ((upper * upper - square) + 2.0 * (upper * lower)) + lower * lower;
    let half = -0.5 * square;
    let sum = t + half;
    let rest = (half - (sum - t)) + (t * square * parts.tail - 0.5 * square_low);
    // The natural logarithm in two parts, the first of 12 bits, times log2(e) in two parts.
    let whole = sum + rest;
    let natural = bitcast<f32>(bitcast<u32>(whole) & 0xfffff000u);
    let natural_low = (sum - natural) + rest;
    let high = natural * 1.4423828125;
    let low = natural_low * 1.4426950408889634 + natural * 0.0003122283889634;
    let result = parts.exponent + high;
    // The exponent is 0, or larger than the other term.
    return vec2<f32>(result, (high - (result - parts.exponent)) + low);
}

fn f32_log2(x: f32) -> f32 {
    let parts = f32_log2_parts(x);
    return f32_log_of(x, parts.x + parts.y);
}

// x^p for x of 0 or more; 1 for p = 0 and for x = 1.
fn f32_pow(x: f32, p: f32) -> f32 {
    let parts = f32_log2_parts(x);
    // p times the leading part, exactly.
    let p_upper = bitcast<f32>(bitcast<u32>(p) & 0xfffff000u);
    let p_lower = p - p_upper;
    let upper = bitcast<f32>(bitcast<u32>(parts.x) & 0xfffff000u);
    let lower = parts.x - upper;
    let product = p * parts.x;
    let rest = ((p_upper * upper - product) + (p_upper * lower + p_lower * upper)) + p_lower * lower;
    let more = rest + p * parts.y;
    let sum = product + more;
    let bounded = f32_bounded(sum);
    let whole = bounded + F32_WHOLE;
    let power = f32_raised(whole, (bounded - (whole - F32_WHOLE)) + ((product - sum) + more));
    let bits = bitcast<u32>(x);
    let none = (bits & F32_INFINITY) == 0u;
    // x is 0 or infinite, and so is the power.
    let end = select(F32_INFINITY, 0u, none == (p > 0.0));
    let result = select(bitcast<u32>(power), end, none || bits == F32_INFINITY);
    let undefined = f32_is_nan(x) || f32_is_nan(p) || (!none && bits > F32_INFINITY);
    let value = select(result, F32_NAN, undefined);
    return select(bitcast<f32>(value), 1.0, p == 0.0 || x == 1.0);
}

fn f32_fract(x: f32) -> f32 {
    return x - floor(x);
}
