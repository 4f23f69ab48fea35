//! A filter over maps: edges of the depth map darken the colour, so that shapes stand out without
//! normals.
//!
//! ```text
//! cargo run --release --example filter -- data/bunny.obj edges.png
//! ```

use epsplat::{DeviceOptions, Frame, Map, RenderOptions, Renderer, Result, Scene, SceneOptions, View, io};

fn main() -> Result<()> {
    let mut paths = std::env::args().skip(1);
    let (input, output) = (paths.next().unwrap_or("data/bunny.obj".into()), paths.next().unwrap_or("edges.png".into()));
    let scene = Scene::open([input], &SceneOptions::default())?;
    let mut options = RenderOptions::default();
    options.maps.aov = vec![Map::Depth];
    let mut renderer = Renderer::new(&scene, &options, &DeviceOptions::default(), &())?;
    let mut frame = renderer.frame(&View::default(), &())?.frame;
    darken_edges(&mut frame);
    io::png::write(output.as_ref(), &frame)
}

/// Darkens pixels that lie behind their neighbours, by the logarithm of the depths' ratio.
fn darken_edges(frame: &mut Frame) {
    let depths: Vec<f32> = frame.map(Map::Depth).unwrap_or_default().to_vec();
    let (width, height) = (frame.width as usize, frame.height as usize);
    for y in 1..height - 1 {
        for x in 1..width - 1 {
            let pixel = y * width + x;
            let neighbours = [pixel - 1, pixel + 1, pixel - width, pixel + width];
            let behind = |other: &usize| (depths[pixel] / depths[*other]).ln().max(0.0);
            let sum: f32 = neighbours.iter().map(behind).filter(|step| step.is_finite()).sum();
            let shade = (-40.0 * sum).exp();
            frame.color[pixel][..3].iter_mut().for_each(|light| *light *= shade);
        }
    }
}
