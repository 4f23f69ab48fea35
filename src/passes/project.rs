//! Stage 1: projects every surfel to a splat, once: its [`homography`], the pixels that it may
//! touch, and its [`lowpass`].
//!
//! The pixel bounds only save work: [`footprint`](super::footprint) decides which pixels are
//! covered.

use glam::{DVec2, DVec3, Vec3};
use rayon::prelude::*;

use super::conic;
use super::curved::{self, Curve, Seen};
use super::homography::{self, Projected, slope};
use super::lowpass::{self, Design};
use super::splat::{Filter, Splat};
use super::visibility;
use crate::gpu::layout::QUEUE_START;
use crate::plan::pass::Pass;
use crate::plan::steps::{Clear, Kernel, Over, Part, Run, Stage, Twin};
use crate::plan::{Facts, Settings, Sides, composited, culls_back};
use crate::plan::{Plan, tuning};
use crate::scene::{Camera, Cap, Clip, Composite, Fade, Form, LowPass, Scene, Surfel, copies, has_copies};

/// How a surfel extends out of its plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Body {
    /// By a cap.
    Cap(Cap),
    /// As a 3D Gaussian with this third half-axis, world units.
    Solid(f32),
}

impl Body {
    /// The body of the surfel at `index`; None if it is flat.
    pub fn of(scene: &Scene, index: usize, options: &Settings) -> Option<Self> {
        let third = scene.thirds.get(index).map(|third| Self::Solid(*third));
        third.or_else(|| scene.caps.get(index).filter(|_| options.draws_caps()).map(|cap| Self::Cap(*cap)))
    }
}

/// A surfel with its index, and with its body if some surfel of the scene has one.
pub type Indexed<'a> = (u32, &'a Surfel, Option<Body>);

/// The f64 twin of `wgsl/project/project.wgsl` for one surfel; `None` if it can touch no pixel.
///
/// `relative` is the surfel's centre relative to the camera's eye, world units.
pub fn reference(of: Indexed<'_>, relative: DVec3, camera: &Camera, design: &Design) -> Option<Splat> {
    projected(of, relative, camera, design, false).ok()
}

/// Why a surfel touches no pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Missed {
    /// It lies behind the camera or nearer than the near depth.
    Behind,
    /// It lies beside the image.
    Outside,
    /// It lies between pixel centres, because it is small or seen edge-on.
    Between,
}

/// The splat of [`reference`], or why there is none; if `again`, the part of it beyond the border
/// of a whole sphere.
pub(super) fn projected(
    (index, surfel, body): Indexed<'_>,
    relative: DVec3,
    camera: &Camera,
    design: &Design,
    again: bool,
) -> Result<Splat, Missed> {
    let vector = |v: [f32; 3]| Vec3::from_array(v).as_dvec3();
    let (s_world, t_world) = (vector(surfel.s), vector(surfel.t));
    let p = camera.rotation * relative;
    let point = design.facing.map(|faced| faced.point(surfel, p.z, camera));
    let own = || [s_world, t_world].map(|axis| camera.rotation * axis);
    let [s, t] = of_body(body, point.map_or_else(own, |point| point.axes()), p, camera, design);
    let is_solid = matches!(body, Some(Body::Solid(_)));
    let own = match camera.optics {
        Some(_) => Some(homography::own(camera, p, s, t).ok_or(Missed::Behind)?),
        None => None,
    };
    let (normal, radius) = (curved::normal_of(s, t), s.length().max(t.length()));
    let normal = own.as_ref().map_or(normal, |own| own.axes(normal));
    let (p, s, t) = own.as_ref().map_or((p, s, t), |own| (DVec3::Z * own.depth, own.s, own.t));
    let cap = if let Some(Body::Cap(cap)) = body { Some(cap) } else { None };
    let seen = cap.map(|cap| Seen { p, s, t, normal, radius, cap });
    let pinhole = own.as_ref().map(|own| own.camera(camera));
    let camera = pinhole.as_ref().unwrap_or(camera);
    let depths = seen.as_ref().map_or([p.z - slope(s, t), p.z + slope(s, t)], Seen::depths);
    if depths[1] < camera.near {
        return Err(Missed::Behind);
    }
    let mut projected = match &own {
        Some(own) => homography::lens(camera.near, own),
        None => homography::projected(camera, p, s, t),
    };
    let near = depths[0].max(camera.near);
    let depths = [near, depths[1].max(near)];
    let curve = seen.as_ref().map(|seen| {
        [projected.low, projected.high] = seen.extent(camera);
        Curve { slopes: curved::normal_slopes(s_world, t_world, seen.cap), ..curved::curve(camera, seen, &projected) }
    });
    let filter =
        projected.images.filter(|_| !is_solid).and_then(|[center, s, t]| lowpass::filter(design, center, s, t, depths));
    if let Some(filter) = &filter {
        widen(&mut projected, filter, design.low_pass);
    }
    if again {
        turn(&mut projected, camera.width);
    }
    let [first, last] = pixels(&projected, camera)?;
    let normal = s_world.cross(t_world);
    let normal = (normal / normal.abs().max_element()).normalize();
    Ok(Splat {
        surfel: index,
        anchor: projected.anchor,
        first,
        last,
        a: projected.a,
        b: projected.b,
        c: projected.c,
        // A point that faces the camera shows no back.
        away: projected.away && point.is_none() && !is_solid,
        sides: Sides::None,
        normal,
        filter,
        clip: Clip::NONE,
        outline: None,
        curve,
        point,
        copies: 1,
        fade: Fade::WHOLE,
    })
}

/// The half-axes in camera space: those of a disk, or of the ellipse that a 3D Gaussian shows.
fn of_body(body: Option<Body>, [s, t]: [DVec3; 2], p: DVec3, camera: &Camera, design: &Design) -> [DVec3; 2] {
    match body {
        // A lens draws no 3D Gaussians.
        Some(Body::Solid(third)) => {
            let w = s.normalize().cross(t.normalize()).normalize_or_zero() * f64::from(third);
            conic::half_axes(p, [s, t, w], camera, design.dilation)
        }
        _ => [s, t],
    }
}

/// The first and the last column and row of pixels that a splat may touch.
fn pixels(projected: &Projected, camera: &Camera) -> Result<[[u32; 2]; 2], Missed> {
    let margin = 0.01 + 1e-5 * (projected.low.abs() + projected.high.abs());
    let size = DVec2::new(camera.width.into(), camera.height.into());
    let first = (projected.low - margin - 0.5).ceil().max(DVec2::ZERO);
    let last = (projected.high + margin - 0.5).floor().min(size - 1.0);
    if first.x <= last.x && first.y <= last.y {
        return Ok([first, last].map(|corner| [corner.x as u32, corner.y as u32]));
    }
    let in_image = projected.low.cmplt(size).all() && projected.high.cmpgt(DVec2::ZERO).all();
    Err(if in_image { Missed::Between } else { Missed::Outside })
}

/// Widens the bounds of a disk by those of its low-pass filter. With `ewa` the filter includes the
/// disk; with other low-passes the disk shows beside the filter.
fn widen(disk: &mut Projected, filter: &Filter, low_pass: LowPass) {
    let center = DVec2::new(disk.anchor[0] as f64, disk.anchor[1] as f64) + 0.5 + filter.center;
    let (low, high) = (center - filter.extent, center + filter.extent);
    let beside = low_pass != LowPass::Ewa;
    disk.low = if beside { disk.low.min(low) } else { low };
    disk.high = if beside { disk.high.max(high) } else { high };
}

/// Moves a disk by the width of the image of a whole sphere, toward the other border.
fn turn(disk: &mut Projected, width: u32) {
    let width = i64::from(width);
    let turn = if 2 * disk.anchor[0] >= width { -width } else { width };
    disk.anchor[0] += turn;
    disk.low.x += turn as f64;
    disk.high.x += turn as f64;
}

/// All splats of a scene that may touch a pixel, in the order of the surfels.
///
/// Identical copies of a surfel become one splat, if the scene has many.
pub fn reference_all(scene: &Scene, camera: &Camera, options: &Settings) -> Vec<Splat> {
    let design = Design::of(options);
    let surfels = scene.surfels.par_iter().enumerate();
    let eye = camera.eye - scene.origin;
    let facts = Facts::of(scene);
    let (cull_back, sides) = (culls_back(&facts, camera, options), Sides::of(&facts, camera, options));
    // Fragment lists hold every copy.
    let once = options.draws_copies_once() && composited(&facts, options) == Composite::Opaque;
    let copies = (has_copies(scene) && once).then(|| copies(scene));
    let project = |again: bool, (index, surfel): (usize, &Surfel)| {
        let copies = copies.as_ref().map_or(1, |copies| copies[index]);
        let of = (index as u32, surfel, Body::of(scene, index, options));
        let splat = || projected(of, scene.center(index) - eye, camera, &design, again).ok();
        let splat = (copies > 0).then(splat).flatten().filter(|splat| !(cull_back && splat.faces_away()));
        let own = |splat: Splat| {
            let given = scene.normals.get(index).map(|normal| Vec3::from_array(*normal).as_dvec3());
            let normal = given.unwrap_or(splat.normal);
            Splat {
                copies,
                fade: scene.fades.get(index).copied().unwrap_or(Fade::WHOLE),
                clip: scene
                    .clips
                    .get(index)
                    .copied()
                    .filter(|_| splat.point.is_none() && !facts.solid)
                    .unwrap_or_default(),
                outline: options.outline,
                sides,
                normal: if splat.away && sides != Sides::Both && splat.curve.is_none() { -normal } else { normal },
                curve: splat.curve.map(|curve| Curve { culls: cull_back, ..curve }),
                ..splat
            }
        };
        splat.map(own)
    };
    let is_sphere = camera.optics.is_some_and(|optics| optics.form == Form::Equirectangular);
    match is_sphere {
        false => surfels.filter_map(|one| project(false, one)).collect(),
        // A splat at the border of a whole sphere shows on both sides.
        true => surfels.flat_map_iter(|one| [project(false, one), project(true, one)].into_iter().flatten()).collect(),
    }
}

/// The pass's kernels, files and constants.
pub const PASS: Pass = Pass {
    name: "project",
    files: |needs| {
        vec!["project.wgsl", if needs.draws_projected { "project_draws.wgsl" } else { "project_draws_absent.wgsl" }]
    },
    kernels: |_| vec![PROJECT, PROJECT_RARE],
    constants: |making| {
        vec![
            ("LARGE", tuning::large(making.needs.surface.tiles(), making.options).into()),
            ("CULL_BACK", u32::from(making.needs.cull_back).into()),
        ]
    },
};

const PROJECT: Kernel = Kernel::new("project");
const PROJECT_RARE: Kernel = Kernel::new("project_rare");

/// The stage that projects `part` of the surfels, for `band` or for it and all later bands.
///
/// If [`cull`](super::cull) leaves batches out, it has already listed the batches to project.
/// Splats that take long to project are listed and projected by a dispatch of their own. Both
/// dispatches also draw the nearest depths of small splats if
/// [`SceneNeeds::draws_projected`](crate::plan::SceneNeeds::draws_projected) says so.
pub fn steps(plan: &Plan, band: usize, part: Part) -> Stage {
    let start = |queue| Clear::of(queue, 0, QUEUE_START.into());
    let draws = plan.needs.draws_projected;
    let mut clears = Vec::new();
    if part != Part::Far || !draws {
        clears.push(start("rare"));
    }
    if !plan.needs.cull {
        clears.push(start("queue"));
    }
    if part != Part::Far && draws {
        clears.extend(visibility::clears(plan, band));
    }
    let run = |kernel, over| Run { kernel, over };
    let mut runs = vec![run(PROJECT, Over::Slots(part))];
    // A kernel of its own that draws the near part reads the records of rare splats too.
    runs.extend((part != Part::Near || !draws).then(|| run(PROJECT_RARE, Over::Rare)));
    Stage::new("project", band, runs).after(clears).as_twin(Twin::Project)
}
