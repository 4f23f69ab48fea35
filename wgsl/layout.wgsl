// Every struct that host and device share, and every binding. src/gpu/layout.rs mirrors the structs and a test compares
// the two field by field; bindings are looked up by name.

// All lengths on the device are in units of `1 / unit` world units, where `unit` is a power of two chosen so that the
// scene and the camera's distance are near one: scaling by it is exact, and no length or square overflows.
struct View {
    // World to camera, rows right, down, forward: nine leading parts, then nine trailing parts (see double.wgsl).
    rotation: array<vec4<f32>, 3>,
    rotation_low: array<vec4<f32>, 3>,
    // xyz: the eye relative to the scene's origin.
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
    // Always 0, which no compiler can know (double.wgsl).
    zero: u32,
    unit: f32,
    near: f32,
    epsilon_relative: f32,
    epsilon_absolute: f32,
    // 1 / unit: device lengths times this are world lengths.
    world: f32,
    // Epsilon as a multiple of the surfel's radius, and that multiple of the largest radius, device units.
    epsilon_radius: f32,
    epsilon_deepest: f32,
    // No surfel lies deeper, device units: an unbounded epsilon accepts up to here.
    farthest: f32,
    // Depth of the middle of the scene's core, device units.
    middle: f32,
    // What an epsilon by the radius does not exceed, as a fraction of the nearest depth.
    epsilon_most: f32,
    // The depths at which the scene's body starts and ends, device units.
    first: f32,
    last: f32,
    // Those of surfels.
    textures: u32,
    // The middle of the range of texture coordinates, its span, and the largest squared reach in units of the span.
    place: vec4<f32>,
    // x: a node that is seen smaller, square pixels of the image, is drawn in place of what is below it (src/scene/detail.rs); yz: the
    // part of a pixel of the image that one here is across and down.
    levels: vec4<f32>,
    // Where textures lie in the plane of coordinates (src/scene/atlas.rs): its corner, the side of a cell, cells in a row.
    atlas: vec4<f32>,
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

// A projected surfel. At the pixel (x, y), with d = (x - anchor_x, y - anchor_y, 1):
// (a . d, b . d, c . d) is (u/z, v/z, 1/z) for a pinhole and (u, v, z) for an orthographic camera.
struct Splat {
    anchor_x: i32,
    anchor_y: i32,
    // First and last pixel, x | y << 16; empty if the first lies past the last. Sides have 15 bits: the top bit of
    // bounds_last is set where s x t points away from the viewer.
    bounds_first: u32,
    bounds_last: u32,
    a: array<f32, 3>,
    b: array<f32, 3>,
    c: array<f32, 3>,
    // Trailing part of a, for thin splats (rows.wgsl); else 0.
    a_low: array<f32, 3>,
    // Where the disk ends before its rim.
    clip: Clip,
    // How it curves; then a, b, c and a_low have other meanings (curved.wgsl).
    cap: Cap,
    // How much of it there is.
    fade: Fade,
}

// A page of surfels.
struct Page {
    // Surfels of the pages before it; of a cut, of those of its branch.
    first: u32,
    // Those that it has room for.
    surfels: u32,
    // Of a cut: runs of surfels that are dealt out over the page, and the stride by which they are.
    runs: u32,
    stride: u32,
    // And where in the attributes of its branch what is chosen starts.
    chosen: u32,
    padding_0: u32,
    padding_1: u32,
    padding_2: u32,
}

// A node of a tree, or one that has a part of a leaf's surfels.
struct TreeNode {
    // A sphere of this radius around this centre holds all below it, world units. The centre is that of its ellipse once more: what a node is mostly judged
    // by is in a line of a cache.
    center: array<f32, 3>,
    radius: f32,
    // The first of its children in this branch, or of its surfels, or which root of another branch it is.
    first: u32,
    // How many there are, and in the highest bits of what kind (select.wgsl).
    below: u32,
    // The largest radius of a child, world units, but of those that are one surfel, where this sphere holds the centres of all; -1 where children are to
    // be judged one by one.
    children: f32,
    // The smallest cosine between its normal and those below it; -1 where they have no side.
    cone: f32,
}

// Neighbouring subtrees, whose surfels and nodes fit a buffer: first the surfels, then the nodes level by level.
struct Branch {
    surfels: u32,
    // The first so many nodes are its roots.
    roots: u32,
    // The number of the first of them among the roots of all branches.
    first_root: u32,
    // 1 if its root is that of the tree.
    whole: u32,
    // Where behind its attributes what is chosen starts.
    chosen: u32,
    // So many levels, its roots the first, have no more nodes than one workgroup judges.
    small_levels: u32,
    padding_0: u32,
    padding_1: u32,
}

const AWAY: u32 = 0x80000000u;

// The nearest depth where nothing is: +inf.
const NOTHING: u32 = 0x7f800000u;

// Depths are positive, so the bits of an f32 order as u32. A nearest depth is kept as what its bits lack to those of +inf: a
// buffer that was cleared has nothing anywhere, and clearing costs no kernel. Its own inverse.
fn kept_depth(bits: u32) -> u32 {
    return NOTHING - bits;
}

// The channel of a pixel's sums that holds the weight.
const WEIGHT_CHANNEL: u32 = 0u;

// The units of a weight of 1 in the sums of `fixed`: 2^32 - 2^10.
const FIXED_ONE: f32 = 4294966272.0;

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<uniform> band: Band;
@group(0) @binding(42) var<uniform> page: Page;

// The uniforms, read once an invocation and where all take part: some drivers read uniforms again wherever they are used, and
// one by one for each invocation where some do not take part (Mesa's llvmpipe), which took a third of the projection. Every
// entry point that uses them starts with hold().
var<private> held: View;
var<private> held_band: Band;

fn hold() {
    hold_view();
    held_band = band;
}

// For those before there are bands.
fn hold_view() {
    held = view;
}

const WORKGROUP: u32 = 64u;

// Surfels that are left out together (cull.wgsl).
const BATCH: u32 = 64u;

// The index of this invocation in a 2-D dispatch of 1-D workgroups.
fn linear_index(workgroup: vec3<u32>, workgroups: vec3<u32>, local: u32) -> u32 {
    return (workgroup.y * workgroups.x + workgroup.x) * WORKGROUP + local;
}
