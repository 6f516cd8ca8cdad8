//! From the world back to components, where something moved.

use bevy::math::Affine3A;
use bevy::prelude::*;

use crate::body::{self, Body, MovedBody};
use crate::components::{
    AngularVelocity, Marble, MarbleState, Sleeping, Velocity, bits, rotation_bits,
};
use crate::convert::{from_point, from_rotation, from_vector};
use crate::gather::{ChangedMarbles, MANY};
use crate::placed::{Placed, PlacedChildren};
use crate::refusal::{Refusal, Refusals};
use crate::resources::TawWorld;

/// Frame that a marble's `Transform` is relative to.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Frame {
    /// From here to the world and back; none for the world itself, so that it costs no rounding.
    of_parent: Option<(Affine3A, Affine3A, Quat)>,
}

impl Frame {
    pub const WORLD: Self = Self { of_parent: None };

    /// Frame of an entity that is a parent, if it has a place and there is a way back.
    pub fn of(parent: Entity, places: &TransformHelper) -> Option<Self> {
        Self::new(&places.compute_global_transform(parent).ok()?)
    }

    /// That of a parent, if there is a way back: not from a scale of zero.
    pub fn new(parent: &GlobalTransform) -> Option<Self> {
        let (there, turned) = (parent.affine(), parent.rotation());
        let back = there.inverse();
        (there.is_finite() && back.is_finite() && turned.is_finite())
            .then_some(Self { of_parent: Some((there, back, turned)) })
    }

    pub fn local(&self, point: Vec3) -> Vec3 {
        self.of_parent.map_or(point, |(_, back, _)| back.transform_point3(point))
    }

    pub fn world(&self, point: Vec3) -> Vec3 {
        self.of_parent.map_or(point, |(there, ..)| there.transform_point3(point))
    }

    pub fn turned(&self, rotation: Quat) -> Quat {
        self.of_parent.map_or(rotation, |(.., turned)| turned.inverse() * rotation)
    }

    pub fn turned_in_world(&self, rotation: Quat) -> Quat {
        self.of_parent.map_or(rotation, |(.., turned)| turned * rotation)
    }
}

/// Writes a place in world space to a `Transform`, and notes it as seen. What is not finite in
/// its frame is not written.
pub(crate) fn put<T: Placed>(
    transform: &mut Mut<Transform>,
    state: &mut Mut<T>,
    frame: &Frame,
    position: Option<Vec3>,
    rotation: Option<Quat>,
) {
    if let Some(translation) = position.map(|position| frame.local(position))
        && translation.is_finite()
        && bits(translation) != bits(transform.translation)
    {
        transform.translation = translation;
        state.see_translation(bits(translation));
    }
    if let Some(rotation) = rotation.map(|rotation| frame.turned(rotation))
        && rotation.is_finite()
        && rotation_bits(rotation) != rotation_bits(transform.rotation)
    {
        transform.rotation = rotation;
        state.see_rotation(rotation_bits(rotation));
    }
}

type Moved<'a> = (
    &'a mut Transform,
    Option<&'a mut Velocity>,
    Option<&'a mut AngularVelocity>,
    &'a mut MarbleState,
);

/// Writes `Transform`, `Velocity` and `AngularVelocity` of the marbles that moved and are no children, and of those
/// whose own values were refused. What sleeps and was not written by others is as it was.
pub fn marbles(
    world: Res<TawWorld>,
    mut transforms: ParamSet<(
        Query<Moved, (With<Marble>, Without<ChildOf>, Without<Sleeping>)>,
        Query<Moved, (With<Marble>, Without<ChildOf>)>,
    )>,
    changed: Res<ChangedMarbles>,
) {
    let write_one = |moved: MovedItem| write(&world, moved, &Frame::WORLD);
    if transforms.p0().iter().len() < MANY {
        transforms.p0().iter_mut().for_each(write_one);
    } else {
        transforms.p0().par_iter_mut().for_each(write_one);
    }
    let mut marbles = transforms.p1();
    for entity in &changed.gathered {
        if let Ok(moved) = marbles.get_mut(*entity) {
            write(&world, moved, &Frame::WORLD);
        }
    }
}

/// Writes marbles and bodies that are children: their `Transform`s are relative to their parents, which have all moved
/// by then.
pub(crate) fn children(
    world: Res<TawWorld>,
    mut placed: ParamSet<(
        Query<Moved, With<Marble>>,
        Query<MovedBody, With<Body>>,
        TransformHelper,
    )>,
    children: PlacedChildren,
    mut refusals: Refusals,
    mut commands: Commands,
) {
    for (child, parent) in children.in_order() {
        let Ok(parent) = placed.p2().compute_global_transform(parent) else { continue };
        let Some(frame) = Frame::new(&parent) else {
            let [x, y, z] = parent.scale().to_array();
            refusals.check(Some(child), Err(Refusal::NoFrame(x, y, z)));
            continue;
        };
        if let Ok(marble) = placed.p0().get_mut(child) {
            write(&world, marble, &frame);
        }
        if let Ok(body) = placed.p1().get_mut(child) {
            body::write(&world, body, &frame, &mut commands);
        }
    }
}

type MovedItem<'a> = (
    Mut<'a, Transform>,
    Option<Mut<'a, Velocity>>,
    Option<Mut<'a, AngularVelocity>>,
    Mut<'a, MarbleState>,
);

fn write(world: &TawWorld, moved: MovedItem, frame: &Frame) {
    let (mut transform, velocity, spin, mut state) = moved;
    let marbles = &world.marbles;
    let Some(row) = state.id.and_then(|id| marbles.row(id).ok()) else {
        return;
    };
    let position = from_point(marbles.position()[row]);
    let rotation = marbles.rotation().get(row).copied().map(from_rotation);
    put(&mut transform, &mut state, frame, Some(position), rotation);
    if let Some(mut component) = velocity {
        let velocity = from_vector(marbles.velocity()[row]);
        if bits(velocity) != bits(**component) {
            **component = velocity;
            state.seen.velocity = Some(bits(velocity));
        }
    }
    if let (Some(mut component), Some(spin)) = (spin, marbles.angular_velocity().get(row)) {
        let spin = from_vector(*spin);
        if bits(spin) != bits(**component) {
            **component = spin;
            state.seen.angular_velocity = Some(bits(spin));
        }
    }
}
