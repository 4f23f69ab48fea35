//! Runs work of the library on a thread of its own, without the interpreter's lock. Meanwhile the
//! calling thread passes progress on, and stops the work if a signal or a callback asks for it.

use std::any::Any;
use std::collections::VecDeque;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::Duration;

use epsplat::Progress;
use pyo3::prelude::*;

use crate::error::{exception, named};

/// The time between two looks at signals and progress.
const BETWEEN_LOOKS: Duration = Duration::from_millis(20);

/// The stack of the working thread, bytes; that of a main thread.
const STACK: usize = 8 << 20;

/// The payload that unwinds the working thread.
struct Stopped;

enum Event {
    Begin(String, u64),
    Advance(u64),
    End,
    Note(String),
}

/// Progress between the working thread and the calling one.
#[derive(Default)]
struct Shared {
    events: Mutex<(VecDeque<Event>, bool)>,
    changed: Condvar,
    stopped: AtomicBool,
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, (VecDeque<Event>, bool)> {
        self.events.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Stores an event, or unwinds if the work is to stop.
    fn push(&self, event: Event) {
        if self.stopped.load(Ordering::Relaxed) && !thread::panicking() {
            // No panic hook runs, so nothing is printed.
            resume_unwind(Box::new(Stopped));
        }
        let (events, _) = &mut *self.lock();
        match (events.back_mut(), event) {
            // A look at whether to stop.
            (_, Event::Advance(0)) => {}
            (Some(Event::Advance(done)), Event::Advance(more)) => *done += more,
            (_, event) => events.push_back(event),
        }
    }

    /// Waits until the work is done, at most for [`BETWEEN_LOOKS`]. Returns the new events, and
    /// whether the work is done.
    fn wait(&self) -> (VecDeque<Event>, bool) {
        let wait = self.changed.wait_timeout_while(self.lock(), BETWEEN_LOOKS, |(_, done)| !*done);
        let (mut guard, _) = wait.unwrap_or_else(PoisonError::into_inner);
        (std::mem::take(&mut guard.0), guard.1)
    }

    fn finish(&self) {
        self.lock().1 = true;
        self.changed.notify_all();
    }
}

impl Progress for Shared {
    fn begin(&self, what: &str, units: u64) {
        self.push(Event::Begin(what.to_owned(), units));
    }

    fn advance(&self, units: u64) {
        self.push(Event::Advance(units));
    }

    fn end(&self) {
        self.push(Event::End);
    }

    fn note(&self, line: &str) {
        self.push(Event::Note(line.to_owned()));
    }
}

/// Passes events to `progress`, an object with the methods of [`Progress`], and collects the notes.
fn pass_on(
    py: Python<'_>,
    events: VecDeque<Event>,
    progress: Option<&Bound<'_, PyAny>>,
    notes: &mut Vec<String>,
) -> PyResult<()> {
    for event in events {
        if let Event::Note(line) = &event {
            notes.push(line.clone());
        }
        let Some(progress) = progress else { continue };
        match event {
            Event::Begin(what, units) => progress.call_method1("begin", (what, units))?,
            Event::Advance(units) => progress.call_method1("advance", (units,))?,
            Event::End => progress.call_method0("end")?,
            Event::Note(line) => progress.call_method1("note", (line,))?,
        };
    }
    py.check_signals()
}

/// The sentence of a panic.
fn panic_text(payload: &(dyn Any + Send)) -> String {
    let text = payload.downcast_ref::<&str>().copied();
    let text = text.or_else(|| payload.downcast_ref::<String>().map(String::as_str)).unwrap_or("no reason given");
    format!("the library failed unexpectedly: {text}")
}

/// The process whose threads work; 0 before the first call.
static OWNER: AtomicU32 = AtomicU32::new(0);

/// Fails in a process that was forked from one that worked: it has none of the threads.
fn check_process(py: Python<'_>) -> PyResult<()> {
    let own = std::process::id();
    match OWNER.compare_exchange(0, own, Ordering::Relaxed, Ordering::Relaxed) {
        Err(owner) if owner != own => Err(named(
            py,
            "DeviceError",
            "this process was forked from one that used epsplat, and has none of its threads: start processes by \
             multiprocessing's method spawn or forkserver",
        )),
        _ => Ok(()),
    }
}

/// Runs `work` and returns its result and its notes.
///
/// # Errors
///
/// The exception of the work, or of the signal or callback that stopped it.
pub fn run<T: Send>(
    py: Python<'_>,
    progress: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce(&dyn Progress) -> epsplat::Result<T> + Send,
) -> PyResult<(T, Vec<String>)> {
    check_process(py)?;
    let shared = Shared::default();
    let (mut notes, mut failed) = (Vec::new(), None);
    let outcome = thread::scope(|scope| {
        let working = thread::Builder::new().stack_size(STACK).spawn_scoped(scope, || {
            let outcome = catch_unwind(AssertUnwindSafe(|| work(&shared)));
            shared.finish();
            outcome
        })?;
        loop {
            let (events, done) = py.detach(|| shared.wait());
            if failed.is_none()
                && let Err(error) = pass_on(py, events, progress, &mut notes)
            {
                shared.stopped.store(true, Ordering::Relaxed);
                failed = Some(error);
            }
            if done {
                return Ok::<_, PyErr>(py.detach(|| working.join()).and_then(|outcome| outcome));
            }
        }
    })?;
    match (failed, outcome) {
        (Some(error), _) => Err(error),
        (None, Ok(outcome)) => Ok((outcome.map_err(|error| exception(py, &error))?, notes)),
        (None, Err(payload)) => Err(named(py, "Error", &panic_text(&*payload))),
    }
}
