//! Writes Gaussians as 2D Gaussian splatting does: with its trained parameters
//! ([`gaussian`](super::gaussian)).

use std::f64::consts::PI;
use std::io::{self, Write};
use std::path::Path;

use glam::{DMat3, DQuat, DVec3};

use super::column::Column;
use crate::io::Points;
use crate::io::atomic::{Output, write_whole};
use crate::scene::gaussian::EXTENT;
use crate::scene::harmonics::terms_of;
use crate::scene::{Colors, Harmonics};
use crate::{Progress, Result};

/// Opacities are clamped to this distance from 0 and 1, where the inverse logistic is infinite.
const NEAREST: f64 = 1e-9;

/// Rows between two reports of progress.
const TOLD: usize = 1 << 16;

/// Writes `points`, which are Gaussians; [`read`](super::read) returns them up to rounding.
pub(super) fn write(path: &Path, points: &Points, columns: &[Column<'_>], progress: &dyn Progress) -> Result<()> {
    let count = points.positions.len();
    progress.begin("writing Gaussians", count as u64);
    let written = write_whole(path, |out| {
        header(out, points, columns)?;
        let mut row = Vec::with_capacity(256);
        for index in 0..count {
            if index % TOLD == TOLD - 1 {
                progress.advance(TOLD as u64);
            }
            row.clear();
            encode(points, index, &mut row);
            for value in &row {
                out.write_all(&value.to_le_bytes())?;
            }
            columns.iter().try_for_each(|column| out.write_all(&column.bytes(index)))?;
        }
        Ok(())
    });
    progress.end();
    written
}

fn harmonics(points: &Points) -> Option<&Harmonics> {
    if let Some(Colors::Harmonics(harmonics)) = &points.colors { Some(harmonics) } else { None }
}

fn header(out: &mut Output<'_>, points: &Points, columns: &[Column<'_>]) -> io::Result<()> {
    write!(out, "ply\nformat binary_little_endian 1.0\ncomment epsplat {}\n", env!("CARGO_PKG_VERSION"))?;
    if let Some(up) = points.up {
        writeln!(out, "comment up {}", up.name())?;
    }
    writeln!(out, "element vertex {}", points.positions.len())?;
    let rest = harmonics(points).map_or(0, |harmonics| 3 * terms_of(harmonics.degree()));
    let named = |name: &str, count: usize| (0..count).map(|k| format!("{name}_{k}")).collect::<Vec<_>>();
    let coordinates = ["x", "y", "z", "nx", "ny", "nz"].map(String::from).to_vec();
    let names = [coordinates, named("f_dc", 3), named("f_rest", rest), vec!["opacity".into()], named("scale", 2)];
    for name in names.iter().flatten().chain(&named("rot", 4)) {
        writeln!(out, "property float {name}")?;
    }
    Column::write_properties(columns, out)?;
    out.write_all(b"end_header\n")
}

/// Appends the numbers of the Gaussian at `index`.
fn encode(points: &Points, index: usize, row: &mut Vec<f32>) {
    row.extend(points.positions[index].map(|c| c as f32));
    row.extend([0.0; 3]);
    let [r, g, b, alpha] = match &points.colors {
        Some(Colors::Harmonics(harmonics)) => harmonics.colors()[index],
        Some(colors) => colors.linear(index),
        None => [0.5, 0.5, 0.5, 1.0],
    };
    row.extend([r, g, b].map(|code| ((f64::from(code) - 0.5) * 2.0 * PI.sqrt()) as f32));
    if let Some(harmonics) = harmonics(points) {
        let terms = harmonics.terms(index);
        row.extend((0..3).flat_map(|channel| terms.iter().skip(channel).step_by(3)));
    }
    let alpha = f64::from(alpha).clamp(NEAREST, 1.0 - NEAREST);
    row.push((alpha / (1.0 - alpha)).ln() as f32);
    let axes = points.axes.as_ref().map_or([[0.0; 3]; 2], |axes| axes[index]);
    let [s, t] = axes.map(|axis| DVec3::from_array(axis.map(f64::from)));
    row.extend([s, t].map(|axis| (axis.length() / EXTENT).ln() as f32));
    let [s, t] = [s.normalize_or(DVec3::X), t.normalize_or(DVec3::Y)];
    let turn = DQuat::from_mat3(&DMat3::from_cols(s, t, s.cross(t)));
    row.extend([turn.w, turn.x, turn.y, turn.z].map(|c| c as f32));
}
