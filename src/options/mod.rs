//! The options of a picture. Each is declared once, for the command line, studies and callers of
//! the library.
//!
//! An option that is `None` leaves the choice to the scene: Gaussians are drawn by other rules than
//! surfels. [`RenderOptions::settle`] makes these choices.

mod camera;
mod check;
mod colors;
mod device;
mod group;
mod input;
mod levels;
mod look;
mod maps;
mod marks;
pub mod parse;
mod points;
mod research;
mod settle;
mod surface;
mod surfels;
mod transparency;
mod triangles;
pub mod values;

pub use camera::CameraOptions;
pub use colors::ColorOptions;
pub use device::{Chosen, DeviceOptions};
pub use input::{FormatOptions, InputOptions};
pub use levels::LevelOptions;
pub use look::LookOptions;
pub use maps::MapOptions;
pub use marks::MarkOptions;
pub use points::PointOptions;
pub use research::ResearchOptions;
pub use settle::Suggested;
pub use surface::SurfaceOptions;
pub use surfels::{LimitOptions, SurfelOptions};
pub use transparency::TransparencyOptions;
pub use triangles::{CreaseAngle, MeshAs, TriangleOptions};

pub use crate::gpu::Replacement;
pub use crate::plan::{Accumulator, BackendName, BlendFormat, Optimisation, Organisation, RasterDepth};
pub use crate::scene::{
    Blend, Composite, Cull, Detail, DetailMeasure, Epsilon, EyeDome, Join, Kernel, Light, LowPass, NodeShape, Outline,
    PointShape, PointSize, Samples, Shading, ShadingAt, Tail,
};
pub use crate::surfels::Size;

use std::fmt;

use serde::de::{DeserializeSeed, Deserializer, Error as _, MapAccess, SeqAccess, Visitor};

use crate::error::{Error, Result};
use group::Group;

/// Former names of options, and what to write instead.
const RENAMED: [(&str, &str); 2] = [("maps", "aov"), ("lod_caps", "lod_shape: cap or disk")];

/// How files become a scene.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "cli", derive(clap::Args))]
pub struct SceneOptions {
    /// How files are read.
    #[cfg_attr(feature = "cli", command(flatten))]
    pub input: InputOptions,
    /// The attribute that points are coloured by.
    #[cfg_attr(feature = "cli", command(flatten))]
    pub colors: ColorOptions,
    /// How points become surfels.
    #[cfg_attr(feature = "cli", command(flatten))]
    pub surfels: SurfelOptions,
    /// Meshes that are drawn as their triangles.
    #[cfg_attr(feature = "cli", command(flatten))]
    pub triangles: TriangleOptions,
}

/// The options of a picture, except those of scene, camera and backend.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "cli", derive(clap::Args))]
pub struct RenderOptions {
    /// Light, background and the smoothness of edges.
    #[cfg_attr(feature = "cli", command(flatten))]
    pub look: LookOptions,
    /// Which fragments are one surface, and how they blend.
    #[cfg_attr(feature = "cli", command(flatten))]
    pub surface: SurfaceOptions,
    /// Surfaces behind the nearest one.
    #[cfg_attr(feature = "cli", command(flatten))]
    pub transparency: TransparencyOptions,
    /// Points as shapes that face the camera.
    #[cfg_attr(feature = "cli", command(flatten))]
    pub points: PointOptions,
    /// Levels of detail.
    #[cfg_attr(feature = "cli", command(flatten))]
    pub levels: LevelOptions,
    /// Maps beside the colour.
    #[cfg_attr(feature = "cli", command(flatten))]
    pub maps: MapOptions,
    /// Marks on the finished picture.
    #[cfg_attr(feature = "cli", command(flatten))]
    pub marks: MarkOptions,
    /// Choices that change speed or error.
    #[cfg_attr(feature = "cli", command(flatten))]
    pub research: ResearchOptions,
}

impl RenderOptions {
    /// Sets the option `name` from `texts`, which are a single text or the items of a list. Names
    /// are those of the command line, with `_` for `-`.
    ///
    /// # Errors
    /// [`Error::Usage`] if there is no such option, or if the texts are not a valid value.
    pub fn set(&mut self, name: &str, texts: &[String]) -> Result<()> {
        let groups: [&mut dyn Group; 8] = [
            &mut self.look,
            &mut self.surface,
            &mut self.transparency,
            &mut self.points,
            &mut self.levels,
            &mut self.maps,
            &mut self.marks,
            &mut self.research,
        ];
        for group in groups {
            if group.set(name, texts)? {
                return Ok(());
            }
        }
        Err(Error::Usage(match RENAMED.iter().find(|(old, _)| *old == name) {
            Some((_, new)) => format!("{name} is now {new}"),
            None => format!("there is no option {name}"),
        }))
    }

    /// Returns a deserialiser that sets the option `name`. The value is a text, a number, true or
    /// false, a list of these, or a table of texts.
    pub fn value_of<'a>(&'a mut self, name: &'a str) -> OptionValue<'a> {
        OptionValue { options: self, name }
    }
}

/// Sets one option by a deserialised value: see [`RenderOptions::value_of`].
pub struct OptionValue<'a> {
    options: &'a mut RenderOptions,
    name: &'a str,
}

impl<'de> DeserializeSeed<'de> for OptionValue<'_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, value: D) -> Result<(), D::Error> {
        let texts = value.deserialize_any(Texts)?;
        // The file's deserialiser names the key, so the option's name is removed here.
        let prefix = format!("{}: ", self.name);
        self.options.set(self.name, &texts).map_err(|error| {
            let sentence = error.to_string();
            D::Error::custom(sentence.strip_prefix(&prefix).unwrap_or(&sentence))
        })
    }
}

/// Converts a value to the texts that the command line would have.
struct Texts;

impl<'de> Visitor<'de> for Texts {
    type Value = Vec<String>;

    fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("a text, a number, true or false, or a list of these")
    }

    fn visit_str<E>(self, text: &str) -> Result<Vec<String>, E> {
        Ok(vec![text.to_owned()])
    }

    fn visit_bool<E>(self, value: bool) -> Result<Vec<String>, E> {
        Ok(vec![value.to_string()])
    }

    fn visit_i64<E>(self, value: i64) -> Result<Vec<String>, E> {
        Ok(vec![value.to_string()])
    }

    fn visit_u64<E>(self, value: u64) -> Result<Vec<String>, E> {
        Ok(vec![value.to_string()])
    }

    fn visit_f64<E>(self, value: f64) -> Result<Vec<String>, E> {
        Ok(vec![value.to_string()])
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut items: A) -> Result<Vec<String>, A::Error> {
        let mut texts = Vec::new();
        while let Some(item) = items.next_element_seed(Item)? {
            texts.push(item);
        }
        Ok(texts)
    }

    /// Converts each row of a table, such as `{ "kernel_ellipse.wgsl" = "mine.wgsl" }`, to a text
    /// `KEY=VALUE`.
    fn visit_map<A: MapAccess<'de>>(self, mut rows: A) -> Result<Vec<String>, A::Error> {
        let mut texts = Vec::new();
        while let Some((key, value)) = rows.next_entry::<String, String>()? {
            texts.push(format!("{key}={value}"));
        }
        Ok(texts)
    }
}

/// Reads an item of a list.
struct Item;

impl<'de> DeserializeSeed<'de> for Item {
    type Value = String;

    fn deserialize<D: Deserializer<'de>>(self, value: D) -> Result<String, D::Error> {
        value.deserialize_any(Texts).map(|texts| texts.join(","))
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::scene::{Epsilon, Map};

    fn texts(all: &[&str]) -> Vec<String> {
        all.iter().map(|text| (*text).to_owned()).collect()
    }

    #[test]
    fn options_are_set_by_their_names() {
        let mut options = RenderOptions::default();
        options.set("epsilon", &texts(&["abs:2"])).unwrap();
        options.set("pixels", &texts(&["2", "9.5"])).unwrap();
        options.set("aov", &texts(&["depth", "normal"])).unwrap();
        options.set("separate", &texts(&["true"])).unwrap();
        options.set("lod_fade", &texts(&["on"])).unwrap();
        assert_eq!(options.surface.epsilon, Some(Epsilon::Absolute(2.0)));
        assert_eq!(options.points.pixels, Some(values::Diameters([2.0, 9.5])));
        assert_eq!(options.maps.aov, [Map::Depth, Map::Normal]);
        assert!(options.surface.separate);
        assert_eq!(options.levels.lod_fade, Some(values::Switch(true)));
    }

    #[test]
    fn a_wrong_name_or_value_is_refused_by_name() {
        let mut options = RenderOptions::default();
        let refusal = |result: Result<()>| result.unwrap_err().to_string();
        assert!(refusal(options.set("epsilo", &texts(&["abs:2"]))).contains("epsilo"));
        assert_eq!(refusal(options.set("maps", &texts(&["depth"]))), "maps is now aov");
        assert!(refusal(options.set("epsilon", &texts(&["abs:-2"]))).starts_with("epsilon: "));
        assert!(refusal(options.set("separate", &texts(&["yes"]))).starts_with("separate: "));
        assert!(refusal(options.set("opacity", &texts(&["half"]))).starts_with("opacity: "));
    }
}
