//! Forces of contacts: what a wall or a marble bears, and what contact messages say.

use std::collections::BTreeMap;

use bevy::prelude::*;
use taw::math::Vec3 as TawVec3;
use taw::prelude::Zero as _;
use taw::response::Response;

use crate::SubstepDelta;
use crate::body_touches::body_touches;
use crate::components::MarbleState;
use crate::convert::from_vector;
use crate::messages::ContactPair;
use crate::resources::TawWorld;
use crate::{contact_points, touches};

/// Force that contacts exert on a wall, a marble or a body, in N: add it to those of which you want to know it, a
/// button or a scale. Updated after each step; what sleeps keeps its force.
///
/// Known by `SoftStep`, `Impulse` and `Penalty`; zero by `Displacement`, which has no masses. By `EventDriven`, that of
/// impacts only, so that it is zero under what rests. Contacts with balls of swarms do not count. The force of a
/// hit is its impulse over the length of a step: shorter steps make it larger, so decide by impulses
/// ([`ContactHit`](crate::prelude::ContactHit)) or by a mean over time what breaks. The first one that is added, while
/// nobody reads contacts, wakes all.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_taw::prelude::*;
/// # #[derive(Component)]
/// # struct Button;
/// // In `FixedUpdate`, after `TawSystems::Scatter`, so that no step is missed.
/// fn press(buttons: Query<&ContactForce, With<Button>>) {
///     for force in &buttons {
///         if force.pressure > 50.0 {
///             println!("pressed with {} N", force.pressure);
///         }
///     }
/// }
/// ```
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, Debug, Default, PartialEq)]
pub struct ContactForce {
    /// Sum of the forces of all contacts, friction included: their impulses in the last step over its
    /// time.
    pub total: Vec3,
    /// Sum of the magnitudes of the normal forces: not zero for a marble that is squeezed from both sides.
    pub pressure: f32,
}

/// Impulse of the contacts of a pair, on its second entity, in N s.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct PairImpulse {
    pub impulse: Vec3,
    /// Normal of the contact that bears most, to the second entity, if one bears something.
    pub normal: Option<Vec3>,
    /// Largest magnitude of a normal impulse, and the sum of all.
    largest: f32,
    sum: f32,
}

/// Impulses of the contacts of this step.
#[derive(Resource, Default)]
pub(crate) struct PairImpulses {
    /// In the order found, several to a pair if there are several contacts or substeps.
    now: Vec<(ContactPair, PairImpulse)>,
    /// Number of this step's impacts already noted.
    impacts: usize,
}

/// Impulse of a pair in the last step.
pub(crate) fn impulse_of(world: &TawWorld, pair: ContactPair) -> PairImpulse {
    let found = world.pair_impulses.binary_search_by_key(&pair, |(pair, _)| *pair);
    found.map_or_else(|_| PairImpulse::default(), |at| world.pair_impulses[at].1)
}

/// Run condition: somebody reads impulses of contacts.
pub(crate) fn are_read(world: &World, forces: Query<(), With<ContactForce>>) -> bool {
    !forces.is_empty() || touches::are_read(world) || contact_points::are_read(world)
}

/// Lets the next step record impulses, if somebody reads them.
pub(crate) fn set_recording(In(are_read): In<bool>, mut world: ResMut<TawWorld>) {
    if world.records_impulses() != are_read {
        world.set_records_impulses(are_read);
    }
}

/// Notes the impulses of a substep after it is solved.
pub(crate) fn collect(world: Res<TawWorld>, mut impulses: ResMut<PairImpulses>) {
    let PairImpulses { now, impacts } = &mut *impulses;
    let mut add = |on_wall: bool, rows: [u32; 2], impulse: TawVec3<f32>, normal: TawVec3<f32>| {
        let first = if on_wall { TawWorld::wall_entity } else { TawWorld::marble_entity };
        let (a, b) = (first(&world, rows[0]), world.marble_entity(rows[1]));
        let (Some(a), Some(b), true) = (a, b, impulse != TawVec3::zero()) else { return };
        // Rows move about; the order of entities does not.
        let turned = !on_wall && b < a;
        let pair = if turned { ContactPair { a: b, b: a } } else { ContactPair { a, b } };
        let sign = if turned { -1.0 } else { 1.0 };
        let (impulse, normal) = (from_vector(impulse) * sign, from_vector(normal) * sign);
        let size = impulse.dot(normal).abs();
        now.push((pair, PairImpulse { impulse, normal: Some(normal), largest: size, sum: size }));
    };
    for c in &world.contacts.wm {
        add(true, [c.a, c.b], c.impulse(), c.normal);
    }
    for c in &world.contacts.mm {
        add(false, [c.a, c.b], c.impulse(), c.normal);
    }
    // Its contacts are those at the begin, and have no impulses; by the others, contacts have those of impacts.
    if world.model().response == Response::EventDriven {
        for it in world.impacts().iter().skip(*impacts) {
            add(it.on_wall, [it.a, it.b], it.impulse, it.normal);
        }
    }
    *impacts = world.impacts().len();
    now.extend(body_touches(&world).map(|((pair, ..), point)| {
        let impulse = point.impulse_on(pair.b);
        let (normal, size) = (Some(point.normal), point.normal_impulse);
        (pair, PairImpulse { impulse, normal, largest: size, sum: size })
    }));
}

/// Returns true if both of a pair sleep, so that their contacts are not listed.
pub(crate) fn sleeps(pair: ContactPair, world: &TawWorld, marbles: &Query<&MarbleState>) -> bool {
    let sleeps = |entity: Entity| {
        let id = marbles.get(entity).ok().map(|state| state.id);
        // A wall does as if it slept.
        id.is_none_or(|id| id.is_some_and(|id| world.is_asleep(id) == Ok(true)))
    };
    marbles.contains(pair.b) && sleeps(pair.b) && sleeps(pair.a)
}

/// Sums the impulses of a step by pairs. Contacts of what sleeps are not listed: they keep theirs.
pub(crate) fn finish(
    mut world: ResMut<TawWorld>,
    mut impulses: ResMut<PairImpulses>,
    marbles: Query<&MarbleState>,
) {
    let mut list = std::mem::take(&mut world.pair_impulses);
    let PairImpulses { now, impacts } = &mut *impulses;
    *impacts = 0;
    now.sort_by_key(|(pair, _)| *pair);
    now.dedup_by(|(pair, impulse), (kept, sum)| {
        let same = pair == kept;
        if same {
            if impulse.largest > sum.largest {
                (sum.normal, sum.largest) = (impulse.normal, impulse.largest);
            }
            sum.impulse += impulse.impulse;
            sum.sum += impulse.sum;
        }
        same
    });
    // One that fell asleep within the step bore its contacts for a part of it only.
    list.retain(|(pair, _)| sleeps(*pair, &world, &marbles));
    now.retain(|(pair, _)| list.binary_search_by_key(pair, |(pair, _)| *pair).is_err());
    list.append(now);
    list.sort_by_key(|(pair, _)| *pair);
    world.pair_impulses = list;
}

/// Forgets the impulses while nobody reads them.
pub(crate) fn forget(mut world: ResMut<TawWorld>, mut impulses: ResMut<PairImpulses>) {
    if !world.pair_impulses.is_empty() {
        world.pair_impulses.clear();
    }
    impulses.now.clear();
    impulses.impacts = 0;
}

/// Writes what walls and marbles bear.
pub(crate) fn write(
    world: Res<TawWorld>,
    delta: Res<SubstepDelta>,
    mut forces: Query<(Entity, &mut ContactForce)>,
) {
    let per_second = 1.0 / step_of(&world, delta.0);
    let mut sums: BTreeMap<Entity, ContactForce> = BTreeMap::new();
    for (ContactPair { a, b }, PairImpulse { impulse, sum: pressure, .. }) in &world.pair_impulses {
        for (entity, impulse) in [(*a, -*impulse), (*b, *impulse)] {
            if forces.contains(entity) {
                let sum = sums.entry(entity).or_default();
                sum.total += impulse * per_second;
                sum.pressure += pressure * per_second;
            }
        }
    }
    for (entity, mut written) in &mut forces {
        written.set_if_neq(sums.get(&entity).copied().unwrap_or_default());
    }
}

/// Length of a step, of which substeps take `dt` seconds each.
pub(crate) fn step_of(world: &TawWorld, dt: f32) -> f32 {
    dt * world.model().passes() as f32
}
