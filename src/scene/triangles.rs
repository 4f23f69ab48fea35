//! Triangles beside a scene's surfels, the second source of visible surfaces.

mod places;

use std::cmp::Ordering;
use std::sync::Arc;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::{Bounds, CUT, Mipmap, Texture};
use crate::morton;

use places::{LEAST_TOLD, LEAST_WIDTH, Place, doubled, has_area, shown_error, single};

/// A triangle as given, before it becomes part of [`Triangles`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Triangle {
    /// World units relative to the scene's origin, counter-clockwise seen from the front.
    pub corners: [[f64; 3]; 3],
    /// Unit normals of the corners; None for the normal of the triangle's plane.
    pub normals: Option<[[f32; 3]; 3]>,
    /// Premultiplied linear colours of the corners.
    pub colors: [[f32; 4]; 3],
    /// The number of the texture that is multiplied with the colours, and the corners' coordinates
    /// (u, v) in it, origin bottom left.
    pub texture: Option<(u32, [[f32; 2]; 3])>,
}

/// Triangles in an order that depends on their set alone: by the Morton codes of their vertices,
/// then by all other bits.
///
/// Where two triangles have the same depth, their indices therefore decide which one shows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Triangles {
    vertices: Vec<[f32; 3]>,
    low: Vec<[f32; 3]>,
    reaches: Vec<f32>,
    corners: Vec<[u32; 3]>,
    normals: Vec<[[f32; 3]; 3]>,
    colors: Vec<[[f32; 4]; 3]>,
    painted: Vec<Painted>,
    textures: Vec<Mipmap>,
}

/// The texture of a triangle and its corners' coordinates in it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Painted {
    /// The texture's number, or [`UNPAINTED`].
    pub texture: u32,
    /// Texture coordinates (u, v) of the corners.
    pub places: [[f32; 2]; 3],
}

/// The texture number of triangles without a texture.
pub const UNPAINTED: u32 = u32::MAX;

/// Cells of the Morton code's grid along an axis.
const CELLS: f64 = ((1u32 << 21) - 1) as f64;

impl Triangles {
    /// Builds the set from those of `triangles` that have an area and finite corners.
    ///
    /// Corners at one position become one vertex, so a quantity computed for a vertex is the same
    /// for all its triangles. If any triangle has normals, the others get those of their planes.
    /// Positions are f32, or two f32 each if the rounding of one would be visible
    /// ([`Triangles::low`]).
    pub fn new(triangles: &[Triangle]) -> Self {
        Self::textured(triangles, &[])
    }

    /// As [`Self::new`], with textures, which triangles refer to by their indices.
    pub fn textured(triangles: &[Triangle], textures: &[Arc<Texture>]) -> Self {
        Self::textured_in_order(triangles, textures).0
    }

    /// As [`Self::textured`]. Also returns the place of each triangle among those given.
    pub(crate) fn textured_in_order(triangles: &[Triangle], textures: &[Arc<Texture>]) -> (Self, Vec<u32>) {
        let (made, places) = Self::numbered(triangles, textures.len());
        let is_painted = !made.painted.is_empty();
        let textures = textures.iter().filter(|_| is_painted).map(|texture| Mipmap::new(texture.clone())).collect();
        (Self { textures, ..made }, places)
    }

    /// Other triangles with the textures of these. Also returns the place of each triangle among
    /// those given.
    pub(crate) fn with(&self, triangles: &[Triangle]) -> (Self, Vec<u32>) {
        let (made, places) = Self::numbered(triangles, self.textures.len());
        let textures = if made.painted.is_empty() { Vec::new() } else { self.textures.clone() };
        (Self { textures, ..made }, places)
    }

    /// A triangle as it was given, with its corners rounded as they are stored.
    pub(crate) fn triangle(&self, index: usize) -> Triangle {
        let painted = self.painted.get(index).filter(|painted| painted.texture != UNPAINTED);
        Triangle {
            corners: self.corners[index].map(|vertex| self.place(vertex as usize).to_array()),
            normals: self.normals.get(index).copied(),
            colors: *self.colors.get(index).unwrap_or(&self.colors[0]),
            texture: painted.map(|painted| (painted.texture, painted.places)),
        }
    }

    /// As [`Self::textured_in_order`], for a number of textures, without them.
    fn numbered(triangles: &[Triangle], textures: usize) -> (Self, Vec<u32>) {
        match triangles.par_iter().any(|triangle| shown_error(triangle.corners, single, LEAST_WIDTH).is_some()) {
            true => Self::kept(triangles, textures, doubled),
            false => Self::kept(triangles, textures, single),
        }
    }

    /// As [`Self::numbered`], with positions rounded by `stored`.
    fn kept<P: Place>(triangles: &[Triangle], textures: usize, stored: fn([f64; 3]) -> P) -> (Self, Vec<u32>) {
        let placed = |triangle: &Triangle| triangle.corners.map(stored);
        let places = triangles.par_iter().flat_map_iter(placed);
        let bounds = Bounds::of(places.clone().map(Place::exact));
        let mut keyed: Vec<(u64, P)> = places
            .filter(|place| place.exact().is_finite())
            .map(|place| (cell(place.exact(), &bounds), place))
            .collect();
        keyed.par_sort_unstable();
        keyed.dedup();
        let number = |place: P| {
            let found = keyed.binary_search(&(cell(place.exact(), &bounds), place));
            found.ok().and_then(|number| u32::try_from(number).ok())
        };
        let has_normals = triangles.par_iter().any(|triangle| triangle.normals.is_some());
        let mut all: Vec<Record> = triangles
            .par_iter()
            .enumerate()
            .filter_map(|(given, triangle)| {
                let [Some(a), Some(b), Some(c)] = placed(triangle).map(number) else { return None };
                let normals =
                    if has_normals { triangle.normals.unwrap_or_else(|| facet(triangle)) } else { [[0.0; 3]; 3] };
                let (texture, places) =
                    triangle.texture.filter(|(of, _)| textures > *of as usize).unwrap_or((UNPAINTED, [[0.0; 2]; 3]));
                let painted = Painted { texture, places };
                let record =
                    Record { corners: [a, b, c], normals, colors: triangle.colors, painted, given: given as u32 };
                has_area(placed(triangle).map(Place::exact)).then(|| record.turned())
            })
            .collect();
        all.par_sort_unstable_by(Record::order);
        let colored = all.par_iter().any(|record| record.colors.iter().any(|color| *color != all[0].colors[0]));
        let mut reaches = vec![0.0; keyed.len()];
        for record in &all {
            let places = record.corners.map(|vertex| keyed[vertex as usize].1.exact());
            for k in 0..3 {
                let (from, to) = (record.corners[k] as usize, record.corners[(k + 1) % 3] as usize);
                let length = places[k].distance(places[(k + 1) % 3]) as f32;
                reaches[from] = length.max(reaches[from]);
                reaches[to] = length.max(reaches[to]);
            }
        }
        let is_painted = all.par_iter().any(|record| record.painted.texture != UNPAINTED);
        let made = Self {
            reaches,
            vertices: keyed.iter().map(|(_, place)| place.high()).collect(),
            low: keyed.iter().filter_map(|(_, place)| place.low()).collect(),
            corners: all.iter().map(|record| record.corners).collect(),
            normals: if has_normals { all.iter().map(|record| record.normals).collect() } else { Vec::new() },
            colors: all.iter().take(if colored { all.len() } else { 1 }).map(|record| record.colors).collect(),
            painted: if is_painted { all.iter().map(|record| record.painted).collect() } else { Vec::new() },
            textures: Vec::new(),
        };
        (made, all.iter().map(|record| record.given).collect())
    }

    /// The largest error of a coordinate stored as two f32, world units. Only triangles count for
    /// which it exceeds 1/256 of their width; None if there are none.
    pub fn rounding(triangles: &[Triangle]) -> Option<f64> {
        let error = |triangle: &Triangle| shown_error(triangle.corners, doubled, LEAST_TOLD);
        triangles.par_iter().filter_map(error).reduce_with(f64::max)
    }

    /// The same triangles in one premultiplied linear colour, without textures.
    pub fn painted(&self, color: [f32; 4]) -> Self {
        let colors = self.colors.first().map(|_| [color; 3]).into_iter().collect();
        Self { colors, painted: Vec::new(), textures: Vec::new(), ..self.clone() }
    }

    /// The number of triangles.
    pub fn len(&self) -> usize {
        self.corners.len()
    }

    /// Whether there are no triangles.
    pub fn is_empty(&self) -> bool {
        self.corners.is_empty()
    }

    /// The positions of the vertices, world units relative to the scene's origin, rounded to f32.
    pub fn vertices(&self) -> &[[f32; 3]] {
        &self.vertices
    }

    /// The part of each position beyond f32; empty if that is less than 1/256 of the width of every
    /// triangle.
    pub fn low(&self) -> &[[f32; 3]] {
        &self.low
    }

    /// The vertex indices of each triangle, rotated so that the lowest comes first.
    pub fn corners(&self) -> &[[u32; 3]] {
        &self.corners
    }

    /// The unit normals of each triangle's corners; empty if all are those of their planes.
    pub fn normals(&self) -> &[[[f32; 3]; 3]] {
        &self.normals
    }

    /// The premultiplied linear colours of each triangle's corners; a single entry if all triangles
    /// have the same colour.
    pub fn colors(&self) -> &[[[f32; 4]; 3]] {
        &self.colors
    }

    /// The texture and coordinates of each triangle; empty if none has a texture.
    pub fn paint(&self) -> &[Painted] {
        &self.painted
    }

    /// The textures with their mipmaps, by number.
    pub fn textures(&self) -> &[Mipmap] {
        &self.textures
    }

    /// Whether points of triangles are left out, because their image is transparent there.
    pub fn are_cut(&self) -> bool {
        self.textures.iter().any(|mipmap| mipmap.least_alpha() > 0.0)
    }

    /// The image of a triangle with its place in it; None without one.
    fn painted_by(&self, triangle: usize) -> Option<(&Painted, &Mipmap)> {
        self.painted.get(triangle).and_then(|of| Some((of, self.textures.get(of.texture as usize)?)))
    }

    /// How far the image's alpha at a point of a triangle exceeds the least that shows
    /// ([`Texture::least_alpha`]), relative to it and to the texels of the triangle, among which it
    /// changes; negative where the triangle is left out. None if all of the triangle shows. `parts`
    /// and `spread` are those of [`Self::texture_at`].
    pub fn excess_alpha(&self, triangle: usize, parts: [f64; 3], spread: f64) -> Option<f64> {
        let (painted, mipmap) = self.painted_by(triangle)?;
        let least = f64::from(mipmap.least_alpha());
        if least == 0.0 {
            return None;
        }
        let [a, b, c] = painted.places.map(|place| DVec2::from_array(place.map(f64::from)));
        let [width, height] = mipmap.levels()[0].size().map(f64::from);
        let texels = (b - a).abs().max((c - a).abs()) * DVec2::new(width, height);
        Some((seen(painted, mipmap, parts, spread)[3] / least - 1.0) / (1.0 + texels.element_sum()))
    }

    /// The filtered premultiplied colour of a triangle's texture; white without one. A point of a
    /// cut-out is opaque.
    ///
    /// `parts` are the barycentric coordinates of the point. `spread` is the area that a pixel
    /// covers in the plane of `parts[1]` and `parts[2]`, in which the triangle has the area 1/2.
    pub fn texture_at(&self, triangle: usize, parts: [f64; 3], spread: f64) -> [f64; 4] {
        let Some((painted, mipmap)) = self.painted_by(triangle) else { return [1.0; 4] };
        let seen = seen(painted, mipmap, parts, spread);
        if mipmap.least_alpha() == CUT { seen.map(|channel| channel / seen[3]) } else { seen }
    }

    /// The longest edge at a vertex, world units.
    pub fn reach(&self, vertex: usize) -> f64 {
        self.reaches[vertex].into()
    }

    /// The position of a vertex with all its digits, world units relative to the scene's origin.
    pub fn place(&self, vertex: usize) -> DVec3 {
        let low = self.low.get(vertex).map_or(DVec3::ZERO, |low| DVec3::from_array(low.map(f64::from)));
        DVec3::from_array(self.vertices[vertex].map(f64::from)) + low
    }

    /// The unit normals at the corners of a triangle.
    pub fn normals_of(&self, triangle: usize) -> [DVec3; 3] {
        match self.normals.get(triangle) {
            Some(normals) => normals.map(|normal| DVec3::from_array(normal.map(f64::from))),
            None => {
                let [a, b, c] = self.corners[triangle].map(|vertex| self.place(vertex as usize));
                [(b - a).cross(c - a).normalize_or_zero(); 3]
            }
        }
    }

    /// The premultiplied linear colours at the corners of a triangle.
    pub fn colors_of(&self, triangle: usize) -> [[f64; 4]; 3] {
        let of = if self.colors.len() == self.corners.len() { triangle } else { 0 };
        self.colors[of].map(|color| color.map(f64::from))
    }
}

/// The filtered premultiplied colour of the image at a point of a triangle.
fn seen(painted: &Painted, mipmap: &Mipmap, parts: [f64; 3], spread: f64) -> [f64; 4] {
    let [a, b, c] = painted.places.map(|place| DVec2::from_array(place.map(f64::from)));
    let place = a + parts[1] * (b - a) + parts[2] * (c - a);
    let [width, height] = mipmap.levels()[0].size().map(f64::from);
    mipmap.seen_at(place.to_array(), spread * (b - a).perp_dot(c - a).abs() * width * height)
}

/// The Morton code of the cell of `bounds` that contains `place`.
fn cell(place: DVec3, bounds: &Bounds) -> u64 {
    let extent = bounds.extent().max_element();
    let scale = if extent > 0.0 { CELLS / extent } else { 0.0 };
    let at = (place - bounds.min) * scale;
    morton::code(at.to_array().map(|x| x as u64))
}

/// The normal of the triangle's plane for each corner.
fn facet(triangle: &Triangle) -> [[f32; 3]; 3] {
    let [a, b, c] = triangle.corners.map(DVec3::from_array);
    [(b - a).cross(c - a).normalize_or_zero().as_vec3().to_array(); 3]
}

/// A triangle with vertex indices instead of positions.
struct Record {
    corners: [u32; 3],
    normals: [[f32; 3]; 3],
    colors: [[f32; 4]; 3],
    painted: Painted,
    /// Its place among the given triangles. It decides the order of triangles that are the same.
    given: u32,
}

impl Record {
    /// The same triangle, rotated so that its lowest vertex comes first.
    fn turned(self) -> Self {
        let lowest = (0..3).min_by_key(|&k| self.corners[k]).unwrap_or(0);
        let turn = |k: usize| (lowest + k) % 3;
        Self {
            corners: std::array::from_fn(|k| self.corners[turn(k)]),
            normals: std::array::from_fn(|k| self.normals[turn(k)]),
            colors: std::array::from_fn(|k| self.colors[turn(k)]),
            painted: Painted { places: std::array::from_fn(|k| self.painted.places[turn(k)]), ..self.painted },
            given: self.given,
        }
    }

    fn order(&self, other: &Self) -> Ordering {
        let normals = |record: &Self| record.normals.map(|normal| normal.map(f32::to_bits));
        let colors = |record: &Self| record.colors.map(|color| color.map(f32::to_bits));
        let painted =
            |record: &Self| (record.painted.texture, record.painted.places.map(|place| place.map(f32::to_bits)));
        (self.corners.cmp(&other.corners))
            .then_with(|| normals(self).cmp(&normals(other)))
            .then_with(|| colors(self).cmp(&colors(other)))
            .then_with(|| painted(self).cmp(&painted(other)))
            .then_with(|| self.given.cmp(&other.given))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triangle(k: usize) -> Triangle {
        let at = |n: usize| [n % 5, n / 5 % 5, n % 3].map(|x| x as f64);
        Triangle {
            corners: [at(k), at(k + 1), at(k + 7)],
            normals: None,
            colors: [[k as f32, 0.0, 0.0, 1.0]; 3],
            texture: None,
        }
    }

    #[test]
    fn order_and_turn_show_nowhere() {
        let given: Vec<_> = (0..100).map(triangle).collect();
        let mut other: Vec<_> = given.iter().rev().copied().collect();
        other.iter_mut().for_each(|triangle| triangle.corners.rotate_left(1));
        let made = Triangles::new(&given);
        assert_eq!(made, Triangles::new(&other));
        assert!(made.len() > 50 && made.vertices().len() <= 75);
        // With the other orientation it is another triangle.
        other[7].corners.swap(0, 1);
        assert_ne!(made, Triangles::new(&other));
    }

    #[test]
    fn what_is_no_triangle_is_left_out() {
        let corners = [[0.0, -0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let of = |corners| Triangle { corners, ..triangle(0) };
        let [a, b, c] = corners;
        let line = [[0.1, 0.1, 0.1], [0.7, 0.7, 0.7], [0.3, 0.3, 0.3]];
        let made = Triangles::new(&[
            of(corners),
            of(line),
            of([a, b, a]),
            of([a, [0.0; 3], c]),
            of([a, b, [f64::NAN, 0.0, 0.0]]),
        ]);
        assert_eq!(made.len(), 1);
        assert_eq!(made.normals_of(0), [DVec3::Z; 3]);
        assert!(Triangles::new(&[]).is_empty());
    }

    /// The stored positions of one triangle's vertices, from the lowest on, and whether they have
    /// low parts.
    fn kept(corners: [[f64; 3]; 3]) -> (Vec<DVec3>, bool) {
        let made = Triangles::new(&[Triangle { corners, ..triangle(0) }]);
        let places = made.corners().iter().flatten().map(|vertex| made.place(*vertex as usize));
        (places.collect(), !made.low().is_empty())
    }

    #[test]
    fn places_have_trailing_parts_where_their_rounding_shows() {
        let near = [[0.1, 0.2, 0.3], [1.1, 0.2, 0.3], [0.1, 1.3, 0.3]];
        for (far, doubled) in [(0.0, false), (1e3, false), (1e6, true), (1e9, true)] {
            let corners = near.map(|[x, y, z]| [x + far, y - far, z]);
            let (places, low) = kept(corners);
            assert_eq!((places.len(), low), (3, doubled), "{far}");
            let error = corners.map(|corner| {
                let place = DVec3::from_array(corner);
                places.iter().map(|other| place.distance(*other)).fold(f64::INFINITY, f64::min)
            });
            let most = error.into_iter().fold(0.0, f64::max);
            assert!(most <= if doubled { 2e-15 } else { 6e-8 } * (far + 1.0), "{far} {most}");
        }
        // Corners that are exact in f32, then one distant triangle among many near the origin.
        assert!(!kept([[16_777_216.0, 0.0, 0.0], [16_777_218.0, 0.0, 0.0], [16_777_216.0, 1.0, 0.0]]).1);
        let far = Triangle { corners: near.map(|corner| corner.map(|x| x + 1e7)), ..triangle(0) };
        let all: Vec<_> = (0..100).map(triangle).chain([far]).collect();
        assert_eq!(Triangles::new(&all).low().len(), Triangles::new(&all).vertices().len());
    }

    #[test]
    fn a_needle_has_an_area() {
        for long in [1.0, 1e4, 1e8, 1e12] {
            let tip = [[0.0, 0.0, 0.0], [long, 0.0, 0.0], [long, 1.0 / long, 0.0]];
            assert_eq!(kept(tip).0.len(), 3, "{long}");
            assert_eq!(kept(tip.map(|[x, y, z]| [z, x, y])).0.len(), 3, "{long}");
        }
        // Oblique needles: two f32 resolve the first, and the second is a line. `rounding` tries
        // two widths, of which the narrower is resolved only in part.
        let aslant = |width: f64| kept([[0.0, 0.0, 0.0], [1e6, 1e6, 1e6], [1e6, 1e6 + width, 1e6]]);
        assert_eq!([aslant(1e-6), aslant(0.0)].map(|(places, _)| places.len()), [3, 0]);
        let rounding = |width: f64| {
            let far = 1e8 + 3.3;
            let corners = [[0.1, 0.0, 0.0], [far, far, far], [far, far + width, far]];
            Triangles::rounding(&[Triangle { corners, ..triangle(0) }])
        };
        assert!(rounding(1.0).is_none() && rounding(5e-6).is_some_and(|error| error < 2.4e-7), "{:?}", rounding(5e-6));
        // A line with rounded decimals needs no low parts.
        assert!(!kept([[0.1, 0.2, 0.3], [0.2, 0.4, 0.6], [0.3, 0.6, 0.9]]).1);
    }
}
