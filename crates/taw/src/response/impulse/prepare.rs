//! Preparation: contacts become constraints with target velocities.

use cgmath::{InnerSpace, Zero};

use super::islands::{Island, Islands};
use super::{BodyA, Colliders, Constraint, Context, WallsAtStart};
use crate::constraint::{ContactImpulse, FrictionCone};
use crate::contact::{Contact, Contacts};
use crate::math::{Mat3, Scalar, Vec3, normalize_and_length};
use crate::response::SolverBodies;

/// Prepares a constraint per contact, walls first, and assigns islands.
pub(super) fn prepare<S: Scalar>(
    marbles: &SolverBodies<S>,
    contacts: &Contacts<S>,
    context: &Context<S, impl Colliders<S>, impl Fn(usize) -> S>,
    constraints: &mut Vec<Constraint<S>>,
    islands: &mut Islands<S>,
) {
    constraints.clear();
    constraints.extend(
        BodyA::of_each(contacts)
            .enumerate()
            .filter_map(|(index, (a, contact))| marbles.constraint(index, a, contact, context)),
    );
    islands.build(constraints, marbles.velocity.len(), context.settings.restitution_threshold);
    if !constraints.iter().any(|c| c.bounces) {
        return;
    }
    for c in constraints.iter() {
        let island = islands.of_mut(c.island);
        island.bounces |= c.bounces;
        // A rotating capsule's position follows for the whole substep, too.
        island.has_resting_contact |= !c.bounces || c.axis_offset != [S::zero(); 2];
        if c.bounces {
            island.time_since_impact = island
                .time_since_impact
                .max(c.time_since_impact.unwrap_or(island.time_since_impact));
        }
    }
    for c in constraints.iter_mut().filter(|c| c.bounces) {
        marbles.set_restitution(c, islands.of(c.island), context);
    }
}

impl<S: Scalar> SolverBodies<'_, S> {
    /// Constraint of a contact without restitution, and the decision if it bounces.
    fn constraint(
        &self,
        index: usize,
        a: BodyA,
        contact: &Contact<S>,
        context: &Context<S, impl Colliders<S>, impl Fn(usize) -> S>,
    ) -> Option<Constraint<S>> {
        let (b, axis_offset) = (contact.b as usize, contact.along);
        let (normal, separation) = self.contact_geometry(a, contact, context)?;
        let normal = self.impact_normal(a, b, (normal, separation), context);
        let arms = self.arms(a, b, axis_offset, normal);
        let material = contact.material.clamped();
        let surface_velocity = self.surface_velocity(a, b, (arms, normal), context.walls);
        let inverse_effective_mass = self.pair_inverse_effective_mass(a, b, arms, normal);
        let relative_velocity = self.relative_velocity(a, b, arms, normal, surface_velocity);
        let approach_speed = -relative_velocity.dot(normal);
        // Positions have moved already, and will follow the velocity changes. This target velocity
        // just keeps the separation from closing.
        let (follow_time, dt) = (context.follow_time(a, b), context.settings.dt);
        let is_fast = approach_speed > context.settings.restitution_threshold;
        let target_normal_velocity = if dt == S::zero() {
            S::zero()
        } else if follow_time > S::zero() {
            -approach_speed - separation / follow_time
        } else if is_fast && separation > S::zero() {
            -approach_speed - separation / dt // to bounce in the next substep
        } else {
            -separation / dt
        };
        let zero = Vec3::zero();
        let mut constraint = Constraint {
            a,
            b,
            key: a.contact_key(contact),
            index,
            axis_offset,
            island: 0,
            normal,
            arms,
            surface_velocity,
            inverse_effective_mass,
            restitution: material.restitution,
            tangential_restitution: material.tangential_restitution,
            friction: material.friction,
            cone: FrictionCone::new(material.friction),
            max_normal_impulse: S::infinity(),
            initial_relative_velocity: relative_velocity,
            initial_relative_spin: zero,
            bounces: is_fast && dt == S::zero(),
            time_since_impact: None,
            velocity_since_impact: zero,
            target_normal_velocity: target_normal_velocity.min(S::zero()),
            target_tangent_velocity: zero,
            impulse: ContactImpulse::zero(),
            rolling: self.rolling_constraint(a, b, inverse_effective_mass, material),
        };
        constraint.initial_relative_spin = self.relative_spin(&constraint);
        constraint.velocity_since_impact = self.velocity_since(&constraint, None, context);
        if is_fast {
            self.detect_bounce(&mut constraint, separation, context);
        }
        (inverse_effective_mass.normal > S::zero()).then_some(constraint)
    }

    /// Marks a fast contact as bouncing if the impact happened within the substep.
    fn detect_bounce(
        &self,
        c: &mut Constraint<S>,
        separation: S,
        context: &Context<S, impl Colliders<S>, impl Fn(usize) -> S>,
    ) {
        // A body stopped by continuous detection is in contact, whatever rounding says.
        let ccd_stopped =
            context.is_ccd_stopped(c.b) || c.a.marble().is_some_and(|a| context.is_ccd_stopped(a));
        if (separation < S::zero() || ccd_stopped) && context.settings.dt > S::zero() {
            let time_since_impact = self.time_since_impact_of(c, separation, context);
            // Only if it is not back on the surface before the substep ends.
            let relative_acceleration = self.relative_acceleration(c, context);
            let velocity_since_impact = self.velocity_since(c, Some(time_since_impact), context);
            let speed = c.restitution * c.approach_speed(velocity_since_impact);
            if speed + relative_acceleration.dot(c.normal) * time_since_impact * S::from_f64(0.5)
                >= S::zero()
            {
                (c.bounces, c.time_since_impact) = (true, Some(time_since_impact));
            }
        }
    }

    /// Normal and separation by which a contact is solved; none for one that is not finite.
    fn contact_geometry(
        &self,
        a: BodyA,
        contact: &Contact<S>,
        context: &Context<S, impl Colliders<S>, impl Fn(usize) -> S>,
    ) -> Option<(Vec3<S>, S)> {
        let Contact { normal, separation, along: axis_offset, .. } = *contact;
        let b = contact.b as usize;
        if !separation.is_finite() {
            return None;
        }
        // An impulse along the mean normal of the substep does no work, and constant penetration
        // does none either.
        let walls_at_start = &WallsAtStart(context.walls);
        let start =
            self.normal_and_separation(context.start.position, a, b, axis_offset, walls_at_start);
        if let (None, Some(geometry)) =
            (start, self.contact_at_impact(a, b, axis_offset, normal, context))
        {
            return Some(geometry);
        }
        Some(start.map_or((normal, separation), |(normal_at_start, separation_at_start)| {
            let mean = normalize_and_length(normal + normal_at_start);
            (mean.map_or(normal, |(mean, _)| mean), separation - separation_at_start.min(S::zero()))
        }))
    }

    /// Normal and separation of two marbles at their time of impact within this substep, if they
    /// approach too fast for their present positions to tell.
    fn contact_at_impact(
        &self,
        a: BodyA,
        b: usize,
        axis_offset: [S; 2],
        normal: Vec3<S>,
        context: &Context<S, impl Colliders<S>, impl Fn(usize) -> S>,
    ) -> Option<(Vec3<S>, S)> {
        let a = a.marble()?;
        let dt = context.settings.dt;
        let velocity = self.velocity[b] - self.velocity[a];
        let threshold = context.settings.restitution_threshold;
        // A capsule rotates on its way.
        let is_sphere_contact = axis_offset == [S::zero(); 2];
        if context.start.velocity.is_empty()
            || velocity.magnitude2() <= threshold * threshold
            || !is_sphere_contact
        {
            return None;
        }
        let center_offset = self.period.minimum_image(self.position[b] - self.position[a]);
        let radius_sum = self.radius[a] + self.radius[b];
        // Backward time of impact: |center_offset − velocity t| = radius_sum.
        let (radial, speed_squared) = (center_offset.dot(velocity), velocity.magnitude2());
        let gap_squared =
            (center_offset.magnitude() - radius_sum) * (center_offset.magnitude() + radius_sum);
        let root = radial * radial - speed_squared * gap_squared;
        if root < S::zero() {
            return None;
        }
        let time_since_impact = (radial + root.sqrt()) / speed_squared;
        let (offset_at_impact, distance) =
            normalize_and_length(center_offset - velocity * time_since_impact)?;
        let is_valid =
            time_since_impact > S::zero() && time_since_impact <= dt && distance.is_finite();
        // Other contacts, or rounding, may imply that the two never came together.
        (is_valid
            && offset_at_impact.dot(velocity) < S::zero()
            && offset_at_impact.dot(normal) > -S::one())
        .then(|| (offset_at_impact, offset_at_impact.dot(center_offset) - radius_sum))
    }

    /// Time since the impact of a penetrating contact, in seconds.
    fn time_since_impact_of(
        &self,
        c: &Constraint<S>,
        separation: S,
        context: &Context<S, impl Colliders<S>, impl Fn(usize) -> S>,
    ) -> S {
        let normal_acceleration = self.relative_acceleration(c, context).dot(c.normal);
        // Under constant acceleration positions lie on a parabola, with the integrator's velocity
        // at another time.
        let end_speed = -c.initial_relative_velocity.dot(c.normal)
            - normal_acceleration * context.integrator_lead(c);
        let speed_squared = (end_speed * end_speed
            - normal_acceleration * separation * S::from_f64(2.0))
        .max(S::zero());
        let time_since_impact = separation * S::from_f64(-2.0) / (end_speed + speed_squared.sqrt());
        time_since_impact.max(S::zero()).min(context.settings.dt)
    }

    /// Sets the restitution target: at the time of the island's first impact, with the approach
    /// speed of that time, and positions follow from then on. So the height of a bounce does not
    /// depend on when it happens within a substep. A bounce among resting contacts follows for the
    /// whole substep, as they do.
    fn set_restitution(
        &self,
        c: &mut Constraint<S>,
        island: &Island<S>,
        context: &Context<S, impl Colliders<S>, impl Fn(usize) -> S>,
    ) {
        let time_since_impact = (!island.has_resting_contact).then_some(island.time_since_impact);
        let velocity_since_impact = self.velocity_since(c, time_since_impact, context);
        let speed = c.restitution * c.approach_speed(velocity_since_impact);
        let velocity_at_impact = c.initial_relative_velocity - velocity_since_impact;
        let tangent_velocity = velocity_at_impact - c.normal * velocity_at_impact.dot(c.normal);
        let target_velocity = velocity_since_impact - tangent_velocity * c.tangential_restitution;
        c.time_since_impact = c.time_since_impact.and(time_since_impact);
        c.target_normal_velocity = speed + target_velocity.dot(c.normal);
        (c.target_tangent_velocity, c.velocity_since_impact) =
            (target_velocity - c.normal * target_velocity.dot(c.normal), velocity_since_impact);
    }

    /// Relative velocity that forces gave the two bodies of a contact since its impulse, in m/s:
    /// since an impact at this time, in seconds, before the end of the substep, or since positions follow.
    /// Each body has its own time: one that continuous collision detection stopped follows no more,
    /// and feels the impulse where it stopped, while the other one is moved back along its path.
    /// With a common time that one would keep speed of a fall that is undone.
    fn velocity_since(
        &self,
        c: &Constraint<S>,
        time_since_impact: Option<S>,
        context: &Context<S, impl Colliders<S>, impl Fn(usize) -> S>,
    ) -> Vec3<S> {
        let dt = context.settings.dt;
        let of = |row: usize| {
            let change = context.start.velocity.get(row).map(|before| self.velocity[row] - before);
            let (Some(change), true) = (change, dt > S::zero()) else { return Vec3::zero() };
            let follow_time = context.follow_time_of(row);
            let time = time_since_impact.filter(|_| !context.is_ccd_stopped(row));
            // Not by the acceleration, which may overflow.
            change * ((time.unwrap_or(follow_time) - context.lead_of(row)) / dt)
        };
        of(c.b) - c.a.marble().map_or_else(Vec3::zero, of)
    }

    /// Relative acceleration of a contact by forces in this substep, in m/s².
    fn relative_acceleration(
        &self,
        c: &Constraint<S>,
        context: &Context<S, impl Colliders<S>, impl Fn(usize) -> S>,
    ) -> Vec3<S> {
        let first = c.a.marble().map_or_else(Vec3::zero, |a| self.acceleration(a, context));
        self.acceleration(c.b, context) - first
    }

    /// Acceleration by forces in this substep, in m/s²; zero where unknown.
    fn acceleration(
        &self,
        row: usize,
        context: &Context<S, impl Colliders<S>, impl Fn(usize) -> S>,
    ) -> Vec3<S> {
        let change = context.start.velocity.get(row).map(|before| self.velocity[row] - before);
        change
            .filter(|_| context.settings.dt > S::zero())
            .map_or_else(Vec3::zero, |change| change / context.settings.dt)
    }
}

impl<S: Scalar> Constraint<S> {
    /// Approach speed at the impact, in m/s, by the relative velocity that forces gave since.
    fn approach_speed(&self, velocity_since_impact: Vec3<S>) -> S {
        (velocity_since_impact - self.initial_relative_velocity).dot(self.normal).max(S::zero())
    }
}

impl<S, W, F> Context<'_, S, W, F>
where
    S: Scalar,
    W: Colliders<S>,
    F: Fn(usize) -> S,
{
    /// Tells if continuous collision detection stopped a row within the substep.
    #[inline]
    pub(in crate::response) fn is_ccd_stopped(&self, row: usize) -> bool {
        self.ccd_stop(row).is_some()
    }

    /// Fraction of a velocity change that the position of a stopped row still follows, as a matrix.
    #[inline]
    fn ccd_stop(&self, row: usize) -> Option<Mat3<S>> {
        self.start.ccd_stops.get(row).copied().flatten()
    }

    /// Displacement of a row by a velocity change, in metres.
    #[inline]
    pub(in crate::response) fn displacement_of(&self, row: usize, change: Vec3<S>) -> Vec3<S> {
        let displacement = change * (self.position_weight)(row) * self.settings.dt;
        self.ccd_stop(row).map_or(displacement, |projection| projection * displacement)
    }

    /// Time for which the position of a row follows a velocity change, in seconds.
    pub(in crate::response) fn follow_time_of(&self, row: usize) -> S {
        if self.is_ccd_stopped(row) {
            S::zero()
        } else {
            (self.position_weight)(row) * self.settings.dt
        }
    }

    /// Time for which a separation follows a change of its speed, in seconds.
    pub(in crate::response) fn follow_time(&self, a: BodyA, b: usize) -> S {
        mean(a, b, |row| self.follow_time_of(row))
    }

    /// Lead of the integrator's velocities over those of the path, in seconds.
    fn integrator_lead(&self, c: &Constraint<S>) -> S {
        mean(c.a, c.b, |row| self.lead_of(row))
    }

    /// Lead of the integrator's velocity of a row, in seconds.
    fn lead_of(&self, row: usize) -> S {
        ((self.position_weight)(row) - S::from_f64(0.5)) * self.settings.dt
    }
}

/// Mean over the marbles of a contact.
fn mean<S: Scalar>(a: BodyA, b: usize, of: impl Fn(usize) -> S) -> S {
    a.marble().map_or_else(|| of(b), |a| (of(a) + of(b)) * S::from_f64(0.5))
}
