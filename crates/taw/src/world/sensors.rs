//! Sensors: shapes that marbles and bodies pass through, and that report which of them enter and leave.

use super::sensed_paths::{StartCenters, sense};
use super::{ColliderId, MarbleId, Marbles, WallShape, World};
use crate::Error;
use crate::body::{Bodies, BodyId};
use crate::broad::CollisionLayers;
use crate::handle::Handles;
pub use crate::handle::SensorId;
use crate::math::{Point3, Scalar};
use crate::motion::WallMotion;
use crate::shape::{Aabb3, Shape, Sphere};
use crate::swarm::BallId;

/// Marble or body that entered or left a sensor in a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SensorEvent<S> {
    /// The sensor.
    pub sensor: SensorId,
    /// The marble or body; one that left may have been removed.
    pub collider: ColliderId,
    /// True if it entered, false if it left.
    pub entered: bool,
    /// Time from then to the end of the step, in seconds.
    pub time_left: S,
}

/// Sensors of a world. Marbles and bodies do not feel them.
///
/// A marble or body is inside of a sensor if their shapes overlap; of a mesh, that is its surface. One that
/// passes through within a substep enters and leaves in it, at any speed: its path is taken to be
/// straight within a substep (of [`SoftStep`](crate::response::Response::SoftStep), within a step), in its
/// orientation at the end, and relative to a sensor that moves. Sleepers and kinematic bodies count. Balls of the
/// swarm are looked for at the end of each step only.
///
/// ```
/// use taw::prelude::*;
///
/// # fn main() -> Result<(), taw::Error> {
/// let mut world = World::<f32>::default();
/// let gate = world.sensors.insert(Sphere::new(Point3::new(0.0, 0.0, 0.0), 1.0)?)?;
/// let ball = world.marbles.insert(Marble::new(Point3::new(0.0, 1.3, 0.0), 0.2))?;
/// while world.sensors.events().is_empty() {
///     world.step(1.0 / 60.0)?;
/// }
/// assert_eq!(world.sensors.inside(gate)?, [ball]);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sensors<S> {
    handles: Handles,
    rows: Vec<Sensor<S>>,
    events: Vec<SensorEvent<S>>,
    /// Where marbles and bodies were at the beginning of the substep.
    marble_start: StartCenters<S>,
    body_start: StartCenters<S>,
}

#[derive(Clone, Debug, PartialEq)]
struct Sensor<S> {
    space: SensorSpace<S>,
    /// Marbles inside, sorted.
    marbles: Vec<MarbleId>,
    /// Bodies inside, sorted.
    bodies: Vec<BodyId>,
    /// Balls of the swarm inside, sorted.
    balls: Vec<BallId>,
}

/// Where a sensor is, and whom it senses.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct SensorSpace<S> {
    pub shape: WallShape<S>,
    pub motion: Option<WallMotion<S>>,
    pub layers: CollisionLayers,
}

impl<S: Scalar> Sensors<S> {
    /// Adds a sensor: any shape that a wall may have.
    ///
    /// # Errors
    /// As [`Walls::insert`](super::Walls::insert).
    pub fn insert(&mut self, shape: impl Into<WallShape<S>>) -> Result<SensorId, Error> {
        let shape = shape.into().validated()?;
        let id = SensorId(self.handles.push()?);
        let space = SensorSpace { shape, motion: None, layers: CollisionLayers::ALL };
        let (marbles, bodies, balls) = (Vec::new(), Vec::new(), Vec::new());
        self.rows.push(Sensor { space, marbles, bodies, balls });
        Ok(id)
    }

    /// Removes a sensor, and its events. Whoever is inside leaves without one.
    ///
    /// # Errors
    /// [`Error::NoSuchSensor`].
    pub fn remove(&mut self, id: SensorId) -> Result<(), Error> {
        let row = self.handles.swap_remove(id.0).ok_or(Error::NoSuchSensor(id))?;
        self.rows.swap_remove(row);
        self.events.retain(|event| event.sensor != id);
        Ok(())
    }

    /// Sets the shape and pose of a sensor.
    ///
    /// # Errors
    /// [`Error::NoSuchSensor`], and as [`Sensors::insert`]; then nothing has changed.
    pub fn set(&mut self, id: SensorId, shape: impl Into<WallShape<S>>) -> Result<(), Error> {
        let row = self.row(id)?;
        self.rows[row].space.shape = shape.into().validated()?;
        Ok(())
    }

    /// Sets the motion by which a sensor gets where it is at the end of a step, or with `None` puts
    /// it at rest. The caller moves it accordingly.
    ///
    /// # Errors
    /// [`Error::NoSuchSensor`]; [`Error::NotFinite`] for a field of the motion.
    pub fn set_motion(&mut self, id: SensorId, motion: Option<WallMotion<S>>) -> Result<(), Error> {
        let row = self.row(id)?;
        self.rows[row].space.motion = motion.map(WallMotion::validated).transpose()?;
        Ok(())
    }

    /// Sets the layers of a sensor: it senses marbles and bodies whose layers interact with these.
    ///
    /// # Errors
    /// [`Error::NoSuchSensor`].
    pub fn set_layers(&mut self, id: SensorId, layers: CollisionLayers) -> Result<(), Error> {
        let row = self.row(id)?;
        self.rows[row].space.layers = layers;
        Ok(())
    }

    /// Marbles inside of a sensor at the end of the last step, sorted.
    ///
    /// # Errors
    /// [`Error::NoSuchSensor`].
    pub fn inside(&self, id: SensorId) -> Result<&[MarbleId], Error> {
        self.row(id).map(|row| self.rows[row].marbles.as_slice())
    }

    /// Bodies inside of a sensor at the end of the last step, sorted.
    ///
    /// # Errors
    /// [`Error::NoSuchSensor`].
    pub fn bodies_inside(&self, id: SensorId) -> Result<&[BodyId], Error> {
        self.row(id).map(|row| self.rows[row].bodies.as_slice())
    }

    /// Balls of the swarm inside of a sensor at the end of the last step, sorted. One that passes through
    /// within a step is not noticed.
    ///
    /// # Errors
    /// [`Error::NoSuchSensor`].
    pub fn balls_inside(&self, id: SensorId) -> Result<&[BallId], Error> {
        self.row(id).map(|row| self.rows[row].balls.as_slice())
    }

    /// Shape of a sensor.
    ///
    /// # Errors
    /// [`Error::NoSuchSensor`].
    pub fn shape(&self, id: SensorId) -> Result<&WallShape<S>, Error> {
        self.row(id).map(|row| &self.rows[row].space.shape)
    }

    /// Marbles and bodies that entered and left in the last step, in the order of substeps and sensors, marbles
    /// before bodies. One that passed through within a substep enters first.
    #[must_use]
    pub fn events(&self) -> &[SensorEvent<S>] {
        &self.events
    }

    /// Number of sensors.
    #[must_use]
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// Returns true if there is no sensor.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    fn row(&self, id: SensorId) -> Result<usize, Error> {
        self.handles.row(id.0).ok_or(Error::NoSuchSensor(id))
    }

    /// Clears the events of the last step.
    pub(super) fn begin_step(&mut self) {
        self.events.clear();
    }

    /// Stores where marbles and bodies are at the beginning of a substep.
    pub(super) fn begin_substep(&mut self, marbles: &Marbles<S>, bodies: &Bodies<S>) {
        self.marble_start.clear();
        self.body_start.clear();
        if !self.rows.is_empty() {
            self.marble_start.store(marbles);
            self.body_start.store(bodies);
        }
    }
}

impl<S: Scalar> World<S> {
    /// Updates sensors after a substep of `dt` seconds.
    pub(super) fn update_sensors(&mut self, dt: S) {
        let rest = self.scratch.rest_of_step;
        let Sensors { handles, rows, events, marble_start, body_start } = &mut self.sensors;
        marble_start.clear_stale(&self.marbles);
        body_start.clear_stale(&self.bodies);
        for (row, sensor) in rows.iter_mut().enumerate() {
            let Some(id) = handles.handle(row).map(SensorId) else { continue };
            let Sensor { space, marbles, bodies, .. } = sensor;
            let mut tell = |collider: ColliderId, entered: bool, fraction: S| {
                let time_left = rest + dt * (S::one() - fraction).max(S::zero());
                events.push(SensorEvent { sensor: id, collider, entered, time_left });
            };
            sense(space, (&self.marbles, marble_start), marbles, [rest, dt], &mut tell);
            sense(space, (&self.bodies, body_start), bodies, [rest, dt], &mut tell);
        }
        marble_start.clear();
        body_start.clear();
    }
}

/// Number of balls that a sensor passes over at once if it is far from all of them: neighbours in memory
/// are mostly neighbours in space.
const BLOCK: usize = 256;

impl<S: Scalar> World<S> {
    /// Finds which balls of the swarm are inside of sensors.
    pub(super) fn sense_balls(&mut self) {
        let swarm = &self.swarm;
        if self.sensors.is_empty() {
            return;
        }
        let ball = |[x, y, z, radius]: [S; 4]| Sphere { center: Point3::new(x, y, z), radius };
        let has_own = swarm.len() > swarm.body_balls.len();
        let blocks = swarm.balls().chunks(BLOCK).filter(|_| has_own);
        let bounds = |block: &[[S; 4]]| {
            let all = block.iter().map(|row| ball(*row).bounds());
            all.reduce(|all, one| all.union(&one))
        };
        let blocks: Vec<_> = blocks.map(bounds).collect();
        for sensor in &mut self.sensors.rows {
            sensor.balls.clear();
            let reach = sensor.space.shape.bounding_box();
            let is_near = |bounds: &Aabb3<S>| reach.is_none_or(|reach| reach.overlaps(bounds));
            let near =
                (0..).zip(&blocks).filter(|(_, bounds)| bounds.as_ref().is_some_and(is_near));
            let rows = near.flat_map(|(block, _)| BLOCK * block..BLOCK * (block + 1));
            for (row, at) in rows.filter_map(|row| Some((row, *swarm.balls().get(row)?))) {
                let ball = ball(at);
                if is_near(&ball.bounds())
                    && swarm
                        .layers_of_own_row(row)
                        .is_some_and(|it| it.interacts_with(sensor.space.layers))
                    && sensor.space.shape.overlaps(&Shape::Sphere(ball))
                {
                    sensor.balls.extend(swarm.id(row));
                }
            }
            sensor.balls.sort_unstable();
        }
    }
}
