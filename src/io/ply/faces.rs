//! The triangles of a PLY file: polygons of the element `face` and strips of `tristrips`.

use super::face_colors;
use super::header::{Element, Kind, Property, Scalar};
use super::vertex::is_tree;
use super::whole::is_whole;
use crate::io::fault::Fault;
use crate::io::polygon;
use glam::DVec3;

/// How a list of vertices is turned into triangles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Shape {
    /// The list is the outline of one polygon.
    Polygon,
    /// Each vertex forms a triangle with the two vertices before it, and every second triangle is
    /// reversed. -1 starts a new strip.
    Strip,
}

/// How a property of a face is used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Role {
    /// The list of its vertex indices.
    Corners,
    /// The list of its texture coordinates: u and v of each corner, as MeshLab writes them.
    Texture,
    /// The index of its texture.
    TextureNumber,
    /// A colour channel: 0 to 3 for red, green, blue and alpha.
    Color(usize),
    /// The property is skipped.
    Unused,
}

/// Collects triangles row by row, with the state of the current row.
#[derive(Debug, Default)]
pub(super) struct Faces {
    triangles: Vec<[u32; 3]>,
    /// Polygons of more than three corners: the index of the first triangle, and the number of
    /// triangles.
    polygons: Vec<(usize, usize)>,
    /// Whether rows of the current element have texture coordinates, and whether rows of any
    /// element so far have texture indices.
    placed: bool,
    numbered: bool,
    /// The types of the colour channels, alpha optional; None if rows have no colour.
    channels: Option<[Option<Scalar>; 4]>,
    /// The colour of each triangle as it is in the file; NaN if the row has no colour. Empty if no
    /// element of faces has colours.
    colors: Vec<[f32; 4]>,
    /// Texture coordinates of the triangles before the first face that has none.
    texture: Vec<[[f32; 2]; 3]>,
    /// Index of each triangle's texture among the textures of the file.
    texture_numbers: Vec<u32>,
    shape: Option<Shape>,
    /// Index of the row's next corner, and of the row's first triangle.
    corner: usize,
    first: usize,
    /// Corner indices within the row, for each triangle of the row.
    corners: Vec<[usize; 3]>,
    /// The row's texture coordinates as a flat list, and its texture index.
    row_texture: Vec<f32>,
    row_number: u32,
    /// The row's colour.
    row_color: [f32; 4],
    /// Two earlier corners for the next triangle, as vertex index and index within the row: the
    /// last two of a strip, or the first and the last of a polygon.
    kept: [Option<(u32, usize)>; 2],
    /// Whether the next triangle of the strip is reversed.
    odd: bool,
}

/// The elements up to the last one that a reader uses. A file may end early after this element, but
/// not before.
pub(super) fn needed(elements: &[Element]) -> &[Element] {
    let read =
        |element: &Element| element.name == "vertex" || is_tree(element) || is_whole(element) || Faces::are(element);
    &elements[..elements.iter().rposition(read).map_or(0, |last| last + 1)]
}

/// The triangles of all faces of a file.
#[derive(Debug, Default)]
pub(super) struct Triangles {
    pub(super) triangles: Vec<[u32; 3]>,
    /// Texture coordinates of each corner; None unless every face has some.
    pub(super) texture: Option<Vec<[[f32; 2]; 3]>>,
    /// Index of each triangle's texture among the textures of the file; 0 if its row has none.
    pub(super) texture_numbers: Vec<u32>,
    /// Colour of each triangle, linear light with straight alpha; None if no face has one.
    pub(super) colors: Option<Vec<[f32; 4]>>,
}

impl Faces {
    /// Whether an element has a list of vertex indices, so that its rows are faces.
    pub(super) fn are(element: &Element) -> bool {
        element.properties.iter().any(|property| role(element, property) == Role::Corners)
    }

    /// Returns how each property of an element is used, and sets `channels`, `placed` and
    /// `numbered`.
    pub(super) fn roles(&mut self, element: &Element) -> Vec<Role> {
        let mut found = false;
        let mut role = |property: &Property| match role(element, property) {
            // Only the first list of vertex indices is used.
            Role::Corners if std::mem::replace(&mut found, true) => Role::Unused,
            role => role,
        };
        let mut roles: Vec<Role> = element.properties.iter().map(&mut role).collect();
        let mut channels = [None; 4];
        for (property, role) in element.properties.iter().zip(&roles) {
            if let (Role::Color(channel), Kind::Scalar(scalar)) = (role, property.kind) {
                channels[*channel] = Some(scalar);
            }
        }
        if found && channels[..3].iter().all(Option::is_some) {
            self.channels = Some(channels);
        } else {
            roles.iter_mut().filter(|role| matches!(role, Role::Color(_))).for_each(|role| *role = Role::Unused);
        }
        self.placed = roles.contains(&Role::Texture);
        self.numbered |= roles.contains(&Role::TextureNumber);
        roles
    }

    /// Starts a row.
    pub(super) fn begin(&mut self, element: &Element) {
        self.shape = shape_of(element);
        (self.kept, self.odd) = ([None, None], false);
        (self.corner, self.first, self.row_number) = (0, self.triangles.len(), 0);
        self.row_color = [f32::NAN, f32::NAN, f32::NAN, f32::NAN];
        self.corners.clear();
        self.row_texture.clear();
    }

    /// Takes the next number of a property with this role.
    pub(super) fn take(&mut self, element: &Element, row: u64, role: Role, number: f64) -> Result<(), Fault> {
        match role {
            Role::Corners => self.vertex(element, row, number)?,
            Role::Texture => self.row_texture.push(number as f32),
            // The cast saturates at `u32::MAX`, which names no texture; NaN becomes 0.
            Role::TextureNumber => self.row_number = if number < 0.0 { u32::MAX } else { number as u32 },
            Role::Color(channel) => self.row_color[channel] = number as f32,
            Role::Unused => {}
        }
        Ok(())
    }

    fn vertex(&mut self, element: &Element, row: u64, number: f64) -> Result<(), Fault> {
        if number == -1.0 && self.shape == Some(Shape::Strip) {
            (self.kept, self.odd) = ([None, None], false);
            return Ok(());
        }
        let vertex = number as u32;
        if f64::from(vertex) != number {
            let (row, name) = (row + 1, &element.name);
            return Err(Fault::Malformed(format!(
                "row {row} of element '{name}' names the vertex {number}, which is not a vertex index"
            )));
        }
        let third = (vertex, self.corner);
        self.corner += 1;
        let [first, second] = self.kept;
        match (first, second) {
            (None, _) => self.kept[0] = Some(third),
            (_, None) => self.kept[1] = Some(third),
            (Some(first), Some(second)) => {
                let turned = self.shape == Some(Shape::Strip) && self.odd;
                let triangle = if turned { [second, first, third] } else { [first, second, third] };
                // Triangles without area are dropped: strips contain some wherever they turn a
                // corner.
                if first.0 != second.0 && second.0 != vertex && vertex != first.0 {
                    self.triangles.push(triangle.map(|(vertex, _)| vertex));
                    if self.placed {
                        self.corners.push(triangle.map(|(_, corner)| corner));
                    }
                }
                let keep = if self.shape == Some(Shape::Strip) { second } else { first };
                self.kept = [Some(keep), Some(third)];
                self.odd = !self.odd;
            }
        }
        Ok(())
    }

    /// Ends a row. Its triangles get their colours and texture coordinates only here, as the order
    /// of properties in a row is free.
    pub(super) fn end(&mut self) {
        let made = self.triangles.len() - self.first;
        // A polygon that names a vertex twice lacks triangles of its fan; it is not cut again.
        if self.shape == Some(Shape::Polygon) && made > 1 && made + 2 == self.corner {
            self.polygons.push((self.first, made));
        }
        if self.channels.is_some() {
            self.colors.resize(self.first, [f32::NAN; 4]);
            self.colors.resize(self.triangles.len(), self.row_color);
        }
        if self.numbered {
            self.texture_numbers.resize(self.first, 0);
            self.texture_numbers.resize(self.triangles.len(), self.row_number);
        }
        if !self.placed {
            return;
        }
        let (pairs, _) = self.row_texture.as_chunks::<2>();
        if pairs.len() >= self.corner && self.texture.len() == self.first {
            self.texture.extend(self.corners.iter().map(|corners| corners.map(|corner| pairs[corner])));
        }
    }

    /// Completes the triangles, with the vertices at `positions`: checks their indices and cuts
    /// polygons into triangles again, so that concave ones are right.
    pub(super) fn finish(self, positions: &[[f64; 3]]) -> Result<Triangles, Fault> {
        let Self { mut triangles, mut texture, mut texture_numbers, polygons, mut colors, channels, .. } = self;
        let vertices = positions.len();
        if let Some(vertex) = triangles.as_flattened().iter().find(|vertex| **vertex as usize >= vertices) {
            return Err(Fault::Malformed(format!("a face names the vertex {vertex}, but there are {vertices}")));
        }
        for (first, count) in polygons {
            let fan = first..first + count;
            let position = |vertex: u32| DVec3::from(positions[vertex as usize]);
            let corners: Vec<_> = corners_of(&triangles[fan.clone()]).into_iter().map(position).collect();
            let parts = polygon::triangles(&corners);
            remake(&mut triangles[fan.clone()], &parts);
            texture.get_mut(fan).into_iter().for_each(|fan| remake(fan, &parts));
        }
        let texture = Some(texture).filter(|texture| !texture.is_empty() && texture.len() == triangles.len());
        texture_numbers.resize(triangles.len(), 0);
        colors.resize(triangles.len(), [f32::NAN; 4]);
        let colors = channels.filter(|_| !triangles.is_empty()).map(|channels| face_colors::linear(colors, channels));
        Ok(Triangles { triangles, texture, texture_numbers, colors })
    }
}

/// The attribute of each corner of a polygon, taken from its triangle fan.
fn corners_of<T: Copy>(fan: &[[T; 3]]) -> Vec<T> {
    fan.iter().take(1).flat_map(|&[a, b, _]| [a, b]).chain(fan.iter().map(|&[.., c]| c)).collect()
}

/// Replaces a polygon's fan by another triangulation: `parts` are the corner indices of its
/// triangles.
fn remake<T: Copy>(fan: &mut [[T; 3]], parts: &[[usize; 3]]) {
    let corners = corners_of(fan);
    fan.iter_mut().zip(parts).for_each(|(triangle, part)| *triangle = part.map(|corner| corners[corner]));
}

fn shape_of(element: &Element) -> Option<Shape> {
    match element.name.as_str() {
        "face" => Some(Shape::Polygon),
        "tristrips" => Some(Shape::Strip),
        _ => None,
    }
}

fn role(element: &Element, property: &Property) -> Role {
    match (shape_of(element), property.kind, property.name.as_str()) {
        (Some(_), Kind::List { .. }, "vertex_indices" | "vertex_index") => Role::Corners,
        (Some(Shape::Polygon), Kind::List { .. }, "texcoord") => Role::Texture,
        (Some(Shape::Polygon), Kind::Scalar(_), "texnumber") => Role::TextureNumber,
        (Some(_), Kind::Scalar(_), name) => face_colors::channel(name).map_or(Role::Unused, Role::Color),
        _ => Role::Unused,
    }
}
