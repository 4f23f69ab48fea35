// Sorts up to sixteen keys in registers by the network of sixty comparators of Green (1969; Knuth,
// The Art of Computer Programming 3, 5.3.4). It has no branches, so pixels with different lists
// sort together. Only depths are compared.
// Host side: src/passes/fragments.rs, whose test proves the network.
// #import fragments::{keys}
// #import fragments_*::{TIES}

// The key at a place; past the end of the list, one that sorts behind all others.
fn key_or_last(first: u32, end: u32, place: u32) -> vec2<u32> {
    var key = vec2<u32>(0xffffffffu);
    if (first + place < end) {
        key = keys[first + place];
    }
    return key;
}

fn keep_key(first: u32, end: u32, place: u32, key: vec2<u32>) {
    if (first + place < end) {
        keys[first + place] = key;
    }
}

fn ordered(a: vec2<u32>, b: vec2<u32>) -> vec4<u32> {
    return select(vec4<u32>(a, b), vec4<u32>(b, a), b.x < a.x);
}

// Whether two keys of the list have the same depth.
fn are_tied(a: vec2<u32>, b: vec2<u32>) -> bool {
    return a.x == b.x && b.y != 0xffffffffu;
}

// Sorts the keys by depth. Returns whether keys of the same depth have yet to be ordered.
fn sort_sixteen(first: u32, end: u32) -> bool {
    var k0 = key_or_last(first, end, 0u);
    var k1 = key_or_last(first, end, 1u);
    var k2 = key_or_last(first, end, 2u);
    var k3 = key_or_last(first, end, 3u);
    var k4 = key_or_last(first, end, 4u);
    var k5 = key_or_last(first, end, 5u);
    var k6 = key_or_last(first, end, 6u);
    var k7 = key_or_last(first, end, 7u);
    var k8 = key_or_last(first, end, 8u);
    var k9 = key_or_last(first, end, 9u);
    var k10 = key_or_last(first, end, 10u);
    var k11 = key_or_last(first, end, 11u);
    var k12 = key_or_last(first, end, 12u);
    var k13 = key_or_last(first, end, 13u);
    var k14 = key_or_last(first, end, 14u);
    var k15 = key_or_last(first, end, 15u);
    var o: vec4<u32>;
    o = ordered(k0, k1); k0 = o.xy; k1 = o.zw;
    o = ordered(k2, k3); k2 = o.xy; k3 = o.zw;
    o = ordered(k4, k5); k4 = o.xy; k5 = o.zw;
    o = ordered(k6, k7); k6 = o.xy; k7 = o.zw;
    o = ordered(k8, k9); k8 = o.xy; k9 = o.zw;
    o = ordered(k10, k11); k10 = o.xy; k11 = o.zw;
    o = ordered(k12, k13); k12 = o.xy; k13 = o.zw;
    o = ordered(k14, k15); k14 = o.xy; k15 = o.zw;
    o = ordered(k0, k2); k0 = o.xy; k2 = o.zw;
    o = ordered(k4, k6); k4 = o.xy; k6 = o.zw;
    o = ordered(k8, k10); k8 = o.xy; k10 = o.zw;
    o = ordered(k12, k14); k12 = o.xy; k14 = o.zw;
    o = ordered(k1, k3); k1 = o.xy; k3 = o.zw;
    o = ordered(k5, k7); k5 = o.xy; k7 = o.zw;
    o = ordered(k9, k11); k9 = o.xy; k11 = o.zw;
    o = ordered(k13, k15); k13 = o.xy; k15 = o.zw;
    o = ordered(k0, k4); k0 = o.xy; k4 = o.zw;
    o = ordered(k8, k12); k8 = o.xy; k12 = o.zw;
    o = ordered(k1, k5); k1 = o.xy; k5 = o.zw;
    o = ordered(k9, k13); k9 = o.xy; k13 = o.zw;
    o = ordered(k2, k6); k2 = o.xy; k6 = o.zw;
    o = ordered(k10, k14); k10 = o.xy; k14 = o.zw;
    o = ordered(k3, k7); k3 = o.xy; k7 = o.zw;
    o = ordered(k11, k15); k11 = o.xy; k15 = o.zw;
    o = ordered(k0, k8); k0 = o.xy; k8 = o.zw;
    o = ordered(k1, k9); k1 = o.xy; k9 = o.zw;
    o = ordered(k2, k10); k2 = o.xy; k10 = o.zw;
    o = ordered(k3, k11); k3 = o.xy; k11 = o.zw;
    o = ordered(k4, k12); k4 = o.xy; k12 = o.zw;
    o = ordered(k5, k13); k5 = o.xy; k13 = o.zw;
    o = ordered(k6, k14); k6 = o.xy; k14 = o.zw;
    o = ordered(k7, k15); k7 = o.xy; k15 = o.zw;
    o = ordered(k5, k10); k5 = o.xy; k10 = o.zw;
    o = ordered(k6, k9); k6 = o.xy; k9 = o.zw;
    o = ordered(k3, k12); k3 = o.xy; k12 = o.zw;
    o = ordered(k13, k14); k13 = o.xy; k14 = o.zw;
    o = ordered(k4, k8); k4 = o.xy; k8 = o.zw;
    o = ordered(k7, k11); k7 = o.xy; k11 = o.zw;
    o = ordered(k1, k2); k1 = o.xy; k2 = o.zw;
    o = ordered(k1, k4); k1 = o.xy; k4 = o.zw;
    o = ordered(k7, k13); k7 = o.xy; k13 = o.zw;
    o = ordered(k2, k8); k2 = o.xy; k8 = o.zw;
    o = ordered(k11, k14); k11 = o.xy; k14 = o.zw;
    o = ordered(k5, k6); k5 = o.xy; k6 = o.zw;
    o = ordered(k9, k10); k9 = o.xy; k10 = o.zw;
    o = ordered(k2, k4); k2 = o.xy; k4 = o.zw;
    o = ordered(k11, k13); k11 = o.xy; k13 = o.zw;
    o = ordered(k3, k8); k3 = o.xy; k8 = o.zw;
    o = ordered(k7, k12); k7 = o.xy; k12 = o.zw;
    o = ordered(k6, k8); k6 = o.xy; k8 = o.zw;
    o = ordered(k10, k12); k10 = o.xy; k12 = o.zw;
    o = ordered(k3, k5); k3 = o.xy; k5 = o.zw;
    o = ordered(k7, k9); k7 = o.xy; k9 = o.zw;
    o = ordered(k3, k4); k3 = o.xy; k4 = o.zw;
    o = ordered(k5, k6); k5 = o.xy; k6 = o.zw;
    o = ordered(k7, k8); k7 = o.xy; k8 = o.zw;
    o = ordered(k9, k10); k9 = o.xy; k10 = o.zw;
    o = ordered(k11, k12); k11 = o.xy; k12 = o.zw;
    o = ordered(k6, k7); k6 = o.xy; k7 = o.zw;
    o = ordered(k8, k9); k8 = o.xy; k9 = o.zw;
    keep_key(first, end, 0u, k0);
    keep_key(first, end, 1u, k1);
    keep_key(first, end, 2u, k2);
    keep_key(first, end, 3u, k3);
    keep_key(first, end, 4u, k4);
    keep_key(first, end, 5u, k5);
    keep_key(first, end, 6u, k6);
    keep_key(first, end, 7u, k7);
    keep_key(first, end, 8u, k8);
    keep_key(first, end, 9u, k9);
    keep_key(first, end, 10u, k10);
    keep_key(first, end, 11u, k11);
    keep_key(first, end, 12u, k12);
    keep_key(first, end, 13u, k13);
    keep_key(first, end, 14u, k14);
    keep_key(first, end, 15u, k15);
    return TIES
        && (are_tied(k0, k1)
            || are_tied(k1, k2)
            || are_tied(k2, k3)
            || are_tied(k3, k4)
            || are_tied(k4, k5)
            || are_tied(k5, k6)
            || are_tied(k6, k7)
            || are_tied(k7, k8)
            || are_tied(k8, k9)
            || are_tied(k9, k10)
            || are_tied(k10, k11)
            || are_tied(k11, k12)
            || are_tied(k12, k13)
            || are_tied(k13, k14)
            || are_tied(k14, k15));
}
