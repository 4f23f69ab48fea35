//! Requests of the host to the device for a frame.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common;

use common::scenes::{sphere, sphere_camera};
use epsplat::low_level::gpu::layout::View;
use epsplat::low_level::gpu::{Gpu, Traffic};
use epsplat::low_level::plan::{Organisation, Settings};
use epsplat::low_level::render::{Backend, Renderer};
use epsplat::low_level::scene::{Maps, Projection};

/// Once the sizes of its buffers are known, a frame is one submission, and the host waits once. It
/// writes the view, and reads the image, a few counts and the times.
#[test]
fn a_frame_is_one_submission() {
    if common::gpu().is_none() {
        return;
    }
    // A device of its own: where others have drawn triangles, llvmpipe's passes are timed one by
    // one.
    let gpu = Gpu::open(None).unwrap();
    if gpu.adapter.is_software() && gpu.adapter.api != "vulkan" || !gpu.adapter.timestamps {
        return;
    }
    let camera = sphere_camera(72, Projection::Pinhole);
    for organisation in [Organisation::Tile, Organisation::Scatter] {
        for maps in [Maps::default(), Maps::ON_DEVICE] {
            let options = Settings { organisation, maps, ..Settings::default() };
            let scene = sphere(3000, 1.7);
            let backend = Backend::gpu(gpu.clone());
            let mut renderer = Renderer::new(&scene, &options, &backend).unwrap();
            let first = renderer.frame(&camera, &()).unwrap();
            // The second frame makes the bind groups of the buffers that the first one sized.
            renderer.frame(&camera, &()).unwrap();
            let (frame, report) = renderer.frame(&camera, &()).unwrap();
            assert!(common::bits(&frame) == common::bits(&first.0));
            let Traffic { submits, waits, dispatches, bind_groups, bytes_written, bytes_read } = report.traffic;
            assert_eq!((submits, waits, bind_groups), (1, 1, 0), "{organisation:?}: {:?}", report.traffic);
            // Graphics cards draw as they project, which saves a dispatch; with culling, three.
            let most = match (organisation, gpu.adapter.is_software()) {
                (Organisation::Tile, true) => 18,
                (Organisation::Tile, false) => 15,
                (_, true) => 14,
                (_, false) => 11,
            };
            assert!((5..=most).contains(&dispatches), "{organisation:?}: {:?}", report.traffic);
            assert_eq!(bytes_written, size_of::<View>() as u64);
            let image = 16 * camera.pixels() as u64;
            assert!((image..4 * image + 1024).contains(&bytes_read), "{:?}", report.traffic);
            // The control: the first frame reads counts before it sizes its buffers.
            assert!(first.1.traffic.submits > 1 && first.1.traffic.bind_groups > 0, "{:?}", first.1.traffic);
        }
    }
}
