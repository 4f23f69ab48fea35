// The splat's record evaluated at a pixel: the one place where coverage, depth and rho are decided, in every pass.
// Twin: src/passes/footprint.rs.

struct Rectangle {
    first: vec2<u32>,
    last: vec2<u32>,
}

// The pixels of the band that the splat can reach; empty if a first lies past a last.
fn reach(splat: Splat) -> Rectangle {
    let first = vec2<u32>(splat.bounds_first & 0xffffu, splat.bounds_first >> 16u);
    let last = vec2<u32>(splat.bounds_last & 0xffffu, (splat.bounds_last & ~AWAY) >> 16u);
    return Rectangle(
        vec2<u32>(first.x, max(first.y, band.first_row)),
        vec2<u32>(last.x, min(last.y, band.first_row + band.rows - 1u)),
    );
}

fn footprint(splat: Splat, x: u32, y: u32) -> Fragment {
    let d = vec2<f32>(f32(i32(x) - splat.anchor_x), f32(i32(y) - splat.anchor_y));
    return intersect(vec3<f32>(
        // The leading parts of a thin splat sum exactly, so the order of these two sums matters (rows.wgsl).
        (splat.a[0] * d.x + (splat.a[1] * d.y + splat.a[2]))
            + (splat.a_low[0] * d.x + (splat.a_low[1] * d.y + splat.a_low[2])),
        splat.b[0] * d.x + (splat.b[1] * d.y + splat.b[2]),
        splat.c[0] * d.x + (splat.c[1] * d.y + splat.c[2]),
    ));
}

// The pixel's place in the band's buffers.
fn pixel_index(x: u32, y: u32) -> u32 {
    return (y - band.first_row) * view.width + x;
}
