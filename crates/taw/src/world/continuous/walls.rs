//! Continuous collision of marbles with walls.

use cgmath::{InnerSpace, SquareMatrix, Zero};
use smallvec::SmallVec;

use super::moving_walls::{Frame, MovingWall, Place, RelativePath};
use super::swept_marble::{SweptMarble, Turn};
use super::{MAX_BENDS, MAX_FREE_MOTION, OVERLAP, Obstacle, StoppedMarble, outer};
use crate::broad::CollisionFilter;
use crate::contact::time_to_close;
use crate::math::{Mat3, Point3, Scalar, Vec3, length};
use crate::response::Colliders as _;
use crate::response::penalty::CORE;
use crate::shape::{Aabb, PointProjection, Sphere};
use crate::world::narrow_phase::flush_distance;
use crate::world::walls::{SubShape, Walls};
use crate::world::{WallShape, World};

/// Enough iterations for any wall that a marble does not only graze.
pub(super) const MAX_ITERATIONS: u32 = 32;

/// Penetration, as a fraction of the radius, up to which a sphere that touches a rotating wall and
/// parts may advance: shorter steps would lead nowhere.
pub(super) const MAX_OVERSHOOT: f64 = 0.005;

/// Time of impact of a marble with a wall.
pub(in crate::world) struct WallImpact<S> {
    /// Fraction of the motion.
    pub time: S,
    pub part: SubShape,
    pub normal: Vec3<S>,
    /// Center there in the frame of the wall, which is that of the world at the end of the substep.
    pub center: Point3<S>,
    /// Vector from there to the point of a capsule's axis that is nearest to the wall, and the
    /// velocity of that about the center, in metres and metres per path; zero for a ball.
    pub(super) anchor: Vec3<S>,
    pub(super) swing: Vec3<S>,
    pub(super) place: Place<S>,
    /// Separation from the wall there, in metres.
    pub(super) gap: S,
}

/// Motion of a marble, and the walls that it may meet.
#[derive(Clone, Copy, Debug)]
pub(super) struct MarbleMotion<S> {
    /// Displacement, in metres.
    pub displacement: Vec3<S>,
    /// Time that it takes until the end of the substep, in seconds; zero for one that takes place
    /// at its end, where no wall moves.
    pub time: S,
    /// Moving wall that carries the marble along, with start and displacement in its frame.
    pub carrier: Option<(u32, Point3<S>, Vec3<S>)>,
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
    /// Remaining displacement of the wall there, in metres.
    pub carried: Vec3<S>,
    /// Projection by which the position still follows the velocity.
    pub along: Mat3<S>,
}

impl<S: Scalar> World<S> {
    /// Finds the bends of paths that would pass into walls by more than half of the marble's
    /// radius. Half-spaces are solid, so that a marble by itself needs no such test there.
    pub(super) fn bend_at_walls(&mut self, dt: S) {
        self.walls.update_tree();
        self.list_crowded_bounces();
        if self.walls.are_half_spaces() && self.scratch.continuous.crowded.is_empty() {
            return;
        }
        MovingWall::list(&self.walls, dt, &mut self.scratch.continuous.moving_walls);
        self.list_deep_marbles(|_, _| S::zero());
        for row in 0..self.marbles.len() {
            if self.is_kinematic(row) {
                continue;
            }
            let start = self.scratch.continuous.start[row];
            let marble = self.swept_marble(row, start, dt);
            let motion = self.marbles.position[row] - start;
            let standing = RelativePath { start, displacement: motion, frame: Frame::Standing };
            let is_fast = length(motion) + marble.max_swing(&standing) > self.free_motion(row);
            let moving_walls = &self.scratch.continuous.moving_walls;
            let may_be_met = || {
                let bounds = marble.bounds(motion);
                moving_walls.iter().any(|wall| wall.is_near(&bounds))
            };
            if is_fast || (!moving_walls.is_empty() && may_be_met()) {
                self.slide_along_walls(row, marble, dt);
            }
        }
    }

    /// Marble at the start of its free motion over `dt` seconds.
    pub(super) fn swept_marble(&self, row: usize, start: Point3<S>, dt: S) -> SweptMarble<S> {
        let model = self.settings.model.rotation;
        SweptMarble::in_free_motion(&self.marbles, row, start, (model, dt))
    }

    /// Lists the marbles that contacts with walls, as they were found, show half inside of one after
    /// they have moved by `motion` metres: however slow, they must not come out on the other side.
    pub(super) fn list_deep_marbles(&mut self, motion: impl Fn(&Self, usize) -> S) {
        let mut deep = std::mem::take(&mut self.scratch.continuous.deep);
        deep.clear();
        deep.extend(self.contacts.wm.iter().filter_map(|c| {
            let radius = *self.marbles.radius().get(c.b as usize)?;
            let is_deep = c.penetration() > S::zero()
                && c.penetration() + motion(self, c.b as usize)
                    > radius * S::from_f64(MAX_FREE_MOTION);
            (is_deep && !self.is_kinematic(c.b as usize)).then_some(c.b)
        }));
        deep.sort_unstable();
        self.scratch.continuous.deep = deep;
    }

    /// Returns true for a marble of infinite mass, which contacts do not move, if the response knows
    /// masses.
    pub(super) fn is_kinematic(&self, row: usize) -> bool {
        self.settings.model.response.knows_masses() && self.marbles.mass(row).is_infinite()
    }

    /// Motion of a marble against a wall that needs no sweep, in metres: beyond this it may pass.
    pub(super) fn free_motion(&self, row: usize) -> S {
        if self.scratch.continuous.deep.binary_search(&(row as u32)).is_ok() {
            S::zero()
        } else {
            self.marbles.radius()[row] * S::from_f64(MAX_FREE_MOTION)
        }
    }

    /// Follows a path from wall to wall: a marble stops at the time of impact, or with
    /// [`Response::Penalty`](crate::response::Response::Penalty), whose forces need an overlap,
    /// when half of its radius is inside. The remaining motion and velocity change by forces
    /// continue along the surface ("collide and slide"; Fauerby, *Improved collision detection and
    /// response*, 2003), which carries the marble along if it moves. A marble that approaches faster
    /// than [`World::resting_approach`] keeps the velocity of the impact, with which it bounces; if
    /// it would slide off the wall, it stays, since there it could not bounce. A resting one keeps
    /// its velocity: friction needs its weight. A capsule that stops no longer turns from there on,
    /// except with the wall; one that rests there turns on about the point where it touches.
    fn slide_along_walls(&mut self, row: usize, mut marble: SweptMarble<S>, dt: S) {
        let resting_approach = self.resting_approach(dt);
        let mut displacement = self.marbles.position[row] - marble.sphere.center;
        let mut velocity = self.marbles.velocity[row];
        let mut change = velocity - self.scratch.continuous.velocity[row];
        let (mut left, mut turn) = (S::one(), Turn::until(S::zero(), Vec3::zero()));
        let mut surfaces: SmallVec<[Vec3<S>; MAX_BENDS as usize]> = SmallVec::new();
        let mut carrier = None;
        while surfaces.len() < MAX_BENDS as usize
            && let Some(mut impact) = self.first_wall_impact(
                row,
                &marble,
                MarbleMotion { displacement, time: left * dt, carrier },
            )
        {
            // The path bends within free axes.
            impact.normal = self.marbles.locked_axes_of_row(row).free_normal(impact.normal);
            let WallImpact { time, normal, center, anchor, swing, ref place, .. } = impact;
            let (wall, rest, carried) = (impact.part.wall, S::one() - time, place.carried);
            turn.add(&marble, time, left);
            // From here on as the wall sees it.
            (displacement, change, left) = (place.rest, change * rest, left * rest);
            let approach = -(displacement + swing * rest).dot(normal);
            let fast = approach > resting_approach * left;
            marble.advance(time, place.position);
            let radius = marble.sphere.radius;
            let along = self.along_wall(&impact, displacement, (radius, fast), &surfaces);
            surfaces.push(normal);
            let (mut slid, kept) = (along * displacement, along * change);
            if fast || along.is_zero() {
                marble.stop_turning(self.turn_with_wall(row, wall, left * dt));
            } else if !marble.is_ball() {
                slid = displacement + normal * approach.max(S::zero());
            }
            let surface = self.walls.surface_velocity(wall as usize, center + anchor, normal);
            let closing = (velocity + self.swing_velocity(row, anchor) - surface).dot(normal);
            let part = lost_fraction((change - kept).dot(normal), closing);
            let stop = StoppedMarble {
                row: row as u32,
                obstacle: Obstacle::Wall(wall),
                displacement: displacement - slid,
                change: if fast { (change - kept) * part } else { Vec3::zero() },
            };
            velocity -= stop.change;
            (displacement, change) = (slid + carried, kept);
            carrier = Some((wall, center, slid)).filter(|_| !carried.is_zero());
            self.scratch.continuous.bends.push(Bend {
                stop,
                center: marble.sphere.center,
                left,
                displacement,
                carried,
                change,
                along: along * rest,
            });
        }
        if !surfaces.is_empty() && !marble.is_ball() {
            turn.add(&marble, S::one(), left);
            self.scratch.continuous.set_turn(row, turn);
        }
    }

    /// Projection of the rest of a path onto the wall that it meets, after other surfaces; zero if it
    /// stays: in a corner, or where a marble that is `fast` would slide off the wall.
    fn along_wall(
        &self,
        impact: &WallImpact<S>,
        displacement: Vec3<S>,
        (radius, fast): (S, bool),
        surfaces: &[Vec3<S>],
    ) -> Mat3<S> {
        let WallImpact { part: SubShape { wall, .. }, normal, center, anchor, .. } = *impact;
        let along = along_surfaces(displacement, normal, surfaces, radius * S::from_f64(OVERLAP));
        let slides_off = || {
            let (wall, there) =
                (&self.walls.shapes()[wall as usize], center + anchor + along * displacement);
            !matches!(wall, WallShape::Plane(_)) && wall.project_point(there).distance > radius
        };
        let stays = surfaces.len() + 1 == MAX_BENDS as usize || (fast && slides_off());
        if stays { Mat3::from_value(S::zero()) } else { along }
    }

    /// First time of impact of a marble with a wall that it would pass into.
    pub(super) fn first_wall_impact(
        &self,
        row: usize,
        marble: &SweptMarble<S>,
        motion: MarbleMotion<S>,
    ) -> Option<WallImpact<S>> {
        // The core (half the radius) decides whether it passes into a wall, the full radius when:
        // first wherever it touches, so that at the internal edge of two flush parts the one below
        // counts.
        let Sphere { radius, .. } = marble.sphere;
        let core = marble.touching(radius * S::from_f64(CORE));
        let passes = self.first_impact_of(core, (row, marble, motion))?;
        if self.settings.model.response.needs_penetration() {
            return Some(passes);
        }
        let all = marble.touching(radius - radius * S::from_f64(OVERLAP));
        Some(self.first_impact_of(all, (row, marble, motion)).unwrap_or(passes))
    }

    /// First time of impact of a ball or a capsule of this radius, of the parts that are met at once
    /// the deepest.
    fn first_impact_of(
        &self,
        radius: S,
        (row, marble, motion): (usize, &SweptMarble<S>, MarbleMotion<S>),
    ) -> Option<WallImpact<S>> {
        let filter = self.marbles.filter_of_row(row);
        let mut best: Option<WallImpact<S>> = None;
        let sized = SweptMarble { sphere: Sphere { radius, ..marble.sphere }, ..*marble };
        self.for_each_wall_on_path(row, marble, motion, |part, path| {
            let stop = if marble.is_ball() {
                self.walls.time_of_impact(part, radius, path)
            } else {
                self.walls.time_of_impact_of_capsule(part, &sized, path)
            };
            let Some(stop) = stop else { return };
            if self.walls.is_ghost_impact(&stop, &sized, (path, filter)) {
                return;
            }
            let order = |stop: &WallImpact<S>| (stop.time, stop.gap);
            if best.as_ref().is_none_or(|best| order(&stop) < order(best)) {
                best = Some(stop);
            }
        });
        best
    }

    /// Visits the sub-shapes of walls that a marble may meet on its path, of half-spaces those at
    /// rest that it would bounce off among others, and the path as each of them sees it.
    fn for_each_wall_on_path(
        &self,
        row: usize,
        marble: &SweptMarble<S>,
        MarbleMotion { displacement, time, carrier }: MarbleMotion<S>,
        mut visit: impl FnMut(SubShape, &RelativePath<S>),
    ) {
        let filter = self.marbles.filter_of_row(row);
        let free = self.free_motion(row);
        let start = marble.sphere.center;
        let bounds = marble.bounds(displacement);
        let moves_far = |path: &RelativePath<S>| path.max_length() + marble.max_swing(path) > free;
        let moving_walls =
            if time > S::zero() { &self.scratch.continuous.moving_walls[..] } else { &[] };
        let path = RelativePath { start, displacement, frame: Frame::Standing };
        let moves = |part: SubShape| {
            time > S::zero() && self.walls.swept_motion_of_row(part.wall as usize).is_some()
        };
        if self.scratch.continuous.crowded.get(row).is_some_and(|crowded| *crowded) {
            for (wall, _) in self.walls.colliding_planes(filter) {
                let part = SubShape { wall, index: 0 };
                if !moves(part) {
                    visit(part, &path);
                }
            }
        }
        if moves_far(&path) {
            self.walls.for_each_colliding(&bounds, filter, |part| {
                if !moves(part) {
                    visit(part, &path);
                }
            });
        }
        for wall in moving_walls {
            let carried = carrier.filter(|(row, ..)| *row == wall.row);
            let path = match carried {
                Some((_, start, displacement)) => {
                    let frame = Frame::Carrying(wall.motion, time);
                    RelativePath { start, displacement, frame }
                }
                None => RelativePath { frame: Frame::Moving(wall.motion, time), ..path },
            };
            if (carried.is_some() || wall.is_near(&bounds))
                && wall.collides(&self.walls, filter)
                && moves_far(&path)
            {
                wall.for_each_near_path(&self.walls, &path, marble.reach(), |part| {
                    visit(part, &path);
                });
            }
        }
    }
}

impl<S: Scalar> Walls<S> {
    /// Tests if an impact is a ghost at an internal edge: the point that is hit lies on another part
    /// too, and the path leads along the plane of this one or away, so that it cannot get deeper.
    fn is_ghost_impact(
        &self,
        impact: &WallImpact<S>,
        marble: &SweptMarble<S>,
        (path, filter): (&RelativePath<S>, CollisionFilter),
    ) -> bool {
        let WallImpact { time, part, normal, center, gap, anchor, .. } = *impact;
        let (sphere, center) = (marble.sphere, center + anchor);
        let Some(face) = self.shapes()[part.wall as usize].face_normal(part.index, center) else {
            return false;
        };
        let closing = -path.velocity(time, center).dot(face);
        if closing > sphere.radius * S::from_f64(OVERLAP)
            || marble.max_acceleration(path, face) > sphere.radius * S::from_f64(OVERLAP)
        {
            return false;
        }
        let flush = flush_distance(&Sphere { center, ..sphere });
        let point = center - normal * (gap + sphere.radius);
        let margin = Vec3::new(flush, flush, flush);
        let mut is_shared = false;
        self.for_each_colliding(&Aabb { min: point - margin, max: point + margin }, filter, |it| {
            is_shared |= it != part && self.project_point(it, point).distance <= flush;
        });
        is_shared
    }

    /// Time of impact of a sphere of this radius with a sub-shape of a wall, by conservative
    /// advancement (Mirtich 1996): as the path is bent where the wall rotates, with a bound of its
    /// acceleration beside the velocity.
    pub(in crate::world) fn time_of_impact(
        &self,
        part: SubShape,
        radius: S,
        path: &RelativePath<S>,
    ) -> Option<WallImpact<S>> {
        let near = radius * S::from_f64(OVERLAP);
        let bend = path.max_acceleration();
        let mut time = S::zero();
        let mut last = None;
        for _ in 0..MAX_ITERATIONS {
            let center = path.at(time);
            let PointProjection { normal, distance, .. } = self.project_point(part, center);
            let (gap, closing) = (distance - radius, -path.velocity(time, center).dot(normal));
            // A ball that slides along a surface closes by rounding; on a bent path perhaps faster.
            let closes = closing > if bend > S::zero() { S::zero() } else { near };
            if closing.is_nan() || (!closes && bend <= S::zero()) {
                return None;
            }
            last = closes.then_some(WallImpact {
                time,
                part,
                normal,
                center,
                anchor: Vec3::zero(),
                swing: Vec3::zero(),
                place: path.place(time, center),
                gap,
            });
            if gap <= near && last.is_some() {
                return last;
            }
            // One that touches and parts may come back where the wall rotates.
            let overshoot = radius * S::from_f64(MAX_OVERSHOOT);
            let gap = if closes { gap } else { gap.max(overshoot) };
            time += time_to_close(gap, closing, bend);
            if time > S::one() {
                return None;
            }
        }
        // A grazing contact, or within rounding.
        last.filter(|last| last.gap <= radius)
    }
}

/// Fraction of a normal velocity change that a stopped marble loses: all, but never so much that it
/// would separate by forces that it has not felt yet. `end` is its normal speed with all of it.
pub(super) fn lost_fraction<S: Scalar>(change: S, end: S) -> S {
    if end < S::zero() && end > change { end / change } else { S::one() }
}

/// Projection of a motion onto the surface that it reaches: onto its plane, onto the edge with
/// another touched surface in the way, or zero in a corner. No surface is in the way by `rounding`
/// metres.
fn along_surfaces<S: Scalar>(
    displacement: Vec3<S>,
    normal: Vec3<S>,
    others: &[Vec3<S>],
    rounding: S,
) -> Mat3<S> {
    let plane = Mat3::from_value(S::one()) - outer(normal);
    let slid = plane * displacement;
    let blocks = |other: &&Vec3<S>, displacement: Vec3<S>| displacement.dot(**other) < -rounding;
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
