//! Components and settings that have no effect.

use bevy::ecs::archetype::{Archetype, Archetypes};
use bevy::ecs::component::{ComponentId, Components};
use bevy::ecs::entity_disabling::DefaultQueryFilters;
use bevy::prelude::*;
use taw::motion::{Integrator, Rotation};
use taw::response::Response;
use taw::world::{Detection, Model, Precision};

use crate::components::{
    AngularVelocity, ExternalForce, ExternalImpulse, GravityScale, HalfLength, Marble,
    MarbleDamping, MarbleIntegrator, MarbleMass, MarbleRotation, SurfaceMaterial, SurfaceVelocity,
    Velocity,
};
use crate::controller::MarbleController;
use crate::ignore::OneWay;
use crate::resources::TawWorld;
use crate::sensor::Sensor;
use crate::wall::Wall;

/// Names of the components and settings that have no effect:
///
/// - components that the [`TawModel`](crate::resources::TawModel) does not read, as `SurfaceMaterial` with
///   `Displacement` (a `MarbleMass` that contacts do not read counts for forces still);
/// - fields of the model that its response does not read, as `precision` with `SoftStep`;
/// - components of marbles on walls, as a `Velocity`, those of walls on marbles, as a `OneWay`, and a
///   `Sensor` without a [`Wall`].
///
/// Each is also logged as a warning, once until it has an effect. Updated in each step, in
/// [`TawSystems::Gather`](crate::TawSystems::Gather).
#[derive(Resource, Clone, Debug, Default, PartialEq, Eq, Deref)]
pub struct IgnoredComponents(Vec<&'static str>);

/// Tables of the components that entities have.
pub(crate) struct Carriers<'a> {
    components: &'a Components,
    archetypes: Vec<&'a Archetype>,
}

impl<'a> Carriers<'a> {
    /// Components of all entities that no default filter hides.
    fn new(
        archetypes: &'a Archetypes,
        components: &'a Components,
        hidden: &DefaultQueryFilters,
    ) -> Self {
        let is_seen = |archetype: &&Archetype| {
            !archetype.is_empty() && !hidden.disabling_ids().any(|id| archetype.contains(id))
        };
        Self { components, archetypes: archetypes.iter().filter(is_seen).collect() }
    }

    fn has<C: Component>(&self, archetype: &Archetype) -> bool {
        let id: Option<ComponentId> = self.components.component_id::<C>();
        id.is_some_and(|id| archetype.contains(id))
    }

    /// Tests if an entity has this component.
    fn carry<C: Component>(&self) -> bool {
        self.archetypes.iter().any(|archetype| self.has::<C>(archetype))
    }

    /// Tests if a wall has this component, which is for marbles.
    fn walls_carry<C: Component>(&self) -> bool {
        let mut walls = self
            .archetypes
            .iter()
            .filter(|archetype| self.has::<Wall>(archetype) && !self.has::<Marble>(archetype));
        walls.any(|archetype| self.has::<C>(archetype))
    }

    /// Tests if a marble has this component, which is for walls.
    fn marbles_carry<C: Component>(&self) -> bool {
        let mut marbles = self.archetypes.iter().filter(|archetype| self.has::<Marble>(archetype));
        marbles.any(|archetype| self.has::<C>(archetype))
    }

    /// Tests if an entity is a sensor without a shape.
    fn has_sensor_without_wall(&self) -> bool {
        let mut sensors = self.archetypes.iter().filter(|archetype| self.has::<Sensor>(archetype));
        sensors.any(|archetype| {
            let has_shape = self.has::<Wall>(archetype) || self.awaits_mesh(archetype);
            !has_shape && !self.has::<Marble>(archetype)
        })
    }

    /// Tests if the walls of an entity come with its meshes.
    #[cfg(feature = "mesh")]
    fn awaits_mesh(&self, archetype: &Archetype) -> bool {
        self.has::<crate::mesh_walls::MeshWalls>(archetype)
    }

    #[cfg(not(feature = "mesh"))]
    #[expect(clippy::unused_self, reason = "as with meshes")]
    fn awaits_mesh(&self, _: &Archetype) -> bool {
        false
    }

    /// Rows of a name and true if it has no effect.
    fn rows(&self, model: Model) -> [(&'static str, bool); 24] {
        let Model { integrator, response, rotation, precision, detection, .. } = model;
        let projects = response == Response::Displacement;
        let unturned = rotation == Rotation::None;
        let soft = response == Response::SoftStep;
        let is_continuous = soft || response == Response::EventDriven;
        [
            ("SurfaceMaterial", projects && self.carry::<SurfaceMaterial>()),
            ("MarbleMass", projects && self.carry::<MarbleMass>()),
            ("AngularVelocity", unturned && self.carry::<AngularVelocity>()),
            ("MarbleRotation", unturned && self.carry::<MarbleRotation>()),
            ("MarbleIntegrator", soft && self.carry::<MarbleIntegrator>()),
            ("Model::integrator", soft && integrator != Integrator::SemiImplicitEuler),
            ("Model::precision", soft && precision != Precision::Plain),
            ("Model::detection", is_continuous && detection == Detection::Discrete),
            ("Velocity of a wall", self.walls_carry::<Velocity>()),
            ("AngularVelocity of a wall", self.walls_carry::<AngularVelocity>()),
            ("MarbleMass of a wall", self.walls_carry::<MarbleMass>()),
            ("GravityScale of a wall", self.walls_carry::<GravityScale>()),
            ("MarbleDamping of a wall", self.walls_carry::<MarbleDamping>()),
            ("ExternalForce of a wall", self.walls_carry::<ExternalForce>()),
            ("ExternalImpulse of a wall", self.walls_carry::<ExternalImpulse>()),
            ("HalfLength of a wall", self.walls_carry::<HalfLength>()),
            ("MarbleIntegrator of a wall", self.walls_carry::<MarbleIntegrator>()),
            ("MarbleRotation of a wall", self.walls_carry::<MarbleRotation>()),
            ("MarbleController of a wall", self.walls_carry::<MarbleController>()),
            ("Wall of a marble", self.marbles_carry::<Wall>()),
            ("SurfaceVelocity of a marble", self.marbles_carry::<SurfaceVelocity>()),
            ("OneWay of a marble", self.marbles_carry::<OneWay>()),
            ("Sensor of a marble", self.marbles_carry::<Sensor>()),
            ("Sensor without a Wall", self.has_sensor_without_wall()),
        ]
    }
}

/// Finds the components and settings that have no effect, and says which are new.
pub(crate) fn find(
    world: Res<TawWorld>,
    archetypes: &Archetypes,
    components: &Components,
    hidden: Res<DefaultQueryFilters>,
    mut found: ResMut<IgnoredComponents>,
) {
    let model = world.model();
    let rows = Carriers::new(archetypes, components, &hidden).rows(model);
    let ignored: Vec<_> =
        rows.into_iter().filter(|(_, is_ignored)| *is_ignored).map(|(name, _)| name).collect();
    let Model { response, rotation, .. } = model;
    for name in ignored.iter().filter(|name| !found.contains(name)) {
        if name.contains(' ') {
            log::warn!("taw ignores a {name}");
        } else {
            log::warn!(
                "taw ignores {name}{}: the TawModel's response is {response:?} and its rotation {rotation:?}",
                if *name == "MarbleMass" { " in contacts" } else { "" }
            );
        }
    }
    found.set_if_neq(IgnoredComponents(ignored));
}
