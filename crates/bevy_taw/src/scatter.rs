//! From the world back to components, where something moved.

use bevy::prelude::*;

use crate::components::{Marble, MarbleState, Spin, Velocity, bits, rotation_bits};
use crate::convert::{from_point, from_rotation, from_vector};
use crate::resources::TawWorld;

type Moved<'a> =
    (&'a mut Transform, Option<&'a mut Velocity>, Option<&'a mut Spin>, &'a mut MarbleState);

/// Writes `Transform`, `Velocity` and `Spin` of the marbles that moved, and of those
/// whose own values were refused.
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
    transforms.p0().par_iter_mut().for_each(|moved| write(&world, moved, None));
    // A child's Transform is relative to its parents, which have all moved by now.
    let helper = transforms.p1();
    parents.clear();
    parents.extend(children.iter().filter_map(|(entity, child_of)| {
        Some((entity, helper.compute_global_transform(child_of.parent()).ok()?))
    }));
    let mut marbles = transforms.p2();
    for (entity, parent) in &parents {
        if let Ok(moved) = marbles.get_mut(*entity) {
            write(&world, moved, Some(parent));
        }
    }
}

type MovedItem<'a> =
    (Mut<'a, Transform>, Option<Mut<'a, Velocity>>, Option<Mut<'a, Spin>>, Mut<'a, MarbleState>);

fn write(world: &TawWorld, moved: MovedItem, parent: Option<&GlobalTransform>) {
    let (mut transform, velocity, spin, mut state) = moved;
    let marbles = &world.marbles;
    let Some(row) = state.id.and_then(|id| marbles.row(id).ok()) else {
        return;
    };
    let position = from_point(marbles.position()[row]);
    let position =
        parent.map_or(position, |parent| parent.affine().inverse().transform_point3(position));
    if bits(position) != bits(transform.translation) {
        transform.translation = position;
        state.seen.translation = bits(position);
    }
    if let Some(rotation) = marbles.rotation().get(row) {
        let rotation = from_rotation(*rotation);
        let rotation = parent.map_or(rotation, |parent| parent.rotation().inverse() * rotation);
        if rotation_bits(rotation) != rotation_bits(transform.rotation) {
            transform.rotation = rotation;
            state.seen.rotation = rotation_bits(rotation);
        }
    }
    if let Some(mut component) = velocity {
        let velocity = from_vector(marbles.velocity()[row]);
        if bits(velocity) != bits(**component) {
            **component = velocity;
            state.seen.velocity = Some(bits(velocity));
        }
    }
    if let (Some(mut component), Some(spin)) = (spin, marbles.spin().get(row)) {
        let spin = from_vector(*spin);
        if bits(spin) != bits(**component) {
            **component = spin;
            state.seen.spin = Some(bits(spin));
        }
    }
}
