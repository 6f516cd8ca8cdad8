use std::ops::Mul;

use crate::frame::Bivector;
use crate::math::{Quat, Scalar};

/// A rotation as geometric algebra has it: `scalar + bivector`, where a vector v goes to
/// R v R̃. A rotation by an angle in a plane B is `cos(angle / 2) − B sin(angle / 2)`
/// (Hestenes, *New foundations for classical mechanics*, 1986, §5).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rotor<S> {
    /// Cosine of half of the angle.
    pub scalar: S,
    /// Plane of rotation, reversed, times the sine of half of the angle.
    pub bivector: Bivector<S>,
}

impl<S: Scalar> Rotor<S> {
    /// Inverse rotation: the reverse, in the algebra.
    #[must_use]
    pub fn reverse(self) -> Self {
        Self { bivector: -self.bivector, ..self }
    }
}

impl<S: Scalar> Mul for Rotor<S> {
    type Output = Self;

    /// Composition: the geometric product, which applies `first` first.
    fn mul(self, first: Self) -> Self {
        let (a, b) = (self.bivector.dual(), first.bivector.dual());
        // The product of two bivectors is minus that of their duals.
        Self {
            scalar: self.scalar * first.scalar - cgmath::dot(a, b),
            bivector: (a * first.scalar + b * self.scalar - a.cross(b)).into(),
        }
    }
}

impl<S: Scalar> From<Rotor<S>> for Quat<S> {
    fn from(rotor: Rotor<S>) -> Self {
        Self::from_sv(rotor.scalar, -rotor.bivector.dual())
    }
}

impl<S: Scalar> From<Quat<S>> for Rotor<S> {
    fn from(rotation: Quat<S>) -> Self {
        Self { scalar: rotation.s, bivector: (-rotation.v).into() }
    }
}
