// Stage 0 of scenes with levels of detail: the cut that is drawn in place of all surfels (Pajarola 2003, section 5.1, step 1), branch by
// branch of the tree, and in each level by level from its roots down. The nodes of a level that are come to are a stretch of `frontier`: they
// are judged, what they leave is counted by workgroups, and from these counts follows where each puts what it leaves. So the order of the cut, too,
// depends on tree and camera alone. The first levels, which are small, are one workgroup's. Pages of surfels are drawn from where what was chosen lies.
// Of cuts that fade into each other (select_fades.wgsl) all are made at once.
// Host side and twin: src/passes/select.rs.
// All loops end, by 1 of src/gpu/loops.rs: 0x737976e37d84fa2b

@group(0) @binding(72) var<uniform> branch: Branch;
@group(0) @binding(73) var<storage, read> tree_nodes: array<TreeNode>;
// Numbers of nodes that are come to, level after level, and what becomes of each. Numbers have a second half where cuts fade (select_fades.wgsl).
@group(0) @binding(75) var<storage, read_write> frontier: array<u32>;
@group(0) @binding(76) var<storage, read_write> fates: array<u32>;
// For each invocation of a level: how many surfels and how many children are left by what those before it in its workgroup judge.
@group(0) @binding(82) var<storage, read_write> run_counts: array<vec2<u32>>;
// Of each workgroup: how many of both its nodes leave; then where these start.
@group(0) @binding(77) var<storage, read_write> group_counts: array<vec2<u32>>;
// The attributes of this branch, and from branch.chosen on how many of its surfels are drawn, its nodes' among them, and then which: no kernel
// that draws them needs another buffer, of which core WebGPU has eight.
@group(0) @binding(78) var<storage, read_write> chosen: array<u32>;
// By how many cuts the roots of branches are come to.
@group(0) @binding(79) var<storage, read_write> reached: array<u32>;
// The words below.
@group(0) @binding(80) var<storage, read_write> selection: array<u32>;
@group(0) @binding(81) var<storage, read> selected: array<u32>;

// The stretch of the frontier that is the level in work, and the next one.
const LEVEL: u32 = 0u;
const LEVEL_END: u32 = 1u;
const NEXT: u32 = 2u;
const NEXT_END: u32 = 3u;
// Grids with an invocation for JUDGED nodes each of the level that is judged, and of that which is spread.
const JUDGE_GRID: u32 = 4u;
const SPREAD_GRID: u32 = 7u;

// Surfels of a run: whole batches.
const RUN: u32 = 512u;

// Kinds of nodes.
const KIND_SHIFT: u32 = 30u;
const COUNT_MASK: u32 = (1u << KIND_SHIFT) - 1u;
const INNER: u32 = 0u;
const LEAF: u32 = 1u;
const OTHER_BRANCH: u32 = 2u;
const PART_OF_LEAF: u32 = 3u;

// Nodes that an invocation judges, one after the other: barriers are dear on processors, and one costs the same however many nodes there are.
const JUDGED: u32 = 8u;

// What becomes of a node: in how many cuts, the first of those that come to it, it is divided; or nothing.
const UNSEEN: u32 = 0x7fu;
const CUTS_MASK: u32 = 0x7fu;
// Beside that: its children are drawn, all of them, and not judged.
const CHILDREN_DRAWN: u32 = 0x80u;

// A node's size is that of the ball by which it is in sight, as seen in the middle of the image, not that of its ellipse's image.
override MEASURES_EXTENT: bool;

const PI: f32 = 3.14159265;

// Room for the rounding of a ball's place and size, of its distance; of bounds of children's balls, which lie off by 2e-6 of that distance, as a child is
// less than twice as far as its parent where both are past the near depth, and whose sizes err by six roundings of 6e-8; and of sines.
const BALL_ROUNDING: f32 = 1e-6;
const BOUND_SLACK: f32 = 1e-4;
const SINE_SLACK: f32 = 1e-5;

var<workgroup> counted: array<vec2<u32>, WORKGROUP>;
var<workgroup> eights: array<vec2<u32>, WORKGROUP / 8u>;
var<workgroup> first_end: u32;

// Which of those that are chosen has a place of the page. Neighbours in a cut are neighbours in the image, and what is in work at the same time
// should not be: atomics would wait for each other (src/passes/order.rs).
fn drawn_at(place: u32) -> u32 {
    let run = place / RUN;
    // A page has fewer than 2^16 runs, so no product is past 2^32, and the quotient in f32 errs by less than 2^16 * 6 * 2^-24 < 1: the
    // remainder is right, or one whole too small or too large. Processors divide integers one by one.
    let runs = max(page.runs, 1u);
    let product = run * page.stride;
    let rest = bitcast<i32>(product - u32(f32(product) / f32(runs)) * runs);
    let turn = bitcast<u32>(rest + select(0, i32(runs), rest < 0) - select(0, i32(runs), rest >= i32(runs)));
    // What is left of the last run stays.
    return page.first + select(run, turn, run < page.runs) * RUN + place % RUN;
}

fn places_held() -> u32 {
    return page.surfels;
}

// The surfel, or the node's, at a place of the page; any where the cut has ended.
fn surfel_of(place: u32) -> u32 {
    return attributes[page.chosen + 1u + CHOSEN_WORDS * drawn_at(place)];
}

// Whether a place has a surfel of the cut.
fn is_filled(place: u32) -> bool {
    return drawn_at(place) < attributes[page.chosen];
}

// Which word of a surfel's attributes.
override NUMBER_WORD: u32;

// The place of a surfel among all of the tree, its nodes after them; where it is asked for.
fn rank_of(index: u32) -> u32 {
    return attribute_word(index, NUMBER_WORD);
}

fn kind_of(node: TreeNode) -> u32 {
    return node.below >> KIND_SHIFT;
}

// Whether it is never divided: one surfel is itself, with its lines and its cap, which are the node's too (src/scene/hierarchy.rs, `settle`; src/passes/source.rs); and where the surfels of
// a part of a tree are not there, no picture comes to them.
fn is_whole(node: TreeNode) -> bool {
    return kind_of(node) == LEAF && (node.below & COUNT_MASK) <= 1u;
}

fn vector(parts: array<f32, 3>) -> vec3<f32> {
    return vec3<f32>(parts[0], parts[1], parts[2]);
}

// The sine by which its plane faces away from the eye, and that past which all below it does.
fn turned_away(node: TreeNode, surfel: Surfel, relative: vec3<f32>, radius: f32) -> vec2<f32> {
    let normal = cross3(vector(surfel.s) * held.unit, vector(surfel.t) * held.unit);
    let turned = dot3(ray_to(relative), normal * inverseSqrt(max(dot3(normal, normal), 1e-38)));
    // Of the cone's angle and the ball's together, if they are less than a right angle; else nothing is told.
    let ball = ball_sine(radius, norm3(relative));
    let cone = sqrt(max(1.0 - node.cone * node.cone, 0.0));
    let ball_cosine = sqrt(max(1.0 - ball * ball, 0.0));
    let narrow = node.cone * ball_cosine - cone * ball > SINE_SLACK;
    return vec2<f32>(turned, select(1.0, cone * ball_cosine + node.cone * ball, narrow) + SINE_SLACK);
}

// Square pixels that a ball of this radius, device units, is seen as at a depth in the middle of the image.
fn seen_disk(depth: f32, radius: f32) -> f32 {
    let across = axis_image(vec3<f32>(0.0, 0.0, depth), vec3<f32>(radius, radius, 0.0)) * held.levels.yz;
    let longest = max(across.x, across.y);
    return PI * longest * longest;
}

// Square pixels of the image that a node is seen at.
fn size_of(center: vec3<f32>, node: TreeNode, surfel: Surfel) -> f32 {
    if (MEASURES_EXTENT) {
        return seen_disk(center.z, node.radius * held.unit);
    }
    let s = axis_image(center, rotate_plain(vector(surfel.s) * held.unit)) * held.levels.yz;
    let t = axis_image(center, rotate_plain(vector(surfel.t) * held.unit)) * held.levels.yz;
    return PI * abs(s.x * t.y - s.y * t.x);
}

// Whether the children of a node are drawn wherever it is divided, however they lie in the ball around it: all are in sight, past the near depth, and
// in no cut is one divided. Of most nodes of a cut this is told.
fn draws_children(node: TreeNode, ball: Ball) -> bool {
    let radius = node.children * held.unit * (1.0 + BOUND_SLACK);
    let nearest = ball.nearest - BOUND_SLACK * norm3(ball.center);
    let past = nearest - radius - growth(ball.farthest + radius) > held.near * (1.0 + BOUND_SLACK);
    // A ball of a negative radius lies beside the image where that of the positive one is not wholly within.
    let within = !is_beside(ball.center, -ball.radius, 0.0);
    return node.children >= 0.0 && past && within && cuts_that_divide(seen_disk(nearest, radius)) == 0u;
}

// What becomes of a node whose centre leaves out `low`, world units.
fn fate_of(node: TreeNode, surfel: Surfel, low: vec3<f32>) -> u32 {
    // In its own branch it is judged, or the whole leaf was.
    if (kind_of(node) == OTHER_BRANCH || kind_of(node) == PART_OF_LEAF) {
        return ALL_CUTS;
    }
    // Leading parts cancel, and what is left is as exact as the trailing ones.
    let relative = (vector(node.center) * held.unit - held.eye.xyz) + (low * held.unit - held.eye_low.xyz);
    // Ten roundings of f32 in this length.
    let ball = ball_at(relative, node.radius * held.unit + BALL_ROUNDING * norm3(relative));
    if (ball.farthest < held.near || is_beside(ball.center, ball.radius, FILTER_REACH + 2.0)) {
        return UNSEEN;
    }
    var faces = true;
    if (CULL_BACK) {
        let away = turned_away(node, surfel, relative, ball.radius);
        if (away.x > away.y) {
            return UNSEEN;
        }
        // The plane of one that faces away is left out, whatever is below it.
        faces = away.x <= 0.0;
    }
    let divided = reaches_near(ball) || !faces;
    let cuts = select(select(cuts_that_divide(size_of(ball.center, node, surfel)), ALL_CUTS, divided), 0u, is_whole(node));
    // By its own place and size alone nothing is told of a child's area, or of its side.
    let unjudged = MEASURES_EXTENT && !CULL_BACK && draws_children(node, ball);
    return cuts | select(0u, CHILDREN_DRAWN, unjudged);
}

// Of the cuts that come to a node, the number in which it is divided.
fn cuts_of(fate: u32) -> u32 {
    return fate & CUTS_MASK;
}

// Whether what is below a node is drawn if it is divided: its surfels, or its children.
fn is_last(node: TreeNode, fate: u32) -> bool {
    let kind = kind_of(node);
    return kind == LEAF || kind == PART_OF_LEAF || (kind == INNER && (fate & CHILDREN_DRAWN) != 0u);
}

// How many surfels and nodes are drawn of a node that so many cuts come to, and how many children it leaves for the next level.
fn left_by(node: TreeNode, fate: u32, reached_in: u32) -> vec2<u32> {
    let cuts = cuts_of(fate);
    if (cuts == UNSEEN) {
        return vec2<u32>(0u);
    }
    let below = select(0u, node.below & COUNT_MASK, cuts > 0u && kind_of(node) != OTHER_BRANCH);
    let itself = select(0u, 1u, cuts < reached_in);
    return select(vec2<u32>(itself, below), vec2<u32>(itself + below, 0u), is_last(node, fate));
}

// The sum of the counts of the invocations before this one: in its own eight, and of those before. Few barriers, as each is dear on processors.
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

// Invocations that judge so many nodes.
fn judges_of(nodes: u32) -> u32 {
    return (nodes + JUDGED - 1u) / JUDGED;
}

fn set_grid(at: u32, nodes: u32) {
    let grid = rows_of(groups_of(judges_of(nodes)));
    for (var k = 0u; k < 3u; k++) {
        selection[at + k] = grid[k];
    }
}

// What becomes of a node in so many cuts that come to it.
fn judged(node: TreeNode, index: u32, reached_in: u32) -> u32 {
    let record = branch.surfels + index;
    let fate = fate_of(node, surfel_at(record), low_part(record));
    return select((fate & CHILDREN_DRAWN) | min(cuts_of(fate), reached_in), UNSEEN, cuts_of(fate) == UNSEEN);
}

// Judges the nodes of a stretch of the frontier, and returns how much they leave.
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

// Writes what a node leaves from `start` on, and returns how much that is.
fn spread(index: u32, fate: u32, reached_in: u32, start: vec2<u32>) -> vec2<u32> {
    let cuts = cuts_of(fate);
    let node = tree_nodes[index];
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
    let drawn = start.x + counts.x - at;
    for (var k = 0u; k < drawn; k++) {
        choose(at + k, below + k, 0u, cuts);
    }
    for (var k = 0u; k < counts.y; k++) {
        frontier[start.y + k] = node.first + k;
        set_cuts_that_reach(start.y + k, cuts);
    }
    return counts;
}

// Writes what they leave from `start` on.
fn spread_run(first: u32, end: u32, start: vec2<u32>) {
    var at = start;
    for (var place = first; place < end; place++) {
        at += spread(frontier[place], fates[place], cuts_that_reach(place), at);
    }
}

// The roots of a branch that are come to are its first level; how many they are.
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

// One workgroup: roots, and the levels that are small.
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
        // What was spread is seen by all, and all have seen the sums.
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

// One invocation for JUDGED nodes of the next level that follow each other.
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
        run_counts[run] = before;
    }
    if (local == WORKGROUP - 1u) {
        group_counts[workgroup.y * workgroups.x + workgroup.x] = before + counts;
    }
}

// One workgroup: where the surfels and the children of each workgroup start, and the level after this one.
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
        own += group_counts[group];
    }
    let before = sum_before(own, local);
    var start = before + vec2<u32>(here, end);
    for (var group = local * each; group < stop; group++) {
        let counts = group_counts[group];
        group_counts[group] = start;
        start += counts;
    }
    // All have read the old words before the barriers above.
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

// One invocation for JUDGED nodes of the level that was judged.
@compute @workgroup_size(WORKGROUP)
fn select_spread(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let run = linear_index(workgroup, workgroups, local);
    let first = selected[LEVEL] + run * JUDGED;
    let end = min(first + JUDGED, selected[LEVEL_END]);
    if (first >= end) {
        return;
    }
    spread_run(first, end, group_counts[workgroup.y * workgroups.x + workgroup.x] + run_counts[run]);
}
