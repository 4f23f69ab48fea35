// The whole sphere: longitude and latitude, radians, to the right and down. Depth is the distance
// from the eye. Same interface as lens_fisheye.wgsl.
// Twin: src/scene/optics.rs.
// #import angle::{angle_of, length_of, turned_by}
// #import camera_lens::{Sight}
// #import double::{Double}

fn signed_angle(y: Double, x: Double) -> Double {
    let angle = angle_of(Double(abs(y.high), select(y.low, -y.low, y.high < 0.0)), x);
    return Double(select(angle.high, -angle.high, y.high < 0.0), select(angle.low, -angle.low, y.high < 0.0));
}

fn see_plane(p: array<Double, 3>) -> Sight {
    var sight: Sight;
    let level = length_of(p[0], p[2]);
    sight.seen = level.high > 0.0;
    sight.depth = length_of(level, p[1]);
    sight.x = signed_angle(p[0], p[2]);
    sight.y = signed_angle(p[1], level);
    let depth = sight.depth.high;
    let at = vec3<f32>(p[0].high, p[1].high, p[2].high);
    sight.across = vec3<f32>(at.z, 0.0, -at.x) * (depth / (level.high * level.high));
    sight.down = vec3<f32>(-at.y * (at.x / level.high), level.high, -at.y * (at.z / level.high)) / depth;
    sight.axis = at / depth;
    return sight;
}

// Whether a point of the plane is one of the sphere.
fn shows_plane(plane: vec2<f32>) -> bool {
    return all(abs(plane) <= vec2<f32>(3.1415927, 1.5707964));
}

fn plane_ray(plane: vec2<f32>) -> vec3<f32> {
    let across = turned_by(plane.x);
    let down = turned_by(plane.y);
    return vec3<f32>(across.y * down.x, down.y, across.x * down.x);
}
