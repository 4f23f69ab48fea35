// The first step of a fisheye: the angle from the axis, radians, in the direction of (X, Y). Depth
// is the distance from the eye, or camera-space z for the FOV model.
// Twin: src/scene/optics.rs.
// #import angle::{angle_of, length_of, turned_by}
// #import camera_lens::{Sight}
// #import distortion::{coefficient, distorted, undistorted}
// #import double::{Double, product, quotient}
// #import layout::{held}
// #import rows::{single}
// #import vectors::{norm2, unit3}

// Whether depth is camera-space z.
fn is_flat() -> bool {
    return held.lens[6].w > 0.0;
}

fn see_plane(p: array<Double, 3>) -> Sight {
    var sight: Sight;
    let wide = coefficient(1u, 3u);
    let x = product(p[0], wide);
    let y = product(p[1], wide);
    let r = length_of(x, y);
    let far = length_of(r, p[2]);
    // Straight ahead, all directions of (X, Y) are alike.
    let is_ahead = r.high <= 1e-12 * far.high && p[2].high > 0.0;
    sight.seen = far.high > 0.0 && (is_ahead || r.high > 0.0) && (p[2].high > 0.0 || !is_flat());
    let away = length_of(length_of(p[0], p[1]), p[2]);
    sight.depth = Double(select(away.high, p[2].high, is_flat()), select(away.low, p[2].low, is_flat()));
    var turned = quotient(single(1.0), far);
    var toward = vec2<f32>(1.0, 0.0);
    if (!is_ahead && r.high > 0.0) {
        turned = quotient(angle_of(r, p[2]), r);
        toward = vec2<f32>(x.high, y.high) / r.high;
    }
    sight.x = product(x, turned);
    sight.y = product(y, turned);
    let depth = sight.depth.high;
    let outward = vec3<f32>(toward * (p[2].high * wide.high), -r.high) * (depth / (far.high * far.high));
    let perp = vec2<f32>(-toward.y, toward.x);
    let around = vec3<f32>(perp * (turned.high * wide.high * depth), 0.0);
    sight.across = outward * toward.x + around * perp.x;
    sight.down = outward * toward.y + around * perp.y;
    sight.axis = select(vec3<f32>(p[0].high, p[1].high, p[2].high) / depth, vec3<f32>(0.0, 0.0, 1.0), is_flat());
    return distorted(sight);
}

// The point of depth 1 on the ray of a point of the plane, camera space.
fn plane_ray(plane: vec2<f32>) -> vec3<f32> {
    let e = undistorted(plane).xy;
    let r = norm2(e);
    let turn = turned_by(r);
    let across = e * (select(1.0, turn.y / r, r > 0.0) / held.lens[1].w);
    let ray = vec3<f32>(across, turn.x);
    return select(unit3(ray), ray / ray.z, is_flat());
}
