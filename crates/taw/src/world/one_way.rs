//! One-way walls: marbles pass through them in one direction, and lie on them against it.
//!
//! Before each substep it is decided which marbles a wall holds; the others pass through it as through
//! [one that they name](super::Marbles::set_ignored), until the next substep.

use cgmath::InnerSpace;

use super::marbles::Marbles;
use super::method::method_of;
use super::walls::{WallId, Walls};
use super::{ColliderId, MarbleId, WallShape, World};
use crate::Error;
use crate::broad::CollisionLayers;
use crate::contact::ClosestPoints;
use crate::error::finite_vector;
use crate::frame::Pose;
use crate::math::{Scalar, Vec3, length, normalize_and_length};
use crate::shape::{Aabb3, BoundedShape, Capsule, Sphere};

/// Least cosine of the angle between the direction and a normal that faces along it: 87°. The sides
/// of a box that is turned by rounding are none of its top.
const MIN_FACING_COSINE: f64 = 0.05;

/// Largest penetration over the radius of a marble that lies on a wall on which it has not been seen
/// before, and separation up to which a held one still lies on a part of it. Springs let it sink in by
/// a tenth; one with its center inside does not lie.
const LIES: f64 = 0.5;

/// Decision of a one-way wall about a marble before the last substep.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct OneWayState {
    pub wall: WallId,
    pub marble: MarbleId,
    /// False for one that passes.
    pub held: bool,
}

/// Placement of a marble relative to a wall.
#[derive(Clone, Copy, Debug)]
struct Placement<S> {
    /// Separation of the surfaces, in metres; negative if they overlap.
    separation: S,
    /// Normal of the wall there.
    normal: Vec3<S>,
}

impl<S: Scalar> Walls<S> {
    /// Lets marbles pass through a wall in a direction of any length but zero, or with `None` in none.
    ///
    /// The wall holds a marble whose nearest point of it faces along the direction, and then collides
    /// with it everywhere; it goes on holding it as long as any part that faces so is beneath it. A
    /// marble that comes from behind or from the side, or was in the wall when it came near, is not
    /// touched until it is wholly out. A closed mesh is hollow: a marble that fits in is held by its
    /// bottom. Platforms are boxes, half-spaces, compounds or open sheets.
    ///
    /// Decided before each substep (of [`SoftStep`](crate::response::Response::SoftStep), each step)
    /// for all marbles that may reach the wall in it. Balls of the [swarm](World::swarm) and queries
    /// meet it from all sides.
    ///
    /// # Errors
    /// [`Error::NoSuchWall`], [`Error::NotFinite`], [`Error::NotUnit`] if the direction is zero.
    pub fn set_one_way(&mut self, id: WallId, direction: Option<Vec3<S>>) -> Result<(), Error> {
        let row = self.row(id)?;
        let direction = direction.map(unit_direction).transpose()?;
        if self.one_way.get(row) != direction {
            self.mark_changed(row);
        }
        self.one_way.set(row, direction, self.len());
        Ok(())
    }

    /// Unit vector along which marbles pass through a wall, if they do.
    ///
    /// # Errors
    /// [`Error::NoSuchWall`].
    pub fn one_way(&self, id: WallId) -> Result<Option<Vec3<S>>, Error> {
        self.row(id).map(|row| self.one_way.get(row))
    }
}

/// Validates a direction, and normalizes it.
fn unit_direction<S: Scalar>(direction: Vec3<S>) -> Result<Vec3<S>, Error> {
    finite_vector(["direction.x", "direction.y", "direction.z"], direction)?;
    let unit = normalize_and_length(direction).map(|(unit, _)| unit);
    unit.ok_or(Error::NotUnit { field: "direction", value: 0.0 })
}

impl<S: Scalar> World<S> {
    /// Returns true if a one-way wall let a marble pass in the last substep.
    pub(super) fn lets_pass(&self, wall: WallId, marble: MarbleId) -> bool {
        let decided = &self.memory.one_way;
        let found = decided.binary_search_by_key(&(wall, marble), |it| (it.wall, it.marble));
        found.is_ok_and(|i| !decided[i].held)
    }

    /// Decides which marbles one-way walls hold in a substep of `dt` seconds.
    pub(super) fn decide_one_way(&mut self, dt: S) {
        if self.walls.one_way.is_empty() && self.memory.one_way.is_empty() {
            return;
        }
        let before = std::mem::take(&mut self.memory.one_way);
        self.marbles.ignored_rows.found_at = None;
        // Walls that move are where they will be at the end of the substep, or of the step.
        let interpolates = method_of::<S>(self.settings.model.response).interpolates_walls();
        let time = if interpolates { dt } else { dt + self.scratch.rest_of_step };
        let fall = length(self.settings.gravity) * dt;
        let mut now = Vec::with_capacity(before.len());
        for row in 0..self.walls.len() {
            let (Some(direction), Some(wall)) = (self.walls.one_way.get(row), self.walls.id(row))
            else {
                continue;
            };
            let pose = self.walls.swept_motion_of_row(row).map(|motion| motion.pose_before(time));
            let (shape, layers) = (&self.walls.shapes()[row], self.walls.layers_of_row(row as u32));
            let bounds = shape.bounding_box().filter(|_| pose.is_none());
            for row in 0..self.marbles.len() {
                let Some(marble) = self.marbles.id(row) else { continue };
                let known = before.binary_search_by_key(&(wall, marble), |it| (it.wall, it.marble));
                let before = known.ok().map(|i| before[i].held);
                let capsule = capsule_before(&self.marbles, row, pose);
                let is_near = bounds.is_none_or(|bounds| {
                    // Twice as far as it goes by its speed: others may kick it.
                    let speed = length(self.marbles.velocity()[row]) + fall;
                    let way = (speed * dt + capsule.radius) * S::from_f64(2.0);
                    bounds.overlaps(&grown(capsule.bounding_box(), way))
                });
                let held = match before {
                    // One that meets it again within it has to come out first.
                    _ if !self.marbles.may_meet(row, marble, wall, layers) => false,
                    _ if is_near => is_held(shape, &capsule, before, direction),
                    Some(held) => held,
                    None => continue,
                };
                now.push(OneWayState { wall, marble, held });
            }
        }
        now.sort_unstable_by_key(|it| (it.wall, it.marble));
        self.memory.one_way = now;
    }
}

impl<S: Scalar> Marbles<S> {
    /// Returns true if a marble does not name a wall of these layers to pass through, nor lacks a layer
    /// in common with it.
    fn may_meet(
        &self,
        row: usize,
        marble: MarbleId,
        wall: WallId,
        layers: CollisionLayers,
    ) -> bool {
        let names = || self.ignored(marble).is_ok_and(|all| all.contains(&ColliderId::Wall(wall)));
        layers.interacts_with(self.layers_of_row(row)) && !names()
    }
}

/// A marble relative to a wall that is this pose away from where its shape is.
fn capsule_before<S: Scalar>(
    marbles: &Marbles<S>,
    row: usize,
    pose: Option<Pose<S>>,
) -> Capsule<S> {
    let Sphere { center, radius } = marbles.sphere(row);
    let half = marbles.axis(row) * marbles.half_length(row);
    let (center, half) = match pose {
        None => (center, half),
        Some(pose) => (pose.inverse_transform_point(center), pose.inverse_transform_vector(half)),
    };
    Capsule { a: center - half, b: center + half, radius }
}

/// Returns true if a wall that lets marbles pass along a direction holds one, of which it was decided
/// so before.
fn is_held<S: Scalar>(
    wall: &WallShape<S>,
    capsule: &Capsule<S>,
    before: Option<bool>,
    direction: Vec3<S>,
) -> bool {
    let faces = |normal: Vec3<S>| normal.dot(direction) > S::from_f64(MIN_FACING_COSINE);
    let lies = capsule.radius * S::from_f64(LIES);
    let Placement { separation, normal } = Placement::nearest(wall, capsule);
    let deepest = match before {
        Some(true) => S::neg_infinity(),
        Some(false) => S::zero(),
        None => -lies,
    };
    let is_beneath = || {
        let contacts = contacts_of(wall, capsule, lies);
        contacts.into_iter().any(|contact| contact.separation <= lies && faces(contact.normal))
    };
    faces(normal) && separation >= deepest || before == Some(true) && is_beneath()
}

impl<S: Scalar> Placement<S> {
    /// Nearest point of a wall.
    fn nearest(wall: &WallShape<S>, capsule: &Capsule<S>) -> Self {
        let around = |center| {
            let nearest = wall.project_point(center);
            Self { separation: nearest.distance - capsule.radius, normal: nearest.normal }
        };
        let first = around(capsule.a);
        if capsule.a == capsule.b {
            return first;
        }
        // A capsule is nearest with an end, or with what is between them.
        let contacts = contacts_of(wall, capsule, S::zero());
        let nearer = |a: Self, b: Self| if b.separation < a.separation { b } else { a };
        contacts.into_iter().chain([around(capsule.b)]).fold(first, nearer)
    }
}

/// Contacts of a capsule with the parts of a wall other than a half-space, up to a separation in metres.
fn contacts_of<S: Scalar>(
    wall: &WallShape<S>,
    capsule: &Capsule<S>,
    separation: S,
) -> Vec<Placement<S>> {
    let (reached, mut contacts) = (grown(capsule.bounding_box(), separation), Vec::new());
    wall.for_each_box(|part, bounds| {
        if bounds.overlaps(&reached) {
            wall.for_each_in_box(part, &reached, |part| {
                let closest = wall.closest_points(part, capsule);
                contacts.extend(closest.map(|ClosestPoints { distance, normal, .. }| Placement {
                    separation: distance,
                    normal,
                }));
            });
        }
    });
    contacts
}

/// A box with a margin, in metres.
fn grown<S: Scalar>(bounds: Aabb3<S>, by: S) -> Aabb3<S> {
    let by = Vec3::new(by, by, by);
    Aabb3 { min: bounds.min - by, max: bounds.max + by }
}
