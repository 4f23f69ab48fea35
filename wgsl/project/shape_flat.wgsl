// Squares and circles, which are flat. `rise` is how far a point's surface lies in front of the
// point's plane. `rho2` is the squared distance from the point's axis; both are in units of the
// radius.

fn rise(rho2: f32) -> f32 {
    return 0.0;
}
