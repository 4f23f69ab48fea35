// Stage 4: every fragment of a pixel by itself, from front to back. Twin: src/passes/sorted.rs.
// All loops end, by 1 of src/gpu/loops.rs: 0x377cebb42feee805

fn composite(pixel: u32, x: u32, y: u32) -> Shown {
    let list = list_of(pixel);
    var shown = shown_nothing();
    for (var key = list.x; key < list.y; key++) {
        let record = record_at(keys[key].y);
        let mapped = listed_normal(record) * 2.0 - 1.0;
        let normal = mapped * (side_of(bitcast<f32>(keys[key].x)) * inverseSqrt(max(dot(mapped, mapped), 1e-12)));
        let color = shaded(held.color_low + held.color_span * listed_color(record), normal, x, y);
        shown = with_behind(shown, vec4<f32>(color.rgb, color.a * listed_weight(record)));
        if (shown.transmittance < LEAST_TRANSMITTANCE) {
            break;
        }
    }
    return shown;
}
