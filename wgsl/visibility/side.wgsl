// A pixel shows one side of a surface: that of its nearest fragment. Fragments within epsilon
// behind it that show the other side, at an outline or in a thin part, are left out.
// Twin: src/passes/accumulate.rs.
// #import camera_orthographic|perspective::{Fragment}
// #import epsilon_*::{farthest_shown}
// #import fade::{meets_front}

// Whether the last bit of a depth stores the fragment's side, so that the nearest depth tells which
// side is nearest. Set only if surfels have sides and both may be visible.
override SIDES: bool;

const SIDE_BIT: u32 = 1u;

// Stores the side in the last bit of a depth, which moves it by at most one unit in the last place.
// The front has the nearer of two depths that differ in this bit alone.
fn sided(depth: f32, away: bool) -> f32 {
    let bits = (bitcast<u32>(depth) & ~SIDE_BIT) | select(0u, SIDE_BIT, away);
    return select(depth, bitcast<f32>(bits), SIDES);
}

// Whether the fragment at `pixel` belongs to the surface whose nearest depth is `front`.
fn is_shown(fragment: Fragment, front: f32, radius: f32, pixel: vec2<u32>) -> bool {
    let same_side = !SIDES || ((bitcast<u32>(fragment.depth) ^ bitcast<u32>(front)) & SIDE_BIT) == 0u;
    let image = vec2<f32>(pixel) + 0.5;
    return fragment.hit
        && same_side
        && fragment.depth <= farthest_shown(front, radius, image)
        && meets_front(fragment.depth, front, radius, image);
}

// -1 if the back is visible, else 1.
fn side_of(front: f32) -> f32 {
    return select(1.0, -1.0, SIDES && (bitcast<u32>(front) & SIDE_BIT) != 0u);
}
