//! Motion of a ball on a curved or rotating surface: a sphere, an edge, a tilting board.
//!
//! The center moves on the offset surface, one radius away from the wall. With `n` the normal, `w`
//! the velocity of the wall and `v` that of the ball relative to it, contact means `n · v = 0` at
//! all times; so the normal acceleration is known, and with it the normal force: on a sphere,
//! `N = g cos θ − v² / (R + r)` per mass. Tangentially as on a plane, see
//! [`flat_support`](super::flat_support). Integrated in short steps (Kutta 1901) that end where the
//! normal force vanishes.

use std::cell::Cell;

use cgmath::{InnerSpace, Zero};

use super::flat_support::Regime;
use super::support_candidates::SupportCandidates;
use super::{EventBall, Wall};
use crate::contact::ContactMaterial;
use crate::math::{Point3, Vec3, normalize_and_length};
use crate::motion::BALL_INVERSE_INERTIA;
use crate::response::{BallRotation, Material};
use crate::shape::PointProjection;

/// Largest rotation of the normal in one step, in radians: the error of a step is of the fifth
/// power.
const MAX_TURN: f64 = 0.02;
/// Minimum step over the substep.
const MIN_STEP: f64 = 1.0 / 4096.0;
/// Number of steps in one substep before they get longer, doubling every [`STEPS_PER_DOUBLING`]
/// steps, so that the substep ends. They suffice for 2.5 radians, and for more borders of faces
/// than a substep should have.
const MAX_FINE_STEPS: u32 = 128;
/// Steps per doubling; 12 doublings end every substep.
const STEPS_PER_DOUBLING: u32 = 8;
/// Smallest displacement over the radius that has a direction; less is rounding.
const MIN_DISPLACEMENT: f64 = 1e-9;
/// Distance over the radius at which the normal is probed for its rate. Its rounding over this
/// distance is 1e-11.
const PROBE_DISTANCE: f64 = 1e-5;
/// Change of curvature times radius that tells one face, edge or corner from another.
const CURVATURE_TOLERANCE: f64 = 0.1;
/// Curvature of the offset surface times radius above which it may be a crease between two faces: that
/// of edges and corners is 1, that of hollows may be any.
const MAX_CURVATURE: f64 = 2.0;
/// Bisections of a time to find the end of a condition.
const BISECTIONS: u32 = 24;
/// Rotation of the normal over a radius below which a surface is flat: rounding.
const FLATNESS: f64 = 1e-9;

/// Surface below a ball, and the forces.
pub(super) struct CurvedSupport<'a> {
    pub walls: &'a [Wall],
    /// Walls that may support it before the step is over.
    pub candidates: &'a SupportCandidates,
    pub external_acceleration: Vec3<f64>,
    pub radius: f64,
    pub rotation: BallRotation,
    pub material: Material<f64>,
    /// Minimum step, in seconds.
    pub min_step: f64,
    /// Cost so far, in tests.
    pub cost: Cell<u64>,
}

/// State of a ball at a time.
#[derive(Clone, Copy, Debug)]
pub(super) struct BallState {
    pub time: f64,
    pub position: Point3<f64>,
    pub velocity: Vec3<f64>,
    pub spin: Vec3<f64>,
}

impl BallState {
    pub fn of(ball: &EventBall) -> Self {
        let EventBall { position, velocity, spin, trajectory, .. } = *ball;
        Self { time: trajectory.start, position, velocity, spin }
    }

    fn after(self, rate: Rate, dt: f64) -> Self {
        Self {
            time: self.time + dt,
            position: self.position + rate.velocity * dt,
            velocity: self.velocity + rate.acceleration * dt,
            spin: self.spin + rate.spin * dt,
        }
    }
}

#[derive(Clone, Copy, Debug)]
struct Rate {
    velocity: Vec3<f64>,
    acceleration: Vec3<f64>,
    spin: Vec3<f64>,
}

/// Contact of a ball with its support.
#[derive(Clone, Copy, Debug)]
pub(super) struct SupportContact {
    pub wall: usize,
    pub normal: Vec3<f64>,
    /// Normal force per mass, in m/s²; negative if the ball leaves.
    pub normal_acceleration: f64,
    /// Slip: tangential velocity of the contact point over the surface, in m/s.
    pub slip: Vec3<f64>,
    /// Rate of change of the normal, in 1/s.
    pub normal_rate: Vec3<f64>,
    /// Rate of change of the surface velocity at the contact point, in m/s².
    surface_acceleration: Vec3<f64>,
    material: ContactMaterial<f64>,
}

/// Integration step.
#[derive(Clone, Copy, Debug)]
pub(super) struct Step {
    pub end: BallState,
    /// True if the ball leaves the surface at its end.
    pub leaves: bool,
}

impl CurvedSupport<'_> {
    /// Nearest wall.
    fn nearest(&self, at: Point3<f64>, time: f64) -> (usize, PointProjection<f64>) {
        self.candidates.nearest(self.walls, (at, time), &self.cost)
    }

    /// Rate of change of the normal for a point that moves over the wall, in 1/s.
    fn normal_rate_over(
        &self,
        at: Point3<f64>,
        time: f64,
        normal: Vec3<f64>,
        relative_velocity: Vec3<f64>,
    ) -> Vec3<f64> {
        let Some((tangential, speed)) = normalize_and_length(relative_velocity) else {
            return Vec3::zero();
        };
        let probe = PROBE_DISTANCE * self.radius;
        let change_to = |distance: f64| {
            let change = self.nearest(at + tangential * distance, time).1.normal - normal;
            change - normal * change.dot(normal)
        };
        let relative_curvature = |change: Vec3<f64>| change.magnitude() * self.radius / probe;
        let mut normal_change = change_to(probe);
        if relative_curvature(normal_change) > MAX_CURVATURE {
            // A crease ahead is no curvature, but a wall that the ball is about to meet.
            let behind = -change_to(-probe);
            if relative_curvature(behind) <= MAX_CURVATURE {
                normal_change = behind;
            }
        }
        if relative_curvature(normal_change) <= FLATNESS {
            return Vec3::zero();
        }
        normal_change * (speed / probe)
    }

    /// Tests if the surface is flat around a point, and rotates about its normal at most.
    pub fn is_flat(&self, state: &BallState) -> bool {
        let (wall, PointProjection { normal, .. }) = self.nearest(state.position, state.time);
        let Some(wall) = self.walls.get(wall) else { return false };
        if wall.motion_at(0.0).is_some_and(|(motion, _)| {
            motion.angular_velocity.cross(normal).magnitude()
                > 1e-12 * motion.angular_velocity.magnitude()
        }) {
            return false;
        }
        let (x, y) = tangent_basis(normal);
        let is_curved = |direction| {
            !self.normal_rate_over(state.position, state.time, normal, direction).is_zero()
        };
        self.candidates.is_single() && matches!(wall.collider, super::WallCollider::Plane { .. })
            || ![x, -x, y, -y].into_iter().any(is_curved)
    }

    /// Tests if the surface has this normal at a point.
    pub fn has_normal(&self, at: Point3<f64>, time: f64, normal: Vec3<f64>) -> bool {
        (self.nearest(at, time).1.normal - normal).magnitude() <= FLATNESS
    }

    /// Contact of a ball with the nearest wall.
    pub fn contact(&self, state: &BallState) -> Option<SupportContact> {
        let BallState { time, position, velocity, spin } = *state;
        let (number, PointProjection { normal, .. }) = self.nearest(position, time);
        let wall = self.walls.get(number)?;
        let relative_velocity = velocity - wall.velocity_at(position, time);
        let tangential = |x: Vec3<f64>| x - normal * x.dot(normal);
        let curvature_rate =
            self.normal_rate_over(position, time, normal, tangential(relative_velocity));
        let (mut needed, mut normal_rate) =
            (-curvature_rate.dot(relative_velocity), curvature_rate);
        let point = position - normal * self.radius;
        let mut surface_acceleration = Vec3::zero();
        if let Some((motion, _)) = wall.motion_at(time) {
            let wall_spin = motion.angular_velocity;
            normal_rate += wall_spin.cross(normal);
            needed += normal.dot(wall_spin.cross(velocity - motion.velocity + relative_velocity));
            surface_acceleration =
                wall_spin.cross(velocity - normal_rate * self.radius - motion.velocity);
        } else if let Some(motion) = wall.motion {
            let point_velocity = motion.velocity_at(point);
            surface_acceleration =
                motion.angular_velocity.cross(velocity - normal_rate * self.radius);
            surface_acceleration -= normal_rate * point_velocity.dot(normal);
        }
        let mut slip = tangential(velocity - wall.surface_velocity(normal, point, time));
        if self.rotation == BallRotation::Free {
            slip += normal.cross(spin) * self.radius;
        }
        // A difference of speeds has the rounding of the speeds.
        let speeds = velocity.magnitude() + spin.magnitude() * self.radius;
        if slip.magnitude() <= 1e-14 * speeds {
            slip = Vec3::zero();
        }
        Some(SupportContact {
            wall: number,
            normal,
            normal_acceleration: needed - self.external_acceleration.dot(normal),
            slip,
            normal_rate,
            surface_acceleration: tangential(surface_acceleration),
            material: wall.combined_with(self.material),
        })
    }

    /// Rolling resistance, as a rate of the contact point's velocity by spin.
    fn rolling_resistance(&self, contact: &SupportContact, spin: Vec3<f64>) -> Vec3<f64> {
        if self.rotation == BallRotation::Locked || contact.material.rolling_resistance == 0.0 {
            return Vec3::zero();
        }
        let spin_velocity = contact.normal.cross(spin) * self.radius;
        let tangential_acceleration = self.external_acceleration
            - contact.normal * self.external_acceleration.dot(contact.normal);
        normalize_and_length(spin_velocity)
            .or_else(|| {
                normalize_and_length(contact.surface_acceleration - tangential_acceleration)
            })
            .map_or_else(Vec3::zero, |(direction, _)| {
                direction
                    * (-BALL_INVERSE_INERTIA
                        * contact.material.rolling_resistance
                        * contact.normal_acceleration)
            })
    }

    /// Tangential inverse effective mass per inverse mass: slip rate per friction.
    fn tangent_inverse_mass(&self) -> f64 {
        1.0 + self.rotation.inverse_inertia_factor::<f64>()
    }

    /// Friction per mass that keeps the slip constant.
    fn static_friction(&self, contact: &SupportContact, spin: Vec3<f64>) -> Vec3<f64> {
        let normal = contact.normal;
        let tangential = |x: Vec3<f64>| x - normal * x.dot(normal);
        let mut needed = contact.surface_acceleration - tangential(self.external_acceleration);
        if self.rotation == BallRotation::Free {
            needed -= tangential(contact.normal_rate.cross(spin)) * self.radius;
            needed -= self.rolling_resistance(contact, spin);
        }
        needed / self.tangent_inverse_mass()
    }

    fn regime(&self, contact: &SupportContact, spin: Vec3<f64>) -> Regime {
        let max_friction = contact.material.friction * contact.normal_acceleration;
        if !contact.slip.is_zero() {
            return Regime::Sliding;
        }
        let tangential_acceleration = self.external_acceleration
            - contact.normal * self.external_acceleration.dot(contact.normal);
        let max_static = contact.material.rolling_resistance * contact.normal_acceleration;
        let is_resting =
            contact.normal.cross(spin).is_zero() || self.rotation == BallRotation::Locked;
        let needed = (contact.surface_acceleration - tangential_acceleration).magnitude();
        if is_resting && needed <= max_static.min(max_friction) {
            Regime::Resting
        } else if self.static_friction(contact, spin).magnitude() <= max_friction {
            Regime::Rolling
        } else {
            Regime::Sliding
        }
    }

    fn rate(&self, state: &BallState, regime: Regime) -> Option<Rate> {
        let contact = self.contact(state)?;
        let max_friction = contact.material.friction * contact.normal_acceleration.max(0.0);
        let normal = contact.normal;
        let tangential_acceleration =
            self.external_acceleration - normal * self.external_acceleration.dot(normal);
        let friction = match regime {
            Regime::Resting => contact.surface_acceleration - tangential_acceleration,
            Regime::Rolling => self.static_friction(&contact, state.spin),
            Regime::Sliding => {
                let static_friction =
                    || normalize_and_length(self.static_friction(&contact, state.spin));
                normalize_and_length(-contact.slip)
                    .or_else(static_friction)
                    .map_or_else(Vec3::zero, |(direction, _)| direction * max_friction)
            }
        };
        let mut spin = Vec3::zero();
        if self.rotation == BallRotation::Free && regime != Regime::Resting {
            let spin_rate =
                friction * BALL_INVERSE_INERTIA + self.rolling_resistance(&contact, state.spin);
            spin = spin_rate.cross(normal) / self.radius;
            let torsional_spin = state.spin.dot(normal);
            let torsional_rate =
                contact.material.spinning_resistance * contact.normal_acceleration.max(0.0);
            if torsional_rate > 0.0 && torsional_spin != 0.0 {
                spin -= normal
                    * (BALL_INVERSE_INERTIA * torsional_rate / self.radius
                        * torsional_spin.signum());
            }
        }
        let acceleration =
            self.external_acceleration + normal * contact.normal_acceleration + friction;
        Some(Rate { velocity: state.velocity, acceleration, spin })
    }

    /// Removes a residual slip, with its effect on velocity and spin.
    pub fn without_residual_slip(&self, mut state: BallState) -> Option<BallState> {
        let contact = self.contact(&state)?;
        let slip_rate = self.tangent_inverse_mass()
            * contact.material.friction
            * contact.normal_acceleration.max(0.0);
        // Friction removes it in less than a minimum step, which would reverse it.
        if contact.slip.magnitude() <= 2.0 * self.min_step * slip_rate {
            let correction = contact.slip / self.tangent_inverse_mass();
            state.velocity -= correction;
            if self.rotation == BallRotation::Free {
                state.spin -=
                    correction.cross(contact.normal) * (BALL_INVERSE_INERTIA / self.radius);
            }
        }
        Some(state)
    }

    /// Integrates a step of at most `remaining` seconds.
    pub fn step(&self, start: &BallState, remaining: f64) -> Option<Step> {
        let contact = self.contact(start)?;
        if contact.normal_acceleration <= 0.0 {
            return None;
        }
        let regime = self.regime(&contact, start.spin);
        let rate = self.rate(start, regime)?;
        let min_step = self.min_step.min(remaining);
        let mut duration = self.max_step(start, &contact, rate).clamp(min_step, remaining);
        if regime == Regime::Sliding && !contact.slip.is_zero() && contact.material.friction > 0.0 {
            duration = duration.min(self.time_to_roll(start, &contact, rate).max(min_step));
        }
        let end = |duration: f64| self.runge_kutta(start, rate, duration, regime);
        let mut state = end(duration)?;
        // A step ends at the border of a face, edge or corner, where the curvature changes.
        if duration > min_step && !self.has_same_curvature(start, &state, &contact) {
            let is_same = |duration: f64| {
                end(duration).is_some_and(|end| self.has_same_curvature(start, &end, &contact))
            };
            duration = bisect_end(duration, is_same)[1].max(min_step);
            state = end(duration)?;
        }
        let is_pressed = |end: &BallState| {
            self.contact(end).is_some_and(|contact| contact.normal_acceleration > 0.0)
        };
        let leaves = !is_pressed(&state);
        if leaves {
            // Just after that time, so that no normal force is left there.
            duration =
                bisect_end(duration, |duration| end(duration).is_some_and(|end| is_pressed(&end)))
                    [1];
            state = end(duration)?;
        }
        Some(Step { end: BallState { time: start.time + duration, ..state }, leaves })
    }

    /// Tests if a ball is still on the same face, edge or corner: same curvature at start and end
    /// along the displacement.
    fn has_same_curvature(
        &self,
        start: &BallState,
        end: &BallState,
        contact: &SupportContact,
    ) -> bool {
        let Some(wall) = self.walls.get(contact.wall) else { return true };
        let dt = end.time - start.time;
        let relative_velocity =
            |at: &BallState| at.velocity - wall.velocity_at(at.position, at.time);
        let displacement =
            end.position - start.position - wall.velocity_at(start.position, start.time) * dt;
        let distance = displacement.magnitude();
        if distance <= MIN_DISPLACEMENT * self.radius {
            return true;
        }
        // From rest, the direction of the displacement counts.
        let start_direction = relative_velocity(start);
        let start_direction = if start_direction.magnitude() * dt < 1e-3 * distance {
            displacement
        } else {
            start_direction
        };
        let curvature_change =
            self.curvature(end, -relative_velocity(end)) - self.curvature(start, start_direction);
        curvature_change.abs() * self.radius <= CURVATURE_TOLERANCE
    }

    /// Curvature of the surface in a direction, in 1/m.
    fn curvature(&self, state: &BallState, direction: Vec3<f64>) -> f64 {
        let normal = self.nearest(state.position, state.time).1.normal;
        let direction = direction - normal * direction.dot(normal);
        let Some((direction, _)) = normalize_and_length(direction) else { return 0.0 };
        self.normal_rate_over(state.position, state.time, normal, direction).magnitude()
    }

    /// Largest step in which the normal rotates little.
    fn max_step(&self, start: &BallState, contact: &SupportContact, rate: Rate) -> f64 {
        let (x, y) = tangent_basis(contact.normal);
        let directions = [x, -x, y, -y];
        let at = |direction| {
            self.normal_rate_over(start.position, start.time, contact.normal, direction).magnitude()
        };
        let max_curvature = directions.into_iter().map(at).fold(0.0, f64::max);
        let wall = &self.walls[contact.wall];
        let speed = (start.velocity - wall.velocity_at(start.position, start.time)).magnitude();
        let mut max_step = (MAX_TURN / (max_curvature * speed))
            .min((MAX_TURN / (max_curvature * rate.acceleration.magnitude())).sqrt());
        if let Some((motion, _)) = wall.motion_at(0.0) {
            max_step = max_step.min(MAX_TURN / motion.angular_velocity.magnitude());
        }
        // A locally flat surface may be curved further on.
        max_step.min(super::SUPPORT_CHECK * self.radius / speed)
    }

    /// Time until the slip ends, or a fraction of it if the slip changes its direction.
    fn time_to_roll(&self, start: &BallState, contact: &SupportContact, rate: Rate) -> f64 {
        let dt = 1e-6 * self.radius / (1.0 + start.velocity.magnitude());
        let later = self.contact(&start.after(rate, dt));
        let Some(later) = later else { return f64::INFINITY };
        let change = (later.slip - contact.slip) / dt;
        let (slip, decrease) = (contact.slip.magnitude(), -change.dot(contact.slip));
        if decrease <= 0.0 {
            return f64::INFINITY;
        }
        let end = slip * slip / decrease;
        if decrease > 0.999 * slip * change.magnitude() { end } else { 0.25 * end }
    }

    /// Integrates over `dt` seconds, from the rate `k1` at the start.
    fn runge_kutta(
        &self,
        start: &BallState,
        k1: Rate,
        dt: f64,
        regime: Regime,
    ) -> Option<BallState> {
        let k2 = self.rate(&start.after(k1, 0.5 * dt), regime)?;
        let k3 = self.rate(&start.after(k2, 0.5 * dt), regime)?;
        let k4 = self.rate(&start.after(k3, dt), regime)?;
        let mean = |of: fn(Rate) -> Vec3<f64>| (of(k1) + (of(k2) + of(k3)) * 2.0 + of(k4)) / 6.0;
        let mean = Rate {
            velocity: mean(|k| k.velocity),
            acceleration: mean(|k| k.acceleration),
            spin: mean(|k| k.spin),
        };
        let mut end = start.after(mean, dt);
        // Removes the integration error in position and normal velocity, so that it does not
        // accumulate.
        let (wall, PointProjection { normal, distance, .. }) = self.nearest(end.position, end.time);
        end.position += normal * (self.radius - distance);
        let wall_velocity = self.walls.get(wall)?.velocity_at(end.position, end.time);
        end.velocity += normal * (wall_velocity - end.velocity).dot(normal);
        Some(end)
    }
}

/// Minimum step after a number of steps in this substep, in seconds.
pub(super) fn min_step_at(steps: u32, dt: f64) -> f64 {
    let doublings = steps.saturating_sub(MAX_FINE_STEPS) / STEPS_PER_DOUBLING;
    (MIN_STEP * dt * f64::from(1_u32 << doublings.min(12))).min(dt)
}

/// Bisects for the end of a condition that holds at zero and not at `hi`: last time that it holds,
/// first time that it does not.
fn bisect_end(mut hi: f64, holds: impl Fn(f64) -> bool) -> [f64; 2] {
    let mut lo = 0.0;
    for _ in 0..BISECTIONS {
        let middle = 0.5 * (lo + hi);
        if holds(middle) { lo = middle } else { hi = middle }
    }
    [lo, hi]
}

/// Orthonormal basis of the tangent plane.
fn tangent_basis(normal: Vec3<f64>) -> (Vec3<f64>, Vec3<f64>) {
    let x = crate::shape::any_perpendicular(normal);
    (x, normal.cross(x))
}
