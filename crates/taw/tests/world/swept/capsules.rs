//! Capsules thrown at thin plates, that rest, move and turn: no part of them gets through.

use fastrand::Rng;
use taw::frame::Pose;
use taw::math::{Quat, Scalar, cast_point, cast_vector};
use taw::motion::integrate_rotation;
use taw::prelude::*;
use taw::shape::{Mesh, Obb};
use taw::world::WallMotion;

const DT: f64 = 1.0 / 60.0;
/// Half extents of a plate 2 cm thick, so wide that nothing gets round it in a second.
const PLATE: Vec3<f64> = Vec3::new(80.0, 0.01, 80.0);
/// All that know capsules.
const RESPONSES: [Response; 4] = [
    Response::Displacement,
    Response::Impulse,
    Response::Penalty(ContactLaw::SpringDashpot),
    Response::Penalty(ContactLaw::HertzMindlin),
];

fn unit(random: &mut Rng) -> Vec3<f64> {
    loop {
        let [x, y, z] = [(); 3].map(|()| 2.0 * random.f64() - 1.0);
        let v = Vec3::new(x, y, z);
        if (0.1..1.0).contains(&v.magnitude()) {
            return v.normalize();
        }
    }
}

/// Number whose logarithm is evenly distributed.
fn log(random: &mut Rng, low: f64, high: f64) -> f64 {
    low * (high / low).powf(random.f64())
}

fn turned(random: &mut Rng) -> Quat<f64> {
    integrate_rotation(Quat::new(1.0, 0.0, 0.0, 0.0), unit(random), 3.0 * random.f64())
}

fn cast<S: Scalar>(rotation: Quat<f64>) -> Quat<S> {
    Quat::from_sv(S::from_f64(rotation.s), cast_vector(rotation.v)).normalize()
}

/// A box, or a mesh of one layer of triangles in its middle.
fn plate<S: Scalar>(hollow: bool, pose: Pose<f64>) -> WallShape<S> {
    if !hollow {
        let center = cast_point(pose.transform_point(Point3::new(0.0, 0.0, 0.0)));
        return Obb::new(center, cast(pose.rotation), cast_vector(PLATE)).unwrap().into();
    }
    let corner = |[i, j]: [u32; 2]| {
        let [x, z] = [i, j].map(|it| f64::from(it) / 2.0 - 1.0);
        cast_point(pose.transform_point(Point3::new(PLATE.x * x, 0.0, PLATE.z * z)))
    };
    let points = (0..25).map(|it| corner([it / 5, it % 5])).collect();
    let cells = (0..20_u32).filter(|it| it % 5 < 4);
    let triangles = cells.flat_map(|it| [[it, it + 1, it + 5], [it + 1, it + 6, it + 5]]).collect();
    Mesh::new(points, triangles).unwrap().into()
}

/// A capsule above a plate, `height` metres, that comes at it.
fn thrown<S: Scalar>(random: &mut Rng, pose: Pose<f64>, height: f64, speed: f64) -> Marble<S> {
    let radius = log(random, 0.05, 0.3);
    let normal = pose.transform_vector(Vec3::unit_y());
    let aside = unit(random).cross(normal) * random.f64();
    let velocity = (aside - normal * (0.3 + 0.7 * random.f64())).normalize() * speed;
    let at = Point3::new(random.f64(), height, random.f64());
    let number = S::from_f64;
    let material = Material {
        friction: number(0.8 * random.f64()),
        restitution: number(random.f64()),
        ..Material::default()
    };
    Marble {
        half_length: number(10.0 * radius * random.f64()),
        rotation: cast(turned(random)),
        velocity: cast_vector(velocity),
        angular_velocity: cast_vector(unit(random) * (30.0 * random.f64())),
        mass: Mass::Density(number(log(random, 100.0, 10_000.0))),
        material: Some(material),
        ..Marble::new(cast_point(pose.transform_point(at)), number(radius))
    }
}

fn world<S: Scalar>(random: &mut Rng, response: Response) -> World<S> {
    let mut world = World::default();
    let rotation = if random.u32(..4) == 0 { Rotation::None } else { Rotation::Dynamic };
    let substeps = random.u32(1..=4);
    world.set_model(Model { response, rotation, substeps, ..Model::default() }).unwrap();
    world
}

/// Lowest point of the axes of all capsules over the middle of the plate, in metres.
fn lowest<S: Scalar>(world: &World<S>, pose: Pose<f64>) -> f64 {
    let height = |row: usize| {
        let marble = world.marbles.get(world.marbles.id(row).unwrap()).unwrap();
        let half = marble.rotation * Vec3::unit_y() * marble.half_length;
        let ends = [marble.position - half, marble.position, marble.position + half];
        let heights = ends.map(|at| pose.inverse_transform_point(cast_point(at)).y);
        assert!(heights.iter().all(|y| y.is_finite()), "{marble:?}");
        heights.into_iter().fold(9.0, f64::min)
    };
    (0..world.marbles.len()).map(height).fold(9.0, f64::min)
}

fn throw<S: Scalar>(random: &mut Rng, response: Response, hollow: bool, moves: bool) -> f64 {
    let mut world = world::<S>(random, response);
    let at = Vec3::new(random.f64(), random.f64(), random.f64());
    let mut pose = Pose { rotation: turned(random), translation: at };
    let wall = world.walls.insert(plate::<S>(hollow, pose)).unwrap();
    let mut motion = WallMotion {
        velocity: unit(random) * (8.0 * random.f64()),
        angular_velocity: unit(random) * random.f64(),
        pivot: Point3::from_vec(at),
    };
    let speed = log(random, 1.0, 50.0);
    for count in 0..[1, 1, 3][random.usize(..3)] {
        let height = 4.0 + 7.0 * f64::from(count);
        world.marbles.insert(thrown::<S>(random, pose, height, speed)).unwrap();
    }
    let mut least = f64::INFINITY;
    for _ in 0..60 {
        if moves {
            motion.pivot += motion.velocity * DT;
            pose.translation = motion.pivot.to_vec();
            pose.rotation = integrate_rotation(pose.rotation, motion.angular_velocity, DT);
            world.walls.set(wall, plate::<S>(hollow, pose)).unwrap();
            let WallMotion { velocity, angular_velocity, pivot } = motion;
            let motion = WallMotion {
                velocity: cast_vector(velocity),
                angular_velocity: cast_vector(angular_velocity),
                pivot: cast_point(pivot),
            };
            world.walls.set_motion(wall, Some(motion)).unwrap();
        }
        world.step(S::from_f64(DT)).unwrap();
        least = least.min(lowest(&world, pose));
    }
    least
}

#[test]
fn no_part_of_a_capsule_passes_a_thin_plate() {
    for response in RESPONSES {
        for (hollow, moves) in [(false, false), (false, true), (true, false), (true, true)] {
            for run in 0..60 {
                let random = &mut Rng::with_seed(run);
                let least = if run % 2 == 0 {
                    throw::<f32>(random, response, hollow, moves)
                } else {
                    throw::<f64>(random, response, hollow, moves)
                };
                let what = format!("{response:?}, hollow {hollow}, moves {moves}, run {run}");
                assert!(least > 0.0, "{what}: {least} m over the middle of the plate");
            }
        }
    }
}

#[test]
fn a_capsule_that_a_plate_stops_bounces_and_does_not_hang() {
    for response in RESPONSES {
        for run in 0..200 {
            let random = &mut Rng::with_seed(run);
            let mut world = world::<f32>(random, response);
            world.set_gravity(Vec3::zero()).unwrap();
            let pose = Pose { rotation: turned(random), translation: Vec3::zero() };
            world.walls.insert(plate::<f32>(run % 2 == 0, pose)).unwrap();
            let speed = log(random, 5.0, 50.0);
            let id = world.marbles.insert(thrown(random, pose, 4.0, speed)).unwrap();
            let mut before = world.marbles.get(id).unwrap();
            for step in 0..240 {
                world.step(1.0 / 60.0).unwrap();
                let now = world.marbles.get(id).unwrap();
                let still = (now.position, now.rotation) == (before.position, before.rotation);
                let same = (now.velocity, now.angular_velocity)
                    == (before.velocity, before.angular_velocity);
                let hangs = still && same && now.velocity.magnitude() > 1e-3;
                assert!(!hangs, "{response:?}, run {run}, step {step}: {now:?}");
                before = now;
            }
        }
    }
}

/// A flipper, one end of which is within a plate all the time, turns as it does without the plate.
#[test]
fn no_wall_stops_the_rotation_of_a_capsule_of_infinite_mass() {
    let upright = Quat::new(1.0, 0.0, 0.0, 0.0);
    for response in [Response::Impulse, Response::Penalty(ContactLaw::SpringDashpot)] {
        let [free, beside_plate] = [false, true].map(|has_plate| {
            let mut world = World::<f64>::default();
            let rotation = Rotation::Dynamic;
            world.set_model(Model { response, rotation, ..Model::default() }).unwrap();
            if has_plate {
                let pose = Pose { rotation: upright, translation: Vec3::zero() };
                world.walls.insert(plate::<f64>(false, pose)).unwrap();
            }
            let flipper = Marble {
                half_length: 1.0,
                rotation: integrate_rotation(upright, Vec3::unit_z(), 1.5),
                angular_velocity: Vec3::unit_y() * 10.0,
                mass: Mass::Infinite,
                ..Marble::new(Point3::new(0.0, 0.1, 0.0), 0.1)
            };
            let id = world.marbles.insert(flipper).unwrap();
            for _ in 0..60 {
                world.step(DT).unwrap();
            }
            let now = world.marbles.get(id).unwrap();
            assert_ne!(now.rotation, flipper.rotation, "{response:?}");
            (now.position, now.rotation, now.angular_velocity)
        });
        assert_eq!(free, beside_plate, "{response:?}");
    }
}
