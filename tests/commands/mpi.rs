//! Pictures that the processes of MPI jobs draw: equal bytes for any number of them, under every
//! launcher of the machine, and one sentence if a process fails.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use crate::common::command::{DATA, Folder, fails, succeeds, text};

/// The launchers of the machine: those of Open MPI and MPICH, by their own names if both are there.
fn launchers() -> Vec<&'static str> {
    let version = |name: &str| Command::new(name).arg("--version").output().map(|output| output.stdout);
    let named: Vec<_> = ["mpirun.openmpi", "mpirun.mpich"].into_iter().filter(|name| version(name).is_ok()).collect();
    let found = if named.is_empty() && version("mpirun").is_ok() { vec!["mpirun"] } else { named };
    assert!(
        !found.is_empty() || std::env::var_os("EPSPLAT_REQUIRE_MPI").is_none(),
        "there is no mpirun (on Debian and Ubuntu: openmpi-bin)"
    );
    found
}

/// Open MPI takes more processes than cores, a container's only user, and a machine without ssh. It
/// copies messages by shared memory alone, as containers may forbid to read another process.
const ENVIRONMENT: [(&str, &str); 6] = [
    ("OMPI_ALLOW_RUN_AS_ROOT", "1"),
    ("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1"),
    ("OMPI_MCA_rmaps_base_oversubscribe", "true"),
    ("OMPI_MCA_plm_rsh_agent", "sh"),
    ("OMPI_MCA_btl_vader_single_copy_mechanism", "none"),
    ("PRTE_MCA_rmaps_default_mapping_policy", ":oversubscribe"),
];

/// A launcher of `of` processes.
fn launched(launcher: &str, of: usize) -> Command {
    let mut command = Command::new(launcher);
    command.envs(ENVIRONMENT);
    command.args(["-n", &of.to_string()]).stdin(Stdio::null());
    command
}

/// A job of the program.
fn job(launcher: &str, of: usize, arguments: &[&str]) -> Command {
    let mut command = launched(launcher, of);
    command.arg(env!("CARGO_BIN_EXE_epsplat")).args(arguments);
    command
}

fn run(launcher: &str, of: usize, arguments: &[&str]) -> Output {
    job(launcher, of, arguments).output().unwrap()
}

/// The sentences of epsplat among what a launcher prints.
fn errors(output: &Output) -> Vec<String> {
    let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
    stderr.lines().filter(|line| line.starts_with("error: ")).map(str::to_owned).collect()
}

#[test]
fn any_number_of_processes_makes_the_bytes_of_one() {
    let bunny = format!("{DATA}/bunny.obj");
    let autzen = format!("{DATA}/autzen.laz");
    let copc = format!("{DATA}/simple.copc.laz");
    let pictures: [(&[&str], &[usize]); 9] = [
        // All maps that can be summed.
        (&[&autzen, "--size", "150x90", "--aov", "depth,normal,height,weight,count"], &[2, 7]),
        // A mesh, drawn as triangles, with points.
        (&[&autzen, "--triangles", &bunny, "--size", "100x80", "--samples", "4", "--aov", "depth"], &[3]),
        (&[&bunny, "--mesh", "surfels", "--size", "90x90", "--shading", "phong", "--edl"], &[2]),
        // Nodes of the levels of detail that the view reads.
        (&[&copc, "--lod", "4px", "--size", "80x60", "--aov", "depth"], &[2]),
        (&[&autzen, &bunny, "--size", "64x48", "--projection", "fisheye", "--eye", "0,0,300"], &[3]),
        // Surfaces behind each other, and the nearest fragments alone.
        (&[&autzen, "--size", "60x50", "--composite", "layers:3", "--opacity", "0.6", "--aov", "layers,depth"], &[2]),
        (&[&autzen, "--triangles", &bunny, "--size", "60x50", "--composite", "sorted", "--opacity", "0.5"], &[3]),
        (&[&autzen, "--size", "60x50", "--composite", "moments", "--opacity", "0.3"], &[2]),
        (&[&autzen, "--size", "60x50", "--blend", "nearest", "--shading", "unlit"], &[3]),
    ];
    for (number, (arguments, counts)) in pictures.iter().enumerate() {
        let folder = Folder::new();
        let alone = folder.path("alone.exr");
        succeeds(&[&["render"], *arguments, &["-o", text(&alone)]].concat());
        let alone = std::fs::read(alone).unwrap();
        for launcher in launchers() {
            for of in *counts {
                let path = folder.path("together.exr");
                let output = run(launcher, *of, &[&["render"], *arguments, &["-o", text(&path)]].concat());
                let stderr = String::from_utf8_lossy(&output.stderr);
                assert!(output.status.success(), "{launcher} {of} {number}: {stderr}");
                assert!(std::fs::read(&path).unwrap() == alone, "{launcher} {of} {number}: other bytes");
                // Process 0 speaks, and the others are silent.
                assert_eq!(stderr.lines().filter(|line| line.starts_with("view: ")).count(), 1, "{stderr}");
                assert!(stderr.contains(&format!("{of} processes")), "{stderr}");
            }
        }
    }
}

/// From a file of `epsplat lod`, and from surfels in binary PLY, each process reads only its share,
/// and the bytes are those of one.
#[test]
fn processes_read_their_shares() {
    let folder = Folder::new();
    let [surfels, tree, alone] = ["surfels.ply", "tree.ply", "alone.exr"].map(|name| folder.path(name));
    succeeds(&["generate", "sphere", "--count", "300000", "-o", text(&surfels)]);
    succeeds(&["lod", text(&surfels), "-o", text(&tree)]);
    let json = folder.path("json");
    let report = |path: &Path| serde_json::from_slice::<serde_json::Value>(&std::fs::read(path).unwrap()).unwrap();
    // A view with a position, the default view, and others that are framed.
    let placed: &[&str] = &["--eye", "2,1,3", "--target", "0,0,0", "--aov", "depth,normal,count"];
    let pictures: [(&Path, usize, &[&str]); 6] = [
        (&tree, 3, placed),
        (&tree, 2, &[]),
        (&tree, 3, &["--from", "left", "--ortho", "fit"]),
        (&tree, 2, &["--composite", "layers:2", "--opacity", "0.7"]),
        (&surfels, 2, placed),
        (&surfels, 3, &[]),
    ];
    for (input, of, view) in pictures {
        let arguments = [&["render", text(input), "--size", "100x80"], view].concat();
        succeeds(&[&arguments[..], &["-o", text(&alone)]].concat());
        for launcher in launchers() {
            let together = folder.path("together.exr");
            let output = run(launcher, of, &[&arguments[..], &["-o", text(&together), "--json", text(&json)]].concat());
            assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
            assert!(std::fs::read(&together).unwrap() == std::fs::read(&alone).unwrap(), "{launcher} {of} {view:?}");
            let report = report(&json);
            assert_eq!(report["surfels"].as_u64(), Some(300_000));
            let read = |rank: &serde_json::Value| rank["surfels_read"].as_u64().unwrap();
            let read: Vec<u64> = report["ranks"].as_array().unwrap().iter().map(read).collect();
            // A share is 32 pieces of the file.
            let alike = read.iter().all(|own| own.abs_diff(read[0]) <= 32);
            assert!(read.iter().sum::<u64>() == 300_000 && alike, "{view:?} {read:?}");
        }
    }
}

#[test]
fn the_report_tells_of_each_process() {
    for launcher in launchers() {
        let folder = Folder::new();
        let (image, json) = (folder.path("a.png"), folder.path("a.json"));
        let scene = format!("{DATA}/autzen.laz");
        let arguments = ["render", &scene, "--size", "120x80", "-o", text(&image), "--json", text(&json)];
        let output = run(launcher, 2, &arguments);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let report: serde_json::Value = serde_json::from_slice(&std::fs::read(json).unwrap()).unwrap();
        let ranks = report["ranks"].as_array().unwrap();
        assert_eq!(ranks.len(), 2);
        let sum = |name: &str| ranks.iter().map(|rank| rank[name].as_u64().unwrap()).sum::<u64>();
        assert_eq!(report["splats_drawn"].as_u64(), Some(sum("splats_drawn")));
        assert!(sum("sums_bytes") > 0 && sum("nearest_bytes") > 0 && sum("picture_bytes") > 0);
        assert!(ranks.iter().all(|rank| rank["total_ms"].as_f64() > Some(0.0) && rank["peak_bytes"].is_u64()));
        assert!(report["mpi"].as_str().unwrap().contains("MPI"), "{}", report["mpi"]);
        // The same picture by one process has the same hash, and a report without processes.
        let alone = folder.path("alone.json");
        succeeds(&["render", &scene, "--size", "120x80", "-o", text(&image), "--json", text(&alone)]);
        let alone: serde_json::Value = serde_json::from_slice(&std::fs::read(alone).unwrap()).unwrap();
        assert_eq!(alone["bits"], report["bits"]);
        assert!(alone.get("ranks").is_none());
    }
}

/// A process draws the next view when it is done with the last, however long each takes.
#[test]
fn views_are_dealt_as_processes_ask_for_them() {
    let scene = format!("{DATA}/bunny.obj");
    for launcher in launchers() {
        let folder = Folder::new();
        let (cameras, dealt, json) = (folder.path("cameras.json"), folder.path("dealt"), folder.path("dealt.json"));
        // The first view takes as long as many others.
        let camera = |number: usize| {
            let size = if number == 0 { 3000 } else { 16 };
            let look = r#""eye": [0.1, 0.2, 0.4], "target": [0.0, 0.1, 0.0], "fov": 40"#;
            format!(r#"{{ "width": {size}, "height": {size}, {look} }}"#)
        };
        std::fs::write(&cameras, format!("[{}]", [0, 1, 2, 3, 4, 5, 6, 7, 8].map(camera).join(","))).unwrap();
        let arguments = ["render", &scene, "--cameras", text(&cameras), "-o", text(&dealt), "--json", text(&json)];
        let output = run(launcher, 2, &arguments);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let report: serde_json::Value = serde_json::from_slice(&std::fs::read(json).unwrap()).unwrap();
        let views = report["views"].as_array().unwrap();
        let busy = views[0]["rank"].as_u64().unwrap();
        let others = views[1..].iter().filter(|view| view["rank"].as_u64() != Some(busy)).count();
        // Views that are dealt in turn would be four and five.
        assert!(views.len() == 9 && others >= 6, "{others} of 8 by the process that was free");
    }
}

#[test]
fn views_are_dealt_to_processes() {
    let scene = format!("{DATA}/bunny.obj");
    for launcher in launchers() {
        let folder = Folder::new();
        let [alone, dealt] = ["alone", "dealt"].map(|name| folder.path(name));
        let json = folder.path("dealt.json");
        let arguments = |output| ["render", &scene, "--size", "60x50", "--turntable", "5", "-o", text(output)];
        succeeds(&arguments(&alone));
        let output = run(launcher, 3, &[&arguments(&dealt)[..], &["--json", text(&json)]].concat());
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        for step in 0..5 {
            let [one, other] =
                [&alone, &dealt].map(|folder| std::fs::read(folder.join(format!("{step:04}.png"))).unwrap());
            assert!(one == other, "step {step}");
        }
        let report: serde_json::Value = serde_json::from_slice(&std::fs::read(json).unwrap()).unwrap();
        let views = report["views"].as_array().unwrap();
        let files: Vec<_> = views.iter().map(|view| view["file"].as_str().unwrap().to_owned()).collect();
        let expected: Vec<_> = (0..5).map(|step| text(&dealt.join(format!("{step:04}.png"))).to_owned()).collect();
        assert_eq!(files, expected);
        assert!(views.iter().all(|view| view["rank"].as_u64().unwrap() < 3));
    }
}

/// Every failure ends all processes soon, with one sentence, exit code 1 or 2, and no picture.
#[test]
fn a_process_that_fails_ends_the_job_with_one_sentence() {
    let autzen = format!("{DATA}/autzen.laz");
    for launcher in launchers() {
        let folder = Folder::new();
        let image = folder.path("a.png");
        let output = text(&image);
        // A file is missing on one of the processes' machines: its path depends on the process.
        let there = folder.path("0");
        std::fs::create_dir(&there).unwrap();
        std::fs::copy(&autzen, there.join("scan.laz")).unwrap();
        let script = format!(
            "exec '{}' render '{}'/${{OMPI_COMM_WORLD_RANK:-$PMI_RANK}}/scan.laz -o '{output}'",
            env!("CARGO_BIN_EXE_epsplat"),
            text(&there).trim_end_matches("/0"),
        );
        let start = Instant::now();
        let missing = launched(launcher, 3).args(["sh", "-c", &script]).output().unwrap();
        assert_eq!(errors(&missing).len(), 1, "{}", String::from_utf8_lossy(&missing.stderr));
        assert!(errors(&missing)[0].contains("process 1: cannot read"), "{:?}", errors(&missing));
        assert_eq!(missing.status.code(), Some(1));
        assert!(start.elapsed() < Duration::from_secs(10) && !image.exists());

        let cases: [(&[&str], i32, &str); 5] = [
            (&[&autzen, &autzen, "--separate"], 2, "--separate"),
            (&[&autzen, "--lod", "4px"], 2, "--lod"),
            (&[&autzen, "--lod", "4"], 2, "--lod"),
            (&[&autzen, "--pixel-size", "5"], 2, "--pixel-size"),
            (&[&autzen, "--backend", "reference"], 2, "--backend"),
        ];
        for (arguments, code, word) in cases {
            let image = folder.path("a.tif");
            let output = run(launcher, 2, &[&["render", "-o", text(&image)], arguments].concat());
            let said = errors(&output);
            assert!(said.len() == 1 && said[0].contains(word), "{arguments:?}: {said:?}");
            assert_eq!(output.status.code(), Some(code), "{arguments:?}");
            assert!(!image.exists());
        }
        // The folder of the output does not exist: only process 0 writes.
        let nowhere = folder.path("nowhere/a.png");
        let output = run(launcher, 2, &["render", &autzen, "-o", text(&nowhere)]);
        assert_eq!((errors(&output).len(), output.status.code()), (1, Some(1)), "{:?}", errors(&output));
    }
}

/// A process that is killed ends the job: no process stays, and there is no picture.
#[cfg(target_os = "linux")]
#[test]
fn a_process_that_is_killed_ends_the_job() {
    let scene = format!("{DATA}/autzen.laz");
    for launcher in launchers() {
        let folder = Folder::new();
        let image = folder.path("killed.png");
        // Long enough to be killed in the middle.
        let arguments = ["render", &scene, "--size", "6000x6000", "--samples", "8", "-o", text(&image)];
        let mut command = job(launcher, 2, &arguments);
        let mut running = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        let drawing = || processes_with(text(&image)).into_iter().filter(|id| *id != running.id()).collect::<Vec<_>>();
        let start = Instant::now();
        while drawing().len() < 2 && start.elapsed() < Duration::from_secs(20) {
            std::thread::sleep(Duration::from_millis(50));
        }
        std::thread::sleep(Duration::from_secs(1));
        let killed = drawing();
        assert!(killed.len() >= 2, "{killed:?}");
        Command::new("kill").args(["-9", &killed[killed.len() - 1].to_string()]).status().unwrap();
        let start = Instant::now();
        let status = running.wait().unwrap();
        assert!(!status.success() && start.elapsed() < Duration::from_secs(10), "{status}");
        while !processes_with(text(&image)).is_empty() && start.elapsed() < Duration::from_secs(10) {
            std::thread::sleep(Duration::from_millis(50));
        }
        assert!(processes_with(text(&image)).is_empty(), "a process stayed");
        assert_eq!(folder.names(), [""; 0], "a file stayed");
    }
}

/// The processes of epsplat that have this argument.
#[cfg(target_os = "linux")]
fn processes_with(argument: &str) -> Vec<u32> {
    let entries = std::fs::read_dir("/proc").unwrap().filter_map(Result::ok);
    let ids = entries.filter_map(|entry| entry.file_name().to_str()?.parse::<u32>().ok());
    let is_drawing = |id: &u32| {
        let line = std::fs::read(format!("/proc/{id}/cmdline")).unwrap_or_default();
        let mut words = line.split(|byte| *byte == 0);
        let program = words.next().unwrap_or_default();
        program.ends_with(b"epsplat") && words.any(|word| word == argument.as_bytes())
    };
    ids.filter(is_drawing).collect()
}

/// The lines of the guide.
#[test]
fn the_job_of_the_guide_makes_the_bytes_of_one_process() {
    if launchers().is_empty() {
        return;
    }
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let guide = std::fs::read_to_string(root.join("src/guide/machines.md")).unwrap();
    let mut blocks = guide.split("```bash\n").skip(1).map(|block| block.split("```").next().unwrap());
    let script = blocks.find(|block| block.contains("mpirun")).unwrap();
    let folder = Folder::new();
    std::os::unix::fs::symlink(root.join("data"), folder.path("data")).unwrap();
    std::os::unix::fs::symlink(env!("CARGO_BIN_EXE_epsplat"), folder.path("epsplat")).unwrap();
    let own = folder.path("data").parent().unwrap().to_owned();
    let path = format!("{}:{}", own.display(), std::env::var("PATH").unwrap());
    let mut shell = Command::new("sh");
    let output = shell.args(["-e", "-c", script]).current_dir(&own).envs(ENVIRONMENT).env("PATH", path).output();
    let output = output.unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(folder.path("together.exr").exists());
}

/// The job of Slurm of the guide, with a launcher in place of srun.
#[test]
fn the_job_of_slurm_of_the_guide_draws() {
    use std::os::unix::fs::PermissionsExt;
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let guide = std::fs::read_to_string(root.join("src/guide/machines.md")).unwrap();
    let mut blocks = guide.split("```text\n").skip(1).map(|block| block.split("```").next().unwrap());
    let script = blocks.find(|block| block.contains("srun")).unwrap();
    for launcher in launchers() {
        let folder = Folder::new();
        succeeds(&["generate", "torus", "--count", "3000", "-o", text(&folder.path("scan.ply"))]);
        let shim = folder.path("srun");
        let skipped = "while [ \"${1#--}\" != \"$1\" ]; do shift; done";
        std::fs::write(&shim, format!("#!/bin/sh\n{skipped}\nexec {launcher} -n 2 \"$@\"\n")).unwrap();
        std::fs::set_permissions(&shim, std::fs::Permissions::from_mode(0o755)).unwrap();
        std::os::unix::fs::symlink(env!("CARGO_BIN_EXE_epsplat"), folder.path("epsplat")).unwrap();
        let own = shim.parent().unwrap();
        let path = format!("{}:{}", own.display(), std::env::var("PATH").unwrap());
        let mut shell = Command::new("sh");
        let output = shell.args(["-e", "-c", script]).current_dir(own).envs(ENVIRONMENT).env("PATH", path).output();
        let output = output.unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let report: serde_json::Value =
            serde_json::from_slice(&std::fs::read(folder.path("scan.json")).unwrap()).unwrap();
        assert!(report["ranks"].as_array().unwrap().len() == 2 && folder.path("scan.png").exists());
    }
}

/// Without a library, a job says so; without a job, none is needed.
#[test]
fn a_job_needs_a_library_and_a_lone_process_none() {
    let folder = Folder::new();
    let (scene, image) = (format!("{DATA}/bunny.obj"), folder.path("a.png"));
    let run = |size: &str| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_epsplat"));
        command.env("OMPI_COMM_WORLD_SIZE", size).env("EPSPLAT_MPI", "/nowhere/libmpi.so");
        command.args(["render", &scene, "--size", "32x32", "-o", text(&image)]).output().unwrap()
    };
    let output = run("2");
    assert_eq!(output.status.code(), Some(2));
    let said = errors(&output);
    assert!(said.len() == 1 && said[0].contains("EPSPLAT_MPI=") && !image.exists(), "{said:?}");
    assert!(run("1").status.success() && image.exists());
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("data/README.md");
    let mut command = Command::new(env!("CARGO_BIN_EXE_epsplat"));
    command.env("OMPI_COMM_WORLD_SIZE", "2").env("EPSPLAT_MPI", path);
    let output = command.args(["render", &scene, "-o", text(&image)]).output().unwrap();
    assert_eq!(errors(&output).len(), 1, "a file that is no library");
    // Control: other commands take no part in a job.
    fails(&["info", "nowhere.ply"], 1, &["nowhere.ply"]);
}
