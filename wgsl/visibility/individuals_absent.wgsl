// All surfels are blended with each other, as one individual. Same interface as individuals.wgsl.
// #import *::{front_at}
// #import resolve_surface::{Surface, surface_of}

fn blended_at(sums_of: u32, pixel: u32, x: u32, y: u32) -> Surface {
    return surface_of(sums_of, front_at(pixel), x, y);
}
