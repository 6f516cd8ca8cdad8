use cgmath::{EuclideanSpace, One, Rotation};

use super::turned;
use crate::frame::Pose;
use crate::math::{Point3, Quat, Scalar, Vec3, cast_point, cast_vector};

/// How a wall moves, as one rigid thing: a velocity, and a spin about a pivot.
///
/// It says how fast the wall's surface carries along what lies on it, and nothing
/// about where the wall is at the end of a step. So a conveyor is a wall that stays where it
/// is and has one. For one that was set to another place since the last step,
/// [`World::step`](crate::world::World::step) takes it for how it came there, through all
/// substeps: velocity and spin are then the mean ones over the step, and the pivot is where the
/// step leads it to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WallMotion<S> {
    /// Of the pivot, in m/s.
    pub velocity: Vec3<S>,
    /// In rad/s, an axial vector in world space.
    pub spin: Vec3<S>,
    /// A point that the spin is about.
    pub pivot: Point3<S>,
}

impl<S: Scalar> WallMotion<S> {
    /// The velocity of a point that moves along, in m/s.
    #[must_use]
    pub fn velocity_at(&self, point: Point3<S>) -> Vec3<S> {
        self.velocity + self.spin.cross(point - self.pivot)
    }

    /// From where the wall is to where it was `time` seconds ago.
    pub(crate) fn undone(&self, time: S) -> Pose<S> {
        let rotation = turned(Quat::one(), self.spin, -time);
        let pivot = self.pivot.to_vec();
        let translation = pivot - rotation.rotate_vector(pivot) - self.velocity * time;
        Pose { rotation, translation }
    }

    /// The same motion in another scalar.
    pub(crate) fn cast<T: Scalar>(self) -> WallMotion<T> {
        WallMotion {
            velocity: cast_vector(self.velocity),
            spin: cast_vector(self.spin),
            pivot: cast_point(self.pivot),
        }
    }
}
