//! Rigid transforms, and every common form of a rotation.
//!
//! Axes are right-handed, with y up and −z forward. A rotation is a unit quaternion; the other
//! forms convert to and from it, each in a file of its own, each round trip within four epsilons.

mod axis_angle;
mod bivector;
mod camera;
mod look_at;
mod matrix;
mod motor;
mod pose;
mod rotor;
mod slerp;
mod tree;
mod yaw_pitch_roll;

pub use axis_angle::AxisAngle;
pub use bivector::Bivector;
pub use camera::{Camera, Ray};
pub use look_at::LookAt;
pub use matrix::{matrix_of_rotation, rotation_of_matrix};
pub use motor::{Line, Motor, Twist};
pub use pose::Pose;
pub use rotor::Rotor;
pub use slerp::slerp;
pub use tree::{NodeId, Tree};
pub use yaw_pitch_roll::YawPitchRoll;
