use std::f64::consts::TAU;
use std::sync::Arc;

use cgmath::{EuclideanSpace, InnerSpace, Zero};

use super::structure::cast_pose;
use super::{
    ForceFieldDesc, KinematicMotion, MarbleDesc, MaterialDesc, RotationDesc, Scene, SensorPlane,
    ShapeDesc, Structure, WallDesc,
};
use crate::Error;
use crate::error::finite_vector;
use crate::frame::{AxisAngle, Pose};
use crate::math::{Point3, Quat, Scalar, Vec3, cast_vector, normalize_and_length};
use crate::motion::{ForceField, Mass, Medium, WallMotion};
use crate::response::{Elasticity, Material};
use crate::shape::{Capsule, Obb, Plane, Sphere};
use crate::world::{Marble, Model, WallId, WallShape, World};

/// Running simulation of a [`Scene`]: its world and kinematic motions.
#[derive(Clone, Debug)]
pub struct Simulation<S: Scalar> {
    /// The world, with marbles in the order of the scene.
    pub world: World<S>,
    scene: Scene,
    moving: Vec<(WallId, InitialShape, KinematicMotion)>,
    time: f64,
}

/// Initial shape of a kinematic wall.
#[derive(Clone, Debug)]
enum InitialShape {
    ShapeDesc(ShapeDesc),
    /// Index of a structure.
    Structure(usize),
}

impl Scene {
    /// Builds the initial state, to be stepped by a model.
    ///
    /// # Errors
    /// Errors of the world: [`Error::NotFinite`], [`Error::NotPositive`], [`Error::OutOfRange`],
    /// [`Error::NotUnit`], [`Error::UnsupportedShape`]. Also numbers beyond those of `f32` in any
    /// world, and more than [`MAX_MARBLES`](Self::MAX_MARBLES).
    pub fn run<S: Scalar>(&self, model: Model) -> Result<Simulation<S>, Error> {
        self.check()?;
        let mut world = World::default();
        world.set_model(model)?;
        world.set_gravity(vector(self.gravity_at(0.0)))?;
        world.set_forces(self.force_fields.iter().map(|field| field.force()).collect())?;
        let mut moving = Vec::new();
        let mut insert = |wall: WallShape<S>,
                          material: &Option<MaterialDesc>,
                          motion: &Option<KinematicMotion>,
                          shape| {
            let id = world.walls.insert(wall)?;
            let material = material.unwrap_or(self.material);
            world.walls.set_material(id, Some(material.to_material()))?;
            if let Some(movement) = motion {
                let motion = movement.at(0.0, 0.0)?.1;
                world.walls.set_motion(id, Some(motion))?;
                moving.push((id, shape, *movement));
            }
            Ok::<_, Error>(())
        };
        for WallDesc { shape, material, motion } in &self.walls {
            insert(
                shape.wall(Pose::identity())?,
                material,
                motion,
                InitialShape::ShapeDesc(*shape),
            )?;
        }
        for (number, Structure { shape, material, motion }) in self.structures.iter().enumerate() {
            let wall = shape.wall(Pose::identity())?;
            insert(wall, material, motion, InitialShape::Structure(number))?;
        }
        for ball in self.all_marbles() {
            world.marbles.insert(ball.marble(self.material)?)?;
        }
        world.check_shapes()?;
        Ok(Simulation { world, scene: self.clone(), moving, time: 0.0 })
    }

    /// Interpolated gravity at a time, in m/s².
    #[must_use]
    pub fn gravity_at(&self, time: f64) -> [f64; 3] {
        let (Some(first), Some(last)) =
            (self.gravity_keyframes.first(), self.gravity_keyframes.last())
        else {
            return self.gravity;
        };
        if time <= first.time {
            return first.gravity;
        }
        for pair in self.gravity_keyframes.windows(2) {
            if let [before, after] = pair
                && time < after.time
            {
                let part = (time - before.time) / (after.time - before.time);
                let axis =
                    |i: usize| before.gravity[i] + (after.gravity[i] - before.gravity[i]) * part;
                return [axis(0), axis(1), axis(2)];
            }
        }
        last.gravity
    }

    /// All marbles: single ones first.
    pub fn all_marbles(&self) -> impl Iterator<Item = MarbleDesc> + '_ {
        let lattices = self.lattices.iter().flat_map(super::Lattice::marbles);
        self.marbles.iter().copied().chain(lattices)
    }
}

impl<S: Scalar> From<World<S>> for Simulation<S> {
    /// Wraps an existing world without kinematic motions.
    fn from(world: World<S>) -> Self {
        Self { world, scene: Scene::default(), moving: Vec::new(), time: 0.0 }
    }
}

impl<S: Scalar> Simulation<S> {
    /// Steps by `dt` seconds: gravity of the midpoint, walls at their poses of the end.
    ///
    /// # Errors
    /// As [`World::step`]; then nothing has changed.
    pub fn step(&mut self, dt: S) -> Result<(), Error> {
        self.world.validated_substep(dt)?;
        self.move_walls(dt)?;
        self.world.step(dt)
    }

    /// First part of a [step](Self::step): updates gravity and walls, for callers who step the
    /// [world](Self::world) themselves.
    ///
    /// # Errors
    /// [`Error::NotPositive`] for `dt`, [`Error::OutOfRange`] if it is not in [`World::TIMES`],
    /// [`Error::NoSuchWall`] if a kinematic wall was removed; then nothing has changed.
    pub fn move_walls(&mut self, dt: S) -> Result<(), Error> {
        let duration = World::validated_dt(dt)?.as_f64();
        self.moving.iter().try_for_each(|(id, ..)| self.world.walls.row(*id).map(|_| ()))?;
        if !self.scene.gravity_keyframes.is_empty() {
            let gravity = self.scene.gravity_at(self.time + 0.5 * duration);
            self.world.set_gravity(vector(gravity))?;
        }
        for (id, shape, movement) in &self.moving {
            let (pose, motion) = movement.at(self.time, self.time + duration)?;
            let wall = match (self.world.walls.get(*id)?, shape) {
                // Copies share the built geometry.
                (WallShape::Mesh(mesh, _), _) => WallShape::Mesh(Arc::clone(mesh), cast_pose(pose)),
                (WallShape::HeightField(field, _), _) => {
                    WallShape::HeightField(Arc::clone(field), cast_pose(pose))
                }
                (_, InitialShape::ShapeDesc(form)) => form.wall(pose)?,
                (_, InitialShape::Structure(number)) => {
                    self.scene.structures[*number].shape.wall(pose)?
                }
            };
            self.world.walls.set(*id, wall)?;
            self.world.walls.set_motion(*id, Some(motion))?;
        }
        self.time += duration;
        Ok(())
    }

    /// Simulated time, in seconds.
    #[must_use]
    pub fn time(&self) -> f64 {
        self.time
    }

    /// Number of marbles behind a sensor plane; those behind several count several times.
    #[must_use]
    pub fn sensor_count(&self) -> usize {
        let behind = |gate: &SensorPlane| {
            let (normal, point) = (Vec3::from(gate.normal), Vec3::from(gate.point));
            let at = self.world.marbles.position().iter().map(|at| cast_vector(at.to_vec()));
            at.filter(|at: &Vec3<f64>| normal.dot(at - point) < 0.0).count()
        };
        self.scene.sensor_planes.iter().map(behind).sum()
    }

    /// The initial scene.
    #[must_use]
    pub fn scene(&self) -> &Scene {
        &self.scene
    }
}

impl ForceFieldDesc {
    fn force<S: Scalar>(self) -> ForceField<S> {
        match self {
            Self::Drag { velocity, linear, quadratic } => ForceField::Drag(Medium {
                velocity: vector(velocity),
                linear: S::from_f64(linear),
                quadratic: S::from_f64(quadratic),
            }),
            Self::Spring { anchor, rest_length, stiffness } => ForceField::Spring {
                anchor: point(anchor),
                rest_length: S::from_f64(rest_length),
                stiffness: S::from_f64(stiffness),
            },
            Self::Attraction { center, strength } => {
                ForceField::Attraction { center: point(center), strength: S::from_f64(strength) }
            }
        }
    }
}

impl MaterialDesc {
    /// Converts to a material.
    #[must_use]
    pub fn to_material<S: Scalar>(self) -> Material<S> {
        Material {
            restitution: S::from_f64(self.restitution),
            friction: S::from_f64(self.friction),
            tangential_restitution: S::from_f64(self.tangential_restitution),
            rolling_resistance: S::from_f64(self.rolling_resistance),
            spinning_resistance: S::from_f64(self.spinning_resistance),
            elasticity: Elasticity {
                youngs_modulus: S::from_f64(self.youngs_modulus),
                poissons_ratio: S::from_f64(self.poissons_ratio),
            },
            ..Material::default()
        }
    }
}

impl MarbleDesc {
    fn marble<S: Scalar>(self, material: MaterialDesc) -> Result<Marble<S>, Error> {
        let rotation = self.rotation.quaternion()?;
        Ok(Marble {
            velocity: vector(self.velocity),
            rotation: Quat::from_sv(S::from_f64(rotation.s), cast_vector(rotation.v)),
            angular_velocity: vector(self.angular_velocity),
            half_length: S::from_f64(self.half_length),
            mass: Mass::Density(S::from_f64(self.density)),
            material: Some(self.material.unwrap_or(material).to_material()),
            ..Marble::new(point(self.position), S::from_f64(self.radius))
        })
    }
}

impl ShapeDesc {
    /// The wall shape, transformed by a pose.
    pub(super) fn wall<S: Scalar>(self, pose: Pose<f64>) -> Result<WallShape<S>, Error> {
        let place = |at: [f64; 3]| point(pose.transform_point(Point3::from(at)).into());
        Ok(match self {
            Self::HalfSpace { normal, point } => {
                Plane::through(place(point), vector(pose.transform_vector(normal.into()).into()))?
                    .into()
            }
            Self::Box { center, size, rotation } => {
                let turn = pose.rotation * rotation.quaternion()?;
                let rotation = Quat::from_sv(S::from_f64(turn.s), cast_vector(turn.v));
                Obb::new(place(center), rotation, vector(size.map(|side| 0.5 * side)))?.into()
            }
            Self::Ball { center, radius } => {
                Sphere::new(place(center), S::from_f64(radius))?.into()
            }
            Self::Capsule { from, to, radius } => {
                Capsule::new(place(from), place(to), S::from_f64(radius))?.into()
            }
        })
    }
}

impl RotationDesc {
    fn quaternion(self) -> Result<Quat<f64>, Error> {
        axis_angle(self.axis, self.degrees.to_radians())
    }
}

fn axis_angle(axis: [f64; 3], radians: f64) -> Result<Quat<f64>, Error> {
    Ok(AxisAngle::new(Vec3::from(axis), radians)?.into())
}

impl KinematicMotion {
    /// Pose of a wall after a time in seconds, relative to its initial one.
    ///
    /// # Errors
    /// [`Error::NotFinite`] for the axis, [`Error::NotUnit`] for one without a length.
    pub fn pose(self, time: f64) -> Result<Pose<f64>, Error> {
        Ok(self.at::<f64>(time, time)?.0)
    }

    /// Pose of a wall at the time `to`, relative to its initial one, and its mean motion since the
    /// time `from`.
    fn at<S: Scalar>(self, from: f64, to: f64) -> Result<(Pose<f64>, WallMotion<S>), Error> {
        let middle = 0.5 * (from + to);
        let (translation, velocity, pivot, axis, angle, rate) = match self {
            Self::Conveyor { velocity } => {
                let motion = WallMotion {
                    velocity: vector(velocity),
                    angular_velocity: Vec3::zero(),
                    pivot: Point3::origin(),
                };
                return Ok((Pose::identity(), motion));
            }
            Self::Rotate { pivot, axis, degrees_per_second } => {
                let rate = degrees_per_second.to_radians();
                (Vec3::zero(), Vec3::zero(), pivot, axis, rate * to, rate)
            }
            Self::Oscillate { amplitude, pivot, axis, degrees, period } => {
                let (part, _) = (TAU * (to / period)).sin_cos_portable();
                let (_, rate) = (TAU * (middle / period)).sin_cos_portable();
                // sin a − sin b = 2 cos((a + b) / 2) sin((a − b) / 2): the mean rate, also over
                // many periods.
                let half = 0.5 * TAU * ((to - from) / period);
                let mean = if half == 0.0 { 1.0 } else { half.sin_cos_portable().0 / half };
                let (amplitude, rate) = (Vec3::from(amplitude), rate * mean * TAU / period);
                let angle = degrees.to_radians();
                (amplitude * part, amplitude * rate, pivot, axis, angle * part, angle * rate)
            }
        };
        let pivot = Point3::from(pivot);
        let (direction, _) =
            normalize_and_length(finite_vector(["axis.x", "axis.y", "axis.z"], Vec3::from(axis))?)
                .ok_or(Error::NotUnit { field: "axis", value: 0.0 })?;
        let rotation = axis_angle(axis, angle)?;
        // Rotation about the pivot, then translation.
        let turned_pivot = Pose { rotation, translation: Vec3::zero() }.transform_point(pivot);
        let pose = Pose { rotation, translation: pivot - turned_pivot + translation };
        let motion = WallMotion {
            velocity: cast_vector(velocity),
            angular_velocity: cast_vector(direction * rate),
            pivot: point((pivot + translation).into()),
        };
        Ok((pose, motion))
    }
}

fn vector<S: Scalar>(v: [f64; 3]) -> Vec3<S> {
    cast_vector(Vec3::from(v))
}

fn point<S: Scalar>(p: [f64; 3]) -> Point3<S> {
    Point3::from_vec(vector(p))
}
