#![allow(dead_code, reason = "not every test needs all of it")]
//! Random numbers that are the same on every machine.

/// Numbers in [0, 1) that depend on nothing but how many were drawn.
pub struct Draw(pub u64);

impl Draw {
    pub fn next(&mut self) -> f64 {
        // Steele, Lea and Flood 2014.
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.next()
    }
}
