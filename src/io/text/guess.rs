//! A guess of what the columns of a table without names are, from their number and their values.

/// The names of the columns of sample `rows`, which all have the same length of three or more.
///
/// After x, y and z, three columns are colours if they are whole numbers from 0 to 255, normals if
/// they have unit length, and colours too if they lie between 0 and 1 and are the last ones. A
/// single column before such a triple, or one that is left over, is an intensity.
pub(super) fn names(rows: &[Vec<f64>]) -> Vec<String> {
    let count = rows.first().map_or(0, Vec::len);
    let mut names: Vec<String> = ["x", "y", "z"].map(str::to_owned).to_vec();
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
        match (later, here) {
            (None, Some(kind)) => names.extend(kind.names().map(str::to_owned)),
            (Some(_), _) => names.push("intensity".to_owned()),
            _ if !has_intensity && (at == 3 && left < 3 || left == 1 && !has_unknown) => {
                names.push("intensity".to_owned())
            }
            _ => names.push(format!("column_{}", at + 1)),
        }
    }
    names
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

    fn guessed(rows: &[&[f64]]) -> String {
        names(&rows.iter().map(|row| row.to_vec()).collect::<Vec<_>>()).join(" ")
    }

    #[test]
    fn columns_are_guessed_by_number_and_values() {
        let xyz = [1.5, -2.0, 3.0];
        let of = |rest: &[&[f64]]| {
            let rows: Vec<Vec<f64>> = rest.iter().map(|rest| [&xyz, *rest].concat()).collect();
            names(&rows)[3..].join(" ")
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
}
