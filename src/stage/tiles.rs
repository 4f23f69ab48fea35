//! Tiles of virtual point clouds: a tile is opened when a picture shows it.

use std::sync::{Mutex, PoisonError};

use glam::DVec3;

use super::Request;
use super::files::Files;
use crate::address;
use crate::error::{Error, Result};
use crate::io::las::Copc;
use crate::io::vpc::Tile;
use crate::io::{Points, Up};
use crate::progress::Progress;
use crate::scene::octree::{PointOctree, is_box_beside};
use crate::scene::{Bounds, Camera, Scene};
use crate::surfels;

/// Number of tiles that are opened at the same time: a server answers several requests in the time
/// of one.
const TOGETHER: usize = 8;

/// Tolerance of stated bounds, as a part of the largest coordinate: programs write them with 15 or
/// more digits.
const ROUNDED: f64 = 1e-12;

/// Tolerance of stated bounds, world units: some programs write coordinates with 3 decimals. It is
/// at most a ten-thousandth of a tile, whose units may be degrees.
const DECIMALS: f64 = 2e-3;
const OF_TILE: f64 = 1e-4;

/// COPC files with stated bounds.
pub(super) struct Tiles(Vec<(Tile, Bounds)>);

impl Tiles {
    /// The inputs, if all of them are COPC files in virtual point clouds that state their bounds.
    ///
    /// Returns None with conditions on attributes: only the points themselves tell whether a tile
    /// has any that pass.
    pub fn of(files: &Files) -> Option<Self> {
        if !files.options().filter().is_empty() {
            return None;
        }
        let is_copc = |tile: &Tile| {
            let path = address::shown(&tile.path).to_string_lossy().to_ascii_lowercase();
            path.ends_with(".copc.laz")
        };
        let stated = |tile: &Tile| {
            let bounds = tile.bounds.filter(|bounds| bounds.extent().is_finite() && is_copc(tile))?;
            Some((tile.clone(), bounds))
        };
        files.tiles()?.into_iter().map(stated).collect::<Option<_>>().map(Self)
    }

    /// The octree of each tile, none of which is open.
    pub fn octrees(&self) -> Vec<PointOctree> {
        self.0.iter().map(|(_, bounds)| closed(*bounds)).collect()
    }

    /// The corners of the tiles, from which views are framed.
    pub fn overview(&self, request: &Request<'_>, progress: &dyn Progress) -> Result<Scene> {
        let corners = |(_, bounds): &(Tile, Bounds)| {
            let Bounds { min, max } = *bounds;
            let corner = move |at: usize| {
                let upper = [at & 1, at >> 1 & 1, at >> 2 & 1].map(|upper| upper as f64);
                (min + (max - min) * DVec3::from_array(upper)).to_array()
            };
            (0..8).map(corner)
        };
        let positions: Vec<[f64; 3]> = self.0.iter().flat_map(corners).collect();
        let radii = Some(vec![0.0; positions.len()]);
        let points = Points { positions, radii, up: Some(Up::Z), ..Points::default() };
        let built = surfels::build_within(vec![points], Vec::new(), &request.surfels().limits.limits(), progress);
        built.map(|(overview, _)| overview).map_err(|error| request.files().named(error))
    }

    /// The indices of the tiles that a picture of `camera` shows and that are not among the open
    /// `files`. If it shows none and none is open, the first tile.
    pub fn seen(&self, files: &[Option<Copc>], camera: &Camera) -> Vec<usize> {
        let stated = |index: usize| {
            let Bounds { min, max } = self.0[index].1;
            let tolerance = tolerance(&self.0[index].1);
            Bounds { min: min - tolerance, max: max + tolerance }
        };
        let shown = |index: &usize| files[*index].is_none() && !is_box_beside(&stated(*index), camera);
        let seen: Vec<usize> = (0..self.0.len()).filter(shown).collect();
        if seen.is_empty() && files.iter().all(Option::is_none) { vec![0] } else { seen }
    }

    /// Opens the tiles with these indices, several at the same time.
    ///
    /// # Errors
    ///
    /// An error of reading, and [`Error::Malformed`] for a tile that is no COPC file, or that is
    /// not what the virtual point cloud states.
    pub fn open(&self, indices: &[usize], request: &Request<'_>, progress: &dyn Progress) -> Result<Vec<Copc>> {
        progress.begin(&format!("opening {} of {} tiles", indices.len(), self.0.len()), indices.len() as u64);
        let opened = Mutex::new(Vec::new());
        let queue = Mutex::new(indices.iter());
        let files = request.files();
        let work = || {
            loop {
                let next = queue.lock().unwrap_or_else(PoisonError::into_inner).next();
                let Some(&index) = next else { return };
                let file = self.opened(index, files);
                let failed = file.is_err();
                opened.lock().unwrap_or_else(PoisonError::into_inner).push((index, file));
                progress.advance(1);
                if failed {
                    queue.lock().unwrap_or_else(PoisonError::into_inner).by_ref().for_each(drop);
                }
            }
        };
        std::thread::scope(|scope| {
            // Where the system refuses a thread, the others do its work.
            let spawned = |_| drop(std::thread::Builder::new().spawn_scoped(scope, work));
            (1..indices.len().min(TOGETHER)).for_each(spawned);
            work();
        });
        progress.end();
        let mut opened = opened.into_inner().unwrap_or_else(PoisonError::into_inner);
        opened.sort_by_key(|(index, _)| *index);
        opened.into_iter().map(|(_, file)| file).collect()
    }

    fn opened(&self, index: usize, files: &Files) -> Result<Copc> {
        let (tile, bounds) = &self.0[index];
        let input = files.seekable(&tile.path)?;
        let wrong = |what: String| Error::malformed(&tile.path, what);
        let file = input.map_or(Ok(None), Copc::open)?;
        let file = file.ok_or_else(|| wrong("it is not a COPC file, although its name says so".into()))?;
        if let Some(count) = tile.count.filter(|count| *count != file.count()) {
            return Err(wrong(format!(
                "it has {} points, and the virtual point cloud states {count}: build the .vpc file again",
                file.count()
            )));
        }
        let own = file.octree.bounds;
        let tolerance = tolerance(bounds);
        let within = own.min.cmpge(bounds.min - tolerance).all() && own.max.cmple(bounds.max + tolerance).all();
        if !own.is_empty() && !within {
            return Err(wrong(format!(
                "its points span {:?} to {:?}, beyond the bounds that the virtual point cloud states: build the .vpc file again",
                own.min.to_array(),
                own.max.to_array()
            )));
        }
        Ok(file)
    }

    /// A note about the tiles that are not open, of which there are `closed`.
    pub fn note(&self, closed: usize) -> String {
        format!(
            "{closed} of {} tiles lie outside the view and are not read: ranges that no option or file states are those of the \
             first view's tiles, unless --range gives numbers",
            self.0.len()
        )
    }
}

/// By how much a tile may exceed these bounds, which a file states.
fn tolerance(bounds: &Bounds) -> DVec3 {
    let largest = bounds.min.abs().max(bounds.max.abs()).max_element();
    DVec3::splat((ROUNDED * largest).max(DECIMALS.min(OF_TILE * bounds.extent().max_element())))
}

/// The octree of a file that is not open.
fn closed(bounds: Bounds) -> PointOctree {
    // No place lies in it.
    PointOctree { center: DVec3::INFINITY, half: 1.0, spacing: 1.0, nodes: Vec::new(), bounds }
}
