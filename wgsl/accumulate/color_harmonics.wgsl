// A surfel's colour from four f32 (straight alpha) and spherical harmonics in the direction from
// the eye to its centre. After these four words, each term of the harmonics has three: red, green
// and blue.
// Twin: src/scene/harmonics.rs.
// All loops end, by 1 of src/gpu/loops.rs: 0x8f3393ef138ea48e
// #import attributes::{attribute_vector, attribute_word}
// #import camera_orthographic|perspective::{ray_to}
// #import center|center_doubled::{relative_center}
// #import words|words_long::{surfel_at}

override HARMONICS_DEGREE: u32;

const MOST_TERMS: u32 = 15u;

// The basis functions in the unit direction d, up to HARMONICS_DEGREE. The others stay 0 and are
// not read.
fn harmonics(d: vec3<f32>) -> array<f32, MOST_TERMS> {
    let xx = d.x * d.x;
    let yy = d.y * d.y;
    let zz = d.z * d.z;
    var terms: array<f32, MOST_TERMS>;
    terms[0] = -0.48860251190291992 * d.y;
    terms[1] = 0.48860251190291992 * d.z;
    terms[2] = -0.48860251190291992 * d.x;
    if (HARMONICS_DEGREE > 1u) {
        terms[3] = 1.0925484305920791 * d.x * d.y;
        terms[4] = -1.0925484305920791 * d.y * d.z;
        terms[5] = 0.31539156525252001 * (2.0 * zz - xx - yy);
        terms[6] = -1.0925484305920791 * d.x * d.z;
        terms[7] = 0.54627421529603954 * (xx - yy);
    }
    if (HARMONICS_DEGREE > 2u) {
        terms[8] = -0.59004358992664351 * d.y * (3.0 * xx - yy);
        terms[9] = 2.8906114426405541 * d.x * d.y * d.z;
        terms[10] = -0.45704579946446574 * d.y * (4.0 * zz - xx - yy);
        terms[11] = 0.37317633259011540 * d.z * (2.0 * zz - 3.0 * xx - 3.0 * yy);
        terms[12] = -0.45704579946446574 * d.x * (4.0 * zz - xx - yy);
        terms[13] = 1.4453057213202770 * d.z * (xx - yy);
        terms[14] = -0.59004358992664351 * d.x * (xx - 3.0 * yy);
    }
    return terms;
}

fn surfel_alpha(index: u32) -> f32 {
    return bitcast<f32>(attribute_word(index, 3u));
}

fn premultiplied_color(index: u32) -> vec4<f32> {
    let color = attribute_vector(index, 0u);
    let relative = relative_center(index, surfel_at(index));
    let terms = harmonics(ray_to(vec3<f32>(relative[0].high, relative[1].high, relative[2].high)));
    var seen = color.rgb;
    for (var k = 0u; k < (HARMONICS_DEGREE + 2u) * HARMONICS_DEGREE; k++) {
        let word = 4u + 3u * k;
        let term = vec3<u32>(attribute_word(index, word), attribute_word(index, word + 1u), attribute_word(index, word + 2u));
        seen += bitcast<vec3<f32>>(term) * terms[k];
    }
    return vec4<f32>(max(seen, vec3<f32>(0.0)) * color.a, color.a);
}
