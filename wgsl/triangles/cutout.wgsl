// Leaves out points of triangles where their image is transparent. Same interface as
// cutout_absent.wgsl.
// Twin: excess_alpha in src/scene/triangles.rs.
// #import triangles::{Triangle, cross_precisely}
// #import triangles_attributes::{TRIANGLE_RECORDS, TRIANGLE_WORDS, triangle_attributes}
// #import triangles_texture::{TRIANGLE_PLACES, image_of_triangle}

// The least alpha of an image's point that shows; 0 if all points do.
fn least_alpha(record: u32) -> f32 {
    return triangle_attributes[record + TRIANGLE_PLACES + 7u];
}

// Whether the triangle is there at the image point p, which it covers.
fn shows(triangle: Triangle, number: u32, p: vec2<f32>) -> bool {
    let record = TRIANGLE_RECORDS + number * TRIANGLE_WORDS;
    let least = least_alpha(record);
    if (least == 0.0) {
        return true;
    }
    let crossed = cross_precisely(triangle, p);
    return image_of_triangle(record, crossed.parts, crossed.spread).w >= least;
}
