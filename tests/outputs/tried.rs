//! Output folders are tested before anything is read. A folder in which no file can be created is
//! refused, for root and for other users.

use super::common::command::{Folder, fails, ply, text};
use std::os::unix::fs::{PermissionsExt, chown};
use std::path::Path;
use std::process::Command;

/// Not even root can create files in /proc, though its mode does not show that. The inputs do not
/// exist, so reading first would give another error.
#[test]
fn a_folder_in_which_nothing_can_be_made_is_told_before_anything_is_read() {
    let said = |line: &str| {
        let arguments: Vec<&str> = line.split(' ').collect();
        let output = arguments.iter().find(|word| word.starts_with("/proc")).unwrap();
        fails(&arguments, 1, &[&format!("cannot write {output}: ")]);
    };
    let missing = "/no/such/input.ply";
    said(&format!("render {missing} -o /proc/x.png"));
    said(&format!("render {missing} -o x.png --json /proc/x.json"));
    said(&format!("surfels {missing} -o /proc/x.ply"));
    said(&format!("simplify {missing} -o /proc/x.ply"));
    said(&format!("simplify {missing} -o x.ply --json /proc/x.json"));
    said(&format!("sample {missing} --count 9 -o /proc/x.ply"));
    said(&format!("info {missing} --json /proc/x.json"));
    said(&format!("compare {missing} {missing} --json /proc/x.json"));
    said(&format!("coverage {missing} --mesh {missing} --json /proc/x.json"));
    said("generate sphere --count 4000000000 -o /proc/x.ply");
    said("adapters --json /proc/x.json");
    said("hardcases --json /proc/x.json");
    let study = concat!(env!("CARGO_MANIFEST_DIR"), "/benches/textured.toml");
    said(&format!("bench {study} --out /proc/report"));
    said(&format!("card {study} --out /proc/records"));
    let cameras = concat!(env!("CARGO_MANIFEST_DIR"), "/data/cameras/transforms.json");
    fails(&["render", missing, "--cameras", cameras, "-o", "/proc/views"], 1, &["cannot write /proc/views"]);
}

/// Runs the program as a user to whom file modes apply: the current user, or, instead of root, user
/// 65534 with a copy of the program.
fn as_user(folder: &Folder) -> Command {
    let binary = Path::new(env!("CARGO_BIN_EXE_epsplat"));
    if !is_root() {
        return Command::new(binary);
    }
    let copy = folder.path("epsplat");
    std::fs::copy(binary, &copy).unwrap();
    let mut command = Command::new("setpriv");
    command.args(["--reuid=65534", "--regid=65534", "--clear-groups"]).arg(copy);
    command
}

fn is_root() -> bool {
    let folder = Folder::new();
    chown(folder.path(""), Some(0), Some(0)).is_ok()
}

#[test]
fn a_user_without_rights_is_told_before_anything_is_read() {
    let folder = Folder::new();
    let mode = |name: &str, bits: u32| {
        std::fs::set_permissions(folder.path(name), std::fs::Permissions::from_mode(bits)).unwrap();
    };
    mode("", 0o755);
    let rows: String = (0..36).map(|i| format!("{} {} 0\n", i % 6, i / 6)).collect();
    let cloud = folder.file("c.ply", ply("x y z", 36, &rows));
    mode("c.ply", 0o644);
    for (name, bits) in [("closed", 0o555), ("open", 0o777)] {
        std::fs::create_dir(folder.path(name)).unwrap();
        mode(name, bits);
    }
    let run = |input: &Path, name: &str| {
        let output = as_user(&folder).args(["surfels", text(input), "-o", text(&folder.path(name))]).output().unwrap();
        (output.status.code(), String::from_utf8(output.stderr).unwrap())
    };
    let (code, said) = run(Path::new("/no/such/input.ply"), "closed/x.ply");
    assert!(code == Some(1) && said.contains("closed/x.ply: Permission denied") && said.lines().count() == 1, "{said}");
    let (code, said) = run(&cloud, "open/x.ply");
    assert_eq!(code, Some(0), "{said}");
    // A file is read-only, but its folder allows replacing it.
    mode("open/x.ply", 0o444);
    let before = std::fs::read(folder.path("open/x.ply")).unwrap();
    let (code, said) = run(&cloud, "open/x.ply");
    assert!(code == Some(1) && said.contains("open/x.ply: it is read-only"), "{said}");
    assert_eq!(std::fs::read(folder.path("open/x.ply")).unwrap(), before);
    mode("closed", 0o755);
}
