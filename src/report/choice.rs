//! The section of the page on which configuration to use for an acceptable error.

use std::collections::BTreeSet;

use super::case::Case;
use super::pareto::best;
use super::results::Measurement;
use super::text::{escape, optional, significant};

/// An error limit: zero, which is less than every power, or a power of ten.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Limit {
    Exact,
    Power(i32),
}

impl Limit {
    /// Returns the smallest limit that holds for an error.
    fn of(error: f64) -> Self {
        // The tolerance is for errors such as 1e-6, whose logarithm may be slightly more than -6.
        if error > 0.0 { Self::Power((error.log10() - 1e-9).ceil() as i32) } else { Self::Exact }
    }

    fn kept_by(self, measurement: &Measurement) -> bool {
        measurement.numeric_error().is_some_and(|error| Self::of(error) <= self)
    }

    fn name(self) -> String {
        match self {
            Self::Exact => "0 (exact)".to_owned(),
            Self::Power(power) => format!("1e{power}"),
        }
    }

    fn phrase(self) -> String {
        match self {
            Self::Exact => "Without any error".to_owned(),
            Self::Power(power) => format!("Within 1e{power}"),
        }
    }
}

/// Returns the fastest configuration within each limit, the tightest limit first. A limit with the
/// same answer as a tighter one is left out.
fn answers<'a>(case: &Case<'a>) -> Vec<(Limit, &'a Measurement)> {
    let mut answers: Vec<(Limit, &Measurement)> = Vec::new();
    for measurement in best(&case.measurements).into_iter().rev() {
        let Some(limit) = measurement.numeric_error().map(Limit::of) else { continue };
        // Measurements come in the order from slow and exact to fast, so a later one replaces an
        // earlier one with the same limit.
        if answers.last().is_some_and(|(last, _)| *last == limit) {
            answers.pop();
        }
        answers.push((limit, measurement));
    }
    answers
}

/// A configuration that ran in all cases, and the geometric mean of its median times, ms.
struct Overall<'a> {
    config: &'a str,
    milliseconds: f64,
}

/// Returns, for each limit, the configuration that keeps it in every case and has the least
/// geometric mean of times. With that mean, each case counts equally, however long it takes.
fn overall<'a>(cases: &[Case<'a>]) -> Vec<(Limit, Overall<'a>)> {
    let configs: BTreeSet<&str> = cases.iter().flat_map(|case| &case.measurements).map(|m| m.config.as_str()).collect();
    let limits: BTreeSet<Limit> =
        cases.iter().flat_map(|case| &case.measurements).filter_map(|m| m.numeric_error().map(Limit::of)).collect();
    let mean = |config: &str, limit: Limit| -> Option<f64> {
        let logarithms: Option<Vec<f64>> = cases
            .iter()
            .map(|case| {
                let m = case.measurements.iter().find(|m| m.config == config)?;
                (limit.kept_by(m) && m.total_ms.median > 0.0).then(|| m.total_ms.median.ln())
            })
            .collect();
        logarithms.map(|all| (all.iter().sum::<f64>() / all.len() as f64).exp())
    };
    let mut answers: Vec<(Limit, Overall<'a>)> = Vec::new();
    for limit in limits {
        let means = configs.iter().filter_map(|config| Some(Overall { config, milliseconds: mean(config, limit)? }));
        let Some(fastest) = means.min_by(|a, b| a.milliseconds.total_cmp(&b.milliseconds)) else { continue };
        if answers.last().is_none_or(|(_, last)| last.config != fastest.config) {
            answers.push((limit, fastest));
        }
    }
    answers
}

/// Returns the section of the page.
pub(super) fn section(cases: &[Case<'_>]) -> String {
    let rows: String = cases.iter().map(rows).collect();
    if rows.is_empty() {
        return format!(
            "<section><h2>Which to use</h2>{}<p>No configuration was compared with the reference.</p></section>",
            nearest_to_truth(cases)
        );
    }
    let sentence = match cases {
        [case] => sentence(
            "The fastest",
            answers(case).iter().map(|(limit, m)| (*limit, m.config.as_str(), m.total_ms.median)),
        ),
        _ => sentence(
            &format!("The fastest over all {} cases, by the geometric mean of their times", cases.len()),
            overall(cases).iter().map(|(limit, fastest)| (*limit, fastest.config, fastest.milliseconds)),
        ),
    };
    format!(
        "<section><h2>Which to use</h2>{}{sentence}<div class=\"scroll\"><table class=\"choice\"><thead><tr>\
         <th>RMSE against f64 at most</th><th>the fastest</th><th class=\"n\">ms</th><th class=\"n\">× raster</th>\
         <th class=\"n\">its RMSE</th></tr></thead>{rows}\
         </table></div></section>",
        nearest_to_truth(cases)
    )
}

/// Names the configuration whose picture is nearest to the true surface, for each case that has
/// one. Errors against the f64 reference of the same configuration do not tell which one is.
fn nearest_to_truth(cases: &[Case<'_>]) -> String {
    let item = |case: &Case<'_>| {
        let known = case.measurements.iter().filter_map(|m| Some((m.reconstruction_error()?, m)));
        let (error, m) = known.min_by(|(a, _), (b, _)| a.total_cmp(b))?;
        let (title, config, time) = (escape(&case.title), escape(&m.config), significant(m.total_ms.median, 3));
        Some(format!("<li>{title}: <strong>{config}</strong> (RMSE {}, {time} ms)</li>", significant(error, 2)))
    };
    let items: String = cases.iter().filter_map(item).collect();
    match items.is_empty() {
        true => String::new(),
        false => format!("<p>Nearest to the true surface:</p><ul class=\"answer\">{items}</ul>"),
    }
}

fn sentence<'a>(start: &str, answers: impl Iterator<Item = (Limit, &'a str, f64)>) -> String {
    let clauses: Vec<String> = answers
        .map(|(limit, config, time)| {
            format!("<li>{}: <strong>{}</strong> ({} ms)</li>", limit.phrase(), escape(config), significant(time, 3))
        })
        .collect();
    if clauses.is_empty() {
        return "<p>No configuration ran in all cases, so each case has its own answer.</p>".into();
    }
    format!("<p>{start}:</p><ul class=\"answer\">{}</ul>", clauses.concat())
}

/// Returns the table rows of a case. The scene's name has a row of its own, so that a phone shows
/// the answers without scrolling.
fn rows(case: &Case<'_>) -> String {
    let row = |(limit, m): &(Limit, &Measurement)| {
        let (limit, config, time) = (limit.name(), escape(&m.config), significant(m.total_ms.median, 3));
        let (ratio, error) = (optional(m.ratio_to_raster, 3), optional(m.numeric_error(), 2));
        format!(
            "<tr><td>{limit}</td><td>{config}</td><td class=\"n\">{time}</td><td class=\"n\">{ratio}</td>\
             <td class=\"n\">{error}</td></tr>"
        )
    };
    let rows: String = answers(case).iter().map(row).collect();
    if rows.is_empty() {
        return rows;
    }
    let scene = escape(&case.title);
    format!("<tbody><tr><th colspan=\"5\" scope=\"rowgroup\">{scene}</th></tr>{rows}</tbody>")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::case::cases;
    use crate::report::results::{Numeric, Summary};

    fn measurement(scene: &str, config: &str, median: f64, rmse: f64) -> Measurement {
        Measurement {
            scene: scene.into(),
            config: config.into(),
            total_ms: Summary { median, ..Summary::default() },
            numeric: Some(Numeric { rmse, ..Numeric::default() }),
            ..Measurement::default()
        }
    }

    #[test]
    fn each_decade_names_its_fastest_and_none_twice() {
        let all = [
            measurement("s", "exact", 100.0, 0.0),
            measurement("s", "slow", 50.0, 5e-7),
            measurement("s", "quick", 20.0, 1e-6),
            measurement("s", "beaten", 30.0, 2e-6),
            measurement("s", "rough", 1.0, 3e-3),
        ];
        let found: Vec<(Limit, String)> =
            answers(&cases(&all)[0]).iter().map(|(limit, m)| (*limit, m.config.clone())).collect();
        let expected = [(Limit::Exact, "exact"), (Limit::Power(-6), "quick"), (Limit::Power(-2), "rough")];
        assert_eq!(found, expected.map(|(limit, config)| (limit, config.to_owned())));
    }

    #[test]
    fn over_all_cases_a_limit_must_be_kept_in_each() {
        let all = [
            measurement("s", "a", 10.0, 1e-7),
            measurement("s", "b", 1.0, 1e-7),
            measurement("t", "a", 40.0, 1e-7),
            measurement("t", "b", 1.0, 1e-2),
            measurement("t", "only here", 0.1, 0.0),
        ];
        let found: Vec<(Limit, &str, f64)> =
            overall(&cases(&all)).iter().map(|(l, o)| (*l, o.config, o.milliseconds)).collect();
        assert_eq!(found.len(), 2);
        assert_eq!((found[0].0, found[0].1), (Limit::Power(-7), "a"));
        assert!((found[0].2 - 20.0).abs() < 1e-9);
        assert_eq!((found[1].0, found[1].1), (Limit::Power(-2), "b"));
    }
}
