//! The record of a run, and its files.

use std::collections::BTreeMap;
use std::io::Write as _;
use std::path::Path;

use serde::Serialize;

use super::{Accuracy, Asked, Clocks, Comparison, StudyRecord, Throughput, Trial, accuracy, markdown};
use crate::bench::bandwidth::{Copier, CopyBandwidth};
use crate::bench::machine::machine;
use crate::error::{Error, Result};
use crate::gpu::AdapterDescription;
use crate::io::atomic::{write_together, write_whole};
use crate::render::Backend;
use crate::report::Machine;

/// The files of a run beside the studies' folders: record, summary, and rows of the hard cases.
pub const FILES: [&str; 3] = ["card.json", "card.md", accuracy::FILE];

/// The results of a run.
#[derive(Clone, Debug, Serialize)]
pub struct Record {
    /// The command line that repeats the run.
    pub command: String,
    /// The date of the run.
    pub date: String,
    /// Whether this was the short form.
    pub quick: bool,
    /// Time limit in minutes.
    pub minutes: f64,
    /// Time so far, seconds.
    pub seconds: f64,
    /// The machine and the version of epsplat.
    pub machine: Machine,
    /// The adapter, its limits and features.
    pub adapter: AdapterDescription,
    /// The finished steps.
    pub steps: Vec<Step>,
    /// The card's clocks, in the order in which they were read.
    pub clocks: Vec<Clocks>,
    /// The copy bandwidth of the device by kernels and by commands, for growing buffers.
    pub copies: Vec<CopyBandwidth>,
    /// The results of the hard cases; `None` until they have run.
    pub accuracy: Option<Accuracy>,
    /// Comparisons of images that must be bit-identical.
    pub determinism: Vec<Comparison>,
    /// A hash of the colour's and of each map's bits of one frame of each scene of the comparisons
    /// ([`Frame::hashes`](crate::frame::Frame::hashes)).
    pub bits: BTreeMap<String, BTreeMap<&'static str, String>>,
    /// Frame times, one entry per number of surfels.
    pub throughput: Vec<Throughput>,
    /// Changes of the hot path beside the default, by number of surfels.
    pub changes: Vec<Trial>,
    /// The studies that ran.
    pub studies: Vec<StudyRecord>,
    /// Errors that ended a step or a part of it, one sentence each.
    pub problems: Vec<String>,
    /// Work skipped for lack of time or of a feature of the adapter, one sentence each.
    pub left_out: Vec<String>,
}

/// A finished step.
#[derive(Clone, Debug, Serialize)]
pub struct Step {
    /// The name.
    pub name: &'static str,
    /// Duration, seconds.
    pub seconds: f64,
}

impl Record {
    /// Returns the empty record of a run that has just begun.
    pub(super) fn new(asked: &Asked, backend: &Backend, adapter: AdapterDescription) -> Self {
        Self {
            command: asked.command.clone(),
            date: asked.date.clone(),
            quick: asked.quick,
            minutes: asked.minutes,
            seconds: 0.0,
            machine: machine(Some(backend)),
            adapter,
            steps: Vec::new(),
            clocks: Vec::new(),
            copies: Vec::new(),
            accuracy: None,
            determinism: Vec::new(),
            bits: BTreeMap::new(),
            throughput: Vec::new(),
            changes: Vec::new(),
            studies: Vec::new(),
            problems: Vec::new(),
            left_out: Vec::new(),
        }
    }

    /// Returns the copies of the largest buffer, whose speed is that of memory.
    pub fn copy_of_memory(&self, by: Copier) -> Option<&CopyBandwidth> {
        self.copies.iter().filter(|copy| copy.by == by).max_by_key(|copy| copy.buffer_bytes)
    }

    /// Returns a sentence for each failed hard case, image difference, failed study and error.
    pub fn failures(&self) -> Vec<String> {
        let hard = self.accuracy.iter().flat_map(|accuracy| &accuracy.failures);
        let hard = hard.map(|failure| format!("hard case {failure}"));
        let differ = self.determinism.iter().filter(|comparison| !comparison.equal).map(|comparison| {
            let Comparison { scene, accumulator, what, values, differing, .. } = comparison;
            format!("{scene}, {accumulator}, {what}: {differing} of {values} values differ in bits")
        });
        let studies = self
            .studies
            .iter()
            .flat_map(|study| study.failures.iter().map(move |failure| format!("the study {}: {failure}", study.name)));
        let changes = self.changes.iter().filter(|trial| !trial.equal);
        let changes = changes
            .map(|trial| format!("{} surfels, {}: the bits are not those of the default", trial.surfels, trial.change));
        hard.chain(differ).chain(changes).chain(studies).chain(self.problems.iter().cloned()).collect()
    }

    /// Writes the JSON and Markdown files into `folder`, both or neither.
    pub(super) fn write(&self, folder: &Path) -> Result<()> {
        let [json_file, summary_file] = [FILES[0], FILES[1]].map(|name| folder.join(name));
        let (json, summary) = (json(&json_file, self)?, markdown(self));
        write_together([(json_file, json.as_bytes()), (summary_file, summary.as_bytes())])
    }
}

fn json(path: &Path, value: &impl Serialize) -> Result<String> {
    let mut text = serde_json::to_string_pretty(value).map_err(|e| Error::write(path, e.into()))?;
    text.push('\n');
    Ok(text)
}

/// Writes `value` as JSON.
pub(super) fn write_json(path: &Path, value: &impl Serialize) -> Result<()> {
    let text = json(path, value)?;
    write_whole(path, |file| file.write_all(text.as_bytes()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_image_that_differs_and_what_could_not_be_done_are_failures() {
        let asked = Asked {
            adapter: None,
            quick: false,
            minutes: 1.0,
            study: None,
            studies: Vec::new(),
            command: "epsplat card".into(),
            date: String::new(),
        };
        let mut record = Record::new(&asked, &Backend::Reference, AdapterDescription::core());
        let comparison = |differing| Comparison {
            scene: "s".into(),
            accumulator: "fixed",
            what: "without order".into(),
            values: 10,
            differing,
            equal: differing == 0,
        };
        record.determinism.push(comparison(0));
        record.left_out.push("frames of 10 surfels: the remaining time is too short".into());
        assert_eq!(record.failures(), Vec::<String>::new());
        let page = markdown(&record);
        assert!(page.contains("1 of 1 pairs of images |") && page.contains("## Left out\n\n- frames of 10"), "{page}");
        record.determinism.push(comparison(3));
        record.problems.push("throughput: the device was lost".into());
        let failures = ["s, fixed, without order: 3 of 10 values differ in bits", "throughput: the device was lost"];
        assert_eq!(record.failures(), failures);
        let page = markdown(&record);
        assert!(page.contains("1 of 2 pairs of images, **1 DIFFER**") && page.contains(failures[0]), "{page}");
    }
}
