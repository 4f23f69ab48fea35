//! Builds a scene of surfels that face the camera, which needs neither normals nor neighbours.

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

/// The radius in a cloud without radii, in spacings. Random points leave `exp(-pi 1.8^2)` of their
/// plane open, 4 parts in 100,000; through the gaps, whatever lies behind is visible.
const RADIUS: f64 = 1.8;

/// Builds one scene from the points of all inputs, to be drawn
/// [facing](crate::plan::Settings::facing) the camera.
///
/// The surfels are circles with the points' radii, or with the longer half-axes of points that have
/// half-axes. Points with neither share one radius, which is computed from the mean spacing. `size`
/// may scale or replace these radii.
///
/// # Errors
///
/// The errors of [`build`](super::build), and [`Error::Usage`](crate::Error::Usage) for limits out
/// of range.
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
    // Placeholders: the camera determines where the surfels face.
    points.normals = Some(vec![[0.0, 0.0, 1.0]; own.len()]);
    (points.axes, points.clips, points.caps, points.texture) = (None, None, None, None);
    points.thirds = None;
    let ((scene, mut preparation), _) = built(gathered, limits, progress)?;
    preparation.common_radius =
        common.filter(|_| lacking > 0 && all.is_none()).map(|radius| (lacking, factor * radius));
    Ok((Scene { oriented: false, closed: false, hierarchy: None, ..scene }, preparation))
}
