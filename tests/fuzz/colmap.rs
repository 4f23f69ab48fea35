//! Fuzzes COLMAP's binary models. An input is the length of `cameras.bin` (u32), `cameras.bin` and
//! `images.bin`.

use super::mutate::Grammar;
use super::random::Random;
use super::{Outcome, Target, cameras};
use std::path::Path;

pub const TARGET: Target = Target {
    name: "colmap",
    extension: "model",
    generate,
    grammar: Grammar { words: &["\0", "../", "/"], separators: b"\0", text: 1 << 10, numbers },
    execute,
};

/// Numbers of parameters by the number of a model.
const PARAMETERS: [usize; 11] = [3, 4, 4, 5, 8, 8, 12, 5, 4, 5, 12];

/// The counts, and all other numbers of a file whose names are whole words.
fn numbers(bytes: &[u8]) -> Vec<(usize, usize)> {
    let cameras = bytes.first_chunk().map_or(0, |length| u32::from_le_bytes(*length) as usize);
    let counts = [(0, 4), (4, 8), (cameras.saturating_add(4), 8)];
    let others = (0..bytes.len() / 4).flat_map(|word| [(4 * word, 4), (4 * word, 8)]);
    counts.into_iter().chain(others).filter(|(at, size)| at.saturating_add(*size) <= bytes.len()).collect()
}

/// A valid model of one to four images and as many cameras.
fn generate(random: &mut Random) -> (Vec<u8>, usize) {
    let count = 1 + random.below(4);
    let mut cameras = (count as u64).to_le_bytes().to_vec();
    let mut images = cameras.clone();
    for id in 0..count as u32 {
        let model = random.below(PARAMETERS.len());
        cameras.extend([id, model as u32].map(u32::to_le_bytes).as_flattened());
        cameras.extend([1 + random.below(99) as u64, 16].map(u64::to_le_bytes).as_flattened());
        // Coefficients of lenses follow the focal lengths and the principal point.
        for k in 0..PARAMETERS[model] {
            let value = if k < 4 { random.between(1.0, 50.0) } else { random.between(0.01, 0.5) };
            cameras.extend(value.to_le_bytes());
        }

        let turn = random.between(-3.0, 3.0);
        let pose = [turn.cos(), turn.sin(), 0.0, 0.0, random.between(-1.0, 1.0), 0.0, random.between(1.0, 5.0)];
        images.extend(id.to_le_bytes());
        pose.iter().for_each(|value| images.extend(value.to_le_bytes()));
        images.extend(id.to_le_bytes());
        // Names of seven characters and a zero keep the numbers aligned.
        images.extend(format!("s/{id}.png\0").bytes());
        let points = random.below(3);
        images.extend((points as u64).to_le_bytes());
        images.extend(vec![7; 24 * points]);
    }
    ([&(cameras.len() as u32).to_le_bytes()[..], &cameras, &images].concat(), 0)
}

fn execute(path: &Path, valid: Option<usize>) -> Result<Outcome, String> {
    let bytes = std::fs::read(path).map_err(|error| error.to_string())?;
    let (length, rest) = bytes.split_at(bytes.len().min(4));
    let length = length.first_chunk().map_or(0, |length| u32::from_le_bytes(*length) as usize);
    let (cameras, images) = rest.split_at(rest.len().min(length));
    let folder = path.with_extension("folder");
    std::fs::create_dir_all(&folder).map_err(|error| error.to_string())?;
    for (name, bytes) in [("cameras.bin", cameras), ("images.bin", images)] {
        let file = folder.join(name);
        let _ = std::fs::remove_file(&file);
        std::fs::write(&file, bytes).map_err(|error| error.to_string())?;
    }
    cameras::read(&folder, &folder, valid)
}
