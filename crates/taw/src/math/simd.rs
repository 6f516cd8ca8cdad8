//! SIMD: eight numbers at once, by the processor's own instructions where it has them, else in
//! plain Rust. Both round each operation alike, so a step gives the same bits by either.

use std::ops::{Add, Div, Mul, Sub};

#[cfg(target_arch = "x86_64")]
use super::avx2;
use super::{Lanes, PerScalar, Real, Scalar, Vec3Wide};

/// Number of contacts that a kernel works on at once.
pub const LANES: usize = 8;

/// A row of a column: three coordinates, and one number more.
pub type Row<S> = [S; 4];

/// Eight numbers. Nothing here adds across lanes or fuses two roundings into one.
pub trait Simd: Real<Vector = Vec3Wide<Self>> {
    fn load(from: &[Self::Scalar; LANES]) -> Self;
    fn store(self, to: &mut [Self::Scalar; LANES]);
    fn sqrt(self) -> Self;
    /// Mask with a bit for each lane where the first is the greater, the lowest bit for the first
    /// lane.
    fn gt_mask(self, other: Self) -> u32;
    /// The sum of all: of the lanes that are four apart, then two, then one.
    fn sum(self) -> Self::Scalar;
    /// The lanes before this one; zeros after them.
    fn mask_first(self, count: usize) -> Self;
    /// The lanes whose bits are set, counted from a number on; the rest is anything.
    fn compress(bits: u32, from: u32, to: &mut [u32; LANES]);
    /// The rows at these places after `base`, as columns.
    ///
    /// # Safety
    /// The rows exist, and nobody writes them meanwhile.
    unsafe fn gather(base: *const Row<Self::Scalar>, at: &[u16; LANES]) -> [Self; 4];
    /// Writes back the first `count` of what [`Simd::gather`] read.
    ///
    /// # Safety
    /// The rows exist, and no other thread touches them meanwhile.
    unsafe fn scatter(
        base: *mut Row<Self::Scalar>,
        at: &[u16; LANES],
        count: usize,
        columns: [Self; 4],
    );
}

/// A piece of work on eight lanes.
pub trait Kernel<S> {
    /// Does it. Mark it and all that it calls `#[inline(always)]`, so that it is compiled for the
    /// instructions of the lanes that it is done by; and call no closure with lanes, which cannot
    /// be marked so.
    fn run<L: Simd<Scalar = S>>(self);
}

/// Instruction set that a swarm uses. Each gives the same bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SimdLevel(SimdKind);

/// Instruction sets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum SimdKind {
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
    pub const PORTABLE: Self = Self(SimdKind::Portable);

    /// All that this machine has, the fastest first.
    pub fn available() -> impl Iterator<Item = Self> {
        #[cfg(target_arch = "x86_64")]
        let more = (std::is_x86_feature_detected!("avx2")
            && std::is_x86_feature_detected!("bmi1")
            && std::is_x86_feature_detected!("popcnt"))
        .then_some(Self(SimdKind::Avx2));
        #[cfg(not(target_arch = "x86_64"))]
        let more = None;
        more.into_iter().chain([Self::PORTABLE])
    }

    pub(crate) fn run<S: Scalar>(self, kernel: impl Kernel<S>) {
        match self.0 {
            SimdKind::Portable => kernel.run::<Portable<S>>(),
            // SAFETY: a value of this kind comes from `available` only.
            #[cfg(target_arch = "x86_64")]
            SimdKind::Avx2 => unsafe { avx2::run(kernel) },
        }
    }
}

/// Plain Rust.
#[derive(Clone, Copy, Debug)]
pub struct Portable<S>([S; LANES]);

impl<S: Scalar> Portable<S> {
    /// Lane by lane: loops take the compiler twice as long.
    #[inline(always)]
    fn both(self, other: Self, of: impl Fn(S, S) -> S) -> Self {
        let (Self([a, b, c, d, e, f, g, h]), Self([i, j, k, l, m, n, o, p])) = (self, other);
        Self([of(a, i), of(b, j), of(c, k), of(d, l), of(e, m), of(f, n), of(g, o), of(h, p)])
    }
}

macro_rules! operator {
    ($name:ident, $method:ident, $plain:tt) => {
        impl<S: Scalar> $name for Portable<S> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                self.both(other, |a, b| a $plain b)
            }
        }
    };
}
operator!(Add, add, +);
operator!(Sub, sub, -);
operator!(Mul, mul, *);
operator!(Div, div, /);

impl<S: Scalar> Real for Portable<S> {
    type Scalar = S;
    type Vector = Vec3Wide<Self>;

    #[inline(always)]
    fn splat(x: S) -> Self {
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

impl<S: Scalar> Simd for Portable<S> {
    #[inline(always)]
    fn load(from: &[S; LANES]) -> Self {
        Self(*from)
    }

    #[inline(always)]
    fn store(self, to: &mut [S; LANES]) {
        *to = self.0;
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(self.0.map(S::sqrt))
    }

    #[inline(always)]
    fn gt_mask(self, other: Self) -> u32 {
        (0..LANES).map(|lane| u32::from(self.0[lane] > other.0[lane]) << lane).sum()
    }

    #[inline(always)]
    fn sum(self) -> S {
        let Self([a, b, c, d, e, f, g, h]) = self;
        ((a + e) + (c + g)) + ((b + f) + (d + h))
    }

    #[inline(always)]
    fn mask_first(self, count: usize) -> Self {
        let mut out = self.0;
        out.iter_mut().skip(count).for_each(|lane| *lane = S::zero());
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
    unsafe fn gather(base: *const Row<S>, at: &[u16; LANES]) -> [Self; 4] {
        let mut columns = [[S::zero(); LANES]; 4];
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
    unsafe fn scatter(base: *mut Row<S>, at: &[u16; LANES], count: usize, columns: [Self; 4]) {
        for (lane, at) in at.iter().enumerate().take(count) {
            let row = columns.map(|column| column.0[lane]);
            // SAFETY: as the caller promises.
            unsafe { *base.add(usize::from(*at)) = row };
        }
    }
}

impl Lanes for f32 {
    #[cfg(target_arch = "x86_64")]
    type Avx2 = avx2::Avx;

    #[inline(always)]
    fn choose<T: PerScalar>(single: T::Of<f32>, _: T::Of<f64>) -> T::Of<f32> {
        single
    }

    #[inline(always)]
    fn floor_to_u32(self) -> u32 {
        self as u32
    }
}

impl Lanes for f64 {
    #[cfg(target_arch = "x86_64")]
    type Avx2 = avx2::AvxPair;

    #[inline(always)]
    fn choose<T: PerScalar>(_: T::Of<f32>, double: T::Of<f64>) -> T::Of<f64> {
        double
    }

    #[inline(always)]
    fn floor_to_u32(self) -> u32 {
        self as u32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Puts the bits of all operations on eight lanes of rows behind each other.
    struct All<'a, S> {
        rows: &'a [Row<S>],
        at: [u16; LANES],
        count: usize,
        out: &'a mut Vec<u8>,
    }

    impl<S: Scalar> Kernel<S> for All<'_, S> {
        #[inline(always)]
        fn run<L: Simd<Scalar = S>>(self) {
            // SAFETY: `at` are places of rows, which nobody writes.
            let [a, b, c, d] = unsafe { L::gather(self.rows.as_ptr(), &self.at) };
            let mut lanes = [S::zero(); LANES];
            for lanes_of in [
                a + b,
                a - b,
                a * b,
                a / b,
                a.max(b),
                a.select_gt(b, c, d),
                (a * a).sqrt(),
                a.mask_first(self.count),
                L::splat(a.sum()),
                L::constant(0.1),
            ] {
                lanes_of.store(&mut lanes);
                L::load(&lanes).store(&mut lanes);
                self.out.extend(bytemuck::bytes_of(&lanes));
            }
            let bits = a.gt_mask(b);
            let mut set = [0; LANES];
            L::compress(bits, 7, &mut set);
            self.out.extend(bits.to_le_bytes());
            self.out.extend(bytemuck::cast_slice(&set[..bits.count_ones() as usize]));
            let mut written = self.rows.to_vec();
            // SAFETY: as above, and the rows are this function's own.
            unsafe { L::scatter(written.as_mut_ptr(), &self.at, self.count, [d, c, b, a]) };
            self.out.extend(bytemuck::cast_slice::<_, u8>(&written));
        }
    }

    /// Every level gives the bits of plain Rust.
    fn levels_agree<S: Scalar>() {
        let mut random = fastrand::Rng::with_seed(3);
        let special = [0.0, -0.0, 1.0, -1.0, 1e30, -1e-30, f64::INFINITY];
        for round in 0..2_000 {
            let mut number = || match random.usize(..24) {
                i if i < special.len() => S::from_f64(special[i]),
                _ => S::from_f64((random.f64() - 0.5) * 10_f64.powi(random.i32(-6..7))),
            };
            let rows: Vec<Row<S>> = (0..20).map(|_| [(); 4].map(|()| number())).collect();
            let mut places: Vec<u16> = (0..20).collect();
            random.shuffle(&mut places);
            let at = std::array::from_fn(|lane| places[lane]);
            let bits_by = |level: SimdLevel| {
                let mut out = Vec::new();
                level.run(All { rows: &rows, at, count: round % (LANES + 1), out: &mut out });
                out
            };
            for level in SimdLevel::available() {
                assert!(bits_by(level) == bits_by(SimdLevel::PORTABLE), "{level:?}: {rows:?}");
            }
        }
    }

    #[test]
    fn instructions_change_no_bit() {
        levels_agree::<f32>();
        levels_agree::<f64>();
    }
}
