// Finds the nearest triangle of a pixel, depth and index at once, by 64-bit atomics. Same interface
// as triangles_twice.wgsl.

// A cleared word means an empty pixel. As two words, the index comes first.
@group(0) @binding(58) var<storage, read_write> nearest_triangles: array<atomic<u64>>;

fn keep_triangle(pixel: u32, kept: u32, number: u32) {
    let both = (u64(kept) << 32u) | u64(number);
    // A load costs less than an atomic maximum that changes nothing.
    if (both > atomicLoad(&nearest_triangles[pixel])) {
        atomicMax(&nearest_triangles[pixel], both);
    }
}
