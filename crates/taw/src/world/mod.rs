//! The state as columns, the choice of methods, and the step.

mod changed_rows;
mod contact_limit;
mod continuous;
mod energy;
mod energy_audit;
mod event_driven;
mod external_forces;
mod integrate;
mod limits;
mod marble;
mod marble_rotation;
mod marble_setters;
mod marble_shapes;
mod marbles;
mod model;
mod narrow_phase;
mod quarantine;
mod query;
mod soft_step;
mod sparse_column;
mod swarm;
#[cfg(test)]
mod tests;
mod wall_changes;
mod wall_shape;
mod walls;

pub use crate::handle::MarbleId;
pub use crate::motion::{Mass, WallMotion};
pub use energy::Energy;
pub use energy_audit::EnergyAudit;
pub use limits::SpeedLimits;
pub use marble::{Damping, Marble};
pub use marbles::Marbles;
pub use model::{Detection, Model, Precision};
pub use query::{ColliderId, Queries, QueryHit, QueryTree};
pub use wall_shape::WallShape;
pub use walls::{WallId, Walls};

use crate::Error;
use crate::broad::{Grid, Images, Period};
use crate::contact::Contacts;
use crate::error::{finite, finite_vector, positive};
use crate::math::{Point3, Scalar, Vec3, cast_vector, length};
use crate::motion::{ForceField, Rotation};
use crate::response::event::EventDriven;
use crate::response::impulse::{
    self, CachedImpulse, Context, SolverSettings, SubstepStart, solve_contacts,
};
use crate::response::{
    CapsuleInertia, Impact, Response, SpringHistory,
    displacement::{self, solve_displacement},
    penalty::{PenaltySettings, apply_penalty_forces},
};
use crate::swarm::Swarm;
use contact_limit::ContactLimit;
use continuous::Continuous;
use energy_audit::AuditState;
use integrate::StepContext;
use narrow_phase::Candidate;
use quarantine::Quarantine;
use soft_step::SoftStep;
use walls::SubShape;

/// Everything that moves and everything that it can touch.
///
/// A world is plain data: a clone is a snapshot, and stepping two clones gives
/// the same bits. Two worlds are equal when their state and their last contacts
/// are; what a step only scribbles on does not count.
#[derive(Clone, Debug)]
pub struct World<S> {
    model: Model,
    gravity: Vec3<S>,
    forces: Vec<ForceField<S>>,
    limits: SpeedLimits<S>,
    /// What moves.
    pub marbles: Marbles<S>,
    /// What nothing can move.
    pub walls: Walls<S>,
    /// Balls in bulk, which touch the walls. (What is touched by whom of them is not listed.)
    pub swarm: Swarm,
    /// The touches of the last substep, except those of marbles [asleep](Self::is_asleep) with each
    /// other and with walls. Between [`World::generate_contacts`] and
    /// [`World::restitute`] they may be changed: what is taken out is not
    /// restituted, and a row that does not exist is passed over.
    ///
    /// Of a marble among many, those with the 32 that are deepest in it or nearest are listed, of
    /// all that are as large or larger; of a long capsule so many more as it is longer than wide.
    pub contacts: Contacts<S>,
    /// The collisions of the last step, if the response is event-driven.
    impacts: Vec<Impact<S>>,
    grid: Grid,
    images: Images<S>,
    /// The rows that the verb at work has stopped.
    stopped: Vec<u32>,
    quarantine: Quarantine<S>,
    contact_limit: ContactLimit<S>,
    /// How wide a gap still makes a contact, in metres: what gravity closes in two
    /// substeps, for a response that looks ahead.
    reach: S,
    inverse_mass: Vec<S>,
    /// Before forces changed them in this substep, in m/s; empty for a response that has no use
    /// for them.
    velocity_before: Vec<Vec3<S>>,
    held: Vec<bool>,
    displacement: displacement::Scratch<S>,
    impulse: impulse::Scratch<S>,
    /// What the contacts of the last substep bore, and the removals until then: they
    /// move rows, after which nothing here has the right name any more.
    warm: Vec<CachedImpulse<S>>,
    shear: Vec<SpringHistory<S>>,
    warm_removals: [u64; 2],
    /// For a response that moves marbles by itself: how each is to be accelerated.
    accelerations: Vec<Vec3<f64>>,
    /// How much of a step comes after the substep, in seconds; zero unless within one.
    rest_of_step: S,
    events: EventDriven,
    soft_step: SoftStep<S>,
    continuous: Continuous<S>,
    near_walls: Vec<Candidate<S>>,
    /// What is long about marbles, and how far they reach.
    rods: Vec<CapsuleInertia<S>>,
    reaches: Vec<S>,
    audit_state: Option<Box<AuditState<S>>>,
}

impl<S: Scalar> Default for World<S> {
    /// Empty, with gravity 9.81 m/s² toward −y and the default [`Model`].
    fn default() -> Self {
        Self {
            model: Model::default(),
            gravity: Vec3::unit_y() * S::from_f64(-9.81),
            forces: Vec::new(),
            limits: SpeedLimits::default(),
            marbles: Marbles::default(),
            walls: Walls::default(),
            swarm: Swarm::default(),
            contacts: Contacts::default(),
            impacts: Vec::new(),
            grid: Grid::default(),
            images: Images::default(),
            stopped: Vec::new(),
            quarantine: Quarantine::default(),
            contact_limit: ContactLimit::default(),
            reach: S::zero(),
            inverse_mass: Vec::new(),
            velocity_before: Vec::new(),
            held: Vec::new(),
            displacement: displacement::Scratch::default(),
            impulse: impulse::Scratch::default(),
            warm: Vec::new(),
            shear: Vec::new(),
            warm_removals: [0; 2],
            accelerations: Vec::new(),
            rest_of_step: S::zero(),
            events: EventDriven::default(),
            soft_step: SoftStep::default(),
            continuous: Continuous::default(),
            near_walls: Vec::new(),
            rods: Vec::new(),
            reaches: Vec::new(),
            audit_state: None,
        }
    }
}

impl<S: Scalar> PartialEq for World<S> {
    fn eq(&self, other: &Self) -> bool {
        let Self {
            model,
            gravity,
            forces,
            limits,
            marbles,
            walls,
            swarm,
            contacts,
            impacts,
            quarantine,
            stopped: _,
            contact_limit: _,
            grid: _,
            images: _,
            reach: _,
            inverse_mass: _,
            velocity_before: _,
            held: _,
            displacement: _,
            impulse: _,
            warm,
            shear,
            warm_removals,
            accelerations: _,
            rest_of_step: _,
            events,
            soft_step: _,
            continuous: _,
            near_walls: _,
            rods: _,
            reaches: _,
            audit_state: _,
        } = self;
        *model == other.model
            && *gravity == other.gravity
            && *forces == other.forces
            && *limits == other.limits
            && *impacts == other.impacts
            && events.impulse_cache == other.events.impulse_cache
            && *marbles == other.marbles
            && *walls == other.walls
            && *swarm == other.swarm
            && *contacts == other.contacts
            && quarantine.stopped == other.quarantine.stopped
            && *warm == other.warm
            && *shear == other.shear
            && *warm_removals == other.warm_removals
    }
}

impl<S: Scalar> World<S> {
    /// How this world steps.
    #[must_use]
    pub fn model(&self) -> Model {
        self.model
    }

    /// Changes how the next step is done. A model equal to the current one changes nothing;
    /// another one forgets the impulses that contacts remember.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for the substeps or the iterations; [`Error::UnsupportedShape`] for
    /// [`Response::EventDriven`] and [`Response::SoftStep`] if a marble is a capsule;
    /// [`Error::Unsupported`] for [`Response::SoftStep`] in a periodic world.
    pub fn set_model(&mut self, model: Model) -> Result<(), Error> {
        let model = model.validated()?;
        if !model.response.knows_capsules()
            && let Some(id) = self.marbles.first_capsule()
        {
            return Err(Error::UnsupportedShape(id));
        }
        if model == self.model {
            return Ok(());
        }
        if model.response == Response::SoftStep && !self.marbles.period.is_open() {
            return Err(Error::Unsupported { response: "SoftStep", feature: "a period" });
        }
        self.model = model;
        self.marbles.changed.add_all();
        self.forget_contacts();
        self.marbles
            .enable_rotation(model.rotation != Rotation::None || self.marbles.has_capsules());
        self.marbles.set_compensated(model.precision == Precision::Compensated);
        Ok(())
    }

    /// The acceleration of every marble, in m/s².
    #[must_use]
    pub fn gravity(&self) -> Vec3<S> {
        self.gravity
    }

    /// Changes the acceleration of every marble, in m/s².
    ///
    /// # Errors
    /// [`Error::NotFinite`], also if it is longer than a number can be.
    pub fn set_gravity(&mut self, gravity: Vec3<S>) -> Result<(), Error> {
        finite_vector(["gravity.x", "gravity.y", "gravity.z"], gravity)?;
        finite("the length of gravity", length(gravity))?;
        self.gravity = gravity;
        Ok(())
    }

    /// Lengths of the periodic box along the axes, in metres; none along those without sides.
    #[must_use]
    pub fn period(&self) -> [Option<S>; 3] {
        self.marbles.period.lengths
    }

    /// Makes the world a periodic box around the origin: whatever leaves it through a side enters
    /// it through the opposite one, and balls touch across the sides. Along an axis with none,
    /// which is the default, it has no sides.
    ///
    /// Walls are where they are, and nowhere else: what crosses a side is to be a half-space along
    /// it. Balls of [`World::swarm`], queries and attraction know no sides. [`World::energy`] and
    /// the account count where marbles are: who crosses a side along gravity changes them. But for
    /// [`Response::EventDriven`], who goes farther than a quarter of a length in a substep may pass
    /// through others.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a length of less than 8.02 radii of the largest marble;
    /// [`Error::NotPositive`] for one that is no length; [`Error::UnsupportedShape`] if a marble is
    /// a capsule; [`Error::Unsupported`] for [`Response::SoftStep`]. Steps refuse marbles that came later in the same way.
    pub fn set_period(&mut self, lengths: [Option<S>; 3]) -> Result<(), Error> {
        for (length, field) in lengths.iter().zip(["period.x", "period.y", "period.z"]) {
            length.map(|length| positive(field, length)).transpose()?;
        }
        let period = Period { lengths };
        self.check_period(period)?;
        if period != self.marbles.period {
            self.marbles.period = period;
            self.marbles.wrap();
            self.forget_contacts();
        }
        Ok(())
    }

    /// Image of a point across the sides of the periodic box that is nearest to another point.
    #[must_use]
    pub fn nearest_image(&self, point: Point3<S>, near: Point3<S>) -> Point3<S> {
        self.marbles.period.image(point, near)
    }

    /// The force fields that act on every marble besides gravity.
    #[must_use]
    pub fn forces(&self) -> &[ForceField<S>] {
        &self.forces
    }

    /// Changes the force fields.
    ///
    /// # Errors
    /// [`Error::NotFinite`] or [`Error::OutOfRange`] for a number of one of them.
    pub fn set_forces(&mut self, forces: Vec<ForceField<S>>) -> Result<(), Error> {
        self.forces = forces.into_iter().map(ForceField::validated).collect::<Result<_, _>>()?;
        Ok(())
    }

    /// How fast marbles may be at most.
    #[must_use]
    pub fn speed_limits(&self) -> SpeedLimits<S> {
        self.limits
    }

    /// Changes how fast marbles may be at most, from the end of the next substep on.
    ///
    /// # Errors
    /// [`Error::NotPositive`].
    pub fn set_speed_limits(&mut self, limits: SpeedLimits<S>) -> Result<(), Error> {
        self.limits = limits.validated()?;
        Ok(())
    }

    /// Moves the world on by `dt` seconds, in [`Model::substeps`] equal parts.
    ///
    /// A marble whose motion overflows keeps its last place, loses its velocity and its spin,
    /// and is named by [`World::stopped`]; no marble that does not touch it is affected.
    ///
    /// # Errors
    /// [`Error::NotPositive`] for `dt`; [`Error::OutOfRange`] if it, or a substep of it, is not in
    /// [`World::TIMES`]; [`Error::UnsupportedShape`] for a capsule in a world that is event-driven
    /// or periodic; [`Error::OutOfRange`] for a marble too large for its
    /// [period](Self::set_period). Then nothing has changed.
    pub fn step(&mut self, dt: S) -> Result<(), Error> {
        let substep = self.validated_substep(dt)?;
        self.begin_step();
        for after in (0..self.model.passes()).rev() {
            self.begin_substep(substep * S::from_f64(f64::from(after)));
            self.integrate(substep)?;
            self.generate_contacts();
            self.restitute(substep)?;
        }
        self.end_step();
        self.step_swarm(dt, &mut |_| ())
    }

    /// The first verb: forces change velocities, velocities change positions, over
    /// `dt` seconds. For [`Response::EventDriven`], forces become accelerations only: what
    /// moves when is decided by the third verb.
    ///
    /// # Errors
    /// [`Error::NotPositive`] for `dt`, [`Error::OutOfRange`] if it is not in [`World::TIMES`],
    /// and what [`World::step`] says of marbles; then nothing has moved.
    pub fn integrate(&mut self, dt: S) -> Result<(), Error> {
        let dt = Self::validated_dt(dt)?;
        self.check_shapes()?;
        self.audit_before();
        if self.model.response == Response::SoftStep {
            return self.integrate_forces(dt);
        }
        self.store_poses();
        self.begin_continuous();
        let drive = StepContext {
            integrator: self.model.integrator,
            gravity: self.gravity,
            forces: &self.forces,
            dt,
        };
        if self.model.rotation == Rotation::Dynamic {
            self.marbles.integrate_angular_velocity(dt);
        }
        if self.model.response == Response::EventDriven {
            self.marbles.mean_accelerations(drive, &mut self.accelerations);
        } else {
            self.velocity_before.clear();
            if self.model.response == Response::Impulse {
                self.velocity_before.extend_from_slice(self.marbles.velocity());
            }
            self.marbles.integrate(drive, &mut self.stopped);
            self.solve_continuous(dt);
        }
        if !(self.model.response == Response::EventDriven
            && self.model.rotation == Rotation::Dynamic)
        {
            self.marbles.integrate_rotations(dt, self.model.rotation);
        }
        self.quarantine_non_finite();
        self.reach = match self.model.response {
            // Rounding must not end the touch of what falls together.
            Response::Displacement => length(self.gravity) * dt * dt * S::from_f64(1e-3),
            Response::Penalty(_) => S::zero(),
            Response::Impulse => length(self.gravity) * dt * dt * S::from_f64(2.0),
            Response::EventDriven | Response::SoftStep => self.resting_contact_distance(dt),
        };
        self.audit_forces();
        Ok(())
    }

    /// The second verb: finds who touches whom, and by how much.
    ///
    /// For [`Response::Impulse`], that is also who is so near that gravity closes the
    /// gap within two substeps; the displacement of these is zero. For
    /// [`Response::EventDriven`] it is who may rest on each other at the start; who comes
    /// together later is found later.
    pub fn generate_contacts(&mut self) {
        self.contacts.clear();
        if self.model.response == Response::SoftStep {
            return self.find_soft_contacts();
        }
        self.collide_walls(self.reach);
        self.collide_marbles(self.reach);
        self.add_grazing_contacts();
        self.drop_separated_stops();
    }

    /// The third verb: contacts change positions and velocities back to what the
    /// scene allows. `dt` is the time that was integrated, in seconds.
    ///
    /// # Errors
    /// [`Error::NotPositive`] for `dt`, [`Error::OutOfRange`] if it is not in [`World::TIMES`].
    pub fn restitute(&mut self, dt: S) -> Result<(), Error> {
        let dt = Self::validated_dt(dt)?;
        if self.model.response == Response::SoftStep {
            return self.solve_soft_contacts(dt);
        }
        self.walls.update_tree(); // some may have been taken out since contacts were looked for
        let (walls, marbles) = (self.walls.len() as u32, self.marbles.len() as u32);
        self.contacts.wm.retain(|c| c.a < walls && c.b < marbles);
        self.contacts.mm.retain(|c| c.a < marbles && c.b < marbles);
        self.release_separated_stops();
        if self.model.response == Response::Impulse {
            self.continuous.begin_bounces(&self.marbles.position);
        }
        self.audit_contacts();
        self.look_at_marbles();
        self.solve(dt);
        self.stop_bounces_at_walls();
        self.quarantine_non_finite();
        self.roll_what_only_shows();
        self.limits.apply(&mut self.marbles);
        self.audit_after();
        self.marbles.wrap();
        Ok(())
    }

    /// Solves the contacts by the model's response.
    fn solve(&mut self, dt: S) {
        let (mut columns, material, integrator) =
            self.marbles.columns(&self.inverse_mass, &self.held, &self.rods);
        if self.model.rotation != Rotation::Dynamic {
            columns.spin = &mut []; // cosmetic rotation does not affect contacts
        }
        let restitution_threshold = length(self.gravity) * dt * S::from_f64(2.0);
        let settings = SolverSettings {
            iterations: self.model.iterations,
            dt,
            restitution_threshold,
            tolerance: restitution_threshold * S::epsilon(),
            slop: length(self.gravity) * dt * dt,
            max_relative_slop: S::from_f64(0.001),
        };
        let context = Context {
            walls: &self.walls,
            material: |row| material.get(row).unwrap_or_default(),
            position_weight: |row| {
                integrator.get(row).unwrap_or(self.model.integrator).position_weight()
            },
            start: SubstepStart {
                position: &[],
                velocity: &self.velocity_before,
                ccd_stops: &self.continuous.projections,
            },
            settings: &settings,
        };
        match self.model.response {
            Response::Displacement => {
                let contacts = self.contacts.len() as u32;
                let mut pushes = self.audit_state.as_ref().map(|_| Vec::new());
                solve_displacement(
                    &mut columns,
                    &mut self.contacts,
                    &context,
                    &mut self.displacement,
                    &mut self.warm,
                    &mut self.stopped,
                    |row, change| pushes.iter_mut().for_each(|pushes| pushes.push((row, change))),
                );
                if let Some(audit_state) = &mut self.audit_state {
                    audit_state.work.collisions = contacts;
                    for (row, change) in pushes.into_iter().flatten() {
                        let mass = self.marbles.mass(row as usize).as_f64();
                        audit_state.work.momentum += cast_vector::<S, f64>(change) * mass;
                    }
                }
            }
            Response::Impulse => {
                solve_contacts(
                    &mut columns,
                    &mut self.contacts,
                    &context,
                    &mut self.impulse,
                    &mut self.warm,
                    &mut self.stopped,
                );
                if let Some(audit_state) = &mut self.audit_state {
                    let AuditState { velocity, angular_velocity, work, .. } = &mut **audit_state;
                    self.impulse.record_energy(&mut columns, velocity, angular_velocity, work);
                }
            }
            Response::Penalty(law) => apply_penalty_forces(
                &PenaltySettings {
                    law,
                    dt,
                    material: |row| material.get(row).unwrap_or_default(),
                    position_weight: |row| {
                        integrator.get(row).unwrap_or(self.model.integrator).position_weight()
                    },
                },
                &mut columns,
                &mut self.contacts,
                &self.walls,
                &mut self.shear,
                &mut self.stopped,
                self.audit_state.as_mut().map(|audit_state| &mut audit_state.work),
            ),
            Response::EventDriven => self.step_events(dt, self.rest_of_step),
            Response::SoftStep => {}
        }
    }

    /// Makes marbles that turn for show only roll over the walls that they touch.
    fn roll_what_only_shows(&mut self) {
        let all_dynamic =
            self.model.rotation == Rotation::Dynamic && !self.marbles.has_rotation_locks();
        if self.model.rotation == Rotation::None || all_dynamic {
            return;
        }
        // The deepest contact comes first in the list, so it has the last word.
        for contact in self.contacts.wm.iter().rev() {
            let part = SubShape { wall: contact.a, index: contact.part };
            let row = contact.b as usize;
            let normal = self.walls.project_point(part, self.marbles.position()[row]).normal;
            if self.marbles.rotation_of(row, self.model.rotation) == Rotation::Rolling {
                self.marbles.roll_without_slip(row, normal);
            }
        }
    }

    /// Brings up to date what a response asks of marbles: masses, who is held, what is long;
    /// and forgets contacts whose rows are no longer theirs.
    fn look_at_marbles(&mut self) {
        self.inverse_mass.clear();
        if matches!(self.model.response, Response::Impulse | Response::Penalty(_)) {
            let masses = (0..self.marbles.len()).map(|row| self.marbles.mass(row));
            self.inverse_mass.extend(masses.map(|mass| S::one() / mass));
        }
        let removals = [self.walls.removals(), self.marbles.removals()];
        if self.warm_removals != removals {
            self.forget_contacts();
            self.warm_removals = removals;
        }
        self.held.clear();
        if self.model.rotation == Rotation::Dynamic && self.marbles.has_rotation_locks() {
            self.held
                .extend((0..self.marbles.len()).map(|row| self.marbles.is_rotation_locked(row)));
        }
        self.marbles.rods(self.model.rotation, &mut self.rods);
    }

    /// Forgets what contacts remember from substep to substep.
    fn forget_contacts(&mut self) {
        self.warm.clear();
        self.shear.clear();
        self.events.impulse_cache.clear();
    }

    /// The marbles that the last step stopped because their motion overflowed, each once.
    pub fn stopped(&self) -> impl Iterator<Item = MarbleId> + '_ {
        self.quarantine.stopped.iter().copied()
    }

    /// The collisions of the last step, in the order of time within each substep. Only
    /// [`Response::EventDriven`] goes through them one by one.
    #[must_use]
    pub fn impacts(&self) -> &[Impact<S>] {
        &self.impacts
    }

    /// How far the contacts of the last substep were from agreeing when
    /// [`Response::Impulse`] let them be: by how much a velocity still changed in its last
    /// sweep, at most, in m/s. It ends at the [iterations](Model::iterations), or where
    /// the change is below the rounding of what gravity does in two substeps.
    #[must_use]
    pub fn residual(&self) -> S {
        self.impulse.residual()
    }

    /// Forgets who was [stopped](World::stopped), and the [impacts](World::impacts). A
    /// step begins with this; whoever calls the verbs one by one begins so too.
    pub fn begin_step(&mut self) {
        self.rest_of_step = S::zero();
        self.stopped.clear();
        self.quarantine.stopped.clear();
        self.impacts.clear();
        self.reset_audit();
    }

    /// Begins a substep, after which `rest` seconds of the step are left: walls that were set
    /// elsewhere and have a motion are where that puts them by then. Whoever calls the verbs one by
    /// one in several substeps begins each so; without it, walls are at the end of their ways.
    pub fn begin_substep(&mut self, rest: S) {
        self.rest_of_step = if rest.is_finite() { rest.max(S::zero()) } else { S::zero() };
        if !matches!(self.model.response, Response::EventDriven | Response::SoftStep) {
            self.walls.interpolate_to(self.rest_of_step);
        }
    }

    /// Ends a step: walls are at the end of their ways, and forces that were applied are forgotten.
    pub fn end_step(&mut self) {
        self.walls.finish_step();
        self.marbles.clear_forces();
    }

    /// The grid of the last substep, for drawing it.
    #[must_use]
    pub fn grid(&self) -> &Grid {
        &self.grid
    }
}
