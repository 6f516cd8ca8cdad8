//! From components and resources into the world, where they changed.

use std::sync::atomic::{AtomicBool, Ordering};

use bevy::math::Isometry3d;
use bevy::prelude::*;
use taw::frame::Pose;
use taw::motion::Rotation;
use taw::world::{self as core, WallMotion};

use crate::components::{
    ExternalForce, ExternalImpulse, GravityScale, HalfLength, Marble, MarbleDamping,
    MarbleIntegrator, MarbleMass, MarbleRotation, MarbleState, SeenMarble, Spin, SurfaceMaterial,
    Velocity, WallState, bits, rotation_bits,
};
use crate::convert::{to_point, to_rotation, to_vector};
use crate::diagnostics::StepTimes;
use crate::refusal::InputRefused;
use crate::resources::{Forces, Gravity, TawModel, TawWorld};
use crate::wall::Wall;

/// Takes the model, gravity and forces over, if they can be stepped with.
pub fn settings(
    mut world: ResMut<TawWorld>,
    model: Res<TawModel>,
    gravity: Res<Gravity>,
    forces: Res<Forces>,
    mut times: ResMut<StepTimes>,
    mut refused: MessageWriter<InputRefused>,
) {
    times.begin_step();
    world.begin_step();
    let mut check = |result: Result<(), taw::Error>| {
        if let Err(error) = result {
            InputRefused::write(&mut refused, None, error);
        }
    };
    if model.is_changed() {
        check(world.set_model(**model));
    }
    if gravity.is_changed() {
        check(world.set_gravity(to_vector(**gravity)));
    }
    if forces.is_changed() {
        check(world.set_forces(forces.0.clone()));
    }
}

/// Puts new walls in and moves those that moved.
pub fn walls(
    mut world: ResMut<TawWorld>,
    mut walls: Query<(Entity, Ref<Wall>, Option<&SurfaceMaterial>, &mut WallState)>,
    transforms: TransformHelper,
    time: Res<Time>,
    mut refused: MessageWriter<InputRefused>,
) {
    for (entity, wall, material, mut state) in &mut walls {
        let Ok(transform) = transforms.compute_global_transform(entity) else {
            continue; // a parent without a Transform: nobody can say where this is
        };
        let now = transform.to_isometry();
        if let Some(id) = state.id {
            let motion = motion_between(state.last.unwrap_or(now), now, time.delta_secs());
            // What cannot be right is refused below, with the place that it led to.
            let _ = world.walls.set_motion(id, motion);
        }
        state.last = Some(now);
        let (scale, rotation, translation) = transform.to_scale_rotation_translation();
        let seen = (bits(translation), rotation_bits(rotation), bits(scale));
        let made_anew = wall.is_changed() || state.seen.is_none_or(|before| before.2 != seen.2);
        let moved = state.seen != Some(seen);
        state.seen = Some(seen);
        let mut check = |result: Result<(), taw::Error>| {
            if let Err(error) = result {
                InputRefused::write(&mut refused, Some(entity), error);
            }
        };
        if made_anew {
            let shape = wall.shape(scale);
            state.shape = shape.as_ref().ok().cloned();
            check(shape.map(|_| ()));
        }
        if (made_anew || moved)
            && let Some(shape) = &state.shape
        {
            let rotation = to_rotation(rotation);
            let shape = shape.moved(Pose { rotation, translation: to_vector(translation) });
            check(shape.and_then(|shape| match state.id {
                Some(id) => world.walls.set(id, shape),
                None => world.walls.insert(shape).map(|id| {
                    world.wall_entities.insert(id, entity);
                    state.id = Some(id);
                }),
            }));
        }
        let made_of = material.map(SurfaceMaterial::bits);
        if let Some(id) = state.id
            && state.material != made_of
        {
            state.material = made_of;
            check(world.walls.set_material(id, material.map(|material| (*material).into())));
        }
    }
}

/// How something moved that was `last` one step of `dt` seconds ago, or `None` if it
/// did not.
fn motion_between(last: Isometry3d, now: Isometry3d, dt: f32) -> Option<WallMotion<f32>> {
    (last != now && dt > 0.0).then(|| WallMotion {
        velocity: to_vector(Vec3::from(now.translation - last.translation) / dt),
        spin: to_vector((now.rotation * last.rotation.inverse()).to_scaled_axis() / dt),
        pivot: to_point(now.translation.into()),
    })
}

/// A marble entity's components. The optional ones are read together.
type MarbleComponents<'a> =
    (Entity, &'a Marble, &'a Transform, OptionalComponents<'a>, Has<ChildOf>, &'a mut MarbleState);

type OptionalComponents<'a> = (
    Option<&'a HalfLength>,
    Option<&'a Velocity>,
    Option<&'a Spin>,
    Option<&'a MarbleMass>,
    Option<&'a GravityScale>,
    Option<&'a MarbleDamping>,
    Option<&'a SurfaceMaterial>,
    Option<&'a MarbleIntegrator>,
    Option<&'a MarbleRotation>,
);

impl SeenMarble {
    fn of(marble: Marble, transform: &Transform, optional: &OptionalComponents) -> Self {
        let (
            half_length,
            velocity,
            spin,
            mass,
            gravity_scale,
            damping,
            material,
            integrator,
            rotation_model,
        ) = optional;
        Self {
            translation: bits(transform.translation),
            rotation: rotation_bits(transform.rotation),
            radius: marble.radius.to_bits(),
            half_length: half_length.map(|half| half.to_bits()),
            velocity: velocity.map(|v| bits(**v)),
            spin: spin.map(|s| bits(**s)),
            mass: mass.map(|m| m.bits()),
            gravity_scale: gravity_scale.map(|g| g.to_bits()),
            damping: damping.map(|d| [d.linear, d.angular].map(f32::to_bits)),
            material: material.map(SurfaceMaterial::bits),
            integrator: integrator.map(|i| **i),
            rotation_model: rotation_model.map(|r| **r),
        }
    }
}

/// Puts new marbles in and takes over what somebody else wrote since the last
/// scatter.
pub fn marbles(
    mut world: ResMut<TawWorld>,
    mut queries: ParamSet<(Query<MarbleComponents>, Query<(Entity, &MarbleState)>)>,
    transforms: TransformHelper,
    mut refused: MessageWriter<InputRefused>,
    mut last_rotation: Local<Rotation>,
    mut stale: Local<Vec<Entity>>,
) {
    // The world's own columns for it begin unturned; the components know better.
    let rotation = world.model().rotation;
    let begins_to_turn = *last_rotation == Rotation::None && rotation != Rotation::None;
    *last_rotation = rotation;
    // Looking at all is for all threads; then there are few or none, and they go in order.
    let any = AtomicBool::new(false);
    queries.p0().par_iter_mut().for_each(|(_, marble, transform, optional, _, mut state)| {
        if begins_to_turn {
            (state.seen.rotation, state.seen.spin) = ([0; 4], None); // no rotation's bits
        }
        let seen = SeenMarble::of(*marble, transform, &optional);
        let stale = state.id.is_none() || state.seen != seen;
        if state.stale != stale {
            state.stale = stale;
        }
        if stale {
            any.store(true, Ordering::Relaxed);
        }
    });
    if !any.into_inner() {
        return;
    }
    stale.clear();
    let states = queries.p1();
    stale.extend(states.iter().filter(|(_, state)| state.stale).map(|(entity, _)| entity));
    let mut marbles = queries.p0();
    for entity in stale.drain(..) {
        let Ok((_, marble, transform, optional, is_child, mut state)) = marbles.get_mut(entity)
        else {
            continue;
        };
        let seen = SeenMarble::of(*marble, transform, &optional);
        let (half_length, velocity, spin, mass, gravity_scale, damping, material, _, _) = optional;
        let place = if is_child {
            transforms.compute_global_transform(entity).map(|t| t.compute_transform())
        } else {
            Ok(*transform)
        };
        let Ok(place) = place else {
            continue; // a parent without a Transform: nobody can say where this is
        };
        let last = std::mem::replace(&mut state.seen, seen);
        let now = core::Marble {
            position: to_point(place.translation),
            radius: marble.radius,
            half_length: *half_length.copied().unwrap_or_default(),
            velocity: to_vector(velocity.map_or(Vec3::ZERO, |v| **v)),
            rotation: to_rotation(place.rotation),
            spin: to_vector(spin.map_or(Vec3::ZERO, |s| **s)),
            mass: mass.copied().unwrap_or_default().into(),
            gravity_scale: *gravity_scale.copied().unwrap_or_default(),
            damping: damping.map_or_else(core::Damping::default, |d| core::Damping {
                linear: d.linear,
                angular: d.angular,
            }),
            integrator: seen.integrator,
            rotation_model: seen.rotation_model,
            material: material.map(|m| (*m).into()),
        };
        let refuse = |error| InputRefused::write(&mut refused, Some(entity), error);
        match state.id {
            Some(id) => update(&mut world.marbles, id, &now, &last, &seen, refuse),
            // What was refused is tried again when it changes.
            None if last == seen => {}
            None => match world.marbles.insert(now) {
                Ok(id) => {
                    world.marble_entities.insert(id, entity);
                    state.id = Some(id);
                }
                Err(error) => InputRefused::write(&mut refused, Some(entity), error),
            },
        }
    }
}

/// Takes over the fields that changed from `last` to `seen`, each on its own: one
/// that is refused does not keep back the rest.
fn update(
    marbles: &mut core::Marbles<f32>,
    id: core::MarbleId,
    now: &core::Marble<f32>,
    last: &SeenMarble,
    seen: &SeenMarble,
    mut refuse: impl FnMut(taw::Error),
) {
    let mut check = |result: Result<(), taw::Error>| {
        if let Err(error) = result {
            refuse(error);
        }
    };
    if seen.translation != last.translation {
        check(marbles.set_position(id, now.position));
    }
    if seen.rotation != last.rotation {
        check(marbles.set_rotation(id, now.rotation));
    }
    if seen.radius != last.radius {
        check(marbles.set_radius(id, now.radius));
    }
    if seen.half_length != last.half_length {
        check(marbles.set_half_length(id, now.half_length));
        // Which way a ball points may not have been kept.
        check(marbles.set_rotation(id, now.rotation));
    }
    if seen.velocity != last.velocity && seen.velocity.is_some() {
        check(marbles.set_velocity(id, now.velocity));
    }
    if seen.spin != last.spin && seen.spin.is_some() {
        check(marbles.set_spin(id, now.spin));
    }
    if seen.mass != last.mass {
        check(marbles.set_mass(id, now.mass));
    }
    if seen.gravity_scale != last.gravity_scale {
        check(marbles.set_gravity_scale(id, now.gravity_scale));
    }
    if seen.damping != last.damping {
        check(marbles.set_damping(id, now.damping));
    }
    if seen.material != last.material {
        check(marbles.set_material(id, now.material));
    }
    if seen.rotation_model != last.rotation_model {
        check(marbles.set_rotation_model(id, now.rotation_model));
    }
    if seen.integrator != last.integrator {
        check(marbles.set_integrator(id, now.integrator));
    }
}

/// Applies what pushes and hits single marbles.
pub fn forces(
    mut world: ResMut<TawWorld>,
    forces: Query<(Entity, &ExternalForce, &MarbleState)>,
    mut impulses: Query<(Entity, &mut ExternalImpulse, &MarbleState)>,
    mut refused: MessageWriter<InputRefused>,
) {
    let mut check = |entity, result: Result<(), taw::Error>| {
        if let Err(error) = result {
            InputRefused::write(&mut refused, Some(entity), error);
        }
    };
    for (entity, ExternalForce { force, torque }, state) in &forces {
        if let Some(id) = state.id {
            check(entity, world.marbles.apply_force(id, to_vector(*force)));
            check(entity, world.marbles.apply_torque(id, to_vector(*torque)));
        }
    }
    for (entity, mut hit, state) in &mut impulses {
        let ExternalImpulse { impulse, angular } = *hit;
        if let Some(id) = state.id
            && *hit != ExternalImpulse::default()
        {
            check(entity, world.marbles.apply_impulse(id, to_vector(impulse)));
            check(entity, world.marbles.apply_angular_impulse(id, to_vector(angular)));
            *hit = ExternalImpulse::default();
        }
    }
}

/// Notes how long gathering took.
pub fn finish(mut times: ResMut<StepTimes>) {
    times.end_gather();
}

/// Takes a marble out of the world when its component or entity goes.
pub fn forget_marble(
    removed: On<Remove, Marble>,
    states: Query<&MarbleState>,
    mut world: ResMut<TawWorld>,
    mut commands: Commands,
) {
    if let Ok(MarbleState { id: Some(id), .. }) = states.get(removed.entity) {
        // It can only be gone already if the game took it out by itself.
        let _ = world.marbles.remove(*id);
        world.marble_entities.remove(id);
    }
    commands.entity(removed.entity).try_remove::<MarbleState>();
}

/// Takes a wall out of the world when its component or entity goes.
pub fn forget_wall(
    removed: On<Remove, Wall>,
    states: Query<&WallState>,
    mut world: ResMut<TawWorld>,
    mut commands: Commands,
) {
    if let Ok(WallState { id: Some(id), .. }) = states.get(removed.entity) {
        let _ = world.walls.remove(*id);
        world.wall_entities.remove(id);
    }
    commands.entity(removed.entity).try_remove::<WallState>();
}
