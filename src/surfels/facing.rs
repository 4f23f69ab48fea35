//! From points to a scene whose surfels are drawn facing the camera, which needs no normal and so no neighbour.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::build::built;
use super::estimate::{LONE_RADIUS, RADIUS_RANGE};
use super::gather::gather;
use super::mesh::{By, Painting, of_mesh};
use super::spacing::spacing;
use super::{Limits, Preparation, usable_axes, usable_radius};
use crate::io::{Points, settle_colors};
use crate::scene::{PointSize, Scene, body};
use crate::{Progress, Result};

/// The radius of a cloud without radii, in spacings: random points leave `exp(-pi 1.8^2)` of their plane open, 4 parts in 100,000. What
/// is open hides nothing of what lies behind, which then is drawn too.
const RADIUS: f64 = 1.8;

/// Makes one scene of the points of all inputs, to be drawn [facing](crate::plan::RenderOptions::facing) the camera: circles of the
/// points' radii, or of the longer half-axes where they have these; points that have neither take one radius, by how far points lie
/// apart in the mean. All of them are `size` as large.
///
/// # Errors
///
/// Those of [`build`](super::build), and [`Error::Usage`](crate::Error::Usage) for limits out of range.
pub fn build_facing(
    inputs: Vec<Points>,
    size: PointSize,
    limits: &Limits,
    progress: &dyn Progress,
) -> Result<(Scene, Preparation)> {
    limits.check()?;
    let mut inputs = inputs;
    settle_colors(&mut inputs);
    let inputs: Vec<Points> = inputs.into_iter().map(|input| of_mesh(input, By::Vertices, Painting::Means)).collect();
    let mut gathered = gather(inputs)?;
    let points = &mut gathered.points;
    let own = |i: usize| {
        let axes = points.axes.as_ref().and_then(|axes| usable_axes(axes[i]));
        let given = || points.radii.as_ref().and_then(|radii| usable_radius(radii[i]));
        axes.map_or_else(given, |axes| Some(axes.map(Vec3::length).into_iter().fold(0.0, f32::max)))
    };
    let own: Vec<Option<f32>> = (0..points.positions.len()).into_par_iter().map(own).collect();
    let lacking = own.par_iter().filter(|radius| radius.is_none()).count() as u64;
    let common = if let PointSize::Absolute(radius) = size {
        Some(radius)
    } else {
        progress.begin("measuring the spacing", 0);
        let (body, _) = body(points.positions.len(), |index| DVec3::from_array(points.positions[index]));
        let spacing = (lacking > 0).then(|| spacing(&points.positions, &body)).flatten();
        progress.end();
        spacing.map(|spacing| RADIUS * spacing)
    };
    let factor = if let PointSize::Radius(factor) = size { factor } else { 1.0 };
    let all = common.filter(|_| matches!(size, PointSize::Absolute(_)));
    let radius = |own: &Option<f32>| {
        let radius = all.or(own.map(f64::from)).or(common).unwrap_or(LONE_RADIUS);
        (radius * factor).clamp(RADIUS_RANGE.0, RADIUS_RANGE.1) as f32
    };
    points.radii = Some(own.par_iter().map(radius).collect());
    // Of no matter: the camera says where they face.
    points.normals = Some(vec![[0.0, 0.0, 1.0]; own.len()]);
    (points.axes, points.clips, points.caps, points.texture) = (None, None, None, None);
    let ((scene, mut preparation), _) = built(gathered, limits, progress)?;
    preparation.common_radius =
        common.filter(|_| lacking > 0 && all.is_none()).map(|radius| (lacking, factor * radius));
    Ok((Scene { oriented: false, closed: false, hierarchy: None, ..scene }, preparation))
}
