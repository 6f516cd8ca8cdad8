//! Invariants of places: overlap, closed boxes.

use taw::prelude::*;

use super::super::case::Kind;
use super::{Finding, Invariant, Rules};
use crate::storm::observe::{Body, Snapshot};

/// All numbers are finite, and nothing was stopped: speeds of ordinary scenes are far from any
/// overflow, so what a step has to stop came from a fault.
pub fn finite(after: &Snapshot) -> Finding {
    let body = after.bodies.iter().position(|body| !body.is_finite());
    let count = after.bodies.iter().filter(|body| !body.is_finite()).count() + after.stopped;
    Finding { invariant: Invariant::Finite, value: count as f64, bound: 0.5, body }
}

/// The deepest overlap of bodies with walls and each other, and the sum of the deepest of each, in
/// metres.
#[must_use]
pub fn deepest(snapshot: &Snapshot) -> (f64, f64) {
    let count = snapshot.bodies.len();
    let mut depth: Vec<f64> = snapshot.bodies.iter().map(|body| -body.wall_gap).collect();
    for i in 0..count {
        for j in 0..i {
            let both = snapshot.depth(i, j);
            (depth[i], depth[j]) = (depth[i].max(both), depth[j].max(both));
        }
    }
    let depth = depth.into_iter().map(|depth| depth.max(0.0));
    depth.fold((0.0, 0.0), |(deepest, sum), depth| (depth.max(deepest), sum + depth))
}

/// Penetration of springs, as documented, in metres.
///
/// A collision of 16 substeps goes as deep as `v T / π` for `T` = 16 substeps, and what rests on
/// it by its weight over the stiffness `m π² / T²`. Balls by Hertz go as deep as their energy
/// goes into `8/15 E √R d^(5/2)`, and rest where `4/3 E √R d^(3/2)` bears all.
fn softness(rules: &Rules, [speed, mass, radius]: [f64; 3], weight: f64) -> f64 {
    let way = speed * rules.substep;
    if rules.kind.law() == Some(ContactLaw::SpringDashpot) {
        let time = 16.0 * rules.substep / std::f64::consts::PI;
        return speed * time + 2.0 * weight / mass * time * time + way;
    }
    let stiff = rules.modulus * radius.sqrt();
    let hit = (15.0 / 16.0 * mass * speed * speed / stiff).powf(0.4);
    let rests = (0.75 * weight / stiff).powf(2.0 / 3.0);
    hit + 2.0 * rests + way
}

/// Nothing sinks into anything deeper than it was in the beginning, by more than
/// - the way of a substep, at whose end contacts are looked for;
/// - a tenth of the smaller radius, which hardly anybody sees, for what iterations leave in heaps:
///   eight or more, as is the default; with fewer, as many times more;
/// - springs: their [softness];
/// - event-driven: nothing but a thousandth of the radius, as it looks ahead.
pub fn overlap(
    rules: &Rules,
    before: &Snapshot,
    after: &Snapshot,
    [begin, fastest]: [f64; 2],
) -> Finding {
    let gravity = after.gravity().magnitude();
    let total: f64 = after.bodies.iter().map(|body| body.mass).sum();
    let slop = (gravity * rules.substep * rules.substep).min(1e-3);
    let mut worst = Finding { invariant: Invariant::Overlap, value: 0.0, bound: 1.0, body: None };
    let mut judge = |body: usize, depth: f64, radius: f64, speed: f64, mass: f64| {
        let way = speed * rules.substep;
        let rounding = 8.0 * rules.epsilon * after.bodies[body].at.magnitude();
        let bound = match rules.kind {
            Kind::EventDriven => 1e-3 * radius + slop,
            _ if rules.springs() => {
                // Half the radius for two balls alike, and the lighter of two.
                // The speed is that when they met.
                let contact = [speed.max(2.0 * fastest), mass, 0.5 * radius];
                softness(rules, contact, gravity * total) + 0.1 * radius
            }
            _ => way + slop + 0.1 * rules.sag * radius,
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

/// Takes out of a box's inmates who moves by more than half of its radius in a substep: where
/// contacts are looked for at the end of substeps only, it may pass walls, as documented.
pub fn forget_the_fast(rules: &Rules, after: &Snapshot, outside: &mut [bool]) {
    for (body, outside) in after.bodies.iter().zip(outside).take(rules.discrete) {
        *outside |= body.velocity.magnitude() * rules.marble_substep > 0.5 * body.radius;
    }
}

/// No centre leaves a closed box: walls hold whatever comes at an ordinary speed. The bound is
/// the rounding of a place; for springs their softness. Of those whose centre was in a wall or
/// outside when it began, nobody can say that they leave.
pub fn closed(
    rules: &Rules,
    after: &Snapshot,
    fastest: f64,
    outside: &[bool],
    [low, high]: [[f64; 3]; 2],
) -> Finding {
    let gravity = after.gravity().magnitude();
    let total: f64 = after.bodies.iter().map(|body| body.mass).sum();
    let mut worst = Finding { invariant: Invariant::Closed, value: 0.0, bound: 1.0, body: None };
    let inside = |(i, _): &(usize, &Body)| !outside.get(*i).is_some_and(|outside| *outside);
    for (i, body) in after.bodies.iter().enumerate().filter(inside) {
        for axis in 0..3 {
            let size = high[axis].abs().max(low[axis].abs()).max(high[axis] - low[axis]);
            let out = (low[axis] - body.at[axis]).max(body.at[axis] - high[axis]);
            let mut found = Finding { value: out, body: Some(i), ..worst };
            found.bound = 8.0 * rules.epsilon * size;
            if rules.springs() {
                let contact = [fastest, body.mass, body.radius];
                found.bound += softness(rules, contact, gravity * total);
            }
            if found.ratio() > worst.ratio() {
                worst = found;
            }
        }
    }
    worst
}
