//! The triangles around a vertex, in turn, and where the surface has an edge or a border between them.

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::cover::{self, Facet};
use crate::surfels::ellipse::Ellipse;

/// The cosine of the angle between the normals of two triangles past which their common edge is one of the surface: 30 degrees. Of 20
/// to 60 degrees fewer gave better pictures of more surfels.
const EDGE: f64 = 0.866_025_403_784_438_6;

/// The part of a mesh's diagonal by which a disk may stand off the triangles that it stands for. Of 1, 2, 3, 4 and 5 times 1e-4, on
/// eleven models, 2 is where pictures of 1024x1024 hardly gain by more surfels.
pub(in crate::surfels) const TOLERANCE: f64 = 2e-4;

/// An ellipse may be so much larger than what it is to cover where the surface ends, and where it goes on.
const WASTE: [f64; 2] = [2.0, 6.0];

/// Fans of more triangles are cut in halves, wherever they turn: nobody should wait for the middle of a disk of a million.
const MANY: usize = 32;

/// A triangle at a vertex: its two other corners, counter-clockwise seen from outside.
#[derive(Clone, Copy, Debug)]
pub(super) struct Corner {
    /// Which one.
    pub triangle: u32,
    /// Which of its corners is the vertex.
    pub place: usize,
    /// The corner that follows the vertex.
    pub next: u32,
    /// The one after that.
    pub last: u32,
    /// The edge from `next` to `last` is one of the surface: a border, or an edge.
    pub ends: bool,
}

/// Triangles around a vertex that make one piece of a surface.
#[derive(Clone, Debug)]
pub(super) struct Fan {
    /// In turn, counter-clockwise seen from outside.
    pub corners: Vec<Corner>,
    /// It goes round the vertex: it has no sides.
    pub round: bool,
    /// Unit, of its plane.
    pub normal: DVec3,
}

impl Fan {
    fn new(corners: Vec<Corner>, round: bool, facets: &[Option<Facet>]) -> Self {
        let facet = |corner: &Corner| facets[corner.triangle as usize].as_ref();
        let sum: DVec3 = corners.iter().filter_map(facet).map(|facet| facet.normal * facet.area).sum();
        let normal = sum.try_normalize().or_else(|| corners.iter().find_map(facet).map(|facet| facet.normal));
        Self { corners, round, normal: normal.unwrap_or(DVec3::Z) }
    }

    /// How much larger one ellipse is than the parts of the triangles that it is to cover, and how far it reaches.
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

    /// The mean of the normals that its corners name, where that is on the plane's side; else the plane's.
    pub fn seen_normal(&self, named: Option<&Vec<[[f32; 3]; 3]>>) -> DVec3 {
        let Some(normals) = named else { return self.normal };
        let named = |corner: &Corner| DVec3::from(normals[corner.triangle as usize][corner.place].map(f64::from));
        let mean =
            self.corners.iter().map(|corner| named(corner).normalize_or_zero()).sum::<DVec3>().normalize_or_zero();
        if mean.is_finite() && mean.dot(self.normal) > 0.0 { mean } else { self.normal }
    }
}

/// Which triangles are around each vertex.
pub(super) struct Around {
    /// Those of vertex v, in order, are `triangles[starts[v]..starts[v + 1]]`.
    starts: Vec<u32>,
    triangles: Vec<u32>,
    /// For each side of each triangle, from its corner on: what is on the other side.
    beyond: Vec<[Beyond; 3]>,
}

/// What is on the other side of a triangle's side.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Beyond {
    /// A triangle that goes on with the surface.
    Surface(u32),
    /// One that does too, but looks otherwise.
    Look,
    /// An edge, a border, or several triangles.
    Edge,
}

impl Around {
    /// The fans of a mesh of so many `vertices`; triangles without an area are none. Two with a
    /// side in common look like one surface where they `go_on`.
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

    /// Vertices that no triangle names.
    pub fn loose(&self) -> usize {
        self.starts.windows(2).filter(|pair| pair[0] == pair[1]).count()
    }

    fn beyond_side(&self, number: u32, side: usize, triangles: &[[u32; 3]], facets: &[Option<Facet>]) -> Beyond {
        let corners = triangles[number as usize];
        let (from, to) = (corners[side], corners[(side + 1) % 3]);
        // Looked for at the end that fewer triangles have.
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

    /// The sides of a triangle, each from its corner on, past which the surface does not go on, or
    /// looks otherwise. With `is_flat`, if all three are such sides, those where it goes on are
    /// none.
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
        // What follows a triangle, counter-clockwise, lies beyond its side from the last corner to the vertex.
        let follows = |corner: &Corner| match self.beyond[corner.triangle as usize][(corner.place + 2) % 3] {
            Beyond::Surface(other) => corners.binary_search_by_key(&other, |corner| corner.triangle).ok(),
            Beyond::Look | Beyond::Edge => None,
        };
        let after: Vec<Option<usize>> = corners.iter().map(follows).collect();
        let mut begins = vec![true; corners.len()];
        after.iter().flatten().for_each(|&next| begins[next] = false);
        let mut seen = vec![false; corners.len()];
        let mut fans = Vec::new();
        // First those with sides, from their first triangle on; what is left goes round.
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

/// The parts of a fan that a disk each stands for well: where its triangles turn away from its plane, or one ellipse would be much
/// larger than what it is to cover, it is cut.
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
    // Between a triangle and the one that follows it.
    let mut sides: Vec<usize> = (0..count - usize::from(!fan.round)).collect();
    if bent && count <= MANY {
        let normal = |k: usize| facet(&fan.corners[k % count]).map_or(fan.normal, |facet| facet.normal);
        let turn = |k: usize| normal(k).dot(normal(k + 1));
        sides.sort_by(|&a, &b| turn(a).total_cmp(&turn(b)).then(a.cmp(&b)));
    } else {
        // Half of the angle each.
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
    // Two cuts: the part between them, and the one that goes on to the first.
    let (low, high) = (sides[0].min(sides[1]) + 1, sides[0].max(sides[1]) + 1);
    let rest = [&fan.corners[high..], &fan.corners[..low]].concat();
    [cut(&fan.corners[low..high]), cut(&rest)].concat()
}
