// Puts a pixel's nearest triangle among the surfaces or fragments of its list, as one surface more.
// Same interface as join_lists_absent.wgsl. Twin: src/passes/join.rs.
// #import join_*::{color_beside}
// #import layout::{held, held_band}
// #import maps::{write_surface}
// #import resolve_lists::{Shown, with_behind}
// #import triangles_tiles::{beside, shows_triangles}

// The depth of no triangle, beyond all fragments.
const NO_TRIANGLE: f32 = 3.4028234e38;

// The depth of the pixel's triangle, device units. It is beyond all fragments if there is none.
fn triangle_depth(x: u32, y: u32) -> f32 {
    let row = y - held_band.first_row;
    var depth = 0.0;
    if (shows_triangles(x, row)) {
        depth = beside[2u * (row * held.width + x) + 1u].w;
    }
    return select(NO_TRIANGLE, depth, depth > 0.0);
}

// Whether a surface at `depth` lies behind the triangle.
fn is_behind_triangle(depth: f32, triangle: f32) -> bool {
    return depth >= triangle;
}

// Whether the pixel has a triangle.
fn has_triangle(triangle: f32) -> bool {
    return triangle < NO_TRIANGLE;
}

// Composites the triangle behind what is shown, and writes the maps of its surface at `out`.
fn with_triangle(shown: Shown, depth: f32, out: u32, x: u32, y: u32) -> Shown {
    let color = color_beside(beside[2u * ((y - held_band.first_row) * held.width + x)]);
    write_surface(out, shown.layers, depth, color.a);
    var behind = with_behind(shown, color);
    behind.tail = shown.tail;
    return behind;
}
