//! Contacts of bodies, as they are told.

use crate::handle::{BallId, BodyId, MarbleId, WallId};
use crate::math::{Point3, Vec3};

/// Collider that touches a body.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum ContactPartner {
    /// Another body.
    Body(BodyId),
    /// Marble.
    Marble(MarbleId),
    /// Ball of the swarm that is no marble.
    Ball(BallId),
    /// Wall.
    Wall(WallId),
}

/// Contact point of a body in the last step ([`World::body_contacts`](crate::world::World::body_contacts)).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BodyContactInfo<S> {
    /// Body to which the normal points.
    pub body: BodyId,
    /// The other one.
    pub partner: ContactPartner,
    /// Parts that meet, of the partner and of the body: parts of compounds, or a triangle of a wall.
    pub parts: [u32; 2],
    /// Features of the parts that meet, by which a point is known in the next step.
    pub feature: u32,
    /// Unit normal, from the partner to the body.
    pub normal: Vec3<S>,
    /// Point on the body's surface at the end of the step, in metres.
    pub point: Point3<S>,
    /// Separation of the surfaces there, in metres; negative where they overlap, and infinite of a fast ball that passes
    /// by.
    pub separation: S,
    /// True from when the two parts first press on each other until a gap opens here
    /// ([`touch_goes_on`](crate::contact::touch_goes_on)).
    pub is_touching: bool,
    /// Largest approach speed along the normal in the step before contacts are solved, in m/s; negative if the two
    /// part, and zero of two that sleep.
    pub approach_speed: S,
    /// Speed at which the surfaces slide over each other then, in m/s.
    pub slip_speed: S,
    /// Normal impulse on the body in the step, in N s. What sleeps keeps it.
    pub normal_impulse: S,
    /// Friction impulse on the body in the step, in N s.
    pub tangent_impulse: Vec3<S>,
}
