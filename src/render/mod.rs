//! Renders frames on a device or with the f64 reference: project, visibility, accumulate, resolve.

mod count;
mod cut;
mod encode;
mod encoded;
pub mod exchange;
mod frame_layout;
pub mod inspect;
mod kept;
mod kernels;
mod look;
mod own;
mod page;
mod parts;
mod record;
mod reference;
mod report;
mod run;
pub mod sequence;
mod store;
pub mod sums;
mod taken;
mod targets;
mod texture;
mod ticket;
mod warm;

use std::borrow::{Borrow, Cow};
use std::time::Instant;

use crate::error::{Error, Result};
use crate::frame::Frame;
use crate::gpu::{Gpu, Sources};
use crate::network::{Network, Reduction, Wire, together};
use crate::passes::select::{self, Wanted};
use crate::passes::source::Source;
use crate::passes::{eye_dome, index, tiles};
use crate::plan::{Optimisation, Settings, check, culls_back};
use crate::progress::Progress;
use crate::scene::{Camera, Detail, EyeDome, KernelFaults, Map};
pub use encode::Target;
use exchange::{Among, Exchange};
pub use frame_layout::{FrameLayout, Plane};
use kept::Kept;
pub use report::{DeviceBytes, Report, Tail};
pub use taken::taken;
pub use ticket::{Receipt, Ticket};
pub(crate) use warm::warm;

/// The renderer: a graphics device or the processor.
pub enum Backend {
    /// The compute kernels (or the rasteriser) on an adapter.
    Gpu {
        /// The open device.
        gpu: Box<Gpu>,
        /// The WGSL files of the kernels.
        sources: Sources,
    },
    /// The f64 twins of the kernels, on all threads of the processor.
    Reference,
}

impl Backend {
    /// The built-in kernels on `gpu`.
    pub fn gpu(gpu: Gpu) -> Self {
        Self::Gpu { gpu: Box::new(gpu), sources: Sources::default() }
    }
}

/// Renders one frame of a scene or of another [`Source`].
///
/// # Errors
/// The errors of [`Renderer::new`] and [`Renderer::frame`].
pub fn render(
    source: &dyn Source,
    camera: &Camera,
    options: &Settings,
    backend: &Backend,
    progress: &dyn Progress,
) -> Result<(Frame, Report)> {
    Renderer::new(source, options, backend)?.frame(camera, progress)
}

/// A scene on a backend, with all that is reused from frame to frame: the uploaded surfels, the
/// buffers, the compiled kernels and the sizes measured so far. A second frame costs only its
/// passes.
///
/// The scene (or another [`Source`]) and the backend are borrowed or owned:
/// `Renderer::new(&scene, &options, &backend)`, or an [`Arc`](std::sync::Arc) of each for a
/// renderer that owns its inputs.
pub struct Renderer<S, B> {
    source: S,
    backend: B,
    /// The WGSL files of the kernels; unused by the reference.
    sources: Sources,
    /// Faults of a kernel that the user wrote.
    faults: Option<KernelFaults>,
    /// The settings of the whole frame.
    settings: Settings,
    /// The part that renders the colour.
    kept: Kept,
    /// The parts that render maps with other options than the colour's ([`parts::parts`]).
    of_maps: Vec<Kept>,
    /// The level of detail in the options. A number of splats is converted to a node size anew for
    /// each view.
    detail: Detail,
    /// The strength of eye-dome lighting.
    eye_dome: Option<EyeDome>,
    /// Whether the map of depths is rendered only for eye-dome lighting or for the names of
    /// triangles.
    drops_depth: bool,
    /// State that recorded frames share.
    recorded: encode::Shared,
    /// Whether frames are drawn together with other processes.
    together: bool,
}

impl<S: Source, B: Borrow<Backend>> Renderer<S, B> {
    /// Creates a renderer of `source` without uploading anything yet.
    ///
    /// # Errors
    /// [`Error::Usage`] if the scene or the backend does not support the options.
    pub fn new(source: S, options: &Settings, backend: B) -> Result<Self> {
        let reference = matches!(backend.borrow(), Backend::Reference);
        check::options(options, reference)?;
        let facts = source.facts();
        check::scene(&facts, options, reference)?;
        let (sources, options) = own::settled(backend.borrow(), options)?;
        let faults = own::faults(&options);
        let settings = options.clone();
        let eye_dome = options.edl;
        let needs_depth = eye_dome.is_some() || index::needs_depth(options.maps, facts.mesh.triangles);
        let drops_depth = needs_depth && !options.maps.has(Map::Depth);
        let maps = if needs_depth { options.maps.and(&[Map::Depth]) } else { options.maps };
        let options = &encoded::of(&facts, &Settings { maps, ..options.clone() });
        let mut parts = parts::parts(&facts, options).into_iter();
        let colors = parts.next().unwrap_or_else(|| options.clone());
        let of_maps = parts.map(|options| Kept::new(facts.clone(), options)).collect();
        let detail = colors.detail;
        let (kept, recorded) = (Kept::new(facts, colors), encode::Shared::default());
        let together = false;
        Ok(Self {
            source,
            backend,
            sources,
            faults,
            settings,
            kept,
            of_maps,
            detail,
            eye_dome,
            drops_depth,
            recorded,
            together,
        })
    }

    /// Renders one frame.
    ///
    /// # Errors
    /// [`Error::Limit`] if a limit of the adapter is too small, and any error of the device.
    pub fn frame(&mut self, camera: &Camera, progress: &dyn Progress) -> Result<(Frame, Report)> {
        let (frame, report) = self.rendered(camera, None, progress)?;
        Ok((self.filtered(frame, camera), report))
    }

    /// Prepares to draw frames together with other processes, by [`Renderer::frame_among`].
    ///
    /// # Errors
    /// [`Error::Usage`] for a picture that processes cannot draw together.
    pub fn among(mut self) -> Result<Self> {
        let reference = matches!(self.backend.borrow(), Backend::Reference);
        check::options_of_ranks(&self.settings, reference)?;
        for part in self.of_maps.iter_mut().chain([&mut self.kept]) {
            // Tiles that gather keep sums in registers, where nothing can be exchanged.
            part.options.without.push(Optimisation::Gathering);
        }
        self.together = true;
        Ok(self)
    }

    /// Renders one frame together with other processes, each of which has a share of the scene
    /// ([`share`](crate::passes::share)) and calls this with the same camera. Returns no frame if
    /// the exchange ends its bands ([`Then::Stop`](exchange::Then::Stop)).
    ///
    /// # Errors
    /// As [`Renderer::frame`], and errors of the exchange. [`Error::Usage`] without
    /// [`Renderer::among`].
    pub fn frame_among(
        &mut self,
        camera: &Camera,
        exchange: &dyn Exchange,
        progress: &dyn Progress,
    ) -> Result<(Option<Frame>, Report)> {
        self.check_together()?;
        let (frame, report) = self.rendered(camera, Some(exchange), progress)?;
        let whole = frame.height == camera.height;
        Ok((whole.then(|| self.filtered(frame, camera)), report))
    }

    /// Renders one frame as [`Renderer::frame_among`] does, over a network. Returns it in process 0
    /// and no frame in the others, with what this process sent.
    ///
    /// # Errors
    /// The first error of a process, in that process, and [`Error::OtherProcess`] in the others.
    pub fn frame_over(
        &mut self,
        camera: &Camera,
        network: &dyn Network,
        progress: &dyn Progress,
    ) -> Result<(Option<Frame>, Report, Wire)> {
        let samples = [&self.kept].into_iter().chain(&self.of_maps).map(|part| part.options.samples).collect();
        let reduction = Reduction::new(network, camera.width, samples);
        let drawn = self.check_together().and_then(|()| self.rendered(camera, Some(&reduction), progress));
        let (frame, report) = together(network, drawn)?;
        let start = Instant::now();
        let frame = together(network, reduction.gathered(frame))?;
        let tail = frame.as_ref().and_then(Tail::of).or(report.tail);
        let total_ms = report.total_ms + start.elapsed().as_secs_f64() * 1e3;
        let report = Report { total_ms, tail, ..report };
        Ok((frame.map(|frame| self.filtered(frame, camera)), report, reduction.wire()))
    }

    fn check_together(&self) -> Result<()> {
        match self.together {
            true => Ok(()),
            false => Err(Error::Usage("a renderer draws together with others after Renderer::among".into())),
        }
    }

    /// Renders one frame, before the filters of finished pictures. It has no rows if the exchange
    /// ends its bands.
    fn rendered(
        &mut self,
        camera: &Camera,
        exchange: Option<&dyn Exchange>,
        progress: &dyn Progress,
    ) -> Result<(Frame, Report)> {
        let start = Instant::now();
        self.check_lens(camera, "")?;
        let detail = self.sized(camera);
        let spent = start.elapsed().as_secs_f64() * 1e3;
        let Self { source, backend, sources, faults, kept, of_maps, .. } = self;
        of_maps.iter_mut().chain([&mut *kept]).for_each(|part| part.options.detail = detail);
        let one = |kept: &mut Kept, render: usize| {
            let among = exchange.map(|exchange| Among { exchange, render });
            one(&*source, ((*backend).borrow(), &*sources), kept, (camera, among), progress)
        };
        let mut maps = Vec::new();
        for (number, part) in of_maps.iter_mut().enumerate() {
            // All parts share the uploaded surfels as far as their needs agree.
            part.store = kept.store.take();
            maps.push(one(part, number + 1)?);
            kept.store = part.store.take();
        }
        let (mut frame, mut report) = parts::joined(one(kept, 0)?, maps);
        report.tail = Tail::of(&frame);
        report.kernel = faults.clone();
        if matches!(self.detail, Detail::Splats(_)) {
            *report.passes.entry("select_ms".to_owned()).or_default() += spent;
            report.total_ms += spent;
        }
        if kept.facts.encoded {
            encoded::decode(&mut frame);
        }
        Ok((frame, report))
    }

    /// Rejects what a camera whose lens is no pinhole does not show. `other` is how to get a
    /// pinhole instead, as "leave --projection out"; empty if there is no such way.
    ///
    /// # Errors
    /// [`Error::Usage`].
    pub(crate) fn check_lens(&self, camera: &Camera, other: &str) -> Result<()> {
        let reference = matches!(self.backend.borrow(), Backend::Reference);
        let options = Settings { detail: self.detail, ..self.kept.options.clone() };
        check::lens(&self.kept.facts, camera, &options, reference).map_err(|error| match error {
            Error::Usage(sentence) if !other.is_empty() => Error::Usage(format!("{sentence}, or {other}")),
            error => error,
        })
    }

    /// Applies the filters of finished pictures, and removes a map that only they need.
    fn filtered(&self, mut frame: Frame, camera: &Camera) -> Frame {
        if let Some(strength) = self.eye_dome {
            eye_dome::light(&mut frame, camera, strength);
        }
        if self.drops_depth { frame.without(Map::Depth) } else { frame }
    }

    /// Returns the node size for the view of `camera`. The options of the colour's part determine
    /// it, and all parts use it.
    fn sized(&self, camera: &Camera) -> Detail {
        let (facts, options) = (&self.kept.facts, Settings { detail: self.detail, ..self.kept.options.clone() });
        let wanted = Wanted::of(&options, culls_back(facts, camera, &options));
        let tree = self.source.levels();
        tree.map_or(self.detail, |tree| select::sized(tree, facts.origin, camera, &wanted))
    }

    /// The number of surfels of the scene.
    pub(crate) fn surfels(&self) -> u64 {
        self.kept.facts.surfels
    }

    /// The number of samples that splats cover in the view of `camera`, estimated from some of them
    /// by the rectangles about their images. 0 if nodes are drawn in place of surfels.
    pub(crate) fn fragments(&self, camera: &Camera) -> f64 {
        let Kept { facts, options, .. } = &self.kept;
        match self.detail.is_finest() {
            true => tiles::covered(facts, camera, options) * f64::from(options.samples.count()),
            false => 0.0,
        }
    }

    /// Counts of wrong weights of a kernel that the user wrote; None for built-in kernels.
    pub fn kernel_faults(&self) -> Option<&KernelFaults> {
        self.faults.as_ref()
    }

    /// Whether the last frames of both renderers were drawn by the same compiled kernels.
    #[cfg(feature = "bench")]
    pub(crate) fn has_kernels_of(&self, other: &Self) -> bool {
        let both = self.kept.kernels.as_ref().zip(other.kept.kernels.as_ref());
        both.is_some_and(|(own, others)| own.are_those_of(others))
    }

    /// Device memory of the last frame; zero for the reference.
    pub fn device_bytes(&self) -> DeviceBytes {
        self.kept.device_bytes()
    }
}

/// Returns the WGSL files for `options`, which may leave optimisations of all kernels out.
fn without_optimisations<'a>(sources: &'a Sources, options: &Settings) -> Cow<'a, Sources> {
    let mut sources = Cow::Borrowed(sources);
    if !options.has(Optimisation::UncountedLoops) {
        sources = Cow::Owned(sources.into_owned().with_counted_loops());
    }
    if !options.has(Optimisation::Division) {
        sources = Cow::Owned(sources.into_owned().with_own_division());
    }
    sources
}

/// Renders one part of a frame on `backend`.
fn one(
    source: &dyn Source,
    (backend, sources): (&Backend, &Sources),
    kept: &mut Kept,
    (camera, among): (&Camera, Option<Among<'_>>),
    progress: &dyn Progress,
) -> Result<(Frame, Report)> {
    match backend {
        Backend::Gpu { gpu, .. } => {
            let sources = without_optimisations(sources, &kept.options);
            kept.frame((gpu, &sources), source, (camera, among), progress)
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

    /// Opens a device. If there is no adapter, returns `None`, or panics if
    /// `EPSPLAT_REQUIRE_ADAPTER` is 1.
    fn opened() -> Option<Gpu> {
        match Gpu::open(None) {
            Ok(gpu) => Some(gpu),
            Err(error) if std::env::var("EPSPLAT_REQUIRE_ADAPTER").is_ok_and(|v| v == "1") => panic!("{error}"),
            Err(_) => None,
        }
    }

    /// For each program that a render compiles, whether it counts the rounds of its loops.
    fn counted(without: &[Optimisation]) -> Option<Vec<bool>> {
        let backend = Backend::gpu(opened()?);
        let case = cases().unwrap().swap_remove(0);
        let options = Settings { without: without.to_vec(), ..case.options };
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

    /// Another map changes some kernels; the unchanged ones are compiled once for all renders.
    #[test]
    fn kernels_that_are_the_same_are_compiled_once() {
        // Other APIs get the kernels as WGSL, with constants that are set later.
        let Some(gpu) = opened().filter(|gpu| gpu.adapter.api == "vulkan") else { return };
        let case = cases().unwrap().swap_remove(0);
        let after = |maps: &[Map]| {
            let options = Settings { maps: Maps::of(maps), ..case.options.clone() };
            render(&case.scene, &case.camera, &options, &Backend::gpu(gpu.clone()), &()).unwrap();
            gpu.compiled.count_pipelines()
        };
        let one = after(&[]);
        let (again, with_another) = (after(&[]), after(&[Map::Count]));
        assert!(one > 3 && again == one, "{one} {again}");
        assert!((one + 1..2 * one).contains(&with_another), "{one} {with_another}");
    }
}
