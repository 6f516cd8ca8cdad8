use cgmath::{InnerSpace, Zero};

use crate::contact::ContactMaterial;
use crate::math::{RealVector, Scalar, Vec3};
use crate::motion::BALL_INVERSE_INERTIA;

/// Inverse effective mass of a contact: change of the relative velocity of its two points per
/// impulse, in 1/kg (the diagonal of `K` in constraint solvers).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InverseEffectiveMass<S> {
    /// Component along the normal.
    pub normal: S,
    /// Component along the tangents.
    pub tangent: S,
}

impl<S: Scalar> InverseEffectiveMass<S> {
    /// Inverse effective mass of two balls with these inverse masses (1/kg); zero for a wall.
    ///
    /// The normal passes through the centers, so spin counts only tangentially:
    /// `1/m + r²/I = 7/2 · 1/m` for a solid ball.
    #[must_use]
    pub fn of_balls(inverse_mass_a: S, inverse_mass_b: S, rotation: BallRotation) -> Self {
        Self::of([(inverse_mass_a, rotation), (inverse_mass_b, rotation)])
    }

    /// Sum over two bodies.
    pub(super) fn plus(self, other: Self) -> Self {
        Self { normal: self.normal + other.normal, tangent: self.tangent + other.tangent }
    }

    /// Sum over `count` equal bodies.
    pub(super) fn scaled(self, count: S) -> Self {
        Self { normal: self.normal * count, tangent: self.tangent * count }
    }

    /// Inverse effective mass of two balls whose rotation may be locked one by one.
    pub(super) fn of(balls: [(S, BallRotation); 2]) -> Self {
        let tangent = |(inverse_mass, rotation): (S, BallRotation)| {
            inverse_mass * (S::one() + rotation.inverse_inertia_factor::<S>())
        };
        let [a, b] = balls;
        Self { normal: a.0 + b.0, tangent: tangent(a) + tangent(b) }
    }
}

/// Rotation lock of balls.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BallRotation {
    /// Impulses change the velocity alone.
    Locked,
    /// Impulses also spin the balls: solid, of uniform density.
    Free,
}

impl BallRotation {
    /// Inertia factor `m r² / I`: tangential compliance by spinning over that by translation.
    pub(super) fn inverse_inertia_factor<S: Scalar>(self) -> S {
        match self {
            Self::Locked => S::zero(),
            Self::Free => S::from_f64(BALL_INVERSE_INERTIA),
        }
    }
}

/// Impulse (N s) of a collision on the second body; the first one feels the opposite.
///
/// `relative_velocity` is that of the second's contact point relative to the first's, in m/s;
/// `normal` points from the first to the second. Newton's restitution along the normal; friction is
/// bounded by *all* of the normal impulse, that of the restitution included (Chung and Ooi 2011;
/// Cross, *Grip-slip behavior of a bouncing ball*, 2002). Zero if the points separate.
#[must_use]
pub fn impact<S: Scalar>(
    normal: Vec3<S>,
    relative_velocity: Vec3<S>,
    inverse_effective_mass: InverseEffectiveMass<S>,
    material: ContactMaterial<S>,
) -> Vec3<S> {
    let approach = -relative_velocity.dot(normal);
    if approach <= S::zero() || inverse_effective_mass.normal <= S::zero() {
        return Vec3::zero();
    }
    let normal_impulse =
        (S::one() + material.restitution) * approach / inverse_effective_mass.normal;
    let tangent_velocity = relative_velocity + normal * approach;
    let stopping_impulse = tangent_velocity
        * (-(S::one() + material.tangential_restitution) / inverse_effective_mass.tangent);
    normal * normal_impulse + stopping_impulse.clamp_length(material.friction * normal_impulse)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Bounce of a ball off a wall at rest whose normal is +y: velocity and spin speed (radius
    /// times spin about z) afterwards. The contact point moves by `vx + spin_speed` along x.
    fn bounce<S: Scalar>(
        v: [f64; 2],
        spin_speed: f64,
        material: ContactMaterial<S>,
    ) -> ([f64; 2], f64) {
        let number = S::from_f64;
        let relative_velocity =
            Vec3::new(number(v[0]) + number(spin_speed), number(v[1]), S::zero());
        let inverse_effective_mass =
            InverseEffectiveMass::of_balls(S::zero(), S::one(), BallRotation::Free);
        let j = impact(Vec3::unit_y(), relative_velocity, inverse_effective_mass, material);
        // m = 1; r ω changes by r² j / I = 5/2 j.
        let after = [number(v[0]) + j.x, number(v[1]) + j.y];
        (after.map(Scalar::as_f64), (number(spin_speed) + number(2.5) * j.x).as_f64())
    }

    fn material<S: Scalar>(e: f64, mu: f64, beta: f64) -> ContactMaterial<S> {
        ContactMaterial {
            restitution: S::from_f64(e),
            friction: S::from_f64(mu),
            tangential_restitution: S::from_f64(beta),
            ..ContactMaterial::default()
        }
    }

    /// Chung and Ooi (2011), test 4: a rigid ball at 3.9 m/s, e = 0.98, µ = 0.092, at these angles
    /// from the normal (degrees): tangential restitution of the center, spin for a radius of 2.5 mm
    /// (rad/s), angle of the contact point's rebound.
    #[rustfmt::skip]
    const OBLIQUE: [(f64, f64, f64, f64); 10] = [
        (5.0, 0.71429, -97.116, 0.0), (10.0, 0.71429, -193.494, 0.0),
        (20.0, 0.71429, -381.108, 0.0), (30.0, 0.71429, -557.143, 0.0),
        (40.0, 0.78291, -544.216, 11.621), (50.0, 0.84715, -456.652, 29.488),
        (60.0, 0.89483, -355.212, 48.159), (70.0, 0.93370, -242.979, 65.086),
        (80.0, 0.96788, -123.364, 78.983), (85.0, 0.98406, -61.918, 84.812),
    ];

    #[test]
    fn oblique_impacts_match_the_rigid_solution() {
        for (degrees, e_t, spin, rebound) in OBLIQUE {
            let (sin, cos) = degrees.to_radians().sin_cos();
            let (v, spin_speed) =
                bounce::<f64>([3.9 * sin, -3.9 * cos], 0.0, material(0.98, 0.092, 0.0));
            assert!((v[0] / (3.9 * sin) - e_t).abs() < 6e-6, "{degrees}°: {}", v[0] / (3.9 * sin));
            assert!((v[1] - 0.98 * 3.9 * cos).abs() < 1e-14, "{degrees}°");
            // About z, forward rolling is negative: the table's sign.
            assert!(
                (spin_speed / 2.5e-3 - spin).abs() < 6e-4,
                "{degrees}°: {}",
                spin_speed / 2.5e-3
            );
            let angle = (v[0] + spin_speed).atan2(v[1]).to_degrees();
            assert!((angle - rebound).abs() < 6e-4, "{degrees}°: {angle}");
            // The target for f32: 2e-6 of the speed.
            let (v32, spin32) =
                bounce::<f32>([3.9 * sin, -3.9 * cos], 0.0, material(0.98, 0.092, 0.0));
            let worst =
                (v32[0] - v[0]).abs().max((v32[1] - v[1]).abs()).max((spin32 - spin_speed).abs());
            assert!(worst / 3.9 < 2e-6, "{degrees}° in f32: {worst}");
        }
    }

    #[test]
    fn fast_sliding_follows_chung_and_ooi_tests_5_and_6() {
        // V'st / (µ V'cn) = Vt / (µ Vn) − 7 and r w' / (µ Vn) = −5, for e = 1.
        for vt in [36.0, 40.0, 70.0, 300.0] {
            let (v, spin_speed) = bounce::<f64>([vt, -5.0], 0.0, material(1.0, 0.3, 0.0));
            assert!(((v[0] + spin_speed) / (0.3 * v[1]) - (vt / 1.5 - 7.0)).abs() < 1e-12);
            assert!((spin_speed / 1.5 + 5.0).abs() < 1e-12);
        }
        // With the slip against the approach: −V'st / V'cn = Vst / (e Vcn) − 7/2 µ (1 + 1/e).
        for spin in [4.5, 5.5, 10.0, 22.86] {
            let slip = 0.1 * spin;
            let (v, spin_speed) = bounce::<f64>([0.0, -0.2], slip, material(0.5, 0.4, 0.0));
            let exact = slip / (0.5 * 0.2) - 3.5 * 0.4 * 3.0;
            assert!(((v[0] + spin_speed) / v[1] - exact).abs() < 1e-12, "{spin} rad/s");
        }
    }

    #[test]
    fn a_superball_comes_back_from_under_a_table() {
        // Garwin (1969): floor, table from below, floor; all in 343rds.
        fn check<S: Scalar>(tolerance: f64) {
            let (mut v, mut spin_speed) = (1.0, 0.0);
            for (flip, speed, table_speed) in
                [(1.0, 147.0, -490.0), (-1.0, -217.0, 420.0), (1.0, -333.0, 130.0)]
            {
                // Under the table the ball is seen upside down, so its spin is too.
                let ([x, _], turned) =
                    bounce::<S>([v, -1.0], flip * spin_speed, material(1.0, 1e9, 1.0));
                (v, spin_speed) = (x, flip * turned);
                assert!((v - speed / 343.0).abs() < tolerance, "{v}");
                assert!((spin_speed - table_speed / 343.0).abs() < tolerance, "{spin_speed}");
            }
        }
        check::<f32>(1e-6);
        check::<f64>(1e-15);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(20_000))]

        /// Two free balls, masses over six decades: conservation laws hold.
        #[test]
        fn impacts_conserve_momentum_and_create_no_energy(
            mass_exponents in [-3.0..3.0_f64, -3.0..3.0],
            normal in [-1.0..1.0_f64, -1.0..1.0, 0.1..1.0],
            relative_velocity in [-1.0..1.0_f64, -1.0..1.0, -1.0..1.0],
            e in 0.0..1.0_f64,
            mu in 0.0..2.0_f64,
            beta in -1.0..1.0_f64,
        ) {
            let masses = mass_exponents.map(|x| 10.0_f64.powf(x));
            let normal = Vec3::from(normal).normalize();
            let relative_velocity = Vec3::from(relative_velocity);
            let surface = material::<f32>(e, mu, beta);
            let inverse = masses.map(|m| (1.0 / m) as f32);
            let inverse_effective_mass =
                InverseEffectiveMass::of_balls(inverse[0], inverse[1], BallRotation::Free);
            let cast = |v: Vec3<f64>| v.map(|x| x as f32);
            let j = impact(cast(normal), cast(relative_velocity), inverse_effective_mass, surface)
                .map(f64::from);
            let approach = -relative_velocity.dot(normal);
            if approach < 1e-6 {
                // Separating, or too close to it for f32 to say.
                prop_assert!(approach > -1e-6 || j == Vec3::zero());
                return Ok(());
            }
            // Momentum is conserved by construction: the impulses are j and −j, at one point.
            // Restitution and Coulomb:
            let inverse_mass = 1.0 / masses[0] + 1.0 / masses[1];
            let normal_impulse = j.dot(normal);
            let after = relative_velocity + normal * (normal_impulse * inverse_mass)
                + (j - normal * normal_impulse) * (3.5 * inverse_mass);
            let tolerance = 1e-6 * relative_velocity.magnitude();
            prop_assert!((after.dot(normal) - e * approach).abs() < tolerance);
            let friction = (j - normal * normal_impulse).magnitude();
            prop_assert!(friction <= mu * normal_impulse * (1.0 + 1e-6) + 1e-6 * normal_impulse);
            // Energy of the relative motion of the two points: the loss is j · (before + after) /
            // 2, which must not be a gain.
            let gained = 0.5 * j.dot(relative_velocity + after);
            let energy = 0.5 * relative_velocity.magnitude2() / inverse_mass;
            prop_assert!(gained <= 1e-6 * energy, "{gained} of {energy}");
        }
    }
}
