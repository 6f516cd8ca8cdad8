//! SIMD: eight numbers at once, by the processor's own instructions where it has them, else in
//! plain Rust. Both round each operation alike, so a step gives the same bits by either.

use std::ops::{Add, Div, Mul, Sub};

use super::vec3_wide::Vec3Wide;
use crate::math::Real;

/// Number of contacts that a kernel works on at once.
pub(super) const LANES: usize = 8;

/// A row of a column: three coordinates, and one number more.
pub(super) type Row = [f32; 4];

/// Eight numbers. Nothing here adds across lanes or fuses two roundings into one.
pub(super) trait Simd: Real<Vector = Vec3Wide<Self>> {
    fn load(from: &[f32; LANES]) -> Self;
    fn store(self, to: &mut [f32; LANES]);
    fn sqrt(self) -> Self;
    /// Mask with a bit for each lane where the first is the greater, the lowest bit for the first
    /// lane.
    fn gt_mask(self, other: Self) -> u32;
    /// The sum of all: of the lanes that are four apart, then two, then one.
    fn sum(self) -> f32;
    /// The lanes before this one; zeros after them.
    fn mask_first(self, count: usize) -> Self;
    /// The lanes whose bits are set, counted from a number on; the rest is anything.
    fn compress(bits: u32, from: u32, to: &mut [u32; LANES]);
    /// The rows at these places after `base`, as columns.
    ///
    /// # Safety
    /// The rows exist, and nobody writes them meanwhile.
    unsafe fn gather(base: *const Row, at: &[u16; LANES]) -> [Self; 4];
    /// Writes back the first `count` of what [`Simd::gather`] read.
    ///
    /// # Safety
    /// The rows exist, and no other thread touches them meanwhile.
    unsafe fn scatter(base: *mut Row, at: &[u16; LANES], count: usize, columns: [Self; 4]);
}

/// A piece of work on eight lanes.
pub(super) trait Kernel {
    /// Does it. Mark it and all that it calls `#[inline(always)]`, so that it is compiled for the
    /// instructions of the lanes that it is done by; and call no closure with lanes, which cannot
    /// be marked so.
    fn run<L: Simd>(self);
}

/// Instruction set that a swarm uses. Each gives the same bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SimdLevel(Kind);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Portable,
    /// AVX2, BMI1 and POPCNT; only where the processor has them.
    #[cfg(target_arch = "x86_64")]
    Avx2,
}

impl Default for SimdLevel {
    /// The fastest that this machine has.
    fn default() -> Self {
        Self::available().next().unwrap_or(Self::PORTABLE)
    }
}

impl SimdLevel {
    /// Those that every machine of its kind has.
    pub const PORTABLE: Self = Self(Kind::Portable);

    /// All that this machine has, the fastest first.
    pub fn available() -> impl Iterator<Item = Self> {
        #[cfg(target_arch = "x86_64")]
        let more = (std::is_x86_feature_detected!("avx2")
            && std::is_x86_feature_detected!("bmi1")
            && std::is_x86_feature_detected!("popcnt"))
        .then_some(Self(Kind::Avx2));
        #[cfg(not(target_arch = "x86_64"))]
        let more = None;
        more.into_iter().chain([Self::PORTABLE])
    }

    pub(super) fn run(self, kernel: impl Kernel) {
        match self.0 {
            Kind::Portable => kernel.run::<Portable>(),
            // SAFETY: a value of this kind comes from `available` only.
            #[cfg(target_arch = "x86_64")]
            Kind::Avx2 => unsafe { x86::run(kernel) },
        }
    }
}

/// Plain Rust.
#[derive(Clone, Copy, Debug)]
pub(super) struct Portable([f32; LANES]);

impl Portable {
    #[inline(always)]
    fn both(self, other: Self, of: impl Fn(f32, f32) -> f32) -> Self {
        let mut out = self.0;
        for (a, b) in out.iter_mut().zip(other.0) {
            *a = of(*a, b);
        }
        Self(out)
    }
}

macro_rules! operator {
    ($name:ident, $method:ident, $plain:tt, $avx:ident) => {
        impl $name for Portable {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                self.both(other, |a, b| a $plain b)
            }
        }
        #[cfg(target_arch = "x86_64")]
        impl $name for x86::Avx {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                // SAFETY: see `Avx`.
                Self(unsafe { std::arch::x86_64::$avx(self.0, other.0) })
            }
        }
    };
}
operator!(Add, add, +, _mm256_add_ps);
operator!(Sub, sub, -, _mm256_sub_ps);
operator!(Mul, mul, *, _mm256_mul_ps);
operator!(Div, div, /, _mm256_div_ps);

impl Real for Portable {
    type Vector = Vec3Wide<Self>;

    #[inline(always)]
    fn splat(x: f32) -> Self {
        Self([x; LANES])
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        self.both(other, |a, b| if a > b { a } else { b })
    }

    #[inline(always)]
    fn select_gt(self, other: Self, yes: Self, no: Self) -> Self {
        let mut out = no.0;
        for (lane, out) in out.iter_mut().enumerate() {
            if self.0[lane] > other.0[lane] {
                *out = yes.0[lane];
            }
        }
        Self(out)
    }
}

impl Simd for Portable {
    #[inline(always)]
    fn load(from: &[f32; LANES]) -> Self {
        Self(*from)
    }

    #[inline(always)]
    fn store(self, to: &mut [f32; LANES]) {
        *to = self.0;
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(self.0.map(f32::sqrt))
    }

    #[inline(always)]
    fn gt_mask(self, other: Self) -> u32 {
        (0..LANES).map(|lane| u32::from(self.0[lane] > other.0[lane]) << lane).sum()
    }

    #[inline(always)]
    fn sum(self) -> f32 {
        let Self([a, b, c, d, e, f, g, h]) = self;
        ((a + e) + (c + g)) + ((b + f) + (d + h))
    }

    #[inline(always)]
    fn mask_first(self, count: usize) -> Self {
        let mut out = self.0;
        out.iter_mut().skip(count).for_each(|lane| *lane = 0.0);
        Self(out)
    }

    #[inline(always)]
    fn compress(mut bits: u32, from: u32, to: &mut [u32; LANES]) {
        let mut count = 0;
        while bits != 0 {
            to[count] = from + bits.trailing_zeros();
            count += 1;
            bits &= bits - 1;
        }
    }

    #[inline(always)]
    unsafe fn gather(base: *const Row, at: &[u16; LANES]) -> [Self; 4] {
        let mut columns = [[0.0; LANES]; 4];
        for lane in 0..LANES {
            // SAFETY: as the caller promises.
            let row = unsafe { *base.add(usize::from(at[lane])) };
            for (column, x) in columns.iter_mut().zip(row) {
                column[lane] = x;
            }
        }
        columns.map(Self)
    }

    #[inline(always)]
    unsafe fn scatter(base: *mut Row, at: &[u16; LANES], count: usize, columns: [Self; 4]) {
        for (lane, at) in at.iter().enumerate().take(count) {
            let row = columns.map(|column| column.0[lane]);
            // SAFETY: as the caller promises.
            unsafe { *base.add(usize::from(*at)) = row };
        }
    }
}

#[cfg(target_arch = "x86_64")]
mod x86 {
    #[allow(clippy::wildcard_imports, reason = "they all begin with _mm")]
    use std::arch::x86_64::*;

    use super::{Kernel, LANES, Real, Row, Simd, Vec3Wide};

    /// # Safety
    /// The processor has these.
    #[target_feature(enable = "avx2,bmi1,popcnt")]
    pub(super) unsafe fn run(kernel: impl Kernel) {
        kernel.run::<Avx>();
    }

    /// Eight lanes of a register. Only [`run`] makes them, where the processor has AVX2: that is
    /// why each of the instructions below is safe.
    #[derive(Clone, Copy, Debug)]
    pub(in crate::swarm) struct Avx(pub(super) __m256);

    impl Real for Avx {
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
            unsafe {
                _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_GT_OQ>(self.0, other.0)).cast_unsigned()
            }
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
            unsafe {
                let which = _mm256_loadu_si256(FIRST[bits as usize & 0xff].as_ptr().cast());
                let from = _mm256_set1_epi32(from.cast_signed());
                _mm256_storeu_si256(to.as_mut_ptr().cast(), _mm256_add_epi32(which, from));
            }
        }

        #[inline(always)]
        unsafe fn gather(base: *const Row, at: &[u16; LANES]) -> [Self; 4] {
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
        unsafe fn scatter(base: *mut Row, at: &[u16; LANES], count: usize, columns: [Self; 4]) {
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
    unsafe fn two(base: *const Row, low: u16, high: u16) -> __m256 {
        unsafe {
            let low = _mm_loadu_ps(base.add(usize::from(low)).cast());
            let high = _mm_loadu_ps(base.add(usize::from(high)).cast());
            _mm256_insertf128_ps::<1>(_mm256_castps128_ps256(low), high)
        }
    }

    #[inline(always)]
    unsafe fn put(base: *mut Row, low: u16, high: u16, Avx(two): Avx) {
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
}
