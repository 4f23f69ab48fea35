//! Combinations of options, or of a scene and options, that are rejected: one row each, with a
//! sentence that says what to do instead. The command line, studies and the library share these
//! rows.

mod adapter;
mod parts;
mod table;

pub use self::adapter::{on_adapter, sums};
pub use self::parts::{files_of_parts, options_of_parts, options_of_ranks};
use self::table::{FADES, LENSES, OPTIONS, SCENES, TEXTURES, TILES};
use super::tuning::MOST_LARGE;
use super::{Facts, Settings, composited};
use crate::error::{Error, Result};
use crate::scene::light::MAX_LIGHTS;
use crate::scene::{Blend, Camera, Form, Map, Samples, Shading, options::SHININESS_RANGE};

/// A combination of options that is rejected for every scene.
struct Clash {
    /// Whether a picture has this combination. The second argument is false if the f64 reference
    /// renders, which ignores options that only devices use.
    applies: fn(&Settings, bool) -> bool,
    /// The fault and its remedy.
    sentence: &'static str,
}

/// A combination of a lens that is no pinhole, a scene and options that is rejected.
struct LensClash {
    /// As in [`SceneClash`], for a lens of this form.
    applies: fn(Form, &Facts, &Settings, bool) -> bool,
    /// The fault and its remedy.
    sentence: &'static str,
}

/// A combination of a scene and options that is rejected.
struct SceneClash {
    /// As in [`Clash`], for a scene with these facts.
    applies: fn(&Facts, &Settings, bool) -> bool,
    /// The fault and its remedy.
    sentence: &'static str,
}

fn usage<T>(what: impl Into<String>) -> Result<T> {
    Err(Error::Usage(what.into()))
}

/// Fails with the sentence of the first row that applies.
fn first(clashes: &[Clash], options: &Settings, device: bool) -> Result<()> {
    let found = clashes.iter().find(|clash| (clash.applies)(options, device));
    found.map_or(Ok(()), |clash| usage(clash.sentence))
}

/// Rejects combinations of options that no adapter can render. If the `reference` renders, options
/// that only devices use are ignored.
///
/// # Errors
/// [`Error::Usage`].
pub fn options(options: &Settings, reference: bool) -> Result<()> {
    in_range(options)?;
    first(&OPTIONS, options, !reference)?;
    if options.detail_fades && !options.detail.is_finest() {
        fades(options)?;
    }
    maps(options, reference)
}

/// The most rows or columns of samples in a pixel.
const MOST_SAMPLES: u32 = 16;

/// Rejects numbers outside their ranges.
fn in_range(options: &Settings) -> Result<()> {
    let (least, most) = SHININESS_RANGE;
    if options.lights.len() > MAX_LIGHTS {
        return usage(format!("a picture has at most {MAX_LIGHTS} lights, not {}", options.lights.len()));
    }
    if options.shading == Shading::Phong && !(least..=most).contains(&options.shininess) {
        return usage(format!("the shininess is {least} to {most}, not {}", options.shininess));
    }
    if let Some(large) = options.large.filter(|large| *large > MOST_LARGE) {
        return usage(format!("a splat is large above 0 to {MOST_LARGE} pixels, not {large}"));
    }
    let Samples { across, down } = options.samples;
    if ![across, down].iter().all(|samples| (1..=MOST_SAMPLES).contains(samples)) {
        return usage(format!("a pixel has 1 to {MOST_SAMPLES} samples across and down, not {across} and {down}"));
    }
    if !(0.0..=1.0).contains(&options.opacity) {
        return usage(format!("the opacity is 0 to 1, not {}", options.opacity));
    }
    Ok(())
}

/// Rejects maps that the renderer does not make.
fn maps(options: &Settings, reference: bool) -> Result<()> {
    // The reference's only fragment has weight 1 and count 1.
    let unknown = if reference { &[Map::Normal][..] } else { &[Map::Normal, Map::Weight, Map::Count, Map::Index] };
    for row in options.maps.iter().map(Map::row) {
        if options.blend == Blend::Nearest && unknown.contains(&row.map) {
            return usage(format!("--blend nearest keeps colour and depth: leave the {} map out", row.name));
        }
        if let Some(from) = row.from {
            let from = from.row().name;
            return usage(format!("the {} map is made from the {from} of a frame: ask for {from}", row.name));
        }
        if !reference && row.image_word.is_none() {
            return usage(format!("only the reference backend makes the {} map: take --backend reference", row.name));
        }
        if !reference && options.raster.is_some() && !row.raster {
            return usage(format!("the rasteriser makes no {} map: leave it out, or take --backend gpu", row.name));
        }
    }
    Ok(())
}

/// Rejects options that tiles cannot draw if the organisation `tile` is chosen. A study must
/// measure the organisation that it names, so there is no fallback.
///
/// # Errors
/// [`Error::Usage`].
pub fn by_tiles(options: &Settings) -> Result<()> {
    first(&TILES, options, true)
}

/// Rejects options with which cuts cannot fade into each other. Fades need weighted sums of the
/// nearest surface.
///
/// # Errors
/// [`Error::Usage`].
pub fn fades(options: &Settings) -> Result<()> {
    first(&FADES, options, true)
}

/// Rejects options that cannot be combined with a texture. If the `reference` renders, options that
/// only devices use are ignored.
///
/// # Errors
/// [`Error::Usage`].
pub fn textured(options: &Settings, reference: bool) -> Result<()> {
    first(&TEXTURES, options, !reference)
}

/// Rejects what a camera whose lens is no pinhole does not show.
///
/// # Errors
/// [`Error::Usage`].
pub fn lens(facts: &Facts, camera: &Camera, options: &Settings, reference: bool) -> Result<()> {
    let Some(optics) = &camera.optics else { return Ok(()) };
    let found = LENSES.iter().find(|clash| (clash.applies)(optics.form, facts, options, !reference));
    found.map_or(Ok(()), |clash| usage(clash.sentence))
}

/// Rejects options that cannot be used with the scene that `facts` describe.
///
/// # Errors
/// [`Error::Usage`].
pub fn scene(facts: &Facts, options: &Settings, reference: bool) -> Result<()> {
    if u32::try_from(facts.surfels).is_err() {
        return usage(format!("a scene has at most 2^32 - 1 surfels, not {}", facts.surfels));
    }
    if let Some(clash) = SCENES.iter().find(|clash| (clash.applies)(facts, options, !reference)) {
        return usage(clash.sentence);
    }
    if facts.fades && facts.nodes_of(options).is_none() {
        fades(options)?;
    }
    match facts.texture {
        // Opaque surfaces are drawn as if nothing was composited.
        Some(_) => textured(&Settings { composite: composited(facts, options), ..options.clone() }, reference),
        None => Ok(()),
    }
}
