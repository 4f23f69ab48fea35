// The terms of the accumulator `fixed` for scenes in which terms may be small
// (SceneNeeds::wide_sums): 40 to 56 fractional bits (wide_bits in src/plan/accumulator.rs). Same
// interface as terms.wgsl.
// Error bound: src/passes/accumulate.rs.

// A term in units of the sums, as f32: a product is rounded only once, like the terms of f32 sums.
alias Term = f32;
const COUNT_ONE: Term = 1.0;

// The value of a weight of 1, in units of the sums: a power of two.
override ONE: f32;

// The weight that a term stands for.
fn part_of(weight: Term) -> f32 {
    return weight / ONE;
}

const WORD: f32 = 4294967296.0;

fn quantise(weight: f32) -> Term {
    return weight * ONE;
}

// The low and high word of a term. Both are exact, as consecutive bits of one f32, except for what
// lies below one unit.
fn term_words(value: Term) -> vec2<u32> {
    let whole = floor(value / WORD);
    return vec2<u32>(u32(value - whole * WORD), u32(whole));
}

fn term(weight: Term, value: f32) -> Term {
    return weight * clamp(value, 0.0, 1.0);
}
