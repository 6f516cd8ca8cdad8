use crate::Error;
use crate::error::within;
use crate::math::Scalar;

/// What a marble's surface is made of, as far as a contact can tell. Against a wall its
/// own counts, between two marbles what [`Material::against`] says.
///
/// [`Response::Displacement`] knows neither bounce nor friction and does not read it.
///
/// [`Response::Displacement`]: super::Response::Displacement
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material<S> {
    /// The part of the approach speed that a bounce gives back, in `[0, 1]`.
    pub restitution: S,
    /// The largest friction force over the normal force (Coulomb), at least zero.
    pub friction: S,
    /// The part of the sliding speed of the touching points that a bounce turns
    /// round, in `[-1, 1]`, as far as friction can: 0 stops them, 1 is a superball
    /// (Garwin 1969), −1 slides freely.
    pub tangential_restitution: S,
}

impl<S: Scalar> Default for Material<S> {
    /// Somewhat bouncy, somewhat rough: 0.5 and 0.3.
    fn default() -> Self {
        Self {
            restitution: S::constant(0.5),
            friction: S::constant(0.3),
            tangential_restitution: S::zero(),
        }
    }
}

impl<S: Scalar> Material<S> {
    pub(crate) fn checked(self) -> Result<Self, Error> {
        within("restitution", self.restitution, S::zero(), S::one())?;
        within("friction", self.friction, S::zero(), S::max_value())?;
        within("tangential_restitution", self.tangential_restitution, -S::one(), S::one())?;
        Ok(self)
    }

    /// What counts between two surfaces: the mean of each number.
    #[must_use]
    pub fn against(self, other: Self) -> Self {
        let mean = |a: S, b: S| a + (b - a) * S::constant(0.5);
        Self {
            restitution: mean(self.restitution, other.restitution),
            friction: mean(self.friction, other.friction),
            tangential_restitution: mean(self.tangential_restitution, other.tangential_restitution),
        }
    }
}
