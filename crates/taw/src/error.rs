use std::fmt;

use cgmath::{Array, InnerSpace};

use crate::frame::NodeId;
use crate::handle::{BallId, BodyId, JointId, MarbleId, SensorId, WallId};
use crate::math::{Point3, Quat, Scalar, Vec3, length};

/// Reason why an input was rejected. A function that returns one has changed nothing.
///
/// Values are given as `f64`, whichever scalar the world uses.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A number is NaN or infinite.
    #[error("{field} must be finite, but is {value}")]
    NotFinite {
        /// Name of the field.
        field: &'static str,
        /// The given number.
        value: f64,
    },
    /// A number is zero, negative, NaN or infinite.
    #[error("{field} must be finite and above zero, but is {value}")]
    NotPositive {
        /// Name of the field.
        field: &'static str,
        /// The given number.
        value: f64,
    },
    /// A number is outside the range that its meaning allows, or NaN.
    #[error("{field} must be {}, but is {value}", Allowed([*min, *max]))]
    OutOfRange {
        /// Name of the field.
        field: &'static str,
        /// The given number.
        value: f64,
        /// Smallest allowed value.
        min: f64,
        /// Largest allowed value.
        max: f64,
    },
    /// A direction or quaternion is not of unit length.
    #[error("{field} must have length 1, but has length {value}")]
    NotUnit {
        /// Name of the field.
        field: &'static str,
        /// The given length.
        value: f64,
    },
    /// Points are coplanar where a solid is needed.
    #[error("{field} lie in a plane")]
    Coplanar {
        /// Name of the field.
        field: &'static str,
    },
    /// A marble is a capsule where only balls are supported.
    #[error("{0:?} is a capsule, and the model knows balls only")]
    UnsupportedShape(MarbleId),
    /// The response has no method for a feature of the world.
    #[error("{response} does not support {feature}")]
    Unsupported {
        /// Name of the response in code.
        response: &'static str,
        /// Name of the feature.
        feature: &'static str,
    },
    /// No ball of a swarm has this handle, or it is listed twice.
    #[error("no ball has the handle {0:?}, or it is named twice")]
    NoSuchBall(BallId),
    /// No marble has this handle: it was removed, or belongs to another world.
    #[error("no marble has the handle {0:?}")]
    NoSuchMarble(MarbleId),
    /// No wall has this handle: it was removed, or belongs to another world.
    #[error("no wall has the handle {0:?}")]
    NoSuchWall(WallId),
    /// No sensor has this handle: it was removed, or belongs to another world.
    #[error("no sensor has the handle {0:?}")]
    NoSuchSensor(SensorId),
    /// No joint has this handle: it was removed, broke, or belongs to another world.
    #[error("no joint has the handle {0:?}")]
    NoSuchJoint(JointId),
    /// No body has this handle: it was removed, or belongs to another world.
    #[error("no body has the handle {0:?}")]
    NoSuchBody(BodyId),
    /// A joint holds nothing that moves.
    #[error("both ends of a joint are places in the world")]
    NothingJoined,
    /// Both ends of a joint are one marble or one body.
    #[error("both ends of a joint are the same marble or body")]
    JoinedToItself,
    /// No node has this handle: it was removed, or belongs to another tree.
    #[error("no node has the handle {0:?}")]
    NoSuchNode(NodeId),
    /// A node would become its own ancestor.
    #[error("the node {0:?} carries its new parent")]
    Cycle(NodeId),
    /// More pairs of marbles, or balls of a swarm, overlap than a step takes.
    #[error("at least {pairs} pairs of marbles or balls overlap, and a step takes at most {max}")]
    TooManyPairs {
        /// Number of pairs that overlap for certain.
        pairs: u64,
        /// Largest allowed number.
        max: u64,
    },
    /// Indices of 32 bits are exhausted.
    #[error("the world holds {0} rows already, which is all that a handle can name")]
    Full(usize),
}

/// Range of numbers, as messages name it.
struct Allowed([f64; 2]);

impl fmt::Display for Allowed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self([min, max]) = *self;
        let [low, high] = [min, max].map(|bound| {
            let single = bound as f32; // has fewer digits
            let is_single = f64::from(single) == bound;
            match (bound == 0.0 || (1e-4..1e10).contains(&bound.abs()), is_single) {
                (true, true) => single.to_string(),
                (true, false) => bound.to_string(),
                (false, true) => format!("{single:e}"),
                (false, false) => format!("{bound:e}"),
            }
        });
        let most = f64::from(f32::MAX);
        match (min == max, min <= -most, max >= most) {
            (true, ..) => write!(f, "{low}"),
            (_, true, true) => write!(f, "finite"),
            (_, false, true) => write!(f, "finite and at least {low}"),
            (_, true, false) => write!(f, "finite and at most {high}"),
            (..) => write!(f, "in [{low}, {high}]"),
        }
    }
}

/// Validates a finite number.
pub(crate) fn finite<S: Scalar>(field: &'static str, value: S) -> Result<S, Error> {
    if value.is_finite() {
        Ok(value)
    } else {
        Err(Error::NotFinite { field, value: value.as_f64() })
    }
}

/// Validates a finite number above zero.
pub(crate) fn positive<S: Scalar>(field: &'static str, value: S) -> Result<S, Error> {
    if value.is_finite() && value > S::zero() {
        Ok(value)
    } else {
        Err(Error::NotPositive { field, value: value.as_f64() })
    }
}

/// Validates a number in `[min, max]`.
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

/// Validates a rotation of about unit length and normalizes it if it drifted.
///
/// Deviations within 1e-5 are kept: that would shift a point a hundred metres away by a millimetre.
/// Up to 1e-3 is the drift of a few thousand products in `f32`.
pub(crate) fn rotation<S: Scalar>(field: &'static str, q: Quat<S>) -> Result<Quat<S>, Error> {
    let norm = q.s.as_f64().hypot(length(q.v).as_f64());
    let off = (norm - 1.0).abs();
    if off.is_nan() || off > 1e-3 {
        return Err(Error::NotUnit { field, value: norm });
    }
    Ok(if off > 1e-5 { q.normalize() } else { q })
}

/// Validates a finite vector.
pub(crate) fn finite_vector<S: Scalar>(
    field: [&'static str; 3],
    v: Vec3<S>,
) -> Result<Vec3<S>, Error> {
    finite(field[0], v.x)?;
    finite(field[1], v.y)?;
    finite(field[2], v.z)?;
    Ok(v)
}

/// Checks that all coordinates of a point of two or three dimensions are finite.
pub(crate) fn coordinates<P>(field: [&'static str; 3], point: P) -> Result<(), Error>
where
    P: Array + Copy,
    P::Element: Scalar,
{
    (0..P::len()).zip(field).try_for_each(|(axis, field)| finite(field, point[axis]).map(|_| ()))
}

/// Validates a finite point.
pub(crate) fn finite_point<S: Scalar>(
    field: [&'static str; 3],
    p: Point3<S>,
) -> Result<Point3<S>, Error> {
    finite_vector(field, Vec3::new(p.x, p.y, p.z)).map(|_| p)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_are_named_as_people_read_them() {
        let max = f64::from(f32::MAX);
        let tiny = f64::from(1e-9_f32);
        for (range, name) in [
            ([1.0, 1000.0], "in [1, 1000]"),
            ([tiny, 1e9], "in [1e-9, 1000000000]"),
            ([1e-9, 1e12], "in [1e-9, 1e12]"),
            ([0.1, 0.25], "in [0.1, 0.25]"),
            ([f64::from(0.3_f32), max], "finite and at least 0.3"),
            ([f64::MIN, f64::MAX], "finite"),
            ([-max, 2.0], "finite and at most 2"),
            ([4.0, 4_294_967_294.0], "in [4, 4294967294]"),
            ([0.0, max], "finite and at least 0"),
            ([1.0, f64::MAX], "finite and at least 1"),
            ([4.0, 4.0], "4"),
        ] {
            assert_eq!(Allowed(range).to_string(), name);
        }
    }
}
