// The record of a splat: sixteen words, then the optional rows of its low-pass, its clip lines, its
// cap and its fade (filter.wgsl, clip.wgsl, curved.wgsl, fade.wgsl). If slots are not in the order
// of the surfels, spare bits of the anchor store the surfel's batch (cull.wgsl).
// #import clip::{CLIP_ROWS, clip_in, with_clip}
// #import cull|cull_absent|cull_twice::{anchor_of, anchor_words}
// #import curved|facing|flat::{CAP_ROWS, cap_in, with_cap}
// #import fade::{FADE_ROWS, fade_in, with_fade}
// #import filter|lowpass_none::{FILTER_ROWS, Filter, with_filter}
// #import layout::{Splat}
// #import words|words_long::{Words, each_word, words}

alias SplatRecord = array<Words, 4u + FILTER_ROWS + CLIP_ROWS + CAP_ROWS + FADE_ROWS>;

fn splat_record(splat: Splat, place: u32, filter_: Filter) -> SplatRecord {
    var record: SplatRecord;
    record[0] = words(vec4<u32>(anchor_words(splat, place), splat.bounds_first, splat.bounds_last));
    record[1] = words(bitcast<vec4<u32>>(vec4<f32>(splat.a[0], splat.a[1], splat.a[2], splat.b[0])));
    record[2] = words(bitcast<vec4<u32>>(vec4<f32>(splat.b[1], splat.b[2], splat.c[0], splat.c[1])));
    record[3] = words(bitcast<vec4<u32>>(vec4<f32>(splat.c[2], splat.a_low[0], splat.a_low[1], splat.a_low[2])));
    return with_fade(with_cap(with_clip(with_filter(record, filter_), splat.clip), splat.cap), splat.fade);
}

fn splat_of(record: SplatRecord) -> Splat {
    let head = each_word(record[0]);
    let anchor = anchor_of(head.xy);
    let first = bitcast<vec4<f32>>(each_word(record[1]));
    let second = bitcast<vec4<f32>>(each_word(record[2]));
    let third = bitcast<vec4<f32>>(each_word(record[3]));
    return Splat(
        anchor.x,
        anchor.y,
        head.z,
        head.w,
        array<f32, 3>(first.x, first.y, first.z),
        array<f32, 3>(first.w, second.x, second.y),
        array<f32, 3>(second.z, second.w, third.x),
        array<f32, 3>(third.y, third.z, third.w),
        clip_in(record),
        cap_in(record),
        fade_in(record),
    );
}
