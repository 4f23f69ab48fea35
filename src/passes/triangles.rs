//! Triangles beside splats: projects their corners, finds the nearest triangle of each pixel, and
//! shades it.
//!
//! # A triangle at a pixel
//!
//! Seen from the image point p, a vertex is the spoke `q = (x, y) - p w`. For a vertex beyond the
//! near depth (x, y) is its image and w = 1. For any other vertex (x, y) is
//! `(fx X + cx Z, fy Y + cy Z)` and w = Z, which needs no division (Olano and Greer 1997). For each
//! pair of corners the sign of the area `E_k = q_i x q_j` says on which side of their edge p lies;
//! p is in the triangle if all three signs agree. With shares s_k (1 / Z for a vertex with an image
//! in perspective, else 1) the corners' parts are `E_k s_k / sum E s`: the perspective-correct
//! barycentric coordinates. They weight the corners' depths. Nothing is clipped: the near depth is
//! tested at each pixel.
//!
//! **Each pixel belongs to one of the two triangles at an edge.** A vertex is projected once, for
//! all its triangles, in doubled f32 arithmetic, so its spoke from a pixel is the same for all of
//! them. The rounding of E depends only on the edge's two ends. In f32, E is `x1 y2 - y1 x2`, and
//! reversing the edge changes only the sign. If an end has no image, or an image beyond 2^16
//! pixels, E is computed in doubled arithmetic, always with the end of the lower number first. So
//! the two triangles at an edge get opposite signs however E is rounded. Where E is 0, p is taken
//! to lie slightly to the right, then slightly below: `dE/dx`, or else `dE/dy`, decides.
//!
//! *No crack shows*: around a vertex close to p the signs of its edges change at least once, and
//! the triangle at such a change has p. Near the middle of an edge only the sign of that edge is
//! uncertain, and one of its two triangles has p. Signs may be wrong where E is less than 2^-22 of
//! its products: p may then belong to the neighbour, or to both, and the nearer one shows.
//!
//! **Rare triangles** need more than f32 for their parts. A kernel of their own computes the areas
//! in doubled arithmetic. In f32 parts err by `2^-23 L^2 / 2A`, where L is the length and A the
//! area in the image. A triangle is rare if
//!
//! - an end needs doubled arithmetic (see above), or
//! - it is long for its area and its depths: `L^2 / 2A (z_max - z_min) / z_min > 4`, or
//! - its parts would be arbitrary: `2A < 1e-6 L^2`, an error of about an eighth or more.
//!
//! The attribute pass computes the parts of all triangles in doubled arithmetic.
//!
//! **Far corners**: f32 relative to the scene's origin has too few digits for a mesh far from it.
//! Such scenes store two f32 per coordinate (`vertex_doubled.wgsl`); other scenes have neither the
//! words nor the code.
//!
//! **Facing away**: a triangle's corners run counterclockwise as its front is seen. With
//! [`Cull::Back`] triangles whose edges have p on the other side are left out.
//!
//! **Cut-outs**: where the image of a triangle is transparent
//! ([`least_alpha`](crate::scene::Texture::least_alpha)), the triangle is not there. The image is
//! looked up as in the attribute pass.
//!
//! **The nearest triangle** is an atomic maximum of (bits(+inf) - bits(depth), number). The order
//! of [`Triangles`](crate::scene::Triangles) does not depend on the order in files, so no bit of
//! the image does. The rasteriser, for comparison, uses its own coverage and depths; among
//! triangles at its nearest depth, the first one drawn counts as nearest.

mod shown;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

pub use self::shown::Shown;
use super::Strip;
use super::raster::DEPTH_FORMAT;
use super::resolve::shaded;
use crate::gpu::layout::{QUEUE_START, TILE};
use crate::gpu::program::Draw;
use crate::plan::extra::TRIANGLE_PIXEL_WORDS;
use crate::plan::pass::Pass;
use crate::plan::steps::{Clear, Kernel, Over, Run, Stage, Step, Twin};
use crate::plan::{Band, ColorNeed, Plan};
use crate::scene::{Camera, Cull, Projection, Scene};

/// A vertex in the image of a camera. Relative to the image point p it is `place - p w`.
#[derive(Clone, Copy, Debug)]
pub struct Corner {
    /// Image position times w, pixels.
    pub place: DVec2,
    /// 1 for a vertex with an image, else its depth.
    pub w: f64,
    /// Its depth ([`Camera::depth`]), world units.
    pub depth: f64,
    /// The factor of its area in the barycentric coordinates (s_k above).
    pub share: f64,
}

impl Corner {
    /// Whether the vertex has an image.
    fn is_before(&self, camera: &Camera) -> bool {
        camera.projection == Projection::Orthographic || self.depth >= camera.near
    }
}

/// The f64 twin of the first stage: all vertices, in the order of the scene's.
pub fn corners(scene: &Scene, camera: &Camera) -> Vec<Corner> {
    let eye = camera.eye - scene.origin;
    let focal = DVec2::new(camera.fx, camera.fy);
    let principal = DVec2::new(camera.cx, camera.cy);
    let corner = |vertex: usize| {
        let p = camera.rotation * (scene.triangles.place(vertex) - eye);
        if camera.optics.is_some() {
            return match camera.corner(p) {
                Some((place, depth)) => Corner { place, w: 1.0, depth, share: 1.0 / depth },
                None => Corner { place: DVec2::ZERO, w: 0.0, depth: 0.0, share: 0.0 },
            };
        }
        let plane = focal * p.truncate();
        match camera.projection {
            Projection::Orthographic => Corner { place: plane + principal, w: 1.0, depth: p.z, share: 1.0 },
            Projection::Pinhole if p.z >= camera.near => {
                Corner { place: plane / p.z + principal, w: 1.0, depth: p.z, share: 1.0 / p.z }
            }
            Projection::Pinhole => Corner { place: plane + principal * p.z, w: p.z, depth: p.z, share: 1.0 },
        }
    };
    (0..scene.triangles.vertices().len()).into_par_iter().map(corner).collect()
}

/// A triangle at a point of the image.
#[derive(Clone, Copy, Debug)]
pub struct Crossing {
    /// Its depth ([`Camera::depth`]), world units.
    pub depth: f64,
    /// The barycentric coordinates, whose sum is 1.
    pub parts: [f64; 3],
    /// The barycentric area of a pixel: the absolute determinant of the coordinates' change per
    /// column and row.
    pub spread: f64,
    /// Whether the point is in the triangle and not nearer than the near depth.
    pub hit: bool,
    /// Whether the corners run counterclockwise as the viewer sees them.
    pub faces: bool,
    /// The smallest relative distance to a decision, negative on the rejecting side. For an edge it
    /// is the area divided by the products whose difference the area is; for the near depth it is
    /// relative to that depth.
    pub decision: f64,
}

/// Evaluates a triangle at the image point `p`; `None` if it has no area there. `of` are its
/// corners, `numbers` the corners' numbers.
pub fn crossing(camera: &Camera, of: [Corner; 3], numbers: [u32; 3], p: DVec2) -> Option<Crossing> {
    let edge = |from: usize, to: usize| {
        let (from, to, turned) = if numbers[from] < numbers[to] { (from, to, 1.0) } else { (to, from, -1.0) };
        let [a, b] = [of[from], of[to]].map(|corner| corner.place - p * corner.w);
        let right = of[to].w * a.y - of[from].w * b.y;
        let below = of[from].w * b.x - of[to].w * a.x;
        let area = a.perp_dot(b);
        let decided = [area, right, below].into_iter().find(|value| *value != 0.0).unwrap_or(0.0);
        let side = if decided == 0.0 || decided.is_nan() { 0.0 } else { decided.signum() };
        (turned * area, turned * side, area.abs() / ((a.x * b.y).abs() + (a.y * b.x).abs()).max(f64::MIN_POSITIVE))
    };
    let edges = [edge(1, 2), edge(2, 0), edge(0, 1)];
    let sides = edges.map(|(_, side, _)| side);
    let weighed: [f64; 3] = std::array::from_fn(|k| edges[k].0 * of[k].share);
    let sum: f64 = weighed.iter().sum();
    if sum == 0.0 || !sum.is_finite() || sides.contains(&0.0) {
        return None;
    }
    let parts = weighed.map(|part| part / sum);
    let depth: f64 = (0..3).map(|k| parts[k] * of[k].depth).sum();
    let inside = sides.iter().all(|side| *side == sides[0]);
    // An edge is on the wrong side if its sign is not that of the majority.
    let most = sides.iter().sum::<f64>().signum();
    let distance = edges.map(|(_, side, distance)| side * most * distance).into_iter().fold(f64::INFINITY, f64::min);
    let beyond = depth / camera.near - 1.0;
    // In perspective the spread is z^3 / det by Cramer's rule, as the homogeneous areas sum to
    // det / z. In an orthographic image it is 1 over the doubled area.
    let units =
        of.map(
            |corner| {
                if camera.projection == Projection::Pinhole && corner.is_before(camera) { corner.depth } else { 1.0 }
            },
        );
    let shared: f64 = (0..3).map(|k| edges[k].0 * of[k].depth / units[k]).sum();
    let spread = match camera.projection {
        Projection::Pinhole => depth.powi(3) / (units.iter().product::<f64>() * shared),
        Projection::Orthographic => depth / shared,
    };
    Some(Crossing {
        depth,
        parts,
        spread: spread.abs(),
        hit: inside && depth >= camera.near,
        // In the image rows go down, so a positive area is clockwise. Near an edge, one side may
        // differ from the two others.
        faces: most < 0.0,
        decision: distance.min(beyond),
    })
}

/// A point outside a triangle by at most this relative distance still records its distance to a
/// decision.
const NEARBY: f64 = 1e-3;

/// The f64 twin: the nearest triangle at each pixel of `strip`.
pub fn reference(strip: &Strip<'_>) -> Vec<Shown> {
    let Strip { scene, camera, options, first_row, rows, .. } = *strip;
    let mut shown = vec![Shown::NOTHING; camera.width as usize * rows as usize];
    for (number, numbers) in scene.triangles.corners().iter().enumerate() {
        let of = numbers.map(|vertex| strip.corners[vertex as usize]);
        let Some([first, last]) = reach(camera, &of, (first_row, rows)) else { continue };
        for y in first[1]..=last[1] {
            for x in first[0]..=last[0] {
                let p = DVec2::new(x.into(), y.into()) + 0.5;
                let Some(crossing) = crossing(camera, of, *numbers, p) else { continue };
                if options.cull == Cull::Back && !crossing.faces {
                    continue;
                }
                if crossing.decision > -NEARBY || crossing.hit {
                    let crossing = cut(scene, number, crossing);
                    let pixel = &mut shown[((y - first_row) * camera.width + x) as usize];
                    *pixel = pixel.with(number as u32, crossing);
                }
            }
        }
    }
    for (pixel, shown) in shown.iter_mut().enumerate().filter(|(_, shown)| shown.depth.is_finite()) {
        let at = (pixel as u32 % camera.width, pixel as u32 / camera.width + first_row);
        let triangle = shown.triangle as usize;
        let mean = |values: [f64; 3]| (0..3).map(|k| shown.parts[k] * values[k]).sum::<f64>();
        let (normals, colors) = (scene.triangles.normals_of(triangle), scene.triangles.colors_of(triangle));
        let normal = DVec3::from_array(std::array::from_fn(|axis| mean(normals.map(|normal| normal[axis]))));
        shown.normal = normal.normalize_or_zero();
        let lit = within_horizon(shown.normal, facet(scene, triangle), -ray(camera, at));
        let texture = scene.triangles.texture_at(triangle, shown.parts, shown.spread);
        let color = std::array::from_fn(|channel| texture[channel] * mean(colors.map(|color| color[channel])));
        shown.color = shaded(color, lit, camera, options, at);
    }
    shown
}

/// The crossing of a triangle where its image may be transparent.
fn cut(scene: &Scene, triangle: usize, crossing: Crossing) -> Crossing {
    match scene.triangles.excess_alpha(triangle, crossing.parts, crossing.spread) {
        Some(excess) => {
            let decision = crossing.decision.min(excess);
            Crossing { hit: crossing.hit && excess >= 0.0, decision, ..crossing }
        }
        None => crossing,
    }
}

/// The unit direction of the view ray through a pixel's centre.
fn ray(camera: &Camera, (x, y): (u32, u32)) -> DVec3 {
    camera.ray(f64::from(x) + 0.5, f64::from(y) + 0.5).normalize()
}

/// The unit normal of a triangle's plane.
fn facet(scene: &Scene, triangle: usize) -> DVec3 {
    let [a, b, c] = scene.triangles.corners()[triangle].map(|vertex| scene.triangles.place(vertex as usize));
    (b - a).cross(c - a).normalize_or_zero()
}

/// The normal by which a triangle is lit. An interpolated normal may point away from the viewer
/// although its facet, seen aslant, shows the viewer the same side; then it is turned to the
/// horizon, where a headlight is dark.
fn within_horizon(normal: DVec3, facet: DVec3, toward_eye: DVec3) -> DVec3 {
    let facing = normal.dot(toward_eye);
    match facing * facet.dot(toward_eye) * facet.dot(normal) >= 0.0 {
        true => normal,
        false => (normal - facing * toward_eye).normalize_or_zero(),
    }
}

/// The first and the last pixel that a triangle may reach in the given rows. If the near depth cuts
/// it, it may reach all of them.
fn reach(camera: &Camera, of: &[Corner; 3], (first_row, rows): (u32, u32)) -> Option<[[u32; 2]; 2]> {
    let before = of.map(|corner| corner.is_before(camera));
    let places = of.map(|corner| corner.place);
    let (low, high) = match before {
        [true, true, true] => {
            (places[0].min(places[1]).min(places[2]) - 0.51, places[0].max(places[1]).max(places[2]) - 0.49)
        }
        [false, false, false] => return None,
        // A corner that a lens does not see has no image, and neither have its triangles.
        _ if camera.optics.is_some() => return None,
        _ => (DVec2::NEG_INFINITY, DVec2::INFINITY),
    };
    let (top, bottom) = (f64::from(first_row), f64::from(first_row + rows) - 1.0);
    let first = DVec2::new(low.x.ceil().max(0.0), low.y.ceil().max(top));
    let last = DVec2::new(high.x.floor().min(f64::from(camera.width) - 1.0), high.y.floor().min(bottom));
    let pixels = |at: DVec2| at.to_array().map(|value| value as u32);
    first.cmple(last).all().then(|| [pixels(first), pixels(last)])
}

/// Words per pixel of the buffer of nearest triangles.
pub const NEAREST_TRIANGLE_WORDS: u32 = 2;

/// The word at which the list of tiles with triangles starts, after its count and a grid.
const TRIANGLE_TILES: u64 = 8;

/// Words of a band's list of tiles.
pub fn tile_words(band: &Band) -> u64 {
    TRIANGLE_TILES + band.tiles
}

/// Words of a band's shaded triangles: [`TRIANGLE_PIXEL_WORDS`] per pixel, and four per tile.
pub fn pixel_words(band: &Band) -> u64 {
    u64::from(TRIANGLE_PIXEL_WORDS) * band.pixels + 4 * band.tiles
}

/// Words of a projected vertex.
pub const CORNER_WORDS: u32 = 9;

/// The pass's kernels, files and constants.
pub const PASS: Pass = Pass {
    name: "triangles",
    files: |needs| {
        let Some(mesh) = needs.mesh else { return vec!["triangles_tiles_absent.wgsl"] };
        let corner: &[&str] = match (needs.lens, needs.projection) {
            (Some(_), _) => &["corner_lens.wgsl", "corner_perspective.wgsl"],
            (None, Projection::Pinhole) => &["corner_pinhole.wgsl", "corner_perspective.wgsl"],
            (None, Projection::Orthographic) => &["corner_orthographic.wgsl"],
        };
        let visibility: &[&str] = match (needs.surface.raster(), mesh.once) {
            (Some(_), _) => &["triangles_raster.wgsl"],
            (None, true) => &["triangles_visibility.wgsl", "triangles_named.wgsl", "triangles_once.wgsl"],
            (None, false) => &["triangles_visibility.wgsl", "triangles_named.wgsl", "triangles_twice.wgsl"],
        };
        let vertex = if mesh.doubled { "vertex_doubled.wgsl" } else { "vertex.wgsl" };
        let texture = if mesh.textured { "triangles_texture.wgsl" } else { "triangles_texture_absent.wgsl" };
        // If surfels are textured, or coloured by sRGB codes, their colours include these files.
        let looks_up = mesh.textured && needs.color != ColorNeed::Textured;
        let decodes = looks_up && needs.color != ColorNeed::Srgb8;
        let own = looks_up.then_some("textures.wgsl").into_iter().chain(decodes.then_some("srgb.wgsl"));
        let cutout = if mesh.cut { "cutout.wgsl" } else { "cutout_absent.wgsl" };
        let drawn = ["triangles_tiles.wgsl", "triangles_attributes.wgsl", texture, cutout];
        let all = ["corners.wgsl", vertex, "triangles.wgsl"].into_iter().chain(drawn);
        all.chain(corner.iter().copied()).chain(visibility.iter().copied()).chain(own).collect()
    },
    kernels: |needs| match needs.mesh {
        None => Vec::new(),
        Some(_) if needs.surface.raster().is_some() => vec![SEE_CORNERS, LIST_TILES, ARRANGE_TILES, SHADE],
        Some(mesh) => {
            let all = [SEE_CORNERS, DRAW, ARRANGE, DRAW_LARGE, DRAW_RARE, LIST_TILES, ARRANGE_TILES, SHADE];
            all.into_iter().chain([NAME, NAME_LARGE, NAME_RARE].into_iter().filter(|_| !mesh.once)).collect()
        }
    },
    constants: |making| {
        let Some(mesh) = making.needs.mesh else { return Vec::new() };
        vec![
            ("CULLED_SIDE", u32::from(mesh.cull_back).into()),
            ("TRIANGLE_WORDS", mesh.words().into()),
            ("TRIANGLE_COLORS", mesh.normal_words().into()),
            ("TRIANGLE_RECORDS", if mesh.colored { 0.0 } else { 12.0 }),
            ("TRIANGLE_PLACES", mesh.places_at().into()),
            ("TRIANGLE_NORMALS", u32::from(mesh.normals).into()),
            ("TRIANGLE_COLORED", u32::from(mesh.colored).into()),
        ]
    },
};

const SEE_CORNERS: Kernel = Kernel::new("see_corners");
const DRAW: Kernel = Kernel::new("draw_triangles");
const ARRANGE: Kernel = Kernel::of("arrange_triangles", [1; 3]);
const DRAW_LARGE: Kernel = Kernel::of("draw_large_triangles", [TILE, TILE, 1]);
const DRAW_RARE: Kernel = Kernel::of("draw_rare_triangles", [TILE, TILE, 1]);
const NAME: Kernel = Kernel::new("name_triangles");
const NAME_LARGE: Kernel = Kernel::of("name_large_triangles", [TILE, TILE, 1]);
const NAME_RARE: Kernel = Kernel::of("name_rare_triangles", [TILE, TILE, 1]);
const LIST_TILES: Kernel = Kernel::new("list_triangle_tiles");
const ARRANGE_TILES: Kernel = Kernel::of("arrange_triangle_tiles", [1; 3]);
const SHADE: Kernel = Kernel::new("shade_triangles");

/// The steps of the rasteriser: projected vertices, and the nearest triangle of each pixel of the
/// whole image.
pub fn drawn() -> [Step; 2] {
    let corners = vec![Run { kernel: SEE_CORNERS, over: Over::Vertices }];
    [Step::Stage(Stage::new("triangles", 0, corners)), Step::DrawTriangles]
}

/// The pipeline of the rasteriser's visibility pass. Its depths are largest in front.
pub fn draw() -> Draw {
    let target = wgpu::ColorTargetState { format: NUMBERS, blend: None, write_mask: wgpu::ColorWrites::ALL };
    let depth = wgpu::DepthStencilState {
        format: DEPTH_FORMAT,
        depth_write_enabled: Some(true),
        depth_compare: Some(wgpu::CompareFunction::Greater),
        stencil: Default::default(),
        bias: Default::default(),
    };
    Draw {
        name: DRAWN,
        vertex: "drawn_corner",
        fragment: "drawn_triangle",
        targets: vec![target],
        depth: Some(depth),
        constant: None,
    }
}

/// The name of the pipeline of [`draw`].
pub const DRAWN: &str = "triangles";

/// The format of the texture of triangle numbers that the pipeline of [`draw`] writes.
pub const NUMBERS: wgpu::TextureFormat = wgpu::TextureFormat::R32Uint;

/// The stages of a band: vertices once per frame, then the nearest triangle of each pixel, then its
/// shading.
pub fn steps(plan: &Plan, band: usize) -> Vec<Stage> {
    let run = |kernel, over| Run { kernel, over };
    let once = plan.needs.mesh.is_some_and(|mesh| mesh.once);
    let tiles = Clear::of("triangle_tiles", 0, TRIANGLE_TILES);
    let shade = [run(LIST_TILES, Over::Occlusion), run(ARRANGE_TILES, Over::Once), run(SHADE, Over::TriangleTiles)];
    if plan.needs.surface.raster().is_some() {
        return vec![Stage::new("triangles", band, shade.to_vec()).after(vec![tiles])];
    }
    let mut runs = Vec::new();
    if band == 0 {
        runs.push(run(SEE_CORNERS, Over::Vertices));
    }
    let over = [Over::Triangles, Over::LargeTriangles, Over::RareTriangles];
    runs.extend([run(DRAW, over[0]), run(ARRANGE, Over::Once), run(DRAW_LARGE, over[1]), run(DRAW_RARE, over[2])]);
    if !once {
        runs.extend([NAME, NAME_LARGE, NAME_RARE].into_iter().zip(over).map(|(kernel, over)| run(kernel, over)));
    }
    runs.extend(shade);
    let words = plan.bands[band].pixels * u64::from(NEAREST_TRIANGLE_WORDS);
    let start = |queue| Clear::of(queue, 0, QUEUE_START.into());
    let nearest = Clear::of("nearest_triangles", 0, words);
    let clears = vec![start("large_triangles"), start("rare_triangles"), nearest, tiles];
    vec![Stage::new("triangles", band, runs).after(clears).as_twin(Twin::Triangles)]
}
