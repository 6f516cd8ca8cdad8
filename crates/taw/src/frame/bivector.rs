use std::ops::{Add, Mul, Neg, Sub};

use cgmath::Zero;

use crate::math::{Scalar, Vec3};

/// An oriented area. Torque, angular velocity and angular momentum are bivectors; in three
/// dimensions each has an axial vector that is perpendicular to it and of equal magnitude, its
/// [dual](Bivector::dual).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bivector<S> {
    /// Component in the plane of y and z, from y toward z.
    pub yz: S,
    /// Component in the plane of z and x, from z toward x.
    pub zx: S,
    /// Component in the plane of x and y, from x toward y.
    pub xy: S,
}

impl<S: Scalar> Bivector<S> {
    /// Exterior product of two vectors, from `a` toward `b`: as a torque, that of the force `b` at
    /// the lever arm `a`.
    #[must_use]
    pub fn wedge(a: Vec3<S>, b: Vec3<S>) -> Self {
        a.cross(b).into()
    }

    /// The axial vector: axis of rotation by the right hand, and magnitude.
    #[must_use]
    pub fn dual(self) -> Vec3<S> {
        Vec3::new(self.yz, self.zx, self.xy)
    }

    /// The zero bivector.
    #[must_use]
    pub fn zero() -> Self {
        Vec3::zero().into()
    }
}

impl<S: Scalar> From<Vec3<S>> for Bivector<S> {
    /// The bivector of an axial vector.
    fn from(axial: Vec3<S>) -> Self {
        Self { yz: axial.x, zx: axial.y, xy: axial.z }
    }
}

impl<S: Scalar> Add for Bivector<S> {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        (self.dual() + other.dual()).into()
    }
}

impl<S: Scalar> Sub for Bivector<S> {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        (self.dual() - other.dual()).into()
    }
}

impl<S: Scalar> Neg for Bivector<S> {
    type Output = Self;
    fn neg(self) -> Self {
        (-self.dual()).into()
    }
}

impl<S: Scalar> Mul<S> for Bivector<S> {
    type Output = Self;
    fn mul(self, factor: S) -> Self {
        (self.dual() * factor).into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_wedge_of_two_axes_is_the_plane_between_them() {
        let (x, y, z) = (Vec3::<f64>::unit_x(), Vec3::unit_y(), Vec3::unit_z());
        assert_eq!(Bivector::wedge(x, y), Bivector { yz: 0.0, zx: 0.0, xy: 1.0 });
        assert_eq!(Bivector::wedge(y, z), Bivector { yz: 1.0, zx: 0.0, xy: 0.0 });
        assert_eq!(Bivector::wedge(z, x), Bivector { yz: 0.0, zx: 1.0, xy: 0.0 });
        assert_eq!(Bivector::wedge(x, z), -Bivector::wedge(z, x));
        assert_eq!(Bivector::wedge(x, x), Bivector::zero());
        assert_eq!(Bivector::wedge(x, y).dual(), z);
        assert_eq!((Bivector::wedge(x, y) * 2.0 - Bivector::wedge(y, z)).dual(), z * 2.0 - x);
        assert_eq!((Bivector::wedge(x, y) + Bivector::wedge(y, x)), Bivector::zero());
    }
}
