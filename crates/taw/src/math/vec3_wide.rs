//! Vectors on eight lanes.

use std::ops::{Add, Mul, Sub};

use super::{LANES, RealVector, Simd};

/// Three coordinates on eight lanes.
#[derive(Clone, Copy, Debug)]
pub struct Vec3Wide<L>(pub [L; 3]);

impl<L: Simd> Vec3Wide<L> {
    /// Coordinates of rows.
    #[inline(always)]
    pub fn of(row: &[L; 4]) -> Self {
        Self([row[0], row[1], row[2]])
    }

    #[inline(always)]
    pub fn load(from: &[[L::Scalar; LANES]; 3]) -> Self {
        Self([L::load(&from[0]), L::load(&from[1]), L::load(&from[2])])
    }

    #[inline(always)]
    pub fn store(self, to: &mut [[L::Scalar; LANES]; 3]) {
        let Self([x, y, z]) = self;
        x.store(&mut to[0]);
        y.store(&mut to[1]);
        z.store(&mut to[2]);
    }

    #[inline(always)]
    pub fn dot(self, other: Self) -> L {
        let (Self([a, b, c]), Self([x, y, z])) = (self, other);
        a * x + b * y + c * z
    }

    #[inline(always)]
    pub fn cross(self, other: Self) -> Self {
        let (Self([a, b, c]), Self([x, y, z])) = (self, other);
        Self([b * z - c * y, c * x - a * z, a * y - b * x])
    }

    /// Rows with these coordinates and a fourth number.
    #[inline(always)]
    pub fn with(self, w: L) -> [L; 4] {
        let Self([x, y, z]) = self;
        [x, y, z, w]
    }
}

impl<L: Simd> Add for Vec3Wide<L> {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        let (Self([a, b, c]), Self([x, y, z])) = (self, other);
        Self([a + x, b + y, c + z])
    }
}

impl<L: Simd> Sub for Vec3Wide<L> {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        let (Self([a, b, c]), Self([x, y, z])) = (self, other);
        Self([a - x, b - y, c - z])
    }
}

impl<L: Simd> Mul<L> for Vec3Wide<L> {
    type Output = Self;

    #[inline(always)]
    fn mul(self, by: L) -> Self {
        let Self([x, y, z]) = self;
        Self([x * by, y * by, z * by])
    }
}

impl<L: Simd> RealVector<L> for Vec3Wide<L> {
    #[inline(always)]
    fn inner_product(self, other: Self) -> L {
        self.dot(other)
    }

    #[inline(always)]
    fn clamp_length(self, max: L) -> Self {
        let length = self.dot(self).sqrt();
        self * length.select_gt(max, max / length, L::constant(1.0))
    }
}
