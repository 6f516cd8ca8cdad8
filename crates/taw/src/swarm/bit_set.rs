//! Sets of small numbers.

/// A bit for each number.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct BitSet {
    /// The last one is not zero.
    words: Vec<u64>,
}

impl BitSet {
    /// Empties the set.
    pub fn clear(&mut self) {
        self.words.clear();
    }

    /// Adds a number. Returns whether it was new.
    pub fn insert(&mut self, number: u32) -> bool {
        let (word, bit) = (number as usize / 64, 1 << (number % 64));
        if self.words.len() <= word {
            self.words.resize(word + 1, 0);
        }
        let is_new = self.words[word] & bit == 0;
        self.words[word] |= bit;
        is_new
    }

    /// Removes a number. Returns whether it was there.
    pub fn remove(&mut self, number: u32) -> bool {
        let was_there = self.contains(number);
        if was_there {
            self.words[number as usize / 64] &= !(1 << (number % 64));
            while self.words.last() == Some(&0) {
                self.words.pop();
            }
        }
        was_there
    }

    #[inline]
    pub fn contains(&self, number: u32) -> bool {
        let word = self.words.get(number as usize / 64);
        word.is_some_and(|word| word >> (number % 64) & 1 == 1)
    }

    /// Its numbers, in order.
    pub fn iter(&self) -> impl Iterator<Item = u32> + '_ {
        (0..).zip(&self.words).flat_map(|(i, word)| {
            let some = |word: u64| (word != 0).then_some(word);
            let left = std::iter::successors(some(*word), move |left| some(left & (left - 1)));
            left.map(move |left| 64 * i + left.trailing_zeros())
        })
    }

    pub fn is_empty(&self) -> bool {
        self.words.is_empty()
    }

    pub fn bytes(&self) -> usize {
        self.words.capacity() * size_of::<u64>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_come_in_order_and_sets_of_equal_numbers_are_equal() {
        let mut set = BitSet::default();
        let numbers = [0, 63, 64, 127, 500, 3];
        assert!(numbers.iter().all(|number| set.insert(*number)) && !set.insert(64));
        assert!(set.iter().eq([0, 3, 63, 64, 127, 500]));
        let mut other = set.clone();
        assert!(other.insert(9_000) && other != set && other.remove(9_000));
        assert_eq!(other, set);
        assert!(numbers.iter().all(|number| set.remove(*number)) && !set.remove(7_000));
        assert!(set.is_empty() && set == BitSet::default());
    }
}
