//! Computes surfels from points: the command `epsplat surfels`.

mod sizes;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::caps::caps_of;
use super::creases::clips;
use super::estimate::NORMAL_NEIGHBOURS;
use super::gather::{Gathered, gather};
use super::graph::NeighbourGraph;
use super::orient::{self, Orientation};
use super::outliers::drop_outliers;
use super::planes::{Neighbourhoods, TOGETHER};
use super::positions::DistinctPositions;
use super::sheets;
use super::sizes::{RADIUS_NEIGHBOURS, Size, measure_triangles, offsets, open_radius};
use super::{Limits, Preparation, guess_up, origin_for, painting, unit, usable_axes};
use crate::io::Points;
use crate::scene::{Bounds, Clip, Listed, Surfel, body, framed};
use crate::{Error, Progress, Result};
use sizes::Sizes;

/// A disk that ends at an edge is enlarged by this factor, because neither cells nor planes are
/// certain there. Of 4.0 million rays at 60,000 points of the fandisk with normals, 9 find a hole;
/// without the factor, 126.
const AT_EDGE: f32 = 1.2;

/// The options for computing surfels from points.
#[derive(Clone, Debug, PartialEq)]
pub struct FromPoints {
    /// The size of the surfels.
    pub size: Size,
    /// The side that estimated normals point to.
    pub orientation: Orientation,
    /// Estimate normals even where they are given.
    pub estimate_normals: bool,
    /// Limits on the points that become surfels, and on the surfels' size.
    pub limits: Limits,
}

impl Default for FromPoints {
    /// Ellipses that contain the points' cells, with outward normals. No point is left out, and a
    /// half-axis is at most three times the median of the neighbours' half-axes.
    fn default() -> Self {
        Self {
            size: Size::Knn,
            orientation: Orientation::Propagate,
            estimate_normals: false,
            limits: Limits::default(),
        }
    }
}

/// The surfels of a cloud, and the counts of their preparation.
#[derive(Clone, Debug)]
pub struct Surfels {
    /// One surfel for each point that was not left out, in the points' order, with normals and
    /// radii. There are half-axes too, unless all surfels are disks ([`Size::is_of_disks`]) and
    /// none ends at an edge. Colours and texture coordinates are the given ones.
    pub points: Points,
    /// The counts that every scene has.
    pub preparation: Preparation,
    /// The number of connected parts of the surface, each oriented separately; None if no normals
    /// were propagated.
    pub parts: Option<u64>,
    /// For [`Size::Bsp`], the number of positions whose cluster of three points is collinear; else
    /// 0.
    pub collinear: u64,
    /// For [`Size::BspGlobal`], the number of positions around which the one radius leaves gaps, as
    /// their neighbours are farther away; else 0.
    pub sparse: u64,
}

impl Surfels {
    /// Sentences for the user, one for each kind of loss or replacement.
    pub fn notes(&self) -> Vec<String> {
        let mut notes = self.preparation.notes();
        let mut counted = |count: u64, what: &str| notes.extend((count > 0).then(|| format!("{count} points {what}")));
        counted(self.collinear, "are in collinear clusters, and got the mean length of their edges as their size");
        counted(self.sparse, "are too sparse for one radius, which leaves holes there: take --size bsp or knn");
        let distinct = self.preparation.distinct_positions.unwrap_or(self.preparation.surfels);
        counted(self.preparation.surfels - distinct, "coincide with another one");
        notes
    }
}

/// Computes surfels from the points of all inputs, which become one cloud.
///
/// Neighbours are searched among all points. Points at one position count as one and have equal
/// sizes and estimated normals. The result for a point is the same to the bit for any order of the
/// points and any number of threads.
///
/// # Errors
///
/// [`Error::EmptyScene`] if no input holds a usable point, and [`Error::Usage`] for options out of
/// range or more than 2^32 - 1 points.
pub fn from_points(inputs: Vec<Points>, options: &FromPoints, progress: &dyn Progress) -> Result<Surfels> {
    check(options)?;
    let mut inputs = inputs;
    if options.size == Size::Qsplat {
        inputs.iter_mut().try_for_each(measure_triangles)?;
    }
    painting::number_together(&mut inputs)?;
    let mut gathered = gather(inputs)?;
    gathered.points = std::mem::take(&mut gathered.points).in_light();
    if options.estimate_normals {
        (gathered.points.normals, gathered.points.axes) = (None, None);
    }
    let bounds = Bounds::of(gathered.points.positions.par_iter().map(|position| DVec3::from_array(*position)));
    let (body, _) = body(gathered.points.positions.len(), |index| DVec3::from_array(gathered.points.positions[index]));
    let known_up = gathered.points.up.unwrap_or_else(|| guess_up(&body));
    let up = known_up.axis();
    let origin = origin_for(&body);
    progress.begin("sorting points", 0);
    let mut distinct = DistinctPositions::new(&gathered.points.positions, &bounds, origin)?;
    progress.end();
    if let Some(deviations) = options.limits.outliers {
        gathered.preparation.dropped_outliers = drop_outliers(&mut gathered, &mut distinct, deviations, progress);
    }
    let graph = NeighbourGraph::new(&distinct, NORMAL_NEIGHBOURS, progress);
    let given = given_normals(&gathered);
    let count = gathered.points.positions.len();
    let mut preparation = prepared(&gathered, given.as_deref(), (&distinct, &graph));
    progress.begin("fitting planes", 0);
    let mut normals = fit_normals(&distinct, &graph, up);
    progress.end();
    let parts = match preparation.estimated_normals {
        0 => None,
        _ => {
            oriented((&distinct, &graph), &mut normals, given.as_deref(), (&options.orientation, up, origin), progress)
        }
    };

    progress.begin("measuring surfels", 0);
    let sizes = Sizes::of((&distinct, &graph), &normals, gathered.points.radii.as_deref(), options, progress);
    let normal_of = |(point, position): (usize, &u32)| {
        given.as_ref().and_then(|all| *all.get(point)?).unwrap_or(normals[*position as usize])
    };
    let of_point = distinct.of_point();
    let point_normals: Vec<[f32; 3]> = of_point.par_iter().enumerate().map(normal_of).collect();
    let (axes, radii) = sizes.of_points((&distinct, &graph), &normals, &point_normals);
    progress.end();
    let (axes, clips) = match preparation.estimated_normals == 0 && !preparation.has_random_sides() {
        true => cut(&distinct, &graph, (&point_normals, &radii), (options.size, axes)),
        false => (axes, None),
    };
    let radii = axes.as_ref().map_or(radii, longer);
    let curved = options.limits.curved && !options.size.is_of_disks();
    let caps = axes.as_ref().filter(|_| curved);
    let sided = !preparation.has_random_sides();
    let caps = caps.map(|axes| caps_of((&distinct, &graph), (&point_normals, sided), axes));
    let (normals, radii, up) = (Some(point_normals), Some(radii), Some(known_up));
    // The cloud counts as not closed, because it is unknown which surfels cover a closed surface.
    let unsided = gathered.points.unsided && preparation.estimated_normals < preparation.surfels;
    let points =
        Points { unsided, normals, radii, axes, clips, caps, up, closed: false, tree: None, ..gathered.points };
    preparation.limited_by_neighbours = Some(sizes.limited(distinct.of_point()));
    let radius = |index: usize| points.radii.as_ref().map_or(0.0, |radii| f64::from(radii[index]));
    preparation.strays = framed(&Listed(count, |index| (DVec3::from_array(points.positions[index]), radius(index)))).1;
    let (collinear, sparse) = (sizes.collinear, sizes.sparse(distinct.of_point()));
    Ok(Surfels { points, preparation, parts, collinear, sparse })
}

/// The preparation as far as it is known before the surfels are computed.
fn prepared(
    gathered: &Gathered,
    given: Option<&[Option<[f32; 3]>]>,
    (distinct, graph): (&DistinctPositions, &NeighbourGraph),
) -> Preparation {
    let count = gathered.points.positions.len();
    let mut preparation = Preparation {
        surfels: count as u64,
        estimated_normals: given.map_or(count, |all| all.iter().filter(|n| n.is_none()).count()) as u64,
        estimated_radii: count as u64,
        guessed_up: gathered.points.up.is_none(),
        distinct_positions: Some(distinct.len() as u64),
        median_spacing: median_spacing(distinct, graph),
        ..gathered.preparation.clone()
    };
    if preparation.estimated_normals == 0 {
        let of_point = |point: usize| given?.get(point).copied()?.map(Vec3::from_array);
        preparation.opposed_normals = orient::opposed(distinct, graph, of_point);
    }
    preparation
}

/// Half-axes s and t of each point, world units.
pub(super) type HalfAxes = Vec<[[f32; 3]; 2]>;

/// The lengths of the half-axes s, which are not shorter than t.
fn longer(axes: &HalfAxes) -> Vec<f32> {
    axes.par_iter().map(|[s, _]| DVec3::from_array(s.map(f64::from)).length() as f32).collect()
}

/// The half-axes of points, and the clip lines at which their surfels end at edges.
///
/// If no surfel ends at an edge, `axes` is returned unchanged. Otherwise ellipses away from edges
/// keep their half-axes, and so do all ellipses of [`Size::Ellipse`]. Cell ellipses ([`Size::Knn`])
/// at an edge become disks, because points across the edge do not bound the cell on this side.
/// Disks are enlarged by [`AT_EDGE`]; for sizes that give disks, this includes disks away from
/// edges.
fn cut(
    distinct: &DistinctPositions,
    graph: &NeighbourGraph,
    (normals, radii): (&[[f32; 3]], &[f32]),
    (size, axes): (Size, Option<HalfAxes>),
) -> (Option<HalfAxes>, Option<Vec<Clip>>) {
    // Points at one position may have several normals: the first point's normal counts.
    let first = distinct.first_points();
    let wide = |v: [f32; 3]| DVec3::from_array(v.map(f64::from));
    let half_axes = |point: usize| match &axes {
        Some(axes) if size != Size::Knn => axes[point],
        _ => {
            let open = match size {
                Size::Knn => open_radius(offsets(distinct, graph, distinct.of_point()[point], RADIUS_NEIGHBOURS)),
                _ => 0.0,
            };
            let radius = AT_EDGE * radii[point].max((open / distinct.scale()) as f32);
            let Surfel { s, t, .. } = Surfel::disk(Vec3::ZERO, Vec3::from_array(normals[point]), radius);
            [s, t]
        }
    };
    let of_positions: Vec<DVec3> =
        first.iter().map(|point| wide(normals[*point as usize]).normalize_or_zero()).collect();
    let clips =
        clips(distinct, graph, &of_positions, |position| half_axes(first[position as usize] as usize).map(wide));
    if clips.is_empty() {
        return (axes, None);
    }
    let is_first = |(point, position): (usize, &u32)| normals[point] == normals[first[*position as usize] as usize];
    let clip = |(point, position): (usize, &u32)| {
        if is_first((point, position)) { clips[*position as usize] } else { Clip::NONE }
    };
    let of_points: Vec<Clip> = distinct.of_point().par_iter().enumerate().map(clip).collect();
    let at_lines = |point: usize| match &axes {
        Some(axes) if of_points[point].is_none() => axes[point],
        _ => half_axes(point),
    };
    (Some((0..normals.len()).into_par_iter().map(at_lines).collect()), Some(of_points))
}

/// Turns the `normals` of positions to one side. Returns the number of connected parts of the
/// surface if normals are propagated along it.
fn oriented(
    (distinct, graph): (&DistinctPositions, &NeighbourGraph),
    normals: &mut [[f32; 3]],
    given: Option<&[Option<[f32; 3]>]>,
    (orientation, up, origin): (&Orientation, DVec3, DVec3),
    progress: &dyn Progress,
) -> Option<u64> {
    match orientation {
        Orientation::Up => None,
        Orientation::Toward(scanners) => {
            let center = |index: usize| distinct.position(index as u32) / distinct.scale() + origin;
            orient::toward(center, normals, scanners);
            None
        }
        Orientation::Propagate => {
            let given = given.into_iter().flatten().zip(distinct.of_point());
            let given: Vec<_> = given.filter_map(|(normal, &position)| Some((position, (*normal)?))).collect();
            let parts = orient::propagate(distinct, graph, normals, &given, up, progress);
            progress.begin("telling sheets apart", 0);
            sheets::refit(distinct, graph, normals);
            progress.end();
            Some(parts)
        }
    }
}

fn check(options: &FromPoints) -> Result<()> {
    options.limits.check()?;
    match &options.orientation {
        Orientation::Toward(scanners) if scanners.is_empty() || !scanners.iter().all(|at| at.is_finite()) => Err(
            Error::Usage("normals are turned toward scanner positions: give at least one, and only finite ones".into()),
        ),
        _ => Ok(()),
    }
}

/// The usable given normals, of unit length. The normal of half-axes takes precedence. None if no
/// input has normals or half-axes.
fn given_normals(gathered: &Gathered) -> Option<Vec<Option<[f32; 3]>>> {
    let Points { normals, axes, .. } = &gathered.points;
    (normals.is_some() || axes.is_some()).then(|| {
        let of_axes = |i: usize| {
            let [s, t] = usable_axes(*axes.as_ref()?.get(i)?)?.map(|axis| axis.as_dvec3());
            Some(s.cross(t).normalize().as_vec3())
        };
        let of_normal = |i: usize| unit(*normals.as_ref()?.get(i)?);
        let all = (0..gathered.points.positions.len()).into_par_iter();
        all.map(|i| of_axes(i).or_else(|| of_normal(i)).map(|normal| normal.to_array())).collect()
    })
}

/// The normal of the plane fitted to each position and its neighbours, on the side of `up`.
fn fit_normals(distinct: &DistinctPositions, graph: &NeighbourGraph, up: DVec3) -> Vec<[f32; 3]> {
    let groups = (0..distinct.len()).into_par_iter().step_by(TOGETHER);
    let mut normals = vec![[0.0; 3]; distinct.len()];
    normals.par_chunks_mut(TOGETHER).zip(groups).with_min_len(1024).for_each(|(group, first)| {
        let last = first + group.len() - 1;
        let indices: [u32; TOGETHER] = std::array::from_fn(|lane| (first + lane).min(last) as u32);
        let fitted = Neighbourhoods::around((distinct, graph), indices).normals(up);
        group.iter_mut().zip(fitted).for_each(|(slot, normal)| *slot = normal.as_vec3().to_array());
    });
    normals
}

/// The median distance to the nearest other position, world units; None if there is only one
/// position.
fn median_spacing(distinct: &DistinctPositions, graph: &NeighbourGraph) -> Option<f64> {
    let nearest = |index| offsets(distinct, graph, index, 1).next();
    let spacings = (0..distinct.len() as u32).into_par_iter().filter_map(|index| Some(nearest(index)?.length()));
    super::estimate::median(&mut spacings.collect::<Vec<_>>()).map(|spacing| spacing / distinct.scale())
}
