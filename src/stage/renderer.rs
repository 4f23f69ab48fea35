//! Renders views of a scene.

use std::sync::Arc;

use glam::DVec3;

use super::drawn::{Drawn, whole};
use super::extent::Extent;
use super::in_part::{Part, Parts};
use super::{Files, Inputs, Picture, Request, Scene, View, ViewReport, lens, memory, overdraw, refined};
#[cfg(feature = "parts")]
use super::{ReadReport, machines::Drawing};
use crate::annotate::Marks;
use crate::error::{Error, Result};
use crate::gpu::{Gpu, Replacement};
use crate::network::Network;
use crate::options::{Chosen, DeviceOptions, RenderOptions, SceneOptions};
use crate::plan::{BackendName, Settings};
use crate::progress::Progress;
use crate::render::{self, Backend, render};
use crate::scene::{self, Bounds, Camera, KernelFaults, Maps};
#[cfg(feature = "parts")]
use crate::{
    plan::check,
    scene::framing::Others,
    scene::{ColorKey, Detail},
};

/// Renders views of a scene with the same options. Surfels, buffers and compiled kernels are kept
/// from one view to the next.
pub struct Renderer {
    inputs: Arc<Inputs>,
    pub(super) options: RenderOptions,
    device: DeviceOptions,
    views: bool,
    settings: Settings,
    backend: Arc<Backend>,
    pub(super) drawn: Drawn,
    /// Number of frames in memory at once, which counts against the limit of memory.
    frames: u64,
    /// The extent of [`Renderer::scene`].
    pub(super) extent: Extent,
    /// Whether only a share of the scene was read, for [`Renderer::frame_over`].
    has_share: bool,
    /// The share that this process draws together with others, from the last such view.
    #[cfg(feature = "parts")]
    pub(super) ranked: Option<Drawing>,
}

/// The use of a renderer.
#[derive(Clone, Copy, Default)]
struct How<'a> {
    /// It draws many views, from one to the next of which levels of detail fade.
    views: bool,
    /// The first view, if its kernels are to be compiled early.
    first: Option<&'a View>,
    /// The processes with which it draws together, and the view.
    among: Option<(&'a dyn Network, &'a View)>,
}

/// The scene that a view shows, and how it is drawn.
#[cfg(feature = "parts")]
pub(super) struct SceneOfView {
    pub scene: Arc<scene::Scene>,
    pub camera: Camera,
    pub settings: Settings,
    pub report: ViewReport,
    /// Counts of what was read for this view; None if the inputs were read whole.
    pub read: Option<ReadReport>,
    pub key: Option<ColorKey>,
    /// Whether the scene is only the share of this process.
    pub is_share: bool,
}

impl Renderer {
    /// Makes a renderer of `scene`: checks the options, opens the device, and reads and prepares
    /// all that its views share. Notes for the user go to [`Progress::note`].
    ///
    /// # Errors
    ///
    /// [`Error::Usage`] if the options cannot be combined or do not suit the scene,
    /// [`Error::NoAdapter`] if no adapter fits the device options, and errors of reading.
    pub fn new(
        scene: &Scene,
        options: &RenderOptions,
        device: &DeviceOptions,
        progress: &dyn Progress,
    ) -> Result<Self> {
        Self::with(scene, options, (device, None), How::default(), progress)
    }

    /// Makes a renderer for [`Renderer::frame_over`], together with the other processes of a
    /// network, all of which call this.
    ///
    /// It reads only the share of this process if the inputs are one file of `epsplat lod`, or
    /// binary PLY files of surfels. Else it reads everything, because the surfels of a share may
    /// depend on points around it.
    ///
    /// # Errors
    ///
    /// The same as those of [`Renderer::new`], and [`Error::OtherProcess`] if another process could
    /// not read its share. After an error the caller tells the others
    /// ([`together`](crate::low_level::network::together)).
    #[cfg(feature = "parts")]
    pub fn of_share(
        scene: &Scene,
        options: &RenderOptions,
        device: &DeviceOptions,
        (network, view): (&dyn Network, &View),
        progress: &dyn Progress,
    ) -> Result<Self> {
        Self::with(scene, options, (device, None), How { among: Some((network, view)), ..How::default() }, progress)
    }

    /// Makes a renderer as [`Renderer::new`] does, and meanwhile compiles the kernels that `first`,
    /// the first view, most likely needs.
    ///
    /// # Errors
    ///
    /// The same as those of [`Renderer::new`]. Errors of the kernels are left to the frame.
    pub fn ahead(
        scene: &Scene,
        options: &RenderOptions,
        device: &DeviceOptions,
        first: &View,
        progress: &dyn Progress,
    ) -> Result<Self> {
        Self::with(scene, options, (device, None), How { first: Some(first), ..How::default() }, progress)
    }

    /// Makes a renderer on a device that is open already, such as that of the caller's own program
    /// ([`Gpu::from_wgpu`]).
    ///
    /// # Errors
    ///
    /// The same as those of [`Renderer::new`].
    pub fn on_device(scene: &Scene, options: &RenderOptions, gpu: &Gpu, progress: &dyn Progress) -> Result<Self> {
        let device = DeviceOptions { backend: Chosen(Some(BackendName::Gpu)), ..DeviceOptions::default() };
        Self::with(scene, options, (&device, Some(gpu)), How::default(), progress)
    }

    /// Makes a renderer for a camera that moves: cuts of levels of detail fade from view to view
    /// where they can, unless the options say otherwise.
    ///
    /// # Errors
    ///
    /// The same as those of [`Renderer::new`].
    pub fn of_views(
        scene: &Scene,
        options: &RenderOptions,
        device: &DeviceOptions,
        progress: &dyn Progress,
    ) -> Result<Self> {
        Self::with(scene, options, (device, None), How { views: true, ..How::default() }, progress)
    }

    fn with(
        scene: &Scene,
        options: &RenderOptions,
        (device, open): (&DeviceOptions, Option<&Gpu>),
        How { views, first, among }: How<'_>,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let (inputs, mut options, device) = (scene.0.clone(), options.clone(), device.clone());
        let sources = options.research.sources.iter().map(Replacement::loaded).collect::<Result<_>>()?;
        options.research.sources = sources;
        let request = Request { scene: &inputs, options: &options, device: &device, views, read: None, among };
        let settings = request.settings()?;
        #[cfg(feature = "parts")]
        if request.among.is_some() {
            // Files may turn out to need no levels of detail.
            check::options_of_ranks(&Settings { detail: Detail::FINEST, ..settings.clone() }, request.is_reference())?;
        }
        if options.surface.separate && inputs.count() < 2 {
            progress.note(
                "--separate keeps the surfels of several files apart: it changes nothing here, as there is at most one file",
            );
        }
        let backend = match open {
            Some(gpu) => Backend::gpu(gpu.clone()),
            None => backend(&device, progress)?,
        };
        let backend = Arc::new(backend);
        let (settings, drawn) = match Parts::of(&request, &settings, progress)? {
            Some(parts) => (settings, Drawn::Parts { parts: Box::new(parts), noted: false }),
            None => whole(&request, settings, (&backend, first), progress)?,
        };
        // A renderer of everything draws a scene that is part of nothing.
        let has_share = matches!(&drawn, Drawn::Whole { scene, .. } if scene.part_of.is_some());
        Ok(Self {
            inputs,
            options,
            device,
            views,
            settings,
            backend,
            drawn,
            frames: 1,
            extent: Extent::default(),
            has_share,
            #[cfg(feature = "parts")]
            ranked: None,
        })
    }

    /// Rejects options that cannot be combined, before any input is read.
    ///
    /// # Errors
    ///
    /// [`Error::Usage`], as [`Renderer::new`].
    pub fn check(files: &Files, scene: &SceneOptions, options: &RenderOptions, device: &DeviceOptions) -> Result<()> {
        let inputs = Inputs { files: files.clone(), options: scene.clone(), ..Inputs::default() };
        Request { scene: &inputs, options, device, views: false, read: None, among: None }.settings().map(drop)
    }

    /// Sets how many frames the caller has in memory at once (1 by default). They count against the
    /// limit of memory.
    #[must_use]
    pub fn with_frames(self, frames: u64) -> Self {
        Self { frames, ..self }
    }

    /// The settings that the options and the scene resolve to.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// The maps that the options ask for.
    pub(super) fn maps(&self) -> Maps {
        Maps::of(&self.options.maps.aov)
    }

    /// The backend that renders.
    pub fn backend(&self) -> &Backend {
        &self.backend
    }

    /// The box of the scene's centres, world coordinates. If files are read in part, it is the box
    /// of the overview, which is made from the coarsest nodes.
    pub fn bounds(&self) -> Bounds {
        let scene = self.scene();
        let Bounds { min, max } = scene.bounds();
        Bounds { min: min + scene.origin, max: max + scene.origin }
    }

    /// The number of surfels in memory that all views share.
    pub fn surfels_read(&self) -> u64 {
        self.scene().surfels.len() as u64
    }

    /// The scene, or an overview of files that are read in part.
    pub(super) fn scene(&self) -> &scene::Scene {
        match &self.drawn {
            Drawn::Whole { scene, .. } => scene,
            Drawn::Parts { parts, .. } => parts.overview(),
        }
    }

    /// The box of all points of files that are read in part, as they state it, world coordinates.
    pub(super) fn data(&self) -> Option<Bounds> {
        match &self.drawn {
            Drawn::Parts { parts, .. } => parts.bounds(),
            Drawn::Whole { .. } => None,
        }
    }

    /// Returns the camera of a view, with values from the scene filled in.
    ///
    /// # Errors
    ///
    /// [`Error::Usage`] if the view and the scene give no camera, or if the view shows the whole
    /// scene, of which this renderer has a share.
    pub fn camera(&self, view: &View) -> Result<Camera> {
        if view.is_framed() {
            self.check_whole()?;
        }
        view.camera(self.scene(), &self.extent, &()).map(|(camera, _)| camera)
    }

    /// Renders a view.
    ///
    /// # Errors
    ///
    /// [`Error::Limit`] if a limit of the adapter is too small, [`Error::Usage`] if the limit of
    /// memory is too small, and errors of reading and of the device.
    pub fn frame(&mut self, view: &View, progress: &dyn Progress) -> Result<Picture> {
        // Many views would give a line each.
        let is_told = !self.views;
        let marks = self.options.marks.marks();
        // Framing a view looks at all points, so a frame without marks does it only once.
        if marks != Marks::default() {
            marks.check(&self.camera(view)?)?;
        }
        let up = self.scene().up.axis();
        self.rendered(view, (is_told, up), progress)?.marked(marks)
    }

    /// Fails if the renderer has only a share of the scene.
    pub(super) fn check_whole(&self) -> Result<()> {
        match self.has_share {
            true => Err(Error::Usage("this renderer has a share of the scene: draw by Renderer::frame_over".into())),
            false => Ok(()),
        }
    }

    /// Returns the scene that a view shows, and how it is drawn. Notes are those of a frame.
    /// `others` hold the other shares of the scene, if this renderer has one.
    #[cfg(feature = "parts")]
    pub(super) fn scene_of(
        &mut self,
        view: &View,
        others: &dyn Others,
        progress: &dyn Progress,
    ) -> Result<SceneOfView> {
        let others = if self.has_share { others } else { &() };
        let (camera, seen) = view.camera(self.scene(), &self.extent, others)?;
        let Self { inputs, options, device, views, settings, drawn, frames, .. } = self;
        let request = Request { scene: inputs, options, device, views: *views, read: None, among: None };
        match drawn {
            Drawn::Whole { scene, guessed_up, key, renderer } => {
                renderer.check_lens(&camera, view.as_pinhole())?;
                let report = ViewReport::new(&camera, &seen, scene, *guessed_up);
                report.tell(progress);
                lens::note(scene, &camera).iter().for_each(|line| progress.note(line));
                let slow = overdraw::note(renderer.surfels(), renderer.fragments(&camera));
                slow.iter().for_each(|line| progress.note(line));
                let refined = refined::refined(scene, &camera);
                refined.iter().filter_map(|refined| refined.note()).for_each(|line| progress.note(&line));
                let scene = refined.map_or_else(|| scene.clone(), |refined| Arc::new(refined.scene));
                let (settings, key) = (settings.clone(), key.clone());
                Ok(SceneOfView { scene, camera, settings, report, read: None, key, is_share: self.has_share })
            }
            Drawn::Parts { parts, .. } => {
                let Part { made: (scene, preparation), settings, read, key } =
                    parts.scene(&request, (&camera, *frames), settings, progress)?;
                let report = ViewReport::new(&camera, &seen, &scene, preparation.guessed_up);
                preparation.notes().iter().for_each(|line| progress.note(line));
                report.tell(progress);
                progress.note(&read.sentence());
                let scene = Arc::new(scene);
                Ok(SceneOfView { scene, camera, settings, report, read: Some(read), key, is_share: false })
            }
        }
    }

    /// Renders a view without marks, and describes it in a note if `is_told`. `up` is the axis of
    /// heights, of length 1.
    pub(super) fn rendered(
        &mut self,
        view: &View,
        (is_told, up): (bool, DVec3),
        progress: &dyn Progress,
    ) -> Result<Picture> {
        self.check_whole()?;
        let (camera, seen) = view.camera(self.scene(), &self.extent, &())?;
        let other = view.as_pinhole();
        let Self { inputs, options, device, views, settings, backend, drawn, frames, .. } = self;
        let request = Request { scene: inputs, options, device, views: *views, read: None, among: None };
        let maps = Maps::of(&options.maps.aov);
        let tell = |view: &ViewReport| {
            if is_told {
                view.tell(progress);
            }
        };
        match drawn {
            Drawn::Whole { scene, guessed_up, key, renderer } => {
                renderer.check_lens(&camera, other)?;
                let view = ViewReport::new(&camera, &seen, scene, *guessed_up);
                tell(&view);
                let bent = is_told.then(|| lens::note(scene, &camera)).flatten();
                bent.iter().for_each(|line| progress.note(line));
                let slow = is_told.then(|| overdraw::note(renderer.surfels(), renderer.fragments(&camera))).flatten();
                slow.iter().for_each(|line| progress.note(line));
                let rendered = match refined::refined(scene, &camera) {
                    Some(refined) => {
                        refined.note().iter().filter(|_| is_told).for_each(|line| progress.note(line));
                        render(&refined.scene, &camera, settings, backend, progress)?
                    }
                    None => renderer.frame(&camera, progress)?,
                };
                Ok(Picture::of(scene, settings, rendered, (camera, view), (None, key.clone())).with_heights(up, maps))
            }
            Drawn::Parts { parts, noted } => {
                let Part { made: (scene, preparation), settings, read, key } =
                    parts.scene(&request, (&camera, *frames), settings, progress)?;
                let first = !std::mem::replace(noted, true);
                if first {
                    preparation.notes().iter().for_each(|line| progress.note(line));
                }
                let view = ViewReport::new(&camera, &seen, &scene, preparation.guessed_up);
                tell(&view);
                if is_told {
                    progress.note(&read.sentence());
                }
                let mut renderer = render::Renderer::new(&scene, &settings, &**backend)?;
                renderer.check_lens(&camera, other)?;
                let rendered = renderer.frame(&camera, progress)?;
                let wrong = rendered.1.kernel.as_ref().filter(|_| first).and_then(KernelFaults::sentence);
                wrong.iter().for_each(|line| progress.note(line));
                Ok(Picture::of(&scene, &settings, rendered, (camera, view), (Some(read), key)).with_heights(up, maps))
            }
        }
    }
}

/// Opens the backend of the device options.
///
/// # Errors
///
/// [`Error::NoAdapter`] if no adapter fits the options.
pub(super) fn backend(device: &DeviceOptions, progress: &dyn Progress) -> Result<Backend> {
    if device.backend.0 == Some(BackendName::Reference) {
        if device.adapter.is_some() {
            return Err(Error::Usage("--backend reference uses no adapter: leave --adapter out".into()));
        }
        return Ok(Backend::Reference);
    }
    match Gpu::open_in_turn(device.adapter.as_deref(), device.turn) {
        Ok(gpu) => {
            progress.note(&format!("rendering on {} ({}, {})", gpu.adapter.name, gpu.adapter.api, gpu.adapter.kind));
            let gpu = if device.memory.is_some() { gpu.with_buffer_limit(memory::BUFFER) } else { gpu };
            Ok(Backend::gpu(gpu))
        }
        Err(Error::NoAdapter(why)) if device.backend.0.is_none() && device.adapter.is_none() => {
            progress.note(&format!("rendering with the f64 reference on the processor: {why}"));
            Ok(Backend::Reference)
        }
        Err(error) => Err(error),
    }
}
