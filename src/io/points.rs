//! The content of one input file, before it becomes surfels.

use std::collections::BTreeMap;
use std::path::PathBuf;

use super::about::About;
use super::color_range::RawColors;
use super::{Column, Paint, Span, Tree};
pub use crate::scene::Up;
use crate::scene::color::srgb_to_linear;
use crate::scene::{Cap, Clip, Colors, Whole};

/// Points as a file gives them: f64 world coordinates and whatever attributes exist.
///
/// A reader returns all points except deleted ones, and repairs nothing. Non-finite coordinates,
/// zero normals and radii that are not positive stay as they are; [`crate::surfels::build`] drops
/// or estimates them, and counts them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Points {
    /// World coordinates.
    pub positions: Vec<[f64; 3]>,
    /// A normal per point, of any length; zero or non-finite means missing.
    pub normals: Option<Vec<[f32; 3]>>,
    /// A disk radius per point, world units; non-positive or non-finite means missing.
    pub radii: Option<Vec<f32>>,
    /// Half-axes s and t of an elliptical disk per point, world units, with the normal s x t. They
    /// replace normal and radius where they span an ellipse; half-axes that are zero, parallel or
    /// non-finite mean missing.
    pub axes: Option<Vec<[[f32; 3]; 2]>>,
    /// Clip lines of the disks with these half-axes.
    pub clips: Option<Vec<Clip>>,
    /// Curvature of the disks with these half-axes.
    pub caps: Option<Vec<Cap>>,
    /// The third half-axis of each point, perpendicular to these half-axes, world units: the points
    /// are 3D Gaussians.
    pub thirds: Option<Vec<f32>>,
    /// Colours: [`Colors::Srgb8`], [`Colors::Linear`] or [`Colors::Harmonics`].
    pub colors: Option<Colors>,
    /// Colours and intensities as they are in the file, until
    /// [`settle_colors`](super::settle_colors) converts them to [`colors`](Self::colors).
    pub raw: Option<Box<RawColors>>,
    /// The points are Gaussians, whose colours are sRGB codes
    /// ([`Scene::encoded`](crate::scene::Scene::encoded)).
    pub encoded: bool,
    /// Counts and thickness of the ellipsoids that were flattened to surfels.
    pub flattened: Option<Flattened>,
    /// Texture coordinates (u, v) per point, origin bottom left as in OBJ.
    pub texture: Option<Vec<[f32; 2]>>,
    /// The index of each point's texture, if there are several; [`u32::MAX`] means none.
    pub texture_numbers: Option<Vec<u32>>,
    /// The change of u and of v per world unit along x, y and z, per point; all zero if unknown.
    pub texture_slopes: Option<Vec<[[f32; 3]; 2]>>,
    /// The up direction of the format's convention.
    pub up: Option<Up>,
    /// Radii are such that disks at a mesh's vertices cover its triangles.
    pub of_mesh: bool,
    /// The triangles of the mesh whose vertices are the points.
    pub faces: Option<Faces>,
    /// Levels of detail. The points are in the order of this tree.
    pub tree: Option<Tree>,
    /// Facts about the whole scene, for readers of a part of it; only with a tree.
    pub whole: Option<Box<Whole>>,
    /// The sign of the normals is arbitrary: they do not tell the two sides of a surface apart.
    pub unsided: bool,
    /// A mesh file to draw together with these surfels: the part of the original mesh that they do
    /// not replace.
    pub beside: Option<PathBuf>,
    /// The points are the vertices of a closed mesh that faces outward, or surfels that cover such
    /// a mesh. The back of the surface is visible only from inside.
    pub closed: bool,
    /// The number of points of each class, without deleted ones; only for laser scans.
    pub classes: BTreeMap<u8, u64>,
    /// The number of points that were left out because the file marks them as withheld (deleted).
    pub withheld: u64,
    /// The number of points that were left out because their class has the opacity 0.
    pub unseen: u64,
    /// The number of points that were left out because they do not pass the filter of
    /// [`ReadOptions::wanted`](super::ReadOptions::wanted).
    pub filtered: u64,
    /// The attribute to colour the points by, until they have their colours.
    pub column: Option<Box<Column>>,
    /// The ranges of all attributes, if the reader was asked for them.
    pub spans: Vec<Span>,
    /// The number of mesh vertices that were left out because no triangle uses them.
    pub loose: u64,
    /// The number of triangles that were left out because a coordinate is not finite or too large.
    pub broken: u64,
    /// The number of mesh vertices that were left out because all their triangles have no area or
    /// are [`broken`](Self::broken).
    pub stranded: u64,
    /// The number of a mesh's surfels whose colour is the mean of the image on their triangle.
    pub averaged: u64,
    /// Parts of the file that could not be read and were left out: one sentence for each file, with
    /// names and counts.
    pub unread: Vec<String>,
    /// Sorted indices of the file's points that were left out; the first point has 0.
    pub left_out: Vec<u64>,
    /// For each surfel, the index of its point among those that are kept, if a point may have
    /// several surfels, or only a part of the file was read.
    pub numbers: Option<Vec<u32>>,
    /// Sentences about what is odd in the file, could not be read, or is drawn differently than a
    /// user may expect.
    pub notes: Vec<String>,
    /// The file's description of itself, if [`ReadOptions::describe`](super::ReadOptions::describe)
    /// asks for it.
    pub about: Option<Box<About>>,
}

/// Ellipsoids that became surfels without their shortest half-axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Flattened {
    /// The number of ellipsoids.
    pub count: u64,
    /// The number of those whose shortest half-axis is longer than a tenth of the middle one.
    pub thick: u64,
    /// The median ratio of the shortest half-axis to the middle one; for several files, the largest
    /// of their medians.
    pub ratio: f64,
}

impl Flattened {
    /// Joins the counts of two inputs.
    pub(crate) fn of_both(one: Option<Self>, other: Option<Self>) -> Option<Self> {
        let (Some(one), Some(other)) = (one, other) else { return one.or(other) };
        let (count, thick) = (one.count + other.count, one.thick + other.thick);
        Some(Self { count, thick, ratio: one.ratio.max(other.ratio) })
    }

    /// A sentence for users.
    pub(crate) fn sentence(&self) -> String {
        let Self { count, thick, ratio } = self;
        format!(
            "{count} ellipsoids became surfels without their shortest axis: {thick} were thicker than a tenth of their width, and the \
             median thickness is {ratio:.3} of the width"
        )
    }
}

/// The triangles of a mesh.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Faces {
    /// The vertex indices of each triangle, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Normals of the triangles' corners from the file, any length; zero or non-finite means
    /// missing.
    pub normals: Option<Vec<[[f32; 3]; 3]>>,
    /// Colours and images of the triangles, beside the vertices' colours.
    pub paint: Option<Box<Paint>>,
}

impl Points {
    /// Whether the triangles, or the points if there are none, have texture coordinates.
    pub fn has_places(&self) -> bool {
        let paint = self.faces.as_ref().and_then(|faces| faces.paint.as_ref());
        self.texture.is_some() || self.of_mesh && paint.is_some_and(|paint| !paint.places.is_empty())
    }

    /// Converts the colours to linear light that is the same from every direction.
    ///
    /// Harmonics are reduced to their constant colours, with negative channels set to 0.
    #[must_use]
    pub fn in_light(mut self) -> Self {
        if let Some(Colors::Harmonics(harmonics)) = self.colors {
            let colors = harmonics.colors().iter().map(|[r, g, b, a]| [r.max(0.0), g.max(0.0), b.max(0.0), *a]);
            self.colors = Some(Colors::Linear(colors.collect()));
        }
        if let (true, Some(Colors::Linear(colors))) = (std::mem::take(&mut self.encoded), &mut self.colors) {
            for color in colors {
                let [r, g, b, a] = *color;
                let [r, g, b] = [r, g, b].map(|code| srgb_to_linear(code.into()) as f32);
                *color = [r, g, b, a];
            }
        }
        self
    }

    /// Keeps the points whose flag is set, in all per-point arrays.
    ///
    /// A surface without some of its points is not closed, and its tree is dropped.
    /// [`Provenance`](crate::scene::Provenance) records which points of the file remain.
    pub(crate) fn retain(&mut self, keep: &[bool]) {
        self.closed &= keep.iter().all(|keep| *keep);
        self.tree = self.tree.take().filter(|_| keep.iter().all(|keep| *keep));
        self.whole = self.whole.take().filter(|_| self.tree.is_some());
        retain(&mut self.positions, keep);
        self.normals.iter_mut().for_each(|all| retain(all, keep));
        self.radii.iter_mut().for_each(|all| retain(all, keep));
        self.axes.iter_mut().for_each(|all| retain(all, keep));
        self.clips.iter_mut().for_each(|all| retain(all, keep));
        self.caps.iter_mut().for_each(|all| retain(all, keep));
        self.thirds.iter_mut().for_each(|all| retain(all, keep));
        self.texture.iter_mut().for_each(|all| retain(all, keep));
        self.texture_numbers.iter_mut().for_each(|all| retain(all, keep));
        self.texture_slopes.iter_mut().for_each(|all| retain(all, keep));
        self.colors.iter_mut().for_each(|all| retain_colors(all, keep));
        self.column.iter_mut().for_each(|column| retain(&mut column.values, keep));
    }
}

/// Gathers positions, colours and texture coordinates of the points with the indices `of`, in that
/// order; indices may repeat.
pub(crate) fn taken(points: Points, of: Vec<u32>) -> Points {
    fn each<T: Copy>(values: &[T], of: &[u32]) -> Vec<T> {
        of.iter().map(|&index| values[index as usize]).collect()
    }
    let colors = match points.colors {
        Some(Colors::Srgb8(codes)) => Some(Colors::Srgb8(each(&codes, &of))),
        Some(Colors::Linear(colors)) => Some(Colors::Linear(each(&colors, &of))),
        other => other,
    };
    Points {
        positions: each(&points.positions, &of),
        colors,
        texture: points.texture.map(|texture| each(&texture, &of)),
        texture_numbers: points.texture_numbers.map(|numbers| each(&numbers, &of)),
        texture_slopes: points.texture_slopes.map(|slopes| each(&slopes, &of)),
        numbers: Some(of),
        tree: None,
        whole: None,
        ..points
    }
}

/// Keeps the values whose flag is set.
pub(crate) fn retain<T>(values: &mut Vec<T>, keep: &[bool]) {
    let mut flags = keep.iter();
    values.retain(|_| flags.next().copied().unwrap_or(false));
}

pub(super) fn retain_colors(colors: &mut Colors, keep: &[bool]) {
    match colors {
        Colors::Srgb8(codes) => retain(codes, keep),
        Colors::Linear(colors) => retain(colors, keep),
        Colors::Constant(_) => {}
        Colors::Harmonics(harmonics) => {
            let kept = keep.iter().enumerate().filter(|(_, keep)| **keep).map(|(index, _)| index);
            *harmonics = harmonics.taken(&kept.collect::<Vec<_>>());
        }
        Colors::Textured(textured) => {
            let kept = keep.iter().enumerate().filter(|(_, keep)| **keep).map(|(index, _)| index);
            *textured = textured.taken(&kept.collect::<Vec<_>>());
        }
    }
}
