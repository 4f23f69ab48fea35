// No map of the number of layers. Same interface as layers_map.wgsl.

fn write_layers(out: u32, layers: u32) {}
