//! Frames that stay on the device: their bits, what is asked of the device for them, and their
//! verdicts.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common;

use common::levels::levels;
use common::scenes::sphere;
use epsplat::low_level::frame::Frame;
use epsplat::low_level::gpu::{Gpu, Traffic};
use epsplat::low_level::plan::{Organisation, Settings};
use epsplat::low_level::render::{Backend, Renderer};
use epsplat::low_level::scene::Lens;
use epsplat::low_level::scene::color::srgb8;
use epsplat::low_level::scene::composite::ALL_LAYERS;
use epsplat::low_level::scene::{Camera, Composite, Detail, Map, Maps, Samples, Scene, Up};
use epsplat::{FrameLayout, Target};
use glam::DVec3;

/// A view of a turn about the sphere, from the distance `far` of its centre.
fn view(number: u32, far: f64) -> Camera {
    let (sin, cos) = (f64::from(number) * 0.3).sin_cos();
    let eye = DVec3::new(far * sin, 0.4 * far, far * cos);
    Camera::look_at((72, 56), Lens::Fov(45.0), eye, DVec3::ZERO, None, Up::Y, 1e-5).unwrap()
}

/// A buffer for a frame, and one that the host maps.
fn buffers(gpu: &Gpu, bytes: u64) -> [wgpu::Buffer; 2] {
    use wgpu::BufferUsages as Usage;
    [Usage::COPY_DST | Usage::COPY_SRC, Usage::COPY_DST | Usage::MAP_READ].map(|usage| {
        gpu.device().create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: bytes,
            usage,
            mapped_at_creation: false,
        })
    })
}

/// The bytes of a buffer.
fn bytes(gpu: &Gpu, buffer: &wgpu::Buffer) -> Vec<u8> {
    let [_, read] = buffers(gpu, buffer.size());
    let mut encoder = gpu.device().create_command_encoder(&Default::default());
    encoder.copy_buffer_to_buffer(buffer, 0, &read, 0, buffer.size());
    gpu.queue().submit([encoder.finish()]);
    read.slice(..).map_async(wgpu::MapMode::Read, |_| {});
    gpu.device().poll(wgpu::PollType::wait_indefinitely()).unwrap();
    let view = read.slice(..).get_mapped_range().unwrap();
    view.to_vec()
}

/// The bits of all values of a frame.
fn bits(frame: &Frame) -> Vec<u32> {
    let maps = frame.maps().iter().flat_map(|map| frame.map(map).unwrap().to_vec());
    frame.color.iter().flatten().copied().chain(maps).map(f32::to_bits).collect()
}

/// A frame of each of `cameras`, recorded into one encoder per frame and submitted together, and
/// whether the device called it complete.
fn recorded<'a>(
    renderer: &mut Renderer<&Scene, &Backend>,
    gpu: &Gpu,
    cameras: impl IntoIterator<Item = &'a Camera>,
) -> Vec<(Frame, bool)> {
    let record = |camera: &Camera| {
        let layout: FrameLayout = renderer.layout(camera).unwrap();
        let [target, _] = buffers(gpu, layout.bytes + 8);
        let [verdict, _] = buffers(gpu, 16);
        let mut encoder = gpu.device().create_command_encoder(&Default::default());
        let ticket = renderer.encode(camera, &mut encoder, Target::Buffer(&target, 8)).unwrap();
        encoder.copy_buffer_to_buffer(ticket.verdict(), 0, &verdict, 0, 16);
        (layout, target, verdict, encoder, ticket)
    };
    let all: Vec<_> = cameras.into_iter().map(record).collect();
    let (mut commands, mut frames) = (Vec::new(), Vec::new());
    for (layout, target, verdict, encoder, ticket) in all {
        commands.push(encoder.finish());
        frames.push((layout, target, verdict, ticket));
    }
    gpu.queue().submit(commands);
    let read = |(layout, target, verdict, ticket): (FrameLayout, wgpu::Buffer, wgpu::Buffer, epsplat::Ticket)| {
        let verdict: [u32; 4] = bytemuck::pod_read_unaligned(&bytes(gpu, &verdict));
        let receipt = ticket.read().unwrap();
        assert_eq!((receipt.complete, receipt.lacking.is_empty()), (verdict[0] == 1, verdict[1] == 0));
        (layout.frame(&bytes(gpu, &target)[8..]).unwrap(), receipt.complete)
    };
    frames.into_iter().map(read).collect()
}

/// Checks frames of a turn against those of another renderer, which reads them back. Returns how
/// many were complete at once.
fn check(name: &str, gpu: &Gpu, scene: &Scene, options: &Settings) -> usize {
    let backend = Backend::gpu(gpu.clone());
    let mut renderer = Renderer::new(scene, options, &backend).unwrap();
    let mut other = Renderer::new(scene, options, &backend).unwrap();
    let cameras: Vec<Camera> = (0..20).map(|number| view(number, 2.9)).collect();
    // The first frames are submitted alone, the others together.
    let mut frames = recorded(&mut renderer, gpu, &cameras[..1]);
    frames.extend(recorded(&mut renderer, gpu, &cameras[1..2]));
    frames.extend(recorded(&mut renderer, gpu, &cameras[2..]));
    let mut complete = 0;
    for (number, (camera, (frame, whole))) in cameras.iter().zip(&frames).enumerate() {
        let (expected, _) = other.frame(camera, &()).unwrap();
        assert_eq!(expected.maps(), frame.maps(), "{name}");
        let again = (!whole).then(|| recorded(&mut renderer, gpu, [camera]).remove(0));
        // Tickets were read, so a view that lacked splats is measured when it is encoded again.
        let (frame, whole) = again.as_ref().map_or((frame, *whole), |(frame, whole)| (frame, *whole));
        assert!(whole, "{name}: view {number} is not complete");
        assert!(bits(&expected) == bits(frame), "{name}: view {number}");
        complete += usize::from(again.is_none());
    }
    eprintln!("{name}: {complete} of 20 are complete at once");
    complete
}

#[test]
fn a_frame_on_the_device_has_the_bits_of_one_that_is_read_back() {
    let Some(gpu) = common::gpu() else { return };
    let maps = Maps::of(&[Map::Depth, Map::Normal]);
    let small = Settings { maps, ..Settings::default() };
    let scatter = Settings { organisation: Organisation::Scatter, ..small.clone() };
    let tiles = Settings { organisation: Organisation::Tile, ..small.clone() };
    let samples = Settings { samples: Samples::FOUR, ..small.clone() };
    let layers = Settings { composite: Composite::Layers(ALL_LAYERS), opacity: 0.5, ..small.clone() };
    let sorted = Settings { composite: Composite::Sorted, opacity: 0.5, ..small.clone() };
    let cut = Settings { detail: Detail::Pixels(9.0), ..small.clone() };
    let few = sphere(3000, 1.7);
    // More surfels than pixels are culled.
    let many = sphere(60_000, 1.7);
    // Several pages, and several bands.
    let narrow = gpu.clone().with_buffer_limit(40 << 10);
    for (name, gpu, scene, options) in [
        ("scatter", &gpu, &few, &scatter),
        ("tiles", &gpu, &few, &tiles),
        ("4 samples", &gpu, &few, &samples),
        ("large splats", &gpu, &sphere(40, 2.0), &scatter),
        ("layers", &gpu, &few, &layers),
        ("sorted", &gpu, &few, &sorted),
        ("culled", &gpu, &many, &scatter),
        ("culled tiles", &gpu, &many, &tiles),
        ("a cut", &gpu, &levels(sphere(20_000, 1.7)), &cut),
        ("bands", &narrow, &few, &scatter),
        ("bands of tiles", &narrow, &few, &tiles),
        ("bands of layers", &narrow, &few, &layers),
    ] {
        // A sphere's counts differ little from view to view.
        assert!(check(name, gpu, scene, options) >= 12, "{name}");
    }
}

/// A frame of the camera, or the sentence of its error.
fn tried(
    renderer: &mut Renderer<&Scene, &Backend>,
    gpu: &Gpu,
    camera: &Camera,
    target: &wgpu::Buffer,
    at: u64,
) -> String {
    let mut encoder = gpu.device().create_command_encoder(&Default::default());
    match renderer.encode(camera, &mut encoder, Target::Buffer(target, at)) {
        Ok(_) => String::new(),
        Err(error) => error.to_string(),
    }
}

#[test]
fn a_frame_that_lacks_room_says_so_on_the_device() {
    let Some(gpu) = common::gpu() else { return };
    let scene = sphere(60_000, 1.7);
    for organisation in [Organisation::Scatter, Organisation::Tile] {
        let options = Settings { organisation, ..Settings::default() };
        let backend = Backend::gpu(gpu.clone());
        let mut renderer = Renderer::new(&scene, &options, &backend).unwrap();
        // First the sphere lies beside the image, then it fills it.
        let near = view(3, 1.6);
        let aside = Camera { rotation: view(0, 1.0).rotation, eye: DVec3::new(9.0, 0.0, 3.0), ..view(0, 1.0) };
        assert!(recorded(&mut renderer, &gpu, [&aside])[0].1);
        let (frame, complete) = recorded(&mut renderer, &gpu, [&near]).remove(0);
        let (expected, _) = Renderer::new(&scene, &options, &backend).unwrap().frame(&near, &()).unwrap();
        assert_eq!(bits(&frame) == bits(&expected), complete, "{organisation:?}");
        assert!(!complete, "the control: {organisation:?} has room after a view of nothing");
        let (frame, complete) = recorded(&mut renderer, &gpu, [&near]).remove(0);
        assert!(complete && bits(&frame) == bits(&expected), "{organisation:?}");
    }
}

/// A frame whose sizes are known asks nothing of the device but its commands.
#[test]
fn a_recorded_frame_is_not_submitted_awaited_or_read() {
    let Some(gpu) = common::gpu() else { return };
    let scene = sphere(3000, 1.7);
    let backend = Backend::gpu(gpu.clone());
    let mut renderer = Renderer::new(&scene, &Settings::default(), &backend).unwrap();
    let camera = view(0, 2.9);
    let [target, _] = buffers(&gpu, renderer.layout(&camera).unwrap().bytes);
    let mut encoder = gpu.device().create_command_encoder(&Default::default());
    let mut asked = Vec::new();
    for _ in 0..3 {
        let before = Traffic::so_far();
        let ticket = renderer.encode(&camera, &mut encoder, Target::Buffer(&target, 0)).unwrap();
        asked.push(Traffic::so_far() - before);
        drop(ticket);
    }
    let ticket = renderer.encode(&camera, &mut encoder, Target::Buffer(&target, 0)).unwrap();
    let mut early = renderer.encode(&camera, &mut encoder, Target::Buffer(&target, 0)).unwrap();
    assert!(early.try_read().unwrap().is_none());
    let unsent = ticket.read().unwrap_err().to_string();
    assert!(unsent.contains("submit the encoder"), "{unsent}");
    gpu.queue().submit([encoder.finish()]);
    let receipt = early.read().unwrap();
    assert!(receipt.complete && (1000..=3000).contains(&receipt.splats_drawn), "{receipt:?}");
    let Traffic { submits, waits, dispatches, bind_groups, bytes_read, .. } = asked[2];
    assert_eq!((submits, waits, bytes_read), (0, 0, 0), "{:?}", asked[2]);
    // The verdict's kernel has a bind group for each frame.
    assert!(dispatches >= 5 && bind_groups <= 1, "{:?}", asked[2]);
    // The control: the first frame is measured.
    assert!(asked[0].submits > 0 && asked[0].waits > 0, "{:?}", asked[0]);
}

#[test]
fn targets_and_maps_that_do_not_suit_are_refused() {
    let Some(gpu) = common::gpu() else { return };
    let (scene, camera) = (sphere(300, 1.7), view(0, 2.9));
    let backend = Backend::gpu(gpu.clone());
    let mut renderer = Renderer::new(&scene, &Settings::default(), &backend).unwrap();
    let [target, mapped] = buffers(&gpu, renderer.layout(&camera).unwrap().bytes);
    assert_eq!(tried(&mut renderer, &gpu, &camera, &target, 0), "");
    assert_eq!(tried(&mut renderer, &gpu, &camera, &mapped, 0), "");
    assert!(tried(&mut renderer, &gpu, &camera, &target, 4).contains("bytes, but the frame has"));
    assert!(tried(&mut renderer, &gpu, &camera, &target, 2).contains("no multiple of 4"));
    let other = gpu.device().create_buffer(&wgpu::BufferDescriptor {
        label: None,
        size: target.size(),
        usage: wgpu::BufferUsages::STORAGE,
        mapped_at_creation: false,
    });
    assert!(tried(&mut renderer, &gpu, &camera, &other, 0).contains("COPY_DST"));
    let index = Settings { maps: Maps::of(&[Map::Index]), ..Settings::default() };
    let mut renderer = Renderer::new(&scene, &index, &backend).unwrap();
    assert!(tried(&mut renderer, &gpu, &camera, &target, 0).contains("the map index"));
    let reference = Backend::Reference;
    let mut renderer = Renderer::new(&scene, &Settings::default(), &reference).unwrap();
    assert!(tried(&mut renderer, &gpu, &camera, &target, 0).contains("--backend gpu"));
}

/// A device that a program opened itself: with all features, with none, and too small a one.
#[test]
fn epsplat_renders_on_the_device_of_a_program() {
    let Some(gpu) = common::gpu() else { return };
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle_from_env());
    let all = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::all()));
    let adapter = all.into_iter().find(|adapter| {
        let info = adapter.get_info();
        info.name == gpu.adapter.name && info.backend.to_str() == gpu.adapter.api
    });
    // The twin is no adapter of wgpu.
    let Some(adapter) = adapter else { return };
    let open = |required_features, required_limits| {
        let descriptor = wgpu::DeviceDescriptor { required_features, required_limits, ..Default::default() };
        let (device, queue) = pollster::block_on(adapter.request_device(&descriptor)).unwrap();
        Gpu::from_wgpu(&adapter, device, queue)
    };
    let (scene, camera, options) = (sphere(3000, 1.7), view(0, 2.9), Settings::default());
    let (expected, _) =
        Renderer::new(&scene, &options, &Backend::gpu(gpu.clone())).unwrap().frame(&camera, &()).unwrap();
    let limits = Gpu::limits(&adapter);
    for features in [Gpu::features(&adapter), wgpu::Features::empty()] {
        let own = open(features, limits.clone()).unwrap();
        assert_eq!(
            (own.adapter.subgroups, own.adapter.timestamps),
            (!features.is_empty() && gpu.adapter.subgroups, false)
        );
        let backend = Backend::gpu(own.clone());
        let mut renderer = Renderer::new(&scene, &options, &backend).unwrap();
        let (frame, complete) = recorded(&mut renderer, &own, [&camera]).remove(0);
        assert!(complete && bits(&frame) == bits(&expected));
        assert!(bits(&renderer.frame(&camera, &()).unwrap().0) == bits(&expected));
    }
    let few = wgpu::Limits { max_storage_buffers_per_shader_stage: 4, ..limits };
    let refused = open(wgpu::Features::empty(), few).err().unwrap().to_string();
    assert!(refused.contains("max_storage_buffers_per_shader_stage of 4, and 8 are needed"), "{refused}");
}

/// The texels of a texture, without the padding of rows.
fn texels(gpu: &Gpu, texture: &wgpu::Texture) -> Vec<u8> {
    let row = texture.width() * texture.format().block_copy_size(None).unwrap();
    let padded = row.next_multiple_of(256);
    let [read, _] = buffers(gpu, u64::from(padded * texture.height()));
    let mut encoder = gpu.device().create_command_encoder(&Default::default());
    let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(padded), rows_per_image: None };
    encoder.copy_texture_to_buffer(
        texture.as_image_copy(),
        wgpu::TexelCopyBufferInfo { buffer: &read, layout },
        texture.size(),
    );
    gpu.queue().submit([encoder.finish()]);
    bytes(gpu, &read).chunks_exact(padded as usize).flat_map(|line| line[..row as usize].to_vec()).collect()
}

fn texture(gpu: &Gpu, (width, height): (u32, u32), format: wgpu::TextureFormat) -> wgpu::Texture {
    gpu.device().create_texture(&wgpu::TextureDescriptor {
        label: None,
        size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: wgpu::TextureUsages::COPY_DST | wgpu::TextureUsages::COPY_SRC,
        view_formats: &[],
    })
}

#[test]
fn textures_get_the_bytes_of_a_png_or_the_values_of_the_frame() {
    use wgpu::TextureFormat as Format;
    let Some(gpu) = common::gpu() else { return };
    let (scene, camera) = (sphere(3000, 1.7), view(0, 2.9));
    let size = (camera.width, camera.height);
    // Half of the samples at a rim are empty, so alpha has values in between.
    let options =
        Settings { maps: Maps::of(&[Map::Depth, Map::Normal]), samples: Samples::FOUR, ..Settings::default() };
    for gpu in [gpu.clone(), gpu.with_buffer_limit(100 << 10)] {
        let backend = Backend::gpu(gpu.clone());
        let mut renderer = Renderer::new(&scene, &options, &backend).unwrap();
        let (expected, _) = renderer.frame(&camera, &()).unwrap();
        let mut drawn = |format, depth: Option<&wgpu::Texture>| {
            let color = texture(&gpu, size, format);
            let mut encoder = gpu.device().create_command_encoder(&Default::default());
            let ticket = renderer.encode(&camera, &mut encoder, Target::Textures { color: &color, depth });
            gpu.queue().submit([encoder.finish()]);
            assert!(ticket.unwrap().read().unwrap().complete);
            texels(&gpu, &color)
        };
        let codes: Vec<u8> = expected.color.iter().flat_map(|color| srgb8(*color)).collect();
        let swapped = codes.chunks_exact(4).flat_map(|code| [code[2], code[1], code[0], code[3]]).collect::<Vec<_>>();
        let depth = texture(&gpu, size, Format::R32Float);
        assert!(drawn(Format::Rgba8Unorm, Some(&depth)) == codes);
        let depths: Vec<u8> = expected.map(Map::Depth).unwrap().iter().flat_map(|depth| depth.to_le_bytes()).collect();
        assert!(texels(&gpu, &depth) == depths);
        assert!(drawn(Format::Rgba8UnormSrgb, None) == codes && drawn(Format::Bgra8Unorm, None) == swapped);
        let floats: Vec<u8> = expected.color.iter().flatten().flat_map(|value| value.to_le_bytes()).collect();
        assert!(drawn(Format::Rgba32Float, None) == floats);
        // Half floats have eleven bits.
        let halves = drawn(Format::Rgba16Float, None);
        for (half, value) in halves.chunks_exact(2).zip(expected.color.iter().flatten()) {
            let half = f64::from(from_half(u16::from_le_bytes([half[0], half[1]])));
            assert!((half - f64::from(*value)).abs() <= f64::from(*value).abs() / 1024.0 + 1e-7, "{half} {value}");
        }
        // The picture has colours, and alpha in between.
        assert!(codes.iter().skip(3).step_by(4).any(|alpha| (1..255).contains(alpha)));
    }
}

/// The value of an f16 that is not negative, infinite or NaN.
fn from_half(bits: u16) -> f32 {
    let (exponent, mantissa) = (i32::from(bits >> 10), f32::from(bits & 1023));
    if exponent == 0 { mantissa * 2f32.powi(-24) } else { (1.0 + mantissa / 1024.0) * 2f32.powi(exponent - 15) }
}

#[test]
fn textures_that_do_not_suit_are_refused() {
    use wgpu::TextureFormat as Format;
    let Some(gpu) = common::gpu() else { return };
    let (scene, camera) = (sphere(300, 1.7), view(0, 2.9));
    let backend = Backend::gpu(gpu.clone());
    let mut renderer = Renderer::new(&scene, &Settings::default(), &backend).unwrap();
    let size = (camera.width, camera.height);
    let [good, single] = [Format::Rgba8Unorm, Format::R32Float].map(|format| texture(&gpu, size, format));
    let other = texture(&gpu, (10, 10), Format::Rgba8Unorm);
    let mut sentence = |color, depth| {
        let mut encoder = gpu.device().create_command_encoder(&Default::default());
        let tried = renderer.encode(&camera, &mut encoder, Target::Textures { color, depth });
        tried.err().map_or_else(String::new, |error| error.to_string())
    };
    assert_eq!(sentence(&good, None), "");
    assert!(sentence(&single, None).contains("rgba8unorm"));
    assert!(sentence(&other, None).contains("is 10x10, but the frame is one flat image of 72x56"));
    assert!(sentence(&good, Some(&single)).contains("gets no depth"));
}
