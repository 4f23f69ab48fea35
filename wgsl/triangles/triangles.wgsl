// A triangle at a pixel: the only place where coverage, depth and barycentric coordinates are
// decided. Twin: src/passes/triangles.rs, which explains the method.
// #import corner_*::{homogeneous_depth, is_before, shared_depth, spread_of_parts}
// #import corners::{Corner}
// #import double::{Double, product, quotient, sum}
// #import layout::{held}
// #import rows::{minor, single}
// #import vectors::{dot3}

// The indices of each triangle's three corners.
@group(0) @binding(54) var<storage, read> triangles: array<u32>;
@group(0) @binding(55) var<storage, read> corners: array<array<f32, 9>>;

struct Triangle {
    numbers: vec3<u32>,
    a: Corner,
    b: Corner,
    c: Corner,
}

fn triangles_held() -> u32 {
    return arrayLength(&triangles) / 3u;
}

fn corner_at(number: u32) -> Corner {
    let c = corners[number];
    return Corner(Double(c[0], c[1]), Double(c[2], c[3]), Double(c[4], c[5]), Double(c[6], c[7]), c[8]);
}

fn triangle_at(number: u32) -> Triangle {
    let numbers = vec3<u32>(triangles[3u * number], triangles[3u * number + 1u], triangles[3u * number + 2u]);
    return Triangle(numbers, corner_at(numbers.x), corner_at(numbers.y), corner_at(numbers.z));
}

// Image coordinates of plain corners are below this, pixels.
const PLAIN_REACH: f32 = 65536.0;

// Whether the corner is plain. On which side of an edge between two plain corners a point lies is
// decided in f32, in every triangle.
fn is_plain(corner: Corner) -> bool {
    return is_before(corner) && max(abs(corner.x.high), abs(corner.y.high)) < PLAIN_REACH;
}

// The plain corner's position relative to the image point p. No digit of the difference is lost.
fn plain_spoke(corner: Corner, p: vec2<f32>) -> vec2<f32> {
    return vec2<f32>(
        (corner.x.high - p.x) + corner.x.low,
        (corner.y.high - p.y) + corner.y.low,
    );
}

// Twice the signed area of the triangle of two corners and the point p that they are relative to.
// Every kernel rounds it alike, and swapping the corners changes its sign and nothing else.
fn plain_area(from_: vec2<f32>, to: vec2<f32>) -> f32 {
    return from_.x * to.y - from_.y * to.x;
}

// The side of an edge on which the point lies: 1 or -1, or 0 if the edge has no length. A point on
// the edge counts as slightly to the right of it; on a level edge, as slightly below.
fn side_by(area: f32, right: f32, below: f32) -> f32 {
    return sign(select(select(below, right, right != 0.0), area, area != 0.0));
}

fn plain_side(area: f32, from_: vec2<f32>, to: vec2<f32>) -> f32 {
    return side_by(area, from_.y - to.y, to.x - from_.x);
}

// A triangle at a pixel.
struct Crossing {
    hit: bool,
    // Camera-space z, device units.
    depth: f32,
    // The barycentric coordinates, whose sum is 1.
    parts: vec3<f32>,
    // The barycentric area of a pixel.
    spread: f32,
}

// The side of its edges on which a triangle that is left out has its points: 1 for triangles that
// face away, or 0 if none is left out.
override CULLED_SIDE: f32;

// Whether the point is in a visible triangle, by the sides of its edges, and not nearer than the
// near depth. False for NaN.
fn is_hit(sides: vec3<f32>, depth: f32) -> bool {
    let inside = sides.x != 0.0 && sides.x == sides.y && sides.x == sides.z;
    return inside && sides.x != CULLED_SIDE && depth >= held.near;
}

// The crossing in f32, for triangles that are not ill-formed (is_ill_formed()) and whose corners
// are all plain.
fn cross_plainly(triangle: Triangle, p: vec2<f32>) -> Crossing {
    let a = plain_spoke(triangle.a, p);
    let b = plain_spoke(triangle.b, p);
    let c = plain_spoke(triangle.c, p);
    let areas = vec3<f32>(plain_area(b, c), plain_area(c, a), plain_area(a, b));
    let sides = vec3<f32>(plain_side(areas.x, b, c), plain_side(areas.y, c, a), plain_side(areas.z, a, b));
    let weighed = areas * vec3<f32>(triangle.a.share, triangle.b.share, triangle.c.share);
    let parts = weighed / (weighed.x + weighed.y + weighed.z);
    let depths = vec3<f32>(triangle.a.depth.high, triangle.b.depth.high, triangle.c.depth.high);
    let depth = dot3(parts, depths);
    return Crossing(is_hit(sides, depth), depth, parts, 0.0);
}

// An edge seen from a point of the image.
struct Edge {
    // The area times the side, so not negative; 0 if the sign of the area differs from the side.
    area: Double,
    side: f32,
}

fn spoke(corner: Corner, p: f32, image: Double) -> Double {
    return sum(image, product(corner.w, single(-p)));
}

// An edge in doubled arithmetic. The evaluation starts at the corner with the lower index, so both
// triangles of the edge get the same numbers; `turned` is -1 for the triangle that has it the other
// way round.
fn doubled_edge(from_: Corner, to: Corner, p: vec2<f32>, turned: f32) -> Edge {
    let a_x = spoke(from_, p.x, from_.x);
    let a_y = spoke(from_, p.y, from_.y);
    let b_x = spoke(to, p.x, to.x);
    let b_y = spoke(to, p.y, to.y);
    let area = minor(a_x, b_y, a_y, b_x);
    let right = to.w.high * a_y.high - from_.w.high * b_y.high;
    let below = from_.w.high * b_x.high - to.w.high * a_x.high;
    return Edge(Double(turned * area.high, turned * area.low), turned * side_by(area.high, right, below));
}

fn precise_edge(from_: Corner, to: Corner, numbers: vec2<u32>, p: vec2<f32>) -> Edge {
    var edge: Edge;
    if (numbers.x < numbers.y) {
        edge = doubled_edge(from_, to, p, 1.0);
    } else {
        edge = doubled_edge(to, from_, p, -1.0);
    }
    if (is_plain(from_) && is_plain(to)) {
        let a = plain_spoke(from_, p);
        let b = plain_spoke(to, p);
        edge.side = plain_side(plain_area(a, b), a, b);
    }
    let agrees = edge.area.high * edge.side > 0.0;
    edge.area = Double(select(0.0, edge.side * edge.area.high, agrees), select(0.0, edge.side * edge.area.low, agrees));
    return edge;
}

// In doubled arithmetic, for any triangle. Sides of edges between plain corners still come from
// f32.
fn cross_precisely(triangle: Triangle, p: vec2<f32>) -> Crossing {
    let a = precise_edge(triangle.b, triangle.c, triangle.numbers.yz, p);
    let b = precise_edge(triangle.c, triangle.a, triangle.numbers.zx, p);
    let c = precise_edge(triangle.a, triangle.b, triangle.numbers.xy, p);
    let weighed_a = quotient(a.area, homogeneous_depth(triangle.a));
    let weighed_b = quotient(b.area, homogeneous_depth(triangle.b));
    let weighed_c = quotient(c.area, homogeneous_depth(triangle.c));
    let whole = sum(sum(weighed_a, weighed_b), weighed_c);
    let of_depth = sum(
        sum(product(a.area, shared_depth(triangle.a)), product(b.area, shared_depth(triangle.b))),
        product(c.area, shared_depth(triangle.c)),
    );
    // In a sliver, the signs of all areas may differ from the sides, which come from f32. Then all
    // three barycentric coordinates are 1/3.
    let is_told = whole.high > 0.0;
    let told = vec3<f32>(weighed_a.high, weighed_b.high, weighed_c.high) / whole.high;
    let parts = select(vec3<f32>(1.0 / 3.0), told, is_told);
    let depths = vec3<f32>(triangle.a.depth.high, triangle.b.depth.high, triangle.c.depth.high);
    let depth = select(dot3(parts, depths), quotient(of_depth, whole).high, is_told);
    let spread = abs(spread_of_parts(triangle, depth, of_depth.high));
    return Crossing(is_hit(vec3<f32>(a.side, b.side, c.side), depth), depth, parts, spread);
}
