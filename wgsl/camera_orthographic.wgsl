// The orthographic camera x = fx X + cx. Same interface as camera_pinhole.wgsl.
// Twin: src/passes/project.rs and src/passes/footprint.rs.

struct Homography {
    a: vec3<f32>,
    b: vec3<f32>,
    c: vec3<f32>,
    anchor: vec2<i32>,
    low: vec2<f32>,
    high: vec2<f32>,
    away: f32,
}

fn image_of(position: Double, axis: u32) -> Double {
    let focal = Double(view.intrinsics[axis], view.intrinsics_low[axis]);
    let principal = Double(view.intrinsics[axis + 2u], view.intrinsics_low[axis + 2u]);
    return sum(product(focal, position), principal);
}

fn homography(center: array<Double, 3>, s: vec3<f32>, t: vec3<f32>) -> Homography {
    var h: Homography;
    let p_z = center[2].high;
    h.away = s.x * t.y - s.y * t.x;
    h.low = vec2<f32>(1.0);
    h.high = vec2<f32>(0.0);
    let x = image_of(center[0], 0u);
    let y = image_of(center[1], 1u);
    let image = vec2<f32>(x.high, y.high);
    if (p_z + sqrt(s.z * s.z + t.z * t.z) < view.near || h.away == 0.0 || any(abs(image) >= vec2<f32>(4194304.0))) {
        return h;
    }
    let focal = view.intrinsics.xy;
    let pixel = floor(image);
    let offset = (image - pixel) + vec2<f32>(x.low, y.low) - 0.5;
    let a = vec2<f32>(t.y, -t.x) / (h.away * focal);
    let b = vec2<f32>(-s.y, s.x) / (h.away * focal);
    let c = s.z * a + t.z * b;
    h.anchor = vec2<i32>(pixel);
    h.a = vec3<f32>(a, -dot(a, offset));
    h.b = vec3<f32>(b, -dot(b, offset));
    h.c = vec3<f32>(c, p_z - dot(c, offset));
    let extent = focal * sqrt(s.xy * s.xy + t.xy * t.xy);
    h.low = image - extent;
    h.high = image + extent;
    return h;
}

struct Fragment {
    hit: bool,
    depth: f32,
    rho2: f32,
}

fn intersect(abc: vec3<f32>) -> Fragment {
    let rho2 = dot(abc.xy, abc.xy);
    return Fragment(rho2 <= 1.0 && abc.z >= view.near, abc.z, rho2);
}

fn ray(x: u32, y: u32) -> vec3<f32> {
    return view.rotation[2].xyz;
}
