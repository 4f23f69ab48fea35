//! Kernels that a user wrote: on the command line and in studies, beside the f64 evaluation of the
//! same text, and with faults.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::path::Path;
use std::process::Command;

use crate::common;
use common::command::Folder;
use epsplat::low_level::frame::Frame;
use epsplat::low_level::gpu::Replacement;
use epsplat::low_level::plan::Settings;
use epsplat::low_level::render::{Backend, Report, render};
use epsplat::low_level::scene::{Kernel, OwnKernel, Scene};

use common::scenes::{sphere, sphere_camera};
use epsplat::low_level::scene::Projection;

const WENDLAND: &str = include_str!("../../benches/own-kernel.wgsl");

/// The text of a kernel whose body is `body`.
fn text(body: &str) -> String {
    format!("fn kernel_weight(rho2: f32) -> f32 {{ {body} }}")
}

fn ball() -> Scene {
    sphere(600, 1.5)
}

/// A picture of [`ball`] by the ellipse kernel, or by `source` in its place.
fn drawn(backend: &Backend, options: Settings) -> Result<(Frame, Report), String> {
    let camera = sphere_camera(64, Projection::Pinhole);
    render(&ball(), &camera, &options, backend, &()).map_err(|error| error.to_string())
}

fn with(source: &str) -> Settings {
    let sources = vec![Replacement::new("kernel_ellipse.wgsl", source)];
    Settings { sources, ..Settings::default() }
}

/// The largest difference of colours.
fn apart(one: &Frame, other: &Frame) -> f32 {
    let pairs = one.color.iter().flatten().zip(other.color.iter().flatten());
    pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
}

#[test]
fn the_reference_draws_the_same_kernel() {
    let Some(gpu) = common::gpu() else { return };
    let device = Backend::gpu(gpu);
    let (own, report) = drawn(&device, with(WENDLAND)).unwrap();
    let (reference, _) = drawn(&Backend::Reference, with(WENDLAND)).unwrap();
    assert!(apart(&own, &reference) < 1e-4, "{}", apart(&own, &reference));
    assert_eq!(report.kernel.unwrap().sentence(), None);
    // A closure in place of the evaluated text gives the same reference.
    let closure = OwnKernel::new("Wendland", |rho2| {
        let rho = rho2.sqrt();
        (1.0 - rho).max(0.0).powi(4) * (4.0 * rho + 1.0)
    });
    let by_closure = Settings { own_kernel: Some(closure), ..Settings::default() };
    assert!(apart(&drawn(&Backend::Reference, by_closure).unwrap().0, &reference) < 1e-7);
    // Control: the built-in kernel gives another picture.
    let (built_in, report) = drawn(&device, Settings::default()).unwrap();
    assert!(apart(&own, &built_in) > 1e-2);
    assert!(report.kernel.is_none());
}

/// Faults of a kernel's weights are counted and reported, even where the picture does not show
/// them.
#[test]
fn wrong_weights_are_counted_and_named() {
    let Some(gpu) = common::gpu() else { return };
    let device = Backend::gpu(gpu);
    let faults = |body: &str| drawn(&device, with(&text(body))).unwrap().1.kernel.unwrap();
    let root = faults("return sqrt(-1.0 - rho2);");
    assert_eq!((root.not_a_number, root.first), (root.tried, Some(0.0)));
    assert!(root.sentence().unwrap().contains("4097 NaN"));
    assert!(faults("return 0.5 - rho2;").negative > 1000);
    assert!(faults("return 1.0 / (rho2 - rho2);").infinite > 0);
    // On a card such a kernel would not end.
    let endless = text("var w = 1.0; loop { w = w * 0.5; if (w > 2.0) { break; } } return w;");
    let refusal = drawn(&device, with(&endless)).err().unwrap();
    assert!(refusal.contains("has a loop that does not end"), "{refusal}");
}

#[test]
fn faults_of_a_text_are_refused_with_their_file_and_line() {
    let Some(gpu) = common::gpu() else { return };
    let device = Backend::gpu(gpu);
    let refusal = |source: &str| drawn(&device, with(source)).err().unwrap();
    let unknown = refusal("// One.\nfn kernel_weight(rho2: f32) -> f32 {\n    return missing(rho2);\n}\n");
    assert!(unknown.contains("kernel_ellipse.wgsl:3:12: ") && unknown.contains("missing"), "{unknown}");
    let arguments =
        refusal("fn g(a: f32, b: f32) -> f32 { return a; }\nfn kernel_weight(rho2: f32) -> f32 { return g(rho2); }");
    assert!(arguments.contains("kernel_ellipse.wgsl:2:"), "{arguments}");
    let vector = refusal(&text("return length(vec2<f32>(rho2, 0.0));"));
    assert!(vector.contains("cannot be evaluated in f64") && vector.contains("vectors"), "{vector}");
    // A replaced file that is no kernel is not evaluated in f64: the compiler reports the error and
    // its place.
    let sources = vec![Replacement::new("shade_lambert.wgsl", "fn shade() -> f32 {\n    return nothing;\n}\n")];
    let options = Settings { sources, ..Settings::default() };
    let shade = drawn(&device, options).err().unwrap();
    assert!(shade.contains("shade_lambert.wgsl:2:12: ") && shade.contains("nothing"), "{shade}");
    let sources = vec![Replacement::new("kernel_cone.wgsl", WENDLAND)];
    let other = Settings { sources, kernel: Kernel::Constant, ..Settings::default() };
    let other = drawn(&device, other).err().unwrap();
    assert!(other.contains("kernel_constant.wgsl and not by kernel_cone.wgsl"), "{other}");
    let sources = vec![Replacement::new("kernel.wgsl", WENDLAND)];
    let none = drawn(&device, Settings { sources, ..Settings::default() }).err().unwrap();
    assert!(none.contains("there is no kernel file kernel.wgsl"), "{none}");
}

#[test]
fn the_command_line_and_studies_take_files() {
    let folder = Folder::new();
    let run = |arguments: &[&str]| {
        Command::new(env!("CARGO_BIN_EXE_epsplat")).args(arguments).current_dir(folder.path("")).output().unwrap()
    };
    let said = |output: &std::process::Output| String::from_utf8(output.stderr.clone()).unwrap();
    std::fs::write(folder.path("nan.wgsl"), text("return sqrt(-1.0 - rho2);")).unwrap();
    assert!(run(&["generate", "sphere", "--count", "500", "-o", "ball.ply"]).status.success());
    let render = ["render", "ball.ply", "-o", "ball.png", "--size", "40x40", "--backend", "reference", "--source"];
    let output = run(&[&render[..], &["kernel_ellipse.wgsl=nan.wgsl"]].concat());
    assert!(output.status.success(), "{}", said(&output));
    assert!(said(&output).contains("of 4097 weights of the kernel nan.wgsl, 4097 are wrong"), "{}", said(&output));
    let own = ["kernel_ellipse.wgsl=nan.wgsl", "--json", "nan.wgsl"];
    let output = run(&[&render[..], &own].concat());
    assert_eq!(output.status.code(), Some(2), "the kernel would be overwritten: {}", said(&output));
    let output = run(&[&render[..], &["kernel_ellipse.wgsl=none.wgsl"]].concat());
    assert_eq!(output.status.code(), Some(1));
    assert!(said(&output).contains("none.wgsl"), "{}", said(&output));
    let study = Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/own-kernel.toml");
    let output = run(&["bench", study.to_str().unwrap(), "--quick", "--out", "report"]);
    assert!(output.status.success(), "{}", said(&output));
    let rows = std::fs::read_to_string(folder.path("report/results.csv")).unwrap();
    assert_eq!(rows.lines().filter(|row| row.contains(",own,") || row.contains(",built-in,")).count(), 2, "{rows}");
}
