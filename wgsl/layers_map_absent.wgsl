fn write_layers(out: u32, layers: u32) {}
