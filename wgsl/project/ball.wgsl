// Bounding balls of surfels as the camera sees them: of batches (cull.wgsl) and of tree nodes
// (select.wgsl). Twin: src/passes/cull.rs.
// #import axes_*::{growth}
// #import layout::{held}
// #import project::{rotate_plain}

// How far a low-pass may reach past its disk, pixels.
override FILTER_REACH: f32;

struct Ball {
    // Camera space, device units.
    center: vec3<f32>,
    radius: f32,
    // The range of depths of the fragments in the ball.
    nearest: f32,
    farthest: f32,
}

// The ball with a centre relative to the eye, in world axes, and a radius; device units.
fn ball_at(relative: vec3<f32>, radius: f32) -> Ball {
    var b: Ball;
    b.center = rotate_plain(relative);
    b.radius = radius + growth(b.center.z + radius);
    b.nearest = b.center.z - b.radius;
    b.farthest = b.center.z + b.radius;
    return b;
}

// Whether the ball reaches the near depth, so that its image has no useful bounds.
fn reaches_near(ball: Ball) -> bool {
    return !(ball.nearest > held.near);
}
