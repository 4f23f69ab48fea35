//! Several textures in one scene, on surfels and on triangles: the device against its twin.

use super::*;
use epsplat::io::ply;
use epsplat::low_level::plan::Organisation;
use epsplat::low_level::scene::{Triangle, Triangles};

const BARE: [f32; 4] = [0.2, 0.5, 0.1, 1.0];

/// As steep as [`waves`], in other colours.
fn other_waves() -> Texture {
    let first = waves(true);
    let [width, height] = first.size();
    let turned = first.texels().iter().map(|[r, g, b, a]| [255 - *b, *r, *g, *a]);
    Texture::new(width, height, turned.collect()).unwrap()
}

/// A belt with the first texture above, the second in the middle, and none below.
fn parted(count: usize, radius: f64) -> Points {
    let mut points = belt(count, radius);
    let number = |[_, y, _]: &[f64; 3]| if *y > 0.2 { 0 } else { [1, u32::MAX][usize::from(*y < -0.3)] };
    points.texture_numbers = Some(points.positions.iter().map(number).collect());
    points.colors = Some(Colors::Linear(vec![BARE; points.positions.len()]));
    points
}

fn both() -> Vec<Texture> {
    vec![waves(true), other_waves()]
}

/// Device and twin agree, also where two textures meet.
#[test]
fn the_device_paints_several_as_its_twin_does() {
    if common::gpu().is_none() {
        return;
    }
    let scene = build_textured(vec![parted(3000, 1.5)], both(), &()).unwrap().0;
    for projection in [Projection::Pinhole, Projection::Orthographic] {
        let found = |sources| beyond_bounds(&scene, &camera(160, projection), Accumulator::Fixed, &sources).unwrap();
        let [wrong, covered, open, passing] = found(Sources::default());
        assert!(
            wrong == 0 && covered > 8000 && open < covered / 50 && passing > 0,
            "{wrong} {covered} {open} {passing}"
        );
        for (from, to) in [
            ("cell.y * held.atlas.w + cell.x", "cell.y * held.atlas.w"),
            ("number < held.textures", "number <= held.textures"),
            ("select(0.0, share, exists)", "share"),
        ] {
            let broken = found(Sources::default().replace("texture.wgsl", from, to).unwrap());
            assert!(broken[0] >= 20, "{from} became {to}, and {broken:?}");
        }
    }
}

/// Each texture shows as if it were alone, except for precision lost in a wider atlas. Surfels
/// without a texture show their blended colours.
#[test]
fn each_texture_shows_as_if_it_were_alone() {
    let camera = camera(96, Projection::Pinhole);
    let picture = |points: Points, textures: Vec<Texture>| {
        let scene = build_textured(vec![points], textures, &()).unwrap().0;
        render(&scene, &camera, &unlit(), &Backend::Reference, &()).unwrap().0
    };
    let points = parted(3000, 1.5);
    let alone = || Points { texture_numbers: None, ..points.clone() };
    let (first, second) = (picture(alone(), vec![waves(true)]), picture(alone(), vec![other_waves()]));
    let joint = picture(points.clone(), both());
    let swapped = picture(points.clone(), both().into_iter().rev().collect());
    let depths = |frame: &Frame| frame.color.iter().map(|color| color[3] > 0.0).collect::<Vec<_>>();
    assert_eq!(depths(&joint), depths(&first));
    let (mut compared, mut differs) = ([0; 3], 0);
    for (pixel, color) in joint.color.iter().enumerate().filter(|(_, color)| color[3] > 0.0) {
        let (x, y) = ((pixel % 96) as f64 + 0.5, (pixel / 96) as f64 + 0.5);
        let ray = camera.ray(x, y).normalize();
        let along = -camera.eye.dot(ray);
        let off = (camera.eye.length_squared() - along * along).min(1.0);
        let point = camera.eye + ray * (along - (1.0 - off).sqrt());
        let height = point.y;
        // Compares pixels two radii from the borders of the parts and away from the textures' seam,
        // which is found less sharply in a wider atlas.
        let part =
            [(0.35, 0.9), (-0.15, 0.05), (-0.9, -0.45)].iter().position(|(low, high)| height > *low && height < *high);
        let Some(part) = part.filter(|_| off < 0.9 && point.z.abs() > 0.2) else { continue };
        let expected = [first.color[pixel], second.color[pixel], BARE][part];
        let far = |a: &[f32; 4], b: &[f32; 4]| (0..4).any(|k| (a[k] - b[k]).abs() > 1e-4);
        assert!(!far(color, &expected), "{x} {y}: {color:?} and {expected:?}");
        compared[part] += 1;
        differs += usize::from(far(&swapped.color[pixel], &expected));
    }
    assert!(compared.iter().all(|count| *count > 100) && differs > 1000, "{compared:?} {differs}");
}

/// Texture numbers and their coordinates survive a file and [`simplify_in_texture`].
#[test]
fn numbers_survive_files_and_simplification() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("several.ply");
    let given = parted(12_000, 1.3);
    ply::write_points(&path, &given, &()).unwrap();
    let read = io::read(&path, &()).unwrap();
    assert_eq!((&read.texture, &read.texture_numbers), (&given.texture, &given.texture_numbers));
    let (scene, _, coordinates) = build_at_vertices(vec![read], &()).unwrap();
    let (simplified, left, report) =
        simplify_in_texture(&scene, &coordinates, &within(0.0005, SplatShape::Cap), &()).unwrap();
    assert!(report.selected * 3 < report.surfels, "{report:?}");
    let left = points(&simplified, left, SplatShape::Cap);
    ply::write_points(&path, &left, &()).unwrap();
    let left = io::read(&path, &()).unwrap();
    let mut seen = [0; 3];
    let all = left.positions.iter().zip(left.texture.as_ref().unwrap()).zip(left.texture_numbers.as_ref().unwrap());
    for (([x, y, z], [u, v]), number) in all {
        let expected = if *y > 0.2 { 0 } else { [1, u32::MAX][usize::from(*y < -0.3)] };
        assert_eq!(*number, expected, "{y}");
        seen[(*number).min(2) as usize] += 1;
        let around = [0.5 + z.atan2(*x) / TAU, 1.0 - y.acos() / PI];
        // Surfels without a texture have meaningless coordinates.
        let seam = *x < 0.0 && z.abs() < 0.2 || *number == u32::MAX;
        let off = (f64::from(*u) - around[0]).abs().max((f64::from(*v) - around[1]).abs());
        assert!(seam || off < 2e-3, "{u} {v} and {around:?}");
    }
    assert!(seen.iter().all(|count| *count > 50), "{seen:?}");
}

/// One texture serves all inputs, or each input has one, or there are as many as the points'
/// texture numbers need.
#[test]
fn textures_are_as_many_as_are_named() {
    let plain = || belt(300, 1.5);
    let several = || parted(300, 1.5);
    let made =
        |inputs: Vec<Points>, textures: Vec<Texture>| build_textured(inputs, textures, &()).map(|(scene, _)| scene);
    let count = |scene: Scene| textured(&scene).mipmaps().len();
    assert_eq!(count(made(vec![plain(), plain()], vec![waves(true)]).unwrap()), 1);
    assert_eq!(count(made(vec![plain(), plain()], both()).unwrap()), 2);
    assert_eq!(count(made(vec![several()], both()).unwrap()), 2);
    // Also accepted: a last image that no point uses, and an input that needs none.
    assert_eq!(count(made(vec![plain()], both()).unwrap()), 2);
    assert_eq!(count(made(vec![plain(), Points::default()], both()).unwrap()), 2);
    assert_eq!(count(made(vec![plain(), several()], [both(), both()[..1].to_vec()].concat()).unwrap()), 3);
    for (inputs, textures, told) in [
        (
            vec![plain(), plain()],
            [both(), both()].concat(),
            "4 textures are given, and 1 is needed for all inputs, or 2, one for each",
        ),
        (vec![several()], vec![waves(true)], "1 texture is given, and 2 are needed: as many as the numbers of points"),
        (vec![plain(), several()], both(), "2 textures are given, and 3 are needed"),
    ] {
        let error = made(inputs, textures).unwrap_err();
        assert!(error.to_string().contains(told), "{error}");
    }
    // The second input uses the second texture.
    let scene = made(vec![plain(), plain()], both()).unwrap();
    let first = textured(&scene).places().len() / 2;
    let number = |place: &Place| textured(&scene).atlas().number(place.center.map(f64::from));
    assert!(textured(&scene).places().iter().enumerate().all(|(k, place)| number(place) == u32::from(k >= first)));
}

/// A user's way: a mesh with several images and a plain colour is sampled, and rendered as `sample`
/// says.
#[test]
fn samples_of_a_mesh_with_several_images_are_painted_by_them() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    for (name, code) in [("red.png", [255, 0, 0, 255]), ("blue.png", [0, 0, 255, 255]), ("gray.png", [99, 99, 99, 255])]
    {
        let texels = vec![code; 16];
        io::png::write_texture(path(name).as_ref(), &Texture::new(4, 4, texels).unwrap()).unwrap();
    }
    let materials =
        "newmtl a\nmap_Kd red.png\nnewmtl b\nmap_Kd blue.png\nnewmtl c\nKd 0 1 0\nnewmtl d\nmap_Kd gray.png\n";
    std::fs::write(path("three.mtl"), materials).unwrap();
    let mut mesh = "mtllib three.mtl\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n".to_owned();
    for (k, material) in ["a", "b", "c"].iter().enumerate() {
        let (left, right) = (2 * k, 2 * k + 2);
        mesh += &format!(
            "v {left} 0 0\nv {right} 0 0\nv {right} 2 0\nv {left} 2 0\nusemtl {material}\nf -4/1 -3/2 -2/3 -1/4\n"
        );
    }
    // A triangle without an area has no samples.
    mesh += "usemtl d\nf -1/1 -1/2 -1/3\n";
    std::fs::write(path("three.obj"), mesh).unwrap();
    let run = |arguments: &[&str]| {
        let run =
            Command::new(env!("CARGO_BIN_EXE_epsplat")).args(arguments).current_dir(folder.path()).output().unwrap();
        assert!(run.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&run.stderr));
        String::from_utf8(run.stderr).unwrap()
    };
    let told = run(&["sample", "three.obj", "-o", "three.ply", "--count", "3000"]);
    let command = told.lines().find_map(|line| line.split("epsplat render ").nth(1)).unwrap();
    assert_eq!(command, "three.ply --texture red.png --texture blue.png --texture gray.png");
    let view = [
        "--shading",
        "unlit",
        "--eye",
        "3,1,9",
        "--target",
        "3,1,0",
        "--ortho",
        "3",
        "--size",
        "96x48",
        "-o",
        "three.png",
    ];
    let all: Vec<&str> = ["render"].into_iter().chain(command.split(' ')).chain(view).collect();
    run(&all);
    let picture = image::open(path("three.png")).unwrap().to_rgba8();
    // A unit is 16 pixels, and the three parts' middles are a third of the width apart.
    for (x, code) in [(16, [255, 0, 0, 255]), (48, [0, 0, 255, 255]), (80, [0, 255, 0, 255])] {
        assert_eq!(picture.get_pixel(x, 24).0, code, "{x}");
    }
}

/// Slopes of coordinates come only from neighbours in the same texture.
///
/// Surfels of two textures lie among each other. If all were in one texture, the jump from one
/// texture's coordinates to the other's would look like a steep slope.
#[test]
fn neighbours_in_another_texture_tell_nothing() {
    let first = belt(2000, 1.5);
    let moved = |place: &[f32; 2], by: f32| [place[0] + by, place[1]];
    let others: Vec<[f64; 3]> = first.positions.iter().map(|[x, y, z]| [x + 0.01 * z, *y, z - 0.01 * x]).collect();
    let second = |by: f32| Points {
        positions: [&others[..200], &others[400..]].concat(),
        texture: first
            .texture
            .as_ref()
            .map(|all| all[..200].iter().chain(&all[400..]).map(|at| moved(at, by)).collect()),
        normals: first.normals.as_ref().map(|all| [&all[..200], &all[400..]].concat()),
        radii: first.radii.as_ref().map(|all| all[200..].to_vec()),
        ..Points::default()
    };
    let largest = |inputs: Vec<Points>, textures: Vec<Texture>| {
        let scene = build_textured(inputs, textures, &()).unwrap().0;
        textured(&scene).places().iter().map(|place| place.reach).fold(0.0, f32::max)
    };
    let alone = largest(vec![first.clone()], vec![waves(true)]);
    let two = largest(vec![first.clone(), second(0.0)], both());
    let one = largest(vec![first.clone(), second(3.0)], vec![waves(true)]);
    assert!(two < 2.0 * alone && one > 10.0 * alone, "{alone} {two} {one}");
}

/// A surfel past the edges of its image shows that image, not its neighbour in the atlas, on every
/// side. This holds even if all its texture coordinates are one point.
#[test]
fn no_texture_shows_past_the_edges_of_another() {
    let Some(gpu) = common::gpu() else { return };
    let plain = |code: [u8; 4]| Texture::new(2, 2, vec![code; 4]).unwrap();
    let colors = [[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 255], [255, 255, 0, 255]];
    let patch = |number: usize, place: fn([f64; 2]) -> [f32; 2]| {
        let at = |k: usize| [(k % 9) as f64 / 8.0, (k / 9) as f64 / 8.0];
        let [x, y] = [(number % 2) as f64 * 1.6, (number / 2) as f64 * 1.6];
        Points {
            positions: (0..81).map(|k| [x + at(k)[0], y + at(k)[1], 0.0]).collect(),
            normals: Some(vec![[0.0, 0.0, 1.0]; 81]),
            radii: Some(vec![0.19; 81]),
            texture: Some((0..81).map(|k| place(at(k))).collect()),
            ..Points::default()
        }
    };
    let camera = Camera::look_at(
        (90, 90),
        Lens::OrthographicHeight(3.4),
        DVec3::new(1.3, 1.3, 9.0),
        DVec3::new(1.3, 1.3, 0.0),
        None,
        Up::Y,
        1e-3,
    );
    let camera = camera.unwrap();
    let textures = || colors.map(plain).to_vec();
    let backends = [Backend::Reference, Backend::gpu(gpu)];
    let places: [fn([f64; 2]) -> [f32; 2]; 2] = [|at| at.map(|c| c as f32), |_| [0.0; 2]];
    for (place, backend) in places.iter().flat_map(|place| backends.iter().map(move |backend| (place, backend))) {
        let inputs = (0..4).map(|number| patch(number, *place)).collect();
        let scene = build_textured(inputs, textures(), &()).unwrap().0;
        let (frame, _) = render(&scene, &camera, &unlit(), backend, &()).unwrap();
        let mut seen = 0;
        for (pixel, color) in frame.color.iter().enumerate().filter(|(_, color)| color[3] > 0.0) {
            let right = pixel % 90 >= 45;
            let upper = pixel / 90 < 45;
            let code = colors[usize::from(right) + 2 * usize::from(upper)].map(|code| f32::from(code) / 255.0);
            let off = (0..3).map(|k| (color[k] / color[3] - code[k]).abs()).fold(0.0, f32::max);
            assert!(off < 1e-5, "{pixel}: {color:?} and {code:?}");
            seen += 1;
        }
        assert!(seen > 4000, "{seen}");
    }
}

/// Surfels and triangles have their own textures: device and twin agree, and a wrong number would
/// show.
#[test]
fn surfels_and_triangles_have_their_own_textures() {
    let Some(gpu) = common::gpu() else { return };
    let scene = build_textured(vec![parted(3000, 1.5)], both(), &()).unwrap().0;
    let wall = |texture: u32| {
        let corners = [[-3.0, -3.0, 0.1], [3.0, -3.0, 0.1], [0.0, 4.0, 0.1]];
        Triangle {
            corners,
            normals: None,
            colors: [[1.0; 4]; 3],
            texture: Some((texture, [[0.0, 0.0], [3.0, 0.0], [1.5, 3.0]])),
        }
    };
    let textures: Vec<std::sync::Arc<Texture>> = both().into_iter().rev().map(Into::into).collect();
    let with = |texture: u32| Scene { triangles: Triangles::textured(&[wall(texture)], &textures), ..scene.clone() };
    let camera = camera(96, Projection::Pinhole);
    let exact = Settings { maps: Maps::of(&[Map::Decision]), ..unlit() };
    let (twin, _) = render(&with(0), &camera, &exact, &Backend::Reference, &()).unwrap();
    let decided = twin.map(Map::Decision).unwrap();
    let off = |frame: &Frame| {
        let far = |pixel: &usize| (0..4).any(|k| (frame.color[*pixel][k] - twin.color[*pixel][k]).abs() > 2e-3);
        (0..96 * 96).filter(|&pixel| decided[pixel] > 1e-4).filter(far).count()
    };
    let backend = Backend::gpu(gpu);
    for organisation in [Organisation::Scatter, Organisation::Tile] {
        let options = Settings { organisation, ..unlit() };
        let drawn = |texture: u32| render(&with(texture), &camera, &options, &backend, &()).unwrap().0;
        let (same, other) = (off(&drawn(0)), off(&drawn(1)));
        assert!(same < 20 && other > 500, "{organisation:?}: {same} {other}");
    }
}

/// Inputs that are simplified together get distinct texture numbers, if any input has some.
#[test]
fn inputs_that_are_simplified_together_keep_their_textures() {
    let numbers = |inputs: Vec<Points>| {
        let (scene, _, coordinates) = build_at_vertices(inputs, &()).unwrap();
        let (simplified, left, _) =
            simplify_in_texture(&scene, &coordinates, &within(0.0005, SplatShape::Cap), &()).unwrap();
        let left = points(&simplified, left, SplatShape::Cap).texture_numbers;
        left.map(|all| all.into_iter().collect::<std::collections::BTreeSet<_>>().into_iter().collect::<Vec<_>>())
    };
    let far = |mut points: Points| {
        points.positions.iter_mut().for_each(|position| position[0] += 5.0);
        points
    };
    assert_eq!(numbers(vec![parted(2000, 1.3), far(parted(2000, 1.3))]), Some(vec![0, 1, 2, 3, u32::MAX]));
    assert_eq!(numbers(vec![parted(2000, 1.3), far(belt(2000, 1.3))]), Some(vec![0, 1, 2, u32::MAX]));
    assert_eq!(numbers(vec![belt(2000, 1.3), far(belt(2000, 1.3))]), None);
    let mut beyond = parted(300, 1.3);
    beyond.texture_numbers = Some(vec![4_000_000_000; beyond.positions.len()]);
    let error = build_at_vertices(vec![beyond], &()).unwrap_err().to_string();
    assert!(error.contains("texture 4000000000"), "{error}");
}
