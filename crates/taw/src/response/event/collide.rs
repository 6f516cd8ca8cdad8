//! Collisions: of two balls, of several at the same time, of a ball and a wall.

use std::cmp::Reverse;

use cgmath::{InnerSpace, Zero};

use super::resting_cluster::{PressedBy, RestingCluster};
use super::{
    Event, EventKind, EventSettings, EventSolver, Impact, MAX_DISSIPATIONS, MAX_FREEZES, Wall,
};
use crate::constraint::{ContactImpulse, tipped};
use crate::contact::ContactMaterial;
use crate::math::{RealVector, Vec3, normalize_and_length};
use crate::response::{ImpulseSample, InverseEffectiveMass, impact};

/// Scratch buffers for collisions at the same time.
#[derive(Clone, Debug, Default)]
pub(super) struct SimultaneousImpacts {
    pairs: Vec<(usize, usize)>,
    /// Events at that time other than collisions.
    deferred: Vec<Event>,
    rows: Vec<usize>,
    collisions: Vec<Collision>,
}

/// Collision of two balls.
#[derive(Clone, Copy, Debug)]
pub(super) struct Collision {
    pub a: usize,
    pub b: usize,
    pub impact: Impact<f64>,
    pub inverse_effective_mass: InverseEffectiveMass<f64>,
    pub material: ContactMaterial<f64>,
    /// Relaxation factor, beside the other collisions of the two balls.
    pub relaxation: f64,
    /// Accumulated impulse, in N s.
    pub impulse: ContactImpulse<f64>,
}

impl EventSolver {
    /// Detects inelastic collapse: collisions that would not end.
    pub(super) fn is_collapsing(&self, row: usize) -> bool {
        self.balls[row].trajectory.dissipation_count >= MAX_DISSIPATIONS
    }

    /// Ends an inelastic collapse: puts the balls to rest with all that touch them, however fast
    /// they separate just now. Between a wall and a heavy ball, a light one always separates from
    /// one of them.
    pub(super) fn stop_collapse(&mut self, rows: [usize; 2], time: f64, settings: &EventSettings) {
        let seeds = rows;
        let RestingCluster { mut rows, pressed_by, squeezed } =
            self.rest_cluster(seeds, f64::INFINITY, time, settings);
        let mut freezes = false;
        for row in rows.iter().copied() {
            let trajectory = &mut self.balls[row].trajectory;
            trajectory.dissipation_count = 0.0;
            // What walls squeeze gives way to those that move.
            let gives_way = squeezed && self.touches_moving_wall(row, time, settings);
            if !self.balls[row].is_frozen() && (gives_way || self.count_freeze(row, pressed_by)) {
                self.balls[row].freeze();
                freezes = true;
            }
        }
        if freezes {
            // What is frozen carries nothing on from a wall, so the others rest against it again: the
            // force that it had would drive them without a reaction.
            let again = self.rest_cluster(seeds, f64::INFINITY, time, settings);
            rows.extend(again.rows);
            rows.sort_unstable();
            rows.dedup();
        }
        for row in rows {
            self.predict(row, time, settings);
        }
    }

    /// Counts a freeze. True if the pressure on the ball will not end: only a body outside of its
    /// cluster could take the momentum.
    fn count_freeze(&mut self, row: usize, pressed_by: PressedBy) -> bool {
        let freeze_count = &mut self.balls[row].trajectory.freeze_count;
        let max = match pressed_by {
            PressedBy::FixedBody => MAX_FREEZES,
            PressedBy::Forces | PressedBy::Nothing => MAX_FREEZES - 1,
        };
        *freeze_count = (*freeze_count + 1).min(max);
        *freeze_count == MAX_FREEZES
    }

    /// Collides two balls, and all others that collide at the same time.
    ///
    /// Simultaneous collisions are solved together, so that no order is preferred: the mirror image
    /// of a scene has the mirror image of its future, to the bit.
    pub(super) fn collide_balls(
        &mut self,
        first: Event,
        other: usize,
        settings: &EventSettings,
        impacts: &mut Vec<Impact<f64>>,
    ) {
        let Event { time, row, .. } = first;
        let SimultaneousImpacts { mut pairs, mut deferred, mut rows, mut collisions } =
            std::mem::take(&mut self.simultaneous_impacts);
        pairs.clear();
        pairs.push((row.min(other), row.max(other)));
        self.add_simultaneous(first, &mut pairs, &mut deferred, settings);
        pairs.sort_unstable();
        pairs.dedup();
        rows.clear();
        rows.extend(pairs.iter().flat_map(|(a, b)| [*a, *b]));
        rows.sort_unstable();
        rows.dedup();
        for row in &rows {
            self.advance(*row, time);
        }
        collisions.clear();
        collisions.extend(pairs.iter().map(|(a, b)| self.collision(*a, *b, settings)));
        for row in &rows {
            self.balls[*row].fly_free();
        }
        if rows.len() == 2 * pairs.len() {
            for c in &mut collisions {
                let relative_velocity = self.relative_velocity(c);
                let impulse = impact(
                    c.impact.normal,
                    relative_velocity,
                    c.inverse_effective_mass,
                    c.material,
                );
                self.balls[c.a].apply_impulse(-impulse, -c.impact.normal);
                self.balls[c.b].apply_impulse(impulse, c.impact.normal);
                c.impact.impulse = impulse;
                self.record_impact(c, impulse, relative_velocity);
            }
        } else {
            self.solve_simultaneous(&mut collisions, &rows);
            for c in &mut collisions {
                c.impact.impulse = c.impulse.along(c.impact.normal);
            }
        }
        impacts.extend(collisions.iter().map(|c| c.impact));
        for row in &rows {
            self.predict(*row, time, settings);
        }
        self.simultaneous_impacts = SimultaneousImpacts { pairs, deferred, rows, collisions };
    }

    /// Adds the pairs of all other collisions at the time of an event.
    fn add_simultaneous(
        &mut self,
        first: Event,
        pairs: &mut Vec<(usize, usize)>,
        deferred: &mut Vec<Event>,
        settings: &EventSettings,
    ) {
        let Event { time, row, .. } = first;
        let mut add_all_of = |row: usize| {
            self.for_each_near(row, settings, |other| {
                let event = (other != row).then(|| self.predict_ball(row, other, time, settings));
                if let Some(Some((after, EventKind::BallImpact(..)))) = event
                    && time + after <= time
                {
                    pairs.push((row.min(other), row.max(other)));
                }
            });
        };
        if first.simultaneous {
            add_all_of(row);
        }
        while let Some(Reverse(event)) = self.queue.peek().copied()
            && event.time == time
        {
            self.queue.pop();
            let valid = self.balls[event.row].trajectory.version == event.version;
            match event.kind {
                EventKind::BallImpact(other, version)
                    if valid
                        && self.balls[other].trajectory.version == version
                        && !self.is_collapsing(event.row) =>
                {
                    pairs.push((event.row.min(other), event.row.max(other)));
                }
                _ => deferred.push(event),
            }
        }
        self.queue.extend(deferred.drain(..).map(Reverse));
    }

    /// Collision of two balls in contact, before its impulse.
    pub(super) fn collision(&mut self, a: usize, b: usize, settings: &EventSettings) -> Collision {
        let threshold = self.pressing_speed(a, b, settings);
        let (first, second) = (&self.balls[a], &self.balls[b]);
        let (normal, _) = normalize_and_length(self.center_offset(first, second))
            .unwrap_or((Vec3::unit_x(), 0.0));
        let approach_speed = -(second.velocity - first.velocity).dot(normal);
        let mut material = first.material.combined_with(second.material);
        let mut normal = normal;
        if approach_speed <= 2.0 * threshold {
            material.restitution = 0.0;
        } else {
            normal = tipped(normal, settings.gravity, [a as u32, b as u32]);
        }
        let inverse_effective_mass = InverseEffectiveMass::of(
            [first, second].map(|ball| (ball.inverse_mass, ball.rotation)),
        );
        self.balls[a].collide(material, settings);
        self.balls[b].collide(material, settings);
        let (first, second) = (a as u32, b as u32);
        let point = self.balls[a].position + normal * self.balls[a].radius;
        let zero = Vec3::zero();
        let impact = Impact {
            a: first,
            on_wall: false,
            b: second,
            part: 0,
            normal,
            point,
            approach_speed,
            slip: zero,
            impulse: zero,
        };
        let mut collision = Collision {
            a,
            b,
            impact,
            inverse_effective_mass,
            material,
            relaxation: 1.0,
            impulse: ContactImpulse::zero(),
        };
        collision.impact.slip = self.relative_velocity(&collision).reject_from(normal);
        collision
    }

    /// Relative velocity of the contact points, in m/s.
    pub(super) fn relative_velocity(&self, c: &Collision) -> Vec3<f64> {
        let (first, second) = (&self.balls[c.a], &self.balls[c.b]);
        let spin_velocities =
            first.spin_velocity(c.impact.normal) + second.spin_velocity(c.impact.normal);
        second.velocity - first.velocity + spin_velocities
    }

    /// Books the energy of a collision; `before` is the relative velocity before it.
    pub(super) fn record_impact(&mut self, c: &Collision, impulse: Vec3<f64>, before: Vec3<f64>) {
        if self.work.is_none() {
            return;
        }
        let after = self.relative_velocity(c);
        let fixed_velocity = |row: usize| {
            let ball = &self.balls[row];
            (ball.inverse_mass == 0.0).then_some(ball.velocity)
        };
        let fixed_velocity = [fixed_velocity(c.a), fixed_velocity(c.b)];
        if let Some(work) = &mut self.work {
            let (normal, mean_velocity) = (c.impact.normal, (before + after) * 0.5);
            work.record_impulse(ImpulseSample { impulse, normal, mean_velocity, fixed_velocity });
            work.collisions += 1;
        }
    }

    /// Collides a ball with a wall.
    pub(super) fn collide_with_wall(
        &mut self,
        row: usize,
        wall: usize,
        settings: &EventSettings,
    ) -> Impact<f64> {
        let ball = &mut self.balls[row];
        ball.fly_free();
        let now = ball.trajectory.start;
        let normal = self.walls[wall].nearest(ball.position, now).normal;
        let contact_point = ball.position - normal * ball.radius;
        let surface_velocity = self.walls[wall].surface_velocity(normal, contact_point, now);
        let relative_velocity = ball.velocity - surface_velocity + ball.spin_velocity(normal);
        let approach_speed = -relative_velocity.dot(normal);
        let inverse_effective_mass =
            InverseEffectiveMass::of_balls(0.0, ball.inverse_mass, ball.rotation);
        let material = self.walls[wall].combined_with(ball.material);
        ball.collide(material, settings);
        let impulse = impact(normal, relative_velocity, inverse_effective_mass, material);
        ball.apply_impulse(impulse, normal);
        if let Some(work) = &mut self.work {
            let after = ball.velocity - surface_velocity + ball.spin_velocity(normal);
            let mean_velocity = (relative_velocity + after) * 0.5;
            let fixed_velocity =
                [Some(surface_velocity), (ball.inverse_mass == 0.0).then_some(ball.velocity)];
            work.record_impulse(ImpulseSample { impulse, normal, mean_velocity, fixed_velocity });
            work.collisions += 1;
        }
        let Wall { row: a, part, .. } = self.walls[wall];
        let slip = relative_velocity.reject_from(normal);
        let (b, point) = (row as u32, contact_point);
        Impact { a, on_wall: true, b, part, normal, point, approach_speed, slip, impulse }
    }
}
