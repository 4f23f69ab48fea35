// The path that compute is compared with (Botsch et al. 2005): a triangle or quad a splat, the rasteriser's depth test for the nearest
// depth, its blender for the sums. Splats, footprint, kernel, attributes and resolve are those of the compute path.
// Host side and what the variants mean: src/passes/raster.rs.

@group(0) @binding(5) var<storage, read> projected: array<SplatRecord>;

// What a splat's fragments need is read once a corner and handed on unchanged: reading the record again at each fragment
// took a software adapter twice as long.
struct ShapeCorner {
    @builtin(position) position: vec4<f32>,
    @location(0) @interpolate(flat) index: u32,
    // And bounds_last.
    @location(1) @interpolate(flat) anchor: vec3<i32>,
    @location(2) @interpolate(flat) a: vec3<f32>,
    @location(3) @interpolate(flat) b: vec3<f32>,
    @location(4) @interpolate(flat) c: vec3<f32>,
    @location(5) @interpolate(flat) a_low: vec3<f32>,
    @location(6) @interpolate(flat) color: vec4<f32>,
    @location(7) @interpolate(flat) normal: vec3<f32>,
    @location(8) @interpolate(flat) radius: f32,
}

// Vertices of a splat: 3 for one triangle, 6 for the two of a quad. A quad has fewer pixels that the splat misses, a
// triangle half the cost of its own: so triangles where splats are many and small (src/passes/raster.rs).
override VERTICES: u32;

// How far the shape reaches past the disk, pixels: more than the rasteriser rounds corners.
const SHAPE_MARGIN: f32 = 0.05;

// Corner `number` of the shape about the unit disk, in the disk's coordinates: a triangle, or a square.
fn disk_corner(number: u32) -> vec2<f32> {
    if (VERTICES == 3u) {
        return vec2<f32>(select(f32(number) * 3.4641016 - 5.1961524, 0.0, number == 0u), select(-1.0, 2.0, number == 0u));
    }
    return vec2<f32>(f32(number & 1u), f32(number >> 1u)) * 2.0 - 1.0;
}

// Corner `number` of the shape about a box of pixels, from the box's first corner in units of its sides.
fn box_corner(number: u32) -> vec2<f32> {
    return vec2<f32>(f32(number & 1u), f32(number >> 1u)) * select(1.0, 2.0, VERTICES == 3u);
}

// The image point of a corner: of the triangle or parallelogram about the image of the splat's disk, or about its
// bounds where that could leave out pixels: a thin splat's rows have too few digits, a disk much nearer at one side than
// at the other has no such shape, and filters widen splats.
fn corner_image(splat: Splat, number: u32) -> vec2<f32> {
    let extent = bounds(splat);
    let first = vec2<f32>(extent.first);
    let size = vec2<f32>(extent.last + 1u) - first;
    let boxed = first + box_corner(number) * size;
    let a = vec3<f32>(splat.a[0], splat.a[1], splat.a[2]);
    let b = vec3<f32>(splat.b[0], splat.b[1], splat.b[2]);
    let c = homogeneous_row(splat);
    // The columns of the rows' inverse, up to a factor; at the disk's centre u = v = 0.
    let u = cross3(b, c);
    let v = cross3(c, a);
    let center = cross3(a, b);
    let thin = any(vec3<f32>(splat.a_low[0], splat.a_low[1], splat.a_low[2]) != vec3<f32>(0.0));
    // Corners are within 2 of the centre: there the homogeneous coordinate stays within half of the centre's.
    let level = 4.0 * (abs(u.z) + abs(v.z)) < abs(center.z);
    if (FACES || FILTERED || thin || !level || any(size > vec2<f32>(4096.0))) {
        return boxed;
    }
    // A step of a pixel changes u and v by less than this, anywhere on such a disk.
    let change = 2.0 * abs(center.z / dot3(a, u))
        * vec2<f32>(abs(a.x) + abs(a.y) + abs(c.x) + abs(c.y), abs(b.x) + abs(b.y) + abs(c.x) + abs(c.y));
    let corner = disk_corner(number) * (1.0 + SHAPE_MARGIN * max(change.x, change.y));
    let d = u * corner.x + v * corner.y + center;
    return vec2<f32>(f32(splat.anchor_x), f32(splat.anchor_y)) + 0.5 + d.xy / d.z;
}

// A corner in clip space; a splat out of view has none.
fn shape_corner(vertex: u32) -> ShapeCorner {
    hold();
    let index = vertex / VERTICES;
    let place = vertex % VERTICES;
    let splat = splat_of(projected[index]);
    // The quad's triangles are 0, 1, 2 and 3, 2, 1.
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
    // A constructor names every field, so that none is forgotten. The record's own are read only
    // where there are any.
    let splat = Splat(
        corner.anchor.x,
        corner.anchor.y,
        // corner_image() alone looks at bounds.
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
    // The rasteriser draws flat disks (src/plan/needs.rs).
    var flat_: Bend;
    return attributes_without_place(corner.color, corner.normal, flat_, corner.radius);
}
