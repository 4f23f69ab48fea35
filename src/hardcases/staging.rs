//! Stages for the cases: a camera, and surfels that are placed in its image.

use glam::{DMat3, DVec3};

use super::{Expected, HardCase};
use crate::error::Result;
use crate::plan::{Accumulator, Optimisation, Settings};
use crate::scene::{Camera, Cap, Clip, Colors, Epsilon, Kernel, Lens, Outline, Projection, Scene, Shading, Surfel, Up};

/// Returns the fractional part of the `k`th element of a sequence that fills [0, 1) evenly along
/// each of six axes.
pub fn fraction(k: usize, axis: usize) -> f64 {
    // Fractions of square roots of primes and of powers of the plastic number: independent over the
    // rationals.
    const STEPS: [f64; 6] = [
        0.754_877_666_246_692_7,
        0.569_840_290_998_053_2,
        0.414_213_562_373_095_1,
        0.732_050_807_568_877_2,
        0.236_067_977_499_789_8,
        0.645_751_311_064_590_7,
    ];
    (0.5 + (k + 1) as f64 * STEPS.get(axis % 6).copied().unwrap_or(0.0)).fract()
}

/// A camera with its own frame: x right, y down, z forward, in units of `unit` world units.
#[derive(Clone, Debug)]
pub struct Stage {
    /// The camera.
    pub camera: Camera,
    /// The scene's origin, world units.
    pub origin: DVec3,
    /// World units per unit of the stage.
    pub unit: f64,
}

/// Height of an orthographic image, units: about that of a 60-degree pinhole's image at the depth
/// of most cases.
const HEIGHT: f64 = 4.0;

/// Near depth, units.
pub const NEAR: f64 = 1e-3;

impl Stage {
    /// Creates a stage at the origin that looks along z.
    pub fn plain(projection: Projection, size: (u32, u32)) -> Result<Self> {
        Self::new(projection, size, DVec3::ZERO, DVec3::ZERO, DMat3::IDENTITY, 1.0)
    }

    /// Creates a stage beside the origin that looks in an oblique direction.
    pub fn askew(projection: Projection, size: (u32, u32)) -> Result<Self> {
        Self::placed(projection, size, DVec3::ZERO, 1.0)
    }

    /// Creates the oblique stage in a scene about `origin`, with `unit` world units per unit of the
    /// stage.
    pub fn placed(projection: Projection, size: (u32, u32), origin: DVec3, unit: f64) -> Result<Self> {
        let forward = DVec3::new(-0.22, 0.91, -0.35).normalize();
        let right = forward.cross(DVec3::Z).normalize();
        let rotation = DMat3::from_cols(right, forward.cross(right), forward).transpose();
        Self::new(projection, size, origin, DVec3::new(0.31, -1.7, 0.9), rotation, unit)
    }

    fn new(
        projection: Projection,
        size: (u32, u32),
        origin: DVec3,
        eye: DVec3,
        rotation: DMat3,
        unit: f64,
    ) -> Result<Self> {
        let lens = match projection {
            Projection::Pinhole => Lens::Fov(60.0),
            Projection::Orthographic => Lens::OrthographicHeight(HEIGHT * unit),
        };
        let camera = Camera::posed(size, lens, origin + eye * unit, rotation, NEAR * unit)?;
        Ok(Self { camera, origin, unit })
    }

    /// Returns the camera-space point, in units, that the image shows at (x, y), pixels, at depth
    /// `z`.
    pub fn at(&self, x: f64, y: f64, z: f64) -> DVec3 {
        let (x, y) = ((x - self.camera.cx) / self.camera.fx, (y - self.camera.cy) / self.camera.fy);
        match self.camera.projection {
            Projection::Pinhole => DVec3::new(x * z, y * z, z),
            Projection::Orthographic => DVec3::new(x / self.unit, y / self.unit, z),
        }
    }

    /// Returns the direction of the view ray through a camera-space point.
    pub fn ray(&self, point: DVec3) -> DVec3 {
        match self.camera.projection {
            Projection::Pinhole => point.normalize(),
            Projection::Orthographic => DVec3::Z,
        }
    }

    /// Width of a pixel at depth `z`, units.
    pub fn pixel(&self, z: f64) -> f64 {
        match self.camera.projection {
            Projection::Pinhole => z / self.camera.fx,
            Projection::Orthographic => 1.0 / (self.camera.fx * self.unit),
        }
    }

    /// Width and height of the image, pixels.
    pub fn size(&self) -> (usize, usize) {
        (self.camera.width as usize, self.camera.height as usize)
    }

    /// Creates a surfel from its centre and half-axes in units of camera space.
    pub fn surfel(&self, center: DVec3, s: DVec3, t: DVec3) -> Surfel {
        let world = |v: DVec3| self.camera.rotation.transpose() * (v * self.unit);
        Surfel {
            center: (world(center) + (self.camera.eye - self.origin)).as_vec3().to_array(),
            s: world(s).as_vec3().to_array(),
            t: world(t).as_vec3().to_array(),
        }
    }

    /// Creates a round disk.
    pub fn disk(&self, center: DVec3, normal: DVec3, radius: f64) -> Surfel {
        let normal = normal.normalize();
        let s = normal.any_orthonormal_vector();
        self.surfel(center, s * radius, normal.cross(s) * radius)
    }

    /// Creates a sheet of disks over the whole image: a grid of `spacing` pixels at the depths
    /// `depth(x, y)`, each disk with its own small tilt.
    pub fn sheet(&self, spacing: f64, tilt: f64, depth: impl Fn(f64, f64) -> f64) -> Vec<Surfel> {
        let (width, height) = self.size();
        let (columns, rows) = ((width as f64 / spacing).ceil() as usize, (height as f64 / spacing).ceil() as usize);
        let mut surfels = Vec::new();
        for k in 0..(columns + 2) * (rows + 2) {
            let x = ((k % (columns + 2)) as f64 - 0.5 + 0.3 * fraction(k, 0)) * spacing;
            let y = ((k / (columns + 2)) as f64 - 0.5 + 0.3 * fraction(k, 1)) * spacing;
            let z = depth(x, y);
            let normal = DVec3::new(tilt * (fraction(k, 2) - 0.5), tilt * (fraction(k, 3) - 0.5), -1.0);
            surfels.push(self.disk(self.at(x, y, z), normal, 1.2 * spacing * self.pixel(z)));
        }
        surfels
    }
}

/// The surfels and options of a case, and the requirements on its image.
pub struct Filling {
    /// The surfels.
    pub surfels: Vec<Surfel>,
    /// Linear colours, one per surfel; if absent, varied ones in [0, 1].
    pub colors: Option<Vec<[f32; 4]>>,
    /// The clip lines of each surfel; may be empty.
    pub clips: Vec<Clip>,
    /// The curvature of each surfel; may be empty.
    pub caps: Vec<Cap>,
    /// The options, except the accumulator.
    pub options: Settings,
    /// Least and largest fraction of pixels that the reference covers.
    pub covered: (f64, f64),
    /// Largest fraction of pixels that may be excused.
    pub excused: f64,
    /// Accumulators that may exceed the bound.
    pub expected: Vec<Expected>,
    /// The smallest magnitude of an attribute, for high dynamic range.
    pub smallest: Option<f64>,
}

/// The reason why one-word sums fail in an image with a pixel that only a disk's rim reaches.
const BITS: &str = "one-word sums have only 24 fraction bits where hundreds of fragments may meet, and keep 16 of a \
                    weight of 1/400 at a disk's rim";

/// Options of all cases: unlit, over an empty background. Duplicate disks are drawn too, because
/// sums of many terms are judged. Epsilon does not depend on the disks' sizes, which differ by many
/// powers of ten.
pub fn options() -> Settings {
    let (without, epsilon) = (vec![Optimisation::Copies], Epsilon::Relative(0.01));
    Settings { epsilon, shading: Shading::Unlit, lights: Vec::new(), without, ..Settings::default() }
}

impl Filling {
    /// Creates a filling of `surfels` that cover a fraction of the image between `covered.0` and
    /// `covered.1`.
    pub fn of(surfels: Vec<Surfel>, covered: (f64, f64)) -> Self {
        Self {
            surfels,
            colors: None,
            clips: Vec::new(),
            caps: Vec::new(),
            options: options(),
            covered,
            excused: 0.01,
            expected: Vec::new(),
            smallest: None,
        }
    }

    /// Expects one-word sums to fail: some pixel is reached only by the rims of disks, where the
    /// sums have too few bits.
    pub fn with_lone_rims(self) -> Self {
        self.expect(&[Accumulator::Fixed32, Accumulator::Packed64], BITS)
    }

    /// Replaces the disks by polygons of `sides` sides.
    pub fn outline(mut self, sides: u32) -> Self {
        self.options.outline = Outline::of_sides(sides).ok();
        self
    }

    /// Sets the kernel.
    pub fn kernel(mut self, kernel: Kernel) -> Self {
        self.options.kernel = kernel;
        self
    }

    /// Adds `accumulators` that may exceed the bound.
    pub fn expect(mut self, accumulators: &[Accumulator], reason: &'static str) -> Self {
        self.expected.extend(accumulators.iter().map(|&accumulator| Expected { accumulator, reason }));
        self
    }
}

impl Stage {
    /// Applies [`Filling::with_lone_rims`] if the stage has this `projection`: with the other
    /// projection, no pixel is reached by rims only.
    pub fn rims_in(&self, projection: Projection, filling: Filling) -> Filling {
        if self.camera.projection == projection { filling.with_lone_rims() } else { filling }
    }
}

/// A row of the lists of cases.
pub struct Entry {
    /// [`HardCase::name`] of the pinhole case.
    pub name: &'static str,
    /// [`HardCase::about`].
    pub about: &'static str,
    /// [`HardCase::bound`].
    pub bound: &'static str,
    /// Width and height of the image, pixels.
    pub size: (u32, u32),
    /// Creates the stage.
    pub stage: fn(Projection, (u32, u32)) -> Result<Stage>,
    /// Creates the filling.
    pub fill: fn(&Stage) -> Filling,
    /// The projections for which the case makes sense.
    pub projections: &'static [Projection],
}

/// Both projections.
pub const BOTH: &[Projection] = &[Projection::Pinhole, Projection::Orthographic];

/// Builds the cases of a list: one per entry and projection.
pub fn build(entries: &[Entry]) -> Result<Vec<HardCase>> {
    let mut cases = Vec::new();
    for entry in entries {
        for &projection in entry.projections {
            let stage = (entry.stage)(projection, entry.size)?;
            let filling = (entry.fill)(&stage);
            let twin = if projection == Projection::Orthographic { ", orthographic" } else { "" };
            let varied = |k: usize| [0, 1, 2].map(|axis| fraction(k, 3 + axis) as f32);
            let colors = filling
                .colors
                .unwrap_or_else(|| (0..filling.surfels.len()).map(varied).map(|[r, g, b]| [r, g, b, 1.0]).collect());
            cases.push(HardCase {
                name: format!("{}{twin}", entry.name),
                about: entry.about,
                bound: entry.bound,
                scene: Scene {
                    origin: stage.origin,
                    surfels: filling.surfels,
                    low: vec![],
                    clips: filling.clips,
                    caps: filling.caps,
                    colors: Colors::Linear(colors),
                    oriented: true,
                    up: Up::Z,
                    ..Scene::default()
                },
                camera: stage.camera,
                options: filling.options,
                covered: filling.covered,
                excused: filling.excused,
                expected: filling.expected,
                smallest: filling.smallest,
            });
        }
    }
    Ok(cases)
}
