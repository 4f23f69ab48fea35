//! The ray-cast truth compared with closed forms, and a mesh with the surface that it approximates.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common;

use std::f64::consts::PI;
use std::path::Path;

use common::meshes::sphere;
use epsplat::io::Mesh;
use epsplat::low_level::metrics::{Reconstruction, reconstruction};
use epsplat::low_level::plan::Settings;
use epsplat::low_level::render::{Backend, render};
use epsplat::low_level::scene::options::HIGHLIGHT;
use epsplat::low_level::scene::{Camera, Colors, Lens, Light, Map, Maps, Shading, Up};
use epsplat::low_level::surfels::analytic::Shape;
use epsplat::low_level::truth::{DEFAULT_GRID, Surface, Truth};
use glam::DVec3;

/// Returns a camera that looks at the origin from `eye`. With an odd `side`, its axis goes through
/// the centre of a pixel.
fn camera(side: u32, lens: Lens, eye: DVec3) -> Camera {
    Camera::look_at((side, side), lens, eye, DVec3::ZERO, Some(DVec3::Y), Up::Y, 1e-3).unwrap()
}

fn cast(surface: &Surface, camera: &Camera) -> Truth {
    Truth::cast(surface, camera, &Settings::default(), DEFAULT_GRID, &()).unwrap()
}

fn depth(truth: &Truth, pixel: usize) -> f64 {
    truth.frame.map(Map::Depth).unwrap()[pixel].into()
}

/// The area that the surface covers, pixels.
fn area(truth: &Truth) -> f64 {
    truth.coverage.iter().map(|&share| f64::from(share)).sum()
}

/// A ray through a transparent sphere meets its front and its back.
#[test]
fn rays_go_through_what_lets_them_through() {
    let camera = camera(51, Lens::Fov(30.0), DVec3::new(0.0, 0.0, 5.0));
    let options = Settings { shading: Shading::Unlit, opacity: 0.5, ..Settings::default() };
    let mesh = Surface::mesh(&sphere(4, false)).unwrap();
    for (surface, slack) in [(Surface::Analytic(Shape::Sphere), 0.0), (mesh, 0.01)] {
        let truth = Truth::cast(&surface, &camera, &options, 1, &()).unwrap();
        let opaque = Truth::cast(&surface, &camera, &Settings { opacity: 1.0, ..options.clone() }, 1, &()).unwrap();
        let alphas = |of: &Truth| of.frame.color.iter().map(|color| color[3]).collect::<Vec<_>>();
        let covered = alphas(&opaque).iter().filter(|alpha| **alpha == 1.0).count();
        let twice = alphas(&truth).iter().filter(|alpha| **alpha == 0.75).count();
        assert!(covered > 700 && (covered - twice) as f64 <= slack * covered as f64, "{covered} {twice}");
        assert_eq!(truth.frame.map(Map::Depth), opaque.frame.map(Map::Depth));
    }
}

#[test]
fn a_sphere_has_the_outline_and_depths_of_its_formula() {
    let truth = |lens| {
        let camera = camera(201, lens, DVec3::new(0.0, 0.0, 5.0));
        let truth = cast(&Surface::Analytic(Shape::Sphere), &camera);
        (camera, truth)
    };
    let center = 100 * 201 + 100;
    // A pinhole at distance 5 sees the cone of tangents, tan = 1 / sqrt(5^2 - 1); f = 100.5 /
    // tan(15 degrees).
    let (pinhole, seen) = truth(Lens::Fov(30.0));
    let radius = pinhole.fx / 24f64.sqrt();
    // The error is that of 16 samples per pixel along the outline; 2.7e-5 was measured.
    assert!((area(&seen) / (PI * radius * radius) - 1.0).abs() < 1e-4, "{}", area(&seen));
    let (orthographic, flat) = truth(Lens::OrthographicHeight(2.5));
    let scale = orthographic.fx;
    assert!((area(&flat) / (PI * scale * scale) - 1.0).abs() < 1e-4, "{}", area(&flat));
    for truth in [&seen, &flat] {
        assert_eq!(depth(truth, center), 4.0);
        assert_eq!(truth.second_depth[center], 6.0);
        assert_eq!(truth.frame.normals().unwrap()[center], [0.0, 0.0, 1.0]);
        assert_eq!((depth(truth, 0), truth.second_depth[0]), (f64::INFINITY, f32::INFINITY));
        assert_eq!((truth.frame.color[0], truth.coverage[0]), ([0.0; 4], 0.0));
        assert_eq!(truth.frame.normals().unwrap()[0], [0.0; 3]);
    }
    let mut met = 0;
    for pixel in 0..flat.coverage.len() {
        let [x, y] = [pixel % 201, pixel / 201].map(|k| (k as f64 - 100.0) / scale);
        let height = 1.0 - x * x - y * y;
        assert_eq!(depth(&flat, pixel).is_finite(), height >= 0.0);
        if height >= 0.0 {
            assert!((depth(&flat, pixel) - (5.0 - height.sqrt())).abs() < 5e-7);
            assert!((f64::from(flat.second_depth[pixel]) - (5.0 + height.sqrt())).abs() < 5e-7);
            met += 1;
        }
    }
    assert!(met > 20_000);
}

#[test]
fn a_torus_has_its_hole() {
    let camera = camera(201, Lens::OrthographicHeight(4.0), DVec3::new(0.0, 0.0, 3.0));
    let truth = cast(&Surface::Analytic(Shape::Torus), &camera);
    let center = 100 * 201 + 100;
    assert_eq!((depth(&truth, center), truth.coverage[center]), (f64::INFINITY, 0.0));
    // The image's area is pi (1.4^2 - 0.6^2) times the squared scale. The two outlines have smaller
    // radii than that of the sphere above, so the error is larger: 4.2e-4 was measured.
    let expected = 1.6 * PI * camera.fx * camera.fx;
    assert!((area(&truth) / expected - 1.0).abs() < 1e-3, "{}", area(&truth) / expected);
    // The crest of the tube, and its bottom.
    let at = center + 50;
    let x = 50.0 / camera.fx - 1.0;
    let half = (0.16 - x * x).sqrt();
    assert!((depth(&truth, at) - (3.0 - half)).abs() < 3e-7);
    assert!((f64::from(truth.second_depth[at]) - (3.0 + half)).abs() < 3e-7);
    // Seen from the side, a ray meets four walls; the second is the far wall of the same tube.
    let side = self::camera(101, Lens::OrthographicHeight(4.0), DVec3::new(4.0, 0.0, 0.0));
    let side = cast(&Surface::Analytic(Shape::Torus), &side);
    let center = 50 * 101 + 50;
    assert!((depth(&side, center) - 2.6).abs() < 1e-6 && (side.second_depth[center] - 3.4).abs() < 1e-6);
}

/// A plane seen head-on, for which every cosine has a formula.
#[test]
fn highlights_are_phongs() {
    let (size, distance, exponent) = (65, 5.0, 20.0);
    let camera = camera(size, Lens::Fov(24.0), DVec3::new(0.0, 0.0, distance));
    let toward = DVec3::new(0.2, 0.0, 1.0).normalize();
    let lights =
        [Light::Headlight { intensity: 0.5 }, Light::Directional { toward: toward.as_vec3(), intensity: 0.25 }];
    let cast = |shading, lights: &[Light]| {
        let options = Settings { shading, lights: lights.into(), shininess: exponent as f32, ..Default::default() };
        Truth::cast(&Surface::Analytic(Shape::Plane), &camera, &options, 1, &()).unwrap().frame
    };
    let (diffuse, both) = (cast(Shading::Lambert, &lights), cast(Shading::Phong, &lights));
    let (mut seen, mut brightest) = (0, (0.0, 0));
    for pixel in (0..diffuse.color.len()).filter(|pixel| diffuse.map(Map::Depth).unwrap()[*pixel].is_finite()) {
        let [x, y] = [pixel % 65, pixel / 65].map(|k| (k as f64 - 32.0) / camera.fx);
        let toward_eye = DVec3::new(-x, y, 1.0).normalize();
        // The headlight's reflection deviates by twice its angle; that of the other light is
        // mirrored at z.
        let of_headlight = 0.5 * toward_eye.z * (2.0 * toward_eye.z * toward_eye.z - 1.0).powf(exponent);
        let mirrored = DVec3::new(-toward.x, -toward.y, toward.z).dot(toward_eye).max(0.0);
        let of_other = 0.25 * toward.z * mirrored.powf(exponent);
        let expected = HIGHLIGHT * (of_headlight + of_other);
        let highlight = f64::from(both.color[pixel][1] - diffuse.color[pixel][1]);
        assert!((highlight - expected).abs() < 1e-6, "{highlight} is not {expected} at {pixel}");
        let alone = highlight - HIGHLIGHT * of_headlight;
        brightest = if alone > brightest.0 { (alone, pixel) } else { brightest };
        seen += 1;
    }
    // The light is to the right of the eye, so its highlight is to the right of the centre.
    let expected = 32.0 + toward.x / toward.z * camera.fx;
    assert!(seen > 3500 && (brightest.1 as f64 % 65.0 - expected).abs() <= 1.0, "{brightest:?} {expected}");
}

#[test]
fn shading_and_background_are_those_of_a_render() {
    let camera = camera(65, Lens::Fov(24.0), DVec3::new(0.0, 0.0, 5.0));
    let surface = Surface::Analytic(Shape::Checkerboard);
    let unlit = Settings { shading: Shading::Unlit, background: [0.0, 0.5, 0.0, 1.0], ..Settings::default() };
    let truth = |options: &Settings| Truth::cast(&surface, &camera, options, DEFAULT_GRID, &()).unwrap();
    let [plain, lit] = [&unlit, &Settings { shading: Shading::Lambert, ..unlit.clone() }].map(truth);
    let inside = |pixel: &usize| plain.coverage[*pixel] == 1.0;
    let mut light = 0.0;
    for pixel in (0..plain.coverage.len()).filter(inside) {
        let [r, g, b, alpha] = plain.frame.color[pixel];
        assert!(r == g && g == b && alpha == 1.0);
        light += f64::from(r);
        // The headlight's cosine on z = 0 is that of the ray, which is between those at the pixel's
        // far and near corners.
        let [x, y] = [pixel % 65, pixel / 65].map(|k| (k as f64 - 32.0).abs());
        let cosine = |across: f64| {
            let [x, y] = [(x + across).max(0.0), (y + across).max(0.0)].map(|d| d / camera.fx);
            1.0 / (1.0 + x * x + y * y).sqrt()
        };
        let dimmed = f64::from(lit.frame.color[pixel][0]);
        let r = f64::from(r);
        assert!(dimmed <= r * cosine(-0.5) + 1e-6 && dimmed >= r * cosine(0.5) - 1e-6, "{dimmed} of {r}");
    }
    let covered = (0..plain.coverage.len()).filter(inside).count();
    assert!(covered > 3500 && (light / covered as f64 - 0.5).abs() < 0.02, "{light} of {covered}");
    // Outside the square there is background; partly covered pixels contain a part of it.
    assert_eq!(plain.frame.color[0], [0.0, 0.5, 0.0, 1.0]);
    let mixed = |pixel: &usize| plain.coverage[*pixel] > 0.0 && plain.coverage[*pixel] < 1.0;
    for pixel in (0..plain.coverage.len()).filter(mixed) {
        let [r, g, _, alpha] = plain.frame.color[pixel];
        assert!((g - r - 0.5 * (1.0 - plain.coverage[pixel])).abs() < 1e-6 && alpha == 1.0);
    }
}

#[test]
fn a_finer_mesh_comes_nearer_at_the_order_of_its_elements() {
    let camera = camera(128, Lens::Fov(30.0), DVec3::new(2.0, 3.0, 3.5));
    let truth = cast(&Surface::Analytic(Shape::Sphere), &camera);
    let error = |cuts, smooth| -> Reconstruction {
        let mesh = cast(&Surface::mesh(&sphere(cuts, smooth)).unwrap(), &camera);
        reconstruction(&mesh.frame, &truth).unwrap()
    };
    let errors: Vec<_> = (4..7).map(|cuts| (error(cuts, false), error(cuts, true))).collect();
    for pair in errors.windows(2) {
        let ratio = |of: &dyn Fn(&(Reconstruction, Reconstruction)) -> f64| of(&pair[0]) / of(&pair[1]);
        let depth = ratio(&|(flat, _)| flat.depth_relative.unwrap().mean);
        let flat = ratio(&|(flat, _)| flat.normal_degrees.unwrap().mean);
        let smooth = ratio(&|(_, smooth)| smooth.normal_degrees.unwrap().mean);
        // Halving the edges gives a quarter of the depth error, half of the facets' normal error,
        // and a quarter of that of interpolated normals.
        assert!((3.8..4.2).contains(&depth) && (1.9..2.1).contains(&flat) && (3.8..4.2).contains(&smooth));
    }
    assert!(errors[2].0.depth_relative.unwrap().mean < 1e-4 && errors[2].1.normal_degrees.unwrap().mean < 0.1);
}

#[test]
fn no_ray_slips_through_an_edge_or_a_vertex() {
    // Pixel centres and samples lie exactly on the octahedron's edges and vertices, and its outline
    // is exact.
    let eye = DVec3::new(0.0, 0.0, 4.0);
    for (side, cuts) in [(65, 0), (64, 0), (257, 3)] {
        let camera = camera(side, Lens::OrthographicScale([32.0, 32.0, side as f64 / 2.0, side as f64 / 2.0]), eye);
        let surface = Surface::mesh(&sphere(cuts, false)).unwrap();
        let truth = cast(&surface, &camera);
        for pixel in 0..truth.coverage.len() {
            let [x, y] = [pixel % side as usize, pixel / side as usize]
                .map(|k| (k as f64 + 0.5 - side as f64 / 2.0).abs() / 32.0);
            let inside = if cuts == 0 { x + y < 0.9 } else { x * x + y * y < 0.9 };
            if inside {
                assert_eq!(truth.coverage[pixel], 1.0, "{x} {y}");
                let second = f64::from(truth.second_depth[pixel]);
                // The two walls are mirror images, also where the ray meets several triangles of
                // one wall at once.
                assert!((depth(&truth, pixel) + second - 8.0).abs() < 1e-6, "{x} {y}: {second}");
            }
        }
    }
}

#[test]
fn a_mesh_in_map_coordinates_loses_no_digits() {
    let offset = DVec3::new(636_590.123, 5_849_216.456, 430.789);
    let here = camera(64, Lens::Fov(30.0), DVec3::new(2.0, 3.0, 3.5));
    let mut mesh = sphere(3, false);
    let near = cast(&Surface::mesh(&mesh).unwrap(), &here);
    mesh.positions.iter_mut().for_each(|p| *p = (DVec3::from(*p) + offset).to_array());
    let there = Camera { eye: here.eye + offset, ..here };
    let far = cast(&Surface::mesh(&mesh).unwrap(), &there);
    let error = reconstruction(&far.frame, &near).unwrap();
    // At 5.8e6 an f64 is rounded to 5e-10, and so is the mesh.
    assert_eq!((error.silhouette_iou, error.hole_rate), (Some(1.0), Some(0.0)));
    assert!(error.depth_relative.unwrap().mean < 1e-8 && error.max_abs < 1e-5, "{error:?}");
}

#[test]
fn what_has_no_area_is_not_there() {
    let camera = camera(33, Lens::Fov(30.0), DVec3::new(0.0, 0.0, 5.0));
    let nothing = |mesh: &Mesh| {
        let truth = cast(&Surface::mesh(mesh).unwrap(), &camera);
        assert!(truth.coverage.iter().all(|&share| share == 0.0));
        truth
    };
    let empty = nothing(&Mesh::default());
    let degenerate = Mesh {
        positions: vec![
            [0.0; 3],
            [1.0, 0.0, 0.0],
            [0.5, 0.0, 0.0],
            [f64::NAN; 3],
            [0.0, f64::INFINITY, 0.0],
            [1e300; 3],
        ],
        triangles: vec![[0, 0, 0], [0, 1, 2], [0, 1, 1], [0, 1, 3], [0, 4, 1]],
        ..Mesh::default()
    };
    nothing(&degenerate);
    nothing(&Mesh { triangles: vec![[0, 1, 5]], ..degenerate.clone() });
    // Degenerate triangles do not hide others.
    let mut mixed = degenerate;
    mixed.positions.extend([[-1.0, -1.0, 0.5], [1.0, -1.0, 0.5], [0.0, 1.0, 0.5]]);
    mixed.triangles.push([6, 7, 8]);
    let truth = cast(&Surface::mesh(&mixed).unwrap(), &camera);
    assert_eq!(depth(&truth, 16 * 33 + 16), 4.5);
    assert_eq!(truth.second_depth[16 * 33 + 16], f32::INFINITY);
    // Without pixels no measure reports success.
    let error = reconstruction(&empty.frame, &empty).unwrap();
    assert_eq!(
        (error.depth_relative, error.hole_rate, error.leak_rate, error.silhouette_iou, error.outline_px),
        (None, None, None, None, None)
    );
    let outside = Mesh { triangles: vec![[0, 1, 9]], ..mixed.clone() };
    let colorless = Mesh { colors: Some(Colors::Linear(vec![[1.0; 4]])), ..mixed };
    for bad in [outside, colorless] {
        assert!(Surface::mesh(&bad).is_err());
    }
    assert!(Truth::cast(&Surface::Analytic(Shape::Plane), &camera, &Settings::default(), 0, &()).is_err());
}

#[test]
fn obj_files_keep_their_normals_and_colors() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("square.obj");
    let text = "v -1 -1 0 1 0 0\nv 1 -1 0 1 0 0\nv 1 1 0 0 0 1\nv -1 1 0 0 0 1\nvn 0 0.6 0.8\n";
    let camera = camera(33, Lens::OrthographicHeight(2.0), DVec3::new(0.0, 0.0, 5.0));
    let read = |faces: &str| {
        std::fs::write(&path, format!("{text}{faces}\n")).unwrap();
        let unlit = Settings { shading: Shading::Unlit, ..Settings::default() };
        Truth::cast(&Surface::read(&path, &()).unwrap(), &camera, &unlit, DEFAULT_GRID, &()).unwrap()
    };
    let center = 16 * 33 + 16;
    assert_eq!(read("f 1 2 3 4").frame.normals().unwrap()[center], [0.0, 0.0, 1.0]);
    let smooth = read("f 1//1 2//1 3//1 4//1").frame;
    assert_eq!(smooth.normals().unwrap()[center], [0.0, 0.6, 0.8]);
    // Halfway from red to blue, in linear light.
    let [r, g, b, alpha] = smooth.color[center];
    assert!((r - 0.5).abs() < 1e-6 && g == 0.0 && (b - 0.5).abs() < 1e-6 && alpha == 1.0, "{:?}", smooth.color[center]);
    for (name, bytes) in [("missing.obj", None), ("cloud.ply", Some("ply\n")), ("bad.obj", Some("f 1 2 3\n"))] {
        let path = folder.path().join(name);
        bytes.inspect(|bytes| std::fs::write(&path, bytes).unwrap());
        let Err(error) = Surface::read(&path, &()) else { panic!("{name} was read") };
        assert!(error.to_string().contains(name), "{error}");
    }
}

#[test]
fn the_bunny_of_surfels_is_the_bunny_of_triangles() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("data/bunny.obj");
    let points = epsplat::io::read(&path, &()).unwrap();
    let mut mesh = epsplat::io::read_mesh(&path, &()).unwrap();
    assert_eq!((mesh.positions.len(), mesh.triangles.len()), (1839, 3674));
    let (scene, _) = epsplat::low_level::surfels::build(vec![points.clone()], &()).unwrap();
    let camera = Camera::framing((200, 200), Lens::Fov(45.0), &scene, Camera::default_near(&scene)).unwrap();
    let maps = Maps::of(&[Map::Depth, Map::Normal]);
    let options = Settings { maps, ..Settings::default() };
    let (frame, _) = render(&scene, &camera, &options, &Backend::Reference, &()).unwrap();
    let error = |surface: &Surface| {
        let truth = Truth::cast(surface, &camera, &options, DEFAULT_GRID, &()).unwrap();
        reconstruction(&frame, &truth).unwrap()
    };
    let faceted = error(&Surface::read(&path, &()).unwrap());
    let vertex_normals = points.normals.unwrap();
    mesh.normals = Some(mesh.triangles.iter().map(|t| t.map(|vertex| vertex_normals[vertex as usize])).collect());
    let smooth = error(&Surface::mesh(&mesh).unwrap());
    // The surfels cover the triangles, so there are no holes, and end at their borders.
    assert_eq!(faceted.hole_rate, Some(0.0));
    eprintln!("{faceted:?} {smooth:?}");
    assert!(faceted.silhouette_iou.unwrap() > 0.99 && faceted.leak_rate.unwrap() < 1e-3);
    // The file has no normals and large facets. The surfels lie in the facets, 0.29 degrees from
    // their normals; they differ from interpolated vertex normals as much as the facets do.
    let (facets, vertices) = (faceted.normal_degrees.unwrap().mean, smooth.normal_degrees.unwrap().mean);
    assert!(facets < 0.5 && (6.0..7.0).contains(&vertices), "{facets} {vertices}");
    // Both truths have the same depth. The mean error is 0.23 %, the median 0.12 %.
    assert_eq!(faceted.depth_relative, smooth.depth_relative);
    assert!(faceted.depth_relative.unwrap().mean < 0.003);
}
