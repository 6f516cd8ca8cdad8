//! Effect of a collision: on two balls, on several at one moment, on a ball and a wall.

use std::cmp::Reverse;

use cgmath::{InnerSpace, Zero};

use super::hold::{Held, Pressed};
use super::{Event, EventDriven, Impact, MOST_LOSSES, MOST_SURRENDERS, Settings, What};
use crate::math::{Vec3, direction_and_length};
use crate::response::impact::at_most;
use crate::response::{Material, Mobility, Push, impact};

/// Rounds that collisions at one moment have to agree.
const MOST_ROUNDS: u32 = 1000;

/// Events of one moment.
#[derive(Clone, Debug, Default)]
pub(super) struct Moment {
    pairs: Vec<(usize, usize)>,
    /// Events other than collisions.
    rest: Vec<Event>,
    rows: Vec<usize>,
    collisions: Vec<Collision>,
}

/// Two balls that collide.
#[derive(Clone, Copy, Debug)]
struct Collision {
    a: usize,
    b: usize,
    impact: Impact<f64>,
    mobility: Mobility<f64>,
    material: Material<f64>,
    /// Part of what it asks for that it may take at once, beside others.
    share: f64,
    /// Impulse on the second one, in N s.
    impulse: Vec3<f64>,
}

impl EventDriven {
    /// Tests if a ball has had so many collisions that took energy that they will not end.
    pub(super) fn loses(&self, row: usize) -> bool {
        self.balls[row].path.losses >= MOST_LOSSES
    }

    /// Brings balls to rest that collide without end, and all that touch them, however fast they
    /// part just now: between a wall and a heavy ball, a light one parts from one of them always.
    pub(super) fn surrender(&mut self, rows: [usize; 2], time: f64, settings: &Settings) {
        let Held { rows, pressed } = self.hold_from_now_on(rows, f64::INFINITY, time, settings);
        for row in rows {
            let path = &mut self.balls[row].path;
            path.losses = 0.0;
            if !self.balls[row].is_frozen() && self.gives_up(row, pressed) {
                self.balls[row].freeze();
            }
            self.foresee(row, time, settings);
        }
    }

    /// Counts that a ball was brought to rest. True if something presses it that will not end:
    /// only what is outside could take its momentum.
    fn gives_up(&mut self, row: usize, pressed: Pressed) -> bool {
        let surrenders = &mut self.balls[row].path.surrenders;
        let most = match pressed {
            Pressed::FromOutside => MOST_SURRENDERS,
            Pressed::ByForces | Pressed::No => MOST_SURRENDERS - 1,
        };
        *surrenders = (*surrenders + 1).min(most);
        *surrenders == MOST_SURRENDERS
    }

    /// Lets two balls bounce off each other, and whoever else meets at the same moment.
    ///
    /// All that happens at one moment happens at once, so that no order is preferred:
    /// the mirror image of a scene has the mirror image of its future, to the bit.
    pub(super) fn meet(
        &mut self,
        first: Event,
        other: usize,
        settings: &Settings,
        impacts: &mut Vec<Impact<f64>>,
    ) {
        let Event { time, row, .. } = first;
        let Moment { mut pairs, mut rest, mut rows, mut collisions } =
            std::mem::take(&mut self.moment);
        pairs.clear();
        pairs.push((row.min(other), row.max(other)));
        let mut with_all = |row: usize| {
            self.name_near(row, |other| {
                let meeting =
                    (other != row).then(|| self.foresee_meeting(row, other, time, settings));
                if let Some(Some((after, What::Meets(..)))) = meeting
                    && time + after <= time
                {
                    pairs.push((row.min(other), row.max(other)));
                }
            });
        };
        if first.tied {
            with_all(row);
        }
        while let Some(Reverse(event)) = self.queue.peek().copied()
            && event.time == time
        {
            self.queue.pop();
            let valid = self.balls[event.row].path.stamp == event.stamp;
            match event.what {
                What::Meets(other, stamp)
                    if valid && self.balls[other].path.stamp == stamp && !self.loses(event.row) =>
                {
                    pairs.push((event.row.min(other), event.row.max(other)));
                }
                _ => rest.push(event),
            }
        }
        self.queue.extend(rest.drain(..).map(Reverse));
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
            self.balls[*row].release();
        }
        impacts.extend(collisions.iter().map(|c| c.impact));
        if rows.len() == 2 * pairs.len() {
            for c in &collisions {
                let approach = self.closing(c);
                let impulse = impact(c.impact.normal, approach, c.mobility, c.material);
                self.balls[c.a].hit(-impulse, -c.impact.normal);
                self.balls[c.b].hit(impulse, c.impact.normal);
                self.count_meeting(c, impulse, approach);
            }
        } else {
            self.collide_at_once(&mut collisions, &rows);
        }
        for row in &rows {
            self.foresee(*row, time, settings);
        }
        self.moment = Moment { pairs, rest, rows, collisions };
    }

    /// Collision of two balls that touch, before its impulse.
    fn collision(&mut self, a: usize, b: usize, settings: &Settings) -> Collision {
        let press = self.press_speed(a, b, settings);
        let (first, second) = (&self.balls[a], &self.balls[b]);
        let (normal, _) =
            direction_and_length(self.apart(first, second)).unwrap_or((Vec3::unit_x(), 0.0));
        let approach_speed = -(second.velocity - first.velocity).dot(normal);
        let mut material = first.material.against(second.material);
        if approach_speed <= 2.0 * press {
            material.restitution = 0.0;
        }
        let mobility = Mobility::of([first, second].map(|ball| (ball.inverse_mass, ball.spins)));
        self.balls[a].collide(material, settings);
        self.balls[b].collide(material, settings);
        let (first, second) = (a as u32, b as u32);
        let impact = Impact { a: first, on_wall: false, b: second, normal, approach_speed };
        Collision { a, b, impact, mobility, material, share: 1.0, impulse: Vec3::zero() }
    }

    /// The velocity of the second's touching point relative to the first's, in m/s.
    fn closing(&self, c: &Collision) -> Vec3<f64> {
        let (first, second) = (&self.balls[c.a], &self.balls[c.b]);
        let rims = first.rim(c.impact.normal) + second.rim(c.impact.normal);
        second.velocity - first.velocity + rims
    }

    /// Finds the impulses of collisions that share balls: each has the restitution and
    /// friction of its own, with all others going on (Newton's law, simultaneously). All
    /// change together, round by round (Jacobi), so that their order is nothing to them.
    fn collide_at_once(&mut self, collisions: &mut [Collision], rows: &[usize]) {
        let begin: Vec<_> = collisions.iter().map(|c| self.closing(c)).collect();
        let shared = |row: usize| collisions.iter().filter(|c| c.a == row || c.b == row).count();
        let shares: Vec<_> =
            collisions.iter().map(|c| 1.0 / shared(c.a).max(shared(c.b)) as f64).collect();
        collisions.iter_mut().zip(shares).for_each(|(c, share)| c.share = share);
        let fastest = begin.iter().map(|v| v.magnitude()).fold(0.0, f64::max);
        for _ in 0..MOST_ROUNDS {
            let mut largest: f64 = 0.0;
            let mut changes = vec![[Vec3::zero(); 2]; rows.len()];
            let closing: Vec<_> = collisions.iter().map(|c| self.closing(c)).collect();
            for ((c, closing), begin) in collisions.iter_mut().zip(closing).zip(&begin) {
                let normal = c.impact.normal;
                let (Material { restitution, friction, tangential_restitution, .. }, before) =
                    (c.material, c.impulse);
                let along = |v: Vec3<f64>| v.dot(normal);
                let across = |v: Vec3<f64>| v - normal * v.dot(normal);
                let wanted = restitution * (-along(*begin)).max(0.0);
                let pressure =
                    along(before) + c.share * (wanted - along(closing)) / c.mobility.normal;
                let pressure = pressure.max(0.0);
                let slide = across(*begin) * -tangential_restitution;
                let grip =
                    across(before) + (slide - across(closing)) * (c.share / c.mobility.tangent);
                c.impulse = normal * pressure + at_most(grip, friction * pressure);
                let change = c.impulse - before;
                largest = largest.max(change.magnitude() * c.mobility.normal);
                for (row, impulse, normal) in [(c.a, -change, -normal), (c.b, change, normal)] {
                    if let Ok(at) = rows.binary_search(&row) {
                        changes[at][0] += impulse;
                        changes[at][1] += normal.cross(impulse);
                    }
                }
            }
            for (row, [impulse, twist]) in rows.iter().zip(changes) {
                let ball = &mut self.balls[*row];
                ball.velocity += impulse * ball.inverse_mass;
                let whirl: f64 = ball.spins.of_solid_ball();
                ball.spin -= twist * (whirl * ball.inverse_mass / ball.radius);
            }
            if largest <= 1e-15 * fastest {
                break;
            }
        }
        for (c, begin) in collisions.iter().zip(begin) {
            self.count_meeting(c, c.impulse, begin);
        }
    }

    /// Counts what a collision did with this impulse, of points that came together so.
    fn count_meeting(&mut self, c: &Collision, impulse: Vec3<f64>, before: Vec3<f64>) {
        if self.work.is_none() {
            return;
        }
        let after = self.closing(c);
        let fixed = |row: usize| {
            let ball = &self.balls[row];
            (ball.inverse_mass == 0.0).then_some(ball.velocity)
        };
        let fixed = [fixed(c.a), fixed(c.b)];
        if let Some(work) = &mut self.work {
            let (normal, mean) = (c.impact.normal, (before + after) * 0.5);
            work.push(Push { impulse, normal, mean, fixed });
            work.collisions += 1;
        }
    }

    /// Lets a ball that touches a wall bounce off it.
    pub(super) fn hit_wall(&mut self, row: usize, wall: usize, settings: &Settings) -> Impact<f64> {
        let ball = &mut self.balls[row];
        ball.release();
        let now = ball.path.begin;
        let normal = self.walls[wall].nearest(ball.position, now).normal;
        let touch = ball.position - normal * ball.radius;
        let surface = self.walls[wall].surface_velocity(normal, touch, now);
        let closing = ball.velocity - surface + ball.rim(normal);
        let approach_speed = -closing.dot(normal);
        let mobility = Mobility::of_balls(0.0, ball.inverse_mass, ball.spins);
        let material = self.walls[wall].against(ball.material);
        ball.collide(material, settings);
        let impulse = impact(normal, closing, mobility, material);
        ball.hit(impulse, normal);
        if let Some(work) = &mut self.work {
            let after = ball.velocity - surface + ball.rim(normal);
            let mean = (closing + after) * 0.5;
            let fixed = [Some(surface), (ball.inverse_mass == 0.0).then_some(ball.velocity)];
            work.push(Push { impulse, normal, mean, fixed });
            work.collisions += 1;
        }
        Impact { a: self.walls[wall].row, on_wall: true, b: row as u32, normal, approach_speed }
    }
}
