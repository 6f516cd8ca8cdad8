//! Momentum and free fall of clusters that touch no wall.

use taw::prelude::*;

use super::{Finding, Invariant, Rules};
use crate::storm::case::Kind;
use crate::storm::observe::{Body, Snapshot};

/// Possible contacts of a step.
#[derive(Clone, Debug)]
pub struct Near {
    /// For each body, the first of its cluster.
    pub first: Vec<usize>,
    /// For each body, whether its cluster may have touched a wall.
    pub grounded: Vec<bool>,
    /// For each body, whether it may have touched anything.
    pub touched: Vec<bool>,
}

impl Near {
    /// Those that are, before or after the step, as near to each other as both can move in it at
    /// the larger of their speeds, and gravity in two steps, and a hundredth of their radii.
    ///
    /// Soft contacts bounce several times in a step. A light ball that a heavy one strikes leaves at
    /// up to twice the speed of that one beside its own, and may come back from a wall or a third ball
    /// before anybody sees its speed. So clusters touch, and have touched a wall, as far as
    /// that goes at the speed of their fastest.
    #[must_use]
    pub fn find(rules: &Rules, before: &Snapshot, after: &Snapshot) -> Self {
        let gravity = after.gravity().magnitude();
        let bodies = || before.bodies.iter().zip(&after.bodies);
        let speed =
            |(old, new): (&Body, &Body)| old.velocity.magnitude().max(new.velocity.magnitude());
        let mut reach: Vec<f64> = bodies()
            .map(|(old, new)| {
                let carried = old.carried.max(new.carried);
                (speed((old, new)) + carried + 2.0 * gravity * rules.step) * rules.step
                    + 0.01 * new.radius
            })
            .collect();
        let near = Self::within(&reach, before, after);
        if !matches!(rules.kind, Kind::SoftStep | Kind::SwarmFull) {
            return near;
        }
        let mut fastest = vec![0.0_f64; reach.len()];
        let mut members = vec![0; reach.len()];
        for (first, both) in near.first.iter().zip(bodies()) {
            fastest[*first] = fastest[*first].max(speed(both));
            members[*first] += 1;
        }
        for (first, reach) in near.first.iter().zip(&mut reach) {
            let struck = if members[*first] > 1 { 2.0 * fastest[*first] } else { 0.0 };
            *reach += struck * rules.step;
        }
        Self { touched: near.touched, ..Self::within(&reach, before, after) }
    }

    /// Clusters of bodies within this reach of each other, in metres, before or after a step.
    fn within(reach: &[f64], before: &Snapshot, after: &Snapshot) -> Self {
        let count = reach.len();
        let mut near =
            Self { first: (0..count).collect(), grounded: vec![false; count], touched: vec![] };
        near.touched = vec![false; count];
        for (i, reach) in reach.iter().enumerate() {
            let gap = before.bodies[i].wall_gap.min(after.bodies[i].wall_gap);
            let half = after.bodies[i].half.magnitude();
            near.grounded[i] = gap <= reach + half;
            near.touched[i] = near.grounded[i];
        }
        for i in 0..count {
            for j in 0..i {
                let gap = |bodies: &[Body]| {
                    let (a, b) = (&bodies[i], &bodies[j]);
                    (a.at - b.at).magnitude() - a.reach() - b.reach()
                };
                if gap(&before.bodies).min(gap(&after.bodies)) <= reach[i] + reach[j] {
                    (near.touched[i], near.touched[j]) = (true, true);
                    near.join(i, j);
                }
            }
        }
        for i in 0..count {
            near.first[i] = near.root(i);
            let first = near.first[i];
            near.grounded[first] |= near.grounded[i];
        }
        for i in 0..count {
            near.grounded[i] = near.grounded[near.first[i]];
        }
        near
    }

    fn root(&self, body: usize) -> usize {
        let mut body = body;
        while self.first[body] != body {
            body = self.first[body];
        }
        body
    }

    fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.root(a), self.root(b));
        self.first[a.max(b)] = a.min(b);
    }
}

/// For how many steps in a row each body has not gone where it should.
#[derive(Clone, Debug, Default)]
pub struct Falls {
    late: Vec<u32>,
}

/// Largest number of steps for which a body may be held up. Bodies that meet on their way stop there and
/// lose the rest of it, as documented: in the step in which they meet, and, while they still close, in the
/// next ones. A body that is held up for longer hangs.
const LATE: u32 = 5;

/// Sums over a cluster.
#[derive(Clone, Copy, Default)]
struct Sum {
    count: usize,
    /// Has a ball of the lab's tier, and others: they part by half, and keep no momentum.
    by_half: bool,
    mass: f64,
    momentum: [f64; 3],
    /// Mass times displacement, beyond that of the mean velocity.
    aside: [f64; 3],
    /// Of all that moves, for the rounding: kg m/s and kg m.
    moving: f64,
    placed: f64,
}

impl Sum {
    /// Empty sums, by the first of each cluster.
    fn of_clusters(rules: &Rules, near: &Near) -> Vec<Self> {
        let mut sums = vec![Self::default(); near.first.len()];
        if rules.kind == Kind::SwarmLab {
            // Marbles come first.
            for first in &near.first[rules.discrete..] {
                let members = near.first.iter().filter(|other| *other == first).count();
                sums[*first].by_half = members > 1;
            }
        }
        sums
    }
}

impl Falls {
    /// A cluster that touches no wall
    /// - changes its momentum by gravity alone, as every action has its reaction. Bound: the
    ///   rounding of all velocities that were added, as many times as there are substeps; of what
    ///   touches, and in the lab's tier of swarms of all, also that of places by the substep.
    ///   Bodies that stop where they meet lose what gravity does in the rest of the step.
    /// - moves its centre of mass by its velocity: at the least with the one before, at the most
    ///   with the one after, so within half a step of gravity of the mean. Bound: that, and the
    ///   rounding of places. Where bodies stop where they meet, see [`LATE`].
    ///
    /// A swarm of the lab's tier has no momentum, as documented
    /// ([`Tier::Lab`](taw::swarm::Tier::Lab)): no ball is faster than it was, so one at rest that is
    /// hit moves aside and stays there, and the other one loses what it gave. Balls are moved apart
    /// by half, though, whatever they weigh. So the mean place of a cluster with such a ball moves
    /// on by the velocities before the step, within half a step of gravity, and in rounding.
    pub fn judge(
        &mut self,
        rules: &Rules,
        before: &Snapshot,
        after: &Snapshot,
        near: &Near,
    ) -> Vec<Finding> {
        let count = after.bodies.len();
        self.late.resize(count, 0);
        let gravity = after.gravity();
        let mut sums = Sum::of_clusters(rules, near);
        for i in 0..count {
            let (old, new) = (&before.bodies[i], &after.bodies[i]);
            let sum = &mut sums[near.first[i]];
            let fall = gravity * rules.step;
            let (gained, mean, mass) = if sum.by_half {
                (Vec3::zero(), old.velocity + fall * 0.5, 1.0)
            } else {
                let gained = new.velocity - old.velocity - fall;
                (gained, (new.velocity + old.velocity) * 0.5, new.mass)
            };
            let aside = new.at - old.at - mean * rules.step;
            sum.count += 1;
            sum.mass += mass;
            for axis in 0..3 {
                sum.momentum[axis] += mass * gained[axis];
                sum.aside[axis] += mass * aside[axis];
            }
            let speed = old.velocity.magnitude() + new.velocity.magnitude();
            let place = old.at.magnitude().max(new.at.magnitude());
            sum.moving += mass
                * rules.velocity_rounding(
                    speed + gravity.magnitude() * rules.step,
                    if near.touched[i] || rules.kind == Kind::SwarmLab { place } else { 0.0 },
                );
            sum.placed += mass * 8.0 * rules.epsilon * rules.substeps * place;
        }
        let mut worst = [Invariant::Momentum, Invariant::Support].map(|invariant| Finding {
            invariant,
            value: 0.0,
            bound: 1.0,
            body: None,
        });
        let mut offer = |found: Finding| {
            let worst = &mut worst[usize::from(found.invariant == Invariant::Support)];
            if found.ratio() > worst.ratio() {
                *worst = found;
            }
        };
        // A sweep stops at any time within a step, so only what lasts counts there.
        let mut held_up = vec![false; count];
        for i in (0..count).filter(|i| near.first[*i] == *i && !near.grounded[*i]) {
            let [momentum, support] = Self::cluster(rules, &sums[i], i, gravity);
            offer(momentum);
            if sums[i].count > 1 && rules.swept() {
                held_up[i] = !support.holds();
            } else {
                offer(support);
            }
        }
        for (i, late) in self.late.iter_mut().enumerate() {
            *late = if held_up[near.first[i]] { *late + 1 } else { 0 };
            let (value, bound) = (f64::from(*late), f64::from(LATE));
            offer(Finding { invariant: Invariant::Support, value, bound, body: Some(i) });
        }
        worst.to_vec()
    }

    fn cluster(rules: &Rules, sum: &Sum, body: usize, gravity: Vec3<f64>) -> [Finding; 2] {
        let length = |v: [f64; 3]| Vec3::from(v).magnitude();
        let mut gained = Vec3::from(sum.momentum);
        if sum.count > 1 && rules.swept() && gravity.magnitude2() > 0.0 {
            let fall = gravity * (sum.mass * rules.step);
            gained += fall * (-gained.dot(fall) / fall.magnitude2()).clamp(0.0, 1.0);
        }
        let gravity = gravity.magnitude();
        let momentum = Finding {
            invariant: Invariant::Momentum,
            value: gained.magnitude(),
            bound: sum.moving + f64::MIN_POSITIVE,
            body: Some(body),
        };
        // Half a step of gravity, with a little for the mean over substeps.
        let fall = 0.55 * gravity * rules.step * rules.step;
        let support = Finding {
            invariant: Invariant::Support,
            value: length(sum.aside),
            bound: sum.mass * fall + sum.placed + sum.moving * rules.step + f64::MIN_POSITIVE,
            body: Some(body),
        };
        [momentum, support]
    }
}
