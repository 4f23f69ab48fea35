// Textured triangles: the lookup for a pixel (textures.wgsl). Same interface as
// triangles_texture_absent.wgsl.
// #import cutout::{least_alpha}
// #import textures::{seen_texture}
// #import triangles_attributes::{triangle_attributes}

// The first word of the texture coordinates in a triangle's record.
override TRIANGLE_PLACES: u32;

// The least alpha at which a point of a cut-out image shows; it is then opaque.
const CUT: f32 = 0.5;

// The premultiplied texture colour of a point that shows. `spread` is the barycentric area of the
// pixel.
fn triangle_texture(record: u32, parts: vec3<f32>, spread: f32) -> vec4<f32> {
    let seen = image_of_triangle(record, parts, spread);
    return select(seen, seen / seen.w, least_alpha(record) == CUT);
}

fn image_of_triangle(record: u32, parts: vec3<f32>, spread: f32) -> vec4<f32> {
    let first = record + TRIANGLE_PLACES;
    let a = vec2<f32>(triangle_attributes[first], triangle_attributes[first + 1u]);
    let b = vec2<f32>(triangle_attributes[first + 2u], triangle_attributes[first + 3u]);
    let c = vec2<f32>(triangle_attributes[first + 4u], triangle_attributes[first + 5u]);
    // One plus the texture's number; 0 if there is none.
    let number = u32(triangle_attributes[first + 6u]);
    let doubled_area = abs((b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x));
    let place = a + parts.y * (b - a) + parts.z * (c - a);
    let seen = seen_texture(max(number, 1u) - 1u, place, spread * doubled_area);
    return select(seen, vec4<f32>(1.0), number == 0u);
}
