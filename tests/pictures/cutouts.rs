//! Triangles whose images have transparent points: nothing is there, and what lies behind shows.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common;

use common::bits;
use std::sync::Arc;

use epsplat::io::{Material, Mesh, Texture};
use epsplat::low_level::frame::Frame;
use epsplat::low_level::gpu::Sources;
use epsplat::low_level::metrics::DECISION_MARGIN;
use epsplat::low_level::plan::{BlendFormat, Raster, RasterDepth, Settings};
use epsplat::low_level::render::{Backend, render};
use epsplat::low_level::scene::{Camera, Composite, Lens, Map, Maps, Samples, Scene, Shading, Triangle, Triangles, Up};
use epsplat::low_level::truth::Surface;
use glam::DVec3;

const BLUE: [f32; 4] = [0.0, 0.0, 1.0, 1.0];

fn unlit() -> Settings {
    Settings { shading: Shading::Unlit, maps: Maps::of(&[Map::Depth]), ..Settings::default() }
}

fn frame(scene: &Scene, camera: &Camera, options: &Settings, backend: &Backend) -> Frame {
    render(scene, camera, options, backend, &()).unwrap().0
}

fn camera(size: (u32, u32)) -> Camera {
    Camera::look_at(size, Lens::Fov(60.0), DVec3::ZERO, DVec3::Z, Some(DVec3::NEG_Y), Up::Y, 0.01).unwrap()
}

/// Texels of `size` times `size`, whose alphas are `clear` and `full` as on a chessboard.
fn board(size: u32, clear: u8, full: u8) -> Arc<Texture> {
    let of = |k: u32| [255, 60, 0, if (k % size + k / size).is_multiple_of(2) { full } else { clear }];
    Arc::new(Texture::new(size, size, (0..size * size).map(of).collect()).unwrap())
}

/// A square at the depth `z`, which the image covers once if `texture` names one.
fn square(z: f64, half: f64, texture: Option<u32>) -> [Triangle; 2] {
    let corners = [[-half, -half, z], [half, -half, z], [half, half, z], [-half, half, z]];
    let places = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    let color = if texture.is_some() { [1.0; 4] } else { BLUE };
    [[0, 1, 2], [0, 2, 3]].map(|of: [usize; 3]| Triangle {
        corners: of.map(|k| corners[k]),
        normals: None,
        colors: [color; 3],
        texture: texture.map(|number| (number, of.map(|k| places[k]))),
    })
}

/// A fence and a pane before a wall; another fence stands aslant on the floor.
fn garden() -> Scene {
    let mut all = square(9.0, 6.0, None).to_vec();
    all.extend(square(3.0, 1.0, Some(0)));
    all.extend(square(4.0, 2.0, Some(1)));
    let lean = |triangle: Triangle| Triangle {
        corners: triangle.corners.map(|[x, y, z]| [3.0 * x, 0.4 * z - 1.6 + 0.1 * y, z + 3.0 * y]),
        ..triangle
    };
    all.extend(square(4.0, 1.0, Some(0)).map(lean));
    // The near depth cuts this one.
    all.push(Triangle { corners: [[0.9, -0.9, -1.0], [1.0, 0.2, 3.0], [1.4, -0.5, 3.0]], ..all[2] });
    Scene { triangles: Triangles::textured(&all, &[board(6, 0, 255), board(4, 0, 128)]), ..Scene::default() }
}

/// Kernels leave out what their twins leave out, at all ways of drawing; broken ones do not.
#[test]
fn kernels_and_twins_cut_alike() {
    let Some(gpu) = common::gpu() else { return };
    let (scene, camera) = (garden(), camera((160, 120)));
    let raster = Raster { format: BlendFormat::Rgba16Float, depth: RasterDepth::Exact };
    let with_decision = Settings { maps: Maps::of(&[Map::Decision]), ..unlit() };
    let truth = frame(&scene, &camera, &with_decision, &Backend::Reference);
    let decided = truth.map(Map::Decision).unwrap();
    let differ = |options: &Settings, backend: &Backend| {
        let shown = frame(&scene, &camera, options, backend);
        let far = |pixel: &usize| {
            let pairs = shown.color[*pixel].iter().zip(truth.color[*pixel]);
            pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max) > 2e-4
        };
        let sure = (0..decided.len()).filter(|pixel| decided[*pixel] > DECISION_MARGIN);
        assert!(sure.clone().count() > 19_000, "{}", sure.count());
        sure.filter(far).count()
    };
    let core = common::core_gpu().unwrap();
    for backend in [Backend::gpu(gpu.clone()), Backend::gpu(core)] {
        assert_eq!(differ(&unlit(), &backend), 0);
    }
    // The rasteriser's own edges and depths decide about some pixels.
    let by_raster = differ(&Settings { raster: Some(raster), ..unlit() }, &Backend::gpu(gpu.clone()));
    assert!(by_raster < 100, "{by_raster}");
    for (file, from, to) in [
        ("cutout.wgsl", ".w >= least", ".w >= 0.0"),
        ("cutout.wgsl", "TRIANGLE_PLACES + 7u", "TRIANGLE_PLACES + 6u"),
        ("triangles_texture.wgsl", "seen / seen.w", "seen"),
    ] {
        let sources = Sources::default().replace(file, from, to).unwrap();
        let broken = Backend::Gpu { gpu: Box::new(gpu.clone()), sources };
        assert!(differ(&unlit(), &broken) > 50, "{from}");
    }
    if let Some(gl) = common::opengl() {
        assert_eq!(differ(&unlit(), &Backend::gpu(gl)), 0);
    }
}

/// The middle of a texel that is not there shows the wall, in all composites that draw triangles.
#[test]
fn what_lies_behind_a_hole_shows() {
    let Some(gpu) = common::gpu() else { return };
    let camera = camera((48, 48));
    let texture = |alphas: [u8; 4]| {
        let texel = |k: usize| [255, 0, 0, alphas[k / 8 * 2 + k % 4 / 2]];
        Arc::new(Texture::new(4, 4, (0..16).map(texel).collect()).unwrap())
    };
    let of = |alphas: [u8; 4]| {
        let mut all = square(9.0, 6.0, None).to_vec();
        all.extend(square(3.0, 1.6, Some(0)));
        Scene { triangles: Triangles::textured(&all, &[texture(alphas)]), ..Scene::default() }
    };
    // The picture is upside down, so its lower left quarter shows the first quarter of the image.
    let at = |frame: &Frame, (x, y): (usize, usize)| frame.color[y * 48 + x].map(|value| (1e6 * value).round() / 1e6);
    let quarters = [(12, 35), (35, 35), (12, 12), (35, 12)];
    for composite in [Composite::Opaque, Composite::Layers(4), Composite::Sorted] {
        let options = Settings { composite, ..unlit() };
        for backend in [Backend::gpu(gpu.clone()), Backend::Reference] {
            let shown = frame(&of([0, 255, 255, 0]), &camera, &options, &backend);
            let [a, b, c, d] = quarters.map(|place| at(&shown, place));
            assert_eq!([a, d], [BLUE, BLUE], "{composite:?}");
            assert_eq!([b, c], [[1.0, 0.0, 0.0, 1.0]; 2], "{composite:?}");
            // With an alpha between, points that are quite transparent still hide nothing.
            let shown = frame(&of([0, 255, 0, 100]), &camera, &options, &backend);
            assert_eq!(at(&shown, quarters[0]), BLUE, "{composite:?}");
            // Controls: an opaque image hides the wall, and so does a faint one.
            let opaque = frame(&of([255; 4]), &camera, &options, &backend);
            assert!(quarters.iter().all(|place| at(&opaque, *place) == [1.0, 0.0, 0.0, 1.0]));
            let faint = frame(&of([9; 4]), &camera, &options, &backend);
            assert!(quarters.iter().all(|place| at(&faint, *place)[2] == 0.0), "{composite:?}");
        }
    }
}

/// Bits of a cut picture do not depend on how it is drawn, and samples smooth its rims.
#[test]
fn the_same_bits_and_smooth_rims() {
    let Some(gpu) = common::gpu() else { return };
    let (scene, camera) = (garden(), camera((160, 120)));
    let samples: Samples = "4".parse().unwrap();
    for samples in [Samples::ONE, samples] {
        let own = Settings { samples, ..unlit() };
        let first = frame(&scene, &camera, &own, &Backend::gpu(gpu.clone()));
        let other = frame(&scene, &camera, &own, &Backend::gpu(common::core_gpu().unwrap()));
        assert!(bits(&first) == bits(&other), "{samples:?}");
        // Rims of the fence against the wall are mixtures with samples only.
        let mixed = first.color.iter().filter(|[r, _, b, _]| *r > 0.2 && *b > 0.2).count();
        assert!(if samples == Samples::ONE { mixed == 0 } else { mixed > 50 }, "{mixed}");
    }
}

/// Rays of the truth pass through holes.
#[test]
fn rays_pass_through_holes() {
    let square = |z: f64| [[-1.0, -1.0, z], [1.0, -1.0, z], [1.0, 1.0, z], [-1.0, 1.0, z]];
    let mesh = Mesh {
        positions: [square(1.0), square(2.0)].concat(),
        triangles: vec![[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]],
        texture: Some(vec![
            [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]],
            [[0.0, 0.0], [1.0, 1.0], [0.0, 1.0]],
            [[0.0; 2]; 3],
            [[0.0; 2]; 3],
        ]),
        materials: vec![
            Material { name: "fence".into(), texture: Some(board(2, 0, 255)), diffuse: [1.0; 4], image: None },
            Material { name: "wall".into(), texture: None, diffuse: BLUE, image: None },
        ],
        material: Some(vec![0, 0, 1, 1]),
        ..Mesh::default()
    };
    let surface = Surface::mesh(&mesh).unwrap();
    let hit = |x: f64, y: f64| surface.first_hit(DVec3::new(x, y, 0.0), DVec3::Z, 0.0).unwrap();
    // The first texel, at the upper left, is there.
    assert_eq!(
        [(-0.5, 0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, -0.5)].map(|(x, y)| hit(x, y).distance),
        [1.0, 1.0, 2.0, 2.0]
    );
    assert_eq!((hit(-0.5, 0.5).color[3], hit(0.5, 0.5).color), (1.0, BLUE));
}
