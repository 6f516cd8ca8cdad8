//! Drawing of walls that move: where the marbles that are drawn meet them.
//!
//! A wall's `Transform` is what the game wrote last. The physics has it there up to a frame and a step
//! later, and marbles are drawn between the last two steps: so are walls, by their `GlobalTransform`, and so
//! is all that moves with them.

use bevy::ecs::entity::{EntityHashMap, EntityHashSet};
use bevy::ecs::system::SystemParam;
use bevy::math::{Affine3A, Isometry3d};
use bevy::prelude::*;
use bevy_transform_interpolation::prelude::NoTransformEasing;

use crate::body::Body;
use crate::components::{Marble, WallState};
use crate::gather_walls::FrameTime;

/// Memory of what is drawn.
#[derive(Default)]
pub(crate) struct Drawing {
    known: EntityHashMap<Known>,
    /// Walls that move, or are drawn elsewhere than their `Transform`s are.
    walls: EntityHashSet,
    /// Entities that are drawn elsewhere with them.
    carriers: Vec<Entity>,
}

/// Transform of a wall or of what carries it.
struct Known {
    transform: Transform,
    /// When it last changed, in seconds, and whether that was while time stood still.
    changed_at: f64,
    changed_in_pause: bool,
}

/// Entities in their hierarchy.
#[derive(SystemParam)]
pub(crate) struct Hierarchy<'w, 's> {
    places: TransformHelper<'w, 's>,
    transforms: Query<'w, 's, &'static Transform>,
    parents: Query<'w, 's, &'static ChildOf>,
    children: Query<'w, 's, &'static Children>,
    placed: Query<'w, 's, (), Or<(With<Marble>, With<Body>)>>,
}

type MovedWall = (With<WallState>, Changed<GlobalTransform>);

/// Draws walls that move between the last two steps.
pub(crate) fn draw(
    mut drawing: Local<Drawing>,
    mut globals: ParamSet<(Query<Entity, MovedWall>, Query<&'static mut GlobalTransform>)>,
    walls: Query<&WallState, Without<NoTransformEasing>>,
    hierarchy: Hierarchy,
    (time, fixed, frame): (Res<Time<Virtual>>, Res<Time<Fixed>>, Res<FrameTime>),
    mut removed: RemovedComponents<WallState>,
) {
    let drawing = &mut *drawing;
    if removed.read().count() > 0 {
        drawing.known.retain(|entity, _| hierarchy.transforms.contains(*entity));
    }
    let mut candidates = std::mem::take(&mut drawing.walls);
    candidates.extend(&globals.p0());
    // The game may keep the physics from running.
    let is_running = frame.gathered_at == fixed.elapsed();
    let mut moves = Vec::new();
    for wall in candidates {
        let Ok(state) = walls.get(wall) else { continue };
        let carrier = drawing.carrier(wall, &hierarchy, (&time, &fixed));
        let place = hierarchy.places.compute_global_transform(wall);
        let (Some(carrier), Ok(place), Some([from, to])) = (carrier, place, state.poses) else {
            continue;
        };
        let now = place.to_isometry();
        let drawn = between(from, to, fixed.overstep_fraction());
        if from != to || drawn != now {
            drawing.walls.insert(wall);
        }
        if is_running && drawn != now && place.affine().is_finite() {
            moves.push((carrier, Affine3A::from(drawn * now.inverse())));
        }
    }
    // Who is carried by another one comes after it.
    moves.sort_by_key(|((depth, entity), _)| (*depth, *entity));
    moves.dedup_by_key(|(carrier, _)| *carrier);
    let mut globals = globals.p1();
    for carrier in std::mem::take(&mut drawing.carriers) {
        hierarchy.place(carrier, Affine3A::IDENTITY, &mut globals);
    }
    for ((_, carrier), by) in moves {
        hierarchy.place(carrier, by, &mut globals);
        drawing.carriers.push(carrier);
    }
}

fn between(from: Isometry3d, to: Isometry3d, part: f32) -> Isometry3d {
    if from == to {
        return to;
    }
    let translation = from.translation.lerp(to.translation, part);
    Isometry3d { translation, rotation: from.rotation.slerp(to.rotation, part) }
}

impl Drawing {
    /// Entity by which a wall moves, and its depth in the hierarchy: the nearest one that changes, or the
    /// wall itself. None if the wall is drawn where its `Transform` is: one on a marble or body, and one that is
    /// moved while time stands still.
    fn carrier(
        &mut self,
        wall: Entity,
        hierarchy: &Hierarchy,
        (time, fixed): (&Time<Virtual>, &Time<Fixed>),
    ) -> Option<(usize, Entity)> {
        let (now, paused) = (time.elapsed_secs_f64(), time.delta().is_zero());
        let recent = now - 2.0 * (time.delta() + fixed.timestep()).as_secs_f64();
        let (mut carrier, mut is_held, mut length) = (None, false, 0);
        for entity in std::iter::once(wall).chain(hierarchy.parents.iter_ancestors(wall)) {
            if hierarchy.placed.contains(entity) {
                return None;
            }
            let transform = *hierarchy.transforms.get(entity).ok()?;
            let (changed_at, changed_in_pause) = (f64::NEG_INFINITY, false);
            let first = Known { transform, changed_at, changed_in_pause };
            let known = self.known.entry(entity).or_insert(first);
            known.changed_in_pause &= paused;
            if known.transform != transform {
                *known = Known { transform, changed_at: now, changed_in_pause: paused };
            }
            is_held |= known.changed_in_pause;
            if carrier.is_none() && known.changed_at >= recent {
                carrier = Some((length, entity));
            }
            length += 1;
        }
        let (height, entity) = carrier.unwrap_or((0, wall));
        (!is_held).then_some((length - height, entity))
    }
}

impl Hierarchy<'_, '_> {
    /// Draws an entity, and what it carries except marbles and bodies, by a displacement beside where it is.
    fn place(&self, entity: Entity, by: Affine3A, globals: &mut Query<&mut GlobalTransform>) {
        let Ok(place) = self.places.compute_global_transform(entity) else { return };
        let mut open = vec![(entity, GlobalTransform::from(by * place.affine()))];
        while let Some((entity, place)) = open.pop() {
            if let Ok(mut global) = globals.get_mut(entity) {
                global.set_if_neq(place);
            }
            let children = self.children.get(entity).into_iter().flatten();
            let children = children.filter(|child| !self.placed.contains(**child));
            open.extend(
                children
                    .filter_map(|child| Some((*child, place * *self.transforms.get(*child).ok()?))),
            );
        }
    }
}
