//! Reads and validates a study from a TOML file; an error names the file and the key.

use std::collections::BTreeSet;
use std::path::Path;

use super::config::Config;
use super::definition::{Definition, Making, OneOrMany, Rims, SceneEntry};
use crate::error::{Error, Result};
use crate::io::Format;
use crate::io::input::text;
use crate::plan::check;
use crate::scene::camera::check_size;
use crate::scene::{Detail, Shading};

impl Definition {
    /// Reads the definition at `path`.
    ///
    /// # Errors
    ///
    /// [`Error::Read`] if the file cannot be read, [`Error::Malformed`] if it does not define a
    /// study; the message names the key.
    pub fn read(path: &Path) -> Result<Self> {
        let text = text(path)?;
        Self::parse(&text, path)
    }

    /// Parses a definition; `path` is its file, for messages and for the paths in it.
    ///
    /// # Errors
    ///
    /// [`Error::Malformed`], as for [`read`](Self::read).
    pub fn parse(text: &str, path: &Path) -> Result<Self> {
        let mut definition: Self = toml::from_str(text).map_err(|e| Error::malformed(path, located(text, &e)))?;
        definition.folder = path.parent().unwrap_or(Path::new("")).to_owned();
        for config in &mut definition.configs {
            let sources = std::mem::take(&mut config.options.research.sources);
            config.options.research.sources =
                sources.into_iter().map(|source| source.within(&definition.folder)).collect();
        }
        definition.check().map_err(|what| Error::malformed(path, what))?;
        Ok(definition)
    }

    /// Checks the rules that the types of the TOML keys do not express.
    fn check(&self) -> Result<(), String> {
        sized("size", Some(self.size))?;
        sized("quick.size", self.quick.size)?;
        within("runs", self.runs, MOST_RUNS)?;
        within("quick.runs", self.quick.runs.unwrap_or(1), MOST_RUNS)?;
        within("rays", self.rays, MOST_RAYS)?;
        unique("scene", self.scenes.iter().map(|scene| (&scene.name, scene.quick)))?;
        let configs = unique("config", self.configs.iter().map(|config| (&config.name, config.quick)))?;
        if let Some(baseline) = self.baseline.as_ref().filter(|name| !configs.contains(name)) {
            return Err(format!("baseline: there is no config {baseline:?}"));
        }
        for scene in &self.scenes {
            scene.check().map_err(|what| format!("scene {:?}: {what}", scene.name))?;
            if let Some(name) = scene.configs.iter().flatten().find(|name| !configs.contains(name)) {
                return Err(format!("scene {:?}: configs: there is no config {name:?}", scene.name));
            }
            let sized =
                |config: &&Config| config.cuts() && !matches!(config.options.levels.lod, Some(Detail::Splats(_)));
            let other = self.configs_of(scene).find(|config| scene.surfels == Making::Levels && !sized(config));
            if let Some(config) = other {
                let (scene, config) = (&scene.name, &config.name);
                return Err(format!(
                    "scene {scene:?}: surfels: a file that is read in parts is drawn in cuts of a given size: give config {config:?} a lod size above 0"
                ));
            }
        }
        for config in &self.configs {
            config.check().map_err(|what| format!("config {:?}: {what}", config.name))?;
            if let Some(name) = config.approximates.as_ref().filter(|name| !configs.contains(name)) {
                return Err(format!("config {:?}: approximates: there is no config {name:?}", config.name));
            }
        }
        Ok(())
    }
}

/// Returns the names; fails if two are equal or none belongs to a quick run.
fn unique<'a>(table: &str, names: impl Iterator<Item = (&'a String, bool)>) -> Result<BTreeSet<&'a String>, String> {
    let (mut seen, mut quick) = (BTreeSet::new(), false);
    for (name, of_quick) in names {
        if !seen.insert(name) {
            return Err(format!("{table}: two are called {name:?}: rename one"));
        }
        quick |= of_quick;
    }
    if quick { Ok(seen) } else { Err(format!("{table}: a study needs at least one [[{table}]] without quick = false")) }
}

fn sized(key: &str, size: Option<[u32; 2]>) -> Result<(), String> {
    size.map_or(Ok(()), |[width, height]| check_size(width, height).map_err(|e| format!("{key}: {e}")))
}

/// Upper limits of timed runs (also for `epsplat bench --runs`), cameras of a scene, and rays
/// across a pixel: their times and frames are held in memory.
const MOST_RUNS: u32 = 10_000;
const MOST_VIEWS: u32 = 1000;
const MOST_RAYS: u32 = 256;

fn within(key: &str, value: u32, most: u32) -> Result<(), String> {
    if (1..=most).contains(&value) { Ok(()) } else { Err(format!("{key}: it is 1 to {most}, not {value}")) }
}

fn positive(key: &str, value: Option<f64>) -> Result<(), String> {
    match value {
        Some(value) if !(value.is_finite() && value > 0.0) => Err(format!("{key}: it must be positive, not {value}")),
        _ => Ok(()),
    }
}

fn not_beside(key: &str, given: bool, other: &str) -> Result<(), String> {
    if given { Err(format!("{key}: it cannot be combined with {other}")) } else { Ok(()) }
}

impl SceneEntry {
    fn check(&self) -> Result<(), String> {
        self.check_source()?;
        self.check_sweeps()?;
        let placed = self.surfels.samples() && self.surfels != Making::Hybrid;
        if self.lookup && (self.texture.is_none() || !placed) {
            return Err("lookup: it needs a texture and surfels that are samples with texture coordinates".into());
        }
        if self.texture.is_some() && !self.surfels.samples() && !self.truth {
            return Err("texture: it needs a mesh that is sampled, or truth = true".into());
        }
        let stratified = [Making::Sample, Making::Projected, Making::Caps, Making::Scanned];
        if self.priority.is_some() && !(stratified.contains(&self.surfels) && self.file.is_some()) {
            return Err("priority: it needs a mesh file and surfels = sample, projected, caps or scanned".into());
        }
        if self.simplify.is_some() && !(self.surfels.samples() && self.surfels != Making::Hybrid) {
            return Err("simplify: it needs surfels that are samples of a mesh".into());
        }
        if self.cover.is_some_and(|ratio| self.simplify.is_none() || !(ratio > 0.0 && ratio <= 1.0)) {
            return Err("cover: it needs simplify, and is a ratio from 0 to 1".into());
        }
        not_beside("radius", self.radius.is_some() && self.footprint_px.is_some(), "footprint_px")?;
        not_beside("ortho", self.ortho.is_some() && self.fov.is_some(), "fov")?;
        if self.eye.is_none() && (self.target.is_some() || self.up.is_some()) {
            return Err("eye: it must be given if target or up is".into());
        }
        within("views", self.views, MOST_VIEWS)?;
        sized("size", self.size)?;
        positive("radius", self.radius)?;
        positive("noise", self.noise)?;
        positive("shirt", self.shirt)?;
        let bare = self.triangles.is_some() || !matches!(self.surfels, Making::File | Making::Scanned);
        not_beside("shirt", self.shirt.is_some() && bare, "triangles, or surfels other than scanned")?;
        positive("fill", self.fill)?;
        positive("fov", self.fov)?;
        if self.opacity.is_some_and(|opacity| !(0.0..=1.0).contains(&opacity)) {
            return Err("opacity: it must be 0 to 1".into());
        }
        not_beside(
            "classes",
            self.classes.is_some() && (self.shape.is_some() || self.surfels != Making::File),
            "a shape or surfels",
        )?;
        positive("ortho", self.ortho)?;
        positive("most_fragments", self.most_fragments)
    }

    /// Checks `file` and `shape`, and the keys that go with only one of them.
    fn check_source(&self) -> Result<(), String> {
        match (&self.file, &self.shape) {
            (Some(_), Some(_)) => return Err("shape: give the scene a file or a shape, not both".into()),
            (None, None) => return Err("shape: a scene needs a file or a shape".into()),
            (Some(file), None) => {
                let counts = self.count.is_some() || self.quick_count.is_some();
                if self.surfels.samples() && self.count.is_none() {
                    return Err("count: sampled surfels need their number".into());
                }
                not_beside("count", counts && !self.surfels.samples(), "file, unless surfels are sampled")?;
                not_beside("radius", self.radius.is_some(), "file: use footprint_px")?;
                not_beside("noise", self.noise.is_some(), "file")?;
                not_beside("shirt", self.shirt.is_some(), "file")?;
                let of_shape = matches!(self.surfels, Making::Gaussians | Making::Triangles);
                not_beside("surfels = gaussians or triangles", of_shape, "file: give a shape")?;
                self.check_levels()?;
                let is_mesh = file.extension().is_some_and(|e| Format::mesh_names().any(|m| e.eq_ignore_ascii_case(m)));
                if self.truth && !is_mesh {
                    let formats = Format::meshes_sentence();
                    return Err(format!("truth: only {formats} files have triangles that rays can meet"));
                }
            }
            (None, Some(_)) if self.texture.is_some() || self.source.is_some() => {
                return Err("texture, source: they need a file, not a shape".into());
            }
            (None, Some(_)) if !Making::OF_SHAPES.contains(&self.surfels) => {
                return Err("surfels: for a shape, leave it out or give scanned, gaussians or triangles".into());
            }
            (None, Some(_)) if self.surfels == Making::Triangles && self.ortho.is_none() => {
                return Err("ortho: surfels = triangles needs an orthographic camera".into());
            }
            (None, Some(_)) if self.surfels == Making::Triangles && (self.truth || self.triangles.is_some()) => {
                return Err("truth, triangles: they cannot be combined with surfels = triangles".into());
            }
            (None, Some(_)) if self.surfels == Making::Gaussians && self.shading != Some(Shading::Unlit) => {
                return Err("shading: Gaussians need shading = unlit, as their colours include the light".into());
            }
            (None, Some(_)) if self.surfels == Making::Gaussians && (self.noise.is_some() || self.radius.is_some()) => {
                return Err("noise, radius: they cannot be combined with surfels = gaussians".into());
            }
            (None, Some(_)) if self.count.is_none() => return Err("count: a shape needs a number of surfels".into()),
            (None, Some(_)) => {}
        }
        Ok(())
    }

    /// Checks the keys of a file that is read in parts.
    fn check_levels(&self) -> Result<(), String> {
        if self.surfels != Making::Levels {
            return Ok(());
        }
        let footprints = self.footprint_px.is_some() || self.quick_footprint_px.is_some();
        let of_all = [
            ("truth", self.truth),
            ("footprint_px", footprints),
            ("most_fragments", self.most_fragments.is_some()),
            ("triangles", self.triangles.is_some()),
            ("rims", self.rims != Rims::Curved),
        ];
        for (key, given) in of_all {
            not_beside(key, given, "surfels = levels: it needs all surfels")?;
        }
        if self.eye.is_none() {
            return Err("eye: it must be given for a file that is read in parts".into());
        }
        Ok(())
    }

    /// Checks the lists of a sweep: numbers of surfels and footprints.
    fn check_sweeps(&self) -> Result<(), String> {
        for (key, counts) in [("count", &self.count), ("quick_count", &self.quick_count)] {
            let counts = counts.as_ref().map(OneOrMany::values);
            if counts.is_some_and(|c| c.is_empty() || c.iter().any(|c| !(1..=u64::from(u32::MAX)).contains(c))) {
                return Err(format!("{key}: a shape has 1 to 2^32 - 1 surfels"));
            }
        }
        for (key, all) in [("footprint_px", &self.footprint_px), ("quick_footprint_px", &self.quick_footprint_px)] {
            let all = all.as_ref().map(OneOrMany::values);
            if all.as_ref().is_some_and(Vec::is_empty) {
                return Err(format!("{key}: the list is empty"));
            }
            all.into_iter().flatten().try_for_each(|value| positive(key, Some(value)))?;
        }
        Ok(())
    }
}

impl Config {
    fn check(&self) -> Result<(), String> {
        let settings = self.settings(None);
        self.options.check(Some(self.backend), &settings).map_err(|error| error.to_string())?;
        check::by_tiles(&settings).map_err(|error| error.to_string())?;
        match self.error_limit {
            Some(limit) if limit.is_nan() || limit < 0.0 => Err(format!("error_limit: it must not be {limit}")),
            _ => Ok(()),
        }
    }
}

/// Formats a TOML error with its line and its key in `text`.
fn located(text: &str, error: &toml::de::Error) -> String {
    let message = error.message().trim().replace('\n', ", ");
    let Some(span) = error.span() else { return message };
    let before = text.get(..span.start).unwrap_or(text);
    let number = before.lines().count().max(1) + usize::from(before.ends_with('\n'));
    let line = text.lines().nth(number - 1).unwrap_or("").trim();
    match line.split_once('=') {
        Some((key, _)) => format!("line {number}, {}: {message}", key.trim()),
        None if line.is_empty() => message,
        None => format!("line {number}, {line}: {message}"),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::plan::Accumulator;
    use crate::scene::{Epsilon, LowPass, Map};

    const HEAD: &str = "name = \"n\"\nabout = \"a\"\n";
    const SCENE: &str = "[[scene]]\nname = \"s\"\nshape = \"sphere\"\ncount = 10\n";
    const CONFIG: &str = "[[config]]\nname = \"c\"\nbackend = \"gpu\"\n";

    fn parse(text: &str) -> Result<Definition> {
        Definition::parse(text, Path::new("folder/study.toml"))
    }

    #[test]
    fn what_a_definition_does_not_say_is_the_default() {
        let study = parse(&[HEAD, SCENE, CONFIG].concat()).unwrap();
        assert_eq!((study.size, study.runs), ([1024, 1024], 7));
        assert!(study.needs_gpu() && study.baseline.is_none());
        let options = study.configs[0].settings(None);
        assert_eq!(options, crate::plan::Settings::default());
        assert_eq!(study.configs[0].settings(Some(Shading::Unlit)).shading, Shading::Unlit);
        assert_eq!(study.path_of(Path::new("../a.obj")), Path::new("folder/../a.obj"));
    }

    #[test]
    fn what_it_says_is_taken_and_a_quick_form_has_less() {
        let text = "name = \"n\"\nabout = \"a\"\nsize = [64, 32]\nbaseline = \"c\"\n[quick]\nruns = 2\nsize = [8, 8]\n\
                    [[scene]]\nname = \"s\"\nshape = \"torus\"\ncount = [10, 20]\nquick_count = 5\n\
                    [[scene]]\nname = \"t\"\nfile = \"a.obj\"\ntruth = true\nquick = false\nconfigs = [\"r\"]\n\
                    [[config]]\nname = \"c\"\nbackend = \"gpu\"\nepsilon = \"abs:2\"\nlowpass = \"ewa\"\n\
                    accumulator = \"fixed64\"\naov = [\"depth\"]\n\
                    [[config]]\nname = \"r\"\nbackend = \"raster\"\nblend_format = \"rgba32float\"\nquick = false\n";
        let study = parse(text).unwrap();
        let options = study.configs[0].settings(None);
        assert_eq!((options.epsilon, options.low_pass), (Epsilon::Absolute(2.0), LowPass::Ewa));
        assert!(
            options.accumulator == Accumulator::Fixed64
                && options.maps.has(Map::Depth)
                && !options.maps.has(Map::Normal)
        );
        assert_eq!(study.scenes[0].configs, None);
        assert_eq!(study.scenes[1].configs, Some(vec!["r".to_owned()]));
        assert!(study.configs[0].deterministic() && !study.configs[1].deterministic());
        assert_eq!(study.configs[1].sums(), "rgba32float");
        assert!(study.configs[1].settings(None).raster.is_some() && options.raster.is_none());
        assert_eq!(study.scenes[0].count.as_ref().unwrap().values(), [10, 20]);
        let quick = study.quick_form().unwrap();
        assert_eq!((quick.runs, quick.size, quick.scenes.len(), quick.configs.len()), (2, [8, 8], 1, 1));
        assert_eq!(quick.scenes[0].count, Some(OneOrMany::One(5)));
        let whole = text.replace("[quick]\nruns = 2\nsize = [8, 8]\n", "").replace("quick = false\n", "");
        let whole = parse(&whole.replace("quick_count = 5\n", "")).unwrap();
        assert!(whole.quick_form().unwrap_err().to_string().contains("no quick form"));
    }

    /// Each error names the file and the key.
    #[test]
    fn bad_definitions_are_refused_by_file_and_key() {
        let cases: &[(&str, &[&str])] = &[
            ("runs = \"x\"\n", &["line 3, runs:", "invalid type"]),
            ("runz = 1\n", &["line 3", "runz"]),
            ("runs = 0\n", &["runs:"]),
            ("runs = 2147483647\n", &["runs: it is 1 to 10000, not 2147483647"]),
            ("[quick]\nruns = 10001\n", &["quick.runs: it is 1 to 10000"]),
            ("rays = 0\n", &["rays: it is 1 to 256"]),
            ("rays = 4294967295\n", &["rays: it is 1 to 256"]),
            (
                "[[scene]]\nname = \"t\"\nshape = \"torus\"\ncount = 1\nviews = 1000000000\n",
                &["scene \"t\": views: it is 1 to 1000, not 1000000000"],
            ),
            ("size = [0, 5]\n", &["size:"]),
            ("baseline = \"d\"\n", &["baseline:", "\"d\""]),
            ("[quick]\nruns = 0\n", &["runs:"]),
            ("[[scene]]\nname = \"s\"\nshape = \"cube\"\ncount = 1\n", &["line 5, shape:", "cube", "torus"]),
            ("[[scene]]\nname = \"t\"\nshape = \"torus\"\n", &["scene \"t\": count:"]),
            ("[[scene]]\nname = \"t\"\nshape = \"torus\"\ncount = 1\nsize = [9, 0]\n", &["scene \"t\": size:", "9x0"]),
            ("[[scene]]\nname = \"t\"\n", &["scene \"t\": shape:"]),
            ("[[scene]]\nname = \"t\"\nshape = \"torus\"\ncount = 1\nconfigs = [\"e\"]\n", &["configs:", "\"e\""]),
            ("[[scene]]\nname = \"t\"\nfile = \"a.ply\"\ncount = 1\n", &["count:", "file"]),
            ("[[scene]]\nname = \"t\"\nfile = \"a.las\"\ntruth = true\n", &["truth:", "OBJ"]),
            ("[[scene]]\nname = \"t\"\nfile = \"a.ply\"\nsurfels = \"sample\"\n", &["count:", "sampled"]),
            ("[[scene]]\nname = \"t\"\nfile = \"a.ply\"\nsurfels = \"mesh\"\n", &["surfels:", "mesh", "uniform"]),
            ("[[scene]]\nname = \"t\"\nfile = \"a.ply\"\nlookup = true\n", &["lookup:", "texture"]),
            ("[[scene]]\nname = \"t\"\nfile = \"a.ply\"\ntexture = \"a.png\"\n", &["texture:", "sampled"]),
            ("[[scene]]\nname = \"t\"\nshape = \"torus\"\ncount = 1\nsurfels = \"knn\"\n", &["surfels", "shape"]),
            ("[[scene]]\nname = \"t\"\nshape = \"torus\"\ncount = [1, \"x\"]\n", &["count:", "list of numbers"]),
            ("[[scene]]\nname = \"t\"\nshape = \"torus\"\ncount = 0\n", &["count:"]),
            ("[[scene]]\nname = \"t\"\nshape = \"torus\"\ncount = 1\nfill = -1\n", &["fill:", "-1"]),
            ("[[scene]]\nname = \"t\"\nshape = \"torus\"\ncount = 1\nfootprint_px = []\n", &["footprint_px:"]),
            ("[[scene]]\nname = \"t\"\nshape = \"torus\"\ncount = 1\nviews = 0\n", &["views:"]),
            ("[[scene]]\nname = \"t\"\nshape = \"torus\"\ncount = 1\nopacity = 2\n", &["opacity:"]),
            ("[[scene]]\nname = \"t\"\nshape = \"torus\"\ncount = 1\nclasses = \"1:0\"\n", &["classes:", "shape"]),
            ("[[scene]]\nname = \"t\"\nfile = \"a.laz\"\nclasses = \"1\"\n", &["classes:", "3-5:0.3"]),
            ("[[scene]]\nname = \"t\"\nshape = \"torus\"\ncount = 1\nup = [0, 0, 1]\n", &["eye:"]),
            ("[[scene]]\nname = \"t\"\nshape = \"torus\"\ncount = 1\nfov = 9\northo = 1\n", &["ortho:", "fov"]),
            ("[[scene]]\nname = \"s\"\nshape = \"torus\"\ncount = 1\n", &["scene: two are called \"s\""]),
            ("[[config]]\nname = \"d\"\nbackend = \"cpu\"\n", &["line 5, backend:", "cpu", "raster"]),
            ("[[scene]]\nname = \"t\"\nfile = \"a.ply\"\nsurfels = \"levels\"\n", &["eye:"]),
            ("[[scene]]\nname = \"t\"\nfile = \"a.ply\"\nsurfels = \"levels\"\ntruth = true\n", &["truth", "levels"]),
            ("[[scene]]\nname = \"t\"\nfile = \"a.ply\"\nsurfels = \"levels\"\nrims = \"flat\"\n", &["rims", "levels"]),
            ("[[scene]]\nname = \"t\"\nfile = \"a.ply\"\nsurfels = \"levels\"\ncount = 5\n", &["count:"]),
            (
                "[[scene]]\nname = \"t\"\nfile = \"a.ply\"\nsurfels = \"levels\"\nquick_footprint_px = 2\n",
                &["footprint_px", "levels"],
            ),
            ("[[scene]]\nname = \"t\"\nfile = \"a.ply\"\nsurfels = \"levels\"\neye = [1, 2, 3]\n", &["\"c\"", "cuts"]),
            ("[[scene]]\nname = \"t\"\nshape = \"torus\"\ncount = 1\nsurfels = \"levels\"\n", &["surfels", "shape"]),
            ("[[config]]\nname = \"d\"\nbackend = \"gpu\"\nepsilon = \"1\"\n", &["line 6, epsilon:", "rel:E"]),
            ("[[config]]\nname = \"d\"\nbackend = \"gpu\"\naccumulator = \"f\"\n", &["accumulator:", "fixed32"]),
            ("[[config]]\nname = \"d\"\nbackend = \"gpu\"\nlowpass = \"box\"\n", &["lowpass:", "ewa"]),
            (
                "[[config]]\nname = \"d\"\nbackend = \"gpu\"\nblend_format = \"rgba8unorm\"\n",
                &["blend-format", "raster"],
            ),
            ("[[config]]\nname = \"d\"\nbackend = \"raster\"\naccumulator = \"fixed64\"\n", &["accumulator", "gpu"]),
            ("[[config]]\nname = \"d\"\nbackend = \"gpu\"\nerror_limit = -1\n", &["error_limit:"]),
            ("[[config]]\nname = \"d\"\nbackend = \"gpu\"\napproximates = \"x\"\n", &["approximates:", "\"x\""]),
            ("[[config]]\nname = \"d\"\nbackend = \"raster\"\norganisation = \"tile\"\n", &["organisation", "gpu"]),
            ("[[config]]\nname = \"d\"\nbackend = \"raster\"\nwithout = [\"order\"]\n", &["left out", "gpu"]),
            ("[[config]]\nname = \"d\"\nbackend = \"gpu\"\nwithout = [\"x\"]\n", &["line 6, without:", "culling"]),
            ("[[config]]\nname = \"d\"\nbackend = \"gpu\"\naov = [\"decision\"]\n", &["decision map", "reference"]),
            ("[[config]]\nname = \"d\"\nbackend = \"gpu\"\naov = [\"colour\"]\n", &["line 6, aov:", "depth"]),
            ("size = [\n", &["line"]),
        ];
        for (wrong, words) in cases {
            let error = parse(&[HEAD, wrong, SCENE, CONFIG].concat()).unwrap_err().to_string();
            assert!(error.starts_with("folder/study.toml: ") && !error.contains('\n'), "{error}");
            for word in *words {
                assert!(error.contains(word), "{wrong}: {error}");
            }
        }
        for (text, word) in [
            (HEAD.to_owned(), "[[scene]]"),
            ([HEAD, SCENE].concat(), "[[config]]"),
            ([HEAD, SCENE, CONFIG, "quick = false\n"].concat(), "[[config]] without quick"),
            ("name = \"n\"\n".to_owned(), "about"),
        ] {
            let error = parse(&text).unwrap_err().to_string();
            assert!(error.contains(word), "{error}");
        }
    }
}
