//! Components and settings that have no effect.

use bevy::ecs::archetype::{Archetype, Archetypes};
use bevy::ecs::component::{ComponentId, Components};
use bevy::ecs::entity_disabling::DefaultQueryFilters;
use bevy::prelude::*;
use taw::motion::{Integrator, Rotation};
use taw::response::Response;
use taw::world::{Detection, Model, Precision};

use crate::body::Body;
use crate::components::{
    AngularVelocity, ExternalForce, ExternalImpulse, GravityScale, HalfLength, Marble,
    MarbleDamping, MarbleIntegrator, MarbleMass, MarbleRotation, SleepingDisabled, SurfaceMaterial,
    SurfaceVelocity, Velocity,
};
use crate::contact_force::ContactForce;
use crate::controller::MarbleController;
use crate::grounded::Grounded;
use crate::ignore::{ColliderDisabled, IgnoreCollisions, OneWay};
use crate::locked_axes::LockedAxes;
use crate::pair_filter::{FilterPairs, PairFilter};
use crate::resources::TawWorld;
use crate::sensor::Sensor;
use crate::wall::Wall;

/// Names of the components and settings that have no effect:
///
/// - components that the [`TawModel`](crate::resources::TawModel) does not read, as `SurfaceMaterial` with
///   `Displacement` (a `MarbleMass` that contacts do not read counts for forces still); a `ContactForce`
///   that the response does not write, by `EventDriven` that of what rests; a `SleepingDisabled` where
///   nothing sleeps ([`SwarmModel::sleeps`](taw::swarm::SwarmModel::sleeps));
/// - `integrator`, `precision` and `detection` of the model where its response does not read them; an
///   integrator by `SoftStep` where no [`Forces`](crate::resources::Forces) act. (Its
///   `iterations` are not named: every model has some.)
/// - a [`FilterPairs`] in an app without a [`PairFilter`];
/// - components of marbles on walls, as a `Velocity`, those of walls on marbles, as a `OneWay`, those that a
///   [`Body`] does not have, as `LockedAxes`, and a `Sensor` or a zone without a [`Wall`].
///
/// Each is also logged as a warning, once until it has an effect. Updated in each step, in
/// [`TawSystems::Gather`](crate::TawSystems::Gather).
#[derive(Resource, Clone, Debug, Default, PartialEq, Eq, Deref, Reflect)]
#[reflect(Resource, Debug, Default, PartialEq)]
pub struct IgnoredComponents(Vec<&'static str>);

/// Tables of the components that entities have, except those that default filters hide.
struct Carriers<'a> {
    components: &'a Components,
    marbles: Vec<&'a Archetype>,
    /// Walls that are no marbles.
    walls: Vec<&'a Archetype>,
    /// Bodies that are neither.
    bodies: Vec<&'a Archetype>,
    /// Sensors that are none of these.
    shapeless: Vec<&'a Archetype>,
}

impl<'a> Carriers<'a> {
    fn new(
        archetypes: &'a Archetypes,
        components: &'a Components,
        hidden: &DefaultQueryFilters,
    ) -> Self {
        let [marbles, walls, bodies, shapeless] = [const { Vec::new() }; 4];
        let mut all = Self { components, marbles, walls, bodies, shapeless };
        let (marble, wall, body) = (all.id::<Marble>(), all.id::<Wall>(), all.id::<Body>());
        let (sensor, mesh) = (all.id::<Sensor>(), mesh_id(components));
        let has = |archetype: &Archetype, id: Option<ComponentId>| {
            id.is_some_and(|id| archetype.contains(id))
        };
        for archetype in archetypes.iter() {
            if archetype.is_empty() || hidden.disabling_ids().any(|id| archetype.contains(id)) {
                continue;
            }
            if has(archetype, marble) {
                all.marbles.push(archetype);
            } else if has(archetype, wall) {
                all.walls.push(archetype);
            } else if has(archetype, body) {
                all.bodies.push(archetype);
            } else if has(archetype, sensor) && !has(archetype, mesh) {
                all.shapeless.push(archetype); // those with a mesh may await it
            }
        }
        all
    }

    fn id<C: Component>(&self) -> Option<ComponentId> {
        self.components.component_id::<C>()
    }

    /// Tests if one of these has a component.
    fn any<C: Component>(&self, of: &[&Archetype]) -> bool {
        self.id::<C>().is_some_and(|id| of.iter().any(|archetype| archetype.contains(id)))
    }

    /// Each name of what the model may not read or write, and true if it does not.
    fn of_model(&self, model: Model, has_forces: bool, sleeps: bool) -> [(&'static str, bool); 12] {
        let Model { integrator, response, rotation, precision, detection, .. } = model;
        let projects = response == Response::Displacement;
        let unturned = rotation == Rotation::None;
        let soft = response == Response::SoftStep;
        let is_parabola = soft && !has_forces; // whatever the integrator
        let event_driven = response == Response::EventDriven;
        let is_continuous = soft || event_driven;
        let (marbles, walls) = (&self.marbles, &self.walls);
        let has_material =
            self.any::<SurfaceMaterial>(marbles) || self.any::<SurfaceMaterial>(walls);
        let has_force = self.any::<ContactForce>(marbles) || self.any::<ContactForce>(walls);
        [
            ("SurfaceMaterial", projects && has_material),
            ("SurfaceVelocity", projects && self.any::<SurfaceVelocity>(walls)),
            ("MarbleMass", projects && self.any::<MarbleMass>(marbles)),
            ("AngularVelocity", unturned && self.any::<AngularVelocity>(marbles)),
            ("MarbleRotation", unturned && self.any::<MarbleRotation>(marbles)),
            ("ContactForce", projects && has_force),
            ("ContactForce of what rests", event_driven && has_force),
            ("SleepingDisabled", !sleeps && self.any::<SleepingDisabled>(marbles)),
            ("MarbleIntegrator", is_parabola && self.any::<MarbleIntegrator>(marbles)),
            ("Model::integrator", is_parabola && integrator != Integrator::SemiImplicitEuler),
            ("Model::precision", soft && precision != Precision::Plain),
            ("Model::detection", is_continuous && detection == Detection::Discrete),
        ]
    }

    /// Each name of a component that has no effect on a body, and true if one has it.
    fn of_bodies(&self) -> [(&'static str, bool); 12] {
        let bodies = &self.bodies;
        [
            ("LockedAxes of a body", self.any::<LockedAxes>(bodies)),
            ("ColliderDisabled of a body", self.any::<ColliderDisabled>(bodies)),
            ("IgnoreCollisions of a body", self.any::<IgnoreCollisions>(bodies)),
            ("FilterPairs of a body", self.any::<FilterPairs>(bodies)),
            ("SurfaceVelocity of a body", self.any::<SurfaceVelocity>(bodies)),
            ("OneWay of a body", self.any::<OneWay>(bodies)),
            ("Sensor of a body", self.any::<Sensor>(bodies)),
            ("HalfLength of a body", self.any::<HalfLength>(bodies)),
            ("MarbleIntegrator of a body", self.any::<MarbleIntegrator>(bodies)),
            ("MarbleRotation of a body", self.any::<MarbleRotation>(bodies)),
            ("MarbleController of a body", self.any::<MarbleController>(bodies)),
            ("Grounded of a body", self.any::<Grounded>(bodies)),
        ]
    }

    /// Each name of a component that has no effect where it is, and true if an entity has it there.
    fn of_places(&self, has_filter: bool) -> [(&'static str, bool); 21] {
        let (marbles, walls) = (&self.marbles, &self.walls);
        let is_marked = self.any::<FilterPairs>(marbles) || self.any::<FilterPairs>(walls);
        [
            ("FilterPairs without a PairFilter", is_marked && !has_filter),
            ("Velocity of a wall", self.any::<Velocity>(walls)),
            ("AngularVelocity of a wall", self.any::<AngularVelocity>(walls)),
            ("MarbleMass of a wall", self.any::<MarbleMass>(walls)),
            ("GravityScale of a wall", self.any::<GravityScale>(walls)),
            ("MarbleDamping of a wall", self.any::<MarbleDamping>(walls)),
            ("ExternalForce of a wall", self.any::<ExternalForce>(walls)),
            ("ExternalImpulse of a wall", self.any::<ExternalImpulse>(walls)),
            ("HalfLength of a wall", self.any::<HalfLength>(walls)),
            ("MarbleIntegrator of a wall", self.any::<MarbleIntegrator>(walls)),
            ("MarbleRotation of a wall", self.any::<MarbleRotation>(walls)),
            ("LockedAxes of a wall", self.any::<LockedAxes>(walls)),
            ("MarbleController of a wall", self.any::<MarbleController>(walls)),
            ("Grounded of a wall", self.any::<Grounded>(walls)),
            ("IgnoreCollisions of a wall", self.any::<IgnoreCollisions>(walls)),
            ("ColliderDisabled of a wall", self.any::<ColliderDisabled>(walls)),
            ("SleepingDisabled of a wall", self.any::<SleepingDisabled>(walls)),
            ("SurfaceVelocity of a marble", self.any::<SurfaceVelocity>(marbles)),
            ("OneWay of a marble", self.any::<OneWay>(marbles)),
            ("Sensor of a marble", self.any::<Sensor>(marbles)),
            ("Sensor or zone without a Wall", !self.shapeless.is_empty()),
        ]
    }
}

/// Component of entities that may become walls once their mesh is there.
#[cfg(feature = "mesh")]
fn mesh_id(components: &Components) -> Option<ComponentId> {
    components.component_id::<Mesh3d>()
}

#[cfg(not(feature = "mesh"))]
fn mesh_id(_: &Components) -> Option<ComponentId> {
    None
}

/// Finds the components and settings that have no effect, and says which are new.
pub(crate) fn find(
    world: Res<TawWorld>,
    archetypes: &Archetypes,
    components: &Components,
    hidden: Res<DefaultQueryFilters>,
    filter: Option<Res<PairFilter>>,
    mut found: ResMut<IgnoredComponents>,
) {
    let model = world.model();
    let carriers = Carriers::new(archetypes, components, &hidden);
    let without_effect = |rows: &[(&'static str, bool)]| -> Vec<&'static str> {
        rows.iter().filter(|(_, is_ignored)| *is_ignored).map(|(name, _)| *name).collect()
    };
    let (has_forces, sleeps) = (!world.forces().is_empty(), world.swarm.model().sleeps);
    let mut ignored = without_effect(&carriers.of_model(model, has_forces, sleeps));
    let Model { response, rotation, .. } = model;
    for name in ignored.iter().filter(|name| !found.contains(name)) {
        log::warn!(
            "without effect{}: {name}, as the TawModel's response is {response:?} and its rotation {rotation:?}",
            if *name == "MarbleMass" { " in contacts" } else { "" }
        );
    }
    let mut misplaced = without_effect(&carriers.of_places(filter.is_some()));
    misplaced.extend(without_effect(&carriers.of_bodies()));
    for name in misplaced.iter().filter(|name| !found.contains(name)) {
        log::warn!("without effect: {name}");
    }
    ignored.extend(misplaced);
    found.set_if_neq(IgnoredComponents(ignored));
}
