//! Passes of the soft step over contacts of bodies: warm start, solve, relax.
//!
//! The velocity `v` of a body's point relative to its partner's changes by `K p` with an impulse `p`, where
//! `K = Σ (1/m + [r]ᵀ I⁻¹ [r])` of both (Catto, *Iterative dynamics with temporal coherence*, 2005). The points of a
//! contact are solved together, by sweeps over them.

use cgmath::{InnerSpace, Zero};
use smallvec::SmallVec;

use super::contact::{BodyContact, BodyContactPoint};
use super::state::SolverBody;
use crate::constraint::{ContactImpulse, ContactSoftness, FrictionCone, Softness};
use crate::math::Vec3;
use crate::shape::any_perpendicular;

/// Sweeps over the points of one contact, which are solved together: until no impulse changes by more
/// than this part of the largest, and at most so often.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sweeps {
    pub solved: f64,
    pub most: u32,
}

/// Sweeps in each pass: the next one goes on.
const IN_PASS: Sweeps = Sweeps { solved: 1e-3, most: 12 };

/// Numbers of a substep.
#[derive(Clone, Copy, Debug)]
pub(super) struct SubstepParams {
    /// Length in seconds.
    pub h: f64,
    /// Approach speed in m/s below which nothing bounces.
    pub threshold: f64,
    pub softness: ContactSoftness<f64>,
}

/// Impulse at a point per velocity, along the normal and across it: there by the direction in which the two give way
/// most, since friction that is limited has the direction of the slip.
#[derive(Clone, Copy, Debug)]
pub(super) struct EffectiveMass {
    pub normal: f64,
    pub tangent: f64,
}

impl EffectiveMass {
    pub fn of(contact: &BodyContact, point: &BodyContactPoint, bodies: &[SolverBody]) -> Self {
        let ends = contact.bodies.map(|body| &bodies[body as usize]);
        let give = |one: Vec3<f64>, other: Vec3<f64>| -> f64 {
            let along = |(body, arm): (&SolverBody, Vec3<f64>)| {
                let turn = arm.cross(one).dot(body.inverse_inertia * arm.cross(other));
                body.inverse_mass * one.dot(other) + turn
            };
            ends.into_iter().zip(point.arms).map(along).sum()
        };
        let normal = contact.normal;
        let across = any_perpendicular(normal);
        let other = normal.cross(across);
        let [a, b, c] = [give(across, across), give(across, other), give(other, other)];
        let most = (a + c) * 0.5 + ((a - c) * 0.5).hypot(b); // the larger eigenvalue
        let inverse = |x: f64| if x > 0.0 { 1.0 / x } else { 0.0 };
        Self { normal: inverse(give(normal, normal)), tangent: inverse(most) }
    }
}

impl BodyContact {
    /// Forgets the impulses of impacts, which are over.
    pub(super) fn forget_impacts(&mut self, threshold: f64) {
        for point in &mut self.points {
            if point.approach < -threshold {
                point.impulse = ContactImpulse::zero();
            }
        }
    }

    /// Applies the impulses of the last substep.
    pub(super) fn warm_start(&self, bodies: &mut [SolverBody]) {
        for point in &self.points {
            self.apply(point, point.impulse, bodies);
        }
    }

    /// Notes how fast points approach, before any is solved.
    pub(super) fn note_approach(&mut self, bodies: &[SolverBody]) {
        for at in 0..self.points.len() {
            let relative = self.relative_velocity(&self.points[at], bodies);
            let approach = relative.dot(self.normal);
            let point = &mut self.points[at];
            point.approach = approach;
            if -approach > point.fastest[0] {
                point.fastest = [-approach, (relative - self.normal * approach).magnitude()];
            }
        }
    }

    /// Solves all points; softly before positions move on, rigidly after that.
    pub(super) fn solve(&mut self, bodies: &mut [SolverBody], params: &SubstepParams, soft: bool) {
        let per_second = 1.0 / params.h;
        self.sweep(bodies, IN_PASS, |contact, at| {
            let BodyContactPoint { separation, impulse, approach, .. } = contact.points[at];
            if soft {
                let (target, softness) = params.softness.at(separation, per_second);
                return Some((target, Some(softness)));
            }
            // What comes fast and did not touch yet may bounce in the next substep.
            let comes = impulse.normal == 0.0 && approach < -params.threshold;
            (!comes).then(|| (-separation.max(0.0) * per_second, None))
        });
    }

    /// Solves points until they agree; `target` is the speed of each along the normal, if it is to be solved, and
    /// its softness.
    pub(super) fn sweep(
        &mut self,
        bodies: &mut [SolverBody],
        until: Sweeps,
        target: impl Fn(&Self, usize) -> Option<(f64, Option<Softness<f64>>)>,
    ) {
        let masses: SmallVec<[EffectiveMass; 4]> =
            self.points.iter().map(|point| EffectiveMass::of(self, point, bodies)).collect();
        let sweeps = if self.points.len() > 1 { until.most } else { 1 };
        for _ in 0..sweeps {
            let (mut change, mut largest) = (0.0_f64, 0.0_f64);
            for (at, mass) in masses.iter().enumerate() {
                let Some(target) = target(self, at) else { continue };
                let by = self.solve_point(at, mass, bodies, target);
                change = change.max(by.abs());
                largest = largest.max(self.points[at].impulse.normal);
            }
            if change <= largest * until.solved {
                break;
            }
        }
    }

    /// Solves a point. Returns the change of its normal impulse.
    fn solve_point(
        &mut self,
        at: usize,
        mass: &EffectiveMass,
        bodies: &mut [SolverBody],
        (target, softness): (f64, Option<Softness<f64>>),
    ) -> f64 {
        let point = &self.points[at];
        let relative = self.relative_velocity(point, bodies);
        let speed = relative.dot(self.normal);
        let wanted = ContactImpulse {
            normal: mass.normal * (target - speed),
            tangent: (relative - self.normal * speed) * -mass.tangent,
        };
        let cone = FrictionCone::new(self.material.friction);
        let change = self.points[at].impulse.solve(wanted, softness, &cone);
        self.apply(&self.points[at], change, bodies);
        change.normal
    }

    pub(super) fn apply(
        &self,
        point: &BodyContactPoint,
        impulse: ContactImpulse<f64>,
        bodies: &mut [SolverBody],
    ) {
        let whole = impulse.along(self.normal);
        if whole.is_zero() {
            return;
        }
        let [a, b] = self.bodies.map(|body| body as usize);
        bodies[a].apply(-whole, point.arms[0]);
        bodies[b].apply(whole, point.arms[1]);
    }
}
