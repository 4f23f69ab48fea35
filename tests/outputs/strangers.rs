//! Untrusted files that name other files, and inputs without an end.

use super::common::command::{DATA, Folder, epsplat, fails, ply, succeeds, text};
use std::os::unix::fs::symlink;
use std::path::Path;
use std::process::Command;

/// A file of surfels that names the mesh file `name`, whose triangles are drawn with them.
fn naming(name: &str) -> String {
    let rows: String = (0..36).map(|i| format!("{} {} 9 0 0 1 1\n", i % 6, i / 6)).collect();
    ply("x y z nx ny nz radius", 36, &rows)
        .replace("ascii 1.0\n", &format!("ascii 1.0\ncomment epsplat 1\ncomment triangles {name}\n"))
}

/// Commands that read surfels, with all arguments except an output.
fn commands(folder: &Folder, input: &Path) -> Vec<Vec<String>> {
    let output = |name: &str| text(&folder.path(name)).to_owned();
    let of = |line: String| line.split(' ').map(str::to_owned).collect();
    let input = text(input);
    vec![
        of(format!("info {input}")),
        of(format!("render {input} --backend reference --size 8x8 -o {}", output("o.png"))),
        of(format!("surfels {input} -o {}", output("o.ply"))),
        of(format!("lod {input} -o {}", output("o.ply"))),
        of(format!("simplify {input} -o {}", output("o.ply"))),
    ]
}

#[test]
fn triangles_are_a_file_of_the_same_folder() {
    let (folder, outside) = (Folder::new(), Folder::new());
    std::fs::create_dir(folder.path("sub")).unwrap();
    let cube = std::fs::read(Path::new(DATA).join("cube.obj")).unwrap();
    for place in [folder.path("sub/m.obj"), folder.path("m.obj"), outside.path("m.obj")] {
        std::fs::write(place, &cube).unwrap();
    }
    symlink("/dev/zero", folder.path("endless.obj")).unwrap();
    symlink(outside.path("m.obj"), folder.path("out.obj")).unwrap();
    symlink("sub/m.obj", folder.path("down.obj")).unwrap();
    assert!(Command::new("mkfifo").arg(folder.path("pipe.obj")).status().unwrap().success());
    let parent = format!("../{}/m.obj", outside.path("").file_name().unwrap().to_str().unwrap());
    for name in [
        "/etc/passwd",
        "/dev/stdin",
        "../m.obj",
        &parent,
        "sub/m.obj",
        "./m.obj",
        "sub\\m.obj",
        "..",
        ".",
        text(&outside.path("m.obj")),
        "endless.obj",
        "pipe.obj",
        "out.obj",
        "down.obj",
        "sub",
    ] {
        let input = folder.file("s.ply", naming(name));
        for command in commands(&folder, &input) {
            fails(
                &command.iter().map(String::as_str).collect::<Vec<_>>(),
                1,
                &["s.ply: its header names", "--triangles"],
            );
        }
        assert!(!folder.path("o.ply").exists() && !folder.path("o.png").exists(), "{name}");
    }
    // Controls: the name of a file in the same folder is allowed, also through a link within the
    // folder. So is the name of a missing file, which only a render opens.
    symlink("m.obj", folder.path("within.obj")).unwrap();
    for name in ["m.obj", "within.obj"] {
        let input = folder.file("s.ply", naming(name));
        for command in commands(&folder, &input) {
            succeeds(&command.iter().map(String::as_str).collect::<Vec<_>>());
        }
        // Files that are derived from these surfels in the same folder name the mesh too.
        let header = String::from_utf8_lossy(&std::fs::read(folder.path("o.ply")).unwrap()).into_owned();
        assert!(header.contains(&format!("\ncomment triangles {name}\n")), "{name}");
    }
    let input = folder.file("s.ply", naming("none.obj"));
    succeeds(&["info", text(&input)]);
    let image = folder.path("o.png");
    let render = ["render", text(&input), "-o", text(&image), "--backend", "reference"];
    fails(&render, 1, &["none.obj", "No such file"]);
}

/// A derived file in another folder does not name the mesh: there the name would mean another file.
/// A note reports that.
#[test]
fn derived_files_of_other_folders_name_no_triangles() {
    let (folder, other) = (Folder::new(), Folder::new());
    folder.file("m.obj", std::fs::read(Path::new(DATA).join("cube.obj")).unwrap());
    let input = folder.file("s.ply", naming("m.obj"));
    for command in ["surfels", "lod", "simplify"] {
        let output = other.path("o.ply");
        let told = succeeds(&[command, text(&input), "-o", text(&output)]).stderr;
        let told = String::from_utf8(told).unwrap();
        assert!(told.contains("m.obj are left out") && told.contains("another folder"), "{command}: {told}");
        let header = String::from_utf8_lossy(&std::fs::read(output).unwrap()).into_owned();
        assert!(!header.contains("comment triangles"), "{command}");
    }
}

/// Runs a shell command for at most 30 seconds, with `$E` as the program; it must fail with one
/// sentence.
fn refused(folder: &Folder, line: &str, words: &[&str]) {
    let line = format!("timeout 30 sh -c '{line}'");
    let mut command = Command::new("sh");
    let output =
        command.args(["-c", &line]).env("E", env!("CARGO_BIN_EXE_epsplat")).current_dir(folder.path("")).output();
    let output = output.unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{line}: {said}");
    assert_eq!(said.lines().filter(|line| line.starts_with("error: ")).count(), 1, "{line}: {said}");
    assert!(words.iter().all(|word| said.contains(word)), "{line}: {said}");
}

#[cfg(target_os = "linux")]
#[test]
fn devices_and_streams_without_an_end_are_refused() {
    let folder = Folder::new();
    let rows: String = (0..36).map(|i| format!("{} {} 9 0 0 1 1\n", i % 6, i / 6)).collect();
    folder.file("s.ply", ply("x y z nx ny nz radius", 36, &rows));
    for name in ["z.ply", "z.las", "z.obj", "z.pcd", "z.png", "z.exr", "z.json", "z.toml"] {
        symlink("/dev/zero", folder.path(name)).unwrap();
    }
    std::fs::create_dir(folder.path("colmap")).unwrap();
    symlink("/dev/zero", folder.path("colmap/cameras.txt")).unwrap();
    folder.file("m.obj", "mtllib z.json\nusemtl x\nv 0 0 0\nv 1 0 0\nv 1 1 0\nvt 0 0\nf 1/1 2/1 3/1\n");
    let render = "$E render s.ply --backend reference --size 8x8 -o o.png";
    for line in [
        "$E info z.ply",
        "$E info z.las",
        "$E info z.obj",
        "$E info /dev/zero",
        "$E info /dev/urandom --input-format ply",
        "$E info - < /dev/zero",
        "$E info z.ply --json o.json",
        "$E lod z.ply -o o.ply",
        "$E render z.ply --backend reference -o o.png",
        "$E sample z.obj --count 9 -o o.ply",
        "$E hybrid z.obj -o o.ply",
        "$E compare z.png z.png",
        "$E compare z.exr z.exr",
        "$E bench z.toml",
        &format!("{render} --camera z.json"),
        &format!("{render} --cameras z.json"),
        &format!("{render} --cameras colmap"),
        &format!("{render} --triangles z.obj"),
    ] {
        refused(&folder, line, &["it is a device, not a file"]);
    }
    // Streams whose first bytes fit no format are refused; text is read up to a stated length.
    for format in ["ply", "las", "obj", "pcd", "e57"] {
        refused(&folder, &format!("cat /dev/zero | $E info - --input-format {format}"), &["its first"]);
    }
    refused(&folder, "yes | $E info -", &["format is not known"]);
    refused(
        &folder,
        "yes v | $E render s.ply --camera /dev/stdin --backend reference -o o.png",
        &["longer than 256 MiB"],
    );
    // A material library that is a device, or a pipe without a writer, is left out.
    let told = epsplat(&["sample", text(&folder.path("m.obj")), "-o", text(&folder.path("o.ply")), "--count", "9"]);
    let told = (told.status.success(), String::from_utf8(told.stderr).unwrap());
    assert!(told.0 && told.1.contains("the materials in z.json are left out: it is a device"), "{told:?}");
    assert!(Command::new("mkfifo").arg(folder.path("pipe")).status().unwrap().success());
    folder.file("m.mtl", "newmtl x\nmap_Kd pipe\n");
    folder.file("m.obj", "mtllib m.mtl\nmtllib pipe\nusemtl x\nv 0 0 0\nv 1 0 0\nv 1 1 0\nvt 0 0\nf 1/1 2/1 3/1\n");
    let told = epsplat(&["sample", text(&folder.path("m.obj")), "-o", text(&folder.path("o.ply")), "--count", "9"]);
    let told = (told.status.success(), String::from_utf8(told.stderr).unwrap());
    assert!(told.0 && told.1.matches("it is not a regular file").count() == 2, "{told:?}");
}
