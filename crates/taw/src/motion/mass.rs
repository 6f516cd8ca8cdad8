use crate::Error;
use crate::error::positive;
use crate::math::Scalar;

/// How heavy a marble is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Mass<S> {
    /// Of this density all through, in kg/m³, above zero. Follows the size.
    Density(S),
    /// This many kilograms, above zero, whatever the size.
    Kilograms(S),
    /// So heavy that no force and no gravity changes its velocity.
    Infinite,
}

impl<S: Scalar> Default for Mass<S> {
    /// That of glass: 2,500 kg/m³.
    fn default() -> Self {
        Self::Density(S::constant(2500.0))
    }
}

impl<S: Scalar> Mass<S> {
    pub(crate) fn cast<T: Scalar>(self) -> Mass<T> {
        let number = |x: S| T::constant(x.as_f64());
        match self {
            Self::Density(density) => Mass::Density(number(density)),
            Self::Kilograms(mass) => Mass::Kilograms(number(mass)),
            Self::Infinite => Mass::Infinite,
        }
    }

    pub(crate) fn checked(self) -> Result<Self, Error> {
        match self {
            Self::Density(density) => positive("density", density).map(Self::Density),
            Self::Kilograms(mass) => positive("mass", mass).map(Self::Kilograms),
            Self::Infinite => Ok(self),
        }
    }

    /// In kilograms, for a ball of this radius in metres.
    #[must_use]
    pub fn of(self, radius: S) -> S {
        match self {
            Self::Density(density) => {
                let volume_of_unit = S::constant(4.0 / 3.0 * std::f64::consts::PI);
                volume_of_unit * radius * radius * radius * density
            }
            Self::Kilograms(mass) => mass,
            Self::Infinite => S::infinity(),
        }
    }

    /// The same for a capsule of this half length in metres.
    #[must_use]
    pub fn of_capsule(self, radius: S, half_length: S) -> S {
        let longer = S::one() + S::constant(1.5) * half_length / radius;
        match self {
            Self::Density(_) => self.of(radius) * longer,
            Self::Kilograms(_) | Self::Infinite => self.of(radius),
        }
    }
}
