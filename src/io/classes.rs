//! Classes of a laser scan's points and their opacities. (LAS 1.4, table 17: 2 is ground, 3 to 5
//! are vegetation, 6 is building, 7 is noise.)

use std::fmt;
use std::str::FromStr;

use crate::error::Error;
use crate::scene::Colors;
use crate::scene::color::DEFAULT_COLOR;

/// The opacity of each class, which is the alpha of its points; points with opacity 0 are left out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClassOpacities([f32; 256]);

impl Default for ClassOpacities {
    fn default() -> Self {
        Self([1.0; 256])
    }
}

impl ClassOpacities {
    /// Whether all opacities are 1.
    pub fn are_plain(&self) -> bool {
        *self == Self::default()
    }

    /// The opacity of a class.
    pub fn of(&self, class: u8) -> f32 {
        self.0[usize::from(class)]
    }

    /// Sets the alphas of points to the opacities of their `classes`.
    ///
    /// Points without colours get the default colour. Nothing changes if the opacities of all these
    /// `classes` are 1.
    pub(super) fn fade(&self, colors: Option<Colors>, classes: &[u8]) -> Option<Colors> {
        if classes.iter().all(|class| self.of(*class) == 1.0) {
            return colors;
        }
        let alphas = classes.iter().map(|class| self.of(*class));
        match colors {
            Some(Colors::Linear(mut colors)) => {
                colors.iter_mut().zip(alphas).for_each(|(color, alpha)| color[3] = alpha);
                Some(Colors::Linear(colors))
            }
            Some(Colors::Srgb8(mut codes)) if self.0.iter().all(|opacity| is_code(*opacity)) => {
                codes.iter_mut().zip(alphas).for_each(|(code, alpha)| code[3] = (255.0 * alpha).round() as u8);
                Some(Colors::Srgb8(codes))
            }
            // Some opacity is not a multiple of 1/255, so codes become linear light.
            Some(Colors::Srgb8(codes)) => {
                let colors = Colors::Srgb8(codes);
                let faded = alphas.enumerate().map(|(index, alpha)| {
                    let [r, g, b, _] = colors.linear(index);
                    [r, g, b, alpha]
                });
                Some(Colors::Linear(faded.collect()))
            }
            None => {
                let [r, g, b, _] = DEFAULT_COLOR;
                Some(Colors::Linear(alphas.map(|alpha| [r, g, b, alpha]).collect()))
            }
            // Laser scans have no other colours.
            other => other,
        }
    }
}

/// The classes of the LAS specification (1.4 R15, table 17): number, name, and the sRGB codes that
/// class is drawn in, which follow the habits of maps.
const CLASSES: [(u8, &str, [u8; 3]); 22] = [
    (0, "never classified", [150, 150, 150]),
    (1, "unclassified", [180, 180, 180]),
    (2, "ground", [166, 118, 68]),
    (3, "low vegetation", [178, 214, 110]),
    (4, "medium vegetation", [96, 176, 72]),
    (5, "high vegetation", [26, 122, 48]),
    (6, "building", [226, 92, 44]),
    (7, "noise", [214, 32, 140]),
    (8, "model key point", [246, 200, 160]),
    (9, "water", [54, 128, 220]),
    (10, "rail", [96, 72, 120]),
    (11, "road", [86, 90, 98]),
    (12, "overlap", [222, 222, 190]),
    (13, "wire guard", [250, 220, 60]),
    (14, "wire conductor", [240, 180, 20]),
    (15, "transmission tower", [120, 40, 160]),
    (16, "wire connector", [190, 130, 220]),
    (17, "bridge", [196, 164, 150]),
    (18, "high noise", [255, 90, 190]),
    (19, "overhead structure", [150, 80, 60]),
    (20, "ignored ground", [206, 178, 140]),
    (21, "snow", [236, 244, 255]),
];

/// The name of a class in the LAS specification; None for reserved classes and those of users.
pub fn class_name(class: u8) -> Option<&'static str> {
    CLASSES.iter().find(|(number, ..)| *number == class).map(|(_, name, _)| *name)
}

/// The sRGB codes that a class is drawn in; None for classes without a name.
pub fn class_color(class: u8) -> Option<[u8; 3]> {
    CLASSES.iter().find(|(number, ..)| *number == class).map(|(.., color)| *color)
}

impl fmt::Display for ClassOpacities {
    /// Writes the syntax that `from_str` reads.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (mut first, mut comma) = (0, "");
        for run in self.0.chunk_by(|a, b| a == b) {
            let last = first + run.len() - 1;
            match run[0] {
                1.0 => {}
                opacity if first == last => write!(f, "{comma}{first}:{opacity}")?,
                opacity => write!(f, "{comma}{first}-{last}:{opacity}")?,
            }
            comma = if run[0] == 1.0 { comma } else { "," };
            first = last + 1;
        }
        Ok(())
    }
}

/// Whether a byte can represent this alpha exactly.
fn is_code(alpha: f32) -> bool {
    (255.0 * alpha).fract() == 0.0
}

impl FromStr for ClassOpacities {
    type Err = Error;

    /// Parses rules `CLASS:A` or `FIRST-LAST:A`, separated by commas. Later rules override earlier
    /// ones.
    fn from_str(text: &str) -> Result<Self, Error> {
        let mut all = Self::default();
        for rule in text.split(',') {
            let read = || {
                let (classes, opacity) = rule.split_once(':')?;
                let (first, last) = classes.split_once('-').unwrap_or((classes, classes));
                let (first, last): (u8, u8) = (first.trim().parse().ok()?, last.trim().parse().ok()?);
                let opacity: f32 = opacity.trim().parse().ok()?;
                (first <= last && (0.0..=1.0).contains(&opacity)).then_some((first, last, opacity))
            };
            let (first, last, opacity) = read().ok_or_else(|| {
                Error::Usage(format!(
                    "opacities of classes are CLASS:A or FIRST-LAST:A with classes 0 to 255 and A from 0 to 1, such as 3-5:0.3,7:0, not \
                     {text:?}"
                ))
            })?;
            all.0[usize::from(first)..=usize::from(last)].fill(opacity);
        }
        Ok(all)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn opacities_are_read_and_refused() {
        let of: ClassOpacities = "3-5:0.25, 7:0,5:1".parse().unwrap();
        assert_eq!([2, 3, 4, 5, 6, 7].map(|class| of.of(class)), [1.0, 0.25, 0.25, 1.0, 1.0, 0.0]);
        assert!(!of.are_plain() && "0-255:1".parse::<ClassOpacities>().unwrap().are_plain());
        assert_eq!(of.to_string(), "3-4:0.25,7:0");
        for bad in ["", "3", "3:", ":1", "5-3:1", "3:2", "3:-1", "256:1", "3:nan", "3:1,", "a:1"] {
            let said = bad.parse::<ClassOpacities>().unwrap_err().to_string();
            assert!(said.contains("3-5:0.3,7:0"), "{bad}: {said}");
        }
    }

    #[test]
    fn points_get_the_alphas_of_their_classes() {
        let of: ClassOpacities = "3:0.2".parse().unwrap();
        assert!(is_code(0.2) && !is_code(0.3) && is_code(0.0) && is_code(1.0));
        let third = "3:0.3".parse::<ClassOpacities>().unwrap().fade(Some(Colors::Srgb8(vec![[255; 4]; 2])), &[2, 3]);
        assert_eq!(third, Some(Colors::Linear(vec![[1.0; 4], [1.0, 1.0, 1.0, 0.3]])));
        let codes = of.fade(Some(Colors::Srgb8(vec![[1, 2, 3, 255]; 2])), &[2, 3]);
        assert_eq!(codes, Some(Colors::Srgb8(vec![[1, 2, 3, 255], [1, 2, 3, 51]])));
        let [r, g, b, _] = DEFAULT_COLOR;
        assert_eq!(of.fade(None, &[3, 1]), Some(Colors::Linear(vec![[r, g, b, 0.2], [r, g, b, 1.0]])));
        // The classes of all points have opacity 1, so nothing changes.
        assert_eq!(of.fade(None, &[2, 1]), None);
    }
}
