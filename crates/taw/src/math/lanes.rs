//! Parts of [`Scalar`] for this crate only.

use bytemuck::Pod;
use cgmath::num_traits::float::TotalOrder;

use super::Scalar;
#[cfg(target_arch = "x86_64")]
use super::Simd;

/// A type for each scalar.
pub trait PerScalar {
    type Of<S: Scalar>;
}

/// Choices by scalar.
pub trait Lanes: Pod + TotalOrder {
    /// Eight lanes in AVX2 registers.
    #[doc(hidden)]
    #[cfg(target_arch = "x86_64")]
    type Avx2: Simd<Scalar = Self>;

    /// Chooses the value for this scalar.
    #[doc(hidden)]
    fn choose<T: PerScalar>(single: T::Of<f32>, double: T::Of<f64>) -> T::Of<Self>
    where
        Self: Scalar;

    /// Floor, saturated to `u32`; 0 for NaN.
    #[doc(hidden)]
    fn floor_to_u32(self) -> u32;
}
