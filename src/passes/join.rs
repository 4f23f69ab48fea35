//! Stage 4 where there are triangles: what shows of a pixel's splats and of its nearest triangle (Tien 2008, section 5.3), by
//! [`Join`].
//!
//! Splats are a surface by themselves before: nearest depths and sums see no triangle, else a splat's fragments just behind one would be
//! left out of a mean that those just before it are in.

use super::accumulate::PixelSums;
use super::resolve::Surface;
use super::triangles::Shown;
use super::visibility::Nearest;
use crate::plan::RenderOptions;
use crate::plan::pass::Pass;
use crate::scene::{Join, Scene};

/// What triangles show in the rows of a strip, and what of its splats they are joined by.
#[derive(Clone, Copy, Debug, Default)]
pub struct Beside<'a> {
    /// What is nearest of the splats at each pixel.
    pub nearest: &'a [Nearest],
    /// What triangles show there; empty if there are none.
    pub triangles: &'a [Shown],
    /// [`Scene::largest_shorter`](crate::scene::Scene::largest_shorter), world units.
    pub largest_shorter: f64,
    /// No surfel lies deeper ([`farthest`](crate::plan::farthest)), world units.
    pub farthest: f64,
}

/// The twin: what shows of a pixel's splats, their sums and what those show, and of its triangle, with the splats' nearest depth there.
pub(super) fn joined(
    (sums, splats): (&PixelSums, Option<Surface>),
    triangle: &Shown,
    (nearest, beside): (f64, &Beside<'_>),
    options: &RenderOptions,
) -> Option<Surface> {
    let (share, order) = share_of_splats(sums, triangle, (nearest, beside), options);
    let decision = sums.decision.min(triangle.decision).min(order);
    let of_triangle = triangle.depth.is_finite().then_some(Surface {
        color: triangle.color,
        normal: triangle.normal,
        place: [0.0; 2],
        depth: triangle.depth,
        weight: 1.0,
        count: 1,
        decision,
    });
    match (splats, of_triangle) {
        (Some(splats), Some(_)) if share == 1.0 => Some(Surface { decision, ..splats }),
        (Some(splats), None) => Some(Surface { decision, ..splats }),
        (Some(splats), Some(of_triangle)) if share > 0.0 => {
            let mix = |triangle: f64, splats: f64| triangle + share * (splats - triangle);
            let alpha = mix(of_triangle.color[3], splats.color[3]);
            let premultiplied = |surface: &Surface, k: usize| surface.color[k] * surface.color[3];
            let straight = |k: usize| {
                let mixed = mix(premultiplied(&of_triangle, k), premultiplied(&splats, k));
                if alpha > 0.0 { mixed / alpha } else { 0.0 }
            };
            let normal = of_triangle.normal.lerp(splats.normal, share).normalize_or_zero();
            let color = [straight(0), straight(1), straight(2), alpha];
            Some(Surface { color, normal, depth: mix(of_triangle.depth, splats.depth), decision, ..splats })
        }
        (_, of_triangle) => of_triangle,
    }
}

/// Whether the depth that a scene's splats blend to decides what shows.
pub(super) fn compares_depth(scene: &Scene, options: &RenderOptions) -> bool {
    !scene.triangles.is_empty() && options.join != Join::Nearest
}

/// The part of the pixel that splats have beside a triangle, and its relative distance to a decision.
fn share_of_splats(
    sums: &PixelSums,
    triangle: &Shown,
    (nearest, beside): (f64, &Beside<'_>),
    options: &RenderOptions,
) -> (f64, f64) {
    match (sums.weight > 0.0, triangle.depth.is_finite()) {
        (false, _) => return (0.0, f64::INFINITY),
        (true, false) => return (1.0, f64::INFINITY),
        (true, true) => {}
    }
    let depth = sums.depth / sums.depth_weight;
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
    files: |needs| match needs.mesh.map(|mesh| mesh.join) {
        // What shows through is made of lists.
        _ if needs.lists.is_some() || needs.peels.is_some() => Vec::new(),
        None => vec!["join_absent.wgsl"],
        Some(Join::Corrected) => vec!["join.wgsl", "join_corrected.wgsl"],
        Some(Join::Nearest) => vec!["join.wgsl", "join_nearest.wgsl"],
        Some(Join::Blended) => vec!["join.wgsl", "join_blended.wgsl"],
    },
    kernels: |_| Vec::new(),
    constants: |_| Vec::new(),
};
