//! Rest at the start of a substep: on one wall, which [`support`](super::flat_support) knows in
//! closed form, or in heaps, which are held by the [impulse method](super::resting_cluster).

use std::collections::BTreeSet;

use cgmath::{InnerSpace, Zero};

use super::wall::Wall;
use super::{EventDriven, EventSettings, PRESS_SPEED, REST_SPEED, SLOP};
use crate::contact::{Contact, Contacts};
use crate::math::{Vec3, direction_and_length};
use crate::shape::Nearest;

/// Number of times that a ball is moved out of the wall that it is deepest in; of two that meet at
/// a right angle or more, it is out after two.
const MAX_MOVES: u32 = 16;

impl EventDriven {
    /// Finds what rests at the start of a substep.
    pub(super) fn find_resting(&mut self, settings: &EventSettings) {
        self.near.wm.clear();
        for row in 0..self.balls.len() {
            self.find_wall_contacts(row, settings);
        }
        let mut near = std::mem::take(&mut self.near);
        near.mm.retain(|c| {
            self.ball_contact(c, 0.0, settings)
                .map_or(self.is_deep_in_ball(c), |speed| speed >= 0.0)
        });
        let mut contact_counts = std::mem::take(&mut self.cluster.contact_counts);
        contact_counts.clear();
        contact_counts.resize(self.balls.len(), 0);
        near.wm.iter().for_each(|c| contact_counts[c.b as usize] += 1);
        near.mm.iter().flat_map(|c| [c.a, c.b]).for_each(|row| contact_counts[row as usize] += 2);
        near.wm.retain(|c| {
            let is_alone = contact_counts[c.b as usize] == 1;
            if is_alone && self.rests_on(c, settings) {
                self.start_resting(c.b as usize, c.a as usize, settings);
            }
            !is_alone
        });
        self.cluster.contact_counts = contact_counts;
        self.end_approach_to_walls(&near, settings);
        if !near.is_empty() {
            let mut impulse_cache = std::mem::take(&mut self.impulse_cache);
            self.solve_resting(&mut near, 0.0, settings, &mut impulse_cache);
            self.impulse_cache = impulse_cache;
        }
        self.near = near;
    }

    /// Ends what is left of the approach of a ball to walls that it rests between, with no other
    /// ball. They would only hold it at the end of the substep, and by then it would be in them.
    fn end_approach_to_walls(&mut self, near: &Contacts<f64>, settings: &EventSettings) {
        let in_pairs: BTreeSet<u32> = near.mm.iter().flat_map(|c| [c.a, c.b]).collect();
        for walls in near.wm.chunk_by(|c, next| c.b == next.b) {
            let row = walls[0].b;
            // What a wall is moved by it takes along in the course of the substep.
            if in_pairs.contains(&row) || walls.iter().any(|c| self.is_moving(c.a as usize)) {
                continue;
            }
            let mut contacts = Contacts { wm: walls.to_vec(), ..Contacts::default() };
            self.cluster.gather(&mut contacts, &self.balls, self.period);
            let max_acceleration = self.balls[row as usize].external_acceleration.magnitude();
            self.solve_inelastic_impact(&mut contacts, 0.0, max_acceleration, settings);
            self.end_remaining_approach(
                &contacts,
                0.0,
                REST_SPEED * max_acceleration * settings.dt,
                settings,
            );
            let ball = &mut self.balls[row as usize];
            (ball.velocity, ball.spin) =
                (self.cluster.bodies.velocity[0], self.cluster.bodies.spin[0]);
        }
    }

    /// Finds the walls that a ball touches at the start. Out of what it overlaps, but by what
    /// others may press it there, it is moved at once: overlap is not energy.
    fn find_wall_contacts(&mut self, row: usize, settings: &EventSettings) {
        self.push_out_of_walls(row, 0.0);
        let mut near = std::mem::take(&mut self.near.wm);
        let at = self.balls[row].position;
        self.for_each_wall(row, |wall| {
            let mtv = Vec3::zero();
            let contact = Contact { a: wall as u32, b: row as u32, part: 0, along: [0.0; 2], mtv };
            let min_speed = if self.is_moving(wall) { f64::NEG_INFINITY } else { 0.0 };
            if self
                .wall_contact(&contact, 0.0, 0.0, settings)
                .is_some_and(|speed| speed >= min_speed)
                && (self.parts_of(row).is_empty() || !self.is_seam(row, wall, at, 0.0, settings))
            {
                near.push(contact);
            }
        });
        settings.add_cost(2 * self.wall_cost(row));
        self.near.wm = near;
    }

    /// Moves a ball out of the walls that it is in.
    pub(super) fn push_out_of_walls(&mut self, row: usize, now: f64) {
        if self.balls[row].inverse_mass <= 0.0 {
            return; // no wall holds it
        }
        self.push_out(row, now, self.parts_of(row).to_vec());
        // Half-spaces have the last word, and those that stay: behind them there is nothing.
        for is_moving in [true, false] {
            let planes = self.half_spaces().iter().copied();
            let planes =
                planes.filter(|wall| self.is_moving(*wall as usize) == is_moving).collect();
            self.push_out(row, now, planes);
        }
    }

    /// Moves a ball out of the wall that it is deepest in, until it is in none of these or, as
    /// between two that leave it no room, was moved often enough (von Neumann 1933, alternating
    /// projections).
    fn push_out(&mut self, row: usize, now: f64, walls: Vec<u32>) {
        for _ in 0..MAX_MOVES {
            let ball = &self.balls[row];
            let mut deepest = (SLOP * ball.radius, Vec3::zero());
            for wall in &walls {
                let wall = &self.walls[*wall as usize];
                if wall.distance_lower_bound(ball.position, now) >= ball.radius {
                    continue;
                }
                let near = wall.nearest(ball.position, now);
                let penetration = ball.radius - near.distance;
                if penetration > deepest.0 {
                    deepest = (penetration, near.normal * penetration);
                }
            }
            if deepest.1.is_zero() {
                break;
            }
            self.balls[row].position += deepest.1;
        }
    }

    /// Tests if a wall goes through the substep.
    fn is_moving(&self, wall: usize) -> bool {
        self.walls[wall].arrival_time.is_some()
    }

    /// Tests if a ball that touches one wall and nothing else rests on it.
    fn rests_on(&self, contact: &Contact<f64>, settings: &EventSettings) -> bool {
        let (separation, speed) = self.wall_separation(contact, 0.0);
        let ball = &self.balls[contact.b as usize];
        let fall_speed = ball.external_acceleration.magnitude() * settings.dt;
        let wall = &self.walls[contact.a as usize];
        // The speed of a wall that is moved from place to place jumps at the start; what lies
        // on it does not jump with it.
        let rest_threshold =
            if self.is_moving(contact.a as usize) { fall_speed } else { REST_SPEED * fall_speed };
        let tolerance = 0.5 * REST_SPEED * REST_SPEED * fall_speed * settings.dt;
        let tolerance = tolerance + ball.position_error + wall.position_error(ball.position);
        let is_pressed = self.normal_acceleration(
            contact.b as usize,
            contact.a as usize,
            0.0,
            ball.external_acceleration,
        ) > 0.0;
        is_pressed && separation <= tolerance && speed.abs() <= rest_threshold
    }

    /// Speed by which a ball and a wall come together slower than what counts as rest, or
    /// nothing if they do not touch.
    pub(super) fn wall_contact(
        &self,
        contact: &Contact<f64>,
        now: f64,
        max_separation_speed: f64,
        settings: &EventSettings,
    ) -> Option<f64> {
        let ball = &self.balls[contact.b as usize];
        let wall = &self.walls[contact.a as usize];
        let tolerance =
            self.contact_tolerance(contact.b, settings) + wall.position_error(ball.position);
        if wall.distance_lower_bound(ball.position, now) > ball.radius + tolerance {
            return None;
        }
        let (separation, speed) = self.wall_separation(contact, now);
        let fall_speed = ball.external_acceleration.magnitude() * settings.dt;
        let is_moving = self.is_moving(contact.a as usize) && now == 0.0;
        let threshold = if is_moving { fall_speed } else { PRESS_SPEED * fall_speed };
        (separation <= tolerance && speed <= threshold.max(max_separation_speed))
            .then_some(threshold + speed)
    }

    /// Speed by which two balls come together slower than what counts as rest, in the same way.
    pub(super) fn ball_contact(
        &self,
        contact: &Contact<f64>,
        max_separation_speed: f64,
        settings: &EventSettings,
    ) -> Option<f64> {
        let (first, second) = (&self.balls[contact.a as usize], &self.balls[contact.b as usize]);
        let center_offset = direction_and_length(self.center_offset(first, second));
        let (normal, distance) = center_offset.unwrap_or((Vec3::unit_x(), 0.0));
        let speed = (second.velocity - first.velocity).dot(normal);
        let max_acceleration =
            first.external_acceleration.magnitude().max(second.external_acceleration.magnitude());
        let threshold = PRESS_SPEED * max_acceleration * settings.dt;
        let tolerance = self
            .contact_tolerance(contact.a, settings)
            .max(self.contact_tolerance(contact.b, settings));
        let separation = distance - first.radius - second.radius;
        (separation <= tolerance && speed <= threshold.max(max_separation_speed))
            .then_some(threshold + speed)
    }

    /// Tests if a ball is too deep in another one that it does not come nearer to: the two are
    /// pushed apart, however fast they part.
    fn is_deep_in_ball(&self, contact: &Contact<f64>) -> bool {
        let (first, second) = (&self.balls[contact.a as usize], &self.balls[contact.b as usize]);
        let center_offset = self.center_offset(first, second);
        let slop = SLOP * first.radius.min(second.radius);
        center_offset.magnitude() < first.radius + second.radius - slop
    }

    /// The widest gap that still counts as touching, in metres: a fall from this height
    /// gives the speed that counts as rest.
    fn contact_tolerance(&self, row: u32, settings: &EventSettings) -> f64 {
        let ball = &self.balls[row as usize];
        0.5 * PRESS_SPEED
            * PRESS_SPEED
            * ball.external_acceleration.magnitude()
            * settings.dt
            * settings.dt
            + ball.position_error
    }

    /// The gap between a wall and a ball, and how fast it grows.
    fn wall_separation(&self, contact: &Contact<f64>, now: f64) -> (f64, f64) {
        let ball = &self.balls[contact.b as usize];
        let wall: &Wall = &self.walls[contact.a as usize];
        let Nearest { normal, distance, .. } = wall.nearest(ball.position, now);
        let wall_velocity = wall.velocity_at(ball.position, now);
        (distance - ball.radius, (ball.velocity - wall_velocity).dot(normal))
    }
}
