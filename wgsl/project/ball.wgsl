// Bounding balls in camera space, of batches of surfels (cull.wgsl) and of tree nodes (judge.wgsl).
// Twin: src/passes/cull.rs.
// #import axes_*::{growth}
// #import layout::{held}
// #import project::{rotate_plain}

// How far the low-pass may extend a splat past its disk, pixels.
override FILTER_REACH: f32;

struct Ball {
    // Camera space, device units.
    center: vec3<f32>,
    radius: f32,
    // The least and the greatest depth of fragments in the ball.
    nearest: f32,
    farthest: f32,
}

// The ball in camera space, from a centre relative to the eye (world axes) and a radius; device
// units.
fn ball_at(relative: vec3<f32>, radius: f32) -> Ball {
    var b: Ball;
    b.center = rotate_plain(relative);
    b.radius = radius + growth(radius, b.center.z + radius);
    b.nearest = b.center.z - b.radius;
    b.farthest = b.center.z + b.radius;
    return b;
}

// Whether the ball reaches the near depth, so that its image has no useful bounds.
fn reaches_near(ball: Ball) -> bool {
    return !(ball.nearest > held.near);
}
