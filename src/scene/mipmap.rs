//! Mipmaps: an image at all scales, so that distant surfaces show averages instead of single texels
//! (Williams 1983).

use std::sync::Arc;

use rayon::prelude::*;

use super::Texture;
use super::srgb::{SRGB8_TO_LINEAR, linear_to_srgb};

/// An image and its halvings, down to one texel.
#[derive(Clone, Debug, PartialEq)]
pub struct Mipmap {
    levels: Vec<Arc<Texture>>,
    least_alpha: f32,
}

impl Mipmap {
    /// Computes all halvings of `texture`: each texel is the mean, in linear light weighted by
    /// alpha, of the texels that it covers in the level before.
    pub fn new(texture: Arc<Texture>) -> Self {
        let least_alpha = texture.least_alpha();
        let mut levels = vec![texture];
        while let Some(half) = levels.last().and_then(|last| half(last)) {
            levels.push(Arc::new(half));
        }
        Self { levels, least_alpha }
    }

    /// [`Texture::least_alpha`] of the full image.
    pub fn least_alpha(&self) -> f32 {
        self.least_alpha
    }

    /// The levels, from the full image; each is half as wide and high as the one before.
    pub fn levels(&self) -> &[Arc<Texture>] {
        &self.levels
    }

    /// The filtered colour at texture coordinates `place`: linear RGB premultiplied by alpha, and
    /// alpha.
    ///
    /// `texels` is the area that a pixel covers, in texels of the full image. The result is
    /// interpolated between the levels with the next smaller and larger texels. The twin of
    /// `seen_texture` in `wgsl/accumulate/textures.wgsl`.
    pub fn seen_at(&self, place: [f64; 2], texels: f64) -> [f64; 4] {
        let level = (0.5 * texels.max(1.0).log2()).min((self.levels.len() - 1) as f64);
        let (low, share) = (level.floor() as usize, level - level.floor());
        let near = self.levels[low].premultiplied_at(place);
        match self.levels.get(low + 1) {
            Some(far) if share > 0.0 => {
                let far = far.premultiplied_at(place);
                std::array::from_fn(|k| near[k] + share * (far[k] - near[k]))
            }
            _ => near,
        }
    }
}

/// The image at half its width and height; None for a single texel.
pub(crate) fn half(of: &Texture) -> Option<Texture> {
    let [width, height] = of.size();
    if (width, height) == (1, 1) {
        return None;
    }
    let halved = |side: u32| (side / 2).max(1);
    let (columns, rows) = (halved(width), halved(height));
    // The texels of the longer line that texel k of the shorter one covers, with their shares.
    let covered = |k: u32, long: u32, short: u32| {
        let scale = f64::from(long) / f64::from(short);
        let (start, end) = (f64::from(k) * scale, f64::from(k + 1) * scale);
        (start.floor() as u32..(end.ceil() as u32).min(long)).map(move |texel| {
            let part = (f64::from(texel) + 1.0).min(end) - f64::from(texel).max(start);
            (texel, part / scale)
        })
    };
    let texel = |k: u32| {
        let mut sum = [0.0; 4];
        for (y, down) in covered(k / columns, height, rows) {
            for (x, across) in covered(k % columns, width, columns) {
                let [r, g, b, a] = of.texels()[(y * width + x) as usize];
                let covers = across * down * f64::from(a) / 255.0;
                let light = [r, g, b].map(|code| covers * f64::from(SRGB8_TO_LINEAR[usize::from(code)]));
                sum = [sum[0] + light[0], sum[1] + light[1], sum[2] + light[2], sum[3] + covers];
            }
        }
        let [r, g, b, a] = sum;
        let code = |light: f64| (255.0 * linear_to_srgb(if a > 0.0 { light / a } else { 0.0 })).round() as u8;
        [code(r), code(g), code(b), (255.0 * a).round() as u8]
    };
    let texels = (0..columns * rows).into_par_iter().map(texel).collect();
    Texture::new(columns, rows, texels).map(|half| half.clamped(of.clamps()))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn levels_halve_and_keep_the_mean_light() {
        let texels = (0..12 * 5).map(|k| if (k % 12 + k / 12) % 2 == 0 { [255; 4] } else { [0, 0, 0, 255] });
        let mipmap = Mipmap::new(Arc::new(Texture::new(12, 5, texels.collect()).unwrap()));
        let sizes: Vec<_> = mipmap.levels().iter().map(|level| level.size()).collect();
        assert_eq!(sizes, [[12, 5], [6, 2], [3, 1], [1, 1]]);
        // Half the light, which is not half the codes.
        for texels in [16.0, 64.0, 1e9] {
            let [r, g, b, a] = mipmap.seen_at([0.3, 0.4], texels);
            assert!((r - 0.5).abs() < 0.02 && (b - 0.5).abs() < 0.02 && (a - 1.0).abs() < 1e-12, "{r} {g} {b} {a}");
        }
        assert_eq!(mipmap.seen_at([0.5 / 12.0, 1.0 - 0.5 / 5.0], 0.1), [1.0; 4]);
        // A transparent texel adds no colour.
        let clear = Texture::new(2, 1, vec![[255, 0, 0, 255], [0, 255, 0, 0]]).unwrap();
        let [r, g, _, a] = Mipmap::new(Arc::new(clear)).seen_at([0.0; 2], 4.0);
        assert!((a - 0.5).abs() < 0.01 && (r - a).abs() < 0.01 && g == 0.0, "{r} {g} {a}");
    }
}
