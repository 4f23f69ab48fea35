//! Inputs of the command line: pipes, explicit formats, withheld points, and damaged files.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common;
#[path = "../common/las_forms.rs"]
mod las_forms;

use common::command::{DATA, Folder, epsplat, fails, ply, succeeds, text};
use las::{Builder, Point, Writer};
use serde_json::Value;
use std::io::{Cursor, Write};
use std::path::Path;
use std::process::{Command, Output, Stdio};

/// Runs the program with `bytes` on standard input.
fn piped(arguments: &[&str], bytes: &[u8]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_epsplat"));
    command.args(arguments).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    let mut stdin = child.stdin.take().unwrap();
    std::thread::scope(|scope| {
        scope.spawn(move || drop(stdin.write_all(bytes)));
        child.wait_with_output().unwrap()
    })
}

/// The only line on stderr of a failed run.
fn only_line(output: &Output, code: i32) -> String {
    let stderr = String::from_utf8(output.stderr.clone()).unwrap();
    assert_eq!((output.status.code(), stderr.lines().count()), (Some(code), 1), "{stderr}");
    stderr.trim_end().strip_prefix("error: ").expect(&stderr).to_owned()
}

/// The JSON of `info` without the input's path.
fn info(output: Output) -> Value {
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let mut info: Value = serde_json::from_slice(&output.stdout).unwrap();
    info.as_object_mut().unwrap().remove("supplied_by");
    info
}

/// A LAS file of which every third point is withheld.
fn third_withheld(count: u32) -> Vec<u8> {
    let mut writer = Writer::new(Cursor::new(Vec::new()), Builder::from((1, 2)).into_header().unwrap()).unwrap();
    for i in 0..count {
        let (x, y) = (f64::from(i % 20), f64::from(i / 20));
        writer.write_point(Point { x, y, is_withheld: i % 3 == 0, ..Point::default() }).unwrap();
    }
    writer.into_inner().unwrap().into_inner()
}

/// A file of each format, and the arguments that a pipe needs to identify it.
fn one_of_each(folder: &Folder) -> Vec<(std::path::PathBuf, &'static [&'static str])> {
    let rows: String = (0..60).map(|i| format!("{} {} 0\n", i % 6, i / 6)).collect();
    let mut files = vec![
        (folder.file("a.ply", ply("x y z", 60, &rows)), &[][..]),
        (folder.file("a.las", third_withheld(90)), &[]),
        (Path::new(DATA).join("simple.copc.laz"), &[]),
        (Path::new(DATA).join("bunny.obj"), &["--input-format", "obj"]),
    ];
    if cfg!(feature = "pcd") {
        let header = "VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 60\nDATA ascii\n";
        files.push((folder.file("a.pcd", format!("{header}{rows}")), &[]));
    }
    files
}

#[test]
fn what_comes_through_a_pipe_is_what_the_file_holds() {
    let folder = Folder::new();
    for (path, format) in one_of_each(&folder) {
        let bytes = std::fs::read(&path).unwrap();
        let from_file = info(epsplat(&["info", text(&path), "--json", "-"]));
        let mut names = vec!["-"];
        if cfg!(unix) {
            names.push("/dev/stdin");
        }
        for name in names {
            let from_pipe = info(piped(&[&["info", name, "--json", "-"], format].concat(), &bytes));
            assert_eq!(from_pipe, from_file, "{name} {}", path.display());
        }
        // A named pipe, such as `<(...)` makes.
        #[cfg(unix)]
        {
            let line = r#""$0" info "$2" $3 --json - & cat "$1" > "$2"; wait $!"#;
            let named = folder.path("pipe");
            assert!(Command::new("mkfifo").arg(&named).status().unwrap().success());
            let mut command = Command::new("sh");
            command.args(["-c", line, env!("CARGO_BIN_EXE_epsplat"), text(&path), text(&named), &format.join(" ")]);
            assert_eq!(info(command.output().unwrap()), from_file, "{}", path.display());
            std::fs::remove_file(&named).unwrap();
        }
    }
    // A mesh through a pipe, and several inputs of which one is a pipe.
    let bunny = std::fs::read(Path::new(DATA).join("bunny.obj")).unwrap();
    let (made, file) = (folder.path("made.ply"), folder.path("a.ply"));
    let sample = ["sample", "-", "--input-format", "obj", "--count", "100", "-o", text(&made)];
    assert!(piped(&sample, &bunny).status.success());
    let surfels = std::fs::read(&made).unwrap();
    let both = piped(&["surfels", text(&file), "-", "-o", text(&folder.path("both.ply"))], &surfels);
    assert!(String::from_utf8_lossy(&both.stderr).contains("both.ply: 160 surfels"), "{both:?}");
}

#[test]
fn a_pipe_that_ends_early_or_holds_no_cloud_is_one_sentence() {
    let folder = Folder::new();
    for (path, format) in one_of_each(&folder) {
        let bytes = std::fs::read(&path).unwrap();
        for share in [0, 1, 40, 70] {
            let output = piped(&[&["info", "-"], format].concat(), &bytes[..bytes.len() * share / 100]);
            // A truncated OBJ file is valid if it ends between two lines and has a vertex.
            if !(format.len() == 2 && output.status.success()) {
                only_line(&output, 1);
            }
        }
    }
    let said = only_line(&piped(&["info", "-"], b"v 1 2 3\n"), 1);
    assert!(said.starts_with("standard input: its format is not known") && said.contains("--input-format"), "{said}");
    let said = only_line(&piped(&["info", "-", "--input-format", "ply"], b"v 1 2 3\n"), 1);
    assert_eq!(said, "standard input: it is not a PLY file: its first line is not 'ply'");
    // An endless input is refused by its first bytes.
    #[cfg(target_os = "linux")]
    only_line(&epsplat(&["info", "/dev/zero"]), 1);
    fails(&["info", "a.ply", "--input-format", "png"], 2, &["--input-format", "ply"]);
    fails(&["sample", "a.obj", "--input-format", "las", "--count", "1", "-o", "a.ply"], 2, &["only PLY, OBJ, STL"]);
}

#[test]
fn deleted_points_are_left_out_and_told_or_kept_by_every_command() {
    let folder = Folder::new();
    let cloud = folder.file("a.las", third_withheld(300));
    let plane = folder.file("m.obj", "v 0 0 0\nv 19 0 0\nv 0 14 0\nf 1 2 3\n");
    let (cloud, image, made) = (text(&cloud), folder.path("a.png"), folder.path("a.ply"));
    let commands: [&[&str]; 5] = [
        &["info", cloud],
        &["render", cloud, "-o", text(&image), "--backend", "reference", "--size", "16x16"],
        &["surfels", cloud, "-o", text(&made)],
        &["simplify", cloud, "-o", text(&made)],
        &["coverage", cloud, "--mesh", text(&plane), "--views", "4", "--side", "16"],
    ];
    for command in commands {
        let told = |more: &[&str]| {
            let Output { stdout, stderr, .. } = succeeds(&[command, more].concat());
            let said = [stdout, stderr].map(|bytes| String::from_utf8(bytes).unwrap()).concat();
            (said.lines().filter(|line| line.contains("are marked")).map(str::to_owned).collect::<Vec<_>>(), said)
        };
        let expected =
            "100 points were left out: they are marked as withheld, which is deleted (--keep-withheld keeps them)";
        let (lines, said) = told(&[]);
        assert_eq!(lines, [expected], "{command:?}");
        let (lines, kept) = told(&["--keep-withheld"]);
        assert!(
            lines.is_empty() && kept.contains("300 surfels") && !said.contains("300 surfels"),
            "{command:?}: {said}{kept}"
        );
    }
    let of = |more: &[&str]| info(epsplat(&[&["info", cloud, "--json", "-"], more].concat()));
    let (left_out, kept) = (of(&[]), of(&["--keep-withheld"]));
    assert_eq!((&left_out["points"], &left_out["preparation"]["withheld"]), (&200.into(), &100.into()));
    assert_eq!((&kept["points"], &kept["preparation"]["withheld"]), (&300.into(), &0.into()));
    // The command that `info` recommends has the same options.
    let table =
        String::from_utf8(succeeds(&["info", cloud, "--keep-withheld", "--input-format", "las"]).stdout).unwrap();
    assert!(table.contains(&format!("epsplat surfels {cloud} --input-format las --keep-withheld -o")), "{table}");
    let mut all = third_withheld(1);
    let said = only_line(&piped(&["info", "-"], &all), 1);
    assert!(
        said.contains("all of the 1 points read are marked as withheld") && said.contains("--keep-withheld"),
        "{said}"
    );
    all.truncate(230);
    assert!(only_line(&piped(&["info", "-"], &all), 1).contains("the file ends after 0"));
}

/// The help names exactly the formats of this build.
#[test]
fn the_help_names_the_formats_that_are_read() {
    for command in ["info", "render", "surfels", "simplify", "coverage"] {
        let help = String::from_utf8(succeeds(&[command, "--help"]).stdout).unwrap();
        let formats =
            [("ply", true), ("las", true), ("laz", true), ("obj", true), ("csv", true), ("ptx", true), ("stl", true)];
        let optional =
            [("e57", cfg!(feature = "e57")), ("glb", cfg!(feature = "gltf")), ("pcd", cfg!(feature = "pcd"))];
        for (format, is_read) in formats.into_iter().chain(optional) {
            let words = help.split(|c: char| c.is_whitespace() || ",;]".contains(c));
            let named = words.filter(|word| *word == format || word.strip_prefix('.') == Some(format)).count();
            assert_eq!(named >= 2, is_read, "{command} {format}: {help}");
            assert!(is_read || named == 0, "{command} {format}: {help}");
        }
        assert!(help.contains("--keep-withheld") && help.contains("--input-format"), "{help}");
    }
}

/// LAZ files on which the decoder once panicked and printed a message before the error.
#[test]
fn damaged_files_are_one_sentence() {
    let folder = Folder::new();
    let mut builder = Builder::from((1, 2));
    builder.point_format.is_compressed = true;
    let mut writer = Writer::new(Cursor::new(Vec::new()), builder.into_header().unwrap()).unwrap();
    (0..200).for_each(|i| writer.write_point(Point { x: f64::from(i), ..Point::default() }).unwrap());
    let whole = writer.into_inner().unwrap().into_inner();
    let without_chunks = las_forms::pointwise(&whole, 0);
    let twice = las_forms::with_another_record(&whole);
    let deep = include_bytes!("../readers/deep_gps_time.laz").to_vec();
    let layers = include_bytes!("../readers/layers_outside_chunks.laz").to_vec();
    for (name, bytes, said) in [
        ("short.laz", without_chunks[..without_chunks.len() - 60].to_vec(), "decoding fails after"),
        ("twice.laz", twice, "its LASzip record does not describe its points"),
        ("deep.laz", deep, "decoding fails after 0"),
        ("layers.laz", layers, "its LASzip record does not describe its points"),
    ] {
        let path = folder.file(name, bytes);
        let line = only_line(&epsplat(&["info", text(&path)]), 1);
        assert!(line.starts_with(text(&path)) && line.contains(said), "{line}");
    }
    assert_eq!(info(piped(&["info", "-", "--json", "-"], &without_chunks))["points"], 200);
}

/// If a folder has readable files, its unreadable ones are left out and reported. A file that is
/// itself an argument must be readable. Files whose name begins with a dot are ignored in a folder.
#[test]
fn one_bad_file_of_a_folder_does_not_lose_the_others() {
    let folder = Folder::new();
    let rows: String = (0..60).map(|i| format!("{} {} 0\n", i % 6, i / 6)).collect();
    let in_folder = |name: &str, bytes: &[u8]| {
        std::fs::create_dir_all(folder.path("tiles")).unwrap();
        std::fs::write(folder.path("tiles").join(name), bytes).unwrap();
    };
    let good = ply("x y z", 60, &rows);
    in_folder("a.ply", good.as_bytes());
    in_folder("b.las", &third_withheld(90));
    in_folder("._a.ply", b"what macOS keeps of a file");
    in_folder(".hidden.las", b"");
    let (tiles, output) = (folder.path("tiles"), folder.path("o.ply"));
    let surfels = |more: &[&str]| epsplat(&[&["surfels", text(&tiles), "-o", text(&output)], more].concat());
    let told = |output: &Output| String::from_utf8(output.stderr.clone()).unwrap();
    // Control: if all files are readable, there is no report, in strict mode or not.
    for strict in [&[][..], &["--strict"]] {
        let whole = surfels(strict);
        assert!(whole.status.success() && told(&whole).contains("o.ply: 120 surfels"), "{}", told(&whole));
        assert!(!told(&whole).contains("--strict"), "{}", told(&whole));
    }
    let mut cut = third_withheld(90);
    cut.truncate(900);
    let copc = std::fs::read(Path::new(DATA).join("simple.copc.laz")).unwrap();
    for (name, bytes) in [
        ("bad.ply", &b""[..]),
        ("bad.ply", b"ply\nformat ascii 1.0\nelement vertex 9\nproperty float x\nend_header\n"),
        ("bad.las", &cut),
        ("bad.laz", &copc[..20_000]),
        ("bad.obj", b"v 1 2 x\n"),
        ("aa.ply", b"ply\n"),
    ] {
        in_folder(name, bytes);
        let rest = surfels(&[]);
        let said = told(&rest);
        assert!(rest.status.success() && said.contains("o.ply: 120 surfels"), "{name}: {said}");
        assert!(said.contains("1 of 3 files of folders left out: ") && said.contains(name), "{name}: {said}");
        let picture = folder.path("o.png");
        let picture = ["render", text(&tiles), "-o", text(&picture), "--backend", "reference", "--size", "8x8"];
        assert!(told(&succeeds(&picture)).contains("1 of 3 files of folders left out: "), "{name}");
        let strict = surfels(&["--strict"]);
        assert!(strict.status.code() == Some(1) && told(&strict).contains(name), "{name}: {}", told(&strict));
        // As an argument, alone or beside the folder, the file must be readable.
        let alone = tiles.join(name);
        fails(&["surfels", text(&alone), "-o", text(&output)], 1, &[name]);
        fails(&["info", text(&alone)], 1, &[name]);
        std::fs::remove_file(&alone).unwrap();
        let beside = folder.file(name, bytes);
        fails(&["surfels", text(&tiles), text(&beside), "-o", text(&output)], 1, &[name]);
    }
    // If no file of a folder can be read, the error is that of the first.
    ["a.ply", "b.las"].iter().for_each(|name| std::fs::write(tiles.join(name), "bad").unwrap());
    assert!(only_line(&surfels(&[]), 1).contains("a.ply"));
    // A file whose name begins with a dot is ignored in a folder, but can be an argument.
    ["a.ply", "b.las"].iter().for_each(|name| std::fs::remove_file(tiles.join(name)).unwrap());
    fails(&["surfels", text(&tiles), "-o", text(&output)], 2, &["has no"]);
    let dotted = folder.file(".a.ply", &good);
    succeeds(&["info", text(&dotted)]);
}

/// A broken node of a COPC file is reported by `render`, which leaves it out, and in the JSON of
/// `info`.
#[test]
fn a_broken_node_is_told_with_its_picture() {
    let folder = Folder::new();
    let mut bytes = std::fs::read(Path::new(DATA).join("simple.copc.laz")).unwrap();
    let record = usize::from(u16::from_le_bytes(*bytes[105..].first_chunk().unwrap()));
    let start = u32::from_le_bytes(*bytes[96..].first_chunk().unwrap()) as usize + 8;
    bytes[start + record + 4..start + record + 8].copy_from_slice(&0x7fff_ff00u32.to_le_bytes());
    let (scan, picture) = (folder.file("a.copc.laz", bytes), folder.path("o.png"));
    let render = ["render", text(&scan), "-o", text(&picture), "--backend", "reference", "--size", "8x8"];
    for (more, kind) in [(&[][..], "chunks"), (&["--lod", "0.0001px"], "nodes")] {
        let told = String::from_utf8(succeeds(&[&render[..], more].concat()).stderr).unwrap();
        assert!(told.contains("a.copc.laz: 1 of ") && told.contains(&format!("{kind} left out, with ")), "{told}");
        fails(&[&render[..], more, &["--strict"]].concat(), 1, &["a.copc.laz"]);
    }
    let said = info(epsplat(&["info", text(&scan), "--json", "-"]));
    let unread = said["preparation"]["unread"].as_array().unwrap();
    assert!(unread.len() == 1 && unread[0].as_str().unwrap().contains("chunk 1: "), "{unread:?}");
}
