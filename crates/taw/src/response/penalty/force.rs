//! Forces of a penalty contact in a substep: its springs, dashpots, friction, and its rigid core.

use cgmath::{InnerSpace, Zero};

use super::contact::PenaltyContact;
use super::law::Springs;
use super::mass_split::{damped_fraction, undamped_fraction};
use super::{PenaltySettings, SpringHistory};
use crate::constraint::{ContactImpulse, FrictionCone, solve_rolling};
use crate::math::{RealVector, Scalar, Vec3, cast_vector, is_finite};
use crate::response::{Colliders, EnergyLedger, SolverBodies};

/// Contact with its forces in this substep.
#[derive(Clone, Debug)]
pub(super) struct ContactForce<S> {
    /// Index of its contact, those with walls first.
    pub index: usize,
    pub contact: PenaltyContact<S>,
    pub springs: Springs<S>,
    /// Half of the velocity fraction that the dashpots take in a substep, normal and tangential.
    pub half_damping: [S; 2],
    pub history: SpringHistory<S>,
    /// Factors on the forces of its springs and of its dashpots by mass splitting.
    pub spring_scale: S,
    pub dashpot_scale: S,
    /// Number of contacts of each body.
    pub counts: [S; 2],
    /// Normal inverse mass if all contacts of both bodies push equally, in 1/kg.
    pub shared_inverse_mass: S,
    /// Impulse of the normal spring, all of the normal impulse, and the total, in N s.
    pub spring_impulse: S,
    pub normal_impulse: S,
    pub impulse: Vec3<S>,
    pub angular_impulse: Vec3<S>,
    /// Velocities of both bodies before the forces, and of the contact points after them, in m/s.
    pub initial_velocities: [Vec3<S>; 2],
    pub relative_velocity: Vec3<S>,
    /// Relative velocity after the forces without the spins of balls, in m/s.
    pub velocity: Vec3<S>,
    /// Speed at which the rigid core leaves the wall, in m/s, and its impulse, in N s.
    pub rebound_speed: S,
    pub core_impulse: S,
    /// The contact will have ended by the next substep although its spring still pushes.
    pub ends: bool,
}

impl<S, W, F> PenaltySettings<'_, S, W, F>
where
    S: Scalar,
    W: Colliders<S>,
    F: Fn(usize) -> S,
{
    #[inline]
    pub(super) fn contact_force(
        &self,
        index: usize,
        mut contact: PenaltyContact<S>,
        initial_velocities: [Vec3<S>; 2],
        (before, depths): (&[SpringHistory<S>], &[S]),
    ) -> ContactForce<S> {
        let dt = self.context.settings.dt;
        let separation_speed = contact.relative_velocity.dot(contact.normal);
        let found = before.binary_search_by_key(&contact.key, |history| history.key);
        let known = found.ok().map(|at| before[at]);
        let overlap = self.overlap(&contact, known, before, depths);
        let history = known.filter(|history| !history.ended);
        contact.penetration -= overlap;
        let mut springs = self.law.springs(&contact, contact.penetration, dt);
        let (mut damped_time, mut tangent_displacement) = (S::one(), Vec3::zero());
        if history.is_none() && separation_speed < S::zero() {
            // New contact: the dashpot acts since the contact began, after the last kick, and for
            // half of the time to the next one, at half of the penetration of then.
            let substep = -separation_speed * dt;
            damped_time = S::from_f64(0.5) + (contact.penetration / substep).min(S::one());
            let middle = self.law.springs(&contact, damped_time * substep * S::from_f64(0.5), dt);
            (springs.damping, springs.tangent_damping) = (middle.damping, middle.tangent_damping);
            tangent_displacement = contact.relative_velocity.reject_from(contact.normal)
                * (contact.penetration / -separation_speed).min(dt);
        }
        if contact.material.friction == S::zero() {
            (springs.tangent_stiffness, springs.tangent_damping) = (S::zero(), S::zero());
        }
        // Half of the step by the velocity before, half by that after; a dashpot stops motion, but
        // never reverses it.
        let (half, inverse_mass) = (S::from_f64(0.5) * dt, contact.inverse_effective_mass());
        let half_damping = [
            springs.damping * inverse_mass.normal * half * damped_time,
            springs.tangent_damping * inverse_mass.tangent * half * damped_time,
        ]
        .map(|damping| damping.min(S::one()));
        let history = history.unwrap_or(SpringHistory {
            key: contact.key,
            normal: contact.normal,
            penetration: contact.penetration,
            overlap,
            ended: false,
            tangent_displacement,
            tangent_stiffness: S::zero(),
            stored_energy: S::zero(),
            velocity: contact.without_spin(initial_velocities, contact.relative_velocity),
        });
        let (zero, none) = (S::zero(), Vec3::zero());
        ContactForce {
            index,
            contact,
            springs,
            half_damping,
            history: SpringHistory { overlap, ..history },
            spring_scale: S::one(),
            dashpot_scale: S::one(),
            counts: [zero; 2],
            shared_inverse_mass: zero,
            spring_impulse: zero,
            normal_impulse: zero,
            impulse: none,
            angular_impulse: none,
            initial_velocities,
            relative_velocity: none,
            velocity: none,
            rebound_speed: zero,
            core_impulse: zero,
            ends: false,
        }
    }

    /// Tells if the contact will have ended by the next substep although its spring still pushes.
    #[inline]
    pub(super) fn ends(&self, force: &ContactForce<S>, marbles: &SolverBodies<S>) -> bool {
        let ahead = |row: usize| marbles.velocity[row] * (self.context.position_weight)(row);
        let first = force.contact.a.map_or_else(Vec3::zero, ahead);
        let displacement =
            (ahead(force.contact.b) - first).dot(force.contact.normal) * self.context.settings.dt;
        let next = force.next_penetration(self.context.settings.dt);
        next > S::zero() && next - displacement <= S::zero()
    }

    /// Applies the last impulse of an ending contact.
    pub(super) fn apply_last_impulse(
        &self,
        force: &mut ContactForce<S>,
        marbles: &mut SolverBodies<S>,
        work: Option<&mut EnergyLedger>,
    ) {
        // Above zero: it ends although its spring pushes.
        let fraction = force.next_penetration(self.context.settings.dt) / force.contact.penetration;
        let elastic_force = force.springs.elastic_force * fraction;
        let [_, normal_impulse] = force.normal_impulses(
            elastic_force,
            force.separation_speed(),
            self.context.settings.dt,
        );
        force.apply_normal_impulse(marbles, normal_impulse, work);
    }
}

impl<S: Scalar> ContactForce<S> {
    /// Solves for the impulses of a substep of `dt` seconds.
    #[inline]
    pub fn solve(&mut self, dt: S) {
        let PenaltyContact { normal, relative_velocity, material, .. } = self.contact;
        let separation_speed = relative_velocity.dot(normal);
        [self.spring_impulse, self.normal_impulse] =
            self.normal_impulses(self.springs.elastic_force, separation_speed, dt);
        let tangent_velocity = relative_velocity - normal * separation_speed;
        let cone = FrictionCone::new(material.friction);
        let limit = cone.max_friction(self.normal_impulse);
        // The tangential displacement rotates with the contact plane.
        let previous = self.history.tangent_displacement;
        let mut tangent_displacement = previous - normal * previous.dot(normal);
        let tangent_stiffness = self.springs.tangent_stiffness * self.spring_scale;
        if tangent_stiffness > self.history.tangent_stiffness
            && self.history.tangent_stiffness > S::zero()
        {
            // A stiffening spring keeps its force, or it would release more energy than it
            // absorbed.
            tangent_displacement *= self.history.tangent_stiffness / tangent_stiffness;
        }
        let damped = damped_fraction(self.half_damping[1]) * self.dashpot_scale;
        let impulse_per_displacement = tangent_stiffness * dt * undamped_fraction(damped);
        if impulse_per_displacement > S::zero() {
            // Friction limits the tangential displacement.
            tangent_displacement =
                tangent_displacement.clamp_length(limit / impulse_per_displacement);
        }
        let dashpot = damped / self.contact.inverse_effective_mass().tangent;
        let spring_and_dashpot =
            tangent_displacement * impulse_per_displacement + tangent_velocity * dashpot;
        let wanted = ContactImpulse { normal: self.normal_impulse, tangent: -spring_and_dashpot };
        let tangent_impulse = cone.clamp(wanted).tangent;
        self.history.tangent_displacement =
            if is_finite(tangent_displacement) { tangent_displacement } else { Vec3::zero() };
        self.history.tangent_stiffness = tangent_stiffness;
        self.impulse = normal * self.normal_impulse + tangent_impulse;
    }

    /// Solves for the angular impulse of rolling and torsional friction.
    #[inline]
    pub fn solve_rolling(&mut self, marbles: &SolverBodies<S>) {
        let PenaltyContact { normal, material, curvature, .. } = self.contact;
        let lever = self.normal_impulse / curvature;
        let limits = [material.rolling_resistance * lever, material.spinning_resistance * lever];
        let wanted = self.contact.rolling_impulse(marbles, self.counts);
        solve_rolling(&mut self.angular_impulse, wanted, normal, limits);
    }

    /// Normal impulses in a substep: of the spring, and of spring and dashpot; in N s.
    fn normal_impulses(&self, elastic_force: S, separation_speed: S, dt: S) -> [S; 2] {
        let alone = damped_fraction(self.half_damping[0]);
        let damped = alone * self.dashpot_scale;
        let dashpot_impulse =
            -separation_speed * damped / self.contact.inverse_effective_mass().normal;
        // All dashpots together slow an approach by no more than its own would.
        let slowed_speed = separation_speed.max(separation_speed * (S::one() - alone));
        let fraction = self.spring_scale * undamped_fraction(damped);
        let spring_impulse =
            (elastic_force * dt * fraction).min(self.max_spring_impulse(slowed_speed));
        [spring_impulse, (spring_impulse + dashpot_impulse).max(S::zero())]
    }

    /// Upper bound of the spring's impulse: it releases no more energy than it absorbed, whatever
    /// made it stiffer or deeper; penetration that it did not stop itself separates slowly.
    fn max_spring_impulse(&self, separation_speed: S) -> S {
        let inverse_mass = self.shared_inverse_mass;
        let mean_speed = self.mean_speed(separation_speed);
        let stored_energy = self.history.stored_energy.max(S::zero());
        let releasable =
            (mean_speed * mean_speed + inverse_mass * stored_energy * S::from_f64(2.0)).sqrt()
                - mean_speed;
        releasable.max(self.max_push_speed() - separation_speed).max(S::zero()) / inverse_mass
    }

    /// Separation speed for penetration without approach: one radius per second, in m/s.
    fn max_push_speed(&self) -> S {
        self.contact.curvature.recip()
    }

    /// Applies the angular impulse.
    #[inline]
    pub fn apply_rolling(&self, marbles: &mut SolverBodies<S>, work: Option<&mut EnergyLedger>) {
        if self.angular_impulse.is_zero() {
            return;
        }
        let before = self.contact.relative_spin(marbles);
        marbles.apply_angular_impulse(self.contact.b, -self.angular_impulse);
        if let Some(a) = self.contact.a {
            marbles.apply_angular_impulse(a, self.angular_impulse);
        }
        if let Some(work) = work {
            let after = self.contact.relative_spin(marbles);
            work.record_angular_impulse(
                cast_vector(-self.angular_impulse),
                cast_vector(before),
                cast_vector(after),
            );
        }
    }

    /// Penetration at the next kick that loads the spring, in metres.
    fn next_penetration(&self, dt: S) -> S {
        self.contact.penetration - self.separation_speed() * dt
    }

    /// Mean of the speeds along the normal at the end of the last substep and now, in m/s: that
    /// along which an impulse of all forces together does its work.
    fn mean_speed(&self, separation_speed: S) -> S {
        let before = self.history.velocity.dot(self.contact.normal);
        (before + separation_speed) * S::from_f64(0.5)
    }

    /// Separation speed after the forces, in m/s.
    fn separation_speed(&self) -> S {
        self.relative_velocity.dot(self.contact.normal)
    }

    /// Sets the speed at which the core of a marble that continuous detection stopped at a wall
    /// leaves it. It cannot go on, so no spring would take its velocity within the time of a
    /// collision: the core is rigid.
    pub fn find_rebound_speed(&mut self, marbles: &SolverBodies<S>, threshold: S) {
        let speed = -self.contact.relative_velocity(marbles).dot(self.contact.normal);
        if self.contact.core_touches && speed > threshold {
            self.rebound_speed = speed * self.contact.material.restitution;
        }
    }

    /// Pushes the core so that it leaves the wall at its rebound speed or faster.
    pub fn push_core(&mut self, marbles: &mut SolverBodies<S>, work: Option<&mut EnergyLedger>) {
        if !self.contact.core_touches {
            return;
        }
        let speed = self.contact.relative_velocity(marbles).dot(self.contact.normal);
        let inverse_mass = self.contact.inverse_effective_mass().normal;
        // No faster than it came: beside other pushes that have slowed it, more would add energy.
        let missing = (self.rebound_speed.min(speed.abs()) - speed) / inverse_mass;
        let total = (self.core_impulse + missing).max(S::zero());
        let impulse = total - self.core_impulse;
        if impulse == S::zero() || !total.is_finite() {
            return;
        }
        self.core_impulse = total;
        if self.rebound_speed > S::zero() {
            // The spring does no work by it.
            self.history.velocity -= self.contact.normal * (impulse * inverse_mass);
        }
        self.apply_normal_impulse(marbles, impulse, work);
    }

    fn apply_normal_impulse(
        &mut self,
        marbles: &mut SolverBodies<S>,
        normal_impulse: S,
        work: Option<&mut EnergyLedger>,
    ) {
        let impulse = self.contact.normal * normal_impulse;
        let before = self.contact.relative_velocity(marbles);
        self.contact.apply_impulse(marbles, impulse);
        self.normal_impulse += normal_impulse;
        self.impulse += impulse;
        if let Some(work) = work {
            let mean_velocity =
                cast_vector::<S, f64>(before + self.contact.relative_velocity(marbles)) * 0.5;
            self.contact.record_impulse(marbles, impulse, mean_velocity, work);
        }
    }

    /// History for the next substep, if it is finite.
    #[inline]
    pub fn next_history(&self, dt: S) -> Option<SpringHistory<S>> {
        let Self { relative_velocity, velocity, contact: PenaltyContact { normal, .. }, .. } =
            *self;
        let work = self.spring_impulse * self.mean_speed(self.separation_speed());
        let stored_energy = (self.history.stored_energy - work).max(S::zero());
        let tangent_displacement =
            self.history.tangent_displacement + relative_velocity.reject_from(normal) * dt;
        let history = SpringHistory {
            normal,
            penetration: self.next_penetration(dt) + self.history.overlap,
            tangent_displacement,
            stored_energy,
            velocity,
            ..self.history
        };
        let known = history.penetration.is_finite()
            && history.stored_energy.is_finite()
            && history.tangent_stiffness.is_finite();
        (known && is_finite(velocity) && is_finite(tangent_displacement)).then_some(history)
    }
}
