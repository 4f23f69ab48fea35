//! The table of figures, `tests/golden/registers.txt`, and what is wrong with new ones.

use std::fmt::Write;

use serde::{Deserialize, Serialize};

use super::card::Figures;

/// Registers are allocated in multiples of this number.
const GRANULE: u64 = 8;

/// Registers of a SIMD, for subgroups of 64 lanes. The driver's number of waves is twice this
/// number divided by a kernel's registers and rounded down, or less if workgroup memory limits it.
const OF_SIMD: u64 = 512;

/// The first lines of the file.
const HEAD: &str = r#"# Registers of the kernels on a Radeon RX 6800 (RDNA 2), as Mesa's compiler allocates them; see
# CONTRIBUTING.md. VGPRs: vector registers per lane. waves: twice the most subgroups of 64 lanes
# that a SIMD holds at a time, so at most 32. scratch: bytes of memory per subgroup. spills:
# registers moved to memory or to other registers. No figure may get worse.
# EPSPLAT_REGISTERS="REASON" tests/run --test kernels registers:: makes the table anew. A row that
# got worse, or has scratch or spills, ends with its reason.
"#;

/// A kernel of a configuration.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Row {
    pub configuration: String,
    pub kernel: String,
    pub figures: Figures,
    /// Why the figures got worse, or are not 0.
    pub reason: String,
}

/// The figures of all kernels, and the driver that gave them.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Table {
    pub driver: String,
    pub rows: Vec<Row>,
}

impl Row {
    fn is(&self, other: &Self) -> bool {
        self.configuration == other.configuration && self.kernel == other.kernel
    }

    fn needs_reason(&self) -> bool {
        self.figures.scratch > 0 || self.figures.spills > 0
    }

    fn told(&self) -> String {
        let Figures { vgprs, waves, scratch, spills, .. } = self.figures;
        let reason = if self.reason.is_empty() { String::new() } else { format!("  {}", self.reason) };
        format!("{:28} {vgprs:5} {waves:5} {scratch:7} {spills:6}{reason}", self.kernel)
    }
}

impl Table {
    /// Reads the file. It has no counts of instructions.
    pub fn read(text: &str) -> Self {
        let mut table = Self::default();
        let mut configuration = "";
        for line in text.lines().filter(|line| !line.is_empty() && !line.starts_with('#')) {
            if let Some(driver) = line.strip_prefix("driver: ") {
                table.driver = driver.to_owned();
                continue;
            }
            if let Some(name) = line.strip_prefix('[') {
                configuration = name.trim_end_matches(']');
                continue;
            }
            let words: Vec<&str> = line.split_whitespace().collect();
            let figure = |place: usize| words[place].parse().unwrap_or_else(|e| panic!("{line}: {e}"));
            let figures =
                Figures { vgprs: figure(1), waves: figure(2), scratch: figure(3), spills: figure(4), instructions: 0 };
            let (configuration, kernel) = (configuration.to_owned(), words[0].to_owned());
            table.rows.push(Row { configuration, kernel, figures, reason: words[5..].join(" ") });
        }
        table
    }

    /// Formats the file.
    pub fn written(&self) -> String {
        let mut text = format!("{HEAD}driver: {}\n", self.driver);
        let mut configuration = "";
        for row in &self.rows {
            if row.configuration != configuration {
                configuration = &row.configuration;
                let head = format!("\n[{configuration}]\n# kernel{:21} VGPRs waves scratch spills  reason", "");
                writeln!(text, "{head}").unwrap();
            }
            writeln!(text, "{}", row.told()).unwrap();
        }
        text
    }

    /// Returns the table of `made`, with the reasons of this one where they still hold, and
    /// `reason` for rows that got worse or are new and have scratch or spills.
    pub fn renewed(&self, made: &Self, reason: &str) -> Self {
        let of = |new: &Row| {
            let old = self.rows.iter().find(|old| old.is(new));
            let worse = old.map_or(new.needs_reason(), |old| !worse(old, new, false).is_empty());
            let better = old.is_some_and(|old| !better(old, new).is_empty());
            let kept = old.filter(|_| !better || new.needs_reason()).map_or("", |old| old.reason.as_str());
            let unexplained = new.needs_reason() && kept.is_empty();
            Row { reason: if worse || unexplained { reason } else { kept }.to_owned(), ..new.clone() }
        };
        Self { driver: made.driver.clone(), rows: made.rows.iter().map(of).collect() }
    }

    /// Lists what is wrong with `made`: rows that got worse or much better, and kernels that one of
    /// the tables lacks.
    ///
    /// Another driver than that of this table may use a granule of registers more, and other
    /// scratch and spills where there are some; rows that got better are not listed then.
    pub fn faults(&self, made: &Self) -> Vec<String> {
        let slack = self.driver != made.driver;
        let mut faults = Vec::new();
        for new in &made.rows {
            let place = format!("{} of {:?}", new.kernel, new.configuration);
            let Some(old) = self.rows.iter().find(|old| old.is(new)) else {
                faults.push(format!("{place} has no row"));
                continue;
            };
            let worse = worse(old, new, slack);
            let better = if slack { Vec::new() } else { better(old, new) };
            faults.extend(worse.iter().map(|what| format!("{place} needs more: {what}")));
            faults.extend(better.iter().map(|what| format!("{place} needs less, so its row is too large: {what}")));
        }
        for old in self.rows.iter().filter(|old| !made.rows.iter().any(|new| new.is(old))) {
            faults.push(format!("{} of {:?} is no kernel any more", old.kernel, old.configuration));
        }
        for old in self.rows.iter().filter(|old| old.needs_reason() && old.reason.is_empty()) {
            faults.push(format!("{} of {:?} has scratch or spills, and no reason", old.kernel, old.configuration));
        }
        faults
    }
}

fn changed(name: &str, old: u64, new: u64) -> String {
    format!("{name} {old} before, {new} now")
}

/// The figures of `new` that are worse than those of `old`. With `slack`, registers may be a
/// granule more, waves as few as that leaves, and scratch and spills other where there are some.
fn worse(old: &Row, new: &Row, slack: bool) -> Vec<String> {
    let (old, new) = (old.figures, new.figures);
    let most = old.vgprs + if slack { GRANULE } else { 0 };
    let fewest = if slack { old.waves.min(OF_SIMD / most * 2) } else { old.waves };
    let moved = |old: u64, new: u64| new > old && !(slack && old > 0);
    let all = [
        (new.vgprs > most, "VGPRs", old.vgprs, new.vgprs),
        (new.waves < fewest, "waves", old.waves, new.waves),
        (moved(old.scratch, new.scratch), "scratch", old.scratch, new.scratch),
        (moved(old.spills, new.spills), "spills", old.spills, new.spills),
    ];
    all.into_iter().filter(|(is, ..)| *is).map(|(_, name, old, new)| changed(name, old, new)).collect()
}

/// The figures of `new` that are well below those of `old`.
fn better(old: &Row, new: &Row) -> Vec<String> {
    let (old, new) = (old.figures, new.figures);
    let all = [
        (new.vgprs + GRANULE <= old.vgprs, "VGPRs", old.vgprs, new.vgprs),
        (new.waves > old.waves, "waves", old.waves, new.waves),
        (new.scratch < old.scratch, "scratch", old.scratch, new.scratch),
        (new.spills < old.spills, "spills", old.spills, new.spills),
    ];
    all.into_iter().filter(|(is, ..)| *is).map(|(_, name, old, new)| changed(name, old, new)).collect()
}

mod tests {
    use super::*;

    fn row(kernel: &str, figures: [u64; 4]) -> Row {
        let [vgprs, waves, scratch, spills] = figures;
        let reason = if scratch > 0 { "sums of many pixels".to_owned() } else { String::new() };
        let figures = Figures { vgprs, waves, scratch, spills, instructions: 0 };
        Row { configuration: "by tiles".to_owned(), kernel: kernel.to_owned(), figures, reason }
    }

    /// The table of a kernel without scratch and of one with it.
    fn table(driver: &str, plain: [u64; 4], full: [u64; 4]) -> Table {
        Table { driver: driver.to_owned(), rows: vec![row("project", plain), row("tile_resolve", full)] }
    }

    const PLAIN: [u64; 4] = [96, 10, 0, 0];
    const FULL: [u64; 4] = [256, 4, 1024, 30];

    #[test]
    fn a_table_is_read_as_it_was_written() {
        let kept = table("Mesa 1", PLAIN, FULL);
        assert_eq!(Table::read(&kept.written()), kept);
    }

    #[test]
    fn what_gets_worse_or_better_is_told_with_both_figures() {
        let kept = table("Mesa 1", PLAIN, FULL);
        let faults = |plain, full| kept.faults(&table("Mesa 1", plain, full));
        assert!(faults(PLAIN, FULL).is_empty());
        for (plain, full, told) in [
            ([104, 10, 0, 0], FULL, "project of \"by tiles\" needs more: VGPRs 96 before, 104 now"),
            ([96, 8, 0, 0], FULL, "project of \"by tiles\" needs more: waves 10 before, 8 now"),
            ([96, 10, 64, 0], FULL, "project of \"by tiles\" needs more: scratch 0 before, 64 now"),
            (PLAIN, [256, 4, 1024, 31], "tile_resolve of \"by tiles\" needs more: spills 30 before, 31 now"),
            (
                [88, 10, 0, 0],
                FULL,
                "project of \"by tiles\" needs less, so its row is too large: VGPRs 96 before, 88 now",
            ),
            (
                PLAIN,
                [256, 4, 512, 30],
                "tile_resolve of \"by tiles\" needs less, so its row is too large: scratch 1024 before, 512 now",
            ),
        ] {
            assert_eq!(faults(plain, full), [told]);
        }
        let mut fewer = kept.clone();
        fewer.rows.pop();
        assert_eq!(kept.faults(&fewer), ["tile_resolve of \"by tiles\" is no kernel any more"]);
        assert_eq!(fewer.faults(&kept), ["tile_resolve of \"by tiles\" has no row"]);
        let mut silent = kept.clone();
        silent.rows[1].reason.clear();
        assert_eq!(silent.faults(&kept), ["tile_resolve of \"by tiles\" has scratch or spills, and no reason"]);
    }

    #[test]
    fn another_driver_has_a_granule_of_registers_to_spare() {
        let kept = table("Mesa 1", PLAIN, FULL);
        let count = |plain, full| kept.faults(&table("Mesa 2", plain, full)).len();
        assert_eq!(count([104, 8, 0, 0], [256, 4, 2048, 60]), 0);
        assert_eq!(count([64, 16, 0, 0], [200, 4, 0, 0]), 0);
        assert_eq!(count([112, 8, 0, 0], FULL), 1);
        assert_eq!(count([104, 6, 0, 0], FULL), 1);
        assert_eq!(count([96, 10, 64, 1], FULL), 2);
    }

    #[test]
    fn only_rows_that_got_worse_take_the_new_reason() {
        let kept = table("Mesa 1", PLAIN, FULL);
        let reasons = |plain, full| {
            let made = table("Mesa 1", plain, full);
            let renewed = kept.renewed(&made, "wider sums");
            assert!(renewed.faults(&made).is_empty());
            [0, 1].map(|place: usize| renewed.rows[place].reason.clone())
        };
        assert_eq!(reasons(PLAIN, FULL), ["", "sums of many pixels"]);
        assert_eq!(reasons([104, 8, 0, 0], FULL), ["wider sums", "sums of many pixels"]);
        assert_eq!(reasons(PLAIN, [256, 4, 1024, 31]), ["", "wider sums"]);
        assert_eq!(reasons(PLAIN, [256, 4, 512, 30]), ["", "sums of many pixels"]);
        assert_eq!(reasons(PLAIN, [200, 4, 0, 0]), ["", ""]);
        let first = Table::default().renewed(&kept, "new kernels");
        assert_eq!(first.rows.iter().map(|row| row.reason.as_str()).collect::<Vec<_>>(), ["", "new kernels"]);
    }
}
