//! Times whole frames, their single stages, and the preparation before them: `cargo bench --bench
//! render`.

#![allow(missing_docs, clippy::unwrap_used)]

use std::time::Duration;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use epsplat::io::Points;
use epsplat::low_level::gpu::Gpu;
use epsplat::low_level::plan::Settings;
use epsplat::low_level::render::{Backend, Renderer, render};
use epsplat::low_level::scene::{Camera, Lens};
use epsplat::low_level::surfels::analytic::{Shape, generate};
use epsplat::low_level::surfels::build;

fn sphere(count: u64, with_normals: bool) -> Points {
    let samples: Vec<_> = generate(Shape::Sphere, count).collect();
    Points {
        positions: samples.iter().map(|s| s.position).collect(),
        normals: with_normals.then(|| samples.iter().map(|s| s.normal).collect()),
        radii: with_normals.then(|| samples.iter().map(|s| s.radius).collect()),
        ..Points::default()
    }
}

/// A frame of 1024x1024 pixels, upload included.
fn frames(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("frame");
    group.sample_size(10);
    let mut backends = vec![("reference", Backend::Reference)];
    backends.extend(Gpu::open(None).ok().map(|gpu| ("gpu", Backend::gpu(gpu))));
    for count in [10_000, 100_000, 1_000_000] {
        let (scene, _) = build(vec![sphere(count, true)], &()).unwrap();
        let near = Camera::default_near(&scene);
        let camera = Camera::framing((1024, 1024), Lens::Fov(45.0), &scene, near).unwrap();
        group.throughput(Throughput::Elements(count));
        for (name, backend) in &backends {
            group.bench_function(BenchmarkId::new(*name, count), |b| {
                b.iter(|| render(&scene, &camera, &Settings::default(), backend, &()).unwrap());
            });
        }
    }
}

/// Estimation of normals and radii for points that have none.
fn estimates(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("estimate");
    group.sample_size(10);
    for count in [10_000, 100_000] {
        let points = sphere(count, false);
        group.throughput(Throughput::Elements(count));
        group.bench_function(BenchmarkId::from_parameter(count), |b| {
            b.iter(|| build(vec![points.clone()], &()).unwrap());
        });
    }
}

/// Time per stage at 1024x1024 pixels, with few large splats and with many small ones.
///
/// Each measurement renders a frame and uses the time of one stage. Upload and compilation happen
/// before.
fn stages(criterion: &mut Criterion) {
    let Ok(gpu) = Gpu::open(None) else {
        eprintln!("no adapter: nothing to measure");
        return;
    };
    let backend = Backend::gpu(gpu);
    let options = Settings::default();
    for stage in ["project", "visibility", "accumulate", "resolve"] {
        let mut group = criterion.benchmark_group(stage);
        group.sample_size(10);
        for count in [10_000, 1_000_000] {
            let (scene, _) = build(vec![sphere(count, true)], &()).unwrap();
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

criterion_group!(benches, frames, stages, estimates);
criterion_main!(benches);
