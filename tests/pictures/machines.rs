//! Frames that several processes draw together, here threads: every one of them gets the bits of a
//! frame that one process draws, however the surfels are shared.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common;

use std::borrow::Cow;
use std::sync::Arc;
use std::sync::Mutex;

use common::any_scene::taken;
use common::network::Threads;
use common::scenes::{sphere, sphere_camera};
use common::{Random, any_options, any_scene};
use epsplat::low_level::frame::Frame;
use epsplat::low_level::gpu::{Gpu, Sources};
use epsplat::low_level::network::{Reduction, Wire};
use epsplat::low_level::passes::share::ShareOfScene;
use epsplat::low_level::passes::source::{Page, Source};
use epsplat::low_level::plan::steps::Reduced;
use epsplat::low_level::plan::{Accumulator, Facts, Organisation, SceneNeeds, Settings, check, composited};
use epsplat::low_level::render::exchange::{Exchange, Lists, Numbers, Rows, Runs, Then};
use epsplat::low_level::render::{Backend, Renderer, render, sums};
use epsplat::low_level::scene::{
    Blend, Camera, Colors, Composite, LowPass, Map, Maps, Mipmap, Projection, Provenance, Samples, Scene, Shading,
    Share, Tail, Triangles,
};
use epsplat::{Error, Result};

/// Some surfels of a scene, with the facts of the whole scene.
struct Hand {
    scene: Scene,
    facts: Facts,
}

impl Source for Hand {
    fn facts(&self) -> Facts {
        Facts { share: Some(self.scene.surfels.len() as u64), ..self.facts.clone() }
    }

    fn pages<'a>(&'a self, needs: &SceneNeeds, most: usize, ordered: Option<&Facts>) -> Vec<Box<dyn Page + 'a>> {
        self.scene.pages(needs, most, ordered)
    }

    fn textures(&self) -> &[Mipmap] {
        self.scene.textures()
    }

    fn triangles(&self) -> Option<&Triangles> {
        Source::triangles(&self.scene)
    }

    fn provenance(&self) -> Cow<'_, Provenance> {
        self.scene.provenance()
    }

    fn whole(&self) -> Option<&Scene> {
        None
    }
}

/// Shares that are runs of the stored order.
fn shares(scene: &Scene, of: u32) -> Vec<Box<dyn Source>> {
    let scene = Arc::new(scene.clone());
    let share = |number| Box::new(ShareOfScene::new(scene.clone(), Share::new(number, of).unwrap()));
    (1..=of).map(|number| share(number) as Box<dyn Source>).collect()
}

/// Shares of any surfels; some may be empty.
fn hands(scene: &Scene, of: u32, random: &mut Random) -> Vec<Box<dyn Source>> {
    let mut dealt = vec![Vec::new(); of as usize];
    (0..scene.surfels.len()).for_each(|surfel| dealt[random.below(of as usize)].push(surfel));
    let facts = Facts::of(scene);
    let hand = |indices: Vec<usize>| Box::new(Hand { scene: taken(scene, &indices), facts: facts.clone() });
    dealt.into_iter().map(|indices| hand(indices) as Box<dyn Source>).collect()
}

/// Draws a frame with a thread for each source, and returns it, with what each thread sent.
fn together(sources: &[Box<dyn Source>], camera: &Camera, options: &Settings, gpu: &Gpu) -> (Frame, Vec<Wire>) {
    let threads = Threads::new(sources.len());
    let backend = Backend::gpu(gpu.clone());
    // The members outlive all threads: one that left early would end the frames of the others.
    let members: Vec<_> = (0..sources.len()).map(|rank| threads.member(rank)).collect();
    let drawn: Vec<_> = std::thread::scope(|scope| {
        let mut threads = Vec::new();
        for (source, member) in sources.iter().zip(&members) {
            let backend = &backend;
            threads.push(scope.spawn(move || {
                let mut renderer = Renderer::new(Box::as_ref(source), options, backend).unwrap().among().unwrap();
                let (frame, _, wire) = renderer.frame_over(camera, member, &()).unwrap();
                (frame, wire)
            }));
        }
        threads.into_iter().map(|thread| thread.join().unwrap()).collect()
    });
    assert!(drawn[1..].iter().all(|(frame, _)| frame.is_none()));
    let (mut frames, wires): (Vec<_>, Vec<_>) = drawn.into_iter().unzip();
    (frames.swap_remove(0).unwrap(), wires)
}

fn alone(scene: &Scene, camera: &Camera, options: &Settings, gpu: &Gpu) -> Frame {
    render(scene, camera, options, &Backend::gpu(gpu.clone()), &()).unwrap().0
}

/// Random pictures that processes draw together: what they cannot draw is left out of the options,
/// and surfaces take turns.
fn exchanged(scene: &Scene, turn: u64, random: &mut Random) -> Settings {
    let options = any_options::sampled(scene, random);
    let maps = options.maps.beside(Maps::of(&[Map::Index, Map::Decision]));
    let of_several = Maps::of(&[Map::Surfaces, Map::Tail, Map::Layers, Map::Transmittance]);
    let options = Settings {
        separate: false,
        accumulator: Accumulator::Fixed,
        maps: maps.beside(of_several),
        organisation: any_options::pick(random, &[Organisation::Auto, Organisation::Auto, Organisation::Scatter]),
        without: any_options::without(random),
        ..options
    };
    let blended = |composite| Settings { composite, blend: Blend::Weighted, ..options.clone() };
    let behind = maps.among(Maps::of(&[Map::Layers, Map::Transmittance])).and_all(options.maps);
    match turn % 8 {
        0 | 1 => blended(Composite::Opaque),
        2 | 3 => Settings { maps: behind, tail: Tail::None, ..blended(Composite::Layers(1 + turn as u32 % 5)) },
        4 => Settings { maps: behind, ..blended(Composite::Sorted) },
        5 => blended(Composite::Moments),
        6 => blended(Composite::Weighted),
        _ => Settings {
            blend: Blend::Nearest,
            shading: Shading::Unlit,
            low_pass: LowPass::None,
            maps: maps.among(Maps::of(&[Map::Depth])),
            ..blended(Composite::Opaque)
        },
    }
}

#[test]
fn any_shares_of_any_scene_make_the_bits_of_one_process() {
    let Some(gpu) = common::gpu() else { return };
    let (mut drawn, mut features) = (0, std::collections::BTreeSet::new());
    let mut surfaces = std::collections::BTreeMap::<String, u32>::new();
    for seed in 0..if common::takes(1, 2) { 400 } else { 48 } {
        let random = &mut Random(7000 + seed);
        let any_scene::Sampled { scene, camera, about } = any_scene::sampled(random);
        let options = exchanged(&scene, seed, random);
        let facts = Facts::of(&scene);
        let refused = check::options(&options, false).and_then(|()| check::scene(&facts, &options, false));
        if refused.and_then(|()| check::options_of_ranks(&options, false)).is_err() {
            continue;
        }
        // Small buffers cut the frame into bands and the surfels into pages.
        let gpu = match seed % 5 {
            // The host maps none of its buffers, and there are no 64-bit atomics.
            0 => common::core_gpu().unwrap(),
            1 => gpu.clone().with_buffer_limit(90_000),
            _ => gpu.clone(),
        };
        let Ok((whole, _)) = render(&scene, &camera, &options, &Backend::gpu(gpu.clone()), &()) else { continue };
        let of = [1, 2, 3, 7][random.below(4)];
        // Places in an image are stored relative to the range of all, which a hand does not know.
        // Where fragments are sorted, the order of all decides between those of one depth.
        let sorts = matches!(composited(&facts, &options), Composite::Sorted | Composite::Gaussians);
        let runs = random.one_in(2) || sorts || matches!(scene.colors, Colors::Textured(_));
        let sources = if runs { shares(&scene, of) } else { hands(&scene, of, random) };
        let (frame, _) = together(&sources, &camera, &options, &gpu);
        assert!(frame.hashes() == whole.hashes(), "seed {seed}: {about:?} of {of}, {options:?}");
        drawn += 1;
        features.extend(about);
        let shown = match (options.blend, composited(&facts, &options)) {
            (Blend::Nearest, _) => "nearest".into(),
            (_, Composite::Layers(_)) => "layers".into(),
            (_, composite) => format!("{composite:?}").to_lowercase(),
        };
        *surfaces.entry(shown).or_insert(0) += 1;
    }
    println!("{drawn} pictures of {features:?}, {surfaces:?}");
    assert!(
        ["opaque", "layers", "sorted", "moments", "weighted", "nearest"].map(|shown| surfaces.contains_key(shown))
            == [true; 6],
        "{surfaces:?}"
    );
    assert!(drawn > 10 && features.contains("triangles") && features.contains("inputs"), "{drawn} {features:?}");
}

/// The interpreted kernels draw together, too.
#[test]
fn the_twin_of_the_kernels_draws_together() {
    let twin = Gpu::open(Some("twin")).unwrap();
    let (scene, camera) = (sphere(300, 3.0), sphere_camera(24, Projection::Pinhole));
    for composite in [Composite::Opaque, Composite::Sorted] {
        let options = Settings { composite, opacity: 0.5, ..Settings::default() };
        let (frame, _) = together(&shares(&scene, 3), &camera, &options, &twin);
        assert!(frame.hashes() == alone(&scene, &camera, &options, &twin).hashes(), "{composite:?}");
        assert!(frame.color.iter().any(|color| color[3] > 0.0));
    }
}

/// Sums in f32, in the order of the parts.
struct Floats<'a> {
    of_depths: &'a dyn Exchange,
    parts: &'a Mutex<Vec<Vec<f32>>>,
}

impl Exchange for Floats<'_> {
    fn reduce(&self, what: Reduced, rows: &Rows, numbers: Numbers<'_>, runs: &mut Runs) -> Result<Then> {
        let Numbers::Long(sums) = numbers else { return self.of_depths.reduce(what, rows, numbers, runs) };
        self.parts.lock().unwrap().push(sums.iter().map(|sum| *sum as f32).collect());
        Ok(Then::Stop)
    }

    fn fragments(&self, _: &Rows, _: &mut Lists) -> Result<()> {
        Ok(())
    }
}

/// The control: partial sums that are rounded to f32 before they are added depend on the shares.
#[test]
fn floats_would_depend_on_the_shares() {
    let Some(gpu) = common::gpu() else { return };
    let (scene, camera) = (sphere(3000, 2.5), sphere_camera(64, Projection::Pinhole));
    let options = Settings::default();
    let added = |of: u32| {
        let sources = shares(&scene, of);
        let (threads, parts) = (Threads::new(sources.len()), Mutex::default());
        let members: Vec<_> = (0..sources.len()).map(|rank| threads.member(rank)).collect();
        std::thread::scope(|scope| {
            for (source, member) in sources.iter().zip(&members) {
                let (gpu, camera, options, parts) = (&gpu, &camera, &options, &parts);
                scope.spawn(move || {
                    let backend = Backend::gpu(gpu.clone());
                    let mut renderer = Renderer::new(&**source, options, &backend).unwrap().among().unwrap();
                    let of_depths = Reduction::new(member, camera.width, vec![Samples::ONE]);
                    let exchange = Floats { of_depths: &of_depths, parts };
                    assert!(renderer.frame_among(camera, &exchange, &()).unwrap().0.is_none());
                });
            }
        });
        let parts = parts.into_inner().unwrap();
        let mut sum = vec![0f32; parts[0].len()];
        parts.iter().for_each(|part| sum.iter_mut().zip(part).for_each(|(sum, part)| *sum += part));
        sum
    };
    let [one, three] = [1, 3].map(added);
    assert!(one.iter().zip(&three).any(|(one, three)| one != three), "floats gave the same sums");
    let whole = alone(&scene, &camera, &options, &gpu);
    assert_eq!(together(&shares(&scene, 3), &camera, &options, &gpu).0.hashes(), whole.hashes());
}

/// A process that fails says so in its place, and all of them end.
#[test]
fn a_process_that_fails_ends_the_others() {
    let Some(gpu) = common::gpu() else { return };
    let (scene, camera) = (sphere(500, 1.5), sphere_camera(32, Projection::Pinhole));
    let (sources, threads, backend) = (shares(&scene, 3), Threads::new(3), Backend::gpu(gpu));
    let members: Vec<_> = (0..3).map(|rank| threads.member(rank)).collect();
    let errors: Vec<Error> = std::thread::scope(|scope| {
        let draw = |rank: usize| {
            let (source, member, backend, camera) = (&sources[rank], &members[rank], &backend, &camera);
            scope.spawn(move || {
                let renderer = Renderer::new(&**source, &Settings::default(), backend).unwrap();
                // Process 1 has not prepared to draw with others.
                let mut renderer = if rank == 1 { renderer } else { renderer.among().unwrap() };
                renderer.frame_over(camera, member, &()).unwrap_err()
            })
        };
        [0, 1, 2].map(draw).into_iter().map(|thread| thread.join().unwrap()).collect()
    });
    assert_eq!(errors[1].to_string(), "process 1: a renderer draws together with others after Renderer::among");
    for rank in [0, 2] {
        assert!(matches!(errors[rank], Error::OtherProcess { rank: 1, code: 2 }), "{}", errors[rank]);
    }
}

/// A process sends what its own surfels cover, and the picture: the documented bytes a pixel.
#[test]
fn what_is_sent_follows_from_the_covered_pixels() {
    let Some(gpu) = common::gpu() else { return };
    let (scene, camera) = (sphere(20_000, 2.0), sphere_camera(256, Projection::Pinhole));
    let options = Settings::default();
    let sources = shares(&scene, 4);
    let (frame, wires) = together(&sources, &camera, &options, &gpu);
    let covered = |frame: &Frame| frame.color.iter().filter(|color| color[3] > 0.0).count() as f64;
    // A process covers what its share alone shows.
    let backend = Backend::gpu(gpu.clone());
    let of_share = |source: &dyn Source| {
        covered(&Renderer::new(source, &options, &backend).unwrap().frame(&camera, &()).unwrap().0)
    };
    // Three quarters of it belong to other processes, within a few percent.
    let sent = 0.75 * sources.iter().map(|source| of_share(&**source)).sum::<f64>();
    let of = |bytes: fn(&Wire) -> u64| wires.iter().map(bytes).sum::<u64>() as f64;
    let [nearest, sums, picture] = [of(|w| w.nearest_bytes), of(|w| w.sums_bytes), of(|w| w.picture_bytes)];
    // Four bytes and as many in answer; the numbers and masks of blocks take 12 for 64 pixels, or
    // for fewer at the border of a share.
    assert!((7.6..9.0).contains(&(nearest / sent)), "{}", nearest / sent);
    let channels = sums::sums(&scene, &camera, &options, &gpu, &Sources::default()).unwrap().pixel.channels;
    assert!((1.0..8.0 * f64::from(channels)).contains(&(sums / sent)), "{} {channels}", sums / sent);
    // Three quarters of the pixels come from others, with four values and their number.
    assert!((picture / (0.75 * 20.0 * covered(&frame)) - 1.0).abs() < 0.1, "{picture}");
    // An empty view costs nothing but the numbers of blocks.
    let away = Camera { eye: camera.eye + camera.rotation.row(2) * 100.0, ..camera.clone() };
    let (_, wires) = together(&sources, &away, &options, &gpu);
    assert!(wires.iter().all(|wire| wire.nearest_bytes + wire.sums_bytes + wire.picture_bytes < 200), "{wires:?}");
}

#[test]
fn pictures_that_processes_cannot_draw_together_are_refused() {
    let Some(gpu) = common::gpu() else { return };
    let scene = sphere(100, 1.5);
    let backend = Backend::gpu(gpu);
    let refusals: [(Settings, &str); 3] = [
        (Settings { accumulator: Accumulator::Fixed64, ..Settings::default() }, "--accumulator"),
        (Settings { maps: Maps::of(&[Map::Index]), ..Settings::default() }, "index"),
        (Settings { separate: true, ..Settings::default() }, "--separate"),
    ];
    for (options, name) in refusals {
        let renderer = Renderer::new(&scene, &options, &backend).unwrap();
        let error = renderer.among().err().unwrap().to_string();
        assert!(error.contains(name), "{error}");
    }
    let samples = Settings { samples: Samples::FOUR, ..Settings::default() };
    assert!(Renderer::new(&scene, &samples, &backend).unwrap().among().is_ok());
    let reference = Renderer::new(&scene, &samples, &Backend::Reference).unwrap();
    assert!(reference.among().err().unwrap().to_string().contains("reference"));
}
