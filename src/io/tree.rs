//! Levels of detail as they are in a file.

use super::Points;
use crate::scene::Surfel;
use crate::scene::hierarchy::{Fault, Hierarchy, Node};

/// The largest magnitude of a node's numbers, the same as for point coordinates.
const LARGEST: f32 = 1e18;

/// The largest radius of a node: at least twice the diagonal of the cube of [`LARGEST`]
/// coordinates, `4 sqrt(3) LARGEST`.
const LARGEST_RADIUS: f32 = 8.0 * LARGEST;

/// The nodes of a tree over points that are in its order ([`Hierarchy`]).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tree {
    /// Centres, half-axes and colours of the nodes; the radii are those of their bounding spheres.
    pub nodes: Box<Points>,
    /// The other values of each node.
    pub rows: Vec<TreeRow>,
}

/// The values of a node beside its ellipse and colour.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TreeRow {
    /// [`Node::cone`].
    pub cone: f32,
    /// [`Node::first`].
    pub first: u32,
    /// [`Node::count`].
    pub count: u32,
    /// [`Node::leaf`].
    pub leaf: bool,
}

impl Tree {
    /// Converts the nodes to a hierarchy relative to `origin`.
    ///
    /// None if a number is not finite or too large, a radius is negative, an alpha is above 1, or
    /// half-axes span no ellipse.
    pub fn hierarchy(&self, origin: glam::DVec3) -> Option<Hierarchy> {
        let count = self.rows.len();
        let mut all = Hierarchy { nodes: Vec::with_capacity(count), low: Vec::with_capacity(count) };
        let (axes, radii) = (self.nodes.axes.as_ref()?, self.nodes.radii.as_ref()?);
        for (index, row) in self.rows.iter().enumerate() {
            let center = glam::DVec3::from_array(*self.nodes.positions.get(index)?) - origin;
            let rounded = center.as_vec3();
            let ([s, t], radius) = (*axes.get(index)?, *radii.get(index)?);
            let color = self.nodes.colors.as_ref().map_or([1.0; 4], |colors| colors.linear(index));
            let numbers = |numbers: &[f32]| numbers.iter().all(|number| number.abs() <= LARGEST);
            let usable = [rounded.as_ref(), &s, &t].into_iter().all(|vector| numbers(vector));
            let usable = usable && numbers(&color) && numbers(&[row.cone]) && radius <= LARGEST_RADIUS;
            let [along, across] = [s, t].map(|axis| glam::DVec3::from_array(axis.map(f64::from)));
            let spans = along.cross(across).length_squared() > 0.0;
            if !usable || radius < 0.0 || !spans || color[3] > 1.0 {
                return None;
            }
            let TreeRow { cone, first, count, leaf } = *row;
            let surfel = Surfel::ellipse(rounded, along.as_vec3(), across.as_vec3());
            let cap = self.nodes.caps.as_ref().and_then(|caps| caps.get(index)).copied().unwrap_or_default();
            all.nodes.push(Node {
                surfel,
                cap: cap.usable(along.length().max(across.length())),
                color,
                radius,
                cone,
                first,
                count,
                leaf,
            });
            all.low.push((center - rounded.as_dvec3()).as_vec3().to_array());
        }
        Some(all)
    }

    /// The reason why the nodes are no valid tree over this many points; None if they are one.
    pub(super) fn fault(&self, points: usize) -> Option<String> {
        let Some(hierarchy) = self.hierarchy(glam::DVec3::ZERO) else {
            return Some(
                "the centre, half-axes, radius or colour of a node is not finite or too large, or its half-axes span no ellipse"
                    .into(),
            );
        };
        let place = |index: usize| format!("node {index} of {}", self.rows.len());
        let what = match Hierarchy::check(&hierarchy.nodes, points).err()? {
            Fault::Children(index) => format!("the children of {} are not the nodes that come next", place(index)),
            Fault::Elements(index) => format!("the points of {} are not those that come next", place(index)),
            Fault::Count(index) => format!("{} has no children or points, or too many children", place(index)),
            Fault::Depth => "it is too deep".into(),
            Fault::Loose => {
                format!("its {} nodes and {points} points are not all below its first node", self.rows.len())
            }
        };
        Some(what)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A node's radius may be several times larger than a coordinate.
    #[test]
    fn radii_may_be_larger_than_coordinates() {
        let of = |x: f64, radius: f32| {
            let axes = Some(vec![[[1e17, 0.0, 0.0], [0.0, 1e17, 0.0]]]);
            let nodes = Points { positions: vec![[x, 0.0, 0.0]], axes, radii: Some(vec![radius]), ..Points::default() };
            let rows = vec![TreeRow { cone: 1.0, first: 0, count: 1, leaf: true }];
            Tree { nodes: Box::new(nodes), rows }.hierarchy(glam::DVec3::ZERO).is_some()
        };
        assert!(of(1e18, 6.9e18));
        assert!(!of(1e18, 9e18) && !of(2e18, 1.0) && !of(0.0, f32::NAN) && !of(0.0, -1.0));
    }
}
