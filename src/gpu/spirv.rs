//! SPIR-V in which every operation is rounded by itself.
//!
//! Vulkan lets a driver compute `a * b + c` with one rounding, and put `b` in place of `(a + b) - a`, and which it does depends on what
//! stands around: the same lines give other bits in the tiles' kernel than in the one that scatters, and pages other ones than one buffer. NVIDIA's
//! does both. The decoration `NoContraction` forbids it, and WGSL has no word for that; so kernels
//! are translated here, by the translator that wgpu itself uses, and decorated. Then additions, subtractions and products have the same bits on
//! every adapter of Vulkan; quotients, roots, powers and exponentials those that the driver gives them, wherever they stand.

use naga::back::spv;
use naga::proc::{BoundsCheckPolicies, BoundsCheckPolicy};

use super::interface::Interface;

/// The words before the first instruction.
const HEADER: usize = 5;
/// OpDecorate, OpMemberDecorate.
const ANNOTATIONS: [u32; 2] = [71, 72];
/// The decoration's number.
const NO_CONTRACTION: u32 = 42;

/// Whether an instruction computes with floating-point numbers: its result is its third word. FNegate, FAdd, FSub, FMul, FDiv, FRem, FMod,
/// and products of vectors and matrices up to Dot.
fn is_arithmetic(opcode: u32) -> bool {
    matches!(opcode, 127 | 129 | 131 | 133 | 136 | 140 | 141..=148)
}

/// The entry point `entry` of a module as SPIR-V, with `constants` and without what other entry points use.
pub(super) fn translate(
    interface: &Interface,
    entry: (naga::ShaderStage, &str),
    constants: &[(&str, f64)],
    options: &spv::Options<'_>,
) -> Result<Vec<u32>, String> {
    let constants = constants.iter().map(|&(name, value)| (name.to_owned(), value)).collect();
    let (module, info) =
        naga::back::pipeline_constants::process_overrides(&interface.module, &interface.info, Some(entry), &constants)
            .map_err(|e| e.to_string())?;
    let (shader_stage, name) = entry;
    let pipeline = spv::PipelineOptions { shader_stage, entry_point: name.to_owned() };
    let words = spv::write_vec(&module, &info, options, Some(&pipeline)).map_err(|e| e.to_string())?;
    Ok(uncontracted(&words))
}

/// How to translate for a device with `features`: what is allowed are its features, and all checks are on but those of buffers, and
/// of loops unless `counts_loops`. `numbers` are those of variables in the text, and what they are bound by.
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
        // Subgroups are of 1.3, and a feature of devices that read it.
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

/// Decorates every arithmetic instruction's result.
fn uncontracted(words: &[u32]) -> Vec<u32> {
    let (mut arithmetic, mut annotations) = (Vec::new(), None);
    let mut at = HEADER;
    while let Some(&word) = words.get(at) {
        let (opcode, length) = (word & 0xffff, (word >> 16) as usize);
        if ANNOTATIONS.contains(&opcode) {
            annotations.get_or_insert(at);
        } else if is_arithmetic(opcode) {
            arithmetic.extend(words.get(at + 2));
        }
        at += length.max(1);
    }
    // A kernel binds something, and is decorated by that already.
    let at = annotations.unwrap_or(words.len());
    let decorations = arithmetic.iter().flat_map(|&result| [3 << 16 | ANNOTATIONS[0], result, NO_CONTRACTION]);
    words[..at].iter().copied().chain(decorations).chain(words[at..].iter().copied()).collect()
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

    /// Instructions: their opcodes and operands.
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
        let interface = Interface::of(KERNEL).unwrap();
        let layout = interface.layout(&[(wgpu::ShaderStages::COMPUTE, "double")]).unwrap();
        assert_eq!(layout.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>(), ["by", "numbers"]);
        let options = options(wgpu::Features::empty(), [(3, 0), (7, 1)].into_iter(), false);
        let entry = (naga::ShaderStage::Compute, "double");
        let words = translate(&interface, entry, &[("TWICE", 2.0)], &options).unwrap();
        let all = instructions(&words);
        let arithmetic: Vec<u32> = all.iter().filter(|(op, _)| is_arithmetic(*op)).map(|(_, of)| of[1]).collect();
        let is_ours = |(op, of): &&(u32, &[u32])| *op == ANNOTATIONS[0] && of[1] == NO_CONTRACTION;
        let decorated: Vec<u32> = all.iter().filter(is_ours).map(|(_, of)| of[0]).collect();
        // A negation, a quotient, two products of a vector and a number, a difference and two sums at least.
        assert!(decorated == arithmetic && decorated.len() >= 6, "{decorated:?}");
        // Before the types, as the order of sections has it.
        let first_type = all.iter().position(|(op, _)| (19..=33).contains(op)).unwrap();
        assert!(all.iter().rposition(|instruction| is_ours(&instruction)).unwrap() < first_type);
        // Without them it is what the translator wrote.
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
        // The numbers it is told.
        let bindings = all.iter().filter(|(op, of)| *op == ANNOTATIONS[0] && of[1] == 33).map(|(_, of)| of[2]);
        assert_eq!(bindings.collect::<std::collections::BTreeSet<_>>(), [0, 1].into());
    }

    /// A kernel that needs what the device does not grant is refused, and not handed over.
    #[test]
    fn what_is_not_granted_is_refused() {
        let text = "@group(0) @binding(0) var<storage, read_write> n: array<atomic<u64>>;
            @compute @workgroup_size(1) fn go() { atomicMax(&n[0], 1lu); }";
        let interface = Interface::of(text).unwrap();
        let entry = (naga::ShaderStage::Compute, "go");
        let with = |features| translate(&interface, entry, &[], &options(features, [(0, 0)].into_iter(), true));
        let both = wgpu::Features::SHADER_INT64 | wgpu::Features::SHADER_INT64_ATOMIC_ALL_OPS;
        assert!(with(both).is_ok() && with(wgpu::Features::SHADER_INT64).is_err());
    }
}
