//! Prepares a scene of a study: surfels of the wanted size, cameras, and the true surface.

use std::f64::consts::{PI, TAU};

use std::path::{Path, PathBuf};

use glam::DVec3;

use super::config::Config;
use super::definition::{Beside, Definition, Making, OneOrMany, Rims, SceneEntry};
use super::in_part;
use super::view::{cameras, footprint};
use crate::error::{Error, Result};
use crate::io::{self, Mesh, Points, ReadOptions, Texture};
use crate::memory;
use crate::progress::Progress;
use crate::random::Random;
use crate::scene::{Camera, Colors, Scene};
use crate::surfels::analytic::{RADIUS_IN_SPACINGS, Shape, gaussians, generate, mesh};
use crate::surfels::hybrid::Hybrid;
use crate::surfels::sampling::voxels::Voxel;
use crate::surfels::sampling::{MeshSurface, Method, sample};
use crate::surfels::simplify::{self, SplatShape, Tolerance, as_in_the_thesis, simplify_in_texture};
use crate::surfels::{
    FromPoints, Size, Triangle, build, build_at_vertices, build_textured, curve, from_points, hierarchy, hybrid,
    with_triangles,
};
use crate::truth::Surface;

/// One point of a scene's sweep: the number of surfels, and their mean radius in pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Point {
    /// Number of surfels of a shape or samples of a mesh; `None` if the scene gives no number.
    pub count: Option<u64>,
    /// Mean radius, pixels; `None` keeps the radii that the surfels have.
    pub footprint_px: Option<f64>,
}

/// A scene that is ready to render.
pub(super) struct Staged {
    /// The surfels and triangles.
    pub scene: Scene,
    /// The cameras; at least one.
    pub cameras: Vec<Camera>,
    /// The true surface of surfels and triangles; `None` without ground truth.
    pub surface: Option<Surface>,
    /// Whether a second input lies over the first ([`SceneEntry::shirt`]).
    pub dressed: bool,
    /// Mean splat radius in pixels, defined as for [`SceneEntry::footprint_px`].
    pub footprint_px: f64,
}

/// Estimated memory, bytes: per surfel of a shape while the scene is built, and per pixel of a
/// frame.
const OF_SURFEL: u64 = 250;
const OF_PIXEL: u64 = 16;

/// Returns the points of a scene's sweep: each count with each footprint, up to `most_fragments`.
pub(super) fn points(entry: &SceneEntry) -> Vec<Point> {
    fn each<T: Copy>(values: &Option<OneOrMany<T>>) -> Vec<Option<T>> {
        values.as_ref().map_or_else(|| vec![None], |all| all.values().into_iter().map(Some).collect())
    }
    let of = |count: Option<u64>| {
        each(&entry.footprint_px).into_iter().map(move |footprint_px| Point { count, footprint_px })
    };
    let small_enough = |point: &Point| match (point.count, point.footprint_px, entry.most_fragments) {
        (Some(count), Some(radius), Some(most)) => count as f64 * PI * radius * radius <= most,
        _ => true,
    };
    each(&entry.count).into_iter().flat_map(of).filter(small_enough).collect()
}

/// Prepares `point` of the scene. If the file has nothing to show, the error names the file.
pub(super) fn stage(
    definition: &Definition,
    entry: &SceneEntry,
    point: Point,
    progress: &dyn Progress,
) -> Result<Staged> {
    if let (Making::Levels, Some(file)) = (entry.surfels, &entry.file) {
        return in_part::stage(definition, entry, file, progress);
    }
    made(definition, entry, point, progress).map_err(|error| match (error, &entry.file) {
        (Error::EmptyScene(what), Some(file)) => Error::malformed(&definition.path_of(file), what),
        (error, _) => error,
    })
}

/// Points, their true surface if the scene asks for ground truth, and triangles to draw.
type Made = (Points, Option<Surface>, Option<Mesh>);

fn made(definition: &Definition, entry: &SceneEntry, point: Point, progress: &dyn Progress) -> Result<Staged> {
    if let Some(count) = point.count.filter(|_| entry.shape.is_some()) {
        memory::check(count.saturating_mul(OF_SURFEL), || format!("{count} surfels of the scene {:?}", entry.name))?;
    }
    let texture = entry.texture.as_ref().map(|file| Texture::read(&present(definition, entry, file)?)).transpose()?;
    let (points, mut surface, left) = source(definition, entry, point, texture.as_ref(), progress)?;
    let points = match entry.simplify {
        Some(tolerance) => simplified(points, (tolerance, entry.cover), progress)?,
        None => points,
    };
    let mut scene = match texture.filter(|_| entry.lookup) {
        Some(texture) => build_textured(vec![points], vec![texture], progress)?.0,
        None if points.positions.is_empty() && left.is_some() => Scene { oriented: true, ..Scene::default() },
        None => build(dressed(points, entry.shirt), progress)?.0,
    };
    if let Some(left) = left {
        let of_surfels = Some(scene).filter(|scene| !scene.surfels.is_empty());
        (scene, _) = with_triangles(of_surfels, &[left])?;
    }
    if entry.rims != Rims::Curved {
        scene.caps.clear();
    }
    if entry.rims == Rims::Flat {
        scene.clips.clear();
    }
    if let Some(triangles) = &entry.triangles {
        let (mesh, of_triangles) = beside(definition, entry, triangles, progress)?;
        (scene, _) = with_triangles(Some(scene), &[mesh])?;
        surface = surface.zip(of_triangles).map(|(first, second)| Surface::Both(Box::new([first, second])));
    }
    let [width, height] = entry.size.unwrap_or(definition.size);
    let frames = u64::from(entry.views) * definition.configs_of(entry).count() as u64;
    memory::check(frames * u64::from(width) * u64::from(height) * OF_PIXEL, || {
        format!("the {frames} frames of the scene {:?}", entry.name)
    })?;
    let mut cameras = cameras([width, height], entry, &scene)?;
    let mut footprint_px = footprint(&scene, &cameras);
    if let (Making::Triangles, Some(shape), Some(wanted)) = (entry.surfels, entry.shape, point.footprint_px) {
        let scale = wanted * (PI * scene.triangles.len() as f64 / shape.area()).sqrt();
        cameras.iter_mut().for_each(|camera| (camera.fx, camera.fy) = (scale, scale));
        footprint_px = wanted;
    }
    if let Some(wanted) = point.footprint_px.filter(|_| !scene.surfels.is_empty() && footprint_px > 0.0) {
        scene.enlarge((wanted / footprint_px) as f32);
        footprint_px = wanted;
    }
    if definition.configs.iter().any(Config::cuts) && !scene.surfels.is_empty() {
        (scene, _) = hierarchy::build_with(scene, entry.bounds.unwrap_or_default(), progress)?;
    }
    Ok(Staged { scene, cameras, surface, dressed: entry.shirt.is_some(), footprint_px })
}

/// Returns the points of a scene before simplification, their true surface, and triangles to draw.
fn source(
    definition: &Definition,
    entry: &SceneEntry,
    point: Point,
    texture: Option<&Texture>,
    progress: &dyn Progress,
) -> Result<Made> {
    Ok(match (&entry.file, entry.shape) {
        (Some(file), _) => {
            let file = present(definition, entry, file)?;
            of_file(&file, entry, point.count.unwrap_or(1) as usize, texture, progress)?
        }
        (None, Some(shape)) if entry.surfels == Making::Triangles => {
            (Points::default(), None, Some(mesh(shape, point.count.unwrap_or(1))))
        }
        (None, Some(shape)) => {
            let surface = entry.truth.then_some(Surface::Analytic(shape));
            let count = point.count.unwrap_or(1);
            let mut points = match entry.surfels {
                Making::Gaussians => gaussians(shape, count),
                _ => of_shape(shape, count, entry.radius),
            };
            if let Some(noise) = entry.noise {
                scatter(&mut points, noise * (shape.area() / count as f64).sqrt());
            }
            let radii = points.radii.clone().filter(|_| entry.surfels != Making::Scanned);
            (Points { radii, ..points }, surface, None)
        }
        // Unreachable, as a definition with neither file nor shape is refused; gives an empty
        // scene.
        (None, None) => (Points::default(), None, None),
    })
}

/// Returns `points` and, with a `shirt`, a copy that is moved along the normals by that distance.
fn dressed(points: Points, shirt: Option<f64>) -> Vec<Points> {
    let Some(out) = shirt else { return vec![points] };
    let mut moved = points.clone();
    for (position, normal) in moved.positions.iter_mut().zip(moved.normals.iter().flatten()) {
        position.iter_mut().zip(normal).for_each(|(into, along)| *into += out * f64::from(*along));
    }
    vec![points, moved]
}

/// Simplifies points as `epsplat simplify --shape cap` does, or `--cover thesis:R` with the ratio R
/// in `cover`.
fn simplified(points: Points, (tolerance, cover): (Tolerance, Option<f64>), progress: &dyn Progress) -> Result<Points> {
    let (scene, _, coordinates) = build_at_vertices(vec![points], progress)?;
    if let Some(ratio) = cover {
        let tolerance = tolerance.in_world(scene.bounds().extent().length());
        let (scene, coordinates, _) = as_in_the_thesis((&scene, &coordinates), tolerance, ratio, progress)?;
        return Ok(simplify::points(&scene, coordinates, SplatShape::Disk));
    }
    let options = simplify::Options { tolerance, shape: SplatShape::Cap, relaxations: 0 };
    let (scene, coordinates, _) = simplify_in_texture(&scene, &coordinates, &options, progress)?;
    Ok(simplify::points(&scene, coordinates, SplatShape::Cap))
}

/// Returns the triangles beside the surfels, and their true surface if `entry.truth` is set.
fn beside(
    definition: &Definition,
    entry: &SceneEntry,
    triangles: &Beside,
    progress: &dyn Progress,
) -> Result<(Mesh, Option<Surface>)> {
    match triangles {
        Beside::Shape(shape, count) => Ok((mesh(*shape, *count), entry.truth.then_some(Surface::Analytic(*shape)))),
        Beside::File(file) => {
            let mesh = io::read_mesh(&present(definition, entry, file)?, progress)?;
            let surface = entry.truth.then(|| Surface::mesh(&mesh)).transpose()?;
            Ok((mesh, surface))
        }
    }
}

/// Returns the path of a scene's file; fails if it is missing and the scene names a source for it.
pub(super) fn present(definition: &Definition, entry: &SceneEntry, file: &Path) -> Result<PathBuf> {
    let path = definition.path_of(file);
    match &entry.source {
        Some(source) if !path.exists() => {
            let what = format!("the scene {:?} needs this missing file: get it from {source}", entry.name);
            Err(Error::malformed(&path, what))
        }
        _ => Ok(path),
    }
}

/// Returns the surfels of a file, its true surface and the triangles to draw.
///
/// The surface is `None` unless the scene asks for ground truth; triangles remain for hybrids only.
fn of_file(
    file: &Path,
    entry: &SceneEntry,
    count: usize,
    texture: Option<&Texture>,
    progress: &dyn Progress,
) -> Result<Made> {
    let mesh = match entry.truth || entry.surfels.samples() {
        true => {
            let mut mesh = io::read_mesh(file, progress)?;
            texture.iter().for_each(|texture| mesh.paint((*texture).clone()));
            Some(mesh)
        }
        false => None,
    };
    // Strict: a file with unreadable parts is an error, as a study measures all of it.
    let read = |file| io::read_with(file, ReadOptions { strict: true, ..ReadOptions::default() }, progress);
    let normals = || {
        let kept = |Points { positions, up, normals, .. }| Points { positions, up, normals, ..Points::default() };
        read(file).map(kept)
    };
    let bare = || normals().map(|points| Points { normals: None, ..points });
    let sized = |size| {
        let options = FromPoints { size, ..FromPoints::default() };
        Ok::<_, Error>(from_points(vec![bare()?], &options, progress)?.points)
    };
    let priority = |surface: &MeshSurface<'_>, voxels: &[Voxel]| entry.priority.unwrap_or_default().of(surface, voxels);
    let sampled = |method| match &mesh {
        Some(mesh) => Ok::<_, Error>(sample(mesh, count, &method, 0, progress)?.0),
        None => Ok(Points::default()),
    };
    let mut left = None;
    let stratified = Method::Stratified { priority: &priority, depth: None };
    let points = match entry.surfels {
        // Unreachable for gaussians and triangles, which a definition allows for shapes only, and
        // for levels, which [`in_part::stage`] reads.
        Making::File | Making::Gaussians | Making::Triangles | Making::Levels => as_they_are(file, entry, progress)?,
        Making::Points => bare()?,
        Making::Normals => normals()?,
        Making::Knn => sized(Size::Knn)?,
        Making::Ellipse => sized(Size::Ellipse)?,
        Making::Bsp => sized(Size::Bsp(Triangle::default()))?,
        Making::BspGlobal => sized(Size::BspGlobal(Triangle::default()))?,
        Making::BspCircumsphere => sized(Size::Bsp(Triangle::Circumsphere))?,
        Making::BspGlobalCircumsphere => sized(Size::BspGlobal(Triangle::Circumsphere))?,
        Making::Qsplat => {
            let bare = Points { faces: read(file)?.faces, ..bare()? };
            let options = FromPoints { size: Size::Qsplat, ..FromPoints::default() };
            from_points(vec![bare], &options, progress)?.points
        }
        Making::Sample => sampled(stratified)?,
        Making::Projected => sampled(Method::Projected { priority: &priority, depth: None })?,
        Making::Caps => curve(sampled(stratified)?, progress)?,
        Making::Scanned => {
            let Points { positions, up, normals, .. } = sampled(stratified)?;
            Points { positions, up, normals, ..Points::default() }
        }
        Making::Uniform => sampled(Method::Uniform)?,
        Making::Hybrid => {
            let divided = mesh.as_ref().map(|mesh| divided(mesh, count, progress)).transpose()?.unwrap_or_default();
            left = divided.triangles;
            divided.surfels.unwrap_or_default()
        }
    };
    let surface = mesh.filter(|_| entry.truth).map(|mesh| Surface::mesh(&mesh)).transpose()?;
    Ok((points, surface, left))
}

/// Reads a file's points with all their attributes.
fn as_they_are(file: &Path, entry: &SceneEntry, progress: &dyn Progress) -> Result<Points> {
    let classes = entry.classes.unwrap_or_default();
    let points = io::read_with(file, ReadOptions { classes, strict: true, ..ReadOptions::default() }, progress)?;
    if entry.classes.is_some() && points.classes.is_empty() {
        return Err(Error::malformed(file, "its points have no classes, which LAS files have"));
    }
    Ok(points)
}

/// Divides a mesh as `epsplat hybrid --pixels` does.
fn divided(mesh: &Mesh, pixels: usize, progress: &dyn Progress) -> Result<Hybrid> {
    let pixel = hybrid::pixel(mesh, pixels as f64);
    pixel.map_or_else(|| Ok(Hybrid::default()), |pixel| hybrid::hybrid(mesh, pixel, progress))
}

/// Returns the points that `epsplat generate` writes, with disks of `radius` mean spacings.
fn of_shape(shape: Shape, count: u64, radius: Option<f64>) -> Points {
    let samples = generate(shape, count);
    let factor = radius.map_or(1.0, |radius| radius / RADIUS_IN_SPACINGS) as f32;
    let opaque = |[r, g, b]: [u8; 3]| [r, g, b, 255];
    Points {
        positions: samples.clone().map(|sample| sample.position).collect(),
        normals: Some(samples.clone().map(|sample| sample.normal).collect()),
        radii: Some(samples.clone().map(|sample| sample.radius * factor).collect()),
        colors: Some(Colors::Srgb8(samples.map(|sample| opaque(sample.color)).collect())),
        ..Points::default()
    }
}

/// Moves each point along its normal by a Gaussian of standard deviation `sigma`, world units.
///
/// The offset depends on the point's index only, so it is the same in every run.
fn scatter(points: &mut Points, sigma: f64) {
    let normals = points.normals.iter().flatten();
    for (index, (position, normal)) in points.positions.iter_mut().zip(normals).enumerate() {
        let mut random = Random::stream(NOISE_SEED, index as u64);
        // Box and Muller 1958. `number()` is below 1, so the argument of the logarithm is positive.
        let (radius, turn) = ((-2.0 * (1.0 - random.number()).ln()).sqrt(), TAU * random.number());
        let offset = sigma * radius * turn.cos();
        *position = (DVec3::from(*position) + offset * DVec3::from(normal.map(f64::from))).to_array();
    }
}

/// Seed of the noise in [`scatter`].
const NOISE_SEED: u64 = 4;

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use std::path::Path;

    fn staged(entry: &str) -> (Definition, Vec<Staged>) {
        let text = format!(
            "name = \"n\"\nabout = \"a\"\nsize = [100, 100]\n[[scene]]\nname = \"s\"\n{entry}\n\
             [[config]]\nname = \"c\"\nbackend = \"reference\""
        );
        let definition = Definition::parse(&text, Path::new("x.toml")).unwrap();
        let entry = &definition.scenes[0];
        let all = points(entry).into_iter().map(|point| stage(&definition, entry, point, &()).unwrap()).collect();
        (definition, all)
    }

    #[test]
    fn a_sweep_is_each_count_with_each_footprint_that_is_not_too_large() {
        let entry = "shape = \"sphere\"\ncount = [100, 200]\nfootprint_px = [1, 4]\nmost_fragments = 6000";
        let (_, all) = staged(entry);
        let sizes: Vec<_> = all.iter().map(|s| (s.scene.surfels.len(), s.footprint_px)).collect();
        assert_eq!(sizes, [(100, 1.0), (100, 4.0), (200, 1.0)]);
        for staged in &all {
            assert!((footprint(&staged.scene, &staged.cameras) / staged.footprint_px - 1.0).abs() < 1e-6);
        }
    }

    #[test]
    fn a_radius_is_in_spacings_and_fill_is_a_share_of_the_image() {
        let (_, plain) = staged("shape = \"sphere\"\ncount = 1000");
        let (_, thick) = staged("shape = \"sphere\"\ncount = 1000\nradius = 3.0");
        let (_, far) = staged("shape = \"sphere\"\ncount = 1000\nfill = 0.1");
        let ratio = |of: &[Staged]| of[0].footprint_px / plain[0].footprint_px;
        assert!((ratio(&thick) - 2.0).abs() < 1e-6);
        // Only approximate: perspective enlarges the nearer half of the sphere.
        assert!((ratio(&far) - 0.1).abs() < 0.02, "{}", ratio(&far));
        let (_, flat) = staged("shape = \"plane\"\ncount = 100\northo = 4\nfill = 0.5");
        assert!((flat[0].footprint_px - 0.3 * 100.0 / 4.0 * 0.5).abs() < 1e-6);
    }

    #[test]
    fn noise_scatters_points_along_their_normals() {
        let heights = |entry: &str| -> Vec<f64> {
            let (_, all) = staged(&format!("shape = \"plane\"\ncount = 4000\n{entry}"));
            (0..4000).map(|index| (all[0].scene.origin + all[0].scene.center(index)).z).collect()
        };
        let spacing = (4.0f64 / 4000.0).sqrt();
        let found = heights("noise = 0.5");
        let sigma = (found.iter().map(|z| z * z).sum::<f64>() / 4000.0).sqrt();
        assert!((sigma / (0.5 * spacing) - 1.0).abs() < 0.05, "{sigma}");
        assert!(heights("").iter().all(|z| *z == 0.0) && found == heights("noise = 0.5"));
    }

    #[test]
    fn a_file_without_points_is_named() {
        let file = std::env::temp_dir().join(format!("epsplat-staging-{}.ply", std::process::id()));
        let header = "ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nproperty float y\nproperty float z\nend_header\n";
        std::fs::write(&file, header).unwrap();
        let text = format!(
            "name = \"n\"\nabout = \"a\"\nsize = [9, 9]\n[[scene]]\nname = \"s\"\nfile = '{}'\n\
             [[config]]\nname = \"c\"\nbackend = \"reference\"",
            file.display()
        );
        let definition = Definition::parse(&text, Path::new("x.toml")).unwrap();
        let entry = &definition.scenes[0];
        let error = stage(&definition, entry, points(entry)[0], &()).err().unwrap().to_string();
        std::fs::remove_file(&file).unwrap();
        assert!(error.contains("epsplat-staging") && error.contains("no points"), "{error}");
    }

    #[test]
    fn views_go_around_the_centre_and_see_it_in_the_same_place() {
        let (_, all) = staged("shape = \"torus\"\ncount = 500\nviews = 3");
        let [first, second, third] = &all[0].cameras[..] else { unreachable!() };
        for other in [second, third] {
            let center = all[0].scene.bounds().center();
            assert!((first.to_camera(center) - other.to_camera(center)).length() < 1e-9);
            assert!((first.eye - other.eye).length() > 1.0);
        }
    }
}
