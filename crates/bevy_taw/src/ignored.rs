//! Components that the model does not read.

use bevy::prelude::*;
use taw::motion::Rotation;
use taw::response::Response;
use taw::world::Model;

use crate::components::{
    AngularVelocity, MarbleIntegrator, MarbleMass, MarbleRotation, SurfaceMaterial,
};
use crate::resources::TawWorld;

/// Names of the components that entities have and that the [`TawModel`](crate::resources::TawModel)
/// does not read: of `SurfaceMaterial` its response knows nothing, say. A `MarbleMass` that contacts do
/// not read counts for forces still. Each is also logged as a warning, once until the model reads it.
///
/// Updated in each step, in [`TawSystems::Gather`](crate::TawSystems::Gather).
#[derive(Resource, Clone, Debug, Default, PartialEq, Eq, Deref)]
pub struct IgnoredComponents(Vec<&'static str>);

/// Entities with components that some models do not read.
type Carriers<'w, 's> = (
    Query<'w, 's, (), With<SurfaceMaterial>>,
    Query<'w, 's, (), With<MarbleMass>>,
    Query<'w, 's, (), With<AngularVelocity>>,
    Query<'w, 's, (), With<MarbleRotation>>,
    Query<'w, 's, (), With<MarbleIntegrator>>,
);

/// Finds the components that the model does not read, and says which are new.
pub(crate) fn find(world: Res<TawWorld>, carriers: Carriers, mut found: ResMut<IgnoredComponents>) {
    let Model { response, rotation, .. } = world.model();
    let projects = response == Response::Displacement;
    let unturned = rotation == Rotation::None;
    let (surfaces, masses, spins, rotations, integrators) = carriers;
    let rows = [
        ("SurfaceMaterial", projects && !surfaces.is_empty()),
        ("MarbleMass", projects && !masses.is_empty()),
        ("AngularVelocity", unturned && !spins.is_empty()),
        ("MarbleRotation", unturned && !rotations.is_empty()),
        ("MarbleIntegrator", response == Response::SoftStep && !integrators.is_empty()),
    ];
    let ignored = rows.into_iter().filter(|(_, is_ignored)| *is_ignored).map(|(name, _)| name);
    let ignored: Vec<_> = ignored.collect();
    for name in ignored.iter().filter(|name| !found.contains(name)) {
        log::warn!(
            "taw ignores {name}{}: the TawModel's response is {response:?} and its rotation {rotation:?}",
            if *name == "MarbleMass" { " in contacts" } else { "" }
        );
    }
    found.set_if_neq(IgnoredComponents(ignored));
}
