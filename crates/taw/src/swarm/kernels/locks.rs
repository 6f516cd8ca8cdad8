//! Balls with locked axes, as pairs see them: what is pushed along a locked axis does not move, and weighs
//! as much more along the normal of the pair.

use super::contact::SolverColumns;
use super::{gather, inverse_mass};
use crate::math::{Scalar, Simd, Vec3Wide};
use crate::motion::LEAST_SHARE;
use crate::swarm::batches::Batch;

impl<S: Scalar> SolverColumns<'_, S> {
    /// Velocities of the pairs with the inverse masses by which they are pushed along the normal: what
    /// locks leave of them.
    #[inline(always)]
    pub(super) fn pushed<L: Simd<Scalar = S>, const LOCKED: bool>(
        &self,
        batch: &Batch,
        [a, b]: &[[L; 4]; 2],
        normal: Vec3Wide<L>,
    ) -> [[L; 4]; 2] {
        if !LOCKED {
            return [*a, *b];
        }
        let [free_a, free_b] = gather::<L>(self.free_axes, batch);
        [pushed_row(a, &free_a, normal), pushed_row(b, &free_b, normal)]
    }

    /// Parts of two vectors along the free axes of the balls.
    #[inline(always)]
    pub(super) fn free_parts<L: Simd<Scalar = S>>(
        &self,
        batch: &Batch,
        [a, b]: [Vec3Wide<L>; 2],
    ) -> [Vec3Wide<L>; 2] {
        let [free_a, free_b] = gather::<L>(self.free_axes, batch);
        [free_part(a, &free_a), free_part(b, &free_b)]
    }
}

/// Part of a vector along free axes.
#[inline(always)]
fn free_part<L: Simd>(vector: Vec3Wide<L>, free: &[L; 4]) -> Vec3Wide<L> {
    let Vec3Wide([x, y, z]) = vector;
    Vec3Wide([x * free[0], y * free[1], z * free[2]])
}

/// A velocity with the inverse mass that locks leave along a normal.
#[inline(always)]
fn pushed_row<L: Simd>(velocity: &[L; 4], free: &[L; 4], normal: Vec3Wide<L>) -> [L; 4] {
    let share = normal.dot(free_part(normal, free));
    let share = share.select_gt(L::constant(LEAST_SHARE), share, L::constant(0.0));
    Vec3Wide::of(velocity).with(inverse_mass(velocity) * share)
}
