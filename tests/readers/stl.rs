//! STL files, as other programs write them, and damaged ones.

use super::{Folder, ReadOptions, io};
use epsplat::io::Wanted;

/// The corners of a tetrahedron, and its triangles, counter-clockwise seen from outside.
const CORNERS: [[f32; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
const OUTWARD: [[usize; 3]; 4] = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];

/// A binary file with these attribute words.
fn binary(header: &[u8], codes: [u16; 4]) -> Vec<u8> {
    let mut bytes = header.to_vec();
    bytes.resize(80, 0);
    bytes.extend(4u32.to_le_bytes());
    for (triangle, code) in OUTWARD.iter().zip(codes) {
        bytes.extend([0; 12]);
        bytes.extend(triangle.iter().flat_map(|corner| CORNERS[*corner]).flat_map(f32::to_le_bytes));
        bytes.extend(code.to_le_bytes());
    }
    bytes
}

/// A text as OpenSCAD writes it.
fn text() -> String {
    let facet = |triangle: &[usize; 3]| {
        let corner = |corner: &usize| {
            let [x, y, z] = CORNERS[*corner];
            format!("      vertex {x} {y} {z}\n")
        };
        let corners: String = triangle.iter().map(corner).collect();
        format!("  facet normal -0 -0 -1\n    outer loop\n{corners}    endloop\n  endfacet\n")
    };
    format!("solid OpenSCAD_Model\n{}endsolid OpenSCAD_Model\n", OUTWARD.iter().map(facet).collect::<String>())
}

#[test]
fn both_forms_become_the_same_mesh() {
    let folder = Folder::new();
    let of_text = folder.read("a.stl", text().as_bytes()).unwrap();
    let mut positions = of_text.positions.clone();
    positions.sort_by(|a, b| a.partial_cmp(b).unwrap());
    assert_eq!(positions, [[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]);
    assert!(of_text.closed && of_text.of_mesh && of_text.radii.is_some());
    let faces = of_text.faces.as_ref().unwrap();
    let corners = |triangle: &[u32; 3]| triangle.map(|corner| of_text.positions[corner as usize]);
    let expected = OUTWARD.map(|triangle| triangle.map(|corner| CORNERS[corner].map(f64::from)));
    assert_eq!(faces.triangles.iter().map(corners).collect::<Vec<_>>(), expected);
    assert!(faces.normals.is_none() && faces.paint.is_none());
    // The same triangles as OBJ make the same points.
    let obj = "v 0 0 0\nv 0 1 0\nv 1 0 0\nv 0 0 1\nf 1 2 3\nf 1 3 4\nf 3 2 4\nf 2 1 4\n";
    let of_obj = folder.read("a.obj", obj.as_bytes()).unwrap();
    assert_eq!((&of_text.normals, &of_text.radii, &of_text.faces), (&of_obj.normals, &of_obj.radii, &of_obj.faces));
    // MeshLab begins binary files with `STL`, some programs with `solid`, trimesh with zeros.
    for header in [&b"VCG"[..], b"solid of another kind", b""] {
        assert_eq!(folder.read("b.stl", &binary(header, [0; 4])).unwrap(), of_text, "{header:?}");
    }
    for variant in [text().replace('\n', "\r\n"), text().to_uppercase(), text().replace("OpenSCAD_Model", "two words")]
    {
        assert_eq!(folder.read("c.STL", variant.as_bytes()).unwrap(), of_text);
    }
    // The first bytes tell text without an extension.
    assert_eq!(folder.read("mesh", text().as_bytes()).unwrap(), of_text);
    let mesh = io::read_mesh(&folder.path("a.stl"), &()).unwrap();
    assert_eq!((mesh.triangles.len(), mesh.positions.len()), (4, 4));
    assert!(folder.read("d.stl", b"solid nothing\nendsolid nothing\n").unwrap().positions.is_empty());
}

#[test]
fn colours_of_15_bits_are_read() {
    let folder = Folder::new();
    let colors = |bytes: &[u8]| {
        let faces = folder.read("a.stl", bytes).unwrap().faces.unwrap();
        faces.paint.map(|paint| paint.colors).unwrap_or_default()
    };
    let (red, blue) = (31 << 10, 31);
    // VisCAM: the highest bit marks a colour, and red has the highest bits.
    let viscam = colors(&binary(b"", [0x8000 | red, 0x8000 | blue, 0x8000, 0]));
    assert_eq!(viscam[..3], [[1.0, 0.0, 0.0, 1.0], [0.0, 0.0, 1.0, 1.0], [0.0, 0.0, 0.0, 1.0]]);
    assert!(viscam[3][0] > 0.0 && viscam[3][0] == viscam[3][1]);
    // Magics: the highest bit marks the colour of the header, and blue has the highest bits.
    let magics = colors(&binary(b"COLOR=\xff\x00\x00\xff", [0x8000, 31 << 5, red, blue]));
    assert_eq!(magics, [[1.0, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, 1.0], [0.0, 0.0, 1.0, 1.0], [1.0, 0.0, 0.0, 1.0]]);
    assert!(colors(&binary(b"", [0, 1, 2, 3])).is_empty());
}

/// MeshLab's header of Magics, with grey and without an alpha.
const MESHLAB: &[u8] = b"COLOR=\x7f\x7f\x7f MATERIAL=\x7f\x7f\x7f \x7f\x7f\x7f \x7f\x7f\x7f ";

#[test]
fn colours_of_meshlab_are_read() {
    let folder = Folder::new();
    let colors = |header: &[u8], codes: [u16; 4]| {
        let faces = folder.read("a.stl", &binary(header, codes)).unwrap().faces.unwrap();
        faces.paint.map(|paint| paint.colors).unwrap_or_default()
    };
    // The linear light of the sRGB code 0x7f, computed apart.
    let is_grey = |color: &[f32; 4]| color[..3].iter().all(|c| (c - 0.212_230_76).abs() < 1e-6) && color[3] == 1.0;
    // Without colours of faces, words are zero.
    assert!(colors(MESHLAB, [0; 4]).iter().all(is_grey));
    // Bit 15 marks colours of faces, in the order of Magics.
    let [red, green, blue] = [0x8000 | 31, 0x8000 | 31 << 5, 0x8000 | 31 << 10];
    let primaries = [[1.0, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, 1.0], [0.0, 0.0, 1.0, 1.0], [0.0, 0.0, 0.0, 1.0]];
    assert_eq!(colors(MESHLAB, [red, green, blue, 0x8000]), primaries);
    assert_eq!(colors(MESHLAB, [red; 4]), [[1.0, 0.0, 0.0, 1.0]; 4]);
    // So do other programs with the mark of VisCAM; one colour for all is that of the header.
    let header = b"COLOR=\x00\xff\x00\xff";
    assert_eq!(colors(header, [red, green, blue, 0x8000]), primaries);
    assert_eq!(colors(header, [0xffff; 4]), [[0.0, 1.0, 0.0, 1.0]; 4]);
    assert_eq!(colors(header, [0; 4]), [[0.0, 1.0, 0.0, 1.0]; 4]);
    // A header without a colour behind its word.
    assert!(colors(b"COLOR=    ", [0; 4]).is_empty() && colors(b"COLOR=", [0; 4]).is_empty());
}

#[test]
fn binary_files_may_start_as_text() {
    let folder = Folder::new();
    let whole = binary(b"solid of another kind", [0; 4]);
    let expected = folder.read("a.stl", &whole).unwrap();
    assert_eq!(folder.read("a.stl", &[&whole[..], b"\0\0 trailing"].concat()).unwrap(), expected);
    let refused = folder.refusal("a.stl", &whole[..whole.len() - 1]);
    assert_eq!(refused, "its header promises 4 triangles, the file ends after 3");
    // Lines may end with carriage returns alone.
    assert_eq!(folder.read("a.stl", text().replace('\n', "\r").as_bytes()).unwrap().positions.len(), 4);
    let damaged = text().replacen("vertex 0 1 0", "vertex 0 one 0", 1).replace('\n', "\r");
    assert_eq!(folder.refusal("a.stl", damaged.as_bytes()), "line 5: a number is needed, not 'one'");
}

#[test]
fn damaged_files_are_refused_in_a_sentence() {
    let folder = Folder::new();
    let whole = binary(b"", [0; 4]);
    assert_eq!(
        folder.refusal("a.stl", &whole[..whole.len() - 1]),
        "its header promises 4 triangles, the file ends after 3"
    );
    let hostile = [&whole[..80], &u32::MAX.to_le_bytes(), &whole[84..]].concat();
    assert_eq!(folder.refusal("a.stl", &hostile), "its header promises 4294967295 triangles, the file ends after 4");
    assert!(folder.refusal("a.stl", b"no").contains("it is no STL file"));
    let text = text();
    for (from, to, said) in [
        ("vertex 0 1 0", "vertex 0 one 0", "line 5: a number is needed, not 'one'"),
        ("vertex 0 1 0\n", "", "line 7: a facet has three corners, not 'endfacet'"),
        ("endfacet", "endface", "line 8: a word of an STL file is needed here, not 'endface'"),
    ] {
        assert_eq!(folder.refusal("a.stl", text.replacen(from, to, 1).as_bytes()), said);
    }
    assert!(folder.refusal("a.stl", &text.as_bytes()[..text.len() - 70]).contains("the file ends inside a facet"));
    let nan = text.replace("vertex 0 0 1", "vertex nan 0 1");
    assert_eq!(folder.read("a.stl", nan.as_bytes()).unwrap().faces.unwrap().triangles.len(), 4);
    // A filter is for points.
    let wanted = Wanted { filter: "Z[0:1]".parse().unwrap(), ..Wanted::default() };
    let options = ReadOptions { wanted, ..ReadOptions::default() };
    let said = io::read_with(&folder.path("a.stl"), options, &()).unwrap_err().to_string();
    assert!(said.contains("filters are for points"), "{said}");
}
