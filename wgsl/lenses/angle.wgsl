// Angles and lengths in doubled precision (double.wgsl), and sine and cosine in f32. WGSL leaves
// the digits of its own functions to the driver.
// Twin: src/scene/optics.rs, which uses f64.
// All loops end, by 1 of src/gpu/loops.rs: 0xfe62bd117434322e
// #import double::{Double, product, quick_two_sum, quotient, sum, two_product}
// #import rows::{single}

// The square root of a number that is not negative; one step of Newton's method after that of f32.
fn root(a: Double) -> Double {
    let first = sqrt(a.high);
    if (!(first > 0.0)) {
        return single(0.0);
    }
    let square = two_product(first, first);
    let rest = ((a.high - square.high) - square.low) + a.low;
    return quick_two_sum(first, rest / (2.0 * first));
}

fn length_of(x: Double, y: Double) -> Double {
    return root(sum(product(x, x), product(y, y)));
}

// How often an angle is halved. The tangent of the last half is below 0.05.
const HALVINGS: u32 = 6u;

// The angle of (x, y) from the x axis, 0 to pi, for y of 0 or more. The vector (x + |(x, y)|, y)
// has half the angle.
fn angle_of(y: Double, x: Double) -> Double {
    var c = x;
    var s = y;
    for (var k = 0u; k < HALVINGS; k++) {
        let length = length_of(c, s);
        if (c.high >= 0.0) {
            c = sum(c, length);
        } else {
            // The same direction without cancellation. Only the first vector may point back.
            c = s;
            s = sum(length, Double(-x.high, -x.low));
        }
    }
    let t = quotient(s, c);
    let t_2 = t.high * t.high;
    // The Taylor series after its first term, which is small: f32 is enough for it.
    let series = t_2 * (0.33333334 - t_2 * (0.2 - t_2 * 0.14285715));
    let half = quick_two_sum(t.high, t.low - t.high * series);
    return Double(half.high * 64.0, half.low * 64.0);
}

// Cosine and sine of an angle of up to a few turns.
fn turned_by(angle: f32) -> vec2<f32> {
    let quarters = floor(angle * 0.63661975 + 0.5);
    let f = (angle - quarters * 1.5703125) - quarters * 0.00048382673;
    let f_2 = f * f;
    let sine = f + f * f_2 * (-0.16666667 + f_2 * (0.008333334 + f_2 * (-0.00019841270 + f_2 * 0.0000027557319)));
    let cosine = 1.0 + f_2 * (-0.5 + f_2 * (0.041666668 + f_2 * (-0.0013888889 + f_2 * 0.000024801587)));
    let quarter = u32(i32(quarters) & 3);
    let odd = (quarter & 1u) == 1u;
    let x = select(cosine, sine, odd);
    let y = select(sine, cosine, odd);
    return vec2<f32>(select(x, -x, quarter == 1u || quarter == 2u), select(y, -y, quarter >= 2u));
}
