//! Frames that stay on the device.

use super::Renderer;
use super::drawn::Drawn;
use crate::error::{Error, Result};
use crate::render::{self, Backend, FrameLayout, Target, Ticket};
use crate::scene::{self, Camera, Map};
use std::sync::Arc;

/// The renderer of a scene that all views share.
type OfWhole = render::Renderer<Arc<scene::Scene>, Arc<Backend>>;

impl Renderer {
    /// Returns how a frame of `camera` lies in a buffer of the device: the words of its colour and
    /// of each map, and its size in bytes.
    ///
    /// # Errors
    ///
    /// [`Error::Usage`] if the frame cannot stay on the device, as those of
    /// [`encode`](Self::encode).
    pub fn layout(&self, camera: &Camera) -> Result<FrameLayout> {
        self.check_whole()?;
        match &self.drawn {
            Drawn::Whole { renderer, .. } => renderer.layout(camera),
            Drawn::Parts { .. } => Err(in_parts()),
        }
    }

    /// Records a frame into `encoder`: all its passes, and the copy of its image to `target`, whose
    /// bits are those of [`frame`](Self::frame). Nothing is submitted, awaited or read back, and
    /// the picture is ready for the commands that follow in the encoder.
    ///
    /// Several frames may be recorded, into one encoder or several, before the first is submitted.
    /// They use the same buffers one after the other, so each is complete before the next begins.
    ///
    /// **Sizes.** Buffers have the sizes that earlier frames needed. The first frame, the first of
    /// another image size, and the first after a ticket told that a buffer was too small are
    /// rendered once at once, to measure them; only then does this function submit commands and
    /// wait. Where a view needs more than the buffers hold, its picture lacks splats. A verdict on
    /// the device says so ([`Ticket::verdict`]), and so does the ticket. Read the ticket, then
    /// encode the view again: that measures it and is complete.
    ///
    /// ```no_run
    /// # use epsplat::{Gpu, RenderOptions, Renderer, Scene, SceneOptions, Target, View, wgpu};
    /// # fn of(gpu: Gpu, buffer: wgpu::Buffer) -> Result<(), epsplat::Error> {
    /// let scene = Scene::open(["scene.ply"], &SceneOptions::default())?;
    /// let mut renderer = Renderer::on_device(&scene, &RenderOptions::default(), &gpu, &())?;
    /// let camera = renderer.camera(&View::default())?;
    /// let mut encoder = gpu.device().create_command_encoder(&Default::default());
    /// // The buffer has renderer.layout(&camera)?.bytes.
    /// let ticket = renderer.encode(&camera, &mut encoder, Target::Buffer(&buffer, 0))?;
    /// gpu.queue().submit([encoder.finish()]);
    /// assert!(ticket.read()?.complete);
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    ///
    /// [`Error::Usage`] if `target` does not suit the frame; for the f64 reference, which has no
    /// device; for files that are read in part; for maps that the host finishes (`index` and
    /// `height`); and where counts must be read in the middle of each frame. Errors of
    /// [`frame`](Self::frame). After an error the encoder may hold a part of the frame: drop it.
    pub fn encode(
        &mut self,
        camera: &Camera,
        encoder: &mut wgpu::CommandEncoder,
        target: Target<'_>,
    ) -> Result<Ticket> {
        self.check_whole()?;
        self.of_whole()?.encode(camera, encoder, target)
    }

    fn of_whole(&mut self) -> Result<&mut OfWhole> {
        if let Some(row) = self.maps().iter().map(Map::row).find(|row| row.from.is_some()) {
            let what = format!("the host finishes the map {}: leave it out of frames on the device", row.name);
            return Err(Error::Usage(what));
        }
        match &mut self.drawn {
            Drawn::Whole { renderer, .. } => Ok(renderer),
            Drawn::Parts { .. } => Err(in_parts()),
        }
    }
}

fn in_parts() -> Error {
    Error::Usage(
        "files that are read in part change their surfels from view to view: render their frames, or leave the level of \
         detail out, so that they are read whole"
            .into(),
    )
}
