//! Penalty method: contact forces that grow with penetration.
//!
//! All forces of a substep are evaluated at the positions that a step ending in a kick would have,
//! which makes every integrator symplectic. So a resting marble has no velocity, and the
//! oscillation of contacts is stable as long as stiffness and damping stay below the limit of
//! [`mass_split`] (multiply the equation of motion by the mean velocity: only dashpots change the
//! remaining sum of squares).

mod contact;
mod law;
mod mass_split;
#[cfg(test)]
mod tests;

pub use law::ContactLaw;

use cgmath::{InnerSpace, Zero};

use crate::constraint::solve_rolling;
use crate::contact::Contacts;
use crate::math::{RealVector, Scalar, Vec3, cast_vector, is_finite};
use crate::response::impulse::BodyA;
use crate::response::{
    Colliders, ContactKey, EnergyLedger, KeyedByContact, Material, SolverBodies,
};
use contact::{PenaltyContact, active_contact};
use law::Springs;
use mass_split::{ContactLoad, damped_fraction, undamped_fraction};

/// Contact history: state of a contact's springs from the last substep.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SpringHistory<S> {
    key: ContactKey,
    /// Unit normal, and penetration at the position of the next kick, in metres.
    normal: Vec3<S>,
    penetration: S,
    /// Tangential displacement of the two points while they stick, in metres, at the position of the
    /// next kick, and its stiffness, in N/m.
    tangent_displacement: Vec3<S>,
    tangent_stiffness: S,
    /// Energy stored in the normal spring, in joules.
    stored_energy: S,
    /// Separation speed along the normal at the end of the substep, in m/s.
    separation_speed: S,
}

impl<S: Scalar> KeyedByContact for SpringHistory<S> {
    fn key(&self) -> ContactKey {
        self.key
    }

    fn set_key(&mut self, key: ContactKey) {
        self.key = key;
    }

    fn reverse(&mut self) {
        self.normal = -self.normal;
        self.tangent_displacement = -self.tangent_displacement;
    }
}

/// Settings of a substep of [`apply_penalty_forces`].
pub(crate) struct PenaltySettings<S, M, F> {
    pub law: ContactLaw,
    /// Substep, in seconds.
    pub dt: S,
    /// Material of a marble, by row.
    pub material: M,
    /// Position weight: fraction of the substep for which a position has followed a velocity
    /// change.
    pub position_weight: F,
}

/// Contact with its forces in this substep.
struct ContactForce<S> {
    /// Index of its contact, those with walls first.
    index: usize,
    contact: PenaltyContact<S>,
    springs: Springs<S>,
    /// Half of the velocity fraction that the dashpots take in a substep, normal and tangential.
    half_damping: [S; 2],
    history: SpringHistory<S>,
    /// Factors on the forces of its springs and of its dashpots by mass splitting.
    spring_scale: S,
    dashpot_scale: S,
    /// Number of contacts of each body.
    counts: [S; 2],
    /// Normal inverse mass if all contacts of both bodies push equally, in 1/kg.
    shared_inverse_mass: S,
    /// Impulse of the normal spring, all of the normal impulse, and the total, in N s.
    spring_impulse: S,
    normal_impulse: S,
    impulse: Vec3<S>,
    angular_impulse: Vec3<S>,
}

/// Applies penalty forces: they change velocities, and positions by what the integrator moved too
/// early. `histories` is the contact history.
///
/// The contacts' rows exist. Rows that end up infinite or NaN lose their velocity and are added to
/// `quarantined`.
pub(crate) fn apply_penalty_forces<S: Scalar>(
    settings: &PenaltySettings<S, impl Fn(usize) -> Material<S>, impl Fn(usize) -> S>,
    marbles: &mut SolverBodies<S>,
    contacts: &mut Contacts<S>,
    walls: &impl Colliders<S>,
    histories: &mut Vec<SpringHistory<S>>,
    quarantined: &mut Vec<u32>,
    mut work: Option<&mut EnergyLedger>,
) {
    let before = std::mem::take(histories);
    keep_sides(settings, marbles, contacts, &before);
    let mut forces = Vec::with_capacity(contacts.len());
    for (index, (a, contact)) in BodyA::of_each(contacts).enumerate() {
        if let Some(contact) = active_contact(settings, marbles, walls, a, contact) {
            forces.push(ContactForce::new(settings, index, contact, &before));
        }
    }
    split_masses(marbles, &mut forces, settings.dt);
    let start: Vec<_> = forces.iter().map(|p| p.contact.velocities(marbles)).collect();
    // All forces are evaluated at the same time, so that their order does not matter.
    for force in &mut forces {
        force.solve(settings.dt);
    }
    for ContactForce { contact, impulse, .. } in &forces {
        contact.apply_impulse(marbles, *impulse);
    }
    update_positions(settings, marbles, &forces, &start);
    if let Some(work) = work.as_deref_mut() {
        for ContactForce { contact, impulse, .. } in &forces {
            contact.record_energy(marbles, *impulse, work);
        }
    }
    // After friction has turned the marbles: what it adds in a substep is resisted in the same one.
    for force in &mut forces {
        force.solve_rolling(marbles);
    }
    for force in &forces {
        force.apply_rolling(marbles, work.as_deref_mut());
    }
    let velocities: Vec<_> = forces.iter().map(|p| p.contact.relative_velocity(marbles)).collect();
    let ending: Vec<_> = forces
        .iter()
        .zip(&velocities)
        .map(|(force, velocity)| force.ends(settings, marbles, velocity.dot(force.contact.normal)))
        .collect();
    for ((force, velocity), ends) in forces.iter_mut().zip(velocities).zip(ending) {
        let separation_speed = velocity.dot(force.contact.normal);
        let Some(history) = force.next_history(settings.dt, velocity) else { continue };
        if ends {
            force.history = history;
            force.apply_last_impulse(settings, marbles, separation_speed, work.as_deref_mut());
        } else {
            histories.push(history);
        }
    }
    histories.sort_unstable_by_key(|history| history.key);
    list_impulses(&forces, contacts);
    for contact in contacts.wm.iter().chain(&contacts.mm) {
        quarantine_if_non_finite(marbles, contact.b, quarantined);
    }
    contacts
        .mm
        .iter()
        .for_each(|contact| quarantine_if_non_finite(marbles, contact.a, quarantined));
}

/// Keeps marbles on the side of a wall from which they came: one that has sunk in beyond the middle
/// of a thin wall is nearer to its other side, where it would be pushed out.
fn keep_sides<S: Scalar>(
    settings: &PenaltySettings<S, impl Fn(usize) -> Material<S>, impl Fn(usize) -> S>,
    marbles: &SolverBodies<S>,
    contacts: &mut Contacts<S>,
    before: &[SpringHistory<S>],
) {
    for contact in &mut contacts.wm {
        let key = ContactKey::with_wall(contact);
        let Ok(at) = before.binary_search_by_key(&key, |history| history.key) else { continue };
        let SpringHistory { normal, penetration, .. } = before[at];
        if normal.dot(contact.normal) > S::from_f64(-0.5) {
            continue;
        }
        let row = contact.b as usize;
        contact.arms[1] += contact.normal * (marbles.radius[row] * S::from_f64(2.0));
        contact.normal = -contact.normal;
        let moved = marbles.velocity[row] * (settings.dt * (settings.position_weight)(row));
        contact.separation = moved.dot(contact.normal) - penetration;
    }
}

/// Lists the impulses in their contacts.
fn list_impulses<S: Scalar>(forces: &[ContactForce<S>], contacts: &mut Contacts<S>) {
    for ContactForce { index, normal_impulse, impulse, contact, .. } in forces {
        let Some(listed) = contacts.get_mut(*index) else { continue };
        listed.set_impulse(*normal_impulse, impulse.reject_from(contact.normal));
    }
}

fn quarantine_if_non_finite<S: Scalar>(
    marbles: &mut SolverBodies<S>,
    row: u32,
    quarantined: &mut Vec<u32>,
) {
    let index = row as usize;
    let spin = marbles.spin.get(index).copied().unwrap_or_else(Vec3::zero);
    if is_finite(marbles.velocity[index]) && is_finite(spin) {
        return;
    }
    marbles.velocity[index] = Vec3::zero();
    if let Some(spin) = marbles.spin.get_mut(index) {
        *spin = Vec3::zero();
    }
    quarantined.push(row);
}

/// Moves marbles by their velocity changes since `start`, with the position weight.
fn update_positions<S: Scalar>(
    settings: &PenaltySettings<S, impl Fn(usize) -> Material<S>, impl Fn(usize) -> S>,
    marbles: &mut SolverBodies<S>,
    forces: &[ContactForce<S>],
    start: &[[Vec3<S>; 2]],
) {
    let mut done = vec![false; marbles.velocity.len()];
    for (ContactForce { contact, .. }, start) in forces.iter().zip(start) {
        for (row, start) in [contact.a, Some(contact.b)].into_iter().zip(start) {
            let Some(row) = row.filter(|row| !std::mem::replace(&mut done[*row], true)) else {
                continue;
            };
            let displacement =
                (marbles.velocity[row] - *start) * (settings.position_weight)(row) * settings.dt;
            if is_finite(displacement) {
                marbles.position[row] += displacement;
            }
        }
    }
}

/// Sets the factors of each contact by mass splitting.
fn split_masses<S: Scalar>(marbles: &SolverBodies<S>, forces: &mut [ContactForce<S>], dt: S) {
    let mut loads = vec![ContactLoad::none(); marbles.velocity.len()];
    for ContactForce { contact, springs, half_damping, .. } in forces.iter() {
        let load = ContactLoad::of(contact, springs, dt, *half_damping);
        contact.a.into_iter().chain([contact.b]).for_each(|row| loads[row].add(&load));
    }
    for force in forces {
        let contact = &force.contact;
        let alone = contact.inverse_effective_mass();
        let of = |row: Option<usize>| row.map_or(ContactLoad::none(), |row| loads[row]);
        let [a, b] = [of(contact.a), of(Some(contact.b))];
        let [first, second] = contact.inverse_effective_masses;
        let fraction = |counts: [S; 2]| {
            let split = first.scaled(counts[0]).plus(second.scaled(counts[1]));
            (alone.normal / split.normal).min(alone.tangent / split.tangent)
        };
        force.spring_scale = fraction([a.spring_split(), b.spring_split()]);
        force.dashpot_scale = fraction([a.dashpot_split(), b.dashpot_split()]);
        force.counts = [a.count, b.count];
        force.shared_inverse_mass = first.normal * a.count + second.normal * b.count;
    }
}

impl<S: Scalar> ContactForce<S> {
    fn new(
        settings: &PenaltySettings<S, impl Fn(usize) -> Material<S>, impl Fn(usize) -> S>,
        index: usize,
        contact: PenaltyContact<S>,
        before: &[SpringHistory<S>],
    ) -> Self {
        let dt = settings.dt;
        let separation_speed = contact.relative_velocity.dot(contact.normal);
        let known = before.binary_search_by_key(&contact.key, |history| history.key);
        let history = known.map(|at| before[at]);
        let mut springs = settings.law.springs(&contact, contact.penetration, dt);
        let (mut damped_time, mut tangent_displacement) = (S::one(), Vec3::zero());
        if history.is_err() && separation_speed < S::zero() {
            // New contact: the dashpot acts since the contact began, after the last kick, and for
            // half of the time to the next one, at half of the penetration of then.
            let substep = -separation_speed * dt;
            damped_time = S::from_f64(0.5) + (contact.penetration / substep).min(S::one());
            let middle =
                settings.law.springs(&contact, damped_time * substep * S::from_f64(0.5), dt);
            (springs.damping, springs.tangent_damping) = (middle.damping, middle.tangent_damping);
            tangent_displacement = contact.relative_velocity.reject_from(contact.normal)
                * (contact.penetration / -separation_speed).min(dt);
        }
        if contact.material.friction == S::zero() {
            (springs.tangent_stiffness, springs.tangent_damping) = (S::zero(), S::zero());
        }
        // Half of the step by the velocity before, half by that after; a dashpot stops motion, but
        // never reverses it.
        let half = S::from_f64(0.5) * dt;
        let inverse_effective_mass = contact.inverse_effective_mass();
        let half_damping = [
            springs.damping * inverse_effective_mass.normal * half * damped_time,
            springs.tangent_damping * inverse_effective_mass.tangent * half * damped_time,
        ]
        .map(|damping| damping.min(S::one()));
        let history = history.unwrap_or(SpringHistory {
            key: contact.key,
            normal: contact.normal,
            penetration: contact.penetration,
            tangent_displacement,
            tangent_stiffness: S::zero(),
            stored_energy: S::zero(),
            separation_speed,
        });
        let (zero, none) = (S::zero(), Vec3::zero());
        Self {
            index,
            contact,
            springs,
            half_damping,
            history,
            spring_scale: S::one(),
            dashpot_scale: S::one(),
            counts: [zero; 2],
            shared_inverse_mass: zero,
            spring_impulse: zero,
            normal_impulse: zero,
            impulse: none,
            angular_impulse: none,
        }
    }

    /// Solves for the impulses of a substep of `dt` seconds.
    fn solve(&mut self, dt: S) {
        let PenaltyContact { normal, relative_velocity, material, .. } = self.contact;
        let separation_speed = relative_velocity.dot(normal);
        [self.spring_impulse, self.normal_impulse] =
            self.normal_impulses(self.springs.elastic_force, separation_speed, dt);
        let tangent_velocity = relative_velocity - normal * separation_speed;
        let limit = material.friction * self.normal_impulse;
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
        let tangent_impulse = (-spring_and_dashpot).clamp_length(limit);
        self.history.tangent_displacement =
            if is_finite(tangent_displacement) { tangent_displacement } else { Vec3::zero() };
        self.history.tangent_stiffness = tangent_stiffness;
        self.impulse = normal * self.normal_impulse + tangent_impulse;
    }

    /// Solves for the angular impulse of rolling and torsional friction.
    fn solve_rolling(&mut self, marbles: &SolverBodies<S>) {
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
        let mean_speed = (self.history.separation_speed + separation_speed) * S::from_f64(0.5);
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
    fn apply_rolling(&self, marbles: &mut SolverBodies<S>, work: Option<&mut EnergyLedger>) {
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

    /// Penetration at the next kick, in metres.
    fn next_penetration(&self, dt: S, separation_speed: S) -> S {
        self.contact.penetration - separation_speed * dt
    }

    /// Tells if the contact will have ended by the next substep although its spring still pushes.
    fn ends(
        &self,
        settings: &PenaltySettings<S, impl Fn(usize) -> Material<S>, impl Fn(usize) -> S>,
        marbles: &SolverBodies<S>,
        separation_speed: S,
    ) -> bool {
        let ahead = |row: usize| marbles.velocity[row] * (settings.position_weight)(row);
        let first = self.contact.a.map_or_else(Vec3::zero, ahead);
        let displacement = (ahead(self.contact.b) - first).dot(self.contact.normal) * settings.dt;
        let next = self.next_penetration(settings.dt, separation_speed);
        next > S::zero() && next - displacement <= S::zero()
    }

    /// Applies the last impulse of an ending contact.
    fn apply_last_impulse(
        &mut self,
        settings: &PenaltySettings<S, impl Fn(usize) -> Material<S>, impl Fn(usize) -> S>,
        marbles: &mut SolverBodies<S>,
        separation_speed: S,
        work: Option<&mut EnergyLedger>,
    ) {
        let fraction =
            self.next_penetration(settings.dt, separation_speed) / self.contact.penetration;
        let elastic_force = self.springs.elastic_force * fraction;
        let [_, normal_impulse] =
            self.normal_impulses(elastic_force, separation_speed, settings.dt);
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
    fn next_history(&self, dt: S, velocity: Vec3<S>) -> Option<SpringHistory<S>> {
        let normal = self.contact.normal;
        let separation_speed = velocity.dot(normal);
        let mean_speed = (self.history.separation_speed + separation_speed) * S::from_f64(0.5);
        let stored_energy =
            (self.history.stored_energy - self.spring_impulse * mean_speed).max(S::zero());
        let tangent_displacement =
            self.history.tangent_displacement + velocity.reject_from(normal) * dt;
        let history = SpringHistory {
            normal,
            penetration: self.next_penetration(dt, separation_speed),
            tangent_displacement,
            stored_energy,
            separation_speed,
            ..self.history
        };
        let known = history.penetration.is_finite()
            && history.stored_energy.is_finite()
            && history.separation_speed.is_finite();
        (known && history.tangent_stiffness.is_finite() && is_finite(tangent_displacement))
            .then_some(history)
    }
}
