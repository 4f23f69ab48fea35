//! Three hundred frames of a turn that stay on the device: each is recorded and submitted without a
//! wait, and the host reads nothing but the verdicts.
//!
//! ```text
//! cargo run --release --example turn_on_device
//! ```

use std::time::Instant;

use epsplat::glam::{DMat3, DVec3};
use epsplat::{CameraOptions, Gpu, Points, RenderOptions, Renderer, Result, Scene, SceneOptions, Target, View, wgpu};

const FRAMES: u32 = 300;

fn main() -> Result<()> {
    let points = Points { positions: wavy_sphere(5000), ..Points::default() };
    let scene = Scene::from_points(vec![points], &SceneOptions::default());
    let gpu = Gpu::open(None)?;
    let mut renderer = Renderer::on_device(&scene, &RenderOptions::default(), &gpu, &())?;
    let [image, verdicts] = [renderer.layout(&camera(&renderer, 0)?)?.bytes, 4 * u64::from(FRAMES)].map(|bytes| {
        let usage = wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::STORAGE;
        buffer(&gpu, bytes, usage)
    });
    let mut again = 0;
    let mut start = Instant::now();
    for number in 0..FRAMES {
        let mut encoder = gpu.device().create_command_encoder(&Default::default());
        let ticket = renderer.encode(&camera(&renderer, number)?, &mut encoder, Target::Buffer(&image, 0))?;
        // A program would use the image here: later frames overwrite it.
        encoder.copy_buffer_to_buffer(ticket.verdict(), 0, &verdicts, 4 * u64::from(number), 4);
        gpu.queue().submit([encoder.finish()]);
        // Now and then the host waits, so that it does not run ahead without bound. If the frame
        // was incomplete, the renderer learns it from the ticket, and measures the next one.
        if number % 50 == 0 {
            again += u32::from(!ticket.read()?.complete);
        }
        if number == 0 {
            // The first frame compiles the kernels.
            start = Instant::now();
        }
    }
    let complete = words(&gpu, &verdicts)?.iter().sum::<u32>();
    let rate = f64::from(FRAMES - 1) / start.elapsed().as_secs_f64();
    println!("{FRAMES} frames, {complete} of them complete, {rate:.1} frames a second; measured again: {again}");
    Ok(())
}

/// The camera of a frame of the turn.
fn camera(renderer: &Renderer, number: u32) -> Result<epsplat::Camera> {
    let angle = f64::from(number) / f64::from(FRAMES) * std::f64::consts::TAU;
    let eye = DMat3::from_rotation_y(angle) * DVec3::new(0.0, 1.0, 3.0);
    let options =
        CameraOptions { size: Some((256, 256)), eye: Some(eye), target: Some(DVec3::ZERO), ..Default::default() };
    renderer.camera(&View::new(&options)?)
}

/// Points on a sphere with waves, by the golden angle.
fn wavy_sphere(count: u32) -> Vec<[f64; 3]> {
    let point = |k: u32| {
        let z = 1.0 - f64::from(2 * k + 1) / f64::from(count);
        let (sin, cos) = (2.399_963_229_728_653 * f64::from(k)).sin_cos();
        let [x, y] = [cos, sin].map(|side| (1.0 - z * z).sqrt() * side);
        (DVec3::new(x, y, z) * (1.0 + 0.05 * (8.0 * x).sin() * (8.0 * y).sin())).to_array()
    };
    (0..count).map(point).collect()
}

fn buffer(gpu: &Gpu, size: u64, usage: wgpu::BufferUsages) -> wgpu::Buffer {
    gpu.device().create_buffer(&wgpu::BufferDescriptor { label: None, size, usage, mapped_at_creation: false })
}

/// Reads the words of a buffer.
fn words(gpu: &Gpu, from: &wgpu::Buffer) -> Result<Vec<u32>> {
    let read = buffer(gpu, from.size(), wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ);
    let mut encoder = gpu.device().create_command_encoder(&Default::default());
    encoder.copy_buffer_to_buffer(from, 0, &read, 0, from.size());
    encoder.map_buffer_on_submit(&read, wgpu::MapMode::Read, .., |_| {});
    gpu.queue().submit([encoder.finish()]);
    let failed = |what: String| epsplat::Error::Gpu { adapter: gpu.adapter.name.clone(), what };
    gpu.device().poll(wgpu::PollType::wait_indefinitely()).map_err(|e| failed(e.to_string()))?;
    let mapped = read.get_mapped_range(..).map_err(|e| failed(e.to_string()))?;
    Ok(mapped.chunks_exact(4).map(|word| u32::from_le_bytes([word[0], word[1], word[2], word[3]])).collect())
}
