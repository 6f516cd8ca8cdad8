//! Walls, from components into the world: shapes are built once, in their own frames, and then
//! only put where they are.

use std::time::Duration;

use bevy::ecs::entity::Entities;
use bevy::math::Isometry3d;
use bevy::prelude::*;
use taw::frame::Pose;
use taw::world::WallMotion;

use crate::components::{
    Kinematic, LocalShape, Marble, SurfaceMaterial, SurfaceVelocity, Teleport, WallState, bits,
    rotation_bits,
};
use crate::convert::{all_finite, to_point, to_rotation, to_vector};
use crate::ignore::OneWay;
use crate::layers::CollisionLayers;
use crate::refusal::{Refusal, Refusals};
use crate::resources::TawWorld;
use crate::sensor::Sensor;
use crate::snapshot::{self, RowRemoved};
use crate::wall::Wall;
use crate::wall_motion::{Change, Clock, LARGEST_CHANGE_OF_SPEED, TrackedPose, WallVelocity};

/// Two scales that differ by no larger part than this are one. A rotation leaves its columns a
/// few epsilons longer or shorter, and each ancestor a few more: 32 of them are reached by none
/// of ten ancestors, and move the surface by four millionths of the wall's size.
const SAME_SCALE: f32 = 32.0 * f32::EPSILON;

/// Lengths of frames, in seconds of virtual time.
#[derive(Resource, Default)]
pub struct FrameTime {
    /// Of this frame.
    this: f32,
    /// Of all frames that ended since the last fixed step.
    since_step: f32,
    /// True until the first fixed step of this frame.
    first: bool,
    /// Fixed time of the last gather.
    pub gathered_at: Duration,
}

/// Counts a frame.
pub fn count_frame(mut frame: ResMut<FrameTime>, time: Res<Time<Virtual>>) {
    frame.since_step += frame.this;
    frame.this = time.delta_secs();
    frame.first = true;
}

/// Notes where walls are before the first fixed step of a frame.
pub fn note_before_steps(
    frame: Res<FrameTime>,
    mut walls: Query<(Entity, &mut WallState)>,
    transforms: TransformHelper,
) {
    if frame.first {
        for (entity, mut state) in &mut walls {
            state.motion.before_steps = finite_place(&transforms, entity);
        }
    }
}

/// Notes where walls are after the last fixed step of a frame.
pub fn note_after_steps(
    frame: Res<FrameTime>,
    mut walls: Query<(Entity, &mut WallState)>,
    transforms: TransformHelper,
) {
    if !frame.first {
        for (entity, mut state) in &mut walls {
            state.motion.after_steps = finite_place(&transforms, entity);
        }
    }
}

/// Place of an entity in the world, if it has one.
fn finite_place(transforms: &TransformHelper, entity: Entity) -> Option<Isometry3d> {
    let place = transforms.compute_global_transform(entity).ok()?.to_isometry();
    is_finite(place).then_some(place)
}

type OptionalComponents<'a> = (
    Option<&'a SurfaceMaterial>,
    Option<&'a CollisionLayers>,
    Option<&'a SurfaceVelocity>,
    Option<&'a OneWay>,
);
type WallComponents<'a> = (
    (Entity, &'a Transform, Has<Marble>, Has<Sensor>),
    Ref<'a, Wall>,
    OptionalComponents<'a>,
    &'a mut WallState,
);
type WallItem<'a> = (
    (Entity, &'a Transform, bool, bool),
    Ref<'a, Wall>,
    OptionalComponents<'a>,
    Mut<'a, WallState>,
);

/// Entities that are marked as put elsewhere and as driven, and the parents of all.
type Marked<'w, 's> = (
    Query<'w, 's, (), With<Teleport>>,
    Query<'w, 's, (), With<Kinematic>>,
    Query<'w, 's, &'static ChildOf>,
);

/// Puts new walls in and moves those that moved.
pub fn walls(
    mut world: ResMut<TawWorld>,
    mut walls: Query<WallComponents>,
    transforms: TransformHelper,
    (teleports, kinematic, parents): Marked,
    (time, fixed, mut frame): (Res<Time>, Res<Time<Fixed>>, ResMut<FrameTime>),
    entities: &Entities,
    (mut refusals, mut removed): (Refusals, MessageWriter<RowRemoved>),
) {
    if world.just_restored {
        snapshot::name_walls(&mut world, walls.iter_mut().map(|it| (it.0.0, it.3)));
    }
    // Somebody else changed walls, or the world is another one.
    let all = world.just_restored || world.walls.version() != world.walls_gathered;
    let clock = Clock {
        dt: time.delta_secs(),
        overstep: fixed.overstep().as_secs_f32(),
        frames: frame.since_step,
    };
    *frame =
        FrameTime { this: frame.this, since_step: 0.0, first: false, gathered_at: fixed.elapsed() };
    let (mut rows, mut sensors) = (0, 0);
    world.moving_walls.clear();
    for mut item in &mut walls {
        let entity = item.0.0;
        let change = if is_marked(&teleports, &parents, entity) {
            Change::Jump
        } else if is_marked(&kinematic, &parents, entity) {
            Change::Motion
        } else {
            Change::Judged
        };
        let place = transforms.compute_global_transform(entity).ok();
        let mut gathering = Gathering { world: &mut world, refusals: &mut refusals, all, change };
        gathering.take_over(&mut item, place, clock);
        rows += usize::from(item.3.id.is_some());
        sensors += usize::from(item.3.sensor.is_some());
    }
    if rows != world.walls.len() {
        snapshot::take_out_walls(
            &mut world,
            |wall| walls.get(wall).ok()?.3.id,
            entities,
            &mut removed,
        );
    }
    if sensors != world.sensors.len() {
        snapshot::take_out_sensors(&mut world, |it| walls.get(it).ok()?.3.sensor);
    }
    world.walls_gathered = world.walls.version();
}

/// Tests for a mark on an entity, or on what carries it.
fn is_marked<M: Component>(
    marks: &Query<(), With<M>>,
    parents: &Query<&ChildOf>,
    entity: Entity,
) -> bool {
    !marks.is_empty()
        && (marks.contains(entity) || parents.iter_ancestors(entity).any(|it| marks.contains(it)))
}

/// Takes the marks off again.
pub fn land(jumps: Query<Entity, With<Teleport>>, mut commands: Commands) {
    for entity in &jumps {
        commands.entity(entity).try_remove::<Teleport>();
    }
}

/// One wall on its way into the world.
struct Gathering<'a, 'w> {
    world: &'a mut TawWorld,
    refusals: &'a mut Refusals<'w>,
    /// True if the world may not be what gather left.
    all: bool,
    change: Change,
}

impl Gathering<'_, '_> {
    /// Takes over one wall or sensor.
    fn take_over(
        &mut self,
        ((entity, own, is_marble, is_sensor), wall, optional, state): &mut WallItem,
        place: Option<GlobalTransform>,
        clock: Clock,
    ) {
        let (entity, state) = (*entity, &mut **state);
        if state.id.is_some_and(|id| self.world.walls.row(id).is_err())
            || state.sensor.is_some_and(|id| self.world.sensors.shape(id).is_err())
        {
            *state = state.without_row();
        }
        if *is_marble {
            self.refusals.check(Some(entity), Err(Refusal::MarbleAndWall));
            self.take_out(entity, state);
            *state = WallState::default();
            return;
        }
        if *is_sensor && state.id.is_some() || !*is_sensor && state.sensor.is_some() {
            self.take_out(entity, state);
            *state = state.without_row();
        }
        let Some(place) = place else {
            self.refusals.check(Some(entity), Err(Refusal::NoPlace));
            return self.stop(state);
        };
        if !self.refusals.check(Some(entity), finite(own)) {
            return self.stop(state);
        }
        let (scale, rotation, translation) = place.to_scale_rotation_translation();
        let no_frame = Refusal::NoFrame(scale.x, scale.y, scale.z);
        if !(scale.is_finite() && translation.is_finite()) {
            self.refusals.check(Some(entity), Err(no_frame));
            return self.stop(state);
        }
        if wall.is_changed() || !state.built.is_some_and(|built| same_scale(built, scale)) {
            state.built = Some(scale);
            let built = wall.shape(scale).map(|shape| {
                state.shape = Some(LocalShape { shape, reach: wall.reach(scale) });
                state.posed = None;
            });
            state.refused = !self.refusals.check(Some(entity), built);
        }
        if state.refused {
            return self.stop(state); // as it was before, and where
        }
        let now = Isometry3d::new(translation, rotation);
        if !is_finite(now) {
            self.refusals.check(Some(entity), Err(no_frame));
            return self.stop(state);
        }
        let (material, layers, surface, one_way) = *optional;
        let surface = surface
            .copied()
            .filter(|surface| self.refusals.check(Some(entity), finite_surface(*surface)));
        self.put(entity, state, now, (clock, *is_sensor, surface));
        self.make_of(entity, state, material);
        self.put_into_layers(entity, state, layers.copied().unwrap_or_default());
        self.put_one_way(entity, state, one_way);
    }

    /// Takes a wall or sensor out of the world.
    fn take_out(&mut self, entity: Entity, state: &WallState) {
        if let Some(id) = state.id {
            let _ = self.world.walls.remove(id); // it is there: its row was found
            self.world.wall_entities.remove(&id);
        }
        if let Some(id) = state.sensor {
            self.world.remove_sensor(id, entity);
        }
    }

    /// Leaves a wall where it is, at rest.
    fn stop(&mut self, state: &mut WallState) {
        (state.motion, state.poses) = default();
        let _ = self.set_motion(state, None);
    }

    /// Sets the motion of a wall or sensor.
    fn set_motion(
        &mut self,
        state: &WallState,
        motion: Option<WallMotion<f32>>,
    ) -> Result<(), taw::Error> {
        match (state.id, state.sensor) {
            (Some(id), _) => self.world.walls.set_motion(id, motion),
            (None, Some(id)) => self.world.sensors.set_motion(id, motion),
            (None, None) => Ok(()),
        }
    }

    /// Puts a wall or sensor where it is now, with the velocity at which it came there.
    fn put(
        &mut self,
        entity: Entity,
        state: &mut WallState,
        now: Isometry3d,
        (clock, is_sensor, surface): (Clock, bool, Option<SurfaceVelocity>),
    ) {
        let Some(LocalShape { shape, reach }) = &state.shape else { return };
        let TrackedPose { pose, velocity, jumped } =
            state.motion.advance(now, clock, *reach, self.change);
        if jumped && !std::mem::replace(&mut state.jumped, true) {
            log::warn!(
                "taw takes a move of {entity} for a jump, which carries nothing along: it changed the \
                 speed of the wall by more than {LARGEST_CHANGE_OF_SPEED} m/s in a step; mark what is \
                 driven with Kinematic, what is put elsewhere with Teleport"
            );
        }
        let translation = Vec3::from(pose.translation);
        let seen = (bits(translation), rotation_bits(pose.rotation));
        let before = state.posed.filter(|_| velocity.is_some()).map(|(translation, rotation)| {
            let translation = Vec3::from_array(translation.map(f32::from_bits));
            Isometry3d::new(translation, Quat::from_array(rotation.map(f32::from_bits)))
        });
        state.poses = Some([before.unwrap_or(pose), pose]);
        // A wall that moves or jumps has no surface velocity, nor has a sensor.
        let surface = surface.filter(|_| !is_sensor && state.posed == Some(seen));
        let on_surface = |SurfaceVelocity(surface): SurfaceVelocity| WallVelocity {
            linear: pose.rotation * surface,
            angular: Vec3::ZERO,
        };
        state.is_belt = velocity.is_none() && surface.is_some();
        let motion = velocity.or_else(|| surface.map(on_surface)).map(|velocity| WallMotion {
            velocity: to_vector(velocity.linear),
            angular_velocity: to_vector(velocity.angular),
            pivot: to_point(translation),
        });
        let set = self.set_motion(state, motion);
        self.refusals.check(Some(entity), set);
        self.world.moving_walls.extend(state.id.filter(|_| velocity.is_some()));
        if state.posed == Some(seen) && !self.all {
            return;
        }
        state.posed = Some(seen);
        let rotation = to_rotation(pose.rotation);
        let shape = shape.transformed(Pose { rotation, translation: to_vector(translation) });
        let put = shape.and_then(|shape| match (is_sensor, state.id, state.sensor) {
            (false, Some(id), _) => self.world.walls.set(id, shape),
            (false, None, _) => self.world.walls.insert(shape).map(|id| {
                self.world.wall_entities.insert(id, entity);
                state.id = Some(id);
            }),
            (true, _, Some(id)) => self.world.sensors.set(id, shape),
            (true, _, None) => self.world.sensors.insert(shape).map(|id| {
                self.world.sensor_entities.insert(id, entity);
                state.sensor = Some(id);
            }),
        });
        self.refusals.check(Some(entity), put);
    }

    /// Gives a wall or sensor its layers.
    fn put_into_layers(&mut self, entity: Entity, state: &mut WallState, layers: CollisionLayers) {
        if state.layers == layers && !self.all {
            return;
        }
        let set = match (state.id, state.sensor) {
            (Some(id), _) => self.world.walls.set_layers(id, layers.into()),
            (None, Some(id)) => self.world.sensors.set_layers(id, layers.into()),
            (None, None) => return,
        };
        state.layers = layers;
        self.refusals.check(Some(entity), set);
    }

    /// Makes a one-way wall of a wall, or one that is solid from all sides.
    fn put_one_way(&mut self, entity: Entity, state: &WallState, one_way: Option<&OneWay>) {
        let (Some(id), Some((_, rotation))) = (state.id, state.posed) else { return };
        let rotation = Quat::from_array(rotation.map(f32::from_bits));
        let direction =
            one_way.map(|OneWay(direction)| to_vector(rotation * Vec3::from(*direction)));
        if direction.is_some() || self.world.walls.one_way(id) != Ok(None) {
            let set = self.world.walls.set_one_way(id, direction);
            self.refusals.check(Some(entity), set);
        }
    }

    /// Gives a wall its material.
    fn make_of(
        &mut self,
        entity: Entity,
        state: &mut WallState,
        material: Option<&SurfaceMaterial>,
    ) {
        let made_of = material.map(SurfaceMaterial::bits);
        if let Some(id) = state.id
            && (state.material != made_of || self.all)
        {
            state.material = made_of;
            let material = material.map(|material| (*material).into());
            self.refusals.check(Some(entity), self.world.walls.set_material(id, material));
        }
    }
}

/// Tests if all numbers of a `Transform` are finite.
fn finite(own: &Transform) -> Result<(), taw::Error> {
    let Transform { translation, rotation, scale } = own;
    let fields = [
        ("translation.x", translation.x),
        ("translation.y", translation.y),
        ("translation.z", translation.z),
        ("rotation.x", rotation.x),
        ("rotation.y", rotation.y),
        ("rotation.z", rotation.z),
        ("rotation.w", rotation.w),
        ("scale.x", scale.x),
        ("scale.y", scale.y),
        ("scale.z", scale.z),
    ];
    all_finite(fields)
}

/// Checks that all numbers of a surface velocity are finite.
fn finite_surface(SurfaceVelocity(Vec3 { x, y, z }): SurfaceVelocity) -> Result<(), taw::Error> {
    all_finite([("surface_velocity.x", x), ("surface_velocity.y", y), ("surface_velocity.z", z)])
}

/// Tests if a shape that was built for one scale does for another.
fn same_scale(built: Vec3, now: Vec3) -> bool {
    bits(built) == bits(now) || (now - built).abs().cmple(built.abs() * SAME_SCALE).all()
}

fn is_finite(place: Isometry3d) -> bool {
    place.translation.is_finite() && place.rotation.is_finite()
}
