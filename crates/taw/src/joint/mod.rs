//! Joints between marbles, rigid bodies and places in the world: what a joint is, its rows, and their solution.
//!
//! Each kind of joint is a list of rows: a position error `C`, and its Jacobian `J`, by which velocities of the
//! two ends change it (`rows.rs`). All rows of a world are solved at once, as the linear system
//! `J M⁻¹ Jᵀ λ = b` of the impulses `λ` (`system.rs`), by a sparse factorization (`sparse_ldl.rs`; Baraff,
//! *Linear-time dynamics using Lagrange multipliers*, 1996). So a chain holds whatever hangs on it.
//!
//! A substep first finds impulses by which `C` is zero at its end, along the directions at its begin, and then,
//! at its end, those by which `J v` is zero: RATTLE (Andersen, 1983), which is of second order, and keeps energy.

mod body;
mod elimination;
mod energy;
mod inertia;
mod list;
mod relax;
mod rows;
mod sparse_ldl;
mod spring;
mod system;

pub use crate::handle::JointId;
pub use list::Joints;

use crate::Error;
use crate::error::{finite, positive, within};
use crate::frame::Pose;
use crate::handle::{BodyId, MarbleId};
use crate::math::{Point3, Quat, Scalar, Vec3};
pub(crate) use body::{JointBody, JointOwner};
pub(crate) use system::{JointSystem, SystemJoint};

/// End of a joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum JointEnd<S> {
    /// Marble, and the frame of the joint relative to its center and its rotation.
    Marble {
        /// The marble.
        marble: MarbleId,
        /// Frame of the joint in that of the marble.
        frame: Pose<S>,
    },
    /// Rigid body, and the frame of the joint in its frame.
    Body {
        /// The body.
        body: BodyId,
        /// Frame of the joint in that of the body.
        frame: Pose<S>,
    },
    /// Place in the world. One that is [set](Joints::set) elsewhere moves there within the next step.
    World {
        /// Frame of the joint in the world.
        frame: Pose<S>,
    },
}

impl<S: Scalar> JointEnd<S> {
    /// Anchor on a marble, relative to its center, in metres, with the axes of the marble.
    #[must_use]
    pub fn marble(marble: MarbleId, anchor: Vec3<S>) -> Self {
        Self::Marble { marble, frame: Pose { translation: anchor, ..Pose::identity() } }
    }

    /// Anchor on a rigid body, in its frame, in metres, with its axes.
    #[must_use]
    pub fn body(body: BodyId, anchor: Vec3<S>) -> Self {
        Self::Body { body, frame: Pose { translation: anchor, ..Pose::identity() } }
    }

    /// Anchor in the world, with the axes of the world.
    #[must_use]
    pub fn world(anchor: Point3<S>) -> Self {
        let translation = Vec3::new(anchor.x, anchor.y, anchor.z);
        Self::World { frame: Pose { translation, ..Pose::identity() } }
    }

    /// Turns its frame.
    #[must_use]
    pub fn with_rotation(mut self, rotation: Quat<S>) -> Self {
        self.frame_mut().rotation = rotation;
        self
    }

    /// Frame of the joint.
    #[must_use]
    pub fn frame(&self) -> Pose<S> {
        let (Self::Marble { frame, .. } | Self::Body { frame, .. } | Self::World { frame }) = self;
        *frame
    }

    fn frame_mut(&mut self) -> &mut Pose<S> {
        let (Self::Marble { frame, .. } | Self::Body { frame, .. } | Self::World { frame }) = self;
        frame
    }

    /// The rigid body, if it is one.
    #[must_use]
    pub fn body_id(&self) -> Option<BodyId> {
        match self {
            Self::Body { body, .. } => Some(*body),
            Self::Marble { .. } | Self::World { .. } => None,
        }
    }

    /// Returns true for a place in the world.
    pub(crate) fn is_world(&self) -> bool {
        matches!(self, Self::World { .. })
    }

    /// Returns true if it holds what the other one holds.
    fn holds_same(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Marble { marble: a, .. }, Self::Marble { marble: b, .. }) => a == b,
            (Self::Body { body: a, .. }, Self::Body { body: b, .. }) => a == b,
            _ => false,
        }
    }

    /// The marble, if it is one.
    #[must_use]
    pub fn marble_id(&self) -> Option<MarbleId> {
        match self {
            Self::Marble { marble, .. } => Some(*marble),
            Self::Body { .. } | Self::World { .. } => None,
        }
    }
}

/// Spring and damper, by the motion of the two ends if nothing else moved them: its stiffness is that frequency's
/// for their effective mass along the spring.
///
/// A spring that swings by more than a quarter of a radian in a substep, 10 Hz at 240 substeps a second, is damped
/// more than by its ratio.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointSpring<S> {
    /// Oscillations per second without damping, above zero.
    pub frequency: S,
    /// Damping over that of the fastest decay without oscillation (critical damping); at least zero.
    pub damping_ratio: S,
}

/// Drive of the free axis of a joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum JointMotor<S> {
    /// Holds a speed. With a speed of zero, it is a brake, or the friction of the joint.
    Speed {
        /// Target, in rad/s, or m/s along a slider.
        target: S,
        /// Largest torque in N m, or force in N.
        max: S,
    },
    /// Holds a position by a spring.
    Position {
        /// Target, in rad within ±.99 π, or m along a slider.
        target: S,
        /// The spring.
        spring: JointSpring<S>,
        /// Largest torque in N m, or force in N.
        max: S,
    },
}

/// Free axis of a joint: what limits and drives it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct JointDrive<S> {
    /// Least and largest position, in rad within ±.99 π, or m along a slider.
    pub limits: Option<[S; 2]>,
    /// Its motor.
    pub motor: Option<JointMotor<S>>,
}

/// Largest angle of a hinge, in rad: at half a turn it becomes its opposite.
const MAX_ANGLE: f64 = 0.99 * std::f64::consts::PI;

/// Kind of a joint: which motions it leaves free. The frames of both ends coincide where it is at zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum JointKind<S> {
    /// Ball-and-socket joint: anchors coincide.
    BallAndSocket,
    /// Hinge about z (revolute joint).
    Hinge(JointDrive<S>),
    /// Slider along x of the first end (prismatic joint).
    Slider(JointDrive<S>),
    /// No motion (weld).
    Fixed,
    /// Distance of the anchors within a range, in metres: a rod for two equal bounds, a rope from zero on.
    Distance([S; 2]),
    /// Spring between the anchors, of this length in metres where it is at rest.
    Spring {
        /// Length at rest, in metres.
        length: S,
        /// Frequency and damping.
        spring: JointSpring<S>,
    },
    /// Wheel: it turns about z, and moves along x of the first end on a spring.
    Wheel {
        /// Suspension.
        spring: JointSpring<S>,
        /// Least and largest way of the suspension, in metres.
        travel: [S; 2],
        /// Drive of the turning.
        drive: JointDrive<S>,
    },
    /// Gear: the first end turns about its z by `−ratio` times the turn of the second about its own z, both
    /// relative to the world.
    Gear {
        /// Ratio of the two, other than zero; negative for a belt.
        ratio: S,
    },
}

/// Joint of two marbles or rigid bodies, or of one and a place in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Joint<S> {
    /// Its ends.
    pub ends: [JointEnd<S>; 2],
    /// Motions that it leaves free.
    pub kind: JointKind<S>,
    /// True if the two that it joins collide with each other.
    pub collide_connected: bool,
    /// Force in N beyond which it breaks, as a mean over a substep, so that a blow counts whole; infinite for never.
    /// Anchors that are apart when the joint is made are brought together within few substeps, by a force that may be
    /// large.
    pub breaking_force: S,
    /// Torque in N m beyond which it breaks; infinite for never.
    pub breaking_torque: S,
}

impl<S: Scalar> Joint<S> {
    /// Joint that never breaks, and whose ends do not collide with each other.
    #[must_use]
    pub fn new(kind: JointKind<S>, ends: [JointEnd<S>; 2]) -> Self {
        let never = S::infinity();
        Self { ends, kind, collide_connected: false, breaking_force: never, breaking_torque: never }
    }

    /// Validates all numbers.
    fn validated(mut self) -> Result<Self, Error> {
        for end in &mut self.ends {
            *end.frame_mut() = end.frame().validated()?;
        }
        let [a, b] = self.ends;
        if a.is_world() && b.is_world() {
            return Err(Error::NothingJoined);
        }
        if a.holds_same(&b) {
            return Err(Error::JoinedToItself);
        }
        for (field, value) in
            [("breaking_force", self.breaking_force), ("breaking_torque", self.breaking_torque)]
        {
            within(field, value, S::zero(), S::infinity())?;
        }
        self.kind.validate()?;
        Ok(self)
    }
}

impl<S: Scalar> JointKind<S> {
    fn validate(&self) -> Result<(), Error> {
        match self {
            Self::BallAndSocket | Self::Fixed => Ok(()),
            Self::Hinge(drive) => drive.validate(S::from_f64(MAX_ANGLE)),
            Self::Slider(drive) => drive.validate(S::max_value()),
            Self::Distance(range) => {
                within("range", range[0], S::zero(), S::max_value())?;
                ordered("range", *range, [S::zero(), S::infinity()])
            }
            Self::Spring { length, spring } => {
                within("length", *length, S::zero(), S::max_value())?;
                spring.validate()
            }
            Self::Wheel { spring, travel, drive } => {
                spring.validate()?;
                ordered("travel", *travel, [S::neg_infinity(), S::infinity()])?;
                drive.validate(S::from_f64(MAX_ANGLE))
            }
            Self::Gear { ratio } => {
                let is_zero = finite("ratio", *ratio)?.is_zero();
                if is_zero { positive("|ratio|", *ratio).map(|_| ()) } else { Ok(()) }
            }
        }
    }
}

/// Validates a least and a largest number.
fn ordered<S: Scalar>(field: &'static str, [low, high]: [S; 2], all: [S; 2]) -> Result<(), Error> {
    within(field, high, all[0], all[1])?;
    within(field, low, all[0], high).map(|_| ())
}

impl<S: Scalar> JointDrive<S> {
    fn validate(&self, most: S) -> Result<(), Error> {
        if let Some(limits) = self.limits {
            ordered("limits", limits, [-most, most])?;
        }
        let max = match self.motor {
            None => return Ok(()),
            Some(JointMotor::Speed { target, max }) => {
                finite("motor.target", target)?;
                max
            }
            Some(JointMotor::Position { target, spring, max }) => {
                within("motor.target", target, -most, most)?;
                spring.validate()?;
                max
            }
        };
        within("motor.max", max, S::zero(), S::infinity()).map(|_| ())
    }
}

impl<S: Scalar> JointSpring<S> {
    fn validate(&self) -> Result<(), Error> {
        positive("frequency", self.frequency)?;
        within("damping_ratio", self.damping_ratio, S::zero(), S::max_value()).map(|_| ())
    }
}

impl<S: Scalar> JointKind<S> {
    fn cast(&self) -> JointKind<f64> {
        let number = |x: S| x.as_f64();
        let spring = |it: JointSpring<S>| JointSpring {
            frequency: number(it.frequency),
            damping_ratio: number(it.damping_ratio),
        };
        let motor = |it: JointMotor<S>| match it {
            JointMotor::Speed { target, max } => {
                JointMotor::Speed { target: number(target), max: number(max) }
            }
            JointMotor::Position { target, spring: it, max } => JointMotor::Position {
                target: number(target),
                spring: spring(it),
                max: number(max),
            },
        };
        let drive = |it: JointDrive<S>| JointDrive {
            limits: it.limits.map(|limits| limits.map(number)),
            motor: it.motor.map(motor),
        };
        match *self {
            Self::BallAndSocket => JointKind::BallAndSocket,
            Self::Hinge(it) => JointKind::Hinge(drive(it)),
            Self::Slider(it) => JointKind::Slider(drive(it)),
            Self::Fixed => JointKind::Fixed,
            Self::Distance(range) => JointKind::Distance(range.map(number)),
            Self::Spring { length, spring: it } => {
                JointKind::Spring { length: number(length), spring: spring(it) }
            }
            Self::Wheel { spring: it, travel, drive: turning } => JointKind::Wheel {
                spring: spring(it),
                travel: travel.map(number),
                drive: drive(turning),
            },
            Self::Gear { ratio } => JointKind::Gear { ratio: number(ratio) },
        }
    }
}
