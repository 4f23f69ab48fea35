// Stage 3: at every pixel, the weighted sums over the fragments within epsilon of the nearest depth. One invocation a
// splat. Each fragment's terms are quantised before they are added, so the sums do not depend on the order.
// Twin: src/passes/accumulate.rs.

@group(0) @binding(7) var<storage, read> visible: array<u32>;

// Words of a pixel's sums; each attribute knows where in them its own begin.
override PIXEL_WORDS: u32;
const WEIGHT_WORD: u32 = 0u;

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
    if (any(pixels.first > pixels.last)) {
        return;
    }
    let color = color_of(index);
    let normal = normal_of(index, splat);
    for (var y = pixels.first.y; y <= pixels.last.y; y++) {
        for (var x = pixels.first.x; x <= pixels.last.x; x++) {
            let fragment = footprint(splat, x, y);
            if (fragment.hit) {
                let pixel = pixel_index(x, y);
                let front = bitcast<f32>(visible[pixel]);
                let back = farthest_accepted(front);
                if (fragment.depth <= back) {
                    let word = pixel * PIXEL_WORDS;
                    let weight = quantise(kernel_weight(fragment.rho2));
                    add(word + WEIGHT_WORD, weight);
                    accumulate_color(word, weight, color);
                    accumulate_normal(word, weight, normal);
                    accumulate_depth(word, weight, fragment.depth, front, back);
                    accumulate_count(word);
                }
            }
        }
    }
}
