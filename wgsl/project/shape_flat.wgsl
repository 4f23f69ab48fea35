// Squares and circles, which are flat. `rise` is how far a point's surface lies in front of its
// plane, in radii, at a squared distance from its axis.

fn rise(rho2: f32) -> f32 {
    return 0.0;
}
