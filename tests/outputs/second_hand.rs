//! Files that an input names are inputs too, and so is the file behind standard input: outputs must
//! not overwrite them.

use super::common::command::{DATA, Folder, epsplat, ply, succeeds, text};
use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Command, Output, Stdio};

/// The inputs: surfels that name an OBJ file, its material library and its image, the OBJ file
/// under another name, and the files that `epsplat hybrid` writes for a textured cube.
fn inputs() -> Folder {
    let folder = Folder::new();
    let data = |name: &str| std::fs::read(Path::new(DATA).join(name)).unwrap();
    let cube = [b"mtllib cube.mtl\nusemtl x\n", &data("cube.obj")[..]].concat();
    folder.file("cube.obj", &cube);
    folder.file("cube.dat", &cube);
    folder.file("cube.mtl", "newmtl x\nmap_Kd cube.png\n");
    folder.file("cube.png", data("cube.png"));
    let rows: String = (0..36).map(|i| format!("{} {} 9 0 0 1 1\n", i % 6, i / 6)).collect();
    let named = ply("x y z nx ny nz radius", 36, &rows)
        .replace("ascii 1.0\n", "ascii 1.0\ncomment epsplat 1\ncomment triangles cube.obj\n");
    folder.file("s.ply", named);
    succeeds(&["hybrid", text(&folder.path("cube.obj")), "-o", text(&folder.path("p.ply")), "--pixels", "2000"]);
    let made = ["p.ply", "p.mesh.ply", "p.mesh-1.png"];
    assert!(made.iter().all(|name| folder.path(name).exists()), "{:?}", folder.names());
    folder
}

fn contents(folder: &Folder) -> BTreeMap<String, Vec<u8>> {
    folder.names().into_iter().map(|name| (name.clone(), std::fs::read(folder.path(&name)).unwrap())).collect()
}

/// Runs a shell command in the folder; `$E` is the program.
fn shell(folder: &Folder, line: &str) -> Output {
    let mut command = Command::new("sh");
    command.args(["-c", line]).env("E", env!("CARGO_BIN_EXE_epsplat")).current_dir(folder.path(""));
    command.stdin(Stdio::null()).output().unwrap()
}

fn refused(folder: &Folder, line: &str) {
    let before = contents(folder);
    let output = shell(folder, line);
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{line}: {said}");
    assert!(said.contains("would overwrite the input"), "{line}: {said}");
    assert_eq!(contents(folder), before, "{line}");
}

#[cfg(unix)]
#[test]
fn what_is_read_at_second_hand_is_not_overwritten() {
    let folder = inputs();
    let others = "--backend reference --size 8x8";
    for line in [
        format!("$E render s.ply -o cube.png {others}"),
        format!("$E render s.ply -o x.png --json cube.obj {others}"),
        format!("$E render s.ply -o x.png --json cube.mtl {others}"),
        format!("$E render p.ply -o p.mesh-1.png {others}"),
        format!("$E render p.ply -o x.png --json p.mesh.ply {others}"),
        format!("$E render --triangles p.mesh.ply -o p.mesh-1.png {others}"),
        format!("$E render cube.dat --input-format obj -o cube.png {others}"),
        "$E info cube.dat --input-format obj --json cube.mtl".into(),
        "$E info s.ply --json cube.png".into(),
        "$E lod s.ply -o y.ply --json cube.mtl".into(),
        "$E simplify p.ply -o p.mesh.ply".into(),
        "$E simplify s.ply -o y.ply --json ./cube.png".into(),
        "$E surfels p.ply -o p.mesh.ply".into(),
        "$E sample p.mesh.ply --count 9 -o p.mesh.ply".into(),
        "$E hybrid cube.dat --input-format obj -o q.ply --json cube.mtl".into(),
        "$E coverage s.ply --mesh p.mesh.ply --views 1 --side 8 --json p.mesh-1.png".into(),
        // The input comes through standard input from a file or a pipe, or through a named pipe.
        format!("$E render - -o cube.png {others} < s.ply"),
        format!("cat s.ply | $E render - -o x.png --json cube.obj {others}"),
        format!("cat p.ply | $E render - -o p.mesh-1.png {others}"),
        "cat cube.obj | $E info - --input-format obj --json cube.mtl".into(),
        "cat cube.obj | $E hybrid - --input-format obj -o q.ply --json cube.png".into(),
        "mkfifo pipe; (cat s.ply > pipe &) ; $E info pipe --json cube.mtl; code=$?; rm pipe; exit $code".into(),
    ] {
        refused(&folder, &line);
        for made in ["x.png", "y.ply", "z.ply", "q.ply"] {
            let _ = std::fs::remove_file(folder.path(made));
        }
    }
    // The output is a link to an input.
    for (link, target) in [("ln -s", "cube.png"), ("ln", "cube.png"), ("ln", "p.mesh-1.png")] {
        let input = if target == "cube.png" { "s.ply" } else { "p.ply" };
        assert!(shell(&folder, &format!("{link} {target} alias.png")).status.success());
        refused(&folder, &format!("$E render {input} -o alias.png {others}"));
        std::fs::remove_file(folder.path("alias.png")).unwrap();
    }
    // The output is an image that the input names, and that does not exist yet.
    folder.file("cube.mtl", "newmtl x\nmap_kd sub/../other.png\n");
    std::fs::create_dir(folder.path("sub")).unwrap();
    let output = shell(&folder, &format!("$E render s.ply -o other.png {others}"));
    assert_eq!(output.status.code(), Some(2), "{output:?}");
    // Control: other names are allowed, and piped input is read completely.
    for line in [
        format!("$E render s.ply -o new.png --json new.json {others}"),
        format!("cat s.ply | $E render - -o new.png {others}"),
        "cat cube.obj | $E hybrid - --input-format obj -o new.ply --pixels 2000".into(),
        "cat s.ply | $E info - --json new.json && grep -q '\"points\": 36' new.json".into(),
    ] {
        let output = shell(&folder, &line);
        assert!(output.status.success(), "{line}: {output:?}");
    }
}

#[cfg(unix)]
#[test]
fn the_file_that_standard_input_is_is_an_input() {
    let folder = inputs();
    let rows: String = (0..36).map(|i| format!("{} {} 9 0 0 1 1\n", i % 6, i / 6)).collect();
    folder.file("a.ply", ply("x y z nx ny nz radius", 36, &rows));
    for line in [
        "$E lod - -o a.ply < a.ply",
        "$E lod - -o b.ply --json a.ply < a.ply",
        "$E simplify - -o a.ply < a.ply",
        "$E surfels - -o a.ply < a.ply",
        "$E hybrid - --input-format obj -o b.ply --json cube.obj < cube.obj",
        "$E hybrid - -o p.mesh.ply < p.mesh.ply",
        "$E sample - --count 9 -o p.mesh.ply < p.mesh.ply",
        "$E info - --json a.ply < a.ply",
        "$E info /dev/stdin --json a.ply < a.ply",
        "$E render - -o b.png --json a.ply --backend reference < a.ply",
        "ln a.ply c.ply; $E lod - -o c.ply < a.ply; code=$?; rm c.ply; exit $code",
        "ln -s a.ply c.ply; $E lod - -o c.ply < a.ply; code=$?; rm c.ply; exit $code",
        // Streams may be outputs, but a run must not append its standard output to an input.
        "$E info a.ply --json /dev/stdout >> a.ply",
    ] {
        refused(&folder, line);
    }
    // Control: standard input may be a file, read from its start or from its middle.
    assert!(shell(&folder, "$E lod - -o b.ply < a.ply").status.success());
    let output = shell(&folder, "(echo junk; cat a.ply) > d; (read junk; $E info - --json e.json) < d");
    assert!(output.status.success(), "{output:?}");
    assert!(std::fs::read_to_string(folder.path("e.json")).unwrap().contains("\"points\": 36"));
}

/// `hybrid` replaces only files beside its output that it wrote itself, and deletes those that it
/// does not write again.
#[test]
fn hybrid_replaces_only_what_it_wrote_itself() {
    let folder = inputs();
    let (cube, output) = (folder.path("cube.obj"), folder.path("p.ply"));
    let run = |input: &Path, pixels: &str| epsplat(&["hybrid", text(input), "-o", text(&output), "--pixels", pixels]);
    let told = |output: &Output| String::from_utf8(output.stderr.clone()).unwrap();
    let again = run(&cube, "2000");
    assert!(again.status.success(), "{}", told(&again));
    for named in ["p.mesh.ply: the triangles that stay", "p.mesh-1.png: an image of these triangles"] {
        assert!(told(&again).contains(named), "{}", told(&again));
    }
    let json = epsplat(&["hybrid", text(&cube), "-o", text(&output), "--pixels", "2000", "--json", "-"]);
    let json: serde_json::Value = serde_json::from_slice(&json.stdout).unwrap();
    assert!(json["files"][0].as_str().unwrap().ends_with("p.mesh.ply") && json["files"].as_array().unwrap().len() == 2);
    // Without a texture no image remains, and for a mesh of small triangles no mesh remains either.
    folder.file("bare.obj", std::fs::read(Path::new(DATA).join("cube.obj")).unwrap());
    let bare = run(&folder.path("bare.obj"), "2000");
    assert!(bare.status.success() && told(&bare).contains("p.mesh-1.png: removed"), "{}", told(&bare));
    assert!(!folder.path("p.mesh-1.png").exists() && folder.path("p.mesh.ply").exists());
    let small = run(&Path::new(DATA).join("bunny.obj"), "8");
    assert!(small.status.success() && told(&small).contains("p.mesh.ply: removed"), "{}", told(&small));
    assert!(!folder.path("p.mesh.ply").exists());
    // Other files with these names stay.
    let others: &[(&str, &[u8])] = &[
        ("p.mesh.ply", b"a text"),
        ("p.mesh.ply", b""),
        ("p.mesh.ply", b"ply\nformat ascii 1.0\ncomment hybrid\nelement vertex 0\nproperty float x\nend_header\n"),
        ("p.mesh.ply", b"ply\nformat ascii 1.0\ncomment epsplat 1\nelement vertex 0\nproperty float x\nend_header\n"),
        ("p.mesh-1.png", b"a text"),
    ];
    for (name, bytes) in others {
        let path = folder.file(name, bytes);
        let before = contents(&folder);
        let output = run(&cube, "2000");
        assert_eq!(output.status.code(), Some(2), "{}", told(&output));
        assert!(told(&output).contains(name) && told(&output).contains("choose another name"), "{}", told(&output));
        assert_eq!(contents(&folder), before);
        std::fs::remove_file(path).unwrap();
    }
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink("elsewhere.ply", folder.path("p.mesh.ply")).unwrap();
        assert_eq!(run(&cube, "2000").status.code(), Some(2));
        assert!(!folder.path("elsewhere.ply").exists());
        std::fs::remove_file(folder.path("p.mesh.ply")).unwrap();
    }
    // A mesh that epsplat wrote may name images that it did not write; these are not deleted.
    folder.file("kept.png", std::fs::read(folder.path("cube.png")).unwrap());
    let own = "ply\nformat ascii 1.0\ncomment epsplat 1\ncomment hybrid\ncomment TextureFile kept.png\n\
               element vertex 0\nproperty float x\nend_header\n";
    folder.file("p.mesh.ply", own);
    let last = run(&cube, "2000");
    assert!(last.status.success() && folder.path("kept.png").exists(), "{}", told(&last));
}
