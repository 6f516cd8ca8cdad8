//! Bodies at rest stay at rest, unless they fall.

use std::collections::BTreeMap;

use taw::prelude::*;

use super::flight::Near;
use super::{Finding, Invariant, Rules};
use crate::storm::observe::{Body, Snapshot};

/// Least time for which a cluster has to be slow, in seconds and in steps, so that it rests and does not
/// only turn back: a body that flies up at the speed of rest comes down after two steps.
const REST: f64 = 0.25;
const STEPS: u32 = 8;

/// Bodies that may touch each other and a wall, and nobody else.
#[derive(Clone, Debug, Default)]
struct Cluster {
    members: Vec<usize>,
    /// Number of steps in a row in which all of them were slow, and since then.
    slow: u32,
    /// The least energy since they are slow, in joules.
    energy: f64,
    /// By how much parting what overlaps may lift them, at most, in joules.
    overlap: f64,
    gravity: [f64; 3],
}

/// Clusters that rest, by their first body.
#[derive(Clone, Debug, Default)]
pub struct Rested {
    clusters: BTreeMap<usize, Cluster>,
}

impl Rested {
    /// Judges clusters at rest. One moves again only if another body touches it or if it falls: its energy
    /// rises by no more than
    /// - that of the speed of rest, `m (g dt)² / 2`, and of a flight at that speed, which is as much;
    /// - first order, as a bounce happens at the end of its substep: `m g v dt` for its speed now;
    /// - what it takes to part what overlapped, which is also the most that soft contacts store;
    /// - rounding of heights, whose signs are random: four standard deviations.
    ///
    /// Not where walls move, or by explicit Euler, which gains energy as documented.
    pub fn judge(
        &mut self,
        rules: &Rules,
        before: &Snapshot,
        after: &Snapshot,
        near: &Near,
    ) -> Option<Finding> {
        let g = after.gravity().magnitude();
        if rules.moving || g == 0.0 || rules.integrator == Integrator::ExplicitEuler {
            return None;
        }
        let mut worst = Finding { invariant: Invariant::Stays, value: 0.0, bound: 1.0, body: None };
        let rest = g * rules.step;
        let mut last = std::mem::take(&mut self.clusters);
        for (first, members) in clusters(near) {
            let known = last.remove(&first);
            let known = known.filter(|it| it.members == members && it.gravity == after.gravity);
            let bodies = || members.iter().map(|i| &after.bodies[*i]);
            let energy = bodies().map(|body| energy(body, after)).sum::<f64>();
            let mut cluster = known.unwrap_or_default();
            let rested = f64::from(cluster.slow) * rules.step >= REST && cluster.slow >= STEPS;
            if !rested && !bodies().all(|body| speed(body) <= rest) {
                continue;
            }
            if cluster.slow == 0 {
                let gravity = after.gravity;
                cluster = Cluster { members: members.clone(), energy, gravity, ..cluster };
            }
            if rested {
                let steps = f64::from(cluster.slow).sqrt();
                let slack = bodies().map(|body| slack(rules, body, g, steps)).sum::<f64>();
                let found = Finding {
                    value: energy - cluster.energy,
                    bound: slack + cluster.overlap + f64::MIN_POSITIVE,
                    body: fastest(&members, after),
                    ..worst
                };
                if found.ratio() > worst.ratio() {
                    worst = found;
                }
            }
            cluster.slow += 1;
            cluster.energy = cluster.energy.min(energy);
            let sunk = [before, after].map(|snapshot| overlap(&members, snapshot) * g);
            cluster.overlap = cluster.overlap.max(sunk[0]).max(sunk[1]);
            self.clusters.insert(first, cluster);
        }
        Some(worst)
    }
}

/// Bodies that may touch a wall, together with those that may touch them.
fn clusters(near: &Near) -> BTreeMap<usize, Vec<usize>> {
    let mut clusters: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for (body, first) in near.first.iter().enumerate().filter(|(body, _)| near.grounded[*body]) {
        clusters.entry(*first).or_default().push(body);
    }
    clusters
}

/// Speed of the center or of the surface about it, whichever is faster, in m/s.
fn speed(body: &Body) -> f64 {
    body.velocity.magnitude().max(body.angular_velocity.magnitude() * body.reach())
}

/// Energy of motion and in gravity, in joules.
fn energy(body: &Body, snapshot: &Snapshot) -> f64 {
    body.kinetic() + body.spin_energy() - body.mass * snapshot.gravity().dot(body.at)
}

/// Allowed rise of the energy of one body, in joules.
fn slack(rules: &Rules, body: &Body, g: f64, root_of_steps: f64) -> f64 {
    let rest = g * rules.step;
    let height = 8.0 * rules.epsilon * rules.substeps * body.at.magnitude();
    body.mass * (rest * rest + rest * speed(body).max(rest) + 4.0 * g * height * root_of_steps)
}

fn fastest(members: &[usize], snapshot: &Snapshot) -> Option<usize> {
    let speed = |i: &usize| speed(&snapshot.bodies[*i]);
    members.iter().copied().max_by(|a, b| speed(a).total_cmp(&speed(b)))
}

/// Mass of a cluster times the sum of the deepest overlap of each of its bodies, in kg m: parting them
/// one after the other lifts all by as much.
fn overlap(members: &[usize], snapshot: &Snapshot) -> f64 {
    let mass: f64 = members.iter().map(|i| snapshot.bodies[*i].mass).sum();
    let deepest = |i: &usize| {
        let others = members.iter().filter(|other| *other != i);
        let depths = others.map(|other| snapshot.depth(*i, *other));
        depths.fold(-snapshot.bodies[*i].wall_gap, f64::max).max(0.0)
    };
    mass * members.iter().map(deepest).sum::<f64>()
}
