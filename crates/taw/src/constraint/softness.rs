//! Soft contacts: springs and dampers in place of rigid constraints.

use crate::math::{Real, Scalar};

/// Softness of a contact in one step of the solver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Softness<R> {
    /// Fraction of the rigid contact's impulse that is applied.
    pub mass_scale: R,
    /// Fraction of the accumulated impulse that is given back.
    pub impulse_scale: R,
}

impl<R: Real> Softness<R> {
    /// Change of the normal impulse, from that of a rigid contact and the accumulated one.
    #[inline(always)]
    pub fn apply(&self, rigid: R, accumulated: R) -> R {
        self.mass_scale * rigid - accumulated * self.impulse_scale
    }
}

/// Stiffness and damping of contacts over a substep.
///
/// Contacts that overlap are pushed apart a little, which the relax pass takes back, though not the
/// load that they have learned to bear. What they give back is what damps them: impulses that are
/// applied again and corrected once a substep swing for a long time, and a push that removes overlap
/// meanwhile makes them swing more (Catto, `Solver2D`, 2024).
#[derive(Clone, Copy, Debug)]
pub(crate) struct ContactSoftness<S> {
    /// Fraction of an overlap that is removed per second.
    pub bias_rate: S,
    /// Largest speed of that, in m/s.
    pub max_push_speed: S,
    /// [`Softness`] of an overlap.
    pub mass_scale: S,
    pub impulse_scale: S,
}

impl<S: Scalar> ContactSoftness<S> {
    /// Spring of this frequency, in Hz, or the stiffest that a substep of `h` seconds allows, with a
    /// damping ratio (Catto, `Solver2D`, 2024); implicit Euler over the substep.
    pub fn new(h: S, [hertz, damping_ratio]: [f64; 2], max_push_speed: S) -> Self {
        let stiffest = S::from_f64(0.25) / h;
        let omega = S::from_f64(2.0 * std::f64::consts::PI) * S::from_f64(hertz).min(stiffest);
        let a1 = S::from_f64(2.0 * damping_ratio) + h * omega;
        let a2 = h * omega * a1;
        let a3 = S::one() / (S::one() + a2);
        Self { bias_rate: omega / a1, max_push_speed, mass_scale: a2 * a3, impulse_scale: a3 }
    }

    /// Target velocity along the normal, in m/s, and softness at a separation in metres. An overlap
    /// is soft; a gap is rigid, and may close within the substep (speculative contact).
    #[inline(always)]
    pub fn at<R: Real<Scalar = S>>(&self, separation: R, per_second: R) -> (R, Softness<R>) {
        let (zero, one) = (R::constant(0.0), R::constant(1.0));
        let push =
            (separation * R::splat(self.bias_rate)).max(zero - R::splat(self.max_push_speed));
        let bias = separation.select_gt(zero, separation * per_second, push);
        let softness = Softness {
            mass_scale: separation.select_gt(zero, one, R::splat(self.mass_scale)),
            impulse_scale: separation.select_gt(zero, zero, R::splat(self.impulse_scale)),
        };
        (zero - bias, softness)
    }
}
