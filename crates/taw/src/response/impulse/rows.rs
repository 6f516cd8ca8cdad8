//! Constraints and bodies packed for the iterations, which pass over them dozens of times: what a
//! pass does not read would only take room in the cache.

use cgmath::InnerSpace;

use super::islands::{DIRECTIONS, Islands};
use super::{BodyA, Constraint};
use crate::constraint::{ContactImpulse, FrictionCone};
use crate::math::{Scalar, Vec3};
use crate::response::bodies::{Motion, push, relative_velocity};
use crate::response::{BallRotation, SolverBodies};

/// Row of a wall in the list of bodies.
const NO_BODY: u32 = u32::MAX;

/// Constraint as a pass sees it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Row<S> {
    /// Index of its constraint.
    pub constraint: u32,
    pub island: u32,
    pub bounces: bool,
    bodies: [u32; 2],
    /// Unit normal from the first body to the second.
    pub normal: Vec3<S>,
    surface_velocity: Vec3<S>,
    /// Target relative velocity of the two points, in m/s.
    target_velocity: Vec3<S>,
    /// Part of the impulse that each body's velocity takes: its inverse mass over the normal
    /// inverse effective mass.
    mass_ratios: [S; 2],
    /// Inverse effective mass along the normal, over that along the tangents.
    pub tangent_ratio: S,
    /// Normal inverse effective mass, in 1/kg.
    pub inverse_effective_mass: S,
    pub cone: FrictionCone<S>,
    /// Largest normal impulse, in m/s.
    pub max_normal_impulse: S,
    /// Accumulated impulse, in m/s as in [`Constraint`].
    pub impulse: ContactImpulse<S>,
}

/// Search directions of a row, as impulses: last pass and accelerated steps before; the relative
/// velocity that each causes; and the velocity error where the search began; in m/s.
#[derive(Clone, Copy, Debug)]
pub(super) struct SearchDirections<S> {
    pub directions: [Vec3<S>; DIRECTIONS],
    pub velocities: [Vec3<S>; DIRECTIONS],
    pub velocity_error: Vec3<S>,
}

/// Body as a pass sees it.
#[derive(Clone, Copy, Debug)]
struct Body<S> {
    motion: Motion<S>,
    /// Spin per change of the velocity at right angles to the normal, in 1/m; zero if the rotation
    /// is locked.
    spin_per_speed: S,
}

/// Rows and bodies of the islands that have not converged.
#[derive(Clone, Debug, Default)]
pub(super) struct Rows<S> {
    list: Vec<Row<S>>,
    searches: Vec<SearchDirections<S>>,
    bodies: Vec<Body<S>>,
}

/// Bodies while rows are solved.
#[derive(Debug)]
pub(super) struct PackedBodies<'a, 'b, S> {
    bodies: &'a mut [Body<S>],
    /// Columns for what few rows need.
    columns: &'a SolverBodies<'b, S>,
}

impl<S: Scalar> Rows<S> {
    /// Packs the constraints of islands that have not converged, and all bodies.
    pub fn pack(
        &mut self,
        marbles: &SolverBodies<S>,
        constraints: &[Constraint<S>],
        islands: &Islands<S>,
    ) {
        let active =
            constraints.iter().enumerate().filter(|(_, c)| !islands.of(c.island).converged);
        self.list.clear();
        self.list.extend(active.map(|(index, c)| Row::new(index as u32, c, marbles)));
        let zero = [Vec3::from([S::zero(); 3]); DIRECTIONS];
        let none = SearchDirections { directions: zero, velocities: zero, velocity_error: zero[0] };
        self.searches.clear();
        self.searches.resize(self.list.len(), none);
        self.bodies.clear();
        self.bodies.extend((0..marbles.velocity.len()).map(|row| Body {
            motion: marbles.motion(row),
            spin_per_speed: marbles.spin_per_speed(row),
        }));
    }

    /// Writes velocities and impulses back.
    pub fn unpack(&self, marbles: &mut SolverBodies<S>, constraints: &mut [Constraint<S>]) {
        for (row, Body { motion, .. }) in self.bodies.iter().enumerate() {
            marbles.velocity[row] = motion.velocity;
            if marbles.ball_rotation(row) == BallRotation::Free {
                marbles.spin[row] = motion.spin;
            }
        }
        for row in &self.list {
            constraints[row.constraint as usize].impulse = row.impulse;
        }
    }

    /// Rows, their search directions, and the bodies that they push.
    pub fn split<'a, 'b>(
        &'a mut self,
        columns: &'a SolverBodies<'b, S>,
    ) -> (&'a mut [Row<S>], &'a mut [SearchDirections<S>], PackedBodies<'a, 'b, S>) {
        let bodies = PackedBodies { bodies: &mut self.bodies, columns };
        (&mut self.list, &mut self.searches, bodies)
    }
}

impl<S: Scalar> Row<S> {
    fn new(constraint: u32, c: &Constraint<S>, marbles: &SolverBodies<S>) -> Self {
        let inverse_effective_mass = c.inverse_effective_mass.normal;
        let ratio = |row: usize| marbles.inverse_mass[row] / inverse_effective_mass;
        let (a, first_ratio) = match c.a {
            BodyA::Wall(..) => (NO_BODY, S::zero()),
            BodyA::Marble(a) => (a, ratio(a as usize)),
        };
        Self {
            constraint,
            island: c.island,
            bounces: c.bounces,
            bodies: [a, c.b as u32],
            normal: c.normal,
            surface_velocity: c.surface_velocity,
            target_velocity: c.normal * c.target_normal_velocity + c.target_tangent_velocity,
            mass_ratios: [first_ratio, ratio(c.b)],
            tangent_ratio: inverse_effective_mass / c.inverse_effective_mass.tangent,
            inverse_effective_mass,
            cone: c.cone,
            max_normal_impulse: c.max_normal_impulse.max(c.cone.min_normal_impulse),
            impulse: c.impulse,
        }
    }

    fn first(&self) -> Option<usize> {
        (self.bodies[0] != NO_BODY).then_some(self.bodies[0] as usize)
    }

    fn second(&self) -> usize {
        self.bodies[1] as usize
    }
}

impl<S: Scalar> PackedBodies<'_, '_, S> {
    /// Velocity error: target minus relative velocity, in m/s. Arms count for capsules only.
    #[inline]
    pub fn velocity_error(&self, row: &Row<S>, arms: &[Vec3<S>; 2]) -> Vec3<S> {
        let motion = |row: usize| self.bodies[row].motion;
        let capsule = |row: usize| self.columns.capsule(row).is_some();
        row.target_velocity
            - relative_velocity(
                motion,
                capsule,
                (row.first(), row.second()),
                arms,
                row.normal,
                row.surface_velocity,
            )
    }

    /// Rounding of the velocities at a contact, in m/s. Smaller changes would only push fast bodies
    /// to one side.
    #[inline]
    pub fn velocity_rounding(&self, row: &Row<S>) -> S {
        let speed = |row: usize| self.bodies[row].motion.velocity.magnitude();
        (speed(row.second()) + row.first().map_or_else(S::zero, speed)) * S::epsilon()
    }

    /// Applies an impulse, in m/s, to the second body, its opposite to the first.
    #[inline]
    pub fn apply_impulse(&mut self, row: &Row<S>, arms: &[Vec3<S>; 2], impulse: Vec3<S>) {
        if let Some(a) = row.first() {
            self.push(a, -impulse * row.mass_ratios[0], -row.normal, &arms[0]);
        }
        self.push(row.second(), impulse * row.mass_ratios[1], row.normal, &arms[1]);
    }

    #[inline]
    fn push(&mut self, row: usize, change: Vec3<S>, normal: Vec3<S>, arm: &Vec3<S>) {
        let Body { motion, spin_per_speed } = &mut self.bodies[row];
        if let Some(capsule) = self.columns.capsule(row) {
            motion.velocity += change;
            motion.spin += capsule.apply_inverse_inertia(arm.cross(change));
        } else {
            push(&mut motion.velocity, &mut motion.spin, change, normal, *spin_per_speed);
        }
    }

    /// Relative spin of a contact, in rad/s.
    pub fn relative_spin(&self, row: &Row<S>) -> Vec3<S> {
        let spin = |row: usize| self.bodies[row].motion.spin;
        let second = spin(row.second());
        row.first().map_or(second, |a| second - spin(a))
    }

    /// Applies an angular impulse, in kg m²/s, to the second body, its opposite to the first.
    pub fn apply_angular_impulse(&mut self, row: &Row<S>, angular_impulse: Vec3<S>) {
        let second = self.columns.spin_change(row.second(), angular_impulse);
        self.bodies[row.second()].motion.spin += second;
        if let Some(a) = row.first() {
            self.bodies[a].motion.spin += self.columns.spin_change(a, -angular_impulse);
        }
    }
}
