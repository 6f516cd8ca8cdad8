//! Bounces of bodies: an impact in two phases, compression and restitution (Poisson), that makes no energy.
//!
//! Newton's rule, by which a point leaves by a part of the speed with which it came, can make energy where friction
//! turns the slip around (Kane and Levinson, *Dynamics*, 1985). Here compression stops the points, with friction.
//! Restitution gives back a part of its normal impulses, and friction acts on; where that would make more energy than
//! compression took, less is given back (Stronge, *Rigid body collisions with friction*, 1990).

use cgmath::{InnerSpace, Zero};
use smallvec::SmallVec;

use super::contact::{BodyContact, BodyContactPoint};
use super::solve::{EffectiveMass, SubstepParams, Sweeps};
use super::state::SolverBody;
use crate::constraint::{ContactImpulse, FrictionCone};
use crate::math::Vec3;

/// Sweeps in a bounce, which nothing corrects later.
const IN_BOUNCE: Sweeps = Sweeps { solved: 1e-9, most: 1000 };

type Vectors = SmallVec<[Vec3<f64>; 4]>;

impl BodyContact {
    /// Lets points bounce that meet in this substep. Returns true if any did.
    ///
    /// Gravity has not acted yet in this substep. A point bounces where it is, at a gap, with the speed that it
    /// would have there after a bounce at the surface, so that it reaches its height.
    pub(super) fn bounce(&mut self, bodies: &mut [SolverBody], params: &SubstepParams) -> bool {
        if self.material.restitution == 0.0 {
            return false;
        }
        self.note_approach(bodies);
        let [a, b] = self.bodies.map(|body| bodies[body as usize].acceleration);
        let pull = (a - b).dot(self.normal);
        let given_back: SmallVec<[Option<f64>; 4]> =
            self.points.iter().map(|point| self.given_back(point, pull, params)).collect();
        if given_back.iter().all(Option::is_none) {
            return false;
        }
        // The impulse of the impact is not the load of the contact.
        let loads: SmallVec<[_; 4]> = self.points.iter().map(|point| point.impulse).collect();
        for point in &mut self.points {
            point.impulse = ContactImpulse::zero();
        }
        let before = self.velocities(bodies);
        self.sweep(bodies, IN_BOUNCE, |_, at| given_back[at].map(|_| (0.0, None)));
        let compression = self.impulses();
        let stopped = self.velocities(bodies);
        for (at, part) in given_back.iter().enumerate() {
            let normal = self.points[at].impulse.normal * part.unwrap_or(0.0);
            let more = ContactImpulse { normal, tangent: Vec3::zero() };
            self.points[at].impulse.normal += normal;
            self.apply(&self.points[at], more, bodies);
        }
        self.rub(bodies);
        let after = self.velocities(bodies);
        let work = |impulses: &Vectors, velocities: &Vectors| -> f64 {
            impulses.iter().zip(velocities).map(|(impulse, velocity)| impulse.dot(*velocity)).sum()
        };
        let mean: Vectors = before.iter().zip(&stopped).map(|(a, b)| (a + b) * 0.5).collect();
        let more: Vectors =
            self.impulses().iter().zip(&compression).map(|(now, then)| now - then).collect();
        let change: Vectors = after.iter().zip(&stopped).map(|(a, b)| a - b).collect();
        let part = part_without_gain(
            work(&compression, &mean),
            work(&more, &stopped),
            work(&more, &change),
        );
        let [a, b] = self.bodies.map(|body| body as usize);
        for ((point, load), more) in self.points.iter_mut().zip(loads).zip(more) {
            let excess = more * (part - 1.0);
            bodies[a].apply(-excess, point.arms[0]);
            bodies[b].apply(excess, point.arms[1]);
            let made = point.impulse.plus(ContactImpulse::split(excess, self.normal));
            point.total = point.total.plus(made);
            point.impulse = load;
        }
        true
    }

    /// Part of the impulse of its compression that a point gets back; none if it does not meet, or not fast enough.
    fn given_back(
        &self,
        point: &BodyContactPoint,
        pull: f64,
        params: &SubstepParams,
    ) -> Option<f64> {
        let BodyContactPoint { separation, approach, .. } = *point;
        let meets = separation + (approach - 0.5 * pull * params.h) * params.h <= 0.0;
        let on_way = 2.0 * pull * separation.max(0.0);
        let impact = approach * approach + on_way; // square of the speed at the surface
        let square = self.material.restitution.powi(2) * impact - on_way;
        let bounces = meets && approach < 0.0 && impact > params.threshold.powi(2) && square > 0.0;
        bounces.then(|| (square.sqrt() / -approach).min(1.0))
    }

    /// Lets friction act under the normal impulses as they are.
    fn rub(&mut self, bodies: &mut [SolverBody]) {
        let masses: SmallVec<[EffectiveMass; 4]> =
            self.points.iter().map(|point| EffectiveMass::of(self, point, bodies)).collect();
        let cone = FrictionCone::new(self.material.friction);
        for _ in 0..IN_BOUNCE.most {
            let (mut change, mut largest) = (0.0_f64, 0.0_f64);
            for (at, mass) in masses.iter().enumerate() {
                let relative = self.relative_velocity(&self.points[at], bodies);
                let slip = relative - self.normal * relative.dot(self.normal);
                let wanted = ContactImpulse { normal: 0.0, tangent: slip * -mass.tangent };
                let by = self.points[at].impulse.solve(wanted, None, &cone);
                self.apply(&self.points[at], by, bodies);
                change = change.max(by.tangent.magnitude());
                largest = largest.max(self.points[at].impulse.normal);
            }
            if change <= largest * IN_BOUNCE.solved {
                break;
            }
        }
    }

    fn velocities(&self, bodies: &[SolverBody]) -> Vectors {
        self.points.iter().map(|point| self.relative_velocity(point, bodies)).collect()
    }

    fn impulses(&self) -> Vectors {
        self.points.iter().map(|point| point.impulse.along(self.normal)).collect()
    }
}

/// Part of the restitution that makes no energy: `lost` is the work of compression; a part `s` of the restitution adds
/// `s a + s² b / 2`.
fn part_without_gain(lost: f64, a: f64, b: f64) -> f64 {
    if lost + a + 0.5 * b <= 0.0 || b <= 0.0 {
        return 1.0;
    }
    let root = (a * a - 2.0 * b * lost).max(0.0).sqrt();
    ((root - a) / b).clamp(0.0, 1.0)
}
