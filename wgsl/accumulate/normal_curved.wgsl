// The normals of caps, which change along the surfel. Same interface as normal_flat.wgsl.
// Twin: src/passes/splat.rs.
// #import blend|winner::{Attributes}
// #import curved::{inverse_of, world_heights}
// #import curved|facing|flat::{Bend, Spot}
// #import layout::{Splat, held}
// #import normal::{TURNS}
// #import normal_*::{surfel_normal}
// #import vectors::{dot3, norm3}
// #import words|words_long::{surfel_at}

// The normal at the centre, world space, unit length.
fn normal_of(index: u32, splat: Splat) -> vec3<f32> {
    return surfel_normal(index);
}

// The change of the normal per unit of u and of v: minus the gradient of the height, world space.
fn bend_of(index: u32) -> Bend {
    let surfel = surfel_at(index);
    let s = vec3<f32>(surfel.s[0], surfel.s[1], surfel.s[2]) * held.unit;
    let t = vec3<f32>(surfel.t[0], surfel.t[1], surfel.t[2]) * held.unit;
    let r = max(norm3(s), norm3(t));
    let m = inverse_of(s / r, t / r);
    let heights = world_heights(index) * (held.unit / r);
    return Bend(-(m[0] * heights.x + m[1] * heights.y), -(m[0] * heights.y + m[1] * heights.z));
}

// The normal at a fragment: unit length, turned toward the viewer, mapped to [0, 1].
fn normal_at(attributes: Attributes, spot: Spot) -> vec3<f32> {
    let n = attributes.normal + attributes.bend.u * spot.uv.x + attributes.bend.v * spot.uv.y;
    let unit_normal = n * inverseSqrt(max(dot3(n, n), 1e-12));
    return select(unit_normal, -unit_normal, TURNS && spot.away) * 0.5 + 0.5;
}
