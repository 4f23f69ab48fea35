//! Signals that end a run: what it was writing goes with it.

#[cfg(unix)]
use std::sync::{Arc, atomic::AtomicBool};

/// From here on SIGINT, SIGTERM, SIGHUP and SIGXCPU, of a limit of processor time, remove the
/// temporary files and end the run with the exit code that a shell gives them: 130, 143, 129, 152.
/// Signals that were ignored at the start, as `nohup` has it, stay so. At a limit of the size of
/// files, whose SIGXFSZ would end the run at once, writing fails instead. An abort, as where memory
/// ends, exits with 1.
#[cfg(unix)]
pub fn watch() {
    use signal_hook::consts::{SIGABRT, SIGHUP, SIGINT, SIGTERM, SIGXCPU, SIGXFSZ};
    use signal_hook::iterator::Signals;

    // An allocation that fails says so, and aborts: a run that failed has the exit code 1, as
    // others do.
    let _ = signal_hook::flag::register_conditional_shutdown(SIGABRT, 1, Arc::new(AtomicBool::new(true)));
    // Nobody looks at the flag: with a handler the system call returns an error.
    let _ = signal_hook::flag::register(SIGXFSZ, Arc::default());
    let ignored = ignored();
    let watched = [SIGHUP, SIGINT, SIGTERM, SIGXCPU].into_iter().filter(|signal| ignored >> (signal - 1) & 1 == 0);
    // Without its handler a signal ends the run as it always did.
    let Ok(mut signals) = Signals::new(watched) else { return };
    std::thread::spawn(move || {
        if let Some(signal) = signals.forever().next() {
            epsplat::io::atomic::abandon();
            // Not by way of destructors: threads of graphics drivers are still at work.
            signal_hook::low_level::exit(128 + signal);
        }
    });
}

#[cfg(not(unix))]
pub fn watch() {}

/// The signals that are ignored, a bit each, the lowest for number 1, SIGHUP; that one where the system does not say, as
/// `nohup` may have it.
#[cfg(unix)]
fn ignored() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(1)
}
