//! Joints of bodies, within a substep: before contacts and after them, so that both hold.

use cgmath::Zero;

use crate::body::{BodySystem, SolverBody};
use crate::joint::{JointBody, JointOwner, JointSystem};
use crate::math::{Scalar, Vec3, cast_vector};
use crate::swarm::Swarm;
use crate::swarm::kernels::{Pass, SolverParams};
use crate::swarm::wall_contact::{set, xyz};

impl<S: Scalar> Swarm<S> {
    /// Sets the joints of the next step, between bodies by their slots.
    pub(crate) fn set_joints(&mut self, joints: JointSystem) {
        self.scratch.joints = joints;
    }

    /// Takes the joints back after the step.
    pub(crate) fn take_joints(&mut self) -> JointSystem {
        std::mem::take(&mut self.scratch.joints)
    }

    /// Returns true if there are joints.
    fn has_joints(&self) -> bool {
        !self.scratch.joints.is_empty()
    }

    /// Solves contacts and joints: joints before contacts, which then know what these bear, and after them.
    /// `share` is the length of a substep over the number of substeps in a step.
    pub(super) fn solve_contacts_and_joints(&mut self, params: &SolverParams<S>, share: S) {
        let h = params.time.as_f64();
        self.begin_bodies(params);
        self.pass(Pass::WarmStart(*params), |_, _| true);
        self.with_bodies(BodySystem::warm_start);
        if self.has_joints() {
            self.find_falls(params.time, share);
            self.with_joints(|joints| joints.begin(h));
        }
        self.with_bodies(BodySystem::solve);
        self.pass(Pass::Solve(*params), |_, _| true);
        self.solve_unconverged(params);
        if self.has_joints() {
            self.find_falls(params.time, share); // contacts may bear some now
        }
        self.with_joints(|joints| joints.solve(h));
    }

    /// Makes velocities at the end of a substep those that contacts and joints allow.
    pub(super) fn relax_contacts_and_joints(&mut self, params: SolverParams<S>) {
        let h = params.time.as_f64();
        self.with_bodies(|bodies| bodies.advance(h));
        self.with_joints(|joints| {
            joints.advance(h);
            joints.begin_relaxation(h);
        });
        self.with_bodies(BodySystem::relax);
        self.relax_recorded(params);
        self.with_joints(|joints| joints.finish_relaxation(h));
    }

    /// Finds how far bodies move in a substep of `h` seconds besides by their velocities, as positions are
    /// integrated.
    fn find_falls(&mut self, h: S, share: S) {
        let gravity = self.gravity.unwrap_or_else(Vec3::zero);
        let half = S::from_f64(-0.5);
        let mut joints = std::mem::take(&mut self.scratch.joints);
        let borne = self.scratch.bodies.borne();
        for body in &mut joints.bodies {
            body.fall = Vec3::zero();
            let slot = match body.owner {
                JointOwner::Place => continue,
                JointOwner::Ball(slot) => slot,
                JointOwner::Rigid(index) => {
                    let index = index as usize;
                    body.fall = self.scratch.bodies.bodies[index].fall(h.as_f64(), borne[index]);
                    continue;
                }
            };
            let row = self.ids.rows()[slot as usize] as usize;
            if self.spin[row][3] == S::zero() {
                body.fall += cast_vector(gravity * (half * h * h));
                let own = self.velocity_changes.binary_search_by_key(&slot, |change| change.slot);
                if let Ok(own) = own {
                    let change = Vec3::from(self.velocity_changes[own].change);
                    body.fall += cast_vector(change * (half * share));
                }
                body.fall = body.locked_axes.free_translation(body.fall);
            }
        }
        self.scratch.joints = joints;
    }

    /// Reads places and velocities of the bodies, does something with the joints, and writes velocities back.
    fn with_joints(&mut self, action: impl FnOnce(&mut JointSystem)) {
        if !self.has_joints() {
            return;
        }
        let mut joints = std::mem::take(&mut self.scratch.joints);
        let rows = self.ids.rows();
        let rigid = &mut self.scratch.bodies.bodies;
        for body in &mut joints.bodies {
            let slot = match body.owner {
                JointOwner::Place => continue,
                JointOwner::Ball(slot) => slot,
                JointOwner::Rigid(index) => {
                    let SolverBody { pose, velocity, spin, .. } = rigid[index as usize];
                    (body.pose, body.velocity, body.spin) = (pose, velocity, spin);
                    continue;
                }
            };
            let row = rows[slot as usize] as usize;
            let at = self.at[row];
            body.pose.translation = cast_vector(xyz(&at));
            body.velocity = cast_vector(xyz(&self.velocity[row]));
            // In f64, so that a spin that nobody changes keeps its bits.
            body.spin = cast_vector::<S, f64>(xyz(&self.spin[row])) / at[3].as_f64();
        }
        action(&mut joints);
        for body in &joints.bodies {
            let JointBody { velocity, spin, inverse_mass, .. } = body;
            let slot = match body.owner {
                JointOwner::Place => continue,
                JointOwner::Ball(slot) => slot,
                JointOwner::Rigid(index) => {
                    rigid[index as usize].set_velocities(*velocity, *spin);
                    continue;
                }
            };
            let row = rows[slot as usize] as usize;
            let radius = self.at[row][3].as_f64();
            if *inverse_mass > 0.0 {
                set(&mut self.velocity[row], cast_vector(*velocity));
            }
            if body.largest_moment() > 0.0 {
                set(&mut self.spin[row], cast_vector(*spin * radius));
            }
        }
        self.scratch.joints = joints;
        self.hold_rows(); // to the bit
    }
}
