//! Sensors: shapes that marbles pass through, and that report which of them enter and leave.

use cgmath::{One, Zero};

use super::{MarbleId, Marbles, WallShape, World};
use crate::Error;
use crate::broad::CollisionLayers;
use crate::frame::Pose;
use crate::handle::Handles;
pub use crate::handle::SensorId;
use crate::math::{Point3, Quat, Scalar, Vec3};
use crate::motion::WallMotion;
use crate::shape::{Aabb3, Shape, Sphere};
use crate::swarm::BallId;

/// Marble that entered or left a sensor in a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SensorEvent<S> {
    /// The sensor.
    pub sensor: SensorId,
    /// The marble; one that left may have been removed.
    pub marble: MarbleId,
    /// True if it entered, false if it left.
    pub entered: bool,
    /// Time from then to the end of the step, in seconds.
    pub time_left: S,
}

/// Sensors of a world. Marbles do not feel them.
///
/// A marble is inside of a sensor if their shapes overlap; of a mesh, that is its surface. One that
/// passes through within a substep enters and leaves in it, at any speed: its path is taken to be
/// straight within a substep (of [`SoftStep`](crate::response::Response::SoftStep), within a step),
/// relative to a sensor that moves. Balls of the swarm are looked for at the end of each step only.
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
    /// Positions of the marbles at the beginning of the substep, by index, and their number of
    /// removals then.
    start: Vec<Point3<S>>,
    removals: u64,
}

#[derive(Clone, Debug, PartialEq)]
struct Sensor<S> {
    shape: WallShape<S>,
    motion: Option<WallMotion<S>>,
    layers: CollisionLayers,
    /// Marbles inside, sorted.
    inside: Vec<MarbleId>,
    /// Balls of the swarm inside, sorted.
    balls: Vec<BallId>,
}

impl<S: Scalar> Sensors<S> {
    /// Adds a sensor: any shape that a wall may have.
    ///
    /// # Errors
    /// As [`Walls::insert`](super::Walls::insert).
    pub fn insert(&mut self, shape: impl Into<WallShape<S>>) -> Result<SensorId, Error> {
        let shape = shape.into().validated()?;
        let id = SensorId(self.handles.push()?);
        let layers = CollisionLayers::ALL;
        self.rows.push(Sensor {
            shape,
            motion: None,
            layers,
            inside: Vec::new(),
            balls: Vec::new(),
        });
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
        self.rows[row].shape = shape.into().validated()?;
        Ok(())
    }

    /// Sets the motion by which a sensor gets where it is at the end of a step, or with `None` puts
    /// it at rest. The caller moves it accordingly.
    ///
    /// # Errors
    /// [`Error::NoSuchSensor`]; [`Error::NotFinite`] for a field of the motion.
    pub fn set_motion(&mut self, id: SensorId, motion: Option<WallMotion<S>>) -> Result<(), Error> {
        let row = self.row(id)?;
        self.rows[row].motion = motion.map(WallMotion::validated).transpose()?;
        Ok(())
    }

    /// Sets the layers of a sensor: it senses marbles whose layers interact with these.
    ///
    /// # Errors
    /// [`Error::NoSuchSensor`].
    pub fn set_layers(&mut self, id: SensorId, layers: CollisionLayers) -> Result<(), Error> {
        let row = self.row(id)?;
        self.rows[row].layers = layers;
        Ok(())
    }

    /// Marbles inside of a sensor at the end of the last step, sorted.
    ///
    /// # Errors
    /// [`Error::NoSuchSensor`].
    pub fn inside(&self, id: SensorId) -> Result<&[MarbleId], Error> {
        self.row(id).map(|row| self.rows[row].inside.as_slice())
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
        self.row(id).map(|row| &self.rows[row].shape)
    }

    /// Marbles that entered and left in the last step, in the order of substeps, sensors and marbles. One
    /// that passed through within a substep enters first.
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

    /// Stores the positions of marbles at the beginning of a substep.
    pub(super) fn begin_substep(&mut self, marbles: &Marbles<S>) {
        self.start.clear();
        if !self.rows.is_empty() {
            self.start.extend_from_slice(marbles.position());
            self.removals = marbles.removals();
        }
    }
}

impl<S: Scalar> World<S> {
    /// Updates sensors after a substep of `dt` seconds.
    pub(super) fn update_sensors(&mut self, dt: S) {
        let rest = self.scratch.rest_of_step;
        let Sensors { handles, rows, events, start, removals } = &mut self.sensors;
        if *removals != self.marbles.removals() {
            start.clear(); // indices have other marbles now
        }
        for (row, sensor) in rows.iter_mut().enumerate() {
            let Some(id) = handles.handle(row).map(SensorId) else { continue };
            let first = events.len();
            let mut push_event = |marble: MarbleId, entered: bool, fraction: S| {
                let time_left = rest + dt * (S::one() - fraction).max(S::zero());
                events.push(SensorEvent { sensor: id, marble, entered, time_left });
            };
            let before = std::mem::take(&mut sensor.inside);
            for (marble, path) in paths(&self.marbles, start, sensor, [rest, dt]) {
                let was_inside = before.binary_search(&marble).is_ok();
                let is_inside = sensor.shape.overlaps(&path.end);
                let enters = || sensor.shape.cast_shape(&path.start(), path.displacement);
                let leaves = || {
                    let back = sensor.shape.cast_shape(&path.end, -path.displacement);
                    back.map(|back| S::one() - back)
                };
                match (was_inside, is_inside) {
                    (true, true) => {}
                    // Who was put inside is there from the beginning.
                    (false, true) => push_event(marble, true, enters().unwrap_or(S::zero())),
                    (true, false) => push_event(marble, false, leaves().unwrap_or(S::zero())),
                    // Who only reaches the surface does not leave it again.
                    (false, false) => {
                        if let Some(entry) = enters()
                            && let Some(exit) = leaves().filter(|exit| *exit > entry)
                        {
                            push_event(marble, true, entry);
                            push_event(marble, false, exit);
                        }
                    }
                }
                if is_inside {
                    sensor.inside.push(marble);
                }
            }
            sensor.inside.sort_unstable();
            for marble in before.into_iter().filter(|it| sensor.inside.binary_search(it).is_err()) {
                if !events[first..].iter().any(|event| event.marble == marble) {
                    let time_left = rest + dt; // it was put elsewhere, or is gone
                    events.push(SensorEvent { sensor: id, marble, entered: false, time_left });
                }
            }
        }
        start.clear();
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
            let reach = sensor.shape.bounding_box();
            let is_near = |bounds: &Aabb3<S>| reach.is_none_or(|reach| reach.overlaps(bounds));
            let near =
                (0..).zip(&blocks).filter(|(_, bounds)| bounds.as_ref().is_some_and(is_near));
            let rows = near.flat_map(|(block, _)| BLOCK * block..BLOCK * (block + 1));
            for (row, at) in rows.filter_map(|row| Some((row, *swarm.balls().get(row)?))) {
                let ball = ball(at);
                if is_near(&ball.bounds())
                    && swarm
                        .layers_of_own_row(row)
                        .is_some_and(|it| it.interacts_with(sensor.layers))
                    && sensor.shape.overlaps(&Shape::Sphere(ball))
                {
                    sensor.balls.extend(swarm.id(row));
                }
            }
            sensor.balls.sort_unstable();
        }
    }
}

/// Path of a marble in a substep, in the frame of a sensor: that of the world at the end of the step.
struct SensedPath<S> {
    /// The marble at its end.
    end: Shape<S>,
    /// In metres.
    displacement: Vec3<S>,
}

impl<S: Scalar> SensedPath<S> {
    /// The marble at its beginning.
    fn start(&self) -> Shape<S> {
        self.end.transformed(Pose { rotation: Quat::one(), translation: -self.displacement })
    }
}

/// Marbles whose paths may touch a sensor, in a substep of `dt` seconds, `rest` seconds before the end
/// of the step.
fn paths<'a, S: Scalar>(
    marbles: &'a Marbles<S>,
    start: &'a [Point3<S>],
    sensor: &Sensor<S>,
    [rest, dt]: [S; 2],
) -> impl Iterator<Item = (MarbleId, SensedPath<S>)> + use<'a, S> {
    let (bounds, layers) = (sensor.shape.bounding_box(), sensor.layers);
    let frame = |time: S| sensor.motion.map(|motion| motion.pose_before(time).inverse());
    let [at_start, at_end] = [frame(rest + dt), frame(rest)];
    (0..marbles.len()).filter_map(move |row| {
        if !marbles.layers_of_row(row).interacts_with(layers) {
            return None;
        }
        let to = marbles.position()[row];
        let moved = start.get(row).map_or_else(Vec3::zero, |from| to - from);
        let from = to - marbles.period.minimum_image(moved);
        let place = |frame: Option<Pose<S>>, point: Point3<S>| {
            frame.map_or(point, |frame| frame.transform_point(point))
        };
        let (from, to) = (place(at_start, from), place(at_end, to));
        let reach = marbles.radius()[row] + marbles.half_length(row);
        if bounds.is_some_and(|bounds| !swept_sphere_overlaps([from, to], reach, &bounds)) {
            return None;
        }
        let shape = marbles.shape_of_row(row);
        let end = at_end.map_or_else(|| shape.clone(), |frame| shape.transformed(frame));
        Some((marbles.id(row)?, SensedPath { end, displacement: to - from }))
    })
}

/// Tests if the box around the path of a sphere overlaps another one.
fn swept_sphere_overlaps<S: Scalar>(
    [from, to]: [Point3<S>; 2],
    radius: S,
    bounds: &Aabb3<S>,
) -> bool {
    (0..3).all(|axis| {
        from[axis].min(to[axis]) - radius <= bounds.max[axis]
            && from[axis].max(to[axis]) + radius >= bounds.min[axis]
    })
}
