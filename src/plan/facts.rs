//! What a renderer must know of all surfels together, looked up once and not for each frame.

use crate::scene::{Bounds, Scene, has_copies};

/// The ranges that a scene's values lie in.
#[derive(Clone, Copy, Debug)]
pub struct Facts {
    /// [`Scene::bounds`].
    pub bounds: Bounds,
    /// The box of [`Scene::body`].
    pub body: Bounds,
    /// [`Scene::core`].
    pub core: Bounds,
    /// [`Scene::color_range`].
    pub color: ([f32; 4], [f32; 4]),
    /// [`Scene::largest_radius`].
    pub largest_radius: f32,
    /// One surfel has many copies, which are drawn as one.
    pub copies: bool,
}

impl Facts {
    /// Those of `scene`.
    pub fn of(scene: &Scene) -> Self {
        Self {
            bounds: scene.bounds(),
            body: scene.body().0,
            core: scene.core(),
            color: scene.color_range(),
            largest_radius: scene.largest_radius(),
            copies: has_copies(scene),
        }
    }
}
