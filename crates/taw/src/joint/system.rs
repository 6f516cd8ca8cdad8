//! System of all joints in a substep: rows, their matrix, and the impulses that satisfy them.

use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::TAU;

use cgmath::{InnerSpace, Zero};

use super::JointKind;
use super::body::{JointBody, JointOwner, JointRow};
use super::elimination::elimination_order;
use super::rows::{JointFrames, MAX_ROWS, RowRule, count};
use super::sparse_ldl::SparseLdl;
use crate::frame::Pose;
use crate::math::{Vec3, normalize_and_length};

/// Number of times that positions at the end of a substep are looked at: the error of each is the square of the
/// angle that the joint turns in it, times that of the one before.
const ITERATIONS: u32 = 3;
/// Number of times at most, while rows begin or cease to act.
pub(super) const MAX_ITERATIONS: u32 = 12;
/// Angle in rad by which a joint may turn in a substep, so that positions at its end count in full, and from
/// which on they do not: there the joint only follows its directions at the begin, which takes energy.
const RESOLVED: f64 = 0.5;
const UNRESOLVED: f64 = 1.0;
/// Number of times at most that a substep is solved anew, with more inertia; and the excess of what forces need
/// from which on it is.
const MAX_ATTEMPTS: u32 = 6;
const MAX_EXCESS: f64 = 1.5;
/// Largest change of speed in a substep, over the fastest of a group and one radius per substep.
const MAX_LEAP: f64 = 4.0;
/// Part of the force of the last substep that counts in this one.
const KEPT: f64 = 0.95;

/// Joint while it is solved.
#[derive(Clone, Debug)]
pub(crate) struct SystemJoint {
    pub kind: JointKind<f64>,
    /// Bodies, by index, and the frame of the joint in each.
    pub bodies: [u32; 2],
    pub frames: [Pose<f64>; 2],
    /// Impulses of its rows in the last substep.
    pub impulses: [f64; MAX_ROWS],
    /// See [`JointState`](super::JointState).
    pub slip: f64,
    pub load: [f64; 2],
    /// Impulse of its force in the last substep, in N s.
    pub pull: f64,
    /// Kinetic energy that its group has gained beyond the work of motors and springs, in J; counted at the
    /// first joint of each group.
    pub gain: f64,
    /// True at the first joint of a group of which velocities alone are solved in this substep.
    plain: bool,
    /// First joint of its group: of those that are connected by balls.
    pub(super) group: usize,
    /// Index of its first row.
    first: usize,
}

/// Joints and their bodies.
#[derive(Clone, Debug, Default)]
pub(crate) struct JointSystem {
    pub bodies: Vec<JointBody>,
    pub joints: Vec<SystemJoint>,
    pub(super) rows: Vec<JointRow>,
    /// Rows that act on one body, and the entry of the matrix for each pair.
    pairs: Vec<[u32; 2]>,
    values: Vec<f64>,
    pub(super) diagonal: Vec<f64>,
    matrix: SparseLdl,
    /// Entries of the rows that are equations, as they were factorized.
    known: (Vec<f64>, Vec<f64>),
    pub(super) residual: Vec<f64>,
    /// First joint of the group of each body.
    pub(super) group_of_body: Vec<usize>,
}

impl SystemJoint {
    pub fn new(kind: JointKind<f64>, bodies: [u32; 2], frames: [Pose<f64>; 2]) -> Self {
        let (impulses, load) = ([0.0; MAX_ROWS], [0.0; 2]);
        Self {
            kind,
            bodies,
            frames,
            impulses,
            slip: 0.0,
            load,
            pull: 0.0,
            gain: 0.0,
            plain: false,
            group: 0,
            first: 0,
        }
    }
}

impl JointSystem {
    /// Takes over which joints there are.
    pub fn set_structure(&mut self, bodies: Vec<JointBody>, joints: Vec<SystemJoint>) {
        (self.bodies, self.joints) = (bodies, joints);
        let mut first = 0;
        for joint in &mut self.joints {
            joint.first = first;
            first += count(&joint.kind);
        }
        self.rows.clear();
        let mut of_body: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        for (index, joint) in (0..).zip(&self.joints) {
            for body in joint.bodies.iter().filter(|body| self.moves(**body)) {
                of_body.entry(*body).or_default().push(index);
            }
        }
        let mut partners = vec![BTreeSet::new(); self.joints.len()];
        for joints in of_body.values() {
            for a in joints {
                partners[*a as usize].extend(joints.iter().filter(|b| *b != a));
            }
        }
        self.pairs.clear();
        for (a, partners) in partners.iter().enumerate() {
            let rows = self.rows_of(a);
            for row in rows.clone() {
                self.pairs.extend((row + 1..rows.end).map(|other| [row as u32, other as u32]));
                for b in partners.iter().map(|b| *b as usize).filter(|b| *b > a) {
                    self.pairs.extend(self.rows_of(b).map(|other| [row as u32, other as u32]));
                }
            }
        }
        self.find_groups(&partners);
        let order = elimination_order(partners);
        let order = order.into_iter().flat_map(|joint| self.rows_of(joint as usize));
        let order = order.map(|row| row as u32).collect();
        self.matrix.analyze(order, &self.pairs);
        self.known = (Vec::new(), Vec::new());
    }

    /// Finds the groups of joints that are connected.
    fn find_groups(&mut self, partners: &[BTreeSet<u32>]) {
        let mut known = vec![false; self.joints.len()];
        let mut next = Vec::new();
        for group in 0..self.joints.len() {
            next.push(group);
            while let Some(joint) = next.pop() {
                if !std::mem::replace(&mut known[joint], true) {
                    self.joints[joint].group = group;
                    next.extend(partners[joint].iter().map(|partner| *partner as usize));
                }
            }
        }
        self.group_of_body.clear();
        self.group_of_body.resize(self.bodies.len(), 0);
        for joint in &self.joints {
            for body in joint.bodies {
                self.group_of_body[body as usize] = joint.group;
            }
        }
    }

    pub fn is_empty(&self) -> bool {
        self.joints.is_empty()
    }

    fn moves(&self, body: u32) -> bool {
        !self.bodies[body as usize].is_place()
    }

    pub(super) fn rows_of(&self, joint: usize) -> std::ops::Range<usize> {
        let SystemJoint { kind, first, .. } = &self.joints[joint];
        *first..first + count(kind)
    }

    /// Position of the free axis of a joint, in rad or metres.
    pub fn position(&self, joint: usize) -> Option<f64> {
        let joint = &self.joints[joint];
        self.frames(joint, |body| body.pose).position(&joint.kind)
    }

    /// Frames of a joint, with bodies at these poses.
    pub(super) fn frames(
        &self,
        joint: &SystemJoint,
        pose: impl Fn(&JointBody) -> Pose<f64>,
    ) -> JointFrames {
        let poses = joint.bodies.map(|body| pose(&self.bodies[body as usize]));
        let frames = [poses[0] * joint.frames[0], poses[1] * joint.frames[1]];
        let arms = [0, 1].map(|end: usize| frames[end].translation - poses[end].translation);
        JointFrames { frames, arms }
    }

    /// Part of the curvature of a joint's motion in `h` seconds that counts.
    pub(super) fn resolved(&self, joint: &SystemJoint, h: f64) -> f64 {
        let [a, b] = joint.bodies.map(|body| &self.bodies[body as usize]);
        let JointFrames { frames, arms } = self.frames(joint, |body| body.pose);
        let turn = |body: &JointBody, arm: Vec3<f64>| {
            if arm.is_zero() { 0.0 } else { body.spin.magnitude() * h }
        };
        let mut turn = turn(a, arms[0]).max(turn(b, arms[1]));
        if let JointKind::Distance(..) | JointKind::Spring { .. } = joint.kind {
            let length = (frames[1].translation - frames[0].translation).magnitude();
            turn = turn.max((b.velocity - a.velocity).magnitude() * h / length);
        }
        ((UNRESOLVED - turn) / (UNRESOLVED - RESOLVED)).clamp(0.0, 1.0)
    }

    /// Begins a substep of `h` seconds: solves it from the impulses of the last one. Where forces turn out to be
    /// larger than those by which inertia was chosen, again.
    pub fn begin(&mut self, h: f64) {
        self.list_rows();
        for row in &mut self.rows {
            row.impulse = 0.0;
        }
        self.count_gain(|joints| joints.attempt(h));
    }

    /// Solves a substep, with as much inertia as it turns out to need. Groups that would leap are solved by
    /// velocities alone, which always has a solution that gains no energy.
    fn attempt(&mut self, h: f64) {
        let start: Vec<_> = self.bodies.iter().map(|body| (body.velocity, body.spin)).collect();
        for joint in &mut self.joints {
            joint.pull *= KEPT;
            joint.plain = false;
        }
        for _ in 0..MAX_ATTEMPTS {
            for (body, start) in self.bodies.iter_mut().zip(&start) {
                (body.velocity, body.spin) = *start;
            }
            self.stiffen(h);
            self.list_entries();
            self.warm_start();
            self.solve_positions(h);
            self.find_pulls();
            let needs = self.needed_inertia(h);
            let too_light = |(body, [mass, inertia]): (&JointBody, &[f64; 2])| {
                body.inverse.mass * mass > MAX_EXCESS
                    || body.inverse.largest_moment() * inertia > MAX_EXCESS
            };
            let leapt = self.find_leaps(&start, h);
            if !leapt && !self.bodies.iter().zip(&needs).any(too_light) {
                break;
            }
        }
    }

    /// Marks the groups of which a body got a speed that no motion of the group explains, nor the largest
    /// correction. Returns true if there are new ones.
    fn find_leaps(&mut self, start: &[(Vec3<f64>, Vec3<f64>)], h: f64) -> bool {
        let mut fastest = vec![0.0_f64; self.joints.len()];
        let arm = |body: &JointBody| if body.radius.is_finite() { body.radius } else { 0.0 };
        for ((body, (velocity, spin)), group) in
            self.bodies.iter().zip(start).zip(&self.group_of_body)
        {
            let speed = velocity.magnitude() + spin.magnitude() * arm(body);
            fastest[*group] = fastest[*group].max(speed);
        }
        let mut any = false;
        for ((body, (velocity, _)), group) in self.bodies.iter().zip(start).zip(&self.group_of_body)
        {
            let change = (body.velocity - velocity).magnitude();
            let most = MAX_LEAP * (fastest[*group] + arm(body) / h);
            if !body.is_place() && (change > most || change.is_nan()) {
                any |= !std::mem::replace(&mut self.joints[*group].plain, true);
            }
        }
        any
    }

    /// Applies the impulses of the last substep.
    fn warm_start(&mut self) {
        for joint in &self.joints {
            for (at, impulse) in joint.impulses.iter().enumerate().take(count(&joint.kind)) {
                let row = &mut self.rows[joint.first + at];
                row.impulse = *impulse;
                row.active = row.geometry.rule != RowRule::AtLeastZero || *impulse > 0.0;
                row.apply(*impulse, &mut self.bodies);
            }
        }
    }

    /// Finds the impulse of each joint's force in this substep, if it is larger than known. Between anchors that
    /// are apart, only what pulls them together counts.
    pub(super) fn find_pulls(&mut self) {
        for index in 0..self.joints.len() {
            let rows = &self.rows[self.rows_of(index)];
            let impulse = rows
                .iter()
                .fold(Vec3::zero(), |sum: Vec3<f64>, row| sum + row.geometry.linear * row.impulse);
            let joint = &self.joints[index];
            let pull = match joint.kind {
                JointKind::Distance(..) | JointKind::Spring { .. } => {
                    let [a, b] = self.frames(joint, |body| body.pose).frames;
                    -impulse.dot(normalized(b.translation - a.translation))
                }
                _ => impulse.magnitude(),
            };
            let joint = &mut self.joints[index];
            joint.pull = pull.max(joint.pull);
        }
    }

    /// Lists the rows where the bodies are.
    pub(super) fn list_rows(&mut self) {
        let mut rows = std::mem::take(&mut self.rows);
        let before = rows.clone();
        rows.clear();
        for joint in &self.joints {
            let bodies = joint.bodies;
            self.frames(joint, |body| body.pose).rows(&joint.kind, |geometry| {
                let (impulse, active) =
                    before.get(rows.len()).map_or((0.0, true), |row| (row.impulse, row.active));
                rows.push(JointRow { bodies, geometry, impulse, relaxation: 0.0, active });
            });
        }
        self.rows = rows;
    }

    /// Lists the entries of the matrix.
    pub(super) fn list_entries(&mut self) {
        let (rows, bodies) = (&self.rows, &self.bodies);
        self.diagonal.clear();
        self.diagonal.extend(rows.iter().map(|row| row.response(row, bodies)));
        self.values.clear();
        self.values.extend(
            self.pairs.iter().map(|[a, b]| rows[*a as usize].response(&rows[*b as usize], bodies)),
        );
        self.known.0.clear();
    }

    /// Finds impulses by which positions are right at the end of a substep of `h` seconds.
    pub fn solve(&mut self, h: f64) {
        self.count_gain(|joints| joints.solve_positions(h));
    }

    fn solve_positions(&mut self, h: f64) {
        for iteration in 0..MAX_ITERATIONS {
            self.find_position_residuals(h);
            let mut changed = false;
            for (row, residual) in self.rows.iter_mut().zip(&self.residual) {
                changed |= row.update_active(*residual, row.impulse, row.first_bounds(h));
            }
            if iteration >= ITERATIONS && !changed {
                return;
            }
            let compliance = |row: &JointRow| match row.geometry.rule {
                RowRule::Spring { spring, .. } => spring.step(h).kicks[0].compliance,
                _ => 0.0,
            };
            self.solve_linear(compliance);
            for (row, change) in self.rows.iter_mut().zip(&self.residual) {
                let [least, most] = row.first_bounds(h);
                let impulse = if row.active { row.impulse + change } else { row.impulse };
                let impulse = impulse.clamp(least, most);
                let change = impulse - row.impulse;
                if change.is_finite() {
                    row.impulse = impulse;
                    row.apply(change, &mut self.bodies);
                }
            }
        }
    }

    /// Speeds by which each row misses its target in a substep of `h` seconds.
    fn find_position_residuals(&mut self, h: f64) {
        let mut residual = std::mem::take(&mut self.residual);
        residual.clear();
        for joint in &self.joints {
            let is_plain = self.joints[joint.group].plain;
            let resolved = if is_plain { 0.0 } else { self.resolved(joint, h) };
            let frames = self.frames(joint, |body| body.pose_after(h));
            frames.rows(&joint.kind, |after| {
                let row = &self.rows[residual.len()];
                residual.push(match row.geometry.rule {
                    RowRule::Zero | RowRule::AtLeastZero => {
                        let linear = row.change(&self.bodies, |body| body.motion(h));
                        let mut curved = after.error - row.geometry.error - linear;
                        if after.is_angle() {
                            curved -= (curved / TAU).round() * TAU;
                        }
                        (row.correction(&self.bodies, is_plain) + linear + curved * resolved) / h
                    }
                    RowRule::Speed { target, .. } => row.speed(&self.bodies) - target,
                    RowRule::Gear => row.speed(&self.bodies) + joint.slip / h,
                    RowRule::Spring { spring, .. } => {
                        let step = spring.step(h).kicks[0];
                        let inverse_mass = self.diagonal[residual.len()];
                        row.speed(&self.bodies)
                            + step.compliance * inverse_mass * row.impulse
                            + step.bias * row.geometry.error
                    }
                });
            });
        }
        self.residual = residual;
    }

    /// Makes of the residuals the changes of impulse that remove them; `compliance` is that of a row, over its
    /// inverse effective mass.
    pub(super) fn solve_linear(&mut self, compliance: impl Fn(&JointRow) -> f64) {
        let active = |row: u32| self.rows[row as usize].active;
        let rows = self.rows.iter().zip(&self.diagonal);
        let diagonal = rows.map(|(row, entry)| {
            if row.active && *entry > 0.0 { entry * (1.0 + compliance(row)) } else { 1.0 }
        });
        let pairs = self.pairs.iter().zip(&self.values);
        let values =
            pairs.map(|([a, b], value)| if active(*a) && active(*b) { *value } else { 0.0 });
        let now = (diagonal.collect(), values.collect());
        if self.known != now {
            self.known = now;
            self.matrix.factorize(&self.known.0, &self.known.1);
        }
        for (residual, row) in self.residual.iter_mut().zip(&self.rows) {
            *residual = if row.active { -*residual } else { 0.0 };
        }
        self.matrix.solve(&mut self.residual);
    }

    /// Moves on by `h` seconds; rigid bodies and centers of balls are moved by others.
    pub fn advance(&mut self, h: f64) {
        for joint in &mut self.joints {
            if let JointKind::Gear { .. } = joint.kind {
                joint.slip += self.rows[joint.first].speed(&self.bodies) * h;
            }
        }
        for body in &mut self.bodies {
            let after = body.pose_after(h);
            match body.owner {
                JointOwner::Place => body.pose = after,
                JointOwner::Ball(_) => body.pose.rotation = after.rotation,
                JointOwner::Rigid(_) => {}
            }
        }
    }

    /// Stores impulses for the next substep, and the loads of this one.
    pub(super) fn store(&mut self, h: f64) {
        for index in 0..self.joints.len() {
            let range = self.rows_of(index);
            let arm = self.frames(&self.joints[index], |body| body.pose).arms[1];
            let joint = &mut self.joints[index];
            let (mut force, mut torque) = (Vec3::zero(), Vec3::zero());
            for (row, stored) in self.rows[range].iter().zip(&mut joint.impulses) {
                *stored = row.impulse;
                let total = row.impulse + row.relaxation;
                let [linear, angular] = row.jacobian(1);
                force += linear * total;
                torque += (angular - arm.cross(linear)) * total;
            }
            let [most_force, most_torque] = joint.load;
            joint.load =
                [most_force.max(force.magnitude() / h), most_torque.max(torque.magnitude() / h)];
        }
    }
}

/// Direction of a vector; zero for none.
fn normalized(vector: Vec3<f64>) -> Vec3<f64> {
    normalize_and_length(vector).map_or_else(Vec3::zero, |(direction, _)| direction)
}
