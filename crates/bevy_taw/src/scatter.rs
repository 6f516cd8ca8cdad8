//! From the world back to components, where something moved.

use bevy::prelude::*;

use crate::components::{Marble, MarbleState, Velocity, bits};
use crate::convert::{from_point, from_vector};
use crate::resources::TawWorld;

type Moved<'a> = (&'a mut Transform, Option<&'a mut Velocity>, &'a mut MarbleState);

/// Writes `Transform` and `Velocity` of the marbles that moved, and of those whose
/// own values were refused.
pub fn marbles(
    world: Res<TawWorld>,
    mut transforms: ParamSet<(
        Query<Moved, (With<Marble>, Without<ChildOf>)>,
        TransformHelper,
        Query<Moved, With<Marble>>,
    )>,
    children: Query<(Entity, &ChildOf), With<Marble>>,
    mut parents: Local<Vec<(Entity, GlobalTransform)>>,
) {
    for moved in &mut transforms.p0() {
        write(&world, moved, |position| position);
    }
    // A child's Transform is relative to its parents, which have all moved by now.
    let helper = transforms.p1();
    parents.clear();
    parents.extend(children.iter().filter_map(|(entity, child_of)| {
        Some((entity, helper.compute_global_transform(child_of.parent()).ok()?))
    }));
    let mut marbles = transforms.p2();
    for (entity, parent) in &parents {
        if let Ok(moved) = marbles.get_mut(*entity) {
            let to_local = parent.affine().inverse();
            write(&world, moved, |position| to_local.transform_point3(position));
        }
    }
}

fn write(
    world: &TawWorld,
    (mut transform, velocity, mut state): (Mut<Transform>, Option<Mut<Velocity>>, Mut<MarbleState>),
    to_local: impl Fn(Vec3) -> Vec3,
) {
    let Some(row) = state.id.and_then(|id| world.marbles.row(id).ok()) else {
        return;
    };
    let translation = to_local(from_point(world.marbles.position()[row]));
    if bits(translation) != bits(transform.translation) {
        transform.translation = translation;
        state.seen.translation = bits(translation);
    }
    if let Some(mut component) = velocity {
        let velocity = from_vector(world.marbles.velocity()[row]);
        if bits(velocity) != bits(**component) {
            **component = velocity;
            state.seen.velocity = Some(bits(velocity));
        }
    }
}
