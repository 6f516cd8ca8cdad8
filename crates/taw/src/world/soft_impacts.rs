//! Impacts within a step of [`Response::SoftStep`](crate::response::Response::SoftStep): contacts
//! that begin while it is solved, and may end in it, too.

use cgmath::InnerSpace;

use super::World;
use super::continuous::{Frame, MovingWall, RelativePath, WallImpact};
use crate::contact::{Contact, time_of_impact_sphere_sphere};
use crate::math::{Scalar, Vec3, cast_vector, length, normal_and_distance};
use crate::response::{Colliders as _, Impact};
use crate::shape::{BoundedShape, Sphere};

/// Impacts that free motion has in the step.
#[derive(Clone, Debug)]
pub(super) struct PredictedImpacts<S> {
    list: Vec<PredictedImpact<S>>,
    /// Walls other than half-spaces that move.
    moving: Vec<MovingWall<S>>,
    /// Number of removals and of marbles when they were predicted.
    rows: (u64, usize),
}

/// Impact, and the velocities of the marbles before the step, in m/s.
#[derive(Clone, Copy, Debug)]
struct PredictedImpact<S> {
    impact: Impact<S>,
    velocity: [Vec3<S>; 2],
}

impl<S> Default for PredictedImpacts<S> {
    fn default() -> Self {
        Self { list: Vec::new(), moving: Vec::new(), rows: (0, 0) }
    }
}

/// Part of the push of an impact without restitution that shows that it took place. More than that of
/// rounding, and less than any: a speculative contact may stop one body at the surface of the other
/// in this step, and take the rest of the speed in the next one.
const CONFIRMING: f64 = 1e-3;

impl<S: Scalar> World<S> {
    /// Predicts which listed contacts begin within the step of `dt` seconds.
    pub(super) fn predict_impacts(&mut self, dt: S) {
        let PredictedImpacts { mut list, mut moving, .. } =
            std::mem::take(&mut self.scratch.soft_step.predicted);
        list.clear();
        let at_walls = self.contacts.wm.iter();
        list.extend(at_walls.filter_map(|contact| self.predict_wall_impact(contact, dt)));
        let of_pairs = self.contacts.mm.iter();
        list.extend(of_pairs.filter_map(|contact| self.predict_pair_impact(contact, dt)));
        MovingWall::list(&self.walls, dt, &mut moving);
        for wall in &moving {
            self.predict_impacts_of(wall, dt, &mut list);
        }
        let rows = (self.marbles.removals(), self.marbles.len());
        self.scratch.soft_step.predicted = PredictedImpacts { list, moving, rows };
    }

    /// Predicts the impacts of a wall that moves: its contacts are found anew in each substep, and
    /// those that are listed are of the places of the last one.
    fn predict_impacts_of(&self, wall: &MovingWall<S>, dt: S, list: &mut Vec<PredictedImpact<S>>) {
        for row in 0..self.marbles.len() {
            let (sphere, velocity) = (self.marbles.sphere(row), self.marbles.velocity[row]);
            let half = S::from_f64(0.5) * dt;
            let displacement = (velocity + self.soft_acceleration(row) * half) * dt;
            let end = Sphere { center: sphere.center + displacement, ..sphere };
            if !wall.is_near(&sphere.bounding_box().union(&end.bounding_box()))
                || !wall.collides(&self.walls, self.marbles.layers_of_row(row))
            {
                continue;
            }
            let frame = Frame::Moving(wall.motion, dt);
            let path = RelativePath { start: sphere.center, displacement, frame };
            let mut first: Option<WallImpact<S>> = None;
            wall.for_each_near_path(&self.walls, &path, sphere.radius, |part| {
                let impact = self.walls.time_of_impact(part, sphere.radius, &path);
                if let Some(impact) = impact
                    && first.as_ref().is_none_or(|first| impact.time < first.time)
                {
                    first = Some(impact);
                }
            });
            let Some(WallImpact { time, normal, .. }) = first else { continue };
            let point = sphere.center + displacement * time - normal * sphere.radius;
            let surface = wall.motion.velocity_at(point);
            let approach_speed = (surface - velocity).dot(normal);
            let at_once = time <= S::zero() && !self.is_fast(approach_speed, dt);
            let b = row as u32;
            let known = |it: &PredictedImpact<S>| it.impact.on_wall && it.impact.a == wall.row;
            if at_once || list.iter().any(|it| known(it) && it.impact.b == b) {
                continue;
            }
            let impact = Impact { a: wall.row, on_wall: true, b, normal, point, approach_speed };
            list.push(PredictedImpact { impact, velocity: [surface, velocity] });
        }
    }

    /// Returns true if two that touch already come together faster than gravity makes rest within
    /// two steps: their impact is now.
    fn meet_now(&self, contact: &Contact<S>, approach_speed: S, dt: S) -> bool {
        contact.is_touching() && self.is_fast(approach_speed, dt)
    }

    /// Returns true for an approach faster than gravity makes rest within two steps.
    fn is_fast(&self, approach_speed: S, dt: S) -> bool {
        approach_speed > length(self.settings.gravity) * dt * S::from_f64(2.0)
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
        let begin_speed = approach_speed;
        let (normal, approach_speed) = (contact.normal, square.sqrt());
        let time = separation * two / (begin_speed + approach_speed);
        let fall = self.soft_acceleration(b) * (time * time * half);
        let point = position + contact.arms[1] + velocity * time + fall;
        let impact = Impact { a: wall, on_wall: true, b: contact.b, normal, point, approach_speed };
        Some(PredictedImpact { impact, velocity: [surface, velocity] })
    }

    /// Impact of two marbles that fly straight relative to each other.
    fn predict_pair_impact(&self, contact: &Contact<S>, dt: S) -> Option<PredictedImpact<S>> {
        let rows = [contact.a, contact.b].map(|row| row as usize);
        let [a, b] = rows.map(|row| self.marbles.sphere(row));
        let velocity = rows.map(|row| self.marbles.velocity[row]);
        let ways = velocity.map(|velocity| velocity * dt);
        let meet_now = self.meet_now(contact, (velocity[0] - velocity[1]).dot(contact.normal), dt);
        let later = || time_of_impact_sphere_sphere(&a, ways[0], &b, ways[1]);
        let time = if meet_now { S::zero() } else { later().filter(|_| !contact.is_touching())? };
        let apart = b.center - a.center + (ways[1] - ways[0]) * time;
        let (normal, _) = normal_and_distance(apart, [contact.a, contact.b]);
        let approach_speed = (velocity[0] - velocity[1]).dot(normal);
        let point = a.center + ways[0] * time + normal * a.radius;
        let Contact { a, b, .. } = *contact;
        let impact = Impact { a, on_wall: false, b, normal, point, approach_speed };
        Some(PredictedImpact { impact, velocity })
    }

    /// Lists the predicted impacts that took place: both bodies were pushed apart. (Who was stopped
    /// by something else on the way left the other one as it was.)
    pub(super) fn list_impacts(&mut self, dt: S) {
        let predicted = std::mem::take(&mut self.scratch.soft_step.predicted);
        if predicted.rows == (self.marbles.removals(), self.marbles.len()) {
            let took_place =
                predicted.list.iter().filter(|predicted| self.took_place(predicted, dt));
            let impacts: Vec<_> = took_place.map(|predicted| predicted.impact).collect();
            self.impacts.extend(impacts);
        }
        self.scratch.soft_step.predicted = predicted;
        self.scratch.soft_step.predicted.list.clear();
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
            // Rows are of single precision, whatever the world is.
            let rounding = (now.magnitude() + before.magnitude()) * S::from_f64(1e-6);
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
