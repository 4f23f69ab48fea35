//! Levels of detail: cuts as scenes of their own.

use std::borrow::Cow;

use epsplat::low_level::frame::Frame;
use epsplat::low_level::passes::select::{self, Wanted};
use epsplat::low_level::passes::source::{Page, Source};
use epsplat::low_level::plan::{Facts, SceneNeeds, Settings};
use epsplat::low_level::render::{Backend, render};
use epsplat::low_level::scene::{Camera, Cull, Detail, Hierarchy, Mipmap, Provenance, Scene};
use epsplat::low_level::surfels::hierarchy;

/// The twin's cut as a scene, with the facts of the whole scene, so that kernels use the same
/// units.
pub struct Cut {
    pub scene: Scene,
    facts: Facts,
}

impl Source for Cut {
    fn facts(&self) -> Facts {
        self.facts.clone()
    }

    fn pages<'a>(&'a self, needs: &SceneNeeds, most: usize, ordered: Option<&Facts>) -> Vec<Box<dyn Page + 'a>> {
        self.scene.pages(needs, most, ordered)
    }

    fn textures(&self) -> &[Mipmap] {
        &[]
    }

    fn provenance(&self) -> Cow<'_, Provenance> {
        Cow::Borrowed(&self.scene.provenance)
    }

    fn whole(&self) -> Option<&Scene> {
        Some(&self.scene)
    }
}

pub fn levels(scene: Scene) -> Scene {
    hierarchy::build(scene, &()).unwrap().0
}

pub fn tree(scene: &Scene) -> &Hierarchy {
    scene.hierarchy.as_ref().unwrap()
}

/// Returns the cut that the twin selects, and the options to draw it with.
pub fn cut(scene: &Scene, camera: &Camera, options: &Settings) -> (Cut, Settings) {
    let back = options.cull == Cull::Back;
    let cut = select::reference(scene, tree(scene), camera, &Wanted::of(options, back)).scene(
        scene,
        tree(scene),
        options.draws_node_caps(),
    );
    let whole = Facts::of(scene);
    let (largest_radius, largest_shorter) = (whole.drawn_radius(options), whole.drawn_shorter(options));
    let surfels = cut.surfels.len() as u64;
    // The facts claim caps as those of the whole scene do.
    let caps = whole.caps || (options.draws_node_caps() && whole.levels.is_some_and(|levels| levels.caps));
    let facts = Facts {
        surfels,
        largest_radius,
        largest_shorter,
        levels: None,
        copies: false,
        fades: options.detail_fades,
        caps,
        ..whole
    };
    // A scene without levels has no cones of normals.
    let cull = if options.cull == Cull::Cones { Cull::None } else { options.cull };
    (Cut { scene: cut, facts }, Settings { detail: Detail::FINEST, cull, ..options.clone() })
}

pub fn frame(source: &dyn Source, camera: &Camera, options: &Settings, backend: &Backend) -> Frame {
    render(source, camera, options, backend, &()).unwrap().0
}
