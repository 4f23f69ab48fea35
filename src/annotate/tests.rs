use super::*;
use crate::scene::color::{linear_to_srgb, srgb8};
use crate::scene::{ColorMap, KeyColors};
use glam::DMat3;

/// A camera with this projection that looks down with y up, or turned by a right angle.
fn camera(projection: Projection, turned: bool) -> Camera {
    let rows = match turned {
        false => [DVec3::X, -DVec3::Y, -DVec3::Z],
        true => [DVec3::Y, DVec3::X, -DVec3::Z],
    };
    Camera {
        projection,
        width: 600,
        height: 400,
        fx: 2.0,
        fy: 2.0,
        cx: 300.0,
        cy: 200.0,
        eye: DVec3::new(0.0, 0.0, 100.0),
        rotation: DMat3::from_cols(rows[0], rows[1], rows[2]).transpose(),
        near: 0.1,
        optics: None,
    }
}

fn blank(camera: &Camera) -> Frame {
    let color = vec![[0.0, 0.0, 0.2, 1.0]; camera.pixels()];
    Frame::of_colors(camera.width, camera.height, color)
}

fn ramp(map: &str, ends: [f64; 2]) -> ColorKey {
    let map: ColorMap = map.parse().unwrap_or_default();
    ColorKey { name: "Intensity".into(), unit: None, colors: KeyColors::Ramp { map, ends } }
}

#[test]
fn ticks_are_round_numbers_within_the_range() {
    let labels = |ends: [f64; 2]| ticks::ticks(ends, 5).into_iter().map(|(_, label)| label).collect::<Vec<_>>();
    assert_eq!(labels([1.0, 223.0]), ["50", "100", "150", "200"]);
    assert_eq!(labels([408.73, 485.04]), ["420", "440", "460", "480"]);
    assert_eq!(labels([0.0, 1.0]), ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]);
    assert_eq!(labels([-0.03, 0.03]), ["−0.03", "−0.02", "−0.01", "0.00", "0.01", "0.02", "0.03"]);
    assert_eq!(labels([3e8 + 0.1, 3e8 + 4.3]), ["300000001", "300000002", "300000003", "300000004"]);
    assert_eq!(labels([7.0, 7.0]), ["7.000"]);
    assert_eq!(labels([0.0, 0.0]), ["0"]);
    for [low, high] in [[0.0, 1e-9], [-1e15, 1e15], [5.0, 5.000_001], [0.0, 999.0], [0.1, 0.9]] {
        let all = ticks::ticks([low, high], 5);
        assert!((2..=9).contains(&all.len()), "{low} {high}: {all:?}");
        assert!(all.iter().all(|(value, _)| (low..=high).contains(value)), "{all:?}");
    }
}

#[test]
fn lengths_are_rounded_down() {
    let cases =
        [(0.9, 0.5), (1.0, 1.0), (1.99, 1.0), (2.0, 2.0), (4.9, 2.0), (5.0, 5.0), (99.0, 50.0), (1000.0, 1000.0)];
    for (most, expected) in cases {
        assert!((ticks::round_length(most) / expected - 1.0).abs() < 1e-12, "{most}");
    }
    // 600 pixels at 2 per unit: a quarter is 75 units.
    assert_eq!(scale_bar::length(600, 2.0), (50.0, "50 units".to_owned()));
    assert_eq!(scale_bar::length(400, 100.0), (1.0, "1 unit".to_owned()));
    assert_eq!(scale_bar::length(100, 100.0).1, "0.2 units");
}

#[test]
fn the_bar_of_a_legend_has_the_colours_of_its_map() -> Result<()> {
    let camera = camera(Projection::Orthographic, false);
    let marks = Marks { legend: true, ..Marks::default() };
    let frame = marks.draw(blank(&camera), &camera, Some(&ramp("viridis", [0.0, 200.0])))?;
    let codes: Vec<[u8; 4]> = frame.color.iter().map(|color| srgb8(*color)).collect();
    let map: ColorMap = "viridis".parse()?;
    // A column of pixels in the bar, from top to bottom: from the last to the first colour.
    let column = |x: usize| (0..400).map(|y| codes[y * 600 + x]).collect::<Vec<_>>();
    let with = |[r, g, b]: [u8; 3]| [r, g, b, 255];
    let bar = (300..600).map(column).find(|column| column.contains(&with(map.code(1.0)))).unwrap_or_default();
    let first = bar.iter().position(|code| *code == with(map.code(1.0))).unwrap_or(0);
    let last = bar.iter().rposition(|code| *code == with(map.code(0.0))).unwrap_or(0);
    // The bar has 42 % of the picture's height.
    assert_eq!(last - first + 1, 168);
    for (row, code) in bar[first..=last].iter().enumerate() {
        assert_eq!(*code, with(map.code(1.0 - row as f64 / 167.0)), "row {row}");
    }
    // The left half stays as it was, and labels are dark on a light panel.
    assert!((0..400).all(|y| (0..300).all(|x| frame.color[y * 600 + x] == [0.0, 0.0, 0.2, 1.0])));
    let dark = codes.iter().filter(|code| code[..3].iter().all(|channel| *channel < 128)).count();
    let light = codes.iter().filter(|code| code[..3].iter().all(|channel| *channel > 200)).count();
    assert!(dark > 60 && light > 5000, "{dark} {light}");
    Ok(())
}

#[test]
fn a_legend_of_classes_has_a_swatch_for_each() -> Result<()> {
    let camera = camera(Projection::Pinhole, false);
    let named = vec![("ground".to_owned(), [166, 118, 68]), ("building".to_owned(), [226, 92, 44])];
    let key = ColorKey { name: "Classification".into(), unit: None, colors: KeyColors::Categories(named) };
    let marks = Marks { legend: true, ..Marks::default() };
    let frame = marks.draw(blank(&camera), &camera, Some(&key))?;
    let count = |code: [u8; 4]| frame.color.iter().filter(|color| srgb8(**color) == code).count();
    assert!(count([166, 118, 68, 255]) > 50 && count([226, 92, 44, 255]) == count([166, 118, 68, 255]));
    // Control: without the option nothing is drawn.
    assert_eq!(Marks::default().draw(blank(&camera), &camera, Some(&key))?.color, blank(&camera).color);
    Ok(())
}

#[test]
fn a_unit_is_named_beside_the_attribute_or_below_it() {
    let key = |unit| ColorKey { unit, ..ramp("gray", [0.0, 1.0]) };
    assert_eq!(legend::heading(&key(None)), ["Intensity"]);
    assert_eq!(legend::heading(&key(Some("s"))), ["Intensity (s)"]);
    assert_eq!(legend::heading(&key(Some("points per square unit"))), ["Intensity", "points per square unit"]);
}

#[test]
fn small_pictures_have_a_small_legend() -> Result<()> {
    let marks = Marks { legend: true, scale_bar: true, north: true };
    for (width, height) in [(1, 1), (40, 30), (3000, 20), (20, 3000)] {
        let camera = Camera { width, height, ..camera(Projection::Orthographic, false) };
        let frame = marks.draw(blank(&camera), &camera, Some(&ramp("gray", [0.0, 1e9])))?;
        assert!(frame.color.iter().flatten().all(|channel| channel.is_finite() && (0.0..=1.0).contains(channel)));
    }
    Ok(())
}

#[test]
fn the_scale_bar_is_as_long_as_its_label_says() -> Result<()> {
    let camera = camera(Projection::Orthographic, false);
    let marks = Marks { scale_bar: true, ..Marks::default() };
    let frame = marks.draw(blank(&camera), &camera, None)?;
    let ink = |x: usize, y: usize| srgb8(frame.color[y * 600 + x])[..3] == [20; 3];
    let longest = (200..400).map(|y| (0..600).filter(|x| ink(*x, y)).count()).max();
    // 50 units at 2 pixels each.
    assert_eq!(longest, Some(100));
    Ok(())
}

#[test]
fn the_arrow_points_along_y() -> Result<()> {
    let marks = Marks { north: true, ..Marks::default() };
    for (turned, horizontal) in [(false, false), (true, true)] {
        let camera = camera(Projection::Orthographic, turned);
        let frame = marks.draw(blank(&camera), &camera, None)?;
        let ink: Vec<[f64; 2]> = (0..frame.color.len())
            .filter(|index| linear_to_srgb(frame.color[*index][1].into()) < 0.2 && frame.color[*index][2] < 0.1)
            .map(|index| [(index % 600) as f64, (index / 600) as f64])
            .collect();
        assert!(ink.len() > 100, "{}", ink.len());
        let spread = |axis: usize| {
            let mean = ink.iter().map(|place| place[axis]).sum::<f64>() / ink.len() as f64;
            ink.iter().map(|place| (place[axis] - mean).powi(2)).sum::<f64>() / ink.len() as f64
        };
        // The arrow and its letter are longer along the direction of the north.
        assert_eq!(spread(0) > spread(1), horizontal, "{} {}", spread(0), spread(1));
    }
    Ok(())
}

#[test]
fn marks_that_a_camera_cannot_have_are_refused() {
    let refusal = |marks: Marks, camera: &Camera| marks.check(camera).err().map(|error| error.to_string());
    let (bar, north) = (Marks { scale_bar: true, ..Marks::default() }, Marks { north: true, ..Marks::default() });
    let perspective = camera(Projection::Pinhole, false);
    assert!(refusal(bar, &perspective).is_some_and(|told| told.starts_with("--scale-bar needs one scale")));
    assert!(refusal(north, &perspective).is_some_and(|told| told.starts_with("--north needs")));
    let level = Camera {
        rotation: DMat3::from_cols(DVec3::X, -DVec3::Z, DVec3::Y).transpose(),
        ..camera(Projection::Orthographic, false)
    };
    assert!(refusal(north, &level).is_some() && refusal(bar, &level).is_none());
    assert!(refusal(north, &camera(Projection::Orthographic, true)).is_none());
}
