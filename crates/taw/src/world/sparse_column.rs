/// A sparse column: allocated only while some marble has a value of its own.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct SparseColumn<T> {
    /// Empty, or as long as the other columns.
    values: Vec<Option<T>>,
    /// Number of present values.
    present: usize,
}

impl<T> Default for SparseColumn<T> {
    fn default() -> Self {
        Self { values: Vec::new(), present: 0 }
    }
}

impl<T: Copy> SparseColumn<T> {
    /// Returns true if no index has a value.
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    pub fn get(&self, row: usize) -> Option<T> {
        self.values.get(row).copied().flatten()
    }

    /// Sets the value at an index of `rows`, the last of which may be new.
    pub fn set(&mut self, row: usize, value: Option<T>, rows: usize) {
        if self.values.is_empty() && value.is_none() {
            return;
        }
        self.values.resize(rows, None);
        if let Some(slot) = self.values.get_mut(row) {
            let last = std::mem::replace(slot, value);
            self.count(value.is_some(), last.is_some());
        }
    }

    /// Iterates over the values that there are.
    pub fn values(&self) -> impl Iterator<Item = T> + '_ {
        self.values.iter().copied().flatten()
    }

    /// Clears all values.
    pub fn clear(&mut self) {
        self.values.clear();
        self.present = 0;
    }

    pub fn swap_remove(&mut self, row: usize) {
        if !self.values.is_empty() {
            let last = self.values.swap_remove(row);
            self.count(false, last.is_some());
        }
    }

    /// Updates the count. Without values the column is deallocated.
    fn count(&mut self, came: bool, went: bool) {
        self.present = self.present + usize::from(came) - usize::from(went);
        if self.present == 0 {
            self.values.clear();
        }
    }
}

/// Declares a set of sparse columns, and the values that one row has of them, from one list.
macro_rules! sparse_columns {
    ($(#[$doc:meta])* $columns:ident, $values:ident {
        $($(#[$field_doc:meta])* $field:ident: $type:ty,)*
    }) => {
        $(#[$doc])*
        #[derive(Clone, Debug, PartialEq, Default)]
        pub(super) struct $columns<S> {
            $($(#[$field_doc])* pub $field: SparseColumn<$type>,)*
        }

        /// Values of one row.
        pub(super) struct $values<S> {
            $(pub $field: Option<$type>,)*
        }

        impl<S: Scalar> $columns<S> {
            /// Adds a row, as the last one of `rows`.
            pub fn push(&mut self, values: $values<S>, rows: usize) {
                $(self.$field.set(rows - 1, values.$field, rows);)*
            }

            /// Removes a row; the last one takes its place.
            pub fn swap_remove(&mut self, row: usize) {
                $(self.$field.swap_remove(row);)*
            }
        }
    };
}
pub(super) use sparse_columns;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_column_exists_only_while_a_row_has_a_value() {
        let mut column = SparseColumn::default();
        column.set(2, None, 5);
        assert!(column.is_empty());
        column.set(3, Some('x'), 5);
        assert_eq!((column.get(0), column.get(3), column.get(99)), (None, Some('x'), None));
        column.set(5, None, 6); // a new row without one
        column.swap_remove(0); // it takes the place of row 0
        assert_eq!((column.get(0), column.get(3)), (None, Some('x')));
        column.set(1, Some('y'), 5);
        column.set(1, Some('z'), 5);
        column.swap_remove(3); // the row with x
        assert_eq!((column.get(1), column.get(3)), (Some('z'), None));
        column.set(1, None, 4);
        assert!(column.is_empty());
        column.set(4, Some('w'), 5); // as the first value of a new row
        assert_eq!(column.get(4), Some('w'));
        column.swap_remove(4);
        assert!(column.is_empty());
    }
}
