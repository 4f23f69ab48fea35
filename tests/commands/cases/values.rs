//! Point counts, sizes, front and back sides, and notes.

use super::{case, drawn, info, told};
use crate::common::command::{Folder, ply, succeeds, text};

#[test]
fn counts_are_those_of_the_points_that_are_there() {
    // The 64-bit count is 3,000; the legacy one is 7.
    let laz = case("las14_pdrf7_legacy_disagrees.laz");
    assert_eq!(info(&laz, &[])["points"], 3000);
    assert!(told(&laz).contains("and 7 in the field of older versions: 3000 are read"));
    let e57 = case("e57_scan_without_points.e57");
    assert_eq!(info(&e57, &[])["preparation"]["surfels"], 2000);
    assert!(told(&e57).contains("1 of 2 scans left out, with 0 points: scan 1 has no points"));
}

#[test]
fn a_scale_of_zero_is_told() {
    let las = case("las_scale_zero.las");
    assert!(told(&las).contains("the scale along x, y, z is 0"));
    // The same with a scale of zero along some of the axes, and the control without one.
    let folder = Folder::new();
    let bytes = std::fs::read(&las).unwrap();
    let with = |scales: [f64; 3]| {
        let mut bytes = bytes.clone();
        bytes[131..155].copy_from_slice(&scales.map(f64::to_le_bytes).concat());
        folder.file("s.las", bytes)
    };
    for (scales, says) in [
        ([0.001, 0.001, 0.0], "the scale along z is 0"),
        ([0.0, 0.001, 0.001], "the scale along x is 0"),
        ([0.001, 0.0, 0.0], "the scale along y, z is 0"),
        ([-0.0, 0.001, 0.01], "the scale along x is 0"),
    ] {
        assert!(told(text(&with(scales))).contains(says), "{scales:?}: {}", told(text(&with(scales))));
    }
    assert!(!told(text(&with([0.001; 3]))).contains("the scale along"));
}

#[test]
fn degrees_beside_metres_are_hinted_at() {
    let hint = "project it to metres first";
    assert!(told(&case("las_lonlat_degrees.las")).contains(hint));
    let folder = Folder::new();
    // A hillside of one kilometre, in other formats, axis orders and hemispheres.
    let rows = |of: &dyn Fn(f64, f64, f64) -> [f64; 3], prefix: &str| -> String {
        let row = |k: i32| {
            let (u, v) = (f64::from(k % 20) / 20.0, f64::from(k / 20) / 20.0);
            let [x, y, z] = of(u, v, 500.0 + 40.0 * (u * v));
            format!("{prefix}{x} {y} {z}\n")
        };
        (0..400).map(row).collect()
    };
    let east = |u: f64, v: f64, z: f64| [11.5 + 0.01 * u, 48.1 + 0.01 * v, z];
    let north_first = |u: f64, v: f64, z: f64| [48.1 + 0.01 * u, 11.5 + 0.01 * v, z];
    let south_west = |u: f64, v: f64, z: f64| [-70.2 + 0.01 * u, -33.4 + 0.01 * v, z];
    let metres = |u: f64, v: f64, z: f64| [691_000.0 + 1000.0 * u, 5_330_000.0 + 1000.0 * v, z];
    let doubles = |rows: String| ply("x y z", 400, &rows).replace("property float", "property double");
    let pcd = |rows: String| {
        let head = "VERSION .7\nFIELDS x y z\nSIZE 8 8 8\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 400\nHEIGHT 1\nPOINTS 400\n";
        format!("{head}DATA ascii\n{rows}")
    };
    for (name, contents, hinted) in [
        ("east.ply", doubles(rows(&east, "")), true),
        ("north.ply", doubles(rows(&north_first, "")), true),
        ("south.ply", doubles(rows(&south_west, "")), true),
        ("east.obj", rows(&east, "v "), true),
        ("south.obj", rows(&south_west, "v "), true),
        ("metres.ply", doubles(rows(&metres, "")), false),
        #[cfg(feature = "pcd")]
        ("east.pcd", pcd(rows(&east, "")), true),
        #[cfg(feature = "pcd")]
        ("metres.pcd", pcd(rows(&metres, "")), false),
    ] {
        assert_eq!(told(text(&folder.file(name, contents))).contains(hint), hinted, "{name}");
    }
}

#[test]
fn alphas_that_are_classes_are_hinted_at_and_can_be_left_out() {
    let file = case("ply_alpha_is_class.ply");
    let folder = Folder::new();
    let hint = "--ignore-alpha leaves it out";
    let opaque = |path: &str| {
        let (without, _) = drawn(&folder, &[path, "--ignore-alpha", "--size", "64x64"]);
        let (with, _) = drawn(&folder, &[path, "--size", "64x64", "--composite", "sorted"]);
        let alphas = |image: &image::RgbaImage| image.pixels().filter(|pixel| pixel.0[3] == 255).count();
        alphas(&without) > 200 && alphas(&with) == 0
    };
    assert!(told(&file).contains(hint) && opaque(&file));
    // Other types, and alpha values that really are opacities.
    let rows = |alpha: &dyn Fn(usize) -> String| -> String {
        let row = |k: usize| format!("{} {} 0 200 100 50 {}\n", k % 20, k / 20, alpha(k));
        (0..400).map(row).collect()
    };
    let of = |kind: &str, alpha: &dyn Fn(usize) -> String| {
        let text = ply("x y z red green blue alpha", 400, &rows(alpha));
        let colors = ["red", "green", "blue", "alpha"].map(|name| (format!("float {name}"), format!("{kind} {name}")));
        colors.iter().fold(text, |text, (from, to)| text.replace(from, to))
    };
    let class = |k: usize| (1 + k % 6).to_string();
    for (kind, alpha, hinted) in [
        ("uchar", &class as &dyn Fn(usize) -> String, true),
        ("ushort", &class, true),
        ("int", &class, true),
        ("uchar", &|k| (2 * (k % 3)).to_string(), true),
        ("uchar", &|_| "2".into(), true),
        ("uchar", &|_| "255".into(), false),
        ("uchar", &|k| (40 + k % 200).to_string(), false),
    ] {
        let path = folder.file("a.ply", of(kind, alpha));
        assert_eq!(told(text(&path)).contains(hint), hinted, "{kind} {}: {}", alpha(3), told(text(&path)));
    }
}

#[test]
fn gaussians_are_those_that_the_file_means() {
    // Two thirds of the rows are zeros, which must not affect the statistics of the others.
    let zeros = info(&case("gs_postshot_zero_rows.ply"), &[]);
    let preparation = &zeros["preparation"];
    assert_eq!((&preparation["surfels"], &preparation["shapeless"]), (&100.into(), &200.into()));
    assert!(told(&case("gs_postshot_zero_rows.ply")).contains("0 were thicker than a tenth"));
    // s = e^-4.60517, f = 0.05; the opacity decreases as the filter increases the volume.
    let filtered = info(&case("gs_one_filter3d.ply"), &["--flatten"]);
    let near = |value: &serde_json::Value, right: f64| (value.as_f64().unwrap() / right - 1.0).abs() < 1e-4;
    assert!(near(&filtered["gaussians"]["deviations"][0], 0.050_990_2), "{filtered}");
    assert!(near(&filtered["gaussians"]["opacities"][1], 7.327_476e-5), "{filtered}");
    let packed = info(&case("gs_supersplat_compressed.ply"), &["--flatten"]);
    assert_eq!((&packed["points"], &packed["preparation"]["surfels"]), (&256.into(), &256.into()));
}

#[test]
fn a_few_points_have_the_spacing_of_a_few() {
    let folder = Folder::new();
    for (name, points) in [("few_8.ply", 8), ("few_9.ply", 9)] {
        let file = case(name);
        let (_, told) = drawn(&folder, &[&file, "--facing", "circle", "--size", "64x64"]);
        let said = format!("{points} points have no radius and got a common one from the mean spacing: ");
        let radius = told.split(&said).nth(1).and_then(|rest| rest.split(' ').next()).expect(&told);
        assert!((0.1..0.6).contains(&radius.parse::<f64>().unwrap()), "{name}: {radius}");
    }
    let few = succeeds(&["info", &case("few_8.ply"), "--json", "-"]);
    let few: serde_json::Value = serde_json::from_slice(&few.stdout).unwrap();
    assert!((few["coverage"]["spacing"].as_f64().unwrap() - 0.33).abs() < 0.01);
}
