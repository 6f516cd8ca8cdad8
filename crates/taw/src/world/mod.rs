//! World: its state as columns, its step, queries, and the energy audit.

mod bodies;
mod body_contact_info;
mod body_contacts;
mod body_seams;
mod body_shapes;
mod changed_rows;
mod contact_impulses;
mod contact_limit;
mod contact_memory;
mod continuous;
mod crowding;
mod displacement;
mod energy;
mod energy_audit;
mod event_driven;
mod external_forces;
mod first_touch;
mod ignored;
mod impulse;
mod integrate;
mod joints;
mod lasting_contacts;
mod limits;
mod locked_axes;
mod marble;
mod marble_rotation;
mod marble_setters;
mod marble_shapes;
mod marbles;
mod method;
mod model;
mod narrow_phase;
mod one_way;
mod penalty;
mod quarantine;
mod query;
mod query_walls;
mod scratch;
mod sensed_paths;
mod sensors;
mod settings;
mod sleep;
mod sleep_columns;
mod soft_impacts;
mod soft_step;
mod solver_columns;
mod sparse_column;
mod step;
mod swarm;
mod swept_manifold;
mod swept_walls;
#[cfg(test)]
mod tests;
mod wall_changes;
mod wall_layers;
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
pub use quarantine::StopReason;
pub use query::{ColliderId, Queries, QueryHit, QueryTree};
pub use sensors::{SensorEvent, SensorId, Sensors};
#[cfg(test)]
pub(crate) use swept_walls::SweptWalls;
pub use wall_shape::WallShape;
pub use walls::{WallId, Walls};

use crate::Error;
use crate::body::Bodies;
use crate::broad::{Grid, Period};
use crate::contact::Contacts;
use crate::error::{finite, finite_vector, positive};
use crate::joint::Joints;
use crate::math::{Point3, Scalar, Vec3, length};
use crate::motion::{ForceField, Rotation};
use crate::response::Impact;
use crate::swarm::Swarm;
use contact_memory::ContactMemory;
use scratch::WorldScratch;
use settings::Settings;

/// Marbles, walls and balls, and the settings of their simulation.
///
/// A world is plain data: a clone is a snapshot, and stepping two clones gives
/// the same bits. Two worlds are equal when their state and their last contacts
/// are; scratch memory does not count.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct World<S: Scalar> {
    settings: Settings<S>,
    /// Marbles: dynamic bodies.
    pub marbles: Marbles<S>,
    /// Walls: static and kinematic colliders.
    pub walls: Walls<S>,
    /// Particle system of balls, which collide with walls, marbles and each other. (Their contacts
    /// are not listed.)
    pub swarm: Swarm<S>,
    /// Joints between marbles, and between a marble and a place in the world.
    pub joints: Joints<S>,
    /// Rigid bodies.
    pub bodies: Bodies<S>,
    /// Sensors: shapes that tell which marbles and bodies enter and leave.
    pub sensors: Sensors<S>,
    /// Contacts of the last substep, except those of marbles [asleep](Self::is_asleep) with each
    /// other and with walls. Between [`World::generate_contacts`] and [`World::restitute`] they may
    /// be edited: a removed contact is not solved, a changed normal, separation or
    /// [material](crate::contact::Contact::material) is the one that is solved, and a contact of a row that
    /// does not exist is ignored.
    /// ([`Response::EventDriven`](crate::response::Response::EventDriven) and [`Response::SoftStep`](crate::response::Response::SoftStep) detect collisions themselves, whatever
    /// is edited.)
    ///
    /// Of each marble, the contacts with at most 32 marbles of its size or larger are listed, the
    /// deepest or nearest; of a capsule, more in proportion to its length over its width.
    pub contacts: Contacts<S>,
    /// Impacts of the last step, of a response that solves them within it.
    impacts: Vec<Impact<S>>,
    /// Marbles that the last step stopped, sorted by handle, each once.
    quarantined: Vec<(MarbleId, StopReason)>,
    memory: ContactMemory<S>,
    /// On the heap, since it is several kilobytes: a world is moved as a whole.
    scratch: Box<WorldScratch<S>>,
}

impl<S: Scalar> World<S> {
    /// Model: physics and accuracy of its steps.
    #[must_use]
    pub fn model(&self) -> Model {
        self.settings.model
    }

    /// Sets the model for the next step. A model equal to the current one changes nothing; another
    /// one clears the cached impulses of contacts (warm starts).
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for the substeps or the iterations; [`Error::UnsupportedShape`] for
    /// [`Response::EventDriven`](crate::response::Response::EventDriven) and [`Response::SoftStep`](crate::response::Response::SoftStep) if a marble is a capsule;
    /// [`Error::Unsupported`] for [`Response::SoftStep`](crate::response::Response::SoftStep) in a periodic world.
    pub fn set_model(&mut self, model: Model) -> Result<(), Error> {
        let model = model.validated()?;
        if !model.response.knows_capsules()
            && let Some(id) = self.marbles.first_capsule()
        {
            return Err(Error::UnsupportedShape(id));
        }
        if model == self.settings.model {
            return Ok(());
        }
        if model.response.uses_swarm_rows() && !self.marbles.period.is_open() {
            return Err(Error::Unsupported { response: "SoftStep", feature: "a period" });
        }
        self.settings.model = model;
        self.marbles.changed.add_all();
        self.marbles.sleep.wake_all();
        self.forget_contacts();
        self.marbles
            .enable_rotation(model.rotation != Rotation::None || self.marbles.has_capsules());
        self.marbles.set_compensated(model.precision == Precision::Compensated);
        Ok(())
    }

    /// Gravity: acceleration of every marble and ball, in m/s².
    #[must_use]
    pub fn gravity(&self) -> Vec3<S> {
        self.settings.gravity
    }

    /// Sets gravity, in m/s².
    ///
    /// # Errors
    /// [`Error::NotFinite`], also if its length overflows.
    pub fn set_gravity(&mut self, gravity: Vec3<S>) -> Result<(), Error> {
        finite_vector(["gravity.x", "gravity.y", "gravity.z"], gravity)?;
        finite("the length of gravity", length(gravity))?;
        if gravity != self.settings.gravity {
            self.marbles.sleep.wake_all();
        }
        self.settings.gravity = gravity;
        Ok(())
    }

    /// Lengths of the periodic box along the axes, in metres; none along axes that are not periodic.
    #[must_use]
    pub fn period(&self) -> [Option<S>; 3] {
        self.marbles.period.lengths
    }

    /// Makes the world a periodic box around the origin: whatever leaves it through a side enters
    /// it through the opposite one, and balls touch across the sides. Along an axis with none,
    /// which is the default, it has no sides.
    ///
    /// Walls are not repeated: one that crosses a side has to be a half-space along it. Balls of
    /// [`World::swarm`], queries and attraction are not periodic. [`World::energy`] and the energy
    /// audit use positions as they are: a marble that crosses a side along gravity changes them.
    /// Except by [`Response::EventDriven`](crate::response::Response::EventDriven), a marble that moves by more than a quarter of a length in
    /// a substep may pass through others.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a length of less than 8.02 radii of the largest marble;
    /// [`Error::NotPositive`] for one that is no length; [`Error::UnsupportedShape`] if a marble is
    /// a capsule; [`Error::Unsupported`] for [`Response::SoftStep`](crate::response::Response::SoftStep). Steps refuse marbles that were
    /// added later in the same way.
    pub fn set_period(&mut self, lengths: [Option<S>; 3]) -> Result<(), Error> {
        for (length, field) in lengths.iter().zip(["period.x", "period.y", "period.z"]) {
            length.map(|length| positive(field, length)).transpose()?;
        }
        let period = Period { lengths };
        self.check_period(period)?;
        if period != self.marbles.period {
            self.marbles.period = period;
            self.marbles.wrap();
            self.marbles.sleep.wake_all();
            self.forget_contacts();
        }
        Ok(())
    }

    /// Image of a point across the sides of the periodic box that is nearest to another point.
    #[must_use]
    pub fn nearest_image(&self, point: Point3<S>, near: Point3<S>) -> Point3<S> {
        self.marbles.period.image(point, near)
    }

    /// Force fields that act on every marble, and on every ball of the swarm, besides gravity.
    #[must_use]
    pub fn forces(&self) -> &[ForceField<S>] {
        &self.settings.forces
    }

    /// Sets the force fields.
    ///
    /// # Errors
    /// [`Error::NotFinite`] or [`Error::OutOfRange`] for a field of one of them.
    pub fn set_forces(&mut self, forces: Vec<ForceField<S>>) -> Result<(), Error> {
        let forces = forces.into_iter().map(ForceField::validated).collect::<Result<_, _>>()?;
        if forces != self.settings.forces {
            self.marbles.sleep.wake_all();
        }
        self.settings.forces = forces;
        Ok(())
    }

    /// Speed limits of marbles.
    #[must_use]
    pub fn speed_limits(&self) -> SpeedLimits<S> {
        self.settings.limits
    }

    /// Sets the speed limits of marbles, from the end of the next substep on.
    ///
    /// # Errors
    /// [`Error::NotPositive`].
    pub fn set_speed_limits(&mut self, limits: SpeedLimits<S>) -> Result<(), Error> {
        self.settings.limits = limits.validated()?;
        Ok(())
    }

    /// Marbles that the last step stopped, each once: see [`stop_reason`](Self::stop_reason).
    pub fn stopped(&self) -> impl Iterator<Item = MarbleId> + '_ {
        self.quarantined.iter().map(|(id, _)| *id)
    }

    /// Reason for which the last step stopped a marble, if it did.
    #[must_use]
    pub fn stop_reason(&self, id: MarbleId) -> Option<StopReason> {
        let found = self.quarantined.binary_search_by_key(&id, |(id, _)| *id);
        found.ok().map(|at| self.quarantined[at].1)
    }

    /// Impacts of the last step that are in no list of contacts: those of
    /// [`Response::EventDriven`](crate::response::Response::EventDriven), in the order of time within each substep, and of
    /// [`Response::SoftStep`](crate::response::Response::SoftStep) those of marbles: bounces in the order in which they were solved, each with
    /// the speed and the normal of its impulse, and then the impacts of what does not bounce, at most one
    /// for each contact, in the order of [`World::contacts`]. (Without restitution an impact may take two
    /// steps, and is told in both, with the speed that is left.) Other responses list contacts where
    /// surfaces overlap, and no impacts.
    #[must_use]
    pub fn impacts(&self) -> &[Impact<S>] {
        &self.impacts
    }

    /// Residual of [`Response::Impulse`](crate::response::Response::Impulse) in the last substep: maximum change of a velocity in the
    /// last iteration, in m/s. Iterations end at [`Model::iterations`], or when the residual is
    /// below the rounding error of the speed that gravity adds in two substeps.
    #[must_use]
    pub fn residual(&self) -> S {
        self.scratch.impulse.residual()
    }

    /// Broad-phase grid of the last substep, for drawing it.
    #[must_use]
    pub fn grid(&self) -> &Grid {
        &self.scratch.grid
    }
}
