//! Collects the wanted attributes of points while a reader passes their numbers.

use serde::Serialize;

use super::filter::Filter;
use super::names::{Group, find};
use super::{ClassList, Range, Wanted};
use crate::io::Points;
use crate::io::fault::Fault;
use crate::io::points::retain;
use crate::io::values::shown;

/// The most attributes that an error names.
const MOST_NAMED: usize = 32;

/// From this magnitude on, an f32 has too few digits for the differences between numbers.
const WIDE: f64 = 65536.0;

/// One attribute of all points of an input, in the order of the points.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Column {
    /// The attribute's name in the file.
    pub name: String,
    /// The number that is subtracted from all values.
    pub base: f64,
    /// The values minus the base; NaN for points without one.
    pub values: Vec<f32>,
}

/// The range of an attribute's values.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Span {
    /// The attribute's name in the file.
    pub name: String,
    /// The smallest and the largest finite value; None if there is none.
    pub range: Option<[f64; 2]>,
}

/// Where a number of a point comes from.
#[derive(Clone, Copy, Debug)]
enum Source {
    /// A coordinate of its position.
    Axis(usize),
    /// An index in [`Collector::fields`].
    Field(usize),
}

/// The numbers that pass.
#[derive(Debug)]
enum Condition {
    Ranges(Vec<Range>),
    Classes(Box<ClassList>),
}

impl Condition {
    fn holds(&self, value: f64) -> bool {
        match self {
            Self::Ranges(ranges) => ranges.iter().any(|range| range.holds(value)),
            Self::Classes(classes) => classes.has(value),
        }
    }
}

/// The values of one attribute: in f32, or in f64 as soon as one is large.
#[derive(Debug)]
enum Values {
    Narrow(Vec<f32>),
    Wide(Vec<f64>),
}

impl Values {
    fn push(&mut self, value: f64) {
        match self {
            Self::Narrow(values) if value.abs() >= WIDE && value.is_finite() => {
                let mut wide: Vec<f64> = values.iter().map(|value| f64::from(*value)).collect();
                wide.push(value);
                *self = Self::Wide(wide);
            }
            Self::Narrow(values) => values.push(value as f32),
            Self::Wide(values) => values.push(value),
        }
    }

    #[cfg(feature = "e57")]
    fn truncate(&mut self, count: usize) {
        match self {
            Self::Narrow(values) => values.truncate(count),
            Self::Wide(values) => values.truncate(count),
        }
    }

    fn into_column(self, name: String) -> Column {
        match self {
            Self::Narrow(values) => Column { name, base: 0.0, values },
            Self::Wide(values) => {
                let least = values.iter().copied().filter(|value| value.is_finite()).fold(f64::INFINITY, f64::min);
                let base = if least.is_finite() { least } else { 0.0 };
                Column { name, base, values: values.into_iter().map(|value| (value - base) as f32).collect() }
            }
        }
    }
}

impl Column {
    /// Makes a column of values.
    pub fn new(name: impl Into<String>, values: impl IntoIterator<Item = f64>) -> Self {
        let mut all = Values::Narrow(Vec::new());
        values.into_iter().for_each(|value| all.push(value));
        all.into_column(name.into())
    }

    /// The value of a point.
    pub fn value(&self, index: usize) -> f64 {
        self.base + f64::from(self.values[index])
    }
}

/// Collects the wanted attributes of one file.
#[derive(Debug)]
pub(in crate::io) struct Collector {
    /// Indices of the file's attributes whose numbers are needed.
    pub fields: Vec<usize>,
    conditions: Vec<(Source, Condition)>,
    column: Option<(String, Source, Values)>,
    spans: Vec<(String, Source, [f64; 2])>,
    /// Whether each point passes, for readers that keep all points at first.
    keep: Vec<bool>,
    filtered: u64,
}

impl Collector {
    /// Finds the wanted attributes among those that a file has beside x, y and z. Returns None if
    /// nothing is wanted.
    ///
    /// # Errors
    ///
    /// [`Fault::Usage`] with the names of all attributes if one is missing.
    pub fn of(names: &[String], wanted: &Wanted) -> Result<Option<Self>, Fault> {
        if wanted.is_empty() {
            return Ok(None);
        }
        let axes = ["X", "Y", "Z"];
        let is_axis = |name: &str| axes.iter().position(|axis| axis.eq_ignore_ascii_case(name));
        let mut fields: Vec<usize> = Vec::new();
        let mut source = |field: usize| {
            let place = fields.iter().position(|known| *known == field).unwrap_or_else(|| {
                fields.push(field);
                fields.len() - 1
            });
            Source::Field(place)
        };
        let mut found = |name: &str| -> Result<(String, Source), Fault> {
            if let Some(axis) = is_axis(name.trim()) {
                return Ok((axes[axis].to_owned(), Source::Axis(axis)));
            }
            let field = find(name, names).ok_or_else(|| missing(name, names))?;
            Ok((names[field].clone(), source(field)))
        };
        let Wanted { column, filter: Filter { ranges, classes }, spans } = wanted;
        let mut conditions = Vec::new();
        for (name, ranges) in ranges {
            conditions.push((found(name)?.1, Condition::Ranges(ranges.clone())));
        }
        if let Some(classes) = classes {
            conditions.push((found("class")?.1, Condition::Classes(Box::new(*classes))));
        }
        let column = column.as_deref().map(&mut found).transpose()?;
        let column = column.map(|(name, source)| (name, source, Values::Narrow(Vec::new())));
        let mut all = Vec::new();
        if *spans {
            let own = names.iter().filter(|name| is_axis(name).is_none());
            for name in axes.into_iter().chain(own.map(String::as_str)) {
                let (name, source) = found(name)?;
                all.push((name, source, [f64::INFINITY, f64::NEG_INFINITY]));
            }
        }
        Ok(Some(Self { fields, conditions, column, spans: all, keep: Vec::new(), filtered: 0 }))
    }

    /// Takes a point. `value(k)` is its number of the attribute `fields[k]`. Returns false for a
    /// point that does not pass, which the reader leaves out.
    pub fn take(&mut self, position: &[f64; 3], value: impl Fn(usize) -> f64) -> bool {
        let number = |source: Source| match source {
            Source::Axis(axis) => position[axis],
            Source::Field(field) => value(field),
        };
        if !self.conditions.iter().all(|(source, condition)| condition.holds(number(*source))) {
            self.filtered += 1;
            return false;
        }
        if let Some((_, source, values)) = &mut self.column {
            values.push(number(*source));
        }
        for (_, source, [low, high]) in &mut self.spans {
            let value = number(*source);
            if value.is_finite() {
                (*low, *high) = (low.min(value), high.max(value));
            }
        }
        true
    }

    /// Takes a point of a reader that keeps all points, until [`finish`](Self::finish) leaves out
    /// those that do not pass.
    pub fn mark(&mut self, position: &[f64; 3], value: impl Fn(usize) -> f64) {
        let keep = self.take(position, value);
        if let Some((_, _, values)) = self.column.as_mut().filter(|_| !keep) {
            values.push(f64::NAN);
        }
        self.keep.push(keep);
    }

    /// Forgets the values of all points from the index `count` on.
    #[cfg(feature = "e57")]
    pub fn truncate(&mut self, count: usize) {
        if let Some((_, _, values)) = &mut self.column {
            values.truncate(count);
        }
    }

    /// Gives the points their attribute and the ranges, and leaves out those that do not pass.
    ///
    /// # Errors
    ///
    /// [`Fault::Usage`] if points are to be left out of a mesh.
    pub fn finish(self, points: &mut Points, is_mesh: bool) -> Result<(), Fault> {
        let Self { conditions, column, spans, keep, filtered, .. } = self;
        if is_mesh && !conditions.is_empty() {
            return Err(Fault::Usage(
                "it is a mesh, and filters are for points: leave --where and --classes out".into(),
            ));
        }
        points.column = column.map(|(name, _, values)| Box::new(values.into_column(name)));
        let span =
            |(name, _, range): (String, Source, [f64; 2])| Span { name, range: Some(range).filter(|r| r[0] <= r[1]) };
        points.spans = spans.into_iter().map(span).collect();
        points.filtered = filtered;
        if filtered == 0 || keep.is_empty() {
            return Ok(());
        }
        points.left_out = (0..).zip(&keep).filter(|(_, keep)| !**keep).map(|(index, _)| index).collect();
        points.numbers.iter_mut().for_each(|numbers| retain(numbers, &keep));
        match &mut points.raw {
            // Points that are left out still count where the range of colours is decided.
            Some(raw) => raw.leave_out(keep),
            None => points.retain(&keep),
        }
        Ok(())
    }
}

/// Collects the wanted attributes of points that have nothing but coordinates.
pub(in crate::io) fn of_positions(points: &mut Points, wanted: &Wanted) -> Result<(), Fault> {
    let Some(mut collector) = Collector::of(&[], wanted)? else { return Ok(()) };
    points.positions.iter().for_each(|position| collector.mark(position, |_| f64::NAN));
    let is_mesh = points.faces.is_some() || points.of_mesh;
    collector.finish(points, is_mesh)
}

/// The error for an attribute that a file does not have.
fn missing(name: &str, names: &[String]) -> Fault {
    let own = names.iter().filter(|name| !["x", "y", "z"].iter().any(|axis| axis.eq_ignore_ascii_case(name)));
    let all: Vec<String> =
        ["X", "Y", "Z"].into_iter().chain(own.map(String::as_str)).map(|name| shown(name.as_bytes())).collect();
    let more = all.len().saturating_sub(MOST_NAMED);
    let more = if more > 0 { format!(" and {more} more") } else { String::new() };
    let what = if Group::of(name) == Some(Group::Class) { "classes" } else { "attribute" };
    let name = if what == "classes" { String::new() } else { format!(" '{}'", shown(name.as_bytes())) };
    Fault::Usage(format!("it has no {what}{name}: it has {}{more}", all[..all.len().min(MOST_NAMED)].join(", ")))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn large_values_keep_their_differences() {
        // Seconds since 1980, 2 ms apart, among which an f32 has steps of 32 s.
        let times = [0, 1, 2, 3].map(|k| 3e8 + 0.002 * f64::from(k));
        let column = Column::new("GpsTime", times);
        assert_eq!(column.base, 3e8);
        for (index, time) in times.iter().enumerate() {
            assert!((column.value(index) - time).abs() < 1e-7, "{index}");
        }
        // A late large value does not lose the early small ones.
        let column = Column::new("a", [1.5, f64::NAN, 1e6]);
        assert_eq!((column.base, column.value(0), column.value(2)), (1.5, 1.5, 1e6));
        assert!(column.value(1).is_nan());
        assert_eq!(Column::new("a", [1.0, 65535.0]).base, 0.0);
    }

    #[test]
    fn points_pass_one_range_of_every_attribute() {
        let names = ["Intensity", "Classification"].map(str::to_owned);
        let filter = "class[2:2],class[6:6],Z[:120],intensity!(10:20)".parse().unwrap();
        let wanted = Wanted { column: Some("intensity".into()), filter, spans: true };
        let mut collector = Collector::of(&names, &wanted).unwrap().unwrap();
        let mut passes = |class: f64, z: f64, intensity: f64| {
            let fields = collector.fields.clone();
            collector.take(&[1.0, 2.0, z], |k| [intensity, class][fields[k]])
        };
        assert!(passes(2.0, 100.0, 5.0) && passes(6.0, 120.0, 20.0));
        assert!(!passes(3.0, 100.0, 5.0) && !passes(2.0, 121.0, 5.0) && !passes(6.0, 100.0, 15.0));
        let mut points = Points::default();
        collector.finish(&mut points, false).unwrap();
        assert_eq!(points.filtered, 3);
        assert_eq!(points.column.unwrap().values, [5.0, 20.0]);
        let spans: Vec<_> = points.spans.into_iter().map(|span| (span.name, span.range.unwrap())).collect();
        let expected = [("X", [1.0; 2]), ("Y", [2.0; 2]), ("Z", [100.0, 120.0]), ("Intensity", [5.0, 20.0])];
        assert_eq!(spans[..4], expected.map(|(name, range)| (name.to_owned(), range)));
        assert_eq!(spans[4], ("Classification".to_owned(), [2.0, 6.0]));
    }

    #[test]
    fn a_missing_attribute_is_named_with_those_that_exist() {
        let names = ["x", "scalar_height"].map(str::to_owned);
        let told = |name: &str| {
            let wanted = Wanted { column: Some(name.into()), ..Wanted::default() };
            match Collector::of(&names, &wanted) {
                Err(Fault::Usage(told)) => told,
                other => format!("{:?}", other.is_ok()),
            }
        };
        assert_eq!(told("width"), "it has no attribute 'width': it has X, Y, Z, scalar_height");
        assert_eq!(told("class"), "it has no classes: it has X, Y, Z, scalar_height");
        assert!(Collector::of(&names, &Wanted::default()).unwrap().is_none());
    }
}
