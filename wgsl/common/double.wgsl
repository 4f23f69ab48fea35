// Arithmetic with twice the digits of f32: a number is an unevaluated sum high + low, |low| <=
// ulp(high) / 2. Dekker 1971, "A floating-point technique for extending the available precision";
// Knuth's two-sum.
//
// WGSL lets a compiler reassociate where it considers the result no worse. Mesa's optimiser and
// NVIDIA's compiler rewrite (a + b) - a to b, which removes the very rounding error that these
// functions compute. src/gpu/exact and src/gpu/spirv.rs keep operations apart.

struct Double {
    high: f32,
    low: f32,
}

// a + b exactly, for |a| >= |b| or a = 0.
fn quick_two_sum(a: f32, b: f32) -> Double {
    let sum = a + b;
    return Double(sum, b - (sum - a));
}

// a + b exactly.
fn two_sum(a: f32, b: f32) -> Double {
    let sum = a + b;
    let part = sum - a;
    return Double(sum, (a - (sum - part)) + (b - part));
}

// The leading 12 bits of the significand. x minus them has 12 bits too, so products of halves are
// exact.
fn upper_half(x: f32) -> f32 {
    return bitcast<f32>(bitcast<u32>(x) & 0xfffff000u);
}

// a * b exactly, unless the error underflows.
fn two_product(a: f32, b: f32) -> Double {
    let product = a * b;
    let a1 = upper_half(a);
    let a2 = a - a1;
    let b1 = upper_half(b);
    let b2 = b - b1;
    let error = (a1 * b1 - product) + a1 * b2;
    return Double(product, (error + a2 * b1) + a2 * b2);
}

fn sum(a: Double, b: Double) -> Double {
    let high = two_sum(a.high, b.high);
    return quick_two_sum(high.high, high.low + (a.low + b.low));
}

fn product(a: Double, b: Double) -> Double {
    let high = two_product(a.high, b.high);
    return quick_two_sum(high.high, high.low + (a.high * b.low + a.low * b.high));
}

fn quotient(a: Double, b: Double) -> Double {
    let q = a.high / b.high;
    let back = two_product(q, b.high);
    let rest = (a.high - back.high) - back.low + (a.low - q * b.low);
    return quick_two_sum(q, rest / b.high);
}
