// How far a point comes before its plane, in radii, at a squared distance from its axis: a square or a circle is flat.

fn rise(rho2: f32) -> f32 {
    return 0.0;
}
