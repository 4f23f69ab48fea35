//! A guess of what the columns of a table without names are, from their number and their values.

/// The first rows of a table.
#[derive(Debug, Default)]
pub(super) struct Sample {
    /// Their numbers; all rows have the same length of three or more.
    pub(super) rows: Vec<Vec<f64>>,
    /// For each column, whether a number is written with a decimal point or an exponent.
    pub(super) fractional: Vec<bool>,
    /// The table is a PTS file: the intensity precedes the colour.
    pub(super) is_pts: bool,
    /// The number of points stands in front, as in PTS files.
    pub(super) is_counted: bool,
}

/// The guessed names of columns.
#[derive(Debug, Default)]
pub(super) struct Guess {
    pub(super) names: Vec<String>,
    /// A reason why they may be something else, as a clause.
    pub(super) doubt: Option<String>,
}

/// The names of the columns of a sample.
///
/// After x, y and z, three columns are colours if they are whole numbers from 0 to 255, normals if
/// they have unit length, and colours too if they lie between 0 and 1 and are the last ones. A
/// single column before such a triple, or one that is left over, is an intensity. Where either of
/// four columns may be the single one, the way in which numbers are written decides, then their
/// variety, and then the order of most programs: colours first, in PTS files last.
pub(super) fn names(sample: &Sample) -> Guess {
    let rows = &sample.rows;
    let count = rows.first().map_or(0, Vec::len);
    let mut names: Vec<String> = ["x", "y", "z"].map(str::to_owned).to_vec();
    let mut doubt = None;
    let has = |names: &[String], name: &str| names.iter().any(|own| own == name);
    while names.len() < count {
        let (at, left) = (names.len(), count - names.len());
        let triple = |at: usize| triple_at(rows, at, at + 3 == count);
        let is_new = |kind: &Triple| !has(&names, kind.names()[0]);
        let here = triple(at).filter(&is_new);
        let has_intensity = has(&names, "intensity");
        let has_unknown = names.last().is_some_and(|name| name.starts_with("column"));
        // Leica's order: intensity, red, green, blue.
        let later = (left % 3 == 1 && !has_intensity).then(|| triple(at + 1)).flatten().filter(is_new);
        let is_first = match (here, later) {
            (Some(here), Some(later)) => sample.leads(at, [here, later]).unwrap_or_else(|| {
                let first = sample.is_counted;
                let [one, other] = if first { [at + 1, at + 4] } else { [at + 4, at + 1] };
                doubt.get_or_insert(format!(
                    "column {one} is taken as the one that is no colour, which may be column {other}"
                ));
                first
            }),
            (_, later) => later.is_some(),
        };
        match here.filter(|_| !is_first) {
            Some(kind) => {
                if kind == Triple::Normal && are_bright(rows, at) {
                    doubt.get_or_insert(format!("the normals in columns {} to {} may be colours", at + 1, at + 3));
                }
                names.extend(kind.names().map(str::to_owned));
            }
            None if is_first => names.push("intensity".to_owned()),
            None if !has_intensity && (at == 3 && left < 3 || left == 1 && !has_unknown) => {
                names.push("intensity".to_owned())
            }
            None => {
                if left >= 3 && are_words(rows, at) {
                    doubt.get_or_insert(format!("columns {} to {} may be colours of 16 bits", at + 1, at + 3));
                }
                names.push(format!("column_{}", at + 1));
            }
        }
    }
    Guess { names, doubt }
}

impl Sample {
    /// Whether the single column among the four from `at` on is the first one, and not the last,
    /// where the triple behind it and the one before the last have these kinds. None if nothing
    /// tells.
    fn leads(&self, at: usize, kinds: [Triple; 2]) -> Option<bool> {
        match kinds {
            [Triple::Color, Triple::Color] => {}
            [Triple::Normal, _] => return Some(false),
            [Triple::Color, Triple::Normal] => return (!are_bright(&self.rows, at + 1)).then_some(true),
        }
        if self.is_pts {
            return Some(true);
        }
        // Programs write channels alike: 120 0 255, beside 7.000000.
        if let Some(&[first, two, three, last]) = self.fractional.get(at..at + 4)
            && two == three
            && first != last
        {
            return Some(first != two);
        }
        let variety = |column: usize| {
            let mut all: Vec<u64> = self.rows.iter().filter_map(|row| row.get(column)).map(|c| c.to_bits()).collect();
            all.sort_unstable();
            all.dedup();
            all.len()
        };
        // Classes and labels are few.
        let [first, last] = [variety(at), variety(at + 3)];
        (first >= 4 * last || last >= 4 * first).then_some(first < last)
    }
}

/// Whether all vectors from column `at` on are zero or axes without a negative part, as normals of
/// a floor and pure colours are.
fn are_bright(rows: &[Vec<f64>], at: usize) -> bool {
    rows.iter().filter_map(|row| row.get(at..at + 3)).flatten().all(|c| [0.0, 1.0].contains(c))
}

/// Whether three columns are whole numbers of 16 bits, of which one is above 255.
fn are_words(rows: &[Vec<f64>], at: usize) -> bool {
    let all = || rows.iter().filter_map(|row| row.get(at..at + 3)).flatten();
    all().all(|c| c.fract() == 0.0 && (0.0..=65535.0).contains(c)) && all().any(|c| *c > 255.0)
}

/// Three columns that belong together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Triple {
    Color,
    Normal,
}

impl Triple {
    fn names(self) -> [&'static str; 3] {
        match self {
            Self::Color => ["red", "green", "blue"],
            Self::Normal => ["nx", "ny", "nz"],
        }
    }
}

/// The kind of the three columns from `at` on; None if they are neither.
fn triple_at(rows: &[Vec<f64>], at: usize, is_last: bool) -> Option<Triple> {
    let triples = rows.iter().filter_map(|row| row.get(at..at + 3));
    let all = |holds: &dyn Fn(&[f64]) -> bool| triples.clone().all(holds);
    let length = |triple: &[f64]| triple.iter().map(|c| c * c).sum::<f64>().sqrt();
    let is_zero = |triple: &[f64]| triple.iter().all(|c| *c == 0.0);
    triples.clone().next()?;
    // Missing normals are zero; a table of zeros alone has none.
    let are_unit = all(&|triple| is_zero(triple) || (length(triple) - 1.0).abs() < 0.01);
    if are_unit && !all(&is_zero) {
        return Some(Triple::Normal);
    }
    let is_code = |c: &f64| c.fract() == 0.0 && (0.0..=255.0).contains(c);
    let are_shares = is_last && all(&|triple| triple.iter().all(|c| (0.0..=1.0).contains(c)));
    (all(&|triple| triple.iter().all(is_code)) || are_shares).then_some(Triple::Color)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of_sample(rows: Vec<Vec<f64>>) -> Guess {
        names(&Sample { rows, ..Sample::default() })
    }

    fn guessed(rows: &[&[f64]]) -> String {
        of_sample(rows.iter().map(|row| row.to_vec()).collect()).names.join(" ")
    }

    #[test]
    fn columns_are_guessed_by_number_and_values() {
        let xyz = [1.5, -2.0, 3.0];
        let of = |rest: &[&[f64]]| {
            let rows: Vec<Vec<f64>> = rest.iter().map(|rest| [&xyz, *rest].concat()).collect();
            of_sample(rows).names[3..].join(" ")
        };
        assert_eq!(guessed(&[&xyz]), "x y z");
        assert_eq!(of(&[&[0.5]]), "intensity");
        assert_eq!(of(&[&[-1200.0, 12.0, 255.0, 0.0]]), "intensity red green blue");
        assert_eq!(of(&[&[12.0, 255.0, 0.0]]), "red green blue");
        assert_eq!(of(&[&[12.0, 255.0, 0.0, 0.4]]), "red green blue intensity");
        assert_eq!(of(&[&[0.6, 0.8, 0.0], &[0.0, 0.0, 1.0], &[0.0, 0.0, 0.0]]), "nx ny nz");
        assert_eq!(of(&[&[0.0, 0.0, 1.0], &[0.0, 0.0, 1.0]]), "nx ny nz");
        assert_eq!(of(&[&[0.0, 0.0, 0.0]]), "red green blue");
        assert_eq!(of(&[&[0.1, 0.2, 0.9], &[1.0, 1.0, 0.5]]), "red green blue");
        assert_eq!(of(&[&[1.0, 2.0, 3.0, 0.0, -0.6, 0.8]]), "red green blue nx ny nz");
        assert_eq!(of(&[&[0.0, -0.6, 0.8, 9.0, 99.0, 7.0]]), "nx ny nz red green blue");
        assert_eq!(of(&[&[7.5, 9.0, 99.0, 7.0, 0.0, -0.6, 0.8]]), "intensity red green blue nx ny nz");
        assert_eq!(of(&[&[300.0, 2.0]]), "intensity column_5");
        assert_eq!(of(&[&[300.5, 2.0, -7.0]]), "column_4 column_5 column_6");
    }

    #[test]
    fn the_single_one_of_four_columns_is_found() {
        let rows = |rest: fn(u32) -> [u32; 4]| -> Vec<Vec<f64>> {
            let row = |k: u32| [&[1.5, 2.0, 3.0][..], &rest(k).map(f64::from)].concat();
            (0..40).map(row).collect()
        };
        let of = |sample: &Sample| {
            let Guess { names, doubt } = names(sample);
            (names[3..].join(" "), doubt.is_some())
        };
        let [first, last] = ["intensity red green blue", "red green blue intensity"].map(str::to_owned);
        // Classes have few values, before the colours and behind them.
        let labels = rows(|k| [k * 5, k * 3 + 1, k * 2 + 7, k % 2]);
        let leading = rows(|k| [k % 2, k * 5, k * 3 + 1, k * 2 + 7]);
        assert_eq!(of(&Sample { rows: labels.clone(), ..Sample::default() }), (last.clone(), false));
        assert_eq!(of(&Sample { rows: leading, ..Sample::default() }), (first.clone(), false));
        assert_eq!(of(&Sample { rows: labels, is_pts: true, ..Sample::default() }), (first.clone(), false));
        // The way in which numbers are written.
        let alike = rows(|k| [k * 5, k * 3 + 1, k * 2 + 7, k + 9]);
        let written = |fractional: [bool; 4]| {
            let fractional = [&[true; 3][..], &fractional].concat();
            of(&Sample { rows: alike.clone(), fractional, ..Sample::default() })
        };
        assert_eq!(written([false, false, false, true]), (last.clone(), false));
        assert_eq!(written([true, false, false, false]), (first.clone(), false));
        assert_eq!(written([false, true, true, true]), (first.clone(), false));
        // Nothing tells: the order of most programs, with a warning.
        assert_eq!(written([false; 4]), (last, true));
        assert_eq!(of(&Sample { rows: alike, is_counted: true, ..Sample::default() }), (first, true));
        // The rest of a normal may have unit length with the curvature behind it.
        let normals = vec![vec![0.0, 0.0, 0.0, 0.001, 0.6, 0.8, 0.002]; 3];
        assert_eq!(of(&Sample { rows: normals, ..Sample::default() }), ("nx ny nz intensity".into(), false));
    }

    #[test]
    fn doubts_are_told() {
        let doubt = |rest: &[[f64; 3]]| {
            let rows = rest.iter().map(|rest| [&[1.5, 2.0, 3.0][..], rest].concat()).collect();
            of_sample(rows).doubt.unwrap_or_default()
        };
        assert_eq!(doubt(&[[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]), "the normals in columns 4 to 6 may be colours");
        assert_eq!(doubt(&[[1.0, 0.0, 0.0], [0.0, 0.0, -1.0]]), "");
        assert_eq!(doubt(&[[65535.0, 0.0, 30000.0]]), "columns 4 to 6 may be colours of 16 bits");
        assert_eq!(doubt(&[[65536.0, 0.0, 30000.0]]), "");
    }
}
