//! Translates kernels to SPIR-V in which every operation is rounded separately.
//!
//! Vulkan lets a driver compute `a * b + c` with one rounding, and replace `(a + b) - a` by `b`.
//! Whether it does depends on the surrounding code: the same lines give different bits in the tile
//! kernel and in the scatter kernel, and with pages and with one buffer. NVIDIA's driver does both.
//! The decoration `NoContraction` forbids both, but WGSL has no word for it. So kernels are
//! translated here, by the translator that wgpu itself uses, and decorated. Sums, differences and
//! products are then those of IEEE 754 on every Vulkan adapter that rounds to nearest, except that
//! subnormal numbers may become 0. Other operations are built from these (`src/gpu/exact`).

use std::ops::RangeInclusive;

use naga::back::spv;
use naga::proc::{BoundsCheckPolicies, BoundsCheckPolicy};
use naga::valid::Capabilities;

use super::interface::Interface;

/// Number of words before the first instruction.
const HEADER: usize = 5;
/// Opcode of OpDecorate.
const DECORATE: u32 = 71;
/// First and last opcode of types. Every module has one, and annotations come before them.
const TYPES: RangeInclusive<u32> = 19..=39;
/// Number of the decoration NoContraction.
const NO_CONTRACTION: u32 = 42;

/// Whether an instruction does floating-point arithmetic. Its third word is then the id of its
/// result.
///
/// These are FNegate, FAdd, FSub, FMul, FDiv, FRem, FMod, and the products of vectors and matrices
/// up to Dot.
fn is_arithmetic(opcode: u32) -> bool {
    matches!(opcode, 127 | 129 | 131 | 133 | 136 | 140 | 141..=148)
}

/// Translates one entry point of a module to SPIR-V, with `constants` set and without what only
/// other entry points use. Its workgroup memory is zeroed first, unless all of it is in
/// `set_memory`: the translator lets one invocation zero all words, while the others wait.
///
/// # Errors
/// A message if the translator refuses the module, or its workgroup is too large for `limits`.
pub(super) fn translate(
    interface: &Interface,
    entry: (naga::ShaderStage, &str),
    constants: &[(&str, f64)],
    (mut options, limits): (spv::Options<'_>, &wgpu::Limits),
    set_memory: &[String],
) -> Result<Vec<u32>, String> {
    let (module, info) = interface.resolved(entry, constants)?;
    let (shader_stage, name) = entry;
    check_workgroup(&module, limits)?;
    let mut memory = module.global_variables.iter().filter(|(_, of)| of.space == naga::AddressSpace::WorkGroup);
    if memory.all(|(_, variable)| variable.name.as_ref().is_some_and(|name| set_memory.contains(name))) {
        options.zero_initialize_workgroup_memory = spv::ZeroInitializeWorkgroupMemoryMode::None;
    }
    let pipeline = spv::PipelineOptions { shader_stage, entry_point: name.to_owned() };
    let words = spv::write_vec(&module, &info, &options, Some(&pipeline)).map_err(|e| e.to_string())?;
    uncontracted(&words)
}

/// Checks the workgroup size and the workgroup memory against the device's limits. `module` must
/// contain only what its entry point uses.
fn check_workgroup(module: &naga::Module, limits: &wgpu::Limits) -> Result<(), String> {
    let mut layouter = naga::proc::Layouter::default();
    layouter.update(module.to_ctx()).map_err(|e| e.to_string())?;
    let shared = module.global_variables.iter().filter(|(_, variable)| variable.space == naga::AddressSpace::WorkGroup);
    let bytes: u64 = shared.map(|(_, variable)| u64::from(layouter[variable.ty].size)).sum();
    let most = u64::from(limits.max_compute_workgroup_storage_size);
    if bytes > most {
        return Err(format!("a workgroup has {bytes} bytes of memory, and the device allows {most}"));
    }
    for entry in module.entry_points.iter().filter(|entry| entry.stage == naga::ShaderStage::Compute) {
        let [x, y, z] = entry.workgroup_size;
        let sides = [
            (x, limits.max_compute_workgroup_size_x),
            (y, limits.max_compute_workgroup_size_y),
            (z, limits.max_compute_workgroup_size_z),
        ];
        let invocations = u64::from(x) * u64::from(y) * u64::from(z);
        let most = u64::from(limits.max_compute_invocations_per_workgroup);
        if invocations > most || sides.iter().any(|(side, most)| side > most) {
            return Err(format!("a workgroup of {x}x{y}x{z} invocations is larger than the device allows"));
        }
    }
    Ok(())
}

/// Returns the capabilities that WGSL may use on a device with `features`.
pub(super) fn capabilities(features: wgpu::Features) -> Capabilities {
    let granted = [
        (wgpu::Features::SHADER_INT64, Capabilities::SHADER_INT64),
        (
            wgpu::Features::SHADER_INT64_ATOMIC_ALL_OPS,
            Capabilities::SHADER_INT64_ATOMIC_ALL_OPS.union(Capabilities::SHADER_INT64_ATOMIC_MIN_MAX),
        ),
        (wgpu::Features::SHADER_FLOAT32_ATOMIC, Capabilities::SHADER_FLOAT32_ATOMIC),
        (wgpu::Features::SUBGROUP, Capabilities::SUBGROUP),
    ];
    granted.iter().filter(|(feature, _)| features.contains(*feature)).map(|(_, granted)| *granted).collect()
}

/// Returns the translator's options for a device with `features`.
///
/// The module may use what these features grant. All checks are on, except those of buffer
/// accesses. Loops get counters only if `counts_loops`. `numbers` maps binding numbers of the
/// source to those of the pipeline.
pub(super) fn options(
    features: wgpu::Features,
    numbers: impl Iterator<Item = (u32, u32)>,
    counts_loops: bool,
) -> spv::Options<'static> {
    use spv::Capability as C;
    let granted = [
        (wgpu::Features::empty(), &[C::Shader, C::Matrix, C::ImageQuery][..]),
        (wgpu::Features::SHADER_INT64, &[C::Int64]),
        (wgpu::Features::SHADER_INT64_ATOMIC_ALL_OPS, &[C::Int64Atomics]),
        (wgpu::Features::SHADER_FLOAT32_ATOMIC, &[C::AtomicFloat32AddEXT]),
        (
            wgpu::Features::SUBGROUP,
            &[
                C::GroupNonUniform,
                C::GroupNonUniformVote,
                C::GroupNonUniformArithmetic,
                C::GroupNonUniformBallot,
                C::GroupNonUniformShuffle,
                C::GroupNonUniformShuffleRelative,
                C::GroupNonUniformQuad,
            ],
        ),
    ];
    let granted = granted.iter().filter(|(feature, _)| features.contains(*feature));
    let bound = numbers.map(|(of_text, binding)| {
        let number = spv::BindingInfo { descriptor_set: 0, binding, binding_array_size: None };
        (naga::ResourceBinding { group: 0, binding: of_text }, number)
    });
    spv::Options {
        // Subgroups need SPIR-V 1.3, which devices with that feature can read.
        lang_version: if features.contains(wgpu::Features::SUBGROUP) { (1, 3) } else { (1, 0) },
        flags: spv::WriterFlags::empty(),
        fake_missing_bindings: false,
        binding_map: bound.collect(),
        capabilities: Some(granted.flat_map(|(_, granted)| granted.iter().copied()).collect()),
        bounds_check_policies: BoundsCheckPolicies {
            index: BoundsCheckPolicy::Restrict,
            buffer: BoundsCheckPolicy::Unchecked,
            image_load: BoundsCheckPolicy::Restrict,
            binding_array: BoundsCheckPolicy::Unchecked,
        },
        force_loop_bounding: counts_loops,
        ..spv::Options::default()
    }
}

/// Adds the decoration NoContraction to the result of every arithmetic instruction.
fn uncontracted(words: &[u32]) -> Result<Vec<u32>, String> {
    let (mut arithmetic, mut types) = (Vec::new(), None);
    let mut at = HEADER;
    while let Some(&word) = words.get(at) {
        let (opcode, length) = (word & 0xffff, (word >> 16) as usize);
        if TYPES.contains(&opcode) {
            types.get_or_insert(at);
        } else if is_arithmetic(opcode) {
            arithmetic.extend(words.get(at + 2));
        }
        at += length.max(1);
    }
    let types = types.ok_or("a module without types")?;
    let decorations = arithmetic.iter().flat_map(|&result| [3 << 16 | DECORATE, result, NO_CONTRACTION]);
    Ok(words[..types].iter().copied().chain(decorations).chain(words[types..].iter().copied()).collect())
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    const KERNEL: &str = "
        override TWICE: f32;
        @group(0) @binding(7) var<storage, read_write> numbers: array<vec2<f32>>;
        @group(0) @binding(3) var<uniform> by: vec4<f32>;
        @group(0) @binding(9) var<storage, read> unused: array<u32>;
        @compute @workgroup_size(64)
        fn double(@builtin(global_invocation_id) id: vec3<u32>) {
            let own = numbers[id.x];
            numbers[id.x] = -own / by.xy + own * TWICE - own * by.z + vec2<f32>(f32(id.x + 1u));
        }";

    /// Opcode of OpStore.
    const STORE: u32 = 62;

    /// Splits a module into instructions: opcode and operands.
    fn instructions(words: &[u32]) -> Vec<(u32, &[u32])> {
        let (mut all, mut rest) = (Vec::new(), &words[HEADER..]);
        while let Some(&word) = rest.first() {
            let (instruction, after) = rest.split_at((word >> 16) as usize);
            all.push((word & 0xffff, &instruction[1..]));
            rest = after;
        }
        all
    }

    #[test]
    fn every_arithmetic_result_is_decorated_and_nothing_else_is_changed() {
        let interface = Interface::of(KERNEL, Capabilities::empty()).unwrap();
        let layout = interface.layout(&[(wgpu::ShaderStages::COMPUTE, "double")]).unwrap();
        assert_eq!(layout.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>(), ["by", "numbers"]);
        let options = options(wgpu::Features::empty(), [(3, 0), (7, 1)].into_iter(), false);
        let entry = (naga::ShaderStage::Compute, "double");
        let words =
            translate(&interface, entry, &[("TWICE", 2.0)], (options.clone(), &wgpu::Limits::default()), &[]).unwrap();
        let all = instructions(&words);
        let arithmetic: Vec<u32> = all.iter().filter(|(op, _)| is_arithmetic(*op)).map(|(_, of)| of[1]).collect();
        let is_ours = |(op, of): &&(u32, &[u32])| *op == DECORATE && of[1] == NO_CONTRACTION;
        let decorated: Vec<u32> = all.iter().filter(is_ours).map(|(_, of)| of[0]).collect();
        assert_eq!(decorated, arithmetic);
        // Two sums, a negation, a difference, a quotient and two products of a vector and a number.
        let mut opcodes: Vec<u32> = all
            .iter()
            .filter(|(_, of)| of.get(1).is_some_and(|id| decorated.contains(id)))
            .map(|(op, _)| *op)
            .collect();
        // A store has the id of a result as the same operand.
        opcodes.retain(|op| ![DECORATE, STORE].contains(op));
        opcodes.sort_unstable();
        assert_eq!(opcodes, [127, 129, 129, 131, 136, 142, 142]);
        // Decorations come before types, as SPIR-V orders its sections.
        let first_type = all.iter().position(|(op, _)| (19..=33).contains(op)).unwrap();
        assert!(all.iter().rposition(|instruction| is_ours(&instruction)).unwrap() < first_type);
        // Without the decorations, the module is what the translator wrote.
        let pipeline =
            spv::PipelineOptions { shader_stage: naga::ShaderStage::Compute, entry_point: "double".to_owned() };
        let constants = [("TWICE".to_owned(), 2.0)].into_iter().collect();
        let (module, info) = naga::back::pipeline_constants::process_overrides(
            &interface.module,
            &interface.info,
            Some(entry),
            &constants,
        )
        .unwrap();
        let plain = spv::write_vec(&module, &info, &options, Some(&pipeline)).unwrap();
        let rest: Vec<_> = all.iter().filter(|instruction| !is_ours(instruction)).copied().collect();
        assert_eq!(rest, instructions(&plain));
        assert!(!instructions(&plain).iter().any(|instruction| is_ours(&instruction)), "the control");
        // The bindings have the pipeline's numbers.
        let bindings = all.iter().filter(|(op, of)| *op == DECORATE && of[1] == 33).map(|(_, of)| of[2]);
        assert_eq!(bindings.collect::<std::collections::BTreeSet<_>>(), [0, 1].into());
    }

    fn translated(text: &str, features: wgpu::Features, limits: &wgpu::Limits) -> Result<Vec<u32>, String> {
        let interface = Interface::of(text, capabilities(features)).map_err(|invalid| invalid.told(|_| None))?;
        let options = options(features, [(0, 0)].into_iter(), true);
        translate(&interface, (naga::ShaderStage::Compute, "go"), &[], (options, limits), &[])
    }

    /// Kernels that need more than the device grants are refused before the driver sees them.
    #[test]
    fn what_is_not_granted_is_refused() {
        let (core, limits) = (wgpu::Features::empty(), wgpu::Limits::default());
        let wide = "@group(0) @binding(0) var<storage, read_write> n: array<atomic<u64>>;
            @compute @workgroup_size(1) fn go() { atomicMax(&n[0], 1lu); }";
        let both = wgpu::Features::SHADER_INT64 | wgpu::Features::SHADER_INT64_ATOMIC_ALL_OPS;
        assert!(translated(wide, both, &limits).is_ok());
        assert!(translated(wide, wgpu::Features::SHADER_INT64, &limits).is_err());
        let workgroup = |size: &str| format!("@compute @workgroup_size({size}) fn go() {{}}");
        assert!(translated(&workgroup("256"), core, &limits).is_ok());
        assert!(translated(&workgroup("257"), core, &limits).is_err());
        assert!(translated(&workgroup("16, 17"), core, &limits).is_err());
        let shared = |words: u32| {
            format!("var<workgroup> w: array<u32, {words}>; @compute @workgroup_size(1) fn go() {{ w[0] = 1u; }}")
        };
        assert!(translated(&shared(4096), core, &limits).is_ok());
        assert!(translated(&shared(4097), core, &limits).is_err());
        let immediate = "var<immediate> i: u32; @group(0) @binding(0) var<storage, read_write> n: array<u32>;
            @compute @workgroup_size(1) fn go() { n[0] = i; }";
        assert!(translated(immediate, core, &limits).is_err());
    }

    /// Decorations come before types even if a kernel binds nothing.
    #[test]
    fn a_kernel_without_annotations_gets_them_in_their_place() {
        let text = "@compute @workgroup_size(1) fn go() { var x = 1.0; x = x * x; }";
        let words = translated(text, wgpu::Features::empty(), &wgpu::Limits::default()).unwrap();
        let all = instructions(&words);
        let decorated = all.iter().position(|(op, of)| *op == DECORATE && of[1] == NO_CONTRACTION).unwrap();
        assert!(decorated < all.iter().position(|(op, _)| TYPES.contains(op)).unwrap());
    }
}
