//! Joints of a world: between marbles as rows, rigid bodies and places, within the third verb of
//! [`SoftStep`](crate::response::Response::SoftStep).

use std::collections::{BTreeMap, BTreeSet};

use cgmath::{EuclideanSpace, Zero};

use super::soft_step::inverse_mass;
use super::{ColliderId, MarbleId, World};
use crate::Error;
use crate::frame::Pose;
use crate::handle::BodyId;
use crate::joint::{JointBody, JointEnd, JointOwner, JointSystem, Joints, SystemJoint};
use crate::math::{Scalar, Vec3, cast_rotation, cast_vector, normalize_and_length};
use crate::motion::{BALL_INVERSE_INERTIA, Rotation};

/// Bodies of the joints, while the joints and what they join stay the same.
#[derive(Clone, Debug, Default)]
pub(super) struct JointedBodies {
    /// Versions of the joints and of the rows of the marbles.
    known: Option<[u64; 2]>,
    bodies: Vec<Jointed>,
    /// True for each marble with a joint, by row; empty if there are none.
    pub is_jointed: Vec<bool>,
    /// Rigid bodies with a joint, in order.
    pub rigid: Vec<BodyId>,
    system: JointSystem,
}

/// Body of a joint.
#[derive(Clone, Copy, Debug)]
enum Jointed {
    Marble(MarbleId),
    Rigid(BodyId),
    /// End in the world of a joint, by index.
    Place {
        joint: usize,
        end: usize,
    },
}

impl<S: Scalar> World<S> {
    /// Refuses joints where the response has no method for them.
    pub(super) fn check_joints(&self) -> Result<(), Error> {
        if self.joints.is_empty() || self.settings.model.response.knows_bodies() {
            return Ok(());
        }
        Err(Error::Unsupported { response: "a response other than SoftStep", feature: "joints" })
    }

    /// Finds what joints hold, if that changed: those marbles do not sleep.
    pub(super) fn find_jointed(&mut self) {
        let removals = self.marbles.removals() + self.bodies.removals();
        if self.scratch.soft_step.jointed.known == Some([*self.joints.version, removals]) {
            return;
        }
        self.joints.remove_loose(|end| match end {
            JointEnd::Marble { marble, .. } => self.marbles.row(*marble).is_ok(),
            JointEnd::Body { body, .. } => self.bodies.row(*body).is_ok(),
            JointEnd::World { .. } => true,
        });
        let jointed = &mut self.scratch.soft_step.jointed;
        let had_none = jointed.is_jointed.is_empty();
        let known = Some([*self.joints.version, removals]);
        *jointed = JointedBodies { known, ..JointedBodies::default() };
        if !(self.joints.is_empty() && had_none) {
            self.marbles.changed.add_all();
        }
        if self.joints.is_empty() {
            return;
        }
        let (mut of_marble, mut of_body) = (BTreeMap::new(), BTreeMap::new());
        let mut joints = Vec::with_capacity(self.joints.len());
        for (joint, state) in self.joints.states.iter().enumerate() {
            let mut bodies = [0; 2];
            for (end, body) in bodies.iter_mut().enumerate() {
                let next = jointed.bodies.len() as u32;
                *body = match state.joint.ends[end] {
                    JointEnd::Marble { marble, .. } => *of_marble.entry(marble).or_insert(next),
                    JointEnd::Body { body, .. } => *of_body.entry(body).or_insert(next),
                    JointEnd::World { .. } => next,
                };
                if *body == next {
                    jointed.bodies.push(match state.joint.ends[end] {
                        JointEnd::Marble { marble, .. } => Jointed::Marble(marble),
                        JointEnd::Body { body, .. } => Jointed::Rigid(body),
                        JointEnd::World { .. } => Jointed::Place { joint, end },
                    });
                }
            }
            joints.push(SystemJoint::new(state.kind(), bodies, [Pose::identity(); 2]));
        }
        jointed.is_jointed = vec![false; self.marbles.len()];
        for row in of_marble.keys().filter_map(|id| self.marbles.row(*id).ok()) {
            jointed.is_jointed[row] = true;
        }
        jointed.rigid = of_body.into_keys().collect();
        let place = |body: &Jointed| {
            let place = JointBody::place(Pose::identity());
            let owner = match body {
                Jointed::Marble(_) => JointOwner::Ball(0),
                Jointed::Rigid(_) => JointOwner::Rigid(0),
                Jointed::Place { .. } => JointOwner::Place,
            };
            JointBody { owner, ..place }
        };
        let bodies = jointed.bodies.iter().map(place).collect();
        jointed.system.set_structure(bodies, joints);
    }

    /// Gives the joints to the solver for a step of `dt` seconds.
    pub(super) fn give_joints(&mut self, dt: S) {
        self.find_jointed();
        if self.joints.is_empty() {
            return;
        }
        let mut system = std::mem::take(&mut self.scratch.soft_step.jointed.system);
        for (body, is) in system.bodies.iter_mut().zip(&self.scratch.soft_step.jointed.bodies) {
            match *is {
                Jointed::Marble(id) => self.read_jointed(id, body),
                Jointed::Rigid(id) => self.read_jointed_body(id, body),
                Jointed::Place { joint, end } => {
                    let state = &self.joints.states[joint];
                    *body = moving_place(
                        cast_pose(state.frames_before[end]),
                        cast_pose(state.joint.ends[end].frame()),
                        dt.as_f64(),
                    );
                }
            }
        }
        for (joint, state) in system.joints.iter_mut().zip(&self.joints.states) {
            (joint.kind, joint.impulses, joint.slip) = (state.kind(), state.impulses, state.slip);
            joint.load = state.load.map(S::as_f64);
            (joint.pull, joint.gain) = (state.pull, state.gain);
            joint.frames = state.joint.ends.map(|end| match end {
                JointEnd::Marble { frame, .. } => cast_pose(frame),
                JointEnd::Body { body, frame } => match self.bodies.row(body) {
                    Ok(row) => self.bodies.states[row].principal.inverse() * cast_pose(frame),
                    Err(_) => Pose::identity(), // those were taken out
                },
                JointEnd::World { .. } => Pose::identity(),
            });
        }
        self.swarm.set_joints(system);
    }

    /// Reads a marble that a joint holds.
    fn read_jointed(&self, id: MarbleId, body: &mut JointBody) {
        let Ok(row) = self.marbles.row(id) else {
            *body = JointBody::place(Pose::identity()); // those were taken out
            return;
        };
        let marbles = &self.marbles;
        let mass = marbles.mass(row);
        body.owner = JointOwner::Ball(self.scratch.soft_step.slot_of_marble[row]);
        body.inverse_mass = if mass.is_infinite() { 0.0 } else { inverse_mass(mass).as_f64() };
        body.locked_axes = marbles.locked_axes_of_row(row);
        let turns = marbles.rotation_of(row, self.settings.model.rotation) == Rotation::Dynamic;
        let radius = marbles.radius[row].as_f64();
        body.radius = radius;
        let inverse =
            if turns { body.inverse_mass * BALL_INVERSE_INERTIA / (radius * radius) } else { 0.0 };
        body.inverse_moments = Vec3::new(inverse, inverse, inverse);
        let rotation = marbles.rotation.get(row).copied();
        body.pose.rotation = rotation.map_or_else(|| Pose::identity().rotation, cast_rotation);
        body.pose.translation = cast_vector(marbles.position[row].to_vec());
    }

    /// Reads a rigid body that a joint holds.
    fn read_jointed_body(&self, id: BodyId, body: &mut JointBody) {
        let Ok(row) = self.bodies.row(id) else {
            *body = JointBody::place(Pose::identity()); // those were taken out
            return;
        };
        let state = &self.bodies.states[row];
        body.owner = JointOwner::Rigid(row as u32);
        body.inverse_mass = state.solver.inverse_mass;
        body.inverse_moments =
            state.solver.moments.map(|moment| if moment > 0.0 { 1.0 / moment } else { 0.0 });
        body.radius = state.reach;
        body.pose = state.solver.pose;
    }

    /// Takes the joints back from the solver: impulses, loads, and rotations of marbles.
    pub(super) fn take_joints(&mut self) {
        if self.joints.is_empty() {
            return;
        }
        let system = self.swarm.take_joints();
        for (at, (joint, state)) in system.joints.iter().zip(&mut self.joints.states).enumerate() {
            state.position = system.position(at).map(S::from_f64);
            (state.impulses, state.slip) = (joint.impulses, joint.slip);
            (state.pull, state.gain) = (joint.pull, joint.gain);
            state.load = joint.load.map(S::from_f64);
            state.frames_before = state.joint.ends.map(|end| end.frame());
        }
        for (body, is) in system.bodies.iter().zip(&self.scratch.soft_step.jointed.bodies) {
            if let Jointed::Marble(id) = is
                && body.largest_moment() > 0.0
                && let Ok(row) = self.marbles.row(*id)
                && let Some(rotation) = self.marbles.rotation.get_mut(row)
            {
                *rotation = cast_rotation(body.pose.rotation);
            }
        }
        self.scratch.soft_step.jointed.system = system;
    }
}

impl<S: Scalar> Joints<S> {
    /// Pairs of marbles that joints keep from colliding with each other.
    pub(super) fn ignored_pairs(&self) -> impl Iterator<Item = [MarbleId; 2]> + '_ {
        self.states.iter().filter(|state| !state.joint.collide_connected).filter_map(|state| {
            let [a, b] = state.joint.ends.map(|end| end.marble_id());
            Some([a?, b?])
        })
    }

    /// Pairs of a rigid body and what joints keep from colliding with it.
    pub(super) fn ignored_bodies(&self) -> BTreeSet<[JointHeld; 2]> {
        let held = |end: &JointEnd<S>| match *end {
            JointEnd::Marble { marble, .. } => Some(JointHeld::Marble(marble)),
            JointEnd::Body { body, .. } => Some(JointHeld::Body(body)),
            JointEnd::World { .. } => None,
        };
        let apart = self.states.iter().filter(|state| !state.joint.collide_connected);
        let pairs = apart.filter_map(|state| {
            let [a, b] = state.joint.ends.each_ref().map(held);
            let (a, b) = (a?, b?);
            Some([a.min(b), a.max(b)])
        });
        pairs.collect()
    }

    /// Returns true if a joint keeps a marble from colliding with something.
    pub(super) fn ignores(&self, marble: MarbleId, other: ColliderId) -> bool {
        match other {
            ColliderId::Marble(other) => {
                self.ignored_pairs().any(|pair| pair == [marble, other] || pair == [other, marble])
            }
            ColliderId::Body(body) => {
                let pair = [JointHeld::Marble(marble), JointHeld::Body(body)];
                self.ignored_bodies().contains(&pair)
            }
            ColliderId::Wall(_) => false,
        }
    }
}

/// Marble or body that a joint holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum JointHeld {
    Marble(MarbleId),
    Body(BodyId),
}

/// Place in the world that moves from one frame to another one in `dt` seconds.
fn moving_place(from: Pose<f64>, to: Pose<f64>, dt: f64) -> JointBody {
    let turn = to.rotation * from.rotation.conjugate();
    let turn = if turn.s < 0.0 { -turn } else { turn };
    let spin = normalize_and_length(turn.v)
        .map_or_else(Vec3::zero, |(axis, sine)| axis * (2.0 * sine.atan2_portable(turn.s) / dt));
    let velocity = (to.translation - from.translation) / dt;
    JointBody { velocity, spin, ..JointBody::place(from) }
}

fn cast_pose<S: Scalar>(pose: Pose<S>) -> Pose<f64> {
    Pose { rotation: cast_rotation(pose.rotation), translation: cast_vector(pose.translation) }
}
