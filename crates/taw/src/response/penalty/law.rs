//! How a contact's force follows from its overlap: stiffness, damping, and what a substep
//! bears of both.

use super::PenaltyContact;
use crate::math::Scalar;
use crate::response::Elasticity;

/// How a penalty force grows with the overlap.
///
/// A collision gives back the restitution that is asked for, to .01 and at any masses; one of
/// zero gives a hundredth. What touches many others at once is shared out among its contacts,
/// which get softer where all together would be stiffer than the substep bears.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum ContactLaw {
    /// A spring and a dashpot (Cundall and Strack 1979), as stiff as the step can bear: an
    /// elastic collision takes [16](ContactLaw::STEPS) substeps, whatever the masses.
    #[default]
    SpringDashpot,
    /// That of elastic balls: Hertz (1882) along the normal, Mindlin (1949) across it,
    /// with the damping of Tsuji, Tanaka and Ishida (1992). The materials'
    /// [`Elasticity`](crate::response::Elasticity) says how stiff they are. No stiffer than
    /// [`ContactLaw::SpringDashpot`], however: substeps longer than
    /// [`Elasticity::longest_substep`] soften the contact.
    HertzMindlin,
}

impl ContactLaw {
    /// How many substeps an elastic collision takes by [`ContactLaw::SpringDashpot`].
    pub const STEPS: u32 = 16;

    /// The square of the angle that a contact's oscillation goes through in a substep.
    pub(super) const ANGLE_2: f64 = {
        let angle = std::f64::consts::PI / Self::STEPS as f64;
        angle * angle
    };
}

/// Stiffness and damping of a touch: what is along the normal and what across it.
pub(super) struct Springs<S> {
    /// The elastic force of the overlap, in newtons.
    pub elastic_force: S,
    /// How it grows with the overlap, in N/m.
    pub stiffness: S,
    /// In N s/m.
    pub damping: S,
    /// In N/m and N s/m.
    pub tangent_stiffness: S,
    pub tangent_damping: S,
}

/// What a collision loses as a part of critical damping, where no contact pulls back
/// (Schwager and Poeschel 2007, eq. 20 ff., whose contact ends with the force): with half of
/// −ln e as y, that is cos ψ where ψ cot ψ = y, beyond y = 1 cosh η where η coth η = y. The
/// polynomial meets both to 3e-4. It holds for [`ContactLaw::HertzMindlin`] too, whose time
/// runs otherwise (Antypov and Elliott 2011).
pub(super) fn damping_ratio<S: Scalar>(restitution: S) -> S {
    // Nothing at all would take endless damping to lose.
    let y = restitution.max(S::constant(0.006)).ln_portable() * S::constant(-0.5);
    let terms = [0.01166, 0.00267, 0.09554, 0.25344, 0.63683];
    terms.into_iter().fold(S::zero(), |sum, term| sum * y + S::constant(term)) * y
}

impl ContactLaw {
    /// What a touch has at this overlap in a substep of `dt` seconds.
    pub(super) fn springs<S: Scalar>(
        self,
        contact: &PenaltyContact<S>,
        penetration: S,
        dt: S,
    ) -> Springs<S> {
        let number = S::constant;
        let (normal, tangent) =
            (contact.inverse_effective_mass().normal, contact.inverse_effective_mass().tangent);
        let two_ratios = number(2.0) * damping_ratio(contact.material.restitution);
        // The max_stiffness, which both laws share.
        let stiffness_per_mass = number(Self::ANGLE_2) / (dt * dt);
        let (max_stiffness, max_tangent_stiffness) =
            (stiffness_per_mass / normal, stiffness_per_mass / tangent);
        let damping =
            |stiffness: S, inverse_mass: S| two_ratios * (stiffness / inverse_mass).sqrt();
        let (elastic_force, stiffness, tangent_stiffness) = match self {
            Self::SpringDashpot => {
                (max_stiffness * penetration, max_stiffness, max_tangent_stiffness)
            }
            Self::HertzMindlin => {
                let two = number(2.0);
                let contact_radius = (penetration / contact.curvature).sqrt();
                let stiffness = two * contact_radius / contact.compliance.normal;
                let tangent_stiffness = number(8.0) * contact_radius / contact.compliance.tangent;
                let hertz = number(2.0 / 3.0) * stiffness.min(max_stiffness);
                let elastic_force = if stiffness <= max_stiffness {
                    hertz * penetration
                } else {
                    // As stiff from here on as it was at this part of the overlap.
                    let fraction = max_stiffness / stiffness;
                    (hertz * fraction * fraction + max_stiffness * (S::one() - fraction * fraction))
                        * penetration
                };
                (
                    elastic_force,
                    stiffness.min(max_stiffness),
                    tangent_stiffness.min(max_tangent_stiffness),
                )
            }
        };
        // Of Hertz's spring it is 5/6 (Tsuji, Tanaka and Ishida 1992), of a linear one all.
        let hertz_correction = (S::one() + elastic_force / (stiffness * penetration)) * number(0.5);
        Springs {
            elastic_force,
            stiffness,
            damping: damping(stiffness * hertz_correction, normal),
            tangent_stiffness,
            tangent_damping: damping(tangent_stiffness * hertz_correction, tangent),
        }
    }
}

impl<S: Scalar> Elasticity<S> {
    /// The longest substep, in seconds, in which two balls of this kind keep their stiffness by
    /// [`ContactLaw::HertzMindlin`] when they meet head-on at `speed` m/s, each of this mass
    /// and radius (kg, m). In a longer one they are as stiff as
    /// [`ContactLaw::SpringDashpot`] is. What bears other marbles needs a shorter one.
    #[must_use]
    pub fn longest_substep(self, mass: S, radius: S, speed: S) -> S {
        let number = S::constant;
        let (mass, radius) = (mass * number(0.5), radius * number(0.5));
        let modulus = (self.compliance().normal * number(2.0)).recip();
        // Hertz: the largest overlap is (15/16 m v² / (E √R))^(2/5).
        let squared = number(15.0 / 16.0) * mass * speed * speed / (modulus * radius.sqrt());
        let penetration = (squared.ln_portable() * number(0.4)).exp_portable();
        let stiffness = number(2.0) * modulus * (radius * penetration).sqrt();
        (number(ContactLaw::ANGLE_2) * mass / stiffness).sqrt()
    }
}
