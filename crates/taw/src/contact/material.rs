use crate::Error;
use crate::error::{positive, within};
use crate::math::Scalar;

/// Surface material of a body. Two make the [`ContactMaterial`] of their contact; a wall may have none of
/// its own.
///
/// [`Response::Displacement`] has neither restitution nor friction and ignores it.
///
/// [`Response::Displacement`]: crate::response::Response::Displacement
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material<S> {
    /// Coefficient of restitution: separation speed over approach speed, in `[0, 1]`.
    pub restitution: S,
    /// Coefficient of friction (Coulomb): largest friction force over the normal force, at least
    /// zero.
    pub friction: S,
    /// Tangential restitution: fraction of the sliding speed that a bounce reverses, in `[-1, 1]`,
    /// as far as friction can: 0 stops sliding, 1 is a superball (Garwin 1969), −1 slides freely.
    pub tangential_restitution: S,
    /// Rolling friction: resisting torque over normal force times radius, at least zero. A marble
    /// rests on slopes up to this tangent, and on a floor it loses `5/7 · rolling_resistance · g`
    /// of its speed per second.
    pub rolling_resistance: S,
    /// Torsional (spinning) friction: torque that resists spin about the normal, over normal force
    /// times radius, at least zero. It takes `5/2 · spinning_resistance · g / radius` per second.
    pub spinning_resistance: S,
    /// Stiffness; only [`ContactLaw::HertzMindlin`](crate::response::ContactLaw) uses it.
    pub elasticity: Elasticity<S>,
    /// Rule that combines it with another material.
    pub combine: Combine,
}

/// Elastic constants of a solid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Elasticity<S> {
    /// Young's modulus, in pascals, above zero.
    pub youngs_modulus: S,
    /// Poisson's ratio, in `[0, 0.5]`.
    pub poissons_ratio: S,
}

impl<S: Scalar> Default for Elasticity<S> {
    /// Firm rubber, 10 megapascals and 0.25: the stiffest that marbles of glass's density and a few
    /// centimetres bear at steps of a millisecond. Glass itself has 70,000 megapascals.
    fn default() -> Self {
        Self { youngs_modulus: S::from_f64(1e7), poissons_ratio: S::from_f64(0.25) }
    }
}

/// Compliance of two surfaces in contact, in 1/Pa (Hertz 1882; Mindlin 1949).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Compliance<S> {
    /// Sum of `(1 − ν²) / E`.
    pub normal: S,
    /// Sum of `(2 − ν) / G`.
    pub tangent: S,
}

impl<S: Scalar> Elasticity<S> {
    pub(crate) fn compliance(self) -> Compliance<S> {
        let (modulus, ratio) = (self.youngs_modulus, self.poissons_ratio);
        let two = S::one() + S::one();
        Compliance {
            normal: (S::one() - ratio * ratio) / modulus,
            tangent: (two - ratio) * two * (S::one() + ratio) / modulus,
        }
    }
}

impl<S: Scalar> Compliance<S> {
    fn plus(self, other: Self) -> Self {
        Self { normal: self.normal + other.normal, tangent: self.tangent + other.tangent }
    }
}

/// Surface material of a contact: that of its two bodies, combined.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactMaterial<S> {
    /// Coefficient of restitution, in `[0, 1]`.
    pub restitution: S,
    /// Coefficient of friction, at least zero.
    pub friction: S,
    /// Tangential restitution, in `[-1, 1]`.
    pub tangential_restitution: S,
    /// Rolling friction, at least zero.
    pub rolling_resistance: S,
    /// Torsional friction, at least zero.
    pub spinning_resistance: S,
    /// Sum of the compliances of both, above zero; only
    /// [`ContactLaw::HertzMindlin`](crate::response::ContactLaw) uses it.
    pub compliance: Compliance<S>,
}

impl<S: Scalar> ContactMaterial<S> {
    /// Converts to another scalar.
    pub(crate) fn cast<T: Scalar>(self) -> ContactMaterial<T> {
        let number = |x: S| T::from_f64(x.as_f64());
        ContactMaterial {
            restitution: number(self.restitution),
            friction: number(self.friction),
            tangential_restitution: number(self.tangential_restitution),
            rolling_resistance: number(self.rolling_resistance),
            spinning_resistance: number(self.spinning_resistance),
            compliance: Compliance {
                normal: number(self.compliance.normal),
                tangent: number(self.compliance.tangent),
            },
        }
    }
}

impl<S: Scalar> Default for ContactMaterial<S> {
    /// Contact of two bodies of the default [`Material`].
    fn default() -> Self {
        Material::default().combined_with(Material::default())
    }
}

impl<S: Scalar> ContactMaterial<S> {
    /// Material with each number moved into its range; NaN goes to the lower end.
    pub(crate) fn clamped(self) -> Self {
        let (zero, one, max) = (S::zero(), S::one(), S::max_value());
        let within = |number: S, low: S, high: S| number.max(low).min(high);
        let not_negative = |number: S| within(number, zero, max);
        let compliance = |number: S| within(number, S::min_positive_value(), max);
        Self {
            restitution: within(self.restitution, zero, one),
            friction: not_negative(self.friction),
            tangential_restitution: within(self.tangential_restitution, -one, one),
            rolling_resistance: not_negative(self.rolling_resistance),
            spinning_resistance: not_negative(self.spinning_resistance),
            compliance: Compliance {
                normal: compliance(self.compliance.normal),
                tangent: compliance(self.compliance.tangent),
            },
        }
    }
}

/// Combination rule of two materials, coefficient by coefficient.
///
/// Of two different rules the one further down in this list wins.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Combine {
    /// Arithmetic mean.
    #[default]
    Average,
    /// Smaller coefficient.
    Min,
    /// Product. Of two negative tangential restitutions, minus the product.
    Multiply,
    /// Larger coefficient.
    Max,
}

impl Combine {
    fn of<S: Scalar>(self, a: S, b: S) -> S {
        match self {
            Self::Average => a + (b - a) * S::from_f64(0.5),
            Self::Min => a.min(b),
            Self::Multiply if a < S::zero() && b < S::zero() => -(a * b),
            Self::Multiply => a * b,
            Self::Max => a.max(b),
        }
    }
}

impl<S: Scalar> Default for Material<S> {
    /// Medium restitution and friction: 0.5 and 0.3. No rolling friction.
    fn default() -> Self {
        Self {
            restitution: S::from_f64(0.5),
            friction: S::from_f64(0.3),
            tangential_restitution: S::zero(),
            rolling_resistance: S::zero(),
            spinning_resistance: S::zero(),
            elasticity: Elasticity::default(),
            combine: Combine::Average,
        }
    }
}

impl<S: Scalar> Material<S> {
    /// Returns the material if its numbers are in range.
    ///
    /// # Errors
    /// [`Error::OutOfRange`], or [`Error::NotPositive`] for Young's modulus.
    pub fn validated(self) -> Result<Self, Error> {
        within("restitution", self.restitution, S::zero(), S::one())?;
        within("friction", self.friction, S::zero(), S::max_value())?;
        within("tangential_restitution", self.tangential_restitution, -S::one(), S::one())?;
        within("rolling_resistance", self.rolling_resistance, S::zero(), S::max_value())?;
        within("spinning_resistance", self.spinning_resistance, S::zero(), S::max_value())?;
        positive("youngs_modulus", self.elasticity.youngs_modulus)?;
        within("poissons_ratio", self.elasticity.poissons_ratio, S::zero(), S::from_f64(0.5))?;
        Ok(self)
    }

    /// Material of the contact of two bodies.
    #[inline]
    #[must_use]
    pub fn combined_with(self, other: Self) -> ContactMaterial<S> {
        let combine = self.combine.max(other.combine);
        let of = |number: fn(&Self) -> S| combine.of(number(&self), number(&other));
        ContactMaterial {
            restitution: of(|m| m.restitution),
            friction: of(|m| m.friction),
            tangential_restitution: of(|m| m.tangential_restitution),
            rolling_resistance: of(|m| m.rolling_resistance),
            spinning_resistance: of(|m| m.spinning_resistance),
            // Whatever the rule: both give way under the same force.
            compliance: self.elasticity.compliance().plus(other.elasticity.compliance()),
        }
    }

    /// Material of the contact of a marble with a wall. A wall without a material of its own is rigid, and
    /// has the coefficients of the marble.
    #[inline]
    #[must_use]
    pub fn on_wall(self, wall: Option<Self>) -> ContactMaterial<S> {
        let alone = || ContactMaterial {
            restitution: self.restitution,
            friction: self.friction,
            tangential_restitution: self.tangential_restitution,
            rolling_resistance: self.rolling_resistance,
            spinning_resistance: self.spinning_resistance,
            compliance: self.elasticity.compliance(),
        };
        wall.map_or_else(alone, |wall| self.combined_with(wall))
    }

    /// Converts to another scalar.
    pub(crate) fn cast<T: Scalar>(self) -> Material<T> {
        let number = |x: S| T::from_f64(x.as_f64());
        Material {
            restitution: number(self.restitution),
            friction: number(self.friction),
            tangential_restitution: number(self.tangential_restitution),
            rolling_resistance: number(self.rolling_resistance),
            spinning_resistance: number(self.spinning_resistance),
            elasticity: Elasticity {
                youngs_modulus: number(self.elasticity.youngs_modulus),
                poissons_ratio: number(self.elasticity.poissons_ratio),
            },
            combine: self.combine,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rule_further_down_counts() {
        let material = |friction, combine| Material { friction, combine, ..Material::default() };
        let rules = [Combine::Average, Combine::Min, Combine::Multiply, Combine::Max];
        let expected = [1.0, 0.5, 0.75, 1.5];
        for (i, a) in rules.into_iter().enumerate() {
            for (j, b) in rules.into_iter().enumerate() {
                let pair = material(0.5, a).combined_with(material(1.5, b));
                assert_eq!(pair.friction, expected[i.max(j)], "{a:?} against {b:?}");
                assert_eq!(pair, material(1.5, b).combined_with(material(0.5, a)));
            }
        }
    }

    #[test]
    fn a_contact_of_two_materials_is_in_range() {
        let ends = [-1.0, -0.5, 0.0, 0.5, 1.0_f64];
        for combine in [Combine::Average, Combine::Min, Combine::Multiply, Combine::Max] {
            for (a, b) in ends.into_iter().flat_map(|a| ends.map(|b| (a, b))) {
                let of = |beta: f64| Material {
                    restitution: beta.abs(),
                    tangential_restitution: beta,
                    combine,
                    ..Material::default()
                };
                let pair = of(a).combined_with(of(b));
                assert_eq!(pair, pair.clamped(), "{combine:?} of {a} and {b}");
            }
        }
    }
}
