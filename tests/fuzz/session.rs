//! Runs inputs for the requested time and reports the one that breaks a promise.

use super::memory::Peak;
use super::mutate::mutate;
use super::random::Random;
use super::{Outcome, Target};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, Once, PoisonError};
use std::time::{Duration, Instant};

/// An input that takes longer counts as a hang.
const PATIENCE: Duration = Duration::from_secs(60);

/// Serialises the targets, so that memory and panics can be attributed.
static TURN: Mutex<()> = Mutex::new(());
/// While an input is read, panics are recorded, not printed. Readers survive panics of a decoder;
/// panics of epsplat fail the test.
static QUIET: AtomicBool = AtomicBool::new(false);
static PANICS: AtomicU64 = AtomicU64::new(0);
static LAST_PANIC: Mutex<String> = Mutex::new(String::new());

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

fn note_panics() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        // When a decoder first runs, the readers install a hook that silences it; ours must be
        // installed over it.
        let _ =
            epsplat::io::read(Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/readers/deep_gps_time.laz")), &());
        let usual = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |info| {
            if QUIET.load(Ordering::Relaxed) {
                PANICS.fetch_add(1, Ordering::Relaxed);
                *lock(&LAST_PANIC) = info.to_string().replace('\n', " ");
            } else {
                usual(info);
            }
        }));
    });
}

/// An integer from the environment.
fn setting(name: &str) -> Option<u64> {
    let text = std::env::var(name).ok()?;
    Some(text.parse().unwrap_or_else(|_| panic!("{name} is a whole number, not {text:?}")))
}

/// Runs `target` for `EPSPLAT_FUZZ_SECONDS`.
pub fn run(target: &Target) {
    let _turn = lock(&TURN);
    note_panics();
    let seconds = setting("EPSPLAT_FUZZ_SECONDS").unwrap_or(2);
    // The same inputs every time unless another seed is given: a test must not fail by chance.
    let first = setting("EPSPLAT_FUZZ_SEED").unwrap_or(1);
    eprintln!("{}: from seed {first}", target.name);

    // The folder has a fixed name and is not temporary, so the file under test survives if the
    // process dies.
    let folder = std::env::temp_dir().join(format!("epsplat-fuzz-{}-{}", target.name, std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let path = folder.join(format!("input.{}", target.extension));
    let watch = Watch::new(path.clone());
    let start = Instant::now();
    let mut before = None;
    let mut outcomes = [0u64; 3];
    let mut seed = first;
    while start.elapsed().as_secs() < seconds || before.is_none() {
        watch.begin(seed);
        let (bytes, valid) = input(target, seed);
        let result = execute(target, &path, &bytes, valid);
        // The first inputs start threads and build tables, which is not counted.
        let executions: u64 = outcomes.iter().sum();
        if executions == 20 {
            before = Some(Peak::now());
        }
        let peak = Peak::now();
        let result = result.and_then(|outcome| match before {
            Some(before) if !peak.within_bound_of(before) => {
                Err(format!("it took too much memory: {before:?} before, {peak:?} after"))
            }
            _ => Ok(outcome),
        });
        match result {
            Ok(outcome) => outcomes[outcome as usize] += 1,
            Err(what) => panic!("{}: {what}; the input is {}, EPSPLAT_FUZZ_SEED={seed}", target.name, path.display()),
        }
        seed = seed.wrapping_add(1);
    }
    drop(watch);
    std::fs::remove_dir_all(&folder).unwrap();
    let [refused, read, drawn] = outcomes;
    let survived = PANICS.swap(0, Ordering::Relaxed);
    eprintln!(
        "{}: {} inputs: {refused} refused, {read} read, {drawn} drawn; {survived} panics of a decoder survived",
        target.name,
        refused + read + drawn
    );
    // A session with only one kind of outcome tests nothing.
    assert!(refused > 0 && drawn > 0, "{}: of all inputs, {refused} were refused and {drawn} drawn", target.name);
}

/// The input of a seed, with its number of points if it is unmodified.
fn input(target: &Target, seed: u64) -> (Vec<u8>, Option<usize>) {
    let mut random = Random(seed);
    let (mut bytes, points) = (target.generate)(&mut random);
    if random.one_in(16) {
        return (bytes, Some(points));
    }
    let (other, _) = (target.generate)(&mut random);
    mutate(&mut random, &target.grammar, &mut bytes, &other);
    (bytes, None)
}

fn execute(target: &Target, path: &Path, bytes: &[u8], valid: Option<usize>) -> Result<Outcome, String> {
    // File systems flush an overwritten file, but not one that replaces a deleted one: this is ten
    // times as fast.
    let _ = std::fs::remove_file(path);
    std::fs::write(path, bytes).unwrap();
    QUIET.store(true, Ordering::Relaxed);
    let result = catch_unwind(AssertUnwindSafe(|| (target.execute)(path, valid)));
    QUIET.store(false, Ordering::Relaxed);
    result.unwrap_or_else(|_| Err(lock(&LAST_PANIC).clone()))
}

/// Checks that an error is one line and names the file, if one is given.
pub fn sentence(error: &epsplat::Error, path: Option<&Path>) -> Result<(), String> {
    let message = error.to_string();
    let name = path.map(|path| path.display().to_string()).unwrap_or_default();
    let wrong = if message.chars().any(char::is_control) {
        "is more than a line"
    } else if !message.contains(&name) {
        "does not name the file"
    } else if path.is_some() && message.len() > 400 + name.len() {
        "is longer than a sentence"
    } else {
        return Ok(());
    };
    Err(format!("its error {wrong}: {message:?}"))
}

/// Ends the process when an input hangs; nothing else can.
struct Watch {
    seed: std::sync::Arc<AtomicU64>,
    over: std::sync::Arc<AtomicBool>,
}

impl Watch {
    fn new(path: PathBuf) -> Self {
        let watch = Self { seed: Default::default(), over: Default::default() };
        let (seed, over) = (watch.seed.clone(), watch.over.clone());
        std::thread::spawn(move || {
            let (mut last, mut since) = (0, Instant::now());
            while !over.load(Ordering::Relaxed) {
                std::thread::sleep(Duration::from_millis(200));
                let now = seed.load(Ordering::Relaxed);
                if now != last {
                    (last, since) = (now, Instant::now());
                } else if since.elapsed() > PATIENCE {
                    eprintln!("reading hangs; the input is {}, EPSPLAT_FUZZ_SEED={now}", path.display());
                    std::process::abort();
                }
            }
        });
        watch
    }

    fn begin(&self, seed: u64) {
        self.seed.store(seed, Ordering::Relaxed);
    }
}

impl Drop for Watch {
    fn drop(&mut self) {
        self.over.store(true, Ordering::Relaxed);
    }
}
