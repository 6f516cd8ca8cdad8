//! Walls in a step, as the balls of a swarm meet them.

use cgmath::{EuclideanSpace, InnerSpace};

use super::continuous::{Frame, MAX_FREE_MOTION, MovingWall, RelativePath};
use super::narrow_phase::{Candidate, candidate_sub_shapes, remove_ghost_collisions};
use super::walls::{SubShape, Walls};
use crate::broad::{CollisionFilter, CollisionLayers};
use crate::math::{Point3, Scalar, Vec3, length};
use crate::motion::WallMotion;
use crate::response::{Colliders as _, Material};
use crate::shape::{Aabb, Aabb3, BoundedShape, PointProjection, Sphere};
use crate::swarm::{MAX_COORDINATE, StaticGeometry};

/// Overlap in radii at the end of a path up to which a ball only grazes a wall.
pub(super) const GRAZES: f64 = 0.02;

/// Radius of a ball's core, over its own: what a surface never passes.
const CORE: f64 = 0.5;

/// Walls in a step, as the balls of a swarm meet them.
///
/// Walls are where they will be at the end of it. Of one that goes further in the step than a ball is
/// wide, that says little: the ball may be beyond it by then. So it is met on the ball's path as the wall
/// sees it.
pub(crate) struct SweptWalls<'a, S> {
    pub(super) walls: &'a Walls<S>,
    pub(super) moving: Vec<MovingWall<S>>,
    /// Length of the step, in seconds.
    dt: S,
}

impl<'a, S: Scalar> SweptWalls<'a, S> {
    /// Walls in a step of `dt` seconds.
    pub fn new(walls: &'a Walls<S>, dt: S) -> Self {
        let mut moving = Vec::new();
        MovingWall::list(walls, dt, &mut moving);
        Self { walls, moving, dt }
    }

    /// Distance that a wall goes at a ball in the step, at most, in metres.
    fn way_of(&self, wall: &MovingWall<S>, ball: &Sphere<S>) -> S {
        let WallMotion { velocity, angular_velocity, pivot } = wall.motion;
        let speed = length(velocity) + length(angular_velocity) * length(ball.center - pivot);
        speed * self.dt
    }

    /// Returns true if a wall goes so far in the step that it may pass a ball there.
    pub(super) fn outruns(&self, wall: &MovingWall<S>, ball: &Sphere<S>) -> bool {
        self.way_of(wall, ball) > ball.radius * S::from_f64(MAX_FREE_MOTION)
    }

    /// Returns true if the wall in a row may pass a ball.
    fn is_outrunning(&self, row: u32, ball: &Sphere<S>) -> bool {
        let moving = self.moving.binary_search_by_key(&row, |wall| wall.row);
        moving.is_ok_and(|i| self.outruns(&self.moving[i], ball))
    }

    /// Visits what a ball touches of a wall that may pass it, as it was `before` seconds before the
    /// end, and then what it meets of it on this path of `time` seconds: each with the plane there, as it
    /// is at the end.
    fn visit_outrunning(
        &self,
        wall: &MovingWall<S>,
        ball: &Sphere<S>,
        displacement: Vec3<S>,
        [before, time]: [S; 2],
        visit: &mut dyn FnMut(SubShape, Vec3<S>, S),
    ) {
        let motion = wall.motion;
        let mut visit_at = |part, center: Point3<S>, after: S| {
            let (normal, distance) =
                self.plane_at(part, (ball, center), Some((motion, before - after)));
            visit(part, normal, distance);
        };
        // Up to the end, since that is where the wall is known.
        let path = RelativePath {
            start: ball.center,
            displacement: displacement * (before / time),
            frame: Frame::Moving(motion, before),
        };
        let mut first: Option<(S, SubShape)> = None;
        wall.for_each_near_path(self.walls, &path, ball.radius, |part| {
            let Some(hit) = self.walls.time_of_impact(part, ball.radius, &path) else { return };
            if hit.time * before <= time && first.is_none_or(|(time, _)| hit.time < time) {
                first = Some((hit.time, part));
            }
        });
        if let Some((at, part)) = first {
            visit_at(part, ball.center + path.displacement * at, before * at);
        }
        let here = Sphere { center: path.at(S::zero()), ..*ball };
        let reach = ball.radius * S::from_f64(MAX_FREE_MOTION);
        let mut near = Vec::new();
        candidate_sub_shapes(self.walls, (&here, CollisionFilter::ALL), reach, &mut near);
        near.retain(|it| it.part.wall == wall.row);
        if near.len() > 1 {
            remove_ghost_collisions(self.walls, (&here, CollisionFilter::ALL), &mut near);
        }
        for Candidate { part, .. } in near {
            visit_at(part, ball.center, S::zero());
        }
    }

    /// Time at which a sphere meets the first part that it passes into on a path, as a fraction of
    /// it. Its core, or how deep it comes in the end, says whether it passes into a wall: one that
    /// grazes it goes on.
    fn time_of_passage(
        &self,
        (sphere, filter): (&Sphere<S>, CollisionFilter),
        displacement: Vec3<S>,
        reached: &Aabb3<S>,
    ) -> Option<S> {
        let core = sphere.radius * S::from_f64(CORE);
        let path = RelativePath { start: sphere.center, displacement, frame: Frame::Standing };
        let deep = sphere.radius * S::from_f64(1.0 - GRAZES);
        // One that slides along a wall in which it is goes no deeper, up to the rounding of places.
        let place = length(sphere.center.to_vec()) + sphere.radius + length(displacement);
        let rounding = place * S::from_f64(16.0) * S::epsilon();
        let mut first: Option<S> = None;
        self.for_each_standing(reached, (sphere, filter), |part| {
            let distance = |point| self.walls.project_point(part, point).distance;
            let ends_in_it = || {
                let end = distance(sphere.center + displacement);
                end < deep && end < distance(sphere.center) - rounding
            };
            let hits = |radius| self.walls.time_of_impact(part, radius, &path);
            let passes = ends_in_it() || hits(core).is_some();
            let stop = passes.then(|| hits(sphere.radius)).flatten();
            if let Some(stop) = stop {
                first = Some(first.map_or(stop.time, |time| time.min(stop.time)));
            }
        });
        first
    }

    /// Center at the end of a path on which a ball's core passes through none of these parts: it slides
    /// along those that it meets. None if it meets none.
    fn slide(
        &self,
        [mut start, end]: [Point3<S>; 2],
        radius: S,
        visit_parts: &dyn Fn(&Aabb3<S>, &mut dyn FnMut(SubShape)),
    ) -> Option<Point3<S>> {
        let core = radius * S::from_f64(CORE);
        let (mut displacement, mut stopped) = (end - start, false);
        // In a corner, it meets three; where it meets more, it stays.
        for _ in 0..3 {
            let path = RelativePath { start, displacement, frame: Frame::Standing };
            let [at, to] = [start, start + displacement]
                .map(|center| Sphere { center, radius: core }.bounding_box());
            let hits = |part, radius| {
                let hit = self.walls.time_of_impact(part, radius, &path);
                hit.map(|hit| hit.time)
            };
            let mut first: Option<(S, SubShape)> = None;
            visit_parts(&at.union(&to), &mut |part| {
                let Some(hit) = hits(part, core) else { return };
                if first.is_none_or(|(time, _)| hit < time) {
                    first = Some((hit, part));
                }
            });
            let Some((passage, part)) = first else {
                return stopped.then_some(start + displacement);
            };
            stopped = true;
            let time = hits(part, radius).map_or(passage, |touch| touch.min(passage));
            start += displacement * time;
            let normal = self.walls.project_point(part, start).normal;
            let rest = displacement * (S::one() - time);
            displacement = rest - normal * rest.dot(normal);
        }
        Some(start)
    }

    /// Visits the parts that may overlap a box, of walls that a ball collides with and that do not pass
    /// it.
    fn for_each_standing(
        &self,
        bounds: &Aabb3<S>,
        (ball, filter): (&Sphere<S>, CollisionFilter),
        mut visit: impl FnMut(SubShape),
    ) {
        self.walls.for_each_colliding(bounds, filter, |part| {
            if !self.is_outrunning(part.wall, ball) {
                visit(part);
            }
        });
    }
}

impl<S: Scalar> StaticGeometry<S> for SweptWalls<'_, S> {
    fn planes(&self, visit: &mut dyn FnMut(u32, Vec3<S>, S)) {
        for (wall, plane) in self.walls.planes() {
            visit(wall, plane.normal().normalize(), not_beyond(plane.offset()));
        }
    }

    fn has_shapes(&self) -> bool {
        !self.walls.are_half_spaces()
    }

    fn visit_removals_since(&self, identity: u64, visit: &mut dyn FnMut([u32; 2])) -> bool {
        self.walls.changes().visit_removals_since(identity, visit)
    }

    fn visit_changes_since(&self, identity: u64, visit: &mut dyn FnMut([[S; 3]; 2])) -> bool {
        self.walls.changes().visit_since(identity, |region| {
            visit([region.min.into(), region.max.into()]);
        })
    }

    fn near(&self, low: [S; 3], high: [S; 3]) -> bool {
        let bounds = Aabb { min: low.into(), max: high.into() };
        let mut any = self.moving.iter().any(|wall| wall.is_near(&bounds));
        self.walls.for_each_in_box(&bounds, |_| any = true);
        any
    }

    fn shapes_at(
        &self,
        ball: &[S; 4],
        filter: CollisionFilter,
        reach: S,
        visit: &mut dyn FnMut([u32; 2], Vec3<S>, S),
    ) {
        let sphere = sphere(*ball);
        // A wall that the ball touches now may be that much further away at the end.
        let slow = self.moving.iter().filter(|wall| !self.outruns(wall, &sphere));
        let way = slow.map(|wall| self.way_of(wall, &sphere)).fold(S::zero(), S::max);
        let mut near = Vec::new();
        candidate_sub_shapes(self.walls, (&sphere, filter), reach + way, &mut near);
        near.retain(|it| {
            let gap = it.nearest.distance - sphere.radius;
            match self.moving.binary_search_by_key(&it.part.wall, |wall| wall.row) {
                Ok(i) if self.outruns(&self.moving[i], &sphere) => false,
                Ok(i) => gap <= reach + self.way_of(&self.moving[i], &sphere),
                Err(_) => way == S::zero() || gap <= reach,
            }
        });
        if near.len() > 1 {
            remove_ghost_collisions(self.walls, (&sphere, filter), &mut near);
        }
        for Candidate { part: SubShape { wall, index: part }, nearest } in near {
            visit([wall, part], nearest.normal, not_beyond(nearest.distance));
        }
    }

    fn first_hit_on_path(
        &self,
        ball: &[S; 4],
        filter: CollisionFilter,
        displacement: Vec3<S>,
    ) -> Option<([u32; 2], Vec3<S>, S)> {
        let sphere: Sphere<S> = sphere(*ball);
        let center = sphere.center;
        let (start, end) =
            (sphere.bounding_box(), Sphere { center: center + displacement, ..sphere });
        let reached = start.union(&end.bounding_box());
        let time = self.time_of_passage((&sphere, filter), displacement, &reached)?;
        // Before the part that it passes into it may meet another one, of which that is the
        // continuation: then the edge between them is no obstacle.
        let path = RelativePath { start: center, displacement, frame: Frame::Standing };
        let mut first: Option<(SubShape, S, PointProjection<S>)> = None;
        self.for_each_standing(&reached, (&sphere, filter), |part| {
            let Some(stop) = self.walls.time_of_impact(part, sphere.radius, &path) else { return };
            if stop.time > time || first.as_ref().is_some_and(|(_, time, _)| stop.time >= *time) {
                return;
            }
            let nearest = self.walls.project_point(part, center + displacement * stop.time);
            let approach = -displacement.dot(nearest.normal);
            if stop.time == time || approach > displacement.magnitude() * S::from_f64(GRAZES) {
                first = Some((part, stop.time, nearest));
            }
        });
        let (part, time, nearest) = first?;
        // The plane there is nearer by the displacement up to it.
        let distance = nearest.distance - displacement.dot(nearest.normal) * time;
        Some(([part.wall, part.index], nearest.normal, not_beyond(distance)))
    }

    fn is_outrun(&self, &[x, y, z, radius]: &[S; 4], way: S, filter: CollisionFilter) -> bool {
        let ball = sphere([x, y, z, radius]);
        let bounds = Sphere { radius: radius + way, ..ball }.bounding_box();
        let passes = |wall: &MovingWall<S>| {
            wall.is_near(&bounds) && wall.collides(self.walls, filter) && self.outruns(wall, &ball)
        };
        self.moving.iter().any(passes)
    }

    fn outrunning_at(
        &self,
        ball: &[S; 4],
        filter: CollisionFilter,
        displacement: Vec3<S>,
        times: [S; 2],
        visit: &mut dyn FnMut([u32; 2], Vec3<S>, S),
    ) {
        let ball = sphere(*ball);
        for wall in &self.moving {
            if wall.collides(self.walls, filter) && self.outruns(wall, &ball) {
                self.visit_outrunning(
                    wall,
                    &ball,
                    displacement,
                    times,
                    &mut |part, normal, far| {
                        visit([part.wall, part.index], normal, not_beyond(far));
                    },
                );
            }
        }
    }

    fn plane_on_way(
        &self,
        [wall, index]: [u32; 2],
        ball: &[S; 4],
        filter: CollisionFilter,
        way: (Vec3<S>, [S; 2]),
    ) -> Option<(Vec3<S>, S)> {
        self.plane_of_part(SubShape { wall, index }, (&sphere(*ball), filter), way)
    }

    fn first_touch(
        &self,
        ball: &[S; 4],
        filter: CollisionFilter,
        way: (Vec3<S>, [S; 2]),
    ) -> Option<([u32; 2], Vec3<S>, S)> {
        let (part, normal, distance) = self.first_part((&sphere(*ball), filter), way)?;
        Some(([part.wall, part.index], normal, distance))
    }

    fn stop_passage(
        &self,
        [before, now]: [&[S; 4]; 2],
        filter: CollisionFilter,
        before_end: [S; 2],
    ) -> Option<[S; 3]> {
        let [before, now]: [Sphere<S>; 2] = [sphere(*before), sphere(*now)];
        let bounds = before.bounding_box().union(&now.bounding_box());
        let (mut center, mut stopped) = (now.center, false);
        for wall in &self.moving {
            let meets = wall.is_near(&bounds) && wall.collides(self.walls, filter);
            if !meets || !self.outruns(wall, &now) {
                continue;
            }
            // In the frame of the wall at the end of the step.
            let [then, here] = before_end.map(|time| wall.motion.pose_before(time));
            let path =
                [then.inverse_transform_point(before.center), here.inverse_transform_point(center)];
            let parts = |bounds: &Aabb3<S>, visit: &mut dyn FnMut(SubShape)| {
                wall.for_each_in_box(self.walls, bounds, visit);
            };
            if let Some(end) = self.slide(path, now.radius, &parts) {
                (center, stopped) = (here.transform_point(end), true);
            }
        }
        let parts = |bounds: &Aabb3<S>, visit: &mut dyn FnMut(SubShape)| {
            self.for_each_standing(bounds, (&now, filter), visit);
        };
        if let Some(end) = self.slide([before.center, center], now.radius, &parts) {
            (center, stopped) = (end, true);
        }
        stopped.then(|| center.into())
    }

    fn surface_velocity(&self, wall: u32, point: Point3<S>, normal: Vec3<S>) -> Vec3<S> {
        let velocity = self.walls.surface_velocity(wall as usize, point, normal);
        // No ball is set to more either: squares and products with masses stay numbers.
        let most = S::from_f64(MAX_COORDINATE);
        velocity.map(|x| if x.is_finite() { x.clamp(-most, most) } else { S::zero() })
    }

    fn layers(&self, wall: u32) -> CollisionLayers {
        self.walls.layers_of_row(wall)
    }

    fn material(&self, wall: u32) -> Option<Material<S>> {
        self.walls.material_of_row(wall as usize)
    }
}

/// A ball of a swarm.
fn sphere<S: Scalar>(ball: [S; 4]) -> Sphere<S> {
    let [x, y, z, radius] = ball;
    Sphere { center: Point3::new(x, y, z), radius }
}

/// Beyond this, in metres, a wall is as far away as this, so that squares of distances are numbers: no
/// ball gets there.
const FARTHEST: f64 = 1e15;

/// A distance or an offset, in metres. What is no number, as of walls that move too fast for numbers,
/// is far away.
pub(super) fn not_beyond<S: Scalar>(x: S) -> S {
    let farthest = S::from_f64(FARTHEST);
    if x.is_nan() { farthest } else { x.clamp(-farthest, farthest) }
}
