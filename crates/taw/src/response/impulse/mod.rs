//! The impulse method, which [`Response::Impulse`](super::Response::Impulse) is, and which holds
//! heaps for [`Response::EventDriven`](super::Response::EventDriven).

mod energy_guard;
mod islands;
mod positions;
mod prepare;
mod solve;

use cgmath::{InnerSpace, Zero};

use crate::contact::{Contact, Contacts};
use crate::math::{
    Mat3, Point3, Scalar, Vec3, any_direction, cast_vector, direction_and_length, is_finite,
};
use crate::response::{
    BallRotation, EnergyLedger, ImpulseSample, InverseEffectiveMass, Material, SolverBodies,
};
use energy_guard::{FullRestitution, IslandEnergy};
pub(super) use islands::UnionFind;
use islands::{DIRECTIONS, Islands};
use prepare::prepare;
use solve::iterate;

/// What the solver is told, besides columns and contacts.
pub(crate) struct Context<'a, S, W, M, F> {
    pub walls: &'a W,
    /// Gives the material of a marble, by row.
    pub material: M,
    /// How far the position of a row follows a change of its velocity in this substep, in
    /// substeps.
    pub position_weight: F,
    pub start: SubstepStart<'a, S>,
    pub settings: &'a SolverSettings<S>,
}

/// Where marbles were before the substep, and how they moved. Empty where nobody knows.
#[derive(Clone, Copy)]
pub(crate) struct SubstepStart<'a, S> {
    pub position: &'a [Point3<S>],
    /// Before forces changed it, in m/s.
    pub velocity: &'a [Vec3<S>],
    /// For rows that were stopped within the substep, the part of a change of velocity that their
    /// positions still follow, per substep; empty if none was.
    pub ccd_stops: &'a [Option<Mat3<S>>],
}

pub(crate) struct SolverSettings<S> {
    /// The most sweeps over all contacts.
    pub iterations: u32,
    /// The length of the substep, in seconds; zero for a collision that takes no time.
    pub dt: S,
    /// Slower than this, in m/s, nothing bounces: what gravity does in two substeps.
    pub restitution_threshold: S,
    /// Sweeps end where the last one changed no velocity by more than this, in m/s.
    pub tolerance: S,
    /// The overlap that may stay, in metres, so that what rests keeps touching.
    pub slop: S,
    /// The same as a part of the smaller radius, at most.
    pub max_relative_slop: S,
}

/// The first thing of a contact, by row.
#[derive(Clone, Copy, Debug)]
pub(super) enum BodyA {
    /// And a part of it.
    Wall(u32, u32),
    Marble(u32),
}

impl BodyA {
    /// All contacts, those with walls first.
    pub(super) fn of_each<S>(contacts: &Contacts<S>) -> impl Iterator<Item = (Self, &Contact<S>)> {
        let wm = contacts.wm.iter().map(|c| (Self::Wall(c.a, c.part), c));
        wm.chain(contacts.mm.iter().map(|c| (Self::Marble(c.a), c)))
    }

    pub(super) fn marble(self) -> Option<usize> {
        match self {
            Self::Wall(..) => None,
            Self::Marble(row) => Some(row as usize),
        }
    }
}

/// What the method only scribbles on.
#[derive(Clone, Debug, Default)]
pub(crate) struct Scratch<S> {
    initial_velocity: Vec<Vec3<S>>,
    constraints: Vec<Constraint<S>>,
    islands: Islands<S>,
    energies: Vec<IslandEnergy<S>>,
    full_restitution: Vec<FullRestitution<S>>,
    separations: Vec<S>,
}

impl<S: Scalar> Scratch<S> {
    /// By how much a velocity still changed in the last sweep, at most, in m/s.
    pub fn residual(&self) -> S {
        self.islands.residual()
    }

    /// Number of times that a contact was solved, over all sweeps.
    pub fn solve_count(&self) -> u64 {
        self.islands.solve_count
    }

    /// Gives the energy that each wall, and each marble of infinite mass, brought to a row by how
    /// it moves, in joules.
    pub fn for_each_supplied_energy(
        &self,
        velocity: &[Vec3<S>],
        inverse_mass: &[S],
        mut visit: impl FnMut(usize, S),
    ) {
        for c in &self.constraints {
            let impulse = c.impulse() / c.inverse_effective_mass.normal;
            match c.a {
                BodyA::Wall(..) => visit(c.b, impulse.dot(c.surface_velocity)),
                BodyA::Marble(a) => {
                    let (a, b) = (a as usize, c.b);
                    for (one, other, impulse) in [(a, b, impulse), (b, a, -impulse)] {
                        if inverse_mass[one] == S::zero() {
                            visit(other, impulse.dot(velocity[one]));
                        }
                    }
                }
            }
        }
    }

    /// Counts what the contacts of the last substep did. `velocity` and `spin` are those at its
    /// beginning: what rests has none there, and then no contact works on it. What bounces does
    /// so at one moment, when the forces of the substep have done their part.
    pub fn record_energy(
        &self,
        marbles: &mut SolverBodies<S>,
        velocity: &mut [Vec3<S>],
        spin: &mut [Vec3<S>],
        work: &mut EnergyLedger,
    ) {
        if velocity.len() != marbles.velocity.len() || spin.len() < marbles.spin.len() {
            return; // the first step with an account of it
        }
        let spins = marbles.spin.len();
        let relative_motions = |marbles: &SolverBodies<S>| -> Vec<_> {
            let relative_motion = |c: &Constraint<S>| marbles.relative_motion(c);
            self.constraints.iter().map(relative_motion).collect()
        };
        let after = relative_motions(marbles);
        marbles.velocity.swap_with_slice(velocity);
        marbles.spin.swap_with_slice(&mut spin[..spins]);
        let before = relative_motions(marbles);
        marbles.velocity.swap_with_slice(velocity);
        marbles.spin.swap_with_slice(&mut spin[..spins]);
        for ((c, after), before) in self.constraints.iter().zip(after).zip(before) {
            let relative_velocity =
                if c.bounces { cast_vector(c.initial_relative_velocity) } else { before[0] };
            let first = match c.a {
                BodyA::Wall(..) => Some(cast_vector(c.surface_velocity)),
                BodyA::Marble(a) => marbles.fixed_velocity(a as usize),
            };
            work.record_impulse(ImpulseSample {
                impulse: cast_vector::<S, f64>(c.impulse())
                    / c.inverse_effective_mass.normal.as_f64(),
                normal: cast_vector(c.normal),
                mean_velocity: (relative_velocity + after[0]) * 0.5,
                fixed_velocity: [first, marbles.fixed_velocity(c.b)],
            });
            work.record_angular_impulse(cast_vector(c.angular_impulse()), before[1], after[1]);
            work.collisions += u32::from(c.bounces && c.normal_impulse > S::zero());
        }
    }
}

/// A contact while it is solved.
#[derive(Clone, Copy, Debug)]
pub(super) struct Constraint<S> {
    a: BodyA,
    b: usize,
    /// How far along the axis of each it is touched.
    axis_offset: [S; 2],
    /// Which island it is of.
    island: u32,
    /// From a to b.
    normal: Vec3<S>,
    /// The velocity of the wall's surface, in m/s; zero between marbles.
    surface_velocity: Vec3<S>,
    inverse_effective_mass: InverseEffectiveMass<S>,
    restitution: S,
    /// How friction is bounded: by this part of the pressure, and by so much, in m/s.
    friction: S,
    friction_bound: S,
    /// The relative velocity of the two points before, in m/s, and how they turn against each
    /// other, in rad/s.
    initial_relative_velocity: Vec3<S>,
    initial_relative_spin: Vec3<S>,
    bounces: bool,
    /// The time since it bounced, in seconds, for which positions follow; none if that is for
    /// as long as the integrator says.
    time_since_impact: Option<S>,
    /// The relative velocity that forces have given since the bounce, counted as the integrator
    /// counts, in m/s.
    velocity_since_impact: Vec3<S>,
    /// The relative velocity of the two points that is asked for: along the normal at
    /// least this, across it this if friction suffices.
    target_normal_velocity: S,
    target_tangent_velocity: Vec3<S>,
    /// The impulse that was applied so far, times the mobility along the normal: in
    /// m/s, which a pebble and a boulder have in common.
    normal_impulse: S,
    tangent_impulse: Vec3<S>,
    /// The least that the pressure may be.
    min_normal_impulse: S,
    /// Directions of the search, as impulses: the last sweep and the ways before; the relative velocity
    /// that each gives, in m/s; and the change of velocity asked for where the search began, in m/s.
    search_directions: [Vec3<S>; DIRECTIONS],
    direction_velocities: [Vec3<S>; DIRECTIONS],
    velocity_error: Vec3<S>,
    rolling: Option<RollingConstraint<S>>,
}

/// What resists rolling and spinning in a contact.
#[derive(Clone, Copy, Debug)]
struct RollingConstraint<S> {
    /// The largest torque over the normal force, about the touching plane and about the
    /// normal, in metres.
    rolling_lever: S,
    torsional_lever: S,
    /// The change of the relative spin per angular impulse, in 1/(kg m²).
    inverse_inertia: S,
    /// The angular impulse that was applied so far, in kg m²/s.
    angular_impulse: Vec3<S>,
}

/// Names a contact: walls first, then by rows.
pub(super) type ContactKey = (bool, usize, usize, u32, [i8; 2]);

/// What a contact needed in the last substep, which is a good guess for this one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct CachedImpulse<S> {
    key: ContactKey,
    normal_impulse: S,
    tangent_impulse: Vec3<S>,
    angular_impulse: Vec3<S>,
}

/// The name of a contact.
pub(super) fn contact_key<S: Scalar>(a: BodyA, b: usize, axis_offset: [S; 2]) -> ContactKey {
    let zero = S::zero();
    // Which ends of capsules; one of them is often touched twice.
    let side = axis_offset.map(|offset| if offset > zero { 2 } else { i8::from(offset < zero) });
    match a {
        BodyA::Wall(wall, part) => (false, wall as usize, b, part, side),
        BodyA::Marble(a) => (true, a as usize, b, 0, side),
    }
}

impl<S: Scalar> CachedImpulse<S> {
    /// Warm start of a contact without friction, from its normal impulse as a change of speed, in m/s.
    pub(super) fn of_normal_impulse(key: ContactKey, normal_impulse: S) -> Self {
        Self { key, normal_impulse, tangent_impulse: Vec3::zero(), angular_impulse: Vec3::zero() }
    }

    pub(super) fn key(&self) -> ContactKey {
        self.key
    }

    pub(super) fn normal_impulse(&self) -> S {
        self.normal_impulse
    }
}

impl<S> CachedImpulse<S> {
    /// Calls its marbles by other names. False if one of them has none.
    pub fn remap(&mut self, map_row: impl Fn(usize) -> Option<usize>) -> bool {
        let (two_marbles, a, b, part, side) = self.key;
        let a = if two_marbles { map_row(a) } else { Some(a) };
        let (Some(a), Some(b)) = (a, map_row(b)) else { return false };
        self.key = (two_marbles, a, b, part, side);
        true
    }
}

impl<S: Scalar> Constraint<S> {
    fn key(&self) -> ContactKey {
        contact_key(self.a, self.b, self.axis_offset)
    }

    /// All that it applied, times the mobility along the normal, in m/s.
    fn impulse(&self) -> Vec3<S> {
        self.normal * self.normal_impulse + self.tangent_impulse
    }

    /// The angular impulse that it applied besides, in kg m²/s.
    fn angular_impulse(&self) -> Vec3<S> {
        self.rolling.map_or_else(Vec3::zero, |rolling| rolling.angular_impulse)
    }
}

/// [`Response::Impulse`](super::Response::Impulse): sequential impulses (Catto,
/// *Iterative dynamics with temporal coherence*, 2005) with the friction of a cone,
/// not of a pyramid, bounded by the accumulated normal impulse, restitution included.
///
/// The contacts' rows exist. Rows that end up infinite or NaN lose their velocity and are
/// added to `quarantined`.
pub(crate) fn solve_contacts<S: Scalar>(
    marbles: &mut SolverBodies<S>,
    contacts: &mut Contacts<S>,
    context: &Context<S, impl Colliders<S>, impl Fn(usize) -> Material<S>, impl Fn(usize) -> S>,
    scratch: &mut Scratch<S>,
    cache: &mut Vec<CachedImpulse<S>>,
    quarantined: &mut Vec<u32>,
) {
    contacts.sort();
    let settings = context.settings;
    let Scratch { initial_velocity, constraints, islands, energies, full_restitution, separations } =
        scratch;
    initial_velocity.clear();
    initial_velocity.extend_from_slice(marbles.velocity);
    prepare(marbles, contacts, context, constraints, islands);
    marbles.warm_start(constraints, cache);
    marbles.limit_warm_start(constraints, islands, energies);
    iterate(marbles, constraints, islands, settings);
    marbles.limit_energy(constraints, islands, energies, full_restitution, settings);
    marbles.update_positions(initial_velocity, constraints, context);
    marbles.solve_positions(constraints, context, separations);
    store_impulses(constraints, cache);
    marbles.quarantine_non_finite(constraints, quarantined);
}

/// Keeps what the contacts bore for the next substep.
fn store_impulses<S: Scalar>(constraints: &[Constraint<S>], cache: &mut Vec<CachedImpulse<S>>) {
    cache.clear();
    cache.extend(constraints.iter().map(|c| CachedImpulse {
        key: c.key(),
        normal_impulse: c.normal_impulse,
        tangent_impulse: c.tangent_impulse,
        angular_impulse: c.angular_impulse(),
    }));
    cache.sort_unstable_by_key(|entry| entry.key);
}

/// What the solver asks of walls, by row.
pub(crate) trait Colliders<S> {
    /// The normal of a part of the wall, and how far a point is in front of it.
    fn normal_and_distance(&self, wall: usize, part: u32, point: Point3<S>) -> (Vec3<S>, S);
    /// The same when the step began, for walls that were elsewhere then.
    fn normal_and_distance_at_start(
        &self,
        wall: usize,
        part: u32,
        point: Point3<S>,
    ) -> (Vec3<S>, S) {
        self.normal_and_distance(wall, part, point)
    }
    /// How its surface moves at a point, in m/s.
    fn surface_velocity(&self, wall: usize, point: Point3<S>) -> Vec3<S>;
    /// Its own material, if it has one.
    fn material(&self, wall: usize) -> Option<Material<S>>;
}

/// Walls as they were when the step began.
struct WallsAtStart<'a, W>(&'a W);

impl<S, W: Colliders<S>> Colliders<S> for WallsAtStart<'_, W> {
    fn normal_and_distance(&self, wall: usize, part: u32, point: Point3<S>) -> (Vec3<S>, S) {
        self.0.normal_and_distance_at_start(wall, part, point)
    }

    fn surface_velocity(&self, wall: usize, point: Point3<S>) -> Vec3<S> {
        self.0.surface_velocity(wall, point)
    }

    fn material(&self, wall: usize) -> Option<Material<S>> {
        self.0.material(wall)
    }
}

impl<S: Scalar> SolverBodies<'_, S> {
    /// The unit vector from the first to the second of a contact, and how far their
    /// surfaces are apart (negative for an overlap). Coincident centers part any way, each pair
    /// its own.
    /// None where the column of positions is empty, or for a gap that is not finite.
    pub(super) fn normal_and_separation(
        &self,
        position: &[Point3<S>],
        a: BodyA,
        b: usize,
        axis_offset: [S; 2],
        walls: &impl Colliders<S>,
    ) -> Option<(Vec3<S>, S)> {
        let second = *position.get(b)? + self.anchor(b, axis_offset[1]);
        let (normal, distance) = match a {
            BodyA::Wall(wall, part) => walls.normal_and_distance(wall as usize, part, second),
            BodyA::Marble(a) => {
                let a = a as usize;
                let first = *position.get(a)? + self.anchor(a, axis_offset[0]);
                let direction = direction_and_length(self.period.nearest(second - first));
                let (normal, distance) =
                    direction.unwrap_or_else(|| (any_direction(a as u32, b as u32), S::zero()));
                (normal, distance - self.radius[a])
            }
        };
        let separation = distance - self.radius[b];
        separation.is_finite().then_some((normal, separation))
    }

    /// How easily the two of a contact give way.
    fn pair_inverse_effective_mass(
        &self,
        a: BodyA,
        b: usize,
        axis_offset: [S; 2],
        normal: Vec3<S>,
    ) -> InverseEffectiveMass<S> {
        if self.capsules.is_empty() {
            let first = a.marble().map_or((S::zero(), BallRotation::Locked), |a| {
                (self.inverse_mass[a], self.ball_rotation(a))
            });
            return InverseEffectiveMass::of([
                first,
                (self.inverse_mass[b], self.ball_rotation(b)),
            ]);
        }
        let second = self.inverse_effective_mass(b, axis_offset[1], normal);
        a.marble().map_or(second, |a| {
            second.plus(self.inverse_effective_mass(a, axis_offset[0], -normal))
        })
    }

    /// The velocity of the second's touching point relative to the first's, in m/s.
    pub(super) fn relative_velocity(
        &self,
        a: BodyA,
        b: usize,
        axis_offset: [S; 2],
        normal: Vec3<S>,
        surface_velocity: Vec3<S>,
    ) -> Vec3<S> {
        let mut velocity = self.velocity[b] - surface_velocity;
        let mut radius_times_spin = self.radius_times_spin(b);
        if let Some(a) = a.marble() {
            velocity -= self.velocity[a];
            radius_times_spin += self.radius_times_spin(a);
        }
        if !self.capsules.is_empty() {
            velocity += self.anchor_spin_velocity(b, axis_offset[1]);
            if let Some(a) = a.marble() {
                velocity -= self.anchor_spin_velocity(a, axis_offset[0]);
            }
        }
        velocity + normal.cross(radius_times_spin)
    }

    /// How the second of a contact moves and turns against the first, in m/s and rad/s.
    fn relative_motion(&self, c: &Constraint<S>) -> [Vec3<f64>; 2] {
        let first = c.a.marble().map_or_else(Vec3::zero, |a| self.unlocked_spin(a));
        let relative_velocity =
            self.relative_velocity(c.a, c.b, c.axis_offset, c.normal, c.surface_velocity);
        [cast_vector(relative_velocity), cast_vector(self.unlocked_spin(c.b) - first)]
    }

    /// The velocity of what nothing can move.
    pub(super) fn fixed_velocity(&self, row: usize) -> Option<Vec3<f64>> {
        let is_fixed = self.inverse_mass[row] == S::zero();
        is_fixed.then(|| cast_vector(self.velocity[row]))
    }

    /// What resists rolling and spinning between two, or a wall and one, if anything does.
    fn rolling_constraint(
        &self,
        a: BodyA,
        b: usize,
        material: Material<S>,
    ) -> Option<RollingConstraint<S>> {
        let Material { rolling_resistance, spinning_resistance, .. } = material;
        let is_zero = rolling_resistance == S::zero() && spinning_resistance == S::zero();
        if is_zero {
            return None;
        }
        let inverse_inertia = |row: usize| self.inverse_inertia(row);
        let (radius, inverse_inertia) = match a {
            BodyA::Wall(..) => (self.radius[b], inverse_inertia(b)),
            BodyA::Marble(a) => {
                let a = a as usize;
                let (r, s) = (self.radius[a], self.radius[b]);
                (r * s / (r + s), inverse_inertia(a) + inverse_inertia(b))
            }
        };
        (inverse_inertia > S::zero()).then(|| RollingConstraint {
            rolling_lever: rolling_resistance * radius,
            torsional_lever: spinning_resistance * radius,
            inverse_inertia,
            angular_impulse: Vec3::zero(),
        })
    }

    /// Takes the velocity of what became infinite or NaN, and names it.
    fn quarantine_non_finite(&mut self, constraints: &[Constraint<S>], quarantined: &mut Vec<u32>) {
        for row in constraints.iter().flat_map(|c| [Some(c.b), c.a.marble()]).flatten() {
            if !is_finite(self.velocity[row]) {
                self.velocity[row] = Vec3::zero();
                quarantined.push(row as u32);
            }
        }
    }

    /// Begins with what the contacts bore in the last substep. What bounces had nothing to
    /// bear before.
    fn warm_start(&mut self, constraints: &mut [Constraint<S>], cache: &[CachedImpulse<S>]) {
        for c in constraints.iter_mut().filter(|c| !c.bounces) {
            let Ok(at) = cache.binary_search_by_key(&c.key(), |entry| entry.key) else { continue };
            let CachedImpulse { normal_impulse, tangent_impulse, angular_impulse, .. } = cache[at];
            c.normal_impulse = normal_impulse;
            c.tangent_impulse = tangent_impulse - c.normal * tangent_impulse.dot(c.normal);
            self.apply_impulse_pair(c, c.impulse());
            if let Some(rolling) = &mut c.rolling {
                rolling.angular_impulse = angular_impulse;
                self.apply_angular_impulse_pair(c, angular_impulse);
            }
        }
    }

    /// Applies an angular impulse to the second of a contact, its opposite to the first.
    fn apply_angular_impulse_pair(&mut self, c: &Constraint<S>, angular_impulse: Vec3<S>) {
        self.apply_angular_impulse(c.b, angular_impulse);
        if let Some(a) = c.a.marble() {
            self.apply_angular_impulse(a, -angular_impulse);
        }
    }

    /// Applies an impulse to the second of a contact, and its opposite to the first;
    /// `impulse_speed` is the impulse times the mobility along the normal.
    fn apply_impulse_pair(&mut self, c: &Constraint<S>, impulse_speed: Vec3<S>) {
        // The impulse itself, of a pebble, may be too small for the scalar.
        let fraction = |row: usize| self.inverse_mass[row] / c.inverse_effective_mass.normal;
        let second = impulse_speed * fraction(c.b);
        if let Some(a) = c.a.marble() {
            let first = -impulse_speed * fraction(a);
            self.apply_impulse(a, first, -c.normal, c.axis_offset[0]);
        }
        self.apply_impulse(c.b, second, c.normal, c.axis_offset[1]);
    }
}
