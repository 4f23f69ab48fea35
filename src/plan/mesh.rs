//! What a renderer must know of the triangles of a scene, and what they need.

use crate::scene::{Join, Triangles};

/// The counts of a scene's triangles, and what they have.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MeshFacts {
    /// Different places of corners.
    pub vertices: u64,
    /// Triangles.
    pub triangles: u64,
    /// Corners have normals.
    pub normals: bool,
    /// Corners differ in colour.
    pub colored: bool,
}

impl MeshFacts {
    /// Those of `triangles`.
    pub fn of(triangles: &Triangles) -> Self {
        Self {
            vertices: triangles.vertices().len() as u64,
            triangles: triangles.len() as u64,
            normals: !triangles.normals().is_empty(),
            colored: triangles.colors().len() > 1,
        }
    }
}

/// What triangles need.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct MeshNeeds {
    /// What shows where they meet splats.
    pub join: Join,
    /// Corners have normals; else triangles are facets.
    pub normals: bool,
    /// Corners differ in colour.
    pub colored: bool,
    /// The nearest one is found in one pass, by 64-bit atomics.
    pub once: bool,
}

impl MeshNeeds {
    /// Words of the normals of a triangle's corners.
    pub fn normal_words(&self) -> u32 {
        if self.normals { 9 } else { 0 }
    }

    /// Words of a triangle's attributes: normals, then colours.
    pub fn words(&self) -> u32 {
        self.normal_words() + if self.colored { 12 } else { 0 }
    }

    /// The attributes of `triangles`, a record each; before them, if all have one colour, the twelve words of that.
    pub fn records(&self, triangles: &Triangles) -> Vec<f32> {
        let common = triangles.colors().first().filter(|_| !self.colored).into_iter().flatten().flatten().copied();
        let mut words: Vec<f32> = common.collect();
        for triangle in 0..if self.words() > 0 { triangles.len() } else { 0 } {
            words.extend(triangles.normals().get(triangle).into_iter().flatten().flatten());
            words.extend(triangles.colors().get(triangle).filter(|_| self.colored).into_iter().flatten().flatten());
        }
        words
    }
}
