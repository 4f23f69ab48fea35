//! Images that are too large are refused by their headers, and lack of memory or disk space ends in
//! one sentence.

use super::common::command::{Folder, epsplat, fails, ply, succeeds, text};
use epsplat::low_level::frame::Frame;
use epsplat::low_level::scene::Map;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// A 1-bit PNG whose header states this size, without the pixels.
fn png(width: u32, height: u32) -> Vec<u8> {
    let mut file = b"\x89PNG\r\n\x1a\n".to_vec();
    let mut chunk = |name: &[u8], data: &[u8]| {
        let body = [name, data].concat();
        file.extend((data.len() as u32).to_be_bytes());
        file.extend(&body);
        file.extend(crc32(&body).to_be_bytes());
    };
    let header = [&width.to_be_bytes()[..], &height.to_be_bytes(), &[1, 0, 0, 0, 0]].concat();
    chunk(b"IHDR", &header);
    chunk(b"IDAT", b"\x78\x9c\x03\x00\x00\x00\x00\x01");
    chunk(b"IEND", b"");
    file
}

/// The CRC-32 of PNG.
fn crc32(bytes: &[u8]) -> u32 {
    let step = |crc: u32, _| if crc & 1 == 1 { 0xedb8_8320 ^ (crc >> 1) } else { crc >> 1 };
    !bytes.iter().fold(u32::MAX, |crc, byte| (0..8).fold(crc ^ u32::from(*byte), step))
}

/// An EXR whose header states this size.
fn exr(folder: &Folder, name: &str, width: u32, height: u32) -> PathBuf {
    let path = folder.path(name);
    let frame = Frame::of_colors(3, 2, vec![[0.5; 4]; 6]);
    epsplat::io::exr::write(&path, &frame).unwrap();
    let mut bytes = std::fs::read(&path).unwrap();
    for window in [&b"dataWindow\0box2i\0"[..], b"displayWindow\0box2i\0"] {
        let at = bytes.windows(window.len()).position(|found| found == window).unwrap() + window.len() + 4;
        let last = [0, 0, width as i32 - 1, height as i32 - 1].map(i32::to_le_bytes);
        bytes[at..at + 16].copy_from_slice(last.as_flattened());
    }
    std::fs::write(&path, bytes).unwrap();
    path
}

/// Runs the program with an address space of `kib` KiB.
fn within(kib: u64, arguments: &[&str]) -> Output {
    let script = format!("ulimit -v {kib} && exec \"$0\" \"$@\"");
    Command::new("sh").args(["-c", &script, env!("CARGO_BIN_EXE_epsplat")]).args(arguments).output().unwrap()
}

#[test]
fn images_beyond_the_limit_are_refused_by_their_headers() {
    let folder = Folder::new();
    let cube = folder
        .file("m.obj", "mtllib m.mtl\nusemtl x\nv 0 0 0\nv 1 0 0\nv 1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nf 1/1 2/2 3/3\n");
    let output = folder.path("out.ply");
    let sample = ["sample", text(&cube), "-o", text(&output), "--count", "9"];
    for (width, height) in [(30_000, 30_000), (65_000, 65_000), (u32::MAX >> 1, 7), (16_385, 16_384)] {
        let said = [&format!("{width}x{height}")[..], "268435456 pixels", "huge"];
        let huge = folder.file("huge.png", png(width, height));
        fails(&["compare", text(&huge), text(&huge)], 1, &said);
        fails(&[&sample[..], &["--texture", text(&huge)]].concat(), 1, &said);
        folder.file("m.mtl", "newmtl x\nKd 1 0 0\nmap_Kd huge.png\n");
        let told = String::from_utf8(succeeds(&sample).stderr).unwrap();
        assert!(said.iter().all(|word| told.contains(word)), "{told}");
        // An EXR stores the last pixel's coordinates as signed integers.
        if width < 1 << 24 {
            let huge = exr(&folder, "huge.exr", width, height);
            fails(&["compare", text(&huge), text(&huge)], 1, &said);
        }
    }
    // Control: an image within the limit is refused only for its missing pixels.
    let whole = folder.file("whole.png", png(4_000, 3));
    fails(&["compare", text(&whole), text(&whole)], 1, &["whole.png", "not a readable PNG"]);
}

#[cfg(target_os = "linux")]
#[test]
fn what_the_system_has_no_room_for_is_said() {
    let folder = Folder::new();
    // The images are within the size limit, but take 3.7 GB as a frame.
    let large = folder.file("large.png", png(12_000, 12_000));
    let exr = exr(&folder, "large.exr", 12_000, 12_000);
    let cloud = folder.file("c.ply", ply("x y z u v", 3, "0 0 0 0 0\n1 0 0 1 0\n0 1 0 0 1\n"));
    let out = folder.path("out.png");
    let textured = ["render", text(&cloud), "-o", text(&out), "--backend", "reference", "--texture", text(&large)];
    for (kib, arguments) in [
        (1_500_000, &["compare", text(&large), text(&large)][..]),
        (1_500_000, &["compare", text(&exr), text(&exr)]),
        (700_000, &textured),
    ] {
        let output = within(kib, arguments);
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(1), "{arguments:?}: {said}");
        assert!(said.contains("cannot read ") && said.contains("large.") && said.contains("out of memory"), "{said}");
    }
    // Control: a small image fits in that memory.
    let small = folder.path("small.png");
    succeeds(&["render", text(&cloud), "-o", text(&small), "--backend", "reference", "--size", "16x16"]);
    let output = within(1_500_000, &["compare", text(&small), text(&small)]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

/// A command that allocates many small parts checks the total first.
#[cfg(target_os = "linux")]
#[test]
fn counts_that_memory_has_no_room_for_are_said() {
    let folder = Folder::new();
    let (cube, out) = (format!("{}/cube.obj", super::common::command::DATA), folder.path("out.ply"));
    let scene = |shape: &str| {
        let text = format!(
            "name = \"n\"\nabout = \"a\"\nsize = [8, 8]\nruns = 1\n[[scene]]\nname = \"s\"\n{shape}\n\
             [[config]]\nname = \"c\"\nbackend = \"reference\"\n"
        );
        folder.file("study.toml", text)
    };
    let sample = |count: &str| {
        let output = within(2_000_000, &["sample", &cube, "--count", count, "-o", text(&out)]);
        (output.status.code(), String::from_utf8(output.stderr).unwrap())
    };
    for count in ["3000000", "30000000", "268435456"] {
        let (code, said) = sample(count);
        assert_eq!(code, Some(1), "{said}");
        assert!(
            said.contains(&format!("error: the system has no memory for {count} samples of a mesh: about ")),
            "{said}"
        );
    }
    for (shape, words) in [
        ("shape = \"sphere\"\ncount = 1000000000", "1000000000 surfels of the scene \"s\""),
        ("shape = \"torus\"\ncount = 4294967295", "4294967295 surfels of the scene \"s\""),
        ("shape = \"sphere\"\ncount = 99\nviews = 900\nsize = [4000, 4000]", "the 900 frames of the scene \"s\""),
    ] {
        let output = within(2_000_000, &["bench", text(&scene(shape))]);
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(1), "{said}");
        assert!(said.contains(words) && said.contains("no memory"), "{said}");
    }
    // Control: smaller counts fit in that memory.
    assert_eq!(sample("3000").0, Some(0));
    let output = within(2_000_000, &["bench", text(&scene("shape = \"sphere\"\ncount = 99"))]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

/// A file size limit does not kill the run: the run removes the partial file and reports the error.
#[cfg(unix)]
#[test]
fn at_a_limit_of_the_size_of_files_nothing_is_left() {
    let folder = Folder::new();
    let rows: String = (0..6400).map(|i| format!("{} {} {}\n", i % 80, i / 80, (i % 7) as f64 * 0.01)).collect();
    let cloud = folder.file("c.ply", ply("x y z", 6400, &rows));
    let (old, bunny) = (folder.file("o.ply", "old"), format!("{}/bunny.obj", super::common::command::DATA));
    let out = text(&old).to_owned();
    for arguments in [
        &["generate", "sphere", "--count", "100000", "-o", &out][..],
        &["surfels", text(&cloud), "-o", &out],
        &["sample", &bunny, "--count", "9000", "-o", &out],
        &["lod", text(&cloud), "-o", &out],
        &["simplify", text(&cloud), "-o", &out, "--tolerance", "abs:1e-9"],
        &["render", &bunny, "-o", text(&folder.path("o.exr")), "--backend", "reference", "--size", "300x300"],
    ] {
        // The unit of `ulimit -f` is 512 bytes or a kilobyte, depending on the shell.
        let script = "ulimit -f 40 && exec \"$0\" \"$@\"";
        let mut command = Command::new("sh");
        let output = command.args(["-c", script, env!("CARGO_BIN_EXE_epsplat")]).args(arguments).output().unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(1), "{arguments:?}: {said}");
        assert!(said.contains("error: cannot write ") && said.contains("o."), "{arguments:?}: {said}");
        let mut names = folder.names();
        names.sort();
        assert_eq!(names, ["c.ply", "o.ply"], "{arguments:?}");
        assert_eq!(std::fs::read(&old).unwrap(), b"old", "{arguments:?}");
    }
}

#[test]
fn compare_names_what_only_one_image_has_and_prints_no_largest_number() {
    let folder = Folder::new();
    let frame = |depth: Option<Vec<f32>>, weight: Option<Vec<f32>>, alpha: f32| {
        let maps = [(Map::Depth, depth), (Map::Weight, weight)].into_iter();
        let colors = Frame::of_colors(2, 1, vec![[0.5, 0.5, 0.5, alpha]; 2]);
        maps.filter_map(|(map, values)| Some((map, values?)))
            .fold(colors, |frame, (map, values)| frame.with(map, values))
    };
    let written = |name: &str, frame: &Frame| {
        let path = folder.path(name);
        epsplat::io::exr::write(&path, frame).unwrap();
        path
    };
    let a = written("a.exr", &frame(Some(vec![1.0, f32::INFINITY]), Some(vec![1.0, 2.0]), 1.0));
    let b = written("b.exr", &frame(Some(vec![1.5, 1.5]), None, 0.75));
    let c = written("c.exr", &frame(Some(vec![1.0, f32::NAN]), None, 1.0));
    let table = |a: &Path, b: &Path| String::from_utf8(succeeds(&["compare", text(a), text(b)]).stdout).unwrap();
    // Differences that are not finite are printed as such, and the run fails.
    let failed = |a: &Path, b: &Path| {
        fails(&["compare", text(a), text(b)], 1, &["a value that is not finite in one image and differs"]);
        String::from_utf8(epsplat(&["compare", text(a), text(b)]).stdout).unwrap()
    };
    let said = table(&a, &b);
    assert!(said.contains("a.exr has: weight\n") && !said.contains("e38") && said.lines().count() == 11, "{said}");
    // All alphas of B are equal, and so are its depths, so errors are relative to these values.
    let row =
        |name: &str| said.lines().find(|line| line.starts_with(name)).unwrap().split_whitespace().collect::<Vec<_>>();
    assert_eq!(row("alpha")[1..], ["7.5000e-1", "2.500e-1", "3.333e-1"]);
    assert_eq!(row("depth")[1..4], ["1.5000e0", "5.000e-1", "3.333e-1"]);
    assert!(said.contains("(1 pixels have a value in one image only)"), "{said}");
    let said = failed(&b, &c);
    assert!(said.contains("not finite  (1 pixels)") || said.contains("not finite    (1 pixels)"), "{said}");
    assert!(!said.contains("e38") && !table(&a, &a).contains("has:"), "{said}");
    let json = succeeds(&["compare", text(&a), text(&b), "--json", "-"]).stdout;
    let json: serde_json::Value = serde_json::from_slice(&json).unwrap();
    assert_eq!((&json["only_in_a"][0], &json["only_in_b"]), (&"weight".into(), &serde_json::json!([])));
    assert_eq!((&json["maps"][1]["max_of_range"], &json["maps"][2]["in_one"]), (&(1.0 / 3.0).into(), &1.into()));
    let colored = failed(&a, &written("d.exr", &frame(None, None, f32::NAN)));
    assert!(colored.contains("rmse               not finite") && !colored.contains("e38"), "{colored}");
}
