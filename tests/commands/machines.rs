//! Pictures that several processes draw by files: equal bytes, and one sentence for parts that do
//! not fit each other.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common;

use std::path::{Path, PathBuf};
use std::process::Command;

use common::command::{DATA, Folder, fails, succeeds, text};

/// The folder, inputs and options of a picture.
struct Picture {
    folder: Folder,
    arguments: Vec<String>,
}

impl Picture {
    fn new(arguments: &[&str]) -> Self {
        let folder = Folder::new();
        let arguments = arguments.iter().map(|argument| argument.replace("DATA", DATA)).collect();
        Self { folder, arguments }
    }

    /// The arguments of `render` with others behind them.
    fn render<'a>(&'a self, others: &[&'a str]) -> Vec<&'a str> {
        let own = self.arguments.iter().map(String::as_str);
        std::iter::once("render").chain(own).chain(others.iter().copied()).collect()
    }

    /// Draws a part, within the depths of others if there are any.
    fn part(&self, share: &str, name: &str, within: &[&Path]) -> PathBuf {
        let path = self.folder.path(name);
        let mut arguments = vec!["--part", share, "-o", text(&path)];
        within.iter().for_each(|path| arguments.extend(["--within", text(path)]));
        succeeds(&self.render(&arguments));
        path
    }

    /// Draws all parts of both passes, and returns the files of sums.
    fn parts(&self, of: u32) -> Vec<PathBuf> {
        let named = |kind: &str, number: u32| (format!("{number}/{of}"), format!("{kind}-{number}-{of}.part"));
        let depth = |number| {
            let (share, name) = named("depth", number);
            self.part(&share, &name, &[])
        };
        let depths: Vec<PathBuf> = (1..=of).map(depth).collect();
        let within: Vec<&Path> = depths.iter().map(PathBuf::as_path).collect();
        let sum = |number| {
            let (share, name) = named("sum", number);
            self.part(&share, &name, &within)
        };
        (1..=of).map(sum).collect()
    }
}

fn merge(parts: &[PathBuf], output: &Path) {
    let mut arguments = vec!["merge", "-o", text(output)];
    arguments.extend(parts.iter().map(|part| text(part)));
    succeeds(&arguments);
}

#[test]
fn merged_files_are_those_of_one_process() {
    let pictures = [
        Picture::new(&["DATA/bunny.obj", "DATA/autzen.laz", "--size", "90x70", "--aov", "depth,normal,height"]),
        Picture::new(&["DATA/autzen.laz", "--size", "120x80", "--samples", "1", "--background", "white"]),
    ];
    let names: [(u32, &[&str]); 2] = [(3, &["p.exr", "p.npz"]), (2, &["p.exr", "p.png", "p.jpg"])];
    for (picture, (of, names)) in pictures.iter().zip(names) {
        let parts = picture.parts(of);
        for name in names {
            let [alone, merged] = ["alone-", "merged-"].map(|before| picture.folder.path(&format!("{before}{name}")));
            succeeds(&picture.render(&["-o", text(&alone)]));
            merge(&parts, &merged);
            assert!(std::fs::read(&alone).unwrap() == std::fs::read(&merged).unwrap(), "{name} of {of}");
        }
    }
    // The order of the parts does not matter, nor do merges of some of them.
    let (picture, folder) = (&pictures[0], &pictures[0].folder);
    let sums: Vec<PathBuf> = (1..=3).map(|number| folder.path(&format!("sum-{number}-3.part"))).collect();
    let some = folder.path("some.part");
    merge(&[sums[2].clone(), sums[0].clone()], &some);
    merge(&[sums[1].clone(), some], &folder.path("tree.exr"));
    assert!(std::fs::read(folder.path("tree.exr")).unwrap() == std::fs::read(folder.path("alone-p.exr")).unwrap());
    // Depths that were merged before, and a report.
    let depths: Vec<PathBuf> = (1..=3).map(|number| folder.path(&format!("depth-{number}-3.part"))).collect();
    let depth = folder.path("depth.part");
    merge(&depths, &depth);
    let again = picture.part("2/3", "again.part", &[&depth]);
    assert!(std::fs::read(again).unwrap() == std::fs::read(&sums[1]).unwrap());
    let mut arguments = vec!["merge", "--json", "-", "-o"];
    let image = folder.path("reported.exr");
    arguments.push(text(&image));
    arguments.extend(sums.iter().map(|part| text(part)));
    let report: serde_json::Value = serde_json::from_slice(&succeeds(&arguments).stdout).unwrap();
    let alone = succeeds(&picture.render(&["-o", text(&folder.path("r.exr")), "--json", "-"]));
    let alone: serde_json::Value = serde_json::from_slice(&alone.stdout).unwrap();
    assert_eq!((&report["bits"], &report["parts"]), (&alone["bits"], &3.into()));
}

#[test]
fn parts_that_do_not_fit_are_refused_by_name() {
    let picture = Picture::new(&["DATA/autzen.laz", "--size", "60x40"]);
    let folder = &picture.folder;
    let sums = picture.parts(2);
    let [one, two] = [&sums[0], &sums[1]].map(|path| text(path));
    let output = folder.path("out.png");
    let out = text(&output);
    let refused = |parts: &[&str], code: i32, words: &[&str]| {
        fails(&[&["merge", "-o", out], parts].concat(), code, words);
        assert!(!output.exists());
    };
    refused(&[one], 2, &["sums of part 2/2 are missing"]);
    refused(&[one, two, one], 1, &["sum-1-2.part", "has part 1/2"]);
    refused(&[one, text(&folder.path("none.part"))], 1, &["none.part"]);
    let [depth, other_depth] = ["depth-1-2.part", "depth-2-2.part"].map(|name| folder.path(name));
    let (depth, other_depth) = (text(&depth), text(&other_depth));
    refused(&[depth, other_depth], 2, &["nearest depths", "--within"]);
    refused(&[one, depth], 1, &["depth-1-2.part", "holds nearest depths"]);
    let image = folder.file("image.part", "no part");
    refused(&[one, text(&image)], 1, &["image.part", "no part of a picture"]);

    // Files that were cut or changed.
    let bytes = std::fs::read(two).unwrap();
    for len in [1, 7, 30, bytes.len() / 2, bytes.len() - 1] {
        let cut = folder.file("cut.part", &bytes[..len]);
        refused(&[one, text(&cut)], 1, &["cut.part", "ends after"]);
    }
    for at in [20, 40, bytes.len() / 2, bytes.len() - 2] {
        let mut changed = bytes.clone();
        changed[at] ^= 4;
        let changed = folder.file("changed.part", changed);
        refused(&[one, text(&changed)], 1, &["changed.part"]);
    }

    // Parts of other pictures.
    let others: [(&[&str], &str, &str); 5] = [
        (&["DATA/bunny.obj", "--mesh", "surfels", "--size", "60x40"], "2/2", "another scene"),
        (&["DATA/autzen.laz", "--size", "60x41"], "2/2", "another camera"),
        (&["DATA/autzen.laz", "--size", "60x40", "--shading", "unlit"], "2/2", "shading"),
        (&["DATA/autzen.laz", "--size", "60x40", "--epsilon", "abs:2"], "2/2", "epsilon"),
        (&["DATA/autzen.laz", "--size", "60x40"], "2/3", "one of 3 parts"),
    ];
    for (arguments, share, word) in others {
        let other = Picture::new(arguments);
        let part = other.part(share, "other.part", &[]);
        refused(&[depth, text(&part)], 1, &["other.part", word]);
        let sum = folder.path("sum.part");
        let share = share.replace('2', "1");
        let within = ["--part", &share, "--within", depth, text(&part), "-o", text(&sum)];
        fails(&picture.render(&within), 1, &["other.part", word]);
        assert!(!sum.exists());
    }
    let sum = folder.path("sum.part");
    fails(&picture.render(&["--part", "1/2", "-o", text(&sum), "--within", depth]), 2, &["part 2/2 are missing"]);
    fails(&picture.render(&["--part", "1/2", "-o", text(&sum), "--within", one, two]), 1, &["holds sums"]);
    let within = ["--part", "1/2", "-o", text(&sum), "--within", depth, other_depth, "--shading", "unlit"];
    fails(&picture.render(&within), 1, &["depth-1-2.part", "shading"]);
    assert!(!sum.exists());
}

#[test]
fn pictures_without_parts_are_refused_before_anything_is_read() {
    let folder = Folder::new();
    // No file is read: this one is none.
    let cloud = folder.file("cloud.laz", "none");
    let part = folder.path("part.part");
    let refused = |others: &[&str], words: &[&str]| {
        let own = ["render", text(&cloud), "-o", text(&part), "--part", "1/2"];
        fails(&[&own, others].concat(), 2, words);
    };
    for (others, word) in [
        (&["--composite", "layers"][..], "--composite"),
        (&["--composite", "moments"], "--composite"),
        (&["--blend", "nearest"], "--blend"),
        (&["--separate"], "--separate"),
        (&["--lod", "4px"], "--lod"),
        (&["--splats", "100"], "--lod"),
        (&["--accumulator", "float"], "--accumulator"),
        (&["--backend", "raster"], "raster"),
        (&["--backend", "reference"], "reference"),
        (&["--aov", "index"], "index"),
        (&["--aov", "surfaces"], "surfaces"),
        (&["--turntable", "3"], "--turntable"),
        (&["--pixel-size", "1"], "--pixel-size"),
        (&["--format", "png"], "--format"),
        (&["--json", "-"], "--json"),
        (&["--scale-bar"], "--scale-bar"),
        (&["--source", "kernel_ellipse.wgsl=none.wgsl"], "--source"),
    ] {
        if word == "--separate" {
            // A single input has nothing to keep apart.
            let second = folder.file("second.laz", "none");
            refused(&[others, &[text(&second)]].concat(), &[word]);
        } else if word == "--source" {
            let file = folder.file("none.wgsl", "");
            let source = format!("kernel_ellipse.wgsl={}", text(&file));
            refused(&["--source", &source], &[word]);
        } else {
            refused(others, &[word]);
        }
    }
    fails(&["render", text(&cloud), "-o", text(&folder.path("p.png")), "--part", "1/2"], 2, &["p.png", "image"]);
    fails(&["render", text(&cloud), "-o", text(&part), "--part", "3/2"], 2, &["3/2"]);
    fails(&["render", text(&cloud), "-o", text(&part), "--within", "a.part"], 2, &["--part"]);
    assert!(!part.exists());
}

/// The job array of the guide, with a `sbatch` that runs each job at once.
#[cfg(unix)]
#[test]
fn the_job_array_of_the_guide_runs() {
    use std::os::unix::fs::PermissionsExt;
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let guide = std::fs::read_to_string(root.join("src/guide/machines.md")).unwrap();
    let blocks = guide.split("```bash\n").skip(1).map(|block| block.split("```").next().unwrap());
    let script = blocks.into_iter().find(|block| block.contains("sbatch")).unwrap();
    assert!(script.lines().count() <= 10, "the guide promises few lines");
    let folder = Folder::new();
    std::os::unix::fs::symlink(root.join("data"), folder.path("data")).unwrap();
    std::os::unix::fs::symlink(env!("CARGO_BIN_EXE_epsplat"), folder.path("epsplat")).unwrap();
    let sbatch = "#!/bin/sh\nset -e\nwhile true; do case $1 in\n--wrap) sh -c \"$2\" >&2; echo 1; exit;;\n--*) shift;;\n\
                  *) break;; esac; done\nlast=$(sed -n 's/^#SBATCH --array=1-//p' $1)\n\
                  for task in $(seq $last); do SLURM_ARRAY_TASK_ID=$task sh -e \"$@\" >&2; done\necho 1\n";
    let sbatch = folder.file("sbatch", sbatch);
    std::fs::set_permissions(&sbatch, std::fs::Permissions::from_mode(0o755)).unwrap();
    let own = text(sbatch.parent().unwrap()).to_owned();
    let path = format!("{own}:{}", std::env::var("PATH").unwrap());
    let output = Command::new("sh").args(["-e", "-c", script]).current_dir(&own).env("PATH", path).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let alone = folder.path("alone.png");
    succeeds(&["render", &format!("{DATA}/autzen.laz"), "-o", text(&alone)]);
    assert!(std::fs::read(folder.path("autzen.png")).unwrap() == std::fs::read(alone).unwrap());
    assert_eq!(folder.names().iter().filter(|name| name.ends_with(".part")).count(), 8);
}
