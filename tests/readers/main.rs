//! The readers on valid files of every supported kind, and on damaged ones.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod attributes;
mod copc;
#[cfg(feature = "http")]
#[path = "../common/copc_made.rs"]
mod copc_made;
mod e57;
#[cfg(feature = "e57")]
#[path = "../common/e57_page.rs"]
mod e57_page;
mod gaussians;
#[cfg(feature = "gltf")]
mod gltf;
mod las;
mod las_damage;
#[path = "../common/las_forms.rs"]
mod las_forms;
mod las_headers;
#[cfg(feature = "gltf")]
#[path = "../common/gltf_made.rs"]
mod made;
mod mesh;
mod obj;
mod off;
#[cfg(feature = "pcd")]
mod pcd;
mod ply;
mod ply_damage;
#[cfg(feature = "e57")]
#[path = "../common/random.rs"]
mod random;
mod ranges;
#[cfg(feature = "http")]
mod remote;
#[cfg(feature = "http")]
#[path = "../common/server.rs"]
mod server;
mod stl;
mod text;
mod text_colors;

use epsplat::io::{self, Format, Points, ReadOptions};
use epsplat::{Error, Progress};
pub use random::Random;
use std::path::Path;
use std::sync::atomic::{AtomicI64, AtomicU64, Ordering};
use tempfile::TempDir;

/// A temporary folder for files to be read.
pub(crate) struct Folder(TempDir);

impl Folder {
    /// Creates an empty folder.
    pub fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    /// Path of a file in the folder.
    pub fn path(&self, name: &str) -> std::path::PathBuf {
        self.0.path().join(name)
    }

    /// Writes `bytes` to a file called `name` and reads it.
    pub fn read(&self, name: &str, bytes: &[u8]) -> Result<Points, Error> {
        let path = self.path(name);
        std::fs::write(&path, bytes).unwrap();
        io::read(&path, &())
    }

    /// Returns the error for `bytes`, which must be one sentence that names the file.
    pub fn refusal(&self, name: &str, bytes: &[u8]) -> String {
        let Err(error) = self.read(name, bytes) else { panic!("{name} was read") };
        sentence(&error, &self.path(name))
    }
}

/// Checks that an error is one line about `path`, and returns the text after the path.
pub fn sentence(error: &Error, path: &Path) -> String {
    let message = error.to_string();
    let prefix = format!("{}: ", path.display());
    assert!(message.lines().count() == 1 && message.len() < 400 + prefix.len(), "{message}");
    assert!(matches!(error, Error::Malformed { .. }), "{message}");
    message.strip_prefix(&prefix).unwrap_or_else(|| panic!("{message}")).to_owned()
}

/// Counts the progress messages.
#[derive(Default)]
struct Count {
    announced: AtomicU64,
    advanced: AtomicU64,
    open: AtomicI64,
}

impl Progress for Count {
    fn begin(&self, what: &str, units: u64) {
        assert!(what.starts_with("reading "), "{what}");
        self.announced.fetch_add(units, Ordering::Relaxed);
        self.open.fetch_add(1, Ordering::Relaxed);
    }
    fn advance(&self, units: u64) {
        self.advanced.fetch_add(units, Ordering::Relaxed);
    }
    fn end(&self) {
        self.open.fetch_sub(1, Ordering::Relaxed);
    }
}

/// Path of a file in `data/`.
pub fn data(name: &str) -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("data").join(name)
}

#[test]
fn progress_adds_up_to_what_was_announced() {
    let folder = Folder::new();
    let ply = folder.path("a.ply");
    let vertices = "1 2 3\n".repeat(70_000);
    let header = "ply\nformat ascii 1.0\nelement vertex 70000\nproperty float x\nproperty float y\nproperty float z\n";
    std::fs::write(&ply, format!("{header}end_header\n{vertices}")).unwrap();
    for path in [ply, data("autzen.laz"), data("bunny.obj")] {
        let count = Count::default();
        io::read(&path, &count).unwrap();
        assert_eq!(count.announced.into_inner(), count.advanced.into_inner(), "{}", path.display());
        assert_eq!(count.open.into_inner(), 0);
    }
}

#[test]
fn files_are_known_by_extension_or_by_their_first_bytes() {
    let folder = Folder::new();
    let ply =
        b"ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nproperty float y\nproperty float z\nend_header\n";
    let laz = std::fs::read(data("autzen.laz")).unwrap();
    for name in ["a.ply", "a.PLY", "a", "a.txt"] {
        assert_eq!(folder.read(name, ply).unwrap().positions.len(), 0, "{name}");
    }
    for name in ["a.laz", "a.LAS", "a.copc.laz", "scan", "scan.bin"] {
        assert_eq!(folder.read(name, &laz).unwrap().positions.len(), 110_000, "{name}");
    }
    assert_eq!(folder.read("a.Obj", b"v 1 2 3").unwrap().positions.len(), 1);
    for unknown in [&b""[..], b"pl", b"plyx", b"v 1 2 3"] {
        let said = folder.refusal("a.dat", unknown);
        let optional = ["E57", "PCD"].into_iter().zip([cfg!(feature = "e57"), cfg!(feature = "pcd")]);
        let optional: String = optional.filter(|(_, is_read)| *is_read).map(|(name, _)| format!("{name}, ")).collect();
        let last = if cfg!(feature = "gltf") { ", OFF, GLB and GLTF" } else { " and OFF" };
        let formats = format!("PLY, LAS, LAZ, OBJ, {optional}XYZ, TXT, CSV, ASC, PTS, PTX, STL{last}");
        let expected =
            format!("its format is not known: {formats} files are read; if it is one, name it by --input-format");
        assert_eq!(said, expected);
    }
    let obj = ReadOptions { format: Some(Format::Obj), ..ReadOptions::default() };
    assert_eq!(io::read_with(&folder.path("a.dat"), obj.clone(), &()).unwrap().positions, [[1.0, 2.0, 3.0]]);
    // An explicit format takes precedence over the file name.
    folder.read("a.laz", &laz).unwrap();
    assert!(io::read_with(&folder.path("a.laz"), ReadOptions { format: Some(Format::Ply), ..obj }, &()).is_err());
    for start in [&b"# .PCD v.7"[..], b"#.pcd v0.7", b"VERSION .7", b"fields x y z", b"\xef\xbb\xbf# .PCD"] {
        std::fs::write(folder.path("scan"), start).unwrap();
        let said = io::read(&folder.path("scan"), &()).unwrap_err().to_string();
        assert!(said.contains("PCD"), "{start:?}: {said}");
    }
}

#[test]
fn missing_files_and_directories_cannot_be_read() {
    let folder = Folder::new();
    for name in ["a.ply", "a.las", "a.laz", "a.obj", "a", "no/such/a.ply"] {
        assert!(matches!(io::read(&folder.path(name), &()), Err(Error::Read { .. })), "{name}");
    }
    for name in ["d.ply", "d.las", "d.laz", "d.obj", "d"] {
        std::fs::create_dir(folder.path(name)).unwrap();
        let error = io::read(&folder.path(name), &()).unwrap_err();
        assert!(matches!(error, Error::Read { .. }), "{error}");
    }
}

/// A format that was not compiled in is refused with the name of its feature.
#[cfg(not(all(feature = "e57", feature = "gltf", feature = "pcd")))]
#[test]
fn readers_that_were_left_out_are_named() {
    let folder = Folder::new();
    let (e57, gltf, pcd) = (cfg!(not(feature = "e57")), cfg!(not(feature = "gltf")), cfg!(not(feature = "pcd")));
    for (format, first_bytes, left_out) in
        [("e57", &b"ASTM-E57"[..], e57), ("gltf", b"glTF", gltf), ("pcd", b"# .PCD v0.7", pcd)]
    {
        for (name, bytes) in [(format!("a.{format}"), b"".as_slice()), ("scan".into(), first_bytes)] {
            let said = folder.refusal(&name, bytes);
            assert_eq!(said.contains(&format!("'--features {format}'")), left_out, "{said}");
        }
    }
}
