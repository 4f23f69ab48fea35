//! The sequence: project, visibility, accumulate, resolve, on every backend.

mod cut;
mod encoded;
pub mod inspect;
mod kept;
mod kernels;
mod look;
mod page;
mod parts;
mod reference;
mod report;
mod run;
pub mod sequence;
mod store;
pub mod sums;
mod taken;
mod targets;

use std::borrow::Borrow;
use std::time::Instant;

use crate::error::{Error, Result};
use crate::frame::Frame;
use crate::gpu::{Gpu, Sources};
use crate::passes::select::{self, Wanted};
use crate::passes::source::Source;
use crate::plan::{Optimisation, RenderOptions, check, culls_back};
use crate::progress::Progress;
use crate::scene::{Camera, Detail};
use kept::Kept;
pub use report::{DeviceBytes, Report, Tail};
pub use taken::taken;

/// Who renders.
pub enum Backend {
    /// The compute kernels, on an adapter.
    Gpu {
        /// The open device.
        gpu: Box<Gpu>,
        /// The kernels' texts.
        sources: Sources,
    },
    /// The twins in f64, on the processor's threads.
    Reference,
}

impl Backend {
    /// The built-in kernels on `gpu`.
    pub fn gpu(gpu: Gpu) -> Self {
        Self::Gpu { gpu: Box::new(gpu), sources: Sources::default() }
    }
}

/// Renders a scene, or what else is a [`Source`], once.
///
/// # Errors
/// Those of [`Renderer::new`] and [`Renderer::frame`].
pub fn render(
    source: &dyn Source,
    camera: &Camera,
    options: &RenderOptions,
    backend: &Backend,
    progress: &dyn Progress,
) -> Result<(Frame, Report)> {
    Renderer::new(source, options, backend)?.frame(camera, progress)
}

/// A scene on a backend, and what stays from frame to frame: the uploaded surfels, the buffers, the kernels, and what earlier frames
/// have shown. The second frame costs its passes alone.
///
/// Scene (or another [`Source`]) and backend are borrowed or owned: `Renderer::new(&scene, &options, &backend)`, or with an [`Arc`](std::sync::Arc) of each
/// something that another program can keep.
pub struct Renderer<S, B> {
    source: S,
    backend: B,
    /// That of the colour.
    kept: Kept,
    /// Those of maps that are made in another way.
    of_maps: Vec<Kept>,
    /// What was asked for: of a number of splats each view has a size of its own.
    detail: Detail,
}

impl<S: Source, B: Borrow<Backend>> Renderer<S, B> {
    /// A renderer of what `source` has; nothing is uploaded yet.
    ///
    /// # Errors
    /// [`Error::Usage`] for options, scenes and backends that do not go together.
    pub fn new(source: S, options: &RenderOptions, backend: B) -> Result<Self> {
        let reference = matches!(backend.borrow(), Backend::Reference);
        check::options(options, reference)?;
        let facts = source.facts();
        check::scene(&facts, options, reference)?;
        let options = &encoded::of(&facts, options);
        let mut parts = parts::parts(&facts, options).into_iter();
        let colors = parts.next().unwrap_or_else(|| options.clone());
        let of_maps = parts.map(|options| Kept::new(facts.clone(), options)).collect();
        let detail = colors.detail;
        Ok(Self { source, backend, kept: Kept::new(facts, colors), of_maps, detail })
    }

    /// One frame.
    ///
    /// # Errors
    /// A limit of the adapter, and whatever a device may report.
    pub fn frame(&mut self, camera: &Camera, progress: &dyn Progress) -> Result<(Frame, Report)> {
        let start = Instant::now();
        let detail = self.sized(camera);
        let spent = start.elapsed().as_secs_f64() * 1e3;
        let Self { source, backend, kept, of_maps, .. } = self;
        of_maps.iter_mut().chain([&mut *kept]).for_each(|part| part.options.detail = detail);
        let one = |kept: &mut Kept| one(&*source, (*backend).borrow(), kept, camera, progress);
        let mut maps = Vec::new();
        for part in of_maps {
            // What is on the device serves all of them, as far as they need the same of it.
            part.store = kept.store.take();
            maps.push(one(part)?);
            kept.store = part.store.take();
        }
        let (mut frame, mut report) = parts::joined(one(kept)?, maps);
        report.tail = Tail::of(&frame);
        if matches!(self.detail, Detail::Splats(_)) {
            *report.passes.entry("select_ms".to_owned()).or_default() += spent;
            report.total_ms += spent;
        }
        if kept.facts.encoded {
            encoded::decode(&mut frame);
        }
        Ok((frame, report))
    }

    /// The size of nodes in the view of `camera`, by the colour's part: all parts have the same.
    fn sized(&self, camera: &Camera) -> Detail {
        let (facts, options) = (&self.kept.facts, RenderOptions { detail: self.detail, ..self.kept.options.clone() });
        let wanted = Wanted::of(&options, culls_back(facts, camera, &options));
        let tree = self.source.levels();
        tree.map_or(self.detail, |tree| select::sized(tree, facts.origin, camera, &wanted))
    }

    /// Device memory that the last frame was rendered with; none for the reference.
    pub fn device_bytes(&self) -> DeviceBytes {
        self.kept.device_bytes()
    }
}

/// A frame of what `kept` is of.
fn one(
    source: &dyn Source,
    backend: &Backend,
    kept: &mut Kept,
    camera: &Camera,
    progress: &dyn Progress,
) -> Result<(Frame, Report)> {
    match backend {
        Backend::Gpu { gpu, sources } if kept.options.has(Optimisation::UncountedLoops) => {
            kept.frame((gpu, sources), source, camera, progress)
        }
        Backend::Gpu { gpu, sources } => {
            kept.frame((gpu, &sources.clone().with_counted_loops()), source, camera, progress)
        }
        Backend::Reference => {
            let scene = source.whole().ok_or_else(|| {
                Error::Usage("the reference needs all surfels in memory: render on an adapter".into())
            })?;
            let sampled = camera.sampled(kept.options.samples)?;
            let Some((cut, options)) = reference::cut(scene, &kept.facts, camera, &kept.options) else {
                return Ok(reference::frame(scene, &kept.facts, &sampled, &kept.options, progress));
            };
            let (frame, mut report) = reference::frame(&cut, &kept.facts, &sampled, &options, progress);
            report.cut = Some(cut.surfels.len() as u64);
            Ok((frame, report))
        }
    }
}

#[cfg(all(test, feature = "bench"))]
mod tests {
    #![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]
    use super::*;
    use crate::hardcases::cases;
    use crate::scene::{Map, Maps};

    /// A device of its own; none where there is no adapter and none is required.
    fn opened() -> Option<Gpu> {
        match Gpu::open(None) {
            Ok(gpu) => Some(gpu),
            Err(error) if std::env::var("EPSPLAT_REQUIRE_ADAPTER").is_ok_and(|v| v == "1") => panic!("{error}"),
            Err(_) => None,
        }
    }

    /// Whether the programs of a render count their loops.
    fn counted(without: &[Optimisation]) -> Option<Vec<bool>> {
        let backend = Backend::gpu(opened()?);
        let case = cases().unwrap().swap_remove(0);
        let options = RenderOptions { without: without.to_vec(), ..case.options };
        render(&case.scene, &case.camera, &options, &backend, &()).unwrap();
        let Backend::Gpu { gpu, .. } = &backend else { return None };
        Some(gpu.compiled.count_loops())
    }

    #[test]
    fn loops_are_counted_where_that_is_asked_for_and_nowhere_else() {
        let Some(by_proof) = counted(&[]) else { return };
        let Some(by_counters) = counted(&[Optimisation::UncountedLoops]) else { return };
        assert!(!by_proof.is_empty() && by_proof.iter().all(|counted| !counted), "{by_proof:?}");
        assert!(!by_counters.is_empty() && by_counters.iter().all(|counted| *counted), "{by_counters:?}");
    }

    /// Another map changes some kernels and not others, which are compiled once, whoever asks.
    #[test]
    fn kernels_that_are_the_same_are_compiled_once() {
        // Elsewhere kernels are told in WGSL, whose constants are set later.
        let Some(gpu) = opened().filter(|gpu| gpu.adapter.api == "vulkan") else { return };
        let case = cases().unwrap().swap_remove(0);
        let after = |maps: &[Map]| {
            let options = RenderOptions { maps: Maps::of(maps), ..case.options.clone() };
            render(&case.scene, &case.camera, &options, &Backend::gpu(gpu.clone()), &()).unwrap();
            gpu.compiled.count_pipelines()
        };
        let one = after(&[]);
        let (again, with_another) = (after(&[]), after(&[Map::Count]));
        assert!(one > 3 && again == one, "{one} {again}");
        assert!((one + 1..2 * one).contains(&with_another), "{one} {with_another}");
    }
}
