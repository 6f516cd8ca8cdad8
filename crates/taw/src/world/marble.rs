//! Description of a single marble.

use cgmath::{InnerSpace, One, Zero};

use crate::Error;
use crate::broad::CollisionLayers;
use crate::error::within;
use crate::math::{Point3, Quat, Scalar, Vec3};
use crate::motion::{Integrator, LockedAxes, Mass, Rotation};
use crate::response::Material;

/// Description of a marble (a rigid sphere or capsule) as a value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Marble<S> {
    /// Center, in metres.
    pub position: Point3<S>,
    /// Radius in metres, above zero.
    pub radius: S,
    /// Half length of a capsule's segment along its own y axis, in metres; zero for a ball.
    pub half_length: S,
    /// Velocity, in m/s.
    pub velocity: Vec3<S>,
    /// Mass.
    pub mass: Mass<S>,
    /// Gravity scale: 0 floats, −1 rises.
    pub gravity_scale: S,
    /// Damping of velocity and angular velocity.
    pub damping: Damping<S>,
    /// Rotation. Stored only by a model with rotation.
    pub rotation: Quat<S>,
    /// Angular velocity in rad/s, an axial vector in world space. Stored only by a model with
    /// rotation.
    pub angular_velocity: Vec3<S>,
    /// Axes that it neither moves along nor turns about.
    pub locked_axes: LockedAxes,
    /// Own integrator instead of the model's.
    pub integrator: Option<Integrator>,
    /// Own rotation model, limited by the world's: a marble may roll visually, or not rotate at
    /// all, among others with angular momentum.
    pub rotation_model: Option<Rotation>,
    /// Own material instead of the default one.
    pub material: Option<Material<S>>,
    /// Layers: which walls and balls it collides with.
    pub layers: CollisionLayers,
    /// Keeps it, and those that it touches, awake ([`World::is_asleep`](super::World::is_asleep)).
    pub sleeping_disabled: bool,
}

impl<S: Scalar> Marble<S> {
    /// Creates a marble of glass, at rest.
    #[must_use]
    pub fn new(position: Point3<S>, radius: S) -> Self {
        Self {
            position,
            radius,
            half_length: S::zero(),
            velocity: Vec3::zero(),
            rotation: Quat::one(),
            angular_velocity: Vec3::zero(),
            mass: Mass::default(),
            gravity_scale: S::one(),
            damping: Damping::default(),
            locked_axes: LockedAxes::NONE,
            integrator: None,
            rotation_model: None,
            material: None,
            layers: CollisionLayers::ALL,
            sleeping_disabled: false,
        }
    }
}

/// Exponential damping: removes the fraction `1 − e^−rate` of the velocity per second. A
/// convenience for games; for the drag of a medium see
/// [`ForceField::Drag`](crate::motion::ForceField).
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Damping<S> {
    /// Rate for the velocity in 1/s, at least zero.
    pub linear: S,
    /// Rate for the angular velocity in 1/s, at least zero. Used with dynamic rotation only.
    pub angular: S,
}

impl<S: Scalar> Damping<S> {
    pub(super) fn cast<T: Scalar>(self) -> Damping<T> {
        let number = |x: S| T::from_f64(x.as_f64());
        Damping { linear: number(self.linear), angular: number(self.angular) }
    }

    pub(super) fn validated(self) -> Result<Self, Error> {
        within("damping.linear", self.linear, S::zero(), S::max_value())?;
        within("damping.angular", self.angular, S::zero(), S::max_value())?;
        Ok(self)
    }
}

/// Validates a half length; none for a ball.
pub(super) fn validated_half_length<S: Scalar>(half_length: S) -> Result<Option<S>, Error> {
    let half_length = within("half_length", half_length, S::zero(), S::max_value())?;
    Ok(non_default(half_length, S::zero()))
}

/// Validates and normalizes a rotation.
pub(super) fn validated_rotation<S: Scalar>(rotation: Quat<S>) -> Result<Quat<S>, Error> {
    // Drift of a few thousand products in f32, at most.
    let length = rotation.magnitude();
    if (length.as_f64() - 1.0).abs() <= 1e-3 {
        Ok(rotation.normalize())
    } else {
        Err(Error::NotUnit { field: "rotation", value: length.as_f64() })
    }
}

/// The value, or `None` for the default one.
pub(super) fn non_default<T: PartialEq>(value: T, usual: T) -> Option<T> {
    (value != usual).then_some(value)
}
