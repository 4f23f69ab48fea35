// Splats of cuts that fade into each other, and in which of them they are (src/scene/fade.rs).
// A fragment weighs as many parts as these are; depths have no weights, and each sample shows that of one cut.
// Same interface as fade_absent.wgsl.

// How many cuts.
const FADE_STEPS: f32 = 64.0;

struct Fade {
    // The first, and one more than the last.
    first: u32,
    end: u32,
}

// That of a surfel at a place of its page.
fn fade_of(index: u32, place: u32) -> Fade {
    let word = fade_word(index, place);
    return Fade(word & 0xffu, word >> 8u);
}

// Its row in a splat's record, the last one.
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

// Whether the cut that the sample shows has the splat.
fn takes_sample(fade: Fade, x: u32, y: u32) -> bool {
    // The lowest three digits of both, from the lowest on: those of the number of a cut from the highest on.
    let differ = x ^ y;
    let cut = ((differ & 1u) << 5u) | ((y & 1u) << 4u)
        | ((differ & 2u) << 2u) | ((y & 2u) << 1u)
        | ((differ & 4u) >> 1u) | ((y & 4u) >> 2u);
    return cut >= fade.first && cut < fade.end;
}

// Whether what is nearest lies within epsilon behind a fragment, which may be of another cut; not where this cut has nothing, infinitely far or (tile.wgsl) at 0.
fn meets_front(depth: f32, front: f32, radius: f32, image: vec2<f32>) -> bool {
    return front > 0.0 && farthest_shown(depth, radius, image) >= front;
}
