//! Paths of marbles as walls see them that move within the substep.

use cgmath::{InnerSpace, Zero};

use crate::broad::CollisionFilter;
use crate::math::{Point3, RealVector as _, Scalar, Vec3, length};
use crate::motion::WallMotion;
use crate::shape::{Aabb, Aabb3};
use crate::world::walls::{SubShape, Walls};

/// Wall, other than a half-space, that moves within the substep.
#[derive(Clone, Copy, Debug)]
pub(in crate::world) struct MovingWall<S> {
    pub row: u32,
    pub motion: WallMotion<S>,
    /// Bounding boxes at the end of the substep, and of all its poses.
    bounds: Aabb3<S>,
    swept: Aabb3<S>,
}

/// Straight path of a marble through the rest of a substep, and the frame in which a wall stands at
/// its pose of the end: there the paths past a wall that moves are bent.
#[derive(Clone, Copy, Debug)]
pub(in crate::world) struct RelativePath<S> {
    /// Start and displacement, in metres.
    pub start: Point3<S>,
    pub displacement: Vec3<S>,
    pub frame: Frame<S>,
}

/// Motion of a wall, and the time that is left of the substep in seconds.
#[derive(Clone, Copy, Debug)]
pub(in crate::world) enum Frame<S> {
    /// The wall stands.
    Standing,
    /// The wall moves, the path is straight in world space.
    Moving(WallMotion<S>, S),
    /// The wall carries the marble along, whose path is straight in the wall's frame.
    Carrying(WallMotion<S>, S),
}

/// Place on a path in metres.
pub(super) struct Place<S> {
    /// In world space, and how far the wall moves from there until the end of the substep.
    pub position: Point3<S>,
    pub carried: Vec3<S>,
    /// Rest of the displacement as the wall sees it.
    pub rest: Vec3<S>,
}

impl<S: Scalar> RelativePath<S> {
    /// Position in the frame of the wall at a fraction of the path.
    pub fn at(&self, time: S) -> Point3<S> {
        let position = self.start + self.displacement * time;
        match self.moving() {
            Some((motion, left)) => {
                motion.pose_before(left * (S::one() - time)).inverse_transform_point(position)
            }
            None => position,
        }
    }

    /// Place at a fraction of the path, where it is at this position in the frame of the wall.
    pub(super) fn place(&self, time: S, center: Point3<S>) -> Place<S> {
        let rest = self.displacement * (S::one() - time);
        if let Frame::Carrying(motion, left) = self.frame {
            let position = motion.pose_before(left * (S::one() - time)).transform_point(center);
            return Place { position, carried: center - position, rest };
        }
        let position = self.start + self.displacement * time;
        let carried = center - position;
        Place { position, carried, rest: rest - carried }
    }

    /// Velocity in the frame of the wall at a position there, in metres per path.
    pub fn velocity(&self, time: S, position: Point3<S>) -> Vec3<S> {
        let Some((motion, left)) = self.moving() else { return self.displacement };
        let relative = self.displacement - motion.velocity * left;
        let rotation = motion.pose_before(left * (S::one() - time)).rotation;
        rotation.conjugate() * relative
            - (motion.angular_velocity * left).cross(position - motion.pivot)
    }

    /// Rotates a vector of the world into the frame of the wall, at a fraction of the path.
    pub(super) fn rotate_into_frame(&self, time: S, vector: Vec3<S>) -> Vec3<S> {
        match self.frame {
            Frame::Standing => vector,
            Frame::Moving(motion, left) | Frame::Carrying(motion, left) => {
                motion.pose_before(left * (S::one() - time)).inverse_transform_vector(vector)
            }
        }
    }

    /// Rotation of the wall on the path, an axial vector in radians.
    pub(super) fn turn(&self) -> Vec3<S> {
        match self.frame {
            Frame::Standing => Vec3::zero(),
            Frame::Moving(motion, left) | Frame::Carrying(motion, left) => {
                motion.angular_velocity * left
            }
        }
    }

    /// Motion of a wall against which the path is straight in world space, and the time left.
    fn moving(&self) -> Option<(WallMotion<S>, S)> {
        match self.frame {
            Frame::Moving(motion, left) => Some((motion, left)),
            Frame::Standing | Frame::Carrying(..) => None,
        }
    }

    /// Upper bound of the acceleration in the frame of the wall, in metres per squared path: that of
    /// Coriolis, and the centrifugal one.
    pub fn max_acceleration(&self) -> S {
        let two = S::from_f64(2.0);
        self.moving().map_or(S::zero(), |(motion, left)| {
            let angle = length(motion.angular_velocity) * left;
            let relative = length(self.displacement - motion.velocity * left);
            // The lever may overflow.
            let lever = if angle > S::zero() { self.max_lever(motion, left) } else { S::zero() };
            angle * (two * relative + angle * lever)
        })
    }

    /// Upper bound of the path's length in the frame of the wall, in metres.
    pub fn max_length(&self) -> S {
        self.moving().map_or_else(
            || length(self.displacement),
            |(motion, left)| {
                let angle = length(motion.angular_velocity) * left;
                let turned = if angle > S::zero() {
                    angle * self.max_lever(motion, left)
                } else {
                    S::zero()
                };
                length(self.displacement - motion.velocity * left) + turned
            },
        )
    }

    /// Largest distance from the pivot, in metres: at the start or at the end, as both move straight.
    fn max_lever(&self, motion: WallMotion<S>, left: S) -> S {
        let pivot = motion.pivot - motion.velocity * left;
        let end = self.start + self.displacement;
        length(self.start - pivot).max(length(end - motion.pivot))
    }

    /// Box around the path of a sphere in the frame of the wall.
    fn bounds(&self, radius: S) -> Aabb3<S> {
        let end = self.start + self.displacement;
        let turns =
            self.moving().filter(|(motion, _)| motion.angular_velocity.magnitude2() > S::zero());
        if turns.is_some() {
            return around(end, self.max_length() + radius);
        }
        around(self.at(S::zero()), radius).union(&around(end, radius))
    }
}

/// Cube around a point.
fn around<S: Scalar>(point: Point3<S>, reach: S) -> Aabb3<S> {
    let reach = Vec3::new(reach, reach, reach);
    Aabb { min: point - reach, max: point + reach }
}

/// Box around a straight path of a sphere.
pub(super) fn path_bounds<S: Scalar>(
    start: Point3<S>,
    displacement: Vec3<S>,
    radius: S,
) -> Aabb3<S> {
    around(start, radius).union(&around(start + displacement, radius))
}

impl<S: Scalar> Walls<S> {
    /// Velocity of the surface of the wall at an index, at a point with this normal, in m/s: along the
    /// surface, if the wall was not set to another pose since the last step.
    #[must_use]
    pub fn surface_velocity_of_row(
        &self,
        row: usize,
        point: Point3<S>,
        normal: Vec3<S>,
    ) -> Vec3<S> {
        let Some(motion) = self.motion_of_row(row) else { return Vec3::zero() };
        let velocity = motion.velocity_at(point);
        if self.has_moved(row) { velocity } else { velocity.reject_from(normal) }
    }

    /// Motion of the wall at an index, if it was set to another pose since the last step.
    pub(in crate::world) fn swept_motion_of_row(&self, row: usize) -> Option<WallMotion<S>> {
        let motion = self.motion_of_row(row).filter(|_| self.has_moved(row))?;
        (!motion.velocity.is_zero() || !motion.angular_velocity.is_zero()).then_some(motion)
    }
}

impl<S: Scalar> MovingWall<S> {
    /// Lists the walls that move within a substep of `dt` seconds.
    pub fn list(walls: &Walls<S>, dt: S, list: &mut Vec<Self>) {
        list.clear();
        list.extend((0..walls.len()).filter_map(|row| {
            let motion = walls.swept_motion_of_row(row)?;
            let bounds = walls.shapes()[row].bounding_box()?;
            let lever = Vec3::new(
                (bounds.min.x - motion.pivot.x).abs().max((bounds.max.x - motion.pivot.x).abs()),
                (bounds.min.y - motion.pivot.y).abs().max((bounds.max.y - motion.pivot.y).abs()),
                (bounds.min.z - motion.pivot.z).abs().max((bounds.max.z - motion.pivot.z).abs()),
            );
            let turned = length(motion.angular_velocity) * dt * length(lever);
            let back = motion.velocity * -dt;
            let turned = Vec3::new(turned, turned, turned);
            let before = Aabb { min: bounds.min + back - turned, max: bounds.max + back + turned };
            Some(Self { row: row as u32, motion, bounds, swept: bounds.union(&before) })
        }));
    }

    /// Returns true if the wall may come near a box of world space within the substep.
    pub fn is_near(&self, bounds: &Aabb3<S>) -> bool {
        self.swept.overlaps(bounds)
    }

    /// Visits the sub-shapes that a sphere on a path may meet.
    pub fn for_each_near_path(
        &self,
        walls: &Walls<S>,
        path: &RelativePath<S>,
        radius: S,
        mut visit: impl FnMut(SubShape),
    ) {
        self.for_each_in_box(walls, &path.bounds(radius), &mut visit);
    }

    /// Visits the sub-shapes that may overlap a box in the frame of the wall.
    pub fn for_each_in_box(
        &self,
        walls: &Walls<S>,
        reached: &Aabb3<S>,
        visit: &mut dyn FnMut(SubShape),
    ) {
        if !self.bounds.overlaps(reached) {
            return;
        }
        let (wall, shape) = (self.row, &walls.shapes()[self.row as usize]);
        shape.for_each_box(|part, bounds| {
            if bounds.overlaps(reached) {
                shape.for_each_in_box(part, reached, |index| visit(SubShape { wall, index }));
            }
        });
    }

    /// Returns true if a filter lets the wall collide.
    pub fn collides(&self, walls: &Walls<S>, filter: CollisionFilter) -> bool {
        walls.collides(self.row, filter)
    }
}
