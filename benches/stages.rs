//! The single stages, each by the adapter's clock: `cargo bench --bench stages`.
//!
//! A frame is rendered for every measurement, of which one stage's time is taken; upload and compilation are done before.

#![allow(missing_docs, clippy::unwrap_used)]

use std::time::Duration;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use epsplat::gpu::Gpu;
use epsplat::io::Points;
use epsplat::render::{Backend, Renderer};
use epsplat::scene::{Camera, Lens, RenderOptions, Scene};
use epsplat::surfels::analytic::{Shape, generate};
use epsplat::surfels::build;

fn sphere(count: u64) -> Scene {
    let samples: Vec<_> = generate(Shape::Sphere, count).collect();
    let points = Points {
        positions: samples.iter().map(|s| s.position).collect(),
        normals: Some(samples.iter().map(|s| s.normal).collect()),
        radii: Some(samples.iter().map(|s| s.radius).collect()),
        ..Points::default()
    };
    build(vec![points], &()).unwrap().0
}

/// Time per stage at 1024x1024, of few large splats and of many small ones.
fn stages(criterion: &mut Criterion) {
    let Ok(gpu) = Gpu::open(None) else {
        eprintln!("no adapter: nothing to measure");
        return;
    };
    let backend = Backend::gpu(gpu);
    let options = RenderOptions::default();
    for stage in ["project", "visibility", "accumulate", "resolve"] {
        let mut group = criterion.benchmark_group(stage);
        group.sample_size(10);
        for count in [10_000, 1_000_000] {
            let scene = sphere(count);
            let camera = Camera::framing((1024, 1024), Lens::Fov(45.0), &scene, Camera::default_near(&scene)).unwrap();
            let mut renderer = Renderer::new(&scene, &options, &backend).unwrap();
            renderer.frame(&camera, &()).unwrap();
            group.throughput(Throughput::Elements(count));
            group.bench_function(BenchmarkId::from_parameter(count), |b| {
                b.iter_custom(|rounds| {
                    let time = |_| renderer.frame(&camera, &()).unwrap().1.passes[&format!("{stage}_ms")];
                    Duration::from_secs_f64((0..rounds).map(time).sum::<f64>() / 1e3)
                });
            });
        }
        group.finish();
    }
}

criterion_group!(benches, stages);
criterion_main!(benches);
