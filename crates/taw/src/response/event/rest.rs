//! What rests: on one wall, which [`support`](super::support) knows in closed form, or in
//! heaps, for which the impulse method finds the accelerations that keep them at rest.

use cgmath::{InnerSpace, Zero};

use super::wall::{Between, Wall};
use super::{Ball, EventDriven, MOST_TOUCHES, PRESS, Path, REST, Settings};
use crate::broad::Period;
use crate::contact::{Contact, Contacts};
use crate::math::{Point3, Vec3, direction_and_length};
use crate::response::impulse::{self, Around, Groups, Start, Warm, impulse};
use crate::response::{BallSpin, Columns, Material, Work};
use crate::shape::Nearest;

/// Overlap that may stay, over the radius: pushing it out would lift what lies on it, and
/// create energy.
const SLOP: f64 = 4e-3;
/// How often a ball is moved out of the wall that it is deepest in; of two that meet at a right
/// angle or more, it is out after two.
const MOST_MOVES: u32 = 16;

/// A heap agrees where a sweep changes no velocity by more than this part of what gravity does in
/// a substep: a hundredth of what counts as rest.
const AGREED: f64 = 0.01 * REST;
/// Or by more than this part of its largest speed, where nothing pulls: a hundred roundings.
const ROUNDING: f64 = 100.0 * f64::EPSILON;
/// Whatever the model's iterations, a heap is swept until it agrees, or for as long as no more
/// contacts are solved than this, all sweeps together: half a millisecond. What a heap of few
/// leaves undecided costs more, as events.
const MOST_SOLVED: usize = 4_000;
/// And no more often than this, which is the most that a model may have.
const MOST_SWEEPS: u32 = 1000;

/// What rests on each other, as the impulse method sees it.
#[derive(Clone, Debug, Default)]
pub(super) struct Heap {
    period: Period<f64>,
    /// Whose turn it is: the balls' rows, in order.
    rows: Vec<u32>,
    /// Where in `rows` a ball is.
    label: Vec<u32>,
    /// How many things each ball touches.
    touches: Vec<u32>,
    position: Vec<Point3<f64>>,
    /// Where each was before the step.
    start: Vec<Point3<f64>>,
    velocity: Vec<Vec3<f64>>,
    spin: Vec<Vec3<f64>>,
    radius: Vec<f64>,
    inverse_mass: Vec<f64>,
    material: Vec<Material<f64>>,
    held: Vec<bool>,
    /// Who touches whom, over how many others.
    groups: Groups,
    scratch: impulse::Scratch<f64>,
}

impl Heap {
    /// Takes over those balls that the contacts are about, and names them by their place
    /// here.
    fn take(&mut self, contacts: &mut Contacts<f64>, balls: &[Ball]) {
        self.rows.clear();
        self.rows.extend(contacts.wm.iter().map(|c| c.b));
        self.rows.extend(contacts.mm.iter().flat_map(|c| [c.a, c.b]));
        self.rows.sort_unstable();
        self.rows.dedup();
        self.label.resize(balls.len(), 0);
        for (label, row) in self.rows.iter().enumerate() {
            self.label[*row as usize] = label as u32;
        }
        contacts.wm.iter_mut().for_each(|c| c.b = self.label[c.b as usize]);
        for c in &mut contacts.mm {
            (c.a, c.b) = (self.label[c.a as usize], self.label[c.b as usize]);
        }
        let rows = &self.rows;
        let each = || rows.iter().map(|row| &balls[*row as usize]);
        fill(&mut self.position, each().map(|b| b.position));
        fill(&mut self.start, each().map(|b| b.position));
        fill(&mut self.velocity, each().map(|b| b.velocity));
        fill(&mut self.spin, each().map(|b| b.spin));
        fill(&mut self.radius, each().map(|b| b.radius));
        fill(
            &mut self.inverse_mass,
            each().map(|b| if b.is_frozen() { 0.0 } else { b.inverse_mass }),
        );
        fill(&mut self.material, each().map(|b| b.material));
        fill(&mut self.held, each().map(|b| b.spins == BallSpin::Ignored));
    }

    /// Solves the contacts over `dt` seconds, or with zero what happens at once.
    fn solve(
        &mut self,
        contacts: &mut Contacts<f64>,
        walls: &Between,
        pull: f64,
        dt: f64,
        settings: &Settings,
        warm: &mut Vec<Warm<f64>>,
    ) {
        let fastest = self.velocity.iter().map(|v| v.magnitude()).fold(0.0, f64::max);
        let mut columns = Columns {
            period: self.period,
            position: &mut self.position,
            velocity: &mut self.velocity,
            radius: &self.radius,
            inverse_mass: &self.inverse_mass,
            spin: &mut self.spin,
            held: &self.held,
            rods: &[],
        };
        let until_it_agrees = (MOST_SOLVED / contacts.len().max(1)) as u32;
        let told = impulse::Settings {
            iterations: settings.iterations.max(until_it_agrees.min(MOST_SWEEPS)),
            dt,
            bounce_speed: 2.0 * pull * settings.dt,
            enough: (AGREED * pull * settings.dt).max(ROUNDING * fastest),
            // As deep as a gap may be wide that counts as touching.
            slop: 0.5 * PRESS * PRESS * pull * settings.dt * settings.dt,
            largest_slop: SLOP,
        };
        let mut stopped = Vec::new(); // whoever it is will be stopped at the end, too
        let around = Around {
            walls,
            material: |label: usize| self.material[label],
            follow: |_| 0.5,
            start: Start { position: &self.start, velocity: &[], stands: &[] },
            settings: &told,
        };
        impulse(&mut columns, contacts, &around, &mut self.scratch, warm, &mut stopped);
        settings.count(2 * self.scratch.solved());
    }
}

impl Heap {
    /// Counts what contacts did at once, to balls that moved and turned so before.
    fn count(&mut self, velocity: &mut [Vec3<f64>], spin: &mut [Vec3<f64>], work: &mut Work) {
        let collisions = work.collisions;
        let mut columns = Columns {
            period: self.period,
            position: &mut self.position,
            velocity: &mut self.velocity,
            radius: &self.radius,
            inverse_mass: &self.inverse_mass,
            spin: &mut self.spin,
            held: &self.held,
            rods: &[],
        };
        self.scratch.count(&mut columns, velocity, spin, work);
        work.collisions = collisions; // it is none: they lie there
    }
}

/// Sets a column.
fn fill<T>(column: &mut Vec<T>, values: impl Iterator<Item = T>) {
    column.clear();
    column.extend(values);
}

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
        if !near.is_empty() {
            let mut warm = std::mem::take(&mut self.warm);
            self.hold(&mut near, 0.0, settings, &mut warm);
            self.warm = warm;
        }
        self.near = near;
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
    fn come_out(&mut self, row: usize, now: f64) {
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

    /// Whether a wall goes through the substep.
    fn goes(&self, wall: usize) -> bool {
        self.walls[wall].there.is_some()
    }

    /// Whether a ball that touches one wall and nothing else rests on it.
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

    /// How much slower than what counts as rest a ball and a wall come together, or
    /// nothing if they do not touch.
    fn touches_wall(
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

    /// The same of two balls.
    fn touches_ball(
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

    /// Whether a ball is too deep in another one that it does not come nearer to: the two are
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
        let Nearest { normal, distance, .. } = wall.nearest(ball.position, now);
        let way = wall.way(ball.position, now);
        (distance - ball.radius, (ball.velocity - way).dot(normal))
    }

    /// Lets balls, and all that touch them and each other, rest together from now on. What parts
    /// faster than `parting`, in m/s, and than what counts as rest does not touch.
    /// Gives their rows, whose events are to be foreseen anew.
    pub(super) fn hold_from_now_on(
        &mut self,
        first: [usize; 2],
        parting: f64,
        now: f64,
        settings: &Settings,
    ) -> Vec<usize> {
        let (found, mut contacts) = self.all_that_touch(first, parting, now, settings);
        let pull = found.iter().map(|row| self.balls[*row].pull.magnitude()).fold(0.0, f64::max);
        // First what the collision does, all of it at once and without rebound.
        self.heap.period = self.period;
        self.heap.take(&mut contacts, &self.balls);
        for material in &mut self.heap.material {
            (material.restitution, material.tangential_restitution) = (0.0, 0.0);
        }
        let left = settings.dt - now;
        let walls = Between { walls: &self.walls, begin: now, end: now };
        let before = self.work.map(|_| (self.heap.velocity.clone(), self.heap.spin.clone()));
        self.heap.solve(&mut contacts, &walls, pull, 0.0, settings, &mut Vec::new());
        if let (Some(work), Some((mut velocity, mut spin))) = (&mut self.work, before) {
            self.heap.count(&mut velocity, &mut spin, work);
        }
        for (label, row) in self.heap.rows.iter().enumerate() {
            let ball = &mut self.balls[*row as usize];
            if !ball.is_frozen() {
                (ball.velocity, ball.spin) = (self.heap.velocity[label], self.heap.spin[label]);
            }
        }
        let name = |label: u32| self.heap.rows[label as usize];
        contacts.wm.iter_mut().for_each(|c| c.b = name(c.b));
        contacts.mm.iter_mut().for_each(|c| (c.a, c.b) = (name(c.a), name(c.b)));
        // Then what holds it from there on, if that is any time at all.
        if left > 1e-6 * settings.dt && !contacts.is_empty() {
            self.hold(&mut contacts, now, settings, &mut Vec::new());
        }
        found
    }

    /// These balls, those that they touch, and so on, all of them released at this time;
    /// and the contacts between them.
    fn all_that_touch(
        &mut self,
        first: [usize; 2],
        parting: f64,
        now: f64,
        settings: &Settings,
    ) -> (Vec<usize>, Contacts<f64>) {
        let mut contacts = Contacts::default();
        // The place of each ball in `found`, plus one.
        let mut place = std::mem::take(&mut self.heap.touches);
        place.clear();
        place.resize(self.balls.len(), 0);
        let mut found = Vec::new();
        let find = |row: usize, place: &mut Vec<u32>, found: &mut Vec<usize>| {
            if place[row] == 0 {
                found.push(row);
                place[row] = found.len() as u32;
            }
        };
        for row in first {
            find(row, &mut place, &mut found);
        }
        let mut turn = 0;
        let mut touches = vec![0_u32; self.balls.len()];
        let mut near = Vec::new();
        let mtv = Vec3::zero();
        while let Some(row) = found.get(turn).copied() {
            turn += 1;
            self.advance(row, now);
            let frozen = self.balls[row].is_frozen();
            self.balls[row].release();
            if frozen {
                self.balls[row].freeze();
            }
            settings.count(1 + self.looks_at_walls(row));
            let at = self.balls[row].position;
            self.name_walls(row, |wall| {
                let contact =
                    Contact { a: wall as u32, b: row as u32, part: 0, along: [0.0; 2], mtv };
                if self.touches_wall(&contact, now, parting, settings).is_some()
                    && (self.parts_of(row).is_empty()
                        || !self.is_seam(row, wall, at, now, settings))
                {
                    contacts.wm.push(contact);
                }
            });
            near.clear();
            self.name_near(row, |other| near.push(other));
            settings.count(near.len() as u64);
            near.sort_unstable();
            near.dedup();
            for other in near.iter().copied().filter(|other| *other != row) {
                // What had its turn has named this one already.
                if place[other] != 0 && place[other] <= turn as u32 {
                    continue;
                }
                let before = self.balls[other];
                self.balls[other].advance(now);
                let (a, b) = (row.min(other) as u32, row.max(other) as u32);
                let contact = Contact { a, b, part: 0, along: [0.0; 2], mtv };
                // The two that it is about touch, whatever rounding says.
                let known = first.contains(&row) && first.contains(&other);
                let full = touches[row].min(touches[other]) >= MOST_TOUCHES;
                if !full && (known || self.touches_ball(&contact, parting, settings).is_some()) {
                    touches[row] += 1;
                    touches[other] += 1;
                    contacts.mm.push(contact);
                    find(other, &mut place, &mut found);
                }
                self.balls[other] = before;
            }
        }
        self.heap.touches = place;
        (found, contacts)
    }

    /// Finds the accelerations that hold these contacts from `now` to the end of the
    /// substep.
    fn hold(
        &mut self,
        contacts: &mut Contacts<f64>,
        now: f64,
        settings: &Settings,
        warm: &mut Vec<Warm<f64>>,
    ) {
        let left = settings.dt - now;
        self.heap.period = self.period;
        self.heap.take(contacts, &self.balls);
        let Heap { rows, label, position, velocity, .. } = &mut self.heap;
        let mut strongest: f64 = 0.0;
        // Where each would be at the end of the substep if nothing held it.
        for (at, row) in rows.iter().enumerate() {
            let ball = &self.balls[*row as usize];
            if ball.is_frozen() {
                continue;
            }
            position[at] += (ball.velocity + ball.pull * (0.5 * left)) * left;
            velocity[at] += ball.pull * left;
            strongest = strongest.max(ball.pull.magnitude());
        }
        warm.retain_mut(|warm| {
            warm.rename(|row| {
                let at = *label.get(row)? as usize;
                (rows.get(at).copied() == Some(row as u32)).then_some(at)
            })
        });
        let walls = Between { walls: &self.walls, begin: now, end: settings.dt };
        self.heap.solve(contacts, &walls, strongest, left, settings, warm);
        let Heap { rows, position, velocity, spin, inverse_mass, groups, scratch, .. } =
            &mut self.heap;
        warm.retain_mut(|warm| warm.rename(|at| rows.get(at).map(|row| *row as usize)));
        let mut power = self.work.map(|_| vec![0.0; rows.len()]);
        if let Some(power) = &mut power {
            scratch.for_each_carried(velocity, inverse_mass, |at, energy| {
                power[at] += energy / left;
            });
        }
        // What the method pushed apart, besides; not so far that one were on the other side of a
        // thin wall then, and all that touch each other by the same part, so that their common
        // center stays where it is.
        groups.find(contacts.mm.iter().map(|c| (Some(c.a as usize), c.b as usize)), rows.len());
        let (mut pushes, mut parts) = (vec![Vec3::zero(); rows.len()], vec![1.0_f64; rows.len()]);
        for (at, row) in rows.iter().enumerate() {
            let ball = &mut self.balls[*row as usize];
            if ball.is_frozen() {
                continue;
            }
            let end = ball.position + (ball.velocity + velocity[at]) * (0.5 * left);
            ball.path = Path {
                acceleration: (velocity[at] - ball.velocity) / left,
                spin_acceleration: (spin[at] - ball.spin) / left,
                heaped: true,
                power: power.as_ref().map_or(0.0, |power| power[at]),
                stamp: ball.path.stamp + 1,
                ..ball.path
            };
            pushes[at] = position[at] - end;
            let (group, far) = (groups.of(at) as usize, pushes[at].magnitude());
            if far > 0.5 * ball.radius {
                parts[group] = parts[group].min(0.5 * ball.radius / far);
            }
        }
        for (at, push) in pushes.into_iter().enumerate() {
            self.balls[rows[at] as usize].position += push * parts[groups.of(at) as usize];
        }
        // It pushed out of what they touched, and maybe into what they did not.
        for at in 0..self.heap.rows.len() {
            let row = self.heap.rows[at] as usize;
            if !self.balls[row].is_frozen() {
                self.look_where_it_is(row, now, settings);
                self.come_out(row, now);
            }
        }
    }
}
