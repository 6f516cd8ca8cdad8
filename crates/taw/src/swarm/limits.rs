//! Limits of the numbers of a ball.

use crate::Error;
use crate::error::{finite_point, finite_vector, within};
use crate::math::{Point3, Scalar, Vec3};

/// Minimum and maximum radius, in metres: their third and fourth powers are finite, too.
pub(super) const RADII: [f64; 2] = [LEAST_RADIUS, 1e9];
/// Minimum radius, in metres.
pub(crate) const LEAST_RADIUS: f64 = 1e-9;
/// Maximum coordinate in metres, and maximum component of a velocity in m/s.
pub(crate) const MAX_COORDINATE: f64 = 1e12;

pub(super) fn validated_position<S: Scalar>(place: Point3<S>) -> Result<Point3<S>, Error> {
    let names = ["position.x", "position.y", "position.z"];
    finite_point(names, place)?;
    for (name, x) in names.into_iter().zip([place.x, place.y, place.z]) {
        within(name, x, -S::from_f64(MAX_COORDINATE), S::from_f64(MAX_COORDINATE))?;
    }
    Ok(place)
}

pub(super) fn validated_velocity<S: Scalar>(velocity: Vec3<S>) -> Result<Vec3<S>, Error> {
    let names = ["velocity.x", "velocity.y", "velocity.z"];
    finite_vector(names, velocity)?;
    for (name, x) in names.into_iter().zip([velocity.x, velocity.y, velocity.z]) {
        within(name, x, -S::from_f64(MAX_COORDINATE), S::from_f64(MAX_COORDINATE))?;
    }
    Ok(velocity)
}
