// The border of a whole sphere's image: splats that reach across it are drawn on both sides
// (cull_twice.wgsl). Same interface as around_absent.wgsl.
// Twin: src/passes/project.rs.
// #import layout::{held}
// #import rows::{Homography}
// #import select::{places_held}

// Whether the slot is for the part of a splat beyond the border.
fn is_again(slot: u32) -> bool {
    return slot >= places_held();
}

// Moves the splat of such a slot by the image's width: a splat near the right border is drawn
// beyond the left one, and the other way round.
fn around(h: ptr<function, Homography>, slot: u32) {
    if (!is_again(slot)) {
        return;
    }
    let width = i32(held.width);
    let turn = select(width, -width, 2 * (*h).anchor.x >= width);
    (*h).anchor.x += turn;
    (*h).low.x += f32(turn);
    (*h).high.x += f32(turn);
}
