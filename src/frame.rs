//! The result of a render: colour and maps, row by row from the top.

use crate::scene::{Camera, Maps};

/// An image with its maps. Pixels without an accepted fragment are background: depth +inf, normal 0, weight 0.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Linear RGB, straight alpha.
    pub color: Vec<[f32; 4]>,
    /// Camera-space z, world units.
    pub depth: Option<Vec<f32>>,
    /// World space, unit.
    pub normal: Option<Vec<[f32; 3]>>,
    /// Sum of weights.
    pub weight: Option<Vec<f32>>,
    /// Accepted fragments.
    pub count: Option<Vec<f32>>,
    /// Smallest relative distance to a decision (reference only).
    pub decision: Option<Vec<f32>>,
}

impl Frame {
    /// An empty frame with room for `maps`.
    pub fn new(camera: &Camera, maps: &Maps) -> Self {
        let pixels = camera.pixels();
        let map = |wanted: bool| wanted.then(|| vec![0.0; pixels]);
        Self {
            width: camera.width,
            height: camera.height,
            color: vec![[0.0; 4]; pixels],
            depth: map(maps.depth),
            normal: maps.normal.then(|| vec![[0.0; 3]; pixels]),
            weight: map(maps.weight),
            count: map(maps.count),
            decision: map(maps.decision),
        }
    }

    /// A frame of no rows, to [`append`](Self::append) to.
    pub fn empty(camera: &Camera, maps: &Maps) -> Self {
        let mut frame = Self::new(&Camera { height: 0, ..camera.clone() }, maps);
        let pixels = camera.pixels();
        frame.color.reserve_exact(pixels);
        for map in [&mut frame.depth, &mut frame.weight, &mut frame.count, &mut frame.decision].into_iter().flatten() {
            map.reserve_exact(pixels);
        }
        frame.normal.iter_mut().for_each(|map| map.reserve_exact(pixels));
        frame
    }

    /// Puts the rows of `below` under these; both have the same width and maps.
    pub fn append(&mut self, below: Self) {
        fn join<T>(above: &mut Option<Vec<T>>, below: Option<Vec<T>>) {
            if let (Some(above), Some(below)) = (above, below) {
                above.extend(below);
            }
        }
        self.height += below.height;
        self.color.extend(below.color);
        join(&mut self.depth, below.depth);
        join(&mut self.normal, below.normal);
        join(&mut self.weight, below.weight);
        join(&mut self.count, below.count);
        join(&mut self.decision, below.decision);
    }
}
