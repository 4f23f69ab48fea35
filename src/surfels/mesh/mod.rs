//! Surfels that cover a mesh and end where its surface ends.
//!
//! If vertices have no normals of their own, and each triangle has equal colours at its corners,
//! surfels are made of triangles. Each surfel is cut along its triangle's sides ([`triangles`]) and
//! has the triangle's look ([`skin`]). Otherwise surfels at the vertices blend their normals and
//! colours across triangles. The triangles around a vertex form a fan, or several if the surface
//! has an edge or a border there ([`fans`]). Each fan gets a surfel in its own plane: the smallest
//! ellipse such that the surfels of all corners cover the triangles ([`cover`]). It is cut along
//! the fan's two sides ([`Clip`]), as disks would otherwise stand out past edges and borders by up
//! to their radius.

mod cover;
mod fans;
mod skin;
mod triangles;

use glam::{DVec2, DVec3, Vec2};
use rayon::prelude::*;

use self::cover::Facet;
pub(super) use self::fans::TOLERANCE;
use self::fans::{Around, Fan};
pub(crate) use self::skin::vertex_colors;
use self::skin::{Look, Skin};
pub(super) use self::skin::{Painting, color_vertices};
use crate::io::Points;
use crate::io::points::{Faces, taken};
use crate::scene::color::DEFAULT_COLOR;
use crate::scene::{Clip, Colors};
use crate::surfels::ellipse::Ellipse;
use crate::surfels::gather::is_usable;

/// The factor by which disks are larger than covering needs, as a blending kernel fades towards its
/// rim.
const OVERLAP: f64 = 1.1;

/// The distance by which a disk extends past an edge or a border, in its own shorter half-axes, so
/// that rounding leaves no gap between two disks that end at one line.
pub(super) const MARGIN: f64 = 0.02;

/// One surfel.
struct Made {
    /// The vertex or triangle that the surfel belongs to.
    of: u32,
    center: DVec3,
    normal: DVec3,
    s: DVec3,
    t: DVec3,
    clip: Clip,
    /// None if the mesh has no colours but those of its vertices.
    look: Option<Box<Look>>,
}

/// The elements of a mesh that surfels stand for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum By {
    /// Its triangles if all of them look flat (`are_plain`), else its vertices.
    Looks,
    /// Its vertices.
    Vertices,
}

/// Returns the surfels of a mesh, painted as `painting` says. Vertices without a triangle that has
/// an area get none.
///
/// A cloud, or a cloud with a few triangles, stays as it is, and so does a mesh whose file has
/// radii: its points get the colours of its triangles.
pub(super) fn of_mesh(mut points: Points, by: By, painting: Painting) -> Points {
    let Some(faces) = points.faces.as_ref().filter(|_| points.of_mesh) else { return uncovered(points) };
    let triangles = &faces.triangles;
    let facets: Vec<Option<Facet>> = triangles.par_iter().map(|t| Facet::of(&points.positions, *t)).collect();
    let skin = faces.paint.as_deref();
    let skin = skin.map(|paint| Skin::new(paint, (triangles, &facets), painting, points.colors.is_some()));
    let go_on = |pair| by == By::Vertices || skin.as_ref().is_none_or(|skin| skin.goes_on(pair));
    let around = Around::new(points.positions.len(), triangles, &facets, go_on);
    if 2 * around.loose() > points.positions.len() {
        return uncovered(points);
    }
    let left_out = LeftOut::of(&points.positions, triangles, around.loose());
    let plain = by == By::Looks && triangles::are_plain(&points, faces, &facets);
    let all = match plain {
        true => at_triangles(&facets, &around, skin.as_ref()),
        false => at_vertices(&points, faces, (&facets, &around, skin.as_ref())),
    };
    drop(skin);
    let Some(faces) = points.faces.take() else { return points };
    left_out.tell(&mut points);
    let made = match plain {
        true => of_triangles(points, &faces.triangles, &all),
        false => {
            let vertices = all.iter().map(|made| made.of).collect();
            shaped(taken(points, vertices), &all)
        }
    };
    dressed(made, &all, painting)
}

/// Returns points that do not become the surfels of a mesh, with the colours of their triangles.
fn uncovered(mut points: Points) -> Points {
    color_vertices(&mut points);
    points.faces = None;
    points
}

/// The numbers of vertices and triangles of a mesh that have no surfels.
struct LeftOut {
    loose: u64,
    stranded: u64,
    broken: u64,
}

impl LeftOut {
    /// Counts the parts left out of a mesh, given the number `bare` of vertices without a facet.
    fn of(positions: &[[f64; 3]], triangles: &[[u32; 3]], bare: usize) -> Self {
        if bare == 0 {
            return Self { loose: 0, stranded: 0, broken: 0 };
        }
        let mut is_named = vec![false; positions.len()];
        triangles.as_flattened().iter().for_each(|vertex| is_named[*vertex as usize] = true);
        let loose = is_named.iter().filter(|named| !**named).count();
        let is_broken = |corners: &&[u32; 3]| !corners.iter().all(|corner| is_usable(&positions[*corner as usize]));
        let broken = triangles.iter().filter(is_broken).count();
        Self { loose: loose as u64, stranded: (bare - loose) as u64, broken: broken as u64 }
    }

    fn tell(&self, points: &mut Points) {
        (points.loose, points.stranded, points.broken) = (self.loose, self.stranded, self.broken);
    }
}

/// Returns one surfel per triangle, or three.
fn at_triangles(facets: &[Option<Facet>], around: &Around, skin: Option<&Skin<'_>>) -> Vec<Made> {
    let made = |(number, facet): (usize, &Option<Facet>)| {
        let number = number as u32;
        let ends = around.ends(number, skin.is_none_or(|skin| skin.is_flat(number)));
        let mut made = facet.as_ref().map(|facet| triangles::surfels(number, facet, ends)).unwrap_or_default();
        for made in &mut made {
            made.look = skin.map(|skin| Box::new(skin.of_triangle(number, made.center)));
        }
        made
    };
    facets.par_iter().enumerate().flat_map_iter(made).collect()
}

/// Returns one or two surfels for each fan of each vertex.
fn at_vertices(
    points: &Points,
    faces: &Faces,
    (facets, around, skin): (&[Option<Facet>], &Around, Option<&Skin<'_>>),
) -> Vec<Made> {
    let tolerance = TOLERANCE * crate::surfels::bounds(points).extent().length();
    let made = |vertex: u32| {
        let fans = around.fans(vertex, &faces.triangles, facets, tolerance);
        let of_fan = |fan: Fan| {
            let normal = fan.seen_normal(faces.normals.as_ref());
            let mut made = surfels((vertex, normal), &fan, &points.positions, facets);
            let look = skin.map(|skin| skin.of_fan(&fan));
            made.iter_mut().for_each(|made| made.look = look.map(Box::new));
            made
        };
        fans.into_iter().flat_map(of_fan).collect::<Vec<_>>()
    };
    (0..points.positions.len() as u32).into_par_iter().flat_map_iter(made).collect()
}

/// Gives `points`, one per surfel, the looks of the surfels.
fn dressed(mut points: Points, all: &[Made], painting: Painting) -> Points {
    let look = |made: &Made| made.look.as_deref().copied().unwrap_or_default();
    points.averaged = all.iter().filter(|made| look(made).averaged).count() as u64;
    if all.iter().any(|made| look(made).color.is_some()) {
        let of_vertex = |index: usize| points.colors.as_ref().map_or(DEFAULT_COLOR, |colors| colors.linear(index));
        let color = |(index, made): (usize, &Made)| look(made).color.unwrap_or_else(|| of_vertex(index));
        points.colors = Some(Colors::Linear(all.iter().enumerate().map(color).collect()));
    }
    let is_placed = all.iter().any(|made| look(made).placed.is_some());
    if is_placed && (painting == Painting::Own || points.texture.is_none()) {
        let placed = || all.iter().map(|made| look(made).placed);
        points.texture = Some(placed().map(|placed| placed.map_or([0.0; 2], |placed| placed.center)).collect());
        points.texture_slopes = Some(placed().map(|placed| placed.map_or([[0.0; 3]; 2], |of| of.slopes)).collect());
        points.texture_numbers = Some(placed().map(|placed| placed.map_or(u32::MAX, |of| of.number)).collect());
    }
    points
}

/// Returns the surfels of triangles. Each has the attributes of its triangle's first corner, and
/// the mean of the corners' texture coordinates.
fn of_triangles(points: Points, triangles: &[[u32; 3]], all: &[Made]) -> Points {
    let corners = |made: &Made| triangles[made.of as usize];
    let place = |texture: &Vec<[f32; 2]>| {
        let mean =
            |made: &Made| corners(made).map(|corner| Vec2::from(texture[corner as usize])).iter().sum::<Vec2>() / 3.0;
        all.iter().map(|made| mean(made).to_array()).collect()
    };
    let texture = points.texture.as_ref().map(place);
    let first = all.iter().map(|made| corners(made)[0]).collect();
    let positions = all.iter().map(|made| made.center.to_array()).collect();
    // A triangle whose corners have different textures gets none.
    let number = |numbers: &Vec<u32>| {
        let own = |made: &Made| corners(made).map(|corner| numbers[corner as usize]);
        let one = |[a, b, c]: [u32; 3]| if a == b && a == c { a } else { u32::MAX };
        all.iter().map(|made| one(own(made))).collect()
    };
    let texture_numbers = points.texture_numbers.as_ref().map(number);
    shaped(Points { positions, texture, texture_numbers, ..taken(points, first) }, all)
}

/// Gives `points`, one per surfel, the shapes of the surfels.
fn shaped(points: Points, all: &[Made]) -> Points {
    let axes = |made: &Made| [made.s, made.t].map(|axis| axis.as_vec3().to_array());
    let radius = |made: &Made| made.s.length().max(made.t.length()) as f32;
    Points {
        normals: Some(all.iter().map(|made| made.normal.as_vec3().to_array()).collect()),
        radii: Some(all.iter().map(radius).collect()),
        axes: Some(all.iter().map(axes).collect()),
        clips: Some(all.iter().map(|made| made.clip).collect()),
        ..points
    }
}

/// Returns the surfels of one of a vertex's fans: one, or one along each side if the sides enclose
/// more than a straight angle.
fn surfels((vertex, normal): (u32, DVec3), fan: &Fan, positions: &[[f64; 3]], facets: &[Option<Facet>]) -> Vec<Made> {
    let at = |vertex: u32| DVec3::from(positions[vertex as usize]);
    let (x, y) = fan.normal.any_orthonormal_pair();
    // For the axes of any_orthonormal_pair, x × y is the normal.
    let plane = |d: DVec3| DVec2::new(d.dot(x), d.dot(y));
    let center = at(vertex);
    let corners: Vec<[DVec2; 2]> =
        fan.corners.iter().map(|corner| [corner.next, corner.last].map(|other| plane(at(other) - center))).collect();
    let wanted = fan.corners.iter().zip(&corners);
    let wanted =
        wanted.filter_map(|(corner, sides)| Some(cover::wanted(facets[corner.triangle as usize].as_ref()?, *sides)));
    let Some(ellipse) = Ellipse::around(&wanted.collect::<Vec<_>>()) else { return Vec::new() };
    let [major, minor] = ellipse.half_axes().map(|axis| axis * OVERLAP);
    let world = |axis: DVec2| axis.x * x + axis.y * y;
    let made = |lines: Vec<cover::Line>| {
        let mut clip = Clip::NONE;
        for (line, of_disk) in lines.iter().zip(&mut clip.0) {
            *of_disk = line.on_disk(major, minor, MARGIN * minor.length());
        }
        Made { of: vertex, center, normal, s: world(major), t: world(minor), clip, look: None }
    };
    cover::lines(fan, &corners, major.length()).into_iter().map(made).collect()
}
