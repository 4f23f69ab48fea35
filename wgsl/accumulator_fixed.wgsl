// Sums of terms.wgsl in fixed point: a term fills a word, a sum has two (low, high) with an exact carry.
// Error bound: src/passes/accumulate.rs.
// All loops end, by 3 of src/gpu/loops.rs: 0xeda3c87029d68b8f

override CHANNELS: u32;

@group(0) @binding(8) var<storage, read_write> sums: array<atomic<u32>>;

// The channels whose low words wrapped under the fragment in work.
var<private> carries: u32;

fn add(pixel: u32, channel: u32, value: Term) {
    let before = atomicAdd(&sums[2u * (pixel * CHANNELS + channel)], value);
    carries |= select(0u, 1u << channel, before + value < before);
}

// After a fragment's terms: carries are rare, so one loop over all channels is less work than a branch for each.
fn settle(pixel: u32) {
    while (carries != 0u) {
        let channel = firstTrailingBit(carries);
        atomicAdd(&sums[2u * (pixel * CHANNELS + channel) + 1u], 1u);
        carries &= carries - 1u;
    }
}

// Two sums that are neighbours; the first is an even channel.
fn add_pair(pixel: u32, channel: u32, first: Term, second: Term) {
    add(pixel, channel, first);
    add(pixel, channel + 1u, second);
}

fn show(pixel: u32) {}

// A sum read back, in the units of the terms; ratios of two sums have no unit.
fn sum_at(pixel: u32, channel: u32) -> f32 {
    let word = 2u * (pixel * CHANNELS + channel);
    return f32(atomicLoad(&sums[word + 1u])) * 4294967296.0 + f32(atomicLoad(&sums[word]));
}

fn weight_at(pixel: u32) -> f32 {
    return sum_at(pixel, WEIGHT_CHANNEL) / ONE;
}
