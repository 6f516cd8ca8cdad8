//! Jams: contacts that cannot all be satisfied, because nothing stops a wall: a ball between two
//! walls that move against each other, or a row of balls. The solver would add to opposite impulses
//! in each pass without end, and the less their directions differ, the faster the balls would
//! escape to the side. So a contact bears no more than a momentum that its island can have, and an
//! island that got an energy that no wall explains finds the walls at rest, and overlaps.

use cgmath::{InnerSpace, Zero};

use super::energy_guard::IslandEnergy;
use super::islands::Islands;
use super::rows::Rows;
use super::{BodyA, Constraint, SolverSettings};
use crate::constraint::{ContactImpulse, FrictionCone};
use crate::math::{Scalar, Vec3};
use crate::response::{BallRotation, SolverBodies};

/// Largest impulse of a contact, over the momentum that the contacts of its island can exchange: the
/// mass of all times the largest relative velocity. Only a wedge makes a force larger than its
/// cause: one of `a` radians to each side, 1 / (2 a) times. In a wedge that makes a thousand times
/// as much, the penetration that is allowed, a thousandth of the radius, lets a ball sink by its
/// diameter; so a narrower one holds nothing.
const MAX_LEVERAGE: f64 = 1000.0;

/// Relative rounding of energies, in roundings of the scalar: that of 256 terms, if all are equally
/// wrong. A larger island that is taken for a jam by rounding is solved with its walls at rest: it keeps
/// its contacts, and lacks what they drive for a substep.
const ROUNDING: f64 = 256.0;

/// Masses and velocities of an island before its contacts act, in its units.
#[derive(Clone, Copy, Debug)]
pub(super) struct Load<S> {
    mass: S,
    /// Largest relative velocity at a contact, in m/s.
    relative_speed: S,
    /// Speed of the fastest wall or marble of infinite mass in contact, in units of the island.
    carrier_speed: S,
    /// Twice the kinetic energy.
    initial_energy: S,
    /// Twice the kinetic energy of translation after the contacts acted.
    energy: S,
}

impl<S: Scalar> Load<S> {
    pub fn none() -> Self {
        let zero = S::zero();
        Self {
            mass: zero,
            relative_speed: zero,
            carrier_speed: zero,
            initial_energy: zero,
            energy: zero,
        }
    }

    /// Tells if the contacts brought in more energy than walls that move alike could. Relative to
    /// these the energy does not grow, and the triangle inequality says by how much it may grow in
    /// the frame of the world. Without restitution the velocity ends on the sphere whose diameter is
    /// from the initial velocity to that of the walls, or inside, in the metric of kinetic energy
    /// (Moreau 1988): its square is at most the sum of the two.
    fn is_jammed(&self, bounces: bool) -> bool {
        let carried = self.mass * self.carrier_speed * self.carrier_speed;
        let max_energy = if bounces {
            let speed = self.initial_energy.sqrt() + carried.sqrt() * S::from_f64(2.0);
            speed * speed
        } else {
            self.initial_energy + carried
        };
        carried > S::zero()
            && self.energy > max_energy * (S::one() + S::epsilon() * S::from_f64(ROUNDING))
    }
}

impl<S: Scalar> Constraint<S> {
    /// Bounds an impulse by what the contact can bear.
    pub(super) fn saturate(&self, impulse: ContactImpulse<S>) -> ContactImpulse<S> {
        saturate(impulse, &self.cone, self.max_normal_impulse)
    }
}

/// Bounds an impulse within the cone by the largest normal impulse.
#[inline]
pub(super) fn saturate<S: Scalar>(
    impulse: ContactImpulse<S>,
    cone: &FrictionCone<S>,
    max_normal_impulse: S,
) -> ContactImpulse<S> {
    if impulse.normal > max_normal_impulse {
        cone.clamp(ContactImpulse { normal: max_normal_impulse, ..impulse })
    } else {
        impulse
    }
}

impl<S: Scalar> SolverBodies<'_, S> {
    /// Measures the islands before contacts act, and bounds the impulses by it.
    pub(super) fn measure_loads(
        &self,
        constraints: &mut [Constraint<S>],
        islands: &mut Islands<S>,
    ) {
        for c in constraints.iter() {
            let carrier_speed = self.carrier_velocity(c).magnitude();
            let island = islands.of_mut(c.island);
            let load = &mut island.load;
            load.relative_speed = load.relative_speed.max(c.initial_relative_velocity.magnitude());
            load.carrier_speed = load.carrier_speed.max(carrier_speed * island.inverse_speed_unit);
        }
        for row in 0..self.velocity.len() {
            let Some(island) = islands.of_row(row) else { continue };
            if self.inverse_mass[row] > S::zero() {
                let mass = island.inverse_mass_unit / self.inverse_mass[row];
                let (moving, turning) = self.energies_per_mass(row, island.inverse_speed_unit);
                island.load.mass += mass;
                island.load.initial_energy += (moving + turning) * mass;
            }
        }
        for c in constraints.iter_mut() {
            let island = islands.of(c.island);
            let mass = island.load.mass / island.inverse_mass_unit;
            let momentum = mass * c.inverse_effective_mass.normal * island.load.relative_speed;
            c.max_normal_impulse = momentum * S::from_f64(MAX_LEVERAGE);
        }
    }

    /// Solves jammed islands again, as if their walls were at rest: then they have a solution, and
    /// [normals before friction](Self::solve_normals_before_friction) can gain nothing.
    pub(super) fn resolve_jams(
        &mut self,
        constraints: &mut [Constraint<S>],
        islands: &mut Islands<S>,
        energies: &mut Vec<IslandEnergy<S>>,
        rows: &mut Rows<S>,
        settings: &SolverSettings<S>,
    ) {
        if islands.list.iter().all(|island| island.load.carrier_speed == S::zero()) {
            return;
        }
        for row in 0..self.velocity.len() {
            let Some(island) = islands.of_row(row) else { continue };
            if self.inverse_mass[row] > S::zero() {
                let mass = island.inverse_mass_unit / self.inverse_mass[row];
                let (moving, _) = self.energies_per_mass(row, island.inverse_speed_unit);
                island.load.energy += moving * mass;
            }
        }
        let jammed: Vec<_> =
            islands.list.iter().map(|island| island.load.is_jammed(island.bounces)).collect();
        if !jammed.contains(&true) {
            return;
        }
        for c in constraints.iter_mut().filter(|c| jammed[c.island as usize]) {
            self.add_impulse(c, -c.impulse());
            self.add_angular_impulse(c, -c.angular_impulse());
            self.hold_wall(c);
        }
        self.solve_normals_before_friction(constraints, islands, energies, &jammed, rows, settings);
        self.stop_approaches(constraints, islands);
    }

    /// Solves a contact as if its wall were at rest, and without restitution.
    fn hold_wall(&self, c: &mut Constraint<S>) {
        let carrier_velocity = self.carrier_velocity(c);
        let target = c.target_without_restitution() + carrier_velocity.dot(c.normal);
        c.target_normal_velocity = target.min(S::zero());
        c.target_tangent_velocity = Vec3::zero();
        c.bounces = false;
        c.initial_relative_velocity += carrier_velocity;
        c.impulse = ContactImpulse::zero();
        c.cone = FrictionCone::new(c.friction);
        c.surface_velocity -= carrier_velocity;
    }

    /// Velocity of the wall, or of the marble of infinite mass, at a contact, in m/s, with the sign by
    /// which the relative velocity lacks it to be that in the world. Zero between marbles that move
    /// freely.
    fn carrier_velocity(&self, c: &Constraint<S>) -> Vec3<S> {
        let fixed = |row: usize| self.inverse_mass[row] == S::zero();
        match c.a {
            BodyA::Wall(..) => c.surface_velocity,
            BodyA::Marble(a) if fixed(a as usize) => self.velocity[a as usize],
            BodyA::Marble(_) if fixed(c.b) => -self.velocity[c.b],
            BodyA::Marble(_) => Vec3::zero(),
        }
    }

    /// Twice the kinetic energy per mass of a row, of translation and of rotation, with speeds in
    /// units of an island.
    fn energies_per_mass(&self, row: usize, inverse_speed_unit: S) -> (S, S) {
        let moving = (self.velocity[row] * inverse_speed_unit).magnitude2();
        if self.ball_rotation(row) == BallRotation::Locked {
            return (moving, S::zero());
        }
        let spin = self.spin[row] * inverse_speed_unit;
        let inverse_inertia = self.ball_rotation(row).inverse_inertia_factor::<S>();
        let of_ball = (spin * self.radius[row]).magnitude2() / inverse_inertia;
        let turning = self.capsule(row).map_or(of_ball, |capsule| capsule.spin_energy(spin));
        (moving, turning)
    }
}
