//! Sequential impulses: the solver of [`Response::Impulse`](super::Response::Impulse), of the resting
//! clusters of [`Response::EventDriven`](super::Response::EventDriven), and of the contacts that a pass of
//! [`Response::SoftStep`](super::Response::SoftStep) leaves unconverged.

mod cache;
mod contact;
mod energy_guard;
mod islands;
mod jam;
mod positions;
mod prepare;
mod rows;
mod solve;
mod velocities;

use cgmath::{InnerSpace, Zero};

use crate::constraint::{ContactImpulse, FrictionCone};
use crate::contact::{Contact, Contacts};
use crate::math::{Mat3, Point3, Scalar, Vec3, cast_vector};
use crate::response::{
    ContactKey, EnergyLedger, ImpulseSample, InverseEffectiveMass, SolverBodies,
};
pub(crate) use cache::CachedImpulse;
use cache::store_impulses;
use energy_guard::{FullRestitution, IslandEnergy};
use islands::Islands;
use prepare::prepare;
use rows::Rows;
use solve::iterate;
pub(crate) use velocities::{VelocityContact, solve_velocities};

/// Solver input besides bodies and contacts.
pub(crate) struct Context<'a, S, W, F> {
    pub walls: &'a W,
    /// Position weight of a velocity change: fraction of the substep for which the position of a
    /// row follows it.
    pub position_weight: F,
    pub start: SubstepStart<'a, S>,
    pub settings: &'a SolverSettings<S>,
}

/// Positions and velocities at the start of the substep. Empty where unknown.
#[derive(Clone, Copy)]
pub(crate) struct SubstepStart<'a, S> {
    pub position: &'a [Point3<S>],
    /// Velocities before forces changed them, in m/s.
    pub velocity: &'a [Vec3<S>],
    /// Fraction of a velocity change that the position of a row still follows per substep, as a
    /// matrix, where continuous collision detection stopped the row; empty if it stopped none.
    pub ccd_stops: &'a [Option<Mat3<S>>],
}

pub(crate) struct SolverSettings<S> {
    /// Maximum number of iterations over all contacts.
    pub iterations: u32,
    /// Length of the substep, in seconds; zero for an instantaneous collision.
    pub dt: S,
    /// Restitution threshold: no bounce below this approach speed, in m/s.
    pub restitution_threshold: S,
    /// Convergence tolerance: iterations end where the last one changed no velocity by more, in
    /// m/s.
    pub tolerance: S,
    /// Allowed penetration, in metres, so that resting contacts persist.
    pub slop: S,
    /// Allowed penetration over the smaller radius, at most.
    pub max_relative_slop: S,
    /// Largest distance by which marbles push each other apart in a substep, over the radius of the one
    /// that moves: its center stays where its contacts with walls are known.
    pub max_relative_push: S,
    /// Acceleration that says where the [top](crate::constraint::tipped) of a marble is, in m/s²; zero where
    /// none matters.
    pub gravity: Vec3<S>,
    /// Number of threads that solve islands, if there are many contacts.
    pub threads: usize,
    /// True to resolve jams; false where the caller does, which tries the walls' motion first.
    pub resolve_jams: bool,
}

/// First body of a contact, by row.
#[derive(Clone, Copy, Debug)]
pub(super) enum BodyA {
    /// Wall and sub-shape.
    Wall(u32, u32),
    Marble(u32),
}

impl BodyA {
    /// Iterates over all contacts, walls first.
    pub(super) fn of_each<S>(contacts: &Contacts<S>) -> impl Iterator<Item = (Self, &Contact<S>)> {
        let wm = contacts.wm.iter().map(|c| (Self::Wall(c.a, c.part), c));
        wm.chain(contacts.mm.iter().map(|c| (Self::Marble(c.a), c)))
    }

    pub(super) fn contact_key<S: Scalar>(self, contact: &Contact<S>) -> ContactKey {
        match self {
            Self::Wall(..) => ContactKey::with_wall(contact),
            Self::Marble(_) => ContactKey::between_marbles(contact),
        }
    }

    pub(super) fn marble(self) -> Option<usize> {
        match self {
            Self::Wall(..) => None,
            Self::Marble(row) => Some(row as usize),
        }
    }
}

/// Scratch buffers, kept for their memory.
#[derive(Clone, Debug, Default)]
pub(crate) struct ImpulseScratch<S> {
    initial_velocity: Vec<Vec3<S>>,
    constraints: Vec<Constraint<S>>,
    islands: Islands<S>,
    rows: Rows<S>,
    energies: Vec<IslandEnergy<S>>,
    full_restitution: Vec<FullRestitution<S>>,
    separations: Vec<S>,
    uncorrected: Vec<Point3<S>>,
}

impl<S: Scalar> ImpulseScratch<S> {
    /// Largest velocity change in the last iteration, in m/s.
    pub fn residual(&self) -> S {
        self.islands.residual()
    }

    /// Number of contact solves, over all iterations.
    pub fn solve_count(&self) -> u64 {
        self.islands.solve_count()
    }

    /// Visits the energy that moving walls and marbles of infinite mass supplied to each row, in
    /// joules.
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

    /// Visits the pairs of marbles that press each other, by row.
    pub fn for_each_pressed_pair(&self, mut visit: impl FnMut(usize, usize)) {
        for c in self.constraints.iter().filter(|c| c.impulse.normal > S::zero()) {
            if let Some(a) = c.a.marble() {
                visit(a, c.b);
            }
        }
    }

    /// Books the energy of the last substep's contacts. `velocity` and `spin` are those at the
    /// start of the substep, so that a resting contact, whose velocity there is zero, does no work.
    /// A bounce counts at the time of impact, after the forces of the substep.
    pub fn record_energy(
        &self,
        marbles: &mut SolverBodies<S>,
        velocity: &mut [Vec3<S>],
        spin: &mut [Vec3<S>],
        work: &mut EnergyLedger,
    ) {
        if velocity.len() != marbles.velocity.len() || spin.len() < marbles.spin.len() {
            return; // first step of the audit
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
            work.collisions += u32::from(c.bounces && c.impulse.normal > S::zero());
        }
    }
}

/// Contact constraint: state of one contact point while it is solved.
#[derive(Clone, Copy, Debug)]
pub(super) struct Constraint<S> {
    a: BodyA,
    b: usize,
    key: ContactKey,
    /// Index of its contact, those with walls first.
    index: usize,
    /// Offset of the contact along the axis of each capsule, in metres.
    axis_offset: [S; 2],
    /// Index of its island.
    island: u32,
    /// Unit normal from a to b.
    normal: Vec3<S>,
    /// Lever arms, from the center of each body to the contact point, in metres.
    arms: [Vec3<S>; 2],
    /// Velocity of the wall's surface, in m/s; zero between marbles.
    surface_velocity: Vec3<S>,
    inverse_effective_mass: InverseEffectiveMass<S>,
    restitution: S,
    tangential_restitution: S,
    friction: S,
    /// Limits of the impulse, in m/s.
    cone: FrictionCone<S>,
    /// Largest normal impulse that the contact can bear, in m/s.
    max_normal_impulse: S,
    /// Relative velocity of the two points, in m/s, and relative spin, in rad/s, before any
    /// impulse.
    initial_relative_velocity: Vec3<S>,
    initial_relative_spin: Vec3<S>,
    bounces: bool,
    /// Time since the impact, in seconds, for which positions follow; none where the integrator's
    /// position weight counts.
    time_since_impact: Option<S>,
    /// Relative velocity gained from forces since the impact, as the integrator counts, in m/s.
    velocity_since_impact: Vec3<S>,
    /// Target relative velocity of the two points: a lower bound along the normal (velocity bias
    /// with restitution or separation), and the tangential target as far as friction suffices, in
    /// m/s.
    target_normal_velocity: S,
    target_tangent_velocity: Vec3<S>,
    /// Impulse accumulated in this substep, times the normal inverse effective mass: in m/s, a
    /// scale that a pebble and a boulder have in common.
    impulse: ContactImpulse<S>,
    rolling: Option<RollingConstraint<S>>,
}

/// Rolling and torsional friction of a contact.
#[derive(Clone, Copy, Debug)]
struct RollingConstraint<S> {
    /// Largest torque over the normal force, about the tangents and about the normal, in metres.
    rolling_lever: S,
    torsional_lever: S,
    /// Change of the relative spin per angular impulse, in 1/(kg m²).
    inverse_inertia: S,
    /// An angular impulse that changes the relative spin by `Δw` changes the relative velocity by
    /// `coupling · Δw × normal`; in metres.
    coupling: S,
    /// Inverse effective mass along the normal, over that along the tangents of bodies that do not
    /// roll on each other.
    blocked_ratio: S,
    /// Angular impulse accumulated in this substep, in kg m²/s.
    angular_impulse: Vec3<S>,
}

impl<S: Scalar> Constraint<S> {
    /// Accumulated impulse times the normal inverse effective mass, in m/s.
    fn impulse(&self) -> Vec3<S> {
        self.impulse.along(self.normal)
    }

    /// Accumulated angular impulse of rolling and torsional friction, in kg m²/s.
    fn angular_impulse(&self) -> Vec3<S> {
        self.rolling.map_or_else(Vec3::zero, |rolling| rolling.angular_impulse)
    }
}

/// Solves contacts by sequential impulses (Catto, *Iterative dynamics with temporal coherence*,
/// 2005) with an exact friction cone, not a pyramid, bounded by the accumulated normal impulse,
/// restitution included.
///
/// The contacts' rows exist. Rows that end up infinite or NaN lose their velocity and are added to
/// `quarantined`.
pub(crate) fn solve_contacts<S: Scalar>(
    marbles: &mut SolverBodies<S>,
    contacts: &mut Contacts<S>,
    context: &Context<S, impl Colliders<S>, impl Fn(usize) -> S>,
    scratch: &mut ImpulseScratch<S>,
    cache: &mut Vec<CachedImpulse<S>>,
    quarantined: &mut Vec<u32>,
) {
    let settings = context.settings;
    let ImpulseScratch {
        initial_velocity,
        constraints,
        islands,
        rows,
        energies,
        full_restitution,
        separations,
        uncorrected,
    } = scratch;
    initial_velocity.clear();
    initial_velocity.extend_from_slice(marbles.velocity);
    prepare(marbles, contacts, context, constraints, islands);
    if settings.resolve_jams {
        marbles.measure_loads(constraints, islands);
    }
    marbles.warm_start(constraints, cache);
    marbles.scale_warm_start(constraints, islands, energies);
    iterate(marbles, constraints, islands, rows, settings);
    marbles.limit_energy(constraints, islands, energies, full_restitution, rows, settings);
    if settings.resolve_jams {
        marbles.resolve_jams(constraints, islands, energies, rows, settings);
    }
    marbles.update_positions(initial_velocity, constraints, context);
    marbles.solve_positions(constraints, context, separations, uncorrected);
    store_impulses(constraints, contacts, cache);
    marbles.quarantine_non_finite(constraints, quarantined);
}

/// Wall geometry, by row, as the solver reads it.
pub(crate) trait Colliders<S> {
    /// Normal of a sub-shape at its point nearest to this one, and signed distance to it.
    fn normal_and_distance(&self, wall: usize, part: u32, point: Point3<S>) -> (Vec3<S>, S);
    /// Normal and distance at the start of the substep, for walls that move.
    fn normal_and_distance_at_start(
        &self,
        wall: usize,
        part: u32,
        point: Point3<S>,
    ) -> (Vec3<S>, S) {
        self.normal_and_distance(wall, part, point)
    }
    /// Velocity of the surface at a point with this normal, in m/s; tangential if the wall stays where
    /// it is, as a conveyor belt does.
    fn surface_velocity(&self, wall: usize, point: Point3<S>, normal: Vec3<S>) -> Vec3<S>;
}

/// Walls at the start of the substep.
struct WallsAtStart<'a, W>(&'a W);

impl<S, W: Colliders<S>> Colliders<S> for WallsAtStart<'_, W> {
    fn normal_and_distance(&self, wall: usize, part: u32, point: Point3<S>) -> (Vec3<S>, S) {
        self.0.normal_and_distance_at_start(wall, part, point)
    }

    fn surface_velocity(&self, wall: usize, point: Point3<S>, normal: Vec3<S>) -> Vec3<S> {
        self.0.surface_velocity(wall, point, normal)
    }
}
