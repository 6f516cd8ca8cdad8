//! Inertia that the forces of joints need of light bodies.

use cgmath::{InnerSpace, Zero};

use super::JointKind;
use super::rows::JointFrames;
use super::system::{JointSystem, SystemJoint};
use crate::math::Vec3;

/// Part of the relative turn of two balls that a substep damps at most.
const BENDING: f64 = 0.25;

impl JointSystem {
    /// Gives bodies the inertia that their joints' forces need.
    pub(super) fn stiffen(&mut self, h: f64) {
        let needs = self.needed_inertia(h);
        for (body, needs) in self.bodies.iter_mut().zip(needs) {
            body.set_inertia(needs);
        }
    }

    /// Mass and moment of inertia that forces need of each body: what a force stretches swings like a string, and
    /// a light body on it faster than substeps of `h` seconds can follow, so that it would gain energy. With
    /// that much it is stable (geometric stiffness: Andrews, Teichmann and Kry, 2017).
    pub(super) fn needed_inertia(&self, h: f64) -> Vec<[f64; 2]> {
        let mut needs = vec![[0.0; 2]; self.bodies.len()];
        for joint in &self.joints {
            let JointFrames { frames, arms } = self.frames(joint, |body| body.pose);
            let length = (frames[1].translation - frames[0].translation).magnitude();
            for end in 0..2 {
                let [mass, inertia] = &mut needs[joint.bodies[end] as usize];
                *inertia += 2.0 * h * joint.pull * arms[end].magnitude();
                if let JointKind::Distance(..) | JointKind::Spring { .. } = joint.kind
                    && length > 0.0
                {
                    *mass += h * joint.pull / length;
                }
            }
        }
        needs
    }

    /// Damps how fast balls turn against each other about axes that a joint leaves free, where substeps of `h`
    /// seconds do not follow that: of balls that got inertia, and of joints that turn too far in a substep.
    pub(super) fn damp_bending(&mut self, h: f64) {
        let bends = |joint: &&SystemJoint| match joint.kind {
            JointKind::Gear { .. } => false,
            JointKind::Distance(..) | JointKind::Spring { .. } => joint.pull > 0.0,
            _ => true,
        };
        for joint in self.joints.iter().filter(bends) {
            let pair = joint.bodies.map(|body| self.bodies[body as usize]);
            let excess = pair.map(|body| body.excess_inertia());
            let excess = excess[0].max(excess[1]).max(1.0 - self.resolved(joint, h));
            if pair.iter().any(|body| body.largest_moment() <= 0.0) || excess <= 0.0 {
                continue;
            }
            let mut turn = pair[1].spin - pair[0].spin;
            if let JointKind::Hinge(_) | JointKind::Wheel { .. } = joint.kind {
                let axis = self.frames(joint, |body| body.pose).frames[0].rotation * Vec3::unit_z();
                turn -= axis * axis.dot(turn);
            }
            let give = pair[0].inverse.largest_moment() + pair[1].inverse.largest_moment();
            let impulse = turn * (BENDING * excess / give);
            self.bodies[joint.bodies[0] as usize].apply(Vec3::zero(), impulse);
            self.bodies[joint.bodies[1] as usize].apply(Vec3::zero(), -impulse);
        }
    }
}
