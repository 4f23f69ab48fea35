// The normals of disks: each surfel has one. Same interface as normal_curved.wgsl.
// #import blend|winner::{Attributes}
// #import curved|facing|flat::{Bend, Spot}
// #import layout::{AWAY, Splat}
// #import normal::{TURNS}
// #import normal_*::{surfel_normal}

// World space, unit length, turned toward the viewer, mapped to [0, 1].
fn normal_of(index: u32, splat: Splat) -> vec3<f32> {
    let unit_normal = surfel_normal(index);
    let turned = TURNS && (splat.bounds_last & AWAY) != 0u;
    return select(unit_normal, -unit_normal, turned) * 0.5 + 0.5;
}

fn bend_of(index: u32) -> Bend {
    return Bend(0u);
}

fn normal_at(attributes: Attributes, spot: Spot) -> vec3<f32> {
    return attributes.normal;
}
