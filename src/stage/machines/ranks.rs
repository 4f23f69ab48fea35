//! Draws a picture together with the other processes of a network: each draws a share of the scene.

use std::sync::{Arc, Mutex, PoisonError};

use super::draw::{digest_of, subject};
use super::header::{Subject, encoded};
use crate::annotate::Marks;
use crate::error::{Error, Result};
use crate::frame::Frame;
use crate::hash;
use crate::network::{Network, Wire, gathered, together};
use crate::passes::share::{ShareOfScene, facts_of_all};
use crate::plan::{Facts, Settings, check};
use crate::progress::Progress;
use crate::render::{self, Backend, Report};
use crate::scene::framing::Others;
use crate::scene::{Scene, Share};
use crate::stage::renderer::SceneOfView;
use crate::stage::{Picture, Renderer, View};

/// A picture that several processes drew, as one of them knows it.
#[derive(Debug)]
pub struct Ranked {
    /// The picture, in process 0.
    pub picture: Option<Picture>,
    /// Times and counts of this process.
    pub report: Report,
    /// Bytes that this process sent, and the time that it took.
    pub wire: Wire,
}

/// The share of a scene that this process draws, which is kept from view to view.
pub(in crate::stage) struct Drawing {
    scene: Arc<Scene>,
    settings: Settings,
    /// Number of this process, and of all.
    place: (usize, usize),
    /// The least limit of buffers of all processes, bytes.
    limit: u64,
    facts: Facts,
    digest: u64,
    renderer: render::Renderer<ShareOfScene, Backend>,
}

impl Drawing {
    fn new(
        of_view: &SceneOfView,
        (facts, digest): (Facts, u64),
        place: (usize, usize),
        (backend, limit): (&Backend, u64),
    ) -> Result<Self> {
        let SceneOfView { scene, settings, is_share, .. } = of_view;
        let source = match is_share {
            true => ShareOfScene::whole(scene.clone()),
            false => ShareOfScene::new(scene.clone(), Share::new(place.0 as u32 + 1, place.1 as u32)?),
        };
        let renderer = render::Renderer::new(source, settings, limited(backend, limit))?.among()?;
        Ok(Self { scene: scene.clone(), settings: settings.clone(), place, limit, facts, digest, renderer })
    }
}

impl Renderer {
    /// Draws a view together with the other processes of a network, all of which call this with the
    /// same scene, options and view. The picture has the bits of [`Renderer::frame`].
    ///
    /// # Errors
    /// The first error of a process, in that process, and [`Error::OtherProcess`] in the others:
    /// [`Error::Usage`] for pictures that processes cannot draw together, and the errors of
    /// [`Renderer::frame`].
    pub fn frame_over(&mut self, view: &View, network: &dyn Network, progress: &dyn Progress) -> Result<Ranked> {
        let others = OverNetwork { network, failed: Mutex::default() };
        let shared = self.shared(view, &others, progress);
        let of_view = together(network, others.failed().map_or(shared, Err))?;
        let SceneOfView { scene, camera, settings, is_share, .. } = &of_view;
        let place = (network.rank(), network.size());
        let is_kept =
            |kept: &Drawing| Arc::ptr_eq(&kept.scene, scene) && kept.settings == *settings && kept.place == place;
        let kept = self.ranked.take().filter(is_kept);
        let (facts, digest) = match (&kept, is_share) {
            (Some(kept), _) => (kept.facts.clone(), kept.digest),
            (None, true) => (facts_of_all(scene), 0),
            (None, false) => (Facts::of(scene), digest_of(scene)),
        };
        let subject = subject(scene, (facts.clone(), digest), camera, settings);
        together(network, check_same(network, &Subject { maps: self.maps(), ..subject }))?;
        let limit = together(network, common_limit(self.backend(), network))?;
        let made = match kept {
            Some(kept) if kept.limit == limit => Ok(kept),
            _ => Drawing::new(&of_view, (facts, digest), place, (self.backend(), limit)),
        };
        let mut kept = together(network, made)?;
        let (frame, report, wire) = kept.renderer.frame_over(camera, network, progress)?;
        self.ranked = Some(kept);
        let picture = frame.map(|frame| self.finished((frame, report.clone()), of_view)).transpose();
        Ok(Ranked { picture: together(network, picture)?, report, wire })
    }

    /// The scene of a view that processes can draw together.
    fn shared(&mut self, view: &View, others: &dyn Others, progress: &dyn Progress) -> Result<SceneOfView> {
        if matches!(self.backend(), Backend::Reference) {
            let what = "processes draw together by adapters, and this one has none: `epsplat adapters`";
            return Err(Error::Usage(what.into()));
        }
        let of_view = self.scene_of(view, others, progress)?;
        check::options_of_ranks(&of_view.settings, false)?;
        let whole = of_view.scene.part_of.as_ref();
        if of_view.is_share && view.is_framed() && whole.is_some_and(|whole| whole.is_framed_by_radii()) {
            let what = "the whole of these large disks is framed from all of them: give --eye and --target";
            return Err(Error::Usage(what.into()));
        }
        let marks = self.options.marks.marks();
        if marks != Marks::default() {
            marks.check(&of_view.camera)?;
        }
        Ok(of_view)
    }

    /// The picture of a frame that all processes drew.
    fn finished(&self, rendered: (Frame, Report), of_view: SceneOfView) -> Result<Picture> {
        let SceneOfView { scene, camera, settings, report, read, key, is_share } = of_view;
        let picture = Picture::of(&scene, &settings, rendered, (camera, report), (read, key));
        // The reasons of a share are not those of all surfels.
        let unseen = picture.unseen.filter(|_| !is_share);
        let picture = Picture { unseen, ..picture };
        picture.with_heights(scene.up.axis(), self.maps()).marked(self.options.marks.marks())
    }
}

/// The processes of a network, for the camera of a view. After an error no message is sent.
struct OverNetwork<'a> {
    network: &'a dyn Network,
    failed: Mutex<Option<Error>>,
}

impl OverNetwork<'_> {
    /// The first error.
    fn failed(&self) -> Option<Error> {
        self.failed.lock().unwrap_or_else(PoisonError::into_inner).take()
    }
}

impl Others for OverNetwork<'_> {
    fn largest(&self, own: &mut [f64]) {
        let mut failed = self.failed.lock().unwrap_or_else(PoisonError::into_inner);
        if failed.is_some() {
            return;
        }
        match gathered(self.network, bytemuck::cast_slice(own)) {
            Ok(all) => {
                let all: Vec<Vec<f64>> = all.iter().map(|bytes| bytemuck::pod_collect_to_vec(bytes)).collect();
                match all.iter().position(|other| other.len() != all[0].len()) {
                    Some(other) => *failed = Some(differs(other)),
                    None => {
                        all.iter().for_each(|all| own.iter_mut().zip(all).for_each(|(own, of)| *own = own.max(*of)))
                    }
                }
            }
            Err(error) => *failed = Some(error),
        }
    }
}

/// The error that a process has another scene, camera or options than process 0.
fn differs(process: usize) -> Error {
    Error::Usage(format!(
        "process {process} has another scene, camera or options than process 0: give all processes the same inputs"
    ))
}

/// Fails unless all processes draw the same picture of the same scene.
fn check_same(network: &dyn Network, subject: &Subject) -> Result<()> {
    // A header has no kernels, as files of parts carry none.
    let Settings { sources, own_kernel, accumulator, .. } = &subject.settings;
    let kernels = format!("{sources:?} {own_kernel:?} {accumulator:?}");
    let own = encoded(subject).into_iter().chain(kernels.into_bytes());
    let all = gathered(network, &hash::of(own).to_le_bytes())?;
    match all.iter().position(|other| *other != all[0]) {
        None => Ok(()),
        Some(other) => Err(differs(other)),
    }
}

/// The least limit of buffers of all processes, bytes: bands follow from it.
fn common_limit(own: &Backend, network: &dyn Network) -> Result<u64> {
    let limit = if let Backend::Gpu { gpu, .. } = own { gpu.buffer_limit() } else { 0 };
    let all = gathered(network, &limit.to_le_bytes())?;
    let of = |bytes: &Vec<u8>| bytes.as_slice().try_into().map_or(0, u64::from_le_bytes);
    Ok(all.iter().map(of).min().unwrap_or(0))
}

/// A device with this limit of buffers.
fn limited(backend: &Backend, limit: u64) -> Backend {
    match backend {
        Backend::Gpu { gpu, sources } => {
            let gpu = Box::new((**gpu).clone().with_buffer_limit(limit));
            Backend::Gpu { gpu, sources: sources.clone() }
        }
        Backend::Reference => Backend::Reference,
    }
}
