// Stage 3: at every pixel, the weighted sums over the fragments within epsilon of the nearest depth. One invocation a
// splat, one workgroup a large splat. Each fragment's terms are quantised before they are added, so the sums do not
// depend on the order.
// Twin: src/passes/accumulate.rs.

@group(0) @binding(7) var<storage, read> visible: array<u32>;

fn front_at(pixel: u32) -> f32 {
    return bitcast<f32>(visible[pixel]);
}

fn add_fragment(splat: Splat, filter_: Filter, attributes: Attributes, x: u32, y: u32) {
    let fragment = footprint(splat, filter_, x, y);
    if (!fragment.hit) {
        return;
    }
    let pixel = pixel_index(x, y);
    let front = front_at(pixel);
    if (fragment.depth > farthest_accepted(front, attributes.radius)) {
        return;
    }
    blend(pixel, fragment, front, attributes);
}

@compute @workgroup_size(WORKGROUP)
fn accumulate(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let index = linear_index(workgroup, workgroups, local);
    if (index >= arrayLength(&projected)) {
        return;
    }
    let splat = projected[index];
    let pixels = reach(splat);
    if (any(pixels.first > pixels.last) || is_large(splat)) {
        return;
    }
    let filter_ = filter_of(index);
    let attributes = attributes_of(index, splat);
    for (var y = pixels.first.y; y <= pixels.last.y; y++) {
        for (var x = pixels.first.x; x <= pixels.last.x; x++) {
            add_fragment(splat, filter_, attributes, x, y);
        }
    }
}

@compute @workgroup_size(TILE, TILE)
fn accumulate_large(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_id) local: vec3<u32>,
) {
    let index = large_splat(workgroup, workgroups);
    if (index >= arrayLength(&projected)) {
        return;
    }
    let splat = projected[index];
    let pixels = reach(splat);
    let filter_ = filter_of(index);
    let attributes = attributes_of(index, splat);
    for (var y = pixels.first.y + local.y; y <= pixels.last.y; y += TILE) {
        for (var x = pixels.first.x + local.x; x <= pixels.last.x; x += TILE) {
            add_fragment(splat, filter_, attributes, x, y);
        }
    }
}
