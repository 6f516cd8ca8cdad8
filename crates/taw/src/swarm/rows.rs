//! Sums and products of rows: vectors, with a fourth number that has another meaning.

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
