//! The iterations of the impulse method: velocities that all contacts agree on.

use cgmath::{InnerSpace, Zero};

use super::{Constraint, Settings};
use crate::math::{Scalar, Vec3, is_finite, length};
use crate::response::Columns;
use crate::response::impact::at_most;

/// Sweeps over the contacts until they agree, or as often as the settings allow.
///
/// Sweep by sweep alone (Gauss and Seidel), a heavy marble on a light one would take as
/// many sweeps as it is times as heavy. So after each sweep the solver goes on along the
/// way that it went, as far as that makes things better (as conjugate gradients do;
/// Silcowitz, Niebe and Erleben, *A nonsmooth nonlinear conjugate gradient method for
/// interactive contact force problems*, 2010, there without the search for how far).
pub(super) fn solve<S: Scalar>(
    marbles: &mut Columns<S>,
    constraints: &mut [Constraint<S>],
    islands: &mut Islands<S>,
    settings: &Settings<S>,
) {
    islands.find(constraints, marbles.velocity.len(), settings.bounce_speed);
    sweep(marbles, constraints, islands, settings);
}

/// The sweeps alone, in those islands that do not agree yet.
pub(super) fn sweep<S: Scalar>(
    marbles: &mut Columns<S>,
    constraints: &mut [Constraint<S>],
    islands: &mut Islands<S>,
    settings: &Settings<S>,
) {
    for sweep in 0..settings.iterations {
        for c in constraints.iter_mut() {
            if islands.list[c.island as usize].agrees {
                continue;
            }
            let before = c.impulse();
            let change = marbles.solve(c);
            c.step = c.impulse() - before;
            let island = &mut islands.list[c.island as usize];
            island.change = island.change.max(change);
            island.squared += island.energy(c, c.step, c.step);
        }
        let last = sweep + 1 == settings.iterations;
        if islands.end_sweep(settings.bounce_speed) || last {
            break;
        }
        marbles.go_on(constraints, islands);
    }
}

/// Where a sweep has less than this part of the energy of the one before, sweeps alone
/// are quick enough.
const SLOW: f64 = 0.6;

/// Groups of marbles that touch each other. What happens in one is nothing to the others,
/// to the bit.
#[derive(Clone, Debug, Default)]
pub(super) struct Islands<S> {
    /// For each row, one of its island that is nearer to its first.
    parent: Vec<u32>,
    /// For each row that is the first of an island, which one.
    number: Vec<u32>,
    list: Vec<Island<S>>,
}

#[derive(Clone, Copy, Debug)]
struct Island<S> {
    /// What energies are counted in, so that their squares do not vanish: 1/kg and m/s.
    mobility: S,
    speed: S,
    /// The largest change of a velocity in this sweep, and the energy of all changes in
    /// this sweep and in the last.
    change: S,
    residual: S,
    squared: S,
    last: S,
    /// Whether the contacts have what they ask for.
    agrees: bool,
    /// Whether it pays to go further, and which part of the way before to keep.
    searches: bool,
    kept: S,
    /// What a unit of the way gains, and what it costs.
    wish: S,
    cost: S,
}

impl<S: Scalar> Islands<S> {
    /// By how much a velocity still changed in the last sweep, at most, in m/s.
    pub fn residual(&self) -> S {
        self.list.iter().fold(S::zero(), |most, island| most.max(island.residual))
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.list.len()
    }

    /// An impulse (as a speed, times the mobility) on a contact times a velocity there, in
    /// units of its island.
    pub fn energy(&self, c: &Constraint<S>, impulse: Vec3<S>, velocity: Vec3<S>) -> S {
        self.list[c.island as usize].energy(c, impulse, velocity)
    }

    /// Sets some islands back to where the sweeps begin, and none of the others.
    pub fn begin_again(&mut self, which: impl Fn(usize) -> bool) {
        for (number, island) in self.list.iter_mut().enumerate() {
            island.agrees = !which(number);
            (island.last, island.searches, island.kept) = (S::zero(), false, S::zero());
        }
    }

    /// Finds who touches whom, over how many others (Tarjan 1975).
    fn find(&mut self, constraints: &mut [Constraint<S>], rows: usize, speed: S) {
        self.parent.clear();
        self.parent.extend(0..rows as u32);
        for c in constraints.iter() {
            if let Some(a) = c.a.marble() {
                let (first, second) = (self.first(a), self.first(c.b));
                self.parent[first.max(second)] = first.min(second) as u32;
            }
        }
        self.number.clear();
        self.number.resize(rows, u32::MAX);
        self.list.clear();
        for c in constraints {
            let first = self.first(c.b);
            if self.number[first] == u32::MAX {
                self.number[first] = self.list.len() as u32;
                self.list.push(Island {
                    mobility: c.mobility.normal,
                    speed: if speed > S::zero() { speed } else { S::one() },
                    change: S::zero(),
                    residual: S::zero(),
                    squared: S::zero(),
                    last: S::zero(),
                    agrees: false,
                    searches: false,
                    kept: S::zero(),
                    wish: S::zero(),
                    cost: S::zero(),
                });
            }
            c.island = self.number[first];
        }
    }

    /// The first row of a row's island. Halves the way there for the next time.
    fn first(&mut self, row: usize) -> usize {
        let mut row = row as u32;
        while self.parent[row as usize] != row {
            let above = self.parent[row as usize];
            self.parent[row as usize] = self.parent[above as usize];
            row = above;
        }
        row as usize
    }

    /// Looks back at a sweep. True if all islands agree.
    fn end_sweep(&mut self, bounce_speed: S) -> bool {
        for island in self.list.iter_mut().filter(|island| !island.agrees) {
            // What is left is beyond what the next sweep could still see.
            island.agrees = island.change <= bounce_speed * S::epsilon();
            // Near the end the sweeps alone come to rest, which the search does not quite.
            let ratio = island.squared / island.last;
            let slow = ratio >= S::constant(SLOW) || ratio.is_nan();
            island.searches =
                slow && !island.agrees && island.change > bounce_speed * S::constant(1e-5);
            // Where the steps grow, it starts anew.
            island.kept = if ratio < S::one() { ratio } else { S::zero() };
            island.last = island.squared;
            island.residual = island.change;
            (island.change, island.squared) = (S::zero(), S::zero());
            (island.wish, island.cost) = (S::zero(), S::zero());
        }
        self.list.iter().all(|island| island.agrees)
    }

    /// The island of a contact, if it searches.
    fn searching(&mut self, c: &Constraint<S>) -> Option<&mut Island<S>> {
        Some(&mut self.list[c.island as usize]).filter(|island| island.searches)
    }
}

impl<S: Scalar> Island<S> {
    /// An impulse (as a speed, times the mobility) on a contact times a velocity there.
    fn energy(&self, c: &Constraint<S>, impulse: Vec3<S>, velocity: Vec3<S>) -> S {
        let weight = self.mobility / c.mobility.normal;
        (impulse / self.speed).dot(velocity / self.speed) * weight
    }
}

impl<S: Scalar> Columns<'_, S> {
    /// One step toward what a contact asks for. Gives the change of velocity.
    fn solve(&mut self, c: &mut Constraint<S>) -> S {
        let closing = self.closing(c.a, c.b, c.along, c.normal, c.surface);
        let along = closing.dot(c.normal);
        let pressure = (c.pressure + c.rebound - along).max(S::zero());
        let sliding = closing - c.normal * along;
        let grip = c.grip + (c.slide - sliding) * (c.mobility.normal / c.mobility.tangent);
        let grip = at_most(grip, c.friction * pressure);
        let change = c.normal * (pressure - c.pressure) + (grip - c.grip);
        if !is_finite(change) {
            return S::zero(); // an overflow here must not reach the other one
        }
        (c.pressure, c.grip) = (pressure, grip);
        self.hit_both(c, change);
        self.resist(c);
        change.magnitude()
    }

    /// Goes on along the last step and a part of the way before, to where that brings the
    /// contacts of each island nearest to what they ask for.
    fn go_on(&mut self, constraints: &mut [Constraint<S>], islands: &mut Islands<S>) {
        for c in constraints.iter_mut() {
            let Some(island) = islands.searching(c) else { continue };
            c.way = c.way * island.kept + c.step;
            if c.pressure <= S::zero() {
                c.way = Vec3::zero(); // it parts, and bears nothing
            } else if length(c.grip) >= c.friction * c.pressure * (S::one() - S::epsilon()) {
                c.way = c.normal * c.way.dot(c.normal); // it slides, whichever way it does
            }
            let closing = self.closing(c.a, c.b, c.along, c.normal, c.surface);
            island.wish += island.energy(c, c.way, c.normal * c.rebound + c.slide - closing);
        }
        for c in constraints.iter().filter(|c| islands.list[c.island as usize].searches) {
            self.hit_both(c, c.way);
        }
        for c in constraints.iter() {
            let Some(island) = islands.searching(c) else { continue };
            let closing = self.closing(c.a, c.b, c.along, c.normal, c.surface);
            // With the wish subtracted, only the change is left.
            island.cost -= island.energy(c, c.way, c.normal * c.rebound + c.slide - closing);
        }
        for c in constraints.iter_mut() {
            let Some(island) = islands.searching(c) else { continue };
            let far = island.wish / (island.cost + island.wish);
            let far = if far > S::zero() && far.is_finite() { far } else { S::zero() };
            let further = c.way * far;
            self.hit_both(c, further - c.way);
            c.pressure += further.dot(c.normal);
            c.grip += further - c.normal * further.dot(c.normal);
            c.way = further;
        }
    }

    /// One step toward no relative spin, as far as the resistances can.
    fn resist(&mut self, c: &mut Constraint<S>) {
        let Some(resistance) = &mut c.resistance else { return };
        let spin_of_a = c.a.marble().map_or_else(Vec3::zero, |a| self.felt_spin(a));
        let relative = self.felt_spin(c.b) - spin_of_a;
        let wanted = resistance.twist - relative / resistance.give;
        let force = c.pressure / c.mobility.normal;
        let about = c.normal * wanted.dot(c.normal);
        let twist = at_most(wanted - about, resistance.rolling * force)
            + at_most(about, resistance.spinning * force);
        let change = twist - resistance.twist;
        if is_finite(change) {
            resistance.twist = twist;
            self.twist_both(c, change);
        }
    }
}
