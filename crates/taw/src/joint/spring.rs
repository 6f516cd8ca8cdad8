//! Springs and dampers as rows: the impulse of a substep, from position and speed at its begin.

use std::f64::consts::TAU;

use crate::math::Scalar;

/// Angle in rad that a spring may go through in a substep, so that it follows its equation; and from which on
/// it is integrated implicitly, in between partly. In a net of springs the fastest motion of all is several times
/// faster, and has to be stable too.
const EXACT: f64 = 0.25;
const IMPLICIT: f64 = 0.5;
/// Largest frequency in Hz, and damping ratio.
const MAX: f64 = 1e9;
/// Smallest loss of speed in a substep, as a fraction: the compliance is its reciprocal.
const LEAST_LOSS: f64 = 1e-9;

/// Spring and damper of a row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SpringRow {
    /// Angular frequency without damping, in rad/s.
    angular_frequency: f64,
    damping_ratio: f64,
}

/// Part of a substep's impulse: the row's impulse `λ` in it and its speed `v` afterwards satisfy
/// `v + compliance · k · λ + bias · x = 0`, with its inverse effective mass `k` and its position error `x`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SpringKick {
    pub compliance: f64,
    /// In 1/s.
    pub bias: f64,
}

/// Impulses of a spring in a substep: one before positions move on, one afterwards.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SpringStep {
    pub kicks: [SpringKick; 2],
    /// Part of the impulse that the first one may have at most.
    pub share: f64,
}

impl SpringKick {
    /// Makes `keeps · v − pulls · x` of the speed.
    fn new(keeps: f64, pulls: f64) -> Self {
        let loss = (1.0 - keeps).max(LEAST_LOSS);
        Self { compliance: (1.0 - loss) / loss, bias: pulls / loss }
    }
}

impl SpringRow {
    pub fn new(frequency: f64, damping_ratio: f64) -> Self {
        // Beyond that a substep is as long as for ever.
        let [frequency, damping_ratio] = [frequency, damping_ratio].map(|x| x.min(MAX));
        Self { angular_frequency: frequency * TAU, damping_ratio }
    }

    /// Impulses of a substep of `h` seconds. Alone on its row, a spring makes `v − b x` of the speed `v` and the
    /// error `x`, and after the motion `a (v − b x)`. Determinant and trace of that map are `a` and
    /// `(1 + a)(1 − b h)`: with those of the damped oscillator, frequency and decay are exact, and what hangs on
    /// the spring at rest has no speed, to second order in `w h` and in its damping. A stiff spring is integrated by an implicit Euler step.
    pub fn step(&self, h: f64) -> SpringStep {
        let (w, damping) = (self.angular_frequency * h, self.damping_ratio);
        let decay = (-damping * w).exp_portable();
        let trace = if damping < 1.0 {
            2.0 * decay * (w * (1.0 - damping * damping).sqrt()).sin_cos_portable().1
        } else {
            let root = w * (damping * damping - 1.0).sqrt();
            (root - damping * w).exp_portable() + (-root - damping * w).exp_portable()
        };
        let keeps = decay * decay;
        let pulls = (1.0 - trace / (1.0 + keeps)) / h;
        let divisor = 1.0 + 2.0 * damping * w + w * w;
        let mix = ((w - EXACT) / (IMPLICIT - EXACT)).clamp(0.0, 1.0);
        let between = |exact: f64, implicit: f64| exact + (implicit - exact) * mix;
        SpringStep {
            kicks: [
                SpringKick::new(between(1.0, 1.0 / divisor), between(pulls, w * w / (h * divisor))),
                SpringKick::new(between(keeps, 1.0), between(keeps * pulls, 0.0)),
            ],
            share: between(0.5, 1.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One substep of a mass of one on a spring, with this acceleration.
    fn step(spring: SpringStep, [x, v]: [f64; 2], h: f64, acceleration: f64) -> [f64; 2] {
        let [first, second] = spring.kicks;
        let kick = |it: SpringKick, x: f64, v: f64| v - (v + it.bias * x) / (1.0 + it.compliance);
        let v = kick(first, x, v + acceleration * h);
        let x = x + h * v - 0.5 * acceleration * h * h;
        [x, kick(second, x, v)]
    }

    #[test]
    fn a_spring_follows_the_damped_oscillator() {
        let h = 1.0 / 240.0;
        for damping in [0.0_f64, 0.1, 0.7, 1.0, 3.0] {
            let spring = SpringRow::new(1.0, damping).step(h);
            let w = TAU * h;
            // Stepped from two starts, the map has these determinant and trace.
            let ([a, c], [b, d]) =
                (step(spring, [1.0, 0.0], h, 0.0), step(spring, [0.0, 1.0], h, 0.0));
            let determinant = (-2.0 * damping * w).exp();
            assert!((a * d - b * c - determinant).abs() < 1e-6, "damping {damping}");
            let root = (damping * damping - 1.0).abs().sqrt() * w;
            let swing = if damping < 1.0 { root.cos() } else { root.cosh() };
            assert!((a + d - 2.0 * determinant.sqrt() * swing).abs() < 1e-6, "damping {damping}");
        }
    }

    #[test]
    fn what_hangs_on_a_spring_is_at_rest_where_statics_says() {
        let h = 1.0 / 240.0;
        for damping in [0.0, 0.3, 1.0] {
            let spring = SpringRow::new(2.0, damping).step(h);
            let sag = 9.81 / (2.0 * TAU).powi(2);
            let [x, v] = step(spring, [sag, 0.0], h, 9.81);
            assert!((x / sag - 1.0).abs() < 2e-3 && v.abs() < 2e-3 * 9.81 * h, "{x} {v}");
        }
    }

    #[test]
    fn a_stiff_spring_only_loses_energy() {
        let h = 1.0 / 60.0;
        for frequency in [2.0, 5.0, 30.0, 1e3, 1e9] {
            let spring = SpringRow::new(frequency, 0.0).step(h);
            let mut state = [1.0, 0.0];
            let mut largest = 0.0_f64;
            for _ in 0..1000 {
                state = step(spring, state, h, 0.0);
                largest = largest.max(state[0].abs());
            }
            assert!(largest <= 1.001, "{frequency} Hz: {largest}");
        }
    }
}
