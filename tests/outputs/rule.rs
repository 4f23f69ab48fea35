//! Outputs overwrite neither inputs nor each other, under any name.

use super::common::Random;
use super::common::command::{DATA, Folder, epsplat, fails, ply, succeeds, text};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Placeholder for the output in a command line.
const OUT: &str = "OUT";

/// A folder with every kind of input.
fn inputs() -> Folder {
    let folder = Folder::new();
    let data = |name: &str| std::fs::read(Path::new(DATA).join(name)).unwrap();
    folder.file("cube.obj", [b"mtllib cube.mtl\nusemtl x\n", &data("cube.obj")[..]].concat());
    folder.file("cube.mtl", "newmtl x\nmap_Kd cube.png\n");
    folder.file("cube.png", data("cube.png"));
    let rows: String = (0..36).map(|i| format!("{} {} 0 0 0 1 1\n", i % 6, i / 6)).collect();
    folder.file("s.ply", ply("x y z nx ny nz radius", 36, &rows));
    succeeds(&["sample", text(&folder.path("cube.obj")), "-o", text(&folder.path("painted.ply")), "--count", "30"]);
    for name in ["a.png", "b.png"] {
        let (cloud, image) = (folder.path("s.ply"), folder.path(name));
        succeeds(&["render", text(&cloud), "--backend", "reference", "--size", "8x8", "-o", text(&image)]);
    }
    std::fs::copy(folder.path("cube.png"), folder.path("t.png")).unwrap();
    folder.file("camera.json", r#"{"width": 8, "height": 8, "eye": [0,0,5], "target": [0,0,0]}"#);
    let frame = r#"{"file_path": "p", "transform_matrix": [[1,0,0,0],[0,1,0,0],[0,0,1,5],[0,0,0,1]]}"#;
    folder.file("transforms.json", format!(r#"{{"w": 8, "h": 8, "fl_x": 9, "frames": [{frame}]}}"#));
    std::fs::create_dir(folder.path("colmap")).unwrap();
    folder.file("colmap/cameras.txt", "1 PINHOLE 8 8 9 9 4 4\n");
    folder.file("colmap/images.txt", "1 1 0 0 0 0 0 5 1 p.png\n\n");
    folder.file(
        "study.toml",
        "name = \"n\"\nabout = \"a\"\nsize = [8, 8]\nruns = 1\n[[scene]]\nname = \"s\"\nfile = \"s.ply\"\n\
         [[config]]\nname = \"c\"\nbackend = \"reference\"\n",
    );
    folder
}

/// The contents of all files in a folder and its subfolders.
fn contents(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    entries
        .flat_map(|path| match path.is_dir() {
            true => contents(&path).into_iter().collect::<Vec<_>>(),
            false => vec![(path.clone(), std::fs::read(&path).unwrap())],
        })
        .collect()
}

/// Every command with each of its outputs, and the inputs that this output must not overwrite.
const COMMANDS: &[(&str, &[&str])] = &[
    ("info s.ply --json OUT", &["s.ply"]),
    ("info cube.obj --json OUT", &["cube.obj", "cube.mtl", "cube.png"]),
    ("compare a.png b.png --json OUT", &["a.png", "b.png"]),
    ("coverage s.ply --mesh cube.obj --views 1 --side 8 --json OUT", &["s.ply", "cube.obj", "cube.mtl", "cube.png"]),
    ("simplify s.ply -o made.ply --json OUT", &["s.ply"]),
    ("simplify s.ply -o OUT", &["s.ply"]),
    ("sample cube.obj --count 20 -o OUT", &["cube.obj", "cube.mtl", "cube.png"]),
    ("sample cube.obj --count 20 --texture t.png -o OUT", &["t.png"]),
    ("surfels s.ply painted.ply -o OUT", &["s.ply", "painted.ply"]),
    ("render s.ply cube.obj --backend reference --size 8x8 -o OUT", &["s.ply", "cube.obj", "cube.png"]),
    ("render painted.ply --texture t.png --backend reference --size 8x8 -o OUT", &["painted.ply", "t.png"]),
    ("render s.ply --camera camera.json --backend reference -o made.png --json OUT", &["s.ply", "camera.json"]),
    ("render s.ply --cameras transforms.json --backend reference -o views --json OUT", &["s.ply", "transforms.json"]),
    ("visible s.ply --cameras transforms.json --backend reference -o OUT", &["s.ply", "transforms.json"]),
    (
        "visible s.ply --cameras colmap --backend reference -o made.ply --json OUT",
        &["s.ply", "colmap/cameras.txt", "colmap/images.txt"],
    ),
    (
        "render s.ply --cameras colmap --backend reference -o views --json OUT",
        &["colmap/cameras.txt", "colmap/images.txt"],
    ),
];

/// The arguments of a command, with its files in `folder` and its output at `output`.
fn line(command: &str, folder: &Folder, output: &Path) -> Vec<String> {
    let there = |word: &str| folder.path(word).exists() || word.starts_with("made") || word == "views";
    let word = |word: &str| match word {
        OUT => text(output).to_owned(),
        "render" | "compare" => word.to_owned(),
        word if there(word) => text(&folder.path(word)).to_owned(),
        word => word.to_owned(),
    };
    command.split(' ').map(word).collect()
}

fn run(line: &[String]) -> std::process::Output {
    epsplat(&line.iter().map(String::as_str).collect::<Vec<_>>())
}

#[cfg(unix)]
#[test]
fn no_output_overwrites_an_input_by_any_name() {
    let (folder, others) = (inputs(), Folder::new());
    let before = contents(&folder.path(""));
    let refuses = |command: &str, output: &Path| {
        let line = line(command, &folder, output);
        fails(&line.iter().map(String::as_str).collect::<Vec<_>>(), 2, &["would overwrite the input"]);
        assert_eq!(contents(&folder.path("")), before, "{line:?}");
    };
    for (command, read) in COMMANDS {
        let extension = match command.split(' ').next() {
            _ if command.contains("--json") => "json",
            Some("render") => "png",
            _ => "ply",
        };
        for input in *read {
            let input = folder.path(input);
            if extension == "json" || input.extension().is_some_and(|own| own == extension) {
                refuses(command, &input);
                refuses(command, &folder.path("colmap/..").join(input.strip_prefix(folder.path("")).unwrap()));
            }
            let alias = others.path(&format!("alias.{extension}"));
            std::os::unix::fs::symlink(&input, &alias).unwrap();
            refuses(command, &alias);
            std::fs::remove_file(&alias).unwrap();
            std::fs::hard_link(&input, &alias).unwrap();
            refuses(command, &alias);
            std::fs::remove_file(&alias).unwrap();
        }
        // Control: with another output name the command runs, and changes no input.
        let line = line(command, &folder, &others.path(&format!("new.{extension}")));
        let output = run(&line);
        assert!(output.status.success(), "{line:?}: {}", String::from_utf8_lossy(&output.stderr));
        let mut after = contents(&folder.path(""));
        after.retain(|path, _| before.contains_key(path));
        assert_eq!(after, before, "{line:?}");
        for made in ["made.ply", "made.png"] {
            let _ = std::fs::remove_file(folder.path(made));
        }
        let _ = std::fs::remove_dir_all(folder.path("views"));
        others.names().iter().for_each(|name| std::fs::remove_file(others.path(name)).unwrap());
    }
    // A report has three files with fixed names.
    let study = folder.path("study.toml");
    for (name, input) in [("results.csv", "s.ply"), ("results.json", "study.toml")] {
        let report = others.path("report");
        std::fs::create_dir(&report).unwrap();
        std::fs::hard_link(folder.path(input), report.join(name)).unwrap();
        fails(&["bench", text(&study), "--out", text(&report)], 2, &["would overwrite the input", name]);
        assert_eq!(contents(&folder.path("")), before);
        std::fs::remove_dir_all(&report).unwrap();
    }
    succeeds(&["bench", text(&study), "--out", text(&others.path("report"))]);
    assert_eq!(contents(&folder.path("")), before);
}

#[cfg(unix)]
#[test]
fn two_outputs_are_two_files() {
    let folder = inputs();
    let (made, linked) = (folder.path("made.ply"), folder.path("linked.ply"));
    let simplify =
        |json: &str| ["simplify", text(&folder.path("s.ply")), "-o", text(&made), "--json", json].map(str::to_owned);
    let refused = |json: &Path| {
        let line = simplify(text(json));
        fails(&line.each_ref().map(String::as_str), 2, &["the same file", "overwrite"]);
    };
    // The first round has no output file yet, the second has one.
    std::os::unix::fs::symlink("made.ply", &linked).unwrap();
    for _ in 0..2 {
        [&made, &folder.path("colmap/../made.ply"), &linked].into_iter().for_each(|json| refused(json));
        std::fs::write(&made, "old").unwrap();
    }
    let hard = folder.path("hard.json");
    std::fs::hard_link(&made, &hard).unwrap();
    refused(&hard);
    assert_eq!(std::fs::read(&made).unwrap(), b"old");
    let (cloud, cameras, views) = (folder.path("s.ply"), folder.path("transforms.json"), folder.path("views"));
    let json = views.join("p.png");
    let render = ["render", text(&cloud), "--cameras", text(&cameras), "-o", text(&views), "--json", text(&json)];
    fails(&render, 2, &["the same file"]);
    // Devices and pipes are written to directly, even for two outputs of one command.
    // The link protects the machine: a faulty program would replace the link, not /dev/stdout.
    let stdout = folder.path("stdout");
    std::os::unix::fs::symlink("/dev/stdout", &stdout).unwrap();
    for json in ["-", "/dev/null", text(&stdout)] {
        let output = run(&simplify(json));
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        assert_eq!(output.stdout.is_empty(), json == "/dev/null", "{json}");
    }
    let null = folder.path("null.ply");
    std::os::unix::fs::symlink("/dev/null", &null).unwrap();
    succeeds(&["simplify", text(&folder.path("s.ply")), "-o", text(&null), "--json", "/dev/null"]);
    assert!(null.is_symlink() && std::fs::metadata("/dev/null").unwrap().len() == 0);
}

/// Redirected standard output may be a file that other programs write to, before and after the run.
#[cfg(unix)]
#[test]
fn stdout_by_name_is_written_to_and_not_replaced() {
    let folder = inputs();
    let script = "ln -s /dev/stdout out; (echo first; $BIN info s.ply --json out; echo last) >> log";
    let run = |script: &str| {
        let mut shell = std::process::Command::new("sh");
        shell.args(["-c", script]).env("BIN", env!("CARGO_BIN_EXE_epsplat")).current_dir(folder.path(""));
        shell.output().unwrap()
    };
    assert!(run(script).status.success());
    let log = std::fs::read_to_string(folder.path("log")).unwrap();
    assert!(log.starts_with("first\n{") && log.ends_with("}\nlast\n") && log.contains("\"points\": 36"), "{log}");
    // A file read through standard input is not overwritten either.
    let script = "$BIN compare a.png /dev/stdin --json b.png < b.png";
    let output = run(script);
    assert_eq!(output.status.code(), Some(2), "{output:?}");
}

/// With random inputs and outputs, a run never changes a file that it reads.
#[cfg(unix)]
#[test]
fn no_choice_of_names_changes_an_input() {
    let folder = inputs();
    let mut random = Random(3);
    let names = ["s.ply", "painted.ply", "cube.obj", "new.ply", "new.json", "a.png", "cube.png", "cube.mtl"];
    let mut outcomes = BTreeMap::new();
    for round in 0..150 {
        let mut pick = |from: &[&str]| from[random.bits() as usize % from.len()].to_owned();
        let command = pick(&["info", "simplify", "surfels", "sample", "render"]);
        let input = pick(&names[..3]);
        let (mut target, way) = (pick(&names), pick(&["plain", "plain", "dotted", "symlink", "hard", "two"]));
        if way == "dotted" {
            target = format!("colmap/../{target}");
        }
        let option = pick(&["-o", "--json"]);
        let mut output = folder.path(&target);
        let extension = if command == "render" { "png" } else { "ply" };
        if way == "symlink" || way == "two" || way == "hard" && output.exists() {
            let alias = folder.path(&format!("alias{round}.{extension}"));
            match way.as_str() {
                "hard" => std::fs::hard_link(&output, &alias).unwrap(),
                "two" => {
                    let between = folder.path(&format!("between{round}"));
                    std::os::unix::fs::symlink(&output, &between).unwrap();
                    std::os::unix::fs::symlink(format!("between{round}"), &alias).unwrap();
                }
                _ => std::os::unix::fs::symlink(&output, &alias).unwrap(),
            }
            output = alias;
        }
        let other = folder.path(&format!("other.{extension}"));
        let mut line = vec![command.clone(), text(&folder.path(&input)).to_owned()];
        match (command.as_str(), option.as_str()) {
            ("info", _) => line.extend(["--json".to_owned(), text(&output).to_owned()]),
            ("simplify" | "render", "--json") => {
                line.extend(["-o", text(&other), "--json", text(&output)].map(str::to_owned));
            }
            _ => line.extend(["-o", text(&output)].map(str::to_owned)),
        }
        match command.as_str() {
            "sample" => line.extend(["--count", "9"].map(str::to_owned)),
            "render" => line.extend(["--backend", "reference", "--size", "8x8"].map(str::to_owned)),
            _ => {}
        }
        let read: &[&str] = if input == "cube.obj" { &["cube.obj", "cube.mtl", "cube.png"] } else { &[&input] };
        let before: Vec<_> = read.iter().map(|name| std::fs::read(folder.path(name)).unwrap()).collect();
        let end = folder.path(target.trim_start_matches("colmap/../"));
        let result = run(&line);
        let code = result.status.code().unwrap();
        let after: Vec<_> = read.iter().map(|name| std::fs::read(folder.path(name)).unwrap()).collect();
        assert!(before == after, "{line:?} changed an input");
        if read.iter().any(|name| folder.path(name) == end) {
            assert_eq!(code, 2, "{line:?}: {}", String::from_utf8_lossy(&result.stderr));
        }
        *outcomes.entry(code).or_insert(0) += 1;
        // Outputs of one round may be inputs of the next, so inputs are restored.
        let fresh = inputs_again(&folder);
        assert!(fresh, "{line:?}");
    }
    assert!(outcomes[&0] > 20 && outcomes[&2] > 20, "{outcomes:?}");
}

/// Restores the inputs that a round may have overwritten.
#[cfg(unix)]
fn inputs_again(folder: &Folder) -> bool {
    use std::sync::OnceLock;
    static ORIGINALS: OnceLock<Folder> = OnceLock::new();
    let originals = ORIGINALS.get_or_init(inputs);
    ["s.ply", "painted.ply", "cube.obj", "cube.mtl", "cube.png", "a.png"].iter().all(|name| {
        let _ = std::fs::remove_file(folder.path(name));
        std::fs::copy(originals.path(name), folder.path(name)).is_ok()
    })
}
