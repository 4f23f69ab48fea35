//! Writes the surfels of a scene and their levels of detail as PLY, without a copy of them.

use std::io::{self, Write};
use std::path::Path;

use glam::DVec3;
use rayon::prelude::*;

use super::rows::Rows;
use super::vertex::NODE_NAMES;
use super::whole;
use super::write::{Color, ColorProperties, Properties, Vertex, longer, normal, write_rows};
use crate::io::atomic::{Output, write_whole};
use crate::scene::color::{DEFAULT_COLOR, srgb8};
use crate::scene::hierarchy::{Node, NodeAndLow};
use crate::scene::{Colors, Hierarchy, Scene, Whole};
use crate::{Progress, Result};

/// Writes the surfels of `scene` and their levels of detail, so that [`read`](super::read) returns
/// them; `beside` is a mesh that is drawn together with the surfels.
///
/// # Errors
///
/// [`Error::Write`](crate::Error::Write) if the system cannot write.
pub fn write_scene(path: &Path, scene: &Scene, beside: Option<&Path>, progress: &dyn Progress) -> Result<()> {
    let (count, whole) = (scene.surfels.len(), Whole::of(scene));
    let levels = scene.hierarchy.as_deref().map(|hierarchy| (hierarchy, Nodes::of(hierarchy, scene)));
    let properties = Properties::of_scene(scene);
    let head = Head {
        properties,
        count: count as u64,
        beside,
        nodes: levels.as_ref().map(|(hierarchy, kind)| (kind.properties(), hierarchy.nodes.len() as u64)),
        whole: whole.as_ref(),
    };
    progress.begin("writing points", count as u64);
    let written = write_whole(path, |out| {
        head.write(out)?;
        let row = |index: usize, rows: &mut Vec<u8>| properties.encode(&vertex(scene, index), rows);
        write_rows(out, count, row, progress)?;
        if let Some((hierarchy, kind)) = &levels {
            let row = |index: usize, rows: &mut Vec<u8>| {
                let low = hierarchy.low.get(index).copied().unwrap_or_default();
                kind.encode(&hierarchy.nodes[index], low, rows);
            };
            write_rows(out, hierarchy.nodes.len(), row, &())?;
        }
        whole.as_ref().map_or(Ok(()), |whole| out.write_all(&whole::bytes(whole)))
    });
    progress.end();
    written
}

/// Writes the same file as [`write_scene`], from surfels in a temporary file and from nodes that
/// arrive level by level.
///
/// # Errors
///
/// [`Error::Write`](crate::Error::Write) if the system cannot write, or nodes cannot be read.
pub(crate) fn write_kept(
    path: &Path,
    (properties, surfels): (Properties, &Rows),
    (kind, whole): (Nodes, &Whole),
    nodes: impl Iterator<Item = Result<Vec<NodeAndLow>>>,
    progress: &dyn Progress,
) -> Result<()> {
    let of_nodes = Some((kind.properties(), whole.nodes.into()));
    let head = Head { properties, count: surfels.count(), beside: None, nodes: of_nodes, whole: Some(whole) };
    write_whole(path, |out| {
        head.write(out)?;
        surfels.copy(out, progress).map_err(io::Error::other)?;
        for nodes in nodes {
            let nodes = nodes.map_err(io::Error::other)?;
            let row = |index: usize, rows: &mut Vec<u8>| kind.encode(&nodes[index].0, nodes[index].1, rows);
            write_rows(out, nodes.len(), row, progress)?;
        }
        out.write_all(&whole::bytes(whole))
    })
}

/// The content of the header.
pub(super) struct Head<'a> {
    pub properties: Properties,
    pub count: u64,
    /// A mesh that is drawn together with the surfels.
    pub beside: Option<&'a Path>,
    /// The properties of nodes, and their number.
    pub nodes: Option<(Properties, u64)>,
    pub whole: Option<&'a Whole>,
}

impl Head<'_> {
    pub fn write(&self, out: &mut Output<'_>) -> io::Result<()> {
        let comments: Vec<String> = self.beside.iter().map(|mesh| format!("triangles {}", mesh.display())).collect();
        self.properties.write_header(out, self.count, &comments)?;
        if let Some((properties, count)) = self.nodes {
            writeln!(out, "element node {count}")?;
            properties.write_properties(out)?;
            let [cone, first, count, leaf] = NODE_NAMES;
            write!(
                out,
                "property float {cone}\nproperty uint {first}\nproperty uint {count}\nproperty uchar {leaf}\n"
            )?;
        }
        if self.whole.is_some() {
            out.write_all(whole::lines().as_bytes())?;
        }
        out.write_all(b"end_header\n")
    }
}

impl Properties {
    /// The properties with which the surfels of `scene` are written without loss, as
    /// [`Properties::of`] has them for points.
    pub(super) fn of_scene(scene: &Scene) -> Self {
        let position = |index| (scene.origin + scene.center(index)).to_array();
        Self {
            double_coordinates: (0..scene.surfels.len()).into_par_iter().any(|index| needs_double(position(index))),
            normals: true,
            radii: true,
            axes: true,
            clips: !scene.clips.is_empty(),
            caps: !scene.caps.is_empty(),
            colors: match &scene.colors {
                Colors::Constant(DEFAULT_COLOR) => ColorProperties::Absent,
                Colors::Srgb8(codes) if codes.par_iter().all(|code| code[3] == 255) => ColorProperties::Srgb8,
                Colors::Srgb8(_) => ColorProperties::Srgb8Alpha,
                _ => ColorProperties::Linear,
            },
            up: Some(scene.up),
            unsided: !scene.oriented,
            closed: scene.closed,
            ..Self::default()
        }
    }
}

/// Whether an f32 would lose digits of a coordinate.
pub(crate) fn needs_double(position: [f64; 3]) -> bool {
    position.iter().any(|c| f64::from(*c as f32) != *c)
}

/// The vertex to write for a surfel.
pub(super) fn vertex(scene: &Scene, index: usize) -> Vertex {
    let surfel = &scene.surfels[index];
    let axes = [surfel.s, surfel.t];
    Vertex {
        position: (scene.origin + scene.center(index)).to_array(),
        normal: scene.normals.get(index).copied().unwrap_or_else(|| normal(axes)),
        radius: longer(axes),
        axes,
        clip: scene.clips.get(index).copied().unwrap_or_default(),
        cap: scene.caps.get(index).copied().unwrap_or_default(),
        color: Some(match &scene.colors {
            Colors::Srgb8(codes) => Color::Srgb8(codes[index]),
            colors => Color::Linear(colors.linear(index)),
        }),
        ..Vertex::default()
    }
}

/// How nodes are written: the properties that all of them together need.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Nodes {
    origin: DVec3,
    /// Colours are 8-bit codes, as those of surfels are.
    coded: bool,
    double: bool,
    caps: bool,
    opaque: bool,
}

impl Nodes {
    /// The smallest set of properties, before any node is known.
    pub fn none(origin: DVec3, coded: bool) -> Self {
        Self { origin, coded, double: false, caps: false, opaque: true }
    }

    fn of(hierarchy: &Hierarchy, scene: &Scene) -> Self {
        let none = Self::none(scene.origin, matches!(scene.colors, Colors::Srgb8(_)));
        let low = |index: usize| hierarchy.low.get(index).copied().unwrap_or_default();
        let nodes = hierarchy.nodes.par_iter().enumerate();
        nodes.fold(|| none, |all, (index, node)| all.with(node, low(index))).reduce(|| none, Self::both)
    }

    /// Adds the properties that another node needs.
    pub fn with(self, node: &Node, low: [f32; 3]) -> Self {
        Self {
            double: self.double || needs_double(self.position(node, low)),
            caps: self.caps || !node.cap.is_flat(),
            // Any alpha below 1 needs the property `alpha`.
            opaque: self.opaque && node.color[3] >= 1.0,
            ..self
        }
    }

    /// Joins the properties that two sets of nodes need.
    pub fn both(self, other: Self) -> Self {
        Self {
            double: self.double || other.double,
            caps: self.caps || other.caps,
            opaque: self.opaque && other.opaque,
            ..self
        }
    }

    /// The properties of nodes: no normal, as it is s x t; `radius` is that of the bounding sphere.
    pub fn properties(&self) -> Properties {
        Properties {
            double_coordinates: self.double,
            radii: true,
            axes: true,
            caps: self.caps,
            colors: match (self.coded, self.opaque) {
                (true, true) => ColorProperties::Srgb8,
                (true, false) => ColorProperties::Srgb8Alpha,
                (false, _) => ColorProperties::Linear,
            },
            ..Properties::default()
        }
    }

    fn position(&self, node: &Node, low: [f32; 3]) -> [f64; 3] {
        let [center, low] = [node.surfel.center, low].map(|part| DVec3::from_array(part.map(f64::from)));
        (self.origin + (center + low)).to_array()
    }

    /// Appends the bytes of a node; `low` is its centre minus the centre rounded to f32, world
    /// units.
    pub fn encode(&self, node: &Node, low: [f32; 3], rows: &mut Vec<u8>) {
        let color = if self.coded { Color::Srgb8(srgb8(node.color)) } else { Color::Linear(node.color) };
        let vertex = Vertex {
            position: self.position(node, low),
            radius: node.radius,
            axes: [node.surfel.s, node.surfel.t],
            cap: node.cap,
            color: Some(color),
            ..Vertex::default()
        };
        self.properties().encode(&vertex, rows);
        rows.extend(node.cone.to_le_bytes());
        rows.extend([node.first, node.count].map(u32::to_le_bytes).as_flattened());
        rows.push(node.leaf.into());
    }
}
