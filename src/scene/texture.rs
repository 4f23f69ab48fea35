//! Textured surfaces: images, and surfels with texture coordinates.

use std::sync::Arc;

use glam::DVec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::srgb::{SRGB8_TO_LINEAR, linear_to_srgb};
use super::{Atlas, Camera, Mipmap, Projection};
use crate::error::{Error, Result};

/// The least alpha at which a point of a cut-out image shows; it is then opaque.
pub const CUT: f32 = 0.5;

/// An image of 8-bit sRGB colours with straight alpha.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    width: u32,
    height: u32,
    /// Rows from the top. Copies of an image share them.
    texels: Arc<Vec<[u8; 4]>>,
    /// Coordinates outside [0, 1] take the edge texels if set; otherwise the image repeats.
    clamps: bool,
}

impl Texture {
    /// An image of `width` x `height` texels, rows from the top. None if `texels` has another
    /// length or is empty.
    pub fn new(width: u32, height: u32, texels: Vec<[u8; 4]>) -> Option<Self> {
        let count = u64::from(width) * u64::from(height);
        let is_whole = count > 0 && count == texels.len() as u64;
        is_whole.then(|| Self { width, height, texels: Arc::new(texels), clamps: false })
    }

    /// The same image with another address mode: outside [0, 1], `true` takes the edge texels and
    /// `false` repeats the image.
    #[must_use]
    pub fn clamped(self, clamps: bool) -> Self {
        Self { clamps, ..self }
    }

    /// Whether coordinates outside [0, 1] take the edge texels instead of repeating the image.
    pub fn clamps(&self) -> bool {
        self.clamps
    }

    /// The image multiplied by a linear colour with straight alpha, rounded to 8-bit codes again.
    #[must_use]
    pub fn times(&self, factor: [f32; 4]) -> Self {
        // One table of 256 codes per colour channel, as texels are 8-bit.
        let table = |k: usize| -> [u8; 256] {
            let light = |code: usize| f64::from(SRGB8_TO_LINEAR[code] * factor[k]);
            std::array::from_fn(|code| (255.0 * linear_to_srgb(light(code).clamp(0.0, 1.0))).round() as u8)
        };
        let [red, green, blue] = [0, 1, 2].map(table);
        let alpha = |code: u8| (f64::from(code) * f64::from(factor[3]).clamp(0.0, 1.0)).round() as u8;
        let times =
            |[r, g, b, a]: &[u8; 4]| [red[usize::from(*r)], green[usize::from(*g)], blue[usize::from(*b)], alpha(*a)];
        Self { texels: Arc::new(self.texels.par_iter().map(times).collect()), ..*self }
    }

    /// Width and height in texels.
    pub fn size(&self) -> [u32; 2] {
        [self.width, self.height]
    }

    /// The least alpha of a point of the image that hides what lies behind it.
    ///
    /// 0 for an opaque image; [`CUT`] for a cut-out, whose alphas are 0 and 1 only; else half a
    /// code, so that only points where nothing is hide nothing.
    pub fn least_alpha(&self) -> f32 {
        let any = |of: fn(u8) -> bool| self.texels.par_iter().any(|[.., alpha]| of(*alpha));
        match (any(|alpha| alpha < 255), any(|alpha| !matches!(alpha, 0 | 255))) {
            (false, _) => 0.0,
            (true, false) => CUT,
            (true, true) => 0.5 / 255.0,
        }
    }

    /// Whether the image has an alpha between 0 and 1.
    pub fn is_translucent(&self) -> bool {
        self.texels.par_iter().any(|[.., alpha]| !matches!(alpha, 0 | 255))
    }

    /// The sRGB codes with straight alpha, rows from the top.
    pub fn texels(&self) -> &[[u8; 4]] {
        &self.texels
    }

    /// The bilinear colour at texture coordinates (u, v), origin bottom left.
    ///
    /// Returns linear RGB premultiplied by alpha, and alpha. Outside [0, 1] the image repeats, or
    /// takes its edge texels if it [clamps](Self::clamped). Coordinates that are not finite count
    /// as 0. The twin of `level_color` in `wgsl/accumulate/textures.wgsl`.
    pub fn premultiplied_at(&self, [u, v]: [f64; 2]) -> [f64; 4] {
        let place = |turns: f64, size: u32| {
            let turns = if turns.is_finite() { turns } else { 0.0 };
            let within = if self.clamps { turns.clamp(0.0, 1.0) } else { turns - turns.floor() };
            let at = within * f64::from(size) - 0.5;
            let low = at.floor();
            let texel = |k: i64| if self.clamps { k.clamp(0, i64::from(size) - 1) } else { k.rem_euclid(size.into()) };
            ([low, low + 1.0].map(|k| texel(k as i64) as usize), at - low)
        };
        let ((columns, right), (rows, down)) = (place(u, self.width), place(1.0 - v, self.height));
        let mut sum = [0.0; 4];
        for (row, weight_y) in rows.into_iter().zip([1.0 - down, down]) {
            for (column, weight_x) in columns.into_iter().zip([1.0 - right, right]) {
                let [r, g, b, a] = self.texels[row * self.width as usize + column];
                let covers = weight_x * weight_y * f64::from(a) / 255.0;
                let light = [r, g, b].map(|code| covers * f64::from(SRGB8_TO_LINEAR[usize::from(code)]));
                sum = [sum[0] + light[0], sum[1] + light[1], sum[2] + light[2], sum[3] + covers];
            }
        }
        sum
    }

    /// The bilinear colour at (u, v): linear RGB with straight alpha.
    pub fn at(&self, u: f32, v: f32) -> [f32; 4] {
        straight(self.premultiplied_at([u, v].map(f64::from)))
    }

    /// The mean colour, straight alpha, over the square of side `2 reach` around (u, v). It takes
    /// about one lookup per texel that the square covers, at most 16 x 16.
    pub fn mean_about(&self, [u, v]: [f64; 2], reach: f64) -> [f32; 4] {
        const MOST: f64 = 16.0;
        let side = (2.0 * reach * f64::from(self.width.max(self.height))).ceil().clamp(1.0, MOST);
        let offset = |k: u32| reach * (2.0 * (f64::from(k) + 0.5) / side - 1.0);
        let count = side as u32;
        let lookups = (0..count * count).map(|k| self.premultiplied_at([u + offset(k % count), v + offset(k / count)]));
        let sum = lookups.fold([0.0; 4], |sum, texel| std::array::from_fn(|k| sum[k] + texel[k]));
        straight(sum.map(|total| total / f64::from(count * count)))
    }
}

/// Converts a premultiplied colour to straight alpha; 0 if alpha is 0.
pub(crate) fn straight([r, g, b, a]: [f64; 4]) -> [f32; 4] {
    if a > 0.0 { [r / a, g / a, b / a, a].map(|c| c as f32) } else { [0.0; 4] }
}

/// The smallest reach that is used, as a fraction of the span of the coordinates. The square of a
/// smaller reach would be lost in the rounding of f32 means.
const LEAST_REACH: f64 = 1.0 / 128.0;

/// The texture coordinates of a surfel, in a texture or in the common plane of several ([`Atlas`]).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Place {
    /// Texture coordinates (u, v) of the centre, origin bottom left.
    pub center: [f32; 2],
    /// The gradients of u and of v along x, y and z, per world unit: the point `p + d` has the
    /// coordinates `center + slopes d`.
    pub slopes: [[f32; 3]; 2],
    /// The largest change of u and of v from the disk's centre to its rim.
    pub extent: [f32; 2],
    /// How much the coordinates of overlapping surfels may differ at a pixel if they belong to one
    /// piece of the texture.
    pub reach: f32,
}

/// Textured surfels. The texture is looked up once per pixel, not once per surfel, so it shows
/// detail that is finer than surfels.
///
/// The lookup is at the weighted mean of the texture coordinates of the pixel's fragments (the TexZ
/// map of paper 002, section 5). A fragment has the coordinates of its point on the disk. The paper
/// takes the coordinates of the disk's centre; their mean stays near them around each centre and
/// changes fast in between.
///
/// Surfels that meet at a pixel may come from different parts of an image: at its seams, where it
/// repeats, and where one surface ends in front of another. They may also come from two images
/// ([`Atlas`]). The mean of their coordinates is then unrelated to either part. Therefore each
/// surfel also has the mean colour of the texture over its disk, and a *reach*. A pixel takes the
/// colour of the texture if the variance of its fragments' coordinates is at most
/// `mean of reach^2`. If the variance is at least twice that, it takes the blend of the mean
/// colours. In between it interpolates linearly. The lookup is filtered to the area that the pixel
/// covers in the texture, averaged over its fragments ([`Mipmap`]).
///
/// **Error.** Let e be the bound of [`crate::passes::accumulate`] on a mean, as a fraction of its
/// range. Coordinates err by e times their span, so a colour errs by this error times the steepest
/// slope of the interpolated texture (the largest difference of neighbouring texels times the
/// texels per unit). The covered area of the texture errs by e: where terms have 24 bits, a pixel
/// that covers less than a few millionths of the texture may be looked up one or two levels too
/// fine. The variance errs by less than `3 e span^2`, so the texture's share of an interpolated
/// pixel errs by `3 e span^2 / mean of reach^2`, which the smallest reach keeps below `5e4 e`.
#[derive(Clone, Debug, PartialEq)]
pub struct Textured {
    mipmaps: Arc<[Mipmap]>,
    atlas: Atlas,
    places: Vec<Place>,
    colors: Vec<[f32; 4]>,
    range: PlaceRange,
}

/// The range of a scene's texture coordinates, which maps them to [0, 1] for the device's sums.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlaceRange {
    /// The middles of the intervals of u and of v.
    pub middle: [f32; 2],
    /// The length of the longer of the two intervals; positive.
    pub span: f32,
    /// The largest squared reach, in units of `span` squared.
    pub most_reach_2: f32,
}

impl PlaceRange {
    fn of(places: &[Place]) -> Self {
        let interval = |k: usize| {
            let ends = places.par_iter().map(|place| {
                let (at, beside) = (place.center[k], place.extent[k]);
                (at - beside, at + beside)
            });
            let (low, high) = ends.reduce(|| (f32::INFINITY, f32::NEG_INFINITY), |a, b| (a.0.min(b.0), a.1.max(b.1)));
            if low <= high { (0.5 * (low + high), high - low) } else { (0.0, 0.0) }
        };
        let [(u, width), (v, height)] = [0, 1].map(interval);
        let span = width.max(height);
        // Widened a little, so that rounded ends stay inside.
        let span = if span > 0.0 { span * (1.0 + 1e-6) } else { 1.0 };
        let largest = f64::from(places.par_iter().map(|place| place.reach).reduce(|| 0.0, f32::max));
        let most_reach_2 = (largest / f64::from(span)).max(LEAST_REACH).powi(2) as f32;
        Self { middle: [u, v], span, most_reach_2 }
    }
}

impl Textured {
    /// Textured surfels from their `places` in the plane of the `atlas` and their mean `colors`
    /// (linear, straight alpha).
    ///
    /// A colour is the mean of the texture over the surfel's disk, or the surfel's own colour if it
    /// has no texture.
    ///
    /// # Errors
    ///
    /// [`Error::Usage`] if the numbers of places and colours differ, or if the textures are none or
    /// not as many as the atlas has.
    pub fn new(textures: Vec<Arc<Texture>>, atlas: Atlas, places: Vec<Place>, colors: Vec<[f32; 4]>) -> Result<Self> {
        if places.len() != colors.len() {
            return Err(Error::Usage("textured surfels need as many places as colours".into()));
        }
        if textures.is_empty() || textures.len() as u64 != u64::from(atlas.textures) {
            return Err(Error::Usage("an atlas needs at least one texture, and as many as it was made for".into()));
        }
        let range = PlaceRange::of(&places);
        Ok(Self { mipmaps: textures.into_par_iter().map(Mipmap::new).collect(), atlas, places, colors, range })
    }

    /// The images with all their mipmap levels, by texture number.
    pub fn mipmaps(&self) -> &[Mipmap] {
        &self.mipmaps
    }

    /// The plane in which the textures lie.
    pub fn atlas(&self) -> Atlas {
        self.atlas
    }

    /// The texture coordinates of each surfel.
    pub fn places(&self) -> &[Place] {
        &self.places
    }

    /// The mean colour of the texture over each surfel's disk: linear, straight alpha.
    pub fn colors(&self) -> &[[f32; 4]] {
        &self.colors
    }

    /// The range of the surfels' coordinates.
    pub fn range(&self) -> PlaceRange {
        self.range
    }

    /// The surfels at `indices`, in that order.
    pub fn taken(&self, indices: &[usize]) -> Self {
        let places: Vec<_> = indices.iter().map(|&index| self.places[index]).collect();
        let colors = indices.iter().map(|&index| self.colors[index]).collect();
        let range = PlaceRange::of(&places);
        Self { mipmaps: Arc::clone(&self.mipmaps), atlas: self.atlas, places, colors, range }
    }

    /// The same surfels with half-axes and reach multiplied by `factor`.
    #[must_use]
    pub fn enlarged(&self, factor: f32) -> Self {
        let enlarged = |place: &Place| {
            let Place { extent, reach, .. } = *place;
            Place { extent: extent.map(|beside| factor * beside), reach: factor * reach, ..*place }
        };
        let places: Vec<_> = self.places.iter().map(enlarged).collect();
        Self { range: PlaceRange::of(&places), places, ..self.clone() }
    }

    /// The quantities of surfel `index` that are summed at the offset `step` (world units) from its
    /// centre.
    ///
    /// They are the coordinates (u, v) relative to the middle of their range, `u^2 + v^2` and the
    /// squared reach, all in units of the range's span; then `part`, the part of the texture that
    /// the pixel covers, unchanged. Fragments outside the disk, which a low-pass filter may draw,
    /// can have coordinates beyond the range; these are clamped to its end.
    pub fn terms(&self, index: usize, step: DVec3, part: f64) -> [f64; 5] {
        let PlaceRange { middle, span, .. } = self.range;
        let Place { center, slopes, reach, .. } = self.places[index];
        let [u, v] = [0, 1].map(|k| {
            let gain = DVec3::from_array(slopes[k].map(f64::from)).dot(step);
            ((f64::from(center[k]) - f64::from(middle[k]) + gain) / f64::from(span)).clamp(-0.5, 0.5)
        });
        let reach = (f64::from(reach) / f64::from(span)).max(LEAST_REACH);
        [u, v, u * u + v * v, reach * reach, part]
    }

    /// The fraction of the whole texture that a pixel covers in the plane of surfel `index`, at
    /// most 1.
    ///
    /// `ray` is the pixel's view ray, scaled to gain a depth of 1; it meets the plane at `depth`,
    /// world units. The twin of `area_in_pixel` in `wgsl/common/perspective.wgsl` and
    /// `wgsl/common/camera_orthographic.wgsl`.
    pub fn part_in_pixel(&self, index: usize, camera: &Camera, ray: DVec3, depth: f64) -> f64 {
        let [u, v] = self.places[index].slopes.map(|slope| DVec3::from_array(slope.map(f64::from)));
        // Its length is the area in the texture per unit of area in the plane.
        let normal = u.cross(v);
        let scale = if camera.projection == Projection::Pinhole { depth * depth } else { 1.0 };
        let facing = normal.dot(ray).abs();
        if facing > 0.0 { (normal.length_squared() / facing * scale / (camera.fx * camera.fy)).min(1.0) } else { 0.0 }
    }

    /// The record of surfel `index` on the device.
    ///
    /// The first row has the centre's coordinates and the squared reach, each mapped to [0, 1]; the
    /// others have the slopes of u and of v, in units of the span. The last entries of the three
    /// rows are x, y and z of `low`, the part of the centre beyond f32.
    pub(crate) fn mapped(&self, index: usize, low: Option<&[f32; 3]>) -> [[f32; 4]; 3] {
        let [u, v, _, reach_2, _] = self.terms(index, DVec3::ZERO, 0.0);
        let slope = |k: usize| self.places[index].slopes[k].map(|gain| f64::from(gain) / f64::from(self.range.span));
        let [[ux, uy, uz], [vx, vy, vz]] = [0, 1].map(slope);
        let [x, y, z] = low.map_or([0.0; 3], |low| low.map(f64::from));
        let center = [u + 0.5, v + 0.5, reach_2 / f64::from(self.range.most_reach_2), x];
        [center, [ux, uy, uz, y], [vx, vy, vz, z]].map(|values| values.map(|value| value as f32))
    }

    /// The position of a pixel in the plane of textures, from the means of [`Self::terms`].
    fn joint_at(&self, [u, v, ..]: [f64; 5]) -> [f64; 2] {
        let PlaceRange { middle, span, .. } = self.range;
        let at = |k: usize, offset: f64| f64::from(middle[k]) + f64::from(span) * offset;
        [at(0, u), at(1, v)]
    }

    /// The texture coordinates of a pixel, from the means of [`Self::terms`].
    pub fn place_at(&self, means: [f64; 5]) -> [f64; 2] {
        self.atlas.own(self.joint_at(means))
    }

    /// The premultiplied colour of a pixel, from the means of [`Self::terms`] and the blended
    /// premultiplied colour.
    ///
    /// It is the texture's where the coordinates agree, and the blended one elsewhere. The twin of
    /// `textured` in `wgsl/accumulate/texture.wgsl`.
    pub fn resolve(&self, means: [f64; 5], blended: [f64; 4]) -> [f64; 4] {
        let [u, v, squared, reach_2, part] = means;
        let share = (2.0 - (squared - u * u - v * v) / reach_2).clamp(0.0, 1.0);
        let place = self.joint_at(means);
        let Some(mipmap) = self.mipmaps.get(self.atlas.number(place) as usize) else { return blended };
        let [width, height] = mipmap.levels()[0].size();
        let texel = mipmap.seen_at(self.atlas.own(place), part * f64::from(width) * f64::from(height));
        std::array::from_fn(|k| blended[k] + share * (texel[k] - blended[k]))
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn texels_lie_where_obj_says_and_repeat() {
        let (red, blue, green, clear) = ([255, 0, 0, 255], [0, 0, 255, 255], [0, 255, 0, 255], [9, 9, 9, 0]);
        let texture = Texture::new(2, 2, vec![red, blue, green, clear]).unwrap();
        // v points up, so the first row is at v = 3/4.
        assert_eq!(texture.at(0.25, 0.75), [1.0, 0.0, 0.0, 1.0]);
        assert_eq!(texture.at(0.75, 0.75), [0.0, 0.0, 1.0, 1.0]);
        assert_eq!(texture.at(0.25, 0.25), [0.0, 1.0, 0.0, 1.0]);
        assert_eq!(texture.at(-1.75, 2.75), [1.0, 0.0, 0.0, 1.0]);
        // Interpolation is linear in light and wraps around the seam; a transparent texel adds no
        // colour.
        assert_eq!(texture.at(0.5, 0.75), [0.5, 0.0, 0.5, 1.0]);
        assert_eq!(texture.at(0.0, 0.75), [0.5, 0.0, 0.5, 1.0]);
        assert_eq!(texture.at(0.5, 0.25), [0.0, 1.0, 0.0, 0.5]);
        assert!(texture.at(f32::NAN, f32::INFINITY).iter().all(|c| c.is_finite()));
        assert!(Texture::new(2, 2, vec![red]).is_none() && Texture::new(0, 2, vec![]).is_none());
        // Clamped: the opposite side does not bleed in at a border, and nothing repeats outside.
        let clamped = texture.clamped(true);
        for (u, v, color) in [(0.0, 0.75, [1.0, 0.0, 0.0, 1.0]), (7.5, 3.0, [0.0, 0.0, 1.0, 1.0])] {
            assert_eq!(clamped.at(u, v), color);
        }
        assert_eq!(clamped.at(0.5, 0.75), [0.5, 0.0, 0.5, 1.0]);
    }
}
