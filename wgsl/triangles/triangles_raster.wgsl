// The visibility pass of triangles by the rasteriser, for comparison: its coverage, its
// interpolated depths and its depth test. The nearest triangle is shaded as in the compute path.
// Same interface as triangles_named.wgsl.
// #import corner_*::{clip_depth, homogeneous_depth}
// #import cutout::{shows}
// #import layout::{held, hold}
// #import triangles::{corner_at, triangle_at, triangles}

// One plus the index of the nearest triangle; 0 where there is none.
@group(0) @binding(69) var drawn_triangles: texture_2d<u32>;

struct DrawnCorner {
    @builtin(position) position: vec4<f32>,
    @location(0) @interpolate(flat) number: u32,
}

@vertex
fn drawn_corner(@builtin(vertex_index) vertex: u32) -> DrawnCorner {
    hold();
    let corner = corner_at(triangles[vertex]);
    let share = homogeneous_depth(corner).high;
    let image = vec2<f32>(corner.x.high, corner.y.high) * share;
    let w = corner.w.high * share;
    let clip = image / vec2<f32>(f32(held.width), f32(held.height)) * vec2<f32>(2.0, -2.0) + vec2<f32>(-w, w);
    return DrawnCorner(vec4<f32>(clip, clip_depth(corner), w), vertex / 3u);
}

@fragment
fn drawn_triangle(corner: DrawnCorner) -> @location(0) u32 {
    let at = floor(corner.position.xy) + 0.5;
    hold();
    if (!shows(triangle_at(corner.number), corner.number, at)) {
        discard;
    }
    return corner.number + 1u;
}

// The nearest triangle of the pixel (x, y), the `pixel`th of the band, and 1 if there is one.
fn nearest_triangle(pixel: u32, x: u32, y: u32) -> vec2<u32> {
    let drawn = textureLoad(drawn_triangles, vec2<u32>(x, y), 0).x;
    return vec2<u32>(drawn - 1u, min(drawn, 1u));
}
