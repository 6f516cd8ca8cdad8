//! Balls that touch each other, as columns that the impulse method solves.

use cgmath::InnerSpace;

use super::wall::MovingWalls;
use super::{Ball, EventSettings, PRESS_SPEED, REST_SPEED, SLOP};
use crate::broad::Period;
use crate::contact::Contacts;
use crate::math::{Point3, Vec3};
use crate::response::impulse::{
    self, CachedImpulse, Context, SubstepStart, UnionFind, solve_contacts,
};
use crate::response::{BallRotation, EnergyLedger, Material, SolverBodies};

/// A heap agrees where a sweep changes no velocity by more than this part of what gravity does in
/// a substep: a hundredth of what counts as rest.
const TOLERANCE: f64 = 0.01 * REST_SPEED;
/// Or by more than this part of its largest speed, where nothing pulls: a hundred roundings.
const ROUNDING: f64 = 100.0 * f64::EPSILON;
/// Whatever the model's iterations, a heap is swept until it agrees, or for as long as no more
/// contacts are solved than this, all sweeps together: half a millisecond. What a heap of few
/// leaves undecided costs more, as events.
const MAX_SOLVES: usize = 4_000;
/// And no more often than this, which is the most that a model may have.
const MAX_ITERATIONS: u32 = 1000;

/// Balls that rest on each other, as the impulse method sees them.
#[derive(Clone, Debug, Default)]
pub(super) struct Cluster {
    /// Whose turn it is: the balls' rows, in order.
    pub rows: Vec<u32>,
    /// Where in `rows` a ball is.
    pub local: Vec<u32>,
    /// Number of things that each ball touches.
    pub contact_counts: Vec<u32>,
    pub bodies: ClusterBodies,
    /// Where each was before the step.
    pub start: Vec<Point3<f64>>,
    pub material: Vec<Material<f64>>,
    /// Who touches whom, over how many others.
    pub sets: UnionFind,
    pub scratch: impulse::Scratch<f64>,
}

/// The balls of a heap, a column for each property.
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
            capsules: &[],
        }
    }
}

impl Cluster {
    /// Takes over those balls that the contacts are about, and names them by their place
    /// here.
    pub fn gather(&mut self, contacts: &mut Contacts<f64>, balls: &[Ball], period: Period<f64>) {
        self.bodies.period = period;
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
        fill(&mut bodies.spin, each().map(|b| b.spin));
        fill(&mut bodies.radius, each().map(|b| b.radius));
        fill(
            &mut bodies.inverse_mass,
            each().map(|b| if b.is_frozen() { 0.0 } else { b.inverse_mass }),
        );
        fill(&mut self.material, each().map(|b| b.material));
        fill(&mut bodies.rotation_locked, each().map(|b| b.rotation == BallRotation::Locked));
    }

    /// The speed, in m/s, below which those that come together agree.
    pub fn tolerance(&self, acceleration: f64, settings: &EventSettings) -> f64 {
        let max_speed = self.bodies.velocity.iter().map(|v| v.magnitude()).fold(0.0, f64::max);
        (TOLERANCE * acceleration * settings.dt).max(ROUNDING * max_speed)
    }

    /// Solves the contacts over `dt` seconds, or with zero what happens at once.
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
            // As deep as a gap may be wide that counts as touching.
            slop: 0.5 * PRESS_SPEED * PRESS_SPEED * acceleration * settings.dt * settings.dt,
            max_relative_slop: SLOP,
        };
        let mut quarantined = Vec::new(); // whoever it is will be stopped at the end, too
        let context = Context {
            walls,
            material: |local: usize| self.material[local],
            position_weight: |_| 0.5,
            start: SubstepStart { position: &self.start, velocity: &[], ccd_stops: &[] },
            settings: &settings_,
        };
        solve_contacts(
            &mut self.bodies.columns(),
            contacts,
            &context,
            &mut self.scratch,
            impulse_cache,
            &mut quarantined,
        );
        settings.add_cost(2 * self.scratch.solve_count());
    }

    /// Counts what contacts did at once, to balls that moved and turned so before.
    pub fn record_energy(
        &mut self,
        velocity: &mut [Vec3<f64>],
        spin: &mut [Vec3<f64>],
        work: &mut EnergyLedger,
    ) {
        let collisions = work.collisions;
        self.scratch.record_energy(&mut self.bodies.columns(), velocity, spin, work);
        work.collisions = collisions; // it is none: they lie there
    }
}

/// Sets a column.
fn fill<T>(column: &mut Vec<T>, values: impl Iterator<Item = T>) {
    column.clear();
    column.extend(values);
}
