// No triangles: only splats show. Same interface as join.wgsl.
// #import resolve_surface::{Surface}

fn joined(splats: Surface, pixel: u32, x: u32, row: u32) -> Surface {
    return splats;
}
