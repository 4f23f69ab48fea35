//! The cameras of a study's scenes, and the size of their splats in pixels.

use std::f64::consts::TAU;

use glam::{DMat3, DVec3};

use super::definition::SceneEntry;
use crate::error::Result;
use crate::scene::lens::DEFAULT_FOV;
use crate::scene::{Camera, Lens, Projection, Scene};

/// Returns the cameras of `entry`: the first, and copies turned around the scene's centre.
pub(super) fn cameras([width, height]: [u32; 2], entry: &SceneEntry, scene: &Scene) -> Result<Vec<Camera>> {
    let lens = match entry.ortho {
        Some(height) => Lens::OrthographicHeight(height),
        None => Lens::Fov(entry.fov.unwrap_or(DEFAULT_FOV)),
    };
    let (size, near) = ((width, height), Camera::default_near(scene));
    let center = scene.origin + scene.framed().0.center();
    let target = entry.target.map_or(center, DVec3::from);
    let mut first = match entry.eye {
        Some(eye) => Camera::look_at(size, lens, eye.into(), target, entry.up.map(DVec3::from), scene.up, near)?,
        None => Camera::framing_centers(size, lens, scene, near)?,
    };
    let fill = entry.fill.unwrap_or(1.0);
    match first.projection {
        // Moves the eye along the line of sight, so that the target keeps its place in the image.
        Projection::Pinhole => first.eye = target + (first.eye - target) / fill,
        Projection::Orthographic => (first.fx, first.fy) = (first.fx * fill, first.fy * fill),
    }
    let turned = |view: u32| {
        let turn = DMat3::from_axis_angle(scene.up.axis(), TAU * f64::from(view) / f64::from(entry.views));
        let eye = center + turn * (first.eye - center);
        Camera { eye, rotation: first.rotation * turn.transpose(), ..first.clone() }
    };
    Ok((0..entry.views).map(turned).collect())
}

/// Returns the mean of a splat's longer half-axis in pixels, over all surfels and cameras.
///
/// Each surfel is taken as seen face-on at the depth of its centre. Surfels nearer than the near
/// depth are skipped. The sum is in a fixed order, so the result is reproducible.
pub(super) fn footprint(scene: &Scene, cameras: &[Camera]) -> f64 {
    let (mut sum, mut seen) = (0.0, 0u64);
    for camera in cameras {
        let focal = (camera.fx * camera.fy).sqrt();
        for (index, surfel) in scene.surfels.iter().enumerate() {
            let center = camera.to_camera(scene.origin + scene.center(index));
            if center.z < camera.near {
                continue;
            }
            let depth = if camera.projection == Projection::Pinhole { center.z } else { 1.0 };
            sum += f64::from(surfel.radius()) * focal / depth;
            seen += 1;
        }
    }
    sum / seen.max(1) as f64
}
