//! Joints of a world, by handles that stay valid.

use std::mem::discriminant;
use std::sync::atomic::{AtomicU64, Ordering};

use super::{Joint, JointEnd, JointId, JointKind, rows};
use crate::Error;
use crate::frame::Pose;
use crate::handle::Handles;
use crate::math::Scalar;
use crate::uncompared::Uncompared;

/// State of a joint besides its definition.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct JointState<S> {
    pub joint: Joint<S>,
    /// Frames at the end of the last step of ends in the world.
    pub frames_before: [Pose<S>; 2],
    /// Impulses of its rows in the last substep, in N s or N m s.
    pub impulses: [f64; rows::MAX_ROWS],
    /// Turn by which a gear is off, in rad.
    pub slip: f64,
    /// Impulse of its force in the last substep, in N s.
    pub pull: f64,
    /// Kinetic energy that its group has gained, in J.
    pub gain: f64,
    /// Largest force in N and torque in N m of the last step.
    pub load: [S; 2],
    /// Position of its free axis at the end of the last step, in rad or metres.
    pub position: Option<S>,
}

/// Joints of a world, which only [`SoftStep`](crate::response::Response::SoftStep) knows: other responses refuse to
/// step a world that has some.
///
/// Marbles that a joint holds do not sleep. Joints turn them if the model's rotation is dynamic. All joints are
/// solved on one thread, which is exact but costs more the more joints are connected in a net: a chain takes a
/// time in proportion to its length, a sheet more, and many joints of one marble the cube of their number.
///
/// Machines that move faster than substeps can follow, or whose own marbles press each other, may open for a while
/// or gain energy: of 300 random ones, 3 that do not collide with themselves, and 16 that do, gain more than 5 % or
/// open by more than a millimetre (`cargo test -p taw --test joint random`).
///
/// ```
/// use taw::joint::{Joint, JointEnd, JointKind};
/// use taw::prelude::*;
///
/// # fn main() -> Result<(), taw::Error> {
/// let mut world = World::<f32>::default();
/// world.set_model(Model::GAME)?;
/// let ball = world.marbles.insert(Marble::new(Point3::new(1.0, 0.0, 0.0), 0.2))?;
/// // A pendulum on a rod of a metre.
/// let ends = [
///     JointEnd::world(Point3::new(0.0, 0.0, 0.0)),
///     JointEnd::marble(ball, Vec3::new(0.0, 0.0, 0.0)),
/// ];
/// let rod = world.joints.insert(Joint::new(JointKind::Distance([1.0, 1.0]), ends))?;
/// for _ in 0..60 {
///     world.step(1.0 / 60.0)?;
/// }
/// let at = world.marbles.get(ball)?.position;
/// assert!((at.to_vec().magnitude() - 1.0).abs() < 1e-4);
/// assert!(world.joints.force(rod)? > 0.0);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Joints<S> {
    handles: Handles,
    pub(crate) states: Vec<JointState<S>>,
    /// Joints that broke in the last step.
    broken: Vec<JointId>,
    /// Number that no other change of joints has, of any world.
    pub(crate) version: Uncompared<u64>,
}

impl<S: Scalar> Joints<S> {
    /// Adds a joint. One of marbles or bodies that are not there is taken out in the next step.
    ///
    /// # Errors
    /// [`Error::NotFinite`] or [`Error::NotUnit`] for a frame; [`Error::NothingJoined`] for two places in the
    /// world; [`Error::JoinedToItself`] for a marble or body joined to itself; [`Error::OutOfRange`], [`Error::NotPositive`] or
    /// [`Error::NotFinite`] for a number of its kind; [`Error::Full`] at 2³² − 1 joints.
    pub fn insert(&mut self, joint: Joint<S>) -> Result<JointId, Error> {
        let joint = joint.validated()?;
        let id = JointId(self.handles.push()?);
        self.states.push(JointState::new(joint));
        self.version = unique_version();
        Ok(id)
    }

    /// Changes a joint. An end in the world moves to its new frame within the next step; one that was of a
    /// marble before is there at once.
    ///
    /// # Errors
    /// [`Error::NoSuchJoint`], and those of [`Self::insert`].
    pub fn set(&mut self, id: JointId, joint: Joint<S>) -> Result<(), Error> {
        let row = self.row(id)?;
        let joint = joint.validated()?;
        let state = &mut self.states[row];
        let before = std::mem::replace(&mut state.joint, joint);
        for (at, frame) in state.frames_before.iter_mut().enumerate() {
            if !before.ends[at].is_world() || !joint.ends[at].is_world() {
                *frame = joint.ends[at].frame();
            }
        }
        let held = |joint: &Joint<S>| joint.ends.map(|end| (end.marble_id(), end.body_id()));
        let same_bodies =
            held(&before) == held(&joint) && before.collide_connected == joint.collide_connected;
        let same_rows = discriminant(&before.kind) == discriminant(&joint.kind)
            && rows::count(&before.kind) == rows::count(&joint.kind);
        if !same_bodies || !same_rows {
            let frames_before = state.frames_before;
            *state = JointState { frames_before, ..JointState::new(joint) };
            self.version = unique_version();
        }
        Ok(())
    }

    /// Takes a joint out.
    ///
    /// # Errors
    /// [`Error::NoSuchJoint`].
    pub fn remove(&mut self, id: JointId) -> Result<Joint<S>, Error> {
        let row = self.handles.swap_remove(id.0).ok_or(Error::NoSuchJoint(id))?;
        self.version = unique_version();
        Ok(self.states.swap_remove(row).joint)
    }

    /// Joint as it was set.
    ///
    /// # Errors
    /// [`Error::NoSuchJoint`].
    pub fn get(&self, id: JointId) -> Result<&Joint<S>, Error> {
        Ok(&self.states[self.row(id)?].joint)
    }

    /// Force between its ends in the last step, in N: the largest of the means over its substeps.
    ///
    /// # Errors
    /// [`Error::NoSuchJoint`].
    pub fn force(&self, id: JointId) -> Result<S, Error> {
        Ok(self.states[self.row(id)?].load[0])
    }

    /// Torque between its ends in the last step, in N m: the largest of the means over its substeps.
    ///
    /// # Errors
    /// [`Error::NoSuchJoint`].
    pub fn torque(&self, id: JointId) -> Result<S, Error> {
        Ok(self.states[self.row(id)?].load[1])
    }

    /// Position of its free axis at the end of the last step: the angle of a hinge or a wheel in rad, in (−π, π], or
    /// the way along a slider in metres, both as its limits count them. None of the other kinds, and before the first
    /// step.
    ///
    /// # Errors
    /// [`Error::NoSuchJoint`].
    pub fn position(&self, id: JointId) -> Result<Option<S>, Error> {
        Ok(self.states[self.row(id)?].position)
    }

    /// Handles of all joints.
    pub fn ids(&self) -> impl Iterator<Item = JointId> + '_ {
        (0..self.states.len()).filter_map(|row| self.handles.handle(row).map(JointId))
    }

    /// Joints that broke in the last step, which are taken out.
    #[must_use]
    pub fn broken(&self) -> &[JointId] {
        &self.broken
    }

    /// Number of joints.
    #[must_use]
    pub fn len(&self) -> usize {
        self.states.len()
    }

    /// Returns true if there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.states.is_empty()
    }

    fn row(&self, id: JointId) -> Result<usize, Error> {
        self.handles.row(id.0).ok_or(Error::NoSuchJoint(id))
    }

    /// Forgets which broke, and the loads of the last step.
    pub(crate) fn begin_step(&mut self) {
        self.broken.clear();
        for state in &mut self.states {
            state.load = [S::zero(); 2];
        }
    }

    /// Takes out joints of what is gone.
    pub(crate) fn remove_loose(&mut self, is_there: impl Fn(&JointEnd<S>) -> bool) {
        self.remove_where(|state| state.joint.ends.iter().any(|end| !is_there(end)));
    }

    /// Takes out joints whose load was too much, and remembers which.
    pub(crate) fn end_step(&mut self) {
        for state in &mut self.states {
            state.frames_before = state.joint.ends.map(|end| end.frame());
        }
        self.broken = self.remove_where(|JointState { joint, load: [force, torque], .. }| {
            *force > joint.breaking_force || *torque > joint.breaking_torque
        });
    }

    fn remove_where(&mut self, goes: impl Fn(&JointState<S>) -> bool) -> Vec<JointId> {
        let rows = (0..self.states.len()).filter(|row| goes(&self.states[*row]));
        let ids: Vec<_> = rows.filter_map(|row| self.handles.handle(row).map(JointId)).collect();
        for id in &ids {
            let _ = self.remove(*id); // it is there
        }
        ids
    }
}

/// A number that no other change has.
fn unique_version() -> Uncompared<u64> {
    static NEXT: AtomicU64 = AtomicU64::new(1);
    Uncompared(NEXT.fetch_add(1, Ordering::Relaxed))
}

impl<S: Scalar> JointState<S> {
    fn new(joint: Joint<S>) -> Self {
        Self {
            frames_before: joint.ends.map(|end| end.frame()),
            joint,
            impulses: [0.0; rows::MAX_ROWS],
            slip: 0.0,
            pull: 0.0,
            gain: 0.0,
            load: [S::zero(); 2],
            position: None,
        }
    }

    /// Kind in the numbers of the solver.
    pub(crate) fn kind(&self) -> JointKind<f64> {
        self.joint.kind.cast()
    }
}
