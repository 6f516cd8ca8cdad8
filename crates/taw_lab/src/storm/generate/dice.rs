//! Random numbers that are the same for the same name.

use std::f64::consts::TAU;

use taw::math::Vec3;

use crate::storm::case::Name;

/// A source of random numbers.
pub struct Dice(fastrand::Rng);

impl Dice {
    /// Those of a scene, whatever other scenes there are.
    pub fn of(Name { kind, seed, number }: Name) -> Self {
        // FNV-1a: any mixing will do that does not depend on the standard library's version.
        let bytes = kind.name().bytes().chain(seed.to_le_bytes()).chain(number.to_le_bytes());
        let hash = bytes.fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
        });
        Self(fastrand::Rng::with_seed(hash))
    }

    /// Evenly between two numbers.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.0.f64()
    }

    /// Each order of magnitude as often as any other.
    pub fn magnitude(&mut self, low: f64, high: f64) -> f64 {
        (self.between(low.ln(), high.ln())).exp()
    }

    /// A whole number below another.
    pub fn below(&mut self, end: usize) -> usize {
        self.0.usize(0..end.max(1))
    }

    /// One of several.
    pub fn pick<T: Copy>(&mut self, of: &[T]) -> T {
        of[self.below(of.len())]
    }

    /// True with this probability.
    pub fn chance(&mut self, part: f64) -> bool {
        self.0.f64() < part
    }

    /// A point of a box.
    pub fn inside(&mut self, low: [f64; 3], high: [f64; 3]) -> [f64; 3] {
        [0, 1, 2].map(|i| self.between(low[i], high[i]))
    }

    /// A unit vector, evenly on the sphere (Archimedes).
    pub fn direction(&mut self) -> Vec3<f64> {
        let (y, angle) = (self.between(-1.0, 1.0), self.between(0.0, TAU));
        let across = (1.0 - y * y).sqrt();
        Vec3::new(across * angle.cos(), y, across * angle.sin())
    }

    /// A unit vector at most this angle, in radians, from the vertical.
    pub fn upward(&mut self, most: f64) -> Vec3<f64> {
        let (lean, angle) = (self.between(0.0, most), self.between(0.0, TAU));
        Vec3::new(lean.sin() * angle.cos(), lean.cos(), lean.sin() * angle.sin())
    }
}
