//! Wavefront OBJ: the vertices of a mesh as points, with normals and radii from its faces.

mod source;
mod triangles;

use crate::io::fault::{self, Fault};
use crate::io::{Points, Up};
use crate::scene::Colors;
use crate::{Progress, Result};
use source::Source;
use std::fs::File;
use std::io::{self, BufReader};
use std::path::Path;
use triangles::Triangles;

/// Reads the vertices of an OBJ file, one point for each `v` line and in their order, whatever groups and materials
/// the faces are in.
///
/// - Normals: the mean of the `vn` that a vertex's face corners name, where every corner of the file names one; else
///   the mean of its faces' normals, weighted by area. A vertex of no face has none (zero). A file without faces but
///   with one `vn` for each `v` pairs them.
/// - Radii: 1.1 times the smallest with which disks at a triangle's corners cover it, the largest over the vertex's
///   triangles; polygons are fanned into triangles; a vertex of no triangle has none (zero).
/// - Colours: the three numbers after a vertex's coordinates, sRGB-coded in [0, 1], become linear light.
///
/// Up is y. Lines, points, curves and materials are passed over, so a missing MTL file is no error.
///
/// # Errors
///
/// [`Error::Read`](crate::Error::Read) where the system cannot read, [`Error::Malformed`](crate::Error::Malformed) where
/// a number is none or a face names a vertex or normal that does not exist.
pub fn read(path: &Path, progress: &dyn Progress) -> Result<Points> {
    let in_file = |fault: Fault| fault.of(path);
    let file = File::open(path).map_err(Fault::Io).map_err(in_file)?;
    let length = file.metadata().map_err(Fault::Io).map_err(in_file)?.len();
    progress.begin(&format!("reading {}", fault::name(path)), length);
    let points = read_mesh(Source::new(BufReader::with_capacity(1 << 18, file), progress));
    progress.end();
    points.map_err(in_file)
}

fn read_mesh<R: io::BufRead>(mut source: Source<'_, R>) -> Result<Points, Fault> {
    let options = tobj::LoadOptions {
        triangulate: true,
        ignore_points: true,
        ignore_lines: true,
        ..tobj::LoadOptions::default()
    };
    // Read line by line: where the parser stops, the source's line is the one it stopped at.
    let loaded =
        tobj::load_obj_buf(&mut BufReader::new(&mut source), &options, |_| Err(tobj::LoadError::OpenFileFailed));
    let lines = source.finish()?;
    let (models, _) = loaded.map_err(|error| {
        Fault::Malformed(match error {
            tobj::LoadError::FaceVertexOutOfBounds => "a face names a vertex that does not exist".into(),
            tobj::LoadError::FaceNormalOutOfBounds => "a face names a normal that does not exist".into(),
            other => format!("line {}: {other}", lines.count),
        })
    })?;
    let mut triangles = Triangles::new(&lines.positions);
    for tobj::Model { mesh, .. } in &models {
        let number =
            |index: &u32| mesh.positions.get(3 * *index as usize).map_or(usize::MAX, |number| *number as usize);
        let normal = |index: &u32| mesh.normals.get(3 * *index as usize..)?.first_chunk().copied();
        let mut normals = mesh.normal_indices.as_chunks::<3>().0.iter();
        for corners in mesh.indices.as_chunks::<3>().0 {
            let named = normals.next().filter(|_| lines.every_corner_has_a_normal);
            triangles.add(corners.each_ref().map(number), named.map(|named| named.each_ref().map(normal)));
        }
    }
    let has_faces = models.iter().any(|model| !model.mesh.indices.is_empty());
    let (face_normals, radii) = triangles.finish();
    let normals = if has_faces {
        Some(face_normals)
    } else {
        Some(lines.normals).filter(|normals| !normals.is_empty() && normals.len() == lines.positions.len())
    };
    Ok(Points {
        positions: lines.positions,
        normals,
        radii: has_faces.then_some(radii),
        colors: (!lines.colors.is_empty()).then_some(Colors::Linear(lines.colors)),
        up: Some(Up::Y),
    })
}
