//! Contacts of rigid bodies: candidates by boxes, and manifolds of convex parts.

use std::collections::{BTreeMap, BTreeSet};

use cgmath::InnerSpace;

use super::World;
use super::body_seams::drop_ghosts;
use super::joints::JointHeld;
use super::swept_manifold::{ContactReach, swept_manifold};
use super::walls::SubShape;
use crate::body::{
    BodyContact, BodyContactKey, BodyPartner, BodyState, BodySystem, SolverBody, ball_contact,
    manifold_contact,
};
use crate::broad::CollisionFilter;
use crate::math::{Scalar, Vec3, cast_point, cast_vector};
use crate::motion::WallMotion;
use crate::response::event::WallCollider;
use crate::shape::{Aabb, Aabb3, BoundedShape, Bvh};
use crate::swarm::BallView;

/// Margin beyond the motion of a step within which contacts are listed, over the reach of the smaller body.
pub(super) const MARGIN: f64 = 0.02;
/// Distance from another wall within which a point counts as on it, over the reach of the body.
const FLUSH: f64 = 0.01;

/// Body with the boxes in which its parts stay in the step.
pub(super) struct BodyCandidate {
    pub row: usize,
    /// Distance that its surface goes in the step, at most, with the slack, in metres.
    margin: f64,
    /// Distance within which contacts are listed, whatever moves, in metres.
    slack: f64,
    pub bounds: Aabb3<f64>,
}

/// Ball that may come near a body.
pub(super) struct NearBall<S> {
    pub ball: BallView<S>,
    /// Row of the body.
    pub row: usize,
    /// Distance that the ball goes in the step, at most, with its slack, in metres.
    way: f64,
}

/// Bodies with the boxes in which they stay in a step, and the balls near these.
pub(super) struct BodyCandidates<S> {
    pub list: Vec<BodyCandidate>,
    tree: Bvh<f64>,
    pub balls: Vec<NearBall<S>>,
}

impl<S> BodyCandidates<S> {
    /// Visits those whose boxes overlap this one.
    pub fn for_each_in_box(&self, bounds: &Aabb3<f64>, mut visit: impl FnMut(&BodyCandidate)) {
        self.tree.for_each_in_box(bounds, |row| {
            let candidate = &self.list[row as usize];
            if candidate.bounds.overlaps(bounds) {
                visit(candidate); // the tree visits some others, too
            }
        });
    }
}

impl BodyCandidate {
    fn new<S: Scalar>(row: usize, state: &BodyState<S>, dt: f64) -> Self {
        let SolverBody { velocity, spin, acceleration, .. } = state.solver;
        let turn = (spin.magnitude() * dt).min(std::f64::consts::PI) * state.reach;
        let speed = velocity.magnitude() + acceleration.magnitude() * dt;
        let margin = if state.asleep { 0.0 } else { speed * dt + turn };
        let slack = MARGIN * state.reach;
        let margin = margin + slack;
        Self { row, margin, slack, bounds: grown(&state.bounds(), margin) }
    }
}

/// Way of the points of a wall within this distance of its pivot in `dt` seconds, at most, in metres.
fn way_of_wall(motion: &WallMotion<f64>, distance: f64, dt: f64) -> f64 {
    let turn = (motion.angular_velocity.magnitude() * dt).min(std::f64::consts::PI);
    motion.velocity.magnitude() * dt + turn * distance
}

/// Box with this much more on each side.
pub(super) fn grown(bounds: &Aabb3<f64>, by: f64) -> Aabb3<f64> {
    let by = Vec3::new(by, by, by);
    Aabb { min: bounds.min - by, max: bounds.max + by }
}

impl<S: Scalar> World<S> {
    /// Finds the contacts of bodies that are awake, for a step of `dt` seconds.
    pub(super) fn find_body_contacts(&mut self, dt: S) -> BodySystem {
        let step = dt.as_f64();
        let mut candidates = self.body_candidates(step);
        while self.wake_disturbed_bodies(&candidates) {
            candidates = self.body_candidates(step);
        }
        self.keep_balls_awake();
        let states = &self.bodies.states;
        let apart = self.joints.ignored_bodies();
        let mut system = BodySystem::new(
            states.iter().map(BodyState::in_solver).collect(),
            states.iter().map(|state| state.parts.clone()).collect(),
        );
        self.collide_bodies_with_walls(&candidates.list, step, &mut system);
        self.collide_bodies(&candidates, (step, &apart), &mut system);
        self.collide_bodies_with_balls(&candidates, &apart, &mut system);
        system.contacts.sort_by_key(|contact| contact.key);
        let before = &self.bodies.contacts;
        for contact in &mut system.contacts {
            if let Ok(known) = before.binary_search_by_key(&contact.key, |known| known.key) {
                contact.take_impulses(&before[known]);
            }
        }
        system
    }

    fn collide_bodies_with_walls(
        &self,
        candidates: &[BodyCandidate],
        dt: f64,
        system: &mut BodySystem,
    ) {
        let mut index_of_wall = BTreeMap::new();
        let moved = self.moved_walls(dt);
        for candidate in candidates {
            let state = &self.bodies.states[candidate.row];
            if state.asleep || !state.is_dynamic() {
                continue;
            }
            let filter = CollisionFilter { layers: state.body.layers, ignored: &[] };
            let mut near: Vec<SubShape> = self
                .walls
                .colliding_planes(filter)
                .map(|(wall, _)| SubShape { wall, index: 0 })
                .collect();
            let bounds = Aabb {
                min: cast_point(candidate.bounds.min),
                max: cast_point(candidate.bounds.max),
            };
            self.walls.for_each_colliding(&bounds, filter, |part| near.push(part));
            let near_moved = moved.iter().filter(|(swept, _)| swept.overlaps(&candidate.bounds));
            let way = near_moved.map(|(_, way)| *way).fold(0.0, f64::max);
            if way > 0.0 {
                let beyond = grown(&candidate.bounds, way);
                let bounds = Aabb { min: cast_point(beyond.min), max: cast_point(beyond.max) };
                self.walls.for_each_colliding(&bounds, filter, |part| {
                    if self.walls.has_moved(part.wall as usize) {
                        near.push(part);
                    }
                });
            }
            near.sort_unstable();
            near.dedup();
            let first = system.contacts.len();
            let mut colliders = Vec::new();
            for part in near {
                let wall = *index_of_wall.entry(part.wall).or_insert_with(|| {
                    let motion = self.walls.motion_of_row(part.wall as usize);
                    let moves = self.walls.has_moved(part.wall as usize);
                    system.bodies.push(SolverBody::wall(motion.map(WallMotion::cast), moves, dt));
                    (system.bodies.len() - 1) as u32
                });
                let Some(collider) = self.wall_before(part, dt) else { continue };
                let found =
                    self.wall_contacts_of_body(part, candidate, wall, (&collider, dt), system);
                system.contacts.extend(found);
                colliders.resize(system.contacts.len() - first, collider);
            }
            drop_ghosts(&mut system.contacts, first, &colliders, state.reach * FLUSH);
        }
    }

    /// Boxes in which walls that move stay in a step of `dt` seconds, and the longest way of their points, at most, in
    /// metres.
    fn moved_walls(&self, dt: f64) -> Vec<(Aabb3<f64>, f64)> {
        let rows = (0..self.walls.len()).filter(|row| self.walls.has_moved(*row));
        let swept = rows.filter_map(|row| {
            let motion = self.walls.motion_of_row(row)?;
            let bounds = self.walls.shapes()[row].bounding_box()?;
            let reach = bounds.farthest_distance(motion.pivot).as_f64();
            let way = way_of_wall(&motion.cast(), reach, dt);
            let bounds = Aabb { min: cast_point(bounds.min), max: cast_point(bounds.max) };
            Some((grown(&bounds, way), way))
        });
        swept.collect()
    }

    /// Part of a wall where it is when a step of `dt` seconds begins.
    fn wall_before(&self, part: SubShape, dt: f64) -> Option<WallCollider> {
        let row = part.wall as usize;
        let shape = &self.walls.shapes()[row];
        match self.walls.motion_of_row(row).filter(|_| self.walls.has_moved(row)) {
            Some(motion) => {
                let before = shape.transformed(motion.pose_before(S::from_f64(dt))).ok()?;
                before.sub_shape_f64(part.index)
            }
            None => shape.sub_shape_f64(part.index),
        }
    }

    fn wall_contacts_of_body(
        &self,
        part: SubShape,
        candidate: &BodyCandidate,
        wall: u32,
        (collider, dt): (&WallCollider, f64),
        system: &BodySystem,
    ) -> Vec<BodyContact> {
        let row = part.wall as usize;
        let state = &self.bodies.states[candidate.row];
        let (Some(id), Some(body)) = (self.walls.id(row), self.bodies.id(candidate.row)) else {
            return Vec::new();
        };
        let material = state.body.material.on_wall(self.walls.material_of_row(row)).cast();
        let motion = self.walls.motion_of_row(row).filter(|_| self.walls.has_moved(row));
        let way = motion.map_or(0.0, |motion| {
            let motion = motion.cast::<f64>();
            let arm = (state.solver.center() - motion.pivot).magnitude() + state.reach;
            way_of_wall(&motion, arm, dt)
        });
        let margin = candidate.margin + way;
        let of_part = |at: usize| {
            let bodies = [wall, candidate.row as u32];
            let ends = bodies.map(|body| &system.bodies[body as usize]);
            let shape = WallCollider::Solid(state.part(at));
            let reach = ContactReach { margin, slack: candidate.slack, dt };
            let found = swept_manifold([collider, &shape], ends, reach)?;
            let key = BodyContactKey {
                partner: BodyPartner::Wall(id),
                body,
                parts: [part.index, at as u32],
            };
            Some(manifold_contact(key, bodies, &found, material))
        };
        (0..state.parts.len()).filter_map(of_part).collect()
    }

    fn collide_bodies(
        &self,
        candidates: &BodyCandidates<S>,
        (dt, apart): (f64, &BTreeSet<[JointHeld; 2]>),
        system: &mut BodySystem,
    ) {
        let states = &self.bodies.states;
        for b in &candidates.list {
            let second = &states[b.row];
            candidates.for_each_in_box(&b.bounds, |a| {
                let first = &states[a.row];
                let is_idle = |state: &BodyState<S>| state.asleep || !state.is_dynamic();
                if a.row >= b.row
                    || is_idle(first) && is_idle(second)
                    || !first.body.layers.interacts_with(second.body.layers)
                    || !apart.is_empty() && self.are_joined(a.row, b.row, apart)
                {
                    return;
                }
                self.collide_pair([a, b], dt, system);
            });
        }
    }

    /// Returns true if a joint keeps two bodies apart.
    fn are_joined(&self, a: usize, b: usize, apart: &BTreeSet<[JointHeld; 2]>) -> bool {
        let [Some(a), Some(b)] = [a, b].map(|row| self.bodies.id(row)) else { return false };
        apart.contains(&[a.min(b), a.max(b)].map(JointHeld::Body))
    }

    fn collide_pair(&self, pair: [&BodyCandidate; 2], dt: f64, system: &mut BodySystem) {
        let [Some(a), Some(b)] = pair.map(|it| self.bodies.id(it.row)) else { return };
        // Rows move about; the order of handles does not.
        let (pair, [a, b]) = if a < b { (pair, [a, b]) } else { ([pair[1], pair[0]], [b, a]) };
        let [first, second] = pair.map(|it| &self.bodies.states[it.row]);
        let margin = pair[0].margin + pair[1].margin;
        let reach = ContactReach { margin, slack: pair[0].slack.min(pair[1].slack), dt };
        let material = first.body.material.combined_with(second.body.material).cast();
        let bodies = pair.map(|it| it.row as u32);
        let ends = bodies.map(|body| system.bodies[body as usize]);
        for i in 0..first.parts.len() {
            let one = first.part(i);
            let bounds = grown(&one.bounding_box(), margin);
            let one = WallCollider::Solid(one);
            for j in 0..second.parts.len() {
                let other = second.part(j);
                if !bounds.overlaps(&other.bounding_box()) {
                    continue;
                }
                let shapes = [&one, &WallCollider::Solid(other)];
                let Some(found) = swept_manifold(shapes, ends.each_ref(), reach) else { continue };
                let parts = [i as u32, j as u32];
                let key = BodyContactKey { partner: BodyPartner::Body(a), body: b, parts };
                system.contacts.push(manifold_contact(key, bodies, &found, material));
            }
        }
    }

    /// Bodies, and the balls near which they come, in a step of `dt` seconds.
    fn body_candidates(&self, dt: f64) -> BodyCandidates<S> {
        let states = &self.bodies.states;
        let rows = states.iter().enumerate();
        let list: Vec<_> = rows.map(|(row, state)| BodyCandidate::new(row, state, dt)).collect();
        let boxes: Vec<_> = list.iter().map(|candidate| candidate.bounds).collect();
        let mut all = BodyCandidates { list, tree: Bvh::new(&boxes), balls: Vec::new() };
        let Some(bounds_of_all) = all.tree.bounds() else { return all };
        let mut balls = Vec::new();
        for ball in self.swarm.ball_views() {
            let speed = cast_vector::<S, f64>(ball.velocity).magnitude();
            let way = speed * dt + MARGIN * ball.radius();
            let center = Aabb { min: ball.center(), max: ball.center() };
            let bounds = grown(&center, ball.radius() + way);
            if bounds_of_all.overlaps(&bounds) {
                all.for_each_in_box(&bounds, |near| {
                    if states[near.row].body.layers.interacts_with(ball.layers) {
                        balls.push(NearBall { ball, row: near.row, way });
                    }
                });
            }
        }
        all.balls = balls;
        all
    }

    fn collide_bodies_with_balls(
        &self,
        candidates: &BodyCandidates<S>,
        apart: &BTreeSet<[JointHeld; 2]>,
        system: &mut BodySystem,
    ) {
        for &NearBall { ref ball, row, way } in &candidates.balls {
            let state = &self.bodies.states[row];
            let Some(body) = self.bodies.id(row) else { continue };
            if self.swarm.is_asleep(ball.id) && state.is_still() {
                continue; // their contact is kept
            }
            let marble = || {
                let slots = &self.scratch.soft_step.marble_of_slot;
                self.marbles.id(*slots.get(ball.slot as usize)? as usize)
            };
            if !apart.is_empty()
                && marble().is_some_and(|marble| {
                    apart.contains(&[JointHeld::Marble(marble), JointHeld::Body(body)])
                })
            {
                continue;
            }
            let local = state.solver.pose.inverse_transform_point(ball.center());
            let reach = ball.radius() + candidates.list[row].margin + way;
            for (part, shape) in (0..).zip(state.parts.iter()) {
                if shape.project_point(local).distance > reach {
                    continue;
                }
                let known = system.bodies.last().is_some_and(|last| last.slot == ball.slot);
                if !known {
                    system.bodies.push(SolverBody::ball(ball.slot));
                }
                let bodies = [(system.bodies.len() - 1) as u32, row as u32];
                let key =
                    BodyContactKey { partner: BodyPartner::Ball(ball.id), body, parts: [0, part] };
                let material = ball.material.combined_with(state.body.material).cast();
                system.contacts.push(ball_contact(key, bodies, ball.radius(), material));
            }
        }
    }
}
