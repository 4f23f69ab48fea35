//! Renders scenes whose colours are sRGB codes, as those of Gaussians are
//! ([`gaussian`](crate::scene::gaussian)). The codes are composited over the code of the
//! background, and the finished frame is decoded to linear light, as all frames are.

use rayon::prelude::*;

use crate::frame::Frame;
use crate::plan::{Facts, Settings};
use crate::scene::color::{linear_to_srgb, srgb_to_linear};

/// Returns `options` with the background as an sRGB code if the scene's colours are codes.
pub(super) fn of(facts: &Facts, options: &Settings) -> Settings {
    let mut options = options.clone();
    if facts.encoded {
        let [r, g, b, a] = options.background;
        let [r, g, b] = [r, g, b].map(|light| linear_to_srgb(light.into()) as f32);
        options.background = [r, g, b, a];
    }
    options
}

/// Decodes the colours of a frame from sRGB codes to linear light; alpha stays.
pub(super) fn decode(frame: &mut Frame) {
    frame.color.par_iter_mut().with_min_len(1 << 12).for_each(|color| {
        let [r, g, b, a] = *color;
        let [r, g, b] = [r, g, b].map(|code| srgb_to_linear(code.into()) as f32);
        *color = [r, g, b, a];
    });
}
