// Compares splats and triangles by the depth of the splats' nearest fragment. share_of_splats() is
// the part of the pixel that the splats have, 0 to 1. Same interface as join_corrected.wgsl.
// #import resolve_surface::{Surface}

fn share_of_splats(splats: Surface, triangle: f32) -> f32 {
    return select(0.0, 1.0, splats.exists && (triangle == 0.0 || splats.front < triangle));
}
