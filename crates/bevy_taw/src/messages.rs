//! Contacts that start, go on and end.
//!
//! Messages are opt-in, as in Bevy: kinds that you register are sent, and contacts are collected only
//! if at least one kind is.
//!
//! ```
//! # use bevy::prelude::*;
//! # use bevy_taw::prelude::*;
//! # let mut app = App::new();
//! fn click(mut started: MessageReader<ContactStarted>) {
//!     for contact in started.read() {
//!         println!("{:?} at {} m/s", contact.pair, contact.approach_speed);
//!     }
//! }
//! app.add_message::<ContactStarted>().add_systems(FixedUpdate, click.after(TawSystems::Scatter));
//! ```

use bevy::ecs::message::Messages;
use bevy::prelude::*;
use taw::math::{Vec3 as TawVec3, length};

use crate::SubstepDelta;
use crate::components::{MarbleState, WallState};
use crate::convert::from_vector;
use crate::resources::TawWorld;

/// Two entities that touch.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Reflect)]
#[reflect(Debug, PartialEq, Hash)]
pub struct ContactPair {
    /// A wall, or the marble that compares lower.
    pub a: Entity,
    /// A marble.
    pub b: Entity,
}

impl ContactPair {
    /// The one that is not `entity`, if `entity` is one of the two.
    #[must_use]
    pub fn other(&self, entity: Entity) -> Option<Entity> {
        match entity {
            _ if entity == self.a => Some(self.b),
            _ if entity == self.b => Some(self.a),
            _ => None,
        }
    }
}

/// Two that did not touch in the last step do in this one. For each pair once a
/// step, however many substeps there are.
#[derive(Message, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Debug, PartialEq)]
pub struct ContactStarted {
    /// The two entities.
    pub pair: ContactPair,
    /// The unit vector from `a` toward `b`.
    pub normal: Vec3,
    /// How fast the two marbles, or the marble and a wall thought at rest, came
    /// together along the normal, in m/s. Negative if they were already parting.
    pub approach_speed: f32,
}

/// Two that touched in the last step still do.
#[derive(Message, Clone, Copy, Debug, PartialEq, Eq, Reflect)]
#[reflect(Debug, PartialEq)]
pub struct ContactOngoing {
    /// The two entities.
    pub pair: ContactPair,
}

/// Two that touched in the last step no longer do. One of them may be gone.
///
/// What rests touches in one step and hovers in the next, so a contact ends only
/// when the gap is wider than a fiftieth of the smaller radius and than gravity
/// closes in a substep (`g dt²`).
#[derive(Message, Clone, Copy, Debug, PartialEq, Eq, Reflect)]
#[reflect(Debug, PartialEq)]
pub struct ContactEnded {
    /// The two entities.
    pub pair: ContactPair,
}

/// The touches of this step and of the last.
#[derive(Resource, Default)]
pub(crate) struct Touches {
    /// In the order found, several to a pair if there are substeps.
    now: Vec<ContactStarted>,
    /// Sorted, one to a pair.
    before: Vec<ContactPair>,
    /// Number of this step's impacts already noted.
    impacts: usize,
}

type Readers<'w> = (
    Option<ResMut<'w, Messages<ContactStarted>>>,
    Option<ResMut<'w, Messages<ContactOngoing>>>,
    Option<ResMut<'w, Messages<ContactEnded>>>,
);

/// Run condition: at least one kind of contact message is registered.
pub(crate) fn are_read(
    started: Option<Res<Messages<ContactStarted>>>,
    ongoing: Option<Res<Messages<ContactOngoing>>>,
    ended: Option<Res<Messages<ContactEnded>>>,
) -> bool {
    started.is_some() || ongoing.is_some() || ended.is_some()
}

/// Notes who touches in this substep, before anything is restituted.
pub(crate) fn collect(world: Res<TawWorld>, mut touches: ResMut<Touches>) {
    let velocity = |row: u32| world.marbles.velocity()[row as usize];
    let started = |pair: ContactPair, normal: TawVec3<f32>, closing: TawVec3<f32>| {
        let (normal, closing) = (from_vector(normal), from_vector(closing));
        ContactStarted { pair, normal, approach_speed: -closing.dot(normal) }
    };
    for contact in world.contacts.wm.iter().filter(|contact| contact.is_touching()) {
        if let (Some(a), Some(b)) = (world.wall_entity(contact.a), world.marble_entity(contact.b)) {
            let touch = started(ContactPair { a, b }, contact.normal, velocity(contact.b));
            touches.now.push(touch);
        }
    }
    for contact in world.contacts.mm.iter().filter(|contact| contact.is_touching()) {
        if let (Some(a), Some(b)) = (world.marble_entity(contact.a), world.marble_entity(contact.b))
        {
            let closing = velocity(contact.b) - velocity(contact.a);
            let mut touch = started(ContactPair { a, b }, contact.normal, closing);
            if b < a {
                // Rows move about; the order of entities does not.
                touch.pair = ContactPair { a: b, b: a };
                touch.normal = -touch.normal;
            }
            touches.now.push(touch);
        }
    }
}

/// Notes the collisions that the response went through by itself.
pub(crate) fn collect_impacts(world: Res<TawWorld>, mut touches: ResMut<Touches>) {
    // The list grows from substep to substep.
    for impact in world.impacts().iter().skip(touches.impacts) {
        let first = if impact.on_wall { TawWorld::wall_entity } else { TawWorld::marble_entity };
        let (Some(a), Some(b)) = (first(&world, impact.a), world.marble_entity(impact.b)) else {
            continue;
        };
        let normal = from_vector(impact.normal);
        let swap = !impact.on_wall && b < a;
        touches.now.push(ContactStarted {
            pair: if swap { ContactPair { a: b, b: a } } else { ContactPair { a, b } },
            normal: if swap { -normal } else { normal },
            approach_speed: impact.approach_speed,
        });
    }
    touches.impacts = world.impacts().len();
}

/// Compares this step's touches with the last one's.
pub(crate) fn write(
    mut touches: ResMut<Touches>,
    mut readers: Readers,
    world: Res<TawWorld>,
    delta: Res<SubstepDelta>,
    marbles: Query<&MarbleState>,
    walls: Query<&WallState>,
) {
    let Touches { now, before, impacts } = &mut *touches;
    *impacts = 0;
    let fall = from_vector(world.gravity()).length() * delta.0 * delta.0;
    now.extend(before.iter().filter_map(|&pair| {
        let gap = gap(pair, &world, &marbles, &walls)?;
        let hovers = gap.width <= fall.max(gap.radius / 50.0);
        hovers.then_some(ContactStarted { pair, normal: Vec3::ZERO, approach_speed: 0.0 })
    }));
    // Stable, so that the first substep's touch stands for its pair.
    now.sort_by_key(|touch| touch.pair);
    now.dedup_by_key(|touch| touch.pair);
    let (started, ongoing, ended) = &mut readers;
    let mut last = before.iter().copied().peekable();
    for touch in now.iter() {
        while let Some(pair) = last.next_if(|pair| *pair < touch.pair) {
            tell(ended, ContactEnded { pair });
        }
        if last.next_if_eq(&touch.pair).is_some() {
            tell(ongoing, ContactOngoing { pair: touch.pair });
        } else {
            tell(started, *touch);
        }
    }
    last.for_each(|pair| tell(ended, ContactEnded { pair }));
    before.clear();
    before.extend(now.drain(..).map(|touch| touch.pair));
}

/// Separation of two surfaces, and the smaller radius, in metres.
struct Gap {
    width: f32,
    radius: f32,
}

/// The gap of a pair, or `None` if one of the two is gone.
fn gap(
    pair: ContactPair,
    world: &TawWorld,
    marbles: &Query<&MarbleState>,
    walls: &Query<&WallState>,
) -> Option<Gap> {
    let marble = |entity| world.marbles.get(marbles.get(entity).ok()?.id?).ok();
    let b = marble(pair.b)?;
    if let Ok(wall) = walls.get(pair.a) {
        let wall = world.walls.get(wall.id?).ok()?;
        Some(Gap { width: wall.project_point(b.position).distance - b.radius, radius: b.radius })
    } else {
        let a = marble(pair.a)?;
        let width = length(b.position - a.position) - a.radius - b.radius;
        Some(Gap { width, radius: a.radius.min(b.radius) })
    }
}

fn tell<M: Message>(reader: &mut Option<ResMut<Messages<M>>>, message: M) {
    if let Some(messages) = reader {
        messages.write(message);
    }
}
