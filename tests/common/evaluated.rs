//! Small kernels that a test evaluates on a device, one invocation for each input.

use bytemuck::{Pod, Zeroable};
use epsplat::low_level::gpu::Gpu;
use epsplat::low_level::gpu::layout::View;
use epsplat::low_level::gpu::sources::FILES;
use epsplat::low_level::inspect::evaluate;

/// The text of a built-in kernel file.
pub fn file(name: &str) -> &'static str {
    FILES.iter().find(|(file, _)| *file == name).unwrap().1
}

/// Runs `statements` for each of `inputs` and returns the `count` elements of `outputs`.
///
/// The statements see `x`, the input of the WGSL type `types[0]`, its `index`, and the array
/// `outputs` of the type `types[1]`. `parts` are the functions and variables that they use beside
/// those of `layout.wgsl`.
pub fn evaluated<I: Pod + Send + Sync, O: Pod>(
    gpu: &Gpu,
    types: [&str; 2],
    parts: &[&str],
    statements: &str,
    (inputs, count): (&[I], usize),
) -> Vec<O> {
    let [input, output] = types;
    let kernel = format!(
        "@group(0) @binding(20) var<storage, read> inputs: array<{input}>;
        @group(0) @binding(21) var<storage, read_write> outputs: array<{output}>;

        @compute @workgroup_size(WORKGROUP)
        fn evaluate(
            @builtin(workgroup_id) workgroup: vec3<u32>,
            @builtin(num_workgroups) workgroups: vec3<u32>,
            @builtin(local_invocation_index) local: u32,
        ) {{
            hold_view();
            let index = linear_index(workgroup, workgroups, local);
            if (index >= arrayLength(&inputs)) {{
                return;
            }}
            let x = inputs[index];
            {statements}
        }}"
    );
    let lacking = "struct Clip { nothing: u32 } struct Cap { nothing: u32 } struct Fade { nothing: u32 }";
    let text = [&[file("layout.wgsl"), lacking], parts, &[&kernel]].concat().join("\n");
    evaluate(gpu, &text, &View::zeroed(), inputs, count as u64).unwrap()
}
