//! Nature knows neither left nor right, and no compass.

use taw::prelude::*;
use taw::scene::{Build, KinematicMotion, MarbleDesc, RotationDesc, Scene, ShapeDesc};

use super::case::Case;
use super::judge::{Finding, Invariant};
use super::observe::Snapshot;
use super::run::advance;

/// A scene that should go like another one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Symmetry {
    /// With x and −x exchanged.
    Mirror,
    /// By a quarter about y, from x to −z and from z to x.
    Turn,
}

/// Number of compared steps, and of those with contacts: chaos multiplies a difference in each
/// bounce, and does not make a part in a million of the last bits of `f64` in that number.
const STEPS: u32 = 200;
const TOUCHED: u32 = 10;
/// Differences below this fraction of the distances in the scene are rounding.
const ALIKE: f64 = 1e-6;
/// With more bodies than this, the order of contacts that are equally deep decides, which is a
/// matter of the last bit.
const MOST: usize = 2;

impl Symmetry {
    /// Invariant of the symmetry.
    #[must_use]
    pub fn invariant(self) -> Invariant {
        match self {
            Self::Mirror => Invariant::Mirror,
            Self::Turn => Invariant::Turn,
        }
    }

    /// A place or velocity.
    #[must_use]
    pub fn of(self, [x, y, z]: [f64; 3]) -> [f64; 3] {
        match self {
            Self::Mirror => [-x, y, z],
            Self::Turn => [z, y, -x],
        }
    }

    /// A spin or the axis of a turn.
    fn axial(self, [x, y, z]: [f64; 3]) -> [f64; 3] {
        match self {
            Self::Mirror => [x, -y, -z],
            Self::Turn => [z, y, -x],
        }
    }

    fn turn(self, rotation: RotationDesc) -> RotationDesc {
        RotationDesc { axis: self.axial(rotation.axis), ..rotation }
    }

    /// A box is turned with all of its sides, so a turned one has the sides of the other's.
    fn form(self, form: ShapeDesc) -> ShapeDesc {
        match form {
            ShapeDesc::HalfSpace { normal, point } => {
                ShapeDesc::HalfSpace { normal: self.of(normal), point: self.of(point) }
            }
            ShapeDesc::Box { center, size, rotation } => {
                let upright = rotation.degrees == 0.0;
                let size = match self {
                    Self::Turn if upright => [size[2], size[1], size[0]],
                    _ => size,
                };
                ShapeDesc::Box { center: self.of(center), size, rotation: self.turn(rotation) }
            }
            ShapeDesc::Ball { center, radius } => {
                ShapeDesc::Ball { center: self.of(center), radius }
            }
            ShapeDesc::Capsule { from, to, radius } => {
                ShapeDesc::Capsule { from: self.of(from), to: self.of(to), radius }
            }
        }
    }

    fn movement(self, movement: KinematicMotion) -> KinematicMotion {
        match movement {
            KinematicMotion::Conveyor { velocity } => {
                KinematicMotion::Conveyor { velocity: self.of(velocity) }
            }
            KinematicMotion::Rotate { pivot, axis, degrees_per_second } => {
                KinematicMotion::Rotate {
                    pivot: self.of(pivot),
                    axis: self.axial(axis),
                    degrees_per_second,
                }
            }
            KinematicMotion::Oscillate { amplitude, pivot, axis, degrees, period } => {
                KinematicMotion::Oscillate {
                    amplitude: self.of(amplitude),
                    pivot: self.of(pivot),
                    axis: self.axial(axis),
                    degrees,
                    period,
                }
            }
        }
    }

    fn ball(self, ball: MarbleDesc) -> MarbleDesc {
        MarbleDesc {
            position: self.of(ball.position),
            velocity: self.of(ball.velocity),
            angular_velocity: self.axial(ball.angular_velocity),
            rotation: self.turn(ball.rotation),
            ..ball
        }
    }

    /// The scene, as it is seen in the mirror or after a turn. None if it has what cannot be
    /// turned exactly: a height field, whose cells have a diagonal; boxes that are turned, and
    /// capsules, whose own axes stay.
    #[must_use]
    pub fn scene(self, scene: &Scene) -> Option<Scene> {
        let mut other = scene.clone();
        other.gravity = self.of(scene.gravity);
        for wall in &mut other.walls {
            let slanted =
                matches!(wall.shape, ShapeDesc::Box { rotation, .. } if rotation.degrees != 0.0);
            if self == Self::Turn && slanted {
                return None;
            }
            wall.shape = self.form(wall.shape);
            wall.motion = wall.motion.map(|motion| self.movement(motion));
        }
        for structure in &mut other.structures {
            structure.motion = structure.motion.map(|motion| self.movement(motion));
            match &mut structure.shape {
                Build::Mesh { points, .. } => {
                    for point in points {
                        *point = self.of(*point);
                    }
                }
                Build::Compound { parts } => {
                    for part in parts {
                        *part = self.form(*part);
                    }
                }
                Build::HeightField { .. } => return None,
            }
        }
        if self == Self::Turn && scene.all_marbles().any(|ball| ball.half_length > 0.0) {
            return None;
        }
        other.marbles = scene.all_marbles().map(|ball| self.ball(ball)).collect();
        other.lattices.clear();
        Some(other)
    }
}

/// Compares a case with its image, for the first steps, if that can tell anything.
#[must_use]
pub fn compare(case: &Case, symmetry: Symmetry) -> Option<Finding> {
    if case.swarm.is_some() || case.differenced || case.bodies() > MOST || is_singular(case) {
        return None;
    }
    let image = Case { scene: symmetry.scene(&case.scene)?, ..case.clone() };
    let (mut one, mut other) = (case.begin::<f64>().ok()?, image.begin::<f64>().ok()?);
    let mut worst =
        Finding { invariant: symmetry.invariant(), value: 0.0, bound: ALIKE, body: None };
    let mut touched = 0;
    for _ in 0..STEPS.min(case.steps) {
        advance(case, &mut one).ok()?;
        advance(&image, &mut other).ok()?;
        let (a, b) = (Snapshot::of(&one.world), Snapshot::of(&other.world));
        touched += touches(&a);
        for (i, (a, b)) in a.bodies.iter().zip(&b.bodies).enumerate() {
            let apart = (Vec3::from(symmetry.of(a.at.into())) - b.at).magnitude();
            let scale = a.at.magnitude() + a.velocity.magnitude() * case.step + a.radius;
            let found = Finding { value: apart / scale, body: Some(i), ..worst };
            if found.ratio() > worst.ratio() {
                worst = found;
            }
        }
        if touched >= TOUCHED {
            break;
        }
    }
    Some(worst)
}

/// Number of kinds of things that a body touches at the end of a step: walls, other bodies.
fn touches(at_end: &Snapshot) -> u32 {
    let bodies = &at_end.bodies;
    u32::from(bodies.iter().any(|body| body.wall_gap < 1e-3 * body.radius))
        + u32::from(bodies.len() > 1 && at_end.depth(1, 0) > -1e-3 * bodies[0].radius)
}

/// Returns true for an initial state without a unique direction: bodies at one point, or in walls,
/// or on the edge of something.
fn is_singular(case: &Case) -> bool {
    let balls: Vec<MarbleDesc> = case.scene.all_marbles().collect();
    let apart = |a: &MarbleDesc, b: &MarbleDesc| {
        (Vec3::from(a.position) - Vec3::from(b.position)).magnitude() > a.radius + b.radius
    };
    let pairs = balls.iter().enumerate().all(|(i, a)| balls[..i].iter().all(|b| apart(a, b)));
    !pairs || balls.iter().any(|ball| ball.position[0].abs() < 1e-6 * ball.radius.max(1e-3))
}
