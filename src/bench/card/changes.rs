//! The changes of the hot path that a card is tried with, each alone against the default.
//!
//! An optimisation is a row because it is in [`Optimisation::ALL`]. A new option is a row in
//! [`all`]. Kernel files are replaced without a build by the configurations of a study that the
//! command names (`sources`).

use crate::bench::Definition;
use crate::error::{Error, Result};
use crate::plan::{BackendName, Fetch, Optimisation, Organisation, Settings, check};

/// Thresholds of large splats that are tried with tiles, pixels; 256 is the default.
const LARGE_BY_TILES: [u32; 4] = [64, 128, 512, 1024];

/// Thresholds of large splats that are tried with workgroups, pixels; 1,024 is the default.
const LARGE_BY_WORKGROUPS: [u32; 3] = [64, 256, 4096];

/// Numbers of frames in flight.
const IN_FLIGHT: [usize; 3] = [1, 2, 3];

/// A change of the default, which changes no bit of the image.
#[derive(Clone, Debug)]
pub(super) struct Change {
    /// The name, in the words of the command line.
    pub name: String,
    /// The difference from the default.
    pub by: By,
    /// Whether quick runs try it too: they try each kind of change once.
    pub quick: bool,
}

/// The difference from frames of the default settings that the caller waits for.
#[derive(Clone, Debug)]
pub(super) enum By {
    /// The settings.
    Settings(Box<Settings>),
    /// The number of frames in flight, none of which is read back.
    InFlight(usize),
}

fn with(name: impl Into<String>, settings: Settings) -> Change {
    Change { name: name.into(), by: By::Settings(Box::new(settings)), quick: true }
}

fn in_full(change: Change) -> Change {
    Change { quick: false, ..change }
}

fn organised(organisation: Organisation) -> Settings {
    Settings { organisation, ..Settings::default() }
}

fn without(optimisation: Optimisation, name: &str) -> Change {
    with(format!("without {name}"), Settings { without: vec![optimisation], ..Settings::default() })
}

/// Every change of the hot path.
pub(super) fn all() -> Vec<Change> {
    let each = Optimisation::ALL.iter();
    let mut all: Vec<Change> = each.map(|(optimisation, name)| without(*optimisation, name)).collect();
    all.extend([with("scatter", organised(Organisation::Scatter)), with("tile", organised(Organisation::Tile))]);
    for (fetch, name) in Fetch::ALL {
        all.push(with(format!("fetch {name}"), Settings { fetch: Some(fetch), ..Settings::default() }));
        let tile = Settings { fetch: Some(fetch), large: Some(256), ..organised(Organisation::Tile) };
        all.push(in_full(with(format!("tile, large 256, fetch {name}"), tile)));
    }
    let large = |pixels: u32, settings| Settings { large: Some(pixels), ..settings };
    let tiles = LARGE_BY_TILES.map(|pixels| with(format!("large {pixels}"), large(pixels, Settings::default())));
    let scatter = |pixels| with(format!("scatter, large {pixels}"), large(pixels, organised(Organisation::Scatter)));
    for thresholds in [tiles.to_vec(), LARGE_BY_WORKGROUPS.map(scatter).to_vec()] {
        let numbered = thresholds.into_iter().enumerate();
        all.extend(numbered.map(|(number, change)| Change { quick: number == 0, ..change }));
    }
    let flies = |depth| Change { name: format!("{depth} in flight"), by: By::InFlight(depth), quick: true };
    all.extend(IN_FLIGHT.map(flies));
    all
}

/// The changes that every record of a card has: order, culling and organisation.
pub(super) fn usual() -> Vec<Change> {
    let named = [Optimisation::Order, Optimisation::Culling];
    let rows = Optimisation::ALL.iter().filter(|(optimisation, _)| named.contains(optimisation));
    let rows = rows.map(|(optimisation, name)| without(*optimisation, name));
    rows.chain([with("scatter", organised(Organisation::Scatter)), with("tile", organised(Organisation::Tile))])
        .collect()
}

/// The configurations of `studies`, as changes. Their scenes are not used.
///
/// # Errors
/// [`Error::Usage`] if a configuration is not of the backend gpu, or is refused.
pub(super) fn of_studies(studies: &[Definition]) -> Result<Vec<Change>> {
    let of = |study: &Definition| {
        let one = |config: &crate::bench::config::Config| {
            if config.backend != BackendName::Gpu {
                let name = &config.name;
                return Err(Error::Usage(format!(
                    "{name:?} is no change of the hot path: take the backend gpu for it"
                )));
            }
            let settings = config.settings(None);
            check::options(&settings, false)?;
            Ok(with(format!("{}, {}", study.name, config.name), settings))
        };
        study.configs.iter().map(one).collect::<Result<Vec<_>>>()
    };
    Ok(studies.iter().map(of).collect::<Result<Vec<_>>>()?.concat())
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;
    use std::path::Path;

    #[test]
    fn each_optimisation_fetch_and_threshold_is_a_change_that_no_option_refuses() {
        let all = all();
        let names: BTreeSet<&str> = all.iter().map(|change| change.name.as_str()).collect();
        assert_eq!(names.len(), all.len());
        for (_, name) in Optimisation::ALL {
            assert!(names.contains(&*format!("without {name}")), "{name}");
        }
        for name in ["scatter", "tile", "fetch staged", "large 512", "scatter, large 256", "3 in flight"] {
            assert!(names.contains(name), "{name}");
        }
        for change in all.iter().chain(&usual()) {
            if let By::Settings(settings) = &change.by {
                check::options(settings, false).unwrap();
                assert!(**settings != Settings::default(), "{}", change.name);
            }
        }
        assert_eq!(usual().len(), 4);
    }

    #[test]
    fn configurations_of_a_study_are_changes() {
        let text = |backend: &str| {
            format!(
                "name = \"mine\"\nabout = \"a\"\n[[scene]]\nname = \"s\"\nshape = \"sphere\"\ncount = 9\n\
                 [[config]]\nname = \"other kernel\"\nbackend = \"{backend}\"\nlarge = 32\n"
            )
        };
        let study = Definition::parse(&text("gpu"), Path::new("x.toml")).unwrap();
        let [change] = &of_studies(&[study]).unwrap()[..] else { unreachable!() };
        assert_eq!(change.name, "mine, other kernel");
        assert!(matches!(&change.by, By::Settings(settings) if settings.large == Some(32)));
        let raster = Definition::parse(&text("raster").replace("large = 32\n", ""), Path::new("x.toml")).unwrap();
        assert!(of_studies(&[raster]).unwrap_err().to_string().contains("hot path"));
    }
}
