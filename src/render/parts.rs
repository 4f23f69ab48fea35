//! Splits a frame into several renders when its maps need other options than its colour.
//!
//! With several samples per pixel, the colour is the mean of the samples, but maps are taken at the
//! pixel centre: the mean of the depths or normals of two surfaces belongs to neither surface.
//! Where surfaces show through each other, depth, normal and similar maps are those of the nearest
//! surface, as in an opaque picture.

use super::report::Report;
use crate::error::{Error, Result};
use crate::frame::Frame;
use crate::plan::{Facts, Settings, composited};
use crate::scene::{Composite, Map, Maps, Samples};

/// Returns the options of each render of a frame: the colour's first, then those of the maps that
/// the first render does not make.
pub(super) fn parts(facts: &Facts, options: &Settings) -> Vec<Settings> {
    // In an opaque picture the map of surfaces needs a render of its own, because it also draws the
    // back faces that the colour leaves out.
    let surfaces = options.maps.among(Maps::of(&[Map::Surfaces]));
    let without = Settings { maps: options.maps.beside(surfaces), ..options.clone() };
    let opaque = composited(facts, &without) == Composite::Opaque;
    if opaque && !surfaces.is_empty() {
        let mut all = parts(facts, &without);
        all.push(Settings { maps: surfaces, samples: Samples::ONE, ..options.clone() });
        return all;
    }
    let decision = options.maps.among(Maps::of(&[Map::Decision]));
    // The options of a render for maps, at one sample per pixel.
    let with = |maps: Maps| Settings { maps: maps.and_all(decision), samples: Samples::ONE, ..options.clone() };
    let (whole, nearest) = match opaque {
        true => (options.maps, Maps::NONE),
        false => (options.maps.among(Maps::COMPOSITED), options.maps.beside(Maps::COMPOSITED).beside(decision)),
    };
    let mut parts = Vec::new();
    if options.samples == Samples::ONE {
        parts.push(with(whole));
    } else {
        parts.push(Settings { maps: decision, ..options.clone() });
        parts.extend((!whole.is_empty()).then(|| with(whole)));
    }
    parts.extend((!nearest.is_empty()).then(|| Settings { composite: Composite::Opaque, ..with(nearest) }));
    parts
}

/// Checks that the sums of a render can be read back: one sample per pixel, no levels of detail.
///
/// # Errors
/// [`Error::Usage`] otherwise.
pub(super) fn one_alone(options: &Settings) -> Result<()> {
    if !options.detail.is_finest() {
        return Err(Error::Usage("sums can be read back only without levels of detail: leave them out".into()));
    }
    if options.samples == Samples::ONE {
        return Ok(());
    }
    Err(Error::Usage("sums can be read back only at one sample per pixel: give the camera a pixel per sample".into()))
}

/// Joins the colours of one render with the maps of others, and adds up their times.
pub(super) fn joined(of_colors: (Frame, Report), others: Vec<(Frame, Report)>) -> (Frame, Report) {
    let (mut frame, mut report) = of_colors;
    for (maps, of_maps) in others {
        for (pass, ms) in of_maps.passes {
            *report.passes.entry(pass).or_default() += ms;
        }
        report.total_ms += of_maps.total_ms;
        report.compile_ms += of_maps.compile_ms;
        report.traffic = report.traffic + of_maps.traffic;
        report.overflows = report.overflows.max(of_maps.overflows);
        let needs = of_maps.needs.into_iter().filter(|need| !report.needs.contains(need)).collect::<Vec<_>>();
        report.needs.extend(needs);
        for map in maps.maps().iter() {
            let Some(values) = maps.map(map) else { continue };
            match frame.map_mut(map) {
                // The distance to a decision is the least over all renders that contribute to the
                // pixel.
                Some(decisions) => {
                    decisions.iter_mut().zip(values).for_each(|(least, other)| *least = least.min(*other))
                }
                None => frame = frame.with(map, values.to_vec()),
            }
        }
    }
    (frame, report)
}
