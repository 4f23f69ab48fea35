// A paraboloid that rises by its diameter, as the code that Schuetz and Wimmer 2015 print does: it
// divides gl_PointSize, a diameter. Their text says radius. In place of shape_paraboloid.wgsl.

fn rise(rho2: f32) -> f32 {
    return 2.0 - 2.0 * rho2;
}
