// Splats alone. Same interface as join.wgsl.

fn joined(splats: Surface, pixel: u32, front: f32) -> Surface {
    return splats;
}
