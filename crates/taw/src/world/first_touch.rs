//! Where a ball of a swarm first touches a wall on its way, and the plane that the wall is like there.

use cgmath::InnerSpace;

use super::continuous::{Frame, MovingWall, RelativePath};
use super::narrow_phase::{Candidate, candidate_sub_shapes, remove_ghost_collisions};
use super::swept_walls::{GRAZES, SweptWalls, not_beyond};
use super::walls::SubShape;
use crate::broad::CollisionFilter;
use crate::math::{Point3, Scalar, Vec3};
use crate::motion::WallMotion;
use crate::shape::{BoundedShape, PointProjection, Sphere};

impl<S: Scalar> SweptWalls<'_, S> {
    /// Plane that a part is like for a ball with its center at a place: its normal, and the distance of the
    /// ball, where it is now, from that plane as it is at the end of the step. `motion` is that of a wall that
    /// moves, and how long before the end of the step the ball is at the place, in seconds.
    pub(super) fn plane_at(
        &self,
        part: SubShape,
        (ball, place): (&Sphere<S>, Point3<S>),
        motion: Option<(WallMotion<S>, S)>,
    ) -> (Vec3<S>, S) {
        let (normal, distance, surface_way) = match motion {
            None => {
                let PointProjection { normal, distance, .. } =
                    self.walls.project_point(part, place);
                (normal, distance, S::zero())
            }
            Some((motion, before)) => {
                let pose = motion.pose_before(before);
                let nearest = self.walls.project_point(part, pose.inverse_transform_point(place));
                let normal = pose.rotation * nearest.normal;
                let surface = motion.velocity_at(ball.center - normal * ball.radius);
                (normal, nearest.distance, surface.dot(normal) * before)
            }
        };
        (normal, distance + (ball.center - place).dot(normal) - surface_way)
    }

    /// Part that a ball first touches on a path, of all that stand, or of a wall that moves, and when, as a
    /// fraction of the path.
    fn first_touched(
        &self,
        (ball, filter): (&Sphere<S>, CollisionFilter),
        path: &RelativePath<S>,
        moving: Option<&MovingWall<S>>,
    ) -> Option<(S, SubShape)> {
        let mut first: Option<(S, SubShape)> = None;
        let mut visit = |part| {
            let Some(hit) = self.walls.time_of_impact(part, ball.radius, path) else { return };
            if first.is_none_or(|(time, _)| hit.time < time) {
                first = Some((hit.time, part));
            }
        };
        if let Some(wall) = moving {
            wall.for_each_near_path(self.walls, path, ball.radius, visit);
        } else {
            let end = Sphere { center: path.at(S::one()), ..*ball };
            let reached = ball.bounding_box().union(&end.bounding_box());
            self.walls.for_each_colliding(&reached, filter, |part| {
                if self.stands(part.wall) {
                    visit(part);
                }
            });
        }
        first
    }

    /// Path of a ball in the frame of a wall that moves, or of those that stand, and its length over that of the
    /// way. The times are what is left of the step and what the way takes, in seconds.
    fn path(
        ball: &Sphere<S>,
        (displacement, [before, time]): (Vec3<S>, [S; 2]),
        moving: Option<&MovingWall<S>>,
    ) -> (RelativePath<S>, S) {
        // Of a wall that moves, up to the end of the step, since that is where it is known.
        let (ways, frame) = match moving {
            None => (S::one(), Frame::Standing),
            Some(wall) => (before / time, Frame::Moving(wall.motion, before)),
        };
        (RelativePath { start: ball.center, displacement: displacement * ways, frame }, ways)
    }

    /// Plane where a ball touches a part, or where its way ends: see
    /// [`StaticGeometry::plane_on_way`](crate::swarm::StaticGeometry::plane_on_way).
    pub(super) fn plane_of_part(
        &self,
        part: SubShape,
        (ball, filter): (&Sphere<S>, CollisionFilter),
        way: (Vec3<S>, [S; 2]),
    ) -> Option<(Vec3<S>, S)> {
        let moving = self.moving.binary_search_by_key(&part.wall, |wall| wall.row).ok();
        let moving = moving.map(|i| &self.moving[i]);
        let (path, ways) = Self::path(ball, way, moving);
        let hit = self.walls.time_of_impact(part, ball.radius, &path);
        let (at, part) = match hit.filter(|hit| hit.time * ways < S::one()) {
            Some(hit) => {
                let touching = Sphere { center: path.at(hit.time), ..*ball };
                let part = self.uncovered_part(part, (&touching, filter), moving.is_some())?;
                (hit.time * ways, part)
            }
            None => (S::one(), part),
        };
        Some(self.plane_on(part, ball, (at, way), moving))
    }

    /// The part that a ball first touches on its way, and the plane that it is like there.
    pub(super) fn first_part(
        &self,
        (ball, filter): (&Sphere<S>, CollisionFilter),
        way: (Vec3<S>, [S; 2]),
    ) -> Option<(SubShape, Vec3<S>, S)> {
        let moving = self.moving.iter().filter(|wall| !self.outruns(wall, ball));
        let all = std::iter::once(None).chain(moving.map(Some));
        let touches = all.filter_map(|moving| {
            let (path, ways) = Self::path(ball, way, moving);
            let (time, part) = self.first_touched((ball, filter), &path, moving)?;
            let touching = Sphere { center: path.at(time), ..*ball };
            let part = self.uncovered_part(part, (&touching, filter), moving.is_some())?;
            (time * ways < S::one()).then_some((time * ways, part, moving))
        });
        let (at, part, moving) = touches.min_by(|(a, ..), (b, ..)| a.total_cmp(b))?;
        let (normal, distance) = self.plane_on(part, ball, (at, way), moving);
        Some((part, normal, distance))
    }

    /// Plane that a part is like for a ball at a fraction of its way: see [`Self::plane_at`].
    fn plane_on(
        &self,
        part: SubShape,
        ball: &Sphere<S>,
        (at, (displacement, [before, time])): (S, (Vec3<S>, [S; 2])),
        moving: Option<&MovingWall<S>>,
    ) -> (Vec3<S>, S) {
        let place = ball.center + displacement * at;
        let motion = moving.map(|wall| (wall.motion, before - time * at));
        let (normal, distance) = self.plane_at(part, (ball, place), motion);
        (normal, not_beyond(distance))
    }

    /// The part that a ball touches, or another one that covers it there: at an edge between two triangles of a
    /// mesh, only one of them is a contact. None if half-spaces cover it. Of a wall that moves, in its frame, in which
    /// nobody knows where others are.
    fn uncovered_part(
        &self,
        part: SubShape,
        (touching, filter): (&Sphere<S>, CollisionFilter),
        moves: bool,
    ) -> Option<SubShape> {
        let (mut near, reach) = (Vec::new(), touching.radius * S::from_f64(GRAZES));
        candidate_sub_shapes(self.walls, (touching, filter), reach, &mut near);
        near.retain(|it| it.part.wall == part.wall || !moves && self.stands(it.part.wall));
        let has_it = |near: &[Candidate<S>]| near.iter().any(|it| it.part == part);
        if near.len() > 1 && has_it(&near) {
            remove_ghost_collisions(self.walls, (touching, filter), &mut near);
            if !has_it(&near) {
                let distance = |it: &Candidate<S>| it.nearest.distance;
                let nearest = near.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)));
                return nearest.map(|it| it.part);
            }
        }
        Some(part)
    }

    fn stands(&self, row: u32) -> bool {
        self.moving.binary_search_by_key(&row, |wall| wall.row).is_err()
    }
}
