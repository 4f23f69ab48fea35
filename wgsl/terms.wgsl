// The terms of the accumulator `fixed`: a term fills a word. Error bound: src/passes/accumulate.rs.

alias Term = u32;
const COUNT_ONE: Term = 1u;

// The units of a weight of 1.
const ONE: f32 = FIXED_ONE;

fn quantise(weight: f32) -> Term {
    return u32(round(weight * ONE));
}

// The weight of its term.
fn part_of(weight: Term) -> f32 {
    return f32(weight) / ONE;
}

// A term's low and high word.
fn term_words(value: Term) -> vec2<u32> {
    return vec2<u32>(value, 0u);
}

// weight * value for a value in [0, 1]. The weight came from an f32, so it has at most 24 significant bits and is exact
// as f32.
fn term(weight: Term, value: f32) -> Term {
    return u32(round(f32(weight) * clamp(value, 0.0, 1.0)));
}
