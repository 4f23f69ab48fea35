//! Facts about all points, which are needed to build any part of the scene.

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::{Path, PathBuf};

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::super::below::Known;
use super::super::sums::Scales;
use super::super::{NodeBounds, as_in_a_file, split};
use super::sources::{Read, Sources, usable};
use crate::io::Points;
use crate::io::ply::Rows;
use crate::scene::scene::shows;
use crate::scene::whole::Has;
use crate::scene::{Bounds, Cap, Clip, Colors, SMALLEST_SCENE, Sample, Scene, Surfel, Up, body_within};
use crate::surfels::build::{LARGEST_IN_EXTENTS, plane_of};
use crate::surfels::complete::{self, Added};
use crate::surfels::{Preparation, guess_up, origin_for, usable_axes};
use crate::{Error, Result};

/// Facts about all points of the inputs.
pub(super) struct Survey {
    /// The scene without surfels from which each part starts.
    pub empty: Scene,
    /// An input without points, with each attribute that any of the files has. It is joined with
    /// each part, so that all parts have the same attributes.
    others: Points,
    pub has: Has,
    pub known: Known,
    /// [`Scene::color_range`].
    pub range: ([f32; 4], [f32; 4]),
    /// [`Scene::largest_radius`].
    pub largest_radius: f32,
    /// [`Scene::largest_shorter`].
    pub largest_shorter: f32,
    /// Whether all colours are opaque.
    pub opaque: bool,
    /// [`Scene::bounds`] of the centres as a file gives them back.
    pub bounds: Bounds,
    /// Whether an f32 would lose digits of a coordinate.
    pub double: bool,
    pub preparation: Preparation,
}

impl Survey {
    /// Surveys the points of `sources`.
    pub fn of(sources: &Sources<'_>) -> Result<Self> {
        let mut look = Look::new(sources)?;
        let told = |what: &str| sources.progress.begin(what, sources.count());
        told("looking at points");
        let nothing = || Looks::of(sources.count());
        let looks = sources.each(nothing, |points, path| look.at(points, path, nothing()), Looks::both);
        sources.progress.end();
        let looks = looks?;
        let count = looks.preparation.surfels;
        if count == 0 {
            return Err(Error::EmptyScene("the inputs hold no point with three finite coordinates".into()));
        }
        if u32::try_from(count).is_err() {
            return Err(Error::Usage(format!("a tree has at most 2^32 - 1 surfels, not {count}")));
        }
        // Sampling depends on the number of usable points: if some are unusable, sample again.
        let sample =
            if looks.preparation.dropped_non_finite == 0 { looks.sample.clone() } else { sampled(sources, count)? };
        let positions = |(file, piece): (&Rows, Range<u64>)| {
            let points = file.points(&file.bytes(piece)?)?;
            Ok(usable(&points).map(|position| (position, 0.0)).collect())
        };
        let places = Read::new(count as usize, sources.pieces(), positions, sources.among);
        let (body, _) = places.made(|places| body_within(sample.core(), looks.all, places))?;
        look.empty.origin = origin_for(&body);
        look.empty.up = look.up.unwrap_or_else(|| guess_up(&body));
        let extent = body.extent().max_element();
        if extent < SMALLEST_SCENE || f64::from(looks.longest) > LARGEST_IN_EXTENTS * extent {
            return Err(Error::Usage(
                "--memory takes neither points that are all at one place nor disks of over a million times the extent of all points: leave it out".into(),
            ));
        }
        let has = Has { low: true, ..looks.has };
        told("checking the precision of coordinates");
        let places = sources.each(
            <[Placed; 2]>::default,
            |points, _| Ok(look.placed(points, has)),
            |[a, b], [c, d]| [a.both(c), b.both(d)],
        );
        sources.progress.end();
        look.empty.closed &= look.are_closed(sources, &looks);
        Ok(look.finish(looks, places?))
    }

    /// The memory that the scene uses for each surfel, bytes.
    pub fn surfel_bytes(&self) -> u64 {
        let Has { low, clips, caps, normals } = self.has;
        let lists = [(low, 12), (clips, 24), (caps, 12), (normals, 12)];
        let colors = match self.empty.colors {
            Colors::Srgb8(_) => 4,
            Colors::Linear(_) => 16,
            _ => 0,
        };
        36 + colors + lists.iter().map(|(has, bytes)| if *has { *bytes } else { 0 }).sum::<u64>()
    }

    /// Reserves memory for `count` surfels.
    pub fn reserve(&self, scene: &mut Scene, count: usize) {
        let Has { low, clips, caps, normals } = self.has;
        let count_if = |has: bool| if has { count } else { 0 };
        scene.surfels.reserve_exact(count);
        scene.low.reserve_exact(count_if(low));
        scene.clips.reserve_exact(count_if(clips));
        scene.caps.reserve_exact(count_if(caps));
        scene.normals.reserve_exact(count_if(normals));
        match &mut scene.colors {
            Colors::Srgb8(codes) => codes.reserve_exact(count),
            Colors::Linear(colors) => colors.reserve_exact(count),
            _ => {}
        }
    }

    /// Returns the surfels of `points` as a part of the scene; None if a point lacks a normal or a
    /// radius.
    pub fn part(&self, points: Points) -> Option<Scene> {
        let mut scene = self.empty.clone();
        complete::add(&mut scene, vec![points, self.others.clone()], self.has)?;
        Some(scene)
    }

    /// As [`Self::part`], for points that were written from a part: the normals of that part are
    /// restored bit for bit.
    pub fn part_again(&self, mut points: Points) -> Option<Scene> {
        let normals = if self.has.normals { points.normals.take() } else { None };
        let part = self.part(points)?;
        Some(Scene { normals: normals.unwrap_or_default(), ..part })
    }
}

/// The sample of `count` usable points.
fn sampled(sources: &Sources<'_>, count: u64) -> Result<Sample> {
    let nothing = || Sample::of(count as usize);
    let sampled = |points: Points, _: &Path| {
        let mut sample = nothing();
        usable(&points).for_each(|position| sample.add(position));
        Ok(sample)
    };
    sources.each(nothing, sampled, Sample::both)
}

/// The facts that the headers of all files give.
struct Look {
    empty: Scene,
    others: Points,
    up: Option<Up>,
}

/// Facts about points that do not depend on the scene's origin.
#[derive(Clone, Serialize, Deserialize)]
struct Looks {
    preparation: Preparation,
    has: Has,
    longest: f32,
    radius: f32,
    shorter: f32,
    range: ([f32; 4], [f32; 4]),
    /// The colour, if all are the same.
    color: One,
    opaque: bool,
    /// The box of their positions, world coordinates.
    all: Bounds,
    sample: Sample,
    /// The numbers of usable and unusable points of each file.
    of_files: BTreeMap<PathBuf, [u64; 2]>,
}

/// Whether colours are all the same.
#[derive(Clone, Copy, PartialEq, Serialize, Deserialize)]
enum One {
    Nothing,
    Color([f32; 4]),
    Several,
}

impl One {
    fn both(self, other: Self) -> Self {
        match (self, other) {
            (Self::Nothing, one) | (one, Self::Nothing) => one,
            (one, other) if one == other => one,
            _ => Self::Several,
        }
    }

    fn of(colors: &Colors, count: usize) -> Self {
        if count == 0 {
            return Self::Nothing;
        }
        let one = match colors {
            Colors::Srgb8(codes) => codes.windows(2).all(|pair| pair[0] == pair[1]),
            Colors::Linear(colors) => colors.windows(2).all(|pair| pair[0] == pair[1]),
            _ => true,
        };
        if one { Self::Color(colors.linear(0)) } else { Self::Several }
    }
}

impl Looks {
    /// The facts before any of `count` points is read.
    fn of(count: u64) -> Self {
        Self {
            preparation: Preparation::default(),
            has: Has { low: false, clips: false, caps: false, normals: false },
            longest: 0.0,
            radius: 0.0,
            shorter: 0.0,
            range: ([f32::INFINITY; 4], [f32::NEG_INFINITY; 4]),
            color: One::Nothing,
            opaque: true,
            all: Bounds::EMPTY,
            sample: Sample::of(count as usize),
            of_files: BTreeMap::new(),
        }
    }

    fn both(mut self, mut other: Self) -> Self {
        for (path, [usable, dropped]) in std::mem::take(&mut other.of_files) {
            let of_file = self.of_files.entry(path).or_default();
            *of_file = [of_file[0] + usable, of_file[1] + dropped];
        }
        let (a, b) = (&self.preparation, &other.preparation);
        let each = |one: [f32; 4], other: [f32; 4], of: fn(f32, f32) -> f32| [0, 1, 2, 3].map(|k| of(one[k], other[k]));
        Self {
            preparation: Preparation {
                points: a.points + b.points,
                surfels: a.surfels + b.surfels,
                dropped_non_finite: a.dropped_non_finite + b.dropped_non_finite,
                replaced_colors: a.replaced_colors + b.replaced_colors,
                clamped_alphas: a.clamped_alphas + b.clamped_alphas,
                ..Preparation::default()
            },
            has: Has {
                low: false,
                clips: self.has.clips || other.has.clips,
                caps: self.has.caps || other.has.caps,
                normals: self.has.normals || other.has.normals,
            },
            longest: self.longest.max(other.longest),
            radius: self.radius.max(other.radius),
            shorter: self.shorter.max(other.shorter),
            range: (each(self.range.0, other.range.0, f32::min), each(self.range.1, other.range.1, f32::max)),
            color: self.color.both(other.color),
            opaque: self.opaque && other.opaque,
            all: self.all.union(other.all),
            sample: self.sample.both(other.sample),
            of_files: self.of_files,
        }
    }
}

/// Facts about centres as a file gives them back, with their parts beyond f32 or without.
#[derive(Clone, Copy, Serialize, Deserialize)]
struct Placed {
    bounds: Bounds,
    /// Whether an f32 would lose digits of a coordinate.
    double: bool,
    /// Whether the error of a centre in f32 may be visible.
    shows: bool,
    /// The largest error of a coordinate that may be visible although parts beyond f32 are stored;
    /// 0 if none is.
    error: f64,
}

impl Default for Placed {
    fn default() -> Self {
        Self { bounds: Bounds::EMPTY, double: false, shows: false, error: 0.0 }
    }
}

impl Placed {
    fn both(self, other: Self) -> Self {
        Self {
            bounds: self.bounds.union(other.bounds),
            double: self.double || other.double,
            shows: self.shows || other.shows,
            error: self.error.max(other.error),
        }
    }

    fn with(self, origin: DVec3, center: DVec3, (shows, error): (bool, f64)) -> Self {
        let double = crate::io::ply::needs_double((origin + center).to_array());
        self.both(Self { bounds: Bounds::EMPTY.with_point(center), double, shows, error })
    }
}

impl Look {
    /// Collects the facts in the headers of all files. No point is read.
    fn new(sources: &Sources<'_>) -> Result<Self> {
        let mut all = Self { empty: Scene::default(), others: Points::default(), up: None };
        for file in sources.files {
            let none = file.points(&[])?;
            let others = &mut all.others;
            others.colors = match (others.colors.take(), none.colors) {
                (Some(Colors::Linear(_)), _) | (_, Some(Colors::Linear(_))) => Some(Colors::Linear(Vec::new())),
                (one, other) => one.or(other),
            };
            others.clips = others.clips.take().or(none.clips);
            others.caps = others.caps.take().or(none.caps);
            others.normals = others.normals.take().or(none.normals);
            others.unsided |= none.unsided;
            all.up = match (all.up, none.up) {
                (Some(Up::Z), _) | (_, Some(Up::Z)) => Some(Up::Z),
                (said, says) => said.or(says),
            };
        }
        all.empty.oriented = !all.others.unsided;
        all.empty.closed = all.empty.oriented;
        all.empty.colors = all.others.colors.clone().unwrap_or_default();
        Ok(all)
    }

    /// Collects the facts about `points`.
    fn at(&self, points: Points, path: &Path, nothing: Looks) -> Result<Looks> {
        let all = Has { low: false, clips: true, caps: true, normals: true };
        let mut scene = self.empty.clone();
        let Some(Added { preparation, positions }) = complete::add(&mut scene, vec![points, self.others.clone()], all)
        else {
            return Err(Error::malformed(
                path,
                "a point has no normal or no radius, and --memory estimates none: make surfels of the points first (epsplat surfels)",
            ));
        };
        if !scene.surfels.iter().all(|surfel| usable_axes([surfel.s, surfel.t]).is_some()) {
            return Err(Error::malformed(
                path,
                "a disk is too small, too large or too thin: with --memory its half-axes must be ones that a file can hold",
            ));
        }
        let (mut all, mut sample) = (Bounds::EMPTY, nothing.sample);
        for position in positions.into_iter().map(DVec3::from_array) {
            all = all.with_point(position);
            sample.add(position);
        }
        let of_file = [scene.surfels.len() as u64, preparation.dropped_non_finite];
        let Scene { surfels, clips, caps, normals, colors, .. } = &scene;
        let differs = |(normal, surfel): (&[f32; 3], &Surfel)| *normal != plane_of(surfel).to_array();
        let opaque = match colors {
            Colors::Srgb8(codes) => codes.iter().all(|code| code[3] == 255),
            _ => true,
        };
        Ok(Looks {
            preparation: Preparation { surfels: surfels.len() as u64, ..preparation },
            has: Has {
                low: false,
                clips: !clips.iter().all(Clip::is_none),
                caps: !caps.iter().all(Cap::is_flat),
                normals: normals.iter().zip(surfels).any(differs),
            },
            longest: surfels.iter().map(Surfel::radius).fold(0.0, f32::max),
            radius: scene.largest_radius(),
            shorter: scene.largest_shorter(),
            range: if surfels.is_empty() { nothing.range } else { scene.color_range() },
            color: One::of(colors, surfels.len()),
            opaque,
            all,
            sample,
            of_files: BTreeMap::from([(path.to_owned(), of_file)]),
        })
    }

    /// Collects the facts about centres without and with their parts beyond f32.
    fn placed(&self, points: Points, has: Has) -> [Placed; 2] {
        let mut scene = self.empty.clone();
        let added = complete::add(&mut scene, vec![points, self.others.clone()], has).unwrap_or_default();
        let origin = scene.origin;
        let mut all = <[Placed; 2]>::default();
        for (index, (surfel, position)) in scene.surfels.iter().zip(&added.positions).enumerate() {
            let short = DVec3::from_array(surfel.center.map(f64::from));
            let relative = DVec3::from_array(*position) - origin;
            let seen = |error: DVec3| Some(error.abs().max_element()).filter(|error| shows(surfel, *error));
            let shows = seen(relative - short).is_some();
            let error = seen(relative - scene.center(index)).unwrap_or(0.0);
            let wide = |part: [f32; 3]| DVec3::from_array(part.map(f64::from));
            let [alone, _] = split(as_in_a_file(origin, short)).map(wide);
            let [near, rest] = split(as_in_a_file(origin, scene.center(index))).map(wide);
            all[0] = all[0].with(origin, alone, (shows, 0.0));
            all[1] = all[1].with(origin, near + rest, (shows, error));
        }
        all
    }

    /// Whether the surfels cover closed surfaces: each file with a usable point must say so and
    /// have no unusable one.
    fn are_closed(&self, sources: &Sources<'_>, looks: &Looks) -> bool {
        sources.files.iter().all(|file| match looks.of_files.get(file.path()) {
            None | Some([0, _]) => true,
            Some([_, dropped]) => file.is_closed() && *dropped == 0,
        })
    }

    /// Joins the facts; `without` and `with` are those about centres without and with parts beyond
    /// f32.
    fn finish(self, looks: Looks, [without, with]: [Placed; 2]) -> Survey {
        let Self { mut empty, mut others, up } = self;
        let low = without.shows;
        let placed = if low { with } else { without };
        if let One::Color(color) = looks.color {
            empty.colors = Colors::Constant(color);
            others.colors = None;
        }
        let scales = Scales::within(looks.range, matches!(empty.colors, Colors::Srgb8(_)), looks.longest);
        let known = Known { origin: empty.origin, oriented: empty.oriented, low, scales, bounds: NodeBounds::Rims };
        let has = Has { low, ..looks.has };
        others.clips = others.clips.filter(|_| has.clips);
        others.caps = others.caps.filter(|_| has.caps);
        Survey {
            empty,
            others,
            has,
            known,
            range: looks.range,
            largest_radius: looks.radius,
            largest_shorter: looks.shorter,
            opaque: looks.opaque,
            bounds: placed.bounds,
            double: placed.double,
            preparation: Preparation {
                guessed_up: up.is_none(),
                rounding: Some(placed.error).filter(|error| *error > 0.0),
                ..looks.preparation
            },
        }
    }
}
