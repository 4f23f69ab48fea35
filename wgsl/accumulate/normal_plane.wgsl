// A surfel's normal is that of its disk. Same interface as normal_own.wgsl.
// #import layout::{held}
// #import vectors::{cross3, unit3}
// #import words|words_long::{surfel_at}

// World space, unit length.
fn surfel_normal(index: u32) -> vec3<f32> {
    let surfel = surfel_at(index);
    // In device units, so that no product underflows.
    let s = vec3<f32>(surfel.s[0], surfel.s[1], surfel.s[2]) * held.unit;
    let t = vec3<f32>(surfel.t[0], surfel.t[1], surfel.t[2]) * held.unit;
    let n = cross3(s, t);
    return unit3(n / max(max(abs(n.x), abs(n.y)), abs(n.z)));
}
