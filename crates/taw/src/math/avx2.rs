//! AVX2: eight numbers in one register, or in two.

#[allow(clippy::wildcard_imports, reason = "they all begin with _mm")]
use std::arch::x86_64::*;

use std::ops::{Add, Div, Mul, Sub};

use super::simd::{Kernel, LANES, Row, Simd};
use super::{Real, Scalar, Vec3Wide};

/// # Safety
/// The processor has these.
#[target_feature(enable = "avx2,bmi1,popcnt")]
pub unsafe fn run<S: Scalar>(kernel: impl Kernel<S>) {
    kernel.run::<S::Avx2>();
}

/// Eight lanes of a register. Only [`run`] makes them, where the processor has AVX2: that is
/// why each of the instructions below is safe.
#[derive(Clone, Copy, Debug)]
pub struct Avx(__m256);

impl Real for Avx {
    type Scalar = f32;
    type Vector = Vec3Wide<Self>;

    #[inline(always)]
    fn splat(x: f32) -> Self {
        Self(unsafe { _mm256_set1_ps(x) })
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self(unsafe { _mm256_max_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn select_gt(self, other: Self, yes: Self, no: Self) -> Self {
        unsafe {
            let mask = _mm256_cmp_ps::<_CMP_GT_OQ>(self.0, other.0);
            Self(_mm256_blendv_ps(no.0, yes.0, mask))
        }
    }
}

impl Simd for Avx {
    #[inline(always)]
    fn load(from: &[f32; LANES]) -> Self {
        Self(unsafe { _mm256_loadu_ps(from.as_ptr()) })
    }

    #[inline(always)]
    fn store(self, to: &mut [f32; LANES]) {
        unsafe { _mm256_storeu_ps(to.as_mut_ptr(), self.0) }
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(unsafe { _mm256_sqrt_ps(self.0) })
    }

    #[inline(always)]
    fn gt_mask(self, other: Self) -> u32 {
        unsafe { _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_GT_OQ>(self.0, other.0)).cast_unsigned() }
    }

    #[inline(always)]
    fn sum(self) -> f32 {
        unsafe {
            let four =
                _mm_add_ps(_mm256_castps256_ps128(self.0), _mm256_extractf128_ps::<1>(self.0));
            let two = _mm_add_ps(four, _mm_movehl_ps(four, four));
            _mm_cvtss_f32(_mm_add_ss(two, _mm_shuffle_ps::<1>(two, two)))
        }
    }

    #[inline(always)]
    fn mask_first(self, count: usize) -> Self {
        let mask = &MASK[LANES - count.min(LANES)..];
        // SAFETY: eight follow.
        Self(unsafe { _mm256_and_ps(self.0, _mm256_loadu_ps(mask.as_ptr().cast())) })
    }

    #[inline(always)]
    fn compress(bits: u32, from: u32, to: &mut [u32; LANES]) {
        compress(bits, from, to);
    }

    #[inline(always)]
    unsafe fn gather(base: *const Row<f32>, at: &[u16; LANES]) -> [Self; 4] {
        // Two rows to a register, then a transposition of two blocks of four by four.
        unsafe {
            transpose(
                two(base, at[0], at[4]),
                two(base, at[1], at[5]),
                two(base, at[2], at[6]),
                two(base, at[3], at[7]),
            )
        }
    }

    #[inline(always)]
    unsafe fn scatter(base: *mut Row<f32>, at: &[u16; LANES], count: usize, columns: [Self; 4]) {
        unsafe {
            let [x, y, z, w] = columns;
            let [first, second, third, fourth] = transpose(x.0, y.0, z.0, w.0);
            if count == LANES {
                put(base, at[0], at[4], first);
                put(base, at[1], at[5], second);
                put(base, at[2], at[6], third);
                put(base, at[3], at[7], fourth);
            } else {
                let mut rows = [[0.0; LANES]; 4];
                first.store(&mut rows[0]);
                second.store(&mut rows[1]);
                third.store(&mut rows[2]);
                fourth.store(&mut rows[3]);
                for lane in 0..count {
                    let half = lane / 4 * 4;
                    let row = &rows[lane % 4][half..half + 4];
                    let to: *mut f32 = base.add(usize::from(at[lane])).cast();
                    to.copy_from_nonoverlapping(row.as_ptr(), 4);
                }
            }
        }
    }
}

/// All bits for eight lanes, and none for eight more.
static MASK: [u32; 2 * LANES] = [!0, !0, !0, !0, !0, !0, !0, !0, 0, 0, 0, 0, 0, 0, 0, 0];

/// For each set of bits, which lanes are in it.
static FIRST: [[u32; LANES]; 256] = {
    let mut first = [[0; LANES]; 256];
    let mut bits = 0;
    while bits < 256 {
        let (mut lane, mut count) = (0, 0);
        while lane < LANES {
            if bits >> lane & 1 == 1 {
                first[bits][count] = lane as u32;
                count += 1;
            }
            lane += 1;
        }
        bits += 1;
    }
    first
};

#[inline(always)]
unsafe fn two(base: *const Row<f32>, low: u16, high: u16) -> __m256 {
    unsafe {
        let low = _mm_loadu_ps(base.add(usize::from(low)).cast());
        let high = _mm_loadu_ps(base.add(usize::from(high)).cast());
        _mm256_insertf128_ps::<1>(_mm256_castps128_ps256(low), high)
    }
}

#[inline(always)]
unsafe fn put(base: *mut Row<f32>, low: u16, high: u16, Avx(two): Avx) {
    unsafe {
        _mm_storeu_ps(base.add(usize::from(low)).cast(), _mm256_castps256_ps128(two));
        _mm_storeu_ps(base.add(usize::from(high)).cast(), _mm256_extractf128_ps::<1>(two));
    }
}

#[inline(always)]
unsafe fn transpose(a: __m256, b: __m256, c: __m256, d: __m256) -> [Avx; 4] {
    unsafe {
        let (low_ab, high_ab) = (_mm256_unpacklo_ps(a, b), _mm256_unpackhi_ps(a, b));
        let (low_cd, high_cd) = (_mm256_unpacklo_ps(c, d), _mm256_unpackhi_ps(c, d));
        [
            Avx(_mm256_shuffle_ps::<0b01_00_01_00>(low_ab, low_cd)),
            Avx(_mm256_shuffle_ps::<0b11_10_11_10>(low_ab, low_cd)),
            Avx(_mm256_shuffle_ps::<0b01_00_01_00>(high_ab, high_cd)),
            Avx(_mm256_shuffle_ps::<0b11_10_11_10>(high_ab, high_cd)),
        ]
    }
}

#[inline(always)]
fn compress(bits: u32, from: u32, to: &mut [u32; LANES]) {
    unsafe {
        let which = _mm256_loadu_si256(FIRST[bits as usize & 0xff].as_ptr().cast());
        let from = _mm256_set1_epi32(from.cast_signed());
        _mm256_storeu_si256(to.as_mut_ptr().cast(), _mm256_add_epi32(which, from));
    }
}

/// Eight lanes of two registers, which [`run`] alone makes, too.
#[derive(Clone, Copy, Debug)]
pub struct AvxPair([__m256d; 2]);

macro_rules! operator {
    ($name:ident, $method:ident, $one:ident, $two:ident) => {
        impl $name for Avx {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self(unsafe { $one(self.0, other.0) })
            }
        }
        impl $name for AvxPair {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                let ([a, b], [c, d]) = (self.0, other.0);
                Self(unsafe { [$two(a, c), $two(b, d)] })
            }
        }
    };
}
operator!(Add, add, _mm256_add_ps, _mm256_add_pd);
operator!(Sub, sub, _mm256_sub_ps, _mm256_sub_pd);
operator!(Mul, mul, _mm256_mul_ps, _mm256_mul_pd);
operator!(Div, div, _mm256_div_ps, _mm256_div_pd);

impl Real for AvxPair {
    type Scalar = f64;
    type Vector = Vec3Wide<Self>;

    #[inline(always)]
    fn splat(x: f64) -> Self {
        Self([unsafe { _mm256_set1_pd(x) }; 2])
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        let ([a, b], [c, d]) = (self.0, other.0);
        Self(unsafe { [_mm256_max_pd(a, c), _mm256_max_pd(b, d)] })
    }

    #[inline(always)]
    fn select_gt(self, other: Self, yes: Self, no: Self) -> Self {
        let (([a, b], [c, d]), ([p, q], [r, s])) = ((self.0, other.0), (yes.0, no.0));
        unsafe {
            let low = _mm256_blendv_pd(r, p, _mm256_cmp_pd::<_CMP_GT_OQ>(a, c));
            Self([low, _mm256_blendv_pd(s, q, _mm256_cmp_pd::<_CMP_GT_OQ>(b, d))])
        }
    }
}

impl Simd for AvxPair {
    #[inline(always)]
    fn load(from: &[f64; LANES]) -> Self {
        let from = from.as_ptr();
        // SAFETY: eight numbers are two registers.
        Self(unsafe { [_mm256_loadu_pd(from), _mm256_loadu_pd(from.add(4))] })
    }

    #[inline(always)]
    fn store(self, to: &mut [f64; LANES]) {
        let (to, [low, high]) = (to.as_mut_ptr(), self.0);
        // SAFETY: as above.
        unsafe {
            _mm256_storeu_pd(to, low);
            _mm256_storeu_pd(to.add(4), high);
        }
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        let [a, b] = self.0;
        Self(unsafe { [_mm256_sqrt_pd(a), _mm256_sqrt_pd(b)] })
    }

    #[inline(always)]
    fn gt_mask(self, other: Self) -> u32 {
        let ([a, b], [c, d]) = (self.0, other.0);
        unsafe {
            let low = _mm256_movemask_pd(_mm256_cmp_pd::<_CMP_GT_OQ>(a, c));
            (low | _mm256_movemask_pd(_mm256_cmp_pd::<_CMP_GT_OQ>(b, d)) << 4).cast_unsigned()
        }
    }

    #[inline(always)]
    fn sum(self) -> f64 {
        let [low, high] = self.0;
        unsafe {
            let four = _mm256_add_pd(low, high);
            let two = _mm_add_pd(_mm256_castpd256_pd128(four), _mm256_extractf128_pd::<1>(four));
            _mm_cvtsd_f64(_mm_add_sd(two, _mm_unpackhi_pd(two, two)))
        }
    }

    #[inline(always)]
    fn mask_first(self, count: usize) -> Self {
        let mut lanes = [0.0; LANES];
        self.store(&mut lanes);
        lanes.iter_mut().skip(count).for_each(|lane| *lane = 0.0);
        Self::load(&lanes)
    }

    #[inline(always)]
    fn compress(bits: u32, from: u32, to: &mut [u32; LANES]) {
        compress(bits, from, to);
    }

    #[inline(always)]
    unsafe fn gather(base: *const Row<f64>, at: &[u16; LANES]) -> [Self; 4] {
        // A row is a register.
        unsafe {
            let [a, b, c, d] = four(base, [at[0], at[1], at[2], at[3]]);
            let [e, f, g, h] = four(base, [at[4], at[5], at[6], at[7]]);
            [Self([a, e]), Self([b, f]), Self([c, g]), Self([d, h])]
        }
    }

    #[inline(always)]
    unsafe fn scatter(base: *mut Row<f64>, at: &[u16; LANES], count: usize, columns: [Self; 4]) {
        let [Self([a, e]), Self([b, f]), Self([c, g]), Self([d, h])] = columns;
        unsafe {
            let [low, high] = [transpose_four([a, b, c, d]), transpose_four([e, f, g, h])];
            let rows = [low[0], low[1], low[2], low[3], high[0], high[1], high[2], high[3]];
            for lane in 0..count {
                _mm256_storeu_pd(base.add(usize::from(at[lane])).cast(), rows[lane]);
            }
        }
    }
}

#[inline(always)]
unsafe fn four(base: *const Row<f64>, [a, b, c, d]: [u16; 4]) -> [__m256d; 4] {
    unsafe {
        transpose_four([
            _mm256_loadu_pd(base.add(usize::from(a)).cast()),
            _mm256_loadu_pd(base.add(usize::from(b)).cast()),
            _mm256_loadu_pd(base.add(usize::from(c)).cast()),
            _mm256_loadu_pd(base.add(usize::from(d)).cast()),
        ])
    }
}

#[inline(always)]
unsafe fn transpose_four([a, b, c, d]: [__m256d; 4]) -> [__m256d; 4] {
    unsafe {
        let (ab, ba) = (_mm256_unpacklo_pd(a, b), _mm256_unpackhi_pd(a, b));
        let (cd, dc) = (_mm256_unpacklo_pd(c, d), _mm256_unpackhi_pd(c, d));
        [
            _mm256_permute2f128_pd::<0x20>(ab, cd),
            _mm256_permute2f128_pd::<0x20>(ba, dc),
            _mm256_permute2f128_pd::<0x31>(ab, cd),
            _mm256_permute2f128_pd::<0x31>(ba, dc),
        ]
    }
}
