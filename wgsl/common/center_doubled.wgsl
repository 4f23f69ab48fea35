// A surfel's centre relative to the eye, in scenes so large, compared with their disks, that f32
// loses visible digits of centres: for example, two distant clusters. The attributes hold the low
// part of each centre. Same interface as center.wgsl. Twin: Scene::center in src/scene/scene.rs.
// All loops end, by 1 of src/gpu/loops.rs: 0x97a1353c8cbc04b6
// #import attributes::{attribute_word}
// #import double::{Double, sum, two_sum}
// #import layout::{Surfel, held}

// The first of the three words of a surfel's attributes that hold the low part of its centre, world
// units.
override LOW_WORD: u32;

// The centre relative to the eye, device units. Where the leading parts cancel, their difference
// may be smaller than the trailing parts, so both are added in doubled precision.
fn relative_center(index: u32, surfel: Surfel) -> array<Double, 3> {
    var relative: array<Double, 3>;
    for (var i = 0u; i < 3u; i++) {
        let d = two_sum(surfel.center[i] * held.unit, -held.eye[i]);
        let low = two_sum(bitcast<f32>(attribute_word(index, LOW_WORD + i)) * held.unit, -held.eye_low[i]);
        relative[i] = sum(d, low);
    }
    return relative;
}
