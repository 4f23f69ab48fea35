// The first step of a distorted perspective: (X/Z, Y/Z). Depth is camera-space z.
// Twin: src/scene/optics.rs.
// #import camera_lens::{Sight}
// #import distortion::{distorted, undistorted}
// #import double::{Double, quotient}

fn see_plane(p: array<Double, 3>) -> Sight {
    var sight: Sight;
    sight.seen = p[2].high > 0.0;
    sight.depth = p[2];
    sight.x = quotient(p[0], p[2]);
    sight.y = quotient(p[1], p[2]);
    sight.across = vec3<f32>(1.0, 0.0, -sight.x.high);
    sight.down = vec3<f32>(0.0, 1.0, -sight.y.high);
    sight.axis = vec3<f32>(0.0, 0.0, 1.0);
    return distorted(sight);
}

// The point of depth 1 on the ray of a point of the plane, camera space.
fn plane_ray(plane: vec2<f32>) -> vec3<f32> {
    return vec3<f32>(undistorted(plane).xy, 1.0);
}
