//! From components of bodies to the world.

use bevy::ecs::entity_disabling::Disabled;
use bevy::ecs::query::QueryData;
use bevy::prelude::*;
use taw::body as core;
use taw::body::BodyId;

use crate::body::{Body, BodySettings, BodyState, SeenBody, pose};
use crate::components::{
    AngularVelocity, ExternalForce, ExternalImpulse, GravityScale, Marble, MarbleDamping,
    MarbleMass, Sleeping, SleepingDisabled, SurfaceMaterial, Velocity, bits, rotation_bits,
};
use crate::convert::{to_point, to_rotation, to_vector};
use crate::layers::CollisionLayers;
use crate::refusal::{Refusal, Refusals};
use crate::resources::TawWorld;
use crate::snapshot::RowRemoved;
use crate::wall::Wall;

/// Optional components of a body that are settings.
type SettingComponents<'a> = (
    Option<&'a MarbleMass>,
    Option<&'a GravityScale>,
    Option<&'a MarbleDamping>,
    Option<&'a SurfaceMaterial>,
    Option<&'a CollisionLayers>,
    Has<SleepingDisabled>,
);

/// Components of a body entity.
#[derive(QueryData)]
#[query_data(mutable)]
pub(crate) struct BodyComponents {
    entity: Entity,
    body: Ref<'static, Body>,
    transform: &'static Transform,
    is_child: Has<ChildOf>,
    is_also: (Has<Marble>, Has<Wall>),
    velocity: Option<&'static Velocity>,
    spin: Option<&'static AngularVelocity>,
    settings: SettingComponents<'static>,
    is_disabled: Has<Disabled>,
    state: &'static mut BodyState,
}

impl BodyComponentsItem<'_, '_> {
    fn seen(&self) -> SeenBody {
        let (mass, gravity_scale, damping, material, layers, sleeping_disabled) = self.settings;
        SeenBody {
            place: (bits(self.transform.translation), rotation_bits(self.transform.rotation)),
            velocity: [self.velocity.map(|v| bits(**v)), self.spin.map(|spin| bits(**spin))],
            settings: BodySettings {
                mass: mass.map(|mass| mass.bits()),
                gravity_scale: gravity_scale.map(|scale| scale.to_bits()),
                damping: damping.map(|d| [d.linear, d.angular].map(f32::to_bits)),
                material: material.map(SurfaceMaterial::bits),
                layers: layers.copied().unwrap_or_default(),
                sleeping_disabled,
            },
        }
    }

    /// Writes the shape and the settings to a body.
    fn set(&self, body: &mut core::Body<f32>) -> Result<(), taw::Error> {
        let (mass, gravity_scale, damping, material, layers, sleeping_disabled) = self.settings;
        body.shape = self.body.shape()?;
        body.mass = core::BodyMass::Uniform(mass.copied().unwrap_or_default().into());
        body.gravity_scale = *gravity_scale.copied().unwrap_or_default();
        body.damping = damping.map_or([0.0; 2], |d| [d.linear, d.angular]);
        body.material = material.map(|m| (*m).into()).unwrap_or_default();
        body.layers = layers.copied().unwrap_or_default().into();
        body.sleeping_disabled = sleeping_disabled;
        Ok(())
    }

    /// Checks that the entity can be a body.
    fn check(&self, is_known: bool) -> Result<(), Refusal> {
        let response = "a response other than SoftStep";
        match self.is_also {
            (true, _) => Err(Refusal::BodyAndMarble),
            (_, true) => Err(Refusal::BodyAndWall),
            _ if is_known => Ok(()),
            _ => Err(taw::Error::Unsupported { response, feature: "rigid bodies" }.into()),
        }
    }

    /// Takes the body out of the world until it comes back.
    fn leave(&mut self, world: &mut TawWorld, commands: &mut Commands) {
        if let Some(id) = self.state.id.take() {
            world.body_entities.remove(&id);
            // It can only be gone already if the game took it out by itself.
            self.state.away = world.bodies.remove(id).ok().map(Box::new);
            commands.entity(self.entity).try_remove::<Sleeping>(); // what is away is awake when it comes back
        }
    }

    /// Puts a body in, or takes over what somebody wrote; of one in a restored world, `all` that is set.
    fn take_over(
        &mut self,
        world: &mut TawWorld,
        (place, rotation): (Vec3, Quat),
        (last, seen): (&SeenBody, &SeenBody),
        all: bool,
    ) -> Result<BodyId, taw::Error> {
        let id = self.state.id;
        let is_new = id.is_none() && self.state.away.is_none();
        let was_placed = is_new || last.place != seen.place;
        let was_pushed = is_new || last.velocity != seen.velocity;
        if let Some(id) = id
            && !all
            && last.settings == seen.settings
            && !self.body.is_changed()
        {
            if was_placed {
                world.bodies.set_pose(id, pose(place, rotation))?;
            }
            if was_pushed {
                let now = world.bodies.motion(id)?;
                let velocity = self.velocity.map_or(now.velocity, |v| to_vector(**v));
                let spin = self.spin.map_or(now.angular_velocity, |spin| to_vector(**spin));
                world.bodies.set_velocity(id, velocity, spin)?;
            }
            return Ok(id);
        }
        let before = match (id, &self.state.away) {
            (Some(id), _) => world.bodies.get(id)?,
            (None, Some(away)) => (**away).clone(),
            (None, None) => core::Body::cuboid(to_vector(Vec3::ONE), to_point(place)),
        };
        let mut now = before.clone();
        self.set(&mut now)?;
        if was_placed {
            (now.position, now.rotation) = (to_point(place), to_rotation(rotation));
        }
        if let Some(velocity) = self.velocity.filter(|_| was_pushed) {
            now.velocity = to_vector(**velocity);
        }
        if let Some(spin) = self.spin.filter(|_| was_pushed) {
            now.angular_velocity = to_vector(**spin);
        }
        match id {
            Some(id) if now == before => Ok(id),
            Some(id) => world.bodies.set(id, now).map(|()| id),
            None => world.bodies.insert(now),
        }
    }
}

/// Run condition: there are bodies, also disabled ones, or rows that the game put in by itself.
pub(crate) fn any(world: Res<TawWorld>, bodies: Query<(), (With<Body>, Allow<Disabled>)>) -> bool {
    !(world.bodies.is_empty() && bodies.is_empty())
}

/// Puts new bodies in, and takes over what somebody else wrote since the last scatter.
pub(crate) fn gather(
    mut world: ResMut<TawWorld>,
    mut bodies: Query<BodyComponents, Allow<Disabled>>,
    transforms: TransformHelper,
    (mut refusals, mut removed, mut commands): (Refusals, MessageWriter<RowRemoved>, Commands),
    mut was_known: Local<bool>,
) {
    let is_known = world.model().response.knows_bodies();
    let again = !std::mem::replace(&mut *was_known, is_known) && is_known;
    let restored = world.just_restored;
    for mut it in &mut bodies {
        let entity = it.entity;
        let checked = it.check(is_known);
        if it.is_disabled || checked.is_err() {
            it.leave(&mut world, &mut commands);
            if !it.is_disabled {
                refusals.check(Some(entity), checked);
            }
            continue;
        }
        let seen = it.seen();
        it.state.refused &= !again;
        it.state.id = it.state.id.filter(|id| world.bodies.motion(*id).is_ok());
        let last = it.state.seen;
        let is_settled = it.state.id.is_some() || it.state.refused && !it.is_child;
        if is_settled && last == seen && !it.body.is_changed() && !restored {
            continue;
        }
        let place = if it.is_child {
            let global = transforms.compute_global_transform(entity);
            let Ok(global) = global else {
                refusals.check(Some(entity), Err(Refusal::NoPlace));
                continue;
            };
            (global.translation(), global.rotation())
        } else {
            (it.transform.translation, it.transform.rotation)
        };
        it.state.seen = seen; // only now: what is written to a child without a place counts later
        match it.take_over(&mut world, place, (&last, &seen), restored) {
            Ok(id) => {
                (it.state.id, it.state.refused, it.state.away) = (Some(id), false, None);
                world.body_entities.insert(id, entity);
            }
            Err(error) => {
                it.state.refused = true;
                refusals.check(Some(entity), Err::<(), _>(error));
            }
        }
    }
    // Somebody else changed bodies, or the world is another one.
    let rows = bodies.iter().filter(|it| it.state.id.is_some()).count();
    if [world.bodies.len(), world.body_entities.len()] != [rows; 2] {
        take_out(&mut world, &bodies, &mut removed);
    }
}

/// Takes out the rows that no entity stands behind, and forgets the names of those that are gone.
fn take_out(
    world: &mut TawWorld,
    bodies: &Query<BodyComponents, Allow<Disabled>>,
    removed: &mut MessageWriter<RowRemoved>,
) {
    let has_row = |id| bodies.get(*world.body_entities.get(&id)?).ok()?.state.id;
    let gone: Vec<_> = world.bodies.ids().filter(|id| has_row(*id) != Some(*id)).collect();
    for id in gone {
        let _ = world.bodies.remove(id); // it is there: its row named it
        log::warn!("taw took out {id:?}: no entity stands behind it");
        removed.write(RowRemoved::Body(id));
    }
    world.body_entities.retain(|id, _| world.world.bodies.motion(*id).is_ok());
}

/// Gives body entities the rows that they have in a restored world.
pub(crate) fn name(world: Res<TawWorld>, mut bodies: Query<&mut BodyState, Allow<Disabled>>) {
    for mut state in &mut bodies {
        (state.id, state.refused) = (None, false);
    }
    for (id, entity) in &world.body_entities {
        if let Ok(mut state) = bodies.get_mut(*entity) {
            (state.id, state.away) = (Some(*id), None);
        }
    }
}

/// Applies what pushes and hits single bodies.
pub(crate) fn forces(
    mut world: ResMut<TawWorld>,
    forces: Query<(Entity, &ExternalForce, &BodyState)>,
    mut impulses: Query<(Entity, &mut ExternalImpulse, &BodyState)>,
    mut refusals: Refusals,
) {
    for (entity, ExternalForce { force, torque }, state) in &forces {
        if let Some(id) = state.id {
            let [force, torque] = [*force, *torque].map(to_vector);
            refusals.check(Some(entity), world.bodies.apply_central_force(id, force, torque));
        }
    }
    for (entity, mut hit, state) in &mut impulses {
        if let Some(id) = state.id
            && *hit != ExternalImpulse::default()
        {
            let [impulse, angular] = [hit.impulse, hit.angular].map(to_vector);
            let applied = world.bodies.apply_central_impulse(id, impulse, angular);
            refusals.check(Some(entity), applied);
            *hit = ExternalImpulse::default();
        }
    }
}
