//! The points that views see.

use rayon::prelude::*;

use glam::{DVec2, DVec3};

use super::{Renderer, Scene, View};
use crate::error::{Error, Result};
use crate::io::{Points, settle_colors};
use crate::options::{DeviceOptions, RenderOptions};
use crate::progress::Progress;
use crate::scene::camera::Projection;
use crate::scene::{self, Camera, Epsilon, Map, Samples, Surfel};
use crate::surfels::gather::gather;
use crate::surfels::vertex_colors;

/// The number of views that see each point of a scene.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Visible {
    /// For each input, and for each of its points in order, the number of views that see it.
    pub views: Vec<Vec<u32>>,
    /// For each view, the number of points that it sees.
    pub points: Vec<u64>,
}

impl Scene {
    /// Counts the views that see each point of a scene in memory ([`Scene::from_points`]).
    ///
    /// A view sees a point that lies in its image if no surface lies in front of it by more than
    /// the tolerance `epsilon` of the options. The depth of the surface is that of the pixel with
    /// the point in it, the nearest one, at one sample a pixel. The point's disk, where it has one,
    /// is extended to the centre of that pixel, as a surface seen aslant is deeper there.
    ///
    /// # Errors
    ///
    /// [`Error::Usage`] for a scene of files, and the errors of [`Renderer::of_views`] and
    /// [`Renderer::frame`].
    pub fn visible(
        &self,
        views: &[View],
        options: &RenderOptions,
        device: &DeviceOptions,
        progress: &dyn Progress,
    ) -> Result<Visible> {
        let points = self.points(progress)?;
        if points.is_empty() {
            let what = "points that views see are found in memory: read the files and make a scene of their points";
            return Err(Error::Usage(what.into()));
        }
        let mut options = options.clone();
        options.maps.aov = vec![Map::Depth];
        options.look.samples = Some(Samples::ONE);
        let mut renderer = Renderer::of_views(self, &options, device, progress)?;
        let own = own_surfels(&points, renderer.scene());
        let empty = points.iter().map(|points| vec![0; points.positions.len()]).collect();
        let mut visible = Visible { views: empty, points: Vec::with_capacity(views.len()) };
        progress.begin("looking at points", views.len() as u64);
        for view in views {
            let picture = renderer.frame(view, &())?;
            let scene = renderer.scene();
            let epsilon = renderer.settings().epsilon;
            let depths = picture.frame.map(Map::Depth).unwrap_or_default();
            let eye = Eye { camera: &picture.camera, depths, epsilon };
            let inputs = points.iter().zip(&own).zip(&mut visible.views);
            let seen = inputs.map(|((points, own), counts)| eye.count(points, (scene, own), counts));
            visible.points.push(seen.sum());
            progress.advance(1);
        }
        progress.end();
        Ok(visible)
    }
}

impl Visible {
    /// Returns the points that at least `least` views see, as one cloud in the order of the inputs,
    /// and the number of views of each. There are no triangles and no levels of detail; the
    /// vertices of a mesh have the mean colours of the triangles around them, as in a cloud.
    ///
    /// # Errors
    ///
    /// The errors of joining inputs, such as more than 2^32 - 1 points.
    pub fn of_points(&self, inputs: &[Points], least: u32) -> Result<(Points, Vec<u32>)> {
        let mut views: Vec<Vec<u32>> = Vec::new();
        let mut copies = inputs.to_vec();
        settle_colors(&mut copies);
        let part = |(mut points, counts): (Points, &Vec<u32>)| {
            let keep: Vec<bool> = counts.iter().map(|count| *count >= least).collect();
            points.colors = vertex_colors(&points).or(points.colors);
            (points.faces, points.beside, points.tree, points.whole) = (None, None, None, None);
            points.retain(&keep);
            (points.left_out, points.numbers) = (Vec::new(), None);
            views.push(counts.iter().copied().filter(|count| *count >= least).collect());
            points
        };
        let parts: Vec<Points> = copies.into_iter().zip(&self.views).map(part).collect();
        if parts.iter().all(|points| points.positions.is_empty()) {
            return Ok((Points::default(), Vec::new()));
        }
        let gathered = gather(parts)?;
        let of_point = |index: usize| {
            let (input, number) = gathered.provenance.of(index as u64);
            views.get(input as usize)?.get(number as usize).copied()
        };
        let counts = (0..gathered.points.positions.len()).map(|index| of_point(index).unwrap_or_default());
        let counts = counts.collect();
        Ok((gathered.points, counts))
    }
}

/// Index of no surfel.
const NONE: u32 = u32::MAX;

/// Returns the index of a surfel of each point, [`NONE`] for points that became no surfel.
fn own_surfels(inputs: &[Points], scene: &scene::Scene) -> Vec<Vec<u32>> {
    let mut own: Vec<Vec<u32>> = inputs.iter().map(|points| vec![NONE; points.positions.len()]).collect();
    for index in 0..scene.surfels.len() as u32 {
        let (input, number) = scene.provenance.of(index.into());
        let Some(points) = inputs.get(input as usize) else { continue };
        // The number counts the points of the file, also those that the reader left out.
        let before = points.left_out.partition_point(|left_out| *left_out < number);
        if let Some(place) = own[input as usize].get_mut(number as usize - before) {
            *place = index;
        }
    }
    own
}

/// The largest difference between the depths of a vertex and of the surface at the centre of its
/// pixel, in widths of the pixel: that of a surface 80 degrees aslant.
const STEEPEST: f64 = 6.0;

/// A camera and what it sees.
struct Eye<'a> {
    camera: &'a Camera,
    /// The depth of each pixel, +inf where there is nothing.
    depths: &'a [f32],
    epsilon: Epsilon,
}

impl Eye<'_> {
    /// Adds 1 to the count of each point that is seen; returns the number of these points.
    fn count(&self, points: &Points, (scene, own): (&scene::Scene, &[u32]), counts: &mut [u32]) -> u64 {
        let normal = |index: usize| {
            let normal = points.normals.as_ref().and_then(|normals| normals.get(index));
            normal.map(|normal| DVec3::from_array(normal.map(f64::from)))
        };
        let points = points.positions.par_iter().zip(own).zip(counts).enumerate();
        let seen = points.map(|(index, ((position, own), count))| {
            let seen = self.sees(DVec3::from_array(*position), scene.surfels.get(*own as usize), normal(index));
            *count += u32::from(seen);
            u64::from(seen)
        });
        seen.sum()
    }

    /// Whether the point is seen: its depth, or that of its own surfel or of the plane across its
    /// `normal` at the centre of its pixel, is within epsilon of the nearest one.
    fn sees(&self, point: DVec3, own: Option<&Surfel>, normal: Option<DVec3>) -> bool {
        let camera = self.camera;
        let at = camera.to_camera(point);
        let Some((DVec2 { x, y }, own_depth)) = camera.image(at) else { return false };
        let along = match camera.projection {
            Projection::Pinhole => own_depth,
            Projection::Orthographic => 1.0,
        };
        // Comparisons with NaN are false.
        if !(x >= 0.0 && y >= 0.0 && x < f64::from(camera.width) && y < f64::from(camera.height)) {
            return false;
        }
        let (x, y) = (x as u32, y as u32);
        let Some(nearest) = self.depths.get(y as usize * camera.width as usize + x as usize) else { return false };
        let radius = match (own, self.epsilon) {
            (Some(own), _) => own.shorter().into(),
            // The vertices of triangles have no radius, so the other part of the tolerance decides.
            (None, Epsilon::Bounded { .. }) => f64::INFINITY,
            (None, _) => 0.0,
        };
        let plane = match (own, normal) {
            (Some(own), _) => {
                let [s, t] = [own.s, own.t].map(|axis| DVec3::from_array(axis.map(f64::from)));
                Some((s.cross(t), s.length().max(t.length())))
            }
            // A vertex stands for the triangles around it, within the steepest slope that counts.
            (None, normal) => normal.map(|normal| (normal, STEEPEST * along.abs() / camera.fx.min(camera.fy))),
        };
        let depth = plane.map_or(own_depth, |plane| self.depth_at((point, own_depth), plane, (x, y)));
        depth <= self.epsilon.farthest((*nearest).into(), radius, camera.along_axis(x, y))
    }

    /// The depth of the plane through a point, across `normal`, on the ray through the centre of a
    /// pixel; at most `longer` from the point's own depth.
    fn depth_at(&self, (point, depth): (DVec3, f64), (normal, longer): (DVec3, f64), (x, y): (u32, u32)) -> f64 {
        let (x, y) = (f64::from(x) + 0.5, f64::from(y) + 0.5);
        let there = normal.dot(point - self.camera.ray_start(x, y)) / normal.dot(self.camera.ray(x, y));
        if there.is_finite() { there.clamp(depth - longer, depth + longer) } else { depth }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::io::Paint;
    use crate::io::points::Faces;
    use crate::scene::Colors;

    #[test]
    fn vertices_keep_the_colours_of_their_triangles() {
        let (red, blue) = ([1.0, 0.0, 0.0, 1.0], [0.0, 0.0, 1.0, 1.0]);
        let paint = Paint { colors: vec![red, blue], ..Paint::default() };
        let triangles = vec![[0, 1, 2], [1, 3, 2]];
        let mesh = Points {
            positions: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]],
            faces: Some(Faces { triangles, normals: None, paint: Some(Box::new(paint)) }),
            ..Points::default()
        };
        let visible = Visible { views: vec![vec![1, 0, 2, 3]], points: vec![3] };
        let (seen, counts) = visible.of_points(std::slice::from_ref(&mesh), 1).unwrap();
        assert_eq!((seen.positions.len(), counts), (3, vec![1, 2, 3]));
        assert_eq!(seen.colors, Some(Colors::Linear(vec![red, [0.5, 0.0, 0.5, 1.0], blue])));
        // The colours of vertices take precedence.
        let own = vec![[0.25, 0.5, 0.75, 1.0]; 4];
        let colored = Points { colors: Some(Colors::Linear(own.clone())), ..mesh };
        let (seen, _) = visible.of_points(&[colored], 1).unwrap();
        assert_eq!(seen.colors, Some(Colors::Linear(own[..3].to_vec())));
    }
}
