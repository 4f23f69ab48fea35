//! OFF files, as other programs write them, and damaged ones.

use super::text::codes;
use super::{Folder, io};

#[test]
fn meshes_of_many_programs_are_read() {
    let folder = Folder::new();
    let obj = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0.5 0.5 1\nf 1 4 3 2\nf 1 2 5\nf 2 3 5\nf 3 4 5\nf 4 1 5\n";
    let expected = folder.read("a.obj", obj.as_bytes()).unwrap();
    let vertices = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n0.5 0.5 1\n";
    let faces = "4 0 3 2 1\n3 0 1 4\n3 1 2 4\n3 2 3 4\n3 3 0 4\n";
    for text in [
        format!("OFF\n5 5 0\n{vertices}{faces}"),
        // MeshLab, with comments; ModelNet, without a line end after the first word; CGAL.
        format!("OFF\n# made by hand\n5 5 8 # counts\n\n{vertices}{faces}"),
        format!("OFF5 5 0\n{vertices}{faces}"),
        format!("OFF 5 5 0\r\n\r\n{}", format!("{vertices}{faces}").replace('\n', " \r\n")),
        format!("5 5 0\n{vertices}{faces}"),
    ] {
        let points = folder.read("a.off", text.as_bytes()).unwrap();
        assert_eq!(points.positions, expected.positions, "{text}");
        assert_eq!(
            (&points.normals, &points.radii, &points.faces),
            (&expected.normals, &expected.radii, &expected.faces)
        );
        assert!(points.closed);
        let utf16: Vec<u8> = format!("\u{feff}{text}").encode_utf16().flat_map(u16::to_be_bytes).collect();
        assert_eq!(folder.read("a.off", &utf16).unwrap(), points);
    }
    assert_eq!(io::read_mesh(&folder.path("a.off"), &()).unwrap().triangles.len(), 6);
    assert_eq!(folder.read("mesh", format!("OFF\n5 5 0\n{vertices}{faces}").as_bytes()).unwrap().positions.len(), 5);
    // Points without faces.
    let points = folder.read("a.off", format!("OFF\n5 0 0\n{vertices}").as_bytes()).unwrap();
    assert!(points.faces.is_none() && !points.of_mesh && points.positions.len() == 5);
    assert!(folder.read("a.off", b"OFF\n0 0 0\n").unwrap().positions.is_empty());
}

#[test]
fn vertices_and_faces_have_colours_and_normals() {
    let folder = Folder::new();
    let read = |text: &str| folder.read("a.off", text.as_bytes()).unwrap();
    let expected = [[255, 0, 51, 255], [0, 255, 0, 255], [0, 0, 255, 255]];
    for text in [
        "COFF\n3 1 0\n0 0 0 255 0 51 255\n1 0 0 0 255 0 255\n0 1 0 0 0 255 255\n3 0 1 2\n",
        "COFF\n3 1 0\n0 0 0 255 0 51\n1 0 0 0 255 0\n0 1 0 0 0 255\n3 0 1 2\n",
        "COFF\n3 1 0\n0 0 0 1.0 0 0.2 1.0\n1 0 0 0 1 0 1\n0 1 0 0 0 1 1\n3 0 1 2\n",
        "STCNOFF\n3 1 0\n0 0 0 0 0 1 255 0 51 255 0 0\n1 0 0 0 0 1 0 255 0 255 1 0\n0 1 0 0 0 1 0 0 255 255 0 1\n3 0 1 2\n",
    ] {
        let points = read(text);
        assert_eq!(codes(&points), expected, "{text}");
        assert_eq!(points.texture.is_some(), text.starts_with("ST"));
    }
    // MeshLab's order of marks; and its library's order of numbers, which follows no mark.
    let square = ["0 0 0", "1 0 0", "0 1 0"];
    let all = ["255 0 51 255", "0 255 0 255", "0 0 255 255"];
    let row = |k: usize, parts: &[&str]| format!("{} {}\n", square[k], parts.join(" ")).replace("RGBA", all[k]);
    for (word, parts) in [
        ("CSTOFF", &["RGBA", "0.25 0.5"][..]),
        ("NCOFF", &["RGBA", "0 0.6 0.8"]),
        ("NCOFF", &["0 0.6 0.8", "RGBA"]),
        ("CNOFF", &["0 0.6 0.8", "RGBA"]),
        ("CNOFF", &["RGBA", "0 0.6 0.8"]),
        ("NCSTOFF", &["RGBA", "0 0.6 0.8", "0.25 0.5"]),
        ("NSTCOFF", &["0 0.6 0.8", "RGBA", "0.25 0.5"]),
    ] {
        let rows: String = (0..3).map(|k| row(k, parts)).collect();
        let text = format!("{word}\n3 1 0\n{rows}3 0 1 2\n");
        let points = read(&text);
        assert_eq!(codes(&points), expected, "{text}");
        assert_eq!(points.texture.is_some_and(|places| places == [[0.25, 0.5]; 3]), word.contains("ST"), "{text}");
        if word.contains('N') {
            assert_eq!(points.normals.unwrap(), [[0.0, 0.6, 0.8]; 3], "{text}");
        }
        // The first bytes tell the format without an extension.
        assert_eq!(folder.read("mesh", text.as_bytes()).unwrap().positions.len(), 3);
    }
    let normals = read("NOFF\n3 1 0\n0 0 0 0 0.6 0.8\n1 0 0 0 0 1\n0 1 0 0 0 1\n3 0 1 2\n");
    assert_eq!(normals.normals.unwrap()[0], [0.0, 0.6, 0.8]);
    assert_eq!(normals.faces.unwrap().normals.unwrap()[0][0], [0.0, 0.6, 0.8]);
    let square = "OFF\n4 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n";
    let paint = |faces: &str| read(&format!("{square}{faces}")).faces.unwrap().paint.map(|paint| paint.colors);
    assert_eq!(paint("3 0 1 2 255 0 0\n3 0 2 3 0 255 0\n").unwrap(), [[1.0, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, 1.0]]);
    assert_eq!(
        paint("3 0 1 2 1.0 0 0 0.5\n3 0 2 3 0 1.0 0 1\n").unwrap(),
        [[1.0, 0.0, 0.0, 0.5], [0.0, 1.0, 0.0, 1.0]]
    );
    // An index into a table of colours is none.
    assert_eq!(paint("3 0 1 2 7\n3 0 2 3 7\n"), None);
}

#[test]
fn damaged_files_are_refused_in_a_sentence() {
    let folder = Folder::new();
    let good = "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    for (from, to, said) in [
        ("3 1 0", "1099511627776 1 0", "it promises 1099511627776 vertices, and ends after 4"),
        ("3 1 0", "3 1099511627776 0", "it promises 1099511627776 faces, and ends after 1"),
        ("3 1 0", "-3 1 0", "line 2: the numbers of vertices, faces and edges are needed"),
        ("3 0 1 2", "3 0 1 3", "line 6: a face names the vertex 3 of 3, counted from 0"),
        ("3 0 1 2", "3 0 1 -1", "line 6: a face names the vertex -1 of 3, counted from 0"),
        ("3 0 1 2", "1e300 0 1 2", ""),
        ("3 0 1 2", "4 0 1 2", "line 6: a face of 4 corners is promised, but 3 numbers follow"),
        ("0 1 0\n", "0 1\n", "line 5: 3 numbers are needed for a vertex, not 2"),
        ("0 1 0\n", "0 a 0\n", "line 5: 'a' is not a number"),
        ("OFF", "4OFF", "line 1: it is no OFF file of three dimensions: '4OFF'"),
        (
            "OFF",
            "nOFF",
            "line 1: vertices of 'nOFF' are not read: the marks in front of OFF may be ST, C and N, as in COFF",
        ),
        ("OFF", "OFF BINARY", "line 1: binary OFF is not read: write it as text, or as PLY"),
        ("OFF", "COFF", "line 3: a vertex of a COFF file needs 6 numbers or more, but this line has 3"),
        ("OFF", "NSTOFF", "line 3: a vertex of an STNOFF file needs 8 numbers or more, but this line has 3"),
        (
            "OFF",
            "CCOFF",
            "line 1: vertices of 'CCOFF' are not read: the marks in front of OFF may be ST, C and N, as in COFF",
        ),
    ] {
        let refused = folder.refusal("a.off", good.replacen(from, to, 1).as_bytes());
        assert!(refused == said || said.is_empty() && refused.starts_with("line 6: "), "{refused}");
    }
    assert_eq!(folder.refusal("a.off", b""), "the file ends before its numbers of vertices and faces");
    assert_eq!(folder.refusal("a.off", &good.as_bytes()[..22]), "it promises 3 vertices, and ends after 2");
    let nan = good.replace("1 0 0", "nan 0 0");
    assert_eq!(folder.read("a.off", nan.as_bytes()).unwrap().positions.len(), 3);
}
