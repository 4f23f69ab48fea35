// A surfel's centre as a camera sees it, in a scene so wide for its disks that an f32 has no room for a centre's last digits:
// two distant clusters, say. These come with its attributes. Twin: Scene::center in src/scene/scene.rs.
// All loops end, by 1 of src/gpu/loops.rs: 0x97a1353c8cbc04b6

// The first of three words of a surfel's attributes, world units.
override LOW_WORD: u32;

// Relative to the eye, device units. Where leading parts cancel, what is left of them may be less than the trailing ones.
fn relative_center(index: u32, surfel: Surfel) -> array<Double, 3> {
    var relative: array<Double, 3>;
    for (var i = 0u; i < 3u; i++) {
        let d = two_sum(surfel.center[i] * held.unit, -held.eye[i]);
        let low = two_sum(bitcast<f32>(attribute_word(index, LOW_WORD + i)) * held.unit, -held.eye_low[i]);
        relative[i] = sum(d, low);
    }
    return relative;
}
