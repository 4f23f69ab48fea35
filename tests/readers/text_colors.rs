//! Colours of texts: missing ones, shares, and those whose columns have no names.

use super::text::codes;
use super::{Folder, Points, ReadOptions, io};
use epsplat::io::Wanted;

/// The default colour, as the 8-bit codes of a grey.
fn default() -> [u8; 4] {
    let folder = Folder::new();
    let points = folder.read("a.csv", b"x,y,z,r,g,b\n0,0,0,,,\n1,0,0,255,0,0\n").unwrap();
    let [missing, red] = codes(&points)[..] else { panic!("{points:?}") };
    assert_eq!(red, [255, 0, 0, 255]);
    assert!(missing[0] == missing[1] && missing[1] == missing[2] && missing[0] > 100 && missing[3] == 255);
    missing
}

#[test]
fn missing_colours_are_not_black() {
    let folder = Folder::new();
    let default = default();
    let read = |text: &str| codes(&folder.read("a.csv", text.as_bytes()).unwrap());
    // Some rows, in each of the forms of a missing number, of codes and of shares.
    for cells in [",,", "NA,NA,NA", "nan,nan,nan", "7,,9", ",8,9", "7,8,"] {
        assert_eq!(read(&format!("x,y,z,r,g,b\n0,0,0,{cells}\n1,0,0,255,0,51\n")), [default, [255, 0, 51, 255]]);
        let shares = format!("x,y,z,r,g,b\n0,0,0,{cells}\n1,0,0,1,0,0.2\n").replace(['7', '8', '9'], "0");
        assert_eq!(read(&shares), [default, [255, 0, 51, 255]]);
    }
    // All rows: the intensities show, and where one is missing, the default colour.
    let grey = read("x,y,z,r,g,b,intensity\n0,0,0,,,,0\n1,0,0,,,,10\n2,0,0,,,,\n");
    assert_eq!(grey, [[0, 0, 0, 255], [255; 4], default]);
    // A missing alpha is opaque.
    assert_eq!(read("x,y,z,r,g,b,a\n0,0,0,255,0,51,\n1,0,0,255,0,51,128\n"), [[255, 0, 51, 255], [255, 0, 51, 128]]);
    // Floats of a PLY file may be missing too.
    let header = "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\nproperty \
                  float red\nproperty float green\nproperty float blue\nend_header\n";
    let points = folder.read("a.ply", format!("{header}0 0 0 nan nan nan\n1 0 0 1 0 0\n").as_bytes()).unwrap();
    assert_eq!(codes(&points), [default, [255, 0, 0, 255]]);
}

#[test]
fn scans_without_colours_stand_beside_others() {
    let folder = Folder::new();
    let default = default();
    let pose = "1\n1\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n";
    let file = |points: &[&str]| points.iter().map(|point| format!("{pose}{point}\n")).collect::<String>();
    let colors = |points: &[&str]| codes(&folder.read("a.ptx", file(points).as_bytes()).unwrap());
    assert_eq!(colors(&["1 2 3 0.5 255 0 51", "4 5 6 0.5"]), [[255, 0, 51, 255], default]);
    assert_eq!(colors(&["4 5 6 0.5", "1 2 3 0.5 255 0 51"]), [default, [255, 0, 51, 255]]);
    assert_eq!(colors(&["4 5 6", "4 5 6 0.5", "1 2 3 1"])[1..], [[128, 128, 128, 255], [255; 4]]);
    assert_eq!(folder.read("a.ptx", file(&["1 2 3", "4 5 6"]).as_bytes()).unwrap().colors, None);
    // Attributes that no scan has are none.
    let asked = |points: &[&str], column: Option<&str>| -> Result<Points, epsplat::Error> {
        std::fs::write(folder.path("a.ptx"), file(points)).unwrap();
        let wanted = Wanted { column: column.map(str::to_owned), spans: true, ..Wanted::default() };
        io::read_with(&folder.path("a.ptx"), ReadOptions { wanted, describe: true, ..ReadOptions::default() }, &())
    };
    let points = asked(&["1 2 3 0.5", "4 5 6 0.5"], None).unwrap();
    let names: Vec<_> = points.spans.iter().map(|span| span.name.to_ascii_lowercase()).collect();
    assert_eq!(names, ["x", "y", "z", "intensity"]);
    assert_eq!(points.about.unwrap().attributes.len(), 4);
    let said = asked(&["1 2 3 0.5"], Some("red")).unwrap_err().to_string();
    assert!(said.contains("it has no attribute 'red'"), "{said}");
    assert!(asked(&["1 2 3 0.5", "1 2 3 0.5 255 0 51"], Some("red")).is_ok());
}

#[test]
fn whole_shares_are_no_codes() {
    let folder = Folder::new();
    let expected = [[255, 0, 0, 255], [0, 255, 255, 255]];
    for (name, text) in [
        ("a.csv", "x,y,z,r,g,b\n0,0,0,1,0,0\n1,0,0,0,1,1\n"),
        ("a.csv", "x,y,z,r,g,b,a\n0,0,0,1,0,0,1\n1,0,0,0,1,1,1\n"),
        ("a.txt", "//X Y Z Rf Gf Bf\n0 0 0 1.000000 0.000000 0.000000\n1 0 0 0.000000 1.000000 1.000000\n"),
        ("a.xyz", "0 0 0 1 0 0\n1 0 0 0 1 1\n"),
        ("a.off", "COFF\n2 0 0\n0 0 0 1 0 0 1\n1 0 0 0 1 1 1\n"),
    ] {
        assert_eq!(codes(&folder.read(name, text.as_bytes()).unwrap()), expected, "{text}");
    }
    // Controls: a single number above 1 makes all of them codes, and so do the bytes of a PLY file.
    let dark = codes(&folder.read("a.csv", b"x,y,z,r,g,b\n0,0,0,1,0,0\n1,0,0,0,2,1\n").unwrap());
    assert_eq!(dark, [[1, 0, 0, 255], [0, 2, 1, 255]]);
    let header = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nproperty \
                  uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n";
    assert_eq!(codes(&folder.read("a.ply", format!("{header}0 0 0 1 0 1\n").as_bytes()).unwrap()), [[1, 0, 1, 255]]);
    // CloudCompare's shares with alphas.
    let shares = folder.read("a.txt", b"//X Y Z Rf Gf Bf Af\n0 0 0 1.0 0.2 0.0 0.5\n").unwrap();
    assert_eq!(codes(&shares), [[255, 51, 0, 128]]);
}

#[test]
fn doubtful_guesses_are_told() {
    let folder = Folder::new();
    let read = |name: &str, text: &str| folder.read(name, text.as_bytes()).unwrap();
    let doubts = |points: &Points| points.notes.iter().filter(|note| note.starts_with("warning: ")).count();
    // A class behind a colour.
    let rows: String = (0..40).map(|k| format!("{k} 0 1 {} {} {} {}\n", 5 * k, 3 * k + 1, 2 * k + 7, k % 3)).collect();
    let points = read("a.txt", &rows);
    assert_eq!((codes(&points)[39], doubts(&points)), ([195, 118, 85, 255], 0));
    // PTS files have the intensity in front.
    assert_eq!(codes(&read("a.pts", &rows))[39], [118, 85, 0, 255]);
    // CloudCompare's way to write numbers.
    let points = read("a.txt", "0 0 1 200 100 50 7.000000\n1 0 1 201 101 51 8.000000\n");
    assert_eq!((codes(&points)[0], doubts(&points)), ([200, 100, 50, 255], 0));
    let points = read("a.txt", "0 0 1 7.000000 200 100 50\n1 0 1 8.000000 201 101 51\n");
    assert_eq!((codes(&points)[0], doubts(&points)), ([200, 100, 50, 255], 0));
    let points = read("a.txt", "0 0 1 200 100 50 7\n1 0 1 201 101 51 8\n");
    assert_eq!((codes(&points)[0], doubts(&points)), ([200, 100, 50, 255], 1));
    // A normal whose last two parts and curvature have unit length too.
    let points = read("a.txt", "0 0 1 0.001 0.6 0.8 0.002\n1 0 1 0.002 0.6 0.8 0.003\n");
    assert_eq!(points.normals.as_ref().unwrap()[0], [0.001, 0.6, 0.8]);
    // Pure colours look like normals, and 16-bit colours like nothing.
    assert_eq!(doubts(&read("a.txt", "0 0 1 1 0 0\n1 0 1 0 0 1\n")), 1);
    assert_eq!(doubts(&read("a.txt", "0 0 1 1 0 0\n1 0 1 0 0 -1\n")), 0);
    let notes = read("a.txt", "0 0 1 65535 0 30000\n").notes.join("\n");
    assert!(notes.contains("columns 4 to 6 may be colours of 16 bits: a first line with names"), "{notes}");
}

#[test]
fn comments_stand_anywhere() {
    let folder = Folder::new();
    for text in [
        "1 2 3 255 0 51 # first, of many; rows\n4 5 6 1 2 3\n",
        "1 2 3 255 0 51 // first\n4 5 6 1 2 3 % second\n",
        "1,2,3,255,0,51 # first, of many\n4,5,6,1,2,3 // second\n",
        "x,y,z,r,g,b\n1,2,3,255,0,51 # first, of many\n4,5,6,1,2,3\n",
        "1 2 3 255 0 51\n4 5 6 1 2 3 # second\n",
        "% x y z r g b\n1 2 3 255 0 51\n% another\n4 5 6 1 2 3\n",
    ] {
        let points = folder.read("a.txt", text.as_bytes()).unwrap();
        assert_eq!(points.positions, [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]], "{text}");
        assert_eq!(codes(&points), [[255, 0, 51, 255], [1, 2, 3, 255]], "{text}");
    }
    // A word may start as a comment.
    let points = folder.read("a.csv", b"x,y,z,color,r,g,b\n1,2,3,#ff0033,255,0,51\n").unwrap();
    assert_eq!(codes(&points), [[255, 0, 51, 255]]);
}

#[test]
fn names_of_more_programs_are_known() {
    let folder = Folder::new();
    let read = |text: &str| folder.read("a.csv", text.as_bytes()).unwrap();
    // An intensity, by a short name and with a unit; the same letter in front counts the points.
    for header in ["x,y,z,i", "X,Y,Z,I", "X,Y,Z,Amplitude[]", "X[m],Y[m],Z[m],Reflectance[dB]"] {
        let grey = codes(&read(&format!("{header}\n0,0,0,0\n1,0,0,10\n")));
        assert_eq!(grey, [[0, 0, 0, 255], [255; 4]], "{header}");
    }
    assert_eq!(read("i,x,y,z\n0,0,0,0\n1,1,0,10\n").colors, None);
    for (header, row) in [
        ("Points:0,Points:1,Points:2", "1,2,3"),
        ("\"Points_0\",\"Points_1\",\"Points_2\"", "1,2,3"),
        ("X,Y,Z,x,y", "1,2,3,400,500"),
        ("x,y,Easting,Northing,Height", "400,500,1,2,3"),
    ] {
        assert_eq!(read(&format!("{header}\n{row}\n")).positions, [[1.0, 2.0, 3.0]], "{header}");
    }
    // COLMAP's points, whose rows end with tracks of any length.
    let text = "# 3D point list with one line of data per point:\n#   POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] as \
                (IMAGE_ID, POINT2D_IDX)\n# Number of points: 2, mean track length: 3\n63390 1.5 0.75 -0.5 115 121 122 1.33 16 \
                6542 15 7345\n63376 2 1 0 255 0 51 0.25 6 1 7 2 8 3 9 4\n";
    let points = folder.read("points3D.txt", text.as_bytes()).unwrap();
    assert_eq!(points.positions, [[1.5, 0.75, -0.5], [2.0, 1.0, 0.0]]);
    assert_eq!(codes(&points), [[115, 121, 122, 255], [255, 0, 51, 255]]);
    assert_eq!(folder.refusal("points3D.txt", format!("{text}7 1 2\n").as_bytes()).split(':').next(), Some("line 6"));
}
