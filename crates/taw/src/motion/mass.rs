use crate::Error;
use crate::error::{positive, within};
use crate::math::Scalar;

/// Mass times the square of the radius of a solid ball, over its moment of inertia.
pub(crate) const BALL_INVERSE_INERTIA: f64 = 2.5;

/// Mass of a marble.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Mass<S> {
    /// Uniform density in kg/m³, above zero. The mass follows the size.
    Density(S),
    /// Mass in kilograms, above zero, independent of the size.
    Kilograms(S),
    /// Infinite mass (a kinematic marble): no force, gravity, wall or marble changes its velocity, and it passes
    /// through walls and others of its kind; by [`SoftStep`](crate::response::Response::SoftStep), no contacts
    /// with these are listed. ([`Displacement`](crate::response::Response::Displacement) knows no masses, and
    /// [`EventDriven`](crate::response::Response::EventDriven) stops one that presses a ball against a wall.)
    Infinite,
}

impl<S: Scalar> Default for Mass<S> {
    /// Glass: 2,500 kg/m³.
    fn default() -> Self {
        Self::Density(S::from_f64(2500.0))
    }
}

impl<S: Scalar> Mass<S> {
    pub(crate) fn cast<T: Scalar>(self) -> Mass<T> {
        let number = |x: S| T::from_f64(x.as_f64());
        match self {
            Self::Density(density) => Mass::Density(number(density)),
            Self::Kilograms(mass) => Mass::Kilograms(number(mass)),
            Self::Infinite => Mass::Infinite,
        }
    }

    pub(crate) fn validated(self) -> Result<Self, Error> {
        match self {
            Self::Density(density) => positive("density", density).map(Self::Density),
            Self::Kilograms(mass) => positive("mass", mass).map(Self::Kilograms),
            Self::Infinite => Ok(self),
        }
    }

    /// Checks that the mass and the moment of inertia of a marble of this size are representable in
    /// the scalar.
    ///
    /// The error names an explicit mass, or a density if glass of this size would be representable;
    /// else the radius or the half length.
    pub(crate) fn of_size(self, radius: S, half_length: S) -> Result<(), Error> {
        let (least, most) = (S::min_positive_value(), S::max_value());
        // The squares and their reciprocals must be representable.
        within("radius", radius, least.sqrt(), most.sqrt())?;
        within("half_length", half_length, S::zero(), most.sqrt())?;
        let has_number = |mass: Self, half: S| {
            let kilograms = mass.of_capsule(radius, half);
            kilograms >= least && kilograms.is_finite()
        };
        if self == Self::Infinite || has_number(self, half_length) {
            return Ok(());
        }
        let cubed = |kilograms: S, density: S| {
            (kilograms.as_f64() / (4.0 / 3.0 * std::f64::consts::PI * density.as_f64())).cbrt()
        };
        let volume = Self::Density(S::one()).of_capsule(radius, half_length).as_f64();
        let (field, value, min, max) = match self {
            Self::Density(density) if has_number(Self::default(), half_length) => {
                ("density", density, least.as_f64() / volume, most.as_f64() / volume)
            }
            Self::Density(density) if !has_number(self, S::zero()) => {
                ("radius", radius, cubed(least, density), cubed(most, density))
            }
            Self::Density(_) => {
                let longer = most.as_f64() / self.of(radius).as_f64() - 1.0;
                ("half_length", half_length, 0.0, longer * radius.as_f64() / 1.5)
            }
            Self::Kilograms(mass) => ("mass", mass, least.as_f64(), most.as_f64()),
            Self::Infinite => return Ok(()),
        };
        Err(Error::OutOfRange { field, value: value.as_f64(), min, max })
    }

    /// Mass in kilograms of a ball of this radius in metres.
    #[must_use]
    pub fn of(self, radius: S) -> S {
        match self {
            Self::Density(density) => {
                let volume_of_unit = S::from_f64(4.0 / 3.0 * std::f64::consts::PI);
                volume_of_unit * radius * radius * radius * density
            }
            Self::Kilograms(mass) => mass,
            Self::Infinite => S::infinity(),
        }
    }

    /// Mass in kilograms of a capsule of this radius and half length in metres.
    #[must_use]
    pub fn of_capsule(self, radius: S, half_length: S) -> S {
        let longer = S::one() + S::from_f64(1.5) * half_length / radius;
        match self {
            Self::Density(_) => self.of(radius) * longer,
            Self::Kilograms(_) | Self::Infinite => self.of(radius),
        }
    }
}
