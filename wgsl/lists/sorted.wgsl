// Stage 4: composites every fragment of a pixel by itself, from front to back.
// Twin: src/passes/sorted.rs.
// All loops end, by 1 of src/gpu/loops.rs: 0xc25542ba6e8b7305
// #import compositing::{Compositing, with_joined}
// #import fragments::{keys, listed_color, listed_normal, listed_weight, record_at}
// #import join_lists::{has_triangle, is_behind_triangle, triangle_depth}
// #import layout::{held}
// #import long_lists::{next_round}
// #import maps::{write_surface}
// #import resolve::{shaded}
// #import resolve_lists::{with_behind}
// #import side::{side_of}
// #import vectors::{dot3}

// The fields of Rules in the twin.
override MOST_ALPHA: f32;
override LEAST_SHOWN: f32;
override LEAVES_LAST: bool;

fn composite_on(before: Compositing, end: u32, out: u32, x: u32, y: u32) -> Compositing {
    var so_far = before;
    let triangle = triangle_depth(x, y);
    for (; so_far.first < end && next_round(); so_far.first++) {
        let key = keys[so_far.first];
        if (!so_far.joined && is_behind_triangle(bitcast<f32>(key.x), triangle)) {
            so_far = with_joined(so_far, triangle, out, x, y);
            if (so_far.shown.transmittance < LEAST_SHOWN) {
                so_far.first = end;
                break;
            }
        }
        let record = record_at(key.y);
        let mapped = listed_normal(record) * 2.0 - 1.0;
        let normal = mapped * (side_of(bitcast<f32>(key.x)) * inverseSqrt(max(dot3(mapped, mapped), 1e-12)));
        let color = shaded(held.color_low + held.color_span * listed_color(record), normal, x, y);
        let alpha = min(color.a * listed_weight(record), MOST_ALPHA);
        let next = with_behind(so_far.shown, vec4<f32>(color.rgb, alpha));
        let shows_more = next.transmittance >= LEAST_SHOWN;
        if (shows_more || !LEAVES_LAST) {
            write_surface(out, so_far.shown.layers, bitcast<f32>(key.x), alpha);
            so_far.shown = next;
        }
        if (!shows_more) {
            so_far.first = end;
            break;
        }
    }
    // The triangle may lie behind all fragments.
    let shows = has_triangle(triangle) && so_far.shown.transmittance >= LEAST_SHOWN;
    if (so_far.first >= end && !so_far.joined && shows) {
        so_far = with_joined(so_far, triangle, out, x, y);
    }
    return so_far;
}
