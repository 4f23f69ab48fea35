//! Triangles through a lens: large ones have no holes and right depths, and those that cover the
//! image show although the lens sees none of their corners.

use super::*;

/// The depth map that the command line writes with these arguments. With `--cameras` it is that of
/// the camera `depth`.
fn depths(folder: &Folder, line: &[&str]) -> Vec<f32> {
    let is_set = line.contains(&"--cameras");
    let output = folder.path(if is_set { "views" } else { "depth.npy" });
    let format: &[&str] = if is_set { &["--format", "npy"] } else { &[] };
    succeeds(&[line, format, &["-o", text(&output), "--aov", "depth", "--samples", "1"]].concat());
    let bytes = std::fs::read(if is_set { output.join("depth.npy") } else { output }).unwrap();
    let start = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    bytes[start..].as_chunks().0.iter().map(|four| f32::from_le_bytes(*four)).collect()
}

/// A square of two triangles in the plane y = -1, `size` units to each side, in the axes of OpenGL.
fn ground(folder: &Folder, size: f64) -> std::path::PathBuf {
    let corner = |x: f64, z: f64| format!("v {} -1 {}\n", x * size, z * size);
    let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, z)| corner(x, z)).concat();
    folder.file("ground.obj", format!("{corners}f 1 3 2\nf 1 4 3\n"))
}

/// A file with one camera that looks along -z, as nerfstudio writes it.
fn looking(folder: &Folder, lens: &str) -> std::path::PathBuf {
    let pose = "[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]";
    let frame = format!(r#"{{"file_path": "depth", "transform_matrix": {pose}}}"#);
    folder.file("t.json", format!(r#"{{{lens}, "frames": [{frame}]}}"#))
}

/// Pixels that show the ground, those that miss it, and those whose depth is off. Rays within two
/// degrees of the horizon do not count.
///
/// Edges may lie a quarter of a pixel beside their images, which changes a depth by that many times
/// its change from row to row, and depths of edges may err by a thousandth.
fn faults(camera: &Camera, depths: &[f32], size: f64) -> [usize; 3] {
    let mut counts = [0; 3];
    for (pixel, depth) in depths.iter().enumerate() {
        let (x, y) = (pixel as u32 % camera.width, pixel as u32 / camera.width);
        let (x, y) = (f64::from(x) + 0.5, f64::from(y) + 0.5);
        let ray = camera.ray(x, y);
        let at = ray / ray.y;
        let on_ground = ray.y > 0.035 * ray.length() && at.x.abs() < 0.99 * size && at.z.abs() < 0.99 * size;
        if camera.shows(x, y) && on_ground {
            let off = (f64::from(*depth) * ray.y - 1.0).abs();
            // The angle below the horizon, in pixels of a lens that the distortion scales by up to
            // 0.85.
            let below = 0.85 * camera.fy * ray.y / ray.x.hypot(ray.z);
            counts[0] += 1;
            counts[1] += usize::from(!depth.is_finite());
            counts[2] += usize::from(depth.is_finite() && off > 2e-3 + 0.25 / below);
        }
    }
    counts
}

#[test]
fn large_triangles_have_no_holes_and_right_depths() {
    let folder = Folder::new();
    let bent = Optics::of(Form::Perspective).with_radial([-0.05, 0.0, 0.0, 0.0]);
    let cameras = looking(&folder, r#""w": 256, "h": 256, "fl_x": 180, "cx": 128, "cy": 128, "k1": -0.05"#);
    let fisheye =
        ["--up=y", "--projection", "fisheye", "--fov", "180", "--eye", "0,0,0", "--target", "0,0,-1", "--size", "256"];
    let cases: [(&str, Camera, Vec<&str>); 2] = [
        ("fisheye", posed((256, 256), Lens::Fisheye(180.0)), fisheye.to_vec()),
        (
            "perspective",
            posed((256, 256), Lens::Curved(bent, [180.0, 180.0, 128.0, 128.0])),
            vec!["--cameras", text(&cameras)],
        ),
    ];
    for (name, camera, line) in cases {
        for size in [30.0, 1000.0, 100_000.0] {
            let mesh = ground(&folder, size);
            for backend in ["reference", "gpu"] {
                if backend == "gpu" && common::gpu().is_none() {
                    continue;
                }
                let all = [&["render", text(&mesh), "--near", "0.01", "--backend", backend][..], &line].concat();
                let [shown, missing, off] = faults(&camera, &depths(&folder, &all), size);
                eprintln!("{name} {size} {backend}: {missing} of {shown} missing, {off} depths off");
                assert!(shown > 15_000 && missing == 0 && off == 0, "{name} {size} {backend}: {missing} {off}");
            }
        }
    }
}

/// A telephoto lens sees the inside of a triangle whose corners and edges are far outside its
/// image.
#[test]
fn triangles_that_cover_the_image_show_without_their_corners() {
    let folder = Folder::new();
    let mesh = folder.file("t.obj", "v 0 1.04 10\nv -0.9 -0.52 10\nv 0.9 -0.52 10\nf 1 2 3\n");
    let cameras = folder.path("");
    folder.file("images.txt", "1 1 0 0 0 0 0 0 1 depth.png\n\n");
    for (lens, least) in
        [("SIMPLE_RADIAL 200 200 2000 100 100 0.001", 37_400), ("SIMPLE_RADIAL 200 200 4000 100 100 0.001", 40_000)]
    {
        folder.file("cameras.txt", format!("1 {lens}\n"));
        for backend in ["reference", "gpu"] {
            if backend == "gpu" && common::gpu().is_none() {
                continue;
            }
            let line = ["render", text(&mesh), "--cameras", text(&cameras), "--near", "0.01", "--backend", backend];
            let depths = depths(&folder, &line);
            let shown = depths.iter().filter(|depth| (**depth - 10.0).abs() < 0.01).count();
            eprintln!("{lens} {backend}: {shown} of {} pixels show the triangle", depths.len());
            assert!(shown >= least && depths.len() == 40_000, "{lens} {backend}: {shown}");
        }
    }
}
