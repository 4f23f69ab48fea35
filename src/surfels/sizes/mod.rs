//! The size of each point's surfel.

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
pub(crate) use self::cell::{LEAST, RADIUS_NEIGHBOURS, cell_ellipse, open_radius};
pub(crate) use self::ellipse::shape;
use self::ellipse::{ELLIPSE_NEIGHBOURS, bounding_ellipse};
pub(crate) use self::limit::local_limits;
pub(crate) use self::lone::{Surroundings, lone_radius, surroundings};
pub(crate) use self::qsplat::measure as measure_triangles;
pub(crate) use self::rough::{Rough, grown};
use super::graph::NeighbourGraph;
use super::planes::Neighbourhoods;
use super::positions::DistinctPositions;
use crate::{Error, Result};

/// The method that computes the size of a surfel from the points around it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Size {
    /// The smallest ellipse that holds the point's Voronoi cell in the tangent plane, the part that
    /// is nearer to the point than to any neighbour.
    #[default]
    Knn,
    /// The ellipse that bounds 8 neighbours in the tangent plane, with the axes of their covariance
    /// there (Pajarola et al. 2003, section 3.4).
    Ellipse,
    /// A disk per point from clusters of three points, found by binary space partition along
    /// principal axes ("a simple scheme to render point-sampled surfaces", section 3.3).
    Bsp(Triangle),
    /// One radius for all disks ("each point as a surfel with fixed radius", the same section): the
    /// mean over such clusters, without those that are no triangle of a surface.
    BspGlobal(Triangle),
    /// At each vertex of a mesh, a disk as large as the largest bounding circle of a triangle there
    /// (Rusinkiewicz and Levoy 2000).
    Qsplat,
}

/// The measure that is used as the size of a cluster of three points.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Triangle {
    /// The mean length of the triangle's edges.
    #[default]
    MeanEdge,
    /// The diameter of the smallest sphere through its corners.
    Circumsphere,
}

impl Size {
    /// Every size, with its name on the command line.
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
    /// Whether the size is a radius alone, without the shape of the surface; such disks stay flat.
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

/// The offsets of the `count` nearest neighbours of position `index`, scaled units, the nearest
/// first.
pub(crate) fn offsets<'a>(
    distinct: &'a DistinctPositions,
    graph: &'a NeighbourGraph,
    index: u32,
    count: usize,
) -> impl Iterator<Item = DVec3> + Clone + 'a {
    let center = distinct.position(index);
    graph.of(index).iter().take(count).map(move |&other| distinct.position(other) - center)
}

/// Returns the half-axes s, the longer one, and t at position `index`, computed from its
/// neighbours, perpendicular to `normal`, scaled units. They are zero if the neighbours do not
/// determine them, and for sizes from clusters or triangles.
pub(crate) fn half_axes_at(
    size: Size,
    (distinct, graph): (&DistinctPositions, &NeighbourGraph),
    index: u32,
    normal: [f32; 3],
) -> [DVec3; 2] {
    let normal = DVec3::from_array(normal.map(f64::from)).normalize();
    let near = Neighbourhoods::around((distinct, graph), [index]);
    let near = near.of_neighbours(0);
    match size {
        Size::Knn if !near.is_empty() => cell_ellipse(near, normal),
        Size::Ellipse => match bounding_ellipse(near.iter().copied().take(ELLIPSE_NEIGHBOURS), normal) {
            // All neighbours lie along the normal, so only their distances determine a size.
            [DVec3::ZERO, _] => {
                let radius = open_radius(near.iter().copied().take(ELLIPSE_NEIGHBOURS));
                <[DVec3; 2]>::from(normal.any_orthonormal_pair()).map(|axis| axis * radius)
            }
            axes => axes,
        },
        Size::Knn | Size::Bsp(_) | Size::BspGlobal(_) | Size::Qsplat => [DVec3::ZERO; 2],
    }
}
