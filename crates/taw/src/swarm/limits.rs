//! Limits of the numbers of a ball.

use cgmath::EuclideanSpace;

use crate::Error;
use crate::error::{finite_vector, within};
use crate::math::{Point3, Scalar, Vec3};

/// Minimum and maximum radius, in metres: their third and fourth powers are finite, too.
pub(super) const RADII: [f64; 2] = [LEAST_RADIUS, 1e9];
/// Minimum radius, in metres.
pub(crate) const LEAST_RADIUS: f64 = 1e-9;
/// Maximum coordinate in metres, and maximum component of a velocity in m/s.
pub(crate) const MAX_COORDINATE: f64 = 1e12;

/// Checks a position, in metres.
pub(super) fn validated_position<S: Scalar>(place: Point3<S>) -> Result<Point3<S>, Error> {
    check(["position.x", "position.y", "position.z"], place.to_vec())?;
    Ok(place)
}

/// Checks a velocity, in m/s.
pub(super) fn validated_velocity<S: Scalar>(velocity: Vec3<S>) -> Result<Vec3<S>, Error> {
    check(["velocity.x", "velocity.y", "velocity.z"], velocity)?;
    Ok(velocity)
}

/// Checks that three numbers are finite and within [`MAX_COORDINATE`].
fn check<S: Scalar>(names: [&'static str; 3], numbers: Vec3<S>) -> Result<(), Error> {
    finite_vector(names, numbers)?;
    let most = S::from_f64(MAX_COORDINATE);
    for (name, x) in names.into_iter().zip([numbers.x, numbers.y, numbers.z]) {
        within(name, x, -most, most)?;
    }
    Ok(())
}
