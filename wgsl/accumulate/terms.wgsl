// The terms of the accumulator `fixed`, one word each. Same interface as terms_wide.wgsl.
// Error bound: src/passes/accumulate.rs.
// #import layout::{FIXED_ONE}

alias Term = u32;
const COUNT_ONE: Term = 1u;

// The value of a weight of 1, in units of the sums.
const ONE: f32 = FIXED_ONE;

fn quantise(weight: f32) -> Term {
    return u32(round(weight * ONE));
}

// The weight that a term stands for.
fn part_of(weight: Term) -> f32 {
    return f32(weight) / ONE;
}

// The low and high word of a term.
fn term_words(value: Term) -> vec2<u32> {
    return vec2<u32>(value, 0u);
}

// weight * value, for a value in [0, 1]. The weight came from an f32, so it has at most 24
// significant bits and converts back exactly.
fn term(weight: Term, value: f32) -> Term {
    return u32(round(f32(weight) * clamp(value, 0.0, 1.0)));
}
