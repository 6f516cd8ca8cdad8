//! Segments of a substep in which the accelerations of a resting cluster count as constant: balls
//! that roll over each other turn the normals of their contacts, and so the forces.

use cgmath::InnerSpace;

use super::cluster::Cluster;
use super::{EventSettings, EventSolver};
use crate::contact::{Contact, Contacts};
use crate::math::{Point3, UnionFind, Vec3, normalize_and_length};
use crate::response::KeyedByContact;

/// Largest rotation of a normal in a segment, in radians, as on curved walls.
const MAX_TURN: f64 = 0.02;
/// Bisections of a time to find where a normal has turned that far.
const BISECTIONS: u32 = 8;
/// A segment is at least this fraction of the time that is left, one over their largest number, which limits the
/// cost of fast balls.
const MAX_SEGMENTS: f64 = 16.0;

impl Cluster {
    /// Time in which no normal of two gathered balls turns by more than [`MAX_TURN`] at the velocities
    /// that they have now, in seconds: the remaining time or a whole part of it, at least a
    /// sixteenth.
    fn segment(&self, contacts: &Contacts<f64>, remaining: f64) -> f64 {
        let bodies = &self.bodies;
        let rate = |c: &Contact<f64>| {
            let (a, b) = (c.a as usize, c.b as usize);
            let center_offset =
                bodies.period.minimum_image(bodies.position[b] - bodies.position[a]);
            turn_rate(center_offset, bodies.velocity[b] - bodies.velocity[a])
        };
        let fastest = contacts.mm.iter().map(rate).fold(0.0, f64::max);
        remaining / (fastest * remaining / MAX_TURN).ceil().clamp(1.0, MAX_SEGMENTS)
    }
}

impl EventSolver {
    /// Time in which no normal of a gathered cluster turns too far, in seconds; see
    /// [`Cluster::segment`]. Normals of walls turn where a ball reaches an edge.
    pub(super) fn segment(&self, contacts: &Contacts<f64>, now: f64, remaining: f64) -> f64 {
        let Cluster { bodies, rows, .. } = &self.cluster;
        if rows.iter().any(|row| self.crowds.of(*row as usize).is_some()) {
            return remaining;
        }
        let mut longest = remaining;
        for c in &contacts.wm {
            let (wall, b) = (c.a as usize, c.b as usize);
            let ball = (bodies.position[b], bodies.velocity[b]);
            let turns = |time: f64| self.turns_on_wall(wall, ball, now, time);
            if turns(longest) {
                let mut start = 0.0;
                for _ in 0..BISECTIONS {
                    let middle = 0.5 * (start + longest);
                    if turns(middle) { longest = middle } else { start = middle }
                }
            }
        }
        let shortest = remaining / MAX_SEGMENTS;
        longest.max(shortest).min(self.cluster.segment(contacts, remaining))
    }

    /// Tests if the normal of a wall turns too far for one segment below a ball, given by position and
    /// velocity, that moves on for some time, in seconds.
    fn turns_on_wall(
        &self,
        wall: usize,
        (position, velocity): (Point3<f64>, Vec3<f64>),
        now: f64,
        time: f64,
    ) -> bool {
        if self.has_fixed_normal(wall) {
            return false;
        }
        let normal =
            |after: f64| self.walls[wall].nearest(position + velocity * after, now + after).normal;
        (normal(time) - normal(0.0)).magnitude() > MAX_TURN
    }

    /// Solves for the accelerations of all resting clusters at the start of a substep. Those whose
    /// normals turn in it do not shorten the segments of the others.
    pub(super) fn solve_all_resting(
        &mut self,
        contacts: &mut Contacts<f64>,
        settings: &EventSettings,
    ) {
        let mut turning = self.take_turning(contacts, settings.dt);
        let mut impulse_cache = std::mem::take(&mut self.impulse_cache);
        if turning.is_empty() {
            self.solve_resting(contacts, 0.0, settings, &mut impulse_cache);
        } else {
            let mut turning_cache = impulse_cache.clone();
            self.solve_resting(contacts, 0.0, settings, &mut impulse_cache);
            self.solve_resting(&mut turning, 0.0, settings, &mut turning_cache);
            impulse_cache.append(&mut turning_cache);
            impulse_cache.sort_unstable_by_key(KeyedByContact::key);
        }
        self.impulse_cache = impulse_cache;
    }

    /// Takes the contacts of clusters whose normals turn too far for one segment of `dt` seconds.
    fn take_turning(&self, contacts: &mut Contacts<f64>, dt: f64) -> Contacts<f64> {
        let turns = |c: &Contact<f64>| {
            let (first, second) = (&self.balls[c.a as usize], &self.balls[c.b as usize]);
            let center_offset = self.center_offset(first, second);
            turn_rate(center_offset, second.velocity - first.velocity) * dt > MAX_TURN
        };
        let turns_on_wall = |c: &&Contact<f64>| {
            let ball = &self.balls[c.b as usize];
            self.turns_on_wall(c.a as usize, (ball.position, ball.velocity), 0.0, dt)
        };
        let on_walls: Vec<_> = contacts.wm.iter().filter(turns_on_wall).map(|c| c.b).collect();
        let mut turning = Contacts::default();
        if on_walls.is_empty() && !contacts.mm.iter().any(turns) {
            return turning;
        }
        let mut sets = UnionFind::default();
        let pairs = contacts.mm.iter().map(|c| (Some(c.a as usize), c.b as usize));
        sets.build(pairs, self.balls.len());
        let mut is_turning = vec![false; self.balls.len()];
        let in_pairs = contacts.mm.iter().filter(|c| turns(c)).map(|c| c.b);
        for row in in_pairs.chain(on_walls) {
            is_turning[sets.set_of(row as usize) as usize] = true;
        }
        for row in (0..self.balls.len()).filter(|row| self.crowds.of(*row).is_some()) {
            is_turning[sets.set_of(row) as usize] = false;
        }
        let mut take = |c: &Contact<f64>| is_turning[sets.set_of(c.b as usize) as usize];
        turning.wm.extend(contacts.wm.extract_if(.., |c| take(c)));
        turning.mm.extend(contacts.mm.extract_if(.., |c| take(c)));
        turning
    }
}

/// Angular speed of the normal of two balls, in rad/s.
fn turn_rate(center_offset: Vec3<f64>, relative_velocity: Vec3<f64>) -> f64 {
    normalize_and_length(center_offset)
        .map_or(0.0, |(normal, distance)| normal.cross(relative_velocity).magnitude() / distance)
}
