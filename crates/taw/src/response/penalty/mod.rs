//! Penalty method: contact forces that grow with penetration.
//!
//! All forces of a substep are evaluated at the positions that a step ending in a kick would have,
//! which makes every integrator symplectic. So a resting marble has no velocity, and the
//! oscillation of contacts is stable as long as stiffness and damping stay below the limit of
//! [`mass_split`] (multiply the equation of motion by the mean velocity: only dashpots change the
//! remaining sum of squares).

mod contact;
mod force;
mod law;
mod mass_split;
mod parting;
#[cfg(test)]
mod tests;

pub use law::ContactLaw;

use cgmath::{InnerSpace, Zero};

use crate::contact::Contacts;
use crate::math::{RealVector, Scalar, Vec3, is_finite};
use crate::response::impulse::{BodyA, Context, SolverSettings};
use crate::response::{Colliders, ContactKey, EnergyLedger, KeyedByContact, SolverBodies};
use force::ContactForce;
use mass_split::ContactLoad;
use parting::depths_in_walls;

/// Contact history: state of a contact's springs from the last substep.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SpringHistory<S> {
    key: ContactKey,
    /// Unit normal, and penetration at the position of the next kick, in metres.
    normal: Vec3<S>,
    penetration: S,
    /// Part of the penetration that no motion of the two brought about, in metres.
    overlap: S,
    /// Set once the spring has pushed for the last time: if the two still overlap in the next substep, they
    /// did not come together in it.
    ended: bool,
    /// Tangential displacement of the two points while they stick, in metres, at the position of the
    /// next kick, and its stiffness, in N/m.
    tangent_displacement: Vec3<S>,
    tangent_stiffness: S,
    /// Energy stored in the normal spring, in joules.
    stored_energy: S,
    /// Velocity of b relative to a at the end of the substep, without the spins of balls, in m/s.
    velocity: Vec3<S>,
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
        self.velocity = -self.velocity;
    }
}

/// Penalty method in a substep, by its settings.
pub(crate) struct PenaltySettings<'a, S, W, F> {
    pub law: ContactLaw,
    pub context: Context<'a, S, W, F>,
    /// Stop of each row at walls by continuous detection; empty if it stopped none.
    pub wall_stops: &'a [Option<WallStop<S>>],
}

/// Radius of the rigid core that continuous detection stops at a wall, over that of the marble; and
/// how far from the wall, of that, it may be left: the time of impact is right to 1e-5.
pub(crate) const CORE: f64 = 0.5;
pub(crate) const CORE_ROUNDING: f64 = 1e-3;

/// Stop of a marble at walls by continuous detection.
#[derive(Clone, Copy, Debug)]
pub(crate) struct WallStop<S> {
    /// Index of the wall of the last stop.
    pub wall: u32,
    /// Displacement that it lost, and that since the last stop over the wall there, in metres.
    pub lost: Vec3<S>,
    pub since: Vec3<S>,
    /// Fraction of the substep since then.
    pub fraction: S,
}

/// Scratch buffers, kept for their memory.
#[derive(Clone, Debug, Default)]
pub(crate) struct PenaltyScratch<S> {
    before: Vec<SpringHistory<S>>,
    forces: Vec<ContactForce<S>>,
    loads: Vec<ContactLoad<S>>,
    /// Rows whose positions have followed their velocity changes.
    followed: Vec<bool>,
    /// Displacements that part what overlaps, in metres.
    pushes: Vec<Vec3<S>>,
    /// Deepest penetration of each marble into a wall at the last kick, in metres.
    depths: Vec<S>,
}

impl<S, W, F> PenaltySettings<'_, S, W, F>
where
    S: Scalar,
    W: Colliders<S>,
    F: Fn(usize) -> S,
{
    /// Applies penalty forces: they change velocities, and positions by what the integrator moved too
    /// early. `histories` is the contact history.
    ///
    /// The contacts' rows exist. Rows that end up infinite or NaN lose their velocity and are added to
    /// `quarantined`.
    pub(crate) fn apply(
        &self,
        marbles: &mut SolverBodies<S>,
        contacts: &mut Contacts<S>,
        histories: &mut Vec<SpringHistory<S>>,
        scratch: &mut PenaltyScratch<S>,
        quarantined: &mut Vec<u32>,
        mut work: Option<&mut EnergyLedger>,
    ) {
        let PenaltyScratch { before, forces, loads, followed, pushes, depths } = scratch;
        std::mem::swap(before, histories);
        self.prepare(marbles, contacts, before, forces, depths);
        split_masses(marbles, forces, loads, self.context.settings.dt);
        self.solve(marbles, forces, work.as_deref_mut());
        self.bounce_cores(marbles, forces, work.as_deref_mut());
        self.update_positions(marbles, forces, followed);
        self.part_overlaps(marbles, forces, pushes);
        // After friction has turned the marbles: what it adds in a substep is resisted in the same one.
        solve_rolling(marbles, forces, work.as_deref_mut());
        self.store_histories(marbles, forces, histories, work);
        list_impulses(forces, contacts);
        quarantine_non_finite(marbles, contacts, quarantined);
    }

    /// Prepares a force per active contact, walls first.
    fn prepare(
        &self,
        marbles: &SolverBodies<S>,
        contacts: &mut Contacts<S>,
        before: &[SpringHistory<S>],
        forces: &mut Vec<ContactForce<S>>,
        depths: &mut Vec<S>,
    ) {
        self.keep_sides(marbles, contacts, before);
        forces.clear();
        depths_in_walls(before, marbles.position.len(), depths);
        for (index, (a, contact)) in BodyA::of_each(contacts).enumerate() {
            if let Some(contact) = self.active_contact(marbles, a, contact, before) {
                let initial_velocities = contact.velocities(marbles);
                let history = (before, &depths[..]);
                forces.push(self.contact_force(index, contact, initial_velocities, history));
            }
        }
    }

    /// Evaluates all forces at one time, so that their order does not matter, and applies them.
    fn solve(
        &self,
        marbles: &mut SolverBodies<S>,
        forces: &mut [ContactForce<S>],
        work: Option<&mut EnergyLedger>,
    ) {
        for force in forces.iter_mut() {
            force.solve(self.context.settings.dt);
        }
        for ContactForce { contact, impulse, .. } in forces.iter() {
            contact.apply_impulse(marbles, *impulse);
        }
        if let Some(work) = work {
            for ContactForce { contact, impulse, .. } in forces.iter() {
                contact.record_energy(marbles, *impulse, work);
            }
        }
    }

    /// Keeps marbles on the side of a wall from which they came: one that has sunk in beyond the middle
    /// of a thin wall is nearer to its other side, where it would be pushed out.
    fn keep_sides(
        &self,
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
            let moved = self.context.displacement_of(row, marbles.velocity[row]);
            contact.separation = moved.dot(contact.normal) - penetration;
        }
    }

    /// Keeps the histories of contacts, after the last impulse of those that end.
    fn store_histories(
        &self,
        marbles: &mut SolverBodies<S>,
        forces: &mut [ContactForce<S>],
        histories: &mut Vec<SpringHistory<S>>,
        mut work: Option<&mut EnergyLedger>,
    ) {
        histories.clear();
        for force in forces.iter_mut() {
            let contact = &force.contact;
            force.relative_velocity = contact.relative_velocity(marbles);
            force.velocity =
                contact.without_spin(contact.velocities(marbles), force.relative_velocity);
            force.ends = self.ends(force, marbles);
        }
        for force in forces {
            let Some(history) = force.next_history(self.context.settings.dt) else { continue };
            if force.ends {
                force.history = history;
                self.apply_last_impulse(force, marbles, work.as_deref_mut());
            }
            histories.push(SpringHistory { ended: force.ends, ..history });
        }
        histories.sort_unstable_by_key(|history| history.key);
    }

    /// Bounces the cores of marbles that continuous detection stopped at walls.
    fn bounce_cores(
        &self,
        marbles: &mut SolverBodies<S>,
        forces: &mut [ContactForce<S>],
        mut work: Option<&mut EnergyLedger>,
    ) {
        if self.wall_stops.is_empty() {
            return;
        }
        let SolverSettings { restitution_threshold, iterations, .. } = *self.context.settings;
        for force in forces.iter_mut() {
            force.find_rebound_speed(marbles, restitution_threshold);
        }
        for _ in 0..iterations {
            for force in forces.iter_mut() {
                force.push_core(marbles, work.as_deref_mut());
            }
        }
    }

    /// Moves marbles by their velocity changes, with the position weight.
    fn update_positions(
        &self,
        marbles: &mut SolverBodies<S>,
        forces: &[ContactForce<S>],
        followed: &mut Vec<bool>,
    ) {
        followed.clear();
        followed.resize(marbles.velocity.len(), false);
        if !self.wall_stops.is_empty() {
            self.leave_walls(marbles, forces, followed);
        }
        for ContactForce { contact, initial_velocities, .. } in forces {
            for (row, initial) in [contact.a, Some(contact.b)].into_iter().zip(initial_velocities) {
                let Some(row) = row.filter(|row| !std::mem::replace(&mut followed[*row], true))
                else {
                    continue;
                };
                let displacement = self.displacement_since(marbles, row, *initial);
                if is_finite(displacement) {
                    marbles.displace(row, displacement);
                }
            }
        }
    }

    /// Moves marbles that continuous detection stopped at walls: one whose core was pushed goes on from
    /// there by its velocity; one that springs alone made part from the wall was never stopped.
    fn leave_walls(
        &self,
        marbles: &mut SolverBodies<S>,
        forces: &[ContactForce<S>],
        followed: &mut [bool],
    ) {
        for is_pushed in [true, false] {
            for ContactForce { contact, initial_velocities, core_impulse, .. } in forces {
                let row = contact.b;
                let is_next = !followed[row] && (*core_impulse > S::zero()) == is_pushed;
                let stop = self.wall_stops.get(row).copied().flatten().filter(|_| is_next);
                let Some(stop) = stop else { continue };
                let is_parted = || {
                    matches!(contact.body_a, BodyA::Wall(wall, _) if wall == stop.wall)
                        && contact.relative_velocity(marbles).dot(contact.normal) >= S::zero()
                };
                let displacement = if is_pushed {
                    let velocity = marbles.velocity[row] - contact.surface_velocity;
                    velocity * (stop.fraction * self.context.settings.dt) - stop.since
                } else if is_parted() {
                    self.displacement_since(marbles, row, initial_velocities[1]) + stop.lost
                } else {
                    continue;
                };
                followed[row] = true;
                if is_finite(displacement) {
                    marbles.displace(row, displacement);
                }
            }
        }
    }

    /// Displacement of a row by the change of its velocity since `initial`, in metres.
    fn displacement_since(
        &self,
        marbles: &SolverBodies<S>,
        row: usize,
        initial: Vec3<S>,
    ) -> Vec3<S> {
        (marbles.velocity[row] - initial)
            * ((self.context.position_weight)(row) * self.context.settings.dt)
    }
}

/// Lists the impulses in their contacts, and the normals along which they acted.
fn list_impulses<S: Scalar>(forces: &[ContactForce<S>], contacts: &mut Contacts<S>) {
    for ContactForce { index, normal_impulse, impulse, contact, .. } in forces {
        let Some(listed) = contacts.get_mut(*index) else { continue };
        listed.normal = contact.normal;
        listed.set_impulse(*normal_impulse, impulse.reject_from(contact.normal));
    }
}

/// Solves and applies rolling and torsional friction.
fn solve_rolling<S: Scalar>(
    marbles: &mut SolverBodies<S>,
    forces: &mut [ContactForce<S>],
    mut work: Option<&mut EnergyLedger>,
) {
    for force in forces.iter_mut() {
        force.solve_rolling(marbles);
    }
    for force in forces.iter() {
        force.apply_rolling(marbles, work.as_deref_mut());
    }
}

/// Zeroes velocities and spins that are infinite or NaN, and lists their rows.
fn quarantine_non_finite<S: Scalar>(
    marbles: &mut SolverBodies<S>,
    contacts: &Contacts<S>,
    quarantined: &mut Vec<u32>,
) {
    let Contacts { wm, mm, .. } = contacts;
    let second = wm.iter().chain(mm).map(|contact| contact.b);
    for row in second.chain(mm.iter().map(|contact| contact.a)) {
        let index = row as usize;
        let spin = marbles.spin.get(index).copied().unwrap_or_else(Vec3::zero);
        if is_finite(marbles.velocity[index]) && is_finite(spin) {
            continue;
        }
        marbles.velocity[index] = Vec3::zero();
        if let Some(spin) = marbles.spin.get_mut(index) {
            *spin = Vec3::zero();
        }
        quarantined.push(row);
    }
}

/// Sets the factors of each contact by mass splitting.
fn split_masses<S: Scalar>(
    marbles: &SolverBodies<S>,
    forces: &mut [ContactForce<S>],
    loads: &mut Vec<ContactLoad<S>>,
    dt: S,
) {
    loads.clear();
    loads.resize(marbles.velocity.len(), ContactLoad::none());
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
