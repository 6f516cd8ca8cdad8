use cgmath::{EuclideanSpace, One, Rotation, Zero};

use super::integrate_rotation;
use crate::Error;
use crate::error::{finite_point, finite_vector};
use crate::frame::Pose;
use crate::math::{Point3, Quat, Scalar, Vec3, cast_point, cast_vector};

/// Rigid motion of a kinematic wall: a velocity, and an angular velocity about a pivot.
///
/// Surface velocity that drags what lies on the wall; it does not move the wall: a conveyor belt
/// stays in place and has a motion. For a wall that was set to another place since the last step,
/// [`World::step`](crate::world::World::step) interpolates its path through all substeps with this
/// motion: velocity and angular velocity are then the means over the step, and the pivot is at its
/// position at the end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WallMotion<S> {
    /// Velocity of the pivot, in m/s.
    pub velocity: Vec3<S>,
    /// Angular velocity in rad/s, an axial vector in world space.
    pub angular_velocity: Vec3<S>,
    /// Center of rotation, in metres.
    pub pivot: Point3<S>,
}

impl<S: Scalar> WallMotion<S> {
    /// Velocity of a point that moves with the wall, in m/s.
    #[must_use]
    pub fn velocity_at(&self, point: Point3<S>) -> Vec3<S> {
        self.velocity + self.angular_velocity.cross(point - self.pivot)
    }

    /// Returns true for a wall that stays where it is.
    pub(crate) fn is_zero(&self) -> bool {
        self.velocity.is_zero() && self.angular_velocity.is_zero()
    }

    /// The motion, if it is finite.
    pub(crate) fn validated(self) -> Result<Self, Error> {
        finite_vector(["velocity.x", "velocity.y", "velocity.z"], self.velocity)?;
        let names = ["angular_velocity.x", "angular_velocity.y", "angular_velocity.z"];
        finite_vector(names, self.angular_velocity)?;
        finite_point(["pivot.x", "pivot.y", "pivot.z"], self.pivot)?;
        Ok(self)
    }

    /// Relative pose of the wall `time` seconds ago.
    pub(crate) fn pose_before(&self, time: S) -> Pose<S> {
        let rotation = integrate_rotation(Quat::one(), self.angular_velocity, -time);
        let pivot = self.pivot.to_vec();
        let translation = pivot - rotation.rotate_vector(pivot) - self.velocity * time;
        Pose { rotation, translation }
    }

    /// Converts to another scalar.
    pub(crate) fn cast<T: Scalar>(self) -> WallMotion<T> {
        WallMotion {
            velocity: cast_vector(self.velocity),
            angular_velocity: cast_vector(self.angular_velocity),
            pivot: cast_point(self.pivot),
        }
    }
}
