//! Arithmetic of one number or of several side by side, for formulas that are written once for both.

use std::ops::{Add, Div, Mul, Sub};

use cgmath::InnerSpace;
use cgmath::num_traits::Float;

use super::{Scalar, Vec3, length};

/// A number (`f32`, `f64`), or several of them side by side (SIMD).
pub trait Real:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
    /// One of them.
    type Scalar: Scalar;
    /// Three of them.
    type Vector: RealVector<Self>;

    /// Puts this number side by side with itself.
    fn splat(x: Self::Scalar) -> Self;
    /// Rounds a constant to this type.
    #[inline(always)]
    fn constant(x: f64) -> Self {
        Self::splat(Self::Scalar::from_f64(x))
    }
    /// The larger of two; `other` where they do not compare.
    fn max(self, other: Self) -> Self;
    /// `yes` where `self` is greater than `other`, else `no`.
    fn select_gt(self, other: Self, yes: Self, no: Self) -> Self;
}

/// Vector of three [real](Real) numbers.
pub trait RealVector<R>:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<R, Output = Self>
{
    fn inner_product(self, other: Self) -> R;
    /// The vector, shortened to this length where it is longer.
    fn clamp_length(self, max: R) -> Self;

    /// Component at right angles to a unit vector.
    #[inline(always)]
    fn reject_from(self, unit: Self) -> Self {
        self - unit * self.inner_product(unit)
    }
}

impl<S: Scalar> Real for S {
    type Scalar = S;
    type Vector = Vec3<S>;

    #[inline(always)]
    fn splat(x: S) -> Self {
        x
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Float::max(self, other)
    }

    #[inline(always)]
    fn select_gt(self, other: Self, yes: Self, no: Self) -> Self {
        if self > other { yes } else { no }
    }
}

impl<S: Scalar> RealVector<S> for Vec3<S> {
    #[inline(always)]
    fn inner_product(self, other: Self) -> S {
        self.dot(other)
    }

    /// Impulses of small marbles are so small that their squares vanish, hence [`length`].
    #[inline(always)]
    fn clamp_length(self, max: S) -> Self {
        let length = length(self);
        if length > max { self * (max / length) } else { self }
    }
}
