//! The three verbs of [`Response::SoftStep`](crate::response::Response::SoftStep): marbles are rows of the same solve as the balls of
//! the swarm.

use std::collections::BTreeSet;

use cgmath::{EuclideanSpace, Zero};

use super::joints::JointedBodies;
use super::method::{Method, SleepUnit};
use super::soft_impacts::{ChunkContacts, PredictedImpacts, drop_listed_twice};
use super::swarm::clamped_row;
use super::swept_walls::SweptWalls;
use super::{MarbleId, World};
use crate::Error;
use crate::broad::CollisionLayers;
use crate::contact::Contacts;
use crate::error::within;
use crate::handle::NO_ROW;
use crate::math::{Scalar, Vec3, cast_vector, length};
use crate::motion::Rotation;
use crate::response::Material;
use crate::swarm::{
    BallSurface, BodyRow, INFINITE_MASS, LEAST_RADIUS, MAX_COORDINATE, MarbleRow, NearLimits,
    SyncToken, VelocityChange,
};
use crate::workers::append_all;

/// Correspondence of marbles and rows, and scratch memory.
#[derive(Clone, Debug, Default)]
pub(super) struct SoftRows<S> {
    /// Number of removals and of marbles, rotation model, and whether the swarm has the default
    /// material: others change the rows of all.
    known: Option<(u64, usize, Rotation, bool)>,
    token: SyncToken,
    pub slot_of_marble: Vec<u32>,
    pub marble_of_slot: Vec<u32>,
    pub jointed: JointedBodies,
    changed: Vec<BodyRow<S>>,
    lists: Vec<ChunkContacts<S>>,
    /// Length of the step that was integrated, in seconds.
    dt: S,
    /// Length of the step and identity of the walls for which contacts were found.
    found: Option<(S, u64)>,
    pub predicted: PredictedImpacts<S>,
}

/// Least and largest inverse mass of a row, in 1/kg: products with it and quotients by it are
/// numbers.
const INVERSE_MASSES: [f64; 2] = [INFINITE_MASS, 1e25];

/// Soft contacts in small steps, all within the third verb.
pub(super) struct SoftStep;

impl<S: Scalar> Method<S> for SoftStep {
    fn advance(&self, _: &mut World<S>, _: S) {} // the solver moves marbles

    fn contact_distance(&self, _: &World<S>, _: S) -> S {
        S::zero()
    }

    fn solve(&self, _: &mut World<S>, _: S) {} // the solver has a list of its own

    fn integrate(&self, world: &mut World<S>, dt: S) -> Result<(), Error> {
        world.integrate_forces(dt)
    }

    fn generate_contacts(&self, world: &mut World<S>) {
        world.find_soft_contacts();
    }

    fn restitute(&self, world: &mut World<S>, dt: S) -> Result<(), Error> {
        world.solve_soft_contacts(dt)
    }

    fn interpolates_walls(&self) -> bool {
        false
    }

    fn sleep_unit(&self) -> SleepUnit {
        SleepUnit::None // its rows do
    }
}

impl<S: Scalar> World<S> {
    /// The first verb: forces other than gravity become changes of velocity, which the third one
    /// applies in substeps.
    fn integrate_forces(&mut self, dt: S) -> Result<(), Error> {
        if self.settings.model.rotation == Rotation::Dynamic {
            if self.marbles.has_external_forces() {
                self.marbles.integrate_angular_velocity(dt);
                self.quarantine_non_finite();
            }
        } else {
            self.marbles.integrate_rotations(dt, self.settings.model.rotation, &[]);
            self.quarantine_non_finite();
        }
        self.scratch.soft_step.dt = dt;
        self.find_jointed();
        self.sync_bodies()?;
        self.scratch.accelerations.clear();
        if !self.settings.forces.is_empty() || self.marbles.accelerate_differently() {
            let context = self.settings.step_context(dt);
            self.marbles.mean_accelerations(context, &mut self.scratch.accelerations);
        }
        let (gravity, step) = (cast_vector::<S, f64>(self.settings.gravity), dt.as_f64());
        let slots = &self.scratch.soft_step.slot_of_marble;
        let of_marbles =
            self.scratch.accelerations.iter().zip(slots).filter_map(|(acceleration, slot)| {
                // One that overflows stops its marble in the swarm.
                let change: [S; 3] = cast_vector((acceleration - gravity) * step).into();
                (change != [S::zero(); 3] && *slot != NO_ROW)
                    .then_some(VelocityChange { slot: *slot, change })
            });
        let mut changes: Vec<_> = of_marbles.collect();
        changes.append(&mut self.field_changes_of_swarm(dt));
        self.swarm.set_velocity_changes(changes);
        Ok(())
    }

    /// The second verb: finds which pairs may touch within the step, and lists those of marbles.
    fn find_soft_contacts(&mut self) {
        self.walls.update_tree();
        if self.check_rows().and_then(|()| self.sync_bodies()).is_err() {
            return; // the third verb says so
        }
        let (dt, gravity) = (self.scratch.soft_step.dt, self.settings.gravity);
        let walls = SweptWalls::new(&self.walls, dt);
        self.swarm.prepare(dt, gravity, &walls, self.walls.identity());
        self.walls.mark_seen();
        self.scratch.soft_step.found = Some((dt, self.walls.identity()));
        let marbles = &self.scratch.soft_step.marble_of_slot;
        let turns = self.settings.model.rotation == Rotation::Dynamic;
        let columns = self.marbles.body_columns(turns);
        self.swarm.read_bodies(marbles, columns, None, &mut self.scratch.stopped);
        self.list_soft_contacts(dt);
    }

    /// Lists contacts that touch or may do so within `dt` seconds, and predicts which begin in that
    /// time.
    fn list_soft_contacts(&mut self, dt: S) {
        let mut lists = std::mem::take(&mut self.scratch.soft_step.lists);
        let fast = self.resting_speed(dt);
        let limits = NearLimits { reach: fast * dt, time: dt, fast };
        let moving = self.list_moving_walls(dt);
        self.swarm.fill_lists(&mut lists, |list, pairs| {
            let marbles = &self.scratch.soft_step.marble_of_slot;
            let listed = (&mut list.contacts, &mut list.meetings);
            self.swarm.list_contacts(pairs, marbles, limits, listed);
            if !self.marbles.ignored_rows.is_empty() {
                // Those of the step before are listed, too.
                let filter = |row: u32| self.marbles.filter_of_row(row as usize);
                list.contacts.wm.retain(|c| self.walls.collides(c.a, filter(c.b)));
            }
            self.set_materials(&mut list.contacts);
            self.predict_impacts(list, &moving, dt);
        });
        drop_listed_twice(&mut lists, self.marbles.len());
        let threads = self.swarm.threads();
        append_all(threads, lists.iter().map(|list| &list.contacts.wm[..]), &mut self.contacts.wm);
        append_all(threads, lists.iter().map(|list| &list.contacts.mm[..]), &mut self.contacts.mm);
        self.collect_predicted(&mut lists, moving, dt);
        lists.iter_mut().for_each(ChunkContacts::clear); // else a clone would copy them
        self.scratch.soft_step.lists = lists;
    }

    /// Gives contacts their materials, if any body has one of its own.
    fn set_materials(&self, Contacts { wm, mm }: &mut Contacts<S>) {
        if self.marbles.own.material.is_empty() && !self.walls.have_materials() {
            return;
        }
        for c in wm {
            c.material = self.wall_contact_material(c.a, c.b as usize);
        }
        for c in mm {
            c.material = self.marbles.contact_material(c.a as usize, c.b as usize);
        }
    }

    /// The third verb: moves marbles on in substeps, and solves their contacts.
    fn solve_soft_contacts(&mut self, dt: S) -> Result<(), Error> {
        self.check_rows()?;
        let identity = self.walls.identity();
        let is_changed = self.scratch.soft_step.found.take() != Some((dt, identity));
        if is_changed || !self.scratch.soft_step.predicted.are_of(&self.marbles) {
            self.drop_missing_contacts();
        }
        self.audit_contacts();
        self.find_jointed();
        self.sync_bodies()?; // somebody may have moved some since the first verb
        self.walls.update_tree();
        self.audit_rows_before();
        self.give_joints(dt);
        self.give_bodies(dt);
        let walls = SweptWalls::new(&self.walls, dt);
        if is_changed || !self.swarm.is_prepared() {
            self.swarm.prepare(dt, self.settings.gravity, &walls, identity);
        }
        if self.settings.records_impulses {
            self.swarm.record_impulses();
        }
        self.swarm.finish(dt, self.settings.model.substeps, &walls);
        self.walls.mark_seen();
        let marbles = &self.scratch.soft_step.marble_of_slot;
        let stopped = self.swarm.stopped_slots();
        let stopped = stopped.filter_map(|slot| marbles.get(slot as usize).copied());
        self.scratch.stopped.extend(stopped.filter(|marble| *marble != NO_ROW));
        let turns = self.settings.model.rotation == Rotation::Dynamic;
        let columns = self.marbles.body_columns(turns);
        self.swarm.read_bodies(marbles, columns, Some(dt), &mut self.scratch.stopped);
        self.take_joints();
        self.take_bodies(dt);
        self.quarantine_stopped();
        self.list_impacts(dt);
        self.audit_rows_after();
        self.roll_what_only_shows();
        self.fill_in_impulses(); // after all that reads the list: it may add to it
        self.settings.limits.apply(&mut self.marbles);
        self.audit_after();
        Ok(())
    }

    /// Returns true if a marble sleeps as a row.
    pub(super) fn is_soft_asleep(&self, id: MarbleId, row: usize) -> bool {
        if self.changes_are_listed() {
            let slot = self.scratch.soft_step.slot_of_marble.get(row);
            return slot.is_some_and(|slot| self.swarm.is_slot_asleep(*slot));
        }
        let bodies = &self.swarm.body_balls;
        let found = bodies.binary_search_by_key(&id, |(marble, _)| *marble);
        found.is_ok_and(|i| self.swarm.is_asleep(bodies[i].1))
    }

    /// Identity of the correspondence of marbles and rows: removals, number, rotation model, and
    /// whether the swarm has the default material.
    fn row_identity(&self) -> (u64, usize, Rotation, bool) {
        let plain = self.swarm.model().material == Material::default();
        (self.marbles.removals(), self.marbles.len(), self.settings.model.rotation, plain)
    }

    /// Returns true if all marbles that differ from their rows are listed.
    fn changes_are_listed(&self) -> bool {
        let token = &self.scratch.soft_step.token;
        self.scratch.soft_step.known == Some(self.row_identity())
            && self.swarm.synced.agrees(token)
            && self.marbles.changed.agrees(token)
    }

    /// Number of marbles that were set since the last step; `None` if changes are not tracked.
    pub(super) fn changed_marbles(&self) -> Option<usize> {
        self.changes_are_listed().then(|| self.marbles.changed.rows().len())
    }

    /// Checks that the numbers of all marbles that were set fit into rows.
    pub(super) fn check_rows(&self) -> Result<(), Error> {
        if !self.settings.model.response.uses_swarm_rows() {
            return Ok(());
        }
        if self.changes_are_listed() {
            self.marbles.changed.rows().iter().try_for_each(|row| self.check_row(*row as usize))
        } else {
            (0..self.marbles.len()).try_for_each(|row| self.check_row(row))
        }
    }

    /// Marbles by which the next [step](Self::step) would be refused, each with the reason: of
    /// [`Response::SoftStep`](crate::response::Response::SoftStep), those that were set to numbers that do not fit into its rows;
    /// of [`EventDriven`](crate::response::Response::EventDriven), those with
    /// [locked axes](crate::motion::LockedAxes).
    pub fn unsupported_marbles(&self) -> Vec<(MarbleId, Error)> {
        if !self.settings.model.response.uses_swarm_rows() {
            let locked = |row: usize| {
                Some((self.marbles.id(row)?, self.check_locked_axes_of_row(row).err()?))
            };
            let any = !self.marbles.own.locked_axes.is_empty();
            let rows = if any { 0..self.marbles.len() } else { 0..0 };
            return rows.filter_map(locked).collect();
        }
        let find = |row: usize| Some((self.marbles.id(row)?, self.check_row(row).err()?));
        if self.changes_are_listed() {
            // One that was set more than once is listed as often.
            let rows: BTreeSet<u32> = self.marbles.changed.rows().iter().copied().collect();
            rows.into_iter().filter_map(|row| find(row as usize)).collect()
        } else {
            (0..self.marbles.len()).filter_map(find).collect()
        }
    }

    /// Checks that the numbers of a marble fit into a row. One that flew farther in steps may go on.
    fn check_row(&self, row: usize) -> Result<(), Error> {
        let marbles = &self.marbles;
        let [least, most] = [LEAST_RADIUS, MAX_COORDINATE].map(|x| S::from_f64(x).as_f64());
        let radius = marbles.radius[row].as_f64();
        within("radius", radius, least, most)?;
        let position = cast_vector::<S, f64>(marbles.position[row].to_vec());
        let velocity = cast_vector::<S, f64>(marbles.velocity[row]);
        let [same_place, same_velocity, same_spin] = self.same_as_row(row);
        if !same_place {
            within_vector(["position.x", "position.y", "position.z"], position, most)?;
        }
        if !same_velocity {
            within_vector(["velocity.x", "velocity.y", "velocity.z"], velocity, most)?;
        }
        let turns = marbles.rotation_of(row, self.settings.model.rotation) == Rotation::Dynamic;
        match marbles.angular_velocity.get(row) {
            Some(spin) if turns && !same_spin => {
                let names = ["angular_velocity.x", "angular_velocity.y", "angular_velocity.z"];
                within_vector(names, cast_vector(*spin), most / radius)
            }
            _ => Ok(()),
        }
    }

    /// Returns true for the position, the velocity and the spin of a marble that are those of its row,
    /// or less.
    fn same_as_row(&self, row: usize) -> [bool; 3] {
        let bodies = &self.swarm.body_balls;
        let found = self.marbles.id(row).and_then(|id| {
            let i = bodies.binary_search_by_key(&id, |(marble, _)| *marble).ok()?;
            self.swarm.motion_of(bodies[i].1)
        });
        let Some((position, velocity, surface_speed)) = found else { return [false; 3] };
        let (marbles, speed) = (&self.marbles, |v: Vec3<S>| length(v).as_f64());
        let turning = marbles.angular_velocity.get(row).copied().map_or(0.0, speed);
        let rounded = surface_speed.as_f64() * 1.000_001;
        [
            marbles.position[row] == position,
            speed(marbles.velocity[row]) <= speed(velocity),
            turning * marbles.radius[row].as_f64() <= rounded,
        ]
    }

    /// Brings rows up to date with marbles that came, went, or were set.
    fn sync_bodies(&mut self) -> Result<(), Error> {
        self.swarm.set_bodies_are_rows(true);
        if self.changes_are_listed() {
            let rows = self.marbles.changed.take();
            self.find_changes(&rows);
            self.marbles.changed.recycle(rows);
        } else {
            self.remove_stale_bodies()?;
            self.insert_missing_bodies()?;
            self.match_slots();
            let all: Vec<_> = (0..self.marbles.len() as u32).collect();
            self.find_changes(&all);
            let [token, synced, changed] = SyncToken::unique();
            (self.scratch.soft_step.token, self.swarm.synced) = (token, synced);
            self.marbles.changed.reset(changed);
            self.scratch.soft_step.known = Some(self.row_identity());
        }
        self.swarm.write_bodies(&self.scratch.soft_step.changed);
        self.sync_ignored_pairs();
        Ok(())
    }

    /// Finds which of these marbles differ from their rows.
    fn find_changes(&mut self, rows: &[u32]) {
        let (marbles, rotation) = (&self.marbles, self.settings.model.rotation);
        let plain_swarm = self.swarm.model().material == Material::default();
        let SoftRows { slot_of_marble, changed, jointed, .. } = &mut self.scratch.soft_step;
        changed.clear();
        for row in rows.iter().map(|row| *row as usize) {
            let Some(slot) = slot_of_marble.get(row).copied().filter(|slot| *slot != NO_ROW) else {
                continue;
            };
            let material = marbles.own.material.get(row);
            let rotation_locked = marbles.rotation_of(row, rotation) != Rotation::Dynamic;
            let locked_axes = marbles.locked_axes_of_row(row);
            let is_plain = plain_swarm && !rotation_locked && locked_axes.is_empty();
            let surface = (material.is_some() || !is_plain).then(|| {
                let material = material.unwrap_or_default();
                BallSurface { material, rotation_locked, locked_axes }
            });
            let spin = marbles.angular_velocity.get(row).copied().filter(|_| !rotation_locked);
            let marble = MarbleRow {
                position: marbles.position[row],
                velocity: marbles.velocity[row],
                spin,
                radius: marbles.radius[row],
            };
            let mass = marbles.mass(row);
            let inverse_mass = inverse_mass(mass);
            let sleepless = marbles.own.sleeping_disabled.get(row).is_some()
                || jointed.is_jointed.get(row) == Some(&true);
            let numbers = [row_radius(marble.radius), inverse_mass];
            let layers = marbles.layers_of_row(row);
            let is_kinematic = mass.is_infinite();
            let flags = [is_kinematic, sleepless];
            if !self.swarm.is_as_read(slot, marble, numbers, (surface, layers), flags) {
                let body = body(slot, marble, inverse_mass, surface);
                changed.push(BodyRow {
                    layers,
                    is_kinematic,
                    sleeping_disabled: sleepless,
                    ..body
                });
            }
        }
    }

    /// Finds the slot of each marble, and the marble of each slot.
    fn match_slots(&mut self) {
        let SoftRows { slot_of_marble, marble_of_slot, .. } = &mut self.scratch.soft_step;
        slot_of_marble.clear();
        slot_of_marble.resize(self.marbles.len(), NO_ROW);
        marble_of_slot.clear();
        for (marble, ball) in &self.swarm.body_balls {
            if let (Ok(row), Some(slot)) = (self.marbles.row(*marble), self.swarm.slot_of(*ball)) {
                slot_of_marble[row] = slot;
                let slots = marble_of_slot.len().max(slot as usize + 1);
                marble_of_slot.resize(slots, NO_ROW);
                marble_of_slot[slot as usize] = row as u32;
            }
        }
        self.swarm.set_bodies(slot_of_marble.iter().copied().filter(|slot| *slot != NO_ROW));
    }
}

/// Inverse mass of a row, in 1/kg.
pub(super) fn inverse_mass<S: Scalar>(mass: S) -> S {
    let [least, most] = INVERSE_MASSES.map(S::from_f64);
    (S::one() / mass).clamp(least, most)
}

/// Validates that no component of a vector is larger.
fn within_vector(names: [&'static str; 3], v: Vec3<f64>, most: f64) -> Result<(), Error> {
    let components: [f64; 3] = v.into();
    names
        .into_iter()
        .zip(components)
        .try_for_each(|(name, x)| within(name, x, -most, most).map(|_| ()))
}

/// Radius of a row, in metres.
fn row_radius<S: Scalar>(radius: S) -> S {
    radius.clamp(S::from_f64(LEAST_RADIUS), S::from_f64(MAX_COORDINATE))
}

/// A marble as a row.
fn body<S: Scalar>(
    slot: u32,
    marble: MarbleRow<S>,
    inverse_mass: S,
    surface: Option<BallSurface<S>>,
) -> BodyRow<S> {
    let spin = marble.spin.map_or_else(Vec3::zero, |spin| spin * marble.radius);
    BodyRow {
        slot,
        at: clamped_row(marble.position.to_vec(), row_radius(marble.radius)),
        velocity: clamped_row(marble.velocity, inverse_mass),
        spin: clamped_row(spin, S::zero()),
        surface,
        layers: CollisionLayers::ALL,
        is_kinematic: false,
        sleeping_disabled: false,
    }
}
