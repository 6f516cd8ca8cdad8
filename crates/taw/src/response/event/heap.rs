//! Balls that touch each other, as columns that the impulse method solves.

use cgmath::InnerSpace;

use super::wall::Between;
use super::{Ball, PRESS, REST, SLOP, Settings};
use crate::broad::Period;
use crate::contact::Contacts;
use crate::math::{Point3, Vec3};
use crate::response::impulse::{self, Around, Groups, Start, Warm, impulse};
use crate::response::{BallSpin, Columns, Material, Work};

/// A heap agrees where a sweep changes no velocity by more than this part of what gravity does in
/// a substep: a hundredth of what counts as rest.
const AGREED: f64 = 0.01 * REST;
/// Or by more than this part of its largest speed, where nothing pulls: a hundred roundings.
const ROUNDING: f64 = 100.0 * f64::EPSILON;
/// Whatever the model's iterations, a heap is swept until it agrees, or for as long as no more
/// contacts are solved than this, all sweeps together: half a millisecond. What a heap of few
/// leaves undecided costs more, as events.
const MOST_SOLVED: usize = 4_000;
/// And no more often than this, which is the most that a model may have.
const MOST_SWEEPS: u32 = 1000;

/// Balls that rest on each other, as the impulse method sees them.
#[derive(Clone, Debug, Default)]
pub(super) struct Heap {
    /// Whose turn it is: the balls' rows, in order.
    pub rows: Vec<u32>,
    /// Where in `rows` a ball is.
    pub label: Vec<u32>,
    /// Number of things that each ball touches.
    pub touches: Vec<u32>,
    pub table: Table,
    /// Where each was before the step.
    pub start: Vec<Point3<f64>>,
    pub material: Vec<Material<f64>>,
    /// Who touches whom, over how many others.
    pub groups: Groups,
    pub scratch: impulse::Scratch<f64>,
}

/// The balls of a heap, a column for each property.
#[derive(Clone, Debug, Default)]
pub(super) struct Table {
    pub period: Period<f64>,
    pub position: Vec<Point3<f64>>,
    pub velocity: Vec<Vec3<f64>>,
    pub spin: Vec<Vec3<f64>>,
    radius: Vec<f64>,
    pub inverse_mass: Vec<f64>,
    held: Vec<bool>,
}

impl Table {
    fn columns(&mut self) -> Columns<'_, f64> {
        Columns {
            period: self.period,
            position: &mut self.position,
            velocity: &mut self.velocity,
            radius: &self.radius,
            inverse_mass: &self.inverse_mass,
            spin: &mut self.spin,
            held: &self.held,
            rods: &[],
        }
    }
}

impl Heap {
    /// Takes over those balls that the contacts are about, and names them by their place
    /// here.
    pub fn take(&mut self, contacts: &mut Contacts<f64>, balls: &[Ball], period: Period<f64>) {
        self.table.period = period;
        self.rows.clear();
        self.rows.extend(contacts.wm.iter().map(|c| c.b));
        self.rows.extend(contacts.mm.iter().flat_map(|c| [c.a, c.b]));
        self.rows.sort_unstable();
        self.rows.dedup();
        self.label.resize(balls.len(), 0);
        for (label, row) in self.rows.iter().enumerate() {
            self.label[*row as usize] = label as u32;
        }
        contacts.wm.iter_mut().for_each(|c| c.b = self.label[c.b as usize]);
        for c in &mut contacts.mm {
            (c.a, c.b) = (self.label[c.a as usize], self.label[c.b as usize]);
        }
        let (rows, table) = (&self.rows, &mut self.table);
        let each = || rows.iter().map(|row| &balls[*row as usize]);
        fill(&mut table.position, each().map(|b| b.position));
        fill(&mut self.start, each().map(|b| b.position));
        fill(&mut table.velocity, each().map(|b| b.velocity));
        fill(&mut table.spin, each().map(|b| b.spin));
        fill(&mut table.radius, each().map(|b| b.radius));
        fill(
            &mut table.inverse_mass,
            each().map(|b| if b.is_frozen() { 0.0 } else { b.inverse_mass }),
        );
        fill(&mut self.material, each().map(|b| b.material));
        fill(&mut table.held, each().map(|b| b.spins == BallSpin::Ignored));
    }

    /// The speed, in m/s, below which those that come together agree.
    pub fn enough(&self, pull: f64, settings: &Settings) -> f64 {
        let fastest = self.table.velocity.iter().map(|v| v.magnitude()).fold(0.0, f64::max);
        (AGREED * pull * settings.dt).max(ROUNDING * fastest)
    }

    /// Solves the contacts over `dt` seconds, or with zero what happens at once.
    pub fn solve(
        &mut self,
        contacts: &mut Contacts<f64>,
        walls: &Between,
        pull: f64,
        dt: f64,
        settings: &Settings,
        warm: &mut Vec<Warm<f64>>,
    ) {
        let until_it_agrees = (MOST_SOLVED / contacts.len().max(1)) as u32;
        let told = impulse::Settings {
            iterations: settings.iterations.max(until_it_agrees.min(MOST_SWEEPS)),
            dt,
            bounce_speed: 2.0 * pull * settings.dt,
            enough: self.enough(pull, settings),
            // As deep as a gap may be wide that counts as touching.
            slop: 0.5 * PRESS * PRESS * pull * settings.dt * settings.dt,
            largest_slop: SLOP,
        };
        let mut stopped = Vec::new(); // whoever it is will be stopped at the end, too
        let around = Around {
            walls,
            material: |label: usize| self.material[label],
            follow: |_| 0.5,
            start: Start { position: &self.start, velocity: &[], stands: &[] },
            settings: &told,
        };
        impulse(
            &mut self.table.columns(),
            contacts,
            &around,
            &mut self.scratch,
            warm,
            &mut stopped,
        );
        settings.count(2 * self.scratch.solved());
    }

    /// Counts what contacts did at once, to balls that moved and turned so before.
    pub fn count(&mut self, velocity: &mut [Vec3<f64>], spin: &mut [Vec3<f64>], work: &mut Work) {
        let collisions = work.collisions;
        self.scratch.count(&mut self.table.columns(), velocity, spin, work);
        work.collisions = collisions; // it is none: they lie there
    }
}

/// Sets a column.
fn fill<T>(column: &mut Vec<T>, values: impl Iterator<Item = T>) {
    column.clear();
    column.extend(values);
}
