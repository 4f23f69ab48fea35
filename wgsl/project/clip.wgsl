// Disks that end at lines in their own planes: at a border, or where the surface has an edge. A
// point (u, v) of the unit disk is kept unless it lies beyond one of two lines (Zwicker et al.
// 2004, Perspective Accurate Splatting, section 5). Polygons also end at their sides
// (outline.wgsl).
// Same interface as clip_absent.wgsl. Twins: src/scene/clip.rs, src/passes/footprint.rs.
// #import attributes::{attribute_word}
// #import camera_orthographic|perspective::{Fragment, homogeneous}
// #import filter|lowpass_none::{FILTER_ROWS}
// #import outline::{beyond_outline}
// #import records::{SplatRecord}
// #import vectors::{dot3}
// #import words|words_long::{each_word, words}

// The first of the six words of a surfel's attributes that hold its two lines.
override CLIP_WORD: u32;

struct Clip {
    // Points with line . (u, v, 1) >= 0 are kept.
    first: vec3<f32>,
    second: vec3<f32>,
    // Cosine and sine of the angle by which the unit disk was rotated in itself (rows.wgsl).
    turn: vec2<f32>,
}

// The lines of a surfel, for a unit disk that `turn` has rotated in itself.
fn clip_of(index: u32, turn: vec2<f32>) -> Clip {
    return Clip(turned_line(index, CLIP_WORD, turn), turned_line(index, CLIP_WORD + 3u, turn), turn);
}

fn turned_line(index: u32, word: u32, turn: vec2<f32>) -> vec3<f32> {
    let line = vec3<f32>(
        bitcast<f32>(attribute_word(index, word)),
        bitcast<f32>(attribute_word(index, word + 1u)),
        bitcast<f32>(attribute_word(index, word + 2u)),
    );
    return vec3<f32>(line.x * turn.x + line.y * turn.y, line.y * turn.x - line.x * turn.y, line.z);
}

// Rows of the lines in a splat's record (records.wgsl).
const CLIP_ROWS: u32 = 2u;

fn with_clip(record: SplatRecord, clip: Clip) -> SplatRecord {
    var clipped_ = record;
    let at = 4u + FILTER_ROWS;
    clipped_[at] = words(bitcast<vec4<u32>>(vec4<f32>(clip.first, clip.second.x)));
    clipped_[at + 1u] = words(bitcast<vec4<u32>>(vec4<f32>(clip.second.yz, clip.turn)));
    return clipped_;
}

fn clip_in(record: SplatRecord) -> Clip {
    let first = bitcast<vec4<f32>>(each_word(record[4u + FILTER_ROWS]));
    let second = bitcast<vec4<f32>>(each_word(record[5u + FILTER_ROWS]));
    return Clip(first.xyz, vec3<f32>(first.w, second.xy), second.zw);
}

// Whether a point lies beyond a line, or beyond a side of the polygon. `p` is (u, v, 1) times a
// factor that is positive in front of the camera.
fn cuts(clip: Clip, p: vec3<f32>) -> bool {
    return p.z > 0.0 && (dot3(clip.first, p) < 0.0 || dot3(clip.second, p) < 0.0 || beyond_outline(clip.turn, p));
}

fn clipped(fragment: Fragment, clip: Clip, abc: vec3<f32>) -> Fragment {
    var kept = fragment;
    kept.hit = fragment.hit && !cuts(clip, homogeneous(abc));
    return kept;
}
