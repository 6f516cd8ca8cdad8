//! Velocities alone, of contacts that another solver has prepared: no bounces, no positions, no memory.

use super::{BodyA, Constraint, ImpulseScratch, SolverSettings, iterate};
use crate::constraint::{ContactImpulse, FrictionCone};
use crate::contact::Contact;
use crate::math::{RealVector, Scalar, Vec3};
use crate::response::{ContactKey, SolverBodies};

/// Contact of two balls, or of a wall and a ball.
#[derive(Clone, Copy, Debug)]
pub(crate) struct VelocityContact<S> {
    /// Row of the first ball; none for a wall.
    pub a: Option<u32>,
    /// Row of the second ball.
    pub b: u32,
    /// Unit normal, from the first to the second.
    pub normal: Vec3<S>,
    /// Velocity of the wall's surface, in m/s.
    pub surface_velocity: Vec3<S>,
    /// Least relative velocity along the normal, in m/s.
    pub target_normal_velocity: S,
    /// Coefficient of friction.
    pub friction: S,
    /// Impulse on the second ball, in N s: before, that which velocities have already; afterwards, all.
    pub impulse: ContactImpulse<S>,
}

/// Solves the velocities of contacts as [`solve_contacts`](super::solve_contacts) does, beginning with
/// the impulses that they have.
pub(crate) fn solve_velocities<S: Scalar>(
    marbles: &mut SolverBodies<S>,
    contacts: &mut [VelocityContact<S>],
    settings: &SolverSettings<S>,
    scratch: &mut ImpulseScratch<S>,
) {
    let ImpulseScratch { constraints, islands, rows, energies, full_restitution, .. } = scratch;
    constraints.clear();
    let prepared = contacts
        .iter()
        .enumerate()
        .map(|(index, contact)| marbles.velocity_constraint(index, contact));
    constraints.extend(prepared);
    for c in constraints.iter() {
        marbles.apply_impulse_pair(c, -c.impulse());
    }
    for c in constraints.iter_mut() {
        c.initial_relative_velocity = marbles.relative_velocity_of(c);
        c.initial_relative_spin = marbles.relative_spin(c);
    }
    islands.build(constraints, marbles.velocity.len(), settings.restitution_threshold);
    marbles.measure_loads(constraints, islands);
    for c in constraints.iter_mut() {
        c.impulse = c.saturate(c.cone.clamp(c.impulse));
        marbles.apply_impulse_pair(c, c.impulse());
    }
    marbles.scale_warm_start(constraints, islands, energies);
    iterate(marbles, constraints, islands, rows, settings);
    marbles.limit_energy(constraints, islands, energies, full_restitution, rows, settings);
    marbles.resolve_jams(constraints, islands, energies, rows, settings);
    for (c, contact) in constraints.iter().zip(contacts) {
        let inverse_mass = c.inverse_effective_mass.normal;
        contact.impulse = ContactImpulse {
            normal: c.impulse.normal / inverse_mass,
            tangent: c.impulse.tangent / inverse_mass,
        };
    }
}

impl<S: Scalar> SolverBodies<'_, S> {
    fn velocity_constraint(&self, index: usize, contact: &VelocityContact<S>) -> Constraint<S> {
        let VelocityContact { normal, surface_velocity, friction, .. } = *contact;
        let (a, b, zero) = (contact.first(), contact.b as usize, Vec3::from([S::zero(); 3]));
        let arms = self.arms(a, b, [S::zero(); 2], normal);
        let inverse_effective_mass = self.pair_inverse_effective_mass(a, b, arms, normal);
        let unit = inverse_effective_mass.normal;
        Constraint {
            a,
            b,
            key: contact.key(),
            index,
            axis_offset: [S::zero(); 2],
            island: 0,
            normal,
            arms,
            surface_velocity,
            inverse_effective_mass,
            restitution: S::zero(),
            tangential_restitution: S::zero(),
            friction,
            cone: FrictionCone::new(friction),
            max_normal_impulse: S::infinity(),
            initial_relative_velocity: zero,
            initial_relative_spin: zero,
            bounces: false,
            time_since_impact: None,
            velocity_since_impact: zero,
            target_normal_velocity: contact.target_normal_velocity,
            target_tangent_velocity: zero,
            impulse: ContactImpulse {
                normal: contact.impulse.normal * unit,
                tangent: contact.impulse.tangent.reject_from(normal) * unit,
            },
            rolling: None,
        }
    }
}

impl<S: Scalar> VelocityContact<S> {
    fn first(&self) -> BodyA {
        self.a.map_or(BodyA::Wall(0, 0), BodyA::Marble)
    }

    /// Key that nobody asks for, as nothing is cached.
    fn key(&self) -> ContactKey {
        self.first().contact_key(&Contact::<S>::between_marbles(self.a.unwrap_or_default(), self.b))
    }
}
