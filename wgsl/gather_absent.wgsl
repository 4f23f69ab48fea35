// Surfels have nothing beside their shape. Same interface as gather.wgsl.

fn gather_attributes(from_: u32, to: u32) {}
