//! Images that surfaces are painted with, and surfels that know their places in them.

use std::sync::Arc;

use glam::DVec3;
use rayon::prelude::*;

use super::srgb::{SRGB8_TO_LINEAR, linear_to_srgb};
use super::{Atlas, Camera, Mipmap, Projection};
use crate::error::{Error, Result};

/// An image of 8-bit sRGB colours with straight alpha.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    width: u32,
    height: u32,
    /// Rows from the top.
    texels: Vec<[u8; 4]>,
    /// Beyond [0, 1] its edges go on; else it is repeated.
    clamps: bool,
}

impl Texture {
    /// An image of `width` x `height` texels, rows from the top; None if there are not as many, or none.
    pub fn new(width: u32, height: u32, texels: Vec<[u8; 4]>) -> Option<Self> {
        let count = u64::from(width) * u64::from(height);
        (count > 0 && count == texels.len() as u64).then_some(Self { width, height, texels, clamps: false })
    }

    /// The same image, whose edges go on beyond [0, 1] if it `clamps`, and which else is repeated
    /// there.
    #[must_use]
    pub fn clamped(self, clamps: bool) -> Self {
        Self { clamps, ..self }
    }

    /// Whether its edges go on beyond [0, 1].
    pub fn clamps(&self) -> bool {
        self.clamps
    }

    /// The image times a linear colour with straight alpha, in codes of 8 bits.
    #[must_use]
    pub fn times(&self, factor: [f32; 4]) -> Self {
        // Three tables of codes, as a texel has no more.
        let table = |k: usize| -> [u8; 256] {
            let light = |code: usize| f64::from(SRGB8_TO_LINEAR[code] * factor[k]);
            std::array::from_fn(|code| (255.0 * linear_to_srgb(light(code).clamp(0.0, 1.0))).round() as u8)
        };
        let [red, green, blue] = [0, 1, 2].map(table);
        let alpha = |code: u8| (f64::from(code) * f64::from(factor[3]).clamp(0.0, 1.0)).round() as u8;
        let times =
            |[r, g, b, a]: &[u8; 4]| [red[usize::from(*r)], green[usize::from(*g)], blue[usize::from(*b)], alpha(*a)];
        Self { texels: self.texels.par_iter().map(times).collect(), ..*self }
    }

    /// Width and height, texels.
    pub fn size(&self) -> [u32; 2] {
        [self.width, self.height]
    }

    /// The codes, rows from the top.
    pub fn texels(&self) -> &[[u8; 4]] {
        &self.texels
    }

    /// The colour at texture coordinates (u, v), origin bottom left: linear RGB premultiplied by
    /// alpha, and alpha. Between the middles of texels it is interpolated; beyond [0, 1] the image
    /// is repeated, or its edges go on where it [clamps](Self::clamped). The twin of `level_color`
    /// in `wgsl/textures.wgsl`.
    pub fn premultiplied_at(&self, [u, v]: [f64; 2]) -> [f64; 4] {
        // What is not a number has no place; that of 0 serves.
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

    /// The colour at a place, with straight alpha.
    pub fn at(&self, u: f32, v: f32) -> [f32; 4] {
        straight(self.premultiplied_at([u, v].map(f64::from)))
    }

    /// The mean over a square of half the side `reach` about (u, v), straight alpha, from as many lookups as it has texels, but
    /// not more than 16 x 16.
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

/// A premultiplied colour with straight alpha.
pub(crate) fn straight([r, g, b, a]: [f64; 4]) -> [f32; 4] {
    if a > 0.0 { [r / a, g / a, b / a, a].map(|c| c as f32) } else { [0.0; 4] }
}

/// The least reach that counts, of the coordinates' range: a variance below its square would be lost to the rounding of f32
/// means.
const LEAST_REACH: f64 = 1.0 / 128.0;

/// Where a surfel lies in a texture, or in the plane of several ([`Atlas`]).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Place {
    /// Texture coordinates (u, v) of its centre, origin bottom left.
    pub center: [f32; 2],
    /// What u and v gain for a world unit along x, y and z: the surface has the coordinates `center + slopes d` at `p + d`.
    pub slopes: [[f32; 3]; 2],
    /// How far they change from the centre to the rim of the disk, at most.
    pub extent: [f32; 2],
    /// How far those of surfels that overlap may be apart where they meet.
    pub reach: f32,
}

/// Surfels that are painted by textures: one is looked up once a pixel, at the mean coordinates of the fragments that are blended
/// there (the TexZ map of paper 002, section 5), so it shows what is finer than surfels.
///
/// A fragment has the coordinates of its point of the disk. With those of the centre, as the paper has them, the mean
/// stays near them around each centre and changes fast in between.
///
/// Coordinates of surfels that meet at a pixel may come from different parts of the image: at its seams, where it is
/// repeated, and where one surface ends in front of another; and from two images ([`Atlas`]). Their mean is then a place that has nothing to do with
/// either. So each surfel also has the texture's mean over its disk, and its *reach*. Where the coordinates of a pixel's
/// fragments vary by no more than `mean of reach^2`, the pixel has the texture's colour; where by more than twice that, the
/// blended means; in between there is a linear passage. The texture is looked up as a pixel sees it that covers so much of it
/// ([`Mipmap`]), the mean over its fragments, so that what is seen from afar is averaged.
///
/// **Error.** Let e be the bound of [`crate::passes::accumulate`] on a mean, as a fraction of its range. Coordinates err by e times
/// their span, so a colour by that times the steepest slope of the interpolated texture (the largest difference of
/// neighbouring texels times their number for each unit); the part of the texture by e, so where terms have 24 bits a pixel of less than a few
/// millionths of it may be looked up a halving or two too fine; the variance errs by less than `3 e span^2`, so within the
/// passage the share of the texture errs by `3 e span^2 / mean of reach^2`, which the least reach keeps below `5e4 e`.
#[derive(Clone, Debug, PartialEq)]
pub struct Textured {
    mipmaps: Arc<[Mipmap]>,
    atlas: Atlas,
    places: Vec<Place>,
    colors: Vec<[f32; 4]>,
    range: PlaceRange,
}

/// Where a scene's coordinates lie, and how they are mapped for the device's sums.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlaceRange {
    /// The middle of u and of v.
    pub middle: [f32; 2],
    /// The larger of the lengths of the intervals of u and v; positive.
    pub span: f32,
    /// The largest squared reach, in units of `span`.
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
        // A little more, so that the ends stay within it after rounding.
        let span = if span > 0.0 { span * (1.0 + 1e-6) } else { 1.0 };
        let largest = f64::from(places.par_iter().map(|place| place.reach).reduce(|| 0.0, f32::max));
        let most_reach_2 = (largest / f64::from(span)).max(LEAST_REACH).powi(2) as f32;
        Self { middle: [u, v], span, most_reach_2 }
    }
}

impl Textured {
    /// Surfels at `places` of the plane in which the textures lie as the `atlas` says, over whose disks these have the mean `colors` (linear,
    /// straight alpha); those of no texture have these colours.
    ///
    /// # Errors
    ///
    /// [`Error::Usage`] if places and colours are not as many, or the textures not as many as the atlas says.
    pub fn new(textures: Vec<Arc<Texture>>, atlas: Atlas, places: Vec<Place>, colors: Vec<[f32; 4]>) -> Result<Self> {
        if places.len() != colors.len() {
            return Err(Error::Usage("surfels in a texture have a place and a colour each".into()));
        }
        if textures.is_empty() || textures.len() as u64 != u64::from(atlas.textures) {
            return Err(Error::Usage("a plane of textures has as many as there are, and one at least".into()));
        }
        let range = PlaceRange::of(&places);
        Ok(Self { mipmaps: textures.into_par_iter().map(Mipmap::new).collect(), atlas, places, colors, range })
    }

    /// The images at all scales, by their numbers.
    pub fn mipmaps(&self) -> &[Mipmap] {
        &self.mipmaps
    }

    /// Where they lie.
    pub fn atlas(&self) -> Atlas {
        self.atlas
    }

    /// Where each surfel lies.
    pub fn places(&self) -> &[Place] {
        &self.places
    }

    /// The mean of its texture over each disk.
    pub fn colors(&self) -> &[[f32; 4]] {
        &self.colors
    }

    /// Where the coordinates lie.
    pub fn range(&self) -> PlaceRange {
        self.range
    }

    /// The same surfels in another order, or some of them.
    pub fn taken(&self, indices: &[usize]) -> Self {
        let places: Vec<_> = indices.iter().map(|&index| self.places[index]).collect();
        let colors = indices.iter().map(|&index| self.colors[index]).collect();
        let range = PlaceRange::of(&places);
        Self { mipmaps: Arc::clone(&self.mipmaps), atlas: self.atlas, places, colors, range }
    }

    /// What is summed of surfel `index` at the world offset `step` from its centre: the coordinates relative to the middle of their
    /// range, the squared length of these, and the squared reach; in units of the range's span. And the `part` of the texture that a pixel has
    /// there, as it is.
    pub fn terms(&self, index: usize, step: DVec3, part: f64) -> [f64; 5] {
        let PlaceRange { middle, span, .. } = self.range;
        let Place { center, slopes, reach, .. } = self.places[index];
        let [u, v] = [0, 1].map(|k| {
            let gain = DVec3::from_array(slopes[k].map(f64::from)).dot(step);
            (f64::from(center[k]) - f64::from(middle[k]) + gain) / f64::from(span)
        });
        let reach = (f64::from(reach) / f64::from(span)).max(LEAST_REACH);
        [u, v, u * u + v * v, reach * reach, part]
    }

    /// The part of the whole texture that a pixel has of the plane of surfel `index`, at `depth` along its ray, which is as long as a unit of depth:
    /// at most all of it. The twin of `area_in_pixel` in `wgsl/camera_pinhole.wgsl` and `wgsl/camera_orthographic.wgsl`.
    pub fn part_in_pixel(&self, index: usize, camera: &Camera, ray: DVec3, depth: f64) -> f64 {
        let [u, v] = self.places[index].slopes.map(|slope| DVec3::from_array(slope.map(f64::from)));
        // As long as the texture's area is for a unit of the plane's.
        let normal = u.cross(v);
        let scale = if camera.projection == Projection::Pinhole { depth * depth } else { 1.0 };
        let facing = normal.dot(ray).abs();
        if facing > 0.0 { (normal.length_squared() / facing * scale / (camera.fx * camera.fy)).min(1.0) } else { 0.0 }
    }

    /// What the device has of surfel `index`: the coordinates of its centre and its squared reach, each mapped to [0, 1]; and the
    /// slopes of u and of v in units of the span. A coordinate of what the surfel's centre leaves out, `low`, comes last in each.
    pub(crate) fn mapped(&self, index: usize, low: Option<&[f32; 3]>) -> [[f32; 4]; 3] {
        let [u, v, _, reach_2, _] = self.terms(index, DVec3::ZERO, 0.0);
        let slope = |k: usize| self.places[index].slopes[k].map(|gain| f64::from(gain) / f64::from(self.range.span));
        let [[ux, uy, uz], [vx, vy, vz]] = [0, 1].map(slope);
        let [x, y, z] = low.map_or([0.0; 3], |low| low.map(f64::from));
        let center = [u + 0.5, v + 0.5, reach_2 / f64::from(self.range.most_reach_2), x];
        [center, [ux, uy, uz, y], [vx, vy, vz, z]].map(|values| values.map(|value| value as f32))
    }

    /// The place of a pixel in the plane of textures, from the means of [`Self::terms`].
    fn joint_at(&self, [u, v, ..]: [f64; 5]) -> [f64; 2] {
        let PlaceRange { middle, span, .. } = self.range;
        let at = |k: usize, offset: f64| f64::from(middle[k]) + f64::from(span) * offset;
        [at(0, u), at(1, v)]
    }

    /// The texture coordinates of a pixel from the means of [`Self::terms`].
    pub fn place_at(&self, means: [f64; 5]) -> [f64; 2] {
        self.atlas.own(self.joint_at(means))
    }

    /// The premultiplied colour of a pixel from the means of [`Self::terms`] and the blended premultiplied colour: by the texture
    /// where the coordinates agree, else blended. The twin of `textured` in `wgsl/texture.wgsl`.
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
        // Between red and blue, in linear light, and across the seam too; what is clear has no colour to give.
        assert_eq!(texture.at(0.5, 0.75), [0.5, 0.0, 0.5, 1.0]);
        assert_eq!(texture.at(0.0, 0.75), [0.5, 0.0, 0.5, 1.0]);
        assert_eq!(texture.at(0.5, 0.25), [0.0, 1.0, 0.0, 0.5]);
        assert!(texture.at(f32::NAN, f32::INFINITY).iter().all(|c| c.is_finite()));
        assert!(Texture::new(2, 2, vec![red]).is_none() && Texture::new(0, 2, vec![]).is_none());
        // Clamped, edges go on: no other side shines in at a border, and none beyond.
        let clamped = texture.clamped(true);
        for (u, v, color) in [(0.0, 0.75, [1.0, 0.0, 0.0, 1.0]), (7.5, 3.0, [0.0, 0.0, 1.0, 1.0])] {
            assert_eq!(clamped.at(u, v), color);
        }
        assert_eq!(clamped.at(0.5, 0.75), [0.5, 0.0, 0.5, 1.0]);
    }
}
