//! The registers of the kernels on a graphics card: Mesa's compiler needs no more than the table
//! `tests/golden/registers.txt` says, for a Radeon RX 6800 that is not there.
//!
//! The driver reads the kind of card from the environment when it starts. So the test runs itself
//! once more as a process of its own, which compiles the kernels and writes their figures.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod card;
mod configurations;
mod table;

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::process::Command;

use card::{Card, Figures};
use epsplat::low_level::gpu::ahead::Translated;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use table::{Row, Table};

/// Name of the environment variable that makes the test the compiling process. Its value is the
/// file for the outcome.
const COMPILES: &str = "EPSPLAT_REGISTERS_OUTCOME";

/// The file of the table.
const TABLE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/golden/registers.txt");

/// Stack size of a compiling thread: that of a process's first thread.
const COMPILER_STACK: usize = 8 << 20;

/// The outcome of the compiling process.
#[derive(Serialize, Deserialize)]
enum Outcome {
    /// The driver offers no such card, for this reason.
    Missing(String),
    /// The figures of all kernels, and those of a kernel with an array of 4096 bytes per lane.
    Made(Table, Figures),
}

/// Finds the manifest of Mesa's driver for Radeon cards where Vulkan's loader looks for it.
fn manifest() -> Option<PathBuf> {
    let folders = ["/etc", "/usr/local/share", "/usr/share"].map(|base| Path::new(base).join("vulkan/icd.d"));
    let files = folders.iter().filter_map(|folder| std::fs::read_dir(folder).ok()).flatten();
    let mut found = files.filter_map(|file| Some(file.ok()?.path())).filter(|path| {
        let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
        // A system may have the driver for processors of 32 bits too.
        name.starts_with("radeon_icd") && name.ends_with(".json") && !name.contains(".i686")
    });
    found.next()
}

/// A kernel whose array does not fit registers.
fn with_array() -> Translated {
    let text = "
        @group(0) @binding(0) var<storage, read_write> numbers: array<u32>;
        @compute @workgroup_size(64)
        fn control(@builtin(global_invocation_id) id: vec3<u32>) {
            var own: array<u32, 1024>;
            for (var k = 0u; k < 1024u; k++) { own[numbers[k] % 1024u] += k; }
            numbers[id.x] = own[numbers[id.x] % 1024u];
        }";
    let module = naga::front::wgsl::parse_str(text).unwrap();
    let mut validator = naga::valid::Validator::new(naga::valid::ValidationFlags::all(), Default::default());
    let info = validator.validate(&module).unwrap();
    let words = naga::back::spv::write_vec(&module, &info, &Default::default(), None).unwrap();
    let ty = wgpu::BindingType::Buffer {
        ty: wgpu::BufferBindingType::Storage { read_only: false },
        has_dynamic_offset: false,
        min_binding_size: None,
    };
    let visibility = wgpu::ShaderStages::COMPUTE;
    Translated {
        name: "control",
        words,
        entries: vec![wgpu::BindGroupLayoutEntry { binding: 0, visibility, ty, count: None }],
    }
}

/// Compiles all kernels; each text once, as configurations share kernels.
fn compiled() -> Outcome {
    let card = match Card::open() {
        Ok(card) if card.driver.contains("NAVI21") => card,
        Ok(card) => return Outcome::Missing(format!("the driver offers {}", card.driver)),
        Err(why) => return Outcome::Missing(why),
    };
    let all = configurations::translated();
    let mut different: HashMap<&[u32], &Translated> = HashMap::new();
    all.iter().flat_map(|(_, kernels)| kernels).for_each(|kernel| {
        different.insert(&kernel.words, kernel);
    });
    let different: Vec<&Translated> = different.into_values().collect();
    let compile = |kernel: &Translated| {
        // The last lines name the kernels whose compilation crashed the driver.
        eprintln!("compiling {}", kernel.name);
        card.compile(kernel).unwrap_or_else(|e| panic!("{}: {e}", kernel.name))
    };
    let pool = rayon::ThreadPoolBuilder::new().stack_size(COMPILER_STACK).build().unwrap();
    let figures: HashMap<&[u32], Figures> =
        pool.install(|| different.par_iter().map(|kernel| (kernel.words.as_slice(), compile(kernel))).collect());
    let row = |configuration: &str, kernel: &Translated| Row {
        configuration: configuration.to_owned(),
        kernel: kernel.name.to_owned(),
        figures: figures[kernel.words.as_slice()],
        reason: String::new(),
    };
    let rows = all.iter().flat_map(|(name, kernels)| kernels.iter().map(|kernel| row(name, kernel)));
    Outcome::Made(Table { driver: card.driver.clone(), rows: rows.collect() }, compile(&with_array()))
}

/// Runs this test as the compiling process, with the driver of `manifest`.
fn by_another_process(manifest: &Path) -> Outcome {
    let file = tempfile::NamedTempFile::new().unwrap();
    let mut command = Command::new(std::env::current_exe().unwrap());
    command.args(["--exact", "registers::no_kernel_needs_more_registers_than_before", "--nocapture"]);
    command.env(COMPILES, file.path()).env("RADV_FORCE_FAMILY", "navi21").env("NODEVICE_SELECT", "1");
    command.env("VK_DRIVER_FILES", manifest).env("VK_ICD_FILENAMES", manifest).env("MESA_SHADER_CACHE_DISABLE", "1");
    // Options of the driver and layers of the user would change the figures.
    ["RADV_DEBUG", "RADV_PERFTEST", "ACO_DEBUG", "VK_INSTANCE_LAYERS"].iter().for_each(|name| {
        command.env_remove(name);
    });
    let output = command.output().unwrap();
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{told}\nthe compiling process ended with {}", output.status);
    serde_json::from_slice(&std::fs::read(file.path()).unwrap()).unwrap_or_else(|e| panic!("{e}: {told}"))
}

/// Without the driver the test says so, and fails if `EPSPLAT_REQUIRE_RADV` is 1.
/// `EPSPLAT_REGISTERS` is the reason for which the table is made anew.
#[test]
fn no_kernel_needs_more_registers_than_before() {
    if let Some(file) = std::env::var_os(COMPILES) {
        std::fs::write(file, serde_json::to_vec(&compiled()).unwrap()).unwrap();
        return;
    }
    let outcome = manifest().map_or_else(
        || Outcome::Missing("Mesa's driver for Radeon cards is not installed".into()),
        |manifest| by_another_process(&manifest),
    );
    let (made, control) = match outcome {
        Outcome::Made(made, control) => (made, control),
        Outcome::Missing(why) if std::env::var("EPSPLAT_REQUIRE_RADV").is_ok_and(|v| v == "1") => {
            panic!("EPSPLAT_REQUIRE_RADV=1, but {why}")
        }
        Outcome::Missing(why) => {
            eprintln!("skipped: the registers of kernels are not compared, as {why}");
            return;
        }
    };
    // Control: the driver reports the memory of arrays that do not fit registers.
    assert!(control.scratch >= 64 * 4096, "{control:?}");
    assert!(made.rows.len() > 100, "{}", made.rows.len());
    let kept = Table::read(&std::fs::read_to_string(TABLE).unwrap());
    if let Ok(reason) = std::env::var("EPSPLAT_REGISTERS") {
        let reason = reason.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(reason.contains(' '), "EPSPLAT_REGISTERS says in words why the figures change");
        std::fs::write(TABLE, kept.renewed(&made, &reason).written()).unwrap();
        // The file leaves out the counts of instructions, which change with Mesa's version.
        for Row { configuration, kernel, figures, .. } in &made.rows {
            println!("{configuration}: {kernel}: {figures:?}");
        }
        return;
    }
    let faults = kept.faults(&made);
    assert!(
        faults.is_empty(),
        "{}\nThe table tests/golden/registers.txt is of {}, the new figures are of {}. \
         EPSPLAT_REGISTERS=\"REASON\" tests/run --test kernels registers:: makes it anew",
        faults.join("\n"),
        kept.driver,
        made.driver
    );
}
