//! Shapes of bodies in the world, for queries and sensors.

use cgmath::{EuclideanSpace, InnerSpace};

use crate::body::BodyState;
use crate::frame::Pose;
use crate::math::{Point3, Quat, Scalar, cast_vector};
use crate::shape::Shape;

impl<S: Scalar> BodyState<S> {
    /// Pose of its frame, in the scalar of the world.
    fn frame(&self) -> Pose<S> {
        let Pose { rotation: Quat { s, v }, translation } = self.pose();
        let rotation = Quat { s: S::from_f64(s), v: cast_vector(v) }.normalize();
        Pose { rotation, translation: cast_vector(translation) }
    }

    /// Its shape where it is.
    pub(super) fn world_shape(&self) -> Shape<S> {
        self.body.shape.transformed(self.frame())
    }

    /// Its convex parts where they are.
    pub(super) fn world_parts(&self) -> impl Iterator<Item = Shape<S>> + '_ {
        let frame = self.frame();
        self.local_parts().iter().map(move |part| part.transformed(frame))
    }

    /// One of its convex parts where it is.
    pub(super) fn world_part(&self, part: u32) -> Option<Shape<S>> {
        Some(self.local_parts().get(part as usize)?.transformed(self.frame()))
    }

    /// Its convex parts in its frame.
    fn local_parts(&self) -> &[Shape<S>] {
        match &self.body.shape {
            Shape::Compound(compound) => compound.parts(),
            simple => std::slice::from_ref(simple),
        }
    }

    /// Center of mass.
    pub(super) fn world_center(&self) -> Point3<S> {
        Point3::from_vec(cast_vector(self.solver.pose.translation))
    }
}
