//! A source that has no scene in memory, and makes its pages when a device asks for them, renders
//! like the scene.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common;

use std::borrow::Cow;
use std::ops::Range;

use common::bits;
use common::scenes::{sphere, sphere_camera};
use epsplat::low_level::passes::index::NOTHING;
use epsplat::low_level::passes::source::{Page, Source};
use epsplat::low_level::plan::{Facts, Optimisation, SceneNeeds, Settings};
use epsplat::low_level::render::{Backend, Renderer, render};
use epsplat::low_level::scene::{Colors, Map, Maps, Projection, Scene, Surfel};

/// Makes the surfels of `common::scenes::sphere` one by one.
struct Made {
    facts: Facts,
    one: fn(usize) -> (Surfel, [u8; 4]),
}

const COUNT: usize = 3000;

fn one(index: usize) -> (Surfel, [u8; 4]) {
    thread_local!(static ALL: Scene = sphere(COUNT, 1.5));
    ALL.with(|scene| {
        let Colors::Srgb8(codes) = &scene.colors else { panic!("of 8 bits") };
        (scene.surfels[index], codes[index])
    })
}

struct Part {
    first: usize,
    len: usize,
    one: fn(usize) -> (Surfel, [u8; 4]),
}

impl Source for Made {
    fn facts(&self) -> Facts {
        self.facts.clone()
    }

    fn pages<'a>(&'a self, needs: &SceneNeeds, most: usize, _: Option<&Facts>) -> Vec<Box<dyn Page + 'a>> {
        assert!(!needs.surface.copies() && !needs.doubled);
        let part = |first: usize| Part { first, len: most.min(COUNT - first), one: self.one };
        (0..COUNT).step_by(most).map(|first| Box::new(part(first)) as Box<dyn Page>).collect()
    }
}

impl Page for Part {
    fn numbers(&self) -> Cow<'_, [u32]> {
        (self.first as u32..(self.first + self.len) as u32).collect()
    }

    fn surfels(&self, range: Range<usize>) -> Vec<Surfel> {
        range.map(|k| (self.one)(self.first + k).0).collect()
    }

    fn attributes(&self, range: Range<usize>) -> Vec<u32> {
        range.map(|k| u32::from_le_bytes((self.one)(self.first + k).1)).collect()
    }

    fn balls(&self) -> Vec<[f32; 4]> {
        // Every ball contains the whole sphere, so no batch is skipped.
        vec![[0.0, 0.0, 0.0, 2.0]; self.len.div_ceil(64)]
    }

    fn stand_for(&self) -> u64 {
        self.len as u64
    }
}

#[test]
fn pages_that_are_made_when_they_are_asked_for_draw_what_a_scene_does() {
    let Some(gpu) = common::gpu() else { return };
    let (scene, camera) = (sphere(COUNT, 1.5), sphere_camera(96, Projection::Pinhole));
    let made = Made { facts: Facts::of(&scene), one };
    let options = Settings { maps: Maps::ON_DEVICE.and(&[Map::Index]), ..Settings::default() };
    let backend = Backend::gpu(gpu);
    let (expected, _) = render(&scene, &camera, &options, &backend, &()).unwrap();
    for (limit, without) in [(1 << 27, vec![]), (40_000, vec![Optimisation::Culling]), (100_000, vec![])] {
        let small = Backend::gpu(common::gpu().unwrap().with_buffer_limit(limit));
        let options = Settings { without, ..options.clone() };
        let mut renderer = Renderer::new(&made, &options, &small).unwrap();
        for _ in 0..2 {
            let (frame, report) = renderer.frame(&camera, &()).unwrap();
            assert!(bits(&frame) == bits(&expected), "{limit}");
            assert_eq!(report.surfels, COUNT as u64);
            // The index maps may differ only in ties, which depend on the position in memory.
            let differ = frame.numbers(Map::Index).unwrap().iter().zip(expected.numbers(Map::Index).unwrap());
            assert!(differ.filter(|(a, b)| a != b).count() < 20);
        }
    }
    let named = expected.numbers(Map::Index).unwrap().iter().filter(|name| **name != NOTHING).count();
    assert!(named > 4000);
}

#[test]
fn the_reference_asks_for_a_scene() {
    let made = Made { facts: Facts::of(&sphere(COUNT, 1.5)), one };
    let camera = sphere_camera(8, Projection::Pinhole);
    let error = render(&made, &camera, &Settings::default(), &Backend::Reference, &()).unwrap_err();
    assert!(error.to_string().contains("in memory"), "{error}");
}
