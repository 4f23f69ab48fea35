//! The triangles of a PLY file: polygons of the element `face`, strips of the element `tristrips`.

use super::face_colors;
use super::header::{Element, Kind, Property, Scalar};
use super::vertex::is_tree;
use super::whole::is_whole;
use crate::io::fault::Fault;
use crate::io::polygon;
use glam::DVec3;

/// How a list of vertices becomes triangles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Shape {
    /// One polygon.
    Polygon,
    /// Each vertex makes a triangle with the two before it, every second one turned round; -1 begins another strip.
    Strip,
}

/// What a property of a face is read for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Role {
    /// The list of its vertices.
    Corners,
    /// The list of its texture coordinates: u and v of each corner, as MeshLab writes them.
    Texture,
    /// The number of its texture.
    TextureNumber,
    /// A channel of its colour: red, green, blue or alpha.
    Color(usize),
    /// Nothing.
    Unused,
}

/// Triangles while they are read, and the row that they are read from.
#[derive(Debug, Default)]
pub(super) struct Faces {
    triangles: Vec<[u32; 3]>,
    /// The polygons of more than three corners: their first triangle, and how many.
    polygons: Vec<(usize, usize)>,
    /// Whether rows may have texture coordinates, and numbers of textures.
    placed: bool,
    numbered: bool,
    /// The types of the channels of colours, of which those of alpha may be absent; none where rows
    /// have no colours.
    channels: Option<[Option<Scalar>; 4]>,
    /// Colours of the triangles, one each, as the file has them; not a number for those without.
    /// None if no row has any.
    colors: Vec<[f32; 4]>,
    /// Texture coordinates of the triangles, one each, or as many as there were before the first face without.
    texture: Vec<[[f32; 2]; 3]>,
    /// Which of the file's textures each triangle has.
    texture_numbers: Vec<u32>,
    shape: Option<Shape>,
    /// Which corner of the row is next, and where its triangles begin.
    corner: usize,
    first: usize,
    /// The corners of each of the row's triangles, by their number in the row.
    corners: Vec<[usize; 3]>,
    /// The row's texture coordinates, and its texture.
    row_texture: Vec<f32>,
    row_number: u32,
    /// The row's colour.
    row_color: [f32; 4],
    /// The last two vertices of a strip, or the first and the last one of a polygon, with their numbers in the row.
    kept: [Option<(u32, usize)>; 2],
    /// Whether the next triangle of the strip is turned round.
    odd: bool,
}

/// The elements up to the last one that is read, by some reader: what ends before it is told.
pub(super) fn needed(elements: &[Element]) -> &[Element] {
    let read =
        |element: &Element| element.name == "vertex" || is_tree(element) || is_whole(element) || Faces::are(element);
    &elements[..elements.iter().rposition(read).map_or(0, |last| last + 1)]
}

/// What the faces of a file are.
#[derive(Debug, Default)]
pub(super) struct Triangles {
    pub(super) triangles: Vec<[u32; 3]>,
    /// Texture coordinates of each corner, if every face has some.
    pub(super) texture: Option<Vec<[[f32; 2]; 3]>>,
    /// Which of the file's textures each triangle has; the first, if no row says it.
    pub(super) texture_numbers: Vec<u32>,
    /// The linear colour of each triangle, straight alpha, if faces have any.
    pub(super) colors: Option<Vec<[f32; 4]>>,
}

impl Faces {
    /// Whether an element lists the vertices of faces.
    pub(super) fn are(element: &Element) -> bool {
        element.properties.iter().any(|property| role(element, property) == Role::Corners)
    }

    /// What each property of an element is read for.
    pub(super) fn roles(&mut self, element: &Element) -> Vec<Role> {
        let mut found = false;
        let mut role = |property: &Property| match role(element, property) {
            // The first list of vertices is theirs.
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

    /// Begins a row.
    pub(super) fn begin(&mut self, element: &Element) {
        self.shape = shape_of(element);
        (self.kept, self.odd) = ([None, None], false);
        (self.corner, self.first, self.row_number) = (0, self.triangles.len(), 0);
        self.row_color = [f32::NAN, f32::NAN, f32::NAN, f32::NAN];
        self.corners.clear();
        self.row_texture.clear();
    }

    /// Takes the next number of a property that is read.
    pub(super) fn take(&mut self, element: &Element, row: u64, role: Role, number: f64) -> Result<(), Fault> {
        match role {
            Role::Corners => self.vertex(element, row, number)?,
            Role::Texture => self.row_texture.push(number as f32),
            // A cast takes what is no number of a texture for that of none.
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
                "row {row} of element '{name}' names the vertex {number}, which cannot be"
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
                // Strips turn corners by triangles without area.
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

    /// Ends a row: its triangles get their texture coordinates, in whichever order the row gave the two.
    pub(super) fn end(&mut self) {
        let made = self.triangles.len() - self.first;
        // Of one that names a vertex twice, triangles are missing.
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

    /// The triangles of a file with these vertices.
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

/// What the corners of a polygon have, of which its fan is made.
fn corners_of<T: Copy>(fan: &[[T; 3]]) -> Vec<T> {
    fan.iter().take(1).flat_map(|&[a, b, _]| [a, b]).chain(fan.iter().map(|&[.., c]| c)).collect()
}

/// Makes of a fan the triangles of the same polygon that are named by its corners.
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
