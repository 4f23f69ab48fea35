//! Each thing has few homes: to add a map, a kernel function, a composite mode, a format or a
//! command, one changes few files.

#![allow(clippy::unwrap_used, clippy::panic)]

use std::path::Path;

use super::prose::files;

/// A thing that exists, and how code names it where it is declared and chosen.
struct Thing {
    what: &'static str,
    /// Where it may be named.
    rooms: &'static [&'static str],
    names: &'static [&'static str],
    /// The most files that name it.
    most: usize,
}

const THINGS: [Thing; 8] = [
    Thing { what: "a map", rooms: &["src", "wgsl"], names: &["Map::Index", "INDEX_IMAGE"], most: 5 },
    Thing {
        what: "a kernel function",
        rooms: &["src", "wgsl"],
        names: &["KernelShape::Cone", "Kernel::Cone { power }", "KERNEL_POWER"],
        most: 4,
    },
    Thing {
        what: "a composite mode",
        rooms: &["src/options", "src/scene", "src/plan", "src/passes", "src/render", "wgsl"],
        names: &["Composite::Moments", "Oit::Moments", "moments"],
        most: 12,
    },
    Thing { what: "a format", rooms: &["src"], names: &["Format::Pcd", "Self::Pcd", "pcd::", "read_pcd"], most: 4 },
    Thing { what: "a format of meshes", rooms: &["src"], names: &["Format::Stl", "Self::Stl", "stl::"], most: 2 },
    Thing {
        what: "a format that names other files",
        rooms: &["src"],
        names: &["Format::Gltf", "Self::Gltf", "read_gltf", "gltf::companions"],
        most: 3,
    },
    Thing { what: "an image format", rooms: &["src"], names: &["mod jpeg", "jpeg::"], most: 2 },
    Thing { what: "a command", rooms: &["src/cli", "src/main.rs"], names: &["simplify::"], most: 4 },
];

/// The files in `rooms` whose code, tests apart, has one of `names`.
fn named_in(thing: &Thing) -> Vec<String> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let all = thing.rooms.iter().map(|room| root.join(room)).filter(|room| room.is_dir()).flat_map(|room| files(&room));
    let named = all.filter(|path| {
        let text = std::fs::read_to_string(path).unwrap();
        let code = text.split("#[cfg(test)]\nmod tests").next().unwrap_or_default();
        let lines = code.lines().map(|line| line.split("//").next().unwrap_or_default());
        lines.into_iter().any(|line| thing.names.iter().any(|name| line.contains(name)))
    });
    named.map(|path| path.strip_prefix(root).unwrap().display().to_string()).collect()
}

#[test]
fn a_thing_is_added_in_few_files() {
    for thing in &THINGS {
        let found = named_in(thing);
        eprintln!("{}: {} files: {}", thing.what, found.len(), found.join(", "));
        assert!((1..=thing.most).contains(&found.len()), "{}: {found:?}", thing.what);
    }
}
