//! Periodic boundary conditions: a body that leaves through a side enters through the opposite one.

use cgmath::EuclideanSpace;
use cgmath::num_traits::Float;

use super::Grid;
use crate::Error;
use crate::error::within;
use crate::math::{Point3, Scalar, Vec3};

/// Smallest period in diameters of the largest ball, so that there are four cells of that width
/// along it: balls in neighbouring cells are then nearest where they are neighbours.
const LEAST_DIAMETERS: f64 = 4.01;

/// Lengths of a periodic box along the axes, around the origin.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub(crate) struct Period<S> {
    /// Lengths in metres; none along a non-periodic axis.
    pub lengths: [Option<S>; 3],
}

impl<S: Scalar> Period<S> {
    /// Returns true without a periodic axis.
    pub fn is_open(&self) -> bool {
        self.lengths.iter().all(Option::is_none)
    }

    /// Checks that the largest of these balls fits into each length often enough.
    pub fn check_radii(self, radius: &[S]) -> Result<(), Error> {
        let largest = radius.iter().fold(S::zero(), |max, r| Float::max(max, *r));
        let least = largest * S::from_f64(2.0 * LEAST_DIAMETERS);
        for (length, field) in self.lengths.iter().zip(["period.x", "period.y", "period.z"]) {
            length.map(|length| within(field, length, least, S::max_value())).transpose()?;
        }
        Ok(())
    }

    /// Shortest displacement modulo periods: minimum image convention (Allen and Tildesley,
    /// *Computer Simulation of Liquids*, 1987, §1.5.2).
    #[inline]
    pub fn minimum_image(&self, way: Vec3<S>) -> Vec3<S> {
        self.image(Point3::from_vec(way), Point3::origin()).to_vec()
    }

    /// Image of a point that is nearest to another one.
    #[inline]
    pub fn image(&self, mut point: Point3<S>, near: Point3<S>) -> Point3<S> {
        for (axis, length) in self.lengths.iter().enumerate() {
            if let Some(length) = *length {
                let way = point[axis] - near[axis];
                if way.abs() >= length {
                    // The remainder is exact.
                    point[axis] = near[axis] + way % length;
                }
                let way = point[axis] - near[axis];
                // A point on a side stays on that side.
                let half = length * S::from_f64(0.5);
                if way.abs() > half {
                    point[axis] -= length.copysign(way);
                }
            }
        }
        point
    }
}

/// Spheres with their periodic images, and scratch memory of the pair search.
#[derive(Clone, Debug, Default)]
pub(crate) struct Images<S> {
    center: Vec<Point3<S>>,
    radius: Vec<S>,
    row: Vec<u32>,
    pairs: Vec<(u32, u32)>,
}

impl<S: Scalar> Images<S> {
    /// Visits every pair of spheres at most `reach` metres apart, and some more, once, the lower
    /// index first, also across the sides of a periodic box. `pair` says if the two overlap: of crowds
    /// in an open world fewer are visited (see [`Grid::pairs_up_to_crowds`]).
    pub fn pairs(
        &mut self,
        grid: &mut Grid,
        (center, radius): (&[Point3<S>], &[S]),
        reach: S,
        period: Period<S>,
        mut pair: impl FnMut(u32, u32) -> bool,
    ) {
        if period.is_open() {
            grid.rebuild(center, radius, reach);
            grid.pairs_up_to_crowds(center, pair);
            return;
        }
        self.list(center, radius, reach, period);
        grid.rebuild(&self.center, &self.radius, reach);
        let Self { row, pairs, .. } = self;
        let inside = center.len() as u32;
        pairs.clear();
        grid.pairs(&self.center, |a, b| {
            // Of two that touch across a side, one is inside for some image.
            if a < inside {
                let (a, b) = (row[a as usize], row[b as usize]);
                if a != b {
                    pairs.push((a.min(b), a.max(b)));
                }
            }
        });
        pairs.sort_unstable();
        pairs.dedup();
        for (a, b) in pairs {
            pair(*a, *b);
        }
    }

    /// Lists all spheres wrapped into the box, then the images that one of them may touch.
    fn list(&mut self, center: &[Point3<S>], radius: &[S], reach: S, period: Period<S>) {
        let largest = radius.iter().fold(S::zero(), |max, r| Float::max(max, *r));
        self.center.clear();
        self.center.extend(center.iter().map(|center| period.image(*center, Point3::origin())));
        self.radius.clear();
        self.radius.extend_from_slice(radius);
        self.row.clear();
        self.row.extend(0..center.len() as u32);
        for inside in 0..center.len() {
            let (first, radius) = (self.center.len(), radius[inside]);
            for (axis, length) in period.lengths.iter().enumerate() {
                let Some(length) = *length else { continue };
                let half = length * S::from_f64(0.5);
                let far = (radius + largest + reach).min(half);
                for image in std::iter::once(inside).chain(first..self.center.len()) {
                    let at = self.center[image];
                    for shift in [length, -length] {
                        let mut beyond = at;
                        beyond[axis] += shift;
                        if beyond[axis].abs() <= half + far {
                            self.center.push(beyond);
                        }
                    }
                }
            }
            self.radius.resize(self.center.len(), radius);
            self.row.resize(self.center.len(), inside as u32);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::broad::brute_force_pairs;
    use cgmath::InnerSpace;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn pairs_across_the_sides_are_named_once(
            at in proptest::collection::vec([-0.75..0.75_f64, -0.75..0.75_f64, -0.75..0.75_f64], 2..60),
            sides in 1..8_u32,
            reach in 0.0..0.05_f64,
        ) {
            let lengths = [0, 1, 2].map(|axis| (sides >> axis & 1 == 1).then_some(1.0));
            let period = Period { lengths };
            let center: Vec<Point3<f64>> = at.into_iter().map(Point3::from).collect();
            let radius: Vec<f64> = (0..center.len()).map(|i| [0.02, 0.05, 0.12][i % 3]).collect();
            let touches = |a: u32, b: u32| {
                let (a, b) = (a as usize, b as usize);
                period.minimum_image(center[b] - center[a]).magnitude() <= radius[a] + radius[b] + reach
            };
            let mut named = Vec::new();
            Images::default().pairs(&mut Grid::default(), (&center, &radius), reach, period, |a, b| {
                named.push((a, b));
                false
            });
            let count = named.len();
            named.dedup();
            prop_assert_eq!(named.len(), count, "one was named twice");
            named.retain(|(a, b)| touches(*a, *b));
            let mut all = Vec::new();
            brute_force_pairs(center.len() as u32, |a, b| all.push((a, b)));
            all.retain(|(a, b)| touches(*a, *b));
            all.sort_unstable();
            prop_assert_eq!(named, all);
        }
    }

    #[test]
    fn the_nearest_image_is_the_way_itself_where_that_is_short() {
        let period = Period { lengths: [Some(8.0_f32), None, Some(0.3)] };
        let short = Vec3::new(3.999, 1e9, -0.1499);
        assert_eq!(period.minimum_image(short), short);
        let there = period.minimum_image(Vec3::new(-5.0, 1e9, 0.25));
        assert_eq!(there, Vec3::new(3.0, 1e9, 0.25 - 0.3));
        assert!(period.minimum_image(Vec3::new(f32::NAN, 0.0, 0.0)).x.is_nan());
    }
}
