//! Where things may be.

use taw::prelude::*;

use super::super::case::Kind;
use super::{Finding, Invariant, Rules};
use crate::storm::observe::Snapshot;

/// All numbers are finite, and nothing was stopped: speeds of ordinary scenes are far from any
/// overflow, so what a step has to stop came from a fault.
pub fn finite(after: &Snapshot) -> Finding {
    let body = after.bodies.iter().position(|body| !body.is_finite());
    let count = after.bodies.iter().filter(|body| !body.is_finite()).count() + after.stopped;
    Finding { invariant: Invariant::Finite, value: count as f64, bound: 0.5, body }
}

/// The deepest overlap of bodies with walls and each other, in metres, and the sum of all.
pub fn deepest(snapshot: &Snapshot) -> (f64, f64) {
    let (mut deepest, mut sum) = (0.0_f64, 0.0);
    let mut add = |depth: f64| {
        if depth > 0.0 {
            deepest = deepest.max(depth);
            sum += depth;
        }
    };
    for (i, body) in snapshot.bodies.iter().enumerate() {
        add(-body.wall_gap);
        for j in 0..i {
            add(snapshot.depth(i, j));
        }
    }
    (deepest, sum)
}

/// Nothing sinks into anything deeper than it was in the beginning, by more than
/// - the way of a substep, at whose end contacts are looked for;
/// - a twentieth of the smaller radius, which nobody sees, for what few iterations leave in heaps;
/// - springs: what a collision of 16 substeps needs (`v T / π` for `T` = 16 substeps), and what
///   rests on it (the weight of all above by the stiffness `m π² / T²`); Hertz's contacts are as
///   soft as their materials say, so their centres only must not pass a surface;
/// - event-driven: nothing but a thousandth of the radius, as it looks ahead.
pub fn overlap(rules: &Rules, before: &Snapshot, after: &Snapshot, begin: f64) -> Finding {
    let gravity = after.gravity().magnitude();
    let total: f64 = after.bodies.iter().map(|body| body.mass).sum();
    let slop = (gravity * rules.substep * rules.substep).min(1e-3);
    let mut worst = Finding { invariant: Invariant::Overlap, value: 0.0, bound: 1.0, body: None };
    let mut judge = |body: usize, depth: f64, radius: f64, speed: f64, mass: f64| {
        let way = speed * rules.substep;
        let rounding = 8.0 * rules.epsilon * after.bodies[body].at.magnitude();
        let bound = match rules.kind {
            Kind::EventDriven => 1e-3 * radius + slop,
            Kind::SpringDashpot => {
                let time = 16.0 * rules.substep / std::f64::consts::PI;
                speed * time + 2.0 * gravity * total / mass * time * time + way + 0.05 * radius
            }
            Kind::HertzMindlin => radius,
            _ => way + slop + 0.05 * radius,
        };
        let found = Finding {
            invariant: Invariant::Overlap,
            value: depth,
            bound: bound + begin + rounding,
            body: Some(body),
        };
        if found.ratio() > worst.ratio() {
            worst = found;
        }
    };
    let speed = |i: usize| {
        let (before, after) = (&before.bodies[i], &after.bodies[i]);
        before.velocity.magnitude().max(after.velocity.magnitude())
    };
    for (i, body) in after.bodies.iter().enumerate() {
        judge(i, -body.wall_gap, body.radius, speed(i) + body.carried, body.mass);
        for j in 0..i {
            let depth = after.depth(i, j);
            if depth > 0.0 {
                let other = &after.bodies[j];
                let mass = body.mass.min(other.mass);
                judge(i, depth, body.radius.min(other.radius), speed(i) + speed(j), mass);
            }
        }
    }
    worst
}

/// No centre leaves a closed box: walls hold whatever comes at an ordinary speed. The bound is
/// the rounding of a place.
pub fn closed(rules: &Rules, after: &Snapshot, [low, high]: [[f64; 3]; 2]) -> Finding {
    let mut worst = (0.0_f64, None);
    let mut size = 0.0_f64;
    for (i, body) in after.bodies.iter().enumerate() {
        for axis in 0..3 {
            size = size.max(high[axis].abs()).max(low[axis].abs());
            let out = (low[axis] - body.at[axis]).max(body.at[axis] - high[axis]);
            if out > worst.0 {
                worst = (out, Some(i));
            }
        }
    }
    let bound = 8.0 * rules.epsilon * size;
    Finding { invariant: Invariant::Closed, value: worst.0, bound, body: worst.1 }
}
