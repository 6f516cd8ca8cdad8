//! Contacts that start, go on and end, and hits, as messages and as events of the entities that touch.
//!
//! Messages are opt-in, as in Bevy: kinds that you register are sent. Observers need nothing else:
//! [`ContactStarted`], [`ContactOngoing`], [`ContactEnded`], [`ContactHit`] and [`ContactPoint`] are triggered once
//! for each of the two entities if somebody observes them, with that entity as `pair.a`. Contacts are collected only if at
//! least one kind is read or observed.
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
//!
//! fn spawn_bumper(mut commands: Commands) {
//!     let flash = |hit: On<ContactStarted>| println!("hit by {} at {}", hit.pair.b, hit.point);
//!     commands.spawn(Wall::from(Sphere::new(0.5))).observe(flash);
//! }
//! ```

use bevy::ecs::event::EntityTrigger;
use bevy::prelude::*;

/// Two entities that touch. In an observer, `a` is the entity that is observed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Reflect)]
#[reflect(Debug, PartialEq, Hash)]
pub struct ContactPair {
    /// A wall, or the marble or body that compares lower.
    pub a: Entity,
    /// A marble or a body.
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

    /// Part of a vector on `b` that acts on an entity.
    fn on(&self, entity: Entity, on_b: Vec3) -> Vec3 {
        match entity {
            _ if entity == self.b => on_b,
            _ if entity == self.a => -on_b,
            _ => Vec3::ZERO,
        }
    }
}

/// Two that did not touch in the last step do in this one. For each pair once a
/// step, however many substeps and contacts there are: it says one of them, and [`ContactPoint`] all.
#[derive(Message, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Debug, PartialEq)]
pub struct ContactStarted {
    /// The two entities.
    pub pair: ContactPair,
    /// Unit normal from `a` to `b`.
    pub normal: Vec3,
    /// Contact point, in metres in world space.
    pub point: Vec3,
    /// Part that is met: of a wall's compound or mesh (a triangle), of the body that a marble meets, and of two bodies,
    /// of that which compares lower.
    pub part: u32,
    /// Approach speed of the two along the normal, in m/s. Negative if they were already parting.
    pub approach_speed: f32,
    /// Speed at which the surfaces slide over each other, in m/s.
    pub slip_speed: f32,
    /// Impulse of all contacts of the pair in the step, on `b`, in N s; see [`ContactForce`](crate::prelude::ContactForce) for
    /// when it is known.
    pub impulse: Vec3,
}

impl ContactStarted {
    /// Impulse on one of the two, in N s: [`impulse`](Self::impulse) on `b`, which the normal points to, the
    /// opposite on `a`, and zero on any other entity.
    #[must_use]
    pub fn impulse_on(&self, entity: Entity) -> Vec3 {
        self.pair.on(entity, self.impulse)
    }

    /// Touch of a contact, whose pair's impulse is not known yet.
    pub(crate) fn of(contact: &ContactPoint) -> Self {
        let ContactPoint { pair, normal, point, part, approach_speed, slip_speed, .. } = *contact;
        Self { pair, normal, point, part, approach_speed, slip_speed, impulse: Vec3::ZERO }
    }

    /// Contact that goes on, of which nobody reads more than the pair and the normal.
    pub(crate) fn going_on(pair: ContactPair, normal: Vec3) -> Self {
        let zero = Vec3::ZERO;
        let (part, approach_speed, slip_speed) = (0, 0.0, 0.0);
        Self { pair, normal, point: zero, part, approach_speed, slip_speed, impulse: zero }
    }
}

/// Impact of two entities, faster than a resting contact, whether or not they touched before: a marble
/// that runs along a mesh hits the end of it. Good for sounds and sparks.
///
/// Sent above 1 mm/s and, except by [`EventDriven`](taw::response::Response::EventDriven), above what gravity makes in two
/// substeps. A pair that touches in several places has a hit for each of them; of those in one
/// direction, within a step, the fastest. Within a step they come in the order of time by `EventDriven`, else in any
/// order.
///
/// A wall that breaks:
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy::time::TimeUpdateStrategy;
/// # use bevy_taw::prelude::*;
/// /// Impulse in N s that breaks it.
/// #[derive(Component)]
/// struct Brittle(f32);
///
/// /// Sees the wall as `pair.a`, since it is the wall that is observed.
/// fn crack(hit: On<ContactHit>, walls: Query<&Brittle>, mut commands: Commands) -> Result {
///     let wall = hit.pair.a;
///     if hit.impulse_on(wall).length() > walls.get(wall)?.0 {
///         commands.entity(wall).try_despawn(); // two may hit it in one step
///     }
///     Ok(())
/// }
///
/// fn spawn(mut commands: Commands) {
///     let pane = Wall::from(Cuboid::new(0.1, 2.0, 2.0));
///     commands.spawn((pane, Brittle(20.0))).observe(crack);
///     // A kilogram at 2 m/s bounces off, one at 30 m/s does not. (It comes second.)
///     for (x, speed) in [(-1.0, 2.0), (-40.0, 30.0)] {
///         let at = Transform::from_xyz(x, 0.0, 0.0);
///         let mass = MarbleMass::Kilograms(1.0);
///         commands.spawn((Marble::new(0.3), mass, Velocity(Vec3::X * speed), at));
///     }
/// }
/// # let mut app = App::new();
/// # app.add_plugins((MinimalPlugins, TransformPlugin, TawPlugin)).insert_resource(Gravity(Vec3::ZERO));
/// # let step = app.world().resource::<Time<Fixed>>().timestep();
/// # app.insert_resource(TimeUpdateStrategy::ManualDuration(step)).add_systems(Startup, spawn);
/// # let walls = |app: &mut App| app.world_mut().query::<&Wall>().iter(app.world()).count();
/// # (0..64).for_each(|_| app.update());
/// # assert_eq!(walls(&mut app), 1);
/// # (0..64).for_each(|_| app.update());
/// # assert_eq!(walls(&mut app), 0);
/// ```
#[derive(Message, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Debug, PartialEq)]
pub struct ContactHit {
    /// The two entities.
    pub pair: ContactPair,
    /// Unit normal from `a` to `b`.
    pub normal: Vec3,
    /// Contact point, in metres in world space.
    pub point: Vec3,
    /// Part that is met: of a wall's compound or mesh (a triangle), of the body that a marble meets, and of two bodies,
    /// of that which compares lower.
    pub part: u32,
    /// Approach speed along the normal, in m/s.
    pub approach_speed: f32,
    /// Speed at which the surfaces slide over each other, in m/s.
    pub slip_speed: f32,
    /// Impulse on `b`, in N s: of the impact by responses that tell of [impacts](taw::world::World::impacts), else of all
    /// contacts of the pair in the step.
    pub impulse: Vec3,
}

impl ContactHit {
    /// Impulse on one of the two, in N s: [`impulse`](Self::impulse) on `b`, which the normal points to, the
    /// opposite on `a`, and zero on any other entity.
    #[must_use]
    pub fn impulse_on(&self, entity: Entity) -> Vec3 {
        self.pair.on(entity, self.impulse)
    }
}

/// Two that touched in the last step still do.
#[derive(Message, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Debug, PartialEq)]
pub struct ContactOngoing {
    /// The two entities.
    pub pair: ContactPair,
    /// Unit normal from `a` to `b`, of the contact that bears most.
    pub normal: Vec3,
    /// Mean force of all contacts of the pair in the step, on `b`, in N; what sleeps keeps it. See
    /// [`ContactForce`](crate::prelude::ContactForce) for when it is known.
    pub force: Vec3,
}

impl ContactOngoing {
    /// Force on one of the two, in N: [`force`](Self::force) on `b`, the opposite on `a`, and zero on any
    /// other entity.
    #[must_use]
    pub fn force_on(&self, entity: Entity) -> Vec3 {
        self.pair.on(entity, self.force)
    }
}

/// One contact of two that touch: a ball in the corner of a mesh has two with it, a capsule that lies on a
/// floor too, and a box there four. Sent in each step for each contact, also of what sleeps. A contact is known by its pair, the part of
/// the wall and the features of capsules that meet, so that what rolls from triangle to triangle of a mesh begins one after
/// the other.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_taw::prelude::*;
/// # let mut app = App::new();
/// /// Sparks where a capsule scrapes along, at both ends of it.
/// fn scrape(mut contacts: MessageReader<ContactPoint>) {
///     for contact in contacts.read().filter(|contact| contact.slip_speed > 1.0) {
///         println!("{} N s of friction at {}", contact.tangent_impulse.length(), contact.point);
///     }
/// }
/// app.add_message::<ContactPoint>().add_systems(FixedUpdate, scrape.after(TawSystems::Scatter));
/// ```
#[derive(Message, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Debug, PartialEq)]
pub struct ContactPoint {
    /// The two entities.
    pub pair: ContactPair,
    /// Unit normal from `a` to `b`.
    pub normal: Vec3,
    /// Contact point, in metres in world space.
    pub point: Vec3,
    /// Part that is met: of a wall's compound or mesh (a triangle), of the body that a marble meets, and of two bodies,
    /// of that which compares lower.
    pub part: u32,
    /// True in the first step of the contact.
    pub is_new: bool,
    /// Largest approach speed along the normal in the step, before the contact is solved, in m/s; negative if the
    /// two part. Zero for what sleeps, and for contacts that come about while others are solved.
    pub approach_speed: f32,
    /// Speed at which the surfaces slide over each other then, in m/s.
    pub slip_speed: f32,
    /// Normal impulse in the step, in N s; on `b` along the normal. What sleeps keeps it. See
    /// [`ContactForce`](crate::prelude::ContactForce) for when impulses are known.
    pub normal_impulse: f32,
    /// Friction impulse in the step, on `b`, in N s.
    pub tangent_impulse: Vec3,
}

impl ContactPoint {
    /// Impulse on one of the two, in N s: along the normal and by friction on `b`, the opposite on `a`, and zero on
    /// any other entity.
    #[must_use]
    pub fn impulse_on(&self, entity: Entity) -> Vec3 {
        self.pair.on(entity, self.normal * self.normal_impulse + self.tangent_impulse)
    }

    /// Contact as two begin to touch, without impulses.
    pub(crate) fn of(touch: ContactStarted) -> Self {
        let ContactStarted { pair, normal, point, part, approach_speed, slip_speed, .. } = touch;
        let (normal_impulse, tangent_impulse) = (0.0, Vec3::ZERO);
        Self {
            pair,
            normal,
            point,
            part,
            is_new: true,
            approach_speed,
            slip_speed,
            normal_impulse,
            tangent_impulse,
        }
    }
}

/// Two that touched in the last step no longer do. One of them may be gone, or pass through the other.
///
/// A resting marble touches in one step and hovers in the next, so a contact ends only
/// when the gap is wider than a fiftieth of the smaller radius and than gravity
/// closes in a substep (`g dt²`). Of a body, the distance of its farthest point from its center of mass counts as the
/// radius.
#[derive(Message, Clone, Copy, Debug, PartialEq, Eq, Reflect)]
#[reflect(Debug, PartialEq)]
pub struct ContactEnded {
    /// The two entities.
    pub pair: ContactPair,
}

/// Contact event of two entities, as one of them sees it.
pub(crate) trait ContactEvent:
    EntityEvent + for<'a> Event<Trigger<'a> = EntityTrigger> + Copy
{
    /// The event as the other one sees it.
    fn swapped(self) -> Self;
}

impl ContactPair {
    fn swapped(self) -> Self {
        Self { a: self.b, b: self.a }
    }
}

impl ContactEvent for ContactStarted {
    fn swapped(self) -> Self {
        let (normal, impulse) = (-self.normal, -self.impulse);
        Self { pair: self.pair.swapped(), normal, impulse, ..self }
    }
}

impl ContactEvent for ContactHit {
    fn swapped(self) -> Self {
        let (normal, impulse) = (-self.normal, -self.impulse);
        Self { pair: self.pair.swapped(), normal, impulse, ..self }
    }
}

impl ContactEvent for ContactOngoing {
    fn swapped(self) -> Self {
        Self { pair: self.pair.swapped(), normal: -self.normal, force: -self.force }
    }
}

impl ContactEvent for ContactPoint {
    fn swapped(self) -> Self {
        let (normal, tangent_impulse) = (-self.normal, -self.tangent_impulse);
        Self { pair: self.pair.swapped(), normal, tangent_impulse, ..self }
    }
}

impl ContactEvent for ContactEnded {
    fn swapped(self) -> Self {
        Self { pair: self.pair.swapped() }
    }
}

macro_rules! entity_event {
    ($($event:ty),*) => {$(
        impl Event for $event {
            type Trigger<'a> = EntityTrigger;
        }

        impl EntityEvent for $event {
            fn event_target(&self) -> Entity {
                self.pair.a
            }
        }
    )*};
}
entity_event!(ContactStarted, ContactHit, ContactOngoing, ContactPoint, ContactEnded);
