// Sums in fixed point: 24 fractional bits a term, two words a sum (low, high) with an exact carry.
// Twin and error bound: src/passes/accumulate.rs.

const SUM_WORDS: u32 = 2u;
// Units of a weight sum.
const ONE: f32 = 16777216.0;

@group(0) @binding(8) var<storage, read_write> sums: array<atomic<u32>>;

// A weight in (0, 1] as fixed point. Never 0: where depth is written, weight is.
fn quantise(weight: f32) -> u32 {
    return max(u32(round(weight * ONE)), 1u);
}

// weight * value for a value in [0, 1]. The weight is an integer of at most 24 bits, so exact as f32.
fn term(weight: u32, value: f32) -> u32 {
    return u32(round(f32(weight) * clamp(value, 0.0, 1.0)));
}

fn add(word: u32, value: u32) {
    let before = atomicAdd(&sums[word], value);
    if (before + value < before) {
        atomicAdd(&sums[word + 1u], 1u);
    }
}

// A sum read back, in units of 2^-24; ratios of two sums have no unit.
fn sum_at(word: u32) -> f32 {
    return f32(atomicLoad(&sums[word + 1u])) * 4294967296.0 + f32(atomicLoad(&sums[word]));
}
