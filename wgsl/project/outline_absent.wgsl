
fn beyond_outline(turn: vec2<f32>, p: vec3<f32>) -> bool {
    return false;
}
