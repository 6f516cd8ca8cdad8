//! Bodies and their contacts within a step.

use std::sync::Arc;

use cgmath::{EuclideanSpace, InnerSpace, Zero};

use super::contact::{BodyContact, BodyPartner};
use super::solve::SubstepParams;
use super::state::SolverBody;
use crate::constraint::ContactSoftness;
use crate::contact::{as_convex, shape_cast};
use crate::handle::NO_ROW;
use crate::math::{Point3, Vec3};
use crate::shape::{BoundedShape, Shape, Sphere};

/// Way of a ball in a substep, in radii, from which on it is swept.
const FAST: f64 = 0.5;
/// Number of looks for bounces in a substep while any is found. What meets after that is stopped.
const ROUNDS: usize = 4;

/// Bodies and their contacts, as the solver has them for a step.
#[derive(Clone, Debug, Default)]
pub(crate) struct BodySystem {
    /// Rigid bodies, and after them the walls and the balls that they may touch.
    pub bodies: Vec<SolverBody>,
    /// Convex parts of the rigid bodies, along their principal axes.
    pub parts: Vec<Arc<[Shape<f64>]>>,
    /// Contacts in the order in which they are solved.
    pub contacts: Vec<BodyContact>,
    params: Option<SubstepParams>,
}

impl BodySystem {
    /// System of rigid bodies and their parts, without contacts.
    pub fn new(bodies: Vec<SolverBody>, parts: Vec<Arc<[Shape<f64>]>>) -> Self {
        Self { bodies, parts, contacts: Vec::new(), params: None }
    }

    /// Returns true if there are no rigid bodies.
    pub fn is_empty(&self) -> bool {
        self.parts.is_empty()
    }

    /// Begins a substep of `h` seconds: forces change velocities, and contacts are where bodies are. Those that
    /// approach by less than `threshold` m/s do not bounce.
    pub fn begin_substep(&mut self, h: f64, threshold: f64, softness: ContactSoftness<f64>) {
        self.params = Some(SubstepParams { h, threshold, softness });
        self.update_contacts(h);
        for contact in &mut self.contacts {
            contact.forget_impacts(threshold);
        }
        // Balls have their gravity already.
        self.accelerate_balls(-h);
        self.bounce();
        self.accelerate_balls(h);
        for body in &mut self.bodies {
            body.accelerate(h);
        }
        for contact in &mut self.contacts {
            contact.note_approach(&self.bodies);
        }
    }

    fn accelerate_balls(&mut self, h: f64) {
        for ball in self.bodies.iter_mut().filter(|body| body.slot != NO_ROW) {
            ball.velocity += ball.acceleration * h;
        }
    }

    /// Lets bodies bounce that meet, and those that these meet then.
    fn bounce(&mut self) {
        let Some(params) = self.params else { return };
        for _ in 0..ROUNDS {
            let mut any = false;
            for contact in &mut self.contacts {
                any |= contact.bounce(&mut self.bodies, &params);
            }
            if !any {
                break;
            }
        }
    }

    /// Applies the impulses of the last substep.
    pub fn warm_start(&mut self) {
        for contact in &self.contacts {
            contact.warm_start(&mut self.bodies);
        }
    }

    /// Solves contacts before positions move on.
    pub fn solve(&mut self) {
        self.pass(true);
    }

    /// Makes velocities at the end of a substep those that contacts allow.
    pub fn relax(&mut self) {
        let Some(SubstepParams { h, .. }) = self.params else { return };
        self.update_contacts(h);
        self.pass(false);
        for point in self.contacts.iter_mut().flat_map(|contact| &mut contact.points) {
            point.total = point.total.plus(point.impulse);
        }
    }

    fn pass(&mut self, soft: bool) {
        let Some(params) = self.params else { return };
        for contact in &mut self.contacts {
            contact.solve(&mut self.bodies, &params, soft);
        }
    }

    /// Moves bodies and walls on by `h` seconds.
    pub fn advance(&mut self, h: f64) {
        let borne = self.borne();
        for (body, borne) in self.bodies.iter_mut().zip(borne) {
            let fall = body.fall(h, borne);
            body.advance(h, fall);
        }
    }

    /// True for each body that contacts press in this substep.
    pub fn borne(&self) -> Vec<bool> {
        let mut borne = vec![false; self.bodies.len()];
        for contact in self.contacts.iter().filter(|contact| contact.presses()) {
            for body in contact.bodies {
                borne[body as usize] = true;
            }
        }
        borne
    }

    /// Slots of the balls that bodies bear in this substep.
    pub fn borne_balls(&self) -> impl Iterator<Item = u32> + '_ {
        let pressed = self.contacts.iter().filter(|contact| contact.presses());
        let partners = pressed.map(|contact| self.bodies[contact.bodies[0] as usize].slot);
        partners.filter(|slot| *slot != NO_ROW)
    }

    /// Finds separations and arms where bodies are now.
    fn update_contacts(&mut self, h: f64) {
        for contact in &mut self.contacts {
            if let BodyPartner::Ball(_) = contact.key.partner {
                let [ball, body] = contact.bodies.map(|body| &self.bodies[body as usize]);
                let part = &self.parts[contact.bodies[1] as usize][contact.key.parts[1] as usize];
                contact.update_ball(ball, body, part, h);
            } else {
                contact.update(&self.bodies);
            }
        }
    }
}

impl BodyContact {
    /// Returns true if it bore something in this step.
    pub fn bore(&self) -> bool {
        self.points.iter().any(|point| point.total.normal > 0.0)
    }

    /// Returns true if it bears something in this substep.
    pub fn presses(&self) -> bool {
        self.points.iter().any(|point| point.impulse.normal > 0.0)
    }

    /// Finds the point where a ball is nearest to a part of a body, or where it meets that in the next `h` seconds
    /// if it is fast. One that will pass by does not touch.
    pub(super) fn update_ball(
        &mut self,
        ball: &SolverBody,
        body: &SolverBody,
        part: &Shape<f64>,
        h: f64,
    ) {
        let [radius, _] = self.radii;
        let center = Point3::from_vec(ball.pose.translation);
        let local = body.pose.inverse_transform_point(center);
        let mut near = part.project_point(local);
        let mut gap = near.distance - radius;
        let arm = body.pose.transform_vector(near.point.to_vec());
        let way = (ball.velocity - body.velocity_at(arm)) * h;
        if gap > 0.0 && way.magnitude2() > FAST * FAST * radius * radius {
            let way = body.pose.inverse_transform_vector(way);
            match time_to_part(local, radius, part, way) {
                Some(time) => {
                    near = part.project_point(local + way * time);
                    gap = -way.dot(near.normal) * time;
                }
                None => gap = f64::INFINITY,
            }
        }
        self.normal = -body.pose.transform_vector(near.normal).normalize();
        for point in &mut self.points {
            point.separation = gap;
            point.place = ball.pose.translation + self.normal * radius;
            point.arms = [self.normal * radius, body.pose.transform_vector(near.point.to_vec())];
            let tangent = point.impulse.tangent;
            point.impulse.tangent = tangent - self.normal * tangent.dot(self.normal);
        }
    }
}

/// Time at which a ball that goes this way meets a convex shape that stands, as a fraction of the way.
fn time_to_part(
    center: Point3<f64>,
    radius: f64,
    part: &Shape<f64>,
    way: Vec3<f64>,
) -> Option<f64> {
    let ball = Sphere { center, radius };
    let still = Vec3::zero();
    as_convex(part).and_then(|part| shape_cast(part, still, &ball, way)).map(|hit| hit.time)
}
