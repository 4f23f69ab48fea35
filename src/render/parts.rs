//! A picture whose maps are made in another way than its colour takes a render for each way. Of several samples a pixel the colour is the
//! mean, and maps are of the centre, however many there are: a mean of depths, or of normals, of two surfaces would be of neither. And
//! where surfaces show through each other depth, normal and the like are still those of the nearest one, as of an opaque picture.

use super::report::Report;
use crate::error::{Error, Result};
use crate::frame::Frame;
use crate::plan::{Facts, RenderOptions, composited};
use crate::scene::{Composite, Map, Maps, Samples};

/// The options of the renders that one with `options` takes: first that of its colour, then those of maps that it does not make too.
pub(super) fn parts(facts: &Facts, options: &RenderOptions) -> Vec<RenderOptions> {
    // A map of the surfaces of what is opaque is made apart, as backs are drawn for it that the colour leaves out.
    let surfaces = options.maps.among(Maps::of(&[Map::Surfaces]));
    let without = RenderOptions { maps: options.maps.beside(surfaces), ..options.clone() };
    let opaque = composited(facts, &without) == Composite::Opaque;
    if opaque && !surfaces.is_empty() {
        let mut all = parts(facts, &without);
        all.push(RenderOptions { maps: surfaces, samples: Samples::ONE, ..options.clone() });
        return all;
    }
    let decision = options.maps.among(Maps::of(&[Map::Decision]));
    // What a render for maps makes.
    let with = |maps: Maps| RenderOptions { maps: maps.and_all(decision), samples: Samples::ONE, ..options.clone() };
    let (whole, nearest) = match opaque {
        true => (options.maps, Maps::NONE),
        false => (options.maps.among(Maps::COMPOSITED), options.maps.beside(Maps::COMPOSITED).beside(decision)),
    };
    let mut parts = Vec::new();
    if options.samples == Samples::ONE {
        parts.push(with(whole));
    } else {
        parts.push(RenderOptions { maps: decision, ..options.clone() });
        parts.extend((!whole.is_empty()).then(|| with(whole)));
    }
    parts.extend((!nearest.is_empty()).then(|| RenderOptions { composite: Composite::Opaque, ..with(nearest) }));
    parts
}

/// Fails for several samples, and for levels of detail, where what a pixel sums of all surfels is read back.
///
/// # Errors
/// [`Error::Usage`].
pub(super) fn one_alone(options: &RenderOptions) -> Result<()> {
    if !options.detail.is_finest() {
        return Err(Error::Usage("sums are read back of all surfels: leave levels of detail out".into()));
    }
    if options.samples == Samples::ONE {
        return Ok(());
    }
    Err(Error::Usage("sums are read back of pixels with one sample: take a camera whose pixels are the samples".into()))
}

/// The colours of one render with the maps of others, and what all of them took.
pub(super) fn joined(of_colors: (Frame, Report), others: Vec<(Frame, Report)>) -> (Frame, Report) {
    let (mut frame, mut report) = of_colors;
    for (maps, of_maps) in others {
        for (pass, ms) in of_maps.passes {
            *report.passes.entry(pass).or_default() += ms;
        }
        report.total_ms += of_maps.total_ms;
        report.overflows = report.overflows.max(of_maps.overflows);
        let needs = of_maps.needs.into_iter().filter(|need| !report.needs.contains(need)).collect::<Vec<_>>();
        report.needs.extend(needs);
        for map in maps.maps().iter() {
            let Some(values) = maps.map(map) else { continue };
            match frame.map_mut(map) {
                // A pixel is as near to a decision as the nearest of what it is made of.
                Some(decisions) => {
                    decisions.iter_mut().zip(values).for_each(|(least, other)| *least = least.min(*other))
                }
                None => frame = frame.with(map, values.to_vec()),
            }
        }
    }
    (frame, report)
}
