//! Disjoint sets of numbers, which can be united (union-find).

/// The numbers from 0 on, each in one set. An entry is the number itself or a smaller one of its
/// set.
pub(crate) struct Sets(Vec<u32>);

impl Sets {
    /// Puts each number below `count` into a set of its own.
    pub fn new(count: usize) -> Self {
        Self((0..count as u32).collect())
    }

    /// Returns the least number of the set that contains `number`.
    pub fn least(&mut self, mut number: u32) -> u32 {
        while self.0[number as usize] != number {
            self.0[number as usize] = self.0[self.0[number as usize] as usize];
            number = self.0[number as usize];
        }
        number
    }

    /// Unites the sets that contain two numbers.
    pub fn unite(&mut self, a: u32, b: u32) {
        let [a, b] = [a, b].map(|number| self.least(number));
        self.0[a.max(b) as usize] = a.min(b);
    }

    /// The least number of each number's set.
    pub fn all(mut self) -> Vec<u32> {
        (0..self.0.len() as u32).map(|number| self.least(number)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn united_numbers_have_one_least() {
        let mut sets = Sets::new(6);
        [(5, 3), (1, 2), (3, 1)].into_iter().for_each(|(a, b)| sets.unite(a, b));
        assert_eq!(sets.least(5), 1);
        assert_eq!(sets.all(), [0, 1, 1, 1, 4, 1]);
    }
}
