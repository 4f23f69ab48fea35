//! Times surfels from points, stage by stage: `cargo bench --bench points [-- COUNT... | NAME...]`.
//!
//! `picture` is the way to a picture of bare points; the other names are those of the sizes of
//! `epsplat surfels`. Without counts it measures 1,000,000 points, without names all of them.

#![allow(missing_docs, clippy::unwrap_used)]

use std::sync::Mutex;
use std::time::Instant;

use epsplat::Progress;
use epsplat::io::Points;
use epsplat::low_level::surfels::analytic::{Shape, generate};
use epsplat::low_level::surfels::{FromPoints, Size, build, from_points};

/// The time of each stage, in seconds.
#[derive(Default)]
struct Parts {
    running: Mutex<Vec<(String, Instant)>>,
    done: Mutex<Vec<(String, f64)>>,
}

impl Progress for Parts {
    fn begin(&self, what: &str, _units: u64) {
        self.running.lock().unwrap().push((what.to_owned(), Instant::now()));
    }

    fn advance(&self, _units: u64) {}

    fn end(&self) {
        if let Some((what, start)) = self.running.lock().unwrap().pop() {
            self.done.lock().unwrap().push((what, start.elapsed().as_secs_f64()));
        }
    }
}

/// Points of a torus in random order, the worst case for caches.
fn shuffled(count: u64) -> Vec<[f64; 3]> {
    let mut positions: Vec<_> = generate(Shape::Torus, count).map(|sample| sample.position).collect();
    let mut state = 1u64;
    for i in (1..positions.len()).rev() {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        positions.swap(i, (state >> 33) as usize % (i + 1));
    }
    positions
}

/// The peak memory of this process, if the system reports it.
fn peak_memory() -> String {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    line.map_or("not known".into(), |line| line.trim().to_owned())
}

/// Makes surfels of bare points for a picture, or of this size; returns their number.
fn surfels(name: &str, positions: &[[f64; 3]], parts: &Parts) -> (u64, f64) {
    let points = Points { positions: positions.to_vec(), ..Points::default() };
    let start = Instant::now();
    let made = match Size::ALL.iter().find(|(_, known)| *known == name) {
        Some((size, _)) => {
            let options = FromPoints { size: *size, ..FromPoints::default() };
            from_points(vec![points], &options, parts).unwrap().preparation.surfels
        }
        None => build(vec![points], parts).unwrap().1.surfels,
    };
    (made, start.elapsed().as_secs_f64())
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let mut counts: Vec<u64> = arguments.iter().filter_map(|argument| argument.parse().ok()).collect();
    if counts.is_empty() {
        counts.push(1_000_000);
    }
    let all = std::iter::once("picture").chain(Size::ALL.map(|(_, name)| name));
    let named: Vec<&str> = all.clone().filter(|name| arguments.iter().any(|argument| argument == name)).collect();
    let names = if named.is_empty() { all.collect() } else { named };
    for count in counts {
        let positions = shuffled(count);
        for name in &names {
            let parts = Parts::default();
            let (made, total) = surfels(name, &positions, &parts);
            assert_eq!(made, count);
            println!("{count} points, {name}: {total:.2} s, {:.0} points/s", count as f64 / total);
            for (what, seconds) in parts.done.into_inner().unwrap() {
                println!("  {what:24} {seconds:7.3} s {:12.0} points/s", count as f64 / seconds);
            }
        }
        println!("peak memory so far: {}", peak_memory());
    }
}
