// Decides the fate of a tree node: how many of the cuts that reach the node divide it, by its size
// in the image, or that nothing below it is visible. A cut that divides a node draws what is below
// the node in its place: its surfels, or its children, which may be divided in turn.
// Twin: src/passes/select.rs.
// All loops end, by 1 of src/gpu/loops.rs: 0x30d8edbe699a7ca2
// #import axes_*::{growth}
// #import backs_*::{lean_of_surfel}
// #import ball::{Ball, FILTER_REACH, ball_at, reaches_near}
// #import camera_*::{axis_image, ball_sine, is_beside}
// #import camera_orthographic|perspective::{ray_to}
// #import layout::{Surfel, TreeNode, held}
// #import low_part::{low_part}
// #import project::{CULL_BACK, rotate_plain}
// #import select_fades::{ALL_CUTS, cuts_that_divide}
// #import vectors::{cross3, dot2, dot3, norm3}
// #import words|words_long::{surfel_at}

// Kinds of nodes.
const KIND_SHIFT: u32 = 30u;
const COUNT_MASK: u32 = (1u << KIND_SHIFT) - 1u;
const INNER: u32 = 0u;
const LEAF: u32 = 1u;
const OTHER_BRANCH: u32 = 2u;
const PART_OF_LEAF: u32 = 3u;

// The fate of a node: how many of the cuts that reach it divide it (the finest ones), or UNSEEN.
const UNSEEN: u32 = 0x7fu;
const CUTS_MASK: u32 = 0x7fu;
// A flag beside that number: all children of the node are drawn without being judged.
const CHILDREN_DRAWN: u32 = 0x80u;
// From this bit on: a bit for each surfel of a leaf that faces away and is left out.
const BACKS_SHIFT: u32 = 8u;
// The most surfels in a leaf, unless they all coincide.
const FAN_OUT: u32 = 8u;

// If set, the size of a node is that of its bounding ball, as seen in the middle of the image; else
// that of the image of its ellipse, or of the square over the longer of the images of its two axes.
override MEASURES_EXTENT: bool;
override MEASURES_SQUARE: bool;

// Whether nodes are left out if everything below them faces away.
override CULL_CONES: bool;

const PI: f32 = 3.14159265;

// Margins for rounding. BALL_ROUNDING covers a ball's position and radius, relative to its
// distance. SINE_SLACK covers sines. BOUND_SLACK covers bounds on the balls of children: if both
// are past the near depth, a child's ball is less than twice as far away as its parent's, so it is
// off by at most 2e-6 of the parent's distance. Its size errs by six roundings of 6e-8.
const BALL_ROUNDING: f32 = 1e-6;
const BOUND_SLACK: f32 = 1e-4;
const SINE_SLACK: f32 = 1e-5;

fn kind_of(node: TreeNode) -> u32 {
    return node.below >> KIND_SHIFT;
}

// Whether the node is never divided. A leaf of one surfel is drawn as that surfel: the node has the
// surfel's ellipse, clip lines and cap (`settle` in src/scene/hierarchy.rs; src/passes/source.rs).
// A leaf of no surfels stands for a subtree that was not loaded, because no picture reaches it.
fn is_whole(node: TreeNode) -> bool {
    return kind_of(node) == LEAF && (node.below & COUNT_MASK) <= 1u;
}

fn vector(parts: array<f32, 3>) -> vec3<f32> {
    return vec3<f32>(parts[0], parts[1], parts[2]);
}

// The sine of the angle by which the node's plane faces away from the eye, and the sine past which
// everything below the node faces away.
fn turned_away(node: TreeNode, surfel: Surfel, relative: vec3<f32>, radius: f32) -> vec2<f32> {
    let normal = cross3(vector(surfel.s) * held.unit, vector(surfel.t) * held.unit);
    let turned = dot3(ray_to(relative), normal * inverseSqrt(max(dot3(normal, normal), 1e-38)));
    // The sine of the sum of the cone's angle and the ball's half-angle, if the sum is less than a
    // right angle; else 1, which is never exceeded.
    let ball = ball_sine(radius, norm3(relative));
    let cone = sqrt(max(1.0 - node.cone * node.cone, 0.0));
    let ball_cosine = sqrt(max(1.0 - ball * ball, 0.0));
    let narrow = node.cone * ball_cosine - cone * ball > SINE_SLACK;
    return vec2<f32>(turned, select(1.0, cone * ball_cosine + node.cone * ball, narrow) + SINE_SLACK);
}

// The area, in square pixels of the image, of a ball of this radius (device units) that is seen at
// `depth` in the middle of the image.
fn seen_disk(depth: f32, radius: f32) -> f32 {
    let across = axis_image(vec3<f32>(0.0, 0.0, depth), vec3<f32>(radius, radius, 0.0)) * held.levels.yz;
    let longest = max(across.x, across.y);
    return PI * longest * longest;
}

// The area that a node covers, in square pixels of the image.
fn size_of(center: vec3<f32>, node: TreeNode, surfel: Surfel) -> f32 {
    if (MEASURES_EXTENT) {
        return seen_disk(center.z, node.radius * held.unit);
    }
    let s = axis_image(center, rotate_plain(vector(surfel.s) * held.unit)) * held.levels.yz;
    let t = axis_image(center, rotate_plain(vector(surfel.t) * held.unit)) * held.levels.yz;
    if (MEASURES_SQUARE) {
        return 4.0 * max(dot2(s, s), dot2(t, t));
    }
    return PI * abs(s.x * t.y - s.y * t.x);
}

// Whether every cut that divides the node draws all its children, wherever they lie in its ball:
// all are in view and past the near depth, and no cut divides any of them. This holds for most
// nodes of a cut.
fn draws_children(node: TreeNode, ball: Ball) -> bool {
    let radius = node.children * held.unit * (1.0 + BOUND_SLACK);
    let nearest = ball.nearest - BOUND_SLACK * norm3(ball.center);
    let past = nearest - radius - growth(radius, ball.farthest + radius) > held.near * (1.0 + BOUND_SLACK);
    // With the negative radius, is_beside() is false exactly if the ball lies wholly within the
    // image.
    let within = !is_beside(ball.center, -ball.radius, 0.0);
    return node.children >= 0.0 && past && within && cuts_that_divide(seen_disk(nearest, radius)) == 0u;
}

// The fate of a node. `low` is the part of its centre that f32 leaves out, world units.
fn fate_of(node: TreeNode, surfel: Surfel, low: vec3<f32>) -> u32 {
    // A root of another branch is judged with that branch, and a part of a leaf was judged with the
    // leaf.
    if (kind_of(node) == OTHER_BRANCH || kind_of(node) == PART_OF_LEAF) {
        return ALL_CUTS;
    }
    // The leading parts cancel, so the result is as exact as the trailing parts.
    let relative = (vector(node.center) * held.unit - held.eye.xyz) + (low * held.unit - held.eye_low.xyz);
    // This length has ten roundings of f32.
    let ball = ball_at(relative, node.radius * held.unit + BALL_ROUNDING * norm3(relative));
    if (ball.farthest < held.near || is_beside(ball.center, ball.radius, FILTER_REACH + 2.0)) {
        return UNSEEN;
    }
    var faces = true;
    if (CULL_CONES) {
        let away = turned_away(node, surfel, relative, ball.radius);
        if (away.x > away.y) {
            return UNSEEN;
        }
        // A node whose plane faces away would be culled although surfels below it may be visible,
        // so it is divided.
        faces = !CULL_BACK || away.x <= 0.0;
        if (CULL_BACK && node.below == ((LEAF << KIND_SHIFT) | 1u) && shows_back(node.first)) {
            return UNSEEN;
        }
    }
    let divided = reaches_near(ball) || !faces;
    let cuts = select(select(cuts_that_divide(size_of(ball.center, node, surfel)), ALL_CUTS, divided), 0u, is_whole(node));
    // Otherwise children must be judged: neither the image area of a child's ellipse nor the side
    // that it shows follows from the node's own position and size.
    let unjudged = MEASURES_EXTENT && !CULL_CONES && draws_children(node, ball);
    var backs = 0u;
    if (CULL_BACK && kind_of(node) == LEAF && cuts > 0u) {
        backs = backs_below(node) << BACKS_SHIFT;
    }
    return cuts | select(0u, CHILDREN_DRAWN, unjudged) | backs;
}

// A bit for each surfel of a leaf that faces away, wherever it is seen. Crowded leaves keep all.
fn backs_below(node: TreeNode) -> u32 {
    let count = node.below & COUNT_MASK;
    let judged = select(0u, count, count <= FAN_OUT);
    var backs = 0u;
    for (var k = 0u; k < judged; k++) {
        if (shows_back(node.first + k)) {
            backs |= 1u << k;
        }
    }
    return backs;
}

// Whether no pixel can show a surfel's front. Pass `project` finds out with more digits, so what
// hardly shows its back is kept. The half-axes may be nearly parallel, so the margin is relative to
// the product of their lengths.
fn shows_back(record: u32) -> bool {
    let surfel = surfel_at(record);
    let s = vector(surfel.s) * held.unit;
    let t = vector(surfel.t) * held.unit;
    let low = low_part(record) * held.unit - held.eye_low.xyz;
    let relative = (vector(surfel.center) * held.unit - held.eye.xyz) + low;
    let ray = ray_to(relative);
    let lean = lean_of_surfel(record, ray, s, t, norm3(relative));
    return dot3(ray, cross3(s, t)) - lean.x > SINE_SLACK * (norm3(s) * norm3(t) + lean.y);
}

// The number of cuts that divide the node, among those that reach it; or UNSEEN.
fn cuts_of(fate: u32) -> u32 {
    return fate & CUTS_MASK;
}

// Whether dividing the node draws its surfels or children at once, without judging children.
fn is_last(node: TreeNode, fate: u32) -> bool {
    let kind = kind_of(node);
    return kind == LEAF || kind == PART_OF_LEAF || (kind == INNER && (fate & CHILDREN_DRAWN) != 0u);
}

// The surfels of a leaf that are left out, a bit each.
fn backs_of(fate: u32) -> u32 {
    return select(0u, fate >> BACKS_SHIFT, CULL_BACK);
}
