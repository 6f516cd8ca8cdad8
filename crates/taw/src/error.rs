use cgmath::{Array, InnerSpace};

use crate::frame::NodeId;
use crate::math::{Point3, Quat, Scalar, Vec3, length};
use crate::swarm::BallId;
use crate::world::{MarbleId, WallId};

/// Why an input was refused. Whatever returns one has changed nothing.
///
/// Values are given as `f64`, whichever scalar the world uses.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A number is NaN or infinite.
    #[error("{field} must be finite, but is {value}")]
    NotFinite {
        /// The field, as the caller knows it.
        field: &'static str,
        /// The number that was given.
        value: f64,
    },
    /// A number is zero, negative, NaN or infinite.
    #[error("{field} must be finite and above zero, but is {value}")]
    NotPositive {
        /// The field, as the caller knows it.
        field: &'static str,
        /// The number that was given.
        value: f64,
    },
    /// A number is outside the range that its meaning allows, or NaN.
    #[error("{field} must be in [{min}, {max}], but is {value}")]
    OutOfRange {
        /// The field, as the caller knows it.
        field: &'static str,
        /// The number that was given.
        value: f64,
        /// The least that is allowed.
        min: f64,
        /// The most that is allowed.
        max: f64,
    },
    /// A direction that must have length one does not.
    #[error("{field} must have length 1, but has length {value}")]
    NotUnit {
        /// The field, as the caller knows it.
        field: &'static str,
        /// The length that was given.
        value: f64,
    },
    /// Points lie in a plane, where something solid is needed.
    #[error("{field} lie in a plane")]
    Flat {
        /// The field, as the caller knows it.
        field: &'static str,
    },
    /// A marble is a capsule, where the model knows balls only.
    #[error("{0:?} is a capsule, and the model knows balls only")]
    BallsOnly(MarbleId),
    /// The response has no method for something that the world has or is asked for.
    #[error("{response} does not support {feature}")]
    Unsupported {
        /// The response, by its name in code.
        response: &'static str,
        /// Name of what it does not support.
        feature: &'static str,
    },
    /// No ball of a swarm has this handle, or it is named twice.
    #[error("no ball has the handle {0:?}, or it is named twice")]
    NoSuchBall(BallId),
    /// No marble has this handle: it was removed, or is another world's.
    #[error("no marble has the handle {0:?}")]
    NoSuchMarble(MarbleId),
    /// No wall has this handle: it was removed, or is another world's.
    #[error("no wall has the handle {0:?}")]
    NoSuchWall(WallId),
    /// No node has this handle: it was removed, or is another tree's.
    #[error("no node has the handle {0:?}")]
    NoSuchNode(NodeId),
    /// A node would carry itself.
    #[error("the node {0:?} carries its new parent")]
    CarriesItself(NodeId),
    /// Handles count rows in 32 bits, and all of them are taken.
    #[error("the world holds {0} rows already, which is all that a handle can name")]
    Full(usize),
}

/// The number, if it is finite.
pub(crate) fn finite<S: Scalar>(field: &'static str, value: S) -> Result<S, Error> {
    if value.is_finite() {
        Ok(value)
    } else {
        Err(Error::NotFinite { field, value: value.as_f64() })
    }
}

/// The number, if it is finite and above zero.
pub(crate) fn positive<S: Scalar>(field: &'static str, value: S) -> Result<S, Error> {
    if value.is_finite() && value > S::zero() {
        Ok(value)
    } else {
        Err(Error::NotPositive { field, value: value.as_f64() })
    }
}

/// The number, if it is in `[min, max]`.
pub(crate) fn within<S: Scalar>(field: &'static str, value: S, min: S, max: S) -> Result<S, Error> {
    if value >= min && value <= max {
        Ok(value)
    } else {
        Err(Error::OutOfRange {
            field,
            value: value.as_f64(),
            min: min.as_f64(),
            max: max.as_f64(),
        })
    }
}

/// The rotation, if its length is about one; made that long if it drifted.
///
/// Within 1e-5 it is taken as it is: so much would shift what is a hundred metres away by a
/// millimetre. Up to 1e-3 is what a few thousand products in `f32` let it drift.
pub(crate) fn rotation<S: Scalar>(field: &'static str, q: Quat<S>) -> Result<Quat<S>, Error> {
    let norm = q.s.as_f64().hypot(length(q.v).as_f64());
    let off = (norm - 1.0).abs();
    if off.is_nan() || off > 1e-3 {
        return Err(Error::NotUnit { field, value: norm });
    }
    Ok(if off > 1e-5 { q.normalize() } else { q })
}

/// The vector, if all of its components are finite.
pub(crate) fn finite_vector<S: Scalar>(
    field: [&'static str; 3],
    v: Vec3<S>,
) -> Result<Vec3<S>, Error> {
    finite(field[0], v.x)?;
    finite(field[1], v.y)?;
    finite(field[2], v.z)?;
    Ok(v)
}

/// Nothing, if all coordinates of a point of two or three dimensions are finite.
pub(crate) fn coordinates<P>(field: [&'static str; 3], point: P) -> Result<(), Error>
where
    P: Array + Copy,
    P::Element: Scalar,
{
    (0..P::len()).zip(field).try_for_each(|(axis, field)| finite(field, point[axis]).map(|_| ()))
}

/// The point, if all of its coordinates are finite.
pub(crate) fn finite_point<S: Scalar>(
    field: [&'static str; 3],
    p: Point3<S>,
) -> Result<Point3<S>, Error> {
    finite_vector(field, Vec3::new(p.x, p.y, p.z)).map(|_| p)
}
