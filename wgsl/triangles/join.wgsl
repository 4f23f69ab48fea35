// Joins a pixel's splats with its triangles (Tien 2008, section 5.3). Twin: src/passes/join.rs.
// #import join_*::{color_beside, share_of_splats}
// #import resolve_surface::{Surface}
// #import triangles_tiles::{beside, shows_triangles}
// #import vectors::{dot3}

// The surface that shows: that of the splats, that of the triangle, or their mean, by the share of
// the splats (join_*.wgsl). `row` is the pixel's row in the band.
fn joined(splats: Surface, pixel: u32, x: u32, row: u32) -> Surface {
    if (!shows_triangles(x, row)) {
        return splats;
    }
    let placed = beside[2u * pixel + 1u];
    let share = share_of_splats(splats, placed.w);
    if (placed.w == 0.0 || share == 1.0) {
        return splats;
    }
    let of_triangle = Surface(color_beside(beside[2u * pixel]), placed.xyz, placed.w, 1.0, 1.0, vec2<f32>(0.0), placed.w, true);
    if (share == 0.0) {
        return of_triangle;
    }
    return mean_of(splats, of_triangle, share);
}

// The mean of both surfaces, in which the splats have the weight `share`.
fn mean_of(splats: Surface, triangle: Surface, share: f32) -> Surface {
    let rest = 1.0 - share;
    let alpha = triangle.color.a * rest + splats.color.a * share;
    let color = triangle.color.rgb * triangle.color.a * rest + splats.color.rgb * splats.color.a * share;
    let normal = triangle.normal * rest + splats.normal * share;
    return Surface(
        vec4<f32>(select(vec3<f32>(0.0), color / alpha, alpha > 0.0), alpha),
        normal * inverseSqrt(max(dot3(normal, normal), 1e-12)),
        triangle.depth * rest + splats.depth * share,
        splats.weight,
        splats.count,
        splats.place,
        splats.front,
        true,
    );
}
