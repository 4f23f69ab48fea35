//! However a run ends, no temporary file remains, and an output is either the old file or the
//! complete new one.

use super::common::Random;
use super::common::command::{DATA, Folder, ply, text};
use std::collections::BTreeMap;
use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

const SIGNALS: [(&str, i32); 3] = [("INT", 130), ("TERM", 143), ("HUP", 129)];

/// Starts a run with default signal handling: background jobs of a shell would inherit an ignored
/// SIGINT.
fn start(arguments: &[String]) -> Child {
    let mut command = Command::new("env");
    command
        .args(["--default-signal=INT,TERM,HUP", env!("CARGO_BIN_EXE_epsplat")])
        .args(arguments)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap()
}

fn signal(child: &Child, name: &str) {
    // A process that has already ended cannot receive a signal; that is no failure.
    let kill = format!("kill -s {name} {} 2>/dev/null", child.id());
    Command::new("sh").args(["-c", &kill]).status().unwrap();
}

/// Returns the exit code as a shell reports it: in its first milliseconds a run has no signal
/// handler yet, so the signal itself may end the run.
fn code(status: ExitStatus) -> i32 {
    status.code().or_else(|| Some(128 + status.signal()?)).unwrap()
}

/// All files in a folder and its subfolders, including temporary ones.
fn files(folder: &Path) -> Vec<PathBuf> {
    let Ok(entries) = std::fs::read_dir(folder) else { return Vec::new() };
    let paths = entries.filter_map(|entry| Some(entry.ok()?.path()));
    paths.flat_map(|path| if path.is_dir() { files(&path) } else { vec![path] }).collect()
}

fn is_temporary(path: &Path) -> bool {
    path.file_name().is_some_and(|name| name.to_str().unwrap().starts_with(".epsplat-"))
}

/// Waits until an output is being written.
fn wait_for_temporary(folder: &Path, child: &mut Child) {
    let start = Instant::now();
    while !files(folder).iter().any(|path| is_temporary(path)) {
        assert!(start.elapsed() < Duration::from_secs(60) && child.try_wait().unwrap().is_none(), "it never wrote");
    }
    // A temporary file is created first to test the folder, then again for the data; this waits for
    // the second.
    std::thread::sleep(Duration::from_millis(30));
}

fn generate(output: &Path, count: u32) -> Vec<String> {
    ["generate", "sphere", "--count", &count.to_string(), "-o", text(output)].map(str::to_owned).to_vec()
}

#[test]
fn a_signal_while_writing_takes_the_unfinished_file_away() {
    let folder = Folder::new();
    let output = folder.file("out.ply", "old");
    for (name, expected) in SIGNALS {
        let mut child = start(&generate(&output, 20_000_000));
        wait_for_temporary(&folder.path(""), &mut child);
        assert!(files(&folder.path("")).iter().any(|path| is_temporary(path)));
        signal(&child, name);
        assert_eq!(child.wait().unwrap().code(), Some(expected), "{name}");
        assert_eq!(folder.names(), ["out.ply"], "{name}");
        assert_eq!(std::fs::read(&output).unwrap(), b"old");
    }
}

/// A run that ignores SIGHUP, as under `nohup`, is not ended by it.
#[test]
fn a_signal_that_is_ignored_stays_ignored() {
    let folder = Folder::new();
    let output = folder.path("out.ply");
    let line = generate(&output, 1_000_000).join(" ");
    let script = format!("trap '' HUP; exec {} {line}", env!("CARGO_BIN_EXE_epsplat"));
    let mut child = Command::new("sh").args(["-c", &script]).stderr(Stdio::null()).spawn().unwrap();
    wait_for_temporary(&folder.path(""), &mut child);
    signal(&child, "HUP");
    assert_eq!(child.wait().unwrap().code(), Some(0));
    assert_eq!(folder.names(), ["out.ply"]);
    assert!(std::fs::metadata(&output).unwrap().len() > 20_000_000);
}

/// Commands with different kinds of output, whose outputs are in `out`.
fn commands(inputs: &Folder, out: &Path) -> Vec<Vec<String>> {
    let bunny = format!("{DATA}/bunny.obj");
    let of = |line: String| line.split(' ').map(str::to_owned).collect::<Vec<_>>();
    let (out, cloud, study) = (out.display(), inputs.path("c.ply"), inputs.path("study.toml"));
    let (cloud, study) = (cloud.display(), study.display());
    vec![
        of(format!("generate torus --count 400000 -o {out}/torus.ply")),
        of(format!("surfels {cloud} -o {out}/surfels.ply")),
        of(format!("sample {bunny} --count 500 -o {out}/sample.ply")),
        of(format!("simplify {cloud} -o {out}/simple.ply --json {out}/simple.json")),
        of(format!("render {bunny} -o {out}/one.exr --backend reference --size 200x200 --json {out}/one.json")),
        of(format!(
            "render {bunny} -o {out}/views --cameras {DATA}/cameras/transforms.json --scale 0.2 --backend reference \
             --json {out}/views.json"
        )),
        of(format!("bench {study} --out {out}/report")),
    ]
}

/// The contents of a folder. Files that contain times, which differ between runs, count only by
/// their last byte.
fn bytes(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let of_times = |path: &Path| path.extension().is_some_and(|e| ["json", "html", "csv"].iter().any(|x| e == *x));
    let read = |path: PathBuf| {
        let bytes = std::fs::read(&path).unwrap();
        // In files with times, the final line feed shows that they are complete.
        let bytes = if of_times(&path) { bytes.last().map(|last| vec![*last]).unwrap_or_default() } else { bytes };
        (path, bytes)
    };
    files(folder).into_iter().map(read).collect()
}

/// Sends `EPSPLAT_KILLS` signals (default 30).
#[test]
fn a_signal_at_any_time_leaves_old_or_whole_files() {
    let kills = std::env::var("EPSPLAT_KILLS").map_or(30, |kills| kills.parse().unwrap());
    let (inputs, outputs) = (Folder::new(), Folder::new());
    let rows: String = (0..6400).map(|i| format!("{} {} {}\n", i % 80, i / 80, (i % 7) as f64 * 0.01)).collect();
    inputs.file("c.ply", ply("x y z", 6400, &rows));
    let study = "name = \"n\"\nabout = \"a\"\nsize = [48, 48]\nruns = 2\n[[scene]]\nname = \"s\"\nshape = \"sphere\"\n\
                 count = 3000\n[[config]]\nname = \"c\"\nbackend = \"reference\"\n";
    inputs.file("study.toml", study);
    let out = outputs.path("out");
    let commands = commands(&inputs, &out);
    // The outputs and duration of each command when it is not interrupted.
    let mut made = Vec::new();
    for command in &commands {
        let _ = std::fs::remove_dir_all(&out);
        std::fs::create_dir(&out).unwrap();
        let begun = Instant::now();
        assert!(start(command).wait().unwrap().success(), "{command:?}");
        made.push((bytes(&out), begun.elapsed()));
    }
    let mut random = Random(u64::from(std::process::id()));
    let (mut ended, mut writing) = (0, 0);
    for kill in 0..kills {
        let which = kill % commands.len();
        let (whole, time) = &made[which];
        let _ = std::fs::remove_dir_all(&out);
        std::fs::create_dir(&out).unwrap();
        let old = random.bits().is_multiple_of(2);
        for path in whole.keys().filter(|_| old) {
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, "old").unwrap();
        }
        let (name, expected) = SIGNALS[random.bits() as usize % 3];
        let mut child = start(&commands[which]);
        std::thread::sleep(time.mul_f64(random.between(0.0, 1.1)));
        writing += usize::from(files(&out).iter().any(|path| is_temporary(path)));
        signal(&child, name);
        let code = code(child.wait().unwrap());
        assert!(code == expected || code == 0, "{:?}: {code} after SIG{name}", commands[which]);
        ended += usize::from(code != 0);
        for (path, bytes) in bytes(&out) {
            let as_it_was = old && std::fs::read(&path).unwrap() == b"old";
            assert!(
                as_it_was || whole.get(&path) == Some(&bytes),
                "SIG{name} left {}: {} bytes",
                path.display(),
                bytes.len()
            );
        }
        let left = files(&out);
        assert!(!left.iter().any(|path| is_temporary(path)), "SIG{name} left {left:?}");
        assert!(!old || left.len() == whole.len(), "SIG{name} took away {left:?}");
    }
    eprintln!("{kills} signals: {ended} ended a run, {writing} while a file was being written");
    assert!(ended * 3 > kills, "only {ended} of {kills} runs were ended");
}
