//! Removes temporary files when a signal ends the run.

#[cfg(unix)]
use std::sync::{Arc, atomic::AtomicBool};

/// Installs the signal handlers.
///
/// - SIGINT, SIGTERM, SIGHUP and SIGXCPU (limit of processor time) remove the temporary files and
///   end the run with the exit code that a shell gives them: 130, 143, 129, 152. Signals that were
///   ignored at the start, as with `nohup`, stay ignored.
/// - SIGXFSZ (limit of file size) makes writing fail, in place of ending the run at once.
/// - SIGABRT, as when memory runs out, exits with 1.
#[cfg(unix)]
pub fn watch() {
    use signal_hook::consts::{SIGABRT, SIGHUP, SIGINT, SIGTERM, SIGXCPU, SIGXFSZ};
    use signal_hook::iterator::Signals;

    // A failed allocation prints a message and aborts. Like every failed run it must exit with 1.
    let _ = signal_hook::flag::register_conditional_shutdown(SIGABRT, 1, Arc::new(AtomicBool::new(true)));
    // The flag is never read. With any handler, the write call returns an error.
    let _ = signal_hook::flag::register(SIGXFSZ, Arc::default());
    let ignored = ignored();
    let watched = [SIGHUP, SIGINT, SIGTERM, SIGXCPU].into_iter().filter(|signal| ignored >> (signal - 1) & 1 == 0);
    // Without handlers the signals end the run as by default, and temporary files remain.
    let Ok(mut signals) = Signals::new(watched) else { return };
    std::thread::spawn(move || {
        if let Some(signal) = signals.forever().next() {
            epsplat::io::atomic::abandon();
            // Skips destructors and exit handlers, as threads of graphics drivers are still
            // running.
            signal_hook::low_level::exit(128 + signal);
        }
    });
}

#[cfg(not(unix))]
pub fn watch() {}

/// Returns the mask of ignored signals: bit `n - 1` for signal `n`.
///
/// If `/proc/self/status` cannot be read, SIGHUP (1) counts as ignored, as under `nohup`.
#[cfg(unix)]
fn ignored() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(1)
}
