//! Primitives: their vertices and triangles in the coordinates of the world.

use ::gltf::json::Index;
use ::gltf::json::accessor::Accessor as Described;
use ::gltf::json::mesh::{Mode, Primitive, Semantic};
use ::gltf::json::validation::Checked;
use glam::{DAffine3, DVec3};

use super::accessor::{Accessor, described};
use super::buffers::Buffers;
use super::document::{Document, compression, malformed};
use super::materials::{Alpha, Look, Map, Materials};
use crate::io::fault::Fault;
use crate::io::values::finite;

/// The vertices of all primitives of a kind, and the triangles between them.
#[derive(Default)]
pub(super) struct Parts {
    pub(super) positions: Vec<[f64; 3]>,
    /// A normal per vertex; zero where the file has none.
    pub(super) normals: Vec<[f32; 3]>,
    /// A linear colour with straight alpha per vertex.
    pub(super) colors: Vec<[f32; 4]>,
    pub(super) triangles: Vec<[u32; 3]>,
    /// The colour of each triangle's material.
    pub(super) paints: Vec<[f32; 4]>,
    /// The image of each triangle, or `u32::MAX`.
    pub(super) numbers: Vec<u32>,
    /// Texture coordinates of the corners of each triangle, origin bottom left; NaN without any.
    pub(super) places: Vec<[[f32; 2]; 3]>,
    pub(super) has_normals: bool,
    /// Whether colours of vertices show.
    pub(super) has_colors: bool,
    pub(super) has_materials: bool,
    pub(super) has_images: bool,
}

/// The texture coordinates of a triangle without any.
const NOWHERE: [[f32; 2]; 3] = [[f32::NAN; 2]; 3];

/// The accessors of a primitive.
struct Attributes<'a> {
    positions: Accessor<'a>,
    normals: Option<Accessor<'a>>,
    colors: Option<Accessor<'a>>,
    indices: Option<Accessor<'a>>,
}

/// A file's document and bytes.
#[derive(Clone, Copy)]
pub(super) struct Source<'a> {
    pub(super) document: &'a Document,
    pub(super) buffers: &'a Buffers<'a>,
}

impl<'a> Source<'a> {
    /// The accessor of an attribute, which needs as many elements as there are vertices.
    fn attribute(
        self,
        primitive: &Primitive,
        semantic: Semantic,
        (widths, count): (&[usize], Option<usize>),
    ) -> Result<Option<Accessor<'a>>, Fault> {
        let Some(index) = index_of(primitive, semantic.clone()) else { return Ok(None) };
        let accessor = Accessor::of(self.document, self.buffers, index, widths)?;
        match count {
            Some(count) if count != accessor.count => {
                let (name, own) = (Checked::Valid(semantic).to_string(), accessor.count);
                Err(malformed(format!("a primitive has {own} elements of {name} for {count} vertices")))
            }
            _ => Ok(Some(accessor)),
        }
    }

    fn attributes(self, primitive: &Primitive) -> Result<Attributes<'a>, Fault> {
        let others = primitive.extensions.as_ref().map(|extensions| &extensions.others);
        let positions = self.attribute(primitive, Semantic::Positions, (&[3], None))?;
        let positions = positions.ok_or_else(|| malformed("a primitive has no POSITION"))?;
        if !positions.is_stored() {
            let lacking = || malformed("the POSITION of a primitive has neither a buffer view nor sparse values");
            return Err(compression(others).unwrap_or_else(lacking));
        }
        let count = Some(positions.count);
        let indices = primitive.indices.map(|index| Accessor::of(self.document, self.buffers, index, &[1]));
        let indices = indices.transpose()?;
        if indices.as_ref().is_some_and(|indices| !indices.is_index()) {
            return Err(malformed("the indices of a primitive are no unsigned integers"));
        }
        Ok(Attributes {
            normals: self.attribute(primitive, Semantic::Normals, (&[3], count))?,
            colors: self.attribute(primitive, Semantic::Colors(0), (&[3, 4], count))?,
            positions,
            indices,
        })
    }
}

fn index_of(primitive: &Primitive, semantic: Semantic) -> Option<Index<Described>> {
    primitive.attributes.get(&Checked::Valid(semantic)).copied()
}

/// The mode of a primitive.
pub(super) fn mode(primitive: &Primitive) -> Result<Mode, Fault> {
    match primitive.mode {
        Checked::Valid(mode) => Ok(mode),
        Checked::Invalid => Err(malformed("a primitive has an unknown mode")),
    }
}

/// The number of vertices and corners of a primitive, which bounds the memory for it.
pub(super) fn size(document: &Document, primitive: &Primitive) -> Result<u64, Fault> {
    let count = |index: Option<Index<Described>>| {
        let own = index.map(|index| described(document, index)).transpose()?;
        let replaced = own.and_then(|own| own.sparse.as_ref()).map_or(0, |sparse| sparse.count.0);
        Ok::<_, Fault>(own.map(|own| (own.count.0, replaced)))
    };
    let (vertices, replaced) = count(index_of(primitive, Semantic::Positions))?.unwrap_or_default();
    let corners = count(primitive.indices)?.map_or(vertices, |(corners, _)| corners);
    Ok(vertices.min(corners).saturating_add(corners).saturating_add(replaced))
}

impl Parts {
    /// Adds a primitive in its place.
    pub(super) fn add(
        &mut self,
        source: Source<'_>,
        primitive: &Primitive,
        materials: &mut Materials<'_>,
        to_world: &DAffine3,
    ) -> Result<(), Fault> {
        let attributes = source.attributes(primitive)?;
        let mode = mode(primitive)?;
        let look = materials.look(primitive.material)?;
        let corners = corners(&attributes)?;
        let mut triangles = triangles(mode, &corners);
        let used = match mode {
            Mode::Points => corners,
            _ => compact(&mut triangles, attributes.positions.count),
        };
        let first = u32::try_from(self.positions.len() + used.len());
        let first = first.map_err(|_| malformed("it has 2^32 vertices or more"))? - used.len() as u32;
        self.has_materials |= primitive.material.is_some();
        self.place(&attributes, &used, to_world);
        let own = Colors::of(attributes.colors.as_ref(), &used);
        let map = look.map.filter(|_| !triangles.is_empty());
        let image = match map {
            Some(map) => {
                source.image(primitive, materials, (&look, &map), (&own, &used, attributes.positions.count))?
            }
            None => None,
        };
        self.has_colors |= image.is_none() && attributes.colors.is_some();
        let paint = match &image {
            Some(image) => image.paint,
            None => look.color([1.0; 4]),
        };
        self.colors.extend((0..used.len()).map(|vertex| look.color(own.at(vertex))));
        self.paints.resize(self.paints.len() + triangles.len(), paint);
        if let Some(Image { number, places, .. }) = image {
            self.has_images = true;
            self.numbers.resize(self.triangles.len(), u32::MAX);
            self.places.resize(self.triangles.len(), NOWHERE);
            self.numbers.resize(self.triangles.len() + triangles.len(), number);
            self.places.extend(triangles.iter().map(|corners| wound(to_world, corners.map(|k| places[k as usize]))));
        }
        self.triangles.extend(triangles.iter().map(|corners| wound(to_world, corners.map(|k| first + k))));
        Ok(())
    }

    /// Adds positions and normals of the vertices `used`.
    fn place(&mut self, attributes: &Attributes<'_>, used: &[u32], to_world: &DAffine3) {
        let vertices = || used.iter().map(|vertex| *vertex as usize);
        let position =
            |vertex: usize| to_world.transform_point3(attributes.positions.get::<3>(vertex).into()).to_array();
        self.positions.extend(vertices().map(position));
        let Some(normals) = &attributes.normals else {
            return self.normals.resize(self.positions.len(), [0.0; 3]);
        };
        self.has_normals = true;
        // The inverse transpose, times a positive factor: it exists for a flattened mesh too.
        let [x, y, z] = [to_world.matrix3.x_axis, to_world.matrix3.y_axis, to_world.matrix3.z_axis];
        let side = if is_mirrored(to_world) { -1.0 } else { 1.0 };
        let [x, y, z] = [y.cross(z), z.cross(x), x.cross(y)].map(|axis| side * axis);
        let normal = |vertex: usize| {
            let own = DVec3::from(normals.get::<3>(vertex));
            (x * own.x + y * own.y + z * own.z).normalize_or_zero().as_vec3().to_array()
        };
        self.normals.extend(vertices().map(normal));
    }

    /// Gives all triangles a place in the lists of images if one has an image.
    pub(super) fn fill(&mut self) {
        if self.has_images {
            self.numbers.resize(self.triangles.len(), u32::MAX);
            self.places.resize(self.triangles.len(), NOWHERE);
        }
    }
}

impl Look {
    /// The base colour times this one.
    fn color(&self, own: [f32; 4]) -> [f32; 4] {
        let [r, g, b, a] = std::array::from_fn(|k| self.factor[k] * own[k]);
        [r, g, b, self.alpha.of(a)]
    }
}

/// Whether a transform turns a surface inside out.
fn is_mirrored(to_world: &DAffine3) -> bool {
    to_world.matrix3.determinant() < 0.0
}

/// Corners in counter-clockwise order after the transform.
fn wound<T: Copy>(to_world: &DAffine3, [a, b, c]: [T; 3]) -> [T; 3] {
    if is_mirrored(to_world) { [a, c, b] } else { [a, b, c] }
}

/// Colours of the vertices of a primitive.
struct Colors(Vec<[f32; 4]>);

impl Colors {
    fn of(accessor: Option<&Accessor<'_>>, used: &[u32]) -> Self {
        let color = |of: &Accessor<'_>, vertex: u32| {
            let [r, g, b, a] = of.get::<4>(vertex as usize).map(finite);
            [r, g, b, if of.width == 4 { a } else { 1.0 }]
        };
        Self(accessor.map_or(Vec::new(), |of| used.iter().map(|vertex| color(of, *vertex)).collect()))
    }

    /// The colour of a vertex; white without any.
    fn at(&self, vertex: usize) -> [f32; 4] {
        self.0.get(vertex).copied().unwrap_or([1.0; 4])
    }

    /// The colour of all vertices; None if they differ.
    fn common(&self) -> Option<[f32; 4]> {
        let first = self.at(0);
        self.0.iter().all(|color| *color == first).then_some(first)
    }
}

/// The image of a primitive.
struct Image {
    number: u32,
    /// The colour that multiplies the image.
    paint: [f32; 4],
    /// The position in the image of each vertex.
    places: Vec<[f32; 2]>,
}

impl Source<'_> {
    /// The image that a primitive shows; None if it has no texture coordinates, or with a note if
    /// the image cannot be read.
    fn image(
        self,
        primitive: &Primitive,
        materials: &mut Materials<'_>,
        (look, map): (&Look, &Map),
        (own, used, count): (&Colors, &[u32], usize),
    ) -> Result<Option<Image>, Fault> {
        let set = self.attribute(primitive, Semantic::TexCoords(map.set), (&[2], Some(count)))?;
        let Some(set) = set else { return Ok(None) };
        let places: Vec<_> = used.iter().map(|vertex| map.place(set.get::<2>(*vertex as usize))).collect();
        let is_inside = |axis: usize| places.iter().all(|place| (0.0..=1.0).contains(&place[axis]));
        let clamps = map.clamps([is_inside(0), is_inside(1)]).unwrap_or_else(|| {
            materials.note("an image that is mirrored, or repeats along one axis alone, repeats along both".into());
            false
        });
        let tint = own.common().unwrap_or_else(|| {
            materials.note("colours of vertices that vary under an image are left out".into());
            [1.0; 4]
        });
        let factor: [f32; 4] = std::array::from_fn(|k| look.factor[k] * tint[k]);
        let number = materials.number(map, clamps, (look.alpha, factor[3]));
        // The alphas of a mask are in its image.
        let alpha = if look.alpha == Alpha::Blend { factor[3].clamp(0.0, 1.0) } else { 1.0 };
        let paint = [factor[0], factor[1], factor[2], alpha];
        Ok(number.map(|number| Image { number, paint, places }))
    }
}

/// The indices of a primitive, which exist.
fn corners(attributes: &Attributes<'_>) -> Result<Vec<u32>, Fault> {
    let count = attributes.positions.count;
    let Some(indices) = &attributes.indices else { return Ok((0..count as u32).collect()) };
    let corner = |k: usize| {
        let [corner] = indices.get::<1>(k);
        let beyond = || malformed(format!("a primitive names the vertex {corner} of {count}"));
        if corner < count as f64 { Ok(corner as u32) } else { Err(beyond()) }
    };
    (0..indices.count).map(corner).collect()
}

/// The triangles of a primitive, by the winding of each mode. Triangles without area, which join
/// strips, are left out.
fn triangles(mode: Mode, corners: &[u32]) -> Vec<[u32; 3]> {
    let windows = || corners.windows(3).enumerate();
    let has_area = |[a, b, c]: &[u32; 3]| a != b && b != c && c != a;
    match mode {
        Mode::Triangles => corners.as_chunks::<3>().0.to_vec(),
        Mode::TriangleStrip => {
            let triangle =
                |(k, of): (usize, &[u32])| if k % 2 == 0 { [of[0], of[1], of[2]] } else { [of[0], of[2], of[1]] };
            windows().map(triangle).filter(has_area).collect()
        }
        Mode::TriangleFan => {
            let pairs = corners.get(1..).unwrap_or_default().windows(2);
            pairs.map(|pair| [pair[0], pair[1], corners[0]]).filter(has_area).collect()
        }
        Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip => Vec::new(),
    }
}

/// Renumbers the vertices of triangles without gaps; returns the vertices in use, in order. The
/// time is that of the triangles, however many vertices a primitive shares with others.
fn compact(triangles: &mut [[u32; 3]], count: usize) -> Vec<u32> {
    if count / 16 > triangles.len() {
        let mut used = triangles.as_flattened().to_vec();
        used.sort_unstable();
        used.dedup();
        let rank = |vertex: &mut u32| *vertex = used.partition_point(|other| other < vertex) as u32;
        triangles.as_flattened_mut().iter_mut().for_each(rank);
        return used;
    }
    let mut is_used = vec![false; count];
    triangles.as_flattened().iter().for_each(|vertex| is_used[*vertex as usize] = true);
    let used: Vec<u32> = (0..count as u32).filter(|vertex| is_used[*vertex as usize]).collect();
    let mut ranks = vec![0; count];
    used.iter().zip(0..).for_each(|(vertex, rank)| ranks[*vertex as usize] = rank);
    triangles.as_flattened_mut().iter_mut().for_each(|vertex| *vertex = ranks[*vertex as usize]);
    used
}
