// A surfel's centre as a camera sees it, in a scene so wide for its disks that an f32 has no room for a centre's last digits:
// two distant clusters, say. These come in a buffer of their own. Twin: Scene::center in src/scene/scene.rs.
// All loops end, by 1 of src/gpu/loops.rs: 0x6d77f8cd2040089e

// World units, three a surfel.
@group(0) @binding(39) var<storage, read> centers_low: array<f32>;

// Relative to the eye, device units. Where leading parts cancel, what is left of them may be less than the trailing ones.
fn relative_center(index: u32, surfel: Surfel) -> array<Double, 3> {
    var relative: array<Double, 3>;
    for (var i = 0u; i < 3u; i++) {
        let d = two_sum(surfel.center[i] * held.unit, -held.eye[i]);
        let low = two_sum(centers_low[3u * index + i] * held.unit, -held.eye_low[i]);
        relative[i] = sum(d, low);
    }
    return relative;
}
