//! Files on servers: the same points as those of local files, and one sentence for each way in
//! which a server can misbehave. The servers are in this process.

use super::copc_made::{Made, copc};
use super::data;
use super::server::{Manner, Sent, Server, bytes};
use epsplat::Points;
use epsplat::io::las::Copc;
use epsplat::io::remote::{Opened, Patience, Remote};
use epsplat::io::{self, Input, ReadOptions};
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;
use std::time::{Duration, Instant};

/// Size of the first range, and of each range behind a jump, bytes.
const BLOCK: u64 = 1 << 14;

/// Largest gap between ranges that are read together, bytes.
const GAP: u64 = 1 << 10;

/// Longest stall in these tests.
const STALL: Duration = Duration::from_millis(600);

fn patience() -> Patience {
    Patience::of_stall(STALL)
}

fn file(name: &str) -> (String, Vec<u8>) {
    (name.to_owned(), std::fs::read(data(name)).unwrap())
}

/// A file of these bytes under the name `a`.
fn a(bytes: &[u8]) -> [(String, Vec<u8>); 1] {
    [("a".to_owned(), bytes.to_vec())]
}

/// 100,000 bytes, no two runs of which are alike.
fn noise() -> Vec<u8> {
    (0..25_000u32).flat_map(|k| k.wrapping_mul(0x9e37_79b9).to_le_bytes()).collect()
}

fn ranges(address: &str) -> std::io::Result<Remote> {
    Remote::open(address, patience()).map(|opened| match opened {
        Opened::Ranges(remote) => remote,
        Opened::Whole(..) => panic!("the server sends ranges"),
    })
}

/// Reads the file `a` of a server with these manners to its end.
fn whole(manners: impl Fn(&super::server::Asked) -> Manner + Send + Sync + 'static) -> Result<Vec<u8>, String> {
    let server = Server::with(a(&noise()), manners);
    let mut read = Vec::new();
    let mut remote = match Remote::open(&server.address("a"), patience()).map_err(|error| error.to_string())? {
        Opened::Ranges(remote) => Box::new(remote) as Box<dyn Read>,
        Opened::Whole(whole, _) => whole,
    };
    remote.read_to_end(&mut read).map_err(|error| error.to_string())?;
    Ok(read)
}

#[test]
fn any_range_is_that_of_the_file() {
    let noise = noise();
    let server = Server::new(a(&noise));
    let mut remote = ranges(&server.address("a")).unwrap();
    assert_eq!(remote.length(), 100_000);
    let mut random = super::Random(7);
    for _ in 0..300 {
        let (at, length) = (random.below(100_100), random.below(40_000));
        let expected = &noise[at.min(100_000)..(at + length).min(100_000)];
        let mut read = Vec::new();
        if random.below(2) == 0 {
            remote.seek(SeekFrom::Start(at as u64)).unwrap();
            (&mut remote).take(length as u64).read_to_end(&mut read).unwrap();
        } else {
            remote.read_at(at as u64, length as u64, &mut read).unwrap();
        }
        assert_eq!(read, expected, "{length} bytes at {at}");
    }
    // Received bytes are kept, so the server sends few bytes twice.
    assert!(bytes(&server.sent()) < 300_000);
    // Ranges that are expected come together, and nothing else is asked for afterwards.
    let remote = ranges(&server.address("a")).unwrap();
    remote.expect([50_000..50_010, 20_000..20_100, 21_000..21_100, 99_990..200_000]).unwrap();
    let asked = |sent: Vec<Sent>| {
        let mut asked: Vec<_> = sent.into_iter().map(|sent| sent.asked.range.unwrap()).collect();
        asked.sort_by_key(|range| range.start);
        asked
    };
    assert_eq!(asked(server.sent()), [0..BLOCK, 20_000..21_100, 50_000..50_010, 99_990..100_000]);
    for (at, length) in [(50_002, 8), (20_050, 1_000), (99_995, 100)] {
        remote.read_at(at, length, &mut Vec::new()).unwrap();
    }
    assert!(server.sent().is_empty());
    // Files that are empty, or shorter than the first range.
    for length in [0, 1, BLOCK as usize - 1, BLOCK as usize, BLOCK as usize + 1] {
        let server = Server::new(a(&noise[..length]));
        let mut read = Vec::new();
        ranges(&server.address("a")).unwrap().read_to_end(&mut read).unwrap();
        assert_eq!(read, noise[..length]);
    }
}

fn octree(levels: u32) -> (Made, tempfile::TempDir) {
    let (made, folder) = (copc([1000.0, 2000.0], 100.0, levels), tempfile::tempdir().unwrap());
    std::fs::write(folder.path().join("a.copc.laz"), &made.bytes).unwrap();
    (made, folder)
}

fn opened(path: impl AsRef<Path>) -> Copc {
    Copc::open(Input::open(path.as_ref(), None).unwrap()).unwrap().unwrap()
}

#[test]
fn a_remote_octree_reads_what_the_local_one_does() {
    let (made, folder) = octree(5);
    let server = Server::new([("a.copc.laz".to_owned(), made.bytes.clone())]);
    let mut here = opened(folder.path().join("a.copc.laz"));
    let mut there = opened(server.address("a.copc.laz"));
    // The first range with the header, and the page of the octree with the header of its record.
    let opening = bytes(&server.sent());
    assert!(opening <= BLOCK + made.page.1 + BLOCK, "{opening}");
    assert_eq!(here.octree, there.octree);
    let corner = |node: &epsplat::low_level::scene::octree::OctreeNode| {
        node.place[..2].iter().all(|place| place << 2 >> node.level == 0 || node.level < 2)
    };
    let nodes: Vec<usize> = (0..here.octree.nodes.len()).filter(|&node| corner(&here.octree.nodes[node])).collect();
    let options = ReadOptions::default();
    let [local, remote] = [&mut here, &mut there].map(|file| file.read(&nodes, &options, &()).unwrap());
    assert!(local.positions.len() > 20_000 && local == remote);
    let sent = server.sent();
    // Heads of chunks, then needed layers; small gaps between them come along.
    let bound = here.bytes_read(&nodes) + 2 * nodes.len() as u64 * GAP;
    assert!(bytes(&sent) <= bound, "{} of {bound}", bytes(&sent));
    assert!(10 * bytes(&sent) < 4 * made.bytes.len() as u64, "{} of {}", bytes(&sent), made.bytes.len());
    eprintln!(
        "{} nodes: {} requests, {} bytes; local {}; file {}",
        nodes.len(),
        sent.len(),
        bytes(&sent),
        here.bytes_read(&nodes),
        made.bytes.len()
    );
    // The same nodes again: colours are known now, so intensities are not needed, and what was
    // received is kept.
    assert_eq!(there.read(&nodes, &options, &()).unwrap().positions.len(), local.positions.len());
    assert!(bytes(&server.sent()) * 10 < bytes(&sent));
    // The control: all nodes are more bytes than the bound allows.
    let all: Vec<usize> = (0..here.octree.nodes.len()).collect();
    let points = there.read(&all, &options, &()).unwrap();
    assert_eq!(points.positions.len() as u64, made.points);
    assert!(bytes(&server.sent()) > bound);
}

/// Reads a file of the repository from its server and from here.
fn both(name: &str, server: &Server) -> [Points; 2] {
    [io::read(Path::new(&server.address(name)), &()).unwrap(), io::read(&data(name), &()).unwrap()]
}

#[test]
fn whole_files_have_the_points_of_local_ones() {
    let names = ["autzen.laz", "simple.copc.laz", "bunny.obj"];
    let server = Server::new(names.map(file));
    for name in names {
        let [there, here] = both(name, &server);
        assert!(there == here && !here.positions.is_empty(), "{name}");
        let (sent, length) = (server.sent(), std::fs::metadata(data(name)).unwrap().len());
        assert!(bytes(&sent) <= length + length / 10 + 4 * BLOCK, "{name}: {} of {length}", bytes(&sent));
        // An extension may be hidden by a query, or missing.
        let server = Server::new([("b".to_owned(), file(name).1), (name.to_owned(), file(name).1)]);
        let queried = io::read(Path::new(&format!("{}?key=1/2.ply", server.address(name))), &()).unwrap();
        assert!(queried.positions == here.positions, "{name}");
        if name != "bunny.obj" {
            let bare = io::read(Path::new(&server.address("b")), &()).unwrap();
            assert!(bare.positions == here.positions, "{name}");
        }
    }
    // The control: another file has other points.
    let other = Server::new([("autzen.laz".to_owned(), file("simple.copc.laz").1)]);
    let [there, here] = both("autzen.laz", &other);
    assert!(there != here);
}

#[test]
fn las_and_ply_are_read_in_place() {
    let (made, folder) = octree(4);
    let points = io::read(&folder.path().join("a.copc.laz"), &()).unwrap();
    assert_eq!(points.positions.len() as u64, made.points);
    let rows: Vec<u8> = points.positions.iter().flatten().flat_map(|part| (*part as f32).to_le_bytes()).collect();
    let header = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\nend_header\n",
        points.positions.len()
    );
    let ply = [header.into_bytes(), rows].concat();
    let mut las = las::Writer::from_path(folder.path().join("a.las"), las::Header::default()).unwrap();
    for &[x, y, z] in &points.positions {
        las.write_point(las::Point { x: x - 1000.0, y: y - 2000.0, z, ..las::Point::default() }).unwrap();
    }
    las.close().unwrap();
    drop(las);
    std::fs::write(folder.path().join("a.ply"), &ply).unwrap();
    let las = std::fs::read(folder.path().join("a.las")).unwrap();
    let files = [("a.ply", ply), ("a.las", las), ("a.copc.laz", made.bytes.clone())];
    let server = Server::new(files.map(|(name, bytes)| (name.to_owned(), bytes)));
    for name in ["a.ply", "a.las", "a.copc.laz"] {
        let here = io::read(&folder.path().join(name), &()).unwrap();
        assert!(io::read(Path::new(&server.address(name)), &()).unwrap() == here, "{name}");
        let longest = server.sent().iter().map(|sent| sent.bytes).max().unwrap();
        assert!(longest <= 1 << 20, "{name}: {longest}");
    }
}

#[test]
fn a_server_without_ranges_sends_the_whole_file() {
    let names = ["autzen.laz", "simple.copc.laz", "bunny.obj"];
    let server = Server::with(names.map(file), |_| Manner::Whole);
    for name in names {
        let [there, here] = both(name, &server);
        assert!(there == here, "{name}");
        assert_eq!(server.sent().len(), 1);
    }
    // A length beyond the limit of copies is refused before anything is copied.
    let server = Server::with([file("autzen.laz")], |_| {
        Manner::Headers(vec![("Content-Length", (1u64 << 33).to_string()), ("Content-Range", String::new())])
    });
    let told = io::read(Path::new(&server.address("autzen.laz")), &()).unwrap_err().to_string();
    assert!(told.contains("the server"), "{told}");
}

#[test]
fn lost_connections_are_made_again() {
    let noise = noise();
    // The connection ends within the body, before the answer, or the server is busy: once each.
    let busy = || Manner::Status(503, vec![("Retry-After", "0".to_owned())]);
    for (name, manner) in [
        ("dies", Manner::Die(1000)),
        ("dies at once", Manner::Die(0)),
        ("hangs up", Manner::Hang),
        ("is busy", busy()),
        ("has too many requests", Manner::Status(429, Vec::new())),
    ] {
        for which in [0, 1] {
            let manner = manner.clone();
            let read = whole(move |asked| if asked.number == which { manner.clone() } else { Manner::Well });
            assert!(read.as_deref() == Ok(&noise[..]), "{name}, request {which}: {:?}", read.map(|read| read.len()));
        }
    }
    // Bytes that arrived before the connection was lost are not sent again.
    let server = Server::with(a(&noise), |asked| if asked.number == 1 { Manner::Die(10_000) } else { Manner::Well });
    let mut read = Vec::new();
    ranges(&server.address("a")).unwrap().read_to_end(&mut read).unwrap();
    assert!(read == noise && bytes(&server.sent()) == 100_000);
}

#[test]
fn each_misbehaviour_is_one_sentence() {
    let with = |name: &'static str, value: &str| Manner::Headers(vec![(name, value.to_owned())]);
    let cases = [
        ("dies always", Manner::Die(100), "the server ended the connection after", 1),
        ("hangs up always", Manner::Hang, "the server ended the connection", 1),
        ("is busy always", Manner::Status(503, Vec::new()), "the server answers 503 Service Unavailable, 4 times", 1),
        ("stalls", Manner::Stall(100), "the server sent nothing for 0.6 seconds", 1),
        ("stalls before the body", Manner::Stall(0), "the server sent nothing for 0.6 seconds", 1),
        ("is silent", Manner::Silence, "the server sent nothing for 0.6 seconds", 1),
        ("drips", Manner::Drip(Duration::from_millis(20)), "the server sends too slowly", 1),
        ("is not there", Manner::Status(404, Vec::new()), "the server answers 404 Not Found", 1),
        ("refuses", Manner::Status(403, Vec::new()), "403 Forbidden: it may need a password", 1),
        ("sends other bytes", with("Content-Range", "bytes 5-16388/100000"), "bytes 5 to 16388 of 100000", 0),
        ("sends fewer bytes", with("Content-Range", "bytes 0-99/100000"), "bytes 0 to 99 of 100000", 0),
        ("says nonsense", with("Content-Range", "all of it"), "does not say which bytes it sends", 1),
        ("says nothing", with("Content-Range", ""), "does not say which bytes it sends", 1),
        ("knows no length", with("Content-Range", "bytes 0-16383/*"), "does not say which bytes it sends", 0),
        ("sends more", Manner::Longer(5), "the server says that it sends bytes", 1),
        ("promises less", with("Content-Length", "100"), "in 100 bytes", 1),
        ("compresses", with("Content-Encoding", "gzip"), "the server sends it encoded as gzip", 1),
        ("changes its tag", with("ETag", "\"2\""), "the file on the server changed while it was read", 1),
        ("changes its time", with("Last-Modified", "now"), "the file on the server changed while it was read", 1),
        ("changes the length", with("Content-Range", "bytes 16384-32767/9"), "changed while it was read", 1),
        ("sends all", Manner::Whole, "the server sends the whole file, where bytes 16384 to", 1),
        ("cuts", Manner::Status(416, Vec::new()), "the file on the server changed while it was read", 1),
    ];
    for (name, manner, said, least) in cases {
        for which in least..=1usize.max(least) {
            let manner = manner.clone();
            let start = Instant::now();
            let told = whole(move |asked| {
                let tagged = vec![("ETag", "\"1\"".to_owned()), ("Last-Modified", "then".to_owned())];
                if asked.number >= which { manner.clone() } else { Manner::Headers(tagged) }
            });
            let told = told.expect_err(name);
            assert!(told.contains(said) && told.lines().count() == 1 && told.len() < 200, "{name}, {which}: {told}");
            // A server that drips is slower than the slowest that is waited for only after a while.
            assert!(start.elapsed() < STALL * 2 + Duration::from_millis(1500), "{name}: {:?}", start.elapsed());
        }
    }
}

#[test]
fn redirects_are_followed_and_circles_end() {
    let to = |place: &'static str| move || Manner::Status(302, vec![("Location", place.to_owned())]);
    let [on, round] = [to("/a"), to("/round")];
    let server = Server::with(a(&noise()), move |asked| match asked.path.as_str() {
        "on" => on(),
        "round" => round(),
        _ => Manner::Well,
    });
    let mut read = Vec::new();
    ranges(&server.address("on")).unwrap().read_to_end(&mut read).unwrap();
    assert!(read == noise());
    let told = ranges(&server.address("round")).unwrap_err().to_string();
    assert_eq!(told, "the server redirects in a circle");
}

#[test]
fn secrets_go_to_the_server_and_into_no_message() {
    let server = Server::with(a(&noise()), |asked| match asked.authorization.as_deref() {
        // "me:secret" in base 64.
        Some("Basic bWU6c2VjcmV0") if asked.query == "key=secret" => Manner::Well,
        _ => Manner::Status(401, Vec::new()),
    });
    let secret = format!("http://me:secret@{}/a?key=secret", server.host());
    assert!(ranges(&secret).is_ok() && ranges(&server.address("a")).is_err());
    for path in [secret, format!("http://me:secret@{}/none.laz?key=secret", server.host())] {
        let told = io::read(Path::new(&path), &()).unwrap_err().to_string();
        assert!(!told.contains("secret") && told.contains(&server.host()), "{told}");
    }
}

#[test]
fn damage_in_a_remote_file_is_told_as_in_a_local_one() {
    let folder = tempfile::tempdir().unwrap();
    let whole = std::fs::read(data("simple.copc.laz")).unwrap();
    let mut spoiled = whole.clone();
    spoiled[3000..3400].fill(0xaa);
    for (name, bytes) in [("cut.laz", &whole[..30_000]), ("spoiled.laz", &spoiled[..]), ("none.laz", &b"LAS"[..])] {
        std::fs::write(folder.path().join(name), bytes).unwrap();
        let server = Server::new([(name.to_owned(), bytes.to_vec())]);
        let path = folder.path().join(name);
        let paths = [path.to_str().unwrap().to_owned(), server.address(name)];
        let [here, there] = paths.map(|path| match io::read(Path::new(&path), &()) {
            Ok(points) => format!("{:?} {:?}", points.positions.len(), points.unread).replace(&path, "PATH"),
            Err(error) => error.to_string().replace(&path, "PATH"),
        });
        assert_eq!(here, there);
        assert!(here.contains("PATH"), "{here}");
    }
}

#[test]
fn a_reader_takes_no_lost_server_for_damage() {
    // Every request from some number on fails; no point of the rest is read.
    for name in ["simple.copc.laz", "autzen.laz"] {
        let least = {
            let server = Server::new([file(name)]);
            io::read(Path::new(&server.address(name)), &()).unwrap();
            server.sent().len()
        };
        for good in 0..least {
            let server = Server::with([file(name)], move |asked| match asked.number < good {
                true => Manner::Well,
                false => Manner::Status(410, Vec::new()),
            });
            let address = server.address(name);
            let told = io::read(Path::new(&address), &()).unwrap_err().to_string();
            assert_eq!(told, format!("cannot read {address}: the server answers 410 Gone"), "{good} of {least}");
        }
    }
}
