//! Aliases of cgmath's types and the few functions that it lacks. Independent of shapes and time.

#![allow(
    clippy::inline_always,
    reason = "kernels are compiled for the instructions of their caller"
)]

use cgmath::num_traits::{self, Float, ToPrimitive};
use cgmath::{BaseFloat, InnerSpace};

#[cfg(target_arch = "x86_64")]
mod avx2;
mod lanes;
mod real;
pub(crate) mod simd;
mod union_find;
mod vec3_wide;

pub(crate) use lanes::{Lanes, PerScalar};
pub(crate) use real::{Real, RealVector};
pub(crate) use simd::{Kernel, LANES, Row, Simd, SimdLevel};
pub(crate) use union_find::UnionFind;
pub(crate) use vec3_wide::Vec3Wide;

/// Displacement, velocity or direction.
pub type Vec3<S> = cgmath::Vector3<S>;
/// Position.
pub type Point3<S> = cgmath::Point3<S>;
/// Rotation.
pub type Quat<S> = cgmath::Quaternion<S>;
/// A 3×3 matrix, column-major.
pub type Mat3<S> = cgmath::Matrix3<S>;
/// A 4×4 matrix, column-major.
pub type Mat4<S> = cgmath::Matrix4<S>;

/// Floating-point type of a world: `f32` or `f64`.
pub trait Scalar: BaseFloat + Default + Send + Sync + Lanes + 'static {
    /// Rounds a constant to this type.
    #[must_use]
    #[inline]
    fn from_f64(value: f64) -> Self {
        // Both implementors convert every f64; NaN is unreachable.
        num_traits::cast(value).unwrap_or_else(Self::nan)
    }

    /// Converts to `f64`, exactly.
    #[must_use]
    #[inline]
    fn as_f64(self) -> f64 {
        ToPrimitive::to_f64(&self).unwrap_or(f64::NAN)
    }

    /// Sine and cosine of an angle in radians, by a pure-Rust library: bit-identical on every
    /// platform, which the platform's own is not.
    #[must_use]
    fn sin_cos_portable(self) -> (Self, Self);

    /// Angle of the point (`x`, `self`) in radians, in [−π, π]; bit-identical on every platform.
    #[must_use]
    fn atan2_portable(self, x: Self) -> Self;

    /// e to the power of this; bit-identical on every platform.
    #[must_use]
    fn exp_portable(self) -> Self;

    /// Natural logarithm; bit-identical on every platform.
    #[must_use]
    fn ln_portable(self) -> Self;
}

impl Scalar for f32 {
    fn sin_cos_portable(self) -> (Self, Self) {
        libm::sincosf(self)
    }

    fn atan2_portable(self, x: Self) -> Self {
        libm::atan2f(self, x)
    }

    fn exp_portable(self) -> Self {
        libm::expf(self)
    }

    fn ln_portable(self) -> Self {
        libm::logf(self)
    }
}

impl Scalar for f64 {
    fn sin_cos_portable(self) -> (Self, Self) {
        libm::sincos(self)
    }

    fn atan2_portable(self, x: Self) -> Self {
        libm::atan2(self, x)
    }

    fn exp_portable(self) -> Self {
        libm::exp(self)
    }

    fn ln_portable(self) -> Self {
        libm::log(self)
    }
}

/// Converts a quaternion to another scalar.
pub(crate) fn cast_rotation<S: Scalar, T: Scalar>(Quat { s, v }: Quat<S>) -> Quat<T> {
    Quat { s: T::from_f64(s.as_f64()), v: cast_vector(v) }
}

/// Converts a vector to another scalar.
#[must_use]
#[inline]
pub fn cast_vector<S: Scalar, T: Scalar>(v: Vec3<S>) -> Vec3<T> {
    v.map(|x| T::from_f64(x.as_f64()))
}

/// Converts a point to another scalar.
#[must_use]
#[inline]
pub fn cast_point<S: Scalar, T: Scalar>(p: Point3<S>) -> Point3<T> {
    p.map(|x| T::from_f64(x.as_f64()))
}

/// Length of `v` without overflow or underflow of squares. Infinite only if a component is, or if
/// the length itself is beyond the scalar's range.
#[must_use]
#[inline]
pub fn length<S: Scalar>(v: Vec3<S>) -> S {
    let squared = v.magnitude2();
    if squared_is_exact(squared) {
        squared.sqrt()
    } else {
        let largest = largest_component(v);
        if largest > S::zero() && largest.is_finite() {
            (v / largest).magnitude() * largest
        } else {
            largest
        }
    }
}

/// `v` as a unit vector and its length, or `None` if it has no direction: zero,
/// infinite or NaN.
#[must_use]
#[inline]
pub fn normalize_and_length<S: Scalar>(v: Vec3<S>) -> Option<(Vec3<S>, S)> {
    let squared = v.magnitude2();
    if squared_is_exact(squared) {
        let length = squared.sqrt();
        return Some((v / length, length));
    }
    let largest = largest_component(v);
    if largest > S::zero() && largest.is_finite() {
        let scaled = v / largest;
        let length = scaled.magnitude();
        Some((scaled / length, length * largest))
    } else {
        None
    }
}

/// Unit normal between the centers of two balls, and their distance. Coincident centers get an
/// [arbitrary normal](any_direction), different for each pair.
#[inline]
pub(crate) fn normal_and_distance<S: Scalar>(
    center_offset: Vec3<S>,
    [a, b]: [u32; 2],
) -> (Vec3<S>, S) {
    let direction = normalize_and_length(center_offset);
    direction.unwrap_or_else(|| (any_direction(a, b), length(center_offset)))
}

/// Deterministic unit vector for a pair of indices without a direction: spread evenly over the
/// sphere by the golden angle (González, *Measurement of areas on a sphere using Fibonacci and
/// latitude–longitude lattices*, 2010).
#[must_use]
pub fn any_direction<S: Scalar>(first: u32, second: u32) -> Vec3<S> {
    // Fibonacci hashing (Knuth, *The Art of Computer Programming*, vol. 3, §6.4).
    let mixed = (u64::from(first) << 32 | u64::from(second)).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    let number = |bits: u64| (bits & 0xFFFF_FFFF) as f64 / 4_294_967_296.0;
    let (height, turn) = (2.0 * number(mixed >> 32) - 1.0, number(mixed) * std::f64::consts::TAU);
    let (sin, cos) = turn.sin_cos_portable();
    let across = (1.0 - height * height).sqrt();
    cast_vector(Vec3::new(across * cos, height, across * sin))
}

/// Returns true if a sum of three squares kept all of its digits. Under the smallest normal number
/// divided by epsilon, one of them may have been denormal.
fn squared_is_exact<S: Scalar>(squared: S) -> bool {
    squared.is_finite() && squared > S::min_positive_value() / S::epsilon()
}

/// Largest absolute component; NaN if a component is.
fn largest_component<S: Scalar>(v: Vec3<S>) -> S {
    let (x, y, z) = (v.x.abs(), v.y.abs(), v.z.abs());
    if x.is_nan() || y.is_nan() || z.is_nan() { S::nan() } else { Float::max(x, Float::max(y, z)) }
}

/// Returns true if all components are finite.
#[must_use]
#[inline]
pub fn is_finite<S: Scalar>(v: Vec3<S>) -> bool {
    v.x.is_finite() && v.y.is_finite() && v.z.is_finite()
}

/// Returns true if all coordinates are finite.
#[must_use]
#[inline]
pub fn is_finite_point<S: Scalar>(p: Point3<S>) -> bool {
    p.x.is_finite() && p.y.is_finite() && p.z.is_finite()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_neither_overflow_nor_vanish() {
        for scale in [1e-44_f32, 1e-40, 1e-30, 1e-20, 1e-3, 1.0, 1e3, 1e20, 1e37] {
            let v = Vec3::new(2.0 * scale, 3.0 * scale, 6.0 * scale);
            let expected = 7.0 * f64::from(scale);
            // Denormals carry fewer digits, so allow their spacing as well.
            let tolerance = 4e-7 * expected + 3e-45;
            assert!((f64::from(length(v)) - expected).abs() <= tolerance, "{scale}");
            let (unit, l) = normalize_and_length(v).unwrap();
            assert_eq!(l.to_bits(), length(v).to_bits(), "{scale}");
            assert!((unit.magnitude() - 1.0).abs() < 3e-7, "{scale}");
        }
    }

    #[test]
    fn what_has_no_direction_gives_none() {
        for v in [
            Vec3::new(0.0_f64, 0.0, 0.0),
            Vec3::new(-0.0, 0.0, 0.0),
            Vec3::new(f64::NAN, 1.0, 0.0),
            Vec3::new(1.0, f64::INFINITY, 0.0),
        ] {
            assert_eq!(normalize_and_length(v), None, "{v:?}");
        }
    }

    #[test]
    fn nan_and_infinity_show_in_the_length() {
        assert!(length(Vec3::new(0.0_f32, f32::NAN, 2.0)).is_nan());
        assert_eq!(length(Vec3::new(f32::NEG_INFINITY, 0.0, 2.0)), f32::INFINITY);
    }
}
