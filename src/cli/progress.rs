//! Progress: bars on a terminal, and elsewhere a line every few seconds for many views.

use std::io::IsTerminal;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use epsplat::Progress;
use indicatif::{ProgressBar, ProgressStyle};

/// A progress bar on stderr for each stage, cleared when the stage ends.
///
/// Nothing is printed if stderr is not a terminal.
pub struct Bars(Option<Mutex<ProgressBar>>);

impl Bars {
    pub fn new() -> Self {
        Self(std::io::stderr().is_terminal().then(|| Mutex::new(ProgressBar::hidden())))
    }

    fn with(&self, f: impl FnOnce(&mut ProgressBar)) {
        if let Some(bar) = &self.0 {
            f(&mut bar.lock().unwrap_or_else(PoisonError::into_inner));
        }
    }
}

impl Progress for Bars {
    fn begin(&self, what: &str, units: u64) {
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
    }

    fn end(&self) {
        self.with(|bar| bar.finish_and_clear());
    }

    fn note(&self, line: &str) {
        super::note(line);
    }
}

/// The time between two lines about views, where there is no terminal.
const BETWEEN_LINES: Duration = Duration::from_secs(5);

/// Counts the pictures of many views: by a bar on a terminal, else by a line every few seconds.
pub struct Views<'a> {
    bars: &'a Bars,
    total: u64,
    /// The number of finished views, and the time of the last line.
    done: Mutex<(u64, Instant)>,
}

impl<'a> Views<'a> {
    pub fn begin(bars: &'a Bars, total: u64) -> Self {
        bars.begin("rendering views", total);
        Self { bars, total, done: Mutex::new((0, Instant::now())) }
    }

    pub fn advance(&self) {
        self.bars.advance(1);
        let mut state = self.done.lock().unwrap_or_else(PoisonError::into_inner);
        let (done, last) = &mut *state;
        *done += 1;
        if self.bars.0.is_none() && last.elapsed() >= BETWEEN_LINES {
            super::note(&format!("{done} of {} pictures are written", self.total));
            *last = Instant::now();
        }
    }

    pub fn end(&self) {
        self.bars.end();
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
