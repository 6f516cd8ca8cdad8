//! Balls that belong to somebody else, who moves them: the marbles of the world.

use super::kernels::squared;
use super::{BallId, Row, Swarm};
use crate::math::Vec3;

/// A ball that the swarm pushes but does not move.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Guest {
    pub ball: BallId,
    /// Center and radius in metres; velocity in m/s and inverse mass in 1/kg; radius times spin.
    pub at: Row,
    pub velocity: Row,
    pub rim: Row,
    /// Place and velocity at the begin of the step. Balls of the swarm move in substeps, and
    /// gravity pulls them in each; a guest that were at the end of its way in the first of them
    /// would let go of the balls on it, and be inside of those below it.
    pub from: [Row; 2],
    /// Changed in its velocity by the swarm in the last step.
    pub borne: bool,
    /// Still on its way, for all that it and the swarm did in the last step.
    pub restless: bool,
    /// Velocity that it brought, and its way, from rest in the first step in which it slept.
    pub asleep: Option<[Row; 2]>,
}

/// The part of the speed up to which a ball counts as lying still that means nothing: a guest that
/// brings as much more or less than before sleeps on, and one that the swarm does not bear and that
/// is slower counts as lying.
const STILL: f32 = 0.01;

impl Guest {
    /// One that begins its step where it ends.
    pub fn new(ball: BallId, at: Row, velocity: Row, rim: Row) -> Self {
        Self {
            ball,
            at,
            velocity,
            rim,
            from: [at, velocity],
            borne: false,
            restless: true,
            asleep: None,
        }
    }

    /// Place and velocity that it would have without the swarm when this part of the step is over.
    fn alone(&self, part: f32) -> [Row; 2] {
        let between = |from: Row, to: Row| {
            let mut row = to;
            if part < 1.0 {
                for axis in 0..3 {
                    row[axis] = from[axis] + (to[axis] - from[axis]) * part;
                }
            }
            row
        };
        [between(self.from[0], self.at), between(self.from[1], self.velocity)]
    }

    /// Finds where it began its step, by where the swarm left it. In the velocity that it brings,
    /// only what gravity gave it came bit by bit.
    fn find_begin(&mut self, at: &Row, velocity: &Row, dt: f32, gravity: Row) {
        let [way, faster] = [less(&self.at, at), less(&self.velocity, velocity)];
        let [own, before] = [squared(self.velocity).sqrt(), squared(*velocity).sqrt()];
        // A jump by less than half its radius passes through nobody.
        if squared(way).sqrt() <= (own + before) * dt + 0.5 * self.at[3] {
            self.from[0] = [at[0], at[1], at[2], self.at[3]];
        }
        let fall = squared(gravity) * dt;
        if fall > 0.0 {
            let part = (dot(&faster, &gravity) / fall).clamp(0.0, 1.0);
            for (speed, pull) in self.from[1].iter_mut().zip(gravity).take(3) {
                *speed -= pull * part * dt;
            }
        }
    }

    /// Says if a guest that sleeps does so in this step too: what it does from rest is the same as
    /// before, so what pulls it and holds it is. `at` is where it sleeps.
    fn sleeps_on(&mut self, at: &Row, before: &Self, lying: f32, dt: f32) -> bool {
        let now = [self.velocity, less(&self.at, at)];
        // The solver of the world learns over some steps what such contacts bear that come again
        // and again; a player pushes at once.
        let own_way = self.velocity.map(|speed| speed * dt);
        let (last, most) = match before.asleep {
            Some(_) => ([before.velocity, less(&before.at, at)], STILL * lying),
            None => ([before.velocity, own_way], lying),
        };
        let first = before.asleep.unwrap_or(now);
        let rounding = 2.0 * f32::EPSILON * (at[0].abs() + at[1].abs() + at[2].abs());
        let as_in = |then: &[Row; 2], most: f32| {
            // Overlap is moved apart as it comes; as far as what lies may go, that is no way.
            squared(less(&now[0], &then[0])).sqrt() <= most
                && squared(less(&now[1], &then[1])).sqrt() <= lying * dt + rounding
        };
        let spins = squared(self.rim).sqrt() > lying;
        let same = as_in(&last, most) && as_in(&first, lying) && !spins;
        self.asleep = same.then_some(first);
        same
    }
}

/// The first three numbers of one row, less those of another.
fn less(a: &Row, b: &Row) -> Row {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2], 0.0]
}

fn dot(a: &Row, b: &Row) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

impl Swarm {
    /// Guests before and after the last step, in the order of [`host`](Self::host).
    pub(crate) fn hosted(&self) -> impl Iterator<Item = (&Guest, Guest)> {
        self.guests.iter().map(|guest| {
            let Some(row) = self.ids.row(guest.ball) else { return (guest, *guest) };
            let rim = self.spin.get(row).copied().unwrap_or([0.0; 4]);
            let after = Guest { at: self.at[row], velocity: self.velocity[row], rim, ..*guest };
            (guest, after)
        })
    }

    /// Says where the guests are now, in a step of `dt` seconds. Each of them is a ball of the
    /// swarm.
    pub(crate) fn host(
        &mut self,
        guests: impl IntoIterator<Item = Guest>,
        dt: f32,
        gravity: Vec3<f32>,
    ) {
        let old = std::mem::take(&mut self.guests);
        self.guests.extend(guests);
        self.guest_slots.clear();
        self.guest_slots.resize(self.ids.slots().len().div_ceil(64), 0);
        let mut guests = std::mem::take(&mut self.guests);
        let (rough, lying) = (self.rough(), super::lying(gravity, self.mean));
        let pull = [gravity.x, gravity.y, gravity.z, 0.0];
        for (i, guest) in guests.iter_mut().enumerate() {
            let Some(row) = self.ids.row(guest.ball) else { continue };
            let slot = self.ids.slots()[row] as usize;
            if self.guest_slots.len() <= slot / 64 {
                self.guest_slots.resize(slot / 64 + 1, 0);
            }
            self.guest_slots[slot / 64] |= 1 << (slot % 64);
            let (at, velocity) = (self.at[row], self.velocity[row]);
            self.largest = self.largest.max(guest.at[3]);
            let before = old.get(i).filter(|before| before.ball == guest.ball);
            if velocity[3].is_sign_negative() {
                let unchanged = velocity[3] == -guest.velocity[3] && at[3] == guest.at[3];
                let sleeps = |before| guest.sleeps_on(&at, before, lying, dt);
                if unchanged && before.is_some_and(sleeps) {
                    continue;
                }
                self.wake(row);
            }
            if let Some(before) = before.filter(|_| rough) {
                guest.borne = less(&velocity, &before.velocity) != [0.0; 4];
                let moved = squared(less(&at, &before.from[0])).sqrt();
                let faster = squared(less(&guest.velocity, &before.velocity)).sqrt();
                let most = if guest.borne { lying } else { STILL * lying };
                // Walls and other marbles change its velocity, and the swarm changes it back.
                guest.restless = moved > most * dt || faster > lying;
                guest.find_begin(&at, &velocity, dt, pull);
            }
            // A drift counts the way of its velocity; whoever moves it besides is counted here.
            let [jump, way] = [less(&guest.from[0], &at), less(&guest.at, &guest.from[0])];
            let own = (squared(guest.from[1]).sqrt() + squared(pull).sqrt() * dt) * dt;
            self.budget[row] -= squared(jump).sqrt() + (squared(way).sqrt() - own).max(0.0);
            (self.at[row], self.velocity[row]) = (guest.from[0], guest.from[1]);
            if let Some(spin) = self.spin.get_mut(row) {
                *spin = guest.rim;
            }
        }
        self.guests = guests;
    }

    /// Says of each slab with guests how fast its own balls are at most, in m/s; infinitely, if
    /// a guest is on its way.
    pub(super) fn look_at_guests(&mut self) {
        for slab in &mut self.slabs {
            slab.fastest_own = None;
        }
        self.find_guests();
        let mut rest = &self.guest_rows[..];
        for slab in &mut self.slabs {
            let (its, others) = rest.split_at(rest.partition_point(|(row, _)| *row < slab.rows[1]));
            rest = others;
            if its.is_empty() || slab.asleep {
                continue;
            }
            if its.iter().any(|(_, guest)| self.guests[*guest as usize].restless) {
                slab.fastest_own = Some(f32::INFINITY);
                continue;
            }
            let (mut from, mut most) = (slab.rows[0], 0.0_f32);
            for to in its.iter().map(|(row, _)| *row).chain([slab.rows[1]]) {
                let rows = &self.velocity[from as usize..to as usize];
                most = rows.iter().fold(most, |most, velocity| most.max(squared(*velocity)));
                from = to + 1;
            }
            slab.fastest_own = Some(most.sqrt());
        }
    }

    /// Lists the rows of the guests, in order.
    pub(super) fn find_guests(&mut self) {
        self.guest_rows.clear();
        let rows = self.guests.iter().zip(0..);
        let rows = rows.filter_map(|(guest, i)| Some((self.ids.row(guest.ball)? as u32, i)));
        self.guest_rows.extend(rows);
        self.guest_rows.sort_unstable();
    }

    /// The guest in a row, among those that were listed.
    pub(super) fn guest_at<'a>(
        guests: &'a [Guest],
        guest_rows: &[(u32, u32)],
        row: u32,
    ) -> Option<&'a Guest> {
        let at = guest_rows.binary_search_by_key(&row, |(row, _)| *row).ok()?;
        guests.get(guest_rows[at].1 as usize)
    }

    pub(super) fn has_guest_slot(slot: u32, guest_slots: &[u64]) -> bool {
        let bits = guest_slots.get(slot as usize / 64);
        bits.is_some_and(|bits| bits >> (slot % 64) & 1 == 1)
    }

    /// Names new guests.
    pub(crate) fn invite(&mut self, count: usize) -> Result<Vec<BallId>, crate::Error> {
        let position = crate::math::Point3::new(0.0, 0.0, 0.0);
        self.add(&vec![super::Ball::new(position, super::RADII[0]); count])
    }

    /// Keeps the rows of the guests, before a drift.
    pub(super) fn keep_guests(&mut self) {
        let rows = self.guest_rows.iter().map(|(row, _)| *row as usize);
        self.kept_guests.clear();
        self.kept_guests.extend(rows.map(|row| [self.at[row], self.velocity[row]]));
    }

    /// Moves the guests in place of a drift, from one part of the step to another: as they do
    /// alone, and by what the swarm changed of it, so that a push moves no center of mass.
    pub(super) fn drift_guests(&mut self, [from, to]: [f32; 2], place: bool, time: f32) {
        for ((row, guest), [at, velocity]) in self.guest_rows.iter().zip(&self.kept_guests) {
            let (row, guest) = (*row as usize, &self.guests[*guest as usize]);
            if self.velocity[row][3].is_sign_negative() {
                continue;
            }
            let ([at_from, before], [at_to, after]) = (guest.alone(from), guest.alone(to));
            let pushed = less(velocity, if place { &after } else { &before });
            for axis in 0..3 {
                if place {
                    let way = at_to[axis] + (at[axis] - at_from[axis]);
                    self.at[row][axis] = way + pushed[axis] * time;
                } else {
                    self.velocity[row][axis] = after[axis] + pushed[axis];
                }
            }
        }
    }

    /// Takes back what the prediction of the lab's tier did to the guests. There, the velocity is
    /// the place before.
    pub(super) fn hold_guests_in_lab(&mut self) {
        for guest in &self.guests {
            let Some(row) = self.ids.row(guest.ball) else { continue };
            self.at[row] = guest.at;
            let [x, y, z, _] = guest.at;
            self.velocity[row] = [x, y, z, guest.velocity[3]];
            self.way[row] = 0.0;
        }
    }

    /// Gives the guests their velocities back, but for what is against the way that they were
    /// pushed.
    pub(super) fn part_with_guests_in_lab(&mut self, dt: f32) {
        for guest in &self.guests {
            let Some(row) = self.ids.row(guest.ball) else { continue };
            let ([x, y, z, _], [a, b, c, _]) = (self.at[row], guest.at);
            let push = [x - a, y - b, z - c];
            let [u, v, w, mass] = guest.velocity;
            let against = -(u * push[0] + v * push[1] + w * push[2]);
            let squared = push[0] * push[0] + push[1] * push[1] + push[2] * push[2];
            let part = if squared > 0.0 { (against / squared).clamp(0.0, 1.0 / dt) } else { 0.0 };
            self.velocity[row] = [u + push[0] * part, v + push[1] * part, w + push[2] * part, mass];
        }
    }
}
