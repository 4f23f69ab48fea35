// Stage 0 of scenes with levels of detail: chooses the cut that is drawn in place of all surfels
// (Pajarola 2003, section 5.1, step 1). The branches of the tree are processed one after the other,
// and each branch level by level from its roots down. The nodes that are reached in a level are a
// range of `frontier`. They are judged; each workgroup counts the surfels and nodes that are chosen
// for its nodes, and the children to judge in the next level. Prefix sums of these counts give the
// places where each node writes its results. So the order of the cut, too, depends only on the tree
// and the camera. One workgroup processes all of the first levels, which are small. Pages then draw
// the chosen surfels and nodes from the branch's buffers, without copies. Cuts that fade into each
// other (select_fades.wgsl) are all chosen at once.
// Host side and twin: src/passes/select.rs.
// All loops end, by 1 of src/gpu/loops.rs: 0x25ad9e96dd21fa72
// #import attributes::{attribute_word, attributes}
// #import balls_cut::{drawn_radius, enclose}
// #import judge::{COUNT_MASK, CUTS_MASK, INNER, OTHER_BRANCH, UNSEEN, backs_of, cuts_of, fate_of}
// #import judge::{is_last, kind_of, vector}
// #import layout::{BATCH, Branch, TreeNode, WORKGROUP, hold_view, linear_index, page}
// #import low_part::{low_part}
// #import project::{groups_of, rows_of}
// #import select_fades::{ALL_CUTS, CHOSEN_WORDS, choose, cuts_that_reach, set_cuts_that_reach}
// #import words|words_long::{surfel_at}

@group(0) @binding(72) var<uniform> branch: Branch;
@group(0) @binding(73) var<storage, read> tree_nodes: array<TreeNode>;
// The indices of the reached nodes, level after level, and the fate of each. With fades, a second
// half of `frontier` stores how many cuts reach each node (select_fades.wgsl).
@group(0) @binding(75) var<storage, read_write> frontier: array<u32>;
@group(0) @binding(76) var<storage, read_write> fates: array<u32>;
// Two counts: how many surfels and nodes to draw, and how many children to judge. First for all
// nodes of each workgroup of a level; after select_sum(), the two places where the workgroup starts
// to write. From runs_start() on for each invocation of a level: those of the invocations before it
// in its workgroup.
@group(0) @binding(82) var<storage, read_write> counts_of: array<vec2<u32>>;
// The attributes of this branch; then, from branch.chosen on, the number of chosen surfels and
// nodes, and their indices. Attributes and list share a buffer, because core WebGPU grants a kernel
// only eight storage buffers.
@group(0) @binding(78) var<storage, read_write> chosen: array<u32>;
// For each root of a branch: how many cuts reach it.
@group(0) @binding(79) var<storage, read_write> reached: array<u32>;
// The state of the cut, whose words are named below; `selected` is the same buffer, read-only.
@group(0) @binding(80) var<storage, read_write> selection: array<u32>;
@group(0) @binding(81) var<storage, read> selected: array<u32>;

// The range of `frontier` that is the current level, and that of the next one.
const LEVEL: u32 = 0u;
const LEVEL_END: u32 = 1u;
const NEXT: u32 = 2u;
const NEXT_END: u32 = 3u;
// The grids of select_judge() and select_spread(), with one invocation for JUDGED nodes of the
// level.
const JUDGE_GRID: u32 = 4u;
const SPREAD_GRID: u32 = 7u;

// Surfels per run. drawn_at() shuffles whole runs; a run is a whole number of batches (cull.wgsl).
const RUN: u32 = 512u;

// Nodes that one invocation judges in sequence. Barriers are expensive on a CPU adapter, and one
// costs the same for any number of nodes.
const JUDGED: u32 = 8u;

var<workgroup> counted: array<vec2<u32>, WORKGROUP>;
var<workgroup> eights: array<vec2<u32>, WORKGROUP / 8u>;
var<workgroup> first_end: u32;

// Maps a place of the page to an entry of the list of chosen surfels. Neighbours in a cut are
// neighbours in the image, but surfels that are processed at the same time should not be: their
// atomics would contend (src/passes/order.rs).
fn drawn_at(place: u32) -> u32 {
    let run = place / RUN;
    // A page has fewer than 2^16 runs, so no product exceeds 2^32, and the f32 quotient errs by
    // less than 2^16 * 6 * 2^-24 < 1: the remainder is right, or too small or too large by one
    // multiple of `runs`. CPU adapters divide integers one lane at a time, so this avoids integer
    // division.
    let runs = max(page.runs, 1u);
    let product = run * page.stride;
    let rest = bitcast<i32>(product - u32(f32(product) / f32(runs)) * runs);
    let turn = bitcast<u32>(rest + select(0, i32(runs), rest < 0) - select(0, i32(runs), rest >= i32(runs)));
    // The incomplete last run stays in place.
    return page.first + select(run, turn, run < page.runs) * RUN + place % RUN;
}

fn places_held() -> u32 {
    return page.surfels;
}

// The surfel or node at a place of the page; past the end of the cut, an arbitrary index.
fn surfel_of(place: u32) -> u32 {
    return attributes[page.chosen + 1u + CHOSEN_WORDS * drawn_at(place)];
}

// Whether a place of the page has a surfel of the cut.
fn is_filled(place: u32) -> bool {
    return drawn_at(place) < attributes[page.chosen];
}

// The number of surfels in a batch of the page. Batches are parts of runs, so their entries in the
// list of chosen surfels follow each other.
fn held_in(batch: u32) -> u32 {
    let first = drawn_at(batch * BATCH);
    let cut = attributes[page.chosen];
    return min(min(cut - min(first, cut), BATCH), page.surfels - min(batch * BATCH, page.surfels));
}

// The word of a surfel's attributes that holds its rank.
override NUMBER_WORD: u32;

// The rank of a surfel among all surfels of the tree; nodes have the ranks after them. Only present
// where a render needs it.
fn rank_of(index: u32) -> u32 {
    return attribute_word(index, NUMBER_WORD);
}

// How many surfels and nodes are drawn for a node that `reached_in` cuts reach, and how many
// children it leaves for the next level.
fn left_by(node: TreeNode, fate: u32, reached_in: u32) -> vec2<u32> {
    let cuts = cuts_of(fate);
    if (cuts == UNSEEN) {
        return vec2<u32>(0u);
    }
    let left = (node.below & COUNT_MASK) - countOneBits(backs_of(fate));
    let below = select(0u, left, cuts > 0u && kind_of(node) != OTHER_BRANCH);
    let itself = select(0u, 1u, cuts < reached_in);
    return select(vec2<u32>(itself, below), vec2<u32>(itself + below, 0u), is_last(node, fate));
}

// The sum of the counts of all invocations before this one in the workgroup: within its group of
// eight, plus the groups before. There are only two barriers, because each is expensive on a CPU
// adapter.
fn sum_before(counts: vec2<u32>, local: u32) -> vec2<u32> {
    counted[local] = counts;
    workgroupBarrier();
    if (local < WORKGROUP / 8u) {
        var sum = vec2<u32>(0u);
        for (var k = 8u * local; k < 8u * local + 8u; k++) {
            let own = counted[k];
            counted[k] = sum;
            sum += own;
        }
        eights[local] = sum;
    }
    workgroupBarrier();
    var before = counted[local];
    for (var k = 0u; k < local / 8u; k++) {
        before += eights[k];
    }
    return before;
}

// There is one workgroup for every WORKGROUP invocations.
fn runs_start() -> u32 {
    return (arrayLength(&counts_of) + WORKGROUP) / (WORKGROUP + 1u);
}

// The number of invocations that judge this many nodes.
fn judges_of(nodes: u32) -> u32 {
    return (nodes + JUDGED - 1u) / JUDGED;
}

fn set_grid(at: u32, nodes: u32) {
    let grid = rows_of(groups_of(judges_of(nodes)));
    for (var k = 0u; k < 3u; k++) {
        selection[at + k] = grid[k];
    }
}

// The fate of a node that `reached_in` cuts reach.
fn judged(node: TreeNode, index: u32, reached_in: u32) -> u32 {
    let record = branch.surfels + index;
    let fate = fate_of(node, surfel_at(record), low_part(record));
    return select((fate & ~CUTS_MASK) | min(cuts_of(fate), reached_in), UNSEEN, cuts_of(fate) == UNSEEN);
}

// Judges the nodes of a range of the frontier, and returns the sum of their left_by().
fn judge_run(first: u32, end: u32) -> vec2<u32> {
    var counts = vec2<u32>(0u);
    for (var place = first; place < end; place++) {
        let index = frontier[place];
        let node = tree_nodes[index];
        let cuts = cuts_that_reach(place);
        let fate = judged(node, index, cuts);
        counts += left_by(node, fate, cuts);
        fates[place] = fate;
    }
    return counts;
}

// Writes the surfels and nodes that are chosen for a node into the list, from `start.x` on, and the
// children to judge into the frontier, from `start.y` on. Returns left_by().
fn spread(node: TreeNode, index: u32, fate: u32, reached_in: u32, start: vec2<u32>) -> vec2<u32> {
    let cuts = cuts_of(fate);
    let counts = left_by(node, fate, reached_in);
    var at = start.x;
    if (cuts < reached_in) {
        choose(at, branch.surfels + index, cuts, reached_in);
        at++;
    }
    if (cuts != UNSEEN && kind_of(node) == OTHER_BRANCH) {
        reached[node.first] = cuts;
    }
    let below = node.first + select(0u, branch.surfels, kind_of(node) == INNER);
    let backs = backs_of(fate);
    let drawn = start.x + counts.x - at + select(0u, countOneBits(backs), counts.x > 0u);
    for (var k = 0u; k < drawn; k++) {
        if (((backs >> min(k, 31u)) & 1u) == 0u) {
            choose(at, below + k, 0u, cuts);
            at++;
        }
    }
    for (var k = 0u; k < counts.y; k++) {
        frontier[start.y + k] = node.first + k;
        set_cuts_that_reach(start.y + k, cuts);
    }
    return counts;
}

// Calls spread() for the nodes of a range of the frontier, one after the other, from `start` on.
fn spread_run(first: u32, end: u32, start: vec2<u32>) {
    var at = start;
    var high = vec3<f32>(-1e30);
    var low = vec3<f32>(-1e30);
    for (var place = first; place < end; place++) {
        let index = frontier[place];
        let node = tree_nodes[index];
        let fate = fates[place];
        let counts = spread(node, index, fate, cuts_that_reach(place), at);
        let radius = select(-1e30, drawn_radius(node, fate), counts.x > 0u);
        high = max(high, vector(node.center) + radius);
        low = max(low, radius - vector(node.center));
        at += counts;
    }
    enclose(high, low, start.x, at.x);
}

// Makes the reached roots of a branch its first level, and returns their number.
fn reach_roots() -> u32 {
    var end = 0u;
    for (var root = 0u; root < branch.roots; root++) {
        var cuts = ALL_CUTS;
        if (branch.whole == 0u) {
            cuts = reached[branch.first_root + root];
        }
        if (cuts > 0u) {
            frontier[end] = root;
            set_cuts_that_reach(end, cuts);
            end++;
        }
    }
    return end;
}

// One workgroup: makes the reached roots the first level, and processes the small levels.
@compute @workgroup_size(WORKGROUP)
fn select_top(@builtin(local_invocation_index) local: u32) {
    hold_view();
    if (local == 0u) {
        first_end = reach_roots();
    }
    storageBarrier();
    var first = 0u;
    var start = vec2<u32>(0u, workgroupUniformLoad(&first_end));
    for (var level = 0u; level < branch.small_levels; level++) {
        let end = start.y;
        let own_first = first + local * JUDGED;
        let own_end = min(own_first + JUDGED, end);
        let before = sum_before(judge_run(own_first, own_end), local);
        spread_run(own_first, own_end, start + before);
        first = end;
        for (var k = 0u; k < WORKGROUP / 8u; k++) {
            start += eights[k];
        }
        // After the barriers all invocations see what spread_run() wrote, and all have read the
        // sums.
        storageBarrier();
        workgroupBarrier();
    }
    if (local == 0u) {
        chosen[branch.chosen] = start.x;
        selection[NEXT] = first;
        selection[NEXT_END] = start.y;
        set_grid(JUDGE_GRID, start.y - first);
    }
}

// Judges the next level. One invocation for JUDGED consecutive nodes.
@compute @workgroup_size(WORKGROUP)
fn select_judge(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    hold_view();
    let run = linear_index(workgroup, workgroups, local);
    let first = selected[NEXT] + run * JUDGED;
    let end = min(first + JUDGED, selected[NEXT_END]);
    let counts = judge_run(first, end);
    let before = sum_before(counts, local);
    if (first < end) {
        counts_of[runs_start() + run] = before;
    }
    // A grid may have more workgroups than the level needs.
    if (local == WORKGROUP - 1u && first - (WORKGROUP - 1u) * JUDGED < selected[NEXT_END]) {
        counts_of[workgroup.y * workgroups.x + workgroup.x] = before + counts;
    }
}

// One workgroup: turns the counts of workgroups into the places where they write their surfels and
// children, and moves LEVEL and NEXT on by one level.
@compute @workgroup_size(WORKGROUP)
fn select_sum(@builtin(local_invocation_index) local: u32) {
    let first = selection[NEXT];
    let end = selection[NEXT_END];
    let here = chosen[branch.chosen];
    let groups = groups_of(judges_of(end - first));
    let each = (groups + WORKGROUP - 1u) / WORKGROUP;
    let stop = min((local + 1u) * each, groups);
    var own = vec2<u32>(0u);
    for (var group = local * each; group < stop; group++) {
        own += counts_of[group];
    }
    let before = sum_before(own, local);
    var start = before + vec2<u32>(here, end);
    for (var group = local * each; group < stop; group++) {
        let counts = counts_of[group];
        counts_of[group] = start;
        start += counts;
    }
    // All invocations have read the old words before the barriers above.
    if (local == WORKGROUP - 1u) {
        let all = before + own;
        selection[LEVEL] = first;
        selection[LEVEL_END] = end;
        selection[NEXT] = end;
        selection[NEXT_END] = end + all.y;
        chosen[branch.chosen] = here + all.x;
        set_grid(SPREAD_GRID, end - first);
        set_grid(JUDGE_GRID, all.y);
    }
}

// Calls spread() for the level that was judged. One invocation for JUDGED consecutive nodes.
@compute @workgroup_size(WORKGROUP)
fn select_spread(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    hold_view();
    let run = linear_index(workgroup, workgroups, local);
    let first = selected[LEVEL] + run * JUDGED;
    let end = min(first + JUDGED, selected[LEVEL_END]);
    if (first >= end) {
        return;
    }
    spread_run(first, end, counts_of[workgroup.y * workgroups.x + workgroup.x] + counts_of[runs_start() + run]);
}
