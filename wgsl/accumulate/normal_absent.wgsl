// #import *::{Term}
// #import blend|winner::{Attributes}
// #import curved|facing|flat::{Bend, Spot}
// #import layout::{Splat}

fn normal_of(index: u32, splat: Splat) -> vec3<f32> {
    return vec3<f32>(0.0);
}

fn bend_of(index: u32) -> Bend {
    var none: Bend;
    return none;
}

fn normal_at(attributes: Attributes, spot: Spot) -> vec3<f32> {
    return vec3<f32>(0.0);
}

fn accumulate_normal(pixel: u32, weight: Term, normal: vec3<f32>) {}

fn resolve_normal(pixel: u32, weight: f32, front: f32) -> vec3<f32> {
    return vec3<f32>(0.0);
}
