//! The plain program: scalar Rust on two threads, without a GPU or intrinsics.
//!
//! Its four passes are those of epsplat (`src/passes`):
//!
//! 1. **project**, in f32: each thread turns half of the surfels into splats, and puts each splat
//!    into the buckets of all strips of [`ROWS`] rows that it may touch. The disk is exact in
//!    perspective, as in `src/passes/homography.rs`.
//! 2. **visibility**: a thread takes the next strip and finds the largest 1/z at each pixel. 1/z is
//!    linear along a row, so nothing is divided. The pixels of a row that a disk covers lie between
//!    the roots of a quadratic, so no pixel is tested. Splats that face away come last, and are
//!    skipped where every tile under them is nearer already.
//! 3. **accumulate**, in the same strip while it is in the cache: f32 sums of weight, and of weight
//!    times colour, where z is within epsilon of the nearest. Hidden splats are skipped again. The
//!    kernel is a table over rho², not `exp`.
//! 4. **resolve**: divides by the weight.
//!
//! Another way to share the work took 1.3 times as long for 100,000 and 1,000,000 surfels: each
//! thread drew half of the splats into depths and sums of the whole image, which were merged after
//! each pass. Strips of 8 to 128 rows took the same time within a tenth.

use std::sync::Mutex;
use std::time::Instant;

use epsplat::low_level::frame::Frame;
use epsplat::low_level::passes::order::order;
use epsplat::low_level::plan::Settings;
use epsplat::low_level::scene::color::SRGB8_TO_LINEAR;
use epsplat::low_level::scene::{Camera, Colors, Scene, Surfel};
use glam::{Mat3, Vec2, Vec3};

/// The number of threads.
pub const THREADS: usize = 2;
/// Image rows per strip: depths and sums of 32 rows of 1024 pixels take 640 KiB.
const ROWS: usize = 32;
/// The side of a tile in pixels; the farthest visible depth of tiles hides splats.
const TILE: usize = 16;
/// Entries of the kernel's table; the nearest is off by at most 4e-4, upwards as often as
/// downwards.
const WEIGHTS: usize = 4096;

/// The camera and the options in f32.
pub struct View {
    width: usize,
    height: usize,
    /// The camera's position relative to the scene's origin.
    eye: Vec3,
    rotation: Mat3,
    focal: Vec2,
    /// 1 / `focal`.
    pixel: Vec2,
    principal: Vec2,
    near: f32,
    /// 1 / (1 + epsilon): times the largest 1/z of a pixel, it gives the smallest 1/z that is
    /// accepted there.
    accepted: f32,
    /// The kernel's weights for rho² from 0 to 1.
    weights: Vec<f32>,
}

impl View {
    pub fn new(scene: &Scene, camera: &Camera, options: &Settings) -> Self {
        let focal = Vec2::new(camera.fx as f32, camera.fy as f32);
        let weight = |i: usize| options.kernel.weight(i as f64 / (WEIGHTS - 1) as f64) as f32;
        Self {
            width: camera.width as usize,
            height: camera.height as usize,
            eye: (camera.eye - scene.origin).as_vec3(),
            rotation: camera.rotation.as_mat3(),
            focal,
            pixel: 1.0 / focal,
            principal: Vec2::new(camera.cx as f32, camera.cy as f32),
            near: camera.near as f32,
            accepted: (1.0 / (1.0 + options.epsilon.parts().0)) as f32,
            weights: (0..WEIGHTS).map(weight).collect(),
        }
    }
}

/// A projected surfel: at (x, y) pixels from `first`, `row . (x, y, 1)` is u/z, v/z and 1/z.
#[derive(Clone, Copy)]
struct Splat {
    /// The first pixel (x, y) that the splat may touch.
    first: [u16; 2],
    /// The last pixel (x, y) that the splat may touch.
    last: [u16; 2],
    a: [f32; 3],
    b: [f32; 3],
    c: [f32; 3],
    /// 8-bit sRGB.
    color: [u8; 4],
}

/// The splats of a strip that one thread projected.
#[derive(Default)]
struct Bucket {
    /// Splats whose normals point toward the viewer: they are likely to hide the others.
    toward: Vec<Splat>,
    away: Vec<Splat>,
}

/// Pass 1: returns the splat of a surfel and whether it faces away.
///
/// Returns `None` if the surfel touches no pixel, is seen edge-on, or reaches the near depth, which
/// no surfel of these scenes does.
fn project(surfel: &Surfel, color: [u8; 4], view: &View) -> Option<(bool, Splat)> {
    let p = view.rotation * (Vec3::from_array(surfel.center) - view.eye);
    let s = view.rotation * Vec3::from_array(surfel.s);
    let t = view.rotation * Vec3::from_array(surfel.t);
    let normal = s.cross(t);
    let away = p.dot(normal);
    let nearest = p.z - Vec2::new(s.z, t.z).length();
    if nearest < view.near || away == 0.0 {
        return None;
    }
    let inverse = 1.0 / p.z;
    let ray = p.truncate() * inverse;
    let image = view.focal * ray + view.principal;
    // The images of the half-axes as if the whole disk were at its nearest depth: never too small,
    // though not tight.
    let across = Vec2::new(s.x - ray.x * s.z, t.x - ray.x * t.z).length();
    let down = Vec2::new(s.y - ray.y * s.z, t.y - ray.y * t.z).length();
    let extent = view.focal * Vec2::new(across, down) * (1.0 / nearest) + 0.01;
    let size = Vec2::new(view.width as f32, view.height as f32);
    // Rounded down, these give the first pixel and the one past the last.
    let (low, high) = ((image - extent + 0.5).max(Vec2::ZERO), (image + extent + 0.5).min(size));
    let (first, end) = ([low.x as u16, low.y as u16], [high.x as u16, high.y as u16]);
    if !(first[0] < end[0] && first[1] < end[1]) {
        return None;
    }
    let offset = image - Vec2::new(first[0].into(), first[1].into()) - 0.5;
    let scale = view.pixel * (1.0 / away);
    let row = |v: Vec3, at_center: f32| {
        let xy = v.truncate() * scale;
        [xy.x, xy.y, at_center - xy.dot(offset)]
    };
    let (a, b, c) = (row(t.cross(p), 0.0), row(p.cross(s), 0.0), row(normal, inverse));
    Some((away > 0.0, Splat { first, last: [end[0] - 1, end[1] - 1], a, b, c, color }))
}

impl Splat {
    /// Calls `draw` for each row of `strip` with the pixels that the disk covers there, and with
    /// u/z, v/z and 1/z at the first of them.
    #[inline(always)]
    fn spans(&self, strip: &Place, mut draw: impl FnMut(std::ops::Range<usize>, [f32; 3])) {
        let (a_x, b_x, c_x) = (self.a[0], self.b[0], self.c[0]);
        // Pixels with a² + b² <= c² lie between the roots of a quadratic in x.
        let scale = 1.0 / (a_x * a_x + b_x * b_x - c_x * c_x);
        let widest = f32::from(self.last[0] - self.first[0]);
        let [left, top] = self.first.map(usize::from);
        for y in top.max(strip.first)..(usize::from(self.last[1]) + 1).min(strip.first + ROWS) {
            let down = (y - top) as f32;
            let [a, b, c] = [self.a, self.b, self.c].map(|row| row[1] * down + row[2]);
            let middle = -(a_x * a + b_x * b - c_x * c) * scale;
            let half_squared = middle * middle - (a * a + b * b - c * c) * scale;
            if half_squared >= 0.0 {
                let half = half_squared.sqrt();
                let (low, high) = ((middle - half).max(0.0), (middle + half).min(widest));
                // Rounds up without `ceil`, which is a function call if the processor's baseline
                // lacks it.
                let first = low as i32 + i32::from((low as i32 as f32) < low);
                let end = (high + 1.0) as i32;
                if first < end {
                    let right = first as f32;
                    let row = (y - strip.first) * strip.width + left;
                    draw(row + first as usize..row + end as usize, [a_x * right + a, b_x * right + b, c_x * right + c]);
                }
            }
        }
    }

    /// The largest 1/z over the splat's bounds.
    fn nearest(&self) -> f32 {
        let [right, down] = [0, 1].map(|k| f32::from(self.last[k] - self.first[k]));
        self.c[2] + (self.c[0] * right).max(0.0) + (self.c[1] * down).max(0.0)
    }
}

/// The position of a strip in the image.
struct Place {
    first: usize,
    width: usize,
}

/// The pixels of the strip that a thread is drawing.
struct Strip {
    place: Place,
    /// The largest 1/z so far; after [`Strip::settle`], the smallest that is accepted.
    nearest: Vec<f32>,
    /// The smallest `nearest` of each tile.
    tiles: Vec<f32>,
    /// Weight times red, green and blue, and weight.
    sums: Vec<[f32; 4]>,
}

impl Strip {
    fn new(width: usize) -> Self {
        let tiles = width.div_ceil(TILE) * ROWS.div_ceil(TILE);
        Self {
            place: Place { first: 0, width },
            nearest: vec![0.0; width * ROWS],
            tiles: vec![0.0; tiles],
            sums: vec![[0.0; 4]; width * ROWS],
        }
    }

    /// Clears the buffers for the strip whose first row is `first`.
    fn clear(&mut self, first: usize) {
        self.place.first = first;
        self.nearest.fill(0.0);
        self.sums.fill([0.0; 4]);
    }

    /// Pass 2 for one splat.
    fn visibility(&mut self, splat: &Splat) {
        splat.spans(&self.place, |pixels, [_, _, mut c]| {
            for nearest in &mut self.nearest[pixels] {
                *nearest = if c > *nearest { c } else { *nearest };
                c += splat.c[0];
            }
        });
    }

    /// Turns the largest 1/z into the smallest that is accepted, with the factor `accepted`.
    fn settle(&mut self, accepted: f32) {
        self.nearest.iter_mut().for_each(|nearest| *nearest *= accepted);
    }

    /// Updates the tiles, so that visible splats hide farther ones.
    fn occlude(&mut self) {
        let across = self.place.width.div_ceil(TILE);
        self.tiles.fill(f32::INFINITY);
        for (y, row) in self.nearest.chunks(self.place.width).enumerate() {
            let tiles = &mut self.tiles[y / TILE * across..][..across];
            for (tile, pixels) in tiles.iter_mut().zip(row.chunks(TILE)) {
                *tile = pixels.iter().fold(*tile, |least, &pixel| if pixel < least { pixel } else { least });
            }
        }
    }

    /// Whether every tile that the splat may touch is nearer than the whole splat.
    fn hides(&self, splat: &Splat) -> bool {
        let across = self.place.width.div_ceil(TILE);
        let nearest = splat.nearest();
        let top = usize::from(splat.first[1]).saturating_sub(self.place.first) / TILE;
        let bottom = (usize::from(splat.last[1]) - self.place.first).min(ROWS - 1) / TILE;
        let columns = usize::from(splat.first[0]) / TILE..=usize::from(splat.last[0]) / TILE;
        (top..=bottom).all(|y| self.tiles[y * across..][columns.clone()].iter().all(|&tile| nearest < tile))
    }

    /// Pass 3 for one splat.
    fn accumulate(&mut self, splat: &Splat, weights: &[f32]) {
        let linear = |k: usize| SRGB8_TO_LINEAR[usize::from(splat.color[k])];
        let values = [linear(0), linear(1), linear(2), 1.0];
        splat.spans(&self.place, |pixels, [mut a, mut b, mut c]| {
            for (sum, &least) in self.sums[pixels.clone()].iter_mut().zip(&self.nearest[pixels]) {
                if c >= least {
                    let rho2 = (a * a + b * b) / (c * c);
                    let place = (rho2 * (WEIGHTS - 1) as f32 + 0.5) as i32 as usize;
                    let weight = weights[place.min(WEIGHTS - 1)];
                    for (sum, value) in sum.iter_mut().zip(values) {
                        *sum += weight * value;
                    }
                }
                a += splat.a[0];
                b += splat.b[0];
                c += splat.c[0];
            }
        });
    }

    /// Pass 4, into the strip's rows of the image.
    fn resolve(&self, image: &mut [[f32; 4]]) {
        for (pixel, sum) in image.iter_mut().zip(&self.sums) {
            if sum[3] > 0.0 {
                *pixel = sum.map(|value| value / sum[3]);
            }
        }
    }

    /// Runs passes 2 to 4 of strip `index` with the splats in `buckets`, and returns the
    /// milliseconds of each.
    fn draw(&mut self, index: usize, buckets: &[&Bucket], view: &View, image: &mut [[f32; 4]]) -> [f64; 3] {
        let start = Instant::now();
        let now = || start.elapsed().as_secs_f64() * 1e3;
        self.clear(index * ROWS);
        let toward = || buckets.iter().flat_map(|bucket| &bucket.toward);
        let away = || buckets.iter().flat_map(|bucket| &bucket.away);
        toward().for_each(|splat| self.visibility(splat));
        self.occlude();
        for splat in away() {
            if !self.hides(splat) {
                self.visibility(splat);
            }
        }
        self.settle(view.accepted);
        self.occlude();
        let seen = now();
        for splat in toward().chain(away()) {
            if !self.hides(splat) {
                self.accumulate(splat, &view.weights);
            }
        }
        let summed = now();
        self.resolve(image);
        [seen, summed - seen, now() - summed]
    }
}

/// The program: surfels, and the buffers that stay from frame to frame.
pub struct Program {
    surfels: Vec<(Surfel, [u8; 4])>,
    /// A bucket per strip, for each thread of the first pass.
    buckets: [Vec<Bucket>; THREADS],
    /// A strip for each thread of the other passes.
    strips: [Strip; THREADS],
}

impl Program {
    pub fn new(scene: &Scene, camera: &Camera) -> Self {
        let color = |index: usize| match &scene.colors {
            Colors::Srgb8(codes) => codes[index],
            _ => [u8::MAX; 4],
        };
        let stored = order(scene, &scene.core(), None).into_iter().map(|index| index as usize);
        let strips = (camera.height as usize).div_ceil(ROWS);
        Self {
            surfels: stored.map(|index| (scene.surfels[index], color(index))).collect(),
            buckets: std::array::from_fn(|_| (0..strips).map(|_| Bucket::default()).collect()),
            strips: std::array::from_fn(|_| Strip::new(camera.width as usize)),
        }
    }

    /// Draws the image, and returns it with the milliseconds of each pass.
    pub fn frame(&mut self, camera: &Camera, view: &View) -> (Frame, [f64; 4]) {
        let start = Instant::now();
        let mut frame = Frame::new(camera, Default::default());
        let share = self.surfels.len().div_ceil(THREADS).max(1);
        std::thread::scope(|scope| {
            for (surfels, buckets) in self.surfels.chunks(share).zip(&mut self.buckets) {
                scope.spawn(|| fill(buckets, surfels, view));
            }
        });
        let project_ms = start.elapsed().as_secs_f64() * 1e3;
        let queue = Mutex::new(frame.color.chunks_mut(view.width * ROWS).enumerate());
        let buckets = &self.buckets;
        let work = |strip: &mut Strip| {
            let mut spent = [0.0; 3];
            loop {
                let next = queue.lock().ok().and_then(|mut strips| strips.next());
                let Some((index, image)) = next else { return spent };
                let of_strip = buckets.each_ref().map(|of_thread| &of_thread[index]);
                let passes = strip.draw(index, &of_strip, view, image);
                spent = std::array::from_fn(|k| spent[k] + passes[k] / THREADS as f64);
            }
        };
        let [visibility_ms, accumulate_ms, resolve_ms] = std::thread::scope(|scope| {
            let threads = self.strips.each_mut().map(|strip| scope.spawn(|| work(strip)));
            let spent = threads.map(|thread| thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)));
            std::array::from_fn(|k| spent.iter().map(|of_thread| of_thread[k]).sum())
        });
        (frame, [project_ms, visibility_ms, accumulate_ms, resolve_ms])
    }
}

/// Pass 1 for one thread's surfels.
fn fill(buckets: &mut [Bucket], surfels: &[(Surfel, [u8; 4])], view: &View) {
    for bucket in &mut *buckets {
        bucket.toward.clear();
        bucket.away.clear();
    }
    for (surfel, color) in surfels {
        if let Some((away, splat)) = project(surfel, *color, view) {
            for bucket in &mut buckets[usize::from(splat.first[1]) / ROWS..=usize::from(splat.last[1]) / ROWS] {
                if away { &mut bucket.away } else { &mut bucket.toward }.push(splat);
            }
        }
    }
}
