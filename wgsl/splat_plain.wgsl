// A large splat that a whole subgroup works on. Same interface as splat_shared.wgsl.

@group(0) @binding(30) var<storage, read> large_splats: array<Splat>;
@group(0) @binding(33) var<storage, read> large_attributes: array<LargeAttributes>;

fn shared_splat(place: u32, local: u32) -> Splat {
    return large_splats[place];
}

fn shared_attributes(place: u32, local: u32) -> Attributes {
    let own = large_attributes[place];
    let c = own.color;
    let n = own.normal;
    return attributes_without_place(vec4<f32>(c[0], c[1], c[2], c[3]), vec3<f32>(n[0], n[1], n[2]), own.radius);
}

fn shared_any(wanted: bool) -> bool {
    return wanted;
}
