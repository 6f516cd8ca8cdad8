//! Parts of [`Scalar`] that are nobody's business outside of the crate.

use bytemuck::Pod;

use super::Scalar;
#[cfg(target_arch = "x86_64")]
use super::Simd;

/// A type for each scalar.
pub trait PerScalar {
    type Of<S: Scalar>;
}

/// Choices by scalar.
pub trait Lanes: Pod {
    /// Eight of them by AVX2.
    #[cfg(target_arch = "x86_64")]
    type Avx2: Simd<Scalar = Self>;

    /// Chooses the value for this scalar.
    fn choose<T: PerScalar>(single: T::Of<f32>, double: T::Of<f64>) -> T::Of<Self>
    where
        Self: Scalar;

    /// Whole number below it, from 0 to 2³² − 1; 0 for NaN.
    fn to_u32(self) -> u32;

    /// Order in which NaN has a place, too.
    fn total_cmp(&self, other: &Self) -> std::cmp::Ordering;
}
