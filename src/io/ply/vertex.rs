//! Maps the properties of a PLY vertex to attributes, and collects vertices as points.

use super::gaussian::{GaussianLayout, Gaussians};
use super::header::{self, Element, Scalar, Tints};
use super::tint::{Tint, code, number};
use crate::io::about::{Attribute, Role};
use crate::io::attributes::{self, find, find_triple};
use crate::io::color_range::{Kind, Number, Numbers, RawColors, Shades, Values};
use crate::io::dimensions::{self, Collector};
use crate::io::fault::{Fault, reserve};
use crate::io::values::finite;
use crate::io::{Points, TreeRow};
use crate::scene::{Cap, Clip, Colors};

/// A property that is used, and where it is in a row.
#[derive(Clone, Copy, Debug)]
pub(super) struct Column {
    /// Index among the row's scalar properties.
    pub(super) slot: usize,
    /// Offset in a binary row, bytes; lists do not count.
    pub(super) offset: usize,
    pub(super) scalar: Scalar,
}

/// Where the attributes are in a row: each number is an index into `columns`.
#[derive(Clone, Debug, Default)]
pub(super) struct Layout {
    pub(super) columns: Vec<Column>,
    /// The types of all scalar properties of a row, used or not, in order.
    pub(super) scalars: Vec<Scalar>,
    /// Size of a binary row's scalar properties, bytes.
    pub(super) row_size: usize,
    position: [usize; 3],
    normal: Option<[usize; 3]>,
    radius: Option<usize>,
    axes: Option<[[usize; 3]; 2]>,
    clip: Option<[usize; 6]>,
    cap: Option<[usize; 3]>,
    pub(super) color: Option<[usize; 3]>,
    alpha: Option<usize>,
    tint: Tint,
    pub(super) intensity: Option<usize>,
    /// epsplat wrote the file, so the range of its colours is known without looking at other files.
    own: bool,
    texture: Option<[usize; 2]>,
    texture_number: Option<usize>,
    texture_slopes: Option<[[usize; 3]; 2]>,
    gaussian: Option<GaussianLayout>,
    /// The columns `cone`, `first`, `count` and `leaf` of a node.
    node: Option<[usize; 4]>,
    /// The attributes that options ask for.
    wants: Option<dimensions::Columns>,
    /// The number of columns that are used without these attributes.
    pub(super) plain: usize,
}

/// Properties of a node beside its ellipse and its colour ([`TreeRow`]).
pub(super) const NODE_NAMES: [&str; 4] = ["cone", "first", "count", "leaf"];

/// Whether an element is the nodes of levels of detail. Other programs may write another element
/// `node`.
pub(super) fn is_tree(element: &Element) -> bool {
    let has = |name: &str| element.properties.iter().any(|property| property.name == name);
    element.name == "node" && ["x", "y", "z", "sx", "tz", "radius"].into_iter().chain(NODE_NAMES).all(has)
}

/// The lines that cut an ellipse ([`Clip`]), in units of its half-axes.
pub(super) const CLIP_NAMES: [&str; 6] = ["clip1_u", "clip1_v", "clip1_w", "clip2_u", "clip2_v", "clip2_w"];

/// The curvature of an ellipse ([`Cap`]), world units.
pub(super) const CAP_NAMES: [&str; 3] = ["cap_uu", "cap_uv", "cap_vv"];

/// Gradients of u and v along x, y and z, per world unit.
pub(super) const SLOPE_NAMES: [[&str; 3]; 2] =
    [["texture_u_x", "texture_u_y", "texture_u_z"], ["texture_v_x", "texture_v_y", "texture_v_z"]];

/// Index of the texture; negative means none. MeshLab's faces have the same property.
pub(super) const NUMBER_NAME: &str = "texnumber";

/// Names of texture coordinates that programs write, the most specific first.
const TEXTURE_NAMES: [[&str; 2]; 5] =
    [["texture_u", "texture_v"], ["texcoord_u", "texcoord_v"], ["s", "t"], ["u", "v"], ["texcoord_s", "texcoord_t"]];

/// The names of a row's scalar properties, and where they are.
fn scalars_of(element: &Element) -> Vec<(&str, Column)> {
    let mut places: Vec<(&str, Column)> = Vec::new();
    let mut offset = 0;
    for property in &element.properties {
        if let header::Kind::Scalar(scalar) = property.kind {
            places.push((&property.name, Column { slot: places.len(), offset, scalar }));
            offset += scalar.size();
        }
    }
    places
}

impl Layout {
    /// Finds the attributes in a row.
    pub(super) fn of(vertex: &Element) -> Result<Self, Fault> {
        let mut layout = Self::without_wants(vertex)?;
        layout.plain = layout.columns.len();
        let places = scalars_of(vertex);
        let names: Vec<String> = places.iter().map(|(name, _)| (*name).to_owned()).collect();
        let column = |field: usize| layout.column_of(places[field].1);
        layout.wants = dimensions::Columns::of(names, &vertex.wanted, column)?;
        Ok(layout)
    }

    /// The index of a property among the columns, to which it is added if necessary.
    fn column_of(&mut self, property: Column) -> usize {
        self.columns.iter().position(|column| column.slot == property.slot).unwrap_or_else(|| {
            self.columns.push(property);
            self.columns.len() - 1
        })
    }

    fn without_wants(vertex: &Element) -> Result<Self, Fault> {
        let places = scalars_of(vertex);
        let scalars = places.iter().map(|(_, column)| column.scalar).collect();
        let row_size = places.iter().map(|(_, column)| column.scalar.size()).sum();
        let mut columns = Vec::new();
        let mut column = |names: &[&str]| -> Option<usize> {
            let found = names.iter().find_map(|name| places.iter().find(|(place, _)| place == name))?;
            columns.push(found.1);
            Some(columns.len() - 1)
        };
        let position = whole_position(["x", "y", "z"].map(|name| column(&[name])))?;
        let has = |name: &str| places.iter().any(|(place, _)| *place == name);
        let scalar_of = |name: &str| places.iter().find(|(place, _)| *place == name).map(|(_, place)| place.scalar);
        let gaussian = GaussianLayout::of(has, |name| column(&[name]).zip(scalar_of(name)))?;
        if gaussian.is_some() {
            return Ok(Self { columns, scalars, row_size, position, gaussian, ..Self::default() });
        }
        let names = places.iter().map(|(name, _)| *name);
        let Tints { own, ignore_alpha } = vertex.tints;
        let found = |slot: usize| [places[slot].0];
        let mut triple = |slots: Option<[usize; 3]>| all(slots?.map(|slot| column(&found(slot))));
        let normal = triple(find_triple(attributes::NORMAL, names.clone()));
        let color = triple(find_triple(attributes::COLOR, names.clone()));
        let alpha = color.filter(|_| !ignore_alpha).and_then(|_| find(attributes::ALPHA, names.clone()));
        let alpha = alpha.and_then(|slot| column(&found(slot)));
        let intensity = find(attributes::INTENSITY, names.clone()).filter(|_| !own);
        let intensity = intensity.and_then(|slot| column(&found(slot)));
        let radius = find(attributes::RADIUS, names.clone()).and_then(|slot| column(&found(slot)));
        let mut axis = |names: [&str; 3]| Some([column(&names[..1])?, column(&names[1..2])?, column(&names[2..])?]);
        let axes = axis(["sx", "sy", "sz"]).zip(axis(["tx", "ty", "tz"])).map(<[_; 2]>::from);
        let cap = axes.and_then(|_| axis(CAP_NAMES));
        let [u_slopes, v_slopes] = SLOPE_NAMES.map(&mut axis);
        let texture_slopes = u_slopes.zip(v_slopes).map(<[_; 2]>::from);
        let clip = axes.and_then(|_| all(CLIP_NAMES.map(|name| column(&[name]))));
        let texture = TEXTURE_NAMES.iter().find_map(|[u, v]| Some([column(&[u])?, column(&[v])?]));
        let texture_number = texture.and_then(|_| column(&[NUMBER_NAME]));
        let node =
            Some(NODE_NAMES).filter(|_| is_tree(vertex)).and_then(|names| all(names.map(|name| column(&[name]))));
        let scalar = |column: usize| columns[column].scalar;
        let tint = color.map(|color| Tint::of(color.map(scalar), alpha.map(scalar), own)).unwrap_or_default();
        Ok(Self {
            columns,
            scalars,
            row_size,
            position,
            normal,
            radius,
            axes,
            clip,
            cap,
            color,
            alpha,
            tint,
            intensity,
            own,
            texture,
            texture_number,
            texture_slopes: texture_slopes.filter(|_| texture.is_some()),
            gaussian: None,
            node,
            wants: None,
            plain: 0,
        })
    }

    /// Whether a row is an ellipse with half-axes and nothing else: not a Gaussian, not textured.
    pub(super) fn has_axes_alone(&self) -> bool {
        self.axes.is_some() && self.gaussian.is_none() && self.texture.is_none()
    }

    /// Whether a row is a disk, by half-axes or by normal and radius: not a Gaussian, not textured.
    pub(super) fn is_disk(&self) -> bool {
        let round = self.normal.is_some() && self.radius.is_some();
        (self.axes.is_some() || round) && self.gaussian.is_none() && self.texture.is_none()
    }

    /// Whether the meaning of colours depends on all rows of the file.
    pub(super) fn is_judged_whole(&self) -> bool {
        self.gaussian.is_none() && !self.own && (self.intensity.is_some() || matches!(self.tint, Tint::Numbers(..)))
    }

    /// Makes all rows show either their colours or their intensities, where they have both.
    pub(super) fn show(&mut self, colors: bool) {
        if colors {
            self.intensity = None;
        } else {
            (self.color, self.alpha) = (None, None);
        }
    }

    /// The attributes of a row, and which of them are used.
    pub(super) fn attributes(&self, vertex: &Element) -> Vec<Attribute> {
        let mut slots = 0..;
        let attribute = |property: &header::Property| {
            let slot = if let header::Kind::Scalar(_) = property.kind { slots.next() } else { None };
            let column = slot.and_then(|slot| self.columns[..self.plain].iter().position(|column| column.slot == slot));
            let is_color = |column: &usize| self.color.iter().flatten().chain(&self.alpha).any(|own| own == column);
            let role = match column {
                Some(column) if is_color(&column) => Role::Color,
                Some(column) if self.intensity == Some(column) => Role::Intensity,
                _ => Role::Other,
            };
            Attribute::new(property.name.clone(), column.is_some(), role)
        };
        vertex.properties.iter().map(attribute).collect()
    }
}

/// All indices, or None if one is missing.
fn all<const N: usize>(indices: [Option<usize>; N]) -> Option<[usize; N]> {
    indices.iter().all(Option::is_some).then(|| indices.map(Option::unwrap_or_default))
}

/// The indices of x, y and z.
///
/// # Errors
/// [`Fault::Malformed`] with the names of those that are missing.
fn whole_position(position: [Option<usize>; 3]) -> Result<[usize; 3], Fault> {
    all(position).ok_or_else(|| {
        let names = ["x", "y", "z"].into_iter().zip(position);
        let missing: Vec<&str> = names.filter(|(_, found)| found.is_none()).map(|(name, _)| name).collect();
        Fault::Malformed(format!("its vertices have no property {}", missing.join(", ")))
    })
}

/// Collects the points of a file block by block.
#[derive(Debug)]
pub(super) struct Vertices<'a> {
    layout: &'a Layout,
    positions: Vec<[f64; 3]>,
    normals: Vec<[f32; 3]>,
    radii: Vec<f32>,
    axes: Vec<[[f32; 3]; 2]>,
    clips: Vec<Clip>,
    caps: Vec<Cap>,
    texture: Vec<[f32; 2]>,
    texture_numbers: Vec<u32>,
    texture_slopes: Vec<[[f32; 3]; 2]>,
    srgb8: Vec<[u8; 4]>,
    /// Colours that are not 8-bit codes: linear light, or numbers whose range is not known yet.
    floats: Vec<[f32; 4]>,
    /// Intensities, collected until a colour that is not zero occurs.
    shades: Vec<f32>,
    /// Some colour is not zero.
    colored: bool,
    gaussians: Option<Gaussians<'a>>,
    rows: Vec<TreeRow>,
    collector: Option<Collector>,
}

impl<'a> Vertices<'a> {
    /// Reserves memory for `rows` points; the caller limits this number by the length of the file.
    pub(super) fn with_capacity(layout: &'a Layout, rows: u64) -> Result<Self, Fault> {
        let (mut positions, mut normals, mut radii) = (Vec::new(), Vec::new(), Vec::new());
        let (mut axes, mut clips, mut caps, mut texture) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        let (mut texture_numbers, mut texture_slopes) = (Vec::new(), Vec::new());
        let (mut srgb8, mut floats, mut shades) = (Vec::new(), Vec::new(), Vec::new());
        reserve(&mut positions, rows)?;
        reserve(&mut normals, if layout.normal.is_some() { rows } else { 0 })?;
        reserve(&mut radii, if layout.radius.is_some() { rows } else { 0 })?;
        reserve(&mut axes, if layout.axes.is_some() { rows } else { 0 })?;
        reserve(&mut clips, if layout.clip.is_some() { rows } else { 0 })?;
        reserve(&mut caps, if layout.cap.is_some() { rows } else { 0 })?;
        reserve(&mut texture, if layout.texture.is_some() { rows } else { 0 })?;
        reserve(&mut texture_numbers, if layout.texture_number.is_some() { rows } else { 0 })?;
        reserve(&mut texture_slopes, if layout.texture_slopes.is_some() { rows } else { 0 })?;
        let (codes, others) = match (layout.color.is_some(), layout.tint) {
            (false, _) => (0, 0),
            (true, Tint::Codes) => (rows, 0),
            (true, _) => (0, rows),
        };
        reserve(&mut srgb8, codes)?;
        reserve(&mut floats, others)?;
        reserve(&mut shades, if layout.intensity.is_some() && layout.color.is_none() { rows } else { 0 })?;
        let mut tree = Vec::new();
        reserve(&mut tree, if layout.node.is_some() { rows } else { 0 })?;
        let gaussians = layout.gaussian.as_ref().map(|own| Gaussians::with_capacity(own, rows)).transpose()?;
        Ok(Self {
            layout,
            positions,
            normals,
            radii,
            axes,
            clips,
            caps,
            texture,
            texture_numbers,
            texture_slopes,
            srgb8,
            floats,
            shades,
            colored: false,
            gaussians,
            rows: tree,
            collector: layout.wants.as_ref().map_or(Ok(None), dimensions::Columns::collector)?,
        })
    }

    pub(super) fn len(&self) -> u64 {
        self.positions.len() as u64
    }

    /// Adds `rows` points; `value(column, row)` gives their numbers, where `column` is an index
    /// into [`Layout::columns`].
    pub(super) fn extend(&mut self, rows: usize, value: impl Fn(usize, usize) -> f64) {
        let layout = self.layout;
        let [x, y, z] = layout.position;
        self.positions.extend((0..rows).map(|row| [value(x, row), value(y, row), value(z, row)]));
        if let (Some(collector), Some(wants)) = (&mut self.collector, &layout.wants) {
            wants.mark(collector, (rows, layout.position), &value);
        }
        if let Some(gaussians) = &mut self.gaussians {
            let position = |row: usize| [x, y, z].map(|column| value(column, row));
            (0..rows).for_each(|row| gaussians.push(position(row), |column| value(column, row)));
        }
        if let Some(normal) = layout.normal {
            self.normals.extend((0..rows).map(|row| normal.map(|column| value(column, row) as f32)));
        }
        if let Some(radius) = layout.radius {
            self.radii.extend((0..rows).map(|row| value(radius, row) as f32));
        }
        if let Some(axes) = layout.axes {
            self.axes.extend((0..rows).map(|row| axes.map(|axis| axis.map(|column| value(column, row) as f32))));
        }
        if let Some(clip) = layout.clip {
            self.clips.extend((0..rows).map(|row| {
                let line = |first: usize| [0, 1, 2].map(|k| value(clip[first + k], row) as f32);
                Clip([line(0), line(3)])
            }));
        }
        if let Some(cap) = layout.cap {
            self.caps.extend((0..rows).map(|row| Cap(cap.map(|column| value(column, row) as f32))));
        }
        if let Some(texture) = layout.texture {
            self.texture.extend((0..rows).map(|row| texture.map(|column| value(column, row) as f32)));
        }
        if let Some(column) = layout.texture_number {
            // The cast turns NaN into 0.
            let number = |number: f64| if number < 0.0 { u32::MAX } else { number as u32 };
            self.texture_numbers.extend((0..rows).map(|row| number(value(column, row))));
        }
        if let Some(slopes) = layout.texture_slopes {
            let slopes = |row: usize| slopes.map(|slope| slope.map(|column| value(column, row) as f32));
            self.texture_slopes.extend((0..rows).map(slopes));
        }
        if let Some([cone, first, count, leaf]) = layout.node {
            // The casts turn invalid numbers into integers with which the tree fails its check.
            self.rows.extend((0..rows).map(|row| TreeRow {
                cone: value(cone, row) as f32,
                first: value(first, row) as u32,
                count: value(count, row) as u32,
                leaf: value(leaf, row) != 0.0,
            }));
        }
        self.extend_colors(rows, &value);
    }

    /// Adds the colours and intensities of `rows` points.
    fn extend_colors(&mut self, rows: usize, value: &impl Fn(usize, usize) -> f64) {
        let layout = self.layout;
        if let Some(color) = layout.color {
            match layout.tint {
                Tint::Codes => self.srgb8.extend((0..rows).map(|row| {
                    let [r, g, b] = color.map(|column| code(value(column, row)));
                    [r, g, b, layout.alpha.map_or(255, |column| code(value(column, row)))]
                })),
                Tint::Light => self.floats.extend((0..rows).map(|row| {
                    let [r, g, b] = color.map(|column| finite(value(column, row)));
                    [r, g, b, layout.alpha.map_or(1.0, |column| finite(value(column, row)))]
                })),
                Tint::Numbers(..) => self.floats.extend((0..rows).map(|row| {
                    let number = |column: usize| number(value(column, row), layout.columns[column].scalar);
                    let [r, g, b] = color.map(number);
                    // A point that lacks a channel has no colour, which red says.
                    let r = if g.is_nan() || b.is_nan() { f32::NAN } else { r };
                    [r, g, b, layout.alpha.map_or(1.0, number)]
                })),
            }
        }
        let Some(intensity) = layout.intensity.filter(|_| !self.colored) else { return };
        let is_colored = |color: [usize; 3]| {
            let own = |row: usize| color.map(|column| value(column, row));
            (0..rows).map(own).any(|own| own.iter().all(|c| !c.is_nan()) && own.iter().any(|c| *c != 0.0))
        };
        if layout.color.is_some_and(is_colored) {
            self.colored = true;
            self.shades = Vec::new();
        } else {
            self.shades.extend((0..rows).map(|row| value(intensity, row) as f32));
        }
    }

    /// The points, the [`TreeRow`]s if they are nodes, and the collected attributes.
    pub(super) fn into_points(self) -> (Points, Vec<TreeRow>, Option<Collector>) {
        let layout = self.layout;
        let count = self.positions.len();
        let (mut colors, mut raw) = (None, None);
        match (layout.color.is_some(), layout.tint) {
            (true, Tint::Light) => colors = Some(Colors::Linear(self.floats)),
            (true, Tint::Codes) if layout.own => colors = Some(Colors::Srgb8(self.srgb8)),
            (has_color, tint) if has_color || layout.intensity.is_some() => {
                let (values, number, alpha) = match tint {
                    Tint::Numbers(number, alpha) => (Values::Floats(self.floats), number, alpha),
                    _ => (Values::Bytes(self.srgb8), Number::Byte, Number::Byte),
                };
                let kind = Kind { light: true, ..Kind::of(number) };
                let numbers = Numbers { values, kind, alpha: layout.alpha.map(|_| alpha) };
                let shades = layout.intensity.filter(|_| !self.colored).map(|column| {
                    let integer = !layout.columns[column].scalar.is_float();
                    Shades::Floats { values: self.shades, integer }
                });
                raw = Some(Box::new(RawColors::of_run(count, has_color.then_some(numbers), shades)));
            }
            _ => {}
        }
        let mut points = Points {
            positions: self.positions,
            normals: layout.normal.map(|_| self.normals),
            radii: layout.radius.map(|_| self.radii),
            axes: layout.axes.map(|_| self.axes),
            clips: layout.clip.map(|_| self.clips),
            caps: layout.cap.map(|_| self.caps),
            colors,
            raw,
            texture: layout.texture.map(|_| self.texture),
            texture_numbers: layout.texture_number.map(|_| self.texture_numbers),
            texture_slopes: layout.texture_slopes.map(|_| self.texture_slopes),
            up: None,
            ..Points::default()
        };
        if let Some(gaussians) = self.gaussians {
            gaussians.finish(&mut points);
        }
        (points, self.rows, self.collector)
    }
}
