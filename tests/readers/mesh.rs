//! Meshes: faces of PLY files, and materials and textures of OBJ files.

use super::ply::{ENCODINGS, file};
use super::{Folder, sentence};
use epsplat::io::{self, Mesh};
use epsplat::low_level::scene::Colors;

const XYZ: [(&str, &str); 3] = [("float", "x"), ("float", "y"), ("float", "z")];

/// The corners of the unit square, and a point above it.
const CORNERS: [&[f64]; 5] = [&[0.0, 0.0, 0.0], &[1.0, 0.0, 0.0], &[1.0, 1.0, 0.0], &[0.0, 1.0, 0.0], &[0.0, 0.0, 1.0]];

fn read(folder: &Folder, name: &str, bytes: &[u8]) -> Mesh {
    std::fs::write(folder.path(name), bytes).unwrap();
    io::read_mesh(&folder.path(name), &()).unwrap()
}

#[test]
fn polygons_and_strips_are_triangles_in_every_encoding() {
    let folder = Folder::new();
    for encoding in ENCODINGS {
        for (list, name) in [("list uchar int", "vertex_indices"), ("list int ushort", "vertex_index")] {
            let face = [("float", "quality"), (list, name), ("list uchar float", "texcoord")];
            let faces: [&[f64]; 3] = [
                &[0.5, 4.0, 0.0, 1.0, 2.0, 3.0, 1.0, 0.5],
                &[0.5, 3.0, 0.0, 1.0, 4.0, 0.0],
                &[0.5, 2.0, 0.0, 1.0, 0.0],
            ];
            // A strip of a square that repeats a vertex, as strips do at corners, and a second
            // strip after a restart.
            let strips: [&[f64]; 1] = [&[9.0, 0.0, 1.0, 3.0, 2.0, 2.0, -1.0, 0.0, 1.0, 4.0]];
            let strip = [("list int int", "vertex_indices")];
            let elements =
                [("vertex", &XYZ[..], &CORNERS[..]), ("face", &face, &faces), ("tristrips", &strip, &strips)];
            let mesh = read(&folder, "a.ply", &file(encoding, &elements));
            let expected = [[0, 1, 2], [0, 2, 3], [0, 1, 4], [0, 1, 3], [3, 1, 2], [0, 1, 4]];
            assert_eq!(mesh.triangles, expected, "{encoding}");
            assert_eq!((mesh.positions.len(), &mesh.normals, &mesh.texture), (5, &None, &None));
            // Faces may also precede vertices.
            let turned = [elements[1], elements[0]];
            assert_eq!(read(&folder, "a.ply", &file(encoding, &turned)).triangles, expected[..3]);

            // Read as points, the file equals an OBJ file with the same faces.
            let points = io::read(&folder.path("a.ply"), &()).unwrap();
            let text = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nf 1 2 3 4\nf 1 2 5\n";
            let same = folder.read("a.obj", text.as_bytes()).unwrap();
            assert_eq!((points.normals, points.radii), (same.normals, same.radii));
        }
    }
}

#[test]
fn what_vertices_have_corners_have_and_radii_of_the_file_stay() {
    let folder = Folder::new();
    let names = ["x", "y", "z", "nx", "ny", "nz", "radius", "u", "v"].map(|name| ("float", name));
    let rows: [&[f64]; 3] = [
        &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.25, 0.0, 0.0],
        &[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.5, 1.0, 0.0],
        &[0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.75, 0.0, 1.0],
    ];
    let face = [("list uchar int", "vertex_indices")];
    let elements = [("vertex", &names[..], &rows[..]), ("face", &face, &[&[3.0, 2.0, 0.0, 1.0]])];
    let mesh = read(&folder, "a.ply", &file("ascii", &elements));
    assert_eq!(mesh.normals.unwrap(), [[[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]]);
    assert_eq!(mesh.texture.unwrap(), [[[0.0, 1.0], [0.0, 0.0], [1.0, 0.0]]]);
    let points = io::read(&folder.path("a.ply"), &()).unwrap();
    assert_eq!(points.radii.unwrap(), [0.25, 0.5, 0.75]);
    assert_eq!(points.normals.unwrap()[1], [0.0, 1.0, 0.0]);
}

#[test]
fn faces_that_cannot_be_are_said() {
    let folder = Folder::new();
    let face = [("list uchar int", "vertex_indices")];
    for encoding in ENCODINGS {
        let refuse = |faces: &[&[f64]], cut: usize| {
            let mut bytes = file(encoding, &[("vertex", &XYZ, &CORNERS), ("face", &face, faces)]);
            bytes.truncate(bytes.len() - cut);
            folder.refusal("a.ply", &bytes)
        };
        assert_eq!(refuse(&[&[3.0, 0.0, 1.0, 5.0]], 0), "a face names the vertex 5, but there are 5");
        assert_eq!(
            refuse(&[&[3.0, 0.0, 1.0, 2.0], &[3.0, 0.0, -1.0, 2.0]], 0),
            "row 2 of element 'face' names the vertex -1, which is not a vertex index"
        );
        let cut = refuse(&[&[3.0, 0.0, 1.0, 2.0], &[3.0, 0.0, 1.0, 2.0]], 4);
        assert_eq!(cut, "the header promises 2 rows of element 'face', the file ends after 1");
    }
    let none = read(&folder, "a.ply", &file("ascii", &[("vertex", &XYZ, &CORNERS)]));
    assert_eq!((none.positions.len(), none.triangles.len()), (5, 0));
}

#[test]
fn materials_textures_and_what_of_them_is_missing() {
    let folder = Folder::new();
    let image = epsplat::low_level::frame::Frame::of_colors(1, 1, vec![[0.0, 1.0, 0.0, 1.0]]);
    io::png::write(&folder.path("a green.png"), &image).unwrap();
    let library = "newmtl red\nKd 0.5 0 0\nd 0.25\n\nnewmtl painted\nKd 1 0.5 1\nmap_Kd a green.png\nnewmtl lost\nmap_Kd none.png\n";
    std::fs::write(folder.path("my colours.mtl"), library).unwrap();
    let text = "mtllib my colours.mtl\nmtllib none.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nvt 0 0.25\nvt 1\nvt 0.5 0.75 0\n\
                f 1/1 2/2 3/3\nusemtl painted\nf 1/1 2/2 3/3\nf 3/-1 2/2 1/1\nusemtl red\ng part\nf 1/1 2/2 3/3\n\
                usemtl unknown\nf 1/1 2/2 3/3\nusemtl lost\nf 1/1 2/2 3/3\nusemtl painted\nf 1/1 2/2 3/3\n";
    let mesh = read(&folder, "a.obj", text.as_bytes());
    let names: Vec<&str> = (0..7).map(|k| mesh.material_of(k).map_or("-", |material| material.name.as_str())).collect();
    assert_eq!(names, ["-", "painted", "painted", "red", "unknown", "lost", "painted"]);
    let corners = [[0.0, 0.25], [1.0, 0.0], [0.5, 0.75]];
    let texture = mesh.texture.as_ref().unwrap();
    assert_eq!((texture[0], texture[2]), (corners, [corners[2], corners[1], corners[0]]));
    assert_eq!(mesh.material_of(3).unwrap().diffuse, [0.5, 0.0, 0.0, 0.25]);
    assert_eq!(mesh.material_of(4).unwrap().diffuse, [1.0; 4]);
    let painted = mesh.material_of(1).unwrap();
    assert_eq!(
        (painted.diffuse, painted.texture.as_ref().unwrap().at(0.3, 0.3)),
        ([1.0, 0.5, 1.0, 1.0], [0.0, 1.0, 0.0, 1.0])
    );
    assert!(mesh.material_of(5).unwrap().texture.is_none());
    assert!(
        mesh.notes.len() == 2 && mesh.notes[0].contains("none.mtl") && mesh.notes[1].contains("none.png"),
        "{:?}",
        mesh.notes
    );

    // A face without texture coordinates changes neither the coordinates of other faces nor the
    // number of points.
    let partly = read(&folder, "a.obj", format!("{text}f 1 2/1 3/2\n").as_bytes());
    assert_eq!(partly.texture.as_ref().unwrap()[..7], mesh.texture.as_ref().unwrap()[..]);
    assert!(partly.texture.as_ref().unwrap()[7].as_flattened().iter().all(|turns| turns.is_nan()));
    assert_eq!(partly.color_at(7, glam::DVec3::X), [1.0, 0.5, 1.0, 1.0]);
    assert_eq!(folder.read("a.obj", text.as_bytes()).unwrap().positions.len(), 3);
    std::fs::write(folder.path("a.obj"), "v 0 0 0\nvt 0 0\nf 1/1 1/1 1/2\n").unwrap();
    let error = io::read_mesh(&folder.path("a.obj"), &()).unwrap_err();
    assert_eq!(sentence(&error, &folder.path("a.obj")), "a face names texture coordinates that do not exist");
    assert!(folder.read("a.obj", b"v 0 0 0\nvt 0 0\nf 1/1 1/1 1/2\n").is_ok());

    let colored = read(&folder, "a.obj", b"v 0 0 0 1 0 0\nv 1 0 0 1 0 0\nv 0 1 0 1 0 0\nf 1 2 3\n");
    assert_eq!(colored.colors, Some(Colors::Linear(vec![[1.0, 0.0, 0.0, 1.0]; 3])));
    assert!(colored.material.is_none() && colored.notes.is_empty());
}

/// A concave arrow: a fan from its first corner would leave the polygon.
#[test]
fn concave_polygons_hold_their_triangles() {
    let folder = Folder::new();
    let arrow: [&[f64]; 5] = [&[0.0, 0.0, 0.0], &[2.0, 0.0, 0.0], &[2.0, 2.0, 0.0], &[1.0, 0.3, 0.0], &[0.0, 2.0, 0.0]];
    let uv: Vec<f64> = arrow.iter().flat_map(|corner| [corner[0], corner[1]]).collect();
    let row = [&[5.0, 0.0, 1.0, 2.0, 3.0, 4.0, 10.0], &uv[..]].concat();
    let face = [("list uchar int", "vertex_indices"), ("list uchar float", "texcoord")];
    let of_obj: String =
        arrow.iter().map(|p| format!("v {} {} {}\nvt {} {}\n", p[0], p[1], p[2], p[0], p[1])).collect();
    let mut meshes = vec![read(&folder, "a.obj", format!("{of_obj}f 1/1 2/2 3/3 4/4 5/5\n").as_bytes())];
    for encoding in ENCODINGS {
        meshes.push(read(&folder, "a.ply", &file(encoding, &[("vertex", &XYZ, &arrow), ("face", &face, &[&row])])));
    }
    for mesh in meshes {
        let double_area = |[a, b, c]: [[f64; 3]; 3]| (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        let areas: Vec<f64> =
            mesh.triangles.iter().map(|t| double_area(t.map(|vertex| mesh.positions[vertex as usize]))).collect();
        // A fan would have one triangle of the opposite orientation.
        assert!(areas.len() == 3 && areas.iter().all(|&area| area > 0.0), "{areas:?}");
        assert!((areas.iter().sum::<f64>() - 4.6).abs() < 1e-6);
        for (triangle, corners) in mesh.triangles.iter().zip(mesh.texture.as_ref().unwrap()) {
            let of = |vertex: u32| [0, 1].map(|axis| mesh.positions[vertex as usize][axis] as f32);
            assert_eq!(triangle.map(of), *corners);
        }
    }
}

#[test]
fn libraries_of_other_writers() {
    let folder = Folder::new();
    std::fs::create_dir(folder.path("maps")).unwrap();
    std::fs::write(folder.path("maps/a b.png"), picture(image::ImageFormat::Png)).unwrap();
    let first = "newmtl one\n\tKa spectral a.rfl\n\tNi\n\tKd 0.5 0 0\n\tTr 0\nnewmtl two\n\
                 map_Kd -blendu on -s 1 1 1 -o 0.5 -mm 0 1 maps\\a b.png\nmap_Bump\nnewmtl three\nmap_Kd maps/a b.png\n";
    std::fs::write(folder.path("first.mtl"), format!("\u{feff}{first}").replace('\n', "\r\n")).unwrap();
    std::fs::write(folder.path("second.mtl"), "newmtl four\nKd 0 1 0\n").unwrap();
    let faces: Vec<String> =
        ["one", "two", "three", "four"].map(|name| format!("usemtl {name}\nf 1/1 2/1 3/1\n")).into();
    let text =
        |libraries: &str| format!("mtllib {libraries}\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0.1 0.5\n{}", faces.concat());
    let mesh = read(&folder, "a.obj", text("first.mtl second.mtl").as_bytes());
    assert_eq!(mesh.notes, [""; 0]);
    let material = |triangle: usize| mesh.material_of(triangle).unwrap();
    assert_eq!((material(0).diffuse, material(3).diffuse), ([0.5, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, 1.0]));
    for painted in [1, 2] {
        let [r, g, b, _] = material(painted).texture.as_ref().unwrap().at(0.1, 0.5);
        assert!(r > 0.9 && g + b == 0.0, "{painted}: {r} {g} {b}");
    }
    // A name with spaces that no file has is reported as a single name.
    let mesh = read(&folder, "a.obj", text("first of all.mtl").as_bytes());
    assert!(mesh.notes.len() == 1 && mesh.notes[0].contains("first of all.mtl"), "{:?}", mesh.notes);
}

/// An image of two columns, red and blue.
fn picture(format: image::ImageFormat) -> Vec<u8> {
    let column = |x: u32| if x < 8 { image::Rgb([250u8, 0, 0]) } else { image::Rgb([0, 0, 250]) };
    let mut bytes = std::io::Cursor::new(Vec::new());
    image::RgbImage::from_fn(16, 16, |x, _| column(x)).write_to(&mut bytes, format).unwrap();
    bytes.into_inner()
}

#[test]
fn textures_are_of_several_formats_whatever_they_are_called() {
    let folder = Folder::new();
    let path = folder.path("texture.png");
    use image::ImageFormat::{Bmp, Jpeg, Png, Tga};
    for (format, close) in [(Png, 0.0), (Jpeg, 0.05), (Bmp, 0.0), (Tga, 0.0)] {
        // A TGA file has no signature, so its name must tell the format.
        let path = if format == Tga { folder.path("texture.TGA") } else { path.clone() };
        std::fs::write(&path, picture(format)).unwrap();
        let texture = io::Texture::read(&path).unwrap();
        for (u, expected) in [(0.1, [0.956, 0.0, 0.0]), (0.9, [0.0, 0.0, 0.956])] {
            let color = texture.at(u, 0.5);
            assert!((0..3).all(|k| (color[k] - expected[k]).abs() <= close + 1e-3), "{format:?} {u}: {color:?}");
        }
    }
    // Truncated images, and bytes that are not an image.
    let jpeg = picture(Jpeg);
    for bytes in [&jpeg[..jpeg.len() / 3], &jpeg[..10], b"GIF89a", b""] {
        std::fs::write(&path, bytes).unwrap();
        let message = sentence(&io::Texture::read(&path).unwrap_err(), &path);
        assert!(message.starts_with("not a readable PNG, JPEG, BMP or TGA: "), "{message}");
    }
}

#[test]
fn faces_have_texture_coordinates_of_their_own_and_a_texture_each() {
    let folder = Folder::new();
    std::fs::write(folder.path("a b.jpg"), picture(image::ImageFormat::Jpeg)).unwrap();
    let (indices, texcoord) = (("list uchar int", "vertex_indices"), ("list uchar float", "texcoord"));
    let corners = |of: &[f64]| -> Vec<f64> { [&[of.len() as f64], of].concat() };
    let uv: Vec<f64> = (0..8).map(f64::from).collect();
    let (square, square_uv) = (corners(&[0.0, 1.0, 2.0, 3.0]), corners(&uv));
    let (triangle, triangle_uv) = (corners(&[0.0, 1.0, 4.0]), corners(&uv[2..]));
    for encoding in ENCODINGS {
        // In either order, with the texture number between.
        for turned in [false, true] {
            let row = |first: &[f64], second: &[f64], number: f64| match turned {
                false => [first, &[number], second].concat(),
                true => [second, &[number], first].concat(),
            };
            let faces = [row(&square, &square_uv, 1.0), row(&triangle, &triangle_uv, 0.0)];
            let faces: Vec<&[f64]> = faces.iter().map(Vec::as_slice).collect();
            let names = if turned {
                [texcoord, ("uchar", "texnumber"), indices]
            } else {
                [indices, ("uchar", "texnumber"), texcoord]
            };
            let elements = [("vertex", &XYZ[..], &CORNERS[..]), ("face", &names[..], &faces)];
            let bytes = file(encoding, &elements);
            let comments = b"ply\ncomment TextureFile a b.jpg\ncomment TextureFile none.png\n";
            let mesh = read(&folder, "a.ply", &[&comments[..], &bytes[4..]].concat());
            assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3], [0, 1, 4]]);
            let [a, b, c, d] = [[0.0, 1.0], [2.0, 3.0], [4.0, 5.0], [6.0, 7.0]];
            assert_eq!(mesh.texture.as_deref(), Some(&[[a, b, c], [a, c, d], [b, c, d]][..]), "{encoding} {turned}");
            assert_eq!(mesh.material.as_deref(), Some(&[1, 1, 0][..]));
            mesh.check().unwrap();
            assert!(mesh.materials[0].texture.is_some() && mesh.materials[1].texture.is_none());
            assert!(mesh.notes.len() == 1 && mesh.notes[0].contains("none.png"), "{:?}", mesh.notes);
            // If the file is read as points, texture coordinates of faces are ignored.
            assert_eq!(io::read(&folder.path("a.ply"), &()).unwrap().texture, None);

            // If one face has no texture coordinates, the mesh has none.
            let bare = row(&triangle, &[0.0], 0.0);
            let elements = [("vertex", &XYZ[..], &CORNERS[..]), ("face", &names[..], &[faces[0], &bare])];
            let mesh = read(&folder, "a.ply", &[&comments[..], &file(encoding, &elements)[4..]].concat());
            assert_eq!((mesh.triangles.len(), mesh.texture, mesh.material), (3, None, None));
        }
    }
}

/// Reads 40,000 materials, as models of buildings have, in time linear in their number.
#[test]
fn many_materials_are_read_at_once() {
    let folder = Folder::new();
    let count = 40_000;
    std::fs::write(folder.path("a.png"), picture(image::ImageFormat::Png)).unwrap();
    let library: String = (0..count)
        .map(|k| format!("newmtl part {k}\nKd {} 0.5 0\nmap_Kd A.PNG\n", f64::from(k) / f64::from(count)))
        .collect();
    std::fs::write(folder.path("a.mtl"), library).unwrap();
    let faces: String = (0..2 * count).map(|k| format!("usemtl part {}\nf 1/1 2/1 3/1\n", k * 7919 % count)).collect();
    let text = format!("mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\n{faces}");
    let start = std::time::Instant::now();
    let mesh = read(&folder, "a.obj", text.as_bytes());
    let part = mesh.part(&vec![true; mesh.triangles.len()]);
    let points = io::read(&folder.path("a.obj"), &()).unwrap();
    assert!(start.elapsed().as_secs() < 20, "{:?}", start.elapsed());
    assert_eq!((mesh.materials.len(), part.materials.len()), (count as usize, count as usize));
    for triangle in [0, 1, 77, 2 * count as usize - 1] {
        let expected = (triangle as i32 * 7919 % count) as f32 / count as f32;
        for mesh in [&mesh, &part] {
            assert!((mesh.material_of(triangle).unwrap().diffuse[0] - expected).abs() < 1e-6);
        }
    }
    let paint = points.faces.unwrap().paint.unwrap();
    assert_eq!((paint.textures.len(), paint.numbers.len()), (1, 2 * count as usize));
}

/// Links to one file and copies are decoded once; distinct images share a limit.
#[test]
fn images_of_a_mesh_have_a_limit() {
    let folder = Folder::new();
    // A black image, which compresses well.
    let image = |name: &str, width: u32, height: u32| {
        image::GrayImage::new(width, height).save(folder.path(name)).unwrap();
    };
    image("0.png", 16384, 4096);
    for k in 1..6 {
        std::fs::copy(folder.path("0.png"), folder.path(&format!("{k}.png"))).unwrap();
    }
    let mesh = |files: std::ops::Range<usize>| {
        let library: String = files.clone().map(|k| format!("newmtl {k}\nmap_Kd {k}.png\n")).collect();
        std::fs::write(folder.path("a.mtl"), library).unwrap();
        let faces: String = files.map(|k| format!("usemtl {k}\nf 1/1 2/1 3/1\n")).collect();
        std::fs::write(folder.path("a.obj"), format!("mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\n{faces}"))
            .unwrap();
        io::read_mesh(&folder.path("a.obj"), &())
    };
    let copies = mesh(0..6).unwrap();
    let first = copies.materials[0].texture.as_ref().unwrap();
    assert!(copies.materials.iter().all(|of| std::sync::Arc::ptr_eq(of.texture.as_ref().unwrap(), first)));
    drop(copies);
    image("6.png", 16384, 12289);
    let error = mesh(5..7).unwrap_err();
    let said = sentence(&error, &folder.path("6.png"));
    assert!(said.contains("images of one mesh have 268451840 pixels, more than the limit of 268435456"), "{said}");
    // If the file is read as points, the images are left out with a note.
    let points = io::read(&folder.path("a.obj"), &()).unwrap();
    assert!(points.notes[0].contains("images of its materials are left out") && points.faces.unwrap().paint.is_some());
}

/// Devices, which may never end, are not read as libraries or images.
#[cfg(unix)]
#[test]
fn libraries_and_images_are_files() {
    let folder = Folder::new();
    let text =
        |library: &str| format!("mtllib {library}\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl m\nf 1/1 2/1 3/1\n");
    std::fs::write(folder.path("m.mtl"), "newmtl m\nmap_Kd /dev/zero\n").unwrap();
    for library in ["/dev/zero", "m.mtl"] {
        let mesh = read(&folder, "a.obj", text(library).as_bytes());
        assert!(mesh.notes.len() == 1 && mesh.notes[0].contains("it is a device"), "{:?}", mesh.notes);
    }
}

#[test]
fn flipped_bytes_of_libraries_and_images_never_panic() {
    let folder = Folder::new();
    let mut random = super::Random(11);
    let mut flipped = |bytes: &[u8]| {
        let mut bytes = bytes.to_vec();
        for _ in 0..1 + random.below(6) {
            let at = random.below(bytes.len());
            bytes[at] = random.bits() as u8;
        }
        bytes.truncate(bytes.len() - random.below(bytes.len() / 4));
        bytes
    };
    let library =
        b"newmtl m\nKd 0.5 0 1\nd 0.5\nmap_Kd -s 2 2 -o 0.5 0.5 -clamp on -mm 0 1 a.png\nNEWMTL n\nmap_kd b.tga\n";
    let text =
        "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nusemtl m\nf 1/1 2/2 3/1\nusemtl n\nf 1/1 2/2 3/1\n";
    use image::ImageFormat::{Bmp, Jpeg, Png, Tga};
    let pictures = [("a.png", Png), ("a.png", Jpeg), ("a.png", Bmp), ("b.tga", Tga)];
    for round in 0..300 {
        let (name, format) = pictures[round % 4];
        std::fs::write(folder.path(name), flipped(&picture(format))).unwrap();
        std::fs::write(folder.path("m.mtl"), if round % 3 == 0 { flipped(library) } else { library.to_vec() }).unwrap();
        std::fs::write(folder.path("a.obj"), text).unwrap();
        let _ = io::read_mesh(&folder.path("a.obj"), &());
        let _ = io::read(&folder.path("a.obj"), &());
    }
}
