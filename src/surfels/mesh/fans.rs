//! The fans of triangles around a vertex, between the edges and borders of the surface.

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::cover::{self, Facet};
use crate::surfels::ellipse::Ellipse;

/// The cosine of 30 degrees: the common side of two triangles at a larger angle is an edge of the
/// surface. Among 20 to 60 degrees, smaller angles gave better pictures with more surfels.
const EDGE: f64 = 0.866_025_403_784_438_6;

/// The largest distance of a disk from the triangles that it stands for, as a fraction of the
/// mesh's diagonal. Among 1 to 5 times 1e-4, on eleven models, 2e-4 is where pictures of 1024x1024
/// hardly gain from more surfels.
pub(in crate::low_level::surfels) const TOLERANCE: f64 = 2e-4;

/// An ellipse may be this many times larger than the area that it must cover: first where the
/// surface ends, then where it continues.
const WASTE: [f64; 2] = [2.0, 6.0];

/// Fans of more triangles are always halved by angle, as otherwise a vertex with a million
/// triangles would take too long.
const MANY: usize = 32;

/// A triangle at a vertex, with its two other corners counter-clockwise as seen from outside.
#[derive(Clone, Copy, Debug)]
pub(super) struct Corner {
    /// The index of the triangle.
    pub triangle: u32,
    /// The index of the vertex among the triangle's corners.
    pub place: usize,
    /// The corner after the vertex.
    pub next: u32,
    /// The corner after `next`.
    pub last: u32,
    /// Whether the edge from `next` to `last` is a border, an edge of the surface, or a change of
    /// look.
    pub ends: bool,
}

/// Triangles around a vertex that form one piece of the surface.
#[derive(Clone, Debug)]
pub(super) struct Fan {
    /// In order, counter-clockwise as seen from outside.
    pub corners: Vec<Corner>,
    /// Whether the fan goes all round the vertex and so has no sides.
    pub round: bool,
    /// Unit normal of the fan's plane.
    pub normal: DVec3,
}

impl Fan {
    fn new(corners: Vec<Corner>, round: bool, facets: &[Option<Facet>]) -> Self {
        let facet = |corner: &Corner| facets[corner.triangle as usize].as_ref();
        let sum: DVec3 = corners.iter().filter_map(facet).map(|facet| facet.normal * facet.area).sum();
        let normal = sum.try_normalize().or_else(|| corners.iter().find_map(facet).map(|facet| facet.normal));
        Self { corners, round, normal: normal.unwrap_or(DVec3::Z) }
    }

    /// Returns the ratio of the ellipse's area, within the fan's angle, to the area that it must
    /// cover, and the length of the ellipse's longer half-axis.
    fn waste(&self, facets: &[Option<Facet>]) -> (f64, f64) {
        let facet = |corner: &Corner| Some((facets[corner.triangle as usize].as_ref()?, corner.place));
        let (x, y) = self.normal.any_orthonormal_pair();
        let (mut angle, mut area, mut wanted) = (0.0, 0.0, Vec::new());
        for (facet, place) in self.corners.iter().filter_map(facet) {
            angle += facet.angles[place];
            area += facet.area / 3.0;
            let sides = facet.sides(place).map(|d| DVec2::new(d.dot(x), d.dot(y)));
            wanted.push(cover::wanted(facet, sides));
        }
        Ellipse::around(&wanted)
            .map_or((0.0, 0.0), |ellipse| (0.5 * angle * ellipse.square() / area, ellipse.half_axes()[0].length()))
    }

    /// The mean of the normals that the file gives for the fan's corners, if it points to the same
    /// side as the plane's normal; else the plane's normal.
    pub fn seen_normal(&self, named: Option<&Vec<[[f32; 3]; 3]>>) -> DVec3 {
        let Some(normals) = named else { return self.normal };
        let named = |corner: &Corner| DVec3::from(normals[corner.triangle as usize][corner.place].map(f64::from));
        let mean =
            self.corners.iter().map(|corner| named(corner).normalize_or_zero()).sum::<DVec3>().normalize_or_zero();
        if mean.is_finite() && mean.dot(self.normal) > 0.0 { mean } else { self.normal }
    }
}

/// The triangles around each vertex.
pub(super) struct Around {
    /// The triangles of vertex v, in order, are `triangles[starts[v]..starts[v + 1]]`.
    starts: Vec<u32>,
    triangles: Vec<u32>,
    /// For each triangle, the neighbours beyond its sides. Side k starts at corner k.
    beyond: Vec<[Beyond; 3]>,
}

/// The neighbour across a side of a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Beyond {
    /// A triangle that continues the surface.
    Surface(u32),
    /// A triangle that continues the surface, with another look.
    Look,
    /// An edge, a border, or several triangles.
    Edge,
}

impl Around {
    /// Finds the triangles around each of the `vertices`. Triangles without an area are ignored.
    /// `go_on` says whether two triangles with a common side look like one surface there.
    pub fn new(
        vertices: usize,
        triangles: &[[u32; 3]],
        facets: &[Option<Facet>],
        go_on: impl Fn([u32; 2]) -> bool + Sync,
    ) -> Self {
        let real = || (0u32..).zip(triangles.iter().zip(facets)).filter(|(_, (_, facet))| facet.is_some());
        let mut starts = vec![0u32; vertices + 1];
        for (_, (corners, _)) in real() {
            corners.iter().for_each(|&corner| starts[corner as usize + 1] += 1);
        }
        for vertex in 0..vertices {
            starts[vertex + 1] += starts[vertex];
        }
        let mut next = starts.clone();
        let mut of = vec![0; starts[vertices] as usize];
        for (number, (corners, _)) in real() {
            for &corner in corners {
                of[next[corner as usize] as usize] = number;
                next[corner as usize] += 1;
            }
        }
        let mut around = Self { starts, triangles: of, beyond: Vec::new() };
        let beyond = |number: u32| {
            [0, 1, 2].map(|side| match around.beyond_side(number, side, triangles, facets) {
                Beyond::Surface(other) if !go_on([number, other]) => Beyond::Look,
                beyond => beyond,
            })
        };
        around.beyond = (0..triangles.len() as u32).into_par_iter().map(beyond).collect();
        around
    }

    fn of(&self, vertex: u32) -> &[u32] {
        &self.triangles[self.starts[vertex as usize] as usize..self.starts[vertex as usize + 1] as usize]
    }

    /// The number of vertices without a triangle that has an area.
    pub fn loose(&self) -> usize {
        self.starts.windows(2).filter(|pair| pair[0] == pair[1]).count()
    }

    fn beyond_side(&self, number: u32, side: usize, triangles: &[[u32; 3]], facets: &[Option<Facet>]) -> Beyond {
        let corners = triangles[number as usize];
        let (from, to) = (corners[side], corners[(side + 1) % 3]);
        // The search uses the end of the side that has fewer triangles.
        let (at, end) = if self.of(from).len() <= self.of(to).len() { (from, to) } else { (to, from) };
        let shares = |other: &&u32| **other != number && triangles[**other as usize].contains(&end);
        let mut others = self.of(at).iter().filter(shares);
        let (Some(&other), None) = (others.next(), others.next()) else { return Beyond::Edge };
        let goes_back = (0..3).any(|k| {
            let corners = triangles[other as usize];
            (corners[k], corners[(k + 1) % 3]) == (to, from)
        });
        let normals = [number, other].map(|triangle| facets[triangle as usize].as_ref().map(|facet| facet.normal));
        match normals {
            [Some(one), Some(next)] if goes_back && one.dot(next) > EDGE => Beyond::Surface(other),
            _ => Beyond::Edge,
        }
    }

    /// Returns which sides of a triangle, each from the corner of the same index, are borders,
    /// edges or changes of look.
    ///
    /// If `is_flat` is true and all three sides are, changes of look do not count.
    pub fn ends(&self, triangle: u32, is_flat: bool) -> [bool; 3] {
        let beyond = self.beyond[triangle as usize];
        let ends = beyond.map(|beyond| !matches!(beyond, Beyond::Surface(_)));
        if is_flat && ends == [true; 3] { beyond.map(|beyond| beyond == Beyond::Edge) } else { ends }
    }

    fn corner(&self, triangle: u32, vertex: u32, triangles: &[[u32; 3]]) -> Option<Corner> {
        let corners = triangles[triangle as usize];
        let place = corners.iter().position(|&corner| corner == vertex)?;
        let ends = !matches!(self.beyond[triangle as usize][(place + 1) % 3], Beyond::Surface(_));
        Some(Corner { triangle, place, next: corners[(place + 1) % 3], last: corners[(place + 2) % 3], ends })
    }

    /// The fans of a vertex.
    pub fn fans(&self, vertex: u32, triangles: &[[u32; 3]], facets: &[Option<Facet>], tolerance: f64) -> Vec<Fan> {
        let corners: Vec<Corner> =
            self.of(vertex).iter().filter_map(|&triangle| self.corner(triangle, vertex, triangles)).collect();
        // The next triangle, counter-clockwise, is beyond the side from the last corner to the
        // vertex.
        let follows = |corner: &Corner| match self.beyond[corner.triangle as usize][(corner.place + 2) % 3] {
            Beyond::Surface(other) => corners.binary_search_by_key(&other, |corner| corner.triangle).ok(),
            Beyond::Look | Beyond::Edge => None,
        };
        let after: Vec<Option<usize>> = corners.iter().map(follows).collect();
        let mut begins = vec![true; corners.len()];
        after.iter().flatten().for_each(|&next| begins[next] = false);
        let mut seen = vec![false; corners.len()];
        let mut fans = Vec::new();
        // Fans with sides come first, from their first triangle; the others go all round.
        let firsts = (0..corners.len()).filter(|&k| begins[k]).chain((0..corners.len()).filter(|&k| !begins[k]));
        for first in firsts {
            let (mut fan, mut at) = (Vec::new(), Some(first));
            while let Some(k) = at.filter(|&k| !seen[k]) {
                seen[k] = true;
                fan.push(corners[k]);
                at = after[k];
            }
            if !fan.is_empty() {
                fans.push(Fan::new(fan, !begins[first], facets));
            }
        }
        fans.into_iter().flat_map(|fan| parts(fan, facets, tolerance)).collect()
    }
}

/// Cuts a fan into parts, each of which one disk approximates well. A fan is cut if its triangles
/// turn away from its plane, or if one ellipse would be much larger than the area that it must
/// cover.
fn parts(fan: Fan, facets: &[Option<Facet>], tolerance: f64) -> Vec<Fan> {
    let count = fan.corners.len();
    if count < 2 {
        return vec![fan];
    }
    let facet = |corner: &Corner| facets[corner.triangle as usize].as_ref();
    let (waste, reach) = fan.waste(facets);
    let bent = fan.corners.iter().filter_map(facet).any(|facet| {
        let cosine = facet.normal.dot(fan.normal).clamp(-1.0, 1.0);
        cosine < EDGE || reach * (1.0 - cosine * cosine).sqrt() > tolerance
    });
    let ends = !fan.round || fan.corners.iter().any(|corner| corner.ends);
    if !bent && waste < WASTE[usize::from(!ends)] {
        return vec![fan];
    }
    // The candidates for cuts: the sides between consecutive triangles.
    let mut sides: Vec<usize> = (0..count - usize::from(!fan.round)).collect();
    if bent && count <= MANY {
        let normal = |k: usize| facet(&fan.corners[k % count]).map_or(fan.normal, |facet| facet.normal);
        let turn = |k: usize| normal(k).dot(normal(k + 1));
        sides.sort_by(|&a, &b| turn(a).total_cmp(&turn(b)).then(a.cmp(&b)));
    } else {
        // The cut halves the fan's angle.
        let angles: Vec<f64> =
            fan.corners.iter().map(|corner| facet(corner).map_or(0.0, |f| f.angles[corner.place])).collect();
        let mut so_far = angles;
        (1..count).for_each(|k| so_far[k] += so_far[k - 1]);
        let half = 0.5 * so_far[count - 1];
        sides.sort_by(|&a, &b| (so_far[a] - half).abs().total_cmp(&(so_far[b] - half).abs()).then(a.cmp(&b)));
        if fan.round {
            sides.insert(1, count - 1);
            sides.dedup();
        }
    }
    let cut = |corners: &[Corner]| parts(Fan::new(corners.to_vec(), false, facets), facets, tolerance);
    if !fan.round {
        return [cut(&fan.corners[..=sides[0]]), cut(&fan.corners[sides[0] + 1..])].concat();
    }
    // A round fan needs two cuts: the parts are the triangles between them, and the rest.
    let (low, high) = (sides[0].min(sides[1]) + 1, sides[0].max(sides[1]) + 1);
    let rest = [&fan.corners[high..], &fan.corners[..low]].concat();
    [cut(&fan.corners[low..high]), cut(&rest)].concat()
}
