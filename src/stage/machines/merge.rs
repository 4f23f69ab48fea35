//! Joins the parts of several processes, and makes the picture of all.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::path::{Path, PathBuf};

use glam::DVec3;

use super::Part;
use super::files::All;
use super::header::{Header, Holds};
use crate::error::{Error, Result};
use crate::frame::Frame;
use crate::hash;
use crate::io::part::{Content, Section, Values};
use crate::options::DeviceOptions;
use crate::passes::share::NoneOfScene;
use crate::passes::unseen::is_empty;
use crate::plan::check;
use crate::progress::Progress;
use crate::render::{Renderer, Report};
use crate::scene::{Camera, Maps};
use crate::stage::heights;
use crate::stage::renderer::backend;

/// The picture of all parts.
#[derive(Debug)]
pub struct Merged {
    /// The colour and the maps.
    pub frame: Frame,
    /// Times and counts of the process that merged.
    pub report: Report,
    /// The camera.
    pub camera: Camera,
}

/// Joins parts of one picture that hold the same kind of values; the order does not matter. Some
/// parts may still be missing: parts that were merged can be merged again.
///
/// ```no_run
/// use epsplat::{DeviceOptions, Part, RenderOptions, Renderer};
/// use epsplat::{Scene, SceneOptions, Share, View, merge};
///
/// let (options, device) = (RenderOptions::default(), DeviceOptions::default());
/// let scene = Scene::open(["scan.laz"], &SceneOptions::default())?;
/// let renderer = Renderer::new(&scene, &options, &device, &())?;
/// let pass = |within: Option<&Part>| {
///     // Each part could be drawn by another process, and sent as part.bytes().
///     let draw = |number| renderer.part(&View::default(), Share::new(number, 3)?, within, &());
///     merge(&(1..=3).map(draw).collect::<Result<Vec<_>, _>>()?)
/// };
/// let depths = pass(None)?;
/// let sums = pass(Some(&depths))?;
/// let frame = sums.picture(&device, &())?.frame;
/// # Ok::<(), epsplat::Error>(())
/// ```
///
/// # Errors
/// [`Error::Usage`] without parts. [`Error::Malformed`], which names the part, for a part of
/// another scene, camera, options or number of shares, with a share that is there already, or with
/// damaged values.
pub fn merge(parts: &[Part]) -> Result<Part> {
    let first = first(parts)?;
    let owners = owners(parts)?;
    let own = parts.iter().fold(0u64, |own, part| own.wrapping_add(part.header.own));
    let adapters: BTreeSet<&String> = parts.iter().flat_map(|part| &part.header.adapters).collect();
    let adapters = adapters.into_iter().cloned().collect();
    let header = Header { shares: owners.into_keys().collect(), own, adapters, ..first.header.clone() };
    let merged = Part { name: first.name.clone(), header, sections: sections(parts)? };
    merged.check_cover()?;
    Ok(merged)
}

/// Files whose values are in memory at once.
const AT_ONCE: usize = 16;

/// Joins the parts of files as [`merge`] does, with the values of few of them in memory at once.
///
/// # Errors
/// The errors of [`Part::read`] and of [`merge`].
pub fn merge_files(paths: &[PathBuf]) -> Result<Part> {
    let read = |paths: &[PathBuf]| paths.iter().map(|path| Part::read(path)).collect::<Result<Vec<_>>>();
    if paths.len() <= AT_ONCE {
        return merge(&read(paths)?);
    }
    // All are checked first, so that errors name the files.
    let heads = paths.iter().map(|path| Ok(Part { sections: Vec::new(), ..Part::read(path)? }));
    owners(&heads.collect::<Result<Vec<_>>>()?)?;
    let mut merged: Option<Part> = None;
    for paths in paths.chunks(AT_ONCE) {
        let mut parts = read(paths)?;
        parts.extend(merged.take());
        merged = Some(merge(&parts)?);
    }
    merged.ok_or_else(nothing)
}

fn nothing() -> Error {
    Error::Usage("there is nothing to merge: name the parts".into())
}

/// The first of the parts.
fn first(parts: &[Part]) -> Result<&Part> {
    parts.first().ok_or_else(nothing)
}

/// The name of the part that has each share. Fails unless all are different parts of one picture.
fn owners(parts: &[Part]) -> Result<BTreeMap<u32, &Path>> {
    let first = first(parts)?;
    parts.iter().skip(1).try_for_each(|other| check(first, other))?;
    let mut owners: BTreeMap<u32, &Path> = BTreeMap::new();
    for part in parts {
        for share in &part.header.shares {
            if let Some(other) = owners.insert(*share, &part.name) {
                let of = part.header.of;
                return Err(part.refused(format!(
                    "it has part {share}/{of}, and so has {}: leave one of them out",
                    other.display()
                )));
            }
        }
    }
    Ok(owners)
}

/// Fails unless `other` can be merged with `first`.
fn check(first: &Part, other: &Part) -> Result<()> {
    let name = first.name.display();
    if let Some(difference) = other.header.difference(&first.header) {
        return Err(other.refused(format!("it {difference} than {name}: merge the parts of one picture")));
    }
    let [own, there] = [other, first].map(|part| part.header.holds);
    if own != there {
        let (own, there) = (own.name(), there.name());
        return Err(other.refused(format!("it holds {own}, and {name} holds {there}: merge one kind at a time")));
    }
    if other.header.within != first.header.within {
        return Err(other.refused(format!(
            "its sums lie within other depths than those of {name}: draw all of them --within the same depths"
        )));
    }
    Ok(())
}

/// For each kind of values and each render: its columns, the values of each sample, and its rows.
type Shape = BTreeMap<(Values, u32), (u32, u16, u32)>;

/// The sections of all parts, one for each kind of values of each render.
fn sections(parts: &[Part]) -> Result<Vec<Section>> {
    let shapes = parts.iter().map(Part::shape).collect::<Result<Vec<_>>>()?;
    let mut kinds = Shape::new();
    for (&kind, &(width, each, rows)) in shapes.iter().flatten() {
        let all = kinds.entry(kind).or_insert((width, each, rows));
        all.2 = all.2.max(rows);
    }
    for (part, shape) in parts.iter().zip(&shapes) {
        // The values that every part has; others are common to all and in one part.
        let own = match part.header.holds {
            Holds::Depths => Values::Nearest,
            Holds::Sums => Values::Sums,
        };
        let is_short = |(kind, all): (&(Values, u32), _)| match shape.get(kind) {
            Some(rows) => rows != all,
            None => kind.0 == own,
        };
        if kinds.iter().any(is_short) {
            return Err(part.refused("it lacks rows of the image: draw the part again"));
        }
    }
    let of = |((values, render), (width, each, rows)): ((Values, u32), (u32, u16, u32))| {
        let all = |samples: Range<usize>| {
            let mut all = vec![0; samples.len() * usize::from(each)];
            let sections = parts.iter().flat_map(|part| &part.sections);
            for section in sections.filter(|own| (own.values, own.render) == (values, render)) {
                // All sections have been checked, so they are not damaged.
                let _ = section.reduce(samples.clone(), &mut all);
            }
            all
        };
        Section::new(values, render, (width, 0, rows), each, all)
    };
    Ok(kinds.into_iter().map(of).collect())
}

impl Part {
    /// The shape of the part's values.
    fn shape(&self) -> Result<Shape> {
        let mut shape = Shape::new();
        for section in &self.sections {
            section.check().map_err(|what| self.refused(what))?;
            let Section { values, render, width, each, first, rows, .. } = *section;
            let so_far = shape.entry((values, render)).or_insert((width, each, 0));
            if *so_far != (width, each, first) || !self.header.fits(section) {
                return Err(self.refused("its rows do not make an image: draw the part again"));
            }
            so_far.2 += rows;
        }
        Ok(shape)
    }

    /// Fails if the part has all shares, and they are not the scene.
    fn check_cover(&self) -> Result<()> {
        let Header { of, shares, own, subject, .. } = &self.header;
        match shares.len() == *of as usize && *own != subject.digest {
            true => Err(self.refused("the parts do not cover the scene once: draw them again from the same inputs")),
            false => Ok(()),
        }
    }

    /// Fails if shares are missing, and names them.
    ///
    /// # Errors
    /// [`Error::Usage`], or [`Error::Malformed`] if the shares are not those of the scene.
    pub fn check_whole(&self) -> Result<()> {
        let Header { of, shares, holds, .. } = &self.header;
        let missing: Vec<String> = (1..=*of)
            .filter(|share| shares.binary_search(share).is_err())
            .map(|share| format!("{share}/{of}"))
            .collect();
        let holds = holds.name();
        match &missing[..] {
            [] => self.check_cover(),
            [one] => Err(Error::Usage(format!("the {holds} of part {one} are missing: name its file too"))),
            [first, .., last] => Err(Error::Usage(format!(
                "the {holds} of {} parts are missing, {first} to {last}: name their files too",
                missing.len()
            ))),
        }
    }

    /// Fails unless the part has the sums of all shares.
    ///
    /// # Errors
    /// [`Error::Usage`].
    pub fn check_picture(&self) -> Result<()> {
        if self.header.holds == Holds::Depths {
            return Err(Error::Usage(
                "the parts hold nearest depths, which make no picture: draw sums with --within and merge those".into(),
            ));
        }
        self.check_whole()
    }

    /// The names of the adapters that drew the shares, in order, each once.
    pub fn adapters(&self) -> &[String] {
        &self.header.adapters
    }

    /// The maps of the picture, as the user asked for them.
    pub fn maps(&self) -> Maps {
        self.header.subject.maps
    }

    /// A hash of the values of a part that was merged.
    pub(super) fn digest(&self) -> u64 {
        let bytes = Content { header: Vec::new(), sections: self.sections.clone() }.encoded();
        hash::of(bytes)
    }

    /// Makes the picture of all parts on a device, without the scene. Its bits are those of a
    /// picture that one process draws, on an adapter like that of the parts.
    ///
    /// # Errors
    /// [`Error::Usage`] if parts are missing or hold depths, [`Error::Malformed`] for damaged
    /// values, and errors of the device.
    pub fn picture(&self, device: &DeviceOptions, progress: &dyn Progress) -> Result<Merged> {
        self.check_picture()?;
        self.shape()?;
        let subject = &self.header.subject;
        check::files_of_parts(&subject.facts, &subject.settings)?;
        let backend = backend(device, progress)?;
        let source = NoneOfScene::new(subject.facts.clone());
        let mut renderer = Renderer::new(source, &subject.settings, &backend)?.among()?;
        let (frame, report) = renderer.frame_among(&subject.camera, &All(self), progress)?;
        let frame = frame.ok_or_else(|| self.refused("it makes no picture: draw the parts again"))?;
        if is_empty(&frame, &subject.settings) {
            progress.note("warning: nothing shows in this picture: the camera sees no surfel of any part");
        }
        let frame = heights::made(frame, &subject.camera, DVec3::from_array(subject.up), subject.maps);
        Ok(Merged { frame, report, camera: subject.camera.clone() })
    }
}
