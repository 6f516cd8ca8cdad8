//! Rest at the start of a substep: on one wall, which [`support`](super::support) knows in
//! closed form, or in heaps, which are held by the [impulse method](super::hold).

use std::collections::BTreeSet;

use cgmath::{InnerSpace, Zero};

use super::wall::Wall;
use super::{EventDriven, PRESS, REST, SLOP, Settings};
use crate::contact::{Contact, Contacts};
use crate::math::{Vec3, direction_and_length};
use crate::shape::PointProjection;

/// Number of times that a ball is moved out of the wall that it is deepest in; of two that meet at
/// a right angle or more, it is out after two.
const MOST_MOVES: u32 = 16;

impl EventDriven {
    /// Finds what rests at the start of a substep.
    pub(super) fn begin_at_rest(&mut self, settings: &Settings) {
        self.near.wm.clear();
        for row in 0..self.balls.len() {
            self.begin_at_walls(row, settings);
        }
        let mut near = std::mem::take(&mut self.near);
        near.mm.retain(|c| {
            self.touches_ball(c, 0.0, settings).map_or(self.is_in_another(c), |speed| speed >= 0.0)
        });
        let mut touches = std::mem::take(&mut self.heap.touches);
        touches.clear();
        touches.resize(self.balls.len(), 0);
        near.wm.iter().for_each(|c| touches[c.b as usize] += 1);
        near.mm.iter().flat_map(|c| [c.a, c.b]).for_each(|row| touches[row as usize] += 2);
        near.wm.retain(|c| {
            let alone = touches[c.b as usize] == 1;
            if alone && self.lies_on(c, settings) {
                self.settle(c.b as usize, c.a as usize, settings);
            }
            !alone
        });
        self.heap.touches = touches;
        self.end_approach_to_walls(&near, settings);
        if !near.is_empty() {
            let mut warm = std::mem::take(&mut self.warm);
            self.hold(&mut near, 0.0, settings, &mut warm);
            self.warm = warm;
        }
        self.near = near;
    }

    /// Ends what is left of the approach of a ball to walls that it rests between, with no other
    /// ball. They would only hold it at the end of the substep, and by then it would be in them.
    fn end_approach_to_walls(&mut self, near: &Contacts<f64>, settings: &Settings) {
        let among: BTreeSet<u32> = near.mm.iter().flat_map(|c| [c.a, c.b]).collect();
        for walls in near.wm.chunk_by(|c, next| c.b == next.b) {
            let row = walls[0].b;
            // What a wall is moved by it takes along in the course of the substep.
            if among.contains(&row) || walls.iter().any(|c| self.goes(c.a as usize)) {
                continue;
            }
            let mut contacts = Contacts { wm: walls.to_vec(), ..Contacts::default() };
            self.heap.take(&mut contacts, &self.balls, self.period);
            let pull = self.balls[row as usize].pull.magnitude();
            self.end_collision(&mut contacts, 0.0, pull, settings);
            self.end_knot(&contacts, 0.0, REST * pull * settings.dt, settings);
            let ball = &mut self.balls[row as usize];
            (ball.velocity, ball.spin) = (self.heap.table.velocity[0], self.heap.table.spin[0]);
        }
    }

    /// Finds the walls that a ball touches at the start. Out of what it overlaps, but by what
    /// others may press it there, it is moved at once: overlap is not energy.
    fn begin_at_walls(&mut self, row: usize, settings: &Settings) {
        self.come_out(row, 0.0);
        let mut near = std::mem::take(&mut self.near.wm);
        let at = self.balls[row].position;
        self.name_walls(row, |wall| {
            let mtv = Vec3::zero();
            let contact = Contact { a: wall as u32, b: row as u32, part: 0, along: [0.0; 2], mtv };
            let least = if self.goes(wall) { f64::NEG_INFINITY } else { 0.0 };
            if self.touches_wall(&contact, 0.0, 0.0, settings).is_some_and(|speed| speed >= least)
                && (self.parts_of(row).is_empty() || !self.is_seam(row, wall, at, 0.0, settings))
            {
                near.push(contact);
            }
        });
        settings.count(2 * self.looks_at_walls(row));
        self.near.wm = near;
    }

    /// Moves a ball out of the walls that it is in.
    pub(super) fn come_out(&mut self, row: usize, now: f64) {
        if self.balls[row].inverse_mass <= 0.0 {
            return; // no wall holds it
        }
        self.move_out(row, now, self.parts_of(row).to_vec());
        // Half-spaces have the last word, and those that stay: behind them there is nothing.
        for goes in [true, false] {
            let planes = self.half_spaces().iter().copied();
            let planes = planes.filter(|wall| self.goes(*wall as usize) == goes).collect();
            self.move_out(row, now, planes);
        }
    }

    /// Moves a ball out of the wall that it is deepest in, until it is in none of these or, as
    /// between two that leave it no room, was moved often enough (von Neumann 1933, alternating
    /// projections).
    fn move_out(&mut self, row: usize, now: f64, walls: Vec<u32>) {
        for _ in 0..MOST_MOVES {
            let ball = &self.balls[row];
            let mut deepest = (SLOP * ball.radius, Vec3::zero());
            for wall in &walls {
                let wall = &self.walls[*wall as usize];
                if wall.at_least(ball.position, now) >= ball.radius {
                    continue;
                }
                let near = wall.nearest(ball.position, now);
                let overlap = ball.radius - near.distance;
                if overlap > deepest.0 {
                    deepest = (overlap, near.normal * overlap);
                }
            }
            if deepest.1.is_zero() {
                break;
            }
            self.balls[row].position += deepest.1;
        }
    }

    /// Tests if a wall goes through the substep.
    fn goes(&self, wall: usize) -> bool {
        self.walls[wall].there.is_some()
    }

    /// Tests if a ball that touches one wall and nothing else rests on it.
    fn lies_on(&self, contact: &Contact<f64>, settings: &Settings) -> bool {
        let (gap, speed) = self.wall_gap(contact, 0.0);
        let ball = &self.balls[contact.b as usize];
        let fall = ball.pull.magnitude() * settings.dt;
        let wall = &self.walls[contact.a as usize];
        // The speed of a wall that is moved from place to place jumps at the start; what lies
        // on it does not jump with it.
        let rest = if self.goes(contact.a as usize) { fall } else { REST * fall };
        let low = 0.5 * REST * REST * fall * settings.dt;
        let low = low + ball.rounding + wall.rounding(ball.position);
        let presses = self.pressure(contact.b as usize, contact.a as usize, 0.0, ball.pull) > 0.0;
        presses && gap <= low && speed.abs() <= rest
    }

    /// Speed by which a ball and a wall come together slower than what counts as rest, or
    /// nothing if they do not touch.
    pub(super) fn touches_wall(
        &self,
        contact: &Contact<f64>,
        now: f64,
        parting: f64,
        settings: &Settings,
    ) -> Option<f64> {
        let ball = &self.balls[contact.b as usize];
        let wall = &self.walls[contact.a as usize];
        let low = self.low(contact.b, settings) + wall.rounding(ball.position);
        if wall.at_least(ball.position, now) > ball.radius + low {
            return None;
        }
        let (gap, speed) = self.wall_gap(contact, now);
        let fall = ball.pull.magnitude() * settings.dt;
        let goes = self.goes(contact.a as usize) && now == 0.0;
        let slow = if goes { fall } else { PRESS * fall };
        (gap <= low && speed <= slow.max(parting)).then_some(slow + speed)
    }

    /// Speed by which two balls come together slower than what counts as rest, in the same way.
    pub(super) fn touches_ball(
        &self,
        contact: &Contact<f64>,
        parting: f64,
        settings: &Settings,
    ) -> Option<f64> {
        let (first, second) = (&self.balls[contact.a as usize], &self.balls[contact.b as usize]);
        let apart = direction_and_length(self.apart(first, second));
        let (normal, distance) = apart.unwrap_or((Vec3::unit_x(), 0.0));
        let speed = (second.velocity - first.velocity).dot(normal);
        let pull = first.pull.magnitude().max(second.pull.magnitude());
        let slow = PRESS * pull * settings.dt;
        let low = self.low(contact.a, settings).max(self.low(contact.b, settings));
        let gap = distance - first.radius - second.radius;
        (gap <= low && speed <= slow.max(parting)).then_some(slow + speed)
    }

    /// Tests if a ball is too deep in another one that it does not come nearer to: the two are
    /// pushed apart, however fast they part.
    fn is_in_another(&self, contact: &Contact<f64>) -> bool {
        let (first, second) = (&self.balls[contact.a as usize], &self.balls[contact.b as usize]);
        let apart = self.apart(first, second);
        let slop = SLOP * first.radius.min(second.radius);
        apart.magnitude() < first.radius + second.radius - slop
    }

    /// The widest gap that still counts as touching, in metres: a fall from this height
    /// gives the speed that counts as rest.
    fn low(&self, row: u32, settings: &Settings) -> f64 {
        let ball = &self.balls[row as usize];
        0.5 * PRESS * PRESS * ball.pull.magnitude() * settings.dt * settings.dt + ball.rounding
    }

    /// The gap between a wall and a ball, and how fast it grows.
    fn wall_gap(&self, contact: &Contact<f64>, now: f64) -> (f64, f64) {
        let ball = &self.balls[contact.b as usize];
        let wall: &Wall = &self.walls[contact.a as usize];
        let PointProjection { normal, distance, .. } = wall.nearest(ball.position, now);
        let way = wall.way(ball.position, now);
        (distance - ball.radius, (ball.velocity - way).dot(normal))
    }
}
