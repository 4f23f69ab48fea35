//! The extent of a scene: numbers for which all of its points are looked at, once.

use std::sync::OnceLock;

use glam::DVec3;

use crate::scene::{Camera, Scene};

/// The extent of one scene, kept from view to view. Each number is computed when it is first asked
/// for, always with the same scene.
#[derive(Default)]
pub(super) struct Extent {
    near: OnceLock<f64>,
    middle: OnceLock<DVec3>,
}

impl Extent {
    /// [`Camera::default_near`] of the scene.
    pub fn near(&self, scene: &Scene) -> f64 {
        *self.near.get_or_init(|| Camera::default_near(scene))
    }

    /// The middle of the box that the default view shows, world coordinates.
    pub fn middle(&self, scene: &Scene) -> DVec3 {
        *self.middle.get_or_init(|| scene.origin + scene.framed().0.center())
    }
}
