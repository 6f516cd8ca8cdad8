//! One step of projected Gauss–Seidel at a contact point.

use cgmath::Zero;

use super::Softness;
use crate::math::{Real, RealVector, Scalar, Vec3};

/// Impulse at a contact point, on the second body; the first one feels the opposite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ContactImpulse<R, V = Vec3<R>> {
    /// Component along the normal, from the first body to the second.
    pub normal: R,
    /// Friction, at right angles to the normal.
    pub tangent: V,
}

/// Limits of a contact impulse.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct FrictionCone<R> {
    /// Coefficient of friction.
    pub friction: R,
    /// Friction beyond coefficient times normal impulse, as an impulse.
    pub extra_friction: R,
    /// Lower bound of the normal impulse: zero, since contacts do not pull.
    pub min_normal_impulse: R,
}

impl<R: Real> FrictionCone<R> {
    /// Coulomb's cone.
    #[inline(always)]
    pub fn new(friction: R) -> Self {
        let zero = R::constant(0.0);
        Self { friction, extra_friction: zero, min_normal_impulse: zero }
    }

    /// Largest friction at this normal impulse.
    #[inline(always)]
    pub fn max_friction(&self, normal_impulse: R) -> R {
        self.friction * normal_impulse + self.extra_friction
    }

    /// Impulse within the cone: the normal component clamped first, then friction by it.
    #[inline(always)]
    pub fn clamp(&self, impulse: ContactImpulse<R, R::Vector>) -> ContactImpulse<R, R::Vector> {
        let normal = impulse.normal.max(self.min_normal_impulse);
        ContactImpulse { normal, tangent: impulse.tangent.clamp_length(self.max_friction(normal)) }
    }
}

impl<R: Real<Vector = V>, V: RealVector<R>> ContactImpulse<R, V> {
    /// Splits an impulse along a unit normal and across it.
    #[inline(always)]
    pub fn split(impulse: V, normal: V) -> Self {
        let along = impulse.inner_product(normal);
        Self { normal: along, tangent: impulse - normal * along }
    }

    /// The impulse as a vector.
    #[inline(always)]
    pub fn along(&self, normal: V) -> V {
        normal * self.normal + self.tangent
    }

    /// Sum of two impulses.
    #[inline(always)]
    pub fn plus(self, other: Self) -> Self {
        Self { normal: self.normal + other.normal, tangent: self.tangent + other.tangent }
    }

    /// Solves a contact point: adds the impulse that the contact wants, as if it were alone, rigid
    /// and without limits, and clamps the sum to the cone. Returns the change, to be applied to the
    /// bodies.
    #[inline(always)]
    pub fn solve(
        &mut self,
        wanted: Self,
        softness: Option<Softness<R>>,
        cone: &FrictionCone<R>,
    ) -> Self {
        let before = *self;
        let normal = match softness {
            Some(softness) => softness.apply(wanted.normal, before.normal),
            None => wanted.normal,
        };
        *self = cone.clamp(before.plus(Self { normal, ..wanted }));
        Self { normal: self.normal - before.normal, tangent: self.tangent - before.tangent }
    }
}

impl<S: Scalar> ContactImpulse<S> {
    pub fn zero() -> Self {
        Self { normal: S::zero(), tangent: Vec3::zero() }
    }
}

/// Solves rolling and torsional friction: adds the angular impulse that would stop the relative spin,
/// and clamps the part about the tangents and the part about the normal. Returns the change, to be
/// applied to the bodies.
#[inline(always)]
pub(crate) fn solve_rolling<R: Real>(
    accumulated: &mut R::Vector,
    wanted: R::Vector,
    normal: R::Vector,
    [max_rolling, max_torsional]: [R; 2],
) -> R::Vector {
    let (before, sum) = (*accumulated, *accumulated + wanted);
    let torsional = normal * sum.inner_product(normal);
    *accumulated =
        (sum - torsional).clamp_length(max_rolling) + torsional.clamp_length(max_torsional);
    *accumulated - before
}

#[cfg(test)]
mod tests {
    use super::*;
    use cgmath::InnerSpace;
    use proptest::prelude::*;

    proptest! {
        /// Repeated on one contact between a movable body and a fixed one, the step ends where the
        /// contact's conditions hold: no approach beyond the target, no pull, friction that opposes
        /// the slip within its cone.
        #[test]
        fn a_contact_alone_ends_at_signorini_and_coulomb(
            velocity in prop::array::uniform3(-1.0_f64..1.0),
            direction in prop::array::uniform3(-1.0_f64..1.0),
            target in -0.5_f64..0.5,
            friction in 0.0_f64..1.5,
            inertia_factor in 0.0_f64..3.0,
        ) {
            let normal = Vec3::from(direction);
            prop_assume!(normal.magnitude() > 0.1);
            let normal = normal.normalize();
            let (start, cone) = (Vec3::from(velocity), FrictionCone::new(friction));
            let mut impulse = ContactImpulse::split(Vec3::from([0.0; 3]), normal);
            let mut motion = start;
            for _ in 0..3 {
                let missing = ContactImpulse::split(motion, normal);
                let wanted = ContactImpulse {
                    normal: target - missing.normal,
                    tangent: missing.tangent / -(1.0 + inertia_factor),
                };
                let change = impulse.solve(wanted, None, &cone);
                motion += normal * change.normal + change.tangent * (1.0 + inertia_factor);
            }
            let ContactImpulse { normal: speed, tangent: slip } =
                ContactImpulse::split(motion, normal);
            prop_assert!(speed >= target - 1e-12 && impulse.normal >= 0.0);
            prop_assert!((speed - target) * impulse.normal <= 1e-12);
            prop_assert!(impulse.tangent.magnitude() <= friction * impulse.normal + 1e-12);
            prop_assert!(impulse.tangent.dot(slip) <= 1e-12);
            let sticks = slip.magnitude() < 1e-12;
            let at_the_cone =
                (impulse.tangent.magnitude() - friction * impulse.normal).abs() < 1e-12;
            prop_assert!(sticks || at_the_cone);
        }
    }
}
