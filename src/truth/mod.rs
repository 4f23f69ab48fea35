//! Ground truth: ray casting of exact surfaces, against which reconstruction errors are measured.
//!
//! Rays and hits are f64. An analytic [`Shape`] is intersected by its formula, a mesh triangle by
//! triangle, with candidates from a tree of boxes ([`triangles`]); the disks that represent a
//! surface are found in the same way ([`disks`]). The first surface on a ray is shaded, and if it
//! is transparent, so are the surfaces behind it.

mod disk;
pub mod disks;
pub(crate) mod nearest;
mod shading;
pub mod triangles;

use std::path::Path;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

pub use self::disks::DiskTree;
pub use self::triangles::TriangleTree;
use crate::error::{Error, Result};
use crate::frame::Frame;
use crate::io::{self, Mesh};
use crate::plan::Settings;
use crate::progress::Progress;
use crate::scene::color::SRGB8_TO_LINEAR;
use crate::scene::composite::LEAST_TRANSMITTANCE;
use crate::scene::{Camera, Composite, Map};
use crate::surfels::analytic::{Shape, depth_along_ray};

/// A surface that rays can meet.
#[derive(Clone)]
pub enum Surface {
    /// A surface with a formula.
    Analytic(Shape),
    /// A triangle mesh.
    Mesh(TriangleTree),
    /// Two surfaces, of which a ray meets the nearer.
    Both(Box<[Surface; 2]>),
}

/// The intersection of a ray with a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// The distance along the ray, in units of its direction's length. For a camera's ray this is
    /// the depth.
    pub distance: f64,
    /// Unit normal in world space, on the side that the surface specifies.
    pub normal: DVec3,
    /// Unit normal of the tangent plane. For a triangle it is that of its plane, while `normal` may
    /// be interpolated between the corners.
    pub facet: DVec3,
    /// Linear RGB, straight alpha.
    pub color: [f32; 4],
}

/// The default side of the grid of samples in a pixel: 4 x 4 = 16 samples.
pub const DEFAULT_GRID: u32 = 4;

/// The largest side of the grid of samples.
const LARGEST_GRID: u32 = 64;

/// Two intersections on a ray count as one if they are closer together than this fraction of the
/// depth plus the surface's size: a ray through an edge meets both of its triangles.
const SAME_SURFACE: f64 = 1e-9;

impl Surface {
    /// Reads the triangles of a mesh; see [`io::read_mesh`].
    ///
    /// # Errors
    ///
    /// As [`io::read_mesh`] and [`TriangleTree::new`].
    pub fn read(path: &Path, progress: &dyn Progress) -> Result<Self> {
        Self::mesh(&io::read_mesh(path, progress)?)
    }

    /// A surface from the triangles of a mesh; see [`TriangleTree::new`].
    pub fn mesh(mesh: &Mesh) -> Result<Self> {
        Ok(Self::Mesh(TriangleTree::new(mesh)?))
    }

    /// The first intersection at a distance greater than `beyond`, which must not be negative.
    ///
    /// `start` and `direction` are in world units, `beyond` in units of the direction's length.
    /// Distances err by about 1e-12 of the distance and the surface's size.
    pub fn first_hit(&self, start: DVec3, direction: DVec3, beyond: f64) -> Option<Hit> {
        match self {
            Self::Analytic(shape) => {
                let from = start + direction * beyond;
                let further = depth_along_ray(*shape, from, direction)?;
                let p = from + direction * further;
                let [r, g, b] = shape.color(p).map(|code| SRGB8_TO_LINEAR[usize::from(code)]);
                let normal = shape.normal(p);
                Some(Hit { distance: beyond + further, normal, facet: normal, color: [r, g, b, 1.0] })
            }
            Self::Mesh(triangles) => triangles.first_hit(start, direction, beyond),
            Self::Both(both) => {
                let hits = both.each_ref().map(|surface| surface.first_hit(start, direction, beyond));
                hits.into_iter().flatten().min_by(|a, b| a.distance.total_cmp(&b.distance))
            }
        }
    }

    /// About half the diameter, world units.
    fn size(&self) -> f64 {
        match self {
            Self::Analytic(_) => 1.0,
            Self::Mesh(triangles) => triangles.radius(),
            Self::Both(both) => both[0].size().max(both[1].size()),
        }
    }
}

/// The exact image of a surface.
#[derive(Clone, Debug, PartialEq)]
pub struct Truth {
    /// Colour, depth and normal maps, rounded from f64 to f32; there are no other maps.
    ///
    /// - `color`: the mean over the pixel's samples, premultiplied, over the background; linear
    ///   RGB, straight alpha. Each sample is shaded as [`crate::passes::resolve`] shades a pixel,
    ///   with the ray through the sample.
    /// - `depth`: the depth ([`Camera::depth`]) of the first surface on the ray through the pixel's
    ///   centre, world units; +inf for none.
    /// - `normal`: the unit normal there, in world space, on the side that the surface specifies; 0
    ///   for none.
    pub frame: Frame,
    /// The fraction of the pixel's samples that meet the surface, in [0, 1].
    pub coverage: Vec<f32>,
    /// Camera-space z, world units, of the second surface on the ray through the pixel's centre,
    /// whichever side it shows; +inf for none.
    pub second_depth: Vec<f32>,
}

/// The truth of one pixel.
struct Pixel {
    color: [f32; 4],
    depth: f32,
    normal: [f32; 3],
    coverage: f32,
    second_depth: f32,
}

impl Truth {
    /// Casts `grid` x `grid` rays per pixel for colour and coverage, at the centres of equal
    /// squares, and one ray through the pixel's centre for the maps.
    ///
    /// The centre ray continues behind the first surface for the second depth. Surfaces nearer than
    /// the camera's near depth are invisible. The options used are shading, lights, background,
    /// opacity and composite. If the opacity is below 1, or surfaces are composited, the sample
    /// rays continue through each surface, attenuated by the surface's alpha times the opacity.
    ///
    /// # Errors
    ///
    /// [`Error::Usage`] unless `grid` is 1 to 64.
    pub fn cast(
        surface: &Surface,
        camera: &Camera,
        options: &Settings,
        grid: u32,
        progress: &dyn Progress,
    ) -> Result<Self> {
        if !(1..=LARGEST_GRID).contains(&grid) {
            return Err(Error::Usage(format!(
                "a pixel is sampled by 1x1 to {LARGEST_GRID}x{LARGEST_GRID} rays, not {grid}x{grid}"
            )));
        }
        progress.begin("casting rays", camera.height.into());
        let row = |y: u32| {
            let row: Vec<Pixel> = (0..camera.width).map(|x| pixel(surface, camera, options, grid, x, y)).collect();
            progress.advance(1);
            row
        };
        let pixels: Vec<Pixel> = (0..camera.height).into_par_iter().flat_map_iter(row).collect();
        progress.end();
        let color = pixels.iter().map(|pixel| pixel.color).collect();
        let frame = Frame::of_colors(camera.width, camera.height, color)
            .with(Map::Depth, pixels.iter().map(|pixel| pixel.depth).collect())
            .with(Map::Normal, pixels.iter().flat_map(|pixel| pixel.normal).collect());
        Ok(Self {
            frame,
            coverage: pixels.iter().map(|pixel| pixel.coverage).collect(),
            second_depth: pixels.iter().map(|pixel| pixel.second_depth).collect(),
        })
    }
}

fn pixel(surface: &Surface, camera: &Camera, options: &Settings, grid: u32, x: u32, y: u32) -> Pixel {
    let corner = DVec2::new(x.into(), y.into());
    let see = |at: DVec2, beyond: f64| {
        let (start, ray) = (camera.ray_start(at.x, at.y), camera.ray(at.x, at.y));
        if camera.shows(at.x, at.y) { surface.first_hit(start, ray, beyond) } else { None }
    };
    let after = |hit: Hit| hit.distance + SAME_SURFACE * (hit.distance + surface.size());
    let goes_through = options.opacity < 1.0 || options.composite != Composite::Opaque;
    let (mut hits, mut light, mut alpha) = (0, DVec3::ZERO, 0.0);
    for sample in 0..grid * grid {
        let place = DVec2::new((sample % grid).into(), (sample / grid).into());
        let at = corner + (place + 0.5) / f64::from(grid);
        let mut next = see(at, camera.near);
        hits += u32::from(next.is_some());
        let mut transmittance = 1.0;
        while let Some(hit) = next {
            let [r, g, b, own] = hit.color.map(f64::from);
            let shows = transmittance * own * f64::from(options.opacity);
            light += shows * shading::sent(DVec3::new(r, g, b), hit.normal, camera.ray(at.x, at.y), options);
            alpha += shows;
            transmittance -= shows;
            next = if goes_through && transmittance > LEAST_TRANSMITTANCE { see(at, after(hit)) } else { None };
        }
    }
    let samples = f64::from(grid * grid);
    let color = shading::in_front(light / samples, alpha / samples, options.background);
    let center = corner + 0.5;
    let first = see(center, camera.near);
    let second = first.and_then(|hit| see(center, after(hit)));
    let depth = |hit: Option<Hit>| hit.map_or(f32::INFINITY, |hit| hit.distance as f32);
    Pixel {
        color,
        depth: depth(first),
        normal: first.map_or([0.0; 3], |hit| hit.normal.as_vec3().to_array()),
        coverage: (f64::from(hits) / samples) as f32,
        second_depth: depth(second),
    }
}
