//! A kernel of one's own on the depth of a frame, on the device of one's own program: it counts the
//! pixels at which the depth jumps, and the host reads two numbers.
//!
//! ```text
//! cargo run --release --example depth_to_kernel -- data/bunny.obj
//! ```

use epsplat::wgpu::util::DeviceExt;
use epsplat::{CameraOptions, Gpu, Map, RenderOptions, Renderer, Scene, SceneOptions, Target, View, wgpu};

/// The frame lies in the buffer as the renderer's layout says: `plane` has the word of the first
/// pixel's depth, the words from pixel to pixel, and the sides of the image.
const KERNEL: &str = "
@group(0) @binding(0) var<storage, read> frame: array<f32>;
@group(0) @binding(1) var<uniform> plane: vec4<u32>;
@group(0) @binding(2) var<storage, read_write> counts: array<atomic<u32>, 2>;

fn depth(x: u32, y: u32) -> f32 {
    return frame[plane.x + (y * plane.z + x) * plane.y];
}

@compute @workgroup_size(8, 8)
fn count(@builtin(global_invocation_id) at: vec3<u32>) {
    if (at.x + 1u >= plane.z || at.y + 1u >= plane.w) {
        return;
    }
    let here = depth(at.x, at.y);
    if (here < 1e30) {
        atomicAdd(&counts[0], 1u);
    }
    let most = max(here, max(depth(at.x + 1u, at.y), depth(at.x, at.y + 1u)));
    let least = min(here, min(depth(at.x + 1u, at.y), depth(at.x, at.y + 1u)));
    if (most > 1.05 * least) {
        atomicAdd(&counts[1], 1u);
    }
}";

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let input = std::env::args().nth(1).unwrap_or("data/bunny.obj".into());
    // The device is the program's own; epsplat says which features and limits make it fast.
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle_from_env());
    let adapter = pollster::block_on(instance.request_adapter(&Default::default()))?;
    let (device, queue) = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor {
        required_features: Gpu::features(&adapter),
        required_limits: Gpu::limits(&adapter),
        ..Default::default()
    }))?;
    let gpu = Gpu::from_wgpu(&adapter, device.clone(), queue.clone())?;

    let scene = Scene::open([input], &SceneOptions::default())?;
    let mut options = RenderOptions::default();
    options.maps.aov = vec![Map::Depth];
    let mut renderer = Renderer::on_device(&scene, &options, &gpu, &())?;
    let size = CameraOptions { size: Some((400, 400)), ..CameraOptions::default() };
    let camera = renderer.camera(&View::new(&size)?)?;
    let layout = renderer.layout(&camera)?;
    let depth = layout.maps[&Map::Depth];

    let buffer = |size, usage| {
        device.create_buffer(&wgpu::BufferDescriptor { label: None, size, usage, mapped_at_creation: false })
    };
    let frame = buffer(layout.bytes, wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST);
    let counts = buffer(8, wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC);
    let read = buffer(8, wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST);
    let words = [depth.first, depth.stride, layout.width, layout.height];
    let plane = device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
        label: None,
        contents: &words.map(u32::to_le_bytes).concat(),
        usage: wgpu::BufferUsages::UNIFORM,
    });
    let kernel = pipeline(&device);
    let bound: Vec<_> = [&frame, &plane, &counts].into_iter().zip(0..).map(entry).collect();
    let layout_of_group = &kernel.get_bind_group_layout(0);
    let group =
        device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout: layout_of_group, entries: &bound });

    // The frame, the kernel and the copy of its result are one submission.
    let mut encoder = device.create_command_encoder(&Default::default());
    let ticket = renderer.encode(&camera, &mut encoder, Target::Buffer(&frame, 0))?;
    let mut pass = encoder.begin_compute_pass(&Default::default());
    pass.set_pipeline(&kernel);
    pass.set_bind_group(0, &group, &[]);
    pass.dispatch_workgroups(layout.width.div_ceil(8), layout.height.div_ceil(8), 1);
    drop(pass);
    encoder.copy_buffer_to_buffer(&counts, 0, &read, 0, 8);
    encoder.map_buffer_on_submit(&read, wgpu::MapMode::Read, .., |_| {});
    queue.submit([encoder.finish()]);
    let complete = ticket.read()?.complete;
    let mapped = read.get_mapped_range(..)?;
    let [covered, edges] =
        [0, 4].map(|at| u32::from_le_bytes([mapped[at], mapped[at + 1], mapped[at + 2], mapped[at + 3]]));
    println!("{covered} pixels show the scene, {edges} lie at its edges; complete: {complete}");
    Ok(())
}

fn entry<'a>((buffer, binding): (&'a wgpu::Buffer, u32)) -> wgpu::BindGroupEntry<'a> {
    wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() }
}

fn pipeline(device: &wgpu::Device) -> wgpu::ComputePipeline {
    let source = wgpu::ShaderSource::Wgsl(KERNEL.into());
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor { label: None, source });
    device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: None,
        layout: None,
        module: &module,
        entry_point: Some("count"),
        compilation_options: Default::default(),
        cache: None,
    })
}
