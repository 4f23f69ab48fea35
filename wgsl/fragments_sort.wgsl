// Sorts each pixel's list from front to back, in place: positive depths order as their bits. Up to sixteen are sorted by a network
// (fragments_network.wgsl), and by insertion where those of one depth have an order; more by a heap (Williams 1964), whose time does not
// depend on how they lie.
// Host side: src/passes/fragments.rs.
// All loops end, by 1, 5 of src/gpu/loops.rs: 0x52c7ff0d53d03c69

const FEW: u32 = 16u;

// What little is left to do after the network.

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

// Lets the key at `top` of the heap of `count` keys from `first` on sink below those that follow it.
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

// The greatest of the `left + 1` keys of a heap changes places with the last and leaves it.
fn pop(first: u32, left: u32) {
    let last = keys[first + left];
    keys[first + left] = keys[first];
    keys[first] = last;
    sink(first, left, 0u);
}

// All build, then all pop: invocations of a subgroup that did either would wait for one another.
fn sort_many(first: u32, end: u32) {
    let count = end - first;
    for (var k = count / 2u; k > 0u; k--) {
        sink(first, count, k - 1u);
    }
    for (var left = count - 1u; left > 0u; left--) {
        pop(first, left);
    }
}

// One invocation a pixel.
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
