//! Shapes of marbles in world space: spheres and capsules.

use cgmath::EuclideanSpace;

use super::MarbleId;
use super::marbles::Marbles;
use crate::Error;
use crate::math::{Point3, Scalar, Vec3};
use crate::motion::Rotation;
use crate::response::CapsuleInertia;
use crate::shape::{Capsule, Shape, Sphere, capsule_unit_inertia};

/// Fraction of the half length of a capsule from which on a point of its axis counts as an end of it.
pub(super) const END: f64 = 0.999;
/// Feature of both capsules at the first of two points where parallel ones touch.
pub(super) const SIDE_BY_SIDE: u32 = 4;

impl<S: Scalar> Marbles<S> {
    /// Half length of a marble in metres; zero for a ball.
    pub(super) fn half_length(&self, row: usize) -> S {
        self.own.half_length.get(row).unwrap_or_else(S::zero)
    }

    /// [Feature](crate::contact::Contact::feature) of a marble at a point of its axis, in metres from its
    /// center.
    #[inline]
    pub(super) fn feature_at(&self, row: usize, along: S) -> u32 {
        let end = self.half_length(row) * S::from_f64(END);
        if end == S::zero() {
            0
        } else if along.abs() < end {
            3
        } else if along < S::zero() {
            1
        } else {
            2
        }
    }

    /// First marble that is a capsule.
    pub(super) fn first_capsule(&self) -> Option<MarbleId> {
        let row = (0..self.len()).find(|row| self.own.half_length.get(*row).is_some())?;
        self.id(row)
    }

    /// Returns true if any marble is a capsule.
    #[must_use]
    pub fn has_capsules(&self) -> bool {
        !self.own.half_length.is_empty()
    }

    /// Current shape of a marble: a sphere or a capsule.
    ///
    /// # Errors
    /// [`Error::NoSuchMarble`].
    pub fn shape(&self, id: MarbleId) -> Result<Shape<S>, Error> {
        self.row(id).map(|row| self.shape_of_row(row))
    }

    pub(super) fn shape_of_row(&self, row: usize) -> Shape<S> {
        let Sphere { center, radius } = self.sphere(row);
        let half = self.axis(row) * self.half_length(row);
        if self.own.half_length.get(row).is_some() {
            Shape::Capsule(Capsule { a: center - half, b: center + half, radius })
        } else {
            Shape::Sphere(Sphere { center, radius })
        }
    }

    /// Axis of a capsule, as a unit vector of the world.
    pub(super) fn axis(&self, row: usize) -> Vec3<S> {
        self.rotation.get(row).map_or_else(Vec3::unit_y, |turn| turn * Vec3::unit_y())
    }

    /// Capsule axes and inertia of all marbles, if any is a capsule, in a world of this model.
    pub(super) fn rods(&self, model: Rotation, rods: &mut Vec<CapsuleInertia<S>>) {
        rods.clear();
        if !self.has_capsules() {
            return;
        }
        rods.extend((0..self.len()).map(|row| {
            let (axis, half) = (self.axis(row), self.half_length(row));
            let turns = self.rotation_of(row, model) == Rotation::Dynamic;
            let moments = capsule_unit_inertia(self.radius[row], half);
            let whirl = moments.map(|moment| if turns { moment.recip() } else { S::zero() });
            let locked_axes = self.locked_axes_of_row(row);
            CapsuleInertia { axis, half_length: half, inverse_unit_inertia: whirl, locked_axes }
        }));
    }

    /// Sphere around the center of a marble.
    pub(super) fn sphere(&self, row: usize) -> Sphere<S> {
        Sphere { center: self.position[row], radius: self.radius[row] }
    }

    /// Displacement between two marbles in metres: the shortest one of a periodic world.
    #[inline]
    pub(super) fn apart(&self, a: usize, b: usize) -> Vec3<S> {
        self.period.minimum_image(self.position[b] - self.position[a])
    }

    /// Wraps positions into the periodic box.
    pub(super) fn wrap(&mut self) {
        if !self.period.is_open() {
            let middle = Point3::origin();
            self.position.iter_mut().for_each(|at| *at = self.period.image(*at, middle));
        }
    }
}
