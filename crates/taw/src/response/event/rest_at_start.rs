//! Rest at the start of a substep: on one wall, in [closed form](super::flat_support), or in
//! clusters, by the [impulse solver](super::resting_cluster).

use std::collections::{BTreeMap, BTreeSet};

use cgmath::{InnerSpace, Zero};
use smallvec::SmallVec;

use super::wall::Wall;
use super::{EventBall, EventSettings, EventSolver, PRESS_SPEED, REST_SPEED, SLOP};
use crate::contact::{Contact, Contacts};
use crate::math::{UnionFind, Vec3, normalize_and_length};
use crate::shape::PointProjection;

/// Maximum number of projections out of the deepest wall; between two walls at a right angle or
/// more, two suffice.
const MAX_MOVES: u32 = 16;

impl EventSolver {
    /// Finds balls at rest at the start of a substep.
    pub(super) fn find_resting(&mut self, settings: &EventSettings) {
        self.near.wm.clear();
        let mut overlaps = Contacts::default();
        for row in 0..self.balls.len() {
            self.find_wall_contacts(row, settings, &mut overlaps.wm);
        }
        let mut near = std::mem::take(&mut self.near);
        self.find_crowds(&near.mm);
        near.mm.retain(|c| {
            let rests = self.crowds.are_together(c.a as usize, c.b as usize)
                || self
                    .ball_contact(c, 0.0, settings)
                    .map_or(self.is_deep_in_ball(c), |speed| speed >= 0.0);
            if !rests && self.overlaps_ball(c, settings) {
                overlaps.mm.push(*c);
            }
            rests
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
            } else if is_alone {
                self.part_from_wall(c, settings);
            }
            !is_alone
        });
        self.part_freely(&overlaps, &contact_counts, settings);
        self.cluster.contact_counts = contact_counts;
        self.end_approach_to_walls(&near, settings);
        self.end_approach_of_clusters(&near, settings);
        if !near.is_empty() {
            self.solve_all_resting(&mut near, settings);
        }
        self.near = near;
    }

    /// Ends the remaining approach of a ball to the walls between which it rests alone. The solver
    /// would only stop it at the end of the substep, when the ball would have penetrated them.
    fn end_approach_to_walls(&mut self, near: &Contacts<f64>, settings: &EventSettings) {
        let in_pairs: BTreeSet<u32> = near.mm.iter().flat_map(|c| [c.a, c.b]).collect();
        for walls in near.wm.chunk_by(|c, next| c.b == next.b) {
            let row = walls[0].b;
            // A moving wall carries the ball in the course of the substep.
            if in_pairs.contains(&row) || walls.iter().any(|c| self.is_moving(c.a as usize)) {
                continue;
            }
            let mut contacts = Contacts { wm: walls.to_vec(), ..Contacts::default() };
            self.cluster.gather(&mut contacts, (&self.balls, &self.walls), self.period);
            let max_acceleration = self.balls[row as usize].external_acceleration.magnitude();
            self.solve_inelastic_impact(&mut contacts, (0.0, false), max_acceleration, settings);
            self.end_remaining_approach(
                &contacts,
                (0.0, false),
                REST_SPEED * max_acceleration * settings.dt,
                settings,
            );
            let ball = &mut self.balls[row as usize];
            (ball.velocity, ball.spin) =
                (self.cluster.bodies.velocity[0], self.cluster.bodies.spin[0]);
        }
    }

    /// Ends the remaining approach in clusters of balls. Spread over the substep, it would let them
    /// into each other, and the solver would lift them out of that at the start: energy that the
    /// approach has not paid for yet if a collision breaks the cluster up before the end.
    fn end_approach_of_clusters(&mut self, near: &Contacts<f64>, settings: &EventSettings) {
        let mut sets = UnionFind::default();
        let pairs = near.mm.iter().map(|c| (Some(c.a as usize), c.b as usize));
        sets.build(pairs, self.balls.len());
        // Contacts of each cluster with an approach.
        let mut clusters: BTreeMap<u32, Contacts<f64>> = BTreeMap::new();
        for c in near
            .wm
            .iter()
            .filter(|c| self.approaches(self.wall_separation(c, 0.0).1, [c.b; 2], settings))
        {
            clusters.entry(sets.set_of(c.b as usize)).or_default();
        }
        for c in near
            .mm
            .iter()
            .filter(|c| self.approaches(self.ball_separation_speed(c), [c.a, c.b], settings))
        {
            clusters.entry(sets.set_of(c.b as usize)).or_default();
        }
        for row in (0..self.balls.len()).filter(|row| self.crowds.of(*row).is_some()) {
            clusters.remove(&sets.set_of(row)); // its normals are as good as random
        }
        if clusters.is_empty() {
            return;
        }
        for c in &near.wm {
            if let Some(contacts) = clusters.get_mut(&sets.set_of(c.b as usize)) {
                contacts.wm.push(*c);
            }
        }
        for c in &near.mm {
            if let Some(contacts) = clusters.get_mut(&sets.set_of(c.b as usize)) {
                contacts.mm.push(*c);
            }
        }
        for mut contacts in clusters.into_values().filter(|contacts| !contacts.mm.is_empty()) {
            self.cluster.gather(&mut contacts, (&self.balls, &self.walls), self.period);
            let max_acceleration = self.cluster.max_acceleration(&self.balls);
            self.end_approach(&mut contacts, 0.0, max_acceleration, None, settings);
            self.take_cluster_velocities();
        }
    }

    /// Tests if a separation speed of two balls, or of a ball and a wall, in m/s, is an approach that
    /// does not count as rest.
    fn approaches(&self, speed: f64, rows: [u32; 2], settings: &EventSettings) -> bool {
        let acceleration = |row: u32| self.balls[row as usize].external_acceleration.magnitude();
        speed < -REST_SPEED * acceleration(rows[0]).max(acceleration(rows[1])) * settings.dt
    }

    /// Finds the walls that a ball touches at the start. Penetration, beyond the slop, is resolved
    /// at once: it is no energy.
    fn find_wall_contacts(
        &mut self,
        row: usize,
        settings: &EventSettings,
        overlaps: &mut Vec<Contact<f64>>,
    ) {
        self.push_out_of_walls(row, 0.0);
        let mut near = std::mem::take(&mut self.near.wm);
        let EventBall { position: at, radius, .. } = self.balls[row];
        let range = (at, radius + self.contact_tolerance(row as u32, settings));
        let cost = self.for_each_wall_within(row, range, |wall| {
            let contact = Contact::with_wall(wall as u32, 0, row as u32);
            // A faster approach is an impact now, also of a wall that starts to move: spread over
            // the substep, it would let the wall in by half of its way.
            let margin = self.wall_contact(&contact, 0.0, 0.0, settings);
            if margin.is_none() && self.overlaps_wall(&contact, settings) {
                overlaps.push(contact);
            }
            if margin.is_some_and(|margin| margin >= 0.0)
                && (self.parts_of(row).is_empty() || !self.is_seam(row, wall, at, 0.0, settings))
            {
                near.push(contact);
            }
        });
        settings.add_cost(2 * cost);
        self.near.wm = near;
    }

    /// Pushes a ball out of the walls that it penetrates.
    pub(super) fn push_out_of_walls(&mut self, row: usize, now: f64) {
        if self.balls[row].inverse_mass <= 0.0 {
            return; // infinite mass: walls do not stop it
        }
        self.push_out(row, now, |method| {
            let EventBall { position, radius, .. } = method.balls[row];
            method.parts_within(row, (position, radius))
        });
        // Half-spaces come last, and static ones after moving ones: behind them there is nothing.
        for is_moving in [true, false] {
            self.push_out(row, now, |method| {
                let planes = method.planes_of(row);
                planes.filter(|wall| method.is_moving(*wall as usize) == is_moving).collect()
            });
        }
    }

    /// Projects a ball out of the deepest of some walls near it, again and again until it penetrates
    /// none, or too often, as in a gap that is too narrow (von Neumann 1933, alternating
    /// projections).
    fn push_out(&mut self, row: usize, now: f64, walls: impl Fn(&Self) -> SmallVec<[u32; 32]>) {
        for _ in 0..MAX_MOVES {
            let ball = &self.balls[row];
            let mut deepest = (SLOP * ball.radius, Vec3::zero());
            for wall in walls(self) {
                let wall = &self.walls[wall as usize];
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

    /// Tests if a ball touches a wall that moves through the substep.
    pub(super) fn touches_moving_wall(
        &self,
        row: usize,
        now: f64,
        settings: &EventSettings,
    ) -> bool {
        let mut touches = false;
        let EventBall { position, radius, .. } = self.balls[row];
        self.for_each_wall_within(row, (position, radius), |wall| {
            let contact = Contact::with_wall(wall as u32, 0, row as u32);
            touches |= self.is_moving(wall)
                && self.wall_contact(&contact, now, f64::INFINITY, settings).is_some();
        });
        touches
    }

    /// Tests if a wall moves through the substep.
    fn is_moving(&self, wall: usize) -> bool {
        self.walls[wall].arrival_time.is_some()
    }

    /// Tests if a ball that touches one wall and nothing else rests on it.
    fn rests_on(&self, contact: &Contact<f64>, settings: &EventSettings) -> bool {
        let (separation, speed) = self.wall_separation(contact, 0.0);
        let ball = &self.balls[contact.b as usize];
        let fall_speed = ball.external_acceleration.magnitude() * settings.dt;
        let wall = &self.walls[contact.a as usize];
        // The velocity of a moved wall jumps at the start; a ball on it does not jump with it.
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

    /// Margin of the approach speed of a ball and a wall below the resting speed, in m/s; none if
    /// they are not in contact.
    pub(super) fn wall_contact(
        &self,
        contact: &Contact<f64>,
        now: f64,
        max_separation_speed: f64,
        settings: &EventSettings,
    ) -> Option<f64> {
        let ball = &self.balls[contact.b as usize];
        let wall = &self.walls[contact.a as usize];
        let tolerance = self.wall_tolerance(contact, settings);
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

    /// Margin of the approach speed of two balls below the resting speed, in m/s; none if they are
    /// not in contact.
    pub(super) fn ball_contact(
        &self,
        contact: &Contact<f64>,
        max_separation_speed: f64,
        settings: &EventSettings,
    ) -> Option<f64> {
        let (first, second) = (&self.balls[contact.a as usize], &self.balls[contact.b as usize]);
        let center_offset = normalize_and_length(self.center_offset(first, second));
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

    /// Tests for penetration beyond the slop.
    pub(super) fn is_deep_in_ball(&self, contact: &Contact<f64>) -> bool {
        self.ball_separation(contact) < -self.ball_slop(contact)
    }

    /// Tests for penetration that counts as more than contact: such balls are separated, however
    /// slowly or fast they move apart.
    fn overlaps_ball(&self, contact: &Contact<f64>, settings: &EventSettings) -> bool {
        let tolerance = self
            .contact_tolerance(contact.a, settings)
            .max(self.contact_tolerance(contact.b, settings));
        self.ball_separation(contact) < -tolerance.min(self.ball_slop(contact))
    }

    fn ball_slop(&self, contact: &Contact<f64>) -> f64 {
        let radius = |row: u32| self.balls[row as usize].radius;
        SLOP * radius(contact.a).min(radius(contact.b))
    }

    /// Separation of two balls, in metres.
    fn ball_separation(&self, contact: &Contact<f64>) -> f64 {
        let (first, second) = (&self.balls[contact.a as usize], &self.balls[contact.b as usize]);
        self.center_offset(first, second).magnitude() - first.radius - second.radius
    }

    /// Separation speed of two balls, in m/s.
    fn ball_separation_speed(&self, contact: &Contact<f64>) -> f64 {
        let (first, second) = (&self.balls[contact.a as usize], &self.balls[contact.b as usize]);
        normalize_and_length(self.center_offset(first, second))
            .map_or(0.0, |(normal, _)| (second.velocity - first.velocity).dot(normal))
    }

    /// Tests for penetration of a ball into a wall that counts as more than contact.
    fn overlaps_wall(&self, contact: &Contact<f64>, settings: &EventSettings) -> bool {
        let (ball, wall) = (&self.balls[contact.b as usize], &self.walls[contact.a as usize]);
        wall.distance_lower_bound(ball.position, 0.0) < ball.radius
            && self.wall_separation(contact, 0.0).0 < -self.wall_tolerance(contact, settings)
    }

    /// Parts what overlaps below the slop and rests on nothing: nothing lies on it either, so that it
    /// needs no slop. Changes no velocity.
    fn part_freely(
        &mut self,
        overlaps: &Contacts<f64>,
        contact_counts: &[u32],
        settings: &EventSettings,
    ) {
        let is_free = |row: u32| contact_counts[row as usize] == 0;
        for contact in overlaps.mm.iter().filter(|c| is_free(c.a) && is_free(c.b)) {
            let (a, b) = (contact.a as usize, contact.b as usize);
            let separation = self.ball_separation(contact);
            let offset = self.center_offset(&self.balls[a], &self.balls[b]);
            let [first, second] = [a, b].map(|row| self.balls[row].inverse_mass);
            if separation < 0.0 && offset.magnitude() > 0.0 && first + second > 0.0 {
                let push = offset.normalize() * (separation / (first + second));
                self.balls[a].position += push * first;
                self.balls[b].position -= push * second;
            }
        }
        for contact in overlaps.wm.iter().filter(|c| is_free(c.b)) {
            self.part_from_wall(contact, settings);
        }
    }

    /// Moves a ball that touches nothing else out of a wall.
    fn part_from_wall(&mut self, contact: &Contact<f64>, settings: &EventSettings) {
        let row = contact.b as usize;
        if self.balls[row].inverse_mass > 0.0 && self.overlaps_wall(contact, settings) {
            let EventBall { position, radius, .. } = self.balls[row];
            let PointProjection { normal, distance, .. } =
                self.walls[contact.a as usize].nearest(position, 0.0);
            self.balls[row].position += normal * (radius - distance);
        }
    }

    /// Largest separation of a ball and a wall that counts as contact, in metres.
    fn wall_tolerance(&self, contact: &Contact<f64>, settings: &EventSettings) -> f64 {
        let ball = &self.balls[contact.b as usize];
        let wall: &Wall = &self.walls[contact.a as usize];
        self.contact_tolerance(contact.b, settings) + wall.position_error(ball.position)
    }

    /// Largest separation that counts as contact, in metres: the height of a fall that reaches the
    /// resting speed.
    pub(super) fn contact_tolerance(&self, row: u32, settings: &EventSettings) -> f64 {
        let ball = &self.balls[row as usize];
        0.5 * PRESS_SPEED
            * PRESS_SPEED
            * ball.external_acceleration.magnitude()
            * settings.dt
            * settings.dt
            + ball.position_error
    }

    /// Separation of a wall and a ball, in metres, and its rate, in m/s.
    fn wall_separation(&self, contact: &Contact<f64>, now: f64) -> (f64, f64) {
        let ball = &self.balls[contact.b as usize];
        let wall: &Wall = &self.walls[contact.a as usize];
        let PointProjection { normal, distance, .. } = wall.nearest(ball.position, now);
        let wall_velocity = wall.velocity_at(ball.position, now);
        (distance - ball.radius, (ball.velocity - wall_velocity).dot(normal))
    }
}
