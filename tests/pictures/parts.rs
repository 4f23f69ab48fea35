//! Pictures in parts that travel as bytes or files: together they have the bits of one process.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common;

use common::Random;
use epsplat::io::part::{Content, Section};
use epsplat::low_level::scene::{Camera, Map, Samples, Share};
use epsplat::options::{Cull, Epsilon};
use epsplat::{DeviceOptions, Part, RenderOptions, SceneOptions, View, merge, merge_files};

/// Draws both passes of a picture in `of` parts that travel as bytes, and merges them.
fn by_parts(renderer: &epsplat::Renderer, view: &View, of: u32) -> epsplat::Merged {
    let pass = |within: Option<&Part>| {
        let draw = |number| {
            let part = renderer.part(view, Share::new(number, of).unwrap(), within, &()).unwrap();
            Part::of_bytes(format!("part {number}"), &part.bytes()).unwrap()
        };
        // The last part first: no order is needed.
        merge(&(1..=of).rev().map(draw).collect::<Vec<_>>()).unwrap()
    };
    pass(Some(&pass(None))).picture(&DeviceOptions::default(), &()).unwrap()
}

/// Bytes whose checksum is right, but which are those of no part, are refused and never end the
/// program; nor does a merge of parts that were read.
#[test]
fn changed_bytes_with_a_right_checksum_are_read_or_refused() {
    if common::gpu().is_none() {
        return;
    }
    let scene =
        epsplat::Scene::open([format!("{}/data/bunny.obj", env!("CARGO_MANIFEST_DIR"))], &SceneOptions::default());
    let (options, device) = (RenderOptions::default(), DeviceOptions::default());
    let renderer = epsplat::Renderer::new(&scene.unwrap(), &options, &device, &()).unwrap();
    let camera = renderer.camera(&View::default()).unwrap();
    let view = View::from(Camera { width: 20, height: 20, ..camera });
    let part = |number| renderer.part(&view, Share::new(number, 2).unwrap(), None, &()).unwrap();
    let (bytes, other) = (part(1).bytes(), part(2));
    let whole = Share::new(1, 1).unwrap();
    let depths = renderer.part(&view, whole, None, &()).unwrap();
    let sums = renderer.part(&view, whole, Some(&depths), &()).unwrap().bytes();
    let header = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    let (random, mut read, mut refused) = (&mut Random(3), 0, 0);
    for turn in 0..3000 {
        // Some of them are whole pictures.
        let is_picture = turn % 30 == 0;
        let mut changed = if is_picture { sums.clone() } else { bytes.clone() };
        for _ in 0..1 + random.below(3) {
            // Half of the changes lie in the header, half behind it.
            let place = if turn % 2 == 0 { 24 + random.below(header) } else { random.below(bytes.len() - 4) };
            changed[place] = random.below(256) as u8;
        }
        let body = changed.len() - 4;
        let sum = crc32fast::hash(&changed[..body]);
        changed[body..].copy_from_slice(&sum.to_le_bytes());
        match Part::of_bytes("changed", &changed) {
            Ok(part) => {
                read += 1;
                let _ = merge(std::slice::from_ref(&part));
                let _ = merge(&[other.clone(), part.clone()]);
                if is_picture {
                    let _ = part.picture(&device, &());
                }
            }
            Err(error) => {
                refused += 1;
                assert!(error.to_string().starts_with("changed: "), "{error}");
            }
        }
    }
    assert!(read > 100 && refused > 100, "{read} {refused}");
}

/// Parts that lack rows or sections, or claim others, are refused wherever they stand.
#[test]
fn parts_that_lack_rows_are_refused() {
    if common::gpu().is_none() {
        return;
    }
    let files = [format!("{}/data/bunny.obj", env!("CARGO_MANIFEST_DIR"))];
    let scene = epsplat::Scene::open(files, &SceneOptions::default()).unwrap();
    let (mut options, device) = (RenderOptions::default(), DeviceOptions::default());
    // Two renders: the samples' and the map's.
    (options.look.samples, options.maps.aov) = (Some(Samples::FOUR), vec![Map::Depth]);
    let renderer = epsplat::Renderer::new(&scene, &options, &device, &()).unwrap();
    let camera = renderer.camera(&View::default()).unwrap();
    let view = View::from(Camera { width: 20, height: 20, ..camera });
    let part = |number, within| renderer.part(&view, Share::new(number, 2).unwrap(), within, &()).unwrap();
    let depths = [part(1, None), part(2, None)];
    let within = merge(&depths).unwrap();
    let sums = [part(1, Some(&within)), part(2, Some(&within))];
    assert!(merge(&sums).unwrap().picture(&device, &()).is_ok());
    let changed = |part: &Part, change: &dyn Fn(&mut Content)| {
        let mut content = Content::decoded(&part.bytes()).unwrap();
        change(&mut content);
        Part::of_bytes("changed", &content.encoded()).unwrap()
    };
    let zeros = |section: &Section, (width, rows, each): (u32, u32, u16)| {
        Section::new(section.values, section.render, (width, 0, rows), each, |samples| {
            vec![0; samples.len() * usize::from(each)]
        })
    };
    let last = |content: &mut Content, change: &dyn Fn(&Section) -> Section| {
        let section = content.sections.pop().unwrap();
        content.sections.push(change(&section));
    };
    let changes: [&dyn Fn(&mut Content); 6] = [
        &|content| content.sections.clear(),
        &|content| drop(content.sections.pop()),
        &|content| last(content, &|own| zeros(own, (own.width, own.rows / 2, own.each))),
        &|content| last(content, &|own| zeros(own, (own.width, own.rows * 2, own.each))),
        &|content| last(content, &|own| zeros(own, (own.width / 2, own.rows, own.each))),
        &|content| last(content, &|own| zeros(own, (own.width, own.rows, own.each + 1))),
    ];
    for pair in [&depths, &sums] {
        for change in changes {
            let short = changed(&pair[1], change);
            for parts in [[pair[0].clone(), short.clone()], [short, pair[0].clone()]] {
                let error = merge(&parts).err().unwrap().to_string();
                assert!(error.contains("draw the part again"), "{error}");
            }
        }
    }
}

/// Options of a test picture: its files, the change of the defaults, and the numbers of parts.
type Case = (&'static [&'static str], fn(&mut RenderOptions), &'static [u32]);

#[test]
fn parts_of_files_make_the_bits_of_one_process() {
    if common::gpu().is_none() {
        return;
    }
    let cases: [Case; 6] = [
        (
            &["bunny.obj"],
            |options| options.maps.aov = vec![Map::Depth, Map::Normal, Map::Count, Map::Weight],
            &[1, 2, 3, 7],
        ),
        (&["autzen.laz"], |options| options.maps.aov = vec![Map::Depth, Map::Height], &[1, 2, 3, 7]),
        (&["bunny.obj", "autzen.laz", "simple.copc.laz"], |_| {}, &[3]),
        (&["autzen.laz"], |options| options.look.edl = "1".parse().ok(), &[2]),
        (&["autzen.laz"], |options| options.surface.epsilon = Some(Epsilon::Absolute(3.0)), &[7]),
        (&["bunny.obj"], |options| options.surface.cull = Some(Cull::None), &[3]),
    ];
    for (number, (files, change, all)) in cases.into_iter().enumerate() {
        let paths = files.iter().map(|file| format!("{}/data/{file}", env!("CARGO_MANIFEST_DIR")));
        let scene = epsplat::Scene::open(paths, &SceneOptions::default()).unwrap();
        let mut options = RenderOptions::default();
        change(&mut options);
        let mut renderer = epsplat::Renderer::new(&scene, &options, &DeviceOptions::default(), &()).unwrap();
        let camera = renderer.camera(&View::default()).unwrap();
        let scale = 100.0 / 1024.0;
        let [fx, fy, cx, cy] = [camera.fx, camera.fy, camera.cx, camera.cy].map(|length| length * scale);
        let view = View::from(Camera { width: 100, height: 100, fx, fy, cx, cy, ..camera });
        let whole = renderer.frame(&view, &()).unwrap().frame;
        for of in all {
            let merged = by_parts(&renderer, &view, *of).frame;
            assert!(merged.hashes() == whole.hashes(), "case {number} in {of} parts");
        }
        if number == 0 {
            // More files than are in memory at once.
            let folder = tempfile::tempdir().unwrap();
            let written = |name: String, part: &Part| {
                let path = folder.path().join(name);
                part.write(&path).unwrap();
                path
            };
            let draw = |number, within| renderer.part(&view, Share::new(number, 18).unwrap(), within, &()).unwrap();
            let depths = (1..=18).map(|number| written(format!("{number}.part"), &draw(number, None)));
            let depths = merge_files(&depths.collect::<Vec<_>>()).unwrap();
            let sums = (1..=18).map(|number| written(format!("{number}-sums.part"), &draw(number, Some(&depths))));
            let mut sums: Vec<_> = sums.collect();
            let merged = merge_files(&sums).unwrap().picture(&DeviceOptions::default(), &()).unwrap().frame;
            assert!(merged.hashes() == whole.hashes());
            sums[17] = sums[3].clone();
            let twice = merge_files(&sums).err().unwrap().to_string();
            assert!(twice.contains("4-sums.part") && twice.contains("part 4/18"), "{twice}");
        }
        assert!(whole.color.iter().any(|pixel| pixel[3] > 0.0), "case {number} shows nothing");
    }
}
