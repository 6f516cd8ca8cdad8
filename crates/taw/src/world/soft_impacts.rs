//! Impacts within a step of [`Response::SoftStep`](crate::response::Response::SoftStep): contacts
//! that begin while it is solved, and may end in it, too.

use std::collections::HashSet;

use cgmath::{InnerSpace, Zero};

use super::World;
use super::continuous::{Frame, MovingWall, RelativePath, WallImpact};
use super::marbles::Marbles;
use super::walls::SubShape;
use crate::contact::{Contact, Contacts, time_of_impact_sphere_sphere};
use crate::handle::NO_ROW;
use crate::math::{Point3, RealVector, Scalar, Vec3, cast_vector, length, normal_and_distance};
use crate::response::{Colliders as _, Impact};
use crate::shape::{BoundedShape, Sphere};

/// Impacts that free motion has in the step.
#[derive(Clone, Debug, Default)]
pub(super) struct PredictedImpacts<S> {
    list: Vec<PredictedImpact<S>>,
    /// Walls other than half-spaces that move.
    moving: Vec<MovingWall<S>>,
    /// For each marble, true if it has a listed contact with the wall at hand.
    listed: Vec<bool>,
    /// Number of removals and of marbles when they were predicted.
    rows: (u64, usize),
}

/// Impact, and the velocities of the marbles before the step, in m/s.
#[derive(Clone, Copy, Debug)]
struct PredictedImpact<S> {
    impact: Impact<S>,
    velocity: [Vec3<S>; 2],
}

impl<S: Scalar> PredictedImpacts<S> {
    /// Returns true if no row has gone or come since.
    pub fn are_of(&self, marbles: &Marbles<S>) -> bool {
        self.rows == (marbles.removals(), marbles.len())
    }
}

/// Contacts of a chunk, and the impacts that they predict: at walls, and of pairs.
#[derive(Clone, Debug, Default)]
pub(super) struct ChunkContacts<S> {
    pub contacts: Contacts<S>,
    /// Contacts of pairs that may come together, by index.
    pub meetings: Vec<u32>,
    predicted: [Vec<PredictedImpact<S>>; 2],
}

impl<S: Scalar> ChunkContacts<S> {
    pub fn clear(&mut self) {
        self.contacts.clear();
        self.meetings.clear();
        self.predicted.iter_mut().for_each(Vec::clear);
    }
}

/// Part of the push of an impact without restitution that shows that it took place. More than that of
/// rounding, and less than any: a speculative contact may stop one body at the surface of the other
/// in this step, and take the rest of the speed in the next one.
const CONFIRMING: f64 = 1e-3;
/// Part by which an approach speed may differ from the one that decided what bounces.
const ROUNDING: f64 = 1e-3;
/// Roundings of a speed in a step: together a part in a million in `f32`, 1e-6 · 2²³.
const SPEED_ROUNDINGS: f64 = 8.388_608;

/// Drops those of the last list, of fast movers, that a chunk lists, too: such a pair is solved twice, and
/// is one contact.
pub(super) fn drop_listed_twice<S: Scalar>(lists: &mut [ChunkContacts<S>], marbles: usize) {
    let Some((of_movers, of_chunks)) = lists.split_last_mut() else { return };
    if of_movers.contacts.mm.is_empty() {
        return;
    }
    let mut is_first = vec![false; marbles];
    for contact in &of_movers.contacts.mm {
        is_first[contact.a as usize] = true;
    }
    let of_chunks = of_chunks.iter().flat_map(|list| &list.contacts.mm);
    let listed = of_chunks.filter(|contact| is_first[contact.a as usize]);
    let listed: HashSet<_> = listed.map(|contact| (contact.a, contact.b)).collect();
    of_movers.contacts.mm.retain(|contact| !listed.contains(&(contact.a, contact.b)));
    let is_new = |it: &PredictedImpact<S>| !listed.contains(&(it.impact.a, it.impact.b));
    of_movers.predicted[1].retain(is_new);
}

/// Identity of the two that meet.
fn pair_of<S>(impact: &Impact<S>) -> (bool, u32, u32) {
    (impact.on_wall, impact.a, impact.b)
}

/// Impact of marbles, given that of slots; none if balls of the swarm take part.
fn of_marbles<S: Scalar>(impact: &Impact<S>, marbles: &[u32]) -> Option<Impact<S>> {
    let marble = |slot: u32| marbles.get(slot as usize).copied().filter(|marble| *marble != NO_ROW);
    let b = marble(impact.b)?;
    let a = if impact.on_wall { impact.a } else { marble(impact.a)? };
    let listed = Impact { a, b, ..*impact };
    Some(if !impact.on_wall && b < a { listed.reversed() } else { listed })
}

impl<S: Scalar> World<S> {
    /// Walls other than half-spaces that move within `dt` seconds.
    pub(super) fn list_moving_walls(&mut self, dt: S) -> Vec<MovingWall<S>> {
        let mut moving = std::mem::take(&mut self.scratch.soft_step.predicted.moving);
        MovingWall::list(&self.walls, dt, &mut moving);
        moving
    }

    /// Predicts which contacts of a chunk begin within the step of `dt` seconds.
    pub(super) fn predict_impacts(
        &self,
        ChunkContacts { contacts, meetings, predicted: [at_walls, of_pairs] }: &mut ChunkContacts<
            S,
        >,
        moving: &[MovingWall<S>],
        dt: S,
    ) {
        let is_current = |contact: &&Contact<S>| {
            contact.is_touching() || moving.iter().all(|wall| wall.row != contact.a)
        };
        let current = contacts.wm.iter().filter(is_current);
        at_walls.extend(current.filter_map(|contact| self.predict_wall_impact(contact, dt)));
        let pairs = meetings.iter().map(|index| &contacts.mm[*index as usize]);
        of_pairs.extend(pairs.filter_map(|contact| self.predict_pair_impact(contact, dt)));
    }

    /// Collects the impacts that chunks predict, and those of walls that move.
    pub(super) fn collect_predicted(
        &mut self,
        lists: &mut [ChunkContacts<S>],
        moving: Vec<MovingWall<S>>,
        dt: S,
    ) {
        let PredictedImpacts { mut list, mut listed, .. } =
            std::mem::take(&mut self.scratch.soft_step.predicted);
        list.clear();
        for part in 0..2 {
            for of_chunk in &mut *lists {
                list.append(&mut of_chunk.predicted[part]);
            }
        }
        for wall in &moving {
            self.predict_impacts_of(wall, dt, (&mut listed, &mut list));
        }
        let rows = (self.marbles.removals(), self.marbles.len());
        self.scratch.soft_step.predicted = PredictedImpacts { list, moving, listed, rows };
    }

    /// Predicts the impacts of a wall that moves on marbles that have no listed contact with it: contacts
    /// with shapes are listed of where these were at the end of the last step.
    fn predict_impacts_of(
        &self,
        wall: &MovingWall<S>,
        dt: S,
        (listed, list): (&mut Vec<bool>, &mut Vec<PredictedImpact<S>>),
    ) {
        listed.clear();
        listed.resize(self.marbles.len(), false);
        let of_wall = |contact: &&Contact<S>| contact.a == wall.row && contact.is_touching();
        for contact in self.contacts.wm.iter().filter(of_wall) {
            listed[contact.b as usize] = true;
        }
        let marbles = &self.scratch.soft_step.marble_of_slot;
        for slot in self.swarm.slots_near_shapes() {
            let row = marbles.get(slot as usize).map_or(NO_ROW, |row| *row);
            if row != NO_ROW && !std::mem::replace(&mut listed[row as usize], true) {
                list.extend(self.predict_moving_wall_impact(wall, row, dt));
            }
        }
    }

    /// Impact of a wall that moves on a marble that it does not touch yet.
    fn predict_moving_wall_impact(
        &self,
        wall: &MovingWall<S>,
        b: u32,
        dt: S,
    ) -> Option<PredictedImpact<S>> {
        let row = b as usize;
        let (sphere, velocity) = (self.marbles.sphere(row), self.marbles.velocity[row]);
        let half = S::from_f64(0.5) * dt;
        let displacement = (velocity + self.soft_acceleration(row) * half) * dt;
        let end = Sphere { center: sphere.center + displacement, ..sphere };
        let bounds = sphere.bounding_box().union(&end.bounding_box());
        if !wall.is_near(&bounds) || !wall.collides(&self.walls, self.marbles.filter_of_row(row)) {
            return None;
        }
        let frame = Frame::Moving(wall.motion, dt);
        let path = RelativePath { start: sphere.center, displacement, frame };
        let mut first: Option<WallImpact<S>> = None;
        wall.for_each_near_path(&self.walls, &path, sphere.radius, |part| {
            let impact = self.walls.time_of_impact(part, sphere.radius, &path);
            let is_first = |impact: &WallImpact<S>| {
                first.as_ref().is_none_or(|first| impact.time < first.time)
            };
            if let Some(impact) = impact.filter(is_first) {
                first = Some(impact);
            }
        });
        let WallImpact { time, normal, part: SubShape { index: part, .. }, .. } = first?;
        let point = sphere.center + displacement * time - normal * sphere.radius;
        let surface = wall.motion.velocity_at(point);
        let at_impact = velocity + self.soft_acceleration(row) * (dt * time);
        let approach_speed = (surface - at_impact).dot(normal);
        if approach_speed <= S::zero() {
            return None;
        }
        let place = (part, normal, point);
        Some(self.predicted((wall.row, true), b, place, approach_speed, [surface, velocity]))
    }

    /// Speed that gravity makes of rest within two steps, in m/s.
    pub(super) fn resting_speed(&self, dt: S) -> S {
        length(self.settings.gravity) * dt * S::from_f64(2.0)
    }

    /// Returns true if two that touch already come together faster than gravity makes rest within
    /// two steps: their impact is now.
    fn meet_now(&self, contact: &Contact<S>, approach_speed: S, dt: S) -> bool {
        contact.is_touching() && approach_speed > self.resting_speed(dt)
    }

    /// Impact of a marble that flies along its parabola to the plane of its contact.
    fn predict_wall_impact(&self, contact: &Contact<S>, dt: S) -> Option<PredictedImpact<S>> {
        let (wall, b) = (contact.a, contact.b as usize);
        let (position, velocity) = (*self.marbles.position.get(b)?, *self.marbles.velocity.get(b)?);
        let surface = {
            let point = position + contact.arms[1];
            self.walls.surface_velocity(wall as usize, point, contact.normal)
        };
        let approach_speed = (surface - velocity).dot(contact.normal);
        let acceleration = -self.soft_acceleration(b).dot(contact.normal);
        let separation = contact.separation.max(S::zero());
        let (half, two) = (S::from_f64(0.5), S::from_f64(2.0));
        let square = approach_speed * approach_speed + acceleration * separation * two;
        let comes = (approach_speed + acceleration * dt * half) * dt >= separation;
        let later = !contact.is_touching() && comes && square > S::zero();
        if !later && !self.meet_now(contact, approach_speed, dt) {
            return None;
        }
        let start_speed = approach_speed;
        let (normal, approach_speed) = (contact.normal, square.sqrt());
        let time = (separation * two / (start_speed + approach_speed)).min(dt);
        let fall = self.soft_acceleration(b) * (time * time * half);
        let point = position + contact.arms[1] + velocity * time + fall;
        let place = (contact.part, normal, point);
        let velocities = [surface, velocity];
        Some(self.predicted((wall, true), contact.b, place, approach_speed, velocities))
    }

    /// Impact of two marbles that fly straight relative to each other.
    fn predict_pair_impact(&self, contact: &Contact<S>, dt: S) -> Option<PredictedImpact<S>> {
        let rows = [contact.a, contact.b].map(|row| row as usize);
        let velocity = rows.map(|row| self.marbles.velocity[row]);
        let approach_speed = (velocity[0] - velocity[1]).dot(contact.normal);
        let meet_now = self.meet_now(contact, approach_speed, dt);
        if !meet_now && contact.is_touching() {
            return None;
        }
        let [a, b] = rows.map(|row| self.marbles.sphere(row));
        let ways = velocity.map(|velocity| velocity * dt);
        let time = if meet_now {
            S::zero()
        } else {
            time_of_impact_sphere_sphere(&a, ways[0], &b, ways[1])?
        };
        let apart = b.center - a.center + (ways[1] - ways[0]) * time;
        let (normal, _) = normal_and_distance(apart, [contact.a, contact.b]);
        let approach_speed = (velocity[0] - velocity[1]).dot(normal);
        let point = a.center + ways[0] * time + normal * a.radius;
        let Contact { a, b, .. } = *contact;
        Some(self.predicted((a, false), b, (0, normal, point), approach_speed, velocity))
    }

    /// Impact of a wall or a marble `a` on a marble `b`, which have these velocities before it.
    fn predicted(
        &self,
        (a, on_wall): (u32, bool),
        b: u32,
        (part, normal, point): (u32, Vec3<S>, Point3<S>),
        approach_speed: S,
        velocity: [Vec3<S>; 2],
    ) -> PredictedImpact<S> {
        // Radius times spin, as the arms of both lie along the normal.
        let turning = |row: u32| {
            let spin = self.marbles.angular_velocity.get(row as usize).copied();
            spin.map_or_else(Vec3::zero, |spin| spin * self.marbles.radius[row as usize])
        };
        let inverse_mass = |row: u32| S::one() / self.marbles.mass(row as usize);
        let (of_a, turning_a) =
            if on_wall { (S::zero(), Vec3::zero()) } else { (inverse_mass(a), turning(a)) };
        let relative = velocity[1] - velocity[0];
        let slip = relative.reject_from(normal) - (turning_a + turning(b)).cross(normal);
        let sum = of_a + inverse_mass(b);
        let stop = if sum > S::zero() { approach_speed / sum } else { S::zero() };
        let impulse = normal * stop;
        let impact = Impact { a, on_wall, b, part, normal, point, approach_speed, slip, impulse };
        PredictedImpact { impact, velocity }
    }

    /// Lists the bounces as they were solved. What does not bounce is stopped by its contact: of these,
    /// the predicted impacts that took place, as both bodies were pushed apart. (Who was stopped by
    /// something else on the way left the other one as it was.)
    pub(super) fn list_impacts(&mut self, dt: S) {
        let before = self.impacts.len();
        let marbles = &self.scratch.soft_step.marble_of_slot;
        let noted = self.swarm.noted_impacts().iter();
        self.impacts.extend(noted.filter_map(|impact| of_marbles(impact, marbles)));
        let mut told: Vec<_> = self.impacts[before..].iter().map(pair_of).collect();
        told.sort_unstable();
        let predicted = std::mem::take(&mut self.scratch.soft_step.predicted);
        if predicted.are_of(&self.marbles) {
            let took_place = predicted.list.iter().filter(|predicted| {
                let impact = &predicted.impact;
                told.binary_search(&pair_of(impact)).is_err()
                    && !self.bounces(impact, dt)
                    && self.took_place(predicted, dt)
            });
            let impacts: Vec<_> = took_place.map(|predicted| predicted.impact).collect();
            self.impacts.extend(impacts);
        }
        self.scratch.soft_step.predicted = predicted;
        self.scratch.soft_step.predicted.list.clear();
    }

    /// Returns true for an impact that the solver notes if it happens: one fast enough to bounce.
    fn bounces(&self, impact: &Impact<S>, dt: S) -> bool {
        let material = if impact.on_wall {
            self.wall_contact_material(impact.a, impact.b as usize)
        } else {
            self.marbles.contact_material(impact.a as usize, impact.b as usize)
        };
        let substep = dt / S::from_f64(f64::from(self.settings.model.substeps));
        let threshold =
            length(self.settings.gravity) * substep * S::from_f64(2.0 * (1.0 + ROUNDING));
        material.restitution > S::zero() && impact.approach_speed > threshold
    }

    fn took_place(&self, PredictedImpact { impact, velocity }: &PredictedImpact<S>, dt: S) -> bool {
        let (a, b) = (impact.a as usize, impact.b as usize);
        let inverse_mass = |row: usize| S::one() / self.marbles.mass(row);
        let of_a = if impact.on_wall { S::zero() } else { inverse_mass(a) };
        let sum = of_a + inverse_mass(b);
        let pushed = |row: usize, before: Vec3<S>, normal: Vec3<S>, inverse_mass: S| {
            let now = self.marbles.velocity[row];
            let push = (now - before - self.soft_acceleration(row) * dt).dot(normal);
            let alone = impact.approach_speed * inverse_mass / sum;
            let roundings = S::from_f64(SPEED_ROUNDINGS) * S::epsilon();
            let rounding = (now.magnitude() + before.magnitude()) * roundings;
            alone <= rounding || push > alone * S::from_f64(CONFIRMING)
        };
        let first = impact.on_wall || pushed(a, velocity[0], -impact.normal, of_a);
        sum > S::zero() && first && pushed(b, velocity[1], impact.normal, inverse_mass(b))
    }

    /// Acceleration of a marble by gravity and forces in this step, in m/s².
    fn soft_acceleration(&self, row: usize) -> Vec3<S> {
        self.scratch
            .accelerations
            .get(row)
            .map_or(self.settings.gravity, |acceleration| cast_vector(*acceleration))
    }
}
