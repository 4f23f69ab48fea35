//! Draws the part of one process.

use std::sync::Arc;

use super::Part;
use super::files::{Depths, Kept, Sums};
use super::header::{Header, Holds, Subject, version};
use super::merge::merge;
use crate::annotate::Marks;
use crate::error::{Error, Result};
use crate::options::{DeviceOptions, RenderOptions, SceneOptions};
use crate::passes::digest;
use crate::passes::order::order;
use crate::passes::share::ShareOfScene;
use crate::plan::{Facts, Settings, check};
use crate::progress::Progress;
use crate::render::exchange::Exchange;
use crate::render::{self, Backend};
use crate::scene::{Camera, Scene, Share};
use crate::stage::drawn::Drawn;
use crate::stage::renderer::Renderer;
use crate::stage::{Files, Inputs, Request, View, refined};

impl Renderer {
    /// Draws the `share` of a view: its nearest depths, or its sums `within` the nearest depths of
    /// all shares, which [`merge`] joins. Every process reads all inputs.
    ///
    /// # Errors
    /// [`Error::Usage`] for pictures that parts cannot make, or if `within` lacks shares;
    /// [`Error::Malformed`] if `within` belongs to another picture; and the errors of
    /// [`Renderer::frame`].
    pub fn part(&self, view: &View, share: Share, within: Option<&Part>, progress: &dyn Progress) -> Result<Part> {
        self.check_whole()?;
        let (camera, scene) = self.subject_of_part(view, progress)?;
        let Backend::Gpu { gpu, .. } = self.backend() else {
            return Err(Error::Usage("parts are drawn by an adapter, and there is none: `epsplat adapters`".into()));
        };
        let adapters = vec![format!("{} ({})", gpu.adapter.name, gpu.adapter.api)];
        let settings = self.settings().clone();
        let facts = Facts::of(&scene);
        check::files_of_parts(&facts, &settings)?;
        let subject = subject(&scene, (facts, digest_of(&scene)), &camera, &settings);
        let subject = Subject { maps: self.maps(), ..subject };
        let own = own_digest(&scene, share, &subject, &settings);
        let holds = if within.is_some() { Holds::Sums } else { Holds::Depths };
        let (of, shares) = (share.of(), vec![share.number()]);
        let header = Header { holds, of, shares, own, within: None, adapters, subject };
        let kept = Kept::default();
        let draw = |exchange: &dyn Exchange| {
            let source = ShareOfScene::new(scene.clone(), share);
            let mut renderer = render::Renderer::new(source, &settings, self.backend())?.among()?;
            renderer.frame_among(&camera, exchange, progress).map(drop)
        };
        let header = match within {
            None => {
                draw(&Depths(&kept))?;
                header
            }
            Some(within) => {
                let within = depths(within, &header)?;
                draw(&Sums { kept: &kept, within: &within, common: share.number() == 1 })?;
                Header { within: Some(within.digest()), ..header }
            }
        };
        Ok(Part { name: format!("part {share}").into(), header, sections: kept.into_sections() })
    }

    /// Rejects options with which a picture has no parts, before any input is read.
    ///
    /// # Errors
    /// [`Error::Usage`], as [`Renderer::part`].
    pub fn check_part(
        files: &Files,
        scene: &SceneOptions,
        options: &RenderOptions,
        device: &DeviceOptions,
    ) -> Result<()> {
        let inputs = Inputs { files: files.clone(), options: scene.clone(), ..Inputs::default() };
        let request = Request { scene: &inputs, options, device, views: false, read: None, among: None };
        check_marks(options)?;
        check::options_of_parts(&request.settings()?, request.is_reference())
    }

    /// The camera and the scene of a part.
    fn subject_of_part(&self, view: &View, progress: &dyn Progress) -> Result<(Camera, Arc<Scene>)> {
        check_marks(&self.options)?;
        check::options_of_parts(self.settings(), false)?;
        let Drawn::Whole { scene, renderer, .. } = &self.drawn else {
            return Err(Error::Usage("parts are shares of all surfels: leave --lod and --splats out".into()));
        };
        let camera = self.camera(view)?;
        renderer.check_lens(&camera, view.as_pinhole())?;
        let refined = refined::refined(scene, &camera);
        refined.iter().filter_map(|refined| refined.note()).for_each(|line| progress.note(&line));
        Ok((camera, refined.map_or_else(|| scene.clone(), |refined| Arc::new(refined.scene))))
    }
}

/// Rejects marks.
fn check_marks(options: &RenderOptions) -> Result<()> {
    if options.marks.marks() == Marks::default() {
        return Ok(());
    }
    let what =
        "marks are drawn on the finished picture, and a part is none: leave --legend, --scale-bar and --north out";
    Err(Error::Usage(what.into()))
}

/// The picture that a part belongs to.
pub(super) fn subject(scene: &Scene, (facts, digest): (Facts, u64), camera: &Camera, settings: &Settings) -> Subject {
    Subject {
        version: version().to_owned(),
        facts,
        digest,
        camera: camera.clone(),
        settings: settings.clone(),
        maps: settings.maps,
        up: scene.up.axis().to_array(),
    }
}

/// The digest of all surfels and triangles.
pub(super) fn digest_of(scene: &Scene) -> u64 {
    let all: Vec<u32> = (0..scene.surfels.len() as u32).collect();
    digest::of_surfels(scene, &all).wrapping_add(digest::of_triangles(&scene.triangles))
}

/// The digest of the surfels of `share`, and of the triangles in the first share.
fn own_digest(scene: &Scene, share: Share, subject: &Subject, settings: &Settings) -> u64 {
    let ordered = settings.has(crate::plan::Optimisation::Order);
    let given = || share.range(scene.surfels.len()).map(|index| index as u32).collect();
    let indices = if ordered { order(scene, &subject.facts.core, Some(share)) } else { given() };
    let of_triangles = if share.number() == 1 { digest::of_triangles(&scene.triangles) } else { 0 };
    digest::of_surfels(scene, &indices).wrapping_add(of_triangles)
}

/// The nearest depths of all shares.
fn depths(within: &Part, header: &Header) -> Result<Part> {
    if !within.holds_depths() {
        return Err(
            within.refused("it holds sums, and --within takes nearest depths: name the parts of the first pass")
        );
    }
    if let Some(difference) = within.header.difference(header) {
        return Err(within.refused(format!("it {difference} than this picture: draw all parts with the same options")));
    }
    within.check_whole()?;
    merge(std::slice::from_ref(within))
}
