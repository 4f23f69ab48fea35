// No depth map. Same interface as depth_map.wgsl.

fn write_depth(out: u32, depth: f32) {}

fn write_no_depth(out: u32) {}
