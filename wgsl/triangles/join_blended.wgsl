// Splats and triangles that lie within epsilon of each other are blended, the nearer with the
// greater share (after Guennebaud, Barthe and Paulin 2006, who smooth the seam in this way). Same
// interface as join_nearest.wgsl.
// #import epsilon_*::{deepest_accepted}
// #import resolve_surface::{Surface}

fn share_of_splats(splats: Surface, triangle: f32) -> f32 {
    let epsilon = deepest_accepted(splats.front) - splats.front;
    let share = clamp(0.5 + (triangle - splats.depth) / (2.0 * epsilon), 0.0, 1.0);
    return select(0.0, select(share, 1.0, triangle == 0.0), splats.exists);
}
