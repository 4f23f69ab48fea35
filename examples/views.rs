//! Many cameras with one renderer, which keeps surfels, buffers and compiled kernels from frame to
//! frame:
//!
//! ```text
//! cargo run --release --example views -- data/bunny.obj folder
//! ```

use std::path::PathBuf;

use epsplat::glam::{DMat3, DVec3};
use epsplat::{CameraOptions, DeviceOptions, RenderOptions, Renderer, Result, Scene, SceneOptions, View, io};

fn main() -> Result<()> {
    let mut paths = std::env::args().skip(1);
    let (input, folder) = (paths.next().unwrap_or("data/bunny.obj".into()), paths.next().unwrap_or(".".into()));
    let scene = Scene::open([input], &SceneOptions::default())?;
    let mut renderer = Renderer::new(&scene, &RenderOptions::default(), &DeviceOptions::default(), &())?;
    let (center, size) = (renderer.bounds().center(), renderer.bounds().extent().length());
    for index in 0..8 {
        let direction =
            DMat3::from_rotation_y(f64::from(index) * std::f64::consts::FRAC_PI_4) * DVec3::new(0.0, 0.3, 1.0);
        let view = View::new(&CameraOptions {
            size: Some((640, 480)),
            eye: Some(center + 1.4 * size * direction),
            target: Some(center),
            ..CameraOptions::default()
        })?;
        let picture = renderer.frame(&view, &())?;
        println!("view {index}: {:.1} ms", picture.report.total_ms);
        io::png::write(&PathBuf::from(&folder).join(format!("view-{index}.png")), &picture.frame)?;
    }
    Ok(())
}
