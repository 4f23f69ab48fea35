//! Conditions on attributes, in the notation of PDAL's `filters.range`.

use std::fmt;
use std::str::FromStr;

use super::ClassList;
use crate::error::Error;

/// A range of numbers. NaN is in no range.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// The ends; infinite if the range has none.
    pub ends: [f64; 2],
    /// Whether each end is in the range.
    pub closed: [bool; 2],
    /// The numbers outside are meant.
    pub negated: bool,
}

impl Range {
    /// Whether a number passes.
    pub fn holds(&self, value: f64) -> bool {
        let above = if self.closed[0] { value >= self.ends[0] } else { value > self.ends[0] };
        let below = if self.closed[1] { value <= self.ends[1] } else { value < self.ends[1] };
        (above && below) != self.negated
    }
}

/// A condition on the points of a file, `Classification[2:2],Z[:120]`. A point passes if it passes
/// one of the ranges of each attribute that the filter names.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Filter {
    /// The ranges of each attribute, in the order of the text.
    pub(super) ranges: Vec<(String, Vec<Range>)>,
    /// The classes that pass.
    pub(super) classes: Option<ClassList>,
}

impl Filter {
    /// Whether every point passes.
    pub fn is_empty(&self) -> bool {
        self.ranges.is_empty() && self.classes.is_none()
    }

    /// Returns the filter that also needs one of these classes.
    #[must_use]
    pub fn with_classes(self, classes: Option<ClassList>) -> Self {
        Self { classes, ..self }
    }
}

/// The error of a text that is no filter; `why` is a clause.
fn bad(text: &str, why: &str) -> Error {
    Error::Usage(format!("{text:?} {why}: give ranges such as Classification[2:2],Z[:120] or Intensity(100:]"))
}

impl FromStr for Filter {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        let mut filter = Self::default();
        for term in text.split(',') {
            let (name, range) = self::term(term)?;
            match filter.ranges.iter_mut().find(|(known, _)| super::names::plain(known) == super::names::plain(&name)) {
                Some((_, ranges)) => ranges.push(range),
                None => filter.ranges.push((name, vec![range])),
            }
        }
        Ok(filter)
    }
}

/// Parses `NAME[LOW:HIGH]`, with `(` or `)` for an end that is not in the range and `!` before the
/// brackets for the numbers outside.
fn term(text: &str) -> Result<(String, Range), Error> {
    let text = text.trim();
    let last = text.chars().last().filter(|last| matches!(last, ']' | ')'));
    // The name may have brackets of its own: the range starts at the last one.
    let (Some(last), Some(open)) = (last, text.rfind(['[', '('])) else {
        return Err(bad(text, "is no range"));
    };
    let (name, negated) = match text[..open].trim_end().strip_suffix('!') {
        Some(name) => (name.trim_end(), true),
        None => (text[..open].trim_end(), false),
    };
    if name.is_empty() {
        return Err(bad(text, "names no attribute"));
    }
    let Some((low, high)) = text[open + 1..text.len() - 1].split_once(':') else {
        return Err(bad(text, "lacks the colon between its ends"));
    };
    let end = |end: &str, none: f64| match end.trim() {
        "" => Ok(none),
        end => {
            end.parse().ok().filter(|end: &f64| !end.is_nan()).ok_or_else(|| bad(text, "has an end that is no number"))
        }
    };
    let ends = [end(low, f64::NEG_INFINITY)?, end(high, f64::INFINITY)?];
    if ends[0] > ends[1] {
        return Err(bad(text, "has its lower end above the upper one"));
    }
    Ok((name.to_owned(), Range { ends, closed: [text[open..].starts_with('['), last == ']'], negated }))
}

impl fmt::Display for Filter {
    /// Writes the ranges in the syntax that `from_str` reads.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut comma = "";
        for (name, range) in self.ranges.iter().flat_map(|(name, all)| all.iter().map(move |range| (name, range))) {
            let end = |end: f64| if end.is_finite() { end.to_string() } else { String::new() };
            let [low, high] = range.ends.map(end);
            let [open, close] = [["(", "["][usize::from(range.closed[0])], [")", "]"][usize::from(range.closed[1])]];
            write!(f, "{comma}{name}{}{open}{low}:{high}{close}", if range.negated { "!" } else { "" })?;
            comma = ",";
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use proptest::prelude::*;

    /// Whether numbers pass the only range of a text.
    fn passes(text: &str, values: &[f64]) -> Vec<bool> {
        let filter: Filter = text.parse().unwrap();
        let [(_, ranges)] = &filter.ranges[..] else { unreachable!("{filter:?}") };
        values.iter().map(|value| ranges.iter().any(|range| range.holds(*value))).collect()
    }

    #[test]
    fn ranges_hold_what_pdal_documents() {
        let values = [19.0, 20.0, 30.0, 40.0, 41.0];
        for (text, expected) in [
            ("Z[20:40]", [false, true, true, true, false]),
            ("Z(20:40)", [false, false, true, false, false]),
            ("Z[20:40)", [false, true, true, false, false]),
            ("Z(20:40]", [false, false, true, true, false]),
            ("Z[20:]", [false, true, true, true, true]),
            ("Z(:40)", [true, true, true, false, false]),
            ("Z![20:40]", [true, false, false, false, true]),
            ("Z !(20:40)", [true, true, false, true, true]),
            ("Z[30:30]", [false, false, true, false, false]),
            ("Z[:]", [true; 5]),
            ("Z[19:19],z[41:41]", [true, false, false, false, true]),
            (" Z [ 2e1 : 4e1 ] ", [false, true, true, true, false]),
        ] {
            assert_eq!(passes(text, &values), expected, "{text}");
        }
        assert_eq!(passes("Z[:]", &[f64::NAN]), [false]);
        assert_eq!(passes("Z[-2:-1]", &[-1.5, 1.5]), [true, false]);
    }

    #[test]
    fn attributes_stay_apart_and_ranges_of_one_are_joined() {
        let filter: Filter = "Classification[2:2],Z[:120],classification[6:6]".parse().unwrap();
        let names: Vec<_> = filter.ranges.iter().map(|(name, ranges)| (name.as_str(), ranges.len())).collect();
        assert_eq!(names, [("Classification", 2), ("Z", 1)]);
        let filter: Filter = "scalar_Reflectance_(dB)(-20:0]".parse().unwrap();
        assert_eq!(filter.ranges[0].0, "scalar_Reflectance_(dB)");
    }

    #[test]
    fn bad_filters_are_refused_with_what_is_wrong() {
        for (text, why) in [
            ("", "is no range"),
            ("Z", "is no range"),
            ("Z[1:2", "is no range"),
            ("Z1:2]", "is no range"),
            ("[1:2]", "names no attribute"),
            ("![1:2]", "names no attribute"),
            ("Z[12]", "lacks the colon"),
            ("Z[a:2]", "no number"),
            ("Z[nan:2]", "no number"),
            ("Z[2:1]", "above the upper one"),
            ("Z[1:2],", "is no range"),
        ] {
            let said = text.parse::<Filter>().unwrap_err().to_string();
            assert!(said.contains(why) && said.contains("Classification[2:2]"), "{text}: {said}");
        }
    }

    proptest! {
        /// A range holds a number exactly if its negation does not.
        #[test]
        fn a_negation_holds_the_rest(low in -9i32..9, length in 0i32..9, value in -12i32..12, kind in 0usize..4) {
            let (open, close) = [("[", "]"), ("(", ")"), ("[", ")"), ("(", "]")][kind];
            let text = |not: &str| format!("A{not}{open}{low}:{}{close}", low + length);
            prop_assert_ne!(passes(&text(""), &[value.into()]), passes(&text("!"), &[value.into()]));
        }

        /// The text of a filter is that filter.
        #[test]
        fn filters_are_written_as_they_are_read(low in -1e9..1e9, length in 0.0..1e9, not in any::<bool>()) {
            let range = Range { ends: [low, low + length], closed: [not, true], negated: not };
            let filter = Filter { ranges: vec![("Z".into(), vec![range])], classes: None };
            prop_assert_eq!(filter.to_string().parse::<Filter>().unwrap(), filter);
        }

        /// No text makes the parser panic.
        #[test]
        fn any_text_is_read_or_refused(text in "[A-Za-z!\\[\\]():,.0-9 é-]{0,24}") {
            let _ = text.parse::<Filter>();
        }
    }
}
