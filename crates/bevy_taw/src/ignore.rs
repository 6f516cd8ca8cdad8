//! Marbles that pass through others: through those that they name, through all for a time, and through
//! one-way walls.

use std::collections::BTreeMap;

use bevy::prelude::*;
use taw::world::{ColliderId, MarbleId};

use crate::body::Body;
use crate::components::{MarbleState, WallState};
use crate::convert::at_least_zero;
use crate::pair_filter::FilteredPairs;
use crate::refusal::{Refusal, Refusals};
use crate::resources::TawWorld;

/// Marbles and walls that a marble passes through, whatever their
/// [`CollisionLayers`](crate::layers::CollisionLayers). One of a pair is enough. May change at any time;
/// entities that are no marbles or walls, or not yet, do no harm, and a [`Body`], which cannot be ignored, is
/// [refused](Refusal::IgnoredBody) by name. Sensors, queries and balls of swarms
/// do not go by it.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_taw::prelude::*;
/// fn spawn(mut commands: Commands) {
///     let gate = commands.spawn(Wall::from(Cuboid::new(1.0, 2.0, 0.1))).id();
///     // The one who holds the key.
///     commands.spawn((Marble::new(0.5), IgnoreCollisions(vec![gate])));
/// }
/// ```
#[derive(Component, Clone, Debug, Default, PartialEq, Eq, Deref, DerefMut, Reflect)]
#[reflect(Component, Debug, Default, PartialEq)]
pub struct IgnoreCollisions(#[entities] pub Vec<Entity>);

/// A marble that meets nothing: no marble, wall, ball or sensor, and so no zone, as if it were in no layer.
/// Queries without a mask find it. Removed when its time is over.
///
/// A marble that is within another or in a wall by then is moved out as any other that begins so: by the
/// response, most of it in the first steps. Overlap is no energy; but deep inside of a heap, neighbours may
/// be pushed at some metres per second for a step. A ghost falls through floors; one that stands on
/// them has a layer of its own ([`CollisionLayers`](crate::prelude::CollisionLayers)).
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_taw::prelude::*;
/// fn hit(ghost: Entity, mut commands: Commands) {
///     commands.entity(ghost).insert(ColliderDisabled::for_seconds(1.5));
/// }
/// ```
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, Debug, Default, PartialEq)]
pub struct ColliderDisabled {
    /// Seconds of steps until it is removed, at least zero; none for as long as nobody removes it. Over
    /// when less than half a step is left.
    pub time_left: Option<f32>,
}

impl ColliderDisabled {
    /// Ghost for this time in seconds, at least zero.
    #[must_use]
    pub const fn for_seconds(seconds: f32) -> Self {
        Self { time_left: Some(seconds) }
    }
}

/// Makes a one-way wall of a [`Wall`](crate::wall::Wall): marbles that come from behind or from the side
/// pass through it, and those that come from where it faces along this direction, in the frame of the
/// entity, land on it. A platform to jump through, a turnstile.
///
/// A marble that is in the wall or comes from behind is not touched until it is wholly out; one that it
/// holds collides with all of it. To drop a marble through, let it name the wall by [`IgnoreCollisions`] for
/// a while. A closed mesh is hollow, and holds by its bottom what fits in: platforms are boxes, half-spaces or
/// open sheets. May change at any time. Balls of swarms and queries meet it from all sides.
///
/// Before each substep (of `SoftStep`, each step), all marbles near each such wall are looked at.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_taw::prelude::*;
/// fn spawn(mut commands: Commands) {
///     let platform = Wall::from(Cuboid::new(4.0, 0.2, 4.0));
///     commands.spawn((platform, OneWay::default(), Transform::from_xyz(0.0, 2.0, 0.0)));
/// }
/// ```
#[derive(Component, Clone, Copy, Debug, PartialEq, Deref, DerefMut, Reflect)]
#[reflect(Component, Debug, Default, PartialEq)]
pub struct OneWay(pub Dir3);

impl Default for OneWay {
    /// Upwards.
    fn default() -> Self {
        Self(Dir3::Y)
    }
}

/// Counts the time of marbles that meet nothing.
pub(crate) fn count_down(
    mut marbles: Query<(Entity, &mut ColliderDisabled)>,
    time: Res<Time>,
    mut refusals: Refusals,
    mut commands: Commands,
) {
    for (entity, mut disabled) in &mut marbles {
        let Some(left) = &mut disabled.bypass_change_detection().time_left else { continue };
        if !refusals.check(Some(entity), at_least_zero("time_left", *left)) {
            continue;
        }
        if *left < 0.5 * time.delta_secs() {
            commands.entity(entity).try_remove::<ColliderDisabled>();
        }
        *left = (*left - time.delta_secs()).max(0.0);
    }
}

/// Run condition: a marble names others, or did, or the game's filter lets some pass.
pub(crate) fn any(
    world: Res<TawWorld>,
    filtered: Res<FilteredPairs>,
    marbles: Query<(), With<IgnoreCollisions>>,
) -> bool {
    world.marbles.ignoring().next().is_some() || !filtered.pass().is_empty() || !marbles.is_empty()
}

/// Takes over whom marbles pass through: those whom they name, and by the game's filter.
pub(crate) fn gather(
    mut world: ResMut<TawWorld>,
    filtered: Res<FilteredPairs>,
    marbles: Query<(Entity, &IgnoreCollisions), With<MarbleState>>,
    colliders: Query<(Option<&MarbleState>, Option<&WallState>)>,
    bodies: Query<(), With<Body>>,
    mut refusals: Refusals,
) {
    let collider = |entity: Entity| match colliders.get(entity).ok()? {
        (Some(MarbleState { id: Some(id), .. }), _) => Some(ColliderId::Marble(*id)),
        (_, Some(WallState { id: Some(id), .. })) => Some(ColliderId::Wall(*id)),
        _ => None,
    };
    let named = marbles.iter().flat_map(|(marble, IgnoreCollisions(others))| {
        others.iter().map(move |other| (marble, *other))
    });
    let filtered = filtered.pass().iter().map(|pair| (pair.b, pair.a));
    let mut ignored: BTreeMap<MarbleId, Vec<ColliderId>> = BTreeMap::new();
    for (marble, other) in named.chain(filtered) {
        match (collider(marble), collider(other)) {
            (Some(ColliderId::Marble(id)), Some(other)) => {
                ignored.entry(id).or_default().push(other);
            }
            (_, None) if bodies.contains(other) => {
                refusals.check(Some(marble), Err(Refusal::IgnoredBody(other)));
            }
            _ => {}
        }
    }
    let over = world.marbles.ignoring().filter(|id| !ignored.contains_key(id));
    let over: Vec<_> = over.map(|id| (id, Vec::new())).collect();
    for (id, others) in over.into_iter().chain(ignored) {
        if world.marbles.ignored(id).is_ok_and(|before| before != others) {
            let _ = world.marbles.set_ignored(id, &others); // it is there
        }
    }
}
