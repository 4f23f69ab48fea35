// Splats are compared with triangles by the depth of their nearest fragment. What part of the pixel the splats have.

fn share_of_splats(splats: Surface, triangle: f32) -> f32 {
    return select(0.0, 1.0, splats.exists && (triangle == 0.0 || splats.front < triangle));
}
