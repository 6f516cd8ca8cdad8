//! Bounces within a substep: who would come back from a half-space among others, and where a bounce
//! may carry a marble.

use cgmath::InnerSpace;

use super::swept_marble::SweptMarble;
use super::walls::MarbleMotion;
use super::{Continuous, MAX_FREE_MOTION};
use crate::math::{Point3, Scalar, Vec3, is_finite_point, length};
use crate::shape::Sphere;
use crate::world::World;

impl<S: Scalar> World<S> {
    /// Lists the marbles that would pass into a half-space by more than half of their radius while
    /// the paths of others lead through their reach: on the way back they may pass through one,
    /// whose path no longer tells when they met. One that only others could reach is not listed:
    /// what is fast far away must not change its bounce.
    pub(super) fn list_crowded_bounces(&mut self) {
        let mut crowded = std::mem::take(&mut self.scratch.continuous.crowded);
        crowded.clear();
        if !self.settings.model.response.needs_penetration() && self.marbles.len() > 1 {
            crowded.extend((0..self.marbles.len()).map(|row| self.passes_into_half_space(row)));
        }
        if crowded.contains(&true) {
            let Continuous { start, reach, near, .. } = &mut self.scratch.continuous;
            near.clear();
            near.resize(crowded.len(), false);
            reach.clear();
            let ends = self.marbles.position.iter().zip(&self.marbles.radius);
            reach.extend(start.iter().zip(ends).map(|(start, (end, r))| length(end - start) + *r));
            self.scratch.images.pairs(
                &mut self.scratch.grid,
                (&start[..], &reach[..]),
                S::zero(),
                self.marbles.period,
                |a, b| {
                    if !self.marbles.may_collide(a, b) {
                        return false;
                    }
                    let (a, b) = (a as usize, b as usize);
                    for (one, other) in [(a, b), (b, a)] {
                        let others = self.marbles.period.image(start[other], start[one]);
                        let motion = self.marbles.position[other] - start[other];
                        let distance = distance_to_path(start[one], others, motion);
                        near[one] |= distance <= reach[one] + self.marbles.radius[other];
                    }
                    let touching = self.marbles.radius[a] + self.marbles.radius[b];
                    (start[b] - start[a]).magnitude2() < touching * touching
                },
            );
            crowded.iter_mut().zip(&*near).for_each(|(crowded, near)| *crowded &= near);
        } else {
            crowded.clear();
        }
        self.scratch.continuous.crowded = crowded;
    }

    /// Tells if a fast marble ends in a half-space at rest by more than half of its radius.
    fn passes_into_half_space(&self, row: usize) -> bool {
        let Sphere { center, radius } = self.marbles.sphere(row);
        let max_depth = radius * S::from_f64(MAX_FREE_MOTION);
        length(center - self.scratch.continuous.start[row]) > max_depth
            && !self.is_kinematic(row)
            && self
                .walls
                .colliding_planes(self.marbles.filter_of_row(row))
                .filter(|(wall, _)| self.walls.swept_motion_of_row(*wall as usize).is_none())
                .any(|(_, plane)| plane.signed_distance(center) < radius - max_depth)
    }

    /// Stops marbles at a second wall, half-spaces included, that a bounce would carry them into:
    /// they keep their velocity, and bounce there in the next substep.
    pub(in crate::world) fn stop_bounces_at_walls(&mut self) {
        let rows = self.scratch.continuous.bounced_from.len().min(self.marbles.len());
        if rows == 0 {
            return;
        }
        self.list_deep_marbles(|world, row| {
            let from = world.scratch.continuous.bounced_from.get(row);
            from.map_or_else(S::zero, |from| length(world.marbles.position[row] - *from))
        });
        for row in 0..rows {
            self.stop_bounce_at_walls(row);
            self.push_out_of_half_spaces(row);
        }
    }

    /// Stops a marble at the first wall that it would pass into by more than half of its radius, on
    /// the way from where it was before contacts moved it.
    fn stop_bounce_at_walls(&mut self, row: usize) {
        let from = self.scratch.continuous.bounced_from[row];
        let marble = SweptMarble::without_turn(&self.marbles, row, from);
        let Sphere { radius, .. } = marble.sphere;
        let displacement = self.marbles.position[row] - from;
        if length(displacement) <= self.free_motion(row) {
            return;
        }
        let filter = self.marbles.filter_of_row(row);
        let planes = self.walls.colliding_planes(filter).filter_map(|(_, plane)| {
            if self.settings.model.response.needs_penetration() {
                return None; // its forces turn everything round within a half-space
            }
            let (gap, closing) = (
                plane.signed_distance(from) - plane.normal().dot(marble.half_axis).abs() - radius,
                -displacement.dot(plane.normal()),
            );
            let passes =
                closing > S::zero() && closing > gap + radius * S::from_f64(MAX_FREE_MOTION);
            passes.then(|| (gap / closing).max(S::zero()))
        });
        let motion = MarbleMotion { displacement, time: S::zero(), carrier: None };
        let other = self.first_wall_impact(row, &marble, motion).map(|stop| stop.time);
        let first = planes.chain(other).fold(S::one(), S::min);
        if first < S::one() {
            self.marbles.position[row] = from + displacement * first;
        }
    }

    /// Moves a marble that the contacts leave in a half-space by more than half of its radius back
    /// to its surface: nothing else would stop it there. One whose contact the user has removed
    /// passes, and one that contacts do not move.
    fn push_out_of_half_spaces(&mut self, row: usize) {
        if self.settings.model.response.needs_penetration() || self.is_kinematic(row) {
            return;
        }
        let Sphere { mut center, radius } = self.marbles.sphere(row);
        let from = self.scratch.continuous.bounced_from[row];
        for (wall, plane) in self.walls.colliding_planes(self.marbles.filter_of_row(row)) {
            let gap = plane.signed_distance(center) - radius;
            let is_deep = gap.is_finite() && gap < radius * S::from_f64(-MAX_FREE_MOTION);
            let was_listed = || plane.signed_distance(from) - radius <= self.scratch.reach;
            let is_listed = || self.contacts.wm.iter().any(|c| (c.a, c.b) == (wall, row as u32));
            if is_deep && (!was_listed() || is_listed()) {
                center -= self.marbles.locked_axes_of_row(row).escape(plane.normal()) * gap;
            }
        }
        if is_finite_point(center) {
            self.marbles.position[row] = center;
        }
    }
}

/// Distance of a point from a straight path, in metres.
fn distance_to_path<S: Scalar>(point: Point3<S>, start: Point3<S>, motion: Vec3<S>) -> S {
    let along = (point - start).dot(motion) / motion.magnitude2();
    // No motion at all has no direction, either.
    let along = if along > S::zero() { along.min(S::one()) } else { S::zero() };
    length(point - (start + motion * along))
}
