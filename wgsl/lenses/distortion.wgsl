// The second step of a lens: radial, tangential and thin prism distortion of a point of the plane.
// src/scene/optics.rs has the formula; lens_perspective.wgsl and lens_fisheye.wgsl make the first
// step.
// Twins: src/scene/optics.rs and src/scene/optics/inverse.rs.
// All loops end, by 1 of src/gpu/loops.rs: 0x2d4f37d84b83aa65
// #import camera_lens::{Sight}
// #import double::{Double, product, quotient, sum}
// #import layout::{held}
// #import rows::{single}
// #import vectors::{dot2, norm2}

// A coefficient: held.lens has the leading parts of twelve, then the trailing ones.
fn coefficient(row: u32, column: u32) -> Double {
    return Double(held.lens[row][column], held.lens[row + 3u][column]);
}

// The largest radius before the distortion, in focal lengths.
fn lens_limit() -> f32 {
    return held.lens[6].x;
}

// 1 + r2 (a + r2 (b + r2 (c + r2 d))).
fn polynomial(r_2: Double, a: Double, b: Double, c: Double, d: Double) -> Double {
    let inner = sum(b, product(r_2, sum(c, product(r_2, d))));
    return sum(single(1.0), product(r_2, sum(a, product(r_2, inner))));
}

fn twice(x: Double) -> Double {
    return Double(2.0 * x.high, 2.0 * x.low);
}

// The radial factor at a squared radius, and its change per unit of that.
fn radial_at(r_2: f32) -> vec2<f32> {
    let k = held.lens[0];
    let l = held.lens[1].xyz;
    let over = 1.0 + r_2 * (k.x + r_2 * (k.y + r_2 * (k.z + r_2 * k.w)));
    let under = 1.0 + r_2 * (l.x + r_2 * (l.y + r_2 * l.z));
    let over_slope = k.x + r_2 * (2.0 * k.y + r_2 * (3.0 * k.z + r_2 * 4.0 * k.w));
    let under_slope = l.x + r_2 * (2.0 * l.y + r_2 * 3.0 * l.z);
    let factor = over / under;
    return vec2<f32>(factor, (over_slope - factor * under_slope) / under);
}

// The derivative of the distortion: the change of x per unit of x and of y, then that of y.
fn distortion_slope(e: vec2<f32>) -> vec4<f32> {
    let radial = radial_at(dot2(e, e));
    let p = held.lens[2].xy;
    let s = held.lens[2].zw;
    let mixed = 2.0 * radial.y * e.x * e.y + 2.0 * p.x * e.x + 2.0 * p.y * e.y;
    return vec4<f32>(
        radial.x + 2.0 * radial.y * e.x * e.x + 2.0 * p.x * e.y + 6.0 * p.y * e.x + 2.0 * s.x * e.x,
        mixed + 2.0 * s.x * e.y,
        mixed + 2.0 * s.y * e.x,
        radial.x + 2.0 * radial.y * e.y * e.y + 2.0 * p.y * e.x + 6.0 * p.x * e.y + 2.0 * s.y * e.y,
    );
}

// Distorts the point of a sight, and its derivatives.
fn distorted(first: Sight) -> Sight {
    var sight = first;
    let x_2 = product(first.x, first.x);
    let y_2 = product(first.y, first.y);
    let xy = twice(product(first.x, first.y));
    let r_2 = sum(x_2, y_2);
    let over = polynomial(r_2, coefficient(0u, 0u), coefficient(0u, 1u), coefficient(0u, 2u), coefficient(0u, 3u));
    let under = polynomial(r_2, coefficient(1u, 0u), coefficient(1u, 1u), coefficient(1u, 2u), single(0.0));
    let factor = quotient(over, under);
    let p_1 = coefficient(2u, 0u);
    let p_2 = coefficient(2u, 1u);
    let along_x = sum(product(p_1, xy), product(p_2, sum(r_2, twice(x_2))));
    let along_y = sum(product(p_2, xy), product(p_1, sum(r_2, twice(y_2))));
    sight.x = sum(product(first.x, factor), sum(along_x, product(coefficient(2u, 2u), r_2)));
    sight.y = sum(product(first.y, factor), sum(along_y, product(coefficient(2u, 3u), r_2)));
    let slope = distortion_slope(vec2<f32>(first.x.high, first.y.high));
    sight.across = slope.x * first.across + slope.y * first.down;
    sight.down = slope.z * first.across + slope.w * first.down;
    sight.radius_2 = r_2.high;
    let limit = lens_limit();
    sight.seen = first.seen && r_2.high <= limit * limit && slope.x * slope.w - slope.y * slope.z > 0.0;
    return sight;
}

// The number of halvings of the radius, and of rounds for the tangential part.
const RADIUS_ROUNDS: u32 = 30u;
const TANGENTIAL_ROUNDS: u32 = 8u;

// The largest distance, in focal lengths at a distance of 0 from the axis, at which a point counts
// as found.
const FOUND: f32 = 1e-4;

// The sum of what the distortion adds to a point of the plane times the radial factor.
fn leaning(e: vec2<f32>) -> vec2<f32> {
    let r_2 = dot2(e, e);
    let p = held.lens[2].xy;
    return p.xy * (2.0 * e.x * e.y) + p.yx * (r_2 + 2.0 * e * e) + held.lens[2].zw * r_2;
}

// Whether there are tangential or prism terms.
fn leans() -> bool {
    return any(held.lens[2] != vec4<f32>(0.0));
}

// The point that the distortion maps to `plane`; z is 1 if the lens shows it. If not, the point is
// that at the border of the image, without the tangential part.
fn undistorted(plane: vec2<f32>) -> vec3<f32> {
    let wanted = norm2(plane);
    let limit = lens_limit();
    var low = 0.0;
    var high = limit;
    for (var k = 0u; k < RADIUS_ROUNDS; k++) {
        let middle = 0.5 * (low + high);
        if (middle * radial_at(middle * middle).x < wanted) {
            low = middle;
        } else {
            high = middle;
        }
    }
    let start = plane * select(1.0, high / wanted, wanted > 0.0);
    // The centre does not lean either. A branch on uniforms alone would be compiled for every frame
    // (shade_lambert.wgsl).
    if ((!leans()) | (wanted == 0.0)) {
        return vec3<f32>(start, select(0.0, 1.0, wanted <= held.lens[6].z));
    }
    var e = start;
    for (var k = 0u; k < TANGENTIAL_ROUNDS; k++) {
        let slope = distortion_slope(e);
        let off = plane - (e * radial_at(dot2(e, e)).x + leaning(e));
        let turned = vec2<f32>(slope.w * off.x - slope.y * off.y, slope.x * off.y - slope.z * off.x);
        e += turned / (slope.x * slope.w - slope.y * slope.z);
        let r = norm2(e);
        e *= select(1.0, limit / r, r > limit);
    }
    // Comparisons with NaN are false.
    let rest = norm2(plane - (e * radial_at(dot2(e, e)).x + leaning(e)));
    let found = rest <= FOUND * (1.0 + wanted);
    return select(vec3<f32>(start, 0.0), vec3<f32>(e, 1.0), found);
}

// Whether the lens shows something at a point of the plane.
fn shows_plane(plane: vec2<f32>) -> bool {
    let is_sure = norm2(plane) <= held.lens[6].z;
    if (is_sure | (!leans())) {
        return is_sure;
    }
    return undistorted(plane).z > 0.0;
}
