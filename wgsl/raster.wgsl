// The path that compute is compared with (Botsch et al. 2005): a quad a splat, the rasteriser's depth test for the nearest
// depth, its blender for the sums. Splats, footprint, kernel, attributes and resolve are those of the compute path.
// Host side and what the variants mean: src/passes/raster.rs.

@group(0) @binding(5) var<storage, read> projected: array<Splat>;

struct Corner {
    @builtin(position) position: vec4<f32>,
    @location(0) @interpolate(flat) index: u32,
}

// The corner of the pixels that the splat may touch, in clip space at depth `z`; a splat out of view has none.
fn corner_of(splat: Splat, vertex: u32, index: u32) -> Corner {
    let extent = bounds(splat);
    let ends = vec2<u32>(extent.last + 1u);
    let image = vec2<f32>(
        f32(select(extent.first.x, ends.x, (vertex & 1u) != 0u)),
        f32(select(extent.first.y, ends.y, (vertex & 2u) != 0u)),
    );
    let clip = image / vec2<f32>(f32(view.width), f32(view.height)) * vec2<f32>(2.0, -2.0) + vec2<f32>(-1.0, 1.0);
    let z = corner_depth(splat, image, index);
    let empty = any(extent.first > extent.last);
    return Corner(select(vec4<f32>(clip, z, 1.0), vec4<f32>(-2.0, -2.0, 0.0, 1.0), empty), index);
}

@vertex
fn quad(@builtin(vertex_index) vertex: u32, @builtin(instance_index) index: u32) -> Corner {
    return corner_of(projected[index], vertex, index);
}

fn fragment_of(corner: Corner) -> Fragment {
    let pixel = vec2<u32>(corner.position.xy);
    return footprint(projected[corner.index], filter_of(corner.index), pixel.x, pixel.y);
}
