// Balls that hold surfels, as the camera sees them: of batches (cull.wgsl) and of nodes (select.wgsl). Twin: src/passes/cull.rs.

// How far a low-pass may reach past its disk, pixels.
override FILTER_REACH: f32;

struct Ball {
    // Camera space, device units.
    center: vec3<f32>,
    radius: f32,
    // Depths of its fragments.
    nearest: f32,
    farthest: f32,
}

// That of a centre and a radius, world units relative to the scene's origin.
fn ball_of(sphere: vec4<f32>) -> Ball {
    let relative = sphere.xyz * held.unit - held.eye.xyz;
    var b: Ball;
    b.center = rotate_plain(relative);
    // Ten roundings of f32 in these lengths.
    b.radius = sphere.w * held.unit + 1e-6 * (length(relative) + length(held.eye.xyz));
    b.radius += growth(b.center.z + b.radius);
    b.nearest = b.center.z - b.radius;
    b.farthest = b.center.z + b.radius;
    return b;
}

// Whether it reaches the near depth, so that its place in the image says nothing.
fn reaches_near(ball: Ball) -> bool {
    return !(ball.nearest > held.near);
}

// Its pixels, as far as they lie in so many rows from `top` on; empty if a first lies past a last.
fn pixels_of_ball(ball: Ball, top: f32, rows: f32) -> Rectangle {
    let extent = ball_extent(ball.center, ball.radius, ball.nearest);
    // A pixel more on each side, as splats' own bounds have a margin, and one for rounding.
    let margin = FILTER_REACH + 2.0 + 1e-5 * (abs(extent.xy) + abs(extent.zw));
    let first = max(extent.xy - margin, vec2<f32>(0.0, top));
    let last = min(extent.zw + margin, vec2<f32>(f32(held.width), top + rows) - 1.0);
    if (!all(first <= last)) {
        return Rectangle(vec2<u32>(1u), vec2<u32>(0u));
    }
    return Rectangle(vec2<u32>(first), vec2<u32>(last));
}
