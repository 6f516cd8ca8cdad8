//! Contacts of bodies, told as those of marbles are.

use taw::body::ContactPartner;

use crate::contact_points::ContactKey;
use crate::convert::{from_point, from_vector};
use crate::messages::{ContactEvent, ContactPair, ContactPoint};
use crate::resources::TawWorld;

/// Contacts of bodies that touch, after they are solved, with their keys; those with balls of swarms are left out.
pub(crate) fn body_touches(
    world: &TawWorld,
) -> impl Iterator<Item = (ContactKey, ContactPoint)> + '_ {
    world.body_contacts().filter(|contact| contact.is_touching).filter_map(|contact| {
        let body = *world.body_entities.get(&contact.body)?;
        let [of_partner, of_body] = contact.parts;
        let (partner, part) = match contact.partner {
            ContactPartner::Wall(id) => (world.wall_entities.get(&id), of_partner),
            ContactPartner::Marble(id) => (world.marble_entities.get(&id), of_body),
            ContactPartner::Body(id) => (world.body_entities.get(&id), of_partner),
            ContactPartner::Ball(_) => return None,
        };
        let partner = *partner?;
        let is_wall = matches!(contact.partner, ContactPartner::Wall(_));
        let is_swapped = !is_wall && body < partner;
        let point = ContactPoint {
            pair: ContactPair { a: partner, b: body },
            normal: from_vector(contact.normal),
            point: from_point(contact.point),
            part: if is_swapped { of_body } else { part },
            is_new: false,
            approach_speed: contact.approach_speed,
            slip_speed: contact.slip_speed,
            normal_impulse: contact.normal_impulse,
            tangent_impulse: from_vector(contact.tangent_impulse),
        };
        let point = if is_swapped { point.swapped() } else { point };
        Some(((point.pair, contact.parts, contact.feature), point))
    })
}
