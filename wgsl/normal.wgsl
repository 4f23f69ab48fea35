// Normals, mapped from [-1, 1] to [0, 1] before they are summed.
// Twin: src/passes/accumulate.rs, src/passes/resolve.rs.
// All loops end, by 1 of src/gpu/loops.rs: 0x0099a1626ba547a0

override NORMAL_CHANNEL: u32;
// Normals have no consistent side, so each is turned toward the viewer before blending.
override TURN_NORMALS: bool;

// World space, unit, mapped to [0, 1].
fn normal_of(index: u32, splat: Splat) -> vec3<f32> {
    let surfel = surfel_at(index);
    // In device units, so that no product underflows.
    let s = vec3<f32>(surfel.s[0], surfel.s[1], surfel.s[2]) * held.unit;
    let t = vec3<f32>(surfel.t[0], surfel.t[1], surfel.t[2]) * held.unit;
    let n = cross(s, t);
    let unit_normal = normalize(n / max(max(abs(n.x), abs(n.y)), abs(n.z)));
    let normal = select(unit_normal, -unit_normal, TURN_NORMALS && (splat.bounds_last & AWAY) != 0u);
    return normal * 0.5 + 0.5;
}

fn accumulate_normal(pixel: u32, weight: Term, normal: vec3<f32>) {
    add_pair(pixel, NORMAL_CHANNEL, term(weight, normal.x), term(weight, normal.y));
    add(pixel, NORMAL_CHANNEL + 2u, term(weight, normal.z));
}

// The normalised mean; 0 where opposite normals cancel.
fn resolve_normal(pixel: u32, weight: f32) -> vec3<f32> {
    var mean: vec3<f32>;
    for (var k = 0u; k < 3u; k++) {
        mean[k] = sum_at(pixel, NORMAL_CHANNEL + k) / weight * 2.0 - 1.0;
    }
    let length_2 = dot(mean, mean);
    return select(vec3<f32>(0.0), mean * inverseSqrt(length_2), length_2 > 1e-12);
}
