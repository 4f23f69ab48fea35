//! Several samples a pixel: its colour is their mean, and its maps are of its centre, however many there are. A mean of depths, or
//! of normals, of two surfaces would be of neither.

use super::report::Report;
use crate::error::{Error, Result};
use crate::frame::Frame;
use crate::plan::RenderOptions;
use crate::scene::{Map, Maps, Samples};

/// The options of the two renders that one with `options` takes: of colours, unless `options` serve, and of maps, if there are any
/// beside several samples.
pub(super) fn apart(options: &RenderOptions) -> [Option<RenderOptions>; 2] {
    if options.samples == Samples::ONE || options.maps.is_empty() {
        return [None, None];
    }
    let maps = if options.maps.has(Map::Decision) { Maps::of(&[Map::Decision]) } else { Maps::NONE };
    let colors = RenderOptions { maps, ..options.clone() };
    let centers = RenderOptions { samples: Samples::ONE, ..options.clone() };
    [Some(colors), Some(centers)]
}

/// Fails for several samples, where what a pixel sums is read back.
///
/// # Errors
/// [`Error::Usage`].
pub(super) fn one_alone(options: &RenderOptions) -> Result<()> {
    if options.samples == Samples::ONE {
        return Ok(());
    }
    Err(Error::Usage("sums are read back of pixels with one sample: take a camera whose pixels are the samples".into()))
}

/// The colours of one render with the maps of another, and what both took.
pub(super) fn joined((colors, of_colors): (Frame, Report), (centers, of_centers): (Frame, Report)) -> (Frame, Report) {
    let mut report = of_colors;
    for (pass, ms) in of_centers.passes {
        *report.passes.entry(pass).or_default() += ms;
    }
    report.total_ms += of_centers.total_ms;
    report.overflows = report.overflows.max(of_centers.overflows);
    let needs = of_centers.needs.into_iter().filter(|need| !report.needs.contains(need)).collect::<Vec<_>>();
    report.needs.extend(needs);
    let mut frame = centers;
    // Of the colour's samples and of the centre.
    if let (Some(decisions), Some(of_samples)) = (frame.map_mut(Map::Decision), colors.map(Map::Decision)) {
        decisions.iter_mut().zip(of_samples).for_each(|(least, other)| *least = least.min(*other));
    }
    frame.color = colors.color;
    (frame, report)
}
