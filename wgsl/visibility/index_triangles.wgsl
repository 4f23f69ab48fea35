// The index map where a triangle shows: a word that is greater than any weight, then the triangle's
// number. Twin: src/passes/index.rs.
// #import footprint::{band_pixels}
// #import index::{index_word, indexed}
// #import layout::{WORKGROUP, held, held_band, hold, linear_index}
// #import maps::{DEPTH_IMAGE}
// #import resolve::{IMAGE_WORDS}
// #import triangles_*::{nearest_triangle}
// #import triangles_tiles::{beside, shows_triangles}

// OF_TRIANGLE in the twin.
const OF_TRIANGLE: u32 = 0xffffffffu;

// One invocation per pixel, before the splats are named.
@compute @workgroup_size(WORKGROUP)
fn index_triangles(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    hold();
    let pixel = linear_index(workgroup, workgroups, local);
    if (pixel >= band_pixels()) {
        return;
    }
    let x = pixel % held.width;
    let row = pixel / held.width;
    if (!shows_triangles(x, row)) {
        return;
    }
    // The image has the depth of the surface that shows, which is the triangle's or another.
    let depth = beside[2u * pixel + 1u].w;
    let shown = bitcast<f32>(atomicLoad(&indexed[pixel * IMAGE_WORDS + DEPTH_IMAGE]));
    if (depth > 0.0 && shown == depth * held.world) {
        let at = index_word(pixel);
        atomicStore(&indexed[at], OF_TRIANGLE);
        atomicStore(&indexed[at + 1u], nearest_triangle(pixel, x, row + held_band.first_row).x);
    }
}
