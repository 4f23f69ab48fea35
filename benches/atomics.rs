//! Atomic operations per second of an adapter.
//!
//! ```text
//! cargo bench --bench atomics [-- --quick] [-- --adapter SUBSTRING]
//! ```
//!
//! Scatter kernels add every fragment to the sums of its pixel, so they are as fast as the
//! adapter's atomics. The rows show which accumulator (`src/passes/accumulate.rs`) is the fastest:
//!
//! - **u32 add**: the cost of each sum with `fixed32`, and the measure for the other rows.
//! - **u32 add, carry**: `fixed`, with two words per sum and an add to the second where the first
//!   wraps, here at every fourth add. It needs nothing beyond core WebGPU. Where it is nearly as
//!   fast as *u32 add*, no other accumulator is needed.
//! - **u64 add**: `fixed64`, or two sums at once with `packed64`, which therefore wins wherever
//!   this row is faster than half of *u32 add*.
//! - **f32 add**, **f32 compare-exchange**: `float` and `cas`. They are not exact, so only their
//!   speed could justify them.
//! - **u32 min**: the visibility pass. Most attempts change nothing, which hardware may detect
//!   before it locks.
//! - **workgroup, then global**: adds to workgroup memory, and then one add to the buffer for every
//!   eight of them. Where it beats *u32 add*, splats of many pixels belong in tiles whose sums stay
//!   in workgroup memory.
//!
//! The columns are distributions of fragments. *Spread* is one add to each of 4 Mi addresses in an
//! order without locality, as with many small splats in any order: bound by memory. *Line* is 16
//! addresses of one 64-byte line (two lines for pairs and 64-bit words), as with threads that draw
//! one splat. *Same* is a single address, as with a cloud of great depth complexity: hardware takes
//! turns, or adds up within a subgroup first.
//!
//! Every kernel's result is compared, address by address, with one computed here; a wrong one fails
//! the benchmark. The kernels' repetitions alternate, so that a busy machine slows all of them
//! alike. The median is printed with the median distance from it.

use epsplat::low_level::gpu::device::{INSTALL_HINT, adapters};
use std::process::ExitCode;
use std::time::Instant;

/// Invocations per workgroup, and addresses per tile in workgroup memory.
const GROUP: u32 = 256;
/// Operations per invocation: few, because software adapters end long loops.
const ROUNDS: u32 = 8;
/// Addresses in the column *spread*.
const SPREAD: u32 = 1 << 22;
/// Scatters consecutive operations over the addresses; it is odd, so each address has its turn.
const SCATTER: u32 = 0x9e37_79b1;

/// The columns: name, and number of addresses less one (a mask).
const PATTERNS: [(&str, u32); 3] = [("spread", SPREAD - 1), ("line", 15), ("same", 0)];

/// An atomic operation to measure; a row of the table.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Operation {
    Add,
    AddCarry,
    Min,
    Add64,
    AddFloat,
    CompareExchange,
    Workgroup,
}

use Operation::{Add, Add64, AddCarry, AddFloat, CompareExchange, Min, Workgroup};

/// The value of each *u32 add, carry*: slightly more than a quarter of a word, like a full weight
/// of `fixed`.
const QUARTER: u32 = (1 << 30) + 1;

impl Operation {
    const ALL: [Self; 7] = [Add, AddCarry, Add64, AddFloat, CompareExchange, Min, Workgroup];

    fn name(self) -> &'static str {
        match self {
            Add => "u32 add",
            AddCarry => "u32 add, carry",
            Min => "u32 min",
            Add64 => "u64 add",
            AddFloat => "f32 add",
            CompareExchange => "f32 compare-exchange",
            Workgroup => "workgroup, then global",
        }
    }

    /// Features that the operation needs beyond core WebGPU.
    fn features(self) -> wgpu::Features {
        match self {
            Add64 => wgpu::Features::SHADER_INT64 | wgpu::Features::SHADER_INT64_ATOMIC_ALL_OPS,
            AddFloat => wgpu::Features::SHADER_FLOAT32_ATOMIC,
            _ => wgpu::Features::empty(),
        }
    }

    /// The number of u32 words per address.
    fn words(self) -> usize {
        if matches!(self, Add64 | AddCarry) { 2 } else { 1 }
    }

    /// The WGSL kernel for `mask + 1` addresses and `invocations` invocations in all.
    fn kernel(self, mask: u32, invocations: u32) -> String {
        let (cell, operation) = match self {
            Add => ("u32", "atomicAdd(&cells[at], 1u + (i & 1u));".to_owned()),
            AddCarry => (
                "u32",
                format!(
                    "let before = atomicAdd(&cells[2u * at], {QUARTER}u);
                    if (before + {QUARTER}u < before) {{ atomicAdd(&cells[2u * at + 1u], 1u); }}"
                ),
            ),
            Min => ("u32", "atomicMin(&cells[at], i * 2246822519u);".to_owned()),
            Add64 => ("u64", "atomicAdd(&cells[at], (1lu << 32u) | u64(1u + (i & 1u)));".to_owned()),
            AddFloat => ("f32", "atomicAdd(&cells[at], 1.0);".to_owned()),
            CompareExchange => (
                "u32",
                "var old = atomicLoad(&cells[at]);
                loop {
                    let tried = atomicCompareExchangeWeak(&cells[at], old, bitcast<u32>(bitcast<f32>(old) + 1.0));
                    if (tried.exchanged) { break; }
                    old = tried.old_value;
                }"
                .to_owned(),
            ),
            Workgroup => ("u32", format!("atomicAdd(&tile[at & {}u], 1u + (i & 1u));", GROUP - 1)),
        };
        let (tile, flush) = if self == Workgroup {
            let stride = tile_stride(mask, invocations);
            (
                format!("var<workgroup> tile: array<atomic<u32>, {GROUP}>;"),
                format!(
                    "workgroupBarrier();
                    if (local.x <= {mask}u) {{ atomicAdd(&cells[group.x * {stride}u + local.x], atomicLoad(&tile[local.x])); }}"
                ),
            )
        } else {
            Default::default()
        };
        format!(
            "@group(0) @binding(0) var<storage, read_write> cells: array<atomic<{cell}>>;
            {tile}
            @compute @workgroup_size({GROUP})
            fn main(
                @builtin(workgroup_id) group: vec3u,
                @builtin(local_invocation_id) local: vec3u,
            ) {{
                let invocation = group.x * {GROUP}u + local.x;
                for (var round = 0u; round < {ROUNDS}u; round++) {{
                    let i = round * {invocations}u + invocation;
                    let at = (i * {SCATTER}u) & {mask}u;
                    {operation}
                }}
                {flush}
            }}"
        )
    }

    /// The value of every word before the operations.
    fn initial(self) -> u32 {
        if self == Min { u32::MAX } else { 0 }
    }

    /// All words after the operations.
    fn expected(self, mask: u32, invocations: u32) -> Vec<u32> {
        let mut words = vec![self.initial(); SPREAD as usize * self.words()];
        for i in 0..invocations * ROUNDS {
            let mut at = i.wrapping_mul(SCATTER) & mask;
            if self == Workgroup {
                let group = i % invocations / GROUP;
                at = group * tile_stride(mask, invocations) + (at & (GROUP - 1));
            }
            let add = |word: &mut u32, value: u32| *word = word.wrapping_add(value);
            let at = at as usize * self.words();
            match (self, words.get_mut(at..at + self.words())) {
                (Add | Workgroup, Some([word])) => add(word, 1 + (i & 1)),
                (Min, Some([word])) => *word = (*word).min(i.wrapping_mul(2_246_822_519)),
                (Add64 | AddCarry, Some([low, high])) => {
                    let value = if self == Add64 { (1 << 32) | u64::from(1 + (i & 1)) } else { QUARTER.into() };
                    let sum = (u64::from(*high) << 32 | u64::from(*low)).wrapping_add(value);
                    (*low, *high) = (sum as u32, (sum >> 32) as u32);
                }
                // Whole numbers up to 2^24 are exact in f32, in any order of additions.
                (AddFloat | CompareExchange, Some([word])) => *word = (f32::from_bits(*word) + 1.0).to_bits(),
                _ => {}
            }
        }
        words
    }
}

/// Distance between the tiles of consecutive workgroups, in addresses. Only in the column *spread*
/// the tiles are apart; in the others all start at 0.
fn tile_stride(mask: u32, invocations: u32) -> u32 {
    if mask == SPREAD - 1 { SPREAD / (invocations / GROUP) } else { 0 }
}

/// An open device with the buffers that all kernels share.
struct Bench {
    name: String,
    features: wgpu::Features,
    device: wgpu::Device,
    queue: wgpu::Queue,
    cells: wgpu::Buffer,
    ones: wgpu::Buffer,
    staging: wgpu::Buffer,
    /// Two timestamps, if the adapter supports them.
    clock: Option<(wgpu::QuerySet, wgpu::Buffer)>,
    invocations: u32,
}

/// A kernel and its measured rates.
struct Case {
    operation: Operation,
    mask: u32,
    pipeline: wgpu::ComputePipeline,
    group: wgpu::BindGroup,
    /// Operations per second, one value per repetition.
    rates: Vec<f64>,
}

impl Bench {
    fn open(wanted: &str, quick: bool) -> Result<Self, String> {
        let known = adapters();
        let fits = |name: &str| name.to_lowercase().contains(&wanted.to_lowercase());
        let chosen = known.iter().find(|adapter| adapter.usable && fits(&adapter.name));
        let chosen = chosen.ok_or_else(|| format!("no usable adapter is called {wanted:?}: {INSTALL_HINT}"))?;
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle_from_env());
        let handle = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::all()))
            .into_iter()
            .find(|adapter| {
                let info = adapter.get_info();
                info.name == chosen.name && info.backend.to_str() == chosen.api
            })
            .ok_or("the adapter has gone")?;
        let wished = Operation::ALL.iter().fold(wgpu::Features::TIMESTAMP_QUERY, |all, one| all | one.features());
        let features = handle.features() & wished;
        let descriptor = wgpu::DeviceDescriptor {
            required_features: features,
            required_limits: handle.limits(),
            ..Default::default()
        };
        let opened = pollster::block_on(handle.request_device(&descriptor));
        let (device, queue) = opened.map_err(|error| format!("{}: {error}", chosen.name))?;
        let bytes = u64::from(SPREAD) * 8;
        let buffer = |usage, size| {
            device.create_buffer(&wgpu::BufferDescriptor { label: None, size, usage, mapped_at_creation: false })
        };
        use wgpu::BufferUsages as Usage;
        let clock = features.contains(wgpu::Features::TIMESTAMP_QUERY).then(|| {
            let descriptor = wgpu::QuerySetDescriptor { label: None, ty: wgpu::QueryType::Timestamp, count: 2 };
            (device.create_query_set(&descriptor), buffer(Usage::QUERY_RESOLVE | Usage::COPY_SRC, 16))
        });
        let ones = buffer(Usage::COPY_SRC | Usage::COPY_DST, bytes);
        queue.write_buffer(&ones, 0, &vec![0xff; bytes as usize]);
        // On a fast graphics card the cost of a launch would count, so a card does more operations.
        // f32 stays exact up to 2^24 additions.
        let operations = 1 << if quick { 20 } else { 22 + 2 * u32::from(chosen.kind != "software") };
        Ok(Self {
            name: format!("{} ({}, {})", chosen.name, chosen.api, chosen.kind),
            features,
            cells: buffer(Usage::STORAGE | Usage::COPY_SRC | Usage::COPY_DST, bytes),
            ones,
            staging: buffer(Usage::MAP_READ | Usage::COPY_DST, bytes),
            clock,
            invocations: operations / ROUNDS,
            device,
            queue,
        })
    }

    fn case(&self, operation: Operation, mask: u32) -> Result<Case, String> {
        let guard = self.device.push_error_scope(wgpu::ErrorFilter::Validation);
        let module = self.device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: None,
            source: wgpu::ShaderSource::Wgsl(operation.kernel(mask, self.invocations).into()),
        });
        let pipeline = self.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: None,
            layout: None,
            module: &module,
            entry_point: Some("main"),
            compilation_options: Default::default(),
            cache: None,
        });
        let group = self.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &pipeline.get_bind_group_layout(0),
            entries: &[wgpu::BindGroupEntry { binding: 0, resource: self.cells.as_entire_binding() }],
        });
        match pollster::block_on(guard.pop()) {
            Some(error) => Err(format!("{}: the kernel of {} is refused: {error}", self.name, operation.name())),
            None => Ok(Case { operation, mask, pipeline, group, rates: Vec::new() }),
        }
    }

    fn wait(&self) -> Result<(), String> {
        self.device.poll(wgpu::PollType::wait_indefinitely()).map(|_| ()).map_err(|error| error.to_string())
    }

    /// Reads the first `bytes` bytes of a buffer.
    fn read(&self, from: &wgpu::Buffer, bytes: u64) -> Result<Vec<u8>, String> {
        let mut encoder = self.device.create_command_encoder(&Default::default());
        encoder.copy_buffer_to_buffer(from, 0, &self.staging, 0, bytes);
        self.queue.submit([encoder.finish()]);
        let slice = self.staging.slice(..bytes);
        slice.map_async(wgpu::MapMode::Read, |_| {});
        self.wait()?;
        let values = slice.get_mapped_range().map_err(|error| error.to_string())?.to_vec();
        self.staging.unmap();
        Ok(values)
    }

    /// Runs a kernel once on fresh cells and returns operations per second.
    fn run(&self, case: &Case) -> Result<f64, String> {
        let mut encoder = self.device.create_command_encoder(&Default::default());
        match case.operation.initial() {
            0 => encoder.clear_buffer(&self.cells, 0, None),
            _ => encoder.copy_buffer_to_buffer(&self.ones, 0, &self.cells, 0, self.ones.size()),
        }
        self.queue.submit([encoder.finish()]);
        self.wait()?;
        let mut encoder = self.device.create_command_encoder(&Default::default());
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: None,
            timestamp_writes: self.clock.as_ref().map(|(set, _)| wgpu::ComputePassTimestampWrites {
                query_set: set,
                beginning_of_pass_write_index: Some(0),
                end_of_pass_write_index: Some(1),
            }),
        });
        pass.set_pipeline(&case.pipeline);
        pass.set_bind_group(0, &case.group, &[]);
        pass.dispatch_workgroups(self.invocations / GROUP, 1, 1);
        drop(pass);
        if let Some((set, ticks)) = &self.clock {
            encoder.resolve_query_set(set, 0..2, ticks, 0);
        }
        let start = Instant::now();
        self.queue.submit([encoder.finish()]);
        self.wait()?;
        let mut seconds = start.elapsed().as_secs_f64();
        if let Some((_, buffer)) = &self.clock {
            let bytes = self.read(buffer, 16)?;
            let ticks: Vec<u64> = bytes.as_chunks().0.iter().map(|tick| u64::from_le_bytes(*tick)).collect();
            if let [begin, end] = ticks[..] {
                seconds = end.saturating_sub(begin) as f64 * f64::from(self.queue.get_timestamp_period()) * 1e-9;
            }
        }
        Ok(f64::from(self.invocations * ROUNDS) / seconds)
    }

    /// Compares the cells with the words that the last kernel must have left.
    fn verify(&self, case: &Case) -> Result<(), String> {
        let expected = case.operation.expected(case.mask, self.invocations);
        let bytes = self.read(&self.cells, 4 * expected.len() as u64)?;
        let found = bytes.as_chunks().0.iter().map(|word| u32::from_le_bytes(*word));
        match found.zip(&expected).enumerate().find(|(_, (found, expected))| found != *expected) {
            None => Ok(()),
            Some((word, (found, expected))) => Err(format!(
                "{}: {} over {} addresses leaves {found:#x} in word {word}, not {expected:#x}",
                self.name,
                case.operation.name(),
                case.mask + 1
            )),
        }
    }
}

/// The median, or NaN if there are no values.
fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(what) => {
            eprintln!("error: {what}");
            ExitCode::FAILURE
        }
    }
}

fn run() -> Result<(), String> {
    let (mut quick, mut wanted) = (false, String::new());
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            "--bench" => {} // cargo passes it
            "--quick" => quick = true,
            "--adapter" => wanted = arguments.next().ok_or("--adapter needs a part of a name")?,
            other => return Err(format!("{other:?} is not --quick or --adapter SUBSTRING")),
        }
    }
    let bench = Bench::open(&wanted, quick)?;
    let mut cases = Vec::new();
    for operation in Operation::ALL.into_iter().filter(|operation| bench.features.contains(operation.features())) {
        for (_, mask) in PATTERNS {
            cases.push(bench.case(operation, mask)?);
        }
    }
    let repetitions = if quick { 3 } else { 11 };
    for case in &cases {
        bench.run(case)?;
        bench.verify(case)?;
    }
    for _ in 0..repetitions {
        for case in &mut cases {
            let rate = bench.run(case)?;
            case.rates.push(rate);
        }
    }
    let clock = if bench.clock.is_some() { "the device's clock" } else { "wall time, submission included" };
    println!(
        "{}: million operations per second, {} in a kernel, median of {repetitions}, by {clock}\n",
        bench.name,
        bench.invocations * ROUNDS
    );
    println!("{:<24}{}", "", PATTERNS.map(|(name, _)| format!("{name:>18}")).concat());
    for operation in Operation::ALL {
        let cell = |(_, mask): (&str, u32)| {
            let case = cases.iter().find(|case| case.operation == operation && case.mask == mask)?;
            let rate = median(case.rates.clone());
            let spread = median(case.rates.iter().map(|other| (other - rate).abs()).collect());
            Some(format!("{:>12.1} ±{:>3.0}%", rate * 1e-6, 100.0 * spread / rate))
        };
        let cells: Option<Vec<String>> = PATTERNS.into_iter().map(cell).collect();
        let cells = cells.map_or("         not on this adapter".to_owned(), |cells| cells.concat());
        println!("{:<24}{cells}", operation.name());
    }
    Ok(())
}
