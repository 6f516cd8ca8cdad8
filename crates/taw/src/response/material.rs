use crate::Error;
use crate::error::{positive, within};
use crate::math::Scalar;

/// What a surface is made of, as far as a contact can tell. Where a wall has none of its
/// own, the marble's counts; else what [`Material::combined_with`] says.
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
    /// The torque that resists rolling, over normal force times radius, at least zero. A
    /// marble rests on slopes up to this tangent, and rolling on a floor it loses
    /// `5/7 · rolling_resistance · g` of its speed a second.
    pub rolling_resistance: S,
    /// The torque that resists spinning on the spot, over normal force times radius, at
    /// least zero. It takes `5/2 · spinning_resistance · g / radius` a second.
    pub spinning_resistance: S,
    /// How stiff it is; counts for [`ContactLaw::HertzMindlin`](super::ContactLaw) only.
    pub elasticity: Elasticity<S>,
    /// What counts against another material.
    pub combine: Combine,
}

/// How a solid gives way elastically.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Elasticity<S> {
    /// In pascals, above zero.
    pub youngs_modulus: S,
    /// In `[0, 0.5]`.
    pub poissons_ratio: S,
}

impl<S: Scalar> Default for Elasticity<S> {
    /// A firm rubber, which marbles of glass's density and some centimetres bear at a
    /// millisecond's step: 10 megapascals and 0.25. Glass itself has 70,000.
    fn default() -> Self {
        Self { youngs_modulus: S::constant(1e7), poissons_ratio: S::constant(0.25) }
    }
}

/// How much two surfaces that are pressed together give way, in 1/Pa.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Compliance<S> {
    /// `(1 − ν²) / E`, added up.
    pub normal: S,
    /// `(2 − ν) / G`, added up.
    pub tangent: S,
}

impl<S: Scalar> Elasticity<S> {
    pub(super) fn compliance(self) -> Compliance<S> {
        let (modulus, ratio) = (self.youngs_modulus, self.poissons_ratio);
        let two = S::one() + S::one();
        Compliance {
            normal: (S::one() - ratio * ratio) / modulus,
            tangent: (two - ratio) * two * (S::one() + ratio) / modulus,
        }
    }
}

impl<S: Scalar> Compliance<S> {
    pub(super) fn plus(self, other: Self) -> Self {
        Self { normal: self.normal + other.normal, tangent: self.tangent + other.tangent }
    }
}

/// How two materials become that of a contact, number by number.
///
/// Of two surfaces with different rules the one further down in this list is taken.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Combine {
    /// Half of the sum.
    #[default]
    Average,
    /// The smaller number.
    Min,
    /// One times the other. Of two negative tangential restitutions, minus that.
    Multiply,
    /// The larger number.
    Max,
}

impl Combine {
    fn of<S: Scalar>(self, a: S, b: S) -> S {
        match self {
            Self::Average => a + (b - a) * S::constant(0.5),
            Self::Min => a.min(b),
            Self::Multiply if a < S::zero() && b < S::zero() => -(a * b),
            Self::Multiply => a * b,
            Self::Max => a.max(b),
        }
    }
}

impl<S: Scalar> Default for Material<S> {
    /// Somewhat bouncy, somewhat rough: 0.5 and 0.3. Nothing resists rolling.
    fn default() -> Self {
        Self {
            restitution: S::constant(0.5),
            friction: S::constant(0.3),
            tangential_restitution: S::zero(),
            rolling_resistance: S::zero(),
            spinning_resistance: S::zero(),
            elasticity: Elasticity::default(),
            combine: Combine::Average,
        }
    }
}

impl<S: Scalar> Material<S> {
    /// This material, if its numbers can be right.
    ///
    /// # Errors
    /// [`Error::OutOfRange`], or [`Error::NotPositive`] for Young's modulus.
    pub fn checked(self) -> Result<Self, Error> {
        within("restitution", self.restitution, S::zero(), S::one())?;
        within("friction", self.friction, S::zero(), S::max_value())?;
        within("tangential_restitution", self.tangential_restitution, -S::one(), S::one())?;
        within("rolling_resistance", self.rolling_resistance, S::zero(), S::max_value())?;
        within("spinning_resistance", self.spinning_resistance, S::zero(), S::max_value())?;
        positive("youngs_modulus", self.elasticity.youngs_modulus)?;
        within("poissons_ratio", self.elasticity.poissons_ratio, S::zero(), S::constant(0.5))?;
        Ok(self)
    }

    /// What counts between two surfaces.
    #[must_use]
    pub fn combined_with(self, other: Self) -> Self {
        let combine = self.combine.max(other.combine);
        let of = |number: fn(&Self) -> S| combine.of(number(&self), number(&other));
        Self {
            restitution: of(|m| m.restitution),
            friction: of(|m| m.friction),
            tangential_restitution: of(|m| m.tangential_restitution),
            rolling_resistance: of(|m| m.rolling_resistance),
            spinning_resistance: of(|m| m.spinning_resistance),
            // Two surfaces give way together whatever the rule; see `Compliance`.
            elasticity: self.elasticity,
            combine,
        }
    }

    /// The same numbers in another scalar.
    pub(crate) fn cast<T: Scalar>(self) -> Material<T> {
        let number = |x: S| T::constant(x.as_f64());
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
    fn what_two_materials_give_is_a_material() {
        let ends = [-1.0, -0.5, 0.0, 0.5, 1.0_f64];
        for combine in [Combine::Average, Combine::Min, Combine::Multiply, Combine::Max] {
            for (a, b) in ends.into_iter().flat_map(|a| ends.map(|b| (a, b))) {
                let of = |beta: f64| Material {
                    restitution: beta.abs(),
                    tangential_restitution: beta,
                    combine,
                    ..Material::default()
                };
                of(a).combined_with(of(b)).checked().unwrap();
            }
        }
    }
}
