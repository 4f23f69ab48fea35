// The lines of a clipped disk in tiles: of a splat that another invocation fetched (tile.wgsl).

fn handed_clip(own: Clip, from_: u32) -> Clip {
    return Clip(
        vec3<f32>(
            handed_number(own.first.x, from_),
            handed_number(own.first.y, from_),
            handed_number(own.first.z, from_),
        ),
        vec3<f32>(
            handed_number(own.second.x, from_),
            handed_number(own.second.y, from_),
            handed_number(own.second.z, from_),
        ),
    );
}
