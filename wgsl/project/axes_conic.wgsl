// The half-axes of a 3D Gaussian's image (Kerbl et al. 2023; Zwicker et al. 2001): an ellipse
// parallel to the image, at the depth of the Gaussian's centre. Seen from the eye, it is the image
// of the ellipsoid by the projection's Jacobian there, convolved with a Gaussian of the pixel.
// Same interface as axes_own.wgsl.
// Twin: src/passes/conic.rs.
// #import attributes::{attribute_word}
// #import camera_*::{most_slope, slope_in_view}
// #import camera_orthographic|perspective::{widening}
// #import layout::{Surfel, held}
// #import project::{rotate_plain}
// #import vectors::{cross3, unit3}

struct Axes {
    s: vec3<f32>,
    t: vec3<f32>,
    s_world: vec3<f32>,
    t_world: vec3<f32>,
}

// The word of a surfel's attributes that holds the third half-axis, world units.
override THIRD_WORD: u32;
// The half-axes of the pixel's Gaussian, samples.
override DILATION_ACROSS: f32;
override DILATION_DOWN: f32;

// The half-axes of the pixel's Gaussian at a depth, device units.
fn dilation(depth: f32) -> vec2<f32> {
    return widening(depth) / held.intrinsics.xy * vec2<f32>(DILATION_ACROSS, DILATION_DOWN);
}

fn growth(radius: f32, depth: f32) -> f32 {
    let slope = most_slope();
    let blurred = dilation(max(depth, 0.0));
    let sheared = radius * sqrt(1.0 + slope.x * slope.x + slope.y * slope.y);
    return 1.0001 * (sheared + blurred.x + blurred.y) - radius;
}

fn half_axes(index: u32, surfel: Surfel, center: vec3<f32>) -> Axes {
    let s_own = vec3<f32>(surfel.s[0], surfel.s[1], surfel.s[2]);
    let t_own = vec3<f32>(surfel.t[0], surfel.t[1], surfel.t[2]);
    let third = bitcast<f32>(attribute_word(index, THIRD_WORD)) * held.unit;
    // Squares of half-axes may be too small for an f32.
    let w_world = unit3(cross3(unit3(s_own / greatest(s_own)), unit3(t_own / greatest(t_own)))) * third;
    let s_world = s_own * held.unit;
    let t_world = t_own * held.unit;
    let slope = slope_in_view(center);
    let s = rotate_plain(s_world);
    let t = rotate_plain(t_world);
    let w = rotate_plain(w_world);
    // The covariance is the sum of the squares of these columns and of the pixel's.
    let x = vec3<f32>(s.x - slope.x * s.z, t.x - slope.x * t.z, w.x - slope.x * w.z);
    let y = vec3<f32>(s.y - slope.y * s.z, t.y - slope.y * t.z, w.y - slope.y * w.z);
    let pixel = dilation(center.z);
    let scale = max(max(greatest(x), greatest(y)), max(pixel.x, pixel.y));
    return triangular(x / scale, y / scale, pixel / scale, scale);
}

fn greatest(v: vec3<f32>) -> f32 {
    return max(max(abs(v.x), abs(v.y)), abs(v.z));
}

// The half-axes whose squares add up to the covariance: one of them along y. Its determinant is a
// sum of squares (Cauchy-Binet), so that thin ellipses keep their width.
fn triangular(x: vec3<f32>, y: vec3<f32>, pixel: vec2<f32>, scale: f32) -> Axes {
    let xx = (x.x * x.x + x.y * x.y) + x.z * x.z;
    let yy = (y.x * y.x + y.y * y.y) + y.z * y.z;
    let xy = (x.x * y.x + x.y * y.y) + x.z * y.z;
    let minors = cross3(x, y);
    let across = pixel.x * pixel.x;
    let down = pixel.y * pixel.y;
    let of_minors = (minors.x * minors.x + minors.y * minors.y) + minors.z * minors.z;
    let determinant = of_minors + (yy * across + (xx * down + across * down));
    let width = sqrt(xx + across);
    // In this order s x t faces the viewer.
    let s = vec3<f32>(0.0, sqrt(determinant) / width * scale, 0.0);
    let t = vec3<f32>(width * scale, xy / width * scale, 0.0);
    let right = held.rotation[0].xyz;
    let below = held.rotation[1].xyz;
    return Axes(s, t, below * s.y, right * t.x + below * t.y);
}
