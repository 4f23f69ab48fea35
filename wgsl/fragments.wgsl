// Stage 3 where surfaces show through each other: each pixel's fragments become a list. Their numbers, which the visibility pass left,
// become where lists start, by a scan over rows and one over the pixels of each; then every fragment takes a place in its pixel's list.
// Host side and twin: src/passes/fragments.rs.
// All loops end, by 1, 2 of src/gpu/loops.rs: 0x889697132acab64f

// How many fragments there are and how many at most at a pixel; where the lists of each row start and where the last one ends; then the
// same of each pixel. Past what a word holds all three stay at its end.
@group(0) @binding(44) var<storage, read_write> list_starts: array<u32>;
@group(0) @binding(45) var<storage, read> starts: array<u32>;

const STARTS_HEAD: u32 = 2u;
const MOST_FRAGMENTS: u32 = 0xffffffffu;

fn pixels_start() -> u32 {
    return STARTS_HEAD + held_band.rows + 1u;
}

fn sum_or_most(a: u32, b: u32) -> u32 {
    return select(a + b, MOST_FRAGMENTS, a + b < a);
}

// Counts the fragments of a row. One invocation a row.
@compute @workgroup_size(WORKGROUP)
fn fragments_of_rows(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    hold();
    let row = linear_index(workgroup, workgroups, local);
    if (row >= held_band.rows) {
        return;
    }
    var total = 0u;
    var most = 0u;
    for (var x = 0u; x < held.width; x++) {
        let count = visible_count(row * held.width + x);
        total = sum_or_most(total, count);
        most = max(most, count);
    }
    list_starts[STARTS_HEAD + row] = total;
    // Until start_pixels writes it, the first word of a row's pixels has the row's most.
    list_starts[pixels_start() + row * held.width] = most;
}

// Counts of rows become starts.
@compute @workgroup_size(1)
fn start_rows() {
    hold();
    var total = 0u;
    var most = 0u;
    for (var row = 0u; row < held_band.rows; row++) {
        let count = list_starts[STARTS_HEAD + row];
        list_starts[STARTS_HEAD + row] = total;
        total = sum_or_most(total, count);
        most = max(most, list_starts[pixels_start() + row * held.width]);
    }
    list_starts[STARTS_HEAD + held_band.rows] = total;
    list_starts[pixels_start() + band_pixels()] = total;
    list_starts[0] = total;
    list_starts[1] = most;
}

@compute @workgroup_size(WORKGROUP)
fn start_pixels(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    hold();
    let row = linear_index(workgroup, workgroups, local);
    if (row >= held_band.rows) {
        return;
    }
    var start = list_starts[STARTS_HEAD + row];
    for (var x = 0u; x < held.width; x++) {
        let pixel = row * held.width + x;
        list_starts[pixels_start() + pixel] = start;
        start = sum_or_most(start, visible_count(pixel));
    }
}

// How many of a pixel's fragments have no place yet.
fn visible_count(pixel: u32) -> u32 {
    return atomicLoad(&nearest[pixel]);
}

// The depth of each fragment, and where its record is.
@group(0) @binding(46) var<storage, read_write> keys: array<vec2<u32>>;
@group(0) @binding(47) var<storage, read_write> fragments: array<u32>;

// A record's words: the weight, and where the others are (FragmentLayout in src/plan/fragment.rs).
override FRAGMENT_WORDS: u32;
override FRAGMENT_COLOR: u32;
override FRAGMENT_COLORS: u32;
override FRAGMENT_NORMAL: u32;
override FRAGMENT_RADIUS: u32;

// Those of a surfel, which are the same at every pixel.
fn list_fragment(splat: Splat, filter_: Filter, surfel: u32, attributes: Attributes, x: u32, y: u32) {
    let fragment = footprint(splat, filter_, x, y);
    if (!fragment.hit) {
        return;
    }
    let pixel = pixel_index(x, y);
    // Counted down from as many as there are; if two kernels differ about a rim, what has no place is left out.
    let left = atomicSub(&nearest[pixel], 1u);
    let at = starts[pixels_start() + pixel] + (left - 1u);
    if (left > starts[pixels_start() + pixel + 1u] - starts[pixels_start() + pixel] || left == 0u) {
        return;
    }
    keys[at] = vec2<u32>(bitcast<u32>(fragment.depth), at);
    let first = at * FRAGMENT_WORDS;
    fragments[first] = bitcast<u32>(fragment_weight(fragment));
    write_rank(first, surfel);
    for (var k = 0u; k < FRAGMENT_COLORS; k++) {
        fragments[first + FRAGMENT_COLOR + k] = bitcast<u32>(attributes.color[k]);
    }
    if (FRAGMENT_RADIUS > FRAGMENT_NORMAL) {
        let normal = normal_at(attributes, fragment.spot);
        for (var k = 0u; k < 3u; k++) {
            fragments[first + FRAGMENT_NORMAL + k] = bitcast<u32>(normal[k]);
        }
    }
    if (FRAGMENT_WORDS > FRAGMENT_RADIUS) {
        fragments[first + FRAGMENT_RADIUS] = bitcast<u32>(attributes.radius);
    }
}

// The fragments of one invocation: the splat's pixels from `offset` on in steps of `step`.
fn list_splat(slot: u32, splat: Splat, record: SplatRecord, offset: vec2<u32>, step: u32) {
    let filter_ = filter_in(record);
    let surfel = surfel_in(record, slot);
    let attributes = attributes_of(surfel, splat);
    let pixels = reach(splat);
    for (var y = pixels.first.y + offset.y; y <= pixels.last.y; y += step) {
        for (var x = pixels.first.x + offset.x; x <= pixels.last.x; x += step) {
            list_fragment(splat, filter_, surfel, attributes, x, y);
        }
    }
}

@compute @workgroup_size(WORKGROUP)
fn list_fragments(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    hold();
    let slot = slot_of(workgroup, workgroups, local);
    if (slot < arrayLength(&projected)) {
        let record = projected[slot];
        let splat = splat_of(record);
        if (!is_large(splat)) {
            list_splat(slot, splat, record, vec2<u32>(0u), 1u);
        }
    }
}

@compute @workgroup_size(TILE, TILE)
fn list_fragments_large(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_id) local: vec3<u32>,
) {
    hold();
    let slot = large_splat(workgroup.y * workgroups.x + workgroup.x);
    if (slot < arrayLength(&projected)) {
        let record = projected[slot];
        list_splat(slot, splat_of(record), record, local.xy, TILE);
    }
}

// Where a pixel's list starts and ends.
fn list_of(pixel: u32) -> vec2<u32> {
    let list = vec2<u32>(starts[pixels_start() + pixel], starts[pixels_start() + pixel + 1u]);
    // What found no fragment is before the others.
    return vec2<u32>(list.x + visible[pixel], list.y);
}

fn listed_number(record: u32, word: u32) -> f32 {
    return bitcast<f32>(fragments[record * FRAGMENT_WORDS + word]);
}

fn listed_weight(record: u32) -> f32 {
    return listed_number(record, 0u);
}

fn listed_color(record: u32) -> vec4<f32> {
    var color = vec4<f32>(0.0);
    for (var k = 0u; k < FRAGMENT_COLORS; k++) {
        color[k] = listed_number(record, FRAGMENT_COLOR + k);
    }
    return color;
}

// Mapped to [0, 1].
fn listed_normal(record: u32) -> vec3<f32> {
    var normal = vec3<f32>(0.0);
    if (FRAGMENT_RADIUS > FRAGMENT_NORMAL) {
        for (var k = 0u; k < 3u; k++) {
            normal[k] = listed_number(record, FRAGMENT_NORMAL + k);
        }
    }
    return normal;
}

fn listed_radius(record: u32) -> f32 {
    var radius = 0.0;
    if (FRAGMENT_WORDS > FRAGMENT_RADIUS) {
        radius = listed_number(record, FRAGMENT_RADIUS);
    }
    return radius;
}
