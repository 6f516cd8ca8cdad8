use std::cmp::Ordering;

use cgmath::InnerSpace;

use crate::math::{Scalar, Vec3, length};

/// A contact point between two bodies, given by their indices in the world's columns. Indices are
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
    /// Contact anchor on the axis of each body, in metres from its center: zero except for
    /// capsules.
    pub along: [S; 2],
    /// Minimum translation vector (penetration vector): displacement of `b` that separates it from
    /// `a`, in metres.
    pub mtv: Vec3<S>,
}

/// Contact lists of a substep.
#[derive(Clone, Debug, PartialEq)]
pub struct Contacts<S> {
    /// Wall–marble contacts.
    pub wm: Vec<Contact<S>>,
    /// Marble–marble contacts.
    pub mm: Vec<Contact<S>>,
}

impl<S> Default for Contacts<S> {
    fn default() -> Self {
        Self { wm: Vec::new(), mm: Vec::new() }
    }
}

impl<S: Scalar> Contacts<S> {
    /// Sorts both lists by penetration, deepest first. Ties are ordered by indices and NaN comes
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

    /// Returns true without any contact.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

fn deeper_first<S: Scalar>(x: &Contact<S>, y: &Contact<S>) -> Ordering {
    let (squared_x, squared_y) = (x.mtv.magnitude2(), y.mtv.magnitude2());
    if squared_x > squared_y {
        return Ordering::Less;
    }
    if squared_x < squared_y {
        return Ordering::Greater;
    }
    let descending = |x: S, y: S| y.partial_cmp(&x).unwrap_or(Ordering::Equal);
    (squared_x.is_nan().cmp(&squared_y.is_nan()))
        // Squares of tiny and huge lengths vanish and overflow alike.
        .then_with(|| descending(length(x.mtv), length(y.mtv)))
        .then_with(|| (x.a, x.b, x.part).cmp(&(y.a, y.b, y.part)))
        .then_with(|| descending(x.along[0], y.along[0]))
        .then_with(|| descending(x.along[1], y.along[1]))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn contact(a: u32, b: u32, depth: f32) -> Contact<f32> {
        let mtv = Vec3::new(0.0, depth, 0.0);
        Contact { a, b, part: 0, along: [0.0; 2], mtv }
    }

    #[test]
    fn sorting_puts_the_largest_first_and_survives_nan() {
        let sorted = [
            contact(7, 8, f32::INFINITY),
            contact(2, 3, 5.0),
            contact(0, 1, 2.0),
            contact(0, 2, 2.0),
            contact(1, 2, -2.0),
            contact(8, 9, 2e-30),
            contact(5, 9, 1e-30),
            contact(5, 6, 0.0),
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
