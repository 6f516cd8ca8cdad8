use cgmath::{InnerSpace, Zero};

use crate::Error;
use crate::error::{finite_point, finite_vector, within};
use crate::math::{Point3, Scalar, Vec3, normalize_and_length};
use crate::motion::Motion;

/// A force field that acts on every marble, and on every ball of the swarm, besides gravity.
#[derive(Clone, Copy, Debug)]
pub enum ForceField<S> {
    /// Drag of a medium at rest or in motion, such as wind.
    Drag(Medium<S>),
    /// A spring from each marble to a fixed point.
    Spring {
        /// Anchor point, in metres.
        anchor: Point3<S>,
        /// Rest length in metres, at least zero.
        rest_length: S,
        /// Spring constant in N/m, at least zero.
        stiffness: S,
    },
    /// Attraction to a point with the inverse square of the distance, without softening, so that it grows
    /// without bound near the point: put a wall around that, as the surface of a planet. The
    /// acceleration is equal for all masses.
    Attraction {
        /// Center, in metres.
        center: Point3<S>,
        /// Gravitational constant times mass, in m³/s². Negative repels.
        strength: S,
    },
    /// User-defined force in newtons, from a marble's motion and its mass in kg.
    ///
    /// A plain function, so that a world stays a plain value; its result must depend on the
    /// arguments only.
    Custom(fn(Motion<S>, S) -> Vec3<S>),
}

/// A resisting medium.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Medium<S> {
    /// Velocity of the medium, in m/s.
    pub velocity: Vec3<S>,
    /// Force per relative speed, in N s/m, at least zero (Stokes).
    pub linear: S,
    /// Force per square of relative speed, in N s²/m², at least zero (Newton).
    pub quadratic: S,
}

impl<S: Scalar> PartialEq for ForceField<S> {
    /// Two custom forces are equal if they are the same function.
    fn eq(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Drag(a), Self::Drag(b)) => a == b,
            (
                Self::Spring { anchor: a, rest_length: l, stiffness: k },
                Self::Spring { anchor: b, rest_length: m, stiffness: n },
            ) => a == b && l == m && k == n,
            (
                Self::Attraction { center: a, strength: s },
                Self::Attraction { center: b, strength: t },
            ) => a == b && s == t,
            (Self::Custom(f), Self::Custom(g)) => std::ptr::fn_addr_eq(*f, *g),
            _ => false,
        }
    }
}

impl<S: Scalar> Medium<S> {
    /// Medium of a velocity in m/s, as an array or as a vector of any library that makes one of it, with
    /// its [linear](Self::linear) and [quadratic](Self::quadratic) drag.
    #[must_use]
    pub fn new(velocity: impl Into<[S; 3]>, linear: S, quadratic: S) -> Self {
        Self { velocity: velocity.into().into(), linear, quadratic }
    }
}

impl<S: Scalar> ForceField<S> {
    /// [`Spring`](Self::Spring) to an anchor in metres, of a rest length in metres and a spring constant in
    /// N/m.
    #[must_use]
    pub fn spring(anchor: impl Into<[S; 3]>, rest_length: S, stiffness: S) -> Self {
        Self::Spring { anchor: anchor.into().into(), rest_length, stiffness }
    }

    /// [`Attraction`](Self::Attraction) to a center in metres, with a strength in m³/s².
    #[must_use]
    pub fn attraction(center: impl Into<[S; 3]>, strength: S) -> Self {
        Self::Attraction { center: center.into().into(), strength }
    }

    /// Validates the numbers.
    pub(crate) fn validated(self) -> Result<Self, Error> {
        let not_negative = |field, value| within(field, value, S::zero(), S::max_value());
        match self {
            Self::Drag(medium) => {
                let fields = ["medium.velocity.x", "medium.velocity.y", "medium.velocity.z"];
                finite_vector(fields, medium.velocity)?;
                not_negative("medium.linear", medium.linear)?;
                not_negative("medium.quadratic", medium.quadratic)?;
            }
            Self::Spring { anchor, rest_length, stiffness } => {
                finite_point(["anchor.x", "anchor.y", "anchor.z"], anchor)?;
                not_negative("rest_length", rest_length)?;
                not_negative("stiffness", stiffness)?;
            }
            Self::Attraction { center, strength } => {
                finite_point(["center.x", "center.y", "center.z"], center)?;
                within("strength", strength, S::min_value(), S::max_value())?;
            }
            Self::Custom(_) => {}
        }
        Ok(self)
    }

    /// Acceleration of a body of this mass (kg), in m/s².
    #[must_use]
    pub fn acceleration(&self, motion: Motion<S>, mass: S) -> Vec3<S> {
        match *self {
            Self::Drag(medium) => {
                (medium.velocity - motion.velocity) * medium.drag_rate(motion, mass)
            }
            Self::Spring { anchor, rest_length, stiffness } => {
                normalize_and_length(anchor - motion.position)
                    .map_or_else(Vec3::zero, |(toward, length)| {
                        toward * (stiffness * (length - rest_length) / mass)
                    })
            }
            Self::Attraction { center, strength } => normalize_and_length(center - motion.position)
                .map_or_else(Vec3::zero, |(toward, length)| {
                    toward * (strength / (length * length))
                }),
            Self::Custom(force) => force(motion, mass) / mass,
        }
    }
}

impl<S: Scalar> Medium<S> {
    /// Part of the relative velocity that drag takes per second.
    fn drag_rate(&self, motion: Motion<S>, mass: S) -> S {
        let speed = (self.velocity - motion.velocity).magnitude();
        (self.linear + self.quadratic * speed) / mass
    }
}

/// Acceleration of a body of this mass (kg) by several fields in a step of `dt` seconds, in m/s².
/// Drag takes no more in it than all of a velocity: an explicit step of a stiffer one would turn the
/// body back, faster than it came.
pub(crate) fn acceleration_in_step<S: Scalar>(
    fields: &[ForceField<S>],
    motion: Motion<S>,
    mass: S,
    dt: S,
) -> Vec3<S> {
    let drags = fields.iter().filter(|field| matches!(field, ForceField::Drag(_))).count();
    let most = S::one() / (dt * S::from_f64(drags as f64));
    fields.iter().fold(Vec3::zero(), |sum, field| {
        sum + match field {
            ForceField::Drag(medium) => {
                (medium.velocity - motion.velocity) * medium.drag_rate(motion, mass).min(most)
            }
            other => other.acceleration(motion, mass),
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    /// Something of 2 kg under `forces` alone, after `seconds` in steps of about a
    /// millisecond by RK4.
    fn moved(
        forces: &[ForceField<f64>],
        position: Point3<f64>,
        velocity: Vec3<f64>,
        seconds: f64,
    ) -> Motion<f64> {
        let steps = (seconds * 1000.0).ceil();
        let acceleration =
            |motion| forces.iter().map(|force| force.acceleration(motion, 2.0)).sum::<Vec3<f64>>();
        (0..steps as u32).fold(Motion { position, velocity }, |motion, _| {
            motion.rk4(seconds / steps, acceleration)
        })
    }

    const ORIGIN: Point3<f64> = Point3::new(0.0, 0.0, 0.0);

    #[test]
    fn constructors_take_vectors_of_any_library_that_makes_arrays_of_them() {
        let (center, numbers) = (Point3::new(1.0, 2.0, 3.0), [1.0, 2.0, 3.0]);
        assert_eq!(
            [ForceField::attraction(center, 4.0), ForceField::spring(numbers, 5.0, 6.0)],
            [
                ForceField::Attraction { center, strength: 4.0 },
                ForceField::Spring { anchor: center, rest_length: 5.0, stiffness: 6.0 }
            ]
        );
        let velocity = Vec3::from(numbers);
        let expected = Medium { velocity, linear: 7.0, quadratic: 8.0 };
        assert_eq!(Medium::new(velocity, 7.0, 8.0), expected);
    }

    #[test]
    fn linear_drag_decays_exponentially_toward_the_wind() {
        let wind = Vec3::new(3.0, 0.0, 0.0);
        let medium = Medium { velocity: wind, linear: 0.5, quadratic: 0.0 };
        let end = moved(&[ForceField::Drag(medium)], ORIGIN, Vec3::new(0.0, 4.0, 0.0), 2.0);
        let left = (-0.5_f64 / 2.0 * 2.0).exp();
        let exact = Vec3::new(3.0 * (1.0 - left), 4.0 * left, 0.0);
        assert!((end.velocity - exact).magnitude() < 1e-12, "{:?}", end.velocity);
    }

    #[test]
    fn quadratic_drag_decays_as_one_over_time() {
        let medium = Medium { velocity: Vec3::zero(), linear: 0.0, quadratic: 0.5 };
        let end = moved(&[ForceField::Drag(medium)], ORIGIN, Vec3::new(0.0, 4.0, 0.0), 2.0);
        let exact = 4.0 / (1.0 + 0.5 / 2.0 * 4.0 * 2.0);
        assert!((end.velocity.y - exact).abs() < 1e-11, "{:?}", end.velocity);
    }

    #[test]
    fn a_spring_swings_with_its_period() {
        let spring = ForceField::Spring { anchor: ORIGIN, rest_length: 1.0, stiffness: 8.0 };
        let start = Point3::new(1.5, 0.0, 0.0);
        let end = moved(&[spring], start, Vec3::zero(), 1.0);
        assert!((end.position.x - (1.0 + 0.5 * 2.0_f64.cos())).abs() < 1e-12, "{:?}", end.position);
        assert_eq!(moved(&[spring], ORIGIN, Vec3::zero(), 0.1).position, ORIGIN);
    }

    #[test]
    fn a_planet_comes_round_again() {
        let sun = ForceField::Attraction { center: ORIGIN, strength: 4.0 };
        let period = std::f64::consts::TAU * (8.0_f64 / 4.0).sqrt(); // sqrt(r³ / strength)
        let start = Point3::new(2.0, 0.0, 0.0);
        let end = moved(&[sun], start, Vec3::new(0.0, 0.0, 2.0_f64.sqrt()), period);
        assert!((end.position - start).magnitude() < 1e-10, "{:?}", end.position);
    }

    #[test]
    fn forces_add_up_and_a_custom_one_is_a_function() {
        let push = ForceField::Custom(|_, mass| Vec3::new(0.0, mass * 3.0, 0.0));
        let end = moved(&[push, push], ORIGIN, Vec3::zero(), 1.0);
        assert!((end.position.y - 3.0).abs() < 1e-12, "{:?}", end.position);
        assert_eq!(push, push);
        assert_ne!(push, ForceField::Custom(|_, mass| Vec3::new(mass, 0.0, 0.0)));
    }
}
