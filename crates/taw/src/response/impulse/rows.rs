//! Constraints and bodies packed for the iterations, which pass over them dozens of times: what a
//! pass does not read would only take room in the cache.

use std::ops::Range;

use cgmath::InnerSpace;

use super::islands::{DIRECTIONS, Island, Islands};
use super::{Constraint, RollingConstraint};
use crate::constraint::{ContactImpulse, FrictionCone};
use crate::math::{Scalar, Vec3};
use crate::response::bodies::{BodyMotion, CapsuleInertia, push, push_locked, relative_velocity};
use crate::response::{BallRotation, SolverBodies};
use crate::workers::{DisjointSlice, parallel_for};

/// Body of a wall, and of a marble that has none.
const NO_BODY: u32 = u32::MAX;
/// Number of rows for each thread that solves islands: with fewer, waking one costs more than it saves.
const ROWS_PER_THREAD: usize = 128;

/// Constraint as a pass sees it.
#[derive(Clone, Copy, Debug)]
pub(super) struct ConstraintRow<S> {
    pub bounces: bool,
    /// Indices of its bodies in the island.
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

/// Lever arms of capsules and rolling friction, which few rows need.
#[derive(Clone, Copy, Debug)]
pub(super) struct RowDetails<S> {
    /// Index of its constraint.
    constraint: u32,
    pub arms: [Vec3<S>; 2],
    pub rolling: Option<RollingConstraint<S>>,
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
struct PackedBody<S> {
    motion: BodyMotion<S>,
    /// Spin per change of the velocity at right angles to the normal, in 1/m; zero if the rotation
    /// is locked.
    spin_per_speed: S,
}

/// Rows and bodies of the islands that have not converged, one island after another.
#[derive(Clone, Debug, Default)]
pub(super) struct Rows<S> {
    list: Vec<ConstraintRow<S>>,
    details: Vec<RowDetails<S>>,
    searches: Vec<SearchDirections<S>>,
    bodies: Vec<PackedBody<S>>,
    /// Marble of each body.
    marbles: Vec<u32>,
    parts: Vec<IslandPart>,
    /// Constraints in the order of their islands.
    order: Vec<u32>,
    /// Number of constraints of each island, then where the next one goes.
    next: Vec<u32>,
    /// Index in the list of each marble's body; [`NO_BODY`] for one without.
    body_of_marble: Vec<u32>,
}

/// Part of the lists that an island has.
#[derive(Clone, Debug)]
struct IslandPart {
    island: usize,
    rows: Range<usize>,
    bodies: Range<usize>,
}

/// Island while it is solved.
pub(super) struct IslandRows<'a, 'b, S> {
    pub island: &'a mut Island<S>,
    pub rows: &'a mut [ConstraintRow<S>],
    pub details: &'a mut [RowDetails<S>],
    pub searches: &'a mut [SearchDirections<S>],
    pub bodies: PackedBodies<'a, 'b, S>,
}

/// Bodies while rows are solved.
#[derive(Debug)]
pub(super) struct PackedBodies<'a, 'b, S> {
    bodies: &'a mut [PackedBody<S>],
    /// Marbles of the bodies.
    marbles: &'a [u32],
    /// Columns for what few rows need.
    columns: &'a SolverBodies<'b, S>,
}

impl<S: Scalar> Rows<S> {
    /// Packs the constraints of islands that have not converged, and their bodies.
    pub fn pack(
        &mut self,
        marbles: &SolverBodies<S>,
        constraints: &[Constraint<S>],
        islands: &Islands<S>,
    ) {
        self.sort_by_island(constraints, islands);
        self.list.clear();
        self.details.clear();
        self.bodies.clear();
        self.marbles.clear();
        self.parts.clear();
        self.body_of_marble.clear();
        self.body_of_marble.resize(marbles.velocity.len(), NO_BODY);
        let order = std::mem::take(&mut self.order);
        for index in &order {
            let c = &constraints[*index as usize];
            let island = c.island as usize;
            if self.parts.last().is_none_or(|part| part.island != island) {
                let (row, body) = (self.list.len(), self.bodies.len());
                self.parts.push(IslandPart { island, rows: row..row, bodies: body..body });
            }
            let first = c.a.marble().map_or(NO_BODY, |a| self.body(a, marbles));
            let bodies = [first, self.body(c.b, marbles)];
            self.list.push(ConstraintRow::new(c, marbles, bodies));
            let Constraint { arms, rolling, .. } = *c;
            self.details.push(RowDetails { constraint: *index, arms, rolling });
            if let Some(part) = self.parts.last_mut() {
                (part.rows.end, part.bodies.end) = (self.list.len(), self.bodies.len());
            }
        }
        self.order = order;
        let zero = [Vec3::from([S::zero(); 3]); DIRECTIONS];
        let none = SearchDirections { directions: zero, velocities: zero, velocity_error: zero[0] };
        self.searches.clear();
        self.searches.resize(self.list.len(), none);
    }

    /// Orders the constraints by islands (counting sort).
    fn sort_by_island(&mut self, constraints: &[Constraint<S>], islands: &Islands<S>) {
        let active =
            || constraints.iter().zip(0..).filter(|(c, _)| !islands.of(c.island).converged);
        self.next.clear();
        self.next.resize(islands.len(), 0);
        let mut count = 0;
        for (c, _) in active() {
            self.next[c.island as usize] += 1;
            count += 1;
        }
        let mut begin = 0;
        for next in &mut self.next {
            begin += std::mem::replace(next, begin);
        }
        self.order.clear();
        self.order.resize(count, 0);
        for (c, index) in active() {
            let next = &mut self.next[c.island as usize];
            self.order[*next as usize] = index;
            *next += 1;
        }
    }

    /// Index of a marble's body in the last island, which gets it with its first contact.
    fn body(&mut self, marble: usize, marbles: &SolverBodies<S>) -> u32 {
        let first = self.parts.last().map_or(0, |part| part.bodies.start) as u32;
        let body = &mut self.body_of_marble[marble];
        if *body == NO_BODY {
            *body = self.bodies.len() as u32;
            self.bodies.push(PackedBody {
                motion: marbles.motion(marble),
                spin_per_speed: marbles.spin_per_speed(marble),
            });
            self.marbles.push(marble as u32);
        }
        *body - first
    }

    /// Solves each island, on `threads` threads at most: they have nothing in common.
    pub fn solve_islands(
        &mut self,
        columns: &SolverBodies<S>,
        islands: &mut Islands<S>,
        threads: usize,
        solve: impl Fn(IslandRows<S>) + Sync,
    ) {
        let threads = threads.min(self.list.len() / ROWS_PER_THREAD);
        let islands = DisjointSlice::new(&mut islands.list);
        let (rows, details) =
            (DisjointSlice::new(&mut self.list), DisjointSlice::new(&mut self.details));
        let (searches, bodies) =
            (DisjointSlice::new(&mut self.searches), DisjointSlice::new(&mut self.bodies));
        parallel_for(threads, self.parts.len(), |_, part| {
            let IslandPart { island, rows: of_rows, bodies: of_bodies } = self.parts[part].clone();
            // SAFETY: parts follow one another, each island has one, and no marble is in two.
            solve(unsafe {
                IslandRows {
                    island: &mut *islands.row(island),
                    rows: rows.part(of_rows.clone()),
                    details: details.part(of_rows.clone()),
                    searches: searches.part(of_rows),
                    bodies: PackedBodies {
                        bodies: bodies.part(of_bodies.clone()),
                        marbles: &self.marbles[of_bodies],
                        columns,
                    },
                }
            });
        });
    }

    /// Writes velocities and impulses back.
    pub fn unpack(&self, marbles: &mut SolverBodies<S>, constraints: &mut [Constraint<S>]) {
        for (PackedBody { motion, .. }, marble) in self.bodies.iter().zip(&self.marbles) {
            let row = *marble as usize;
            marbles.velocity[row] = motion.velocity;
            if marbles.ball_rotation(row) == BallRotation::Free {
                marbles.spin[row] = motion.spin;
            }
        }
        for (row, details) in self.list.iter().zip(&self.details) {
            let c = &mut constraints[details.constraint as usize];
            (c.impulse, c.rolling) = (row.impulse, details.rolling);
        }
    }
}

impl<S: Scalar> ConstraintRow<S> {
    fn new(c: &Constraint<S>, marbles: &SolverBodies<S>, bodies: [u32; 2]) -> Self {
        let inverse_effective_mass = c.inverse_effective_mass.normal;
        let ratio = |row: usize| marbles.inverse_mass[row] / inverse_effective_mass;
        Self {
            bounces: c.bounces,
            bodies,
            normal: c.normal,
            surface_velocity: c.surface_velocity,
            target_velocity: c.normal * c.target_normal_velocity + c.target_tangent_velocity,
            mass_ratios: [c.a.marble().map_or_else(S::zero, ratio), ratio(c.b)],
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

#[expect(clippy::inline_always, reason = "vectors as arguments go through memory otherwise")]
impl<S: Scalar> PackedBodies<'_, '_, S> {
    /// Velocity error: target minus relative velocity, in m/s. Arms count for capsules only.
    #[inline(always)]
    pub fn velocity_error(&self, row: &ConstraintRow<S>, arms: &[Vec3<S>; 2]) -> Vec3<S> {
        let motion = |row: usize| self.bodies[row].motion;
        let capsule = |row: usize| self.capsule(row).is_some();
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
    #[inline(always)]
    pub fn velocity_rounding(&self, row: &ConstraintRow<S>) -> S {
        let speed = |row: usize| self.bodies[row].motion.velocity.magnitude();
        (speed(row.second()) + row.first().map_or_else(S::zero, speed)) * S::epsilon()
    }

    /// Applies an impulse, in m/s, to the second body, its opposite to the first.
    #[inline(always)]
    pub fn apply_impulse(&mut self, row: &ConstraintRow<S>, arms: &[Vec3<S>; 2], impulse: Vec3<S>) {
        if let Some(a) = row.first() {
            self.push(a, -impulse * row.mass_ratios[0], -row.normal, &arms[0]);
        }
        self.push(row.second(), impulse * row.mass_ratios[1], row.normal, &arms[1]);
    }

    #[inline(always)]
    fn push(&mut self, row: usize, change: Vec3<S>, normal: Vec3<S>, arm: &Vec3<S>) {
        let turn =
            self.capsule(row).map(|capsule| capsule.apply_inverse_inertia(arm.cross(change)));
        let any_locked = !self.columns.locked_axes.is_empty();
        let locks = any_locked.then(|| self.columns.locked_axes(self.marble(row)));
        let PackedBody { motion, spin_per_speed } = &mut self.bodies[row];
        let (velocity, spin) = (&mut motion.velocity, &mut motion.spin);
        match (turn, locks) {
            (Some(turn), locks) => {
                *velocity += locks.map_or(change, |locks| locks.free_translation(change));
                *spin += turn;
            }
            (None, None) => push(velocity, spin, change, normal, *spin_per_speed),
            (None, Some(locks)) => {
                push_locked(velocity, spin, change, normal, (*spin_per_speed, locks));
            }
        }
    }

    /// Relative spin of a contact, in rad/s.
    pub fn relative_spin(&self, row: &ConstraintRow<S>) -> Vec3<S> {
        let spin = |row: usize| self.bodies[row].motion.spin;
        let second = spin(row.second());
        row.first().map_or(second, |a| second - spin(a))
    }

    /// Applies an angular impulse, in kg m²/s, to the second body, its opposite to the first.
    pub fn apply_angular_impulse(&mut self, row: &ConstraintRow<S>, angular_impulse: Vec3<S>) {
        let change = |row: usize, impulse| self.columns.spin_change(self.marble(row), impulse);
        let second = change(row.second(), angular_impulse);
        let first = row.first().map(|a| (a, change(a, -angular_impulse)));
        self.bodies[row.second()].motion.spin += second;
        if let Some((a, first)) = first {
            self.bodies[a].motion.spin += first;
        }
    }

    /// Axis and inertia of a body that is a capsule.
    #[inline(always)]
    fn capsule(&self, body: usize) -> Option<&CapsuleInertia<S>> {
        let any = !self.columns.capsules.is_empty();
        any.then(|| self.columns.capsule(self.marble(body))).flatten()
    }

    fn marble(&self, body: usize) -> usize {
        self.marbles[body] as usize
    }
}
