//! Kinetic energy that joints give and take: no more than their motors and springs do.

use cgmath::InnerSpace;

use super::body::{JointBody, JointRow};
use super::rows::RowRule;
use super::system::JointSystem;

/// Kinetic energy that joints may have made, over all of a group.
const MAX_GAIN: f64 = 0.02;

impl JointSystem {
    /// Does something to velocities, and counts the kinetic energy that it adds to each group beyond the work of
    /// motors, springs, and bodies that nothing moves.
    pub(super) fn count_gain(&mut self, action: impl FnOnce(&mut Self)) {
        let impulses = |row: &JointRow| row.impulse + row.relaxation;
        let energy: Vec<_> = self.bodies.iter().map(JointBody::energy).collect();
        let before: Vec<_> =
            self.rows.iter().map(|row| (impulses(row), row.speed(&self.bodies))).collect();
        action(self);
        for (at, (body, before)) in self.bodies.iter().zip(energy).enumerate() {
            self.joints[self.group_of_body[at]].gain += body.energy() - before;
        }
        for index in 0..self.joints.len() {
            let group = self.joints[index].group;
            for at in self.rows_of(index) {
                let row = &self.rows[at];
                let (impulse, speed) = before.get(at).copied().unwrap_or((0.0, 0.0));
                let impulse = impulses(row) - impulse;
                let mean = (speed + row.speed(&self.bodies)) * 0.5;
                let of_place = |end: usize| {
                    let body = &self.bodies[row.bodies[end] as usize];
                    let [linear, angular] = row.jacobian(end);
                    let drives = |inverse: f64, power: f64| if inverse > 0.0 { 0.0 } else { power };
                    drives(body.inverse_mass, linear.dot(body.velocity))
                        + drives(body.largest_moment(), angular.dot(body.spin))
                };
                let places = of_place(0) + of_place(1);
                let drives = match row.geometry.rule {
                    RowRule::Speed { .. } | RowRule::Spring { .. } => mean,
                    _ => 0.0,
                };
                self.joints[group].gain -= impulse * (drives - places);
            }
        }
    }

    /// Takes back kinetic energy that groups have gained: positions at the end of a substep are right to second
    /// order, and energy swings by a small part. More is what the substeps do not follow. All speeds of the group
    /// shrink alike, so that its joints still hold; a free one loses momentum with them.
    pub(super) fn limit_gain(&mut self) {
        let mut energy = vec![0.0; self.joints.len()];
        for (body, group) in self.bodies.iter().zip(&self.group_of_body) {
            energy[*group] += body.energy();
        }
        for (joint, energy) in self.joints.iter_mut().zip(&energy) {
            joint.gain = joint.gain.max(-energy * MAX_GAIN);
        }
        for (body, group) in self.bodies.iter_mut().zip(&self.group_of_body) {
            let (gain, energy) = (self.joints[*group].gain, energy[*group]);
            if gain > energy * MAX_GAIN && !body.is_place() {
                let scale = (1.0 - gain / energy).max(0.0).sqrt();
                body.velocity *= scale;
                body.spin *= scale;
            }
        }
        for (joint, energy) in self.joints.iter_mut().zip(&energy) {
            if joint.gain > energy * MAX_GAIN {
                joint.gain = 0.0;
            }
        }
    }
}
