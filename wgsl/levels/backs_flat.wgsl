// All surfels are flat. Same interface as backs_curved.wgsl.

fn lean_of_surfel(record: u32, ray: vec3<f32>, s: vec3<f32>, t: vec3<f32>, distance: f32) -> vec2<f32> {
    return vec2<f32>(0.0);
}
