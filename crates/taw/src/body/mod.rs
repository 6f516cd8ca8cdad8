//! Rigid bodies: any convex shape, or a compound of such, that moves and turns; its state, and the rows of its
//! contacts.
//!
//! A body's center of mass flies by its velocity, and it turns freely by its angular momentum about its principal
//! axes ([`FreeRotation`](crate::motion::FreeRotation)). Contacts have up to four points for each pair of convex
//! parts (`contact.rs`), solved as soft contacts in small steps (`solve.rs`; Catto, `Solver2D`, 2024). All numbers of the solver are `f64`, also in
//! a world of `f32`.

mod body_state;
mod bounce;
mod contact;
mod contact_info;
mod list;
mod solve;
mod state;
mod system;

pub use crate::handle::BodyId;
pub use contact_info::{BodyContactInfo, ContactPartner};
pub use list::{Bodies, BodyPlace};

pub(crate) use body_state::BodyState;
pub(crate) use contact::{
    BodyContact, BodyContactKey, BodyContactPoint, BodyPartner, SweptManifold, ball_contact,
    manifold_contact,
};
pub(crate) use state::{SolverBody, turned_freely};
pub(crate) use system::BodySystem;

use crate::Error;
use crate::broad::CollisionLayers;
use crate::contact::Material;
use crate::error::{finite, finite_point, finite_vector, positive, within};
use crate::math::{Point3, Quat, Scalar, Vec3};
use crate::motion::Mass;
use crate::shape::{MassProperties, Shape};

/// Mass of a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum BodyMass<S> {
    /// Uniform distribution over the shape, by density or by mass; or infinite: a kinematic body, which moves by
    /// its velocity and angular velocity, whatever it touches.
    Uniform(Mass<S>),
    /// Any other distribution: of a hollow ball, or of parts of different densities
    /// ([`MassProperties::sum`]).
    Given(MassProperties<S>),
}

impl<S: Scalar> Default for BodyMass<S> {
    /// Uniform density of glass: 2,500 kg/m³.
    fn default() -> Self {
        Self::Uniform(Mass::default())
    }
}

/// Rigid body.
#[derive(Clone, Debug, PartialEq)]
pub struct Body<S> {
    /// Shape in the frame of the body, in metres.
    pub shape: Shape<S>,
    /// Origin of that frame in the world, in metres.
    pub position: Point3<S>,
    /// Rotation of that frame, a unit quaternion.
    pub rotation: Quat<S>,
    /// Velocity of the center of mass, in m/s.
    pub velocity: Vec3<S>,
    /// Angular velocity in rad/s, about axes of the world.
    pub angular_velocity: Vec3<S>,
    /// Mass and its distribution.
    pub mass: BodyMass<S>,
    /// Factor of the world's gravity.
    pub gravity_scale: S,
    /// Decay of velocity and of angular velocity, in 1/s, at least zero.
    pub damping: [S; 2],
    /// Material of its surface.
    pub material: Material<S>,
    /// Layers: what it collides with.
    pub layers: CollisionLayers,
    /// True if it never sleeps.
    pub sleeping_disabled: bool,
}

/// Largest coordinate in metres, speed in m/s and angular speed in rad/s.
const MAX_NUMBER: f64 = 1e12;

/// Checks a place.
fn place<S: Scalar>(at: Point3<S>) -> Result<(), Error> {
    let at = finite_point(["position.x", "position.y", "position.z"], at)?;
    bounded(["position.x", "position.y", "position.z"], at.into())
}

/// Checks a velocity and an angular velocity.
fn motion<S: Scalar>(velocity: Vec3<S>, spin: Vec3<S>) -> Result<(), Error> {
    let names = ["velocity.x", "velocity.y", "velocity.z"];
    bounded(names, finite_vector(names, velocity)?.into())?;
    let names = ["angular_velocity.x", "angular_velocity.y", "angular_velocity.z"];
    bounded(names, finite_vector(names, spin)?.into())
}

fn bounded<S: Scalar>(names: [&'static str; 3], numbers: [S; 3]) -> Result<(), Error> {
    let most = S::from_f64(MAX_NUMBER);
    names
        .into_iter()
        .zip(numbers)
        .try_for_each(|(name, x)| within(name, x, -most, most).map(|_| ()))
}

impl<S: Scalar> Body<S> {
    /// Body of this shape at rest, with the density of glass.
    pub fn new(shape: impl Into<Shape<S>>, position: Point3<S>) -> Self {
        let zero = Vec3::new(S::zero(), S::zero(), S::zero());
        Self {
            shape: shape.into(),
            position,
            rotation: Quat::new(S::one(), S::zero(), S::zero(), S::zero()),
            velocity: zero,
            angular_velocity: zero,
            mass: BodyMass::default(),
            gravity_scale: S::one(),
            damping: [S::zero(); 2],
            material: Material::default(),
            layers: CollisionLayers::ALL,
            sleeping_disabled: false,
        }
    }

    /// Box with these half extents, at rest, with the density of glass.
    pub fn cuboid(half_extents: Vec3<S>, position: Point3<S>) -> Self {
        let Vec3 { x, y, z } = half_extents;
        let (min, max) = (Point3::new(-x, -y, -z), Point3::new(x, y, z));
        Self::new(Shape::Aabb(crate::shape::Aabb { min, max }), position)
    }

    /// Mass properties in its frame; none of infinite mass.
    ///
    /// # Errors
    /// [`Error::NotPositive`] for a mass or density, or for a shape without volume where the mass is uniform.
    pub fn mass_properties(&self) -> Result<Option<MassProperties<S>>, Error> {
        match self.mass {
            BodyMass::Given(properties) => properties.validated().map(Some),
            BodyMass::Uniform(Mass::Infinite) => Ok(None),
            BodyMass::Uniform(Mass::Density(density)) => {
                MassProperties::of_shape(&self.shape, density).map(Some)
            }
            BodyMass::Uniform(Mass::Kilograms(mass)) => {
                let mass = positive("mass", mass)?;
                let unit = MassProperties::of_shape(&self.shape, S::one())?;
                Ok(Some(unit.with_mass(mass)))
            }
        }
    }

    /// Returns the body if all its numbers are in range.
    pub(crate) fn validated(self) -> Result<Self, Error> {
        place(self.position)?;
        motion(self.velocity, self.angular_velocity)?;
        finite("gravity_scale", self.gravity_scale)?;
        within("damping[0]", self.damping[0], S::zero(), S::max_value())?;
        within("damping[1]", self.damping[1], S::zero(), S::max_value())?;
        let rotation = crate::error::rotation("rotation", self.rotation)?;
        let body = Self {
            shape: self.shape.validated()?,
            rotation,
            material: self.material.validated()?,
            ..self
        };
        body.mass_properties()?;
        Ok(body)
    }
}
