// A large splat that a whole subgroup works on, for software adapters, which would read each word again for every invocation:
// eight invocations read eight words, and hand them around. Subgroups have at least eight, with consecutive
// local indices.

// Those of splat_plain.wgsl, word by word: a Splat has sixteen, a LargeAttributes eight.
@group(0) @binding(34) var<storage, read> large_splat_words: array<u32>;
@group(0) @binding(35) var<storage, read> large_attribute_words: array<u32>;

fn shared_splat(place: u32, local: u32) -> Splat {
    let first = 16u * place;
    let low = large_splat_words[first + (local & 7u)];
    let high = large_splat_words[first + 8u + (local & 7u)];
    var splat: Splat;
    splat.anchor_x = bitcast<i32>(subgroupBroadcast(low, 0u));
    splat.anchor_y = bitcast<i32>(subgroupBroadcast(low, 1u));
    splat.bounds_first = subgroupBroadcast(low, 2u);
    splat.bounds_last = subgroupBroadcast(low, 3u);
    splat.a[0] = bitcast<f32>(subgroupBroadcast(low, 4u));
    splat.a[1] = bitcast<f32>(subgroupBroadcast(low, 5u));
    splat.a[2] = bitcast<f32>(subgroupBroadcast(low, 6u));
    splat.b[0] = bitcast<f32>(subgroupBroadcast(low, 7u));
    splat.b[1] = bitcast<f32>(subgroupBroadcast(high, 0u));
    splat.b[2] = bitcast<f32>(subgroupBroadcast(high, 1u));
    splat.c[0] = bitcast<f32>(subgroupBroadcast(high, 2u));
    splat.c[1] = bitcast<f32>(subgroupBroadcast(high, 3u));
    splat.c[2] = bitcast<f32>(subgroupBroadcast(high, 4u));
    splat.a_low[0] = bitcast<f32>(subgroupBroadcast(high, 5u));
    splat.a_low[1] = bitcast<f32>(subgroupBroadcast(high, 6u));
    splat.a_low[2] = bitcast<f32>(subgroupBroadcast(high, 7u));
    return splat;
}

fn shared_attributes(place: u32, local: u32) -> Attributes {
    let words = bitcast<f32>(large_attribute_words[8u * place + (local & 7u)]);
    var color: vec4<f32>;
    color.x = subgroupBroadcast(words, 0u);
    color.y = subgroupBroadcast(words, 1u);
    color.z = subgroupBroadcast(words, 2u);
    color.w = subgroupBroadcast(words, 3u);
    var normal: vec3<f32>;
    normal.x = subgroupBroadcast(words, 4u);
    normal.y = subgroupBroadcast(words, 5u);
    normal.z = subgroupBroadcast(words, 6u);
    return attributes_without_place(color, normal, subgroupBroadcast(words, 7u));
}

// Whether an invocation wants the splat: then all take it.
fn shared_any(wanted: bool) -> bool {
    return subgroupAny(wanted);
}
