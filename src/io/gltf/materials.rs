//! The materials of a glTF file: base colours and their images.

use std::borrow::Cow;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use ::gltf::json::image::Image;
use ::gltf::json::material::{AlphaMode, Material};
use ::gltf::json::texture::{Info, Sampler, WrappingMode};
use ::gltf::json::validation::Checked;
use ::gltf::json::{Index, extensions::texture::TextureTransform};
use glam::DVec2;

use super::buffers::{Buffers, data_of, file_of};
use super::document::{Document, malformed};
use crate::io::beside::Beside;
use crate::io::fault::Fault;
use crate::io::image::{self, MOST_PIXELS};
use crate::io::textures::Numbers;
use crate::io::values::{one_line, shown};
use crate::io::{Texture, values::finite};

/// The alpha of a material.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Alpha {
    /// Alphas are ignored.
    Opaque,
    /// An alpha of at least this becomes 1, a smaller one 0.
    Mask(f32),
    Blend,
}

impl Alpha {
    pub(super) fn of(self, alpha: f32) -> f32 {
        match self {
            Self::Opaque => 1.0,
            Self::Mask(cutoff) => f32::from(alpha >= cutoff),
            Self::Blend => alpha.clamp(0.0, 1.0),
        }
    }
}

/// A material as a primitive uses it.
pub(super) struct Look {
    /// The base colour: linear RGB with straight alpha, before [`Self::alpha`] applies.
    pub(super) factor: [f32; 4],
    pub(super) alpha: Alpha,
    pub(super) map: Option<Map>,
}

/// The image of a base colour, and how texture coordinates map to positions in it.
#[derive(Clone, Copy)]
pub(super) struct Map {
    image: usize,
    /// The number of the set of texture coordinates.
    pub(super) set: u32,
    wraps: [WrappingMode; 2],
    scale: DVec2,
    rotation: f64,
    offset: DVec2,
}

impl Map {
    /// Maps texture coordinates of the file, whose origin is top left, to ours.
    ///
    /// The rotation is counter-clockwise in the image. The GLSL of `KHR_texture_transform` has it
    /// the other way round, but its text, its example and its implementations agree on this one.
    pub(super) fn place(&self, of: [f64; 2]) -> [f32; 2] {
        let scaled = DVec2::from(of) * self.scale;
        let (sine, cosine) = self.rotation.sin_cos();
        let turned = DVec2::new(cosine * scaled.x + sine * scaled.y, cosine * scaled.y - sine * scaled.x);
        let [u, v] = (turned + self.offset).to_array();
        [u as f32, (1.0 - v) as f32]
    }

    /// Whether positions outside [0, 1] take the edge texels, for positions that lie `inside` along
    /// each axis or not. None if the image would have to be mirrored, or be repeated along one axis
    /// and not along the other.
    pub(super) fn clamps(&self, inside: [bool; 2]) -> Option<bool> {
        let [s, t] = [0, 1].map(|axis| match self.wraps[axis] {
            WrappingMode::ClampToEdge => Some(true),
            WrappingMode::Repeat => Some(false),
            // At the edges of the image, mirroring is clamping.
            WrappingMode::MirroredRepeat => inside[axis].then_some(true),
        });
        match (s?, t?) {
            (s, t) if s == t => Some(s),
            (s, _) if inside[1] => Some(s),
            (_, t) if inside[0] => Some(t),
            _ => None,
        }
    }
}

/// The materials of a file while it is being read.
pub(super) struct Materials<'a> {
    document: &'a Document,
    buffers: &'a Buffers<'a>,
    path: &'a Path,
    beside: Beside,
    ignore_alpha: bool,
    /// Decoded images, by their place.
    decoded: HashMap<Source, Option<Arc<Texture>>>,
    /// Images as materials show them, by the index of the image, whether it clamps, and the fate of
    /// its alphas.
    shown: HashMap<(usize, bool, Cut), Option<Arc<Texture>>>,
    pixels: u64,
    /// The number of images that were tried and left out.
    failed: usize,
    pub(super) numbers: Numbers,
    notes: Vec<String>,
    /// The number of notes that are not told.
    more: u64,
}

/// The most notes about materials.
const MOST_NOTES: usize = 16;

/// The most images that are tried and left out: a damaged file may name any number of images that
/// take long to decode before they fail.
const MOST_FAILED: usize = 256;

/// The place of an image, and its bytes if it is no file.
type Placed<'a> = (Source, Option<Cow<'a, [u8]>>);

#[derive(Clone, Debug, PartialEq, Eq, Hash)]
enum Source {
    File(PathBuf),
    /// Bytes of a buffer: their address, and their number.
    Inside(usize, usize),
    /// The data URI of an image.
    Data(usize),
}

/// How the alphas of an image are changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Cut {
    /// Alphas are kept.
    None,
    /// Codes of at least this become 255, smaller ones 0.
    Below(u16),
}

impl<'a> Materials<'a> {
    pub(super) fn of(document: &'a Document, buffers: &'a Buffers<'a>, path: &'a Path, ignore_alpha: bool) -> Self {
        Self {
            document,
            buffers,
            path,
            beside: Beside::of(path),
            ignore_alpha,
            decoded: HashMap::new(),
            shown: HashMap::new(),
            pixels: 0,
            failed: 0,
            numbers: Numbers::default(),
            notes: Vec::new(),
            more: 0,
        }
    }

    /// The look of a primitive of this material; white without one.
    pub(super) fn look(&mut self, material: Option<Index<Material>>) -> Result<Look, Fault> {
        let Some(index) = material else { return Ok(Look { factor: [1.0; 4], alpha: Alpha::Opaque, map: None }) };
        let number = index.value();
        let found = self.document.root.materials.get(number);
        let found = found.ok_or_else(|| malformed(format!("it names the material {number}, which does not exist")))?;
        let extensions = found.extensions.as_ref();
        let (factor, texture) = match extensions.and_then(|of| of.pbr_specular_glossiness.as_ref()) {
            Some(of) => (of.diffuse_factor.0, of.diffuse_texture.as_ref()),
            None => {
                let of = &found.pbr_metallic_roughness;
                (of.base_color_factor.0, of.base_color_texture.as_ref())
            }
        };
        let alpha = match found.alpha_mode {
            Checked::Valid(AlphaMode::Blend) if !self.ignore_alpha => Alpha::Blend,
            Checked::Valid(AlphaMode::Mask) if !self.ignore_alpha => {
                Alpha::Mask(found.alpha_cutoff.map_or(0.5, |cutoff| cutoff.0))
            }
            _ => Alpha::Opaque,
        };
        let factor = factor.map(|channel| finite(channel.into()));
        let map = texture.map(|texture| self.map(texture)).transpose()?.flatten();
        Ok(Look { factor, alpha, map })
    }

    /// The image of a texture; None with a note if it has none that can be read.
    fn map(&mut self, info: &Info) -> Result<Option<Map>, Fault> {
        let root = &self.document.root;
        let number = info.index.value();
        let texture = root.textures.get(number);
        let texture =
            texture.ok_or_else(|| malformed(format!("it names the texture {number}, which does not exist")))?;
        let image = texture.source.value();
        // The crate's mark for a texture without an image of the formats that all programs read.
        if image == u32::MAX as usize {
            let names = texture.extensions.iter().flat_map(|extensions| extensions.others.keys());
            let names: Vec<_> = names.map(|name| shown(name.as_bytes())).collect();
            let why = if names.is_empty() { "no image".into() } else { format!("only one by {}", names.join(" and ")) };
            self.note(format!("a texture is left out: it has {why}, which is not read"));
            return Ok(None);
        }
        if image >= root.images.len() {
            return Err(malformed(format!("it names the image {image}, which does not exist")));
        }
        let sampler =
            match texture.sampler {
                Some(index) => root.samplers.get(index.value()).cloned().ok_or_else(|| {
                    malformed(format!("it names the sampler {}, which does not exist", index.value()))
                })?,
                None => Sampler::default(),
            };
        let wrap = |wrap: Checked<WrappingMode>| match wrap {
            Checked::Valid(wrap) => wrap,
            Checked::Invalid => WrappingMode::Repeat,
        };
        let moved = info.extensions.as_ref().and_then(|extensions| extensions.texture_transform.clone());
        let moved: TextureTransform = moved.unwrap_or_default();
        let two = |[x, y]: [f32; 2]| DVec2::new(x.into(), y.into());
        Ok(Some(Map {
            image,
            set: moved.tex_coord.unwrap_or(info.tex_coord),
            wraps: [wrap(sampler.wrap_s), wrap(sampler.wrap_t)],
            scale: two(moved.scale.0),
            rotation: moved.rotation.0.into(),
            offset: two(moved.offset.0),
        }))
    }

    /// Adds a note unless it is there.
    pub(super) fn note(&mut self, note: String) {
        if self.notes.contains(&note) {
            return;
        }
        match self.notes.len() < MOST_NOTES {
            true => self.notes.push(note),
            false => self.more += 1,
        }
    }

    /// Takes the notes.
    pub(super) fn notes(&mut self) -> Vec<String> {
        let more = (self.more > 0).then(|| format!("and {} more notes about its materials", self.more));
        std::mem::take(&mut self.notes).into_iter().chain(more).collect()
    }

    /// The number of an image, whose alphas are multiplied by `factor` and cut as `alpha` says;
    /// None with a note if it cannot be read.
    pub(super) fn number(&mut self, map: &Map, clamps: bool, (alpha, factor): (Alpha, f32)) -> Option<u32> {
        let cut = match alpha {
            Alpha::Opaque => Cut::Below(0),
            Alpha::Mask(cutoff) => {
                let is_kept = |code: &u16| f32::from(*code) / 255.0 * factor >= cutoff;
                Cut::Below((0..256).find(is_kept).unwrap_or(256))
            }
            Alpha::Blend => Cut::None,
        };
        let key = (map.image, clamps, cut);
        if !self.shown.contains_key(&key) {
            let made = self.decoded(map.image).and_then(|image| self.made(&image, clamps, cut));
            self.shown.insert(key, made);
        }
        self.shown.get(&key).cloned().flatten().map(|texture| self.numbers.of(&texture))
    }

    /// The image with its alphas cut; None with a note if all images become too large.
    fn made(&mut self, image: &Arc<Texture>, clamps: bool, cut: Cut) -> Option<Arc<Texture>> {
        let alpha = |code: u8| match cut {
            Cut::None => code,
            Cut::Below(least) => 255 * u8::from(u16::from(code) >= least),
        };
        if image.texels().iter().all(|texel| texel[3] == alpha(texel[3])) {
            return Some(Arc::new(Texture::clone(image).clamped(clamps)));
        }
        let [width, height] = image.size();
        self.count([width, height]).then_some(())?;
        let texels = image.texels().iter().map(|[r, g, b, a]| [*r, *g, *b, alpha(*a)]).collect();
        Texture::new(width, height, texels).map(|texture| Arc::new(texture.clamped(clamps)))
    }

    /// Counts pixels of an image; false with a note if there are too many.
    fn count(&mut self, [width, height]: [u32; 2]) -> bool {
        let all = self.pixels.saturating_add(u64::from(width) * u64::from(height));
        if all > MOST_PIXELS {
            self.note(format!("images are left out: all have more pixels than the limit of {MOST_PIXELS}"));
            return false;
        }
        self.pixels = all;
        true
    }

    /// The image with this index as its file has it.
    fn decoded(&mut self, number: usize) -> Option<Arc<Texture>> {
        let document = self.document;
        let image = document.root.images.get(number)?;
        if self.failed >= MOST_FAILED {
            self.note(format!("further images are left out, as {MOST_FAILED} could not be read"));
            return None;
        }
        let (source, bytes) = match self.bytes(number, image) {
            Ok(found) => found,
            Err(why) => {
                self.failed += 1;
                self.note(format!("a texture is left out: its image {number} cannot be read: {why}"));
                return None;
            }
        };
        if let Some(known) = self.decoded.get(&source) {
            return known.clone();
        }
        let path = match &source {
            Source::File(path) => path,
            Source::Inside(..) | Source::Data(_) => self.path,
        };
        let bytes = match bytes {
            Some(bytes) => Ok(bytes),
            None => image::bytes(path).map(Cow::from),
        };
        let texture = bytes.and_then(|bytes| {
            // An image beyond the limit is not decoded.
            let size = image::size_of_bytes(path, &bytes)?;
            if self.count(size) { Texture::decoded(path, &bytes).map(Some) } else { Ok(None) }
        });
        let texture = texture.unwrap_or_else(|error| {
            self.failed += 1;
            self.note(format!("a texture is left out: {}", one_line(&error.to_string())));
            None
        });
        let texture = texture.map(Arc::new);
        self.decoded.insert(source, texture.clone());
        texture
    }

    /// The place of an image, and its bytes if it is no file.
    fn bytes(&mut self, number: usize, image: &Image) -> Result<Placed<'a>, String> {
        if let Some(view) = image.buffer_view {
            return match self.buffers.view(view) {
                Ok((bytes, _)) => Ok((Source::Inside(bytes.as_ptr() as usize, bytes.len()), Some(bytes.into()))),
                Err(Fault::Malformed(why)) => Err(why),
                Err(_) => Err("its bytes are missing".into()),
            };
        }
        let uri = image.uri.as_ref().ok_or_else(|| "it has no place".to_owned())?;
        match data_of(uri) {
            Some(data) => Ok((Source::Data(number), Some(data?.into()))),
            None => Ok((Source::File(file_of(uri, &mut self.beside)?), None)),
        }
    }
}
