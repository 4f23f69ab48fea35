// The structs that host and device share, and the uniforms. src/gpu/layout.rs mirrors the structs,
// and a test compares the two field by field; bindings are looked up by name.
// #import clip::{Clip}
// #import curved|facing|flat::{Cap}
// #import fade::{Fade}

// All lengths on the device are in units of `1 / unit` world units. `unit` is a power of two chosen
// so that the scene and the camera's distance are near one: scaling by it is exact, and no length
// or square overflows.
struct View {
    // World to camera, rows right, down, forward. The matrix is the sum of its leading and its
    // trailing parts (double.wgsl).
    rotation: array<vec4<f32>, 3>,
    rotation_low: array<vec4<f32>, 3>,
    // xyz: the eye relative to the scene's origin, device units.
    eye: vec4<f32>,
    eye_low: vec4<f32>,
    // fx, fy, cx, cy: pinhole in pixels; orthographic fx and fy in pixels per unit.
    intrinsics: vec4<f32>,
    intrinsics_low: vec4<f32>,
    // Premultiplied linear colour: value = low + span * [0, 1].
    color_low: vec4<f32>,
    color_span: vec4<f32>,
    // 1 / span, or 0 where the span is 0.
    color_scale: vec4<f32>,
    // Linear, straight alpha.
    background: vec4<f32>,
    // xyz: unit vector toward the light in world space, or 0 for the headlight; w: intensity.
    lights: array<vec4<f32>, 8>,
    width: u32,
    height: u32,
    // Always 0, which no compiler can know (src/gpu/exact).
    zero: u32,
    unit: f32,
    near: f32,
    epsilon_relative: f32,
    epsilon_absolute: f32,
    // 1 / unit: device lengths times this are world lengths.
    world: f32,
    // epsilon_radius: epsilon as a multiple of the surfel's radius. epsilon_deepest: that multiple
    // of the largest radius, device units.
    epsilon_radius: f32,
    epsilon_deepest: f32,
    // An upper bound on the depths of all surfels, device units. An unbounded epsilon accepts
    // depths up to this bound.
    farthest: f32,
    // Depth of the centre of the scene's core (the box of nearly all points), device units.
    middle: f32,
    // The upper limit of an epsilon given by the radius, as a fraction of the nearest depth.
    epsilon_most: f32,
    // The depths at which the scene's body (its box without distant outliers) starts and ends,
    // device units.
    first: f32,
    last: f32,
    // The number of the surfels' textures.
    textures: u32,
    // xy: the middle of the range of texture coordinates; z: the span of that range; w: the largest
    // squared reach (texture.wgsl), in units of the squared span.
    place: vec4<f32>,
    // x: the size, in square pixels of the image, below which a node is drawn in place of what is
    // below it (src/scene/detail.rs). yz: the width and height of a sample, in pixels of the image.
    levels: vec4<f32>,
    // The layout of textures in their common plane (src/scene/atlas.rs). xy: its corner; z: the
    // side of a cell; w: the number of cells in a row.
    atlas: vec4<f32>,
    // A lens that is no pinhole (src/scene/optics.rs); else 0. Its coefficients: the leading parts
    // of k1 to k4, of k5 to k7 and the widening, and of p1, p2, s1 and s2; then their trailing
    // parts; then x: the largest radius before the distortion, y: the largest of a splat's centre,
    // z: the radius of the plane within which the lens surely shows each point, w: 1 if depth is
    // camera-space z, 0 if it is the distance from the eye.
    lens: array<vec4<f32>, 7>,
}

// The rows of the image that the visibility and attribute buffers hold.
struct Band {
    first_row: u32,
    rows: u32,
    padding_0: u32,
    padding_1: u32,
}

// An elliptical disk center + u s + v t, world units relative to the scene's origin.
struct Surfel {
    center: array<f32, 3>,
    s: array<f32, 3>,
    t: array<f32, 3>,
}

// A projected surfel. At the pixel (x, y), with d = (x - anchor_x, y - anchor_y, 1), the products
// (a . d, b . d, c . d) are (u/z, v/z, 1/z) for a pinhole and (u, v, z) for an orthographic camera.
struct Splat {
    anchor_x: i32,
    anchor_y: i32,
    // First and last pixel, x | y << 16; empty if the first lies past the last. The sides of an
    // image have 15 bits, so the top bit of bounds_last, AWAY, is free: it is set if s x t points
    // away from the viewer.
    bounds_first: u32,
    bounds_last: u32,
    a: array<f32, 3>,
    b: array<f32, 3>,
    c: array<f32, 3>,
    // The trailing part of a, for thin splats (rows.wgsl); else 0.
    a_low: array<f32, 3>,
    // The lines at which the disk ends before its rim.
    clip: Clip,
    // The curvature of the surfel. With it, a, b, c and a_low have other meanings (curved.wgsl).
    cap: Cap,
    // The range of fading cuts that contain the surfel (fade.wgsl).
    fade: Fade,
}

// A page of surfels.
struct Page {
    // The number of surfels in the pages before it. In a cut (select.wgsl): the number of chosen
    // surfels in the earlier pages of the same branch.
    first: u32,
    // The number of surfels that the page can hold.
    surfels: u32,
    // In a cut: the number of runs of surfels that are shuffled over the page, and the stride of
    // the shuffle (drawn_at() in select.wgsl).
    runs: u32,
    stride: u32,
    // In a cut: the word of the branch's attributes at which the list of chosen surfels starts.
    chosen: u32,
    padding_0: u32,
    padding_1: u32,
    padding_2: u32,
}

// A node of a tree, or a node that stands for a part of a large leaf.
struct TreeNode {
    // The centre and radius of a sphere that holds everything below the node, world units. The
    // centre is also that of the node's ellipse, and is repeated here so that the values that judge
    // most nodes share a cache line.
    center: array<f32, 3>,
    radius: f32,
    // By the kind of node: the index of its first child in this branch, of its first surfel, or of
    // a root of another branch.
    first: u32,
    // The number of its children or surfels, and in the highest two bits the kind of the node
    // (judge.wgsl).
    below: u32,
    // The largest radius among its children, leaves of one surfel not counted; world units. -1 if
    // the children must be judged one by one: if they are not all in this branch, or the sphere
    // does not hold all their centres.
    children: f32,
    // The smallest cosine of the angle between the node's normal and a normal below it; -1 if
    // normals have no side.
    cone: f32,
}

// A branch consists of neighbouring subtrees of one tree. Its surfels and nodes fit a buffer: the
// surfels first, then the nodes level by level.
struct Branch {
    surfels: u32,
    // The number of roots, which are the first nodes.
    roots: u32,
    // The index of the first of these roots among the roots of all branches except the first
    // branch.
    first_root: u32,
    // 1 if the branch has one root, the root of the tree.
    whole: u32,
    // The word at which the list of chosen surfels starts, after the branch's attributes.
    chosen: u32,
    // The number of top levels that one workgroup can judge within its node and loop limits.
    small_levels: u32,
    padding_0: u32,
    padding_1: u32,
}

const AWAY: u32 = 0x80000000u;

// The nearest depth of an empty pixel: +inf.
const NOTHING: u32 = 0x7f800000u;

// Depths are positive, so the bits of an f32 order as u32. A nearest depth is stored as bits(+inf)
// - bits(depth): a cleared buffer then has only empty pixels, and clearing needs no kernel. The
// function is its own inverse.
fn kept_depth(bits: u32) -> u32 {
    return NOTHING - bits;
}

// The channel of a pixel's sums that holds the weight.
const WEIGHT_CHANNEL: u32 = 0u;

// A weight of 1 in the units of the sums of `fixed`: 2^32 - 2^10.
const FIXED_ONE: f32 = 4294966272.0;

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<uniform> band: Band;
@group(0) @binding(42) var<uniform> page: Page;

// Copies of the uniforms, read once per invocation in uniform control flow. Some drivers (Mesa's
// llvmpipe) read a uniform again at each use, and in divergent control flow once per invocation;
// that took a third of the projection's time. Every entry point that uses them starts with hold().
var<private> held: View;
var<private> held_band: Band;

fn hold() {
    hold_view();
    held_band = band;
}

// For entry points that run before there are bands.
fn hold_view() {
    held = view;
}

const WORKGROUP: u32 = 64u;

// The number of surfels that are culled together (cull.wgsl).
const BATCH: u32 = 64u;

// The index of this invocation in a 2-D dispatch of 1-D workgroups.
fn linear_index(workgroup: vec3<u32>, workgroups: vec3<u32>, local: u32) -> u32 {
    return (workgroup.y * workgroups.x + workgroup.x) * WORKGROUP + local;
}
