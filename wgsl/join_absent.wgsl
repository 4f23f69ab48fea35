// Splats alone. Same interface as join.wgsl.

fn joined(splats: Surface, pixel: u32) -> Surface {
    return splats;
}
