//! How large the surfel of a point is.

mod bsp;
mod cell;
mod ellipse;
mod limit;
mod lone;
mod qsplat;
mod rough;

use std::str::FromStr;

use glam::DVec3;

pub(crate) use self::bsp::{bsp_radii, common_radius};
pub(crate) use self::cell::{RADIUS_NEIGHBOURS, cell_ellipse, open_radius};
pub(crate) use self::ellipse::shape;
use self::ellipse::{ELLIPSE_NEIGHBOURS, bounding_ellipse};
pub(crate) use self::limit::local_limits;
pub(crate) use self::lone::{Surroundings, lone_radius, surroundings};
pub(crate) use self::qsplat::measure as measure_triangles;
pub(crate) use self::rough::{Rough, grown};
use super::estimate::NORMAL_NEIGHBOURS;
use super::graph::NeighbourGraph;
use super::positions::DistinctPositions;
use crate::{Error, Result};

/// How the size of a surfel follows from the points around it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Size {
    /// The least ellipse that holds the point's Voronoi cell in the tangent plane, which is what is nearer to it than to any neighbour.
    #[default]
    Knn,
    /// The ellipse that bounds 8 neighbours in the tangent plane, with the half-axes of their covariance there (Pajarola et
    /// al. 2003, section 3.4).
    Ellipse,
    /// A disk from clusters of three points, by a binary space partition along principal axes ("a simple scheme to render
    /// point-sampled surfaces", section 3.3).
    Bsp(Triangle),
    /// One disk for all, as large as such clusters are in the mean: the section as it is written ("each point as a surfel with fixed radius").
    BspGlobal(Triangle),
    /// At the vertices of a mesh, disks as large as the largest circle about a triangle there (Rusinkiewicz and Levoy 2000).
    Qsplat,
}

/// What is taken of a cluster of three points as its size.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Triangle {
    /// The mean length of the triangle's edges.
    #[default]
    MeanEdge,
    /// The diameter of the smallest sphere through its corners.
    Circumsphere,
}

impl Size {
    /// Every way to a size, with its name.
    pub const ALL: [(Self, &'static str); 7] = [
        (Self::Knn, "knn"),
        (Self::Ellipse, "ellipse"),
        (Self::Bsp(Triangle::MeanEdge), "bsp"),
        (Self::Bsp(Triangle::Circumsphere), "bsp:circumsphere"),
        (Self::BspGlobal(Triangle::MeanEdge), "bsp:global"),
        (Self::BspGlobal(Triangle::Circumsphere), "bsp:global-circumsphere"),
        (Self::Qsplat, "qsplat"),
    ];
}

impl Size {
    /// Whether it is of disks, which say how large they are and not of what surface.
    pub fn is_of_disks(self) -> bool {
        matches!(self, Self::Bsp(_) | Self::BspGlobal(_) | Self::Qsplat)
    }
}

impl FromStr for Size {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        Self::ALL.iter().find(|(_, known)| *known == name).map(|(size, _)| *size).ok_or_else(|| {
            let names = Self::ALL.map(|(_, known)| known).join(", ");
            Error::Usage(format!("there is no size `{name}`: take one of {names}"))
        })
    }
}

/// The offsets of the `count` nearest neighbours of position `index`, scaled units, the nearest first.
pub(crate) fn offsets<'a>(
    distinct: &'a DistinctPositions,
    graph: &'a NeighbourGraph,
    index: u32,
    count: usize,
) -> impl Iterator<Item = DVec3> + Clone + 'a {
    let center = distinct.position(index);
    graph.of(index).iter().take(count).map(move |&other| distinct.position(other) - center)
}

/// The half-axes of position `index` across `normal`, by its neighbours, scaled units: s, the longer one, and t. Zero where nothing
/// says how long they are, and of a size by clusters.
pub(crate) fn half_axes_at(
    size: Size,
    (distinct, graph): (&DistinctPositions, &NeighbourGraph),
    index: u32,
    normal: [f32; 3],
) -> [DVec3; 2] {
    let normal = DVec3::from_array(normal.map(f64::from)).normalize();
    let near: Vec<DVec3> = offsets(distinct, graph, index, NORMAL_NEIGHBOURS).collect();
    match size {
        Size::Knn if !near.is_empty() => cell_ellipse(&near, normal),
        Size::Ellipse => match bounding_ellipse(near.iter().copied().take(ELLIPSE_NEIGHBOURS), normal) {
            // All neighbours lie along the normal: only their distances say how large a disk is.
            [DVec3::ZERO, _] => {
                let radius = open_radius(near.iter().copied().take(ELLIPSE_NEIGHBOURS));
                <[DVec3; 2]>::from(normal.any_orthonormal_pair()).map(|axis| axis * radius)
            }
            axes => axes,
        },
        Size::Knn | Size::Bsp(_) | Size::BspGlobal(_) | Size::Qsplat => [DVec3::ZERO; 2],
    }
}
