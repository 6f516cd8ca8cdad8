//! Continuous collision of marbles with walls.

use cgmath::{InnerSpace, SquareMatrix, Zero};
use smallvec::SmallVec;

use super::{MAX_BENDS, MAX_FREE_MOTION, OVERLAP, Obstacle, StoppedMarble, outer};
use crate::math::{Mat3, Point3, Scalar, Vec3, length};
use crate::response::Colliders as _;
use crate::shape::{Aabb, PointProjection, Sphere};
use crate::world::World;
use crate::world::walls::{SubShape, Walls};

/// Enough iterations for any wall that a marble does not only graze.
const MAX_ITERATIONS: u32 = 32;

/// Time of impact of a marble with a wall.
pub(in crate::world) struct WallImpact<S> {
    /// Fraction of the motion.
    pub time: S,
    pub wall: u32,
    pub normal: Vec3<S>,
    /// Separation from the wall there, in metres.
    gap: S,
}

/// Bend of a path at a wall.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bend<S> {
    pub stop: StoppedMarble<S>,
    pub center: Point3<S>,
    /// Remaining fraction of the substep, remaining displacement in metres, and remaining velocity
    /// change by forces in m/s.
    pub left: S,
    pub displacement: Vec3<S>,
    pub change: Vec3<S>,
    /// Projection by which the position still follows the velocity.
    pub along: Mat3<S>,
}

impl<S: Scalar> World<S> {
    /// Finds the bends of paths that would pass into walls by more than half of the marble's
    /// radius. Walls count at their current poses; half-spaces are solid and need no such test.
    pub(super) fn bend_at_walls(&mut self, dt: S) {
        self.walls.update_tree();
        if self.walls.are_half_spaces() {
            return;
        }
        let resting_approach = self.resting_approach(dt);
        for row in 0..self.marbles.len() {
            let motion = self.marbles.position[row] - self.continuous.start[row];
            if length(motion) > self.marbles.radius[row] * S::from_f64(MAX_FREE_MOTION) {
                self.slide_along_walls(row, resting_approach);
            }
        }
    }

    /// Follows a path from wall to wall: a marble stops at the time of impact, or with
    /// [`Response::Penalty`](crate::response::Response::Penalty), whose forces need an overlap,
    /// when half of its radius is inside. The remaining motion and velocity change by forces
    /// continue along the surface ("collide and slide"; Fauerby, *Improved collision detection and
    /// response*, 2003). A marble that approaches faster than `resting_approach`, in metres per
    /// substep, keeps the velocity of the impact, with which it bounces; if it would slide off the
    /// wall, it stays, since there it could not bounce. A resting one keeps its velocity: friction
    /// needs its weight.
    fn slide_along_walls(&mut self, row: usize, resting_approach: S) {
        let mut sphere = Sphere { center: self.continuous.start[row], ..self.marbles.sphere(row) };
        let mut displacement = self.marbles.position[row] - sphere.center;
        let mut velocity = self.marbles.velocity[row];
        let mut change = velocity - self.continuous.velocity[row];
        let mut left = S::one();
        let mut surfaces: SmallVec<[Vec3<S>; MAX_BENDS as usize]> = SmallVec::new();
        while length(displacement) > sphere.radius * S::from_f64(MAX_FREE_MOTION)
            && let Some(WallImpact { time, wall, normal, .. }) =
                self.first_wall_impact(row, &sphere, displacement)
        {
            sphere.center += displacement * time;
            let rest = S::one() - time;
            (displacement, change, left) = (displacement * rest, change * rest, left * rest);
            let mut along = along_surfaces(displacement, normal, &surfaces);
            surfaces.push(normal);
            let there = sphere.center + along * displacement;
            let slides_off = || {
                let wall = &self.walls.shapes()[wall as usize];
                wall.project_point(there).distance > sphere.radius
            };
            let fast = -displacement.dot(normal) > resting_approach * left;
            if surfaces.len() == MAX_BENDS as usize || (fast && slides_off()) {
                along = Mat3::from_value(S::zero());
            }
            let (slid, kept) = (along * displacement, along * change);
            let surface = self.walls.surface_velocity(wall as usize, sphere.center);
            let closing = (velocity - surface).dot(normal);
            let part = lost_fraction((change - kept).dot(normal), closing);
            let stop = StoppedMarble {
                row: row as u32,
                obstacle: Obstacle::Wall(wall),
                displacement: displacement - slid,
                change: if fast { (change - kept) * part } else { Vec3::zero() },
            };
            velocity -= stop.change;
            (displacement, change) = (slid, kept);
            let center = sphere.center;
            self.continuous.bends.push(Bend {
                stop,
                center,
                left,
                displacement,
                change,
                along: along * rest,
            });
        }
    }

    /// Stops marbles at a second wall, half-spaces included, that a bounce would carry them into:
    /// they keep their velocity, and bounce there in the next substep.
    pub(in crate::world) fn stop_bounces_at_walls(&mut self) {
        for row in 0..self.continuous.bounced_from.len().min(self.marbles.len()) {
            let sphere =
                Sphere { center: self.continuous.bounced_from[row], ..self.marbles.sphere(row) };
            let displacement = self.marbles.position[row] - sphere.center;
            if length(displacement) <= sphere.radius * S::from_f64(MAX_FREE_MOTION) {
                continue;
            }
            let layers = self.marbles.layers_of_row(row);
            let planes = self.walls.colliding_planes(layers).filter_map(|(_, plane)| {
                let (gap, closing) = (
                    plane.signed_distance(sphere.center) - sphere.radius,
                    -displacement.dot(plane.normal()),
                );
                let passes = closing > S::zero()
                    && closing > gap + sphere.radius * S::from_f64(MAX_FREE_MOTION);
                passes.then(|| (gap / closing).max(S::zero()))
            });
            let other = self.first_wall_impact(row, &sphere, displacement).map(|stop| stop.time);
            let first = planes.chain(other).fold(S::one(), S::min);
            if first < S::one() {
                self.marbles.position[row] = sphere.center + displacement * first;
            }
        }
    }

    /// First time of impact of a marble's sphere with a wall that it would pass into.
    pub(super) fn first_wall_impact(
        &self,
        row: usize,
        sphere: &Sphere<S>,
        motion: Vec3<S>,
    ) -> Option<WallImpact<S>> {
        let (half, shrink) = (S::from_f64(0.5), S::one() - S::from_f64(OVERLAP));
        let (start, more) = (sphere.center, sphere.radius);
        let more = Vec3::new(more, more, more);
        let displacement = Aabb { min: start, max: start }
            .union(&Aabb { min: start + motion, max: start + motion });
        let bounds = Aabb { min: displacement.min - more, max: displacement.max + more };
        // The core (half the radius) decides whether it passes into a wall, the full sphere when:
        // first wherever it touches, so that at the internal edge of two flush parts the one below
        // counts.
        let core = Sphere { radius: sphere.radius * half, ..*sphere };
        let layers = self.marbles.layers_of_row(row);
        let mut passes = false;
        self.walls.for_each_colliding(&bounds, layers, |part| {
            passes = passes || self.walls.time_of_impact(part, &core, motion).is_some();
        });
        if !passes {
            return None;
        }
        let scale = if self.model.response.needs_penetration() { half } else { shrink };
        let all = Sphere { radius: sphere.radius * scale, ..*sphere };
        let mut best: Option<WallImpact<S>> = None;
        self.walls.for_each_colliding(&bounds, layers, |part| {
            let Some(stop) = self.walls.time_of_impact(part, &all, motion) else { return };
            let order = |stop: &WallImpact<S>| (stop.time, stop.gap);
            if best.as_ref().is_none_or(|best| order(&stop) < order(best)) {
                best = Some(stop);
            }
        });
        best
    }
}

impl<S: Scalar> Walls<S> {
    /// Time of impact of a sphere with a sub-shape of a wall by conservative advancement (Mirtich
    /// 1996).
    pub(in crate::world) fn time_of_impact(
        &self,
        part: SubShape,
        sphere: &Sphere<S>,
        motion: Vec3<S>,
    ) -> Option<WallImpact<S>> {
        let near = sphere.radius * S::from_f64(OVERLAP);
        let mut time = S::zero();
        let mut last = None;
        for _ in 0..MAX_ITERATIONS {
            let PointProjection { normal, distance, .. } =
                self.project_point(part, sphere.center + motion * time);
            let (gap, closing) = (distance - sphere.radius, -motion.dot(normal));
            if closing.is_nan() || closing <= S::zero() {
                return None;
            }
            if gap <= near {
                return Some(WallImpact { time, wall: part.wall, normal, gap });
            }
            last = Some(WallImpact { time, wall: part.wall, normal, gap });
            time += gap / closing;
            if time > S::one() {
                return None;
            }
        }
        // A grazing contact, or within rounding.
        last.filter(|last| last.gap <= sphere.radius)
    }
}

/// Fraction of a normal velocity change that a stopped marble loses: all, but never so much that it
/// would separate by forces that it has not felt yet. `end` is its normal speed with all of it.
pub(super) fn lost_fraction<S: Scalar>(change: S, end: S) -> S {
    if end < S::zero() && end > change { end / change } else { S::one() }
}

/// Projection of a motion onto the surface that it reaches: onto its plane, onto the edge with
/// another touched surface in the way, or zero in a corner.
fn along_surfaces<S: Scalar>(
    displacement: Vec3<S>,
    normal: Vec3<S>,
    others: &[Vec3<S>],
) -> Mat3<S> {
    let plane = Mat3::from_value(S::one()) - outer(normal);
    let slid = plane * displacement;
    let blocks = |other: &&Vec3<S>, displacement: Vec3<S>| displacement.dot(**other) < S::zero();
    let Some(other) = others.iter().find(|other| blocks(other, slid)) else { return plane };
    let edge = normal.cross(*other);
    // The edge between nearly parallel surfaces is undefined.
    if edge.magnitude2() <= S::epsilon() {
        return plane;
    }
    let along = outer(edge.normalize());
    if others.iter().any(|it| it != other && blocks(&it, along * displacement)) {
        return Mat3::from_value(S::zero());
    }
    along
}
