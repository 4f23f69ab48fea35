//! Fuzzes MTL files beside an OBJ file and an image, as `render mesh.obj` and `render --triangles
//! mesh.obj` read them.

use std::fmt::Write;
use std::path::Path;

use epsplat::io;

use super::mutate::Grammar;
use super::random::Random;
use super::session::sentence;
use super::{Outcome, Target, render};

pub const TARGET: Target = Target {
    name: "materials",
    extension: "mtl",
    generate,
    grammar: Grammar {
        words: &[
            "newmtl",
            "Kd",
            "kd",
            "map_Kd",
            "map_kd",
            "-s",
            "-o",
            "-clamp on",
            "-mm",
            "-imfchan l",
            "-bm",
            "Tr",
            "d",
            "quad.png",
            "../quad.png",
            "/dev/zero",
            "C:\\quad.png",
            "nan",
            "1e400",
            "-1",
            "\nnewmtl\n",
            "\nnewmtl m\n",
            "\nKd spectral a.rfl\n",
            "\nKd xyz 1 1 1\n",
            "\u{feff}",
            "\\\n",
            "\r",
            "#",
        ],
        separators: b" ",
        text: 1 << 14,
        numbers: |_| Vec::new(),
    },
    execute,
};

static IMAGE: &[u8] = include_bytes!("../commands/cases/files/obj/quad.png");

fn generate(random: &mut Random) -> (Vec<u8>, usize) {
    let mut out = String::new();
    for name in ["m", "stone", "M", "a b"] {
        let line = random.pick(&["\n", "\r\n", " # said\n", "\n\n"]);
        write!(out, "{}newmtl {name}{line}", random.pick(&["", "  ", "\t"])).unwrap();
        if random.one_in(2) {
            let mut part = || random.between(0.0, 1.0);
            writeln!(out, "Kd {} {} {}", part(), part(), part()).unwrap();
        }
        if random.one_in(2) {
            let options =
                random.pick(&["", "-s 2 2 1 ", "-o 0.5 0 0 ", "-clamp on ", "-s 2 -o 1 ", "-bm 1 ", "-mm 0 1 "]);
            let file = random.pick(&["quad.png", "QUAD.PNG", "./quad.png", "none.png", "\"quad.png\""]);
            writeln!(out, "{} {options}{file}", random.pick(&["map_Kd", "map_kd", "MAP_KD"])).unwrap();
        }
        out.push_str(random.pick(&["d 0.5\n", "Tr 0.5\n", "illum 2\nNs 10\n", "Ke 1 1 1\n", ""]));
    }
    (out.into_bytes(), 4)
}

/// Writes a mesh that names the materials next to them, and reads it as points and as triangles.
fn execute(path: &Path, valid: Option<usize>) -> Result<Outcome, String> {
    let mesh = path.with_extension("obj");
    let name = path.file_name().unwrap_or_default().display();
    let corners = "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n";
    let faces = "usemtl m\nf 1/1 2/2 3/3\nusemtl stone\nf 1/1 3/3 4/4\n";
    std::fs::write(&mesh, format!("mtllib {name}\n{corners}{faces}")).map_err(|error| error.to_string())?;
    std::fs::write(path.with_file_name("quad.png"), IMAGE).map_err(|error| error.to_string())?;
    // An image that a material names may be missing; then there is a note or an error.
    let names_what_is_there = valid.filter(|_| !std::fs::read(path).is_ok_and(|text| has(&text, b"none.png")));
    let drawn = render::points(&mesh, names_what_is_there)?;
    match io::read_mesh(&mesh, &()) {
        // Unreadable materials are left out with a note.
        Ok(mesh) if mesh.triangles.len() == 2 => match mesh.notes.iter().find(|note| note.contains(char::is_control)) {
            Some(note) => Err(format!("a note is more than a line: {note:?}")),
            None if mesh.notes.is_empty() => Ok(drawn),
            None => Ok(Outcome::Refused),
        },
        Ok(mesh) => Err(format!("two triangles became {}", mesh.triangles.len())),
        Err(error) if names_what_is_there.is_some() => Err(format!("valid materials are refused: {error}")),
        // The error names the faulty file: the mesh, its materials or their image.
        Err(error) => sentence(&error, None).map(|()| Outcome::Refused),
    }
}

fn has(text: &[u8], word: &[u8]) -> bool {
    text.windows(word.len()).any(|window| window == word)
}
