//! Scenes made of some surfels of another scene, or of all its surfels in another order.

use rayon::prelude::*;

use super::{Colors, Scene};

/// The values at these indices; an empty list stays empty.
fn at<T: Copy + Send + Sync>(values: &[T], indices: &[u32]) -> Vec<T> {
    if values.is_empty() { Vec::new() } else { indices.par_iter().map(|&index| values[index as usize]).collect() }
}

/// Replaces a list by its values at these indices.
fn reorder<T: Copy + Send + Sync>(values: &mut Vec<T>, indices: &[u32]) {
    *values = at(values, indices);
}

impl Scene {
    /// The surfels at `indices`, in that order, with the other contents of this scene. Levels of
    /// detail are dropped, as the surfels are in no tree's order.
    #[must_use]
    pub fn taken(&self, indices: &[u32]) -> Self {
        let places = || indices.iter().map(|&index| index as usize).collect::<Vec<_>>();
        let mut provenance = self.provenance.clone();
        provenance.reorder(indices);
        Self {
            surfels: at(&self.surfels, indices),
            low: at(&self.low, indices),
            clips: at(&self.clips, indices),
            caps: at(&self.caps, indices),
            thirds: at(&self.thirds, indices),
            normals: at(&self.normals, indices),
            fades: at(&self.fades, indices),
            colors: match &self.colors {
                Colors::Constant(color) => Colors::Constant(*color),
                Colors::Srgb8(codes) => Colors::Srgb8(at(codes, indices)),
                Colors::Linear(colors) => Colors::Linear(at(colors, indices)),
                Colors::Textured(textured) => Colors::Textured(textured.taken(&places())),
                Colors::Harmonics(harmonics) => Colors::Harmonics(harmonics.taken(&places())),
            },
            hierarchy: None,
            triangles: self.triangles.clone(),
            provenance,
            part_of: self.part_of.clone(),
            ..*self
        }
    }

    /// As [`Scene::taken`], but consumes the scene: lists are replaced one by one, which saves
    /// memory.
    #[must_use]
    pub fn into_order(mut self, indices: &[u32]) -> Self {
        let places = || indices.iter().map(|&index| index as usize).collect::<Vec<_>>();
        reorder(&mut self.surfels, indices);
        reorder(&mut self.low, indices);
        reorder(&mut self.clips, indices);
        reorder(&mut self.caps, indices);
        reorder(&mut self.thirds, indices);
        reorder(&mut self.normals, indices);
        reorder(&mut self.fades, indices);
        match &mut self.colors {
            Colors::Constant(_) => {}
            Colors::Srgb8(codes) => reorder(codes, indices),
            Colors::Linear(colors) => reorder(colors, indices),
            Colors::Textured(textured) => *textured = textured.taken(&places()),
            Colors::Harmonics(harmonics) => *harmonics = harmonics.taken(&places()),
        }
        self.provenance.reorder(indices);
        self.hierarchy = None;
        self
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::scene::{Provenance, Surfel};

    #[test]
    fn surfels_keep_what_they_have_and_where_they_came_from() {
        let surfels: Vec<Surfel> = (0..5).map(|k| Surfel::disk(Vec3::splat(k as f32), Vec3::Z, 1.0)).collect();
        let mut provenance = Provenance::default();
        provenance.push(0, vec![0], None);
        provenance.push(2, vec![], None);
        let colors = Colors::Srgb8((0..5).map(|k| [k, 0, 0, 255]).collect());
        let scene = Scene { surfels, colors, provenance, ..Scene::default() };
        let first = scene.taken(&[3, 1, 4, 0, 2]);
        assert_eq!(first.surfels[0], scene.surfels[3]);
        assert_eq!(first.colors.linear(2), scene.colors.linear(4));
        let points = |scene: &Scene| (0..5).map(|k| scene.provenance.of(k)).collect::<Vec<_>>();
        assert_eq!(points(&scene), [(0, 1), (0, 2), (1, 0), (1, 1), (1, 2)]);
        assert_eq!(points(&first), [(1, 1), (0, 2), (1, 2), (0, 1), (1, 0)]);
        // A second permutation composes with the first.
        assert_eq!(points(&first.taken(&[3, 1, 4, 0, 2])), points(&scene.taken(&[0, 1, 2, 3, 4])));
    }
}
