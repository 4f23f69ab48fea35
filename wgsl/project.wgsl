// Stage 1: every surfel becomes a splat, once. One invocation a surfel. Twin: src/passes/project.rs.

@group(0) @binding(2) var<storage, read> surfels: array<Surfel>;
@group(0) @binding(3) var<storage, read_write> splats: array<Splat>;
@group(0) @binding(4) var<storage, read_write> drawn: atomic<u32>;

var<workgroup> group_drawn: atomic<u32>;

fn project_surfel(index: u32) -> bool {
    let surfel = surfels[index];
    var relative: array<Double, 3>;
    for (var i = 0u; i < 3u; i++) {
        let d = two_sum(surfel.center[i] * view.unit, -view.eye[i]);
        relative[i] = quick_two_sum(d.high, d.low - view.eye_low[i]);
    }
    // Half-axes need no more than f32; the centre decides where the splat lies to a millionth of its own size.
    let s_world = vec3<f32>(surfel.s[0], surfel.s[1], surfel.s[2]) * view.unit;
    let t_world = vec3<f32>(surfel.t[0], surfel.t[1], surfel.t[2]) * view.unit;
    var center: array<Double, 3>;
    var s: vec3<f32>;
    var t: vec3<f32>;
    for (var row = 0u; row < 3u; row++) {
        let high = view.rotation[row];
        let low = view.rotation_low[row];
        center[row] = sum(
            sum(product(Double(high.x, low.x), relative[0]), product(Double(high.y, low.y), relative[1])),
            product(Double(high.z, low.z), relative[2]),
        );
        s[row] = dot(high.xyz, s_world);
        t[row] = dot(high.xyz, t_world);
    }
    let h = homography(center, s, t);

    // Bounds are conservative: the margin covers the rounding of the extent, and `intersect` decides.
    let size = vec2<f32>(f32(view.width), f32(view.height));
    let margin = 0.01 + 1e-5 * (abs(h.low) + abs(h.high));
    let first = max(ceil(h.low - margin - 0.5), vec2<f32>(0.0));
    let last = min(floor(h.high + margin - 0.5), size - 1.0);
    let visible = all(first <= last);

    var splat: Splat;
    splat.bounds_first = 0xffffffffu;
    splat.bounds_last = 0u;
    if (visible) {
        let n = cross(s_world, t_world);
        let unit_normal = normalize(n / max(max(abs(n.x), abs(n.y)), abs(n.z)));
        let normal = select(unit_normal, -unit_normal, h.away > 0.0);
        splat.anchor_x = h.anchor.x;
        splat.anchor_y = h.anchor.y;
        splat.bounds_first = u32(first.x) | (u32(first.y) << 16u);
        splat.bounds_last = u32(last.x) | (u32(last.y) << 16u);
        splat.a = array<f32, 3>(h.a.x, h.a.y, h.a.z);
        splat.b = array<f32, 3>(h.b.x, h.b.y, h.b.z);
        splat.c = array<f32, 3>(h.c.x, h.c.y, h.c.z);
        splat.normal = array<f32, 3>(normal.x, normal.y, normal.z);
    }
    splats[index] = splat;
    return visible;
}

@compute @workgroup_size(WORKGROUP)
fn project(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let index = linear_index(workgroup, workgroups, local);
    if (index < arrayLength(&surfels)) {
        if (project_surfel(index)) {
            atomicAdd(&group_drawn, 1u);
        }
    }
    workgroupBarrier();
    if (local == 0u) {
        atomicAdd(&drawn, atomicLoad(&group_drawn));
    }
}
