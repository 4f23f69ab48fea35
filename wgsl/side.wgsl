// A pixel shows one side of a surface: that of its nearest fragment. What lies within epsilon behind it and faces the other way, at
// an outline or in a thin part, is left out.
// Twin: src/passes/accumulate.rs.

// The last bit of a depth says on which side it is, so that the nearest depth says which side is nearest. Only where surfels have
// sides, and both may be seen.
override SIDES: bool;

const SIDE_BIT: u32 = 1u;

// Off by one unit in the last place at most. Of two depths that differ in this bit alone, the front's is nearer.
fn sided(depth: f32, away: bool) -> f32 {
    let bits = (bitcast<u32>(depth) & ~SIDE_BIT) | select(0u, SIDE_BIT, away);
    return select(depth, bitcast<f32>(bits), SIDES);
}

// Whether the fragment at `pixel` belongs to the surface whose nearest depth is `front`.
fn is_shown(fragment: Fragment, front: f32, radius: f32, pixel: vec2<u32>) -> bool {
    let same_side = !SIDES || ((bitcast<u32>(fragment.depth) ^ bitcast<u32>(front)) & SIDE_BIT) == 0u;
    let image = vec2<f32>(pixel) + 0.5;
    return fragment.hit
        && same_side
        && fragment.depth <= farthest_shown(front, radius, image)
        && meets_front(fragment.depth, front, radius, image);
}

// -1 where a back is seen.
fn side_of(front: f32) -> f32 {
    return select(1.0, -1.0, SIDES && (bitcast<u32>(front) & SIDE_BIT) != 0u);
}
