//! No energy from nothing: Newton's restitution and friction, each right in its own
//! contact, can together gain energy in several contacts at once (Kane and Levinson,
//! *Dynamics: theory and applications*, 1985). Such collisions rebound less.

use cgmath::{InnerSpace, Zero};

use super::solve::{Islands, sweep};
use super::{Constraint, Settings};
use crate::math::{Scalar, Vec3};
use crate::response::Columns;

/// A gain below this part of what the impulses exchange is what the sweeps left over.
const NONE: f64 = 1e-5;

/// What the impulses of an island did, in units of the island.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ledger<S> {
    bounces: bool,
    /// The energy that came in by the impulses as they are.
    work: S,
    /// How much of it went through the contacts at all.
    exchanged: S,
    /// How much more comes in with a part `x` of the rebound, `slope x + curve x²`.
    slope: S,
    curve: S,
}

impl<S: Scalar> Ledger<S> {
    fn new() -> Self {
        let zero = S::zero();
        Self { bounces: false, work: zero, exchanged: zero, slope: zero, curve: zero }
    }

    fn gains(&self) -> bool {
        self.bounces && self.work > self.exchanged * S::constant(NONE)
    }

    /// The largest part of the rebound that gains nothing.
    fn part(&self) -> S {
        let Self { work, slope, curve, .. } = *self;
        let root = (slope * slope - S::constant(4.0) * curve * work).sqrt();
        // Of the two forms of the solution, the one that subtracts nothing.
        let part = if slope > S::zero() {
            work * S::constant(-2.0) / (slope + root)
        } else {
            (root - slope) / (curve * S::constant(2.0))
        };
        if part > S::zero() { part.min(S::one()) } else { S::zero() }
    }
}

/// What a contact would do if all of the rebound came.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rebound<S> {
    impulse: Vec3<S>,
    twist: Vec3<S>,
    /// The relative velocity of the two points afterwards, in m/s.
    closing: Vec3<S>,
}

impl<S: Scalar> Columns<'_, S> {
    /// Finds the islands whose solution gained energy, solves them without rebound, which
    /// never does, and puts as much of the rebound back as gains nothing. Both keep to the
    /// contacts and to the cones of friction, so what is between them does, too.
    pub(super) fn gain_nothing(
        &mut self,
        constraints: &mut [Constraint<S>],
        islands: &mut Islands<S>,
        ledgers: &mut Vec<Ledger<S>>,
        rebounds: &mut Vec<Rebound<S>>,
        settings: &Settings<S>,
    ) {
        if !constraints.iter().any(|c| c.bounces) {
            return;
        }
        self.count(constraints, islands, ledgers);
        if !ledgers.iter().any(Ledger::gains) {
            return;
        }
        rebounds.clear();
        rebounds.extend(constraints.iter().map(|c| Rebound {
            impulse: c.impulse(),
            twist: c.twist(),
            closing: self.closing(c.a, c.b, c.along, c.normal, c.surface),
        }));
        for c in constraints.iter_mut().filter(|c| c.bounces) {
            (c.rebound, c.slide) = (S::zero(), Vec3::zero());
        }
        islands.begin_again(|island| ledgers[island].gains());
        sweep(self, constraints, islands, settings);
        let gaining: Vec<_> = ledgers.iter().map(Ledger::gains).collect();
        self.count(constraints, islands, ledgers);
        let half = S::constant(0.5);
        for (c, rebound) in constraints.iter().zip(rebounds.iter()) {
            let ledger = &mut ledgers[c.island as usize];
            let closing = self.closing(c.a, c.b, c.along, c.normal, c.surface);
            let more = rebound.impulse - c.impulse();
            let faster = rebound.closing - closing;
            ledger.slope += islands.energy(c, more, (c.begin + closing) * half)
                + islands.energy(c, c.impulse(), faster * half);
            ledger.curve += islands.energy(c, more, faster * half);
        }
        for (c, rebound) in constraints.iter_mut().zip(rebounds) {
            if gaining[c.island as usize] {
                let part = ledgers[c.island as usize].part();
                let more = (rebound.impulse - c.impulse()) * part;
                self.hit_both(c, more);
                c.pressure += more.dot(c.normal);
                c.grip += more - c.normal * more.dot(c.normal);
                let twist = (rebound.twist - c.twist()) * part;
                self.twist_both(c, twist);
                if let Some(resistance) = &mut c.resistance {
                    resistance.twist += twist;
                }
            }
        }
    }

    /// Counts what the impulses did to the energy: an impulse times the mean of the
    /// velocities before and after. What resists rolling only takes, and is left out.
    fn count(
        &self,
        constraints: &[Constraint<S>],
        islands: &Islands<S>,
        ledgers: &mut Vec<Ledger<S>>,
    ) {
        ledgers.clear();
        ledgers.resize(islands.len(), Ledger::new());
        for c in constraints {
            let ledger = &mut ledgers[c.island as usize];
            let closing = self.closing(c.a, c.b, c.along, c.normal, c.surface);
            ledger.bounces |= c.bounces;
            let mean = (c.begin + closing) * S::constant(0.5);
            ledger.work += islands.energy(c, c.impulse(), mean);
            ledger.exchanged += islands.energy(c, c.impulse(), c.begin).abs();
        }
    }
}
