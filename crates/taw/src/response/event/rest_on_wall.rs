//! Rest on a single wall: start, motion along the wall, and end of support.

use std::cell::Cell;

use cgmath::{InnerSpace, Zero};

use super::curved_support::{BallState, CurvedSupport, min_step_at};
use super::flat_support::FlatSupport;
use super::predict_wall::MIN_NORMAL_ACCELERATION;
use super::support_candidates::SupportCandidates;
use super::{
    EventBall, EventSettings, EventSolver, REST_SPEED, SEAM_TOLERANCE, SUPPORT_CHECK, WallCollider,
};
use crate::contact::Contact;
use crate::math::Vec3;
use crate::response::{BallRotation, ImpulseSample};
use crate::shape::PointProjection;

/// Bisections of a time to find the end of a face.
const BISECTIONS: u32 = 24;

impl EventSolver {
    /// Starts the rest of a ball on a wall that it touches.
    pub(super) fn start_resting(&mut self, row: usize, wall: usize, settings: &EventSettings) {
        let ball = &mut self.balls[row];
        let surface = &self.walls[wall];
        let now = ball.trajectory.start;
        let PointProjection { normal, distance, .. } = surface.nearest(ball.position, now);
        ball.fly_free();
        // Removes the rounding of the position, so that it does not accumulate; and penetration,
        // which is no energy, without a change of velocity.
        let penetration = ball.radius - distance;
        let fall_distance = ball.external_acceleration.magnitude() * settings.dt * settings.dt;
        if -penetration
            <= REST_SPEED * fall_distance
                + ball.position_error
                + surface.position_error(ball.position)
        {
            ball.position += normal * penetration;
        }
        let wall_velocity = surface.velocity_at(ball.position, now);
        let velocity_change = normal * (wall_velocity - ball.velocity).dot(normal);
        if let Some(work) = &mut self.work
            && ball.inverse_mass > 0.0
        {
            let mean_velocity = ball.velocity + velocity_change * 0.5 - wall_velocity;
            let impulse = velocity_change / ball.inverse_mass;
            work.record_impulse(ImpulseSample {
                impulse,
                normal,
                mean_velocity,
                fixed_velocity: [Some(wall_velocity), None],
            });
        }
        ball.velocity += velocity_change;
        ball.trajectory.support = Some(wall);
        self.update_support_motion(row, settings);
    }

    /// Tests if a ball that has started to rest on a wall touches another one slowly, and accelerates
    /// into that: it rests on both. Half-spaces only: along parts of walls it goes by its equations.
    pub(super) fn is_pressed_into_another(
        &self,
        row: usize,
        support: usize,
        settings: &EventSettings,
    ) -> bool {
        if !self.has_fixed_normal(support) {
            return false;
        }
        let ball = &self.balls[row];
        let (at, now, trajectory) = (ball.position, ball.trajectory.start, &ball.trajectory);
        let min_acceleration = MIN_NORMAL_ACCELERATION * ball.external_acceleration.magnitude();
        let range = (at, ball.radius + self.contact_tolerance(row as u32, settings));
        let mut is_pressed = false;
        let cost = self.for_each_wall_within(row, range, |wall| {
            let contact = Contact::with_wall(wall as u32, 0, row as u32);
            is_pressed |= wall != support
                && self.has_fixed_normal(wall)
                && trajectory.support == Some(support)
                && self.wall_contact(&contact, now, 0.0, settings).is_some_and(|it| it >= 0.0)
                && self.normal_acceleration(row, wall, now, trajectory.acceleration)
                    > min_acceleration
                && !self.is_seam(row, wall, at, now, settings);
        });
        settings.add_cost(1 + cost);
        is_pressed
    }

    /// Rechecks the support on a curved or bounded wall: another face may have taken over, or none,
    /// and then the ball flies.
    pub(super) fn recheck_support(&mut self, row: usize, settings: &EventSettings) {
        let Some(support) = self.balls[row].trajectory.support else { return };
        if self.balls[row].trajectory.leaves_support {
            self.balls[row].leave_wall(support);
            return;
        }
        if self.has_fixed_normal(support) {
            self.update_support_motion(row, settings);
            return;
        }
        let ball = &self.balls[row];
        let (at, now) = (ball.position, ball.trajectory.start);
        let candidates = self.support_candidates(row, support, settings);
        let (wall, nearest) = candidates.nearest(&self.walls, (at, now), &settings.cost);
        let wall = if nearest.distance < f64::INFINITY { wall } else { support };
        let fall_distance = ball.external_acceleration.magnitude() * settings.dt * settings.dt;
        let position_error = ball.position_error + self.walls[wall].position_error(at);
        let is_touching = nearest.distance - ball.radius
            <= REST_SPEED * fall_distance + position_error + SEAM_TOLERANCE * ball.radius;
        if is_touching && self.normal_acceleration(row, wall, now, ball.external_acceleration) > 0.0
        {
            self.start_resting(row, wall, settings);
        } else {
            self.balls[row].leave_wall(wall);
        }
    }

    /// Tests for a half-space that does not rotate, or about its normal only.
    pub(super) fn has_fixed_normal(&self, wall: usize) -> bool {
        let wall = &self.walls[wall];
        let WallCollider::Plane { normal, .. } = wall.collider else { return false };
        wall.motion_at(0.0).is_none_or(|(motion, _)| {
            motion.angular_velocity.cross(normal).magnitude()
                <= 1e-12 * motion.angular_velocity.magnitude()
        })
    }

    /// Normal force per mass that a wall exerts on a ball with this external acceleration, at a
    /// time of its trajectory, in m/s²; negative if the ball would leave.
    pub(super) fn normal_acceleration(
        &self,
        row: usize,
        wall: usize,
        time: f64,
        external_acceleration: Vec3<f64>,
    ) -> f64 {
        let mut ball = self.balls[row];
        let candidates = SupportCandidates::only(wall);
        let ground = CurvedSupport {
            external_acceleration,
            ..support_of(&self.walls, &candidates, &ball, 0.0)
        };
        ball.position = ball.position_at(time);
        ball.velocity = ball.velocity_at(time);
        ball.trajectory.start = time;
        ground.contact(&BallState::of(&ball)).map_or(0.0, |contact| contact.normal_acceleration)
    }

    /// Updates the motion of a ball on a wall: starts its next segment.
    pub(super) fn update_support_motion(&mut self, row: usize, settings: &EventSettings) {
        let Some(support) = self.balls[row].trajectory.support else { return };
        let is_fixed = self.has_fixed_normal(support);
        let candidates = if is_fixed {
            SupportCandidates::only(support)
        } else {
            self.support_candidates(row, support, settings)
        };
        let Self { balls, walls, .. } = self;
        let min_step = min_step_at(balls[row].trajectory.support_steps, settings.dt);
        balls[row].trajectory.support_steps += u32::from(!is_fixed);
        let ground = support_of(walls, &candidates, &balls[row], min_step);
        let state = BallState::of(&balls[row]);
        balls[row].trajectory.version += 1;
        if is_fixed || ground.is_flat(&state) {
            Self::start_flat_segment(&ground, &mut balls[row], support, is_fixed, settings);
        } else if !Self::start_curved_segment(&ground, &mut balls[row], settings) {
            balls[row].leave_wall(support);
        }
        settings.add_cost(ground.cost.get());
    }

    /// Starts a segment on a flat surface, in closed form.
    fn start_flat_segment(
        ground: &CurvedSupport,
        ball: &mut EventBall,
        support: usize,
        is_fixed: bool,
        settings: &EventSettings,
    ) {
        let (wall, now) = (&ground.walls[support], ball.trajectory.start);
        let normal = wall.nearest(ball.position, now).normal;
        let material = wall.combined_with(ball.material);
        let normal_acceleration = -ball.external_acceleration.dot(normal);
        let contact_point = ball.position - normal * ball.radius;
        let support = FlatSupport {
            normal,
            surface_velocity: wall.surface_velocity(normal, contact_point, now),
            angular_velocity: wall.motion.map_or_else(Vec3::zero, |motion| motion.angular_velocity),
            tangential_acceleration: ball.external_acceleration + normal * normal_acceleration,
            normal_acceleration,
            radius: ball.radius,
            friction: material.friction,
            rolling_resistance: material.rolling_resistance,
            spinning_resistance: material.spinning_resistance,
            rotates: ball.rotation == BallRotation::Free,
        };
        let segment = support.segment(ball.velocity, ball.spin, settings.dt);
        ball.velocity += segment.velocity_change;
        ball.spin += segment.spin_change;
        ball.trajectory.acceleration = segment.acceleration;
        ball.trajectory.spin_acceleration = segment.spin_acceleration;
        let mut duration = segment.duration;
        if !is_fixed {
            // The support is rechecked before the ball has rolled far.
            let relative_speed = (ball.velocity - wall.velocity_at(ball.position, now)).magnitude();
            let max_distance = SUPPORT_CHECK * ball.radius;
            let check_time = (max_distance / relative_speed)
                .min((max_distance / segment.acceleration.magnitude()).sqrt());
            let min_step = ground.min_step.min(settings.dt - now);
            let check_time =
                check_time.max(SUPPORT_CHECK * settings.dt).max(min_step).min(settings.dt - now);
            // A slide ends at its exact time, however soon: a minimum step would reverse it, and
            // the next one back again.
            let face_end = end_of_face(ground, ball, normal, duration.min(check_time));
            duration = duration.min(face_end.max(min_step));
        }
        let end = now + duration;
        ball.trajectory.regime_end = if end < settings.dt { end } else { f64::INFINITY };
    }

    /// Starts a segment on a curved surface, integrated numerically. False if there is no normal
    /// force.
    fn start_curved_segment(
        ground: &CurvedSupport,
        ball: &mut EventBall,
        settings: &EventSettings,
    ) -> bool {
        let (start, dt) = (BallState::of(ball), settings.dt);
        let Some(start) = ground.without_residual_slip(start) else { return false };
        let remaining = dt - start.time;
        if remaining <= 0.0 {
            return true;
        }
        let Some(step) = ground.step(&start, remaining) else { return false };
        (ball.velocity, ball.spin) = (start.velocity, start.spin);
        let duration = step.end.time - start.time;
        if duration > 0.0 {
            let displacement = step.end.position - start.position;
            ball.trajectory.acceleration =
                (displacement / duration - start.velocity) * (2.0 / duration);
            ball.trajectory.end_state = Some(step.end);
        }
        ball.trajectory.leaves_support = step.leaves;
        let ends_before = step.leaves || step.end.time < dt;
        ball.trajectory.regime_end = if ends_before { step.end.time } else { f64::INFINITY };
        true
    }
}

impl EventBall {
    /// Starts free flight from a wall that does not press any more.
    fn leave_wall(&mut self, wall: usize) {
        self.fly_free();
        self.trajectory.left_wall = Some(wall);
    }
}

fn support_of<'a>(
    walls: &'a [super::Wall],
    candidates: &'a SupportCandidates,
    ball: &EventBall,
    min_step: f64,
) -> CurvedSupport<'a> {
    let EventBall { external_acceleration, radius, rotation, material, .. } = *ball;
    CurvedSupport {
        walls,
        candidates,
        external_acceleration,
        radius,
        rotation,
        material,
        min_step,
        cost: Cell::new(0),
    }
}

/// Time until a ball on a flat face reaches the end of it, or another face; `duration` if the face
/// continues.
fn end_of_face(ground: &CurvedSupport, ball: &EventBall, normal: Vec3<f64>, duration: f64) -> f64 {
    let now = ball.trajectory.start;
    let is_on_face = |t: f64| ground.has_normal(ball.position_at(now + t), now + t, normal);
    if is_on_face(duration) {
        return duration;
    }
    let (mut lo, mut hi) = (0.0, duration);
    for _ in 0..BISECTIONS {
        let middle = 0.5 * (lo + hi);
        if is_on_face(middle) { lo = middle } else { hi = middle }
    }
    hi
}

#[cfg(test)]
mod tests {
    use super::super::{Trajectory, Wall, WallSource};
    use super::*;
    use crate::broad::CollisionLayers;
    use crate::math::Point3;
    use crate::response::Material;
    use crate::shape::Triangle;

    /// Large triangle of a mesh.
    struct Face;

    impl WallSource for Face {
        fn planes(&self, _: &mut dyn FnMut(u32)) {}

        fn has_parts(&self) -> bool {
            true
        }

        fn near(&self, _: Point3<f64>, _: f64, visit: &mut dyn FnMut(u32, u32)) {
            visit(0, 0);
        }

        fn wall(&self, row: u32, _: u32) -> Option<Wall> {
            let corners = [[-9.0, 0.0, -9.0], [0.0, 0.0, 9.0], [9.0, 0.0, -9.0]].map(Point3::from);
            let collider = WallCollider::Triangle(Triangle { corners });
            let bounds = collider.bounds();
            let (motion, arrival_time, material) = (None, None, None);
            Some(Wall {
                collider,
                bounds,
                row,
                part: 0,
                motion,
                arrival_time,
                material,
                layers: CollisionLayers::ALL,
                relative_rounding: 0.0,
            })
        }
    }

    #[test]
    fn a_slide_on_a_face_ends_at_its_moment_and_the_ball_rolls() {
        let dt = 1.0 / 64.0;
        let mut counts = Vec::new();
        for slip in [1e-6, 1e-5, 1e-4, 1e-3] {
            let ball = EventBall {
                position: Point3::new(0.0, 0.2, 0.0),
                velocity: Vec3::new(1.0 + slip, 0.0, 0.0),
                spin: Vec3::new(0.0, 0.0, -1.0 / 0.2),
                external_acceleration: Vec3::new(0.0, -9.81, 0.0),
                radius: 0.2,
                inverse_mass: 1.0,
                material: Material { friction: 0.5, ..Material::default() },
                layers: CollisionLayers::ALL,
                rotation: BallRotation::Free,
                position_error: 1e-15,
                rotation_increment: Vec3::zero(),
                trajectory: Trajectory::default(),
            };
            let mut method = EventSolver { balls: vec![ball], ..EventSolver::default() };
            let settings = EventSettings {
                threads: 1,
                dt,
                iterations: 8,
                gravity: Vec3::new(0.0, 0.0, 0.0),
                source: &Face,
                budget_fraction: 1.0,
                cost: 0.into(),
            };
            assert!(method.run(&settings, &mut Vec::new()).is_empty());
            let ball = &method.balls[0];
            let spin_velocity = Vec3::unit_y().cross(ball.spin) * ball.radius;
            assert!((ball.velocity + spin_velocity).magnitude() < 1e-14, "{ball:?}");
            assert!((ball.velocity.x - (1.0 + slip * 5.0 / 7.0)).abs() < 1e-12, "{ball:?}");
            counts.push(ball.trajectory.support_steps);
        }
        // Support checks after each 0.01 m, and one at the start of rolling.
        assert!(counts.iter().all(|count| *count <= 5), "{counts:?}");
    }
}
