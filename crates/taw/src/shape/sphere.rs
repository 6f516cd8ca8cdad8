use crate::Error;
use crate::error::{finite_point, positive};
use crate::math::{Point3, Scalar};

/// All points within `radius` of `center`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere<S> {
    /// The middle, in metres.
    pub center: Point3<S>,
    /// In metres, finite and above zero.
    pub radius: S,
}

impl<S: Scalar> Sphere<S> {
    /// A sphere, checked.
    ///
    /// # Errors
    /// [`Error::NotFinite`] for the center, [`Error::NotPositive`] for the radius.
    pub fn new(center: Point3<S>, radius: S) -> Result<Self, Error> {
        Ok(Self {
            center: finite_point(["center.x", "center.y", "center.z"], center)?,
            radius: positive("radius", radius)?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bad_input_is_refused_by_name() {
        let origin = Point3::new(0.0, 0.0, 0.0);
        for radius in [0.0, -1.0, f64::INFINITY] {
            let error = Sphere::new(origin, radius).unwrap_err();
            assert_eq!(error, Error::NotPositive { field: "radius", value: radius });
        }
        let error = Sphere::new(Point3::new(0.0, f64::NEG_INFINITY, 0.0), 1.0).unwrap_err();
        assert_eq!(error.to_string(), "center.y must be finite, but is -inf");
    }
}
