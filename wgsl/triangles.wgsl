// A triangle at a pixel: the one place where coverage, depth and the corners' parts are decided. Twin: src/passes/triangles.rs.

// Three words a triangle: its corners.
@group(0) @binding(54) var<storage, read> triangles: array<u32>;
@group(0) @binding(55) var<storage, read> corners: array<Corner>;

struct Triangle {
    numbers: vec3<u32>,
    a: Corner,
    b: Corner,
    c: Corner,
    // All corners have images.
    before: bool,
}

fn triangles_held() -> u32 {
    return arrayLength(&triangles) / 3u;
}

fn triangle_at(index: u32) -> Triangle {
    let numbers = vec3<u32>(triangles[3u * index], triangles[3u * index + 1u], triangles[3u * index + 2u]);
    let a = corners[numbers.x];
    let b = corners[numbers.y];
    let c = corners[numbers.z];
    return Triangle(numbers, a, b, c, is_before(a) && is_before(b) && is_before(c));
}

// An edge seen from a point of the image: the doubled area between the two, and on which side of the edge the point lies, 0 if it has none.
struct Edge {
    area: f32,
    side: i32,
}

// A corner relative to the point p.
fn spoke(corner: Corner, p: f32, image: Double) -> Double {
    return sum(image, product(corner.w, single(-p)));
}

// The edge from one corner to another. Its two triangles go along it in opposite directions, and see it by the same numbers: from the corner
// of the lower number, and turned. A point on it lies where the one right of it does, or of a level edge the one below.
fn edge_of(from_: Corner, to: Corner, p: vec2<f32>, turned: bool) -> Edge {
    let a_x = spoke(from_, p.x, from_.x);
    let a_y = spoke(from_, p.y, from_.y);
    let b_x = spoke(to, p.x, to.x);
    let b_y = spoke(to, p.y, to.y);
    let area = minor(a_x, b_y, a_y, b_x).high;
    let right = to.w.high * a_y.high - from_.w.high * b_y.high;
    let below = from_.w.high * b_x.high - to.w.high * a_x.high;
    let decided = select(select(below, right, right != 0.0), area, area != 0.0);
    let side = i32(sign(decided));
    return Edge(select(area, -area, turned), select(side, -side, turned));
}

fn edge(from_: Corner, to: Corner, numbers: vec2<u32>, p: vec2<f32>) -> Edge {
    if (numbers.x < numbers.y) {
        return edge_of(from_, to, p, false);
    }
    return edge_of(to, from_, p, true);
}

// What of a triangle is at a pixel.
struct Crossing {
    hit: bool,
    // Camera-space z, device units.
    depth: f32,
    // The corners' parts, whose sum is 1.
    parts: vec3<f32>,
}

// Of the areas beside each corner's opposite edge.
fn crossing(triangle: Triangle, areas: vec3<f32>) -> Crossing {
    let weighed = areas * vec3<f32>(triangle.a.share, triangle.b.share, triangle.c.share);
    let parts = weighed / (weighed.x + weighed.y + weighed.z);
    let depth = dot(parts, vec3<f32>(triangle.a.depth, triangle.b.depth, triangle.c.depth));
    // Not of what is no number.
    return Crossing(depth >= held.near, depth, parts);
}

// In doubled arithmetic.
fn cross_precisely(triangle: Triangle, p: vec2<f32>) -> Crossing {
    let a = edge(triangle.b, triangle.c, triangle.numbers.yz, p);
    let b = edge(triangle.c, triangle.a, triangle.numbers.zx, p);
    let c = edge(triangle.a, triangle.b, triangle.numbers.xy, p);
    if (a.side == 0 || a.side != b.side || a.side != c.side) {
        return Crossing(false, 0.0, vec3<f32>(0.0));
    }
    return crossing(triangle, vec3<f32>(a.area, b.area, c.area));
}

// The sign of an area of f32 is sure where it is more than this part of the products that it is a difference of.
const SURE: f32 = 5e-7;
// Parts and depths of f32 are exact enough where these products exceed the areas no more than so many times.
const WELL_FORMED: f32 = 4.0;

fn plain_spoke(corner: Corner, p: vec2<f32>) -> vec2<f32> {
    return (vec2<f32>(corner.x.high, corner.y.high) - p) + vec2<f32>(corner.x.low, corner.y.low);
}

// In f32 where that is as good.
fn cross_at(triangle: Triangle, x: u32, y: u32) -> Crossing {
    let p = vec2<f32>(f32(x), f32(y)) + 0.5;
    if (triangle.before) {
        let a = plain_spoke(triangle.a, p);
        let b = plain_spoke(triangle.b, p);
        let c = plain_spoke(triangle.c, p);
        let plus = vec3<f32>(b.x * c.y, c.x * a.y, a.x * b.y);
        let minus = vec3<f32>(b.y * c.x, c.y * a.x, a.y * b.x);
        let areas = plus - minus;
        let terms = abs(plus) + abs(minus);
        let out_left = areas < -SURE * terms;
        let out_right = areas > SURE * terms;
        if (any(out_left) && any(out_right)) {
            return Crossing(false, 0.0, vec3<f32>(0.0));
        }
        let shares = vec3<f32>(triangle.a.share, triangle.b.share, triangle.c.share);
        let is_sure = all(out_left) || all(out_right);
        if (is_sure && dot(terms, shares) <= WELL_FORMED * abs(dot(areas, shares))) {
            return crossing(triangle, areas);
        }
    }
    return cross_precisely(triangle, p);
}
