//! A cache of recently used values that are expensive to compute and to keep.

use std::collections::HashMap;
use std::hash::Hash;

/// A cache of at most `most` values. When it is full, a new value replaces the least recently used
/// one.
pub(super) struct Recent<K, V> {
    most: usize,
    /// Each value with the number of the query that last returned or inserted it.
    kept: HashMap<K, (u64, V)>,
    questions: u64,
}

impl<K: Eq + Hash, V: Clone> Recent<K, V> {
    /// Creates an empty cache of at most `most` values.
    pub fn of(most: usize) -> Self {
        Self { most, kept: HashMap::new(), questions: 0 }
    }

    /// Returns the value of `key` if the cache has it, and marks it as used.
    pub fn get(&mut self, key: &K) -> Option<V> {
        self.questions += 1;
        let (last, value) = self.kept.get_mut(key)?;
        *last = self.questions;
        Some(value.clone())
    }

    /// Inserts a value, and removes the least recently used one if there are too many.
    pub fn insert(&mut self, key: K, value: V) {
        self.questions += 1;
        self.kept.insert(key, (self.questions, value));
        if self.kept.len() > self.most {
            let oldest = self.kept.values().map(|(last, _)| *last).min();
            self.kept.retain(|_, (last, _)| Some(*last) != oldest);
        }
    }

    /// All values in the cache.
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
