// Stage 3: at every pixel, the weighted sums over the fragments within epsilon of the nearest depth. One invocation a
// splat, one workgroup a large splat. Each fragment's terms are quantised before they are added, so the sums do not
// depend on the order.
// Twin: src/passes/accumulate.rs.

@group(0) @binding(7) var<storage, read> visible: array<u32>;

// Words of a pixel's sums; each attribute knows where in them its own begin.
override PIXEL_WORDS: u32;
const WEIGHT_WORD: u32 = 0u;

struct Attributes {
    color: vec4<f32>,
    normal: vec3<f32>,
}

fn blend(splat: Splat, attributes: Attributes, x: u32, y: u32) {
    let fragment = footprint(splat, x, y);
    if (!fragment.hit) {
        return;
    }
    let pixel = pixel_index(x, y);
    let front = bitcast<f32>(visible[pixel]);
    let back = farthest_accepted(front);
    if (fragment.depth > back) {
        return;
    }
    let word = pixel * PIXEL_WORDS;
    let weight = quantise(kernel_weight(fragment.rho2));
    add(word + WEIGHT_WORD, weight);
    accumulate_color(word, weight, attributes.color);
    accumulate_normal(word, weight, attributes.normal);
    accumulate_depth(word, weight, fragment.depth, front, back);
    accumulate_count(word);
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
    let attributes = Attributes(color_of(index), normal_of(index, splat));
    for (var y = pixels.first.y; y <= pixels.last.y; y++) {
        for (var x = pixels.first.x; x <= pixels.last.x; x++) {
            blend(splat, attributes, x, y);
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
    let attributes = Attributes(color_of(index), normal_of(index, splat));
    for (var y = pixels.first.y + local.y; y <= pixels.last.y; y += TILE) {
        for (var x = pixels.first.x + local.x; x <= pixels.last.x; x += TILE) {
            blend(splat, attributes, x, y);
        }
    }
}
