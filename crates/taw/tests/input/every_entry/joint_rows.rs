//! Rows of the table for joints, and for locked axes.

use taw::Error;
use taw::joint::{Joint, JointDrive, JointEnd, JointKind, JointMotor, JointSpring};
use taw::prelude::*;

use super::{Place, Row, Scope};

pub fn joints<S: Scalar>() -> Vec<Row<S>> {
    table! {
        World 7 "Joints::insert Joints::set": |p, x| {
            let ends = [JointEnd::world(Point3::new(S::zero(), S::one(), S::zero())), JointEnd::marble(p.subject, Vec3::new(S::zero(), S::zero(), S::zero()))];
            let spring = JointSpring { frequency: S::one(), damping_ratio: x };
            let motor = Some(JointMotor::Position { target: S::zero(), spring, max: x });
            let kind = match p.case {
                0 => JointKind::Distance([x, S::one()]),
                1 => JointKind::Spring { length: x, spring },
                2 => JointKind::Spring { length: S::one(), spring: JointSpring { frequency: x, ..spring } },
                3 => JointKind::Slider(JointDrive { limits: Some([x, S::one()]), motor: Some(JointMotor::Speed { target: x, max: S::one() }) }),
                4 => JointKind::Hinge(JointDrive { limits: None, motor }),
                5 => JointKind::Gear { ratio: x },
                _ => JointKind::Fixed,
            };
            let ends = if p.case == 6 { [JointEnd::world(Point3::new(x, x, S::zero())), ends[1]] } else { ends };
            with_joint(p, Joint::new(kind, ends))
        };
        World 2 "Joints::get Joints::remove Joints::force Joints::torque Joints::position": |p, x| {
            let ends = [JointEnd::world(Point3::new(S::zero(), S::one(), S::zero())), JointEnd::marble(p.subject, Vec3::new(S::zero(), S::zero(), S::zero()))];
            let joint = Joint::new(JointKind::BallAndSocket, ends);
            with_joint(p, if p.case == 0 { Joint { breaking_force: x, ..joint } } else { Joint { breaking_torque: x, ..joint } })
        };
        Marble 6 "Marbles::set_locked_axes Marble.locked_axes": |p, _x| {
            if p.world.model().response == Response::EventDriven { return Ok(()) } // has a name of its own
            let axes = LockedAxes::try_from([1, 4, 12, 38, 56, 63][p.case])?;
            p.world.marbles.set_locked_axes(p.subject, axes)
        };
    }
}

/// Adds a joint, reads it, and takes it out again where the response knows none.
fn with_joint<S: Scalar>(p: &mut Place<S>, joint: Joint<S>) -> Result<(), Error> {
    let id = p.world.joints.insert(joint)?;
    p.world.joints.set(id, joint)?;
    p.world.joints.get(id)?;
    p.world.joints.force(id)?;
    p.world.joints.torque(id)?;
    p.world.joints.position(id)?;
    if p.world.model().response != Response::SoftStep {
        p.world.joints.remove(id)?;
    }
    Ok(())
}
