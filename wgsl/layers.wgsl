// Stage 4: a pixel's fragments are parted into surfaces, each is blended as the nearest one always is, and they are composited.
// Twin: src/passes/layers.rs.
// All loops end, by 1, 6 of src/gpu/loops.rs: 0x1f99a6bf56939312

override MOST_LAYERS: u32;
// What follows the last layer is one more.
override TAIL: bool;

fn depth_at(key: u32) -> f32 {
    return bitcast<f32>(keys[key].x);
}

// 1 for a back.
fn side_at(key: u32) -> u32 {
    return select(0u, keys[key].x & SIDE_BIT, SIDES);
}

// Whether no layer has the fragment yet, of whose side all as deep as `told` are.
fn is_untold(key: u32, told: vec2<f32>) -> bool {
    return depth_at(key) > select(told.x, told.y, side_at(key) == 1u);
}

fn blend_listed(record: Record, key: u32, front: f32) {
    let attributes = attributes_without_place(listed_color(record), vec3<f32>(0.0), no_bend(), 0.0);
    blend_weighted(0u, quantise(listed_weight(record)), depth_at(key), front, listed_normal(record), attributes);
}

fn no_bend() -> Bend {
    var none: Bend;
    return none;
}

// Sums the surface of the list up to `end` whose nearest fragment is at `first`; how far it is told.
fn sum_surface(first: u32, end: u32, image: vec2<f32>) -> f32 {
    let front = depth_at(first);
    let side = side_at(first);
    var farthest = front;
    for (var key = first; key < end; key++) {
        let depth = depth_at(key);
        if (side_at(key) != side) {
            continue;
        }
        // The first is at the front itself.
        if (key != first && depth > farthest) {
            break;
        }
        let record = record_at(keys[key].y);
        let radius = listed_radius(record);
        farthest = max(farthest, farthest_shown(depth, radius, image));
        if (depth <= farthest_shown(front, radius, image)) {
            blend_listed(record, key, front);
        }
    }
    return farthest;
}

// Sums all that no layer has.
fn sum_rest(first: u32, end: u32, told: vec2<f32>) {
    for (var key = first; key < end; key++) {
        if (is_untold(key, told)) {
            blend_listed(record_at(keys[key].y), key, depth_at(first));
        }
    }
}

// The maps of the pixel are at `out`.
fn composite(pixel: u32, out: u32, x: u32, y: u32) -> Shown {
    let list = list_of(pixel);
    let image = vec2<f32>(vec2<u32>(x, y)) + 0.5;
    var shown = shown_nothing();
    var told = vec2<f32>(-1.0);
    var first = list.x;
    var goes_on = first < list.y;
    while (goes_on) {
        clear_sums();
        let is_last = shown.layers >= MOST_LAYERS;
        var front = depth_at(first);
        if (is_last) {
            sum_rest(first, list.y, told);
            // A tail has no side.
            front = bitcast<f32>(bitcast<u32>(front) & ~SIDE_BIT);
        } else {
            let farthest = sum_surface(first, list.y, image);
            told = select(vec2<f32>(farthest, told.y), vec2<f32>(told.x, farthest), side_at(first) == 1u);
        }
        let weight = sum_at(0u, WEIGHT_CHANNEL);
        let normal = resolve_normal(0u, weight, front);
        let color = shaded(resolve_color(0u, weight), normal, x, y);
        if (!is_last) {
            write_surface(out, shown.layers, surface_depth(0u, weight, front), color.a);
        } else {
            write_surface(out, shown.layers, front, color.a);
            write_tail(out, shown.transmittance * color.a);
        }
        shown = with_behind(shown, color);
        while (first < list.y && !is_untold(first, told)) {
            first++;
        }
        let more = first < list.y && shown.transmittance >= LEAST_TRANSMITTANCE;
        goes_on = more && !is_last && (shown.layers < MOST_LAYERS || TAIL);
    }
    return shown;
}
