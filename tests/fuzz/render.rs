//! Builds and draws the points that were read, and checks the image.

use super::Outcome;
use super::session::sentence;
use epsplat::io::{Points, ReadOptions, Wanted};
use epsplat::low_level::frame::Frame;
use epsplat::low_level::plan::Settings;
use epsplat::low_level::render::{Backend, render};
use epsplat::low_level::scene::{
    Bounds, Camera, Colors, Composite, Lens, LowPass, Map, Maps, Scene, Shading, gaussian,
};
use epsplat::low_level::surfels::{LARGEST_COORDINATE, build};
use epsplat::{Error, io};
use glam::DVec3;
use std::path::Path;

/// Scenes with more points are not drawn: a small damaged file can describe very many.
const MOST_POINTS: usize = 2000;

/// Width and height of the image, pixels.
pub const SIZE: (u32, u32) = (16, 16);

/// Reads a file of points and draws them.
pub fn points(path: &Path, valid: Option<usize>) -> Result<Outcome, String> {
    let options = ReadOptions { flatten: true, ..ReadOptions::default() };
    let points = match (io::read_with(path, options, &()), valid) {
        (Ok(points), _) => points,
        (Err(error), Some(_)) => return Err(format!("a valid file is refused: {error}")),
        (Err(error), None) => return sentence(&error, Some(path)).map(|()| Outcome::Refused),
    };
    let count = points.positions.len();
    if let Some(valid) = valid.filter(|&valid| valid != count) {
        return Err(format!("a valid file has {valid} points, of which {count} were read"));
    }
    check_lengths(&points)?;
    if count > MOST_POINTS {
        return Ok(Outcome::Read);
    }
    attributes(path, &points)?;
    let usable = |p: &[f64; 3]| p.iter().all(|c| c.abs() <= LARGEST_COORDINATE);
    // Gaussians may lack attributes that cannot be estimated.
    let drawable = points.positions.iter().any(usable) && !points.encoded;
    // In narrower scenes, products of half-axes underflow f32.
    let narrow = extent(&points) < 1e-15;
    let (scene, _) = match build(vec![points], &()) {
        Ok(built) => built,
        Err(error @ Error::EmptyScene(_)) if !drawable || narrow => {
            return sentence(&error, None).map(|()| Outcome::Read);
        }
        Err(error) => return Err(format!("{count} points make no scene: {error}")),
    };
    let camera = match Camera::framing(SIZE, Lens::Fov(45.0), &scene, Camera::default_near(&scene)) {
        Ok(camera) => camera,
        // A camera has the same limit on coordinates as points. A camera that sees a scene edge-on
        // is moved far away, so for a scene near that limit there may be no camera. Nor is there
        // one for a scene so small that the camera's distance is below the precision of its
        // position.
        Err(error) if reach(&scene) > 1e-6 * LARGEST_COORDINATE || size(&scene) < 1e-12 * reach(&scene) => {
            return sentence(&error, None).map(|()| Outcome::Read);
        }
        Err(error) => return Err(format!("no camera frames the scene: {error}")),
    };
    if scene.encoded {
        return draw(&scene, &camera, &gaussians());
    }
    draw(&scene, &camera, &shaded(Shading::Lambert))?;
    draw(&scene, &camera, &shaded(Shading::Unlit))
}

/// The largest side of the box of the points or, for a mesh, of its triangles that are no slivers:
/// slivers may be left out.
fn extent(points: &Points) -> f64 {
    let Some(faces) = &points.faces else {
        return epsplat::low_level::surfels::bounds(points).extent().max_element();
    };
    let place = |vertex: u32| DVec3::from_array(points.positions[vertex as usize]);
    let corners = faces.triangles.iter().map(|triangle| triangle.map(place));
    let has_area = |[a, b, c]: &[DVec3; 3]| {
        let usable = [a, b, c].iter().all(|p| p.abs().max_element() <= LARGEST_COORDINATE);
        let (p, q) = (*b - *a, *c - *a);
        usable && p.cross(q).length() > 1e-12 * p.length_squared().max(q.length_squared())
    };
    corners.filter(has_area).flatten().fold(Bounds::EMPTY, Bounds::with_point).extent().max_element()
}

/// Reads all attributes of a file whose `points` were read without them, and one of them for each
/// point: neither changes the points.
fn attributes(path: &Path, points: &Points) -> Result<(), String> {
    let read = |wanted: Wanted| {
        let read = io::read_with(path, ReadOptions { flatten: true, wanted, ..ReadOptions::default() }, &());
        read.map_err(|error| format!("the file is refused where its attributes are read: {error}"))
    };
    let all = read(Wanted { spans: true, ..Wanted::default() })?;
    if all.positions.len() != points.positions.len() || all.spans.len() < 3 {
        return Err(format!("{} points and {} ranges with attributes", all.positions.len(), all.spans.len()));
    }
    let last = all.spans.last().map(|span| span.name.clone()).unwrap_or_default();
    let one = read(Wanted { column: Some(last.clone()), ..Wanted::default() })?;
    match one.column.map(|column| column.values.len()) {
        Some(count) if count == points.positions.len() => Ok(()),
        other => Err(format!("{other:?} values of {last}")),
    }
}

/// The largest absolute coordinate or radius of a scene, world units.
fn reach(scene: &Scene) -> f64 {
    let bounds = scene.bounds();
    let farthest = (scene.origin + bounds.min).abs().max((scene.origin + bounds.max).abs());
    farthest.max_element().max(scene.largest_radius().into())
}

/// The size by which a scene is framed, world units.
fn size(scene: &Scene) -> f64 {
    let extent = scene.bounds().extent().length();
    if extent > 0.0 { extent } else { scene.largest_radius().into() }
}

fn check_lengths(points: &Points) -> Result<(), String> {
    let colors = points.colors.as_ref().map(|colors| match colors {
        Colors::Constant(_) => usize::MAX,
        Colors::Srgb8(codes) => codes.len(),
        Colors::Linear(colors) => colors.len(),
        Colors::Textured(textured) => textured.colors().len(),
        Colors::Harmonics(harmonics) => harmonics.colors().len(),
    });
    let lengths = [points.normals.as_ref().map(Vec::len), points.radii.as_ref().map(Vec::len), colors];
    if lengths.into_iter().flatten().all(|length| length == points.positions.len()) {
        Ok(())
    } else {
        Err(format!("{} positions have attributes of other lengths: {lengths:?}", points.positions.len()))
    }
}

/// The default options with this shading.
pub fn shaded(shading: Shading) -> Settings {
    Settings { shading, ..Settings::default() }
}

/// The options that Gaussians are drawn with.
fn gaussians() -> Settings {
    Settings {
        kernel: gaussian::KERNEL,
        low_pass: LowPass::Gaussians,
        composite: Composite::Gaussians,
        ..shaded(Shading::Unlit)
    }
}

/// Draws `scene` with the reference and checks every pixel of every map.
pub fn draw(scene: &Scene, camera: &Camera, options: &Settings) -> Result<Outcome, String> {
    let maps = Maps::ON_DEVICE.and(&[Map::Decision]);
    let options = Settings { maps, ..options.clone() };
    let (frame, _) = render(scene, camera, &options, &Backend::Reference, &())
        .map_err(|error| format!("the scene cannot be drawn: {error}"))?;
    check(&frame).map(|()| Outcome::Drawn)
}

fn check(frame: &Frame) -> Result<(), String> {
    let missing = || "a map is missing".to_owned();
    let depth = frame.map(Map::Depth).ok_or_else(missing)?;
    let normal = frame.normals().ok_or_else(missing)?;
    let weight = frame.map(Map::Weight).ok_or_else(missing)?;
    let count = frame.map(Map::Count).ok_or_else(missing)?;
    let decision = frame.map(Map::Decision).ok_or_else(missing)?;
    for (pixel, color) in frame.color.iter().enumerate() {
        let (depth, normal) = (depth[pixel], normal[pixel]);
        let (weight, count) = (weight[pixel], count[pixel]);
        let values = [depth, weight, count, decision[pixel]];
        let wrong = if color.iter().chain(&normal).chain(&values).any(|value| value.is_nan()) {
            "a NaN"
        } else if count > 0.0 && !(weight > 0.0 && depth.is_finite() && depth > 0.0) {
            "fragments without weight or depth"
        } else if count == 0.0 && (weight != 0.0 || depth != f32::INFINITY || *color != [0.0; 4] || normal != [0.0; 3])
        {
            "a background with values"
        } else {
            continue;
        };
        return Err(format!("pixel {pixel} holds {wrong}: {color:?} {normal:?} {values:?}"));
    }
    Ok(())
}
