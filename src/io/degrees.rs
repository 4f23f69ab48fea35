//! Detection of coordinates in degrees that would be drawn as if they were metres.

/// Heights that span at least this many times the horizontal extent are in another unit.
const TOO_HIGH: f64 = 50.0;

/// Longitudes and latitudes lie at least this many times their extent away from the origin; an
/// object around the origin does not.
const FAR: f64 = 3.0;

/// A sentence for the user if the bounding box looks like longitude and latitude in degrees with
/// heights in metres, or if the coordinate system says so (`geographic`).
pub(super) fn hint(name: &str, [min, max]: [[f64; 3]; 2], geographic: Option<bool>) -> Option<String> {
    let extent = [0, 1, 2].map(|axis| max[axis] - min[axis]);
    let wide = extent[0].max(extent[1]);
    let on_earth = |axis: usize, most: f64| min[axis] >= -most && max[axis] <= most;
    let in_range = on_earth(0, 180.0) && on_earth(1, 90.0) || on_earth(0, 90.0) && on_earth(1, 180.0);
    let reach = min[0].abs().max(min[1].abs());
    let by_values = wide > 0.0 && extent[2] >= TOO_HIGH * wide && reach >= FAR * wide && reach > 1.0;
    let is_finite = extent.iter().all(|extent| extent.is_finite());
    if !is_finite || !in_range || geographic == Some(false) || !(geographic == Some(true) || by_values) {
        return None;
    }
    let why = match geographic {
        Some(_) => "its coordinate system is in degrees",
        None => "its coordinates look like degrees of longitude and latitude",
    };
    Some(format!(
        "{name}: {why}, but its heights of {} to {} are drawn in the same unit: project it to metres first, for example \
         with `pdal translate` and --filter filters.reprojection",
        min[2], max[2]
    ))
}

/// The sentence of [`hint`] for the bounding box of the finite positions.
pub(super) fn hint_of(name: &str, positions: &[[f64; 3]], geographic: Option<bool>) -> Option<String> {
    let finite = || positions.iter().filter(|position| position.iter().all(|c| c.is_finite()));
    let all = |of: fn(f64, f64) -> f64, start: f64| {
        finite().fold([start; 3], |all, position| [0, 1, 2].map(|axis| of(all[axis], position[axis])))
    };
    hint(name, [all(f64::min, f64::INFINITY), all(f64::max, f64::NEG_INFINITY)], geographic)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn degrees_are_told_from_metres() {
        let hinted = |min, max, geographic| hint("a", [min, max], geographic).is_some();
        // A valley at 48 degrees north with either axis order, and regions of a degree.
        assert!(hinted([11.5, 48.1, 500.0], [11.51, 48.11, 520.0], None));
        assert!(hinted([48.1, 11.5, 500.0], [48.11, 11.51, 520.0], None));
        assert!(hinted([-71.2, -33.1, 0.0], [-70.1, -32.0, 3000.0], None));
        assert!(hinted([11.0, 48.0, 500.0], [12.0, 49.0, 500.0], Some(true)));
        // A room, a tower at the origin, a drill hole, a projected system, a scan in metres, NaN.
        assert!(!hinted([-3.0, -4.0, 0.0], [3.0, 4.0, 2.5], None));
        assert!(!hinted([-2.0, -2.0, 0.0], [2.0, 2.0, 200.0], None));
        assert!(!hinted([0.0, 0.0, -800.0], [0.3, 0.3, 0.0], None));
        assert!(!hinted([11.5, 48.1, 500.0], [11.51, 48.11, 520.0], Some(false)));
        assert!(!hinted([5e5, 5e6, 0.0], [5.1e5, 5.1e6, 100.0], None));
        assert!(!hinted([f64::NAN; 3], [1.0; 3], None));
    }
}
