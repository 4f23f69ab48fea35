//! Signals that end a run: what it was writing goes with it.

/// From here on SIGINT, SIGTERM and SIGHUP remove the temporary files and end the run with the exit code that a shell gives
/// them: 130, 143, 129. What was ignored at the start, as `nohup` has it, stays so.
#[cfg(unix)]
pub fn watch() {
    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
    use signal_hook::iterator::Signals;

    let ignored = ignored();
    let watched = [SIGHUP, SIGINT, SIGTERM].into_iter().filter(|signal| ignored >> (signal - 1) & 1 == 0);
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
