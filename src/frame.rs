//! The result of a render: colour and maps, row by row from the top.

use std::collections::BTreeMap;

use rayon::prelude::*;

use crate::hash;
use crate::scene::Camera;
use crate::scene::maps::{Map, Maps};

/// An image with its maps. Pixels without an accepted fragment are background: depth +inf, normal
/// 0, weight 0.
#[derive(Clone, Debug)]
pub struct Frame {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Linear RGB, straight alpha.
    pub color: Vec<[f32; 4]>,
    /// The values of each map, [`Map::width`] per pixel.
    maps: BTreeMap<Map, Vec<f32>>,
}

/// The host memory of a frame while it is encoded and written, bytes per pixel: 48, plus 8 for each
/// value of a map.
pub fn pixel_bytes(maps: Maps) -> u64 {
    48 + 8 * maps.iter().map(|map| map.width() as u64).sum::<u64>()
}

/// Integer maps are compared by their bits, because some are NaN when read as f32.
impl PartialEq for Frame {
    fn eq(&self, other: &Self) -> bool {
        let same = |map: Map| match map.row().numbers {
            true => self.numbers(map) == other.numbers(map),
            false => self.map(map) == other.map(map),
        };
        (self.width, self.height, self.maps()) == (other.width, other.height, other.maps())
            && self.color == other.color
            && self.maps().iter().all(same)
    }
}

impl Frame {
    /// Creates a frame of zeros with `maps`.
    pub fn new(camera: &Camera, maps: Maps) -> Self {
        let pixels = camera.pixels();
        let maps = maps.iter().map(|map| (map, vec![0.0; pixels * map.width()])).collect();
        Self { width: camera.width, height: camera.height, color: vec![[0.0; 4]; pixels], maps }
    }

    /// Creates a frame without rows. It reserves memory for all rows of `camera`, which
    /// [`append`](Self::append) and `extend` add.
    pub fn empty(camera: &Camera, maps: Maps) -> Self {
        let mut frame = Self::new(&Camera { height: 0, ..camera.clone() }, maps);
        let pixels = camera.pixels();
        frame.color.reserve_exact(pixels);
        frame.maps.iter_mut().for_each(|(map, values)| values.reserve_exact(pixels * map.width()));
        frame
    }

    /// Creates a frame of zeros without rows, whose pixels the caller overwrites. The system gives
    /// memory to pixels when they are first written.
    pub(crate) fn sparse(camera: &Camera, maps: Maps) -> Self {
        Self { height: 0, ..Self::new(camera, maps) }
    }

    /// Creates an image of linear RGB and straight alpha, without maps.
    pub fn of_colors(width: u32, height: u32, color: Vec<[f32; 4]>) -> Self {
        Self { width, height, color, maps: BTreeMap::new() }
    }

    /// Adds a map with its `values`, [`Map::width`] per pixel.
    pub fn with(mut self, map: Map, values: Vec<f32>) -> Self {
        self.maps.insert(map, values);
        self
    }

    /// Removes a map.
    pub fn without(mut self, map: Map) -> Self {
        self.maps.remove(&map);
        self
    }

    /// Returns the maps that the frame has.
    pub fn maps(&self) -> Maps {
        self.maps.keys().fold(Maps::NONE, |maps, map| maps.and(&[*map]))
    }

    /// A map's values, [`Map::width`] per pixel.
    pub fn map(&self, map: Map) -> Option<&[f32]> {
        self.maps.get(&map).map(Vec::as_slice)
    }

    /// Returns the values of a map for changes; `None` if the frame lacks the map.
    pub fn map_mut(&mut self, map: Map) -> Option<&mut [f32]> {
        self.maps.get_mut(&map).map(Vec::as_mut_slice)
    }

    /// Returns the colour, and the values of each map, without a copy.
    pub fn into_values(self) -> (Vec<[f32; 4]>, BTreeMap<Map, Vec<f32>>) {
        (self.color, self.maps)
    }

    /// Returns a hash of the bits of the colour and of each map, by name, as 16 digits.
    ///
    /// Frames of one scene, view and options have one set of hashes on every adapter; the guide
    /// names the exceptions. The hash is FNV-1a of 64 bits (Fowler, Noll, Vo) over the words of the
    /// values.
    pub fn hashes(&self) -> BTreeMap<&'static str, String> {
        let hash = |values: &[f32]| hash::of(values.iter().map(|value| value.to_bits()));
        let maps = self.maps.iter().map(|(map, values)| (map.row().name, values.as_slice()));
        let named = maps.chain([("color", bytemuck::cast_slice(&self.color))]);
        named.map(|(name, values)| (name, format!("{:016x}", hash(values)))).collect()
    }

    /// Returns the normal of each pixel; `None` if the frame has no normals.
    pub fn normals(&self) -> Option<&[[f32; 3]]> {
        self.map(Map::Normal).map(bytemuck::cast_slice)
    }

    /// The values of a map of integers, [`Map::width`] per pixel.
    pub fn numbers(&self, map: Map) -> Option<&[u32]> {
        self.map(map).filter(|_| map.row().numbers).map(bytemuck::cast_slice)
    }

    /// Appends pixels with these `colors` and zeros in each map. Returns the index of the first new
    /// pixel. The caller sets the height.
    pub(crate) fn extend(&mut self, colors: impl IndexedParallelIterator<Item = [f32; 4]>) -> usize {
        let first = self.color.len();
        // Colours are written once: filling an image with zeros first takes as long as the rest of
        // a frame on a graphics card.
        self.color.par_extend(colors);
        self.maps.iter_mut().for_each(|(map, values)| values.resize(self.color.len() * map.width(), 0.0));
        first
    }

    /// Joins frames of the same height and maps, from left to right. Returns None for no frames.
    pub(crate) fn joined(frames: Vec<Self>) -> Option<Self> {
        if frames.len() < 2 {
            return frames.into_iter().next();
        }
        let (width, height) = (frames.iter().map(|frame| frame.width).sum(), frames[0].height);
        let mut whole = Self { width, height, color: Vec::new(), maps: BTreeMap::new() };
        for row in 0..height as usize {
            for frame in &frames {
                let across = frame.width as usize;
                whole.color.extend(&frame.color[row * across..][..across]);
                for (map, values) in &frame.maps {
                    let length = across * map.width();
                    whole.maps.entry(*map).or_default().extend(&values[row * length..][..length]);
                }
            }
        }
        Some(whole)
    }

    /// Appends the rows of `below`, which has the same width and maps.
    pub fn append(&mut self, below: Self) {
        self.height += below.height;
        self.color.extend(below.color);
        for (map, values) in below.maps {
            if let Some(above) = self.maps.get_mut(&map) {
                above.extend(values);
            }
        }
    }
}
