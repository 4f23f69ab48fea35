//! Lists the WGSL files in `wgsl/`, so that a new kernel needs only its file.

use std::fmt::Write;
use std::path::Path;
use std::{env, fs, io};

fn main() -> io::Result<()> {
    let variable = |name: &str| env::var(name).map_err(io::Error::other);
    let folder = Path::new(&variable("CARGO_MANIFEST_DIR")?).join("wgsl");
    println!("cargo::rerun-if-changed=wgsl");
    let mut paths = Vec::new();
    for stage in fs::read_dir(&folder)? {
        for file in fs::read_dir(stage?.path())? {
            paths.push(file?.path());
        }
    }
    paths.retain(|path| path.extension().is_some_and(|extension| extension == "wgsl"));
    // Sorted by name alone, as modules refer to files without their folders.
    paths.sort_by(|one, other| one.file_name().cmp(&other.file_name()));
    let mut list = String::from("/// Every file of `wgsl/`: name and text.\npub const FILES: &[(&str, &str)] = &[\n");
    for path in &paths {
        let Some(name) = path.file_name() else { continue };
        writeln!(list, "    ({name:?}, include_str!({path:?})),").map_err(io::Error::other)?;
    }
    list.push_str("];\n");
    fs::write(Path::new(&variable("OUT_DIR")?).join("kernels.rs"), list)
}
