//! A game's own decision of each pair: whether the two collide.

use bevy::ecs::system::SystemId;
use bevy::prelude::*;
use taw::world::ColliderId;

use crate::components::{MarbleState, WallState};
use crate::messages::ContactPair;
use crate::refusal::{Refusal, Refusals};
use crate::resources::TawWorld;

/// Lets the game's [`PairFilter`] decide with whom a marble or a wall collides. One of a pair is enough.
///
/// The filter is asked in each step of all pairs with such an entity, wherever they are: these many times
/// the number of all others, so mark few; [`CollisionLayers`](crate::prelude::CollisionLayers) are for many.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Component, Debug, Default, PartialEq)]
pub struct FilterPairs;

/// The system of the game that decides which pairs collide, of those with a [`FilterPairs`]. It may read
/// whatever a system may.
///
/// Run in each step, in [`TawSystems::Gather`](crate::TawSystems::Gather), and what it decides holds for the
/// step, in every response: pairs that it takes out pass through each other, as those of
/// [`IgnoreCollisions`](crate::prelude::IgnoreCollisions) do. Pairs whose layers do not interact are not asked
/// about. Sensors, queries and balls of swarms do not go by it.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_taw::prelude::*;
/// #[derive(Component, PartialEq)]
/// struct Team(u8);
///
/// /// Marbles pass through the walls and marbles of their team.
/// fn meet_others(InMut(pairs): InMut<CandidatePairs>, teams: Query<&Team>) {
///     let team = |entity| teams.get(entity).ok();
///     pairs.retain(|pair| team(pair.a).is_none() || team(pair.a) != team(pair.b));
/// }
///
/// # let mut app = App::new();
/// # app.add_plugins((MinimalPlugins, TransformPlugin, TawPlugin));
/// let filter = PairFilter::new(app.world_mut(), meet_others);
/// app.insert_resource(filter);
/// app.world_mut().spawn((Marble::new(0.5), Team(1), FilterPairs));
/// app.world_mut().spawn((Wall::default(), Team(1)));
/// # app.update();
/// ```
#[derive(Resource, Clone, Copy, Debug)]
pub struct PairFilter(pub SystemId<InMut<'static, CandidatePairs>>);

impl PairFilter {
    /// Registers a system as a filter; as a resource, it is the one that is asked.
    #[must_use]
    pub fn new<M>(
        world: &mut World,
        filter: impl IntoSystem<InMut<'static, CandidatePairs>, (), M> + 'static,
    ) -> Self {
        Self(world.register_system(filter))
    }
}

/// Pairs of a step, of which a [`PairFilter`] decides who collides.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct CandidatePairs {
    /// Those that collide up to now.
    collide: Vec<ContactPair>,
    /// Those that were taken out.
    pass: Vec<ContactPair>,
}

impl CandidatePairs {
    /// Pairs that collide up to now, sorted.
    #[must_use]
    pub fn as_slice(&self) -> &[ContactPair] {
        &self.collide
    }

    /// Lets only those pairs collide for which `collides` is true. In a pair of a wall and a marble, the wall is
    /// `a`.
    pub fn retain(&mut self, mut collides: impl FnMut(ContactPair) -> bool) {
        let Self { collide, pass } = self;
        collide.retain(|pair| {
            let kept = collides(*pair);
            if !kept {
                pass.push(*pair);
            }
            kept
        });
    }
}

/// Pairs of this step, of which the [`PairFilter`] decides.
#[derive(Resource, Default)]
pub(crate) struct FilteredPairs {
    candidates: CandidatePairs,
    failed: Option<Refusal>,
}

impl FilteredPairs {
    /// Pairs that pass through each other, each with a marble as `b`.
    pub fn pass(&self) -> &[ContactPair] {
        &self.candidates.pass
    }
}

/// Run condition: somebody is to be asked about, or was.
pub(crate) fn any(filtered: Res<FilteredPairs>, marked: Query<(), With<FilterPairs>>) -> bool {
    !filtered.pass().is_empty() || !marked.is_empty()
}

/// Lists the pairs with a marked marble or wall, of which the layers interact.
pub(crate) fn list(
    world: Res<TawWorld>,
    mut filtered: ResMut<FilteredPairs>,
    filter: Option<Res<PairFilter>>,
    marbles: Query<(Entity, &MarbleState, Has<FilterPairs>)>,
    walls: Query<(Entity, &WallState, Has<FilterPairs>)>,
) {
    let CandidatePairs { collide, pass } = &mut filtered.candidates;
    collide.clear();
    pass.clear();
    if filter.is_none() {
        return;
    }
    let marbles = marbles.iter().filter_map(|(entity, state, is_marked)| {
        Some((entity, world.layers(ColliderId::Marble(state.id?)).ok()?, is_marked))
    });
    let walls = walls.iter().filter_map(|(entity, state, is_marked)| {
        Some((entity, world.layers(ColliderId::Wall(state.id?)).ok()?, is_marked))
    });
    let (marbles, walls): (Vec<_>, Vec<_>) = (marbles.collect(), walls.collect());
    for (own, layers, _) in marbles.iter().filter(|(.., is_marked)| *is_marked) {
        for (wall, ..) in walls.iter().filter(|it| it.1.interacts_with(*layers)) {
            collide.push(ContactPair { a: *wall, b: *own });
        }
        let others = marbles.iter().filter(|it| it.1.interacts_with(*layers));
        // Of two that are marked, the lower one names the pair.
        for (other, ..) in others.filter(|(other, _, is_marked)| !is_marked || own < other) {
            if other != own {
                collide.push(ContactPair { a: *own.min(other), b: *own.max(other) });
            }
        }
    }
    for (wall, layers, _) in walls.iter().filter(|(.., is_marked)| *is_marked) {
        let others = marbles.iter().filter(|(_, of, is_marked)| {
            !is_marked && of.interacts_with(*layers) // with the marked ones it is listed
        });
        collide.extend(others.map(|(marble, ..)| ContactPair { a: *wall, b: *marble }));
    }
    collide.sort_unstable();
}

/// Asks the game's filter which pairs pass through each other in this step.
pub(crate) fn ask(world: &mut World) {
    let Some(PairFilter(system)) = world.get_resource::<PairFilter>().copied() else { return };
    let mut candidates = std::mem::take(&mut world.resource_mut::<FilteredPairs>().candidates);
    let failed = world.run_system_with(system, &mut candidates).err();
    let failed = failed.map(|_| Refusal::PairFilter(system.entity()));
    *world.resource_mut::<FilteredPairs>() = FilteredPairs { candidates, failed };
}

/// Reports a filter that could not be run.
pub(crate) fn report(filtered: Res<FilteredPairs>, mut refusals: Refusals) {
    refusals.check(None, filtered.failed.map_or(Ok(()), Err));
}
