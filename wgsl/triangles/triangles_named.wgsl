// The nearest triangle of each pixel, from the visibility pass of the compute path. Same interface
// as triangles_raster.wgsl.

// Two words per pixel: the index of the nearest triangle, and its kept depth.
@group(0) @binding(59) var<storage, read> named_triangles: array<u32>;

fn nearest_triangle(pixel: u32, x: u32, y: u32) -> vec2<u32> {
    return vec2<u32>(named_triangles[2u * pixel], named_triangles[2u * pixel + 1u]);
}
