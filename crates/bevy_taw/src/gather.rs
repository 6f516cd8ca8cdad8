//! From components and resources into the world, where they changed.

use std::sync::atomic::{AtomicBool, Ordering};

use bevy::ecs::entity::Entities;
use bevy::prelude::*;
use taw::motion::Rotation;
use taw::response::Response;
use taw::world::{self as core, Model};

use crate::components::{
    AngularVelocity, ExternalForce, ExternalImpulse, GravityScale, HalfLength, Marble,
    MarbleDamping, MarbleIntegrator, MarbleMass, MarbleRotation, MarbleState, SeenMarble, Sleeping,
    SleepingDisabled, SurfaceMaterial, Velocity, bits, rotation_bits,
};
use crate::convert::{to_point, to_rotation, to_vector};
use crate::diagnostics::StepTimes;
use crate::ignore::ColliderDisabled;
use crate::layers::CollisionLayers;
use crate::locked_axes::LockedAxes;
use crate::refusal::{Refusal, Refusals};
use crate::resources::{Forces, Gravity, TawModel, TawWorld};
use crate::snapshot::{self, RowRemoved};

/// Takes the model, gravity and forces over, if they can be stepped with.
pub fn settings(
    mut world: ResMut<TawWorld>,
    model: Res<TawModel>,
    gravity: Res<Gravity>,
    forces: Res<Forces>,
    mut times: ResMut<StepTimes>,
    mut refusals: Refusals,
) {
    times.begin_step();
    world.begin_step();
    refusals.begin_step();
    // Values are compared, and not whether somebody marked them: a slider that is open marks
    // in every frame, and a world that was restored has others.
    if **model != world.model()
        && let Err(error) = world.set_model(**model)
    {
        let capsule = match error {
            taw::Error::UnsupportedShape(id) => world.marble_entities.get(&id).copied(),
            _ => None,
        };
        let refusal = match capsule {
            Some(_) => Refusal::ModelOfBalls(model.response),
            None => error.into(),
        };
        refusals.check(capsule, Err(refusal));
    }
    let pull = to_vector(**gravity);
    if pull != world.gravity() {
        refusals.check(None, world.set_gravity(pull));
    }
    if forces.0 != world.forces() {
        refusals.check(None, world.set_forces(forces.0.clone()));
    }
}

/// A marble entity's components. The optional ones are read together.
type MarbleComponents<'a> =
    (Entity, &'a Marble, &'a Transform, OptionalComponents<'a>, Has<ChildOf>, &'a mut MarbleState);

type MarbleItem<'a> =
    (Entity, &'a Marble, &'a Transform, OptionalComponents<'a>, bool, Mut<'a, MarbleState>);

type OptionalComponents<'a> = (
    Option<&'a HalfLength>,
    Option<&'a Velocity>,
    Option<&'a AngularVelocity>,
    Option<&'a MarbleMass>,
    Option<&'a GravityScale>,
    Option<&'a MarbleDamping>,
    Option<&'a SurfaceMaterial>,
    Option<&'a MarbleIntegrator>,
    Option<&'a MarbleRotation>,
    Option<&'a LockedAxes>,
    Option<&'a SleepingDisabled>,
    Option<&'a CollisionLayers>,
    Option<&'a ColliderDisabled>,
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
            locked_axes,
            sleeping_disabled,
            layers,
            disabled,
        ) = optional;
        Self {
            translation: bits(transform.translation),
            rotation: rotation_bits(transform.rotation),
            radius: marble.radius.to_bits(),
            half_length: half_length.map(|half| half.to_bits()),
            velocity: velocity.map(|v| bits(**v)),
            angular_velocity: spin.map(|s| bits(**s)),
            mass: mass.map(|m| m.bits()),
            gravity_scale: gravity_scale.map(|g| g.to_bits()),
            damping: damping.map(|d| [d.linear, d.angular].map(f32::to_bits)),
            material: material.map(SurfaceMaterial::bits),
            integrator: integrator.map(|i| **i),
            rotation_model: rotation_model.map(|r| **r),
            locked_axes: locked_axes.copied().unwrap_or_default(),
            layers: if disabled.is_some() {
                CollisionLayers::NONE
            } else {
                layers.copied().unwrap_or_default()
            },
            sleeping_disabled: sleeping_disabled.is_some(),
        }
    }
}

/// Settings when marbles were last gathered, and number of marbles after that.
#[derive(Default)]
pub struct Settings {
    rotation: Rotation,
    response: Response,
    marbles: usize,
}

/// Marbles that others changed, besides those that components tell.
#[derive(Resource, Default)]
pub struct ChangedMarbles {
    /// Lost an optional component or their parent since the last step, asleep.
    pub lost_component: Vec<Entity>,
    /// Were taken over in this step.
    pub gathered: Vec<Entity>,
}

/// Notes that a marble asleep lost an optional component, or its parent.
pub fn note_lost_component<C: Component>(
    removed: On<Remove, C>,
    asleep: Query<(), (With<Marble>, With<Sleeping>)>,
    mut changed: ResMut<ChangedMarbles>,
) {
    if asleep.contains(removed.entity) {
        changed.lost_component.push(removed.entity);
    }
}

/// Marbles asleep of which a component was written, if only with the same value.
type WrittenAsleep = (
    With<Sleeping>,
    Or<(
        Changed<Marble>,
        Changed<Transform>,
        Changed<HalfLength>,
        Changed<Velocity>,
        Changed<AngularVelocity>,
        Changed<MarbleMass>,
        Changed<GravityScale>,
        Changed<MarbleDamping>,
        Changed<SurfaceMaterial>,
        Changed<MarbleIntegrator>,
        Changed<MarbleRotation>,
        Changed<LockedAxes>,
        Changed<SleepingDisabled>,
        Changed<CollisionLayers>,
        Changed<ColliderDisabled>,
    )>,
);

/// Number of marbles from which on it pays to look at them on all threads.
pub const MANY: usize = 1_000;

/// Queries of marbles: all, their states, those awake, and those that were written asleep.
type MarbleQueries<'w, 's, 'a, 'b> = ParamSet<
    'w,
    's,
    (
        Query<'a, 'b, MarbleComponents<'static>>,
        Query<'a, 'b, (Entity, &'static mut MarbleState)>,
        Query<'a, 'b, MarbleComponents<'static>, Without<Sleeping>>,
        Query<'a, 'b, MarbleComponents<'static>, WrittenAsleep>,
    ),
>;

/// Puts new marbles in and takes over what somebody else wrote since the last
/// scatter.
pub fn marbles(
    mut world: ResMut<TawWorld>,
    mut queries: MarbleQueries,
    transforms: TransformHelper,
    entities: &Entities,
    (mut refusals, mut removed, mut commands): (Refusals, MessageWriter<RowRemoved>, Commands),
    mut last: Local<Settings>,
    mut changed: ResMut<ChangedMarbles>,
) {
    if world.just_restored {
        snapshot::name_marbles(&mut world, &mut queries.p1());
    }
    changed.gathered.clear();
    if find_stale(&world, &last, &mut queries, &mut changed) {
        let states = queries.p1();
        let stale = states.iter().filter(|(_, state)| state.stale).map(|(entity, _)| entity);
        changed.gathered.extend(stale);
    }
    let mut without_row = 0;
    let mut marbles = queries.p0();
    for entity in &changed.gathered {
        let Ok(marble) = marbles.get_mut(*entity) else { continue };
        let has_row = take_over(&mut world, marble, &transforms, &mut refusals);
        without_row += usize::from(!has_row);
    }
    let visible = queries.p1();
    if visible.iter().len() != world.marbles.len() + without_row {
        let (removed, commands) = (&mut removed, &mut commands);
        snapshot::take_out_marbles(&mut world, &visible, entities, removed, commands);
    }
    let Model { rotation, response, .. } = world.model();
    *last = Settings { rotation, response, marbles: world.marbles.len() };
}

/// Marks the marbles of which components differ from what was seen. Returns whether any does.
fn find_stale(
    world: &TawWorld,
    last: &Settings,
    queries: &mut MarbleQueries,
    changed: &mut ChangedMarbles,
) -> bool {
    let model = world.model();
    // The world's own columns for it begin unturned; the components know better.
    let begins_to_turn = last.rotation == Rotation::None && model.rotation != Rotation::None;
    // What could be no marble may be one now.
    let knows_capsules = !last.response.knows_capsules() && model.response.knows_capsules();
    let knows_locks = !last.response.knows_locked_axes() && model.response.knows_locked_axes();
    let any = AtomicBool::new(false);
    let (rows, restored) = (&world.marbles, world.just_restored);
    let look = |(_, marble, transform, optional, _, mut state): MarbleItem| {
        if begins_to_turn {
            (state.seen.rotation, state.seen.angular_velocity) = ([0; 4], None); // no rotation's bits
        }
        if knows_capsules && optional.0.is_some() {
            (state.seen.half_length, state.refused) = (None, false);
        }
        if knows_locks {
            state.refused = false;
        }
        if state.id.is_some_and(|id| rows.row(id).is_err()) {
            (state.id, state.refused) = (None, false); // it was away, or somebody took it out
        }
        let seen = SeenMarble::of(*marble, transform, &optional);
        let stale = state.id.is_none() || state.seen != seen || restored;
        if state.stale != stale {
            state.stale = stale;
        }
        if stale {
            any.store(true, Ordering::Relaxed);
        }
    };
    // What sleeps is looked at only where it was written.
    let knows_more = knows_capsules || knows_locks;
    let all = begins_to_turn || knows_more || restored || last.marbles != rows.len();
    match (all, rows.len() >= MANY, queries.p2().iter().len() >= MANY) {
        (true, false, _) => queries.p0().iter_mut().for_each(look),
        (true, true, _) => queries.p0().par_iter_mut().for_each(look),
        (false, _, false) => queries.p2().iter_mut().for_each(look),
        (false, _, true) => queries.p2().par_iter_mut().for_each(look),
    }
    let lost_component = changed.lost_component.drain(..);
    if !all {
        queries.p3().iter_mut().for_each(look);
        for entity in lost_component {
            // One that was despawned is gone.
            if queries.p0().get_mut(entity).map(look).is_ok() {
                changed.gathered.push(entity);
            }
        }
    }
    any.into_inner()
}

/// Takes over one marble. Gives whether it has a row.
fn take_over(
    world: &mut TawWorld,
    (entity, marble, transform, optional, is_child, mut state): MarbleItem,
    transforms: &TransformHelper,
    refusals: &mut Refusals,
) -> bool {
    let seen = SeenMarble::of(*marble, transform, &optional);
    let place = if is_child {
        transforms.compute_global_transform(entity).map(|t| t.compute_transform())
    } else {
        Ok(*transform)
    };
    let Ok(place) = place else {
        refusals.check(Some(entity), Err(Refusal::NoPlace));
        return state.id.is_some();
    };
    let [x, y, z] = place.scale.to_array();
    if is_child && transform.is_finite() && !place.is_finite() {
        refusals.check(Some(entity), Err(Refusal::NoFrame(x, y, z)));
        return state.id.is_some();
    }
    let last = std::mem::replace(&mut state.seen, seen);
    let mut now = to_core(*marble, &place, &optional, &seen);
    let half_length = now.half_length;
    let balls_only = !world.model().response.knows_capsules() && half_length > 0.0;
    let check = |result: Result<(), Refusal>| refusals.check(Some(entity), result);
    if let Some(id) = state.id {
        let all = world.just_restored;
        update(&mut world.marbles, id, &now, &last, &seen, (all, balls_only), check);
        return true;
    }
    // What was refused is tried again when it changes; of a child, its parents may have.
    if state.refused && last == seen && !is_child {
        return false;
    }
    if let Some(away) = world.away.get(&entity) {
        come_back(&mut now, away, &last, &seen);
    }
    let inserted = if balls_only {
        Err(Refusal::Capsule(half_length))
    } else {
        world.marbles.insert(now).map_err(Refusal::from)
    };
    let inserted = inserted.map(|id| {
        world.away.remove(&entity);
        world.marble_entities.insert(id, entity);
        state.id = Some(id);
    });
    state.refused = !refusals.check(Some(entity), inserted);
    !state.refused
}

/// Marble of an entity with these components.
fn to_core(
    marble: Marble,
    place: &Transform,
    optional: &OptionalComponents,
    seen: &SeenMarble,
) -> core::Marble<f32> {
    let (half_length, velocity, spin, mass, gravity_scale, damping, material, ..) = *optional;
    core::Marble {
        position: to_point(place.translation),
        radius: marble.radius,
        half_length: *half_length.copied().unwrap_or_default(),
        velocity: to_vector(velocity.map_or(Vec3::ZERO, |v| **v)),
        rotation: to_rotation(place.rotation),
        angular_velocity: to_vector(spin.map_or(Vec3::ZERO, |s| **s)),
        mass: mass.copied().unwrap_or_default().into(),
        gravity_scale: *gravity_scale.copied().unwrap_or_default(),
        damping: damping.map_or_else(core::Damping::default, |d| core::Damping {
            linear: d.linear,
            angular: d.angular,
        }),
        integrator: seen.integrator,
        rotation_model: seen.rotation_model,
        material: material.map(|m| (*m).into()),
        locked_axes: seen.locked_axes.into(),
        layers: seen.layers.into(),
        sleeping_disabled: seen.sleeping_disabled,
    }
}

/// Makes a marble that comes back go on as it was, except for what was written since.
fn come_back(
    now: &mut core::Marble<f32>,
    away: &core::Marble<f32>,
    last: &SeenMarble,
    seen: &SeenMarble,
) {
    if seen.translation == last.translation {
        now.position = away.position; // what was drawn may lie between two steps
    }
    if seen.rotation == last.rotation {
        now.rotation = away.rotation;
    }
    if seen.velocity.is_none() {
        now.velocity = away.velocity;
    }
    if seen.angular_velocity.is_none() {
        now.angular_velocity = away.angular_velocity;
    }
}

/// Takes over the fields that changed from `last` to `seen`, each on its own: one
/// that is refused does not keep back the rest. Of a world that was restored `all`, except
/// its motion.
fn update(
    marbles: &mut core::Marbles<f32>,
    id: core::MarbleId,
    now: &core::Marble<f32>,
    last: &SeenMarble,
    seen: &SeenMarble,
    (all, balls_only): (bool, bool),
    mut check: impl FnMut(Result<(), Refusal>) -> bool,
) {
    let mut set = |result: Result<(), taw::Error>| check(result.map_err(Refusal::from));
    if seen.translation != last.translation {
        set(marbles.set_position(id, now.position));
    }
    if seen.rotation != last.rotation {
        set(marbles.set_rotation(id, now.rotation));
    }
    if all || seen.radius != last.radius {
        set(marbles.set_radius(id, now.radius));
    }
    if !balls_only && (all || seen.half_length != last.half_length) {
        set(marbles.set_half_length(id, now.half_length));
        // Which way a ball points may not have been kept.
        if seen.half_length != last.half_length {
            set(marbles.set_rotation(id, now.rotation));
        }
    }
    if seen.velocity != last.velocity && seen.velocity.is_some() {
        set(marbles.set_velocity(id, now.velocity));
    }
    if seen.angular_velocity != last.angular_velocity && seen.angular_velocity.is_some() {
        set(marbles.set_angular_velocity(id, now.angular_velocity));
    }
    if all || seen.mass != last.mass {
        set(marbles.set_mass(id, now.mass));
    }
    if all || seen.gravity_scale != last.gravity_scale {
        set(marbles.set_gravity_scale(id, now.gravity_scale));
    }
    if all || seen.damping != last.damping {
        set(marbles.set_damping(id, now.damping));
    }
    if all || seen.material != last.material {
        set(marbles.set_material(id, now.material));
    }
    if all || seen.rotation_model != last.rotation_model {
        set(marbles.set_rotation_model(id, now.rotation_model));
    }
    if all || seen.integrator != last.integrator {
        set(marbles.set_integrator(id, now.integrator));
    }
    if all || seen.locked_axes != last.locked_axes {
        set(marbles.set_locked_axes(id, now.locked_axes));
    }
    if all || seen.layers != last.layers {
        set(marbles.set_layers(id, now.layers));
    }
    if all || seen.sleeping_disabled != last.sleeping_disabled {
        set(marbles.set_sleeping_disabled(id, now.sleeping_disabled));
    }
    if balls_only && seen.half_length != last.half_length {
        check(Err(Refusal::Capsule(now.half_length)));
    }
}

/// Applies what pushes and hits single marbles.
pub fn forces(
    mut world: ResMut<TawWorld>,
    forces: Query<(Entity, &ExternalForce, &MarbleState)>,
    mut impulses: Query<(Entity, &mut ExternalImpulse, &MarbleState)>,
    mut refusals: Refusals,
) {
    for (entity, ExternalForce { force, torque }, state) in &forces {
        if let Some(id) = state.id {
            refusals.check(Some(entity), world.marbles.apply_force(id, to_vector(*force)));
            refusals.check(Some(entity), world.marbles.apply_torque(id, to_vector(*torque)));
        }
    }
    for (entity, mut hit, state) in &mut impulses {
        let ExternalImpulse { impulse, angular } = *hit;
        if let Some(id) = state.id
            && *hit != ExternalImpulse::default()
        {
            refusals.check(Some(entity), world.marbles.apply_impulse(id, to_vector(impulse)));
            let angular = to_vector(angular);
            refusals.check(Some(entity), world.marbles.apply_angular_impulse(id, angular));
            *hit = ExternalImpulse::default();
        }
    }
}

/// Notes how long gathering took.
pub fn finish(mut times: ResMut<StepTimes>, mut world: ResMut<TawWorld>) {
    world.just_restored = false;
    times.end_gather();
}
