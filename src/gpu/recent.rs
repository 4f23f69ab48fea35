//! What was asked for last, of what is dear to make and to keep.

use std::collections::HashMap;
use std::hash::Hash;

/// So many values at most, by their keys: where one more comes, the one goes that was not asked for the longest.
pub(super) struct Recent<K, V> {
    most: usize,
    /// Each with the number of the question that it was the last answer to.
    kept: HashMap<K, (u64, V)>,
    questions: u64,
}

impl<K: Eq + Hash, V: Clone> Recent<K, V> {
    /// None yet.
    pub fn of(most: usize) -> Self {
        Self { most, kept: HashMap::new(), questions: 0 }
    }

    /// The value of a key, if it is kept.
    pub fn get(&mut self, key: &K) -> Option<V> {
        self.questions += 1;
        let (last, value) = self.kept.get_mut(key)?;
        *last = self.questions;
        Some(value.clone())
    }

    /// Keeps a value.
    pub fn insert(&mut self, key: K, value: V) {
        self.questions += 1;
        self.kept.insert(key, (self.questions, value));
        if self.kept.len() > self.most {
            let oldest = self.kept.values().map(|(last, _)| *last).min();
            self.kept.retain(|_, (last, _)| Some(*last) != oldest);
        }
    }

    /// All that are kept.
    #[cfg(test)]
    pub fn values(&self) -> impl Iterator<Item = &V> {
        self.kept.values().map(|(_, value)| value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_one_goes_that_was_not_asked_for_the_longest() {
        let mut recent = Recent::of(2);
        recent.insert("a", 1);
        recent.insert("b", 2);
        assert_eq!(recent.get(&"a"), Some(1));
        recent.insert("c", 3);
        assert_eq!([recent.get(&"a"), recent.get(&"b"), recent.get(&"c")], [Some(1), None, Some(3)]);
        recent.insert("c", 4);
        assert_eq!([recent.get(&"a"), recent.get(&"c")], [Some(1), Some(4)]);
    }
}
