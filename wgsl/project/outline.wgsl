// Polygons instead of disks (paper 001, section 3): the part of the unit disk outside the inscribed
// regular polygon is left out. One corner lies at u = 1, so the polygon is symmetric about v = 0.
// All loops end, by 1 of src/gpu/loops.rs: 0x21ca402a3cfbd5fc
// Same interface as outline_absent.wgsl. Twin: src/scene/outline.rs.
// #import vectors::{dot2}

// The number of sides whose middles have v >= 0.
override OUTLINE_SIDES: u32;
// The cosine and sine of half the central angle of a side. They are the direction of the first
// side's middle, and the cosine is the distance of every side from the centre.
override OUTLINE_COS: f32;
override OUTLINE_SIN: f32;

// Whether a point is outside the polygon. `p` is (u, v, 1) times a positive factor, on a unit disk
// that `turn` has rotated (rows.wgsl).
fn beyond_outline(turn: vec2<f32>, p: vec3<f32>) -> bool {
    let own = vec2<f32>(p.x * turn.x - p.y * turn.y, abs(p.x * turn.y + p.y * turn.x));
    let step = vec2<f32>(OUTLINE_COS * OUTLINE_COS - OUTLINE_SIN * OUTLINE_SIN, 2.0 * OUTLINE_COS * OUTLINE_SIN);
    var middle = vec2<f32>(OUTLINE_COS, OUTLINE_SIN);
    var farthest = 0.0;
    for (var side = 0u; side < OUTLINE_SIDES; side += 1u) {
        farthest = max(farthest, dot2(own, middle));
        middle = vec2<f32>(middle.x * step.x - middle.y * step.y, middle.x * step.y + middle.y * step.x);
    }
    return farthest > OUTLINE_COS * p.z;
}
