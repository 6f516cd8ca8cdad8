//! Rows: vectors, with a fourth number that has another meaning.

use crate::math::{Row, Scalar};

/// The first three numbers of a row and of another, summed; the fourth is that of the first row.
pub(super) fn sum<S: Scalar>(a: &Row<S>, b: &Row<S>) -> Row<S> {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3]]
}

/// The first three numbers of a row, less those of another; the fourth is zero.
pub(super) fn less<S: Scalar>(a: &Row<S>, b: &Row<S>) -> Row<S> {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2], S::zero()]
}

/// Inner product of the first three numbers.
pub(super) fn dot<S: Scalar, const N: usize>(a: &[S; N], b: &[S; N]) -> S {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Drops the entries of a column that are not kept.
pub(super) fn retain<T: Copy>(column: &mut Vec<T>, kept: &[bool]) {
    if column.is_empty() {
        return;
    }
    let mut to = 0;
    for (from, kept) in kept.iter().enumerate() {
        if *kept {
            column[to] = column[from];
            to += 1;
        }
    }
    column.truncate(to);
}
