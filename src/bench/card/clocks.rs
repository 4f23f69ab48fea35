//! Readings of a card's clocks, temperature and power, from its driver's tools.
//!
//! A card lowers its clocks when it idles, so a time means little without them. NVIDIA's driver
//! reports them by `nvidia-smi`, AMD's by files of the system. No reading is needed for a run:
//! where there is none, the record says that the clocks are not known.

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use serde::Serialize;

use crate::gpu::AdapterDescription;

/// The values that are asked of `nvidia-smi`, after the card's name.
const QUERY: &str = "--query-gpu=name,clocks.sm,clocks.mem,temperature.gpu,power.draw";

/// Time after which an answer of `nvidia-smi` is not awaited any more.
const PATIENCE: Duration = Duration::from_secs(5);

/// The folder of the system's graphics devices.
const DEVICES: &str = "/sys/class/drm";

/// AMD's vendor number, as the system writes it.
const AMD: &str = "0x1002";

/// The clocks of a card at one time. Values that its driver does not report are `None`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Clocks {
    /// When they were read: `before` or `after` a part of the run.
    pub when: String,
    /// The source: `nvidia-smi`, `sysfs` or `not known`.
    pub source: &'static str,
    /// Clock of the multiprocessors, MHz.
    pub core_mhz: Option<f64>,
    /// Clock of the memory, MHz.
    pub memory_mhz: Option<f64>,
    /// Temperature, degrees Celsius.
    pub celsius: Option<f64>,
    /// Power, watts.
    pub watts: Option<f64>,
}

impl Clocks {
    /// Reads the clocks of the card of `adapter`; `when` says which part of a run it is.
    pub fn read(adapter: &AdapterDescription, when: String) -> Self {
        let unknown = Self { when, source: "not known", core_mhz: None, memory_mhz: None, celsius: None, watts: None };
        if adapter.is_software() {
            return unknown;
        }
        let by_tool = answer().and_then(|answer| of_nvidia(&answer, &adapter.name));
        let by_files = || of_amd(Path::new(DEVICES));
        let found = by_tool.map(|values| ("nvidia-smi", values)).or_else(|| by_files().map(|values| ("sysfs", values)));
        found.map_or(unknown.clone(), |(source, [core_mhz, memory_mhz, celsius, watts])| Self {
            source,
            core_mhz,
            memory_mhz,
            celsius,
            watts,
            ..unknown
        })
    }
}

/// Core and memory clock, temperature and power, in the units of [`Clocks`].
type Values = [Option<f64>; 4];

/// Returns what `nvidia-smi` prints; `None` if it is missing, fails or does not end.
fn answer() -> Option<String> {
    let mut command = Command::new("nvidia-smi");
    command.args([QUERY, "--format=csv,noheader,nounits"]);
    let mut child = command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::null()).spawn().ok()?;
    let start = Instant::now();
    // The few lines of the answer fit into the pipe, so the tool does not wait for a reader.
    while child.try_wait().ok()?.is_none() {
        if start.elapsed() > PATIENCE {
            let _ = child.kill();
            let _ = child.wait();
            return None;
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    let output = child.wait_with_output().ok()?;
    output.status.success().then(|| String::from_utf8_lossy(&output.stdout).into_owned())
}

/// Returns the values of the first card called `name` in an answer of `nvidia-smi`.
fn of_nvidia(answer: &str, name: &str) -> Option<Values> {
    let rows = answer.lines().filter_map(|line| line.split_once(','));
    let (_, values) = rows.into_iter().find(|(own, _)| name.contains(own.trim()) || own.contains(name))?;
    let mut values = values.split(',').map(|value| value.trim().parse().ok());
    Some(std::array::from_fn(|_| values.next().flatten()))
}

/// Returns the values of the first AMD card among the `devices` of the system.
fn of_amd(devices: &Path) -> Option<Values> {
    let folders = std::fs::read_dir(devices).ok()?.filter_map(|entry| Some(entry.ok()?.path().join("device")));
    let mut folders: Vec<_> = folders.collect();
    folders.sort();
    let text = |path: &Path| std::fs::read_to_string(path).ok();
    folders.iter().find_map(|folder| {
        text(&folder.join("vendor")).filter(|vendor| vendor.trim() == AMD)?;
        let core = current(&text(&folder.join("pp_dpm_sclk"))?);
        let memory = text(&folder.join("pp_dpm_mclk")).and_then(|states| current(&states));
        let sensors = std::fs::read_dir(folder.join("hwmon")).ok().and_then(|mut all| all.next()?.ok());
        let sensor = |name: &str| text(&sensors.as_ref()?.path().join(name))?.trim().parse::<f64>().ok();
        Some([core, memory, sensor("temp1_input").map(|t| t * 1e-3), sensor("power1_average").map(|p| p * 1e-6)])
    })
}

/// Returns the clock in MHz of the marked line among lines such as `1: 1500Mhz *`.
fn current(states: &str) -> Option<f64> {
    let marked = states.lines().find(|line| line.trim_end().ends_with('*'))?;
    let value = marked.split_once(':')?.1.trim();
    value.split(|c: char| !c.is_ascii_digit() && c != '.').next()?.parse().ok()
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn the_row_of_the_card_is_read_and_missing_values_stay_out() {
        let answer = "NVIDIA A2, 210, 405, 30, 8.12\nNVIDIA H200, 1980, 3201, 41, 123.45\n";
        assert_eq!(of_nvidia(answer, "NVIDIA H200"), Some([Some(1980.0), Some(3201.0), Some(41.0), Some(123.45)]));
        assert_eq!(of_nvidia(answer, "AMD Radeon"), None);
        let partly = "NVIDIA GeForce 940M, 135, 405, 40, [N/A]\n";
        assert_eq!(of_nvidia(partly, "NVIDIA GeForce 940M").unwrap()[3], None);
        assert_eq!(of_nvidia("", "NVIDIA H200"), None);
    }

    #[test]
    fn the_marked_state_of_an_amd_card_is_its_clock() {
        let folder = std::env::temp_dir().join(format!("epsplat-clocks-{}", std::process::id()));
        let file = |name: &str, text: &str| {
            let path = folder.join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, text).unwrap();
        };
        assert_eq!(of_amd(&folder), None);
        file("card0/device/vendor", "0x10de\n");
        file("card0/device/pp_dpm_sclk", "0: 1Mhz *\n");
        file("card1/device/vendor", "0x1002\n");
        assert_eq!(of_amd(&folder), None);
        file("card1/device/pp_dpm_sclk", "0: 500Mhz\n1: 2475Mhz *\n");
        file("card1/device/hwmon/hwmon3/power1_average", "87000000\n");
        assert_eq!(of_amd(&folder), Some([Some(2475.0), None, None, Some(87.0)]));
        std::fs::remove_dir_all(&folder).unwrap();
        assert_eq!(current("0: 500Mhz\n"), None);
    }

    #[test]
    fn a_processor_has_no_clocks_of_a_card() {
        let software = AdapterDescription { kind: "software", ..AdapterDescription::core() };
        let clocks = Clocks::read(&software, "before".into());
        assert_eq!((clocks.source, clocks.core_mhz), ("not known", None));
    }
}
