// Normals, mapped from [-1, 1] to [0, 1] before they are summed.
// Twin: src/passes/accumulate.rs, src/passes/resolve.rs.

override NORMAL_WORD: u32;

fn normal_of(splat: Splat) -> vec3<f32> {
    return vec3<f32>(splat.normal[0], splat.normal[1], splat.normal[2]) * 0.5 + 0.5;
}

fn accumulate_normal(word: u32, weight: u32, normal: vec3<f32>) {
    for (var k = 0u; k < 3u; k++) {
        add(word + NORMAL_WORD + k * SUM_WORDS, term(weight, normal[k]));
    }
}

// The normalised mean; 0 where opposite normals cancel.
fn resolve_normal(word: u32, weight: f32) -> vec3<f32> {
    var mean: vec3<f32>;
    for (var k = 0u; k < 3u; k++) {
        mean[k] = sum_at(word + NORMAL_WORD + k * SUM_WORDS) / weight * 2.0 - 1.0;
    }
    let length_2 = dot(mean, mean);
    return select(vec3<f32>(0.0), mean * inverseSqrt(length_2), length_2 > 1e-12);
}
