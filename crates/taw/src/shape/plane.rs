use cgmath::{EuclideanSpace, InnerSpace};

use crate::Error;
use crate::error::{finite, finite_point, finite_vector};
use crate::math::{Point3, Scalar, Vec3, length, normalize_and_length};

/// A half-space: everything behind the surface `normal · x = offset` is solid.
///
/// The normal points to the free side. A plane has no thickness: a point behind it is inside,
/// however deep.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane<S> {
    normal: Vec3<S>,
    offset: S,
}

impl<S: Scalar> Plane<S> {
    /// Tolerance of the length of a normal. Rotating a unit vector costs a few epsilons (6e-7 in
    /// `f32`); at a hundred metres from the origin this much would shift the surface by a
    /// millimetre.
    const UNIT_TOLERANCE: f64 = 1e-5;

    /// Creates the half-space behind the surface at `offset` metres from the origin along the unit
    /// vector `normal`.
    ///
    /// # Errors
    /// [`Error::NotFinite`], or [`Error::NotUnit`] if the normal's length is more
    /// than 1e-5 from one. [`Plane::through`] takes directions of any length.
    pub fn new(normal: Vec3<S>, offset: S) -> Result<Self, Error> {
        finite_vector(["normal.x", "normal.y", "normal.z"], normal)?;
        finite("offset", offset)?;
        let norm = length(normal).as_f64();
        if (norm - 1.0).abs() > Self::UNIT_TOLERANCE {
            return Err(Error::NotUnit { field: "normal", value: norm });
        }
        Ok(Self { normal, offset })
    }

    /// Creates the half-space whose surface goes through `point` and whose free side is where
    /// `direction` points. The direction may have any length but zero.
    ///
    /// # Errors
    /// [`Error::NotFinite`], or [`Error::NotUnit`] if the direction is zero.
    pub fn through(point: Point3<S>, direction: Vec3<S>) -> Result<Self, Error> {
        finite_point(["point.x", "point.y", "point.z"], point)?;
        finite_vector(["direction.x", "direction.y", "direction.z"], direction)?;
        let Some((normal, _)) = normalize_and_length(direction) else {
            return Err(Error::NotUnit { field: "direction", value: 0.0 });
        };
        Self::new(normal, normal.dot(point.to_vec()))
    }

    /// The unit vector that points to the free side.
    #[must_use]
    pub fn normal(&self) -> Vec3<S> {
        self.normal
    }

    /// The distance of the surface from the origin along the normal, in metres.
    #[must_use]
    pub fn offset(&self) -> S {
        self.offset
    }

    /// Signed distance of `point` from the surface, in metres; negative behind it.
    #[must_use]
    #[inline]
    pub fn signed_distance(&self, point: Point3<S>) -> S {
        self.normal.dot(point.to_vec()) - self.offset
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bad_input_is_refused_by_name() {
        let error = Plane::new(Vec3::new(0.0_f32, 2.0, 0.0), 0.0).unwrap_err();
        assert_eq!(error, Error::NotUnit { field: "normal", value: 2.0 });
        let error = Plane::new(Vec3::unit_y(), f32::NAN).unwrap_err();
        assert_eq!(error.to_string(), "offset must be finite, but is NaN");
        let origin = Point3::new(0.0, 0.0, 0.0);
        let error = Plane::through(origin, Vec3::new(0.0, 0.0, 0.0)).unwrap_err();
        assert_eq!(error, Error::NotUnit { field: "direction", value: 0.0 });
    }

    #[test]
    fn through_takes_any_length_of_direction() {
        let point = Point3::new(3.0, 4.0, 5.0);
        for length in [1e-40_f32, 1e-20, 1.0, 1e30] {
            let plane = Plane::through(point, Vec3::unit_z() * length).unwrap();
            assert_eq!(plane.normal(), Vec3::unit_z(), "{length}");
            assert_eq!(plane.signed_distance(Point3::new(0.0, 0.0, 7.0)), 2.0);
        }
    }
}
