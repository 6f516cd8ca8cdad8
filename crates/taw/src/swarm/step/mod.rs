//! A step of a swarm, and its parts in the full tier.

mod lab;
mod seek;

pub(super) use seek::listed;

use super::build::SOON;
use super::kernels::{Columns, Drift, GROUNDED, Impact, LOST, Pass, Soft, solve, squared};
use super::lanes::Row;
use super::slab::Slab;
use super::strays::Strays;
use super::team::{Shared, each, each_beside};
use super::walls::half_spaces;
use super::{Stage, Surroundings, Swarm, Tier, lying};
use cgmath::{InnerSpace, Zero};

use crate::math::{Vec3, length};

/// Stiffness of contacts: at most so many oscillations a second, and as many times as much
/// damping as stops them.
const HERTZ: f32 = 60.0;
const DAMPING: f32 = 10.0;
/// Speed at which an overlap is pushed out at most: that which gravity gives in so many seconds.
const PUSHING: f32 = 0.3;
/// So much of twice the smaller radius two balls may overlap before they are moved apart: more than
/// what bears a heap gets, and less than the tenth of a radius that is seen, since each substep
/// presses in a little again. (Contacts sink by a thousandth for each three balls on them; if that
/// is moved out, they never come to rest.)
const SLOP: f32 = 0.04;
/// Slop where nothing lies on anything: only so that balls that touch are left alone.
const SLOP_WEIGHTLESS: f32 = 0.01;
/// Where one ball weighs more than so many times as much as another, pairs look who has a wall
/// behind it: a pair sinks in by that ratio times the way of gravity in a substep while its contact
/// learns what it bears, less than a millimetre for each such time.
const UNEVEN: f32 = 8.0;
/// Number of looks for bounces in a substep while any is found: in a gas hardly ever do five
/// balls meet in one. What meets after that is stopped.
const ROUNDS: usize = 4;
/// For how long, in seconds, all balls of a slab lie still before they sleep.
const FALL_ASLEEP: f32 = 0.5;

impl Swarm {
    /// Moves the balls on by `dt` seconds. `version` changes whenever a wall does.
    pub(crate) fn step(
        &mut self,
        dt: f32,
        gravity: Vec3<f32>,
        walls: &dyn Surroundings,
        version: u64,
        observe: &mut dyn FnMut(Stage),
    ) {
        let walls_changed = self.begin(gravity, walls, version);
        match self.tier() {
            Tier::Lab => self.step_lab(dt, gravity, walls, walls_changed, observe),
            Tier::Full => {
                self.find_contacts(dt, gravity, walls, walls_changed, observe);
                self.solve(dt, self.model.substeps, walls, observe);
            }
        }
        self.end();
    }

    /// Begins a step of bodies and balls: looks who may touch. Returns whether all sleep.
    pub(crate) fn prepare(
        &mut self,
        dt: f32,
        gravity: Vec3<f32>,
        walls: &dyn Surroundings,
        version: u64,
    ) {
        let walls_changed = self.begin(gravity, walls, version);
        self.find_contacts(dt, gravity, walls, walls_changed, &mut |_| ());
    }

    /// Returns true if pairs are known, so that a step can be finished.
    pub(crate) fn is_prepared(&self) -> bool {
        self.paired
    }

    /// Ends it: moves all on in substeps, and solves the contacts.
    pub(crate) fn finish(&mut self, dt: f32, substeps: u32, walls: &dyn Surroundings) {
        self.solve(dt, substeps, walls, &mut |_| ());
        self.end();
    }

    /// Begins a step: gravity and walls. Returns whether these changed.
    fn begin(&mut self, gravity: Vec3<f32>, walls: &dyn Surroundings, version: u64) -> bool {
        self.stopped.clear();
        self.steps_since_build = (self.steps_since_build + 1).min(SOON);
        if self.gravity != Some(gravity) {
            self.gravity = Some(gravity);
            self.wake_all();
        }
        let walls_changed = self.walled != Some(version);
        if walls_changed {
            half_spaces(walls, &mut self.planes);
            self.wake_all();
            self.walled = Some(version);
        }
        walls_changed
    }

    fn end(&mut self) {
        for slab in &mut self.slabs {
            self.stopped.append(&mut slab.stopped);
        }
    }

    /// Brings up to date which pairs are near, and which balls are near walls; and who sleeps.
    fn find_contacts(
        &mut self,
        dt: f32,
        gravity: Vec3<f32>,
        walls: &dyn Surroundings,
        walls_changed: bool,
        observe: &mut dyn FnMut(Stage),
    ) {
        observe(Stage::Integrate);
        if self.paired {
            self.look(dt, gravity);
        }
        let mut leaving = std::mem::take(&mut self.leaving);
        leaving.clear();
        leaving.extend(self.slabs.iter().flat_map(|slab| &slab.leaving));
        if !self.paired {
            self.build(dt, walls, observe);
            self.look(dt, gravity);
        } else if !leaving.is_empty() {
            let rebuilds = self.rebuilds;
            self.seek_for(&leaving, dt, walls, observe);
            if self.rebuilds == rebuilds {
                self.seek_walls_that_moved(walls_changed, dt, walls, observe);
            } else {
                self.look(dt, gravity);
            }
        } else {
            self.seek_walls_that_moved(walls_changed, dt, walls, observe);
        }
        self.leaving = leaving;
    }

    /// Moves all on by `dt` seconds, in substeps: *bounce*, *integrate velocities*, *warm start*,
    /// *solve*, *integrate positions*, *relax* (Catto, 2024, `Solver2D`, `solve_soft_step.c`).
    fn solve(
        &mut self,
        dt: f32,
        count: u32,
        walls: &dyn Surroundings,
        observe: &mut dyn FnMut(Stage),
    ) {
        if !self.paired || self.slabs.iter().all(|slab| slab.asleep) {
            return;
        }
        self.find_guests();
        observe(Stage::Restitute);
        let gravity = self.gravity.unwrap_or_else(Vec3::zero);
        let substeps = count as f32;
        let h = dt / substeps;
        let (times, all) = ([dt, h], |_: &Slab| true);
        self.age_marks();
        self.look_at_walls(walls, dt, times, all, false);
        // What gravity makes of rest in two steps is no impact.
        let speed = 2.0 * length(gravity) * dt;
        let restitution = self.common_material().restitution;
        // What lies on others is borne by pushes; all else
        // that overlaps is moved apart. Where nothing has weight, overlap makes no speed at all.
        let soft = soft(h, length(gravity));
        let impact = Impact { speed, restitution, time: h, gravity: row(gravity), soft };
        let faster = |slab: &Slab, next: f32| 2.0 * slab.speed[0].max(next) > speed;
        for substep in 0..count {
            let left = dt - h * substep as f32;
            if substep > 0 {
                self.look_at_walls(walls, left, times, |slab| slab.has_fast, true);
            }
            self.bounce(impact, faster);
            let leaves = |velocity: &Row, budget| leaves(velocity, budget, left);
            if self.seek_within_step(|slab| slab.struck, leaves, dt, walls, observe) {
                self.look_at_walls(walls, left, times, all, false);
            }
            observe(Stage::Integrate);
            let parts = [substep as f32, (substep + 1) as f32].map(|part| part / substeps);
            self.push_bodies(1.0 / substeps);
            self.keep_guests();
            self.drift(row(gravity * h), [0.0; 4], [0.0; 4]);
            self.drift_guests(parts, false, 0.0);
            observe(Stage::Restitute);
            self.find_backing();
            self.pass(Pass::Begin(impact), |_, _| true);
            self.pass(Pass::Solve(impact), |_, _| true);
            observe(Stage::Integrate);
            self.keep_guests();
            self.drift([0.0; 4], [h, h, h, 0.0], row(gravity * (-0.5 * h * h)));
            self.take_pushes_back(-0.5 * h / substeps);
            self.drift_guests(parts, true, h);
            let (cap, left) = (self.cap, left - h);
            let left_it = |_: &Row, budget: f32| budget < -cap;
            if self.seek_within_step(|slab| slab.overrun, left_it, dt, walls, observe) {
                self.look_at_walls(walls, left, times, all, false);
                self.find_backing(); // rows may have changed
            }
            observe(Stage::Restitute);
            self.pass(Pass::Relax(impact), |_, _| true);
            self.keep_out();
        }
    }

    /// Finds for each ball the wall that bears most of it, where masses differ so much that pairs
    /// need to know ([`Columns::backing`]).
    fn find_backing(&mut self) {
        let inverse = |slab: &Slab| slab.inverse_masses;
        let [least, most] = self.slabs.iter().map(inverse).fold([f32::MAX, 0.0], wider);
        let rows = if most > UNEVEN * least { self.at.len() } else { 0 };
        self.backing.clear();
        self.backing.resize(rows, [0.0; 4]);
        if rows == 0 {
            self.backing.shrink_to_fit();
            return;
        }
        let (slabs, backing, at) = (&self.slabs, Shared::new(&mut self.backing), &self.at[..]);
        each(self.model.threads as usize, slabs.len(), |_, slab| {
            // Those of a ball follow each other.
            for of_ball in slabs[slab].touches.chunk_by(|a, b| a.row == b.row) {
                let (mut most, mut behind, mut last) = (0.0, [0.0; 4], &of_ball[0]);
                for touch in of_ball {
                    let bears = touch.bears(&at[touch.row as usize]);
                    // Of a wall that comes nearer or gives way, each has to ask for itself.
                    if bears > most && touch.surface.dot(touch.normal) == 0.0 {
                        (most, behind) = (bears, row(touch.normal));
                    }
                    if touch.borne_for_others > last.borne_for_others {
                        last = touch;
                    }
                }
                if last.borne_for_others > 0.0 && behind[..3] != row(last.normal)[..3] {
                    behind = [0.0, 0.0, 0.0, LOST];
                }
                // SAFETY: a row of the slab.
                unsafe { *backing.row(last.row as usize) = behind };
            }
        });
    }

    /// Forgets who was borne by a wall two steps ago.
    fn age_marks(&mut self) {
        let (slabs, spin) = (&self.slabs, Shared::new(&mut self.spin));
        each(self.model.threads as usize, slabs.len(), |_, slab| {
            if !slabs[slab].asleep {
                // SAFETY: the rows of the slab.
                for spin in unsafe { spin.part(slabs[slab].own_rows()) } {
                    spin[3] = (spin[3] - 1.0).max(0.0);
                }
            }
        });
    }

    /// Seeks pairs and walls for balls of some slabs that leave their budget within a step, since a
    /// bounce or a contact made them faster. Says whether there were any.
    fn seek_within_step(
        &mut self,
        which: impl Fn(&Slab) -> bool,
        leaves: impl Fn(&Row, f32) -> bool,
        dt: f32,
        walls: &dyn Surroundings,
        observe: &mut dyn FnMut(Stage),
    ) -> bool {
        let mut leaving = std::mem::take(&mut self.leaving);
        leaving.clear();
        // More than this are too many.
        let most = self.strays.room(self.at.len()) + 1;
        for slab in self.slabs.iter().filter(|slab| which(slab) && !slab.asleep) {
            let leaves = |row: &u32| {
                let at = *row as usize;
                leaves(&self.velocity[at], self.budget[at])
            };
            let room = most.saturating_sub(leaving.len());
            leaving.extend((slab.rows[0]..slab.rows[1]).filter(leaves).take(room));
        }
        if !leaving.is_empty() {
            // Rows may change.
            for slab in &mut self.slabs {
                self.stopped.append(&mut slab.stopped);
            }
            let slots = self.ids.slots();
            self.stopped.iter_mut().for_each(|row| *row = slots[*row as usize]);
            let rebuilds = self.rebuilds;
            self.seek_for(&leaving, dt, walls, observe);
            if self.rebuilds != rebuilds {
                self.look(dt, self.gravity.unwrap_or_else(Vec3::zero));
                self.find_guests();
            }
            let rows = self.ids.columns().1;
            self.stopped.iter_mut().for_each(|slot| *slot = rows[*slot as usize]);
        }
        let any = !leaving.is_empty();
        self.leaving = leaving;
        any
    }

    /// Lets bounce what meets, again where a bounce may have sent a ball on to the next one.
    fn bounce(&mut self, impact: Impact, faster: impl Fn(&Slab, f32) -> bool + Sync) {
        self.slabs.iter_mut().for_each(|slab| (slab.again, slab.struck) = (true, false));
        for _ in 0..ROUNDS {
            self.pass(Pass::Impact(impact), |slab, next| slab.again && faster(slab, next));
            let all = self.strays.pushes.bounced;
            let bounced = |slab: Option<&Slab>| slab.is_some_and(|slab| slab.pushes.bounced);
            let mut any = all;
            for i in 0..self.slabs.len() {
                let before = i.checked_sub(1).and_then(|i| self.slabs.get(i));
                let [own, next] = [self.slabs.get(i), self.slabs.get(i + 1)];
                let again = bounced(before) || bounced(own) || bounced(next);
                any |= again;
                self.slabs[i].again = all || again;
                self.slabs[i].struck |= all || again;
            }
            self.strays.pushes.bounced = false;
            self.slabs.iter_mut().for_each(|slab| slab.pushes.bounced = false);
            if !any {
                break;
            }
        }
    }

    /// Moves out of walls what is in them. That comes last: whatever else moves balls apart,
    /// nothing is pressed through a wall.
    fn keep_out(&mut self) {
        let (at, budget) = (Shared::new(&mut self.at), Shared::new(&mut self.budget));
        let slabs = &self.slabs;
        each(self.model.threads as usize, slabs.len(), |_, slab| {
            let slab = &slabs[slab];
            for touch in slab.touches.iter().filter(|_| !slab.asleep) {
                let row = touch.row as usize;
                // SAFETY: a ball of the slab, and nobody works on others meanwhile.
                unsafe { *budget.row(row) -= touch.keep_out(&mut *at.row(row)) };
            }
        });
    }

    /// Sees who falls asleep, who wakes, and who may leave its budget in this step.
    fn look(&mut self, dt: f32, gravity: Vec3<f32>) {
        let lying = lying(gravity, self.mean);
        let sleeps = self.model.sleeps;
        if !self.guests.is_empty() {
            self.look_at_guests();
        }
        let (grid, budget) = (&self.grid, &self.budget[..]);
        // More than this are too many.
        let most = self.strays.room(self.at.len()) + 1;
        let velocity = Shared::new(&mut self.velocity);
        let spin = Shared::new(&mut self.spin);
        let slabs = Shared::new(&mut self.slabs);
        each(self.model.threads as usize, slabs.len(), |_, slab| {
            // SAFETY: each thread has its own slabs, and their rows.
            let slab = unsafe { &mut *slabs.row(slab) };
            if slab.asleep {
                return;
            }
            let (velocity, spin) =
                unsafe { (velocity.part(slab.own_rows()), spin.part(slab.own_rows())) };
            let budget = &budget[slab.own_rows()];
            slab.leaving.clear();
            let rows = (slab.rows[0]..).zip(velocity.iter().zip(budget));
            let leaving = rows.filter(|(_, (velocity, budget))| leaves(velocity, **budget, dt));
            slab.leaving.extend(leaving.map(|(row, _)| row).take(most));
            let fastest = |from: u32, to: u32| {
                let rows = (from - slab.rows[0]) as usize..(to - slab.rows[0]) as usize;
                // Not its spin: on a single point a ball may spin for ever.
                velocity[rows].iter().fold(0.0_f32, |most, v| most.max(squared(*v))).sqrt()
            };
            let [first, last] = [slab.layers[0] + 1, slab.layers[1] - 1];
            slab.speed = [
                fastest(slab.rows[0], slab.rows[1]),
                fastest(slab.rows[0], grid.first_of_layer(first)),
                fastest(grid.first_of_layer(last), slab.rows[1]),
            ];
            let inverse_masses = velocity.iter().map(|velocity| [velocity[3].abs(); 2]);
            slab.inverse_masses = inverse_masses.fold([f32::MAX, 0.0], wider);
            let lies = slab.fastest_own.unwrap_or(slab.speed[0]) < lying;
            slab.slow = if lies { slab.slow + dt } else { 0.0 };
            if sleeps && slab.slow > FALL_ASLEEP {
                (slab.asleep, slab.speed) = (true, [0.0; 3]);
                slab.leaving.clear();
                for (velocity, spin) in velocity.iter_mut().zip(spin) {
                    *velocity = [0.0, 0.0, 0.0, -velocity[3]];
                    *spin = [0.0, 0.0, 0.0, GROUNDED];
                }
            }
        });
        let slabs = &mut self.slabs;
        for i in 0..slabs.len() {
            let before = i.checked_sub(1).map_or(0.0, |i| slabs[i].speed[2]);
            let after = slabs.get(i + 1).map_or(0.0, |slab| slab.speed[1]);
            if slabs[i].asleep && before.max(after) > 2.0 * lying {
                slabs[i].wake(&mut self.velocity);
            }
        }
    }

    /// Changes velocities and moves the balls that are awake.
    fn drift(&mut self, change: Row, time: Row, back: Row) {
        let instructions = self.instructions;
        let columns = Columns {
            at: Shared::new(&mut self.at),
            velocity: Shared::new(&mut self.velocity),
            spin: Shared::new(&mut self.spin),
            budget: Shared::new(&mut self.budget),
            backing: Shared::new(&mut self.backing),
        };
        let slabs = Shared::new(&mut self.slabs);
        let least = -self.cap;
        each(self.model.threads as usize, slabs.len(), |_, slab| {
            // SAFETY: each thread has its own slabs, and their rows.
            let slab = unsafe { &mut *slabs.row(slab) };
            if slab.asleep {
                return;
            }
            let (rows, first) = (slab.own_rows(), slab.rows[0]);
            let (at, velocity, spin, budget) = unsafe {
                let at = columns.at.part(rows.clone());
                let (velocity, spin) =
                    (columns.velocity.part(rows.clone()), columns.spin.part(rows.clone()));
                (at, velocity, spin, columns.budget.part(rows))
            };
            for touch in &mut slab.touches {
                touch.drift(time[0]);
            }
            let (stopped, overrun) = (&mut slab.stopped, &mut slab.overrun);
            *overrun = false;
            instructions.run(Drift {
                at,
                velocity,
                spin,
                budget,
                change,
                time,
                back,
                least,
                overrun,
                stopped,
                first,
            });
        });
    }

    /// Goes over all contacts of the slabs that are awake or beside one, and of which the
    /// condition holds, given how fast a ball of the next one is.
    fn pass(&mut self, pass: Pass, condition: impl Fn(&Slab, f32) -> bool + Sync) {
        let instructions = self.instructions;
        let friction = self.common_material().friction;
        let mut strays = std::mem::take(&mut self.strays);
        self.each_slab(|next, columns, slab| {
            if slab.asleep && next.is_none_or(|(asleep, _)| asleep)
                || !condition(slab, next.map_or(0.0, |(_, speed)| speed))
            {
                return;
            }
            let Slab { batches, pushes, .. } = &mut *slab;
            solve(instructions, pass, columns, batches, pushes, friction);
            // Walls come last, so that nothing is pushed into them.
            if !slab.asleep {
                for touch in &mut slab.touches {
                    let row = touch.row as usize;
                    // SAFETY: a ball of the slab.
                    unsafe {
                        let (at, velocity) = (columns.at.row(row), columns.velocity.row(row));
                        let spin = &mut *columns.spin.row(row);
                        if columns.backed() {
                            touch.borne_for_others = touch.share_of(&*columns.backing.row(row));
                        }
                        if let Some(way) = touch.solve(pass, &mut *at, &mut *velocity, spin) {
                            *columns.budget.row(row) -= way;
                            slab.pushes.bounced = true;
                        }
                    }
                }
            }
        });
        let columns = Columns {
            at: Shared::new(&mut self.at),
            velocity: Shared::new(&mut self.velocity),
            spin: Shared::new(&mut self.spin),
            budget: Shared::new(&mut self.budget),
            backing: Shared::new(&mut self.backing),
        };
        let Strays { batches, pushes, .. } = &mut strays;
        solve(instructions, pass, columns, batches, pushes, friction);
        self.strays = strays;
    }

    /// Works on all slabs, each with exclusive access to the balls of it and of the next one.
    /// Says whether the next one sleeps and how fast a ball of it is.
    fn each_slab(&mut self, job: impl Fn(Option<(bool, f32)>, Columns, &mut Slab) + Sync) {
        let columns = Columns {
            at: Shared::new(&mut self.at),
            velocity: Shared::new(&mut self.velocity),
            spin: Shared::new(&mut self.spin),
            budget: Shared::new(&mut self.budget),
            backing: Shared::new(&mut self.backing),
        };
        let slabs = Shared::new(&mut self.slabs);
        let (threads, states) = (self.model.threads as usize, &mut self.slab_states);
        each_beside(threads, slabs.len(), states, |slab| {
            // SAFETY: nobody works on a neighbour meanwhile. Of the next one, only what nobody
            // changes is read.
            unsafe {
                let next = (slab + 1 < slabs.len()).then(|| {
                    let next = slabs.row(slab + 1);
                    ((*next).asleep, (*next).speed[0])
                });
                job(next, columns, &mut *slabs.row(slab));
            }
        });
    }
}

/// The range of two ranges.
fn wider([a, b]: [f32; 2], [c, d]: [f32; 2]) -> [f32; 2] {
    [a.min(c), b.max(d)]
}

/// Says if a ball leaves its budget within a time.
fn leaves(velocity: &Row, budget: f32, time: f32) -> bool {
    budget < 0.0 || squared(*velocity) * time * time > budget * budget
}

fn row(vector: Vec3<f32>) -> Row {
    [vector.x, vector.y, vector.z, 0.0]
}

/// Springs that are as stiff as so short a step allows (Catto, `Solver2D`, 2024).
fn soft(h: f32, gravity: f32) -> Soft {
    let omega = 2.0 * std::f32::consts::PI * HERTZ.min(0.25 / h);
    let a1 = 2.0 * DAMPING + h * omega;
    let a2 = h * omega * a1;
    let a3 = 1.0 / (1.0 + a2);
    let slop = if gravity > 0.0 { SLOP } else { SLOP_WEIGHTLESS };
    Soft { rate: omega / a1, fastest: PUSHING * gravity, mass: a2 * a3, back: a3, slop }
}
