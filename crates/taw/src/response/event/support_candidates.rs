//! Walls that may support a ball before a step on its support is over. Found once, and then asked
//! for the nearest one hundreds of times, from points near each other.

use std::cell::Cell;

use cgmath::{InnerSpace, Zero};
use smallvec::{SmallVec, smallvec};

use super::wall::distance_rounding;
use super::{EventSettings, EventSolver, PART_COST, SUPPORT_CHECK, Wall};
use crate::math::{Point3, Vec3};
use crate::shape::PointProjection;

/// A neighbouring face that rises by less than this angle, in radians, continues the supporting
/// one.
const MIN_RISE: f64 = 1e-6;

/// The present support of a ball, and the walls near it that do not rise in front of it. (With those
/// in front it collides.)
#[derive(Debug)]
pub(super) struct SupportCandidates {
    /// Center of the ball at the start.
    center: Point3<f64>,
    /// Start time, in seconds from the start of the substep.
    time: f64,
    /// Nearest point of the support at the start; none if it is the only candidate.
    contact: Option<PointProjection<f64>>,
    /// Position error of the ball, in metres.
    position_error: f64,
    /// Nearest first, among walls some of which may rise in front.
    walls: SmallVec<[SupportCandidate; 1]>,
}

#[derive(Debug)]
struct SupportCandidate {
    wall: usize,
    /// Lower bound of the distance from the center at the start, in metres; minus infinity if the
    /// wall moves.
    distance: f64,
    /// True if it rises in front of the support; none if nobody has asked.
    rises: Cell<Option<bool>>,
}

impl SupportCandidate {
    fn new(wall: usize, distance: f64) -> Self {
        Self { wall, distance, rises: Cell::new(None) }
    }
}

impl SupportCandidates {
    /// One wall alone.
    pub fn only(wall: usize) -> Self {
        let center = Point3::new(0.0, 0.0, 0.0);
        let walls = smallvec![SupportCandidate::new(wall, f64::NEG_INFINITY)];
        Self { center, time: 0.0, contact: None, position_error: 0.0, walls }
    }

    /// True if there is one candidate only.
    pub fn is_single(&self) -> bool {
        self.walls.len() == 1
    }

    /// Nearest wall at a time, the first of several. Adds to the cost.
    pub fn nearest(
        &self,
        walls: &[Wall],
        (at, time): (Point3<f64>, f64),
        cost: &Cell<u64>,
    ) -> (usize, PointProjection<f64>) {
        let nowhere = PointProjection { point: at, normal: Vec3::zero(), distance: f64::INFINITY };
        let mut best = (usize::MAX, nowhere);
        let travel = (at - self.center).magnitude();
        // A shorter way crosses no surface, so that no distance falls by more than that.
        let is_short = self.walls.first().is_some_and(|first| travel < first.distance);
        let travel = if is_short { travel } else { f64::INFINITY };
        for candidate in &self.walls {
            let SupportCandidate { wall, distance, .. } = *candidate;
            if distance - travel > best.1.distance + distance_rounding(at, distance) {
                break; // so are all after it
            }
            cost.set(cost.get() + PART_COST);
            if walls[wall].distance_lower_bound(at, time) > best.1.distance {
                continue;
            }
            let next = (wall, walls[wall].nearest(at, time));
            let is_nearer = (next.1.distance, next.0) < (best.1.distance, best.0);
            if is_nearer && !self.rises(candidate, walls) {
                best = next;
            }
        }
        best
    }

    /// Tests if a wall rises in front of the support.
    fn rises(&self, candidate: &SupportCandidate, walls: &[Wall]) -> bool {
        let Some(contact) = self.contact else { return false };
        candidate.rises.get().unwrap_or_else(|| {
            let offset =
                walls[candidate.wall].nearest(self.center, self.time).point - contact.point;
            let rises =
                offset.dot(contact.normal) > MIN_RISE * offset.magnitude() + self.position_error;
            candidate.rises.set(Some(rises));
            rises
        })
    }
}

impl EventSolver {
    /// Walls that may support a ball on a wall soon.
    pub(super) fn support_candidates(
        &self,
        row: usize,
        support: usize,
        settings: &EventSettings,
    ) -> SupportCandidates {
        let ball = &self.balls[row];
        let (center, time, position_error) =
            (ball.position, ball.trajectory.start, ball.position_error);
        let max_distance = ball.radius * (1.0 + 2.0 * SUPPORT_CHECK) + position_error;
        let mut walls: SmallVec<[SupportCandidate; 1]> = SmallVec::new();
        let cost = self.for_each_wall_within(row, (center, max_distance), |wall| {
            let is_moving = self.walls[wall].motion_at(time).is_some();
            let distance = self.walls[wall].distance_lower_bound(center, time);
            if wall != support && distance <= max_distance {
                let distance = if is_moving { f64::NEG_INFINITY } else { distance };
                walls.push(SupportCandidate::new(wall, distance));
            }
        });
        settings.add_cost(cost);
        let contact = self.walls[support].nearest(center, time);
        let distance = match self.walls[support].motion_at(time) {
            Some(_) => f64::NEG_INFINITY,
            None => contact.distance,
        };
        walls.push(SupportCandidate::new(support, distance));
        walls.sort_by(|x, y| x.distance.total_cmp(&y.distance));
        SupportCandidates { center, time, contact: Some(contact), position_error, walls }
    }
}
