//! A frame and its depth, in world units:
//!
//! ```text
//! cargo run --release --example depth -- data/bunny.obj bunny.png
//! ```

use epsplat::{DeviceOptions, Map, RenderOptions, Renderer, Result, Scene, SceneOptions, View, io};

fn main() -> Result<()> {
    let mut paths = std::env::args().skip(1);
    let (input, output) = (paths.next().unwrap_or("data/bunny.obj".into()), paths.next().unwrap_or("depth.png".into()));
    let scene = Scene::open([input], &SceneOptions::default())?;
    let mut options = RenderOptions::default();
    options.maps.aov = vec![Map::Depth];
    let mut renderer = Renderer::new(&scene, &options, &DeviceOptions::default(), &())?;
    let frame = renderer.frame(&View::default(), &())?.frame;
    // Depth is the distance along the camera's axis; it is infinite in pixels that show no surface.
    let depths = frame.map(Map::Depth).unwrap_or_default().iter().filter(|depth| depth.is_finite());
    let (count, nearest) = depths.fold((0, f32::INFINITY), |(count, nearest), depth| (count + 1, nearest.min(*depth)));
    println!("{count} of {} pixels show the scene, the nearest at {nearest}", frame.color.len());
    io::png::write(output.as_ref(), &frame)
}
