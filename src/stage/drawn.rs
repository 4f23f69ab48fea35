//! The data that views are drawn from, which a renderer keeps.

use std::sync::Arc;

use super::in_part::Parts;
use super::whole::Whole;
use super::{Request, View, ahead, levels, shares};
use crate::error::Result;
use crate::plan::Settings;
use crate::progress::Progress;
use crate::render::{self, Backend};
use crate::scene::{self, ColorKey, KernelFaults};

/// The data that views are drawn from.
pub(super) enum Drawn {
    /// Surfels and triangles that all views share.
    Whole {
        scene: Arc<scene::Scene>,
        guessed_up: bool,
        /// The meaning of colours, if they show an attribute.
        key: Option<ColorKey>,
        renderer: Box<render::Renderer<Arc<scene::Scene>, Arc<Backend>>>,
    },
    /// Files of which each view reads a part.
    Parts {
        parts: Box<Parts>,
        /// Whether the notes of the first view were given; later views would repeat them.
        noted: bool,
    },
}

/// Reads and prepares a scene that all views share, and returns it with the settings that suit it.
pub(super) fn whole(
    request: &Request<'_>,
    settings: Settings,
    (backend, first): (&Arc<Backend>, Option<&View>),
    progress: &dyn Progress,
) -> Result<(Settings, Drawn)> {
    let among = request.among.filter(|_| settings.detail.is_finest());
    let shared = among.map_or(Ok(None), |among| shares::own(request, among, &settings, progress))?;
    let mut whole = match shared {
        Some((scene, preparation)) => {
            Arc::new(Whole { scene: Arc::new(scene), preparation, notes: Vec::new(), key: None })
        }
        None => {
            let read = |read: &ahead::Read<'_>| Request { read: Some(read), ..*request }.whole(progress);
            ahead::compiling(request, &settings, first, backend, read)?
        }
    };
    whole.preparation.notes().iter().for_each(|line| progress.note(line));
    let settings = request.for_scene(settings, &whole.scene, progress)?;
    if levels::lack(&whole.scene, &settings) {
        whole = request.with_levels(whole, progress)?;
    }
    let renderer = render::Renderer::new(whole.scene.clone(), &settings, backend.clone())?;
    renderer.kernel_faults().and_then(KernelFaults::sentence).iter().for_each(|line| progress.note(line));
    let (scene, guessed_up) = (whole.scene.clone(), whole.preparation.guessed_up);
    let key = whole.key.clone();
    Ok((settings, Drawn::Whole { scene, guessed_up, key, renderer: Box::new(renderer) }))
}
