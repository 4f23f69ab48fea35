//! Needles, and triangles far from the origin, which must look like the same triangles near it.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common;

use common::scenes::sphere;
use common::{Random, meshes};
use epsplat::io::Mesh;
use epsplat::low_level::frame::Frame;
use epsplat::low_level::gpu::Sources;
use epsplat::low_level::metrics::DECISION_MARGIN;
use epsplat::low_level::plan::{BlendFormat, Facts, Raster, RasterDepth, Settings};
use epsplat::low_level::render::{Backend, render};
use epsplat::low_level::scene::{Camera, Lens, Map, Maps, Scene, Triangle, Triangles, Up};
use epsplat::low_level::surfels::with_triangles;
use glam::DVec3;

fn gpu() -> Option<Backend> {
    common::gpu().map(Backend::gpu)
}

fn broken(file: &str, from: &str, to: &str) -> Backend {
    let sources = Sources::default().replace(file, from, to).unwrap();
    Backend::Gpu { gpu: Box::new(common::gpu().unwrap()), sources }
}

/// Lit, so that the normals of the triangles' planes show.
fn lit() -> Settings {
    Settings { maps: Maps::of(&[Map::Depth]), ..Settings::default() }
}

fn frame(scene: &Scene, camera: &Camera, options: &Settings, backend: &Backend) -> Frame {
    render(scene, camera, options, backend, &()).unwrap().0
}

/// A closed surface with bumps. Its coordinates are multiples of 2^-16, so f64 holds them exactly
/// even after a move by 2^36.
fn rough() -> Mesh {
    let mut mesh = meshes::sphere(4, false);
    let mut random = Random(7);
    for position in &mut mesh.positions {
        let scale = random.between(0.75, 1.0);
        *position = position.map(|x| (x * scale * 65536.0).round() / 65536.0);
    }
    mesh
}

/// The mesh, moved by `place`.
fn at(mesh: &Mesh, place: DVec3) -> Mesh {
    let positions = mesh.positions.iter().map(|p| (DVec3::from_array(*p) + place).to_array()).collect();
    Mesh { positions, ..mesh.clone() }
}

/// A camera near `place` that looks at it.
fn camera(place: DVec3, lens: Lens) -> Camera {
    let eye = place + DVec3::new(1.0, 1.5, 2.0);
    Camera::look_at((96, 72), lens, eye, place, None, Up::Y, 0.125).unwrap()
}

const LENSES: [Lens; 2] = [Lens::Fov(50.0), Lens::OrthographicHeight(2.5)];

/// The number of decided pixels whose colour or depth differs, and of covered pixels.
fn apart(shown: &Frame, truth: &Frame, decided: &[f32]) -> (usize, usize) {
    let depths = [shown, truth].map(|frame| frame.map(Map::Depth).unwrap());
    let differs = |pixel: &usize| {
        let colors = shown.color[*pixel].iter().zip(truth.color[*pixel]).any(|(a, b)| (a - b).abs() > 1e-4);
        let [a, b] = depths.map(|depths| depths[*pixel]);
        let deeper = a.is_finite() != b.is_finite() || (a.is_finite() && (a - b).abs() > 1e-5 * b);
        decided[*pixel] > DECISION_MARGIN && (colors || deeper)
    };
    let covered = depths[1].iter().filter(|depth| depth.is_finite()).count();
    ((0..decided.len()).filter(differs).count(), covered)
}

/// The reference's picture of the mesh at the origin, and its decision margins.
fn truth(mesh: &Mesh, lens: Lens) -> (Frame, Vec<f32>) {
    let scene = with_triangles(None, std::slice::from_ref(mesh)).unwrap().0;
    let with_decision = Settings { maps: Maps::of(&[Map::Depth, Map::Decision]), ..lit() };
    let frame = frame(&scene, &camera(DVec3::ZERO, lens), &with_decision, &Backend::Reference);
    let decided = frame.map(Map::Decision).unwrap().to_vec();
    (frame, decided)
}

/// The same triangles with corners rounded to f32.
fn single(triangles: &Triangles) -> Triangles {
    let corner = |vertex: &u32| triangles.vertices()[*vertex as usize].map(f64::from);
    let of = |corners: &[u32; 3]| Triangle {
        corners: std::array::from_fn(|k| corner(&corners[k])),
        normals: None,
        colors: triangles.colors()[0],
        texture: None,
    };
    Triangles::new(&triangles.corners().iter().map(of).collect::<Vec<_>>())
}

/// Places from 1e6 to 9e9 away, along axes and askew.
const FAR: [[f64; 3]; 5] = [[1e6, 0.0, 0.0], [-3e6, 2e6, 1e6], [0.0, 1e7, -1e7], [1e9, 0.0, 0.0], [-4e9, 5e9, 6e9]];

/// Two copies of a mesh far from each other look alike, each seen from near: with kernels, with the
/// reference, and beside surfels. Without the low parts of coordinates (the rest that f32 rounds
/// away) they do not.
#[test]
fn a_mesh_far_away_looks_as_it_does_near() {
    let Some(backend) = gpu() else { return };
    let mesh = rough();
    for lens in LENSES {
        let (near, decided) = truth(&mesh, lens);
        for place in FAR.map(DVec3::from_array) {
            let far = at(&mesh, place);
            let alone = with_triangles(None, &[mesh.clone(), far.clone()]).unwrap().0;
            assert_eq!((alone.triangles.len(), alone.triangles.low().is_empty()), (2 * mesh.triangles.len(), false));
            let beside = with_triangles(Some(sphere(500, 1.0)), std::slice::from_ref(&far)).unwrap().0;
            for (scene, at) in [(&alone, DVec3::ZERO), (&alone, place), (&beside, place)] {
                for by in [&backend, &Backend::Reference] {
                    let (apart, covered) = apart(&frame(scene, &camera(at, lens), &lit(), by), &near, &decided);
                    assert!(apart == 0 && covered > 500, "{lens:?} {place} from {at}: {apart} of {covered}");
                }
            }
        }
        let place = DVec3::from_array(FAR[2]);
        let scene = with_triangles(None, &[mesh.clone(), at(&mesh, place)]).unwrap().0;
        let of_high = |from: &str, to: &str| {
            let shown = frame(&scene, &camera(place, lens), &lit(), &broken("vertex_doubled.wgsl", from, to));
            apart(&shown, &near, &decided).0
        };
        assert!(of_high("relative[i] = sum(d, low);", "relative[i] = d;") > 200);
        assert!(of_high("edge[i] = sum(d, low);", "edge[i] = d;") > 200);
        // Control: corners in f32 alone.
        let single = Scene { triangles: single(&scene.triangles), ..scene };
        let shown = frame(&single, &camera(place, lens), &lit(), &Backend::Reference);
        assert!(apart(&shown, &near, &decided).0 > 200);
    }
}

/// The rasteriser draws the same corners: seen from near, both copies of the mesh look alike.
#[test]
fn a_mesh_far_away_is_rasterised_as_it_is_near() {
    let Some(backend) = gpu() else { return };
    let Backend::Gpu { gpu, .. } = &backend else { return };
    let format = if gpu.adapter.blends_f32 { BlendFormat::Rgba32Float } else { BlendFormat::Rgba16Float };
    let options = Settings { raster: Some(Raster { format, depth: RasterDepth::Exact }), ..lit() };
    let (mesh, place) = (rough(), DVec3::from_array(FAR[1]));
    let scene = with_triangles(None, &[mesh.clone(), at(&mesh, place)]).unwrap().0;
    let of = |scene: &Scene, place: DVec3| frame(scene, &camera(place, LENSES[0]), &options, &backend);
    let near = of(&scene, DVec3::ZERO);
    let everywhere = vec![1.0; near.color.len()];
    let (off, covered) = apart(&of(&scene, place), &near, &everywhere);
    assert!(off * 50 < covered && covered > 500, "{off} of {covered}");
    let single = Scene { triangles: single(&scene.triangles), ..scene };
    let (off, _) = apart(&of(&single, place), &near, &everywhere);
    assert!(off * 5 > covered, "{off} of {covered}");
}

/// Only scenes that need the low parts of corners store them.
#[test]
fn scenes_that_f32_serve_have_no_trailing_parts() {
    let mesh = rough();
    let doubled = |meshes: &[Mesh]| Facts::of(&with_triangles(None, meshes).unwrap().0).mesh.doubled;
    assert!(!doubled(std::slice::from_ref(&mesh)));
    // The scene's origin lies near the map coordinates, so f32 suffices.
    assert!(!doubled(&[at(&mesh, DVec3::new(484_700.0, 6_632_550.0, 200.0))]));
    assert!(!doubled(&[mesh.clone(), at(&mesh, DVec3::new(1000.0, 0.0, 0.0))]));
    assert!(doubled(&[mesh.clone(), at(&mesh, DVec3::new(1e6, 0.0, 0.0))]));
    // Decimal coordinates, which f32 rounds, need no low parts either.
    let tenths = |scale: f64| Mesh {
        positions: mesh.positions.iter().map(|p| p.map(|x| (x * 1e4).round() / 1e4 * scale)).collect(),
        ..mesh.clone()
    };
    assert!(!doubled(&[tenths(1.0)]) && !doubled(&[tenths(0.1)]));
}

/// Needles are not degenerate, and seen from near their ends they cover the pixels that they
/// should.
#[test]
fn needles_are_triangles() {
    let Some(backend) = gpu() else { return };
    for (long, direction) in [
        (1e4, DVec3::X),
        (1e6, DVec3::X),
        (1e8, DVec3::X),
        (1e5, DVec3::new(0.6, 0.0, -0.8)),
        (1e6, DVec3::new(0.6, 0.0, -0.8)),
    ] {
        let wide = 1.0 / long;
        let (tip, end) = (DVec3::ZERO, direction * long);
        let positions = [tip, end, end + DVec3::Y * wide].map(|p| p.to_array()).into();
        let mesh = Mesh { positions, triangles: vec![[0, 1, 2]], ..Mesh::default() };
        let (scene, preparation) = with_triangles(None, &[mesh]).unwrap();
        assert_eq!((preparation.triangles, preparation.dropped_degenerate), (1, 0), "{long} {direction}");
        // Like corners, the eye is rounded to f64, so it cannot come near the thinnest needle.
        if wide < 1e-12 * long {
            continue;
        }
        let across = direction.cross(DVec3::Y);
        let target = end - direction * wide + DVec3::Y * 0.5 * wide;
        let eye = target + across * 2.0 * wide;
        let camera =
            Camera::look_at((64, 64), Lens::Fov(60.0), eye, target, Some(DVec3::Y), Up::Y, 0.1 * wide).unwrap();
        let covered = |by: &Backend| {
            let shown = frame(&scene, &camera, &lit(), by);
            shown.color.iter().filter(|color| color[3] > 0.0).count()
        };
        let [ours, theirs] = [&backend, &Backend::Reference].map(covered);
        assert!(ours.abs_diff(theirs) * 20 < theirs && theirs > 200, "{long} {direction}: {ours} and {theirs}");
    }
}
