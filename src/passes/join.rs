//! Stage 4 where there are triangles: joins each pixel's blended splats with its nearest triangle
//! (Tien 2008, section 5.3), by [`Join`].
//!
//! Splats are blended first, without the triangles. If a triangle took part in nearest depths and
//! sums, fragments just behind the triangle would be missing from a mean that includes fragments
//! just in front of it.
//!
//! Where surfaces show through each other, the nearest triangle is one more surface of the pixel's
//! list: in front of the blended surfaces, or of the single fragments, whose depth is not smaller.

use super::resolve::Surface;
use super::triangles::Shown;
use crate::plan::pass::Pass;
use crate::plan::{Settings, bounds_of, in_view};
use crate::scene::color::linear_to_srgb;
use crate::scene::{Camera, Join, Scene};

/// The triangles in the rows of a strip, and the values that join them with its splats.
#[derive(Clone, Copy, Debug, Default)]
pub struct Beside<'a> {
    /// The nearest triangle of each pixel; empty if there are no triangles.
    pub triangles: &'a [Shown],
    /// [`Scene::largest_shorter`](crate::scene::Scene::largest_shorter), world units.
    pub largest_shorter: f64,
    /// The depth beyond which no surfel lies ([`farthest`](crate::plan::farthest)), world units.
    pub farthest: f64,
    /// Whether splat colours are sRGB codes.
    pub coded: bool,
}

impl Beside<'_> {
    /// The nearest triangle of a pixel of the strip, with its colour as the splats have theirs.
    pub(super) fn triangle(&self, pixel: usize) -> Option<Shown> {
        let triangle = self.triangles.get(pixel).filter(|triangle| triangle.depth.is_finite())?;
        Some(Shown { color: if self.coded { coded(triangle.color) } else { triangle.color }, ..*triangle })
    }
}

/// The f64 twin: the surface that a pixel shows, from its splats and its triangle.
pub(super) fn joined(splats: &Surface, triangle: &Shown, beside: &Beside<'_>, options: &Settings) -> Surface {
    let (share, order) = share_of_splats(splats, triangle, beside, options);
    let decision = splats.decision.min(triangle.decision).min(order);
    if !triangle.depth.is_finite() || share == 1.0 {
        return Surface { decision, ..*splats };
    }
    let of_triangle = Surface {
        color: if beside.coded { coded(triangle.color) } else { triangle.color },
        normal: triangle.normal,
        place: [0.0; 2],
        depth: triangle.depth,
        front: triangle.depth,
        weight: 1.0,
        count: 1,
        decision,
    };
    if share > 0.0 { mean(&of_triangle, splats, share) } else { of_triangle }
}

/// Converts a straight linear colour to sRGB codes: the twin of `color_beside` in
/// `wgsl/triangles/join_coded.wgsl`.
fn coded([r, g, b, alpha]: [f64; 4]) -> [f64; 4] {
    let [r, g, b] = [r, g, b].map(linear_to_srgb);
    [r, g, b, alpha]
}

/// The mean of a triangle and of splats, which have the weight `share`.
fn mean(triangle: &Surface, splats: &Surface, share: f64) -> Surface {
    let mix = |triangle: f64, splats: f64| triangle + share * (splats - triangle);
    let alpha = mix(triangle.color[3], splats.color[3]);
    let premultiplied = |surface: &Surface, k: usize| surface.color[k] * surface.color[3];
    let straight = |k: usize| {
        let mixed = mix(premultiplied(triangle, k), premultiplied(splats, k));
        if alpha > 0.0 { mixed / alpha } else { 0.0 }
    };
    let normal = triangle.normal.lerp(splats.normal, share).normalize_or_zero();
    let color = [straight(0), straight(1), straight(2), alpha];
    Surface { color, normal, depth: mix(triangle.depth, splats.depth), decision: triangle.decision, ..*splats }
}

/// Whether the blended depth of a scene's splats decides what is visible in the view of `camera`:
/// there are separate inputs, or triangles in view.
pub(super) fn compares_depth(scene: &Scene, camera: &Camera, options: &Settings) -> bool {
    let apart = options.separate && scene.provenance.ranges(scene.surfels.len() as u64).nth(1).is_some();
    apart || (options.join != Join::Nearest && in_view(&bounds_of(&scene.triangles), scene.origin, camera))
}

/// The weight of a pixel's splats, 0 to 1, and the relative distance to a decision. The pixel's
/// triangle has the rest of the weight.
fn share_of_splats(splats: &Surface, triangle: &Shown, beside: &Beside<'_>, options: &Settings) -> (f64, f64) {
    match (splats.exists(), triangle.depth.is_finite()) {
        (false, _) => return (0.0, f64::INFINITY),
        (true, false) => return (1.0, f64::INFINITY),
        (true, true) => {}
    }
    let (depth, nearest) = (splats.depth, splats.front);
    let epsilon = options.epsilon.farthest(nearest, beside.largest_shorter, 1.0).min(beside.farthest) - nearest;
    let nearer = |depth: f64| (f64::from(u8::from(depth < triangle.depth)), (depth / triangle.depth - 1.0).abs());
    match options.join {
        Join::Corrected => nearer(depth),
        Join::Nearest => nearer(nearest),
        Join::Blended => ((0.5 + (triangle.depth - depth) / (2.0 * epsilon)).clamp(0.0, 1.0), f64::INFINITY),
    }
}

/// The pass's files.
pub const PASS: Pass = Pass {
    name: "join",
    files: |needs| {
        // With peeled layers there are no triangles.
        if needs.surface.peels().is_some() {
            return Vec::new();
        }
        let listed = needs.surface.lists().is_some();
        let Some(mesh) = needs.mesh else {
            return vec![if listed { "join_lists_absent.wgsl" } else { "join_absent.wgsl" }];
        };
        let color = if mesh.coded { "join_coded.wgsl" } else { "join_linear.wgsl" };
        if listed {
            return vec!["join_lists.wgsl", color];
        }
        let join = match mesh.join {
            Join::Corrected => "join_corrected.wgsl",
            Join::Nearest => "join_nearest.wgsl",
            Join::Blended => "join_blended.wgsl",
        };
        vec!["join.wgsl", join, color]
    },
    kernels: |_| Vec::new(),
    constants: |_| Vec::new(),
};
