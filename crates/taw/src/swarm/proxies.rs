//! Proxies of the marbles of the world, which its own solver moves, in the swarm.

use super::kernels::squared;
use super::rows::{dot, less};
use super::{BallId, Swarm};
use crate::math::{Row, Scalar, Vec3, length};
use crate::motion::rest::sleep_speed;

/// A ball that the swarm pushes but does not move.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Proxy<S> {
    pub ball: BallId,
    /// Center and radius in metres; velocity in m/s and inverse mass in 1/kg; radius times spin.
    pub at: Row<S>,
    pub velocity: Row<S>,
    pub spin_velocity: Row<S>,
    /// Place and velocity at the begin of the step. Balls of the swarm move in substeps, and
    /// gravity pulls them in each; a proxy at the end of its path in the first of them
    /// would let go of the balls on it, and be inside of those below it.
    pub from: [Row<S>; 2],
    /// Changed in its velocity by the swarm in the last step.
    pub borne: bool,
    /// Set if it moves, for all that it and the swarm did in the last step.
    pub moving: bool,
    /// Velocity that it brought, and its displacement, from rest in the first step in which it
    /// slept.
    pub asleep: Option<[Row<S>; 2]>,
}

/// Insignificant fraction of the [sleep speed](sleep_speed): a proxy that brings as much
/// more or less than before sleeps on, and one that the swarm does not bear and that is slower
/// counts as lying.
const STILL: f64 = 0.01;

impl<S: Scalar> Proxy<S> {
    /// One that begins its step where it ends.
    pub fn new(ball: BallId, at: Row<S>, velocity: Row<S>, spin_velocity: Row<S>) -> Self {
        Self {
            ball,
            at,
            velocity,
            spin_velocity,
            from: [at, velocity],
            borne: false,
            moving: true,
            asleep: None,
        }
    }

    /// Place and velocity that it would have without the swarm when this part of the step is over.
    fn alone(&self, part: S) -> [Row<S>; 2] {
        let between = |from: Row<S>, to: Row<S>| {
            let mut row = to;
            if part < S::one() {
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
    fn find_begin(&mut self, at: &Row<S>, velocity: &Row<S>, dt: S, gravity: Row<S>) {
        let [displacement, faster] = [less(&self.at, at), less(&self.velocity, velocity)];
        let [own, before] = [squared(self.velocity).sqrt(), squared(*velocity).sqrt()];
        // A jump by less than half its radius passes through nobody.
        if squared(displacement).sqrt() <= (own + before) * dt + S::from_f64(0.5) * self.at[3] {
            self.from[0] = [at[0], at[1], at[2], self.at[3]];
        }
        let fall = squared(gravity) * dt;
        if fall.is_normal() {
            let part = (dot(&faster, &gravity) / fall).clamp(S::zero(), S::one());
            for (speed, pull) in self.from[1].iter_mut().zip(gravity).take(3) {
                *speed -= pull * part * dt;
            }
        }
    }

    /// Tests if a proxy that sleeps does so in this step too: what it does from rest is the same as
    /// before, so what pulls it and holds it is. `at` is where it sleeps.
    fn sleeps_on(&mut self, at: &Row<S>, before: &Self, sleep_speed: S, dt: S) -> bool {
        let now = [self.velocity, less(&self.at, at)];
        // The solver of the world learns over some steps what such contacts bear that come again
        // and again; a player pushes at once.
        let own_way = self.velocity.map(|speed| speed * dt);
        let (last, most) = match before.asleep {
            Some(_) => ([before.velocity, less(&before.at, at)], S::from_f64(STILL) * sleep_speed),
            None => ([before.velocity, own_way], sleep_speed),
        };
        let first = before.asleep.unwrap_or(now);
        let rounding = S::from_f64(2.0) * S::epsilon() * (at[0].abs() + at[1].abs() + at[2].abs());
        let as_in = |then: &[Row<S>; 2], most: S| {
            // Overlap is moved apart as it comes; as far as what lies may go, that is no way.
            squared(less(&now[0], &then[0])).sqrt() <= most
                && squared(less(&now[1], &then[1])).sqrt() <= sleep_speed * dt + rounding
        };
        let spins = squared(self.spin_velocity).sqrt() > sleep_speed;
        let same = as_in(&last, most) && as_in(&first, sleep_speed) && !spins;
        self.asleep = same.then_some(first);
        same
    }
}

impl<S: Scalar> Swarm<S> {
    /// Proxies before and after the last step, in the order of [`set_proxies`](Self::set_proxies).
    pub(crate) fn proxies_and_results(&self) -> impl Iterator<Item = (&Proxy<S>, Proxy<S>)> {
        self.proxies.iter().map(|proxy| {
            let Some(row) = self.ids.row(proxy.ball.0) else { return (proxy, *proxy) };
            let spin_velocity = self.spin.get(row).copied().unwrap_or([S::zero(); 4]);
            let after =
                Proxy { at: self.at[row], velocity: self.velocity[row], spin_velocity, ..*proxy };
            (proxy, after)
        })
    }

    /// Sets where the proxies are now, in a step of `dt` seconds. Each of them is a ball of the
    /// swarm.
    pub(crate) fn set_proxies(
        &mut self,
        proxies: impl IntoIterator<Item = Proxy<S>>,
        dt: S,
        gravity: Vec3<S>,
    ) {
        let old = std::mem::take(&mut self.proxies);
        self.proxies.extend(proxies);
        self.body_slots.clear();
        let mut proxies = std::mem::take(&mut self.proxies);
        let (has_friction, sleep_speed) =
            (self.has_friction(), sleep_speed(length(gravity), self.mean_radius));
        let pull = [gravity.x, gravity.y, gravity.z, S::zero()];
        for (i, proxy) in proxies.iter_mut().enumerate() {
            let Some(row) = self.ids.row(proxy.ball.0) else { continue };
            self.body_slots.insert(self.ids.slots()[row]);
            let (at, velocity) = (self.at[row], self.velocity[row]);
            self.max_radius = self.max_radius.max(proxy.at[3]);
            let before = old.get(i).filter(|before| before.ball == proxy.ball);
            if velocity[3].is_sign_negative() {
                let unchanged = velocity[3] == -proxy.velocity[3] && at[3] == proxy.at[3];
                let sleeps = |before| proxy.sleeps_on(&at, before, sleep_speed, dt);
                if unchanged && before.is_some_and(sleeps) {
                    continue;
                }
                self.wake(row);
            }
            if let Some(before) = before.filter(|_| has_friction) {
                proxy.borne = less(&velocity, &before.velocity) != [S::zero(); 4];
                let moved = squared(less(&at, &before.from[0])).sqrt();
                let faster = squared(less(&proxy.velocity, &before.velocity)).sqrt();
                let most = if proxy.borne { sleep_speed } else { S::from_f64(STILL) * sleep_speed };
                // Walls and other marbles change its velocity, and the swarm changes it back.
                proxy.moving = moved > most * dt || faster > sleep_speed;
                proxy.find_begin(&at, &velocity, dt, pull);
            }
            // Integration counts the displacement by its velocity; any other is counted here.
            let [jump, displacement] = [less(&proxy.from[0], &at), less(&proxy.at, &proxy.from[0])];
            let own = (squared(proxy.from[1]).sqrt() + squared(pull).sqrt() * dt) * dt;
            self.skin_left[row] -=
                squared(jump).sqrt() + (squared(displacement).sqrt() - own).max(S::zero());
            (self.at[row], self.velocity[row]) = (proxy.from[0], proxy.from[1]);
            if let Some(spin) = self.spin.get_mut(row) {
                *spin = proxy.spin_velocity;
            }
        }
        self.proxies = proxies;
    }

    /// Finds for each chunk with proxies the largest speed of its own balls, in m/s; infinity, if a
    /// proxy moves.
    pub(super) fn measure_speeds_beside_proxies(&mut self) {
        for chunk in &mut self.chunks {
            chunk.fastest_own = None;
        }
        self.list_proxy_rows();
        let mut rest = &self.scratch.proxy_rows[..];
        for chunk in &mut self.chunks {
            let (its, others) =
                rest.split_at(rest.partition_point(|(row, _)| *row < chunk.rows[1]));
            rest = others;
            if its.is_empty() || chunk.asleep {
                continue;
            }
            if its.iter().any(|(_, proxy)| self.proxies[*proxy as usize].moving) {
                chunk.fastest_own = Some(S::infinity());
                continue;
            }
            let (mut from, mut most) = (chunk.rows[0], S::zero());
            for to in its.iter().map(|(row, _)| *row).chain([chunk.rows[1]]) {
                let rows = &self.velocity[from as usize..to as usize];
                most = rows.iter().fold(most, |most, velocity| most.max(squared(*velocity)));
                from = to + 1;
            }
            chunk.fastest_own = Some(most.sqrt());
        }
    }

    /// Lists the rows of the proxies, in order.
    pub(super) fn list_proxy_rows(&mut self) {
        self.scratch.proxy_rows.clear();
        let rows = self.proxies.iter().zip(0..);
        let rows = rows.filter_map(|(proxy, i)| Some((self.ids.row(proxy.ball.0)? as u32, i)));
        self.scratch.proxy_rows.extend(rows);
        self.scratch.proxy_rows.sort_unstable();
    }

    /// The proxy in a row, among those that were listed.
    pub(super) fn proxy_at<'a>(
        proxies: &'a [Proxy<S>],
        proxy_rows: &[(u32, u32)],
        row: u32,
    ) -> Option<&'a Proxy<S>> {
        let at = proxy_rows.binary_search_by_key(&row, |(row, _)| *row).ok()?;
        proxies.get(proxy_rows[at].1 as usize)
    }

    /// Inserts a ball for each of `count` bodies.
    pub(crate) fn insert_bodies(&mut self, count: usize) -> Result<Vec<BallId>, crate::Error> {
        let position = crate::math::Point3::new(S::zero(), S::zero(), S::zero());
        self.add(&vec![super::Ball::new(position, S::from_f64(super::LEAST_RADIUS)); count])
    }

    /// Saves the rows of the proxies, before they are integrated.
    pub(super) fn save_proxies(&mut self) {
        let rows = self.scratch.proxy_rows.iter().map(|(row, _)| *row as usize);
        self.scratch.saved_proxies.clear();
        self.scratch.saved_proxies.extend(rows.map(|row| [self.at[row], self.velocity[row]]));
    }

    /// Advances the proxies in place of the integration, from one part of the step to another: as
    /// they do alone, and by what the swarm changed of it, so that a push moves no center of mass.
    pub(super) fn advance_proxies(&mut self, [from, to]: [S; 2], place: bool, time: S) {
        for ((row, proxy), [at, velocity]) in
            self.scratch.proxy_rows.iter().zip(&self.scratch.saved_proxies)
        {
            let (row, proxy) = (*row as usize, &self.proxies[*proxy as usize]);
            if self.velocity[row][3].is_sign_negative() {
                continue;
            }
            let ([at_from, before], [at_to, after]) = (proxy.alone(from), proxy.alone(to));
            let pushed = less(velocity, if place { &after } else { &before });
            for axis in 0..3 {
                if place {
                    let displacement = at_to[axis] + (at[axis] - at_from[axis]);
                    self.at[row][axis] = displacement + pushed[axis] * time;
                } else {
                    self.velocity[row][axis] = after[axis] + pushed[axis];
                }
            }
        }
    }

    /// Takes back what the prediction of the lab's tier did to the proxies. There, the velocity is
    /// the place before.
    pub(super) fn reset_proxies_in_lab(&mut self) {
        for proxy in &self.proxies {
            let Some(row) = self.ids.row(proxy.ball.0) else { continue };
            self.at[row] = proxy.at;
            let [x, y, z, _] = proxy.at;
            self.velocity[row] = [x, y, z, proxy.velocity[3]];
            self.displacement[row] = S::zero();
        }
    }

    /// Gives the proxies their velocities back, except what is against the direction in which they
    /// were pushed.
    pub(super) fn update_proxy_velocities_in_lab(&mut self, dt: S) {
        for proxy in &self.proxies {
            let Some(row) = self.ids.row(proxy.ball.0) else { continue };
            let ([x, y, z, _], [a, b, c, _]) = (self.at[row], proxy.at);
            let push = [x - a, y - b, z - c];
            let [u, v, w, mass] = proxy.velocity;
            let against = -(u * push[0] + v * push[1] + w * push[2]);
            let squared = push[0] * push[0] + push[1] * push[1] + push[2] * push[2];
            let part = if squared > S::zero() {
                (against / squared).clamp(S::zero(), S::one() / dt)
            } else {
                S::zero()
            };
            self.velocity[row] = [u + push[0] * part, v + push[1] * part, w + push[2] * part, mass];
        }
    }
}
