// The farthest depth that counts as the surface whose nearest depth is `front` (paper 000, section 5.3).
// Twin: src/passes/accumulate.rs.
fn farthest_accepted(front: f32) -> f32 {
    return front + (front * view.epsilon_relative + view.epsilon_absolute);
}
