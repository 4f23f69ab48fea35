//! The looks of a mesh's surfels: the colours and images of the triangles that they stand for.
//!
//! Surfels end where the look of triangles changes, as they do at edges: at sides between two
//! colours or images, and at the seams of one image, where the texture coordinates of a corner
//! differ. Within a piece of an image, a surfel has the texture coordinates of its centre and their
//! slopes along its plane, which determine the texture coordinates at each pixel.

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::cover::Facet;
use super::fans::Fan;
use crate::io::{Paint, Points};
use crate::scene::color::{DEFAULT_COLOR, mean_color};
use crate::scene::texture::straight;
use crate::scene::{Colors, Texture};
use crate::surfels::build::LARGEST_PLACE;

/// The images that surfels are painted with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::low_level::surfels) enum Painting {
    /// No image: a surfel has the mean colour of its triangles' images.
    Means,
    /// One image that is given for all triangles.
    Given,
    /// Each triangle's own image, by number.
    Own,
}

/// The look of a surfel.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Look {
    /// None if the surfel has the colour of its vertex, or only the colours of its image.
    pub(super) color: Option<[f32; 4]>,
    pub(super) placed: Option<Placed>,
    /// Whether the colour is the mean of an image.
    pub(super) averaged: bool,
}

/// The position of a surfel in an image.
#[derive(Clone, Copy, Debug)]
pub(super) struct Placed {
    /// The index of the image.
    pub(super) number: u32,
    /// Texture coordinates of the surfel's centre.
    pub(super) center: [f32; 2],
    /// Changes of u and v per world unit along x, y and z.
    pub(super) slopes: [[f32; 3]; 2],
}

/// The slope that is stored if all slopes are zero, as zeros would mean unknown.
const STILL: f32 = 1e-30;

/// The largest number of points along a side of a triangle over which the mean of its image is
/// taken.
const MOST_ALONG: f64 = 16.0;

/// The looks of a mesh's triangles.
pub(super) struct Skin<'a> {
    paint: &'a Paint,
    triangles: &'a [[u32; 3]],
    facets: &'a [Option<Facet>],
    painting: Painting,
    /// Whether triangles without an image have the colours of their vertices.
    of_vertices: bool,
    /// The colours of all triangles, if surfels have the means of images.
    means: Vec<Option<[f32; 4]>>,
}

impl<'a> Skin<'a> {
    pub(super) fn new(
        paint: &'a Paint,
        (triangles, facets): (&'a [[u32; 3]], &'a [Option<Facet>]),
        painting: Painting,
        of_vertices: bool,
    ) -> Self {
        let mut skin = Self { paint, triangles, facets, painting, of_vertices, means: Vec::new() };
        if painting == Painting::Means && paint.has_images() {
            skin.means = (0..triangles.len()).into_par_iter().map(|triangle| skin.color(triangle)).collect();
        }
        skin
    }

    /// The texture coordinates of a triangle's corners, if all are usable.
    fn places(&self, triangle: usize) -> Option<[[f32; 2]; 3]> {
        let usable = |places: &&[[f32; 2]; 3]| places.as_flattened().iter().all(|turns| turns.abs() <= LARGEST_PLACE);
        self.paint.places.get(triangle).filter(usable).copied()
    }

    /// The image of a triangle, by its number among the materials' images, and its corners' texture
    /// coordinates.
    fn image(&self, triangle: usize) -> Option<(u32, [[f32; 2]; 3])> {
        self.paint.number(triangle).zip(self.places(triangle))
    }

    /// The image that a triangle's surfels are painted with.
    fn painted(&self, triangle: usize) -> Option<(u32, [[f32; 2]; 3])> {
        match self.painting {
            Painting::Means => None,
            Painting::Given => Some(0).zip(self.places(triangle)),
            Painting::Own => self.image(triangle),
        }
    }

    /// The colour of a triangle: the mean of its image times its own colour, if surfels have means;
    /// else its own colour, or None if its vertices have colours.
    fn color(&self, triangle: usize) -> Option<[f32; 4]> {
        if let Some(mean) = self.means.get(triangle) {
            return *mean;
        }
        let own = self.paint.colors.get(triangle).copied();
        let image = self.image(triangle).filter(|_| self.painting == Painting::Means);
        let texture = image.and_then(|(number, places)| Some((self.paint.textures.get(number as usize)?, places)));
        match texture {
            Some((texture, places)) => Some(times(mean_over(texture, places), own)),
            None => own.filter(|_| !self.of_vertices),
        }
    }

    /// Whether a triangle's surfels have the mean of its image.
    fn averages(&self, triangle: usize) -> bool {
        self.painting == Painting::Means && self.image(triangle).is_some()
    }

    /// Whether two triangles with a common side look like one surface there.
    pub(super) fn goes_on(&self, [a, b]: [u32; 2]) -> bool {
        match [a, b].map(|triangle| self.painted(triangle as usize)) {
            [Some((one, places)), Some((other, others))] => {
                let [corners, beyond] = [a, b].map(|triangle| self.triangles[triangle as usize]);
                let same = |(k, corner): (usize, &u32)| {
                    beyond.iter().position(|other| other == corner).is_none_or(|l| places[k] == others[l])
                };
                one == other && corners.iter().enumerate().all(same)
            }
            [None, None] => match [a, b].map(|triangle| self.image(triangle as usize)) {
                [Some((one, _)), Some((other, _))] => one == other,
                [None, None] => self.color(a as usize) == self.color(b as usize),
                _ => false,
            },
            _ => false,
        }
    }

    /// Whether a triangle is not painted with an image, so that a surfel that reaches slightly past
    /// the triangle's sides is hardly visible.
    pub(super) fn is_flat(&self, triangle: u32) -> bool {
        self.painted(triangle as usize).is_none()
    }

    /// The look of a triangle's surfel with this centre.
    pub(super) fn of_triangle(&self, triangle: u32, center: DVec3) -> Look {
        let index = triangle as usize;
        let placed = self.painted(index).zip(self.facets[index].as_ref()).map(|((number, places), facet)| {
            let slopes = gains(facet, places);
            let step = center - facet.corners[0];
            let at = DVec2::from_array(places[0].map(f64::from)) + DVec2::from_array(slopes.map(|gain| gain.dot(step)));
            Placed { number, center: at.as_vec2().to_array(), slopes: stored(slopes) }
        });
        Look { color: self.color(index), placed, averaged: self.averages(index) }
    }

    /// The look of a fan's surfel, centred at the vertex.
    pub(super) fn of_fan(&self, fan: &Fan) -> Look {
        let of = |triangle: u32| Some((self.facets[triangle as usize].as_ref()?.area, self.color(triangle as usize)?));
        let colors: Vec<_> = fan.corners.iter().filter_map(|corner| of(corner.triangle)).collect();
        let color = (!colors.is_empty()).then(|| mean_color(colors.iter().map(|(area, color)| (*color, *area))));
        let first = fan.corners.first();
        let placed = first.and_then(|first| Some((first, self.painted(first.triangle as usize)?)));
        let placed = placed.map(|(first, (number, places))| {
            let (mut sum, mut area) = ([DVec3::ZERO; 2], 0.0);
            for corner in &fan.corners {
                let (facet, painted) =
                    (self.facets[corner.triangle as usize].as_ref(), self.painted(corner.triangle as usize));
                if let Some((facet, (_, places))) = facet.zip(painted) {
                    let own = gains(facet, places);
                    sum = [0, 1].map(|k| sum[k] + facet.area * own[k]);
                    area += facet.area;
                }
            }
            Placed { number, center: places[first.place], slopes: stored(sum.map(|gain| gain / area)) }
        });
        let averaged = fan.corners.iter().any(|corner| self.averages(corner.triangle as usize));
        Look { color, placed, averaged }
    }
}

/// Returns the changes of u and v per world unit along x, y and z on a triangle with these texture
/// coordinates at its corners.
fn gains(facet: &Facet, places: [[f32; 2]; 3]) -> [DVec3; 2] {
    let [p, q] = facet.sides(0);
    let normal = p.cross(q);
    let along = [q.cross(normal), normal.cross(p)].map(|along| along / normal.length_squared());
    [0, 1].map(|k| {
        let [a, b, c] = places.map(|place| f64::from(place[k]));
        along[0] * (b - a) + along[1] * (c - a)
    })
}

fn stored(gains: [DVec3; 2]) -> [[f32; 3]; 2] {
    let stored = gains.map(|gain| gain.as_vec3().to_array());
    let known = stored.as_flattened().iter().all(|gain| gain.is_finite());
    if known && stored.as_flattened().iter().any(|gain| *gain != 0.0) { stored } else { [[STILL; 3]; 2] }
}

/// The mean colour of an image over a triangle, straight alpha.
fn mean_over(texture: &Texture, places: [[f32; 2]; 3]) -> [f32; 4] {
    let [a, b, c] = places.map(|place| DVec2::from_array(place.map(f64::from)));
    let size = DVec2::from_array(texture.size().map(f64::from));
    let texels = [b - a, c - b, a - c].map(|side| (side * size).abs().max_element()).into_iter().fold(0.0, f64::max);
    let along = (0.5 * texels).ceil().clamp(1.0, MOST_ALONG);
    // The samples are the centroids of `along` squared equal parts of the triangle.
    let part = |i: u32, j: u32, third: f64| (f64::from(i) + third, f64::from(j) + third);
    let count = along as u32;
    let whole = (0..count).flat_map(|i| (0..count - i).map(move |j| part(i, j, 1.0 / 3.0)));
    let turned = (0..count).flat_map(|i| (0..(count - i).saturating_sub(1)).map(move |j| part(i, j, 2.0 / 3.0)));
    let at = |(x, y): (f64, f64)| texture.premultiplied_at((a + (x * (b - a) + y * (c - a)) / along).to_array());
    let sum = whole.chain(turned).map(at).fold([0.0; 4], |sum, texel| std::array::from_fn(|k| sum[k] + texel[k]));
    straight(sum.map(|total| total / (along * along)))
}

fn times(color: [f32; 4], factor: Option<[f32; 4]>) -> [f32; 4] {
    factor.map_or(color, |factor| std::array::from_fn(|k| color[k] * factor[k]))
}

/// Sets the colour of each vertex of a mesh to its [`vertex_colors`], because the triangles are not
/// drawn.
pub(in crate::low_level::surfels) fn color_vertices(points: &mut Points) {
    if let Some(colors) = vertex_colors(points) {
        points.colors = Some(colors);
    }
    points.faces.iter_mut().for_each(|faces| faces.paint = None);
}

/// The mean colour of the triangles at each vertex of a mesh; None if no triangle has a colour
/// besides those of its vertices.
pub(crate) fn vertex_colors(points: &Points) -> Option<Colors> {
    let faces = points.faces.as_ref()?;
    let (paint, triangles) = (faces.paint.as_deref()?, &faces.triangles);
    let of_vertices = points.colors.is_some();
    let skin = Skin { paint, triangles, facets: &[], painting: Painting::Given, of_vertices, means: Vec::new() };
    let mut sums = vec![[0.0f64; 5]; points.positions.len()];
    for (index, corners) in triangles.iter().enumerate() {
        let image = skin.image(index);
        let texture = image.and_then(|(number, places)| Some((paint.textures.get(number as usize)?, places)));
        for (k, corner) in corners.iter().enumerate() {
            let color = match texture {
                Some((texture, places)) => {
                    let [u, v] = places[k];
                    Some(times(texture.at(u, v), paint.colors.get(index).copied()))
                }
                None => skin.color(index),
            };
            let Some([r, g, b, a]) = color.map(|color| color.map(f64::from)) else { continue };
            let sum = &mut sums[*corner as usize];
            *sum = [sum[0] + a * r, sum[1] + a * g, sum[2] + a * b, sum[3] + a, sum[4] + 1.0];
        }
    }
    if sums.iter().all(|sum| sum[4] == 0.0) {
        return None;
    }
    let own = |index: usize| points.colors.as_ref().map_or(DEFAULT_COLOR, |colors| colors.linear(index));
    let color = |(index, [r, g, b, a, count]): (usize, &[f64; 5])| match *count > 0.0 {
        true => straight([r / count, g / count, b / count, a / count]),
        false => own(index),
    };
    Some(Colors::Linear(sums.iter().enumerate().map(color).collect()))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn places_follow_the_plane_of_a_triangle() {
        let positions = [[1.0, 2.0, 3.0], [4.0, 2.5, 3.0], [1.5, 5.0, 4.0]];
        let facet = Facet::of(&positions, [0, 1, 2]).unwrap();
        let places = [[0.25, 0.5], [0.75, 0.5], [0.5, -1.0]];
        let gains = gains(&facet, places);
        for k in 0..3 {
            let step = DVec3::from(positions[k]) - DVec3::from(positions[0]);
            for axis in 0..2 {
                let gained = f64::from(places[0][axis]) + gains[axis].dot(step);
                assert!((gained - f64::from(places[k][axis])).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn the_mean_of_an_image_is_over_the_triangle() {
        // The left half is red, the right one blue.
        let texels = (0..64 * 64).map(|k| if k % 64 < 32 { [255, 0, 0, 255] } else { [0, 0, 255, 255] }).collect();
        let texture = Texture::new(64, 64, texels).unwrap();
        let left = mean_over(&texture, [[0.05, 0.1], [0.45, 0.1], [0.1, 0.9]]);
        assert_eq!(left, [1.0, 0.0, 0.0, 1.0]);
        // Three quarters of this triangle lie on the left.
        let [r, _, b, _] = mean_over(&texture, [[0.1, 0.1], [0.9, 0.5], [0.1, 0.9]]);
        assert!((r - 0.75).abs() < 0.03 && (b - 0.25).abs() < 0.03, "{r} {b}");
    }
}
