// The terms of the accumulator `fixed` for scenes in which they may be small (SceneNeeds::wide_sums): 40 to 56
// fractional bits (wide_bits in src/plan/accumulator.rs).
// Error bound: src/passes/accumulate.rs.

// Their units as f32: a product is rounded once, as f32 sums would, and no more.
alias Term = f32;
const COUNT_ONE: Term = 1.0;

// The units of a weight of 1, a power of two.
override ONE: f32;

// The weight of its term.
fn part_of(weight: Term) -> f32 {
    return weight / ONE;
}

const WORD: f32 = 4294967296.0;

fn quantise(weight: f32) -> Term {
    return weight * ONE;
}

// A term's low and high word. Exact: both are whole bits of one f32, but for what lies below the unit.
fn term_words(value: Term) -> vec2<u32> {
    let whole = floor(value / WORD);
    return vec2<u32>(u32(value - whole * WORD), u32(whole));
}

fn term(weight: Term, value: f32) -> Term {
    return weight * clamp(value, 0.0, 1.0);
}
