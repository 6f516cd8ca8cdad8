//! Validation of scenes: numbers must suit a world of any scalar.

use cgmath::InnerSpace;

use super::{
    Build, ForceFieldDesc, GravityKeyframe, KinematicMotion, Lattice, MarbleDesc, MaterialDesc,
    RotationDesc, Scene, SensorPlane, ShapeDesc, Structure, WallDesc,
};
use crate::Error;
use crate::error::{finite, positive, within};
use crate::math::Vec3;

/// Numbers must be representable in `f32`, since a scene becomes a world of any scalar.
const LARGEST: f64 = f32::MAX as f64;
const LEAST: f64 = f32::MIN_POSITIVE as f64;

fn number(field: &'static str, value: f64) -> Result<f64, Error> {
    within(field, finite(field, value)?, -LARGEST, LARGEST)
}

fn above_zero(field: &'static str, value: f64) -> Result<f64, Error> {
    within(field, positive(field, value)?, LEAST, LARGEST)
}

fn not_negative(field: &'static str, value: f64) -> Result<f64, Error> {
    within(field, value, 0.0, LARGEST)
}

fn vector(fields: [&'static str; 3], v: [f64; 3]) -> Result<Vec3<f64>, Error> {
    fields.into_iter().zip(v).try_for_each(|(field, x)| number(field, x).map(|_| ()))?;
    Ok(Vec3::from(v))
}

fn direction(field: &'static str, fields: [&'static str; 3], v: [f64; 3]) -> Result<(), Error> {
    if v == [0.0; 3] {
        return Err(Error::NotUnit { field, value: 0.0 });
    }
    // No component overflows or loses digits in any rotation.
    let length = vector(fields, v)?.magnitude();
    within(field, length, LEAST / f64::from(f32::EPSILON), LARGEST / 2.0).map(|_| ())
}

fn gravity(v: [f64; 3]) -> Result<(), Error> {
    let gravity = vector(["gravity.x", "gravity.y", "gravity.z"], v)?;
    number("the length of gravity", gravity.magnitude()).map(|_| ())
}

impl Scene {
    /// Maximum number of marbles of a scene: with their contacts they take up to a kilobyte each,
    /// so a gigabyte together.
    pub const MAX_MARBLES: u32 = 1_000_000;

    /// Checks that all numbers suit any world, now and later.
    ///
    /// Limits of single properties, such as a restitution of at most one, are checked when the
    /// world is built.
    pub(super) fn check(&self) -> Result<(), Error> {
        above_zero("duration", self.duration)?;
        gravity(self.gravity)?;
        let mut before = 0.0;
        for GravityKeyframe { time, gravity: tilted } in &self.gravity_keyframes {
            before = within("gravity_keyframes.time", *time, before, LARGEST)?;
            gravity(*tilted)?;
        }
        self.force_fields.iter().try_for_each(|field| field.check())?;
        self.material.check()?;
        self.walls.iter().try_for_each(WallDesc::check)?;
        self.structures.iter().try_for_each(Structure::check)?;
        for SensorPlane { normal, point } in &self.sensor_planes {
            direction("normal", ["normal.x", "normal.y", "normal.z"], *normal)?;
            vector(["point.x", "point.y", "point.z"], *point)?;
        }
        self.marbles.iter().try_for_each(MarbleDesc::check)?;
        self.lattices.iter().try_for_each(Lattice::check)?;
        let counts = self.lattices.iter().map(|lattice| lattice.count.map(f64::from));
        let marbles = counts.fold(self.marbles.len() as f64, |sum, [x, y, z]| sum + x * y * z);
        within("lattices.count", marbles, 0.0, f64::from(Self::MAX_MARBLES)).map(|_| ())
    }
}

impl ForceFieldDesc {
    fn check(self) -> Result<(), Error> {
        match self {
            Self::Drag { velocity, linear, quadratic } => {
                vector(["velocity.x", "velocity.y", "velocity.z"], velocity)?;
                not_negative("linear", linear)?;
                not_negative("quadratic", quadratic)?;
            }
            Self::Spring { anchor, rest_length, stiffness } => {
                vector(["anchor.x", "anchor.y", "anchor.z"], anchor)?;
                not_negative("rest_length", rest_length)?;
                not_negative("stiffness", stiffness)?;
            }
            Self::Attraction { center, strength } => {
                vector(["center.x", "center.y", "center.z"], center)?;
                number("strength", strength)?;
            }
        }
        Ok(())
    }
}

impl MaterialDesc {
    fn check(&self) -> Result<(), Error> {
        within("restitution", self.restitution, 0.0, 1.0)?;
        not_negative("friction", self.friction)?;
        within("tangential_restitution", self.tangential_restitution, -1.0, 1.0)?;
        not_negative("rolling_resistance", self.rolling_resistance)?;
        not_negative("spinning_resistance", self.spinning_resistance)?;
        above_zero("youngs_modulus", self.youngs_modulus)?;
        within("poissons_ratio", self.poissons_ratio, 0.0, 0.5).map(|_| ())
    }
}

impl WallDesc {
    fn check(&self) -> Result<(), Error> {
        self.material.iter().try_for_each(MaterialDesc::check)?;
        stays_somewhere(self.shape.check()?, self.motion)
    }
}

impl Structure {
    fn check(&self) -> Result<(), Error> {
        self.material.iter().try_for_each(MaterialDesc::check)?;
        stays_somewhere(self.shape.check()?, self.motion)
    }
}

/// Checks that a wall stays representable along its whole motion, at half of the number range
/// because it rotates about a pivot.
fn stays_somewhere(far: f64, motion: Option<KinematicMotion>) -> Result<(), Error> {
    let far = far + motion.map_or(Ok(0.0), KinematicMotion::check)?;
    within("the reach of a wall", far, 0.0, LARGEST / 2.0).map(|_| ())
}

impl Build {
    /// Largest distance from the origin, in metres.
    fn check(&self) -> Result<f64, Error> {
        match self {
            Self::Mesh { points, .. } => points.iter().try_fold(0.0, |far: f64, point| {
                let point = vector(["points.x", "points.y", "points.z"], *point)?;
                Ok(far.max(point.magnitude()))
            }),
            Self::HeightField { corner, cell, columns, heights } => {
                let corner = vector(["corner.x", "corner.y", "corner.z"], *corner)?;
                let [x, z] = *cell;
                let wide = above_zero("cell", x)? + above_zero("cell", z)?;
                let rows = heights.len() as f64 / f64::from((*columns).max(1));
                let high = heights.iter().try_fold(0.0, |high: f64, height| {
                    Ok(high.max(number("heights", *height)?.abs()))
                })?;
                Ok(corner.magnitude() + wide * (f64::from(*columns) + rows) + high)
            }
            Self::Compound { parts } => {
                parts.iter().try_fold(0.0, |far: f64, part| Ok(far.max(part.check()?)))
            }
        }
    }
}

impl RotationDesc {
    fn check(self) -> Result<(), Error> {
        direction("axis", ["axis.x", "axis.y", "axis.z"], self.axis)?;
        number("degrees", self.degrees).map(|_| ())
    }
}

impl ShapeDesc {
    /// Largest distance from the origin, in metres; for a half-space, that of its given point.
    fn check(self) -> Result<f64, Error> {
        const CENTER: [&str; 3] = ["center.x", "center.y", "center.z"];
        Ok(match self {
            Self::HalfSpace { normal, point } => {
                direction("normal", ["normal.x", "normal.y", "normal.z"], normal)?;
                vector(["point.x", "point.y", "point.z"], point)?.magnitude()
            }
            Self::Box { center, size, rotation } => {
                for (field, side) in ["size.x", "size.y", "size.z"].into_iter().zip(size) {
                    above_zero(field, side)?;
                }
                rotation.check()?;
                vector(CENTER, center)?.magnitude() + Vec3::from(size).magnitude()
            }
            Self::Ball { center, radius } => {
                vector(CENTER, center)?.magnitude() + above_zero("radius", radius)?
            }
            Self::Capsule { from, to, radius } => {
                let from = vector(["from.x", "from.y", "from.z"], from)?.magnitude();
                let to = vector(["to.x", "to.y", "to.z"], to)?.magnitude();
                from + to + above_zero("radius", radius)?
            }
        })
    }
}

impl KinematicMotion {
    /// Largest displacement of a wall, in metres.
    fn check(self) -> Result<f64, Error> {
        const PIVOT: [&str; 3] = ["pivot.x", "pivot.y", "pivot.z"];
        const AXIS: [&str; 3] = ["axis.x", "axis.y", "axis.z"];
        Ok(match self {
            Self::Conveyor { velocity } => {
                vector(["velocity.x", "velocity.y", "velocity.z"], velocity)?;
                0.0
            }
            Self::Rotate { pivot, axis, degrees_per_second } => {
                direction("axis", AXIS, axis)?;
                number("degrees_per_second", degrees_per_second)?;
                2.0 * vector(PIVOT, pivot)?.magnitude()
            }
            Self::Oscillate { amplitude, pivot, axis, degrees, period } => {
                direction("axis", AXIS, axis)?;
                let amplitude =
                    vector(["amplitude.x", "amplitude.y", "amplitude.z"], amplitude)?.magnitude();
                let often = std::f64::consts::TAU / above_zero("period", period)?;
                number("amplitude / period", amplitude * often)?;
                number("degrees / period", number("degrees", degrees)?.to_radians() * often)?;
                amplitude + 2.0 * vector(PIVOT, pivot)?.magnitude()
            }
        })
    }
}

impl MarbleDesc {
    fn check(&self) -> Result<(), Error> {
        vector(["position.x", "position.y", "position.z"], self.position)?;
        above_zero("radius", self.radius)?;
        vector(["velocity.x", "velocity.y", "velocity.z"], self.velocity)?;
        vector(
            ["angular_velocity.x", "angular_velocity.y", "angular_velocity.z"],
            self.angular_velocity,
        )?;
        above_zero("density", self.density)?;
        not_negative("half_length", self.half_length)?;
        self.rotation.check()?;
        self.material.iter().try_for_each(MaterialDesc::check)
    }
}

impl Lattice {
    fn check(&self) -> Result<(), Error> {
        self.first.check()?;
        within("jitter", self.jitter, 0.0, 1.0)?;
        vector(["pitch.x", "pitch.y", "pitch.z"], self.pitch)?;
        for ((field, pitch), (first, count)) in ["pitch.x", "pitch.y", "pitch.z"]
            .into_iter()
            .zip(self.pitch)
            .zip(self.first.position.into_iter().zip(self.count))
        {
            let most = (LARGEST - first.abs()) / f64::from(count.max(1));
            within(field, pitch, -most, most)?;
        }
        Ok(())
    }
}
