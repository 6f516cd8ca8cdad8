//! Walls, from components into the world: shapes are built once, in their own frames, and then
//! only put where they are.

use bevy::ecs::entity::Entities;
use bevy::math::Isometry3d;
use bevy::prelude::*;
use taw::frame::Pose;
use taw::world::WallMotion;

use crate::components::{
    LocalShape, Marble, SurfaceMaterial, Teleport, WallState, Way, bits, rotation_bits,
};
use crate::convert::{to_point, to_rotation, to_vector};
use crate::layers::CollisionLayers;
use crate::refusal::{Refusal, Refusals};
use crate::resources::TawWorld;
use crate::snapshot::{self, RowRemoved};
use crate::wall::Wall;

/// Two scales that differ by no larger part than this are one. A rotation leaves its columns a
/// few epsilons longer or shorter, and each ancestor a few more: 32 of them are reached by none
/// of ten ancestors, and move the surface by four millionths of the wall's size.
const SAME_SCALE: f32 = 32.0 * f32::EPSILON;

/// The time since fixed steps last began, which is what the rest of the game had to move walls.
#[derive(Resource, Default)]
pub struct FrameTime {
    seconds: f32,
    /// Whether the next fixed step is the first since then.
    first: bool,
}

/// Counts a frame.
pub fn count_frame(mut frame: ResMut<FrameTime>, time: Res<Time<Virtual>>) {
    frame.seconds += time.delta_secs();
    frame.first = true;
}

/// Notes where walls are before the first fixed step of a frame: so far they came in a frame.
pub fn note_places(
    frame: Res<FrameTime>,
    mut walls: Query<(Entity, &mut WallState)>,
    transforms: TransformHelper,
) {
    if !frame.first {
        return;
    }
    for (entity, mut state) in &mut walls {
        let place = transforms.compute_global_transform(entity).map(|t| t.to_isometry());
        state.way.framed = place.ok().filter(|place| is_finite(*place));
    }
}

type WallComponents<'a> = (
    (Entity, &'a Transform, Has<Marble>),
    Ref<'a, Wall>,
    (Option<&'a SurfaceMaterial>, Option<&'a CollisionLayers>),
    &'a mut WallState,
);
type WallItem<'a> = (
    (Entity, &'a Transform, bool),
    Ref<'a, Wall>,
    (Option<&'a SurfaceMaterial>, Option<&'a CollisionLayers>),
    Mut<'a, WallState>,
);

/// Who was put elsewhere, and who carries whom.
type Jumps<'w, 's> = (Query<'w, 's, Entity, With<Teleport>>, Query<'w, 's, &'static ChildOf>);

/// Puts new walls in and moves those that moved.
pub fn walls(
    mut world: ResMut<TawWorld>,
    mut walls: Query<WallComponents>,
    transforms: TransformHelper,
    (jumps, parents): Jumps,
    (time, mut frame): (Res<Time>, ResMut<FrameTime>),
    entities: &Entities,
    (mut refusals, mut removed): (Refusals, MessageWriter<RowRemoved>),
) {
    if world.just_restored {
        snapshot::name_walls(&mut world, walls.iter_mut().map(|it| (it.0.0, it.3)));
    }
    // Somebody else changed walls, or the world is another one.
    let all = world.just_restored || world.walls.version() != world.walls_gathered;
    let dt = time.delta_secs();
    let clock = Clock { dt, frame: if frame.first { frame.seconds } else { dt } };
    (frame.seconds, frame.first) = (0.0, false);
    let mut rows = 0;
    for item in &mut walls {
        let entity = item.0.0;
        let jumps = !jumps.is_empty()
            && (jumps.contains(entity)
                || parents.iter_ancestors(entity).any(|it| jumps.contains(it)));
        let place = transforms.compute_global_transform(entity).ok();
        let mut gathering = Gathering { world: &mut world, refusals: &mut refusals, all, jumps };
        rows += usize::from(gathering.take_over(item, place, clock));
    }
    if rows != world.walls.len() {
        snapshot::take_out_walls(
            &mut world,
            |wall| walls.get(wall).ok()?.3.id,
            entities,
            &mut removed,
        );
    }
    world.walls_gathered = world.walls.version();
}

/// Takes the marks off again.
pub fn land(jumps: Query<Entity, With<Teleport>>, mut commands: Commands) {
    for entity in &jumps {
        commands.entity(entity).try_remove::<Teleport>();
    }
}

/// How long a step is, and how long the frame was, in seconds.
#[derive(Clone, Copy)]
struct Clock {
    dt: f32,
    frame: f32,
}

/// One wall on its way into the world.
struct Gathering<'a, 'w> {
    world: &'a mut TawWorld,
    refusals: &'a mut Refusals<'w>,
    /// Whether the world may not be what gather left.
    all: bool,
    jumps: bool,
}

impl Gathering<'_, '_> {
    /// Takes over one wall. Gives whether it has a row.
    fn take_over(
        &mut self,
        ((entity, own, is_marble), wall, (material, layers), mut state): WallItem,
        place: Option<GlobalTransform>,
        clock: Clock,
    ) -> bool {
        let state = &mut *state;
        if let Some(id) = state.id
            && self.world.walls.row(id).is_err()
        {
            *state = state.without_row();
        }
        if is_marble {
            self.refusals.check(Some(entity), Err(Refusal::MarbleAndWall));
            if let Some(id) = state.id {
                let _ = self.world.walls.remove(id); // it is there: its row was found
                self.world.wall_entities.remove(&id);
            }
            *state = WallState::default();
            return false;
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
        self.put(entity, state, now, clock);
        self.make_of(entity, state, material);
        self.put_into_layers(entity, state, layers.copied().unwrap_or_default());
        state.id.is_some()
    }

    /// Leaves a wall where it is, at rest. Gives whether it has a row.
    fn stop(&mut self, state: &mut WallState) -> bool {
        state.way = Way::default();
        if let Some(id) = state.id {
            let _ = self.world.walls.set_motion(id, None);
        }
        state.id.is_some()
    }

    /// Puts a wall where it is now, and says how it came there.
    fn put(&mut self, entity: Entity, state: &mut WallState, now: Isometry3d, clock: Clock) {
        let Some(LocalShape { shape, reach }) = &state.shape else { return };
        let translation = Vec3::from(now.translation);
        let speed = state.way.go_on(now, clock.dt, clock.frame, *reach, self.jumps);
        if let Some(id) = state.id {
            let motion = speed.map(|speed| WallMotion {
                velocity: to_vector(speed.velocity),
                angular_velocity: to_vector(speed.angular_velocity),
                pivot: to_point(translation),
            });
            self.refusals.check(Some(entity), self.world.walls.set_motion(id, motion));
        }
        let seen = (bits(translation), rotation_bits(now.rotation));
        if state.posed == Some(seen) && !self.all {
            return;
        }
        state.posed = Some(seen);
        let rotation = to_rotation(now.rotation);
        let shape = shape.transformed(Pose { rotation, translation: to_vector(translation) });
        let put = shape.and_then(|shape| match state.id {
            Some(id) => self.world.walls.set(id, shape),
            None => self.world.walls.insert(shape).map(|id| {
                self.world.wall_entities.insert(id, entity);
                state.id = Some(id);
            }),
        });
        self.refusals.check(Some(entity), put);
    }

    /// Gives a wall its layers.
    fn put_into_layers(&mut self, entity: Entity, state: &mut WallState, layers: CollisionLayers) {
        if let Some(id) = state.id
            && (state.layers != layers || self.all)
        {
            state.layers = layers;
            self.refusals.check(Some(entity), self.world.walls.set_layers(id, layers.into()));
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

/// Whether all numbers of a `Transform` are finite.
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
    let bad = fields.into_iter().find(|(_, value)| !value.is_finite());
    bad.map_or(Ok(()), |(field, value)| Err(taw::Error::NotFinite { field, value: value.into() }))
}

/// Whether a shape that was built for one scale does for another.
fn same_scale(built: Vec3, now: Vec3) -> bool {
    bits(built) == bits(now) || (now - built).abs().cmple(built.abs() * SAME_SCALE).all()
}

fn is_finite(place: Isometry3d) -> bool {
    place.translation.is_finite() && place.rotation.is_finite()
}
