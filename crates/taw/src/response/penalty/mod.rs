//! Forces that grow with the overlap.
//!
//! All forces of a substep are those of one moment: of the places where a step that ends in a
//! kick would have the marbles, which for every integrator makes it symplectic. So a marble
//! that lies has no velocity, and the oscillation of contacts is stable as long as their
//! stiffness and damping are below what [`force_scale`] sees to (multiply the equation of motion by
//! the mean velocity, and what is left is a sum of squares that only dashpots change).

mod law;
mod mass_split;
#[cfg(test)]
mod tests;

pub use law::ContactLaw;

use cgmath::{InnerSpace, Zero};

use crate::contact::Contacts;
use crate::math::{Scalar, Vec3, cast_vector, direction_and_length, is_finite};
use crate::response::impact::clamp_length;
use crate::response::impulse::BodyA;
use crate::response::material::Compliance;
use crate::response::{
    Colliders, EnergyLedger, ImpulseSample, InverseEffectiveMass, Material, SolverBodies,
};
use law::Springs;
use mass_split::ContactLoad;

/// What a contact remembers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SpringHistory<S> {
    key: SpringKey,
    /// How far its two points were displaced against each other across the normal while they
    /// held, in metres, and how stiff that was, in N/m.
    tangent_displacement: Vec3<S>,
    tangent_stiffness: S,
    /// What its spring took and has not given back, in joules.
    stored_energy: S,
    /// How fast its two points parted along the normal at the end of the substep, in m/s.
    separation_speed: S,
}

impl<S> SpringHistory<S> {
    /// The rows of its marbles.
    pub fn rows(&self) -> [Option<usize>; 2] {
        let (two_marbles, a, b, ..) = self.key;
        [two_marbles.then_some(a as usize), Some(b as usize)]
    }
}

/// Names a contact: whether of two marbles, who, which part of a wall, which ends of capsules.
type SpringKey = (bool, u32, u32, u32, [i8; 2]);

/// What a substep of [`penalty`] goes by.
pub(crate) struct PenaltySettings<S, M, F> {
    pub law: ContactLaw,
    /// In seconds.
    pub dt: S,
    /// The material of a row.
    pub material: M,
    /// How far a change of a row's velocity has moved it, as a part of change times step.
    pub position_weight: F,
}

/// One touch: who, where, and how the two give way.
struct PenaltyContact<S> {
    key: SpringKey,
    /// None for a wall.
    a: Option<usize>,
    b: usize,
    /// How far along the axis of each.
    axis_offset: [S; 2],
    /// From a to b.
    normal: Vec3<S>,
    penetration: S,
    /// Of b's point relative to a's, and of the wall's surface, in m/s.
    relative_velocity: Vec3<S>,
    surface_velocity: Vec3<S>,
    /// How easily each gives way, a first.
    inverse_effective_masses: [InverseEffectiveMass<S>; 2],
    has_capsule: bool,
    /// The sum of the curvatures, in 1/m.
    curvature: S,
    material: Material<S>,
    /// How much the surfaces give way together.
    compliance: Compliance<S>,
}

/// A touch with what it does in this substep.
struct ContactForce<S> {
    contact: PenaltyContact<S>,
    springs: Springs<S>,
    /// Half of what the dashpots take of the velocity in a substep, along and across.
    half_damping: [S; 2],
    history: SpringHistory<S>,
    /// What is left of its forces, as a part, when all contacts share their marbles.
    force_scale: S,
    /// How easily the two give way along the normal if all contacts push as much, in 1/kg.
    shared_inverse_mass: S,
    /// Of the spring and of all, along the normal, and all, in N s.
    spring_impulse: S,
    normal_impulse: S,
    impulse: Vec3<S>,
    angular_impulse: Vec3<S>,
}

/// [`Response::Penalty`](super::Response::Penalty): forces that grow with the overlap change
/// velocities, and where these have moved marbles already, their places. `histories` is what
/// contacts remember.
///
/// The contacts' rows exist. Rows that end up infinite or NaN lose their velocity and are
/// added to `quarantined`.
pub(crate) fn apply_penalty_forces<S: Scalar>(
    settings: &PenaltySettings<S, impl Fn(usize) -> Material<S>, impl Fn(usize) -> S>,
    marbles: &mut SolverBodies<S>,
    contacts: &mut Contacts<S>,
    walls: &impl Colliders<S>,
    histories: &mut Vec<SpringHistory<S>>,
    quarantined: &mut Vec<u32>,
    mut work: Option<&mut EnergyLedger>,
) {
    contacts.sort();
    let before = std::mem::take(histories);
    let mut forces = Vec::with_capacity(contacts.len());
    let wm = contacts.wm.iter().map(|c| ((false, c.a, c.b, c.part), c.along));
    let mm = contacts.mm.iter().map(|c| ((true, c.a, c.b, 0), c.along));
    for (key, axis_offset) in wm.chain(mm) {
        if let Some(contact) = find_contact(settings, marbles, walls, key, axis_offset) {
            forces.push(ContactForce::new(settings, contact, &before));
        }
    }
    split_masses(marbles, &mut forces, settings.dt);
    let start: Vec<_> = forces.iter().map(|p| p.contact.velocities(marbles)).collect();
    // All forces are those of the same moment, whatever the order.
    for force in &mut forces {
        force.solve(settings.dt);
    }
    for force in &forces {
        force.apply(marbles, work.as_deref_mut());
    }
    update_positions(settings, marbles, &forces, &start);
    if let Some(work) = work.as_deref_mut() {
        for ContactForce { contact, impulse, .. } in &forces {
            contact.record_energy(marbles, *impulse, work);
        }
    }
    let separation_speeds: Vec<_> =
        forces.iter().map(|p| p.contact.separation_speed(marbles)).collect();
    let ending: Vec<_> = forces
        .iter()
        .zip(&separation_speeds)
        .map(|(force, separation_speed)| force.ends(settings, marbles, *separation_speed))
        .collect();
    for ((force, separation_speed), ends) in forces.iter_mut().zip(separation_speeds).zip(ending) {
        let Some(history) = force.next_history(separation_speed) else { continue };
        if ends {
            force.history = history;
            force.apply_last_impulse(settings, marbles, separation_speed, work.as_deref_mut());
        } else {
            histories.push(history);
        }
    }
    histories.sort_unstable_by_key(|history| history.key);
    for contact in contacts.wm.iter().chain(&contacts.mm) {
        quarantine_if_non_finite(marbles, contact.b, quarantined);
    }
    contacts
        .mm
        .iter()
        .for_each(|contact| quarantine_if_non_finite(marbles, contact.a, quarantined));
}

fn quarantine_if_non_finite<S: Scalar>(
    marbles: &mut SolverBodies<S>,
    row: u32,
    quarantined: &mut Vec<u32>,
) {
    let row_in = row as usize;
    let spin = marbles.spin.get(row_in).copied().unwrap_or_else(Vec3::zero);
    if is_finite(marbles.velocity[row_in]) && is_finite(spin) {
        return;
    }
    marbles.velocity[row_in] = Vec3::zero();
    if let Some(spin) = marbles.spin.get_mut(row_in) {
        *spin = Vec3::zero();
    }
    quarantined.push(row);
}

/// Moves marbles on by what forces have changed since their velocities moved them. Those of
/// `start` are from before.
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

/// Sees how much of a marble each of its contacts may have.
fn split_masses<S: Scalar>(marbles: &SolverBodies<S>, forces: &mut [ContactForce<S>], dt: S) {
    let mut loads = vec![ContactLoad::none(S::zero()); marbles.velocity.len()];
    for ContactForce { contact, springs, half_damping, .. } in forces.iter() {
        let load = ContactLoad::of(contact, springs, dt, *half_damping);
        contact.a.into_iter().chain([contact.b]).for_each(|row| loads[row].add(&load));
    }
    for force in forces {
        let contact = &force.contact;
        let alone = contact.inverse_effective_mass();
        let of = |row: Option<usize>| row.map_or(ContactLoad::none(S::zero()), |row| loads[row]);
        let [a, b] = [of(contact.a), of(Some(contact.b))];
        let [first, second] = contact.inverse_effective_masses;
        let split = first.scaled(a.split_count()).plus(second.scaled(b.split_count()));
        let fraction = |alone: S, split: S| alone / split;
        force.force_scale =
            fraction(alone.normal, split.normal).min(fraction(alone.tangent, split.tangent));
        force.shared_inverse_mass = first.normal * a.count + second.normal * b.count;
        force.angular_impulse = contact.rolling_impulse(marbles, [a.count, b.count]);
    }
}

fn find_contact<S: Scalar>(
    settings: &PenaltySettings<S, impl Fn(usize) -> Material<S>, impl Fn(usize) -> S>,
    marbles: &SolverBodies<S>,
    walls: &impl Colliders<S>,
    (two_marbles, a, b, part): (bool, u32, u32, u32),
    axis_offset: [S; 2],
) -> Option<PenaltyContact<S>> {
    // Which ends of capsules.
    let side = axis_offset.map(|x| if x > S::zero() { 2 } else { i8::from(x < S::zero()) });
    let key = (two_marbles, a, b, part, side);
    let (a, b) = (a as usize, b as usize);
    let anchor_position =
        |row: usize, axis_offset: S| marbles.position[row] + marbles.anchor(row, axis_offset);
    // How far it has been moved since the step's own kick would have found it; see this module's
    // head. Along the normal of now: that is the one that knows which touches are seams.
    let moved =
        |row: usize| marbles.velocity[row] * (settings.dt * (settings.position_weight)(row));
    let mut displacement = moved(b);
    let own = (settings.material)(b);
    let mut relative_velocity =
        marbles.velocity[b] + marbles.anchor_spin_velocity(b, axis_offset[1]);
    let mut radius_times_spin = marbles.radius_times_spin(b);
    let center = anchor_position(b, axis_offset[1]);
    let mut curvature = S::one() / marbles.radius[b];
    let mut compliance = own.elasticity.compliance();
    let mut surface_velocity = Vec3::zero();
    let (normal, distance, material);
    if two_marbles {
        let other = (settings.material)(a);
        displacement -= moved(a);
        let center_offset = marbles.period.nearest(center - anchor_position(a, axis_offset[0]));
        let direction = direction_and_length(center_offset);
        let (direction, centers) = direction.unwrap_or((Vec3::unit_x(), S::zero()));
        (normal, distance) = (direction, centers - marbles.radius[a]);
        relative_velocity -= marbles.velocity[a] + marbles.anchor_spin_velocity(a, axis_offset[0]);
        radius_times_spin += marbles.radius_times_spin(a);
        curvature += S::one() / marbles.radius[a];
        compliance = compliance.plus(other.elasticity.compliance());
        material = own.combined_with(other);
    } else {
        (normal, distance) = walls.normal_and_distance(a, part, center);
        surface_velocity = walls.surface_velocity(a, center - normal * marbles.radius[b]);
        relative_velocity -= surface_velocity;
        let its = walls.material(a);
        material = its.map_or(own, |its| own.combined_with(its));
        // A wall without a material of its own is rigid.
        if let Some(its) = its {
            compliance = compliance.plus(its.elasticity.compliance());
        }
    }
    let none = InverseEffectiveMass { normal: S::zero(), tangent: S::zero() };
    let first =
        if two_marbles { marbles.inverse_effective_mass(a, axis_offset[0], -normal) } else { none };
    let contact = PenaltyContact {
        key,
        a: two_marbles.then_some(a),
        b,
        axis_offset,
        normal,
        penetration: marbles.radius[b] - distance + displacement.dot(normal),
        relative_velocity: relative_velocity + normal.cross(radius_times_spin),
        surface_velocity,
        inverse_effective_masses: [
            first,
            marbles.inverse_effective_mass(b, axis_offset[1], normal),
        ],
        has_capsule: marbles.capsule(b).is_some() || two_marbles && marbles.capsule(a).is_some(),
        curvature,
        material,
        compliance,
    };
    let is_contact = marbles.radius[b] > distance && contact.penetration > S::zero();
    let is_contact = is_contact && contact.penetration.is_finite();
    (is_contact
        && contact.inverse_effective_mass().normal > S::zero()
        && is_finite(contact.relative_velocity))
    .then_some(contact)
}

impl<S: Scalar> PenaltyContact<S> {
    fn inverse_effective_mass(&self) -> InverseEffectiveMass<S> {
        self.inverse_effective_masses[0].plus(self.inverse_effective_masses[1])
    }

    fn velocities(&self, marbles: &SolverBodies<S>) -> [Vec3<S>; 2] {
        [self.a.map_or_else(Vec3::zero, |a| marbles.velocity[a]), marbles.velocity[self.b]]
    }

    /// How its two points move against each other now, in m/s.
    fn relative_velocity(&self, marbles: &SolverBodies<S>) -> Vec3<S> {
        let first = self.a.map_or(BodyA::Wall(0, 0), |a| BodyA::Marble(a as u32));
        marbles.relative_velocity(
            first,
            self.b,
            self.axis_offset,
            self.normal,
            self.surface_velocity,
        )
    }

    fn separation_speed(&self, marbles: &SolverBodies<S>) -> S {
        self.relative_velocity(marbles).dot(self.normal)
    }

    /// Counts what an impulse did, after all have.
    fn record_energy(&self, marbles: &SolverBodies<S>, impulse: Vec3<S>, work: &mut EnergyLedger) {
        let mean_velocity =
            cast_vector::<S, f64>(self.relative_velocity + self.relative_velocity(marbles)) * 0.5;
        self.record_impulse(marbles, impulse, mean_velocity, work);
        work.collisions += 1;
    }

    fn record_impulse(
        &self,
        marbles: &SolverBodies<S>,
        impulse: Vec3<S>,
        mean_velocity: Vec3<f64>,
        work: &mut EnergyLedger,
    ) {
        let surface_velocity = Some(cast_vector(self.surface_velocity));
        let fixed_velocity = [
            self.a.map_or(surface_velocity, |a| marbles.fixed_velocity(a)),
            marbles.fixed_velocity(self.b),
        ];
        let (impulse, normal) = (cast_vector(impulse), cast_vector(self.normal));
        work.record_impulse(ImpulseSample { impulse, normal, mean_velocity, fixed_velocity });
    }

    fn apply_impulse(&self, marbles: &mut SolverBodies<S>, impulse: Vec3<S>) {
        let [first, second] = self.axis_offset;
        for (row, impulse, normal, axis_offset) in
            [(Some(self.b), impulse, self.normal, second), (self.a, -impulse, -self.normal, first)]
        {
            let Some(row) = row else { continue };
            marbles.apply_impulse(row, impulse * marbles.inverse_mass[row], normal, axis_offset);
        }
    }

    /// The angular impulse that would end that the two turn against each other, in kg m²/s, if
    /// each is shared by so many contacts; nothing where nothing resists.
    fn rolling_impulse(&self, marbles: &SolverBodies<S>, counts: [S; 2]) -> Vec3<S> {
        let Material { rolling_resistance, spinning_resistance, .. } = self.material;
        if rolling_resistance == S::zero() && spinning_resistance == S::zero() {
            return Vec3::zero();
        }
        let mut inverse_inertia = marbles.inverse_inertia(self.b) * counts[1];
        if let Some(a) = self.a {
            inverse_inertia += marbles.inverse_inertia(a) * counts[0];
        }
        if inverse_inertia > S::zero() {
            self.relative_spin(marbles) / inverse_inertia
        } else {
            Vec3::zero()
        }
    }

    /// How the second turns against the first, in rad/s.
    fn relative_spin(&self, marbles: &SolverBodies<S>) -> Vec3<S> {
        let first = self.a.map_or_else(Vec3::zero, |a| marbles.unlocked_spin(a));
        marbles.unlocked_spin(self.b) - first
    }
}

impl<S: Scalar> ContactForce<S> {
    fn new(
        settings: &PenaltySettings<S, impl Fn(usize) -> Material<S>, impl Fn(usize) -> S>,
        contact: PenaltyContact<S>,
        before: &[SpringHistory<S>],
    ) -> Self {
        let dt = settings.dt;
        let separation_speed = contact.relative_velocity.dot(contact.normal);
        let index = before.binary_search_by_key(&contact.key, |history| history.key);
        let history = index.map(|at| before[at]);
        let mut springs = settings.law.springs(&contact, contact.penetration, dt);
        let mut damped_time = S::one();
        if history.is_err() && separation_speed < S::zero() {
            // It came into touch after the last kick; that and half of the time until the next
            // is how long it has been damped, at half of the overlap of then.
            let substep = -separation_speed * dt;
            damped_time = S::constant(0.5) + (contact.penetration / substep).min(S::one());
            let middle =
                settings.law.springs(&contact, damped_time * substep * S::constant(0.5), dt);
            (springs.damping, springs.tangent_damping) = (middle.damping, middle.tangent_damping);
        }
        // A half of the step by the velocity before, a half by that after; a dashpot stops,
        // and turns nothing back.
        let half = S::constant(0.5) * dt;
        let inverse_effective_mass = contact.inverse_effective_mass();
        let half_damping = [
            springs.damping * inverse_effective_mass.normal * half * damped_time,
            springs.tangent_damping * inverse_effective_mass.tangent * half * damped_time,
        ]
        .map(|damping| damping.min(S::one()));
        let history = history.unwrap_or(SpringHistory {
            key: contact.key,
            tangent_displacement: Vec3::zero(),
            tangent_stiffness: S::zero(),
            stored_energy: S::zero(),
            separation_speed,
        });
        let (zero, none) = (S::zero(), Vec3::zero());
        Self {
            contact,
            springs,
            half_damping,
            history,
            force_scale: S::one(),
            shared_inverse_mass: zero,
            spring_impulse: zero,
            normal_impulse: zero,
            impulse: none,
            angular_impulse: none,
        }
    }

    /// Sees what it pushes in a substep of `dt` seconds.
    fn solve(&mut self, dt: S) {
        let PenaltyContact { normal, relative_velocity, material, curvature, .. } = self.contact;
        let separation_speed = relative_velocity.dot(normal);
        [self.spring_impulse, self.normal_impulse] =
            self.normal_impulses(self.springs.elastic_force, separation_speed, dt);
        let tangent_velocity = relative_velocity - normal * separation_speed;
        let limit = material.friction * self.normal_impulse;
        // The plane of touch has turned since; the stretch turns along.
        let previous = self.history.tangent_displacement;
        let mut tangent_displacement = previous - normal * previous.dot(normal);
        let tangent_stiffness = self.springs.tangent_stiffness * self.force_scale;
        if tangent_stiffness > self.history.tangent_stiffness
            && self.history.tangent_stiffness > S::zero()
        {
            // A spring that gets stiffer keeps its force, or it would give more than it took.
            tangent_displacement *= self.history.tangent_stiffness / tangent_stiffness;
        }
        tangent_displacement += tangent_velocity * dt;
        let half_damping = self.half_damping[1];
        let impulse_per_displacement = tangent_stiffness * dt / (S::one() + half_damping);
        if impulse_per_displacement > S::zero() {
            // The spring stretches no further than friction holds.
            tangent_displacement =
                clamp_length(tangent_displacement, limit / impulse_per_displacement);
        }
        let dashpot = S::constant(2.0) * half_damping * self.force_scale
            / self.contact.inverse_effective_mass().tangent;
        let tangent_impulse = clamp_length(
            -(tangent_displacement * impulse_per_displacement
                + tangent_velocity * (dashpot / (S::one() + half_damping))),
            limit,
        );
        self.history.tangent_displacement =
            if is_finite(tangent_displacement) { tangent_displacement } else { Vec3::zero() };
        self.history.tangent_stiffness = tangent_stiffness;
        self.impulse = normal * self.normal_impulse + tangent_impulse;
        let (wanted_angular_impulse, lever) =
            (self.angular_impulse, self.normal_impulse / curvature);
        let torsional = normal * wanted_angular_impulse.dot(normal);
        self.angular_impulse =
            clamp_length(wanted_angular_impulse - torsional, material.rolling_resistance * lever)
                + clamp_length(torsional, material.spinning_resistance * lever);
    }

    /// What spring and dashpot push in a substep, of that the spring, and both; in N s.
    fn normal_impulses(&self, elastic_force: S, separation_speed: S, dt: S) -> [S; 2] {
        let [half_damping, _] = self.half_damping;
        let fraction = self.force_scale / (S::one() + half_damping);
        let dashpot =
            S::constant(2.0) * half_damping / self.contact.inverse_effective_mass().normal;
        let dashpot_impulse = -dashpot * separation_speed * fraction;
        let slowed_speed =
            separation_speed + self.shared_inverse_mass * dashpot_impulse.max(S::zero());
        let spring_impulse =
            (elastic_force * dt * fraction).min(self.max_spring_impulse(slowed_speed));
        [spring_impulse, (spring_impulse + dashpot_impulse).max(S::zero())]
    }

    /// How much the spring may push: no more than it has taken, whatever made it as stiff or
    /// as deep as it is; an overlap that it did not stop itself parts slowly.
    fn max_spring_impulse(&self, separation_speed: S) -> S {
        let inverse_mass = self.shared_inverse_mass;
        let mean_speed = (self.history.separation_speed + separation_speed) * S::constant(0.5);
        let stored_energy = self.history.stored_energy.max(S::zero());
        let releasable =
            (mean_speed * mean_speed + inverse_mass * stored_energy * S::constant(2.0)).sqrt()
                - mean_speed;
        releasable.max(self.max_push_speed() - separation_speed).max(S::zero()) / inverse_mass
    }

    /// How fast an overlap parts that no approach made: a radius in a second, in m/s.
    fn max_push_speed(&self) -> S {
        self.contact.curvature.recip()
    }

    fn apply(&self, marbles: &mut SolverBodies<S>, work: Option<&mut EnergyLedger>) {
        self.contact.apply_impulse(marbles, self.impulse);
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

    /// The overlap of the next kick, in metres.
    fn next_penetration(&self, dt: S, separation_speed: S) -> S {
        self.contact.penetration - separation_speed * dt
    }

    /// Whether the next substep will not find it in touch, though there it has something left
    /// to push.
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

    /// Gives the last push of a contact that ends.
    fn apply_last_impulse(
        &self,
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
        if let Some(work) = work {
            let mean_velocity =
                cast_vector::<S, f64>(before + self.contact.relative_velocity(marbles)) * 0.5;
            self.contact.record_impulse(marbles, impulse, mean_velocity, work);
        }
    }

    /// What it knows in the next substep, if that is a number.
    fn next_history(&self, separation_speed: S) -> Option<SpringHistory<S>> {
        let mean_speed = (self.history.separation_speed + separation_speed) * S::constant(0.5);
        let stored_energy =
            (self.history.stored_energy - self.spring_impulse * mean_speed).max(S::zero());
        let history = SpringHistory { stored_energy, separation_speed, ..self.history };
        let known = history.stored_energy.is_finite() && history.separation_speed.is_finite();
        (known && history.tangent_stiffness.is_finite()).then_some(history)
    }
}
