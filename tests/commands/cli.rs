//! The command line as users meet it: successful runs, and for bad ones a one-sentence error with
//! the right exit code.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common;

use common::command::{DATA, Folder, epsplat, fails, ply, succeeds, text};
use std::path::Path;
use std::process::Command;

#[test]
fn a_render_reports_what_it_did() {
    let folder = Folder::new();
    let (sphere, image) = (folder.path("s.ply"), folder.path("s.exr"));
    succeeds(&["generate", "sphere", "--count", "500", "-o", text(&sphere)]);
    let output = succeeds(&[
        "render",
        text(&sphere),
        "-o",
        text(&image),
        "--size",
        "64x48",
        "--backend",
        "reference",
        "--aov",
        "depth,normal,weight,count,decision",
        "--json",
        "-",
    ]);
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(report["backend"], "reference");
    assert_eq!(report["surfels"], 500);
    assert_eq!((&report["width"], &report["height"]), (&64.into(), &48.into()));
    for pass in ["project_ms", "visibility_ms", "accumulate_ms", "resolve_ms"] {
        assert!(report["passes"][pass].is_number(), "{pass}");
    }
    assert!(report["total_ms"].is_number() && report["adapter"].is_string());
    let bits = report["bits"].as_object().unwrap();
    assert_eq!(bits.keys().collect::<Vec<_>>(), ["color", "count", "decision", "depth", "normal", "weight"]);
    assert!(bits.values().all(|hash| u64::from_str_radix(hash.as_str().unwrap(), 16).is_ok()), "{bits:?}");
    assert!(report["needs"].as_array().unwrap().contains(&"depth".into()));
    assert!(report["splats_drawn"].as_u64().unwrap() > 0);

    let output = succeeds(&["compare", text(&image), text(&image), "--json", "-"]);
    let comparison: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(comparison["max_abs"], 0.0);
    assert_eq!(comparison["psnr_db"], serde_json::Value::Null);
    for key in ["rmse", "coverage_mismatch", "percentile_99_9"] {
        assert_eq!(comparison[key], 0.0, "{key}");
    }
    let maps: Vec<&str> =
        comparison["maps"].as_array().unwrap().iter().map(|map| map["map"].as_str().unwrap()).collect();
    assert_eq!(maps, ["color", "alpha", "depth", "normal", "weight", "count"]);
}

#[test]
fn coverage_tells_a_whole_surface_from_one_with_holes() {
    let folder = Folder::new();
    let bunny = format!("{DATA}/bunny.obj");
    let run = |surfels: &str| {
        let few = ["--views", "6", "--side", "64"];
        let output = succeeds(&[&["coverage", surfels, "--mesh", &bunny, "--json", "-"], &few[..]].concat());
        serde_json::from_slice::<serde_json::Value>(&output.stdout).unwrap()
    };
    // The reader derives radii whose disks cover the triangles around each vertex.
    let whole = run(&bunny);
    assert_eq!((&whole["triangles"], &whole["views"]), (&3674.into(), &6.into()));
    // One surfel at each vertex, and more where the surface has sharp edges.
    assert!((1839..=3 * 3674).contains(&whole["surfels"].as_u64().unwrap()), "{whole}");
    assert!(whole["hole_free"] == true && whole["holes"] == 0 && whole["worst_view"].is_null(), "{whole}");
    assert!(whole["centers_to_mesh"]["max"].as_f64().unwrap() < 1e-6 && whole["rays"].as_u64().unwrap() > 4000);
    // A clipped disk ends at the vertex on one side; on the other, its rim leaves the curved
    // surface.
    let rims = |of: &str| whole["rims_to_mesh"][of].as_f64().unwrap();
    assert!(rims("max") > 1e-3 && rims("mean") > 1e-4, "{whole}");
    // Disks too small to touch each other.
    let text_of = std::fs::read_to_string(&bunny).unwrap();
    let vertices: Vec<&str> = text_of.lines().filter_map(|line| line.strip_prefix("v ")).collect();
    let rows: String = vertices.iter().map(|vertex| format!("{vertex} 0 0 1 0.01\n")).collect();
    let specks = folder.file("specks.ply", ply("x y z nx ny nz radius", vertices.len(), &rows));
    let holed = run(text(&specks));
    assert!(holed["hole_free"] == false && holed["views_with_holes"] == 6, "{holed}");
    assert!(holed["hole_share"].as_f64().unwrap() > 0.7, "{holed}");
    let output = succeeds(&["coverage", &bunny, "--mesh", &bunny, "--views", "6", "--side", "64"]);
    let table = String::from_utf8(output.stdout).unwrap();
    assert!(table.contains("hole-free  from all 6 views") && table.contains("centres to mesh"), "{table}");
    let cloud = folder.file("cloud.obj", "v 0 0 0\nv 1 0 0\n");
    fails(&["coverage", &bunny, "--mesh", text(&cloud)], 1, &["cloud.obj", "no triangle"]);
    fails(&["coverage", &bunny, "--mesh", &bunny, "--views", "0"], 2, &["--views"]);
}

#[test]
fn sample_writes_surfels_that_cover_the_mesh() {
    let folder = Folder::new();
    let (bunny, surfels) = (format!("{DATA}/bunny.obj"), folder.path("s.ply"));
    let output = succeeds(&["sample", &bunny, "-o", text(&surfels), "--count", "3000", "--priority", "area"]);
    assert!(String::from_utf8_lossy(&output.stderr).contains("3000 surfels from 3674 triangles"), "{output:?}");
    let output = succeeds(&["coverage", text(&surfels), "--mesh", &bunny, "--side", "64", "--json", "-"]);
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(report["surfels"] == 3000 && report["hole_share"].as_f64().unwrap() < 1e-3, "{report}");
    succeeds(&["sample", &bunny, "-o", text(&surfels), "--count", "10", "--method", "uniform", "--seed", "7"]);
    succeeds(&["sample", &bunny, "-o", text(&surfels), "--count", "3000", "--shape", "cap"]);
    assert!(String::from_utf8_lossy(&std::fs::read(&surfels).unwrap()).contains("property float cap_uu"));
    fails(
        &["sample", &bunny, "-o", "s.ply", "--count", "9", "--shape", "cap", "--method", "uniform"],
        2,
        &["half-axes"],
    );
    fails(&["sample", &bunny, "-o", text(&surfels), "--count", "0"], 2, &["--count"]);
    fails(&["sample", &bunny, "-o", "s.obj", "--count", "9"], 2, &[".ply"]);
    fails(&["sample", &bunny, "-o", "s.ply", "--count", "9", "--priority", "beauty"], 2, &["beauty", "curvature"]);
    let textured = ["sample", &bunny, "-o", "s.ply", "--count", "9", "--texture", "none.png"];
    fails(&textured, 1, &["bunny.obj", "no texture coordinates"]);
    let flat = folder.file("flat.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n");
    fails(&["sample", text(&flat), "-o", text(&surfels), "--count", "9"], 1, &["flat.obj", "has an area"]);
    fails(&["sample", text(&surfels), "-o", "t.ply", "--count", "9"], 1, &["s.ply", "no triangles"]);
}

#[test]
fn every_command_has_help_with_an_example() {
    for command in ["render", "compare", "coverage", "generate", "info", "sample", "hybrid", "simplify", "adapters"] {
        let help = String::from_utf8(succeeds(&[command, "--help"]).stdout).unwrap();
        assert!(help.contains(&format!("epsplat {command}")) && help.contains("Example"), "{help}");
    }
}

#[test]
fn without_an_adapter_auto_falls_back_and_gpu_says_what_to_install() {
    let folder = Folder::new();
    let cloud = folder.file("c.ply", ply("x y z", 3, "0 0 0\n1 0 0\n0 1 0\n"));
    let image = folder.path("c.png");
    // An adapter of another system's API, which does not exist here.
    let foreign = if cfg!(windows) { "metal" } else { "dx12" };
    let run = |backend: &str| {
        Command::new(env!("CARGO_BIN_EXE_epsplat"))
            .args(["render", text(&cloud), "-o", text(&image), "--size", "16x16", "--backend", backend])
            .env("WGPU_BACKEND", foreign)
            .output()
            .unwrap()
    };
    let output = run("gpu");
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{stderr}");
    assert!(stderr.contains("mesa-vulkan-drivers"), "{stderr}");
    assert!(!image.exists());
    let output = run("auto");
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{stderr}");
    assert_eq!(stderr.lines().filter(|line| line.contains("f64 reference")).count(), 1, "{stderr}");
    assert!(image.exists());
}

#[test]
fn unusable_arguments_exit_with_2() {
    let folder = Folder::new();
    let cloud = folder.file("c.ply", ply("x y z", 3, "0 0 0\n1 0 0\n0 1 0\n"));
    let camera = folder.file("c.json", r#"{"width": 8, "height": 8, "eye": [0,0,5], "target": [0,0,0]}"#);
    let image = folder.path("c.png");
    let (cloud, camera, image) = (text(&cloud), text(&camera), text(&image));
    let render = |more: &[&str], words: &[&str]| {
        fails(&[&["render", cloud, "-o", image, "--backend", "reference"], more].concat(), 2, words);
    };
    render(&["--size", "0x0"], &["0x0"]);
    render(&["--size", "100000x100000"], &["100000x100000", "32768"]);
    render(&["--size", "32768x32768"], &["134217728"]);
    render(&["--size", "big"], &["WIDTHxHEIGHT"]);
    render(&["--fov", "40", "--ortho", "3"], &["--ortho"]);
    render(&["--camera", camera, "--eye", "0,0,1"], &["--eye"]);
    render(&["--camera", camera, "--size", "9x9"], &["contradicts"]);
    render(&["--target", "0,0,1"], &["--eye"]);
    render(&["--eye", "1,1,1", "--target", "1,1,1"], &["apart"]);
    render(&["--eye", "0,0,1", "--target", "0,0,0", "--up", "0,0,1"], &["up"]);
    render(&["--eye", "0,nan,1"], &["finite"]);
    render(&["--fov", "180"], &["180"]);
    render(&["--ortho", "-3"], &["positive"]);
    render(&["--near", "0"], &["near"]);
    render(&["--intrinsics", "0,1,2,3"], &["fx"]);
    render(&["--epsilon", "0.01"], &["rel:E"]);
    render(&["--epsilon", "radius:-1"], &["rel:E"]);
    for bad in
        ["box", "gaussian:0", "gaussian:wide", "ellipse:1001,3", "ellipse:6,3,rough", "ellipse:0,3,smooth", "hat:1"]
    {
        render(&["--kernel", bad], &["gaussian", "ellipse:A,N", "hat", "constant"]);
    }
    render(&["--accumulator", "double"], &["fixed", "fixed32", "fixed64", "packed64", "float", "cas"]);
    render(&["--accumulator", "fixed32"], &["accumulator", "backend gpu"]);
    render(&["--light", "0,0,0"], &["light"]);
    render(&["--aov", "depth"], &[".exr"]);
    render(&["--background", "1,2"], &["R,G,B"]);
    render(&["--adapter", "x"], &["--adapter"]);
    render(&["--unknown"], &["--unknown"]);
    fails(&["render", cloud, "-o", "c.bmp"], 2, &[".png, .exr"]);
    fails(&["render", "-o", image], 2, &["INPUTS"]);
    fails(&["render", cloud, "-o", &image.replace("png", "exr"), "--aov", "decision"], 2, &["reference"]);
    fails(&["generate", "cube", "--count", "5", "-o", "x.ply"], 2, &["sphere"]);
    fails(&["generate", "sphere", "--count", "0", "-o", "x.ply"], 2, &["0"]);
    fails(&["generate", "sphere", "--count", "5", "-o", "x.obj"], 2, &[".ply"]);
    assert!(!Path::new(image).exists());
}

#[test]
fn bad_files_exit_with_1_and_leave_nothing_behind() {
    let folder = Folder::new();
    let outputs = Folder::new();
    let image = outputs.path("out.png");
    let bad = |name: &str, bytes: &[u8], words: &[&str]| {
        let input = folder.file(name, bytes);
        let render = ["render", text(&input), "-o", text(&image), "--backend", "reference", "--size", "16x16"];
        fails(&render, 1, words);
        fails(&["info", text(&input)], 1, words);
    };
    let whole = ply("x y z", 3, "0 0 0\n1 0 0\n0 1 0\n");
    bad("truncated.ply", &whole.as_bytes()[..whole.len() - 8], &["truncated.ply", "3"]);
    bad("promises.ply", ply("x y z", 900_000_000, "0 0 0\n").as_bytes(), &["promises.ply", "900000000"]);
    bad("letters.ply", ply("x y z", 1, "0 zero 0\n").as_bytes(), &["letters.ply", "zero"]);
    bad("no_z.ply", ply("x y", 1, "0 0\n").as_bytes(), &["no_z.ply", "z"]);
    bad("empty.ply", b"", &["empty.ply"]);
    bad("empty.las", b"", &["empty.las"]);
    bad("empty.obj", b"", &[]);
    bad("nothing.ply", ply("x y z", 0, "").as_bytes(), &[]);
    bad("nan.ply", ply("x y z", 2, "nan 0 0\n0 inf 0\n").as_bytes(), &["2"]);
    bad("picture.jpg", b"\xff\xd8", &["picture.jpg"]);
    let laz = std::fs::read(format!("{DATA}/autzen.laz")).unwrap();
    bad("half.laz", &laz[..laz.len() / 2], &["half.laz"]);
    bad("head.laz", &laz[..300], &["head.laz"]);
    bad("noise.laz", &[&laz[..400], &[0x5a; 4000][..]].concat(), &["noise.laz"]);
    let mut promises = laz.clone();
    // In LAS 1.2 the number of points is at byte 107.
    promises[107..111].copy_from_slice(&200_000u32.to_le_bytes());
    bad("promises.laz", &promises, &["promises.laz", "200000"]);
    bad("index.obj", b"v 0 0 0\nf 1 2 3\n", &["index.obj"]);

    let missing = folder.path("missing.ply");
    fails(&["render", text(&missing), "-o", text(&image)], 1, &["missing.ply"]);
    let cloud = folder.file("c.ply", whole);
    let nowhere = outputs.path("no/such/folder/out.png");
    fails(&["render", text(&cloud), "-o", text(&nowhere), "--backend", "reference"], 1, &["out.png"]);
    let taken = outputs.path("taken.png");
    std::fs::create_dir(&taken).unwrap();
    fails(&["render", text(&cloud), "-o", text(&taken), "--backend", "reference", "--size", "9x9"], 1, &["taken.png"]);
    let not_an_image = folder.file("not.png", "hello");
    fails(&["compare", text(&not_an_image), text(&not_an_image)], 1, &["not.png"]);
    let broken_camera = folder.file("camera.json", "{");
    fails(&["render", text(&cloud), "-o", text(&image), "--camera", text(&broken_camera)], 1, &["camera.json"]);
    assert_eq!(outputs.names(), ["taken.png"]);
}

#[test]
fn odd_points_are_dropped_or_repaired_and_counted() {
    let folder = Folder::new();
    let rows = "0 0 0 0 0 0 1\n1 0 0 0 0 1 0\n0 1 0 0 0 1 -4\n1 1 0 nan 0 0 1\nnan 0 0 0 0 1 1\n0 0 inf 0 0 1 1\n";
    let cloud = folder.file("odd.ply", ply("x y z nx ny nz radius", 6, rows));
    let image = folder.path("odd.exr");
    let output = succeeds(&["render", text(&cloud), "-o", text(&image), "--backend", "reference", "--size", "32x32"]);
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert!(stderr.contains("2 points"), "{stderr}");
    let info: serde_json::Value =
        serde_json::from_slice(&succeeds(&["info", text(&cloud), "--json", "-"]).stdout).unwrap();
    assert_eq!(info["preparation"]["dropped_non_finite"], 2);
    assert_eq!(info["preparation"]["estimated_normals"], 2);
    assert_eq!(info["preparation"]["estimated_radii"], 2);
}

/// Runs every command on every bad input: either it fails with a sentence that names the file and
/// writes nothing, or it succeeds and reports what it left out.
///
/// A panic has a different exit code.
#[test]
fn bad_meshes_and_clouds_end_in_a_sentence_or_a_count_whatever_the_command() {
    let folder = Folder::new();
    let outputs = Folder::new();
    let (written, image) = (outputs.path("out.ply"), outputs.path("out.png"));
    let quad = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";
    let whole = folder.file("whole.obj", format!("{quad}f 1 2 3\nf 1 3 4\n"));
    let textured = format!("mtllib {{}}\nusemtl x\n{quad}vt 0 0\nvt 1 0\nvt 1 1\nf 1/1 2/2 3/3\n");
    folder.file("lost.mtl", "newmtl x\nKd 1 0 0\nmap_Kd nowhere.png\n");
    folder.file("junk.png", "no image");
    folder.file("junk.mtl", "newmtl x\nmap_Kd junk.png\n");
    let same = |count: usize| ply("x y z", count, &"1 2 3\n".repeat(count));
    // The words in the errors of `sample` and `coverage --mesh`; a cloud has no triangle.
    let no_mesh = ["no triangle"];
    let inputs: [(&str, String, &[&str]); 16] = [
        ("fin.obj", format!("{quad}v 0 0 1\nv 0 1 -1\nf 1 2 3\nf 1 3 5\nf 1 3 6\nf 3 1 2\nf 1 2 3\n"), &[]),
        ("flat.obj", format!("{quad}f 1 1 1\nf 1 2 1\nf 1 2 3\n"), &["2 triangles were dropped"]),
        ("line.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n".into(), &["triangle"]),
        ("nan.obj", format!("v nan 0 0\nv 1e30 0 0\n{quad}f 1 3 4\nf 2 3 4\nf 3 4 5\n"), &["triangles were dropped"]),
        ("lost.obj", textured.replace("{}", "nowhere.mtl"), &["nowhere.mtl"]),
        ("image.obj", textured.replace("{}", "lost.mtl"), &["nowhere.png"]),
        ("junk.obj", textured.replace("{}", "junk.mtl"), &["junk.png"]),
        ("tiny.obj", "v 0 0 0\nv 1e-200 0 0\nv 0 1e-200 0\nf 1 2 3\n".into(), &["triangle"]),
        ("index.obj", format!("{quad}f 1 2 9\n"), &["does not exist"]),
        ("none.ply", ply("x y z", 0, ""), &[]),
        ("one.ply", ply("x y z", 1, "5 5 5\n"), &no_mesh),
        ("two.ply", ply("x y z", 2, "5 5 5\n6 5 5\n"), &no_mesh),
        ("three.ply", ply("x y z", 3, "5 5 5\n6 5 5\n5 6 5\n"), &no_mesh),
        ("same.ply", same(5000), &no_mesh),
        ("nan.ply", ply("x y z", 3, "nan 0 0\n0 0 0\n0 inf 0\n"), &no_mesh),
        ("all_nan.ply", ply("x y z", 2, "nan 0 0\n0 nan 0\n"), &[]),
    ];
    for (name, content, told) in inputs {
        let input = folder.file(name, content);
        let (input, output, whole) = (text(&input), text(&written), text(&whole));
        let few = ["--views", "4", "--side", "16"];
        for arguments in [
            &["info", input][..],
            &["render", input, "-o", text(&image), "--backend", "reference", "--size", "16x16"],
            &["surfels", input, "-o", output],
            &["surfels", input, "-o", output, "--size", "ellipse", "--estimate-normals"],
            &["simplify", input, "-o", output],
            &["simplify", input, "-o", output, "--shape", "ellipse", "--relax", "1", "--tolerance", "abs:0"],
            &["sample", input, "-o", output, "--count", "50"],
            &["sample", input, "-o", output, "--count", "50", "--method", "uniform"],
            &[&["coverage", input, "--mesh", whole][..], &few].concat(),
            &[&["coverage", whole, "--mesh", input][..], &few].concat(),
        ] {
            let result = epsplat(arguments);
            let stderr = String::from_utf8(result.stderr).unwrap();
            let code = result.status.code();
            assert!(code == Some(0) || code == Some(1), "{arguments:?}: {code:?} {stderr}");
            if code == Some(1) {
                assert!(stderr.contains(name) || stderr.contains("nothing to draw"), "{arguments:?}: {stderr}");
                assert!(outputs.names().is_empty(), "{arguments:?}");
            }
            let of_mesh = arguments[0] == "sample" || arguments.contains(&"--mesh") && arguments[1] == whole;
            if of_mesh {
                assert!(told.iter().all(|words| stderr.contains(words)), "{arguments:?}: {stderr}");
            }
            outputs.names().iter().for_each(|name| std::fs::remove_file(outputs.path(name)).unwrap());
        }
    }
}

#[test]
fn one_point_draws_and_so_do_coincident_and_collinear_ones() {
    let folder = Folder::new();
    let image = folder.path("p.exr");
    let line: String = (0..50).map(|i| format!("{i} 0 0\n")).collect();
    for (count, rows) in [(1, "5 5 5\n".to_owned()), (40, "1 2 3\n".repeat(40)), (50, line)] {
        let cloud = folder.file("p.ply", ply("x y z", count, &rows));
        succeeds(&["render", text(&cloud), "-o", text(&image), "--backend", "reference", "--size", "64x64"]);
        let frame = epsplat::io::exr::read(&image).unwrap();
        let covered = frame.color.iter().filter(|c| c[3] > 0.0).count();
        assert!(covered > 8, "{count} points cover {covered} pixels");
    }
}

#[test]
fn surfels_are_made_of_points_and_drawn() {
    let folder = Folder::new();
    let (made, image) = (folder.path("made.ply"), folder.path("made.exr"));
    let rows: String = (0..900).map(|i| format!("{} {} {}\n", i % 30, i / 30, (i % 7) as f64 * 0.01)).collect();
    let cloud = folder.file("cloud.ply", ply("x y z", 901, &(rows + "nan 0 0\n")));
    let output = succeeds(&["surfels", text(&cloud), "-o", text(&made), "--size", "ellipse", "--orient", "-5,5,90"]);
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert!(stderr.contains("1 points were dropped") && stderr.contains("made.ply: 900 surfels"), "{stderr}");
    let points = epsplat::io::read(&made, &()).unwrap();
    assert!(points.normals.unwrap().iter().all(|n| n[2] > 0.9) && points.axes.is_some());
    succeeds(&["render", text(&made), "-o", text(&image), "--backend", "reference", "--size", "64x64"]);
    for orient in ["propagate", "up", "0,0,-9"] {
        for size in ["knn", "bsp", "bsp:circumsphere"] {
            succeeds(&[
                "surfels",
                text(&cloud),
                "-o",
                text(&made),
                "--orient",
                orient,
                "--size",
                size,
                "--outliers",
                "8",
            ]);
        }
    }
    let refuses = |more: &[&str], words: &[&str]| {
        fails(&[&["surfels", text(&cloud), "-o", text(&made)], more].concat(), 2, words);
    };
    refuses(&["--size", "huge"], &["there is no size `huge`", "bsp:circumsphere"]);
    refuses(&["--orient", "1,2"], &["position of a scanner", "three numbers"]);
    refuses(&["--orient", "up", "--orient", "1,2,3"], &["once"]);
    refuses(&["--max-radius", "0.5"], &["at least 1"]);
    refuses(&["--outliers=-1"], &["not negative"]);
    fails(&["surfels", text(&cloud), "-o", "made.obj"], 2, &["must end in .ply"]);
    let empty = folder.file("empty.ply", ply("x y z", 0, ""));
    fails(&["surfels", text(&empty), "-o", text(&made)], 1, &["holds no points"]);
}

/// `--surfel-size` draws the surfels that `epsplat surfels --size` writes.
#[test]
fn sizes_are_chosen_without_a_file_between() {
    let folder = Folder::new();
    let [sphere, made, with, without] = ["s.ply", "made.ply", "with.exr", "without.exr"].map(|file| folder.path(file));
    let rows: String = (0..400).map(|i| format!("{} {} {}\n", i % 20, i / 20, (i % 7) as f64 * 0.01)).collect();
    std::fs::write(&sphere, ply("x y z", 400, &rows)).unwrap();
    succeeds(&["surfels", text(&sphere), "-o", text(&made), "--size", "ellipse"]);
    let size = ["--size", "48x32", "--backend", "reference", "-o"];
    succeeds(&[&["render", text(&made)], &size[..], &[text(&without)]].concat());
    succeeds(&[&["render", text(&sphere), "--surfel-size", "ellipse"], &size[..], &[text(&with)]].concat());
    assert!(std::fs::read(with).unwrap() == std::fs::read(without).unwrap());
}

/// `--radius-scale` draws smaller or larger surfels; what has no meaning is refused.
#[test]
fn surfels_are_scaled_and_choices_without_meaning_are_refused() {
    let folder = Folder::new();
    let [sphere, image] = ["sphere.ply", "x.exr"].map(|file| folder.path(file));
    succeeds(&["generate", "sphere", "--count", "300", "-o", text(&sphere)]);
    let options = ["--size", "64x64", "--backend", "reference", "--samples", "1", "-o", text(&image)];
    let seen = |factor: &str| {
        succeeds(&[&["render", text(&sphere), "--radius-scale", factor], &options[..]].concat());
        let frame = epsplat::io::exr::read(&image).unwrap();
        frame.color.iter().filter(|color| color[3] > 0.0).count()
    };
    let [small, own, large] = ["0.2", "1", "1.5"].map(seen);
    assert!(2 * small < own && own < large, "{small} {own} {large}");
    let refuses = |more: &[&str], words: &[&str]| {
        fails(&[&["render", text(&sphere)], more, &options[..]].concat(), 2, words);
    };
    refuses(&["--radius-scale", "0"], &["--radius-scale is a factor", "not 0"]);
    refuses(&["--radius-scale", "nan"], &["--radius-scale is a factor"]);
    refuses(&["--radius-scale", "0.5", "--lod", "4px"], &["radii of their own", "--lod"]);
    refuses(&["--cull", "cones"], &["take --lod or --splats with --cull cones"]);
    refuses(&["--cull", "fronts"], &["none, back or cones"]);
}

#[test]
fn info_tells_what_is_missing_and_which_command_supplies_it() {
    let folder = Folder::new();
    let rows: String = (0..400).map(|i| format!("{} {} 0\n", i % 20, i / 20)).collect();
    let cloud = folder.file("cloud.ply", ply("x y z", 400, &rows));
    let info = |path: &Path| -> serde_json::Value {
        serde_json::from_slice(&succeeds(&["info", text(path), "--json", "-"]).stdout).unwrap()
    };
    let before = info(&cloud);
    let strings = |value: &serde_json::Value| -> Vec<String> { serde_json::from_value(value.clone()).unwrap() };
    assert_eq!(strings(&before["lacks"]), ["normals", "a side for its normals", "radii", "colours"]);
    assert!((before["coverage"]["spacing"].as_f64().unwrap() - 1.0).abs() < 1e-6);
    let command = before["supplied_by"].as_str().unwrap().strip_prefix("epsplat ").unwrap().to_owned();
    assert!(String::from_utf8(succeeds(&["info", text(&cloud)]).stdout).unwrap().contains(&command));
    succeeds(&command.split(' ').collect::<Vec<_>>());
    let after = info(&folder.path("cloud.surfels.ply"));
    assert_eq!((strings(&after["lacks"]), after["supplied_by"].is_null()), (vec!["colours".to_owned()], true));
    assert_eq!(after["coverage"]["covered"].as_f64(), Some(1.0));
    // Disks too small to touch do not close the surface.
    let rows: String = (0..400).map(|i| format!("{} {} 0 0 0 1 0.3\n", i % 20, i / 20)).collect();
    let dots = folder.file("dots.ply", ply("x y z nx ny nz radius", 400, &rows));
    assert_eq!(strings(&info(&dots)["lacks"]), ["surfels that close the surface", "colours"]);
}

#[test]
fn info_tells_the_format_and_what_is_not_used() {
    let folder = Folder::new();
    let told = |path: &Path| String::from_utf8(succeeds(&["info", text(path)]).stdout).unwrap();
    let rows: String = (0..400).map(|i| format!("{} {} 0 {i} 3\n", i % 20, i / 20)).collect();
    let shaded = told(&folder.file("shaded.ply", ply("x y z intensity label", 400, &rows)));
    for line in [
        "  format    PLY, text\n",
        "  used      x, y, z, intensity\n",
        "  not used  label\n",
        "  colours   none; intensities are drawn as grey, from 0 (black) to 399 (white)\n",
    ] {
        assert!(shaded.contains(line), "{shaded}");
    }
    // Normals that only some points have: the others are estimated and counted.
    let rows: String = (0..400).map(|i| format!("{} {} 0 0 0 {}\n", i % 20, i / 20, i % 2)).collect();
    let half = told(&folder.file("half.ply", ply("x y z nx ny nz", 400, &rows)));
    assert!(half.contains("  normals   given for 200 of 400, the others estimated from neighbours\n"), "{half}");
    assert!(half.contains("  lacks     some normals, "), "{half}");
    let scan = told(&Path::new(DATA).join("autzen.laz"));
    assert!(
        scan.contains("  format    LAZ 1.") && scan.contains("point format") && scan.contains("  system    "),
        "{scan}"
    );
}

#[test]
fn inputs_have_one_white_and_alphas_can_be_left_out() {
    let folder = Folder::new();
    let tile = |x: i32, most: i32| -> String {
        (0..400).map(|i| format!("{} {} 0 {}\n", x + i % 20, i / 20, i * most / 400)).collect()
    };
    let dark = folder.file("dark.ply", ply("x y z intensity", 400, &tile(0, 400)));
    let light = folder.file("light.ply", ply("x y z intensity", 400, &tile(20, 4000)));
    let both = folder.path("both.ply");
    succeeds(&["surfels", text(&dark), text(&light), "-o", text(&both)]);
    let colors = epsplat::io::read(&both, &()).unwrap().colors.unwrap();
    let epsplat::low_level::scene::Colors::Srgb8(codes) = colors else { panic!() };
    assert_eq!((codes[799], codes[399][0].abs_diff(codes[440][0]) < 2), ([255; 4], true));
    let rows: String = (0..400).map(|i| format!("{} {} 0 200 100 50 {}\n", i % 20, i / 20, i % 7)).collect();
    let classes = folder.file("classes.ply", ply("x y z red green blue alpha", 400, &rows));
    let said = |options: &[&str]| {
        let out = folder.path("out.ply");
        let arguments = [&["surfels", text(&classes), "-o", text(&out)][..], options].concat();
        (String::from_utf8(succeeds(&arguments).stderr).unwrap(), epsplat::io::read(&out, &()).unwrap().colors.unwrap())
    };
    let (told, colors) = said(&[]);
    assert!(told.contains("its alpha is at most 6 of 255") && colors.linear(5)[3] < 0.03, "{told}");
    let (told, colors) = said(&["--ignore-alpha"]);
    assert!(!told.contains("alpha") && colors.linear(5)[3] == 1.0, "{told}");
}

#[test]
fn simplify_keeps_the_picture_with_fewer_surfels() {
    let folder = Folder::new();
    let (dense, sparse, report) = (folder.path("torus.ply"), folder.path("few.ply"), folder.path("report.json"));
    succeeds(&["generate", "torus", "--count", "20000", "-o", text(&dense)]);
    let simplify = ["simplify", text(&dense), "-o", text(&sparse), "--tolerance", "rel:0.001"];
    let output = succeeds(&[&simplify[..], &["--shape", "ellipse", "--relax", "2", "--json", text(&report)]].concat());
    assert!(output.stdout.is_empty());
    let report: serde_json::Value = serde_json::from_slice(&std::fs::read(&report).unwrap()).unwrap();
    let info: serde_json::Value =
        serde_json::from_slice(&succeeds(&["info", text(&sparse), "--json", "-"]).stdout).unwrap();
    assert_eq!(report["surfels"], 20_000);
    assert_eq!(report["selected"], info["points"]);
    assert!(report["selected"].as_u64().unwrap() < 4_000, "{report}");
    assert!(report["max_deviation"].as_f64().unwrap() <= report["tolerance"].as_f64().unwrap() * (1.0 + 1e-9));
    let alpha = |cloud: &Path, name: &str| {
        let image = folder.path(name);
        let eye = ["--eye", "0,-3,2", "--target", "0,0,0", "--size", "128x128", "--backend", "reference"];
        succeeds(&[&["render", text(cloud), "-o", text(&image)][..], &eye].concat());
        epsplat::io::exr::read(&image).unwrap().color.iter().map(|c| c[3] > 0.0).collect::<Vec<_>>()
    };
    let pairs = alpha(&dense, "dense.exr").into_iter().zip(alpha(&sparse, "sparse.exr")).collect::<Vec<_>>();
    let (covered, different) = (pairs.iter().filter(|p| p.0).count(), pairs.iter().filter(|p| p.0 != p.1).count());
    // The outlines are less than half a pixel apart on average: differing pixels are compared with
    // the crossings of the first outline by rows and columns.
    let crossed = |step: usize| (0..pairs.len() - step).filter(|&k| pairs[k].0 != pairs[k + step].0).count();
    let crossings = crossed(1) + crossed(128);
    assert!(covered > 3_000 && 2 * different < crossings, "{different} of {covered}, {crossings}");
    let text = String::from_utf8(succeeds(&simplify).stdout).unwrap();
    assert!(text.contains("of 20000 surfels") && text.contains("deviation"), "{text}");
    fails(&["simplify", "x.ply", "-o", "y.obj"], 2, &[".ply"]);
    fails(&["simplify", "x.ply", "-o", "y.ply", "--tolerance", "0.1"], 2, &["rel:E", "abs:E"]);
    fails(&["simplify", "no.ply", "-o", "y.ply"], 1, &["no.ply"]);
}

/// A mesh's triangles are drawn alone and beside surfels; options that do not apply to them are
/// refused in a sentence.
const CLOUD: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\n";

#[test]
fn triangles_are_drawn_alone_and_beside_surfels() {
    let folder = Folder::new();
    let (bunny, cube) = (format!("{DATA}/bunny.obj"), format!("{DATA}/cube.obj"));
    let painted = format!("{DATA}/cube.png");
    let image = folder.path("t.png");
    let with = |more: &[&'static str]| {
        let mut all = vec!["render", "--backend", "reference", "--size", "32x32", "-o"];
        all.extend(more);
        all
    };
    let image = text(&image);
    let alone = succeeds(&["render", "--triangles", &bunny, "-o", image, "--size", "32x32", "--backend", "reference"]);
    let told = String::from_utf8(alone.stderr).unwrap();
    assert!(told.contains("3674 triangles drawn") && !told.contains("surfels"), "{told}");
    let beside =
        ["render", &bunny, "--triangles", &cube, "--triangle-texture", &painted, "-o", image, "--size", "32x32"];
    let told = |more: &[&str]| {
        let all = [&beside[..], &["--backend", "reference"], more].concat();
        String::from_utf8(succeeds(&all).stderr).unwrap()
    };
    assert!(told(&[]).contains(" 3686 triangles drawn"), "{}", told(&[]));
    let surfels = told(&["--mesh", "surfels"]);
    assert!(surfels.contains("surfels and 12 triangles drawn"), "{surfels}");
    // An option of surfels has them drawn, with a note.
    let kernel = told(&["--kernel", "hat"]);
    assert!(kernel.contains("as surfels, which --kernel is for") && kernel.contains("surfels and 12"), "{kernel}");
    fails(&[&beside[..], &["--mesh", "quads"]].concat(), 2, &["triangles or surfels"]);
    fails(&[&beside[..], &["--smooth", "200"]].concat(), 2, &["0 and 180"]);
    let info = String::from_utf8(succeeds(&["info", &bunny]).stdout).unwrap();
    assert!(info.contains("--mesh surfels"), "{info}");
    let points = folder.file("p.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n");
    let flat = folder.file("f.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 1 2\n");
    let scan = format!("{DATA}/autzen.laz");
    let by = |file: &str, more: &[&str], code: i32, words: &[&str]| {
        let all = [&["render", "--triangles", file, "-o", image, "--backend", "reference"][..], more].concat();
        fails(&all, code, words);
    };
    by(text(&points), &[], 1, &["p.obj", "no triangle"]);
    by(text(&flat), &[], 1, &["f.obj", "area"]);
    by(&scan, &[], 1, &["autzen.laz", "only PLY, OBJ, STL"]);
    by("absent.obj", &[], 1, &["absent.obj"]);
    by(&bunny, &["--triangle-texture", &painted], 1, &["bunny.obj", "texture coordinates"]);
    by(&cube, &["--composite", "moments"], 2, &["--composite layers or sorted"]);
    by(&cube, &["--join", "glued"], 2, &["corrected, nearest or blended"]);
    fails(&[&with(&[])[..], &[image, "--join", "nearest", "--mesh", "surfels", &bunny]].concat(), 2, &["--triangles"]);
    // Options that triangles do not have are refused, not left out.
    fails(&[&with(&[])[..], &[image, "--mesh", "triangles", "--opacity", "0.5", &bunny]].concat(), 2, &["--opacity"]);
    let warned = succeeds(&[&with(&[])[..], &[image, "--smooth", "30", text(&folder.file("c.obj", CLOUD))]].concat());
    let warned = String::from_utf8(warned.stderr).unwrap();
    assert!(warned.contains("no input is a mesh"), "{warned}");
    let half = folder.file("half.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 5 5 5\nf 1 2 3\n");
    let told = String::from_utf8(succeeds(&[&with(&[])[..], &[image, text(&half)]].concat()).stderr).unwrap();
    assert!(told.contains("1 vertices of no triangle"), "{told}");
    let painted = [image, "--triangle-texture", &painted, &cube];
    fails(&[&with(&[])[..], &painted].concat(), 2, &["--triangle-texture", "take --texture"]);
    fails(&with(&["t.png"]), 2, &["INPUTS"]);
}

#[test]
fn views_have_names_and_angles() {
    let folder = Folder::new();
    let (bunny, image) = (format!("{DATA}/bunny.obj"), folder.path("v.png"));
    let eye = |more: &[&str]| {
        let small = ["render", &bunny, "-o", text(&image), "--size", "16", "--backend", "reference", "--json", "-"];
        let written = String::from_utf8(succeeds(&[&small[..], more].concat()).stdout).unwrap();
        let report: serde_json::Value = serde_json::from_str(&written).unwrap();
        let at = |name: &str| [0, 1, 2].map(|axis| report["view"][name][axis].as_f64().unwrap());
        let (eye, target) = (at("eye"), at("target"));
        [0, 1, 2].map(|axis| eye[axis] - target[axis])
    };
    let along = |direction: [f64; 3]| {
        let length = direction.map(|x| x * x).iter().sum::<f64>().sqrt();
        direction.map(|x| ((x / length) * 1e6).round() / 1e6 + 0.0)
    };
    // The bunny's up is y, so its front is +z and west is -x.
    assert_eq!(along(eye(&["--view", "front"])), [0.0, 0.0, 1.0]);
    assert_eq!(along(eye(&["--from", "left"])), [-1.0, 0.0, 0.0]);
    assert_eq!(along(eye(&["--view", "top", "--ortho"])), [0.0, 1.0, 0.0]);
    let [rise, run] = [0.5, 0.75f64.sqrt()];
    assert_eq!(along(eye(&["--azimuth", "270"])), along([-run, rise, 0.0]));
    assert_eq!(along(eye(&["--elevation", "-90", "--azimuth", "7"])), [0.0, -1.0, 0.0]);
    let refuses = |more: &[&str], words: &[&str]| {
        fails(&[&["render", &bunny, "-o", text(&image)][..], more].concat(), 2, words);
    };
    refuses(&["--elevation", "91"], &["-90 and 90"]);
    refuses(&["--view", "frnt"], &["front, back", "frnt"]);
    refuses(&["--eye", "1,2,3", "--ortho"], &["--ortho", "HEIGHT"]);
    refuses(&["--ortho", "-3"], &["--ortho", "must be positive"]);
    refuses(&["--ortho", "fut"], &["fit or a height"]);
    refuses(&["--background", "whit"], &["#RRGGBB"]);
    refuses(&["--size", "0"], &["0x0"]);
    refuses(&["--edl", "0"], &["above 0"]);
}

#[test]
fn eye_dome_lighting_darkens_outlines_and_leaves_the_depths() {
    let folder = Folder::new();
    let bunny = format!("{DATA}/bunny.obj");
    let draw = |name: &str, more: &[&str]| {
        let image = folder.path(name);
        let plain =
            ["render", &bunny, "-o", text(&image), "--size", "48", "--backend", "reference", "--shading", "unlit"];
        succeeds(&[&plain[..], more].concat());
        epsplat::io::exr::read(&image).unwrap()
    };
    let plain = draw("plain.exr", &["--aov", "depth"]);
    let lit = draw("lit.exr", &["--aov", "depth", "--edl"]);
    let strong = draw("strong.exr", &["--edl", "4"]);
    let depth = epsplat::low_level::scene::Map::Depth;
    assert_eq!(plain.map(depth), lit.map(depth));
    assert!(strong.map(depth).is_none());
    let light = |frame: &epsplat::Frame| frame.color.iter().map(|color| f64::from(color[1])).sum::<f64>();
    assert!(light(&lit) < 0.99 * light(&plain) && light(&strong) < 0.97 * light(&lit));
    // The middle of the body faces the camera.
    let middle = 24 * 48 + 24;
    assert!(lit.color[middle][1] > 0.8 * plain.color[middle][1]);
}
