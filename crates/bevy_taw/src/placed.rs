//! Places of marbles and bodies, for what draws them and what puts them elsewhere.

use bevy::ecs::component::Mutable;
use bevy::ecs::system::SystemParam;
use bevy::prelude::*;
use taw::frame::Pose;

use crate::body::BodyState;
use crate::components::MarbleState;
use crate::convert::{from_point, from_rotation, to_point, to_rotation, to_vector};
use crate::resources::TawWorld;

/// State of an entity that the physics places: a marble or a body.
pub(crate) trait Placed: Component<Mutability = Mutable> {
    /// Bits of translation and rotation as they were last left.
    fn seen(&self) -> ([u32; 3], [u32; 4]);
    fn see_translation(&mut self, bits: [u32; 3]);
    fn see_rotation(&mut self, bits: [u32; 4]);
    /// Simulated position, and rotation if the model knows one.
    fn place(&self, world: &TawWorld) -> Option<(Vec3, Option<Quat>)>;
    /// Radius in metres within which a change of place is a nudge.
    fn radius(&self, world: &TawWorld) -> f32;
    /// Puts it elsewhere. Returns false if that cannot be right.
    fn set_position(&self, world: &mut TawWorld, position: Vec3) -> bool;
    /// Turns it. Returns false if that cannot be right.
    fn set_rotation(&self, world: &mut TawWorld, rotation: Quat) -> bool;
}

/// Marbles and bodies that are children.
#[derive(SystemParam)]
pub(crate) struct PlacedChildren<'w, 's> {
    children: Query<'w, 's, (Entity, &'static ChildOf), Or<(With<MarbleState>, With<BodyState>)>>,
    parents: Query<'w, 's, &'static ChildOf>,
}

impl PlacedChildren<'_, '_> {
    /// Each with its parent, after all that carry it: only then is it known where its parent is.
    pub fn in_order(&self) -> Vec<(Entity, Entity)> {
        let mut children: Vec<_> =
            self.children.iter().map(|(child, of)| (child, of.parent())).collect();
        children.sort_by_cached_key(|(child, _)| self.parents.iter_ancestors(*child).count());
        children
    }
}

impl Placed for MarbleState {
    fn seen(&self) -> ([u32; 3], [u32; 4]) {
        (self.seen.translation, self.seen.rotation)
    }

    fn see_translation(&mut self, bits: [u32; 3]) {
        self.seen.translation = bits;
    }

    fn see_rotation(&mut self, bits: [u32; 4]) {
        self.seen.rotation = bits;
    }

    fn place(&self, world: &TawWorld) -> Option<(Vec3, Option<Quat>)> {
        let row = world.marbles.row(self.id?).ok()?;
        let rotation = world.marbles.rotation().get(row).copied().map(from_rotation);
        Some((from_point(world.marbles.position()[row]), rotation))
    }

    fn radius(&self, world: &TawWorld) -> f32 {
        let row = self.id.and_then(|id| world.marbles.row(id).ok());
        row.map_or(0.0, |row| world.marbles.radius()[row])
    }

    fn set_position(&self, world: &mut TawWorld, position: Vec3) -> bool {
        self.id.is_some_and(|id| world.marbles.set_position(id, to_point(position)).is_ok())
    }

    fn set_rotation(&self, world: &mut TawWorld, rotation: Quat) -> bool {
        self.id.is_some_and(|id| world.marbles.set_rotation(id, to_rotation(rotation)).is_ok())
    }
}

impl Placed for BodyState {
    fn seen(&self) -> ([u32; 3], [u32; 4]) {
        self.seen.place
    }

    fn see_translation(&mut self, bits: [u32; 3]) {
        self.seen.place.0 = bits;
    }

    fn see_rotation(&mut self, bits: [u32; 4]) {
        self.seen.place.1 = bits;
    }

    fn place(&self, world: &TawWorld) -> Option<(Vec3, Option<Quat>)> {
        let motion = world.bodies.motion(self.id?).ok()?;
        Some((from_point(motion.position), Some(from_rotation(motion.rotation))))
    }

    fn radius(&self, world: &TawWorld) -> f32 {
        self.id.and_then(|id| world.bodies.reach(id).ok()).unwrap_or(0.0)
    }

    fn set_position(&self, world: &mut TawWorld, position: Vec3) -> bool {
        let pose = self.id.and_then(|id| world.bodies.pose(id).ok());
        let pose = pose.map(|pose| Pose { translation: to_vector(position), ..pose });
        self.set_pose(world, pose)
    }

    fn set_rotation(&self, world: &mut TawWorld, rotation: Quat) -> bool {
        let pose = self.id.and_then(|id| world.bodies.pose(id).ok());
        let pose = pose.map(|pose| Pose { rotation: to_rotation(rotation), ..pose });
        self.set_pose(world, pose)
    }
}

impl BodyState {
    fn set_pose(&self, world: &mut TawWorld, pose: Option<Pose<f32>>) -> bool {
        let set = self.id.zip(pose).map(|(id, pose)| world.bodies.set_pose(id, pose));
        set.is_some_and(|set| set.is_ok())
    }
}
