//! Paths of fast balls to walls, and of balls to fast walls.

use cgmath::InnerSpace;

use super::Tier;
use super::kernels::squared;
use super::surfaces::SurfaceOf;
use super::walls::{StaticGeometry, center};
use crate::broad::CollisionFilter;
use crate::math::{Row, Scalar, Vec3};
use crate::motion::LockedAxes;

/// Visits the walls that a ball meets on its path, and along those that it met. A path of at most
/// `shortest` metres is not tested for hits. Returns the ball where it ends.
pub(super) fn along_path<S: Scalar>(
    walls: &dyn StaticGeometry<S>,
    (ball, (filter, locks)): (&Row<S>, (CollisionFilter, LockedAxes)),
    mut displacement: Vec3<S>,
    shortest: S,
    visit: &mut impl FnMut(&Row<S>, [u32; 2], Vec3<S>, S),
) -> Row<S> {
    let mut ball = *ball;
    // In a corner, it meets three.
    for _ in 0..3 {
        let hit = if displacement.magnitude() > shortest {
            walls.first_hit_on_path(&ball, filter, displacement)
        } else {
            None
        };
        let Some((part, normal, distance)) = hit else {
            return moved(&ball, displacement);
        };
        visit(&ball, part, normal, distance);
        let approach = -displacement.dot(normal);
        if approach.is_nan() || approach <= S::zero() {
            return moved(&ball, displacement);
        }
        let time = ((distance - ball[3]) / approach).clamp(S::zero(), S::one());
        ball = moved(&ball, displacement * time);
        let bend = locks.free_normal(normal);
        displacement = (displacement - bend * displacement.dot(bend)) * (S::one() - time);
    }
    ball
}

fn moved<S: Scalar>(ball: &Row<S>, by: Vec3<S>) -> Row<S> {
    [ball[0] + by.x, ball[1] + by.y, ball[2] + by.z, ball[3]]
}

/// Puts a ball that passed into a wall on this displacement back to where it met it, from where it
/// slides along the wall. Returns how far that is, in metres.
pub(super) fn slide_along_wall<S: Scalar>(
    walls: &dyn StaticGeometry<S>,
    at: &mut Row<S>,
    of_ball: (CollisionFilter, LockedAxes),
    displacement: Vec3<S>,
) -> S {
    let (start, mut hits) = (moved(at, -displacement), false);
    let ball = (&start, of_ball);
    let end = along_path(walls, ball, displacement, S::zero(), &mut |_, _, _, _| hits = true);
    if !hits {
        return S::zero();
    }
    let back = (center(at) - center(&end)).magnitude();
    *at = end;
    back
}

/// Returns true if a ball of this velocity and radius is fast for a step of `time` seconds.
pub(super) fn is_fast<S: Scalar>(velocity: &Row<S>, time: S, radius: S) -> bool {
    squared(*velocity) * time * time > S::from_f64(FAST) * S::from_f64(FAST) * radius * radius
}

/// A ball that goes further than this in a step, in radii, is fast: the plane across the nearest
/// point of a wall says little about where it meets it, so it is looked where that is, and again
/// in each substep.
pub(super) const FAST: f64 = 0.5;

/// Input of an update of wall contacts.
#[derive(Clone, Copy)]
pub(super) struct WallQuery<'a, S> {
    pub tier: Tier,
    pub at: &'a [Row<S>],
    /// In the lab's tier, where they were: there, they have moved already.
    pub velocity: &'a [Row<S>],
    pub skin_left: &'a [S],
    pub surfaces: SurfaceOf<'a, S>,
    /// Walls are where they will be at the end of the step; so long before, in seconds, they were
    /// elsewhere.
    pub before: S,
    /// Lengths of a step and of a substep, in seconds.
    pub times: [S; 2],
    /// Surfaces as far away as a fast ball goes are found, too, not only those that it may pass.
    pub whole_way: bool,
    pub gravity: Vec3<S>,
}

impl<S: Scalar> WallQuery<'_, S> {
    /// Ways of a ball in the step and in a substep, in metres.
    fn ways(&self, row: u32) -> [Vec3<S>; 2] {
        let (at, [u, v, w, _]) = (&self.at[row as usize], self.velocity[row as usize]);
        match self.tier {
            Tier::Lab => [Vec3::new(at[0] - u, at[1] - v, at[2] - w); 2],
            Tier::Full => {
                let gravity = self.surfaces.locked_axes(row).free_translation(self.gravity);
                self.times.map(|time| Vec3::new(u, v, w) * time + gravity * (time * time))
            }
        }
    }

    /// Way of a fast ball in a substep, in metres; none for slow ones.
    pub fn displacement(&self, row: u32) -> Option<Vec3<S>> {
        let [step, substep] = self.ways(row);
        let far = S::from_f64(FAST) * self.at[row as usize][3];
        (step.magnitude2() > far * far).then_some(substep)
    }

    /// Distance within which surfaces at a fast ball are found, in metres. Those that are further away are
    /// met on its way, if at all, and the planes that they are like here would be in its way.
    pub fn reach(&self, radius: S, displacement: Vec3<S>) -> S {
        let way = displacement.magnitude();
        if self.whole_way { way } else { way.min(S::from_f64(FAST) * radius) }
    }

    /// Visits the walls that a fast ball meets on its way in a substep, and along those that it met.
    pub fn visit_way(
        &self,
        walls: &dyn StaticGeometry<S>,
        (ball, (filter, locks)): (&Row<S>, (CollisionFilter, LockedAxes)),
        displacement: Vec3<S>,
        visit: &mut impl FnMut(&Row<S>, [u32; 2], Vec3<S>, S),
    ) {
        if self.tier == Tier::Full {
            let way = (displacement, [self.before, self.times[1]]);
            if let Some((part, normal, distance)) = walls.first_touch(ball, filter, way) {
                visit(ball, part, normal, distance);
            }
        }
        let shortest = S::from_f64(FAST) * ball[3];
        along_path(walls, (ball, (filter, locks)), displacement, shortest, visit);
    }

    /// Returns true if a wall may pass a ball within the step.
    pub fn is_outrun(&self, walls: &dyn StaticGeometry<S>, row: u32) -> bool {
        let [step, _] = self.ways(row);
        walls.is_outrun(&self.at[row as usize], step.magnitude(), self.surfaces.filter(row))
    }

    /// A ball where its way in a substep begins, that way in metres, and what is then left of the step
    /// and how long the way takes, in seconds.
    pub fn path(&self, row: u32) -> (Row<S>, Vec3<S>, [S; 2]) {
        let [_, way] = self.ways(row);
        let [step, substep] = self.times;
        let left = if self.tier == Tier::Lab { step } else { self.before };
        (self.ball(row, Some(way)), way, [left, substep])
    }

    /// A ball where its way begins.
    pub fn ball(&self, row: u32, displacement: Option<Vec3<S>>) -> Row<S> {
        let at = self.at[row as usize];
        match (self.tier, displacement) {
            (Tier::Lab, Some(displacement)) => {
                [at[0] - displacement.x, at[1] - displacement.y, at[2] - displacement.z, at[3]]
            }
            _ => at,
        }
    }
}
