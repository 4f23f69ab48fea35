//! Cases: groups of measurements that differ only in the configuration, and so can be compared.

use std::collections::{BTreeMap, BTreeSet};

use super::results::Measurement;
use super::text::{count, significant};

/// All configurations of one scene at one size.
pub(super) struct Case<'a> {
    /// The scene's name, and the size if the scene has several cases.
    pub title: String,
    /// Measurements in their original order.
    pub measurements: Vec<&'a Measurement>,
}

/// Groups measurements by scene, in the order of first occurrence.
pub(super) fn scenes(measurements: &[Measurement]) -> Vec<(&str, Vec<&Measurement>)> {
    let mut scenes: Vec<(&str, Vec<&Measurement>)> = Vec::new();
    for measurement in measurements {
        match scenes.iter_mut().find(|(scene, _)| *scene == measurement.scene) {
            Some((_, of_scene)) => of_scene.push(measurement),
            None => scenes.push((&measurement.scene, vec![measurement])),
        }
    }
    scenes
}

/// Surfels, width, height, and footprint in thousandths of a pixel.
type Size = (u64, u32, u32, u64);

/// Returns the cases of a study. A scene is one case, unless a configuration occurs in it more than
/// once. Then something about the scene was varied, and each of its values is a case.
pub(super) fn cases(measurements: &[Measurement]) -> Vec<Case<'_>> {
    scenes(measurements).iter().flat_map(|(scene, of_scene)| cases_of(scene, of_scene)).collect()
}

/// Returns the cases of one scene.
pub(super) fn cases_of<'a>(scene: &str, of_scene: &[&'a Measurement]) -> Vec<Case<'a>> {
    let keys: [fn(&Measurement) -> Size; 3] = [
        |_| (0, 0, 0, 0),
        |m| (m.surfels, m.width, m.height, 0),
        // The footprint comes last, because configurations may draw the same scene slightly larger
        // or smaller.
        |m| (m.surfels, m.width, m.height, (m.footprint_px * 1e3).round() as u64),
    ];
    let tell_apart = |key: &&fn(&Measurement) -> Size| {
        let mut seen = BTreeSet::new();
        of_scene.iter().all(|m| seen.insert((&m.config, key(m))))
    };
    let key = keys.iter().find(tell_apart).unwrap_or(&keys[2]);
    let mut groups: BTreeMap<Size, Vec<&Measurement>> = BTreeMap::new();
    for measurement in of_scene {
        groups.entry(key(measurement)).or_default().push(measurement);
    }
    let alone = groups.len() == 1;
    let title = |first: Option<&&Measurement>| match first {
        Some(first) if !alone => format!("{scene}, {}", extent(first)),
        _ => scene.to_owned(),
    };
    groups.into_values().map(|measurements| Case { title: title(measurements.first()), measurements }).collect()
}

/// Describes the size of a measurement.
pub(super) fn extent(m: &Measurement) -> String {
    let (surfels, radius) = (count(m.surfels), significant(m.footprint_px, 2));
    format!("{surfels} surfels of {radius} px, {} × {}", m.width, m.height)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_varies_within_a_scene_makes_cases() {
        let of = |scene: &str, config: &str, surfels: u64, footprint_px: f64| Measurement {
            scene: scene.into(),
            config: config.into(),
            surfels,
            footprint_px,
            ..Measurement::default()
        };
        let measurements = [
            of("plain", "a", 10, 1.0),
            of("plain", "b", 10, 2.0),
            of("swept", "a", 10, 1.0),
            of("swept", "b", 10, 1.5),
            of("swept", "a", 100, 1.0),
            of("fat", "a", 10, 1.0),
            of("fat", "a", 10, 2.0),
        ];
        let cases = cases(&measurements);
        let sizes: Vec<usize> = cases.iter().map(|case| case.measurements.len()).collect();
        assert_eq!(sizes, [2, 2, 1, 1, 1]);
        assert_eq!(cases[0].title, "plain");
        assert_eq!(cases[2].title, "swept, 100 surfels of 1.0 px, 0 × 0");
    }
}
