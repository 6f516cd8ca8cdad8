//! Motion of walls, measured from the places of their entities.
//!
//! A wall whose [`Transform`] (or a parent's) is written in a fixed schedule moves there within the next
//! step.
//!
//! Written in any other schedule, as in [`Update`], it follows at the same speed: its displacement in a
//! frame is spread over the fixed steps that run for that frame, which may be many or none. It lags
//! behind its entity by no more than a frame and a step, and arrives in the first frame in which the
//! entity rests. After a frame that took much longer than others it catches up half as fast again as
//! the entity was moved. [`TawInterpolationPlugin`](crate::interpolation::TawInterpolationPlugin) draws it
//! where the marbles that are drawn meet it.
//!
//! All this holds where the step is in the fixed main loop. In a schedule that the game runs
//! ([`TawPlugins::in_schedule`](crate::TawPlugins::in_schedule)), a wall moves within each step to where its
//! entity is then.

use bevy::math::Isometry3d;
use bevy::prelude::*;

/// Largest change of the speed of a wall's surface within a step that passes for motion, in m/s: the
/// speed after a fall of five metres.
///
/// A wall that changes by more was put elsewhere, and carries nothing along; if it goes on so fast in
/// the next step, it does move, and counts from then on. A wall that is
/// [`Kinematic`](crate::components::Kinematic) has no such limit.
///
/// A half-space is taken to be a metre in size.
pub const LARGEST_CHANGE_OF_SPEED: f32 = 10.0;

/// Fastest that a wall catches up with its entity, over the speed at which that was moved.
const CATCH_UP: f32 = 1.5;

/// Overstep below which a step ends with its frame, in seconds: clocks count nanoseconds.
const SAME_TIME: f32 = 1e-6;

/// Times of a fixed step, in seconds.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Clock {
    /// Length of the step.
    pub dt: f32,
    /// Time from the end of the step to the end of the frame.
    pub overstep: f32,
    /// Length of the frames in which walls were moved since the last step.
    pub frames: f32,
}

/// Rule by which a change of place passes for motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Change {
    /// If it is gradual.
    Judged,
    /// Always.
    Motion,
    /// Never.
    Jump,
}

/// Velocity, and angular velocity about the wall's own position.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct WallVelocity {
    pub linear: Vec3,
    pub angular: Vec3,
}

/// Pose of a wall in a step.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TrackedPose {
    pub pose: Isometry3d,
    /// None if the wall is at rest, or was put there.
    pub velocity: Option<WallVelocity>,
    /// True if a change was judged to be a jump.
    pub jumped: bool,
}

/// Pose of a wall's entity from step to step, and how far the wall lags behind it.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct PoseTracker {
    /// Pose at the last gather.
    last: Option<Isometry3d>,
    /// Pose when fixed steps last ended.
    pub after_steps: Option<Isometry3d>,
    /// Pose before the first fixed step of this frame.
    pub before_steps: Option<Isometry3d>,
    /// From the wall to its entity.
    lag: Displacement,
    /// Time in which the entity came so far, in seconds.
    lag_time: f32,
    /// True if the entity was moved between the steps of this frame and those before.
    follows: bool,
    /// Velocity in the last step, and the part of it that passed for motion.
    measured: WallVelocity,
    believed: WallVelocity,
}

impl PoseTracker {
    /// Takes the wall a step on, with its entity at `now`, for a wall that reaches `reach` metres from
    /// its own origin.
    pub fn advance(
        &mut self,
        now: Isometry3d,
        clock: Clock,
        reach: f32,
        change: Change,
    ) -> TrackedPose {
        let Some(last) = self.last.replace(now).filter(|_| clock.dt > 0.0) else {
            return TrackedPose { pose: now, velocity: None, jumped: false };
        };
        let before = self.before_steps.take();
        let after = self.after_steps.take().unwrap_or(last);
        if let Some(before) = before {
            let between = Displacement::between(after, before);
            self.follows = between != Displacement::default();
            if self.follows {
                self.lag = self.lag.then(between);
                self.lag_time += clock.frames;
            }
        }
        let within_steps = [
            Displacement::between(last, after).over(clock.dt),
            Displacement::between(before.unwrap_or(after), now).over(clock.dt),
        ];
        let followed = self.follow(clock);
        let velocity = followed.over(clock.dt) + within_steps[0] + within_steps[1];
        let jumped = self.judge(velocity, reach, change);
        if jumped || change == Change::Jump {
            (self.lag, self.lag_time) = default();
        }
        TrackedPose {
            pose: self.lag.before(now),
            velocity: (self.believed != default()).then_some(self.believed),
            jumped,
        }
    }

    /// Makes up for the part of the lag that is due in a step.
    fn follow(&mut self, clock: Clock) -> Displacement {
        if self.lag == Displacement::default() {
            return self.lag;
        }
        let due = if self.follows && clock.overstep > SAME_TIME {
            clock.dt / (clock.dt + clock.overstep)
        } else {
            1.0
        };
        let part = due.min(CATCH_UP * clock.dt / self.lag_time);
        let followed = self.lag.part(part);
        (self.lag, self.lag_time) = if part < 1.0 {
            (self.lag.part(1.0 - part), self.lag_time * (1.0 - part))
        } else {
            default()
        };
        followed
    }

    /// Takes a velocity over if it passes for motion. Returns whether it is judged to be a jump.
    fn judge(&mut self, measured: WallVelocity, reach: f32, change: Change) -> bool {
        if change == Change::Jump {
            (self.measured, self.believed) = default();
            return false;
        }
        let smooth = |before: WallVelocity| {
            let change = (measured.linear - before.linear).length()
                + (measured.angular - before.angular).length() * reach;
            change <= LARGEST_CHANGE_OF_SPEED
        };
        let moves = change == Change::Motion || smooth(self.measured) || smooth(self.believed);
        self.measured = measured;
        self.believed = if moves { measured } else { default() };
        !moves
    }
}

/// Displacement of a pose.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Displacement {
    translation: Vec3,
    /// In world space, about the pose's own position.
    rotation: Quat,
}

impl Displacement {
    fn between(from: Isometry3d, to: Isometry3d) -> Self {
        if from == to {
            return Self::default();
        }
        Self {
            translation: Vec3::from(to.translation - from.translation),
            rotation: to.rotation * from.rotation.inverse(),
        }
    }

    /// This displacement, and then another one.
    fn then(self, next: Self) -> Self {
        Self {
            translation: self.translation + next.translation,
            rotation: next.rotation * self.rotation,
        }
    }

    /// Rotation vector in radians, along the shorter way round: a rotation has two quaternions.
    fn rotation_vector(self) -> Vec3 {
        let shorter = if self.rotation.w < 0.0 { -self.rotation } else { self.rotation };
        shorter.to_scaled_axis()
    }

    /// Part of it, from the begin on.
    fn part(self, part: f32) -> Self {
        Self {
            translation: self.translation * part,
            rotation: Quat::from_scaled_axis(self.rotation_vector() * part),
        }
    }

    /// Velocity of a displacement over a time in seconds.
    fn over(self, seconds: f32) -> WallVelocity {
        if self == Self::default() {
            return WallVelocity::default();
        }
        WallVelocity {
            linear: self.translation / seconds,
            angular: self.rotation_vector() / seconds,
        }
    }

    /// Pose from which this leads to `end`.
    fn before(self, end: Isometry3d) -> Isometry3d {
        if self == Self::default() {
            return end;
        }
        Isometry3d {
            translation: end.translation - bevy::math::Vec3A::from(self.translation),
            rotation: self.rotation.inverse() * end.rotation,
        }
    }
}

impl std::ops::Add for WallVelocity {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self { linear: self.linear + other.linear, angular: self.angular + other.angular }
    }
}
