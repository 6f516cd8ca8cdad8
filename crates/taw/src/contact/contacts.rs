use std::cmp::Ordering;

use cgmath::Zero;

use super::{ContactMaterial, Material};
use crate::math::{Scalar, Vec3, is_finite, length};

/// Gap between two that touch, as a fraction of the shorter lever arm, at most.
const TOUCHING: f64 = 5e-6;

/// Gap up to which a touch goes on, as a fraction of the smaller radius. Impacts of what rests in a heap reach
/// less; a marble that leaves is beyond it within a step or two.
const PARTING: f64 = 0.02;

/// Tells if a touch of the last step goes on in this one (hysteresis): two that touched touch until the
/// gap between their surfaces is wider than a fiftieth of the smaller radius, and than the distance that
/// gravity closes in a substep, both in metres. What rests in a heap touches in one step and hovers in
/// the next, by less than that; a touch begins again only by
/// [`is_touching`](Contact::is_touching) after it has ended.
#[must_use]
pub fn touch_goes_on<S: Scalar>(separation: S, smaller_radius: S, fall: S) -> bool {
    separation <= fall.max(smaller_radius * S::from_f64(PARTING))
}

/// Contact point between two bodies, given by their indices in the world's columns. Indices are
/// stable within a step only.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact<S> {
    /// Index of the first body: a wall, or the marble with the lower index.
    pub a: u32,
    /// Index of the second body: always a marble.
    pub b: u32,
    /// Sub-shape of the wall: part of a compound or triangle of a surface. Zero for simple shapes,
    /// and between marbles.
    pub part: u32,
    /// Feature id: identifies the features that meet, stable as long as they do, since a capsule often
    /// touches with several points. That of `a` in the upper 16 bits, that of `b` in the lower ones: 0 for a
    /// ball and for a wall, 1 and 2 for the ends of a capsule, 3 for all points of its side, and 4 and 5 for the two points at
    /// which capsules lie side by side. Solvers find the impulses of the last substep by pair, `part` and
    /// `feature`.
    pub feature: u32,
    /// Contact anchor on the axis of each body, in metres from its center: zero except for
    /// capsules.
    pub along: [S; 2],
    /// Unit normal, from `a` to `b`.
    pub normal: Vec3<S>,
    /// Separation of the two surfaces along the normal, in metres; negative for a penetration.
    pub separation: S,
    /// Lever arm of each body: from its center to the contact point on its surface, in metres; zero
    /// for a wall.
    pub arms: [Vec3<S>; 2],
    /// Surface material, combined from those of both bodies whenever contacts are generated. `Impulse`
    /// and `Penalty` solve the contact by it, so that it may be edited before
    /// [`World::restitute`](crate::world::World::restitute), for one contact in one substep: a number
    /// out of its range counts as the nearest one in it, NaN as the lowest. A material that is set on a
    /// body after that counts from the next substep on.
    pub material: ContactMaterial<S>,
    /// Normal impulse accumulated in this substep, in N s. Zero until the contact is solved;
    /// listed by `Impulse` and `Penalty`, and by `SoftStep`, of the whole step, in a world that
    /// [records impulses](crate::world::World::set_records_impulses).
    pub normal_impulse: S,
    /// Friction impulse on `b` accumulated in this substep, in N s; that on `a` is its opposite.
    pub tangent_impulse: Vec3<S>,
}

impl<S: Scalar> Contact<S> {
    /// Contact of a wall and a marble without materials of their own, not placed yet.
    pub(crate) fn with_wall(wall: u32, part: u32, marble: u32) -> Self {
        let material = Material::default().on_wall(None);
        Self { part, material, ..Self::between_marbles(wall, marble) }
    }

    /// Contact of two marbles without materials of their own, not placed yet.
    pub(crate) fn between_marbles(a: u32, b: u32) -> Self {
        let (zero, none) = (S::zero(), Vec3::zero());
        Self {
            a,
            b,
            part: 0,
            feature: 0,
            along: [zero; 2],
            normal: none,
            separation: zero,
            arms: [none; 2],
            material: ContactMaterial::default(),
            normal_impulse: zero,
            tangent_impulse: none,
        }
    }

    /// Places the contact between two balls, or two points on the axes of capsules, these metres
    /// apart. `anchors` are these points relative to the centers. A wall has a radius of zero.
    pub(crate) fn placed(
        self,
        (normal, distance): (Vec3<S>, S),
        radii: [S; 2],
        anchors: [Vec3<S>; 2],
    ) -> Self {
        // In this order, so that the gap between a boulder and a pebble keeps its digits.
        let separation = distance - radii[0] - radii[1];
        let arms = [anchors[0] + normal * radii[0], anchors[1] - normal * radii[1]];
        Self { normal, separation, arms, ..self }
    }

    /// Stores the impulse of this substep, in N s; zero for one that overflows.
    pub(crate) fn set_impulse(&mut self, normal_impulse: S, tangent_impulse: Vec3<S>) {
        if normal_impulse.is_finite() && is_finite(tangent_impulse) {
            (self.normal_impulse, self.tangent_impulse) = (normal_impulse, tangent_impulse);
        }
    }

    /// Contact with the two bodies swapped.
    pub(crate) fn reversed(self) -> Self {
        let Self { a, b, along: [x, y], arms: [p, q], .. } = self;
        let (normal, tangent_impulse) = (-self.normal, -self.tangent_impulse);
        let feature = self.feature.rotate_left(16);
        Self { a: b, b: a, feature, along: [y, x], arms: [q, p], normal, tangent_impulse, ..self }
    }

    /// Penetration along the normal, in metres; zero for separated surfaces.
    #[must_use]
    pub fn penetration(&self) -> S {
        (-self.separation).max(S::zero())
    }

    /// True if the surfaces overlap, or are within 5e-6 of the shorter arm of each other: the gap
    /// that rounding may leave under a resting marble. False for a speculative contact.
    #[must_use]
    pub fn is_touching(&self) -> bool {
        if self.separation <= S::zero() {
            return true;
        }
        let arm = |arm: Vec3<S>| if arm.is_zero() { S::infinity() } else { length(arm) };
        let shorter = arm(self.arms[0]).min(arm(self.arms[1]));
        self.separation <= shorter * S::from_f64(TOUCHING)
    }

    /// Minimum translation vector (penetration vector): displacement of `b` that separates it from
    /// `a`, in metres. The lecture's view of a contact.
    #[must_use]
    pub fn mtv(&self) -> Vec3<S> {
        self.normal * self.penetration()
    }

    /// Impulse on `b` in this substep, in N s.
    #[must_use]
    pub fn impulse(&self) -> Vec3<S> {
        self.normal * self.normal_impulse + self.tangent_impulse
    }
}

/// Contact lists of a substep.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Contacts<S> {
    /// Wall–marble contacts.
    pub wm: Vec<Contact<S>>,
    /// Marble–marble contacts.
    pub mm: Vec<Contact<S>>,
}

impl<S: Scalar> Contacts<S> {
    /// Sorts both lists by separation, deepest penetration first. Ties are ordered by indices and NaN comes
    /// last, so the order does not depend on how the contacts were found.
    pub fn sort(&mut self) {
        self.wm.sort_unstable_by(deeper_first);
        self.mm.sort_unstable_by(deeper_first);
    }

    /// Empties both lists and keeps their memory.
    pub fn clear(&mut self) {
        self.wm.clear();
        self.mm.clear();
    }

    /// The number of contacts in both lists.
    #[must_use]
    pub fn len(&self) -> usize {
        self.wm.len() + self.mm.len()
    }

    /// Contact by its index in both lists, those with walls first.
    pub(crate) fn get_mut(&mut self, index: usize) -> Option<&mut Contact<S>> {
        let with_walls = self.wm.len();
        if index < with_walls {
            self.wm.get_mut(index)
        } else {
            self.mm.get_mut(index - with_walls)
        }
    }

    /// Returns true without any contact.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

fn deeper_first<S: Scalar>(x: &Contact<S>, y: &Contact<S>) -> Ordering {
    let ascending = |x: S, y: S| x.partial_cmp(&y).unwrap_or(Ordering::Equal);
    (x.separation.is_nan().cmp(&y.separation.is_nan()))
        .then_with(|| ascending(x.separation, y.separation))
        .then_with(|| (x.a, x.b, x.part).cmp(&(y.a, y.b, y.part)))
        .then_with(|| ascending(y.along[0], x.along[0]))
        .then_with(|| ascending(y.along[1], x.along[1]))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn contact(a: u32, b: u32, depth: f32) -> Contact<f32> {
        Contact { separation: -depth, ..Contact::between_marbles(a, b) }
    }

    #[test]
    fn sorting_puts_the_largest_first_and_survives_nan() {
        let sorted = [
            contact(7, 8, f32::INFINITY),
            contact(2, 3, 5.0),
            contact(0, 1, 2.0),
            contact(0, 2, 2.0),
            contact(8, 9, 2e-30),
            contact(5, 9, 1e-30),
            contact(5, 6, 0.0),
            contact(1, 2, -2.0),
            contact(0, 9, f32::NAN),
            contact(4, 9, f32::NAN),
        ];
        // Every rotation and its reverse, since a broken order shows in some only.
        for shift in 0..sorted.len() {
            let mut mm = sorted.to_vec();
            mm.rotate_left(shift);
            let wm = mm.iter().rev().copied().collect();
            let mut contacts = Contacts { wm, mm };
            contacts.sort();
            let rows = |list: &[Contact<f32>]| list.iter().map(|c| (c.a, c.b)).collect::<Vec<_>>();
            assert_eq!(rows(&contacts.mm), rows(&sorted), "rotated by {shift}");
            assert_eq!(rows(&contacts.wm), rows(&sorted), "reversed after {shift}");
        }
    }

    #[test]
    fn clearing_keeps_the_memory() {
        let mut contacts = Contacts { wm: vec![contact(0, 0, 1.0); 100], mm: vec![] };
        let capacity = contacts.wm.capacity();
        contacts.clear();
        assert!(contacts.is_empty());
        assert_eq!(contacts.wm.capacity(), capacity);
    }
}
