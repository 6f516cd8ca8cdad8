//! Rest that begins within a substep, and the accelerations that hold it.

use cgmath::{InnerSpace, Zero};

use super::heap::{Heap, Table};
use super::wall::Between;
use super::{EventDriven, MOST_TOUCHES, Path, Settings};
use crate::contact::{Contact, Contacts};
use crate::math::Vec3;
use crate::response::impulse::Warm;

/// Balls that rest together from now on.
pub(super) struct Held {
    pub rows: Vec<usize>,
    pub pressed: Pressed,
}

/// Causes that may bring balls together again that have come to rest among each other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Pressed {
    /// Nothing: all of them fall alike, and touch nobody else.
    No,
    /// Forces that are not the same for all.
    ByForces,
    /// A wall, or a ball that nothing moves.
    FromOutside,
}

impl EventDriven {
    /// Lets balls, and all that touch them and each other, rest together from now on. What parts
    /// faster than `parting`, in m/s, and than what counts as rest does not touch.
    /// Gives them; their events are to be foreseen anew.
    pub(super) fn hold_from_now_on(
        &mut self,
        first: [usize; 2],
        parting: f64,
        now: f64,
        settings: &Settings,
    ) -> Held {
        let (found, mut contacts) = self.all_that_touch(first, parting, now, settings);
        let pull = found.iter().map(|row| self.balls[*row].pull.magnitude()).fold(0.0, f64::max);
        // First what the collision does.
        self.heap.take(&mut contacts, &self.balls, self.period);
        let left = settings.dt - now;
        self.end_collision(&mut contacts, now, pull, settings);
        if parting == f64::INFINITY {
            let enough = self.heap.enough(pull, settings);
            self.end_knot(&contacts, now, enough, settings);
        }
        for (label, row) in self.heap.rows.iter().enumerate() {
            let ball = &mut self.balls[*row as usize];
            if !ball.is_frozen() {
                (ball.velocity, ball.spin) =
                    (self.heap.table.velocity[label], self.heap.table.spin[label]);
            }
        }
        let name = |label: u32| self.heap.rows[label as usize];
        contacts.wm.iter_mut().for_each(|c| c.b = name(c.b));
        contacts.mm.iter_mut().for_each(|c| (c.a, c.b) = (name(c.a), name(c.b)));
        // Then what holds it from there on, if that is needed, for any time at all.
        let pressed = self.are_pressed(&found, &contacts);
        let parted = parting == f64::INFINITY && pressed == Pressed::No;
        if contacts.is_empty() || parted {
            // Nothing presses them any more.
        } else if left > 1e-6 * settings.dt {
            self.hold(&mut contacts, now, settings, &mut Vec::new());
        } else {
            self.keep_going(&found);
        }
        Held { rows: found, pressed }
    }

    /// Ends the approach of what the heap has taken over, all of it at once and without rebound;
    /// `pull` is the strongest acceleration, in m/s².
    pub(super) fn end_collision(
        &mut self,
        contacts: &mut Contacts<f64>,
        now: f64,
        pull: f64,
        settings: &Settings,
    ) {
        for material in &mut self.heap.material {
            (material.restitution, material.tangential_restitution) = (0.0, 0.0);
        }
        let walls = Between { walls: &self.walls, begin: now, end: now };
        let before =
            self.work.map(|_| (self.heap.table.velocity.clone(), self.heap.table.spin.clone()));
        self.heap.solve(contacts, &walls, pull, 0.0, settings, &mut Vec::new());
        if let (Some(work), Some((mut velocity, mut spin))) = (&mut self.work, before) {
            self.heap.count(&mut velocity, &mut spin, work);
        }
    }

    /// Lets balls keep their velocity, for so short a time that nothing presses them noticeably.
    fn keep_going(&mut self, rows: &[usize]) {
        for row in rows {
            let path = &mut self.balls[*row].path;
            (path.acceleration, path.heaped) = (Vec3::zero(), true);
        }
    }

    fn are_pressed(&self, rows: &[usize], contacts: &Contacts<f64>) -> Pressed {
        let fixed = |row: &usize| {
            let ball = &self.balls[*row];
            ball.inverse_mass <= 0.0 || ball.is_frozen()
        };
        if !contacts.wm.is_empty() || rows.iter().any(fixed) {
            return Pressed::FromOutside;
        }
        let alike = rows.windows(2).all(|two| self.balls[two[0]].pull == self.balls[two[1]].pull);
        if alike { Pressed::No } else { Pressed::ByForces }
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
    pub(super) fn hold(
        &mut self,
        contacts: &mut Contacts<f64>,
        now: f64,
        settings: &Settings,
        warm: &mut Vec<Warm<f64>>,
    ) {
        let left = settings.dt - now;
        self.heap.take(contacts, &self.balls, self.period);
        let Heap { rows, label, table: Table { position, velocity, .. }, .. } = &mut self.heap;
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
        let mut among = vec![false; rows.len()];
        for label in contacts.mm.iter().flat_map(|c| [c.a, c.b]) {
            among[label as usize] = true;
        }
        let walls = Between { walls: &self.walls, begin: now, end: settings.dt };
        self.heap.solve(contacts, &walls, strongest, left, settings, warm);
        let Heap { rows, table, groups, scratch, .. } = &mut self.heap;
        let Table { position, velocity, spin, inverse_mass, .. } = table;
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
                among: among[at],
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
