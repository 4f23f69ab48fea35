//! Progress: bars on a terminal, and elsewhere a line every few seconds for many pictures.

use std::io::IsTerminal;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use epsplat::Progress;
use indicatif::{ProgressBar, ProgressStyle};

/// The time between two lines, where there is no terminal.
const BETWEEN_LINES: Duration = Duration::from_secs(5);

/// The stages that print lines where there is no terminal: each unit is a picture.
const WITH_LINES: [&str; 2] = ["rendering views", "rendering tiles"];

/// A progress bar on stderr for each stage, cleared when the stage ends.
///
/// If stderr is not a terminal, stages of many pictures print a line every few seconds, and others
/// nothing.
pub struct Bars {
    bar: Option<Mutex<ProgressBar>>,
    lines: Mutex<Option<Lines>>,
}

/// A stage that prints lines.
struct Lines {
    what: String,
    done: u64,
    units: u64,
    last: Instant,
}

impl Bars {
    pub fn new() -> Self {
        let bar = std::io::stderr().is_terminal().then(|| Mutex::new(ProgressBar::hidden()));
        Self { bar, lines: Mutex::default() }
    }

    fn with(&self, f: impl FnOnce(&mut ProgressBar)) {
        if let Some(bar) = &self.bar {
            f(&mut bar.lock().unwrap_or_else(PoisonError::into_inner));
        }
    }

    fn lines(&self) -> MutexGuard<'_, Option<Lines>> {
        self.lines.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Progress for Bars {
    fn begin(&self, what: &str, units: u64) {
        if self.bar.is_none() && WITH_LINES.contains(&what) {
            *self.lines() = Some(Lines { what: what.to_owned(), done: 0, units, last: Instant::now() });
        }
        self.with(|bar| {
            *bar = if units > 0 { ProgressBar::new(units) } else { ProgressBar::new_spinner() };
            let template = if units > 0 {
                "{spinner} {msg:24} {bar:40} {percent:>3} %  {elapsed}"
            } else {
                "{spinner} {msg:24} {elapsed}"
            };
            // Both templates are valid. The default style avoids a panic in any case.
            bar.set_style(ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar()));
            bar.set_message(what.to_owned());
            bar.enable_steady_tick(Duration::from_millis(120));
        });
    }

    fn advance(&self, units: u64) {
        self.with(|bar| bar.inc(units));
        if let Some(lines) = &mut *self.lines() {
            lines.done += units;
            if lines.last.elapsed() >= BETWEEN_LINES {
                super::note(&format!("{}: {} of {}", lines.what, lines.done, lines.units));
                lines.last = Instant::now();
            }
        }
    }

    fn end(&self) {
        self.with(|bar| bar.finish_and_clear());
        *self.lines() = None;
    }

    fn note(&self, line: &str) {
        super::note(line);
    }
}

/// Prints notes, but no progress bars.
pub struct Notes;

impl Progress for Notes {
    fn begin(&self, _what: &str, _units: u64) {}
    fn advance(&self, _units: u64) {}
    fn end(&self) {}

    fn note(&self, line: &str) {
        super::note(line);
    }
}
