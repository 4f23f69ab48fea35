//! A choice of classes by name or number.

use std::fmt;
use std::str::FromStr;

use crate::error::Error;
use crate::io::class_name;

/// Some of the 256 classes of laser scans.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ClassList([bool; 256]);

/// Names for several classes, and short names.
const ALSO: [(&str, &[u8]); 6] = [
    ("vegetation", &[3, 4, 5]),
    ("buildings", &[6]),
    ("bridge", &[17]),
    ("low noise", &[7]),
    ("wires", &[13, 14]),
    ("unclassified", &[0, 1]),
];

impl ClassList {
    /// Whether the list has a class; numbers that are no class are not in it.
    pub fn has(&self, class: f64) -> bool {
        class.fract() == 0.0 && (0.0..256.0).contains(&class) && self.0[class as usize]
    }
}

/// A name in lower case with blanks between its words.
fn plain(name: &str) -> String {
    name.trim().to_lowercase().replace(['_', '-'], " ")
}

/// The classes of one item of a list.
fn classes(item: &str) -> Option<Vec<u8>> {
    let number = |text: &str| text.trim().parse::<u8>().ok();
    if let Some(class) = number(item) {
        return Some(vec![class]);
    }
    if let Some((first, last)) = item.split_once('-').and_then(|(a, b)| number(a).zip(number(b))) {
        return (first <= last).then(|| (first..=last).collect());
    }
    let name = plain(item);
    if name == "others" {
        return Some((0..=255).filter(|class| class_name(*class).is_none()).collect());
    }
    let also = ALSO.iter().find(|(known, _)| *known == name).map(|(_, classes)| classes.to_vec());
    also.or_else(|| {
        (0..=255).find(|class| class_name(*class).is_some_and(|known| plain(known) == name)).map(|class| vec![class])
    })
}

impl FromStr for ClassList {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        let mut list = Self([false; 256]);
        for item in text.split(',') {
            let found = classes(item).ok_or_else(|| {
                let names: Vec<_> = (0..=255).filter_map(class_name).collect();
                Error::Usage(format!(
                    "{item:?} is no class: give numbers such as 2 or 3-5, or names ({}, vegetation for 3 to 5, others for classes without \
                     a name)",
                    names.join(", ")
                ))
            })?;
            found.into_iter().for_each(|class| list.0[usize::from(class)] = true);
        }
        Ok(list)
    }
}

impl fmt::Display for ClassList {
    /// Writes the syntax that `from_str` reads.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let numbers: Vec<_> = (0..256).filter(|class| self.0[*class]).map(|class| class.to_string()).collect();
        f.write_str(&numbers.join(","))
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn classes_are_chosen_by_name_and_number() {
        let list = |text: &str| {
            let list: ClassList = text.parse().unwrap();
            assert_eq!(list.to_string().parse::<ClassList>().unwrap(), list);
            (0..=255).filter(|class| list.has(f64::from(*class))).collect::<Vec<u8>>()
        };
        assert_eq!(list("ground,building"), [2, 6]);
        assert_eq!(list("2, 6"), [2, 6]);
        assert_eq!(list("Vegetation,9"), [3, 4, 5, 9]);
        assert_eq!(list("high_vegetation,low-vegetation"), [3, 5]);
        assert_eq!(list("3-5"), [3, 4, 5]);
        let others = list("others");
        assert!(!others.contains(&2) && others.contains(&64) && others.contains(&255) && others.len() > 200);
        let ground: ClassList = "2".parse().unwrap();
        assert!(
            ground.has(2.0) && !ground.has(2.5) && !ground.has(-2.0) && !ground.has(f64::NAN) && !ground.has(258.0)
        );
        for bad in ["", "grass", "256", "5-3", "2,"] {
            assert!(bad.parse::<ClassList>().unwrap_err().to_string().contains("is no class"), "{bad}");
        }
    }
}
