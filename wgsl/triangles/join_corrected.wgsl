// Compares splats and triangles by the depth that the splats blend to. Same interface as
// join_nearest.wgsl.
// #import resolve_surface::{Surface}

fn share_of_splats(splats: Surface, triangle: f32) -> f32 {
    return select(0.0, 1.0, splats.exists && (triangle == 0.0 || splats.depth < triangle));
}
