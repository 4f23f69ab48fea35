// Sorts each pixel's list from front to back, in place; positive depths order as their bits. Up to
// sixteen fragments are sorted by a network (fragments_network.wgsl), and then by insertion if
// fragments of the same depth have yet to be ordered. Longer lists are sorted by heap sort
// (Williams 1964), which is slow for no initial order.
// Host side: src/passes/fragments.rs.
// All loops end, by 1, 5 of src/gpu/loops.rs: 0x52c7ff0d53d03c69
// #import footprint::{band_pixels}
// #import fragments::{keys, list_of}
// #import fragments_*::{precedes}
// #import fragments_network::{sort_sixteen}
// #import layout::{WORKGROUP, hold, linear_index}
// #import long_lists::{is_long}

const FEW: u32 = 16u;

// Insertion sort, for the little that is left to do after the network.
fn sort_few(first: u32, end: u32) {
    for (var k = first + 1u; k < end; k++) {
        let own = keys[k];
        var at = k;
        while (at > first && precedes(own, keys[at - 1u])) {
            keys[at] = keys[at - 1u];
            at--;
        }
        keys[at] = own;
    }
}

// Restores the heap of `count` keys that starts at `first`: moves the key at `top` down, below the
// keys that come after it in the order.
fn sink(first: u32, count: u32, top: u32) {
    let own = keys[first + top];
    var at = top;
    while (2u * at + 1u < count) {
        var child = 2u * at + 1u;
        if (child + 1u < count && precedes(keys[first + child], keys[first + child + 1u])) {
            child++;
        }
        if (!precedes(own, keys[first + child])) {
            break;
        }
        keys[first + at] = keys[first + child];
        at = child;
    }
    keys[first + at] = own;
}

// Swaps the greatest of the `left + 1` keys of a heap with the last one, and removes it from the
// heap.
fn pop(first: u32, left: u32) {
    let last = keys[first + left];
    keys[first + left] = keys[first];
    keys[first] = last;
    sink(first, left, 0u);
}

// All invocations of a subgroup build their heaps, and then all pop. If some built while others
// popped, they would wait for each other.
fn sort_many(first: u32, end: u32) {
    let count = end - first;
    for (var k = count / 2u; k > 0u; k--) {
        sink(first, count, k - 1u);
    }
    for (var left = count - 1u; left > 0u; left--) {
        pop(first, left);
    }
}

// One invocation per pixel.
@compute @workgroup_size(WORKGROUP)
fn sort_fragments(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    hold();
    let pixel = linear_index(workgroup, workgroups, local);
    if (pixel >= band_pixels()) {
        return;
    }
    let list = list_of(pixel);
    if (is_long(list)) {
        return;
    }
    if (list.y > list.x + FEW) {
        sort_many(list.x, list.y);
    } else if (list.y > list.x + 1u) {
        if (sort_sixteen(list.x, list.y)) {
            sort_few(list.x, list.y);
        }
    }
}
