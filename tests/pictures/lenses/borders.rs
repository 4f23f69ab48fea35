//! Where the image of a lens ends: nothing is drawn beyond, and up to there kernels and twins have
//! the same rays.

use super::*;

/// Disks on a ball around the eye, which overlap.
fn ball(count: usize) -> Scene {
    let mut scene = disks(count, 0.25, PI, 21);
    let inward = |surfel: &mut Surfel| {
        let toward = Vec3::from_array(surfel.center).normalize();
        *surfel = Surfel::disk(3.0 * toward, -toward, 0.25);
    };
    scene.surfels.iter_mut().for_each(inward);
    scene
}

/// Lenses with the limit in the image: a whole fisheye, and distortions that fold the image.
fn folding() -> [(&'static str, Camera); 5] {
    let bent = |radial: [f64; 4]| Optics::of(Form::Perspective).with_radial(radial);
    let leaning = bent([-0.5, 0.0, 0.0, 0.0]).with_tangential([0.01, -0.02]);
    let prism = Optics::of(Form::Fisheye).with_radial([-0.1, 0.0, 0.0, 0.0]).with_prism([0.02, 0.01]);
    let around = |optics| posed((128, 128), Lens::Curved(optics, [64.0, 64.0, 64.0, 64.0]));
    [
        ("fisheye", posed((128, 128), Lens::Fisheye(360.0))),
        ("folded", around(bent([-0.5, 0.0, 0.0, 0.0]))),
        ("leaning", around(leaning)),
        ("fov", posed((128, 128), Lens::Curved(Optics::field_of_view(2.0), [36.0, 36.0, 64.0, 64.0]))),
        ("prism", posed((128, 128), Lens::Curved(prism, [40.0, 40.0, 64.0, 64.0]))),
    ]
}

fn pixels(camera: &Camera) -> impl Iterator<Item = (usize, DVec2)> {
    let width = camera.width as usize;
    let center = move |pixel: usize| DVec2::new((pixel % width) as f64 + 0.5, (pixel / width) as f64 + 0.5);
    (0..camera.pixels()).map(move |pixel| (pixel, center(pixel)))
}

#[test]
fn lit_pixels_at_the_end_of_a_lens_are_those_of_the_twin() {
    let Some(gpu) = common::gpu() else { return };
    let scene = ball(8000);
    for (name, camera) in folding() {
        for shading in [Shading::Lambert, Shading::Phong] {
            let lit = Settings { shading, ..settings() };
            let twin = drawn(&scene, &camera, &lit, &Backend::Reference);
            let device = drawn(&scene, &camera, &lit, &Backend::gpu(gpu.clone()));
            let (most, off) = difference(&device, &twin);
            let beyond = |frame: &Frame| {
                let depths = frame.map(Map::Depth).unwrap();
                pixels(&camera).filter(|(pixel, at)| depths[*pixel].is_finite() && !camera.shows(at.x, at.y)).count()
            };
            let shown = pixels(&camera).filter(|(_, at)| camera.shows(at.x, at.y)).count();
            let drawn_beyond = [beyond(&twin), beyond(&device)];
            let sources = Sources::default().replace(
                "camera_lens.wgsl",
                "fragment.hit && shows_plane(",
                "fragment.hit && unfolded(",
            );
            let all = "fn unfolded(plane: vec2<f32>) -> bool { return true; } fn within_lens(";
            let sources = sources.unwrap().replace("camera_lens.wgsl", "fn within_lens(", all);
            let broken = Backend::Gpu { gpu: Box::new(gpu.clone()), sources: sources.unwrap() };
            let noticed = difference(&drawn(&scene, &camera, &lit, &broken), &twin).1;
            eprintln!(
                "{name}: {shown} pixels shown, at most {most:.1e}, {off} above 1e-3, {drawn_beyond:?} drawn beyond; \
                 broken {noticed}"
            );
            assert!(shown > 2000 && shown < 15_000, "{name}: {shown}");
            assert!(off <= 8, "{name}: {most} in {off} pixels");
            // A pixel at the very border may round to either side.
            assert!(drawn_beyond[0] == 0 && drawn_beyond[1] <= 4, "{name}: {drawn_beyond:?}");
            assert!(noticed > 50, "{name}: the control differs in {noticed} pixels");
        }
    }
}

/// The ray of each pixel that a lens shows has its image in the middle of that pixel, and no point
/// that the lens sees has an image where it shows nothing.
#[test]
fn a_lens_shows_what_it_sees() {
    for (name, camera) in folding() {
        let mut worst = 0.0f64;
        for (_, at) in pixels(&camera).filter(|(_, at)| camera.shows(at.x, at.y)) {
            let Some((image, depth)) = camera.image(camera.ray(at.x, at.y)) else { continue };
            assert!((depth - 1.0).abs() < 1e-9, "{name}: {depth}");
            worst = worst.max((image - at).length());
        }
        let mut random = Random(23);
        let mut unseen = 0;
        for _ in 0..20_000 {
            let mut at = || random.between(-1.0, 1.0);
            let Some((image, _)) = camera.image(DVec3::new(at(), at(), at())) else { continue };
            unseen += usize::from(!camera.shows(image.x, image.y));
        }
        eprintln!("{name}: rays err by {worst:.1e} pixels, {unseen} points of 20000 are seen where nothing shows");
        assert!(worst < 0.02 && unseen <= 4, "{name}: {worst} {unseen}");
    }
}

/// Rays into the corners of an image, which a fisheye does not reach, meet nothing.
#[test]
fn truth_ends_where_the_lens_ends() {
    use epsplat::low_level::surfels::analytic::Shape;
    use epsplat::low_level::truth::{Surface, Truth};
    let camera = Camera {
        eye: DVec3::new(0.0, 0.0, -1.5),
        ..posed(
            (64, 64),
            Lens::Curved(Optics::of(Form::Perspective).with_radial([-0.5, 0.0, 0.0, 0.0]), [24.0, 24.0, 32.0, 32.0]),
        )
    };
    let truth = Truth::cast(&Surface::Analytic(Shape::Sphere), &camera, &Settings::default(), 1, &()).unwrap();
    let depths = truth.frame.map(Map::Depth).unwrap();
    let seen = pixels(&camera).filter(|(pixel, _)| depths[*pixel].is_finite()).count();
    let beyond = pixels(&camera).filter(|(pixel, at)| depths[*pixel].is_finite() && !camera.shows(at.x, at.y)).count();
    assert!(seen > 300 && beyond == 0, "{seen} {beyond}");
}

/// COLMAP's FOV model is a perspective: it shows what lies in front of the eye, and depth is z.
#[test]
fn the_fov_model_shows_depths_along_the_axis_up_to_ninety_degrees() {
    let Some(gpu) = common::gpu() else { return };
    let camera = colmap("FOV", &[450.0, 450.0, 320.0, 240.0, 2.0]);
    let wide = 2.0 * 1f64.tan();
    let scene = disks(4000, 0.03, 0.99 * PI, 24);
    let plain = Settings { kernel: Kernel::Constant, ..settings() };
    let fault = |sources: Sources| {
        let device = Backend::Gpu { gpu: Box::new(gpu.clone()), sources };
        [Backend::Reference, device].map(|backend| {
            let frame = drawn(&scene, &camera, &plain, &backend);
            let depths = frame.map(Map::Depth).unwrap();
            let (mut wrong, mut shown) = (0, 0);
            for (pixel, at) in pixels(&camera).filter(|(pixel, _)| depths[*pixel].is_finite()) {
                let plane = (at - DVec2::new(320.0, 240.0)) * 2.0 / 450.0;
                let angle = plane.length().tan() / wide;
                let toward = (plane.normalize() * angle).extend(1.0);
                let depth = f64::from(depths[pixel]);
                // The point at that depth lies on a disk, within a few pixels.
                let near =
                    |surfel: &Surfel| (DVec3::from(center(surfel)) - toward * depth).length() < 0.045 + 0.02 * depth;
                shown += 1;
                wrong += usize::from(plane.length() >= 0.5 * PI || !scene.surfels.iter().any(near));
            }
            (wrong, shown)
        })
    };
    let [twin, device] = fault(Sources::default());
    let flat =
        Sources::default().replace("lens_fisheye.wgsl", "return held.lens[6].w > 0.0;", "return false;").unwrap();
    let broken = fault(flat)[1];
    eprintln!("pixels in the wrong place: twin {twin:?}, device {device:?}, with distances {broken:?}");
    assert!(
        twin.0 <= twin.1 / 100 && device.0 <= device.1 / 100 && twin.1 > 300 && device.1 > 300,
        "{twin:?} {device:?}"
    );
    assert!(broken.0 > broken.1 / 4, "{broken:?}");
}

/// Tangential terms move the corners of the image outward; splats there are drawn.
#[test]
fn images_of_leaning_lenses_are_covered_up_to_their_corners() {
    let Some(gpu) = common::gpu() else { return };
    let place = |k: usize| Vec3::new((k % 81) as f32 * 0.05 - 2.0, (k / 81) as f32 * 0.05 - 2.0, 1.0);
    let surfels: Vec<Surfel> = (0..81 * 81).map(|k| Surfel::disk(place(k), Vec3::NEG_Z, 0.06)).collect();
    let wall = Scene { surfels, ..Scene::default() };
    for lean in [0.0, 0.02, 0.05] {
        for rest in [[0.0, lean], [lean, 0.0], [-lean, lean]] {
            let optics = Optics::of(Form::Perspective).with_radial([1e-6, 0.0, 0.0, 0.0]).with_tangential(rest);
            let camera = posed((200, 200), Lens::Curved(optics, [100.0; 4]));
            for backend in [Backend::Reference, Backend::gpu(gpu.clone())] {
                let frame = drawn(&wall, &camera, &settings(), &backend);
                let depths = frame.map(Map::Depth).unwrap();
                let at = |pixel: usize| ((pixel % 200) as f64 + 0.5, (pixel / 200) as f64 + 0.5);
                // A lens that leans much folds: no direction leads to some corner of its image.
                let is_seen = |pixel: &usize| camera.shows(at(*pixel).0, at(*pixel).1);
                let empty = (0..depths.len()).filter(is_seen).filter(|pixel| !depths[*pixel].is_finite()).count();
                let unseen = (0..depths.len()).filter(|pixel| !is_seen(pixel)).count();
                assert_eq!(empty, 0, "{rest:?}");
                assert_eq!(unseen > 0, rest == [-0.05, 0.05], "{rest:?}: {unseen}");
            }
        }
    }
}
