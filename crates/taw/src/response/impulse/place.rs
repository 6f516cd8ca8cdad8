//! Positions, once velocities are solved.

use super::{Around, Constraint, Walls};
use crate::math::{Point3, Scalar, Vec3, is_finite_point};
use crate::response::{Columns, Material};

/// How often overlap that is left after the velocities are solved is pushed out.
const SWEEPS: u32 = 3;

impl<S: Scalar> Columns<'_, S> {
    /// Lets positions follow what contacts changed of the velocities `before`: what a bounce
    /// changed from its moment on, all else for as long as the integrator does.
    pub(super) fn follow(
        &mut self,
        before: &[Vec3<S>],
        constraints: &[Constraint<S>],
        around: &Around<S, impl Walls<S>, impl Fn(usize) -> Material<S>, impl Fn(usize) -> S>,
    ) {
        let follows = |row: usize| around.follows_row(row);
        for (row, before) in before.iter().enumerate() {
            let change = self.velocity[row] - before;
            self.put(row, self.position[row] + around.follow(row, change));
        }
        for c in constraints {
            let Some(since) = c.since else { continue };
            let push = c.impulse() / c.mobility.normal;
            for (row, push) in [(Some(c.b), push), (c.a.marble(), -push)] {
                let Some(row) = row else { continue };
                let change = push * self.inverse_mass[row];
                if !around.stands(row) {
                    self.put(row, self.position[row] + change * (since - follows(row)));
                }
            }
        }
    }

    /// Moves what overlaps too deep apart, sweep after sweep half of the way, the lighter one
    /// further; but nothing deeper into a wall than it was.
    pub(super) fn push_apart(
        &mut self,
        constraints: &[Constraint<S>],
        around: &Around<S, impl Walls<S>, impl Fn(usize) -> Material<S>, impl Fn(usize) -> S>,
        gaps: &mut Vec<S>,
    ) {
        let walls = constraints.iter().take_while(|c| c.a.marble().is_none());
        gaps.clear();
        gaps.extend(walls.clone().map(|c| self.gap_to_keep(c, around)));
        for _ in 0..SWEEPS {
            for c in constraints {
                self.push_two_apart(c, around);
            }
            for (c, gap) in walls.clone().zip(&*gaps) {
                self.push_back(c, *gap, around);
            }
        }
    }

    /// Separation of a marble and a wall that pushing must not make smaller, in metres: below zero, at
    /// least as deep as may stay.
    fn gap_to_keep(
        &self,
        c: &Constraint<S>,
        around: &Around<S, impl Walls<S>, impl Fn(usize) -> Material<S>, impl Fn(usize) -> S>,
    ) -> S {
        let touch = self.normal_and_gap(self.position, c.a, c.b, c.along, around.walls);
        touch.map_or_else(S::neg_infinity, |(_, gap)| gap.min(-self.overlap_to_stay(c, around)))
    }

    /// Moves a marble back out of a wall that others have pushed it into.
    fn push_back(
        &mut self,
        c: &Constraint<S>,
        keep: S,
        around: &Around<S, impl Walls<S>, impl Fn(usize) -> Material<S>, impl Fn(usize) -> S>,
    ) {
        let touch = self.normal_and_gap(self.position, c.a, c.b, c.along, around.walls);
        let Some((normal, gap)) = touch else { return };
        if gap < keep && self.inverse_mass[c.b] > S::zero() {
            self.put(c.b, self.position[c.b] + normal * (keep - gap));
        }
    }

    /// Overlap that stays, in metres: what rests then need not fall back in every substep.
    fn overlap_to_stay(
        &self,
        c: &Constraint<S>,
        around: &Around<S, impl Walls<S>, impl Fn(usize) -> Material<S>, impl Fn(usize) -> S>,
    ) -> S {
        let settings = around.settings;
        let smaller =
            c.a.marble().map_or(self.radius[c.b], |a| self.radius[a].min(self.radius[c.b]));
        settings.slop.min(smaller * settings.largest_slop)
    }

    fn push_two_apart(
        &mut self,
        c: &Constraint<S>,
        around: &Around<S, impl Walls<S>, impl Fn(usize) -> Material<S>, impl Fn(usize) -> S>,
    ) {
        let touch = self.normal_and_gap(self.position, c.a, c.b, c.along, around.walls);
        let Some((normal, gap)) = touch else { return };
        let excess = -gap - self.overlap_to_stay(c, around);
        if excess <= S::zero() {
            return;
        }
        let push = normal * (excess * S::constant(0.5) / c.mobility.normal);
        for (row, by) in [(Some(c.b), push), (c.a.marble(), -push)] {
            let Some(row) = row else { continue };
            self.put(row, self.position[row] + by * self.inverse_mass[row]);
        }
    }

    fn put(&mut self, row: usize, position: Point3<S>) {
        if is_finite_point(position) {
            self.position[row] = position;
        }
    }
}
