//! One-way walls: marbles pass through them in one direction, and lie on them against it.
//!
//! Before each substep it is decided which marbles a wall holds; the others pass through it as through
//! [one that they name](super::Marbles::set_ignored), until the next substep.

use cgmath::{EuclideanSpace, InnerSpace, Zero};

use super::marbles::Marbles;
use super::method::method_of;
use super::walls::{WallId, Walls};
use super::{MarbleId, WallShape, World};
use crate::Error;
use crate::contact::ClosestPoints;
use crate::error::finite_vector;
use crate::frame::Pose;
use crate::math::{Point3, Scalar, Vec3, normalize_and_length};
use crate::shape::{BoundedShape, Capsule, Sphere};

/// Cosine of the angle between the direction and the normal of a contact from which on a wall does not
/// hold a marble: 87°. The sides of a box that is turned by rounding are none of its top.
const SIDE: f64 = 0.05;

/// Depth over the radius up to which a marble lies on a wall on which it has not been seen before:
/// responses with springs let it sink in by a tenth.
const LIES: f64 = 0.5;

/// Decision of a one-way wall about a marble before the last substep.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct OneWayState {
    pub wall: WallId,
    pub marble: MarbleId,
    /// False for one that passes.
    pub held: bool,
}

/// Place of a marble before a wall.
#[derive(Clone, Copy, Debug)]
struct Placement<S> {
    /// Distance of the surfaces in metres; negative if they overlap.
    gap: S,
    /// Normal of the wall there.
    normal: Vec3<S>,
}

impl<S: Scalar> Walls<S> {
    /// Lets marbles pass through a wall in a direction of any length but zero, or with `None` in none.
    /// They collide with what of its surface faces along the direction, and come from there: one that
    /// comes from behind or from the side, or is in the wall, is not touched until it is wholly out.
    ///
    /// Decided before each substep (of [`SoftStep`](crate::response::Response::SoftStep), each step),
    /// which looks at all marbles for each such wall. Balls of the [swarm](World::swarm) and queries
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
        let mut now = Vec::with_capacity(before.len());
        for row in 0..self.walls.len() {
            let (Some(direction), Some(wall)) = (self.walls.one_way.get(row), self.walls.id(row))
            else {
                continue;
            };
            let pose = self.walls.swept_motion_of_row(row).map(|motion| motion.pose_before(time));
            for place in 0..self.marbles.len() {
                let Some(marble) = self.marbles.id(place) else { continue };
                let known = before.binary_search_by_key(&(wall, marble), |it| (it.wall, it.marble));
                let held = known.ok().map(|i| before[i].held);
                let shape = &self.walls.shapes()[row];
                let placement = Placement::of(&self.marbles, place, (shape, pose));
                let held = placement.is_held(held, direction, self.marbles.radius()[place]);
                now.push(OneWayState { wall, marble, held });
            }
        }
        now.sort_unstable_by_key(|it| (it.wall, it.marble));
        self.memory.one_way = now;
    }
}

impl<S: Scalar> Placement<S> {
    /// Where a marble is before a wall, which is this pose away from where its shape is.
    fn of(
        marbles: &Marbles<S>,
        row: usize,
        (wall, pose): (&WallShape<S>, Option<Pose<S>>),
    ) -> Self {
        let Sphere { center, radius } = marbles.sphere(row);
        let half = marbles.axis(row) * marbles.half_length(row);
        let [center, half] = match pose {
            None => [center.to_vec(), half],
            Some(pose) => {
                [pose.inverse_transform_point(center).to_vec(), pose.inverse_transform_vector(half)]
            }
        };
        let around = |center| {
            let nearest = wall.project_point(Point3::from_vec(center));
            Self { gap: nearest.distance - radius, normal: nearest.normal }
        };
        if half.is_zero() {
            return around(center);
        }
        // A capsule is nearest with an end, or with what is between them.
        let ends = [center - half, center + half];
        let [a, b] = ends.map(Point3::from_vec);
        let [first, second] = ends.map(around);
        let touches = touches_of(wall, &Capsule { a, b, radius });
        touches.into_iter().chain([second]).fold(first, |a, b| if b.gap < a.gap { b } else { a })
    }

    /// Returns true if a wall that lets marbles pass along a direction holds a marble of this radius,
    /// of which it was decided so before.
    fn is_held(self, before: Option<bool>, direction: Vec3<S>, radius: S) -> bool {
        let Self { gap, normal } = self;
        let deepest = match before {
            Some(true) => S::neg_infinity(),
            Some(false) => S::zero(),
            None => radius * S::from_f64(-LIES),
        };
        normal.dot(direction) > S::from_f64(SIDE) && gap >= deepest
    }
}

/// Where a capsule touches the parts of a wall other than a half-space.
fn touches_of<S: Scalar>(wall: &WallShape<S>, capsule: &Capsule<S>) -> Vec<Placement<S>> {
    let (reached, mut touches) = (capsule.bounding_box(), Vec::new());
    wall.for_each_box(|part, bounds| {
        if bounds.overlaps(&reached) {
            wall.for_each_in_box(part, &reached, |part| {
                let closest = wall.closest_points(part, capsule);
                let place =
                    |it: ClosestPoints<S>| Placement { gap: it.distance, normal: it.normal };
                touches.extend(closest.map(place));
            });
        }
    });
    touches
}
