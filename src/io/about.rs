//! A file's description of itself, for users; rendering does not use it.

use serde::Serialize;

/// A file's description of itself.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct About {
    /// The format, with version and variant.
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
    /// The number of scans, for formats with several.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scans: Option<u64>,
    /// The attributes of each point.
    pub attributes: Vec<Attribute>,
    /// The interpretation of the colour numbers, if colours are drawn.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub colors: Option<String>,
    /// The intensities that are drawn as black and as white, if intensities are drawn instead of
    /// colours.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub intensities: Option<[f64; 2]>,
}

/// An attribute of each point.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Attribute {
    /// The name in the file.
    pub name: String,
    /// Whether the attribute is used.
    pub used: bool,
    #[serde(skip)]
    pub(super) role: Role,
}

/// The role of an attribute. Colours and intensities are marked, because whether they are used is
/// decided only after reading.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Role {
    Color,
    Intensity,
    #[default]
    Other,
}

impl Attribute {
    pub(super) fn new(name: impl Into<String>, used: bool, role: Role) -> Self {
        // Control characters would be executed by a terminal.
        let name = name.into().replace(char::is_control, "\u{fffd}");
        Self { name, used, role }
    }
}
