// Stage 3: at every pixel, the weighted sums over the fragments within epsilon of the nearest depth. One invocation a
// splat, one workgroup a large splat. Each fragment's terms are quantised before they are added, so the sums do not
// depend on the order.
// Twin: src/passes/accumulate.rs.

@group(0) @binding(7) var<storage, read> visible: array<u32>;

// 2^-10: see LEAST_WEIGHT in src/scene/options.rs.
const LEAST_WEIGHT: f32 = 0.0009765625;

struct Attributes {
    color: vec4<f32>,
    normal: vec3<f32>,
    // Device units; 0 where epsilon does not depend on it.
    radius: f32,
}

fn blend(splat: Splat, filter_: Filter, attributes: Attributes, x: u32, y: u32) {
    let fragment = footprint(splat, filter_, x, y);
    if (!fragment.hit) {
        return;
    }
    let pixel = pixel_index(x, y);
    let front = bitcast<f32>(visible[pixel]);
    if (fragment.depth > farthest_accepted(front, attributes.radius)) {
        return;
    }
    let weight = quantise(clamp(fragment.gain * kernel_weight(fragment.rho2), LEAST_WEIGHT, 1.0));
    accumulate_color(pixel, weight, attributes.color);
    accumulate_normal(pixel, weight, attributes.normal);
    accumulate_depth(pixel, weight, fragment.depth, front);
    accumulate_count(pixel);
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
    let attributes = Attributes(color_of(index), normal_of(index, splat), radius_of(index));
    for (var y = pixels.first.y; y <= pixels.last.y; y++) {
        for (var x = pixels.first.x; x <= pixels.last.x; x++) {
            blend(splat, filter_, attributes, x, y);
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
    let attributes = Attributes(color_of(index), normal_of(index, splat), radius_of(index));
    for (var y = pixels.first.y + local.y; y <= pixels.last.y; y += TILE) {
        for (var x = pixels.first.x + local.x; x <= pixels.last.x; x += TILE) {
            blend(splat, filter_, attributes, x, y);
        }
    }
}
