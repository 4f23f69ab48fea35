//! Virtual point clouds (`.vpc`) and files on servers with `--lod`: a picture has the bits of the
//! local files, and asks for nothing that it does not show.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common;

use common::command::{Folder, epsplat, fails, succeeds, text};
use common::copc_made::{Made, copc};
use common::server::{Manner, Server, bytes};
use epsplat::io::las::Copc;
use epsplat::io::{Input, ReadOptions};
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

/// Size of a range behind a jump, and the largest gap that comes along, bytes.
const BLOCK: u64 = 1 << 14;
const GAP: u64 = 1 << 10;

/// Edge of a tile, world units.
const EDGE: f64 = 100.0;

/// Four tiles of a square, with their names.
fn tiles() -> Vec<(String, Made)> {
    let tile = |k: usize| {
        let corner = [k & 1, k >> 1].map(|part| 5000.0 + EDGE * part as f64);
        (format!("tile {k}.copc.laz").replace(' ', "-"), copc(corner, EDGE, 4))
    };
    (0..4).map(tile).collect()
}

/// The feature of a tile in a virtual point cloud, as PDAL writes it.
fn feature(href: &str, made: &Made) -> String {
    let [[x, y, z], [to_x, to_y, to_z]] = made.bounds;
    format!(
        r#"{{"type": "Feature", "stac_version": "1.0.0", "id": "{href}", "bbox": [7.0, 50.0, 7.1, 50.1],
            "assets": {{"data": {{"href": "{href}"}}}}, "links": [],
            "properties": {{"pc:count": {}, "pc:type": "lidar", "proj:bbox": [{x:?}, {y:?}, {z:?}, {to_x:?}, {to_y:?}, {to_z:?}]}}}}"#,
        made.points
    )
}

fn collection(features: &[String]) -> String {
    format!(r#"{{"type": "FeatureCollection", "features": [{}]}}"#, features.join(", "))
}

/// Writes the tiles and a virtual point cloud of them; returns the paths of the tiles.
fn written(folder: &Folder, tiles: &[(String, Made)]) -> Vec<String> {
    let features: Vec<String> = tiles.iter().map(|(name, made)| feature(&format!("./{name}"), made)).collect();
    folder.file("all.vpc", collection(&features));
    tiles.iter().map(|(name, made)| text(&folder.file(name, &made.bytes)).to_owned()).collect()
}

/// A view straight down on a part of the tile at this corner.
fn view(tile: usize) -> [String; 6] {
    let [x, y] = [tile & 1, tile >> 1].map(|part| 5050.0 + EDGE * part as f64);
    let [eye, target] = [60.0, 0.0].map(|height| format!("{x},{y},{height}"));
    ["--eye".into(), eye, "--target".into(), target, "--up".into(), "y".into()]
}

/// Renders inputs with `--lod` and these options; returns the picture and the report.
fn render(inputs: &[&str], options: &[String]) -> (Vec<u8>, serde_json::Value) {
    let folder = Folder::new();
    let output = folder.path("a.png");
    let options: Vec<&str> = options.iter().map(String::as_str).collect();
    let more = ["--lod", "2px", "--size", "128x128", "--json", "-", "-o", text(&output)];
    let run = succeeds(&[&["render"], inputs, &options, &more].concat());
    (std::fs::read(&output).unwrap(), serde_json::from_slice(&run.stdout).unwrap())
}

fn served(tiles: Vec<(String, Made)>) -> Vec<(String, Vec<u8>)> {
    let features: Vec<String> = tiles.iter().map(|(name, made)| feature(&format!("./{name}"), made)).collect();
    let mut files = vec![("all.vpc".to_owned(), collection(&features).into_bytes())];
    files.extend(tiles.into_iter().map(|(name, made)| (name, made.bytes)));
    files
}

#[test]
fn a_picture_of_a_virtual_point_cloud_is_that_of_its_tiles() {
    let (folder, tiles) = (Folder::new(), tiles());
    let paths = written(&folder, &tiles);
    let paths: Vec<&str> = paths.iter().map(String::as_str).collect();
    let vpc = folder.path("all.vpc");
    for tile in [0, 3] {
        let options = view(tile);
        let (of_tiles, _) = render(&paths, &options);
        let (of_vpc, report) = render(&[text(&vpc)], &options);
        assert!(of_tiles == of_vpc, "tile {tile}");
        // Nodes of one tile are counted.
        let all = report["read"]["points"][1].as_u64().unwrap();
        assert_eq!(all, tiles[tile].1.points);
        // The control: another view is another picture.
        let aside = options.map(|option| option.replace("50,", "57,"));
        assert!(render(&[text(&vpc)], &aside).0 != of_vpc);
    }
    let wide: Vec<String> = ["--eye", "5100,5100,300", "--target", "5100,5100,0", "--up", "y"].map(String::from).into();
    let (of_tiles, _) = render(&paths, &wide);
    assert!(of_tiles == render(&[text(&vpc)], &wide).0 && of_tiles != render(&paths[..1], &wide).0);
    // Without a camera, the corners of the tiles are framed.
    let (framed, report) = render(&[text(&vpc)], &[]);
    assert!(framed.len() > 1000 && report["read"]["points"][1].as_u64().unwrap() == 4 * tiles[0].1.points);
    // Without --lod, all tiles are read whole.
    let output = folder.path("whole.png");
    let whole = |inputs: &[&str]| {
        succeeds(&[&["render"], inputs, &["--size", "64x64", "-o", text(&output)]].concat());
        std::fs::read(&output).unwrap()
    };
    assert!(whole(&paths) == whole(&[text(&vpc)]));
}

#[test]
fn no_request_is_made_for_tiles_outside_the_view() {
    let (folder, tiles) = (Folder::new(), tiles());
    let paths = written(&folder, &tiles);
    let paths: Vec<&str> = paths.iter().map(String::as_str).collect();
    let length: u64 = tiles.iter().map(|(_, made)| made.bytes.len() as u64).sum();
    let server = Server::new(served(tiles));
    let vpc = server.address("all.vpc");
    for tile in [0, 3] {
        let (remote, report) = render(&[&vpc], &view(tile));
        let sent = server.sent();
        let other = |name: &str| name != "all.vpc" && name != format!("tile-{tile}.copc.laz");
        assert!(sent.iter().all(|sent| !other(&sent.asked.path)), "{sent:?}");
        assert!(remote == render(&paths, &view(tile)).0);
        let read = report["read"]["bytes"][0].as_u64().unwrap();
        eprintln!("tile {tile}: {} requests, {} bytes; nodes {read}; all tiles {length}", sent.len(), bytes(&sent));
        assert!(4 * bytes(&sent) < length && read > 0, "{} of {length}", bytes(&sent));
    }
    // The control: a wide view asks for all tiles.
    let wide: Vec<String> = ["--eye", "5100,5100,300", "--target", "5100,5100,0", "--up", "y"].map(String::from).into();
    render(&[&vpc], &wide);
    let sent = server.sent();
    assert!((0..4).all(|tile| sent.iter().any(|sent| sent.asked.path == format!("tile-{tile}.copc.laz"))));
    // A local collection may name remote tiles, and one that is not seen need not exist.
    let features: Vec<String> = self::tiles()
        .iter()
        .enumerate()
        .map(|(k, (name, made))| {
            let href = if k == 3 { server.address("gone.copc.laz") } else { server.address(name) };
            feature(&href, made)
        })
        .collect();
    let mixed = folder.file("mixed.vpc", collection(&features));
    assert!(render(&[text(&mixed)], &view(0)).0 == render(&paths, &view(0)).0);
    let output = folder.path("none.png");
    let gone =
        [["render", text(&mixed), "--lod", "2px", "-o", text(&output)].map(String::from).to_vec(), view(3).to_vec()];
    let gone: Vec<&str> = gone.iter().flatten().map(String::as_str).collect();
    fails(&gone, 1, &["cannot read http://", "gone.copc.laz: the server answers 404 Not Found"]);
    assert!(!output.exists());
}

#[test]
fn many_views_open_each_tile_once() {
    let tiles = tiles();
    let server = Server::new(served(tiles));
    let folder = Folder::new();
    let frame = |name: &str, [x, y]: [f64; 2]| {
        let rows = [[1.0, 0.0, 0.0, x], [0.0, 1.0, 0.0, y], [0.0, 0.0, 1.0, 60.0], [0.0, 0.0, 0.0, 1.0]];
        format!(r#"{{"file_path": "{name}", "transform_matrix": {rows:?}}}"#)
    };
    let frames = [frame("a", [5050.0, 5050.0]), frame("b", [5055.0, 5050.0]), frame("c", [5150.0, 5050.0])];
    let lens = r#""w": 96, "h": 96, "fl_x": 90, "fl_y": 90, "cx": 48, "cy": 48"#;
    let cameras = folder.file("transforms.json", format!(r#"{{{lens}, "frames": [{}]}}"#, frames.join(", ")));
    let output = folder.path("out");
    let vpc = server.address("all.vpc");
    succeeds(&["render", &vpc, "--cameras", text(&cameras), "--lod", "2px", "-o", text(&output)]);
    let sent = server.sent();
    let first = |tile: usize| {
        let of_tile = sent.iter().filter(|sent| sent.asked.path == format!("tile-{tile}.copc.laz"));
        of_tile.filter(|sent| sent.asked.range == Some(0..1 << 14)).count()
    };
    assert_eq!([0, 1, 2, 3].map(first), [1, 1, 0, 0]);
    // The bits of a view do not depend on those before it.
    let last = folder.file("last.json", format!(r#"{{{lens}, "frames": [{}]}}"#, frames[2]));
    let alone = folder.path("alone");
    succeeds(&["render", &vpc, "--cameras", text(&last), "--lod", "2px", "-o", text(&alone)]);
    let picture = |folder: &Path, name: &str| std::fs::read(folder.join(name)).unwrap();
    assert!(picture(&output, "c.png") == picture(&alone, "c.png"));
    assert!(picture(&output, "c.png") != picture(&output, "b.png"));
}

#[test]
fn tiles_that_are_not_what_is_stated_are_refused() {
    let (folder, tiles) = (Folder::new(), tiles());
    written(&folder, &tiles);
    let (name, made) = &tiles[0];
    let whole = feature(&format!("./{name}"), made);
    let output = folder.path("a.png");
    let check = |text_of: String, said: &str| {
        let vpc = folder.file("bad.vpc", text_of);
        let view = view(0);
        let mut run = vec!["render", text(&vpc), "--lod", "2px", "-o", text(&output)];
        run.extend(view.iter().map(String::as_str));
        fails(&run, 1, &[said]);
        assert!(!output.exists());
    };
    let smaller = Made { bounds: [made.bounds[0], made.bounds[1].map(|part| part - 1.0)], bytes: Vec::new(), ..*made };
    check(
        collection(&[feature(&format!("./{name}"), &smaller)]),
        "beyond the bounds that the virtual point cloud states",
    );
    let fewer = whole.replace(&format!("\"pc:count\": {}", made.points), "\"pc:count\": 7");
    check(collection(&[fewer]), "and the virtual point cloud states 7: build the .vpc file again");
    check(collection(std::slice::from_ref(&whole))[..200].to_owned(), "it is not a virtual point cloud in JSON");
    check(collection(&[whole.replace("href", "link")]), "names no file (assets.data.href)");
    check(collection(&[whole.replace("\"proj:bbox\": [", "\"proj:bbox\": [null, ")]), "are no box of 4 or 6 numbers");
    check(collection(&[whole.replace(".copc.laz\"}}", ".copc.txt\"}}")]), "cannot read ");
    folder.file("plain.copc.laz", std::fs::read(Path::new(common::command::DATA).join("autzen.laz")).unwrap());
    check(collection(&[whole.replace(name, "plain.copc.laz")]), "it is not a COPC file, although its name says so");
    // A command that needs one file says so.
    fails(&["info", text(&folder.path("all.vpc"))], 1, &["it is a virtual point cloud, and one file is needed"]);
}

#[test]
fn a_failing_server_leaves_one_sentence_and_no_picture() {
    let made = copc([0.0, 0.0], EDGE, 3);
    let name = "a.copc.laz";
    for (which, manner, said) in [
        (0, Manner::Stall(1000), "the server sent nothing for 1 second"),
        (2, Manner::Stall(10), "the server sent nothing for 1 second"),
        (2, Manner::Silence, "the server sent nothing for 1 second"),
        (1, Manner::Die(10), "the server ended the connection after"),
        (1, Manner::Headers(vec![("Content-Range", "bytes 1-2/3".into())]), "the file on the server changed"),
        (0, Manner::Status(404, Vec::new()), "the server answers 404 Not Found"),
    ] {
        let shared = manner.clone();
        let server = Server::with([(name.to_owned(), made.bytes.clone())], move |asked| match asked.number >= which {
            true => shared.clone(),
            false => Manner::Well,
        });
        let folder = Folder::new();
        let output = folder.path("a.png");
        let start = Instant::now();
        let run = Command::new(env!("CARGO_BIN_EXE_epsplat"))
            .args(["render", &server.address(name), "--lod", "2px", "--size", "64x64", "-o", text(&output)])
            .env("EPSPLAT_HTTP_TIMEOUT", "1")
            .output()
            .unwrap();
        let stderr = String::from_utf8(run.stderr).unwrap();
        let errors: Vec<&str> = stderr.lines().filter(|line| line.starts_with("error: ")).collect();
        assert_eq!((run.status.code(), errors.len()), (Some(1), 1), "{manner:?}: {stderr}");
        assert!(errors[0].contains(said) && errors[0].contains(&server.address(name)), "{manner:?}: {stderr}");
        assert!(!output.exists() && folder.names().is_empty(), "{manner:?}");
        assert!(start.elapsed() < Duration::from_secs(6), "{manner:?}: {:?}", start.elapsed());
    }
    // A limit that is none, and a server that is not there.
    let run = |address: &str, limit: &str| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_epsplat"));
        let run = command.args(["info", address]).env("EPSPLAT_HTTP_TIMEOUT", limit).output().unwrap();
        (run.status.code(), String::from_utf8(run.stderr).unwrap())
    };
    let (code, told) = run("http://127.0.0.1:9/a.laz", "soon");
    assert!(code == Some(1) && told.contains("EPSPLAT_HTTP_TIMEOUT is no number of seconds"), "{told}");
    let (code, told) = run("http://127.0.0.1:9/a.laz", "1");
    assert!(code == Some(1) && told.contains("the server refuses the connection"), "{told}");
}

#[test]
fn a_remote_picture_is_that_of_the_local_file() {
    let folder = Folder::new();
    let made = copc([0.0, 0.0], EDGE, 5);
    let local = folder.file("a.copc.laz", &made.bytes);
    let server = Server::new([("a.copc.laz".to_owned(), made.bytes.clone())]);
    let address = server.address("a.copc.laz");
    let mut copc_here = Copc::open(Input::open(&local, None).unwrap()).unwrap().unwrap();
    let nodes = copc_here.octree.overview();
    copc_here.read(&nodes, &ReadOptions::default(), &()).unwrap();
    let overview = copc_here.bytes_read(&nodes);
    for options in [
        vec![],
        vec!["--eye".into(), "20,20,30".into(), "--target".into(), "20,20,0".into(), "--up".into(), "y".into()],
    ] {
        let start = Instant::now();
        let (here, report) = render(&[text(&local)], &options);
        let here_took = start.elapsed();
        let start = Instant::now();
        let (there, other) = render(&[&address], &options);
        let there_took = start.elapsed();
        assert!(here == there && report["read"] == other["read"]);
        let (sent, read) = (server.sent(), report["read"]["bytes"][0].as_u64().unwrap());
        eprintln!(
            "{} requests, {} bytes; local nodes {read}; file {}; {there_took:?} against {here_took:?}",
            sent.len(),
            bytes(&sent),
            made.bytes.len()
        );
        // The header, the octree, the overview, and the nodes of the picture that are not in it.
        let bound = 3 * BLOCK + made.page.1 + overview + read + GAP * sent.len() as u64;
        assert!(bytes(&sent) <= bound && bound < made.bytes.len() as u64, "{} of {bound}", bytes(&sent));
    }
    // The control: other bytes are another picture.
    let other = Server::new([("a.copc.laz".to_owned(), copc([0.0, 0.0], EDGE, 3).bytes)]);
    assert!(render(&[&other.address("a.copc.laz")], &[]).0 != render(&[text(&local)], &[]).0);
    // Other commands read addresses too.
    let (output, small) = (folder.path("s.ply"), other.address("a.copc.laz"));
    succeeds(&["surfels", &small, "-o", text(&output)]);
    assert!(epsplat(&["info", &small]).stdout.len() > 100);
    // Levels of detail that `epsplat lod` wrote are read in part.
    let tree = folder.path("tree.ply");
    succeeds(&["lod", text(&output), "-o", text(&tree)]);
    let server = Server::new([("tree.ply".to_owned(), std::fs::read(&tree).unwrap())]);
    let options = ["--memory".into(), "1GiB".into()];
    assert!(render(&[&server.address("tree.ply")], &options).0 == render(&[text(&tree)], &options).0);
}
