/// A column that exists only while some row has a value of its own.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Optional<T> {
    /// Empty, or as long as the other columns.
    values: Vec<Option<T>>,
}

impl<T> Default for Optional<T> {
    fn default() -> Self {
        Self { values: Vec::new() }
    }
}

impl<T: Copy> Optional<T> {
    /// Whether no row has a value.
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    pub fn get(&self, row: usize) -> Option<T> {
        self.values.get(row).copied().flatten()
    }

    /// Sets the value of a new last row, `rows` with it.
    pub fn push(&mut self, value: Option<T>, rows: usize) {
        if value.is_some() {
            self.values.resize(rows - 1, None);
            self.values.push(value);
        } else if !self.values.is_empty() {
            self.values.push(None);
        }
    }

    /// Sets the value of one of `rows` rows.
    pub fn set(&mut self, row: usize, value: Option<T>, rows: usize) {
        if self.values.is_empty() && value.is_none() {
            return;
        }
        self.values.resize(rows, None);
        self.values[row] = value;
        self.shrink();
    }

    pub fn swap_remove(&mut self, row: usize) {
        if !self.values.is_empty() {
            self.values.swap_remove(row);
            self.shrink();
        }
    }

    /// Gives the column up when the last value is gone. A value in the first row
    /// answers at once, which is the usual case.
    fn shrink(&mut self) {
        if self.values.iter().all(Option::is_none) {
            self.values.clear();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_column_exists_only_while_a_row_has_a_value() {
        let mut column = Optional::default();
        column.set(2, None, 5);
        assert!(column.is_empty());
        column.set(3, Some('x'), 5);
        assert_eq!((column.get(0), column.get(3), column.get(99)), (None, Some('x'), None));
        column.swap_remove(0); // the last row, without a value, takes its place
        assert_eq!(column.get(3), Some('x'));
        column.swap_remove(1); // row 3 takes the place of row 1
        assert_eq!((column.get(1), column.get(3)), (Some('x'), None));
        column.set(1, None, 3);
        assert!(column.is_empty());
    }
}
