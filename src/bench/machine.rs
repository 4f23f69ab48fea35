//! Describes the machine, date and command of a study, without paths of the local file system.

use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use crate::render::Backend;
use crate::report::Machine;

/// Describes the adapter, processor and operating system, as far as the system reports them.
pub(super) fn machine(gpu: Option<&Backend>) -> Machine {
    let adapter = match gpu {
        Some(Backend::Gpu { gpu, .. }) => Some(&gpu.adapter),
        _ => None,
    };
    let of_adapter = |f: fn(&crate::gpu::AdapterDescription) -> &String| adapter.map(f).cloned().unwrap_or_default();
    let cpu = line_after("/proc/cpuinfo", "model name", ':').unwrap_or_else(|| std::env::consts::ARCH.to_owned());
    let os = line_after("/etc/os-release", "PRETTY_NAME", '=').unwrap_or_else(|| std::env::consts::OS.to_owned());
    Machine {
        adapter: of_adapter(|a| &a.name),
        api: of_adapter(|a| &a.api),
        driver: of_adapter(|a| &a.driver),
        cpu,
        cores: std::thread::available_parallelism().map_or(1, |n| u32::try_from(n.get()).unwrap_or(u32::MAX)),
        os,
        version: env!("CARGO_PKG_VERSION").to_owned(),
        commit: std::env::current_dir().ok().and_then(|folder| commit(&folder)).unwrap_or_default(),
    }
}

/// Returns the commit that is checked out in the clone of epsplat around `folder`; None elsewhere.
fn commit(folder: &Path) -> Option<String> {
    let read = |path: PathBuf| std::fs::read_to_string(path).ok().map(|text| text.trim().to_owned());
    let root = folder.ancestors().find(|folder| folder.join(".git").exists())?;
    let is_own =
        read(root.join("Cargo.toml")).is_some_and(|text| text.lines().any(|line| line == "name = \"epsplat\""));
    let git = Some(root.join(".git")).filter(|_| is_own)?;
    // In a linked worktree, `.git` is a file that names the worktree's Git folder. Branches lie in
    // the Git folder of the main worktree.
    let own = match read(git.clone()) {
        Some(text) => root.join(text.strip_prefix("gitdir: ")?),
        None => git,
    };
    let shared = read(own.join("commondir")).map_or_else(|| own.clone(), |common| own.join(common));
    let head = read(own.join("HEAD"))?;
    let Some(branch) = head.strip_prefix("ref: ") else { return Some(head) };
    read(shared.join(branch)).or_else(|| {
        let packed = read(shared.join("packed-refs"))?;
        let mut rows = packed.lines().filter_map(|line| line.split_once(' '));
        rows.find_map(|(hash, name)| (name == branch).then(|| hash.to_owned()))
    })
}

/// Returns the value of the first line `KEY separator VALUE` in a system file.
fn line_after(path: &str, key: &str, separator: char) -> Option<String> {
    let text = std::fs::read_to_string(path).ok()?;
    let mut values = text.lines().filter_map(|line| line.split_once(separator)).filter(|(k, _)| k.trim() == key);
    values.next().map(|(_, value)| value.trim().trim_matches('"').to_owned())
}

/// Formats `arguments`, of which the first is the program, as an epsplat command line.
///
/// Absolute paths become file names, as a local folder means nothing on another machine.
///
/// ```
/// let typed = ["/usr/bin/epsplat", "bench", "benches/kernels.toml", "--out", "/home/me/out"];
/// let command = epsplat::low_level::bench::machine::command(typed.map(str::to_owned));
/// assert_eq!(command, "epsplat bench benches/kernels.toml --out out");
/// ```
pub fn command(arguments: impl IntoIterator<Item = String>) -> String {
    let shown = |argument: &str| match argument.split_once('=') {
        Some((option, value)) if option.starts_with('-') => format!("{option}={}", name_of(value)),
        _ => name_of(argument),
    };
    let quoted = |word: String| if word.contains(' ') { format!("'{word}'") } else { word };
    let rest = arguments.into_iter().skip(1).map(|argument| quoted(shown(&argument)));
    std::iter::once("epsplat".to_owned()).chain(rest).collect::<Vec<_>>().join(" ")
}

/// Returns the file name of an absolute path; any other word unchanged.
fn name_of(word: &str) -> String {
    let path = Path::new(word);
    match path.file_name() {
        Some(name) if path.is_absolute() => name.to_string_lossy().into_owned(),
        _ => word.to_owned(),
    }
}

/// Formats `time` to the minute in UTC: `2025-01-31 23:59 UTC`.
pub fn date(time: SystemTime) -> String {
    let seconds = time.duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs());
    let (days, second) = (seconds / 86_400, seconds % 86_400);
    let (year, month, day) = civil(days);
    format!("{year:04}-{month:02}-{day:02} {:02}:{:02} UTC", second / 3600, second / 60 % 60)
}

/// Returns year, month and day in the Gregorian calendar for the days since 1970-01-01.
///
/// Years start in March, so that the leap day is the last day of its year (Hinnant,
/// "chrono-compatible low-level date algorithms").
fn civil(days: u64) -> (u64, u64, u64) {
    let days = days + 719_468;
    let (era, of_era) = (days / 146_097, days % 146_097);
    let year = (of_era - of_era / 1460 + of_era / 36_524 - of_era / 146_096) / 365;
    let of_year = of_era - (365 * year + year / 4 - year / 100);
    let month = (5 * of_year + 2) / 153;
    let day = of_year - (153 * month + 2) / 5 + 1;
    let (month, later) = if month < 10 { (month + 3, 0) } else { (month - 9, 1) };
    (400 * era + year + later, month, day)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn dates_are_those_of_the_calendar() {
        let at = |seconds| date(UNIX_EPOCH + Duration::from_secs(seconds));
        assert_eq!(at(0), "1970-01-01 00:00 UTC");
        assert_eq!(at(951_782_399), "2000-02-28 23:59 UTC");
        assert_eq!(at(951_782_400), "2000-02-29 00:00 UTC");
        assert_eq!(at(1_735_689_599), "2024-12-31 23:59 UTC");
        assert_eq!(at(4_107_542_400), "2100-03-01 00:00 UTC");
    }

    #[test]
    fn the_commit_is_that_of_the_clone() -> std::io::Result<()> {
        let folder = std::env::temp_dir().join(format!("epsplat-commit-{}", std::process::id()));
        let file = |name: &str, text: &str| {
            let path = folder.join(name);
            std::fs::create_dir_all(path.parent().unwrap_or(&folder))?;
            std::fs::write(path, text)
        };
        file(".git/HEAD", "ref: refs/heads/main\n")?;
        file(".git/packed-refs", "# pack-refs\n1234 refs/heads/main\n5678 refs/heads/other\n")?;
        file("benches/x.toml", "")?;
        assert_eq!(commit(&folder), None, "another program's clone");
        file("Cargo.toml", "[package]\nname = \"epsplat\"\n")?;
        assert_eq!(commit(&folder.join("benches")).as_deref(), Some("1234"));
        file(".git/refs/heads/main", "abcd\n")?;
        assert_eq!(commit(&folder).as_deref(), Some("abcd"));
        file(".git/HEAD", "9999\n")?;
        assert_eq!(commit(&folder).as_deref(), Some("9999"));
        std::fs::remove_dir_all(&folder)
    }

    #[test]
    fn a_command_holds_no_place_of_this_machine() {
        let of = |arguments: &[&str]| command(arguments.iter().map(|a| (*a).to_owned()));
        assert_eq!(of(&["./target/epsplat", "bench", "a.toml", "--out=/x/y z"]), "epsplat bench a.toml '--out=y z'");
        assert_eq!(of(&["e", "bench", "a b.toml"]), "epsplat bench 'a b.toml'");
    }
}
