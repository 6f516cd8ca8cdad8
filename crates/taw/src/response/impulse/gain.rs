//! No energy from nothing. Newton's restitution and friction, each right in its own contact,
//! can together gain energy in several contacts at once (Kane and Levinson, *Dynamics: theory
//! and applications*, 1985): such collisions rebound less. And what iterations leave undone, or
//! remember wrongly from the last substep, must not gain either.

use cgmath::{InnerSpace, Zero};

use super::islands::Islands;
use super::solve::solve;
use super::{Constraint, Settings};
use crate::math::{Scalar, Vec3};
use crate::response::Columns;

/// A gain below this part of what the impulses exchange is what the sweeps left over.
const NONE: f64 = 1e-5;

/// Energy balance of an island's impulses, in units of the island.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ledger<S> {
    bounces: bool,
    /// The energy that came in by the impulses as they are.
    work: S,
    /// Energy exchanged through the contacts, the scale for `work`.
    exchanged: S,
    /// Coefficients of the energy `slope x + curve x²` that comes in with a part `x` of something.
    slope: S,
    curve: S,
}

impl<S: Scalar> Ledger<S> {
    fn new() -> Self {
        let zero = S::zero();
        Self { bounces: false, work: zero, exchanged: zero, slope: zero, curve: zero }
    }

    fn gains(&self) -> bool {
        self.work > self.exchanged * S::constant(NONE)
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

    /// The part of all impulses that leaves the least energy.
    fn best_part(&self) -> S {
        let part = -self.slope / (self.curve * S::constant(2.0));
        if part > S::zero() && part.is_finite() { part } else { S::zero() }
    }
}

/// State of a contact with full restitution.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rebound<S> {
    impulse: Vec3<S>,
    twist: Vec3<S>,
    /// The relative velocity of the two points afterwards, in m/s, and how they turn, in rad/s.
    closing: Vec3<S>,
    turning: Vec3<S>,
}

impl<S: Scalar> Columns<'_, S> {
    /// Finds the islands whose solution gained energy, solves them without rebound, which
    /// hardly ever does, and puts as much of the rebound back as gains nothing. Both keep to
    /// the contacts and to the cones of friction, so what is between them does, too. Where
    /// the sweeps ended too soon even for that, they begin anew, [pushes before
    /// friction](Self::push_before_friction).
    pub(super) fn gain_nothing(
        &mut self,
        constraints: &mut [Constraint<S>],
        islands: &mut Islands<S>,
        ledgers: &mut Vec<Ledger<S>>,
        rebounds: &mut Vec<Rebound<S>>,
        settings: &Settings<S>,
    ) {
        self.count(constraints, islands, ledgers);
        if ledgers.iter().any(|ledger| ledger.bounces && ledger.gains()) {
            self.rebound_less(constraints, islands, ledgers, rebounds, settings);
            self.count(constraints, islands, ledgers);
        }
        if ledgers.iter().any(Ledger::gains) {
            self.push_before_friction(constraints, islands, ledgers, settings);
        }
        self.end_approaches(constraints, islands);
    }

    /// Pushes, without more friction, at what still approaches. Two walls whose friction presses a
    /// ball into the other have no solution that sweeps could reach; and a ball that went on into
    /// one of them would be lifted out, which is energy. To end an approach only lowers it. Walls,
    /// which come first, have the last word.
    fn end_approaches(&mut self, constraints: &mut [Constraint<S>], islands: &Islands<S>) {
        let forth = 0..constraints.len();
        for row in forth.clone().chain(forth.rev()) {
            let c = &mut constraints[row];
            let missing = c.still() - self.closing_of(c).dot(c.normal);
            let island = islands.of(c);
            let unfinished = island.bounces || island.gave_up || !island.agrees;
            if unfinished && missing > self.rounding(c) && missing.is_finite() {
                self.add(c, c.normal * missing);
            }
        }
    }

    fn rebound_less(
        &mut self,
        constraints: &mut [Constraint<S>],
        islands: &mut Islands<S>,
        ledgers: &mut Vec<Ledger<S>>,
        rebounds: &mut Vec<Rebound<S>>,
        settings: &Settings<S>,
    ) {
        let gaining: Vec<_> = ledgers.iter().map(|it| it.bounces && it.gains()).collect();
        rebounds.clear();
        rebounds.extend(constraints.iter().map(|c| Rebound {
            impulse: c.impulse(),
            twist: c.twist(),
            closing: self.closing_of(c),
            turning: self.turning(c),
        }));
        for c in constraints.iter_mut().filter(|c| c.bounces && gaining[c.island as usize]) {
            (c.rebound, c.slide) = (c.still(), c.lag - c.normal * c.lag.dot(c.normal));
        }
        islands.begin_again(|island| gaining[island]);
        solve(self, constraints, islands, settings);
        self.count(constraints, islands, ledgers);
        let half = S::constant(0.5);
        for (c, rebound) in constraints.iter().zip(rebounds.iter()) {
            let ledger = &mut ledgers[c.island as usize];
            let (closing, turning) = (self.closing_of(c), self.turning(c));
            let (more, twist) = (rebound.impulse - c.impulse(), rebound.twist - c.twist());
            let (faster, turned) = (rebound.closing - closing, rebound.turning - turning);
            let island = islands.of(c);
            ledger.slope += island.energy(c, more, c.mean(closing))
                + island.energy(c, c.impulse(), faster * half)
                + island.energy_of_twist(twist, (c.begin_turning + turning) * half)
                + island.energy_of_twist(c.twist(), turned * half);
            ledger.curve += island.energy(c, more, faster * half)
                + island.energy_of_twist(twist, turned * half);
        }
        for (c, rebound) in constraints.iter_mut().zip(rebounds) {
            if gaining[c.island as usize] {
                let part = ledgers[c.island as usize].part();
                self.add(c, (rebound.impulse - c.impulse()) * part);
                self.add_twist(c, (rebound.twist - c.twist()) * part);
            }
        }
    }

    /// Solves islands that gain energy in a way that never does, however few the sweeps. First
    /// all pushes, without friction: each step of a sweep lowers the energy, from none. They
    /// rebound as Poisson says, by their impulses, no further than energy allows. Then friction,
    /// within the bounds that these pushes give, beside pushes that only grow: again each step
    /// lowers the energy.
    fn push_before_friction(
        &mut self,
        constraints: &mut [Constraint<S>],
        islands: &mut Islands<S>,
        ledgers: &mut Vec<Ledger<S>>,
        settings: &Settings<S>,
    ) {
        let gaining: Vec<_> = ledgers.iter().map(Ledger::gains).collect();
        let mut those: Vec<_> =
            constraints.iter_mut().filter(|c| gaining[c.island as usize]).collect();
        let mut friction = Vec::with_capacity(those.len());
        for c in &mut those {
            self.add(c, -c.impulse());
            self.add_twist(c, -c.twist());
            c.resistance = None;
            friction.push(std::mem::replace(&mut c.friction, S::zero()));
            (c.rebound, c.slide) = (
                c.still(),
                if c.bounces { c.lag - c.normal * c.lag.dot(c.normal) } else { Vec3::zero() },
            );
        }
        islands.begin_again(|island| gaining[island]);
        solve(self, constraints, islands, settings);
        self.rebound_by_impulse(constraints, islands, ledgers, &gaining);
        let those = constraints.iter_mut().filter(|c| gaining[c.island as usize]);
        for (c, friction) in those.zip(friction) {
            c.pressure = c.pressure.max(S::zero()); // rounding
            (c.least, c.bound) = (c.pressure, friction * c.pressure);
        }
        islands.begin_again(|island| gaining[island]);
        solve(self, constraints, islands, settings);
    }

    /// Makes pushes that ended approaches as much larger as restitution says (Poisson 1838): the
    /// least restitution of the bounces in an island, and no more than gains nothing.
    fn rebound_by_impulse(
        &mut self,
        constraints: &mut [Constraint<S>],
        islands: &Islands<S>,
        ledgers: &mut Vec<Ledger<S>>,
        gaining: &[bool],
    ) {
        self.count_all(constraints, islands, ledgers);
        let mut least = vec![S::one(); ledgers.len()];
        for c in constraints.iter().filter(|c| c.pressure > S::zero()) {
            let restitution = if c.bounces { c.restitution } else { S::zero() };
            let least = &mut least[c.island as usize];
            *least = least.min(restitution);
        }
        for c in constraints.iter_mut().filter(|c| gaining[c.island as usize]) {
            let number = c.island as usize;
            let best = ledgers[number].best_part();
            // Between nothing and twice the best part, energy is lost.
            let part = (S::one() + least[number]).min(best + best).max(S::zero());
            self.add(c, c.impulse() * (part - S::one()));
        }
    }

    /// Shortens all impulses of an island, alike, to what leaves the least energy, where they
    /// bring some in: a guess that no longer fits.
    pub(super) fn take_back(
        &mut self,
        constraints: &mut [Constraint<S>],
        islands: &Islands<S>,
        ledgers: &mut Vec<Ledger<S>>,
    ) {
        self.count(constraints, islands, ledgers);
        if !ledgers.iter().any(Ledger::gains) {
            return;
        }
        let gaining: Vec<_> = ledgers.iter().map(Ledger::gains).collect();
        self.count_all(constraints, islands, ledgers);
        for c in constraints.iter_mut().filter(|c| gaining[c.island as usize]) {
            let less = ledgers[c.island as usize].best_part().min(S::one()) - S::one();
            self.add(c, c.impulse() * less);
            self.add_twist(c, c.twist() * less);
        }
    }

    /// Counts what a part of all impulses would do to the energy.
    fn count_all(
        &self,
        constraints: &[Constraint<S>],
        islands: &Islands<S>,
        ledgers: &mut Vec<Ledger<S>>,
    ) {
        self.count(constraints, islands, ledgers);
        let half = S::constant(0.5);
        for c in constraints {
            let ledger = &mut ledgers[c.island as usize];
            let island = islands.of(c);
            let faster = self.closing_of(c) - c.begin;
            let turned = self.turning(c) - c.begin_turning;
            ledger.slope += island.energy(c, c.impulse(), c.mean(c.begin))
                + island.energy_of_twist(c.twist(), c.begin_turning);
            ledger.curve += island.energy(c, c.impulse(), faster * half)
                + island.energy_of_twist(c.twist(), turned * half);
        }
    }

    /// Adds to what a contact bears, within its cone.
    fn add(&mut self, c: &mut Constraint<S>, more: Vec3<S>) {
        self.hit_both(c, more);
        let along = more.dot(c.normal);
        c.pressure += along;
        c.grip += more - c.normal * along;
    }

    fn add_twist(&mut self, c: &mut Constraint<S>, more: Vec3<S>) {
        if let Some(resistance) = &mut c.resistance {
            resistance.twist += more;
            self.twist_both(c, more);
        }
    }

    /// Counts what the impulses did to the energy: an impulse times the mean of the
    /// velocities before and after.
    fn count(
        &self,
        constraints: &[Constraint<S>],
        islands: &Islands<S>,
        ledgers: &mut Vec<Ledger<S>>,
    ) {
        ledgers.clear();
        ledgers.resize(islands.len(), Ledger::new());
        let half = S::constant(0.5);
        for c in constraints {
            let ledger = &mut ledgers[c.island as usize];
            let island = islands.of(c);
            ledger.bounces |= c.bounces;
            let turning = (c.begin_turning + self.turning(c)) * half;
            ledger.work += island.energy(c, c.impulse(), c.mean(self.closing_of(c)))
                + island.energy_of_twist(c.twist(), turning);
            ledger.exchanged += island.energy(c, c.impulse(), c.begin).abs();
        }
    }
}

impl<S: Scalar> Constraint<S> {
    /// The speed along the normal that is asked for without a rebound, in m/s.
    fn still(&self) -> S {
        if self.bounces { self.lag.dot(self.normal) } else { self.rebound }
    }

    /// The mean of the relative velocities before and after an impulse at the moment when it
    /// acted, in m/s.
    fn mean(&self, after: Vec3<S>) -> Vec3<S> {
        (self.begin + after) * S::constant(0.5) - self.lag
    }
}
