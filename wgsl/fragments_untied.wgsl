// Fragments of one depth may come in any order, as nothing that is made of them shows it. Same interface as fragments_ranked.wgsl.

fn write_rank(first: u32, surfel: u32) {}

fn precedes(a: vec2<u32>, b: vec2<u32>) -> bool {
    return a.x < b.x;
}
