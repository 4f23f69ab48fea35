//! Records frames into the encoder of a user's program, with the sizes that earlier frames
//! measured.

use std::borrow::{Borrow, Cow};

use super::frame_layout::{FrameLayout, on_device};
use super::kept::Kept;
use super::record::{OfRecording, Recorder, VERDICT_WORDS, reads_in_its_middle, record};
use super::store::Store;
use super::texture::Textured;
use super::ticket::{Lessons, Part, Ticket};
use super::{Backend, Renderer, texture, without_optimisations};
use crate::error::{Error, Result};
use crate::gpu::buffers::Buffer;
use crate::gpu::layout::View;
use crate::gpu::{Gpu, Sources};
use crate::passes::MAP_PASSES;
use crate::passes::source::Source;
use crate::plan::known::Listed;
use crate::plan::{Known, NO_MAP, PixelLayout, Plan};
use crate::scene::{Camera, Map};

/// Where a frame goes on the device.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub enum Target<'a> {
    /// A buffer with the usage `COPY_DST`, from a byte on that is a multiple of 4. The colour and
    /// all maps lie in it as [`FrameLayout`] says.
    Buffer(&'a wgpu::Buffer, u64),
    /// Textures of the size of the image, with the usage `COPY_DST`.
    Textures {
        /// Takes the colour with straight alpha: as sRGB codes if its format is `Rgba8Unorm`,
        /// `Bgra8Unorm` or the `Srgb` variant of one of them (the bytes of a PNG), and in linear
        /// light if it is `Rgba16Float` or `Rgba32Float`. The colours of Gaussians are sRGB codes
        /// in any format.
        color: &'a wgpu::Texture,
        /// Takes the map of depths ([`Camera::depth`]) in the format `R32Float`: world units, +inf
        /// where nothing is visible.
        depth: Option<&'a wgpu::Texture>,
    },
}

impl<'a> Target<'a> {
    fn check(self, layout: &FrameLayout) -> Result<()> {
        match self {
            Self::Buffer(buffer, first) => layout.check(buffer, first),
            Self::Textures { color, depth } => {
                texture::check(layout, color, false)?;
                depth.map_or(Ok(()), |depth| texture::check(layout, depth, true))
            }
        }
    }

    /// The textures that take values of part `number`, whose image has `maps`.
    fn textures_of(self, number: usize, plan: &PixelLayout, codes: bool) -> Vec<Textured<'a>> {
        let Self::Textures { color, depth } = self else { return Vec::new() };
        let color = (number == 0).then_some(Textured { texture: color, first: 0, codes });
        let word = plan.map_words[Map::Depth as usize];
        let depth = depth.filter(|_| word != NO_MAP).map(|texture| Textured { texture, first: word, codes: false });
        color.into_iter().chain(depth).collect()
    }
}

/// State that the recorded frames of a renderer share.
#[derive(Default)]
pub(super) struct Shared {
    /// Made by the first frame.
    verdict: Option<Buffer<u32>>,
    lessons: Lessons,
}

/// State that a part of a renderer keeps for its recorded frames.
#[derive(Default)]
pub(super) struct Recorded {
    /// Number of measurements so far.
    measured: u64,
    /// Whether a ticket told that a buffer was too small.
    lacks: bool,
    /// Whether no list can hold the large splats, so that frames draw them without.
    unlisted: bool,
    /// Room for fragments, as the last measurement made it; 0 if the part has no lists.
    fragments: u64,
    own: OfRecording,
}

impl<S: Source, B: Borrow<Backend>> Renderer<S, B> {
    /// Returns how a frame of `camera` lies in a buffer.
    ///
    /// # Errors
    /// [`Error::Usage`] if the frame cannot stay on the device ([`encode`](Self::encode)).
    pub fn layout(&self, camera: &Camera) -> Result<FrameLayout> {
        FrameLayout::new(camera, self.kept.facts.encoded, &self.pixels(camera)?)
    }

    /// The layouts of the pixels of all parts, that of the colour first.
    fn pixels(&self, camera: &Camera) -> Result<Vec<PixelLayout>> {
        let gpu = on_device(self.backend.borrow())?;
        if self.eye_dome.is_some() {
            return Err(Error::Usage(
                "the host adds eye-dome lighting: leave --edl out of frames on the device".into(),
            ));
        }
        let of_part = |part: &Kept| {
            if let Some(own) = MAP_PASSES.iter().find(|own| part.options.maps.has(own.map)) {
                let name = own.map.row().name;
                let what = format!("the host finishes the map {name}: leave it out of frames on the device");
                return Err(Error::Usage(what));
            }
            let sampled = camera.sampled(part.options.samples)?;
            Ok(Plan::of(&part.facts, &gpu.adapter, &sampled, &part.options, &part.known)?.pixel)
        };
        std::iter::once(&self.kept).chain(&self.of_maps).map(of_part).collect()
    }

    /// Records a frame into `encoder`: all its passes, and the copy of its image to `target`.
    /// Nothing is submitted, awaited or read back.
    ///
    /// The bits are those of [`frame`](Self::frame). Several frames may be recorded, into one
    /// encoder or several, before the first is submitted. They use the same buffers one after the
    /// other, so they run in the order of their submission.
    ///
    /// Buffers have the sizes that earlier frames needed. The first frame, the first of another
    /// image size, and the first after a ticket told that a buffer was too small are rendered once
    /// at once to measure them, with submissions and waits of their own. Where a view needs more,
    /// its picture lacks splats, and the verdict on the device says so ([`Ticket::verdict`]); once
    /// its ticket was read, encode the view again, or render it.
    ///
    /// After an error the encoder holds a part of the frame and must be dropped.
    ///
    /// # Errors
    /// [`Error::Usage`] if `target` does not suit the frame; for the reference, which has no
    /// device; for maps that the host finishes (`index`); and where counts must be read in the
    /// middle of each frame. Errors of [`frame`](Self::frame).
    pub fn encode(
        &mut self,
        camera: &Camera,
        encoder: &mut wgpu::CommandEncoder,
        target: Target<'_>,
    ) -> Result<Ticket> {
        let pixels = self.pixels(camera)?;
        let layout = FrameLayout::new(camera, self.kept.facts.encoded, &pixels)?;
        target.check(&layout)?;
        self.learn();
        let detail = self.sized(camera);
        let gpu = on_device(self.backend.borrow())?;
        if self.recorded.verdict.is_none() {
            self.recorded.verdict = Some(Buffer::storage(gpu, "verdict on a frame", VERDICT_WORDS)?);
        }
        let Self { source, sources, kept, of_maps, recorded, .. } = self;
        let verdict = recorded.verdict.as_ref().ok_or_else(|| gpu.error("a frame has no verdict"))?;
        encoder.clear_buffer(&verdict.raw, 0, None);
        let image = match target {
            Target::Buffer(buffer, first) => Some((buffer, first)),
            Target::Textures { .. } => None,
        };
        let mut recorder = Recorder { encoder, image, textures: Vec::new(), verdict };
        let (mut store, mut parts) = (kept.store.take(), Vec::new());
        for (number, part) in std::iter::once(kept).chain(of_maps).enumerate() {
            part.options.detail = detail;
            recorder.textures = target.textures_of(number, &pixels[number], layout.codes);
            if recorder.image.is_none() && recorder.textures.is_empty() {
                continue;
            }
            // All parts share the uploaded surfels as far as their needs agree.
            part.store = store;
            let sources = without_optimisations(sources, &part.options);
            let encoded = part.encode((gpu, &sources), &*source, camera, &mut recorder);
            store = part.store.take();
            parts.push(encoded.map(|part| (number, part)));
        }
        self.kept.store = store;
        let parts = parts.into_iter().collect::<Result<_>>()?;
        Ok(Ticket::new(gpu, &verdict.raw, parts, &recorded.lessons))
    }

    /// Learns from the tickets that were read since the last frame.
    fn learn(&mut self) {
        let lessons =
            std::mem::take(&mut *self.recorded.lessons.lock().unwrap_or_else(std::sync::PoisonError::into_inner));
        for (number, measured) in lessons {
            let part = if number == 0 { Some(&mut self.kept) } else { self.of_maps.get_mut(number - 1) };
            // Later measurements have made up for what the frame lacked.
            if let Some(part) = part.filter(|part| part.recorded.measured == measured) {
                part.recorded.lacks = true;
            }
        }
    }
}

impl Kept {
    /// Records this part of a frame. Returns it with the number of measurements before it.
    fn encode(
        &mut self,
        (gpu, sources): (&Gpu, &Sources),
        source: &dyn Source,
        image: &Camera,
        recorder: &mut Recorder<'_>,
    ) -> Result<(Part, u64)> {
        let camera = &image.sampled(self.options.samples)?;
        let (size, cuts) = (self.size, self.known.cuts.take());
        self.look_at(gpu, camera);
        if self.size == size {
            // The bands of an earlier view are as good for this one.
            self.known.cuts = cuts;
        } else {
            self.recorded.unlisted = false;
        }
        let mut plan = self.plan(gpu, camera)?;
        if self.recorded.lacks || self.is_unmeasured(&plan) {
            self.frame((gpu, sources), source, (image, None), &())?;
            (self.recorded.lacks, self.recorded.measured) = (false, self.recorded.measured + 1);
            self.recorded.fragments = self.store.as_ref().map_or(0, Store::fragments);
            let again = Plan::of(&self.facts, &gpu.adapter, camera, &self.options, &self.known)?;
            self.recorded.unlisted = again.looks_for_lists[Listed::Large as usize];
            plan = self.plan(gpu, camera)?;
        }
        // Frames that were recorded before and run later choose other cuts.
        self.known.chosen = false;
        if plan.looks_for_cut() || plan.looks_for_lists.contains(&true) {
            return Err(reads_in_its_middle());
        }
        let fragments = self.recorded.fragments;
        self.prepare((gpu, sources), source, (&plan, camera), &())?;
        let (Some(kernels), Some(store)) = (&self.kernels, &mut self.store) else {
            return Err(gpu.error("a frame has no buffers"));
        };
        if plan.needs.surface.lists().is_some() {
            store.make_fragments(gpu, &plan, fragments, fragments)?;
        }
        let view = View::new(&self.facts, camera, &self.options);
        let part = record(
            (gpu, sources),
            (&plan, &view),
            (kernels, store, &mut self.known),
            &mut self.recorded.own,
            recorder,
        )?;
        Ok((part, self.recorded.measured))
    }

    /// Plans a frame that reads no counts in its middle, as far as sizes are known.
    fn plan(&self, gpu: &Gpu, camera: &Camera) -> Result<Plan> {
        let mut known = Cow::Borrowed(&self.known);
        if self.recorded.unlisted && known.entries_of(Listed::Large).is_none() {
            known = Cow::Owned(Known { large: Some(false), ..known.into_owned() });
        }
        Plan::of(&self.facts, &gpu.adapter, camera, &self.options, &known)
    }

    /// Whether `plan` needs sizes that no frame has measured.
    fn is_unmeasured(&self, plan: &Plan) -> bool {
        let lists = plan.needs.surface.lists().is_some();
        plan.looks_for_cut()
            || plan.looks_for_lists.contains(&true)
            || plan.needs.cull && !self.known.slots
            || lists && self.recorded.fragments == 0
            || self.store.as_ref().is_none_or(|store| !store.serves(&plan.needs))
    }
}

/// The error of a backend without a device.
pub(super) fn no_device() -> Error {
    Error::Usage("the f64 reference renders on the processor: frames stay on a device with --backend gpu".into())
}
