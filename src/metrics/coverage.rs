//! The coverage of a surface by its surfels: the holes that they leave, seen from all around.

use std::f64::consts::TAU;

use glam::DVec3;
use rayon::prelude::*;
use serde::Serialize;

use crate::error::{Error, Result};
use crate::progress::Progress;
use crate::scene::{Camera, Lens, Scene, Up};
use crate::surfels::analytic::{Shape, generate};
use crate::truth::{DiskTree, TriangleTree};

/// The default number of views.
pub const DEFAULT_VIEWS: u32 = 64;

/// The default number of rays along each side of a view.
pub const DEFAULT_SIDE: u32 = 512;

/// The largest distance along the ray between a hit on the surface and a disk that covers the hit,
/// in the disk's shorter half-axes.
///
/// This corresponds to the epsilon `radius:1`, within which a renderer takes depths for one
/// surface. So disks on the far side of the body do not cover the hit, however many there are. A
/// disk that is off by the sag of a curved surface does.
pub const REACH: f64 = 1.0;

/// The width of the strip along an outline that flat disks may cut off, in longer half-axes of the
/// nearest disk.
const EDGE: f64 = 0.5;

/// The largest depth, over the distance of two rays, by which one ray's hit may lie behind the
/// tangent plane at the other's. Beyond it, the surface has a step between the rays.
const STEP: f64 = 2.0;

/// The parts of a mesh that surfels leave uncovered.
///
/// The mesh is seen from `views` directions (a Fibonacci lattice on the sphere). Each view is an
/// orthographic image of `side` x `side` rays that shows the ball around its bounds. The first hit
/// of a ray is *covered* if the ray meets a disk within [`REACH`] of it.
///
/// An uncovered hit is an *edge* if the surface ends or steps back within half the radius of the
/// nearest disk, and a *hole* if the surface continues around it. Along an outline, flat disks end
/// slightly inside the true silhouette: an error of shape, not a gap between disks. A gap at the
/// outline of one view is not at the outline of another, which sees it from the front.
///
/// Shares are of rays, so of the visible surface as seen: parts that face a view count by their
/// area, oblique parts by less, and hidden parts not at all. If there are no holes, none of these
/// views shows a gap that holds a circle of diameter `sqrt(2) * ray_spacing`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Coverage {
    /// The number of views.
    pub views: u32,
    /// Rays along each side of a view.
    pub side: u32,
    /// The distance of neighbouring rays, world units.
    pub ray_spacing: f64,
    /// The counts over all views.
    #[serde(flatten)]
    pub seen: Seen,
    /// `uncovered / rays`; None if no ray meets the mesh.
    pub uncovered_share: Option<f64>,
    /// `holes / rays`; None if no ray meets the mesh.
    pub hole_share: Option<f64>,
    /// The number of views with a hole.
    pub views_with_holes: u32,
    /// The view with the largest share of holes, if any has one.
    pub worst_view: Option<WorstView>,
}

/// Counts of rays.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Seen {
    /// Rays that meet the mesh.
    pub rays: u64,
    /// Rays among these that no disk covers.
    pub uncovered: u64,
    /// Rays among the uncovered ones that are not at an edge.
    pub holes: u64,
}

impl Seen {
    fn and(self, other: Self) -> Self {
        Self {
            rays: self.rays + other.rays,
            uncovered: self.uncovered + other.uncovered,
            holes: self.holes + other.holes,
        }
    }

    fn share(self, part: u64) -> Option<f64> {
        (self.rays > 0).then(|| part as f64 / self.rays as f64)
    }
}

/// The view that shows most holes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct WorstView {
    /// The unit vector from the mesh towards the viewer.
    pub from: [f64; 3],
    /// Holes over rays that meet the mesh, in this view.
    pub hole_share: f64,
}

impl Coverage {
    /// Whether some ray meets the mesh, and none finds a hole.
    pub fn is_hole_free(&self) -> bool {
        self.seen.rays > 0 && self.seen.holes == 0
    }
}

/// Casts rays at `mesh` from all around and counts hits that no disk of `scene` covers.
///
/// # Errors
///
/// [`Error::Usage`] if `views` is 0, or if `side` is 0 or too many pixels for a camera.
pub fn coverage(
    mesh: &TriangleTree,
    scene: &Scene,
    views: u32,
    side: u32,
    progress: &dyn Progress,
) -> Result<Coverage> {
    if views == 0 {
        return Err(Error::Usage("coverage is measured from at least one view".into()));
    }
    // A mesh of one point has no extent; no ray meets it, whatever the camera.
    let radius = if mesh.radius() > 0.0 { mesh.radius() } else { 1.0 };
    let toward: Vec<DVec3> =
        generate(Shape::Sphere, views.into()).map(|sample| DVec3::from_array(sample.position)).collect();
    let camera = |toward: &DVec3| {
        let eye = mesh.center() + 2.0 * radius * toward;
        Camera::look_at(
            (side, side),
            Lens::OrthographicHeight(2.0 * radius),
            eye,
            mesh.center(),
            None,
            Up::Y,
            0.1 * radius,
        )
    };
    let cameras = toward.iter().map(camera).collect::<Result<Vec<_>>>()?;
    let disks = DiskTree::new(scene);
    progress.begin("casting rays", u64::from(views) * u64::from(side));
    let row = |camera: &Camera, y: u32| {
        let mut seen = Seen::default();
        for x in 0..side {
            let Some(hit) = meet(mesh, camera, x.into(), y.into()) else { continue };
            seen.rays += 1;
            if !disks.covers(hit.point, hit.direction, REACH) {
                seen.uncovered += 1;
                seen.holes += u64::from(!is_at_edge(mesh, &disks, camera, &hit, x.into(), y.into()));
            }
        }
        progress.advance(1);
        seen
    };
    let in_view = |camera: &Camera| (0..side).into_par_iter().map(|y| row(camera, y)).reduce(Seen::default, Seen::and);
    let of_views: Vec<Seen> = cameras.par_iter().map(in_view).collect();
    progress.end();
    let seen = of_views.iter().copied().fold(Seen::default(), Seen::and);
    let with_holes = of_views.iter().zip(&toward).filter(|(seen, _)| seen.holes > 0);
    let worst = with_holes.clone().filter_map(|(seen, toward)| Some((seen.share(seen.holes)?, toward)));
    let worst = worst.max_by(|a, b| a.0.total_cmp(&b.0));
    Ok(Coverage {
        views,
        side,
        ray_spacing: 2.0 * mesh.radius() / f64::from(side),
        seen,
        uncovered_share: seen.share(seen.uncovered),
        hole_share: seen.share(seen.holes),
        views_with_holes: with_holes.count() as u32,
        worst_view: worst.map(|(hole_share, toward)| WorstView { from: toward.to_array(), hole_share }),
    })
}

/// The first hit of a ray.
struct Meeting {
    point: DVec3,
    /// Unit direction of the ray.
    direction: DVec3,
    /// Unit normal of the triangle.
    normal: DVec3,
}

/// The first hit of the ray through pixel (x, y).
fn meet(mesh: &TriangleTree, camera: &Camera, x: f64, y: f64) -> Option<Meeting> {
    let (start, direction) = (camera.ray_start(x + 0.5, y + 0.5), camera.ray(x + 0.5, y + 0.5));
    let hit = mesh.first_hit(start, direction, 0.0)?;
    Some(Meeting { point: start + direction * hit.distance, direction, normal: hit.facet })
}

/// Whether the hit at pixel (x, y) is at an edge. Tests rays around it in eight directions, at half
/// and at the full width of the strip.
fn is_at_edge(mesh: &TriangleTree, disks: &DiskTree, camera: &Camera, hit: &Meeting, x: f64, y: f64) -> bool {
    let Some(radius) = disks.radius_near(hit.point) else { return false };
    (0..16).any(|k| {
        let across = EDGE * radius * if k < 8 { 0.5 } else { 1.0 };
        let (sin, cos) = (TAU * f64::from(k) / 8.0).sin_cos();
        let (dx, dy) = (across * cos * camera.fx, across * sin * camera.fy);
        let Some(beside) = meet(mesh, camera, x + dx, y + dy) else { return true };
        // The depth by which the neighbouring ray goes beyond the plane through the hit.
        let below = (beside.point - hit.point).dot(hit.normal) / hit.direction.dot(hit.normal);
        below > STEP * across
    })
}
