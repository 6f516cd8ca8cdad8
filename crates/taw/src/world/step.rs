//! The step: its three verbs, each by the model's response.

use super::World;
use super::method::{Method, method_of};
use super::walls::SubShape;
use crate::Error;
use crate::contact::Contact;
use crate::math::Scalar;
use crate::motion::Rotation;

impl<S: Scalar> World<S> {
    /// Moves the world on by `dt` seconds, in [`Model::substeps`](super::Model::substeps) equal
    /// parts.
    ///
    /// A marble whose motion overflows keeps its last place, loses its velocity and its spin,
    /// and is named by [`World::stopped`]; no marble that does not touch it is affected.
    ///
    /// # Errors
    /// [`Error::NotPositive`] for `dt`; [`Error::OutOfRange`] if it, or a substep of it, is not in
    /// [`World::TIMES`]; [`Error::UnsupportedShape`] for a capsule in a world that is event-driven,
    /// periodic, or steps by `SoftStep`; [`Error::Unsupported`] for [joints](Self::joints) by another
    /// response, and for [locked axes](crate::motion::LockedAxes) by `EventDriven`; [`Error::OutOfRange`] for a marble too large for its
    /// [period](Self::set_period), and by `SoftStep` for one that was set to a radius of less than
    /// 1e-9 m, or to a position, velocity or surface speed of over 1e12 m or m/s;
    /// [`Error::TooManyPairs`] if more than [`World::MAX_PAIRS`] overlap, as from some 16,400 marbles
    /// or balls of the swarm at one point on. Then nothing has changed.
    pub fn step(&mut self, dt: S) -> Result<(), Error> {
        let substep = self.validated_substep(dt)?;
        self.check_shapes()?;
        self.check_crowding()?;
        self.begin_step();
        for after in (0..self.settings.model.passes()).rev() {
            self.begin_substep(substep * S::from_f64(f64::from(after)));
            self.integrate_checked(substep)?;
            self.generate_contacts();
            self.restitute(substep)?;
        }
        let swarm = self.move_swarm(dt, &mut |_| ()); // counted with the marbles
        self.end_step();
        swarm
    }

    /// The first verb: forces change velocities, velocities change positions, over
    /// `dt` seconds. For [`EventDriven`](crate::response::Response::EventDriven), forces become accelerations only: what
    /// moves when is decided by the third verb.
    ///
    /// # Errors
    /// [`Error::NotPositive`] for `dt`, [`Error::OutOfRange`] if it is not in [`World::TIMES`],
    /// and what [`World::step`] says of marbles; then nothing has moved.
    pub fn integrate(&mut self, dt: S) -> Result<(), Error> {
        let dt = Self::validated_dt(dt)?;
        self.check_shapes()?;
        self.check_crowding()?;
        self.integrate_checked(dt)
    }

    /// See [`World::integrate`].
    fn integrate_checked(&mut self, dt: S) -> Result<(), Error> {
        self.decide_one_way(dt);
        self.find_ignored_rows();
        let held = self.marbles.held();
        self.marbles.hold(&held); // somebody may have set velocities
        self.sensors.begin_substep(&self.marbles, &self.bodies);
        self.audit_before();
        self.wake_changed();
        self.wake_pulled();
        self.scratch.substep = dt;
        let method = method_of(self.settings.model.response);
        if self.are_all_asleep() {
            // For one that is set before the other verbs.
            self.store_poses();
            self.forget_motion();
            self.scratch.reach = method.contact_distance(self, dt);
            return Ok(());
        }
        method.integrate(self, dt)?;
        self.marbles.hold(&held);
        Ok(())
    }

    /// Integrates marbles by a method: velocities, positions, rotations.
    pub(super) fn integrate_marbles(&mut self, method: &(impl Method<S> + ?Sized), dt: S) {
        self.store_poses();
        self.forget_motion();
        self.begin_continuous();
        let rotation = self.settings.model.rotation;
        if rotation == Rotation::Dynamic {
            self.marbles.integrate_angular_velocity(dt);
        }
        method.advance(self, dt);
        self.quarantine_non_finite();
        self.scratch.reach = method.contact_distance(self, dt);
        self.audit_forces();
    }

    /// Forgets how marbles moved in the last substep.
    fn forget_motion(&mut self) {
        self.scratch.continuous.clear();
        self.scratch.columns.velocity_before.clear();
    }

    /// Moves marbles freely over `dt` seconds; with continuous detection, to where they meet others.
    pub(super) fn move_marbles(&mut self, dt: S) {
        let context = self.settings.step_context(dt);
        self.marbles.integrate(context, &mut self.scratch.stopped);
        self.solve_continuous(dt);
        let turns = &self.scratch.continuous.turns;
        self.marbles.integrate_rotations(dt, self.settings.model.rotation, turns);
    }

    /// The second verb: finds who touches whom, and by how much.
    ///
    /// For [`Impulse`](crate::response::Response::Impulse) and
    /// [`Displacement`](crate::response::Response::Displacement), that is also who is so near that
    /// gravity closes the gap within two substeps; for `Impulse`, whom the last substep pressed
    /// together, too, if something may do so again. The displacement of these is zero, and the latter
    /// are off the list after [`World::restitute`]. For
    /// [`EventDriven`](crate::response::Response::EventDriven) it is who may rest on each other at the start; who comes
    /// together later is found later.
    pub fn generate_contacts(&mut self) {
        self.contacts.clear();
        self.find_ignored_rows();
        self.wake_changed();
        if !self.are_all_asleep() {
            method_of(self.settings.model.response).generate_contacts(self);
        }
    }

    /// Lists contacts up to the speculative margin.
    pub(super) fn list_contacts(&mut self) {
        loop {
            self.collide_walls(self.scratch.reach);
            self.collide_marbles(self.scratch.reach);
            self.add_grazing_contacts();
            if !self.wake_touched() {
                break;
            }
            self.contacts.clear();
        }
        self.drop_separated_stops();
    }

    /// The third verb: contacts change positions and velocities back to what the
    /// scene allows. `dt` is the time that was integrated, in seconds.
    ///
    /// # Errors
    /// [`Error::NotPositive`] for `dt`, [`Error::OutOfRange`] if it is not in [`World::TIMES`].
    pub fn restitute(&mut self, dt: S) -> Result<(), Error> {
        let dt = Self::validated_dt(dt)?;
        self.find_ignored_rows();
        self.wake_changed();
        if !self.are_all_asleep() {
            method_of(self.settings.model.response).restitute(self, dt)?;
        }
        self.scratch.substep = S::zero();
        self.update_sensors(dt);
        Ok(())
    }

    /// Solves the listed contacts by a method.
    pub(super) fn solve_listed_contacts(&mut self, method: &(impl Method<S> + ?Sized), dt: S) {
        let held = self.marbles.held();
        self.marbles.hold(&held); // somebody may have set velocities
        self.walls.update_tree(); // some may have been taken out since contacts were looked for
        self.drop_missing_contacts();
        self.release_separated_stops();
        self.contacts.sort();
        self.audit_contacts();
        self.follow_contacts();
        self.scratch.columns.read(&mut self.marbles, self.settings.model);
        method.solve(self, dt);
        self.marbles.hold(&held);
        self.stop_bounces_at_walls();
        self.marbles.hold(&held);
        self.quarantine_non_finite();
        self.roll_what_only_shows();
        self.settings.limits.apply(&mut self.marbles);
        self.update_sleep(dt);
        self.audit_after();
        self.marbles.wrap();
    }

    /// Drops contacts of rows that do not exist any more.
    pub(super) fn drop_missing_contacts(&mut self) {
        let (walls, marbles) = (self.walls.len() as u32, self.marbles.len() as u32);
        // Nor is a sleeper one of those that were listed: it has the row of one that was taken out.
        let is_there = |row: u32| row < marbles && !self.marbles.sleep.is_asleep(row as usize);
        self.contacts.wm.retain(|c| c.a < walls && is_there(c.b));
        self.contacts.mm.retain(|c| is_there(c.a) && is_there(c.b));
    }

    /// Makes marbles that turn for show only roll over the walls that they touch.
    pub(super) fn roll_what_only_shows(&mut self) {
        let all_dynamic =
            self.settings.model.rotation == Rotation::Dynamic && !self.marbles.has_rotation_locks();
        if self.settings.model.rotation == Rotation::None || all_dynamic {
            return;
        }
        // The deepest contact comes first in the list, so it has the last word.
        let (walls, marbles) = (self.walls.len() as u32, self.marbles.len() as u32);
        let is_there = |c: &&Contact<S>| c.a < walls && c.b < marbles && c.is_touching();
        for contact in self.contacts.wm.iter().filter(is_there).rev() {
            let part = SubShape { wall: contact.a, index: contact.part };
            let row = contact.b as usize;
            let normal = self.walls.project_point(part, self.marbles.position()[row]).normal;
            if self.marbles.rotation_of(row, self.settings.model.rotation) == Rotation::Rolling {
                self.marbles.roll_without_slip(row, normal);
            }
        }
    }

    /// Forgets who was [stopped](World::stopped), and the [impacts](World::impacts). A
    /// step begins with this; whoever calls the verbs one by one begins so too.
    pub fn begin_step(&mut self) {
        self.scratch.rest_of_step = S::zero();
        self.scratch.stopped.clear();
        self.quarantined.clear();
        self.impacts.clear();
        self.sensors.begin_step();
        self.joints.begin_step();
        self.reset_audit();
    }

    /// Begins a substep, after which `rest` seconds of the step are left: walls that were set
    /// elsewhere and have a motion are where that puts them by then. Whoever calls the verbs one by
    /// one in several substeps begins each so; without it, walls are at the end of their ways.
    pub fn begin_substep(&mut self, rest: S) {
        self.scratch.rest_of_step = if rest.is_finite() { rest.max(S::zero()) } else { S::zero() };
        if method_of::<S>(self.settings.model.response).interpolates_walls() {
            self.walls.interpolate_to(self.scratch.rest_of_step);
        }
    }

    /// Ends a step, that of the [swarm](Self::step_swarm) included: walls are at the end of their
    /// ways, forces that were applied are forgotten, and sensors find the balls of the swarm.
    pub fn end_step(&mut self) {
        self.scratch.sleep.walls = self.walls.identity();
        self.walls.finish_step();
        self.marbles.clear_forces();
        self.swarm.clear_accelerations();
        self.joints.end_step();
        self.sense_balls();
    }
}
