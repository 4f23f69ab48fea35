// A surfel's centre relative to the eye, in scenes where f32 holds all visible digits of centres.
// Same interface as center_doubled.wgsl.
// All loops end, by 1 of src/gpu/loops.rs: 0xc26f8c1eed595583
// #import double::{Double, quick_two_sum, two_sum}
// #import layout::{Surfel, held}

// The centre relative to the eye, device units.
fn relative_center(index: u32, surfel: Surfel) -> array<Double, 3> {
    var relative: array<Double, 3>;
    for (var i = 0u; i < 3u; i++) {
        let d = two_sum(surfel.center[i] * held.unit, -held.eye[i]);
        relative[i] = quick_two_sum(d.high, d.low - held.eye_low[i]);
    }
    return relative;
}
