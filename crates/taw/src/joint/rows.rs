//! Rows of each kind of joint: position error and Jacobian, from the frames of its two ends.

use std::f64::consts::TAU;

use cgmath::{InnerSpace, Zero};

use super::spring::SpringRow;
use super::{JointDrive, JointKind, JointMotor, JointSpring};
use crate::frame::Pose;
use crate::math::{Quat, Scalar, Vec3, normalize_and_length};

/// Largest number of rows of a joint: those of a wheel with stops, limits and a motor.
pub(super) const MAX_ROWS: usize = 10;

/// Row of a joint at the poses of its ends: velocities change its error by `linear · (v₂ − v₁) + angular₁ · ω₁ +
/// angular₂ · ω₂`, with velocities of the centers.
#[derive(Clone, Copy, Debug)]
pub(super) struct RowGeometry {
    pub linear: Vec3<f64>,
    pub angular: [Vec3<f64>; 2],
    /// Position error, in metres or radians.
    pub error: f64,
    pub rule: RowRule,
}

/// Condition of a row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum RowRule {
    /// Error of zero.
    Zero,
    /// Error of zero or more, with an impulse of zero or more.
    AtLeastZero,
    /// Speed, with an impulse of at most this, in N s or N m s per second.
    Speed { target: f64, max: f64 },
    /// Spring towards an error of zero, with an impulse of at most this per second.
    Spring { spring: SpringRow, max: f64 },
    /// Turn of gears, whose error is the sum of their slip.
    Gear,
}

/// Frames of the two ends, and the lever arms from the centers to their anchors, in the world.
#[derive(Clone, Copy, Debug)]
pub(super) struct JointFrames {
    pub frames: [Pose<f64>; 2],
    pub arms: [Vec3<f64>; 2],
}

/// Number of rows of a kind, the same at every pose.
pub(super) fn count<S: Scalar>(kind: &JointKind<S>) -> usize {
    let of_drive = |drive: &JointDrive<S>| {
        let limits = drive.limits.map_or(0, |[low, high]| if low == high { 1 } else { 2 });
        limits + usize::from(drive.motor.is_some())
    };
    match kind {
        JointKind::BallAndSocket => 3,
        JointKind::Hinge(drive) | JointKind::Slider(drive) => 5 + of_drive(drive),
        JointKind::Fixed => 6,
        JointKind::Distance([low, high]) => match (low == high, *low > S::zero(), high.is_finite())
        {
            (true, ..) => 1,
            (_, low, high) => usize::from(low) + usize::from(high),
        },
        JointKind::Spring { .. } | JointKind::Gear { .. } => 1,
        JointKind::Wheel { travel, drive, .. } => {
            5 + of_drive(drive) + travel.iter().filter(|stop| stop.is_finite()).count()
        }
    }
}

impl JointFrames {
    /// Lists the rows of a kind.
    pub fn rows(&self, kind: &JointKind<f64>, mut push: impl FnMut(RowGeometry)) {
        let [x, y, z] = self.axes();
        let push = &mut push;
        match *kind {
            JointKind::BallAndSocket => self.hold([x, y, z], push),
            JointKind::Hinge(drive) => {
                self.hold([x, y, z], push);
                self.align_z([x, y], push);
                drive_rows(&drive, about(z, self.twist()), push);
            }
            JointKind::Slider(drive) => {
                self.hold([y, z], push);
                self.align([x, y, z], push);
                drive_rows(&drive, self.along(x), push);
            }
            JointKind::Fixed => {
                self.hold([x, y, z], push);
                self.align([x, y, z], push);
            }
            JointKind::Distance(range) => {
                let row = self.along(self.direction());
                if range[0] == range[1] {
                    push(row.beyond(range[0]));
                    return;
                }
                if range[0] > 0.0 {
                    push(row.beyond(range[0]).one_sided());
                }
                if range[1].is_finite() {
                    push(row.beyond(range[1]).reversed().one_sided());
                }
            }
            JointKind::Spring { length, spring } => {
                push(self.along(self.direction()).beyond(length).sprung(spring, f64::INFINITY));
            }
            JointKind::Wheel { spring, travel, drive } => {
                self.hold([y, z], push);
                self.align_z([x, y], push);
                let way = self.along(x);
                if travel[0].is_finite() {
                    push(way.beyond(travel[0]).one_sided());
                }
                if travel[1].is_finite() {
                    push(way.beyond(travel[1]).reversed().one_sided());
                }
                push(way.sprung(spring, f64::INFINITY));
                drive_rows(&drive, about(z, self.twist()), push);
            }
            JointKind::Gear { ratio } => {
                let other = self.frames[1].rotation * Vec3::unit_z();
                push(RowGeometry {
                    linear: Vec3::zero(),
                    angular: [z, other * ratio],
                    error: 0.0,
                    rule: RowRule::Gear,
                });
            }
        }
    }

    /// Position of the free axis of a kind, in rad or metres; none of one without.
    pub fn position(&self, kind: &JointKind<f64>) -> Option<f64> {
        match kind {
            JointKind::Hinge(_) | JointKind::Wheel { .. } => Some(self.twist()),
            JointKind::Slider(_) => Some(self.axes()[0].dot(self.offset())),
            _ => None,
        }
    }

    /// Axes of the first frame, in the world.
    fn axes(&self) -> [Vec3<f64>; 3] {
        [Vec3::unit_x(), Vec3::unit_y(), Vec3::unit_z()].map(|axis| self.frames[0].rotation * axis)
    }

    /// Way from the first anchor to the second, in metres.
    fn offset(&self) -> Vec3<f64> {
        self.frames[1].translation - self.frames[0].translation
    }

    /// Direction of that; any where the two coincide.
    fn direction(&self) -> Vec3<f64> {
        normalize_and_length(self.offset()).map_or_else(Vec3::unit_y, |(direction, _)| direction)
    }

    /// Way along an axis that turns with the first end.
    fn along(&self, axis: Vec3<f64>) -> RowGeometry {
        let offset = self.offset();
        RowGeometry {
            linear: axis,
            angular: [axis.cross(self.arms[0] + offset), self.arms[1].cross(axis)],
            error: axis.dot(offset),
            rule: RowRule::Zero,
        }
    }

    /// Rows that keep the anchors together along these axes.
    fn hold<const N: usize>(&self, axes: [Vec3<f64>; N], push: &mut impl FnMut(RowGeometry)) {
        for axis in axes {
            push(self.along(axis));
        }
    }

    /// Rotation of the second frame in the first.
    fn relative_rotation(&self) -> Quat<f64> {
        let [a, b] = self.frames.map(|frame| frame.rotation);
        let relative = a.conjugate() * b;
        if relative.s < 0.0 { -relative } else { relative }
    }

    /// Angle about z, in (−π, π].
    fn twist(&self) -> f64 {
        let relative = self.relative_rotation();
        2.0 * relative.v.z.atan2_portable(relative.s)
    }

    /// Rows that keep the frames parallel.
    fn align(&self, axes: [Vec3<f64>; 3], push: &mut impl FnMut(RowGeometry)) {
        let turn = self.relative_rotation().v * 2.0;
        for (axis, angle) in axes.into_iter().zip([turn.x, turn.y, turn.z]) {
            push(about(axis, angle));
        }
    }

    /// Rows that keep the z axes parallel.
    fn align_z(&self, axes: [Vec3<f64>; 2], push: &mut impl FnMut(RowGeometry)) {
        let [a, b] = self.frames.map(|frame| frame.rotation * Vec3::unit_z());
        let turn = a.cross(b);
        for axis in axes {
            push(about(axis, axis.dot(turn)));
        }
    }
}

/// Turn of the second end relative to the first about an axis, which is at this angle.
fn about(axis: Vec3<f64>, angle: f64) -> RowGeometry {
    let linear = Vec3::zero();
    RowGeometry { linear, angular: [-axis, axis], error: angle, rule: RowRule::Zero }
}

/// Rows of a free axis, whose position is the error of this row.
fn drive_rows(drive: &JointDrive<f64>, row: RowGeometry, push: &mut impl FnMut(RowGeometry)) {
    match drive.limits {
        None => {}
        Some([low, high]) if low == high => push(row.beyond(low).wrapped()),
        Some([low, high]) => {
            push(row.beyond(low).one_sided());
            push(row.beyond(high).reversed().one_sided());
        }
    }
    match drive.motor {
        None => {}
        Some(JointMotor::Speed { target, max }) => {
            push(RowGeometry { rule: RowRule::Speed { target, max }, ..row });
        }
        Some(JointMotor::Position { target, spring, max }) => {
            push(row.beyond(target).wrapped().sprung(spring, max));
        }
    }
}

impl RowGeometry {
    /// Row whose error is zero at this position.
    fn beyond(self, position: f64) -> Self {
        Self { error: self.error - position, ..self }
    }

    /// Row whose error is the nearest way, if it is an angle.
    fn wrapped(self) -> Self {
        let turns = if self.is_angle() { (self.error / TAU).round() } else { 0.0 };
        Self { error: self.error - turns * TAU, ..self }
    }

    /// Returns true if its error is an angle.
    pub fn is_angle(&self) -> bool {
        self.linear.is_zero()
    }

    /// Row in the other direction.
    fn reversed(self) -> Self {
        let angular = self.angular.map(|angular| -angular);
        Self { linear: -self.linear, angular, error: -self.error, ..self }
    }

    fn one_sided(self) -> Self {
        Self { rule: RowRule::AtLeastZero, ..self }
    }

    fn sprung(self, JointSpring { frequency, damping_ratio }: JointSpring<f64>, max: f64) -> Self {
        let spring = SpringRow::new(frequency, damping_ratio);
        Self { rule: RowRule::Spring { spring, max }, ..self }
    }
}
