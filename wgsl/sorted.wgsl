// Stage 4: every fragment of a pixel by itself, from front to back. Twin: src/passes/sorted.rs.
// All loops end, by 1 of src/gpu/loops.rs: 0x7e6ec6883246358f

// Rules in the twin.
override MOST_ALPHA: f32;
override LEAST_SHOWN: f32;
override LEAVES_LAST: bool;

fn composite(pixel: u32, out: u32, x: u32, y: u32) -> Shown {
    let list = list_of(pixel);
    var shown = shown_nothing();
    for (var key = list.x; key < list.y; key++) {
        let record = record_at(keys[key].y);
        let mapped = listed_normal(record) * 2.0 - 1.0;
        let normal = mapped * (side_of(bitcast<f32>(keys[key].x)) * inverseSqrt(max(dot(mapped, mapped), 1e-12)));
        let color = shaded(held.color_low + held.color_span * listed_color(record), normal, x, y);
        let alpha = min(color.a * listed_weight(record), MOST_ALPHA);
        let next = with_behind(shown, vec4<f32>(color.rgb, alpha));
        let shows_more = next.transmittance >= LEAST_SHOWN;
        if (shows_more || !LEAVES_LAST) {
            write_surface(out, shown.layers, bitcast<f32>(keys[key].x), alpha);
            shown = next;
        }
        if (!shows_more) {
            break;
        }
    }
    return shown;
}
