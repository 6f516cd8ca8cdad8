//! Force laws of the penalty method: stiffness and damping at a penetration, bounded by what a
//! substep can resolve.

use super::contact::PenaltyContact;
use crate::math::Scalar;
use crate::response::Elasticity;

/// Force law of a penalty contact.
///
/// A collision reaches the requested restitution to 0.01, at any masses; zero gives a hundredth. A
/// body with many contacts is shared among them (mass splitting): they soften where all together
/// would be stiffer than the substep can resolve.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum ContactLaw {
    /// Linear spring and dashpot (Cundall and Strack 1979), as stiff as the substep can resolve: an
    /// elastic collision takes [16](ContactLaw::SUBSTEPS_PER_COLLISION) substeps, whatever the masses.
    #[default]
    SpringDashpot,
    /// Elastic balls: Hertz (1882) along the normal, Mindlin (1949) tangentially, with the damping
    /// of Tsuji, Tanaka and Ishida (1992). The stiffness follows from the materials'
    /// [`Elasticity`], but is never above that of
    /// [`ContactLaw::SpringDashpot`]: substeps longer than [`Elasticity::max_substep`] soften
    /// the contact.
    HertzMindlin,
}

impl ContactLaw {
    /// Number of substeps of an elastic collision by [`ContactLaw::SpringDashpot`].
    pub const SUBSTEPS_PER_COLLISION: u32 = 16;

    /// Square of the phase angle of a contact's oscillation per substep.
    pub(super) const ANGLE_2: f64 = {
        let angle = std::f64::consts::PI / Self::SUBSTEPS_PER_COLLISION as f64;
        angle * angle
    };
}

/// Stiffness and damping of a contact, normal and tangential.
#[derive(Clone, Debug)]
pub(super) struct Springs<S> {
    /// Elastic force at the penetration, in newtons.
    pub elastic_force: S,
    /// Normal stiffness, the derivative of that force, in N/m.
    pub stiffness: S,
    /// Normal damping, in N s/m.
    pub damping: S,
    /// Tangential stiffness and damping, in N/m and N s/m.
    pub tangent_stiffness: S,
    pub tangent_damping: S,
}

/// Damping ratio (fraction of critical damping) for a coefficient of restitution, where no contact
/// pulls (Schwager and Poeschel 2007, eq. 20 ff., whose contact ends with the force): with y half
/// of −ln e, it is cos ψ where ψ cot ψ = y, beyond y = 1 cosh η where η coth η = y. The polynomial
/// meets both to 3e-4. It holds for [`ContactLaw::HertzMindlin`] too, although that has another
/// time dependence (Antypov and Elliott 2011).
pub(super) fn damping_ratio<S: Scalar>(restitution: S) -> S {
    // Zero restitution would need infinite damping.
    let y = restitution.max(S::from_f64(0.006)).ln_portable() * S::from_f64(-0.5);
    let terms = [0.01166, 0.00267, 0.09554, 0.25344, 0.63683];
    terms.into_iter().fold(S::zero(), |sum, term| sum * y + S::from_f64(term)) * y
}

impl ContactLaw {
    /// Springs of a contact at a penetration, for a substep of `dt` seconds.
    pub(super) fn springs<S: Scalar>(
        self,
        contact: &PenaltyContact<S>,
        penetration: S,
        dt: S,
    ) -> Springs<S> {
        let number = S::from_f64;
        let (normal, tangent) =
            (contact.inverse_effective_mass().normal, contact.inverse_effective_mass().tangent);
        let two_ratios = number(2.0) * damping_ratio(contact.material.restitution);
        // The stability limit, which both laws share.
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
                let stiffness = two * contact_radius / contact.material.compliance.normal;
                let tangent_stiffness =
                    number(8.0) * contact_radius / contact.material.compliance.tangent;
                let hertz = number(2.0 / 3.0) * stiffness.min(max_stiffness);
                let elastic_force = if stiffness <= max_stiffness {
                    hertz * penetration
                } else {
                    // From this fraction of the penetration on, linear with the maximum stiffness.
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
        // Damping follows 5/6 of the stiffness of Hertz's spring (Tsuji, Tanaka and Ishida 1992),
        // all of a linear one.
        let linear_force = stiffness * penetration;
        let hertz_correction = if linear_force > S::zero() {
            (S::one() + elastic_force / linear_force) * number(0.5)
        } else {
            S::one() // no force yet
        };
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
    /// Longest substep, in seconds, in which two balls of this material keep their
    /// [`ContactLaw::HertzMindlin`] stiffness when they collide head-on at `speed` m/s, each of
    /// this mass and radius (kg, m). In a longer one they are as stiff as by
    /// [`ContactLaw::SpringDashpot`]. Balls that bear others need a shorter one.
    #[must_use]
    pub fn max_substep(self, mass: S, radius: S, speed: S) -> S {
        let number = S::from_f64;
        let (mass, radius) = (mass * number(0.5), radius * number(0.5));
        let modulus = (self.compliance().normal * number(2.0)).recip();
        // Hertz: the maximum penetration is (15/16 m v² / (E √R))^(2/5).
        let squared = number(15.0 / 16.0) * mass * speed * speed / (modulus * radius.sqrt());
        let penetration = (squared.ln_portable() * number(0.4)).exp_portable();
        let stiffness = number(2.0) * modulus * (radius * penetration).sqrt();
        (number(ContactLaw::ANGLE_2) * mass / stiffness).sqrt()
    }
}
