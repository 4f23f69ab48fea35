//! The WGSL modules of all sets of needs, joined, parsed and reflected once for all tests of a
//! program.

use std::collections::HashMap;
use std::sync::LazyLock;

use epsplat::low_level::gpu::Sources;
use epsplat::low_level::gpu::interface::Bindings;
use epsplat::low_level::gpu::interface::reflect;
use epsplat::low_level::passes::modules;
use epsplat::low_level::passes::select::CHOOSING;
use epsplat::low_level::plan::SceneNeeds;
use epsplat::low_level::plan::pass::Module;
use epsplat::low_level::plan::steps::Kernel;
use rayon::prelude::*;

use super::variants::all_needs;

/// The result of [`reflect`] for a module's text.
pub struct Reflected {
    pub module: naga::Module,
    pub bindings: Bindings,
}

/// A module of a render with `needs`.
pub struct Made {
    pub needs: SceneNeeds,
    /// The joined files.
    pub files: Vec<&'static str>,
    /// The kernels that the render dispatches.
    pub kernels: Vec<Kernel>,
    /// Index of the module's text in [`All::texts`].
    text: usize,
}

impl Made {
    /// Whether this is a module of tiles.
    pub fn of_tiles(&self) -> bool {
        self.files.contains(&"bin.wgsl")
    }

    pub fn text(&self) -> &'static str {
        &ALL.texts[self.text].0
    }

    pub fn reflected(&self) -> &'static Reflected {
        &ALL.texts[self.text].1
    }
}

struct All {
    made: Vec<Made>,
    /// The distinct texts, in order of first use.
    texts: Vec<(String, Reflected)>,
}

static ALL: LazyLock<All> = LazyLock::new(|| {
    let sources = Sources::default();
    let (mut made, mut texts, mut numbers) = (Vec::new(), Vec::new(), HashMap::new());
    for &needs in all_needs() {
        for Module { files, kernels } in modules(&needs) {
            let text = *numbers.entry(files.clone()).or_insert_with(|| {
                texts.push(sources.join(&files));
                texts.len() - 1
            });
            // Modules that select a cut are made before the number of drawn splats is known.
            let needs = if kernels == CHOOSING { needs.before_cut() } else { needs };
            made.push(Made { needs, files, kernels, text });
        }
    }
    let reflected = texts.into_par_iter().map(|text| {
        let (module, bindings, _) = reflect(&text).unwrap_or_else(|error| panic!("{error}"));
        (text, Reflected { module, bindings })
    });
    All { texts: reflected.collect(), made }
});

/// The modules of all sets of needs.
pub fn all() -> &'static [Made] {
    &ALL.made
}

/// The first module of each distinct text.
pub fn different() -> Vec<&'static Made> {
    let mut known = 0;
    let is_new = |made: &&Made| {
        let new = made.text == known;
        known += usize::from(new);
        new
    };
    ALL.made.iter().filter(is_new).collect()
}
