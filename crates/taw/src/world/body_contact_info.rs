//! Contacts of rigid bodies, to be read.

use super::World;
use crate::body::{BodyContact, BodyContactInfo, BodyContactPoint, BodyPartner, ContactPartner};
use crate::handle::BallId;
use crate::math::{Point3, Scalar, cast_point, cast_vector};
use cgmath::EuclideanSpace;

impl<S: Scalar> World<S> {
    /// Contact points of rigid bodies in the last step, also of those that only came near
    /// ([`is_touching`](BodyContactInfo::is_touching) tells), in a fixed order. What sleeps keeps its contacts.
    ///
    /// ```
    /// use taw::body::{Body, ContactPartner};
    /// use taw::prelude::*;
    ///
    /// # fn main() -> Result<(), taw::Error> {
    /// let mut world = World::<f64>::default();
    /// world.set_model(Model::GAME)?;
    /// world.set_gravity(Vec3::new(0.0, -9.81, 0.0))?;
    /// let floor = world.walls.insert(Plane::new(Vec3::unit_y(), 0.0)?)?;
    /// let half = Vec3::new(0.1, 0.1, 0.1);
    /// let crate_ = world.bodies.insert(Body::cuboid(half, Point3::new(0.0, 0.1, 0.0)))?;
    /// for _ in 0..30 {
    ///     world.step(1.0 / 60.0)?;
    /// }
    /// let on_floor = world.body_contacts().filter(|it| it.partner == ContactPartner::Wall(floor));
    /// let force: f64 = on_floor.map(|contact| contact.normal_impulse * 60.0).sum();
    /// assert!((force / (20.0 * 9.81) - 1.0).abs() < 1e-3, "20 kg of glass: {force} N");
    /// # Ok(())
    /// # }
    /// ```
    pub fn body_contacts(&self) -> impl Iterator<Item = BodyContactInfo<S>> + '_ {
        self.bodies.contacts.iter().flat_map(move |contact| {
            let points = contact.points.iter();
            points.filter_map(move |point| self.body_contact_info(contact, point))
        })
    }

    fn body_contact_info(
        &self,
        contact: &BodyContact,
        point: &BodyContactPoint,
    ) -> Option<BodyContactInfo<S>> {
        let partner = match contact.key.partner {
            BodyPartner::Body(id) => ContactPartner::Body(id),
            BodyPartner::Wall(id) => ContactPartner::Wall(id),
            BodyPartner::Ball(id) => self.partner_of_ball(id)?,
        };
        let body = contact.key.body;
        let center = self.bodies.states[self.bodies.row(body).ok()?].solver.pose.translation;
        let [approach_speed, slip_speed] = point.fastest.map(S::from_f64);
        Some(BodyContactInfo {
            body,
            partner,
            parts: contact.key.parts,
            feature: point.feature,
            normal: cast_vector(contact.normal),
            point: cast_point(Point3::from_vec(center + point.arms[1])),
            separation: S::from_f64(point.separation),
            is_touching: point.touches,
            approach_speed,
            slip_speed,
            normal_impulse: S::from_f64(point.total.normal),
            tangent_impulse: cast_vector(point.total.tangent),
        })
    }

    /// Ball or the marble that it is; none if it is gone.
    fn partner_of_ball(&self, ball: BallId) -> Option<ContactPartner> {
        let row = self.swarm.row(ball).ok()?;
        if !self.swarm.is_marble(row) {
            return Some(ContactPartner::Ball(ball));
        }
        let slot = self.swarm.slot_of(ball)?;
        let row = *self.scratch.soft_step.marble_of_slot.get(slot as usize)?;
        let marble = self.marbles.id(row as usize)?;
        // Marbles may have come and gone since the step.
        let known = self.swarm.body_balls.binary_search_by_key(&marble, |(marble, _)| *marble);
        let is_known = known.is_ok_and(|at| self.swarm.body_balls[at].1 == ball);
        is_known.then_some(ContactPartner::Marble(marble))
    }
}
