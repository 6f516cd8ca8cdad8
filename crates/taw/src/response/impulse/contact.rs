//! Contact kinematics: separation, relative velocity and effective mass of two bodies, and impulses
//! applied to both.

use cgmath::{InnerSpace, Zero};

use super::{BodyA, Colliders, Constraint, Context, RollingConstraint};
use crate::constraint::tipped;
use crate::contact::{Contact, ContactMaterial, Contacts};
use crate::math::{Point3, Scalar, Vec3, cast_vector, is_finite, normal_and_distance};
use crate::response::bodies::relative_velocity;
use crate::response::{BallRotation, InverseEffectiveMass, SolverBodies};

impl<S: Scalar> SolverBodies<'_, S> {
    /// Normal of a contact, from first to second, and separation of the surfaces, in metres
    /// (negative: penetration). Coincident centers get an arbitrary direction, different for each
    /// pair. None where the column of positions is empty, or for a separation that is not finite.
    pub(in crate::response) fn normal_and_separation(
        &self,
        position: &[Point3<S>],
        a: BodyA,
        b: usize,
        axis_offset: [S; 2],
        walls: &impl Colliders<S>,
    ) -> Option<(Vec3<S>, S)> {
        let second = *position.get(b)? + self.anchor(b, axis_offset[1]);
        let (normal, distance) = match a {
            BodyA::Wall(wall, part) => walls.normal_and_distance(wall as usize, part, second),
            BodyA::Marble(first) => {
                let a = first as usize;
                let center_offset = second - (*position.get(a)? + self.anchor(a, axis_offset[0]));
                let center_offset = self.period.minimum_image(center_offset);
                let (normal, distance) = normal_and_distance(center_offset, [first, b as u32]);
                (normal, distance - self.radius[a])
            }
        };
        let separation = distance - self.radius[b];
        separation.is_finite().then_some((normal, separation))
    }

    /// Normal by which two balls meet that overlap, or that continuous detection stopped: it
    /// [leans](tipped) where one falls exactly onto the top of the other.
    pub(in crate::response) fn impact_normal<W, F>(
        &self,
        a: BodyA,
        b: usize,
        (normal, separation): (Vec3<S>, S),
        context: &Context<S, W, F>,
    ) -> Vec3<S>
    where
        W: Colliders<S>,
        F: Fn(usize) -> S,
    {
        let BodyA::Marble(first) = a else { return normal };
        let a = first as usize;
        let meets =
            separation < S::zero() || context.is_ccd_stopped(a) || context.is_ccd_stopped(b);
        let approach_speed = (self.velocity[a] - self.velocity[b]).dot(normal);
        let is_impact = meets && approach_speed > context.settings.restitution_threshold;
        if !is_impact || [a, b].iter().any(|row| self.capsule(*row).is_some()) {
            return normal;
        }
        tipped(normal, context.settings.gravity, [first, b as u32])
    }

    /// Places contacts where the bodies are.
    pub(in crate::response) fn place_contacts(
        &self,
        contacts: &mut Contacts<S>,
        walls: &impl Colliders<S>,
    ) {
        let place = |a: BodyA, contact: &mut Contact<S>| {
            let (b, along) = (contact.b as usize, contact.along);
            let place = self.normal_and_separation(self.position, a, b, along, walls);
            (contact.normal, contact.separation) = place.unwrap_or((Vec3::zero(), S::infinity()));
            contact.arms = self.arms(a, b, along, contact.normal);
        };
        contacts.wm.iter_mut().for_each(|c| place(BodyA::Wall(c.a, c.part), c));
        contacts.mm.iter_mut().for_each(|c| place(BodyA::Marble(c.a), c));
    }

    /// Lever arms of a contact with this normal, in metres.
    pub(in crate::response) fn arms(
        &self,
        a: BodyA,
        b: usize,
        axis_offset: [S; 2],
        normal: Vec3<S>,
    ) -> [Vec3<S>; 2] {
        let first = a
            .marble()
            .map_or_else(Vec3::zero, |a| self.anchor(a, axis_offset[0]) + normal * self.radius[a]);
        [first, self.anchor(b, axis_offset[1]) - normal * self.radius[b]]
    }

    /// Velocity of the wall's surface at a contact, in m/s; zero between marbles.
    pub(in crate::response) fn surface_velocity(
        &self,
        a: BodyA,
        b: usize,
        (arms, normal): ([Vec3<S>; 2], Vec3<S>),
        walls: &impl Colliders<S>,
    ) -> Vec3<S> {
        match a {
            BodyA::Wall(wall, _) => {
                walls.surface_velocity(wall as usize, self.position[b] + arms[1], normal)
            }
            BodyA::Marble(_) => Vec3::zero(),
        }
    }

    /// Inverse effective mass of a contact, over both bodies.
    pub(super) fn pair_inverse_effective_mass(
        &self,
        a: BodyA,
        b: usize,
        arms: [Vec3<S>; 2],
        normal: Vec3<S>,
    ) -> InverseEffectiveMass<S> {
        if self.capsules.is_empty() && self.locked_axes.is_empty() {
            let first = a.marble().map_or((S::zero(), BallRotation::Locked), |a| {
                (self.inverse_mass[a], self.ball_rotation(a))
            });
            return InverseEffectiveMass::of([
                first,
                (self.inverse_mass[b], self.ball_rotation(b)),
            ]);
        }
        let second = self.inverse_effective_mass(b, arms[1], normal);
        a.marble().map_or(second, |a| second.plus(self.inverse_effective_mass(a, arms[0], -normal)))
    }

    /// Relative velocity at a contact: that of the second's contact point minus the first's, in
    /// m/s.
    pub(in crate::response) fn relative_velocity(
        &self,
        a: BodyA,
        b: usize,
        arms: [Vec3<S>; 2],
        normal: Vec3<S>,
        surface_velocity: Vec3<S>,
    ) -> Vec3<S> {
        let motion = |row: usize| self.motion(row);
        let is_capsule = |row: usize| self.capsule(row).is_some();
        let bodies = (a.marble(), b);
        relative_velocity(motion, is_capsule, bodies, &arms, normal, surface_velocity)
    }

    /// Relative velocity of the contact points, in m/s, and relative spin, in rad/s.
    pub(super) fn relative_motion(&self, c: &Constraint<S>) -> [Vec3<f64>; 2] {
        let first = c.a.marble().map_or_else(Vec3::zero, |a| self.unlocked_spin(a));
        let relative_velocity =
            self.relative_velocity(c.a, c.b, c.arms, c.normal, c.surface_velocity);
        [cast_vector(relative_velocity), cast_vector(self.unlocked_spin(c.b) - first)]
    }

    /// Velocity of a body of infinite mass; none for a movable one.
    pub(in crate::response) fn fixed_velocity(&self, row: usize) -> Option<Vec3<f64>> {
        let is_fixed = self.inverse_mass[row] == S::zero();
        is_fixed.then(|| cast_vector(self.velocity[row]))
    }

    /// Rolling and torsional friction of a contact; none for coefficients of zero.
    pub(super) fn rolling_constraint(
        &self,
        a: BodyA,
        b: usize,
        inverse_effective_mass: InverseEffectiveMass<S>,
        material: ContactMaterial<S>,
    ) -> Option<RollingConstraint<S>> {
        let ContactMaterial { rolling_resistance, spinning_resistance, .. } = material;
        let is_zero = rolling_resistance == S::zero() && spinning_resistance == S::zero();
        let first = a.marble();
        let inverse_inertias =
            [first.map_or_else(S::zero, |a| self.inverse_inertia(a)), self.inverse_inertia(b)];
        let inverse_inertia = inverse_inertias[0] + inverse_inertias[1];
        if is_zero || inverse_inertia <= S::zero() {
            return None;
        }
        let radii = [first.map_or_else(S::zero, |a| self.radius[a]), self.radius[b]];
        let radius =
            if first.is_some() { radii[0] * radii[1] / (radii[0] + radii[1]) } else { radii[1] };
        // The points of capsules are not at a radius from the center.
        let is_round = self.capsule(b).is_none() && first.is_none_or(|a| self.capsule(a).is_none());
        let coupling = if is_round {
            (radii[0] * inverse_inertias[0] - radii[1] * inverse_inertias[1]) / inverse_inertia
        } else {
            S::zero()
        };
        let blocked = inverse_effective_mass.tangent - coupling * coupling * inverse_inertia;
        Some(RollingConstraint {
            rolling_lever: rolling_resistance * radius,
            torsional_lever: spinning_resistance * radius,
            inverse_inertia,
            coupling,
            blocked_ratio: inverse_effective_mass.normal / blocked,
            angular_impulse: Vec3::zero(),
        })
    }

    /// Zeroes velocities that are infinite or NaN, and lists their rows.
    pub(super) fn quarantine_non_finite(
        &mut self,
        constraints: &[Constraint<S>],
        quarantined: &mut Vec<u32>,
    ) {
        for row in constraints.iter().flat_map(|c| [Some(c.b), c.a.marble()]).flatten() {
            if !is_finite(self.velocity[row]) {
                self.velocity[row] = Vec3::zero();
                quarantined.push(row as u32);
            }
        }
    }

    /// Applies an angular impulse to the second body, its opposite to the first.
    pub(super) fn apply_angular_impulse_pair(
        &mut self,
        c: &Constraint<S>,
        angular_impulse: Vec3<S>,
    ) {
        self.apply_angular_impulse(c.b, angular_impulse);
        if let Some(a) = c.a.marble() {
            self.apply_angular_impulse(a, -angular_impulse);
        }
    }

    /// Applies an impulse to the second body, its opposite to the first; `impulse_speed` is the
    /// impulse times the normal inverse effective mass.
    pub(super) fn apply_impulse_pair(&mut self, c: &Constraint<S>, impulse_speed: Vec3<S>) {
        // The impulse of a pebble may be too small for the scalar.
        let fraction = |row: usize| self.inverse_mass[row] / c.inverse_effective_mass.normal;
        let second = impulse_speed * fraction(c.b);
        if let Some(a) = c.a.marble() {
            let first = -impulse_speed * fraction(a);
            self.apply_impulse(a, first, -c.normal, c.arms[0]);
        }
        self.apply_impulse(c.b, second, c.normal, c.arms[1]);
    }
}
