//! Columns of rows that several threads work on.

use crate::math::{Row, Scalar};
use crate::workers::DisjointSlice;

/// The columns that several threads work on.
#[derive(Clone, Copy)]
pub(in crate::swarm) struct SolverColumns<'a, S> {
    /// Center and radius.
    pub at: DisjointSlice<'a, Row<S>>,
    /// Velocity and inverse mass.
    pub velocity: DisjointSlice<'a, Row<S>>,
    /// Radius times spin, and nothing.
    pub spin: DisjointSlice<'a, Row<S>>,
    /// The normal of the wall behind each ball, and the impulse that it bears for those who press
    /// the ball on it, in N s; empty where all weigh about as much.
    ///
    /// A light ball that a heavy one presses on a wall takes a thousandth of its momentum at a
    /// time, if the wall takes it after that. So the wall takes it at once, as if pair and wall
    /// were solved together: the ball is moved only by what goes along the wall, and weighs as much
    /// more along the normal of the pair (the Schur complement of the wall's contact).
    pub backing: DisjointSlice<'a, Row<S>>,
    /// One for each axis along which a ball moves freely, zero for a locked one; empty if none is locked.
    pub free_axes: DisjointSlice<'a, Row<S>>,
    /// Remaining skin of each ball, in metres.
    pub skin_left: DisjointSlice<'a, S>,
    /// Velocity of the wall behind along its normal, in m/s; empty if all are at rest.
    pub backing_speed: DisjointSlice<'a, S>,
}

impl<'a, S: Scalar> SolverColumns<'a, S> {
    /// Columns of rows and of numbers, in the order of the fields.
    pub fn new(rows: [&'a mut [Row<S>]; 5], numbers: [&'a mut [S]; 2]) -> Self {
        let [at, velocity, spin, backing, free_axes] = rows.map(DisjointSlice::new);
        let [skin_left, backing_speed] = numbers.map(DisjointSlice::new);
        Self { at, velocity, spin, backing, free_axes, skin_left, backing_speed }
    }
}
