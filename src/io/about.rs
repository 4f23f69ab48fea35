//! A file's description of itself beside its points: for people, and for no picture.

use serde::Serialize;

/// A file's description of itself.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct About {
    /// The format with its version and variant.
    pub format: String,
    /// The coordinate system, if the file names one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub coordinate_system: Option<String>,
    /// The scanners or systems that measured the points.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub scanners: Vec<String>,
    /// The program that wrote the file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub software: Option<String>,
    /// Scans, of a format that has several.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scans: Option<u64>,
    /// The attributes of each point.
    pub attributes: Vec<Attribute>,
    /// The meaning that numbers of colours are given, if colours show.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub colors: Option<String>,
    /// Black and white of the intensities, if they show in the place of colours.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub intensities: Option<[f64; 2]>,
}

/// One attribute of each point.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Attribute {
    /// As the file calls it.
    pub name: String,
    /// Whether anything is made of it.
    pub used: bool,
    #[serde(skip)]
    pub(super) role: Role,
}

/// Attributes of which it is known late whether they are used.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Role {
    Color,
    Intensity,
    #[default]
    Other,
}

impl Attribute {
    pub(super) fn new(name: impl Into<String>, used: bool, role: Role) -> Self {
        // A terminal obeys some characters.
        let name = name.into().replace(char::is_control, "\u{fffd}");
        Self { name, used, role }
    }
}
