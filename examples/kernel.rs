//! A blending kernel of one's own, and its error: the WGSL below takes the place of a built-in file
//! on the device, and the f64 reference evaluates the same text.
//!
//! ```text
//! cargo run --release --example kernel -- data/bunny.obj
//! ```

use epsplat::options::Replacement;
use epsplat::{CameraOptions, DeviceOptions, Frame, RenderOptions, Renderer, Result, Scene, SceneOptions, View};

/// The weight at the squared distance `rho2` from a disk's centre, in radii squared: Wendland's C2
/// function.
const KERNEL: &str = "
fn kernel_weight(rho2: f32) -> f32 {
    let rho = sqrt(rho2);
    let rest = max(1.0 - rho, 0.0);
    return rest * rest * rest * rest * (4.0 * rho + 1.0);
}";

fn main() -> Result<()> {
    let input = std::env::args().nth(1).unwrap_or("data/bunny.obj".into());
    let scene = Scene::open([input], &SceneOptions::default())?;
    let mut options = RenderOptions::default();
    options.research.sources = vec![Replacement::new("kernel_ellipse.wgsl", KERNEL)];
    let view = View::new(&CameraOptions { size: Some((400, 400)), ..CameraOptions::default() })?;
    let rendered = |backend: &str, options: &RenderOptions| -> Result<Frame> {
        let device = DeviceOptions { backend: backend.parse()?, ..DeviceOptions::default() };
        let picture = Renderer::new(&scene, options, &device, &())?.frame(&view, &())?;
        // The report counts weights that are NaN, infinite, negative or above 1.
        if let Some(wrong) = picture.report.kernel.and_then(|faults| faults.sentence()) {
            println!("{wrong}");
        }
        Ok(picture.frame)
    };
    let own = rendered("auto", &options)?;
    println!("to the f64 reference of the same kernel: {:.2e}", rmse(&own, &rendered("reference", &options)?));
    println!("to the built-in kernel: {:.2e}", rmse(&own, &rendered("auto", &RenderOptions::default())?));
    Ok(())
}

/// The root of the mean square of colours' differences.
fn rmse(one: &Frame, other: &Frame) -> f64 {
    let pairs = one.color.iter().flatten().zip(other.color.iter().flatten());
    let sum: f64 = pairs.map(|(a, b)| f64::from(a - b).powi(2)).sum();
    (sum / (4 * one.color.len()) as f64).sqrt()
}
