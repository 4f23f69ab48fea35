// The rows of a thin splat: one whose image is more than eight times as long as wide, because it is
// seen nearly edge-on or has such a shape. Across the image's width, u changes by 1 within a short
// distance. Along the image's much greater length, the terms of a . (dx, dy, 1) grow and cancel,
// and f32 keeps only 24 bits of them.
//
// The unit disk is therefore rotated in itself until row a has all the change across the width and
// row b has none. Row a is then split on a common grid of 12 bits: the leading parts times whole
// pixels sum exactly, so 36 bits survive the cancellation at the cost of three multiplications.
// #import double::{Double, product, sum}
// #import vectors::{dot2, norm2, unit2}

struct Homography {
    a: vec3<f32>,
    b: vec3<f32>,
    c: vec3<f32>,
    a_low: vec3<f32>,
    // Cosine and sine of the angle by which the unit disk was rotated in itself.
    turn: vec2<f32>,
    anchor: vec2<i32>,
    // First and last image point that the disk can reach; empty if low > high.
    low: vec2<f32>,
    high: vec2<f32>,
    // Whether the surfel is left to project_rare().
    rare: bool,
    // > 0 if s x t points away from the viewer; 0 for a disk seen exactly edge-on, which covers
    // nothing.
    away: f32,
    // For the low-pass: whether the anchor is the pixel of the splat's centre. If so, the next
    // fields are the splat's centre relative to that pixel's centre, the images of the half-axes
    // (both in pixels), and the range of depths on the disk.
    centered: bool,
    offset: vec2<f32>,
    s_image: vec2<f32>,
    t_image: vec2<f32>,
    depth_low: f32,
    depth_high: f32,
}

struct Rows {
    turn: vec2<f32>,
    a: vec3<f32>,
    a_low: vec3<f32>,
    b: vec3<f32>,
}

fn is_thin(a: vec2<f32>, b: vec2<f32>) -> bool {
    return dot2(a, a) + dot2(b, b) > 8.0 * abs(a.x * b.y - a.y * b.x);
}

fn single(x: f32) -> Double {
    return Double(x, 0.0);
}

fn negative(x: Double) -> Double {
    return Double(-x.high, -x.low);
}

fn difference(a: Double, b: Double) -> Double {
    return sum(a, negative(b));
}

fn widen(v: vec3<f32>) -> array<Double, 3> {
    return array<Double, 3>(single(v.x), single(v.y), single(v.z));
}

// One component of a cross product: a b' - a' b.
fn minor(a: Double, b_: Double, a_: Double, b: Double) -> Double {
    return difference(product(a, b_), product(a_, b));
}

// Returns cosine and sine of half the angle of (x, y), from -90 to 90 degrees.
fn half_turn(x: f32, y: f32) -> vec2<f32> {
    // Squares of these may be beyond f32.
    let size = max(abs(x), abs(y));
    let at = vec2<f32>(x, y) / size;
    let length = norm2(at);
    let right = vec2<f32>(length + at.x, at.y);
    let left = vec2<f32>(abs(at.y), select(at.x - length, length - at.x, at.y >= 0.0));
    return select(unit2(select(left, right, at.x >= 0.0)), vec2<f32>(1.0, 0.0), size == 0.0);
}

// Returns rows a and b from their changes per pixel, and from the offset in pixels of the splat's
// centre from the anchor's centre. Both rows are 0 at the splat's centre.
fn thin_rows(a_x: Double, a_y: Double, b_x: Double, b_y: Double, offset_x: Double, offset_y: Double) -> Rows {
    let a_2 = a_x.high * a_x.high + a_y.high * a_y.high;
    let b_2 = b_x.high * b_x.high + b_y.high * b_y.high;
    let turn = half_turn(a_2 - b_2, 2.0 * (a_x.high * b_x.high + a_y.high * b_y.high));
    let cosine = single(turn.x);
    let sine = single(turn.y);
    let wide_x = sum(product(cosine, a_x), product(sine, b_x));
    let wide_y = sum(product(cosine, a_y), product(sine, b_y));
    let long_x = difference(product(cosine, b_x), product(sine, a_x));
    let long_y = difference(product(cosine, b_y), product(sine, a_y));
    let wide_0 = negative(sum(product(wide_x, offset_x), product(wide_y, offset_y)));
    let long_0 = negative(sum(product(long_x, offset_x), product(long_y, offset_y)));
    let a = vec3<f32>(wide_x.high, wide_y.high, wide_0.high);
    // The power of two at or below the largest coefficient; the grid is 2^-11 of it.
    let largest = max(max(abs(a.x), abs(a.y)), abs(a.z));
    let grid = bitcast<f32>(bitcast<u32>(largest) & 0x7f800000u) / 2048.0;
    var rows: Rows;
    rows.turn = turn;
    rows.a = floor(a / grid + 0.5) * grid;
    rows.a_low = (a - rows.a) + vec3<f32>(wide_x.low, wide_y.low, wide_0.low);
    rows.b = vec3<f32>(long_x.high, long_y.high, long_0.high);
    return rows;
}
