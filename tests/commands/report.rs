//! The report of a study: its files are well-formed, and its page works in a browser.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::path::{Path, PathBuf};
use std::process::Command;

use base64::Engine;
use epsplat::low_level::frame::Frame;
use epsplat::low_level::metrics::compare;
use epsplat::low_level::report::{ImageSet, Machine, Measurement, Numeric, Study, Summary, write};

/// A configuration: name, backend, accumulator, ms per million splats, ms per frame, error.
type Config = (&'static str, &'static str, &'static str, f64, f64, Option<f64>);

const CONFIGS: [Config; 8] = [
    ("fixed", "gpu", "fixed", 9.2, 1.1, Some(2.1e-8)),
    ("fixed, tiles", "gpu", "fixed", 7.9, 2.0, Some(2.1e-8)),
    ("fixed32", "gpu", "fixed32", 6.1, 0.8, Some(3.4e-7)),
    ("packed64", "gpu", "packed64", 5.4, 0.7, Some(3.3e-7)),
    ("float", "gpu", "float", 4.9, 0.7, Some(6.0e-6)),
    ("raster rgba16f", "raster", "", 19.0, 1.9, Some(2.8e-4)),
    ("raster rgba32f <slow> & \"exact\"", "raster", "", 26.0, 2.5, Some(7.0e-7)),
    ("reference", "reference", "", 2400.0, 80.0, Some(0.0)),
];

/// A sphere over a transparent background, with noise of magnitude about `error`.
fn frame(size: u32, error: f64) -> Frame {
    let pixel = |index: u32| {
        let (x, y) = (index % size, index / size);
        let [u, v] = [x, y].map(|c| (f64::from(c) + 0.5) / f64::from(size) * 2.2 - 1.1);
        let inside = 1.0 - u * u - v * v;
        if inside <= 0.0 {
            return [0.0; 4];
        }
        let light = (0.5 * inside.sqrt() - 0.35 * u - 0.5 * v).max(0.05);
        // Errors of all sizes, more frequent at the rim.
        let dice = f64::from(index.wrapping_mul(2_654_435_761) >> 8) / f64::from(1 << 24);
        let noise = if dice > inside { error * (8.0 * (dice - 0.7)).exp() } else { 0.0 };
        [0.9 * light, 0.55 * light + noise, 0.3 * light, 1.0].map(|c| c as f32)
    };
    Frame::of_colors(size, size, (0..size * size).map(pixel).collect())
}

/// A study as the runner would fill it: the bunny, with images, and the sphere at three sizes.
fn study() -> Study {
    let mut measurements = Vec::new();
    let scenes =
        [("bunny", 35_947u64, 2.8f64), ("sphere", 10_000, 9.0), ("sphere", 100_000, 2.9), ("sphere", 1_000_000, 0.9)];
    for (index, (scene, surfels, footprint_px)) in scenes.into_iter().enumerate() {
        for (place, (config, backend, accumulator, per_million, per_frame, rmse)) in CONFIGS.into_iter().enumerate() {
            let median = per_frame * footprint_px.sqrt() + per_million * surfels as f64 / 1e6;
            let times: Vec<f64> = (0..9).map(|run| median * (1.0 + 0.002 * f64::from(run * run % 13))).collect();
            let total_ms = Summary::of(&times).unwrap();
            let share = |part: f64| Summary::of(&times.iter().map(|t| t * part).collect::<Vec<_>>()).unwrap();
            let passes = [("project", 0.1), ("visibility", 0.25), ("accumulate", 0.6), ("resolve", 0.05)];
            let rmse = rmse.map(|rmse| rmse * (1.0 + 0.3 * index as f64));
            let mut m = Measurement {
                study: "accumulators".into(),
                scene: scene.into(),
                config: config.into(),
                backend: backend.into(),
                accumulator: accumulator.into(),
                surfels,
                footprint_px,
                width: 1024,
                height: 1024,
                total_ms,
                passes: passes.map(|(name, part)| (name.to_owned(), share(part))).into(),
                splats_per_second: surfels as f64 / total_ms.median * 1e3,
                fragments_per_second: (backend == "gpu").then(|| surfels as f64 * 14.0 / total_ms.median * 1e3),
                bytes_per_splat: 96.0 + 8.0 * place as f64,
                device_bytes: surfels * 96 + (40 << 20),
                numeric: rmse.map(|rmse| Numeric {
                    rmse,
                    max_abs: rmse * 40.0,
                    psnr_db: (rmse > 0.0).then(|| -20.0 * rmse.log10()),
                }),
                error_limit: Some(1e-5),
                kept: rmse.is_some_and(|rmse| rmse <= 1e-5),
                ..Measurement::default()
            };
            m.ratio_to_raster = (backend != "reference").then(|| 26.0 / per_million);
            if scene == "bunny" {
                let psnr = 31.0 - rmse.unwrap() * 1e4 - if config == "fixed, tiles" { 1.5 } else { 0.0 };
                let truth = [("psnr_db", psnr), ("ssim", 0.953), ("hole_rate", 0.0012), ("normal_degrees_mean", 1.74)];
                m.reconstruction = truth.map(|(name, value)| (name.to_owned(), value)).into();
            }
            measurements.push(m);
        }
    }
    let reference = frame(320, 0.0);
    let images = CONFIGS.map(|(config, .., rmse)| ImageSet {
        scene: "bunny".into(),
        config: config.into(),
        image: frame(320, rmse.unwrap()),
        reference: Some(reference.clone()),
    });
    Study {
        name: "What exact sums cost".into(),
        about: "The time of each way to add fragments, from sparse scenes to dense ones, \
                and its distance from the f64 reference."
            .into(),
        command: "epsplat bench benches/accumulators.toml --out report --runs 9 --adapter llvmpipe \
                  --backend gpu --backend raster"
            .into(),
        date: "2025-03-01".into(),
        machine: Machine {
            adapter: "llvmpipe (LLVM 15.0.6, 256 bits)".into(),
            api: "Vulkan".into(),
            driver: "llvmpipe, Mesa 22.3.6".into(),
            cpu: "A processor <with> \"marks\" & more".into(),
            cores: 2,
            os: "Debian 12".into(),
            version: "0.1.0".into(),
            commit: "0123abc".into(),
        },
        runs: 9,
        measurements,
        images: images.into(),
    }
}

/// Writes a study's report into a temporary folder; returns the folder and the page.
fn written(study: &Study) -> (tempfile::TempDir, String) {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("new/report");
    write(&out, study).unwrap();
    let page = std::fs::read_to_string(out.join("index.html")).unwrap();
    (folder, page)
}

fn parsed(page: &str) -> roxmltree::Document<'_> {
    let options = roxmltree::ParsingOptions { allow_dtd: true, ..Default::default() };
    roxmltree::Document::parse_with_options(page, options).expect("the page is well-formed XML")
}

/// The number of plot markers of one class.
fn points(page: &roxmltree::Document<'_>, class: &str) -> usize {
    let is = |node: &roxmltree::Node<'_, '_>, class: &str| {
        node.attribute("class").is_some_and(|of| of.split(' ').any(|word| word == class))
    };
    let plots = page.descendants().filter(|node| node.has_tag_name("svg") && is(node, class));
    plots.flat_map(|plot| plot.descendants()).filter(|node| is(node, "point")).count()
}

#[test]
fn the_page_is_well_formed_and_needs_nothing_else() {
    let study = study();
    let (_folder, page) = written(&study);
    let page = parsed(&page);
    let mut images = 0;
    for node in page.descendants().filter(roxmltree::Node::is_element) {
        assert!(
            !["script", "link", "iframe", "object"].contains(&node.tag_name().name())
                || node.attribute("href") == Some("data:,")
        );
        for name in ["src", "href", "srcset", "action", "xlink:href"] {
            let value = node.attribute(name).unwrap_or_default();
            assert!(!value.contains("http") && !value.contains("//") || value.starts_with("data:image/png"), "{value}");
        }
        if node.has_tag_name("img") {
            let data = node.attribute("src").and_then(|src| src.strip_prefix("data:image/png;base64,")).unwrap();
            let bytes = base64::engine::general_purpose::STANDARD.decode(data).unwrap();
            let picture = image::load_from_memory_with_format(&bytes, image::ImageFormat::Png).unwrap();
            assert_eq!((picture.width(), picture.height()), (320, 320));
            assert!(!node.attribute("alt").unwrap().is_empty());
            images += 1;
        }
        if node.has_tag_name("svg") && node.attribute("role") == Some("img") {
            let told = node.attribute("aria-labelledby").or(node.attribute("aria-label"));
            assert!(told.is_some_and(|told| !told.is_empty()));
        }
    }
    assert_eq!(images, 2 * study.images.len());
    assert_eq!(points(&page, "numeric"), study.measurements.len());
    assert_eq!(points(&page, "truth"), CONFIGS.len());
    // Each configuration has a curve of the sphere at three sizes; no other parameter varies alone.
    assert_eq!(points(&page, "scaling"), 3 * CONFIGS.len());
    let ids: Vec<&str> = page.descendants().filter_map(|node| node.attribute("id")).collect();
    assert!(ids.iter().enumerate().all(|(index, id)| !ids[..index].contains(id)));
    for link in ["results.csv", "results.json"] {
        assert!(page.descendants().any(|node| node.attribute("href") == Some(link)));
    }
}

#[test]
fn names_stay_text() {
    let (_folder, page) = written(&study());
    assert!(!page.contains("<slow>") && page.contains("rgba32f &lt;slow&gt; &amp; &quot;exact&quot;"));
    let page = parsed(&page);
    let cell = |node: &roxmltree::Node<'_, '_>| node.text() == Some("raster rgba32f <slow> & \"exact\"");
    assert!(page.descendants().any(|node| cell(&node)));
}

#[test]
fn a_study_of_nothing_is_still_a_page() {
    let empty = Study { measurements: Vec::new(), images: Vec::new(), ..study() };
    let (folder, page) = written(&empty);
    assert_eq!(points(&parsed(&page), "plot"), 0);
    let json = std::fs::read_to_string(folder.path().join("new/report/results.json")).unwrap();
    assert_eq!(json.trim(), "[]");
    // NaN and infinities are shown as missing and have no marker.
    let mut odd = study();
    odd.images.clear();
    for (index, m) in odd.measurements.iter_mut().enumerate() {
        match index % 4 {
            0 => m.total_ms.median = f64::NAN,
            1 => m.numeric = Some(Numeric { rmse: f64::INFINITY, max_abs: f64::NAN, psnr_db: None }),
            2 => m.numeric = None,
            _ => m.footprint_px = 0.0,
        }
    }
    let expected = odd.measurements.iter().filter(|m| m.total_ms.median > 0.0 && m.numeric_error().is_some()).count();
    let (_folder, page) = written(&odd);
    assert_eq!(points(&parsed(&page), "numeric"), expected);
    assert!(!page.contains("NaN") && !page.contains(">inf<"));
}

#[test]
fn the_tables_hold_every_measurement() {
    let study = study();
    let (folder, _) = written(&study);
    let out = folder.path().join("new/report");
    let json: serde_json::Value = serde_json::from_slice(&std::fs::read(out.join("results.json")).unwrap()).unwrap();
    let list = json.as_array().unwrap();
    assert_eq!(list.len(), study.measurements.len());
    for key in ["study", "scene", "config", "backend", "surfels", "footprint_px", "width", "height", "device_bytes"] {
        assert!(!list[0][key].is_null(), "{key}");
    }
    assert_eq!(list[0]["total_ms"]["median"], study.measurements[0].total_ms.median);
    assert_eq!(list[0]["numeric"]["rmse"], study.measurements[0].numeric.unwrap().rmse);
    assert_eq!(list[0]["reconstruction"]["ssim"], 0.953);
    assert!(list[0]["passes"]["project"]["mad"].is_f64() && list[7]["ratio_to_raster"].is_null());
    let csv = std::fs::read_to_string(out.join("results.csv")).unwrap();
    assert_eq!(csv.matches("\r\n").count(), 1 + study.measurements.len());
    assert!(csv.contains("\"raster rgba32f <slow> & \"\"exact\"\"\""));
}

#[test]
fn failures_are_one_sentence_and_leave_no_page() {
    let folder = tempfile::tempdir().unwrap();
    let taken = folder.path().join("taken");
    std::fs::write(&taken, "a file").unwrap();
    let message = write(&taken.join("report"), &study()).unwrap_err().to_string();
    assert!(message.starts_with(&format!("cannot write {}", taken.join("report").display())), "{message}");
    let mut unequal = study();
    unequal.images[0].reference = Some(frame(10, 0.0));
    let out = folder.path().join("report");
    let message = write(&out, &unequal).unwrap_err().to_string();
    assert_eq!(message, "an image of 320x320 cannot be compared with a reference of 10x10");
    assert!(!out.exists());
}

#[test]
fn the_heat_map_and_the_comparison_agree_on_what_a_difference_is() {
    let (image, reference) = (frame(64, 1e-3), frame(64, 0.0));
    let largest =
        epsplat::low_level::report::heatmap::differences(&image, &reference).unwrap().into_iter().fold(0.0, f64::max);
    assert!(largest > 0.0);
    assert_eq!(largest, compare(&image, &reference).unwrap().max_abs);
}

/// Path of a Chromium: `EPSPLAT_CHROMIUM`, or the first one on the path.
fn chromium() -> Option<PathBuf> {
    if let Some(named) = std::env::var_os("EPSPLAT_CHROMIUM") {
        return Some(named.into());
    }
    let folders = std::env::var_os("PATH").unwrap_or_default();
    std::env::split_paths(&folders)
        .flat_map(|folder| ["chromium", "chromium-browser", "google-chrome"].map(|name| folder.join(name)))
        .find(|path| path.is_file())
}

/// Page script that writes the browser's findings into the page, where `--dump-dom` returns them.
/// The policy forbids all requests, so each attempted one is reported.
const PROBE: &str = r#"<meta http-equiv="Content-Security-Policy" content="default-src data: 'unsafe-inline'"/><script>
const requests = [];
document.addEventListener('securitypolicyviolation', event => requests.push(event.blockedURI));
addEventListener('load', () => {
  const images = [...document.images];
  const boxes = [...document.querySelectorAll('.point')].map(point => point.getBoundingClientRect());
  const inPlot = point => { const plot = point.closest('svg').getBoundingClientRect(), box = point.getBoundingClientRect();
    return box.left >= plot.left && box.right <= plot.right && box.top >= plot.top && box.bottom <= plot.bottom; };
  document.body.dataset.found = JSON.stringify({
    width: document.documentElement.clientWidth,
    content: document.documentElement.scrollWidth,
    images: images.length,
    decoded: images.filter(image => image.complete && image.naturalWidth > 0).length,
    points: boxes.filter(box => box.width > 1 && box.height > 1).length,
    inside: [...document.querySelectorAll('.point')].filter(inPlot).length,
    requests,
    wide: [...document.querySelectorAll('body *')].filter(e => !e.closest('.scroll, pre, svg')
      && e.getBoundingClientRect().right > document.documentElement.clientWidth + 0.5).map(e => e.outerHTML.slice(0, 80)),
  });
});</script>"#;

/// Opens the page in an iframe of this width, as a headless window is at least about 500 pixels
/// wide.
fn probe(browser: &Path, folder: &Path, page: &str, width: u32) -> serde_json::Value {
    std::fs::write(folder.join("probed.html"), page.replacen("<head>", &format!("<head>{PROBE}"), 1)).unwrap();
    let outer = format!(
        "<!DOCTYPE html><html><body><iframe src='probed.html' style='border:0' width='{width}' height='900'></iframe><script>
         addEventListener('load', () => {{ const inner = document.querySelector('iframe').contentDocument;
         document.body.textContent = inner.body.dataset.found; }});</script></body></html>"
    );
    std::fs::write(folder.join("outer.html"), outer).unwrap();
    let output = Command::new(browser)
        .args([
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--disable-dev-shm-usage",
            "--no-first-run",
            "--hide-scrollbars",
        ])
        .args([
            "--allow-file-access-from-files",
            "--enable-logging=stderr",
            "--virtual-time-budget=20000",
            "--dump-dom",
        ])
        .arg(format!("--user-data-dir={}", folder.join("profile").display()))
        .arg(format!("file://{}", folder.join("outer.html").display()))
        .output()
        .unwrap();
    let (said, noise) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{noise}");
    let found = said
        .split_once("<body>")
        .and_then(|(_, rest)| rest.split_once("</body>"))
        .unwrap_or_else(|| panic!("{said}"))
        .0;
    let found = found.replace("&lt;", "<").replace("&gt;", ">").replace("&amp;", "&");
    let mut found: serde_json::Value = serde_json::from_str(&found).unwrap_or_else(|e| panic!("{e}: {found}\n{noise}"));
    found["console"] = noise.lines().filter(|line| line.contains("CONSOLE")).collect();
    found
}

#[test]
fn a_browser_shows_the_page_on_a_phone_and_on_a_desk() {
    let Some(browser) = chromium() else {
        if std::env::var("EPSPLAT_REQUIRE_CHROMIUM").is_ok_and(|v| v == "1") {
            panic!("EPSPLAT_REQUIRE_CHROMIUM=1, but EPSPLAT_CHROMIUM is not set and no chromium is on the path");
        }
        eprintln!("skipped: no chromium");
        return;
    };
    let study = study();
    let (folder, page) = written(&study);
    let out = folder.path().join("new/report");
    // Keeps a copy of the report for a person to look at.
    if let Some(keep) = std::env::var_os("EPSPLAT_KEEP_REPORT") {
        write(Path::new(&keep), &study).unwrap();
    }
    let points = study.measurements.len() + CONFIGS.len() + 3 * CONFIGS.len();
    for width in [390, 1200] {
        let found = probe(&browser, &out, &page, width);
        assert_eq!(found["width"], width, "{found}");
        assert_eq!(found["content"], width, "the page is wider than its window: {found}");
        assert_eq!(found["wide"], serde_json::json!([]), "{found}");
        assert_eq!(found["requests"], serde_json::json!([]), "{found}");
        assert_eq!(found["console"], serde_json::json!([]), "{found}");
        assert_eq!(
            (&found["images"], &found["decoded"]),
            (&(2 * study.images.len()).into(), &found["images"]),
            "{found}"
        );
        assert_eq!((&found["points"], &found["inside"]), (&points.into(), &points.into()), "{found}");
    }
    // The control: a page with these faults is noticed.
    let broken = page.replacen(
        "<h1>",
        "<div style=\"width:3000px\">wide</div><img src=\"missing.png\"/><img src=\"data:image/png;base64,AAAA\"/><h1>",
        1,
    );
    let found = probe(&browser, &out, &broken, 390);
    assert!(found["content"].as_u64().unwrap() >= 3000, "{found}");
    assert_eq!(found["wide"].as_array().unwrap().len(), 1, "{found}");
    assert_eq!(found["requests"].as_array().unwrap().len(), 1, "{found}");
    assert!(!found["console"].as_array().unwrap().is_empty(), "{found}");
    assert_eq!(found["images"].as_u64().unwrap() - found["decoded"].as_u64().unwrap(), 2, "{found}");
}
