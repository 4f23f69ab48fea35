// Fades of levels of detail: several cuts are drawn at once, and each splat has the range of cuts
// that contain it (src/scene/fade.rs). A fragment's weight is multiplied by the fraction of the
// cuts in that range. Depths have no weights, so each sample takes the nearest depth of one cut.
// Same interface as fade_absent.wgsl.
// #import camera_orthographic|perspective::{Fragment}
// #import clip::{CLIP_ROWS}
// #import curved|facing|flat::{CAP_ROWS}
// #import epsilon_*::{farthest_shown}
// #import fade_own|select_fades::{fade_word}
// #import filter|lowpass_none::{FILTER_ROWS}
// #import records::{SplatRecord}
// #import words|words_long::{each_word, words}

// The number of cuts.
const FADE_STEPS: f32 = 64.0;

struct Fade {
    // The first cut, and one past the last.
    first: u32,
    end: u32,
}

// The fade of the surfel `index`, which has this place in its page.
fn fade_of(index: u32, place: u32) -> Fade {
    let word = fade_word(index, place);
    return Fade(word & 0xffu, word >> 8u);
}

// Rows of the fade in a splat's record (records.wgsl).
const FADE_ROWS: u32 = 1u;

fn with_fade(record: SplatRecord, fade: Fade) -> SplatRecord {
    var faded_ = record;
    faded_[4u + FILTER_ROWS + CLIP_ROWS + CAP_ROWS] = words(vec4<u32>(fade.first, fade.end, 0u, 0u));
    return faded_;
}

fn fade_in(record: SplatRecord) -> Fade {
    let row = each_word(record[4u + FILTER_ROWS + CLIP_ROWS + CAP_ROWS]);
    return Fade(row.x, row.y);
}

fn faded(fragment: Fragment, fade: Fade) -> Fragment {
    var less = fragment;
    less.gain *= f32(fade.end - fade.first) / FADE_STEPS;
    return less;
}

// Whether the cut that the sample shows contains the splat.
fn takes_sample(fade: Fade, x: u32, y: u32) -> bool {
    // Fade::threshold in src/scene/fade.rs, an ordered dither. From its highest bit on, the cut's
    // number has bit 0 of x ^ y and of y, then bit 1 of both, then bit 2 of both.
    let differ = x ^ y;
    let cut = ((differ & 1u) << 5u) | ((y & 1u) << 4u)
        | ((differ & 2u) << 2u) | ((y & 2u) << 1u)
        | ((differ & 4u) >> 1u) | ((y & 4u) >> 2u);
    return cut >= fade.first && cut < fade.end;
}

// Whether the nearest depth, `front`, lies at most epsilon behind a fragment, which may be of
// another cut. False if this cut has nothing at the pixel: `front` is then +inf, or 0 in tile.wgsl.
fn meets_front(depth: f32, front: f32, radius: f32, image: vec2<f32>) -> bool {
    return front > 0.0 && farthest_shown(depth, radius, image) >= front;
}
