//! Contact clusters: balls in contact, as columns that the impulse solver works on.

use cgmath::{InnerSpace, Zero};

use super::wall::{MovingWalls, Wall};
use super::{EventBall, EventSettings, PRESS_SPEED, REST_SPEED, SLOP};
use crate::broad::Period;
use crate::contact::Contacts;
use crate::math::{Point3, UnionFind, Vec3};
use crate::response::impulse::{self, CachedImpulse, Context, SubstepStart, solve_contacts};
use crate::response::{BallRotation, EnergyLedger, SolverBodies};
use crate::shape::BALL_INERTIA;

/// Convergence tolerance over the speed that gravity adds in a substep: a hundredth of the rest
/// threshold.
const TOLERANCE: f64 = 0.01 * REST_SPEED;
/// Convergence tolerance over the largest speed, for clusters without gravity: a hundred roundings.
const ROUNDING: f64 = 100.0 * f64::EPSILON;
/// Minimum budget of contact solves, over all iterations, whatever the model's iterations: half a
/// millisecond. Small clusters converge within it; unconverged contacts cost more, as events.
const MAX_SOLVES: usize = 4_000;
/// Maximum number of iterations, the same as for a model.
const MAX_ITERATIONS: u32 = 1000;

/// Cluster of balls in contact, as the impulse solver sees it.
#[derive(Clone, Debug, Default)]
pub(super) struct Cluster {
    /// Rows of the balls, sorted.
    pub rows: Vec<u32>,
    /// Local index of each ball, its place in `rows`.
    pub local: Vec<u32>,
    /// Number of contacts of each ball.
    pub contact_counts: Vec<u32>,
    pub bodies: ClusterBodies,
    /// Contacts where the balls are in the solve at hand.
    placed: Contacts<f64>,
    /// Positions at the start of the substep.
    pub start: Vec<Point3<f64>>,
    /// Connected components.
    pub sets: UnionFind,
    pub scratch: impulse::ImpulseScratch<f64>,
}

/// Columns of the cluster's balls.
#[derive(Clone, Debug, Default)]
pub(super) struct ClusterBodies {
    pub period: Period<f64>,
    pub position: Vec<Point3<f64>>,
    pub velocity: Vec<Vec3<f64>>,
    pub spin: Vec<Vec3<f64>>,
    radius: Vec<f64>,
    pub inverse_mass: Vec<f64>,
    rotation_locked: Vec<bool>,
}

impl ClusterBodies {
    fn columns(&mut self) -> SolverBodies<'_, f64> {
        SolverBodies {
            period: self.period,
            position: &mut self.position,
            velocity: &mut self.velocity,
            radius: &self.radius,
            inverse_mass: &self.inverse_mass,
            spin: &mut self.spin,
            rotation_locked: &self.rotation_locked,
            locked_axes: &[],
            capsules: &[],
        }
    }
}

impl Cluster {
    /// Gathers the balls of some contacts, gives these their materials, and renumbers them to local
    /// indices.
    pub fn gather(
        &mut self,
        contacts: &mut Contacts<f64>,
        (balls, walls): (&[EventBall], &[Wall]),
        period: Period<f64>,
    ) {
        self.bodies.period = period;
        let material = |row: u32| balls[row as usize].material;
        for c in &mut contacts.wm {
            c.material = walls[c.a as usize].combined_with(material(c.b));
        }
        for c in &mut contacts.mm {
            c.material = material(c.b).combined_with(material(c.a));
        }
        self.rows.clear();
        self.rows.extend(contacts.wm.iter().map(|c| c.b));
        self.rows.extend(contacts.mm.iter().flat_map(|c| [c.a, c.b]));
        self.rows.sort_unstable();
        self.rows.dedup();
        self.local.resize(balls.len(), 0);
        for (local, row) in self.rows.iter().enumerate() {
            self.local[*row as usize] = local as u32;
        }
        contacts.wm.iter_mut().for_each(|c| c.b = self.local[c.b as usize]);
        for c in &mut contacts.mm {
            (c.a, c.b) = (self.local[c.a as usize], self.local[c.b as usize]);
        }
        let (rows, bodies) = (&self.rows, &mut self.bodies);
        let each = || rows.iter().map(|row| &balls[*row as usize]);
        fill(&mut bodies.position, each().map(|b| b.position));
        fill(&mut self.start, each().map(|b| b.position));
        fill(&mut bodies.velocity, each().map(|b| b.velocity));
        // What is frozen stands still with its surface, which would drive the others without losing
        // anything, and between two that turn against each other a ball has no solution.
        let spin = |b: &EventBall| if b.is_frozen() { Vec3::zero() } else { b.spin };
        fill(&mut bodies.spin, each().map(spin));
        fill(&mut bodies.radius, each().map(|b| b.radius));
        fill(
            &mut bodies.inverse_mass,
            each().map(|b| if b.is_frozen() { 0.0 } else { b.inverse_mass }),
        );
        fill(&mut bodies.rotation_locked, each().map(|b| b.rotation == BallRotation::Locked));
    }

    /// Local index of a ball, if it is in the cluster.
    pub fn local_index(&self, row: usize) -> Option<usize> {
        let local = *self.local.get(row)? as usize;
        (self.rows.get(local).copied() == Some(row as u32)).then_some(local)
    }

    /// Largest acceleration of the balls by external forces, in m/s².
    pub fn max_acceleration(&self, balls: &[EventBall]) -> f64 {
        let of = |row: &u32| balls[*row as usize].external_acceleration.magnitude();
        self.rows.iter().map(of).fold(0.0, f64::max)
    }

    /// Convergence tolerance, in m/s. A surface that spins has the rounding of its speed, too.
    pub fn tolerance(&self, acceleration: f64, settings: &EventSettings) -> f64 {
        let ClusterBodies { velocity, spin, radius, rotation_locked, .. } = &self.bodies;
        let speed = |at: usize| {
            let arm = if rotation_locked[at] { 0.0 } else { radius[at] };
            velocity[at].magnitude() + spin[at].magnitude() * arm
        };
        let max_speed = (0..velocity.len()).map(speed).fold(0.0, f64::max);
        (TOLERANCE * acceleration * settings.dt).max(ROUNDING * max_speed)
    }

    /// Solves the contacts over `dt` seconds; zero for an instantaneous collision.
    pub fn solve(
        &mut self,
        contacts: &mut Contacts<f64>,
        walls: &MovingWalls,
        acceleration: f64,
        dt: f64,
        settings: &EventSettings,
        impulse_cache: &mut Vec<CachedImpulse<f64>>,
    ) {
        let iterations = (MAX_SOLVES / contacts.len().max(1)) as u32;
        let settings_ = impulse::SolverSettings {
            iterations: settings.iterations.max(iterations.min(MAX_ITERATIONS)),
            dt,
            restitution_threshold: 2.0 * acceleration * settings.dt,
            tolerance: self.tolerance(acceleration, settings),
            // As deep as the largest separation that counts as contact.
            slop: 0.5 * PRESS_SPEED * PRESS_SPEED * acceleration * settings.dt * settings.dt,
            max_relative_slop: SLOP,
            max_relative_push: f64::INFINITY,
            gravity: Vec3::zero(), // what rests does not tip
            threads: settings.threads,
            resolve_jams: false,
        };
        let mut quarantined = Vec::new(); // non-finite balls are quarantined after the substep
        let context = Context {
            walls,
            position_weight: |_| 0.5,
            start: SubstepStart { position: &self.start, velocity: &[], ccd_stops: &[] },
            settings: &settings_,
        };
        // In the order of the penetrations that the world found, at any time of the substep.
        contacts.sort();
        self.placed.clone_from(contacts);
        let mut bodies = self.bodies.columns();
        bodies.place_contacts(&mut self.placed, walls);
        solve_contacts(
            &mut bodies,
            &mut self.placed,
            &context,
            &mut self.scratch,
            impulse_cache,
            &mut quarantined,
        );
        settings.add_cost(2 * self.scratch.solve_count());
    }

    /// Twice the kinetic energy of the balls, in joules.
    pub fn kinetic_energy(&self) -> f64 {
        let ClusterBodies { velocity, spin, radius, inverse_mass, rotation_locked, .. } =
            &self.bodies;
        let of_ball = |at: usize| {
            let arm = if rotation_locked[at] { 0.0 } else { radius[at] };
            let turning = BALL_INERTIA * arm * arm * spin[at].magnitude2();
            (velocity[at].magnitude2() + turning) / inverse_mass[at]
        };
        (0..self.rows.len()).filter(|at| inverse_mass[*at] > 0.0).map(of_ball).sum()
    }

    /// Twice the kinetic energy of the balls if each moves with the fastest of the walls in contact,
    /// in joules. None if these are at rest.
    pub fn carried_energy(&self, contacts: &Contacts<f64>, walls: &MovingWalls) -> Option<f64> {
        let mut moving: Vec<_> = contacts.wm.iter().map(|c| c.a as usize).collect();
        moving.sort_unstable();
        moving.dedup();
        moving.retain(|wall| walls.walls[*wall].motion.is_some());
        if moving.is_empty() {
            return None;
        }
        let ClusterBodies { position, inverse_mass, .. } = &self.bodies;
        let of_ball = |at: usize| {
            let speed2 = |wall: &usize| walls.velocity_at(*wall, position[at]).magnitude2();
            let fastest = moving.iter().map(speed2).fold(0.0, f64::max);
            fastest / inverse_mass[at]
        };
        Some((0..self.rows.len()).filter(|at| inverse_mass[*at] > 0.0).map(of_ball).sum())
    }

    /// Books the energy of an instantaneous solve, with the velocities before it.
    pub fn record_energy(
        &mut self,
        velocity: &mut [Vec3<f64>],
        spin: &mut [Vec3<f64>],
        work: &mut EnergyLedger,
    ) {
        let collisions = work.collisions;
        self.scratch.record_energy(&mut self.bodies.columns(), velocity, spin, work);
        work.collisions = collisions; // resting contacts are no collisions
    }
}

/// Replaces a column.
fn fill<T>(column: &mut Vec<T>, values: impl Iterator<Item = T>) {
    column.clear();
    column.extend(values);
}
