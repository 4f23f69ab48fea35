//! What one input file holds, before it becomes surfels.

use std::collections::BTreeMap;
use std::path::PathBuf;

use super::about::About;
use super::color_range::RawColors;
use super::{Paint, Tree};
pub use crate::scene::Up;
use crate::scene::color::srgb_to_linear;
use crate::scene::{Cap, Clip, Colors, Whole};

/// Points as a file gives them: f64 world coordinates and whatever attributes exist.
///
/// A reader reports what it found and, but for deleted points, all of it, and repairs nothing: a non-finite coordinate, a zero normal or a radius that is
/// not positive stay as they are, and [`crate::surfels::build`] drops or estimates them, and counts them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Points {
    /// World coordinates.
    pub positions: Vec<[f64; 3]>,
    /// One normal each, any length; zero or non-finite means missing.
    pub normals: Option<Vec<[f32; 3]>>,
    /// One disk radius each, world units; not positive or not finite means missing.
    pub radii: Option<Vec<f32>>,
    /// Half-axes s and t of one elliptical disk each, world units, with the normal s x t; they stand in for normal and radius
    /// where they span an ellipse. Zero, parallel or non-finite ones mean missing.
    pub axes: Option<Vec<[[f32; 3]; 2]>>,
    /// Where the disks of the half-axes end before their rims.
    pub clips: Option<Vec<Clip>>,
    /// How the disks of the half-axes curve.
    pub caps: Option<Vec<Cap>>,
    /// Colours, [`Colors::Srgb8`], [`Colors::Linear`] or [`Colors::Harmonics`].
    pub colors: Option<Colors>,
    /// Colours and intensities as the file has them, until [`settle_colors`](super::settle_colors)
    /// makes [`colors`](Self::colors) of them.
    pub raw: Option<Box<RawColors>>,
    /// They are Gaussians, whose colours are codes of sRGB ([`Scene::encoded`](crate::scene::Scene::encoded)).
    pub encoded: bool,
    /// They were ellipsoids.
    pub flattened: Option<Flattened>,
    /// Texture coordinates (u, v), origin bottom left as in OBJ.
    pub texture: Option<Vec<[f32; 2]>>,
    /// Which of several textures the coordinates are in; [`u32::MAX`] means none.
    pub texture_numbers: Option<Vec<u32>>,
    /// What u and v gain for a world unit along x, y and z; all zero where it is not known.
    pub texture_slopes: Option<Vec<[[f32; 3]; 2]>>,
    /// The direction that the format, by convention, calls up.
    pub up: Option<Up>,
    /// Radii are those with which disks at the vertices cover the triangles of a mesh.
    pub of_mesh: bool,
    /// The triangles that the points are the vertices of.
    pub faces: Option<Faces>,
    /// Their levels of detail; they are in the order of the tree.
    pub tree: Option<Tree>,
    /// What a reader of a part of them and of their levels of detail must know of all; where there is a tree.
    pub whole: Option<Box<Whole>>,
    /// They have normals that tell no sides.
    pub unsided: bool,
    /// A mesh that they are drawn beside: what is left of the one that they were made of.
    pub beside: Option<PathBuf>,
    /// They are the vertices of a mesh that is closed and faces outward, or surfels that cover one: nobody sees its back who is not
    /// inside.
    pub closed: bool,
    /// How many points the file has of each class, without deleted ones; of a laser scan alone.
    pub classes: BTreeMap<u8, u64>,
    /// Points that the file holds and that were left out, as it marks them as withheld, which is deleted.
    pub withheld: u64,
    /// Points that the file holds and that were left out, as their class has the opacity 0.
    pub unseen: u64,
    /// Vertices of a mesh that the file holds and that were left out, as no triangle names them.
    pub loose: u64,
    /// Triangles of a mesh that were left out, as a corner is nowhere that is drawn.
    pub broken: u64,
    /// Vertices of a mesh that were left out, as their triangles have no area, or a corner that is
    /// nowhere.
    pub stranded: u64,
    /// Surfels of a mesh that have the mean of an image over them.
    pub averaged: u64,
    /// Parts of the file that could not be read and were left out, named and counted: a sentence
    /// each.
    pub unread: Vec<String>,
    /// The numbers, in order, of all points that the file holds and that were left out; they start at 0.
    pub left_out: Vec<u64>,
    /// The number of the point of the file that each one is, where several are one; they start at 0.
    pub numbers: Option<Vec<u32>>,
    /// Sentences about what the reader found odd in the file, could not read, or shows otherwise
    /// than somebody may expect.
    pub notes: Vec<String>,
    /// The file's description of itself, if [`ReadOptions::describe`](super::ReadOptions::describe)
    /// asks for it.
    pub about: Option<Box<About>>,
}

/// Ellipsoids whose shortest half-axis was left out.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Flattened {
    /// All of them.
    pub count: u64,
    /// Those whose shortest half-axis is longer than a tenth of the middle one.
    pub thick: u64,
    /// The median ratio of the two; of several files the largest.
    pub ratio: f64,
}

impl Flattened {
    /// Those of two inputs.
    pub(crate) fn of_both(one: Option<Self>, other: Option<Self>) -> Option<Self> {
        let (Some(one), Some(other)) = (one, other) else { return one.or(other) };
        let (count, thick) = (one.count + other.count, one.thick + other.thick);
        Some(Self { count, thick, ratio: one.ratio.max(other.ratio) })
    }

    /// What a user should hear of it.
    pub(crate) fn sentence(&self) -> String {
        let Self { count, thick, ratio } = self;
        format!(
            "{count} ellipsoids became surfels without their shortest axis: {thick} were thicker than a tenth of their width, half of all \
             than {ratio:.3} of it"
        )
    }
}

/// The triangles of a mesh.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Faces {
    /// The vertices of each, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// The normals that the file gives the corners, any length; zero or non-finite means missing.
    pub normals: Option<Vec<[[f32; 3]; 3]>>,
    /// Their looks beside the colours of their vertices.
    pub paint: Option<Box<Paint>>,
}

impl Points {
    /// Whether triangles, or points where there are none, have places in a texture.
    pub fn has_places(&self) -> bool {
        let paint = self.faces.as_ref().and_then(|faces| faces.paint.as_ref());
        self.texture.is_some() || self.of_mesh && paint.is_some_and(|paint| !paint.places.is_empty())
    }

    /// With colours in linear light that are the same from every side, whatever they were.
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

    /// Keeps what each point has of the points whose flag is set; without some of them they do not cover a closed surface. Which points of the file they are, [`Provenance`](crate::scene::Provenance)
    /// keeps.
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
        self.texture.iter_mut().for_each(|all| retain(all, keep));
        self.texture_numbers.iter_mut().for_each(|all| retain(all, keep));
        self.texture_slopes.iter_mut().for_each(|all| retain(all, keep));
        self.colors.iter_mut().for_each(|all| retain_colors(all, keep));
    }
}

/// The positions, colours and texture coordinates of the points `of`, by their index, which may be there several times.
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
