//! The voxels that a mesh passes through, and the part of the mesh in each.

use glam::DVec3;
use rayon::prelude::*;

use super::overlap::overlaps;
use super::surface::MeshSurface;
use crate::scene::Bounds;

/// A leaf of the tree: a box, and the part of the surface in it.
#[derive(Clone, Debug)]
pub struct Voxel {
    /// The box, relative to the surface's centre, world units.
    pub bounds: Bounds,
    /// The parts of triangles in the box. The parts of all voxels together are the surface.
    pub patches: Vec<Patch>,
    /// The area of the patches, square world units.
    pub area: f64,
}

/// The part of a triangle that lies in a voxel.
#[derive(Clone, Debug)]
pub struct Patch {
    /// The index among the surface's triangles.
    pub triangle: u32,
    /// The area of the part, square world units.
    pub area: f64,
    /// The corners of the part, a convex polygon, each as the weights of the triangle's corners.
    pub(super) outline: Vec<DVec3>,
}

/// A node of the tree: its box, and the triangles that meet it.
struct Cell {
    bounds: Bounds,
    triangles: Vec<u32>,
}

/// The largest number of halvings: a voxel has at least 2^-60 of the box's volume.
const DEEPEST: u32 = 60;

/// The most parts of triangles in all voxels, for each triangle and each voxel that is allowed.
/// Where many large triangles lie close together, each voxel has parts of all of them.
const MOST_PATCHES: usize = 16;

/// Divides a surface into voxels (Tien 2008, section 3.1); returns them and the number of halvings.
///
/// Its bounding box is halved across its longest side, and the halves in turn; halves that meet no
/// triangle are dropped. This ends after `depth` halvings, or before there would be more than
/// `most` voxels or too many parts of triangles ([`MOST_PATCHES`]).
pub(super) fn voxels(surface: &MeshSurface<'_>, depth: Option<u32>, most: usize) -> (Vec<Voxel>, u32) {
    let all = (0..surface.triangles.len() as u32).collect();
    let mut cells = vec![Cell { bounds: surface.bounds, triangles: all }];
    let mut halvings = 0;
    for _ in 0..depth.unwrap_or(DEEPEST).min(DEEPEST) {
        let halves: Vec<Cell> = cells.par_iter().flat_map_iter(|cell| halves(surface, cell)).collect();
        let patches: usize = halves.iter().map(|half| half.triangles.len()).sum();
        let most_patches = surface.triangles.len().saturating_add(most).saturating_mul(MOST_PATCHES);
        if halves.len() > most.max(1) || patches > most_patches {
            break;
        }
        cells = halves;
        halvings += 1;
    }
    let voxels = cells.into_par_iter().map(|cell| voxel(surface, cell));
    (voxels.filter(|voxel| voxel.area > 0.0).collect(), halvings)
}

/// Returns the halves that meet triangles. A triangle in the plane between the halves belongs to
/// the upper one.
fn halves(surface: &MeshSurface<'_>, cell: &Cell) -> impl Iterator<Item = Cell> + use<> {
    let extent = cell.bounds.extent();
    let axis = if extent.x >= extent.y.max(extent.z) {
        DVec3::X
    } else if extent.y >= extent.z {
        DVec3::Y
    } else {
        DVec3::Z
    };
    let middle = cell.bounds.center().dot(axis);
    let at_middle = |corner: DVec3| corner * (DVec3::ONE - axis) + axis * middle;
    let lower = Bounds { min: cell.bounds.min, max: at_middle(cell.bounds.max) };
    let upper = Bounds { min: at_middle(cell.bounds.min), max: cell.bounds.max };
    let inside = |bounds: &Bounds, triangle: &u32| overlaps(&surface.triangles[*triangle as usize].corners, bounds);
    let below =
        |triangle: &u32| surface.triangles[*triangle as usize].corners.iter().any(|corner| corner.dot(axis) < middle);
    let of = |bounds: Bounds, keep: &dyn Fn(&u32) -> bool| {
        let triangles = cell.triangles.iter().copied().filter(|triangle| keep(triangle) && inside(&bounds, triangle));
        Cell { bounds, triangles: triangles.collect() }
    };
    [of(lower, &below), of(upper, &|_| true)].into_iter().filter(|cell| !cell.triangles.is_empty())
}

fn voxel(surface: &MeshSurface<'_>, cell: Cell) -> Voxel {
    let patches: Vec<Patch> = cell
        .triangles
        .into_iter()
        .filter_map(|triangle| {
            let whole = &surface.triangles[triangle as usize];
            let outline = clipped(&whole.corners, &cell.bounds);
            let area = whole.area * share(&outline);
            (area > 0.0).then_some(Patch { triangle, area, outline })
        })
        .collect();
    Voxel { bounds: cell.bounds, area: patches.iter().map(|patch| patch.area).sum(), patches }
}

/// The part of a triangle in a box, as corner weights: the triangle is cut by each of the six
/// planes in turn.
fn clipped(corners: &[DVec3; 3], bounds: &Bounds) -> Vec<DVec3> {
    let mut outline = vec![DVec3::X, DVec3::Y, DVec3::Z];
    for axis in DVec3::AXES {
        let coordinate = DVec3::new(corners[0].dot(axis), corners[1].dot(axis), corners[2].dot(axis));
        for (sign, limit) in [(1.0, bounds.max.dot(axis)), (-1.0, bounds.min.dot(axis))] {
            // The signed distance outside the plane.
            let beyond = |weights: DVec3| sign * (coordinate.dot(weights) - limit);
            let mut kept = Vec::with_capacity(outline.len() + 1);
            for (k, &at) in outline.iter().enumerate() {
                let next = outline[(k + 1) % outline.len()];
                let (here, there) = (beyond(at), beyond(next));
                if here <= 0.0 {
                    kept.push(at);
                }
                if (here < 0.0 && there > 0.0) || (here > 0.0 && there < 0.0) {
                    kept.push(at.lerp(next, here / (here - there)));
                }
            }
            outline = kept;
        }
    }
    outline
}

/// The area of a polygon of corner weights, as a fraction of the triangle's.
fn share(outline: &[DVec3]) -> f64 {
    let Some(&first) = outline.first() else { return 0.0 };
    outline.windows(2).map(|pair| fan_share(first, pair[0], pair[1])).sum()
}

/// The area of a triangle of corner weights, as a fraction of the whole triangle's. Weights sum to
/// one, and in the plane of the first two, the whole triangle has the area 1/2.
pub(super) fn fan_share(a: DVec3, b: DVec3, c: DVec3) -> f64 {
    (b - a).truncate().perp_dot((c - a).truncate()).abs()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::io::Mesh;

    #[test]
    fn parts_of_a_triangle_in_boxes_are_the_triangle() {
        let corners = [DVec3::new(0.1, 0.2, 0.3), DVec3::new(3.7, 0.5, 1.0), DVec3::new(1.0, 3.9, 3.0)];
        let mut whole = 0.0;
        for k in 0..64 {
            let low = DVec3::new(f64::from(k % 4), f64::from(k / 4 % 4), f64::from(k / 16));
            let bounds = Bounds { min: low, max: low + 1.0 };
            let outline = clipped(&corners, &bounds);
            for weights in &outline {
                let p = corners[0] * weights.x + corners[1] * weights.y + corners[2] * weights.z;
                assert!((p - low).min(low + 1.0 - p).min_element() > -1e-12 && weights.min_element() > -1e-12);
            }
            assert!(share(&outline) == 0.0 || overlaps(&corners, &bounds));
            whole += share(&outline);
        }
        assert!((whole - 1.0).abs() < 1e-12, "{whole}");
    }

    #[test]
    fn a_depth_ends_where_there_would_be_too_many_voxels() {
        let mesh = Mesh {
            positions: vec![[0.0; 3], [1.0, 0.1, 0.0], [0.2, 1.0, 0.3], [0.5, 0.4, 1.0]],
            triangles: vec![[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]],
            ..Mesh::default()
        };
        let surface = MeshSurface::new(&mesh).unwrap();
        let of = |depth, most| {
            let (voxels, halvings) = voxels(&surface, Some(depth), most);
            (voxels.iter().map(|voxel| voxel.area).collect::<Vec<_>>(), halvings)
        };
        let (bounded, halvings) = of(60, 1000);
        assert!(bounded.len() <= 1000 && bounded.len() > 300 && halvings < 20, "{} {halvings}", bounded.len());
        // A bounded division equals one with the remaining halvings; a bound that is not reached
        // changes nothing.
        assert_eq!(of(halvings, usize::MAX), (bounded, halvings));
        assert_eq!(of(7, usize::MAX), of(7, 1000));
    }
}
