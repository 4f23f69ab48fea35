//! Arithmetic on the device is rounded after each operation, in the written order, as on the
//! processor.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common;

use common::Random;
use common::evaluated::{evaluated, file};
use epsplat::low_level::gpu::Gpu;

/// Expressions that a compiler could fuse or rewrite if allowed.
const STATEMENTS: &str = "
    outputs[2u * index] = vec4<f32>(x.x * x.y + x.z, (x.x + x.y) - x.x, x.x * x.y - x.z * x.w, x.x * x.z + x.y * x.z);
    outputs[2u * index + 1u] = vec4<f32>(dot3(x.xyz, x.yzw), cross3(x.xyz, x.yzw).x, (x * x.w + x.yzwx).x, x.x * 3.0 - x.x);
";

fn on_the_device(gpu: &Gpu, statements: &str, inputs: &[[f32; 4]]) -> Vec<[f32; 4]> {
    evaluated(gpu, ["vec4<f32>"; 2], &[file("vectors.wgsl")], statements, (inputs, 2 * inputs.len()))
}

fn on_the_processor(inputs: &[[f32; 4]]) -> Vec<[f32; 4]> {
    let of = |&[x, y, z, w]: &[f32; 4]| {
        [
            [x * y + z, (x + y) - x, x * y - z * w, x * z + y * z],
            [x * y + y * z + z * w, y * w - z * z, x * w + y, x * 3.0 - x],
        ]
    };
    inputs.iter().flat_map(of).collect()
}

fn inputs() -> Vec<[f32; 4]> {
    let mut random = Random(3);
    let mut number = || (random.between(-1.0, 1.0) * random.between(-12.0, 12.0).round().exp2()) as f32;
    (0..20_000).map(|_| std::array::from_fn(|_| number())).collect()
}

/// The number of values that differ in any bit.
fn wrong(a: &[[f32; 4]], b: &[[f32; 4]]) -> usize {
    assert_eq!(a.len(), b.len());
    a.as_flattened().iter().zip(b.as_flattened()).filter(|(a, b)| a.to_bits() != b.to_bits()).count()
}

#[test]
fn sums_and_products_are_those_of_the_processor() {
    let Some(gpu) = common::gpu() else { return };
    let (inputs, core, opengl) = (inputs(), common::core_gpu().unwrap(), common::opengl());
    let expected = on_the_processor(&inputs);
    for gpu in [&gpu, &core].into_iter().chain(&opengl) {
        let wrong = wrong(&on_the_device(gpu, STATEMENTS, &inputs), &expected);
        eprintln!("{} ({}): {wrong} of {} differ", gpu.adapter.name, gpu.adapter.api, 4 * expected.len());
        assert_eq!(wrong, 0, "{}", gpu.adapter.api);
    }
}

/// The control: expressions rewritten as a compiler might are noticed.
#[test]
fn other_roundings_are_noticed() {
    let Some(gpu) = common::gpu() else { return };
    let inputs = inputs();
    let expected = on_the_processor(&inputs);
    // WGSL's `fma` may round once or twice, so the CPU's `mul_add` shows that fusing would make a
    // difference.
    let once = inputs.iter().filter(|[x, y, z, _]| x.mul_add(*y, *z).to_bits() != (x * y + z).to_bits()).count();
    assert!(once > 1000, "{once}");
    for (from, to) in [
        ("(x.x + x.y) - x.x", "x.y"),
        ("x.x * x.z + x.y * x.z", "(x.x + x.y) * x.z"),
        ("dot3(x.xyz, x.yzw)", "x.x * x.y + (x.y * x.z + x.z * x.w)"),
        ("x.x * 3.0 - x.x", "x.x * 2.0"),
    ] {
        assert_eq!(STATEMENTS.matches(from).count(), 1, "{from}");
        assert!(wrong(&on_the_device(&gpu, &STATEMENTS.replace(from, to), &inputs), &expected) > 1000, "{from}");
    }
}
