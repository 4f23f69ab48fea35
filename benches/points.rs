//! Times surfels from points, stage by stage: `cargo bench --bench points [-- COUNT...]`.
//!
//! Without counts it measures 1,000,000 points.

#![allow(missing_docs, clippy::unwrap_used)]

use std::sync::Mutex;
use std::time::Instant;

use epsplat::Progress;
use epsplat::io::Points;
use epsplat::low_level::surfels::analytic::{Shape, generate};
use epsplat::low_level::surfels::{FromPoints, Size, from_points};

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

fn main() {
    let mut counts: Vec<u64> = std::env::args().filter_map(|argument| argument.parse().ok()).collect();
    if counts.is_empty() {
        counts.push(1_000_000);
    }
    for count in counts {
        let positions = shuffled(count);
        for (size, name) in Size::ALL {
            let parts = Parts::default();
            let points = Points { positions: positions.clone(), ..Points::default() };
            let start = Instant::now();
            let surfels = from_points(vec![points], &FromPoints { size, ..FromPoints::default() }, &parts).unwrap();
            let total = start.elapsed().as_secs_f64();
            assert_eq!(surfels.preparation.surfels, count);
            println!("{count} points, {name}: {total:.2} s, {:.0} points/s", count as f64 / total);
            for (what, seconds) in parts.done.into_inner().unwrap() {
                println!("  {what:24} {seconds:7.3} s {:12.0} points/s", count as f64 / seconds);
            }
        }
        println!("peak memory so far: {}", peak_memory());
    }
}
