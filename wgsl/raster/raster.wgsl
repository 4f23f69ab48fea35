// The rasteriser's path, the baseline for the compute kernels (Botsch et al. 2005): each splat is a
// triangle or a quad, the depth test finds the nearest depth, and the blender makes the sums.
// Splats, footprint, kernel, attributes and resolve are those of the compute path.
// Host side and the meaning of the variants: src/passes/raster.rs.
// #import blend::{attributes_without_place}
// #import blend|winner::{Attributes, attributes_of}
// #import camera_orthographic|perspective::{Fragment, homogeneous_row}
// #import clip::{clip_in}
// #import curved|facing|flat::{Bend, FACES, cap_in}
// #import fade::{fade_in}
// #import filter|lowpass_none::{FILTERED, filter_in}
// #import footprint::{bounds, footprint}
// #import layout::{Splat, held, hold}
// #import raster_*::{corner_depth}
// #import records::{SplatRecord, splat_of}
// #import select::{surfel_of}
// #import vectors::{cross3, dot3}

@group(0) @binding(5) var<storage, read> projected: array<SplatRecord>;

// The values that a splat's fragments need. They are read once per corner and passed on unchanged:
// on a software adapter, reading the record again at each fragment took twice as long.
struct ShapeCorner {
    @builtin(position) position: vec4<f32>,
    @location(0) @interpolate(flat) index: u32,
    // The anchor, and the bits of bounds_last.
    @location(1) @interpolate(flat) anchor: vec3<i32>,
    @location(2) @interpolate(flat) a: vec3<f32>,
    @location(3) @interpolate(flat) b: vec3<f32>,
    @location(4) @interpolate(flat) c: vec3<f32>,
    @location(5) @interpolate(flat) a_low: vec3<f32>,
    @location(6) @interpolate(flat) color: vec4<f32>,
    @location(7) @interpolate(flat) normal: vec3<f32>,
    @location(8) @interpolate(flat) radius: f32,
}

// Vertices per splat: 3 for a triangle, 6 for the two triangles of a quad. A quad covers fewer
// pixels that the splat misses, but a triangle has half as many vertices. So triangles serve scenes
// of many small splats (src/passes/raster.rs).
override VERTICES: u32;

// How far the shape reaches past the disk, pixels. It exceeds the rounding of corners by the
// rasteriser.
const SHAPE_MARGIN: f32 = 0.05;

// Corner `number` of the shape around the unit disk (a triangle or a square), in the coordinates of
// the disk.
fn disk_corner(number: u32) -> vec2<f32> {
    if (VERTICES == 3u) {
        return vec2<f32>(select(f32(number) * 3.4641016 - 5.1961524, 0.0, number == 0u), select(-1.0, 2.0, number == 0u));
    }
    return vec2<f32>(f32(number & 1u), f32(number >> 1u)) * 2.0 - 1.0;
}

// Corner `number` of the shape around a box of pixels, relative to the first corner of the box, in
// units of its sides.
fn box_corner(number: u32) -> vec2<f32> {
    return vec2<f32>(f32(number & 1u), f32(number >> 1u)) * select(1.0, 2.0, VERTICES == 3u);
}

// The image point of a corner. The shape is the triangle or parallelogram around the image of the
// splat's disk, or around the splat's bounding box where the first shape could miss pixels: the
// rows of a thin splat have too few digits, a disk whose depth varies much has no such shape, and
// filters widen splats.
fn corner_image(splat: Splat, number: u32) -> vec2<f32> {
    let extent = bounds(splat);
    let first = vec2<f32>(extent.first);
    let size = vec2<f32>(extent.last + 1u) - first;
    let boxed = first + box_corner(number) * size;
    let a = vec3<f32>(splat.a[0], splat.a[1], splat.a[2]);
    let b = vec3<f32>(splat.b[0], splat.b[1], splat.b[2]);
    let c = homogeneous_row(splat);
    // The columns of the inverse of the matrix of rows, up to a factor. At the disk's centre u and
    // v are 0.
    let u = cross3(b, c);
    let v = cross3(c, a);
    let center = cross3(a, b);
    let thin = any(vec3<f32>(splat.a_low[0], splat.a_low[1], splat.a_low[2]) != vec3<f32>(0.0));
    // The u and v of corners are at most 2, so the homogeneous coordinate of a corner differs from
    // that of the centre by less than half.
    let level = 4.0 * (abs(u.z) + abs(v.z)) < abs(center.z);
    if (FACES || FILTERED || thin || !level || any(size > vec2<f32>(4096.0))) {
        return boxed;
    }
    // A bound on the change of u and v per pixel, anywhere on such a disk.
    let change = 2.0 * abs(center.z / dot3(a, u))
        * vec2<f32>(abs(a.x) + abs(a.y) + abs(c.x) + abs(c.y), abs(b.x) + abs(b.y) + abs(c.x) + abs(c.y));
    let corner = disk_corner(number) * (1.0 + SHAPE_MARGIN * max(change.x, change.y));
    let d = u * corner.x + v * corner.y + center;
    return vec2<f32>(f32(splat.anchor_x), f32(splat.anchor_y)) + 0.5 + d.xy / d.z;
}

// A corner in clip space. The corners of a splat that is out of view coincide outside the clip
// volume.
fn shape_corner(vertex: u32) -> ShapeCorner {
    hold();
    let index = vertex / VERTICES;
    let place = vertex % VERTICES;
    let splat = splat_of(projected[index]);
    // The triangles of a quad are 0, 1, 2 and 3, 2, 1.
    let image = corner_image(splat, select(place, 6u - place, place > 2u));
    let clip = image / vec2<f32>(f32(held.width), f32(held.height)) * vec2<f32>(2.0, -2.0) + vec2<f32>(-1.0, 1.0);
    let extent = bounds(splat);
    let empty = any(extent.first > extent.last);
    var corner: ShapeCorner;
    corner.position = vec4<f32>(-2.0, -2.0, 0.0, 1.0);
    if (!empty) {
        corner.position = vec4<f32>(clip, corner_depth(splat, image, index), 1.0);
    }
    corner.index = index;
    corner.anchor = vec3<i32>(splat.anchor_x, splat.anchor_y, bitcast<i32>(splat.bounds_last));
    corner.a = vec3<f32>(splat.a[0], splat.a[1], splat.a[2]);
    corner.b = vec3<f32>(splat.b[0], splat.b[1], splat.b[2]);
    corner.c = vec3<f32>(splat.c[0], splat.c[1], splat.c[2]);
    corner.a_low = vec3<f32>(splat.a_low[0], splat.a_low[1], splat.a_low[2]);
    return corner;
}

@vertex
fn shape(@builtin(vertex_index) vertex: u32) -> ShapeCorner {
    return shape_corner(vertex);
}

@vertex
fn shape_with_attributes(@builtin(vertex_index) vertex: u32) -> ShapeCorner {
    var corner = shape_corner(vertex);
    let attributes = attributes_of(surfel_of(corner.index), splat_of(projected[corner.index]));
    corner.color = attributes.color;
    corner.normal = attributes.normal;
    corner.radius = attributes.radius;
    return corner;
}

fn fragment_of(corner: ShapeCorner) -> Fragment {
    hold();
    let record = projected[corner.index];
    // A constructor needs every field, so none can be forgotten. The optional parts of the record
    // (clip, cap, fade) are read here only if there are any.
    let splat = Splat(
        corner.anchor.x,
        corner.anchor.y,
        // Only corner_image() reads the first bounds.
        0u,
        bitcast<u32>(corner.anchor.z),
        array<f32, 3>(corner.a.x, corner.a.y, corner.a.z),
        array<f32, 3>(corner.b.x, corner.b.y, corner.b.z),
        array<f32, 3>(corner.c.x, corner.c.y, corner.c.z),
        array<f32, 3>(corner.a_low.x, corner.a_low.y, corner.a_low.z),
        clip_in(record),
        cap_in(record),
        fade_in(record),
    );
    let pixel = vec2<u32>(corner.position.xy);
    return footprint(splat, filter_in(projected[corner.index]), pixel.x, pixel.y);
}

fn carried(corner: ShapeCorner) -> Attributes {
    // The rasteriser draws flat disks only (src/plan/needs.rs).
    var flat_: Bend;
    return attributes_without_place(corner.color, corner.normal, flat_, corner.radius);
}
