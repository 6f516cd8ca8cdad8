//! Walls that move fast: what they meet they push along, and pass through nothing.

use cgmath::Zero;
use taw::frame::Pose;
use taw::math::{Quat, Scalar};
use taw::motion::integrate_rotation;
use taw::prelude::*;
use taw::shape::{Aabb, Mesh, Obb, Shape};
use taw::world::WallMotion;

const DT: f64 = 1.0 / 60.0;
/// Half extents of the plate: two centimetres thick.
const PLATE: Vec3<f64> = Vec3::new(2.0, 0.01, 2.0);

struct Draw(fastrand::Rng);

impl Draw {
    fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.0.f64()
    }

    fn log(&mut self, low: f64, high: f64) -> f64 {
        self.within(low.ln(), high.ln()).exp()
    }

    fn cube(&mut self, half: f64) -> Vec3<f64> {
        let [x, y, z] = [(); 3].map(|()| self.within(-half, half));
        Vec3::new(x, y, z)
    }
}

/// A wall that starts at a pose, and moves.
struct Mover {
    from: Pose<f64>,
    velocity: Vec3<f64>,
    angular_velocity: Vec3<f64>,
}

impl Mover {
    fn pose(&self, time: f64) -> Pose<f64> {
        Pose {
            rotation: integrate_rotation(self.from.rotation, self.angular_velocity, time),
            translation: self.from.translation + self.velocity * time,
        }
    }

    fn motion<S: Scalar>(&self, time: f64) -> WallMotion<S> {
        WallMotion {
            velocity: cast(self.velocity),
            angular_velocity: cast(self.angular_velocity),
            pivot: Point3::from_vec(cast(self.pose(time).translation)),
        }
    }
}

fn cast<S: Scalar>(v: Vec3<f64>) -> Vec3<S> {
    Vec3::new(S::from_f64(v.x), S::from_f64(v.y), S::from_f64(v.z))
}

/// The plate about a point of its own frame, as a box or as a mesh of one layer.
fn plate<S: Scalar>(center: Vec3<f64>, hollow: bool, pose: Pose<f64>) -> WallShape<S> {
    let pose = Pose {
        rotation: Quat::from_sv(S::from_f64(pose.rotation.s), cast(pose.rotation.v)),
        translation: cast(pose.translation),
    };
    let upright = Quat::new(S::one(), S::zero(), S::zero(), S::zero());
    let shape: WallShape<S> = if hollow {
        let corner = |x: f64, z: f64| {
            Point3::from_vec(cast(center + Vec3::new(PLATE.x * x, 0.0, PLATE.z * z)))
        };
        let corners =
            vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
        Mesh::new(corners, vec![[0, 1, 2], [0, 2, 3]]).unwrap().into()
    } else {
        Obb::new(Point3::from_vec(cast(center)), upright, cast(PLATE)).unwrap().into()
    };
    shape.transformed(pose).unwrap()
}

fn world<S: Scalar>(draw: &mut Draw, response: Response) -> World<S> {
    let mut world = World::default();
    let rotation = [Rotation::None, Rotation::Dynamic][draw.0.usize(0..2)];
    let substeps = draw.0.u32(1..4);
    world.set_model(Model { response, rotation, substeps, ..Model::default() }).unwrap();
    if draw.0.bool() {
        world.set_gravity(Vec3::zero()).unwrap();
    }
    world.enable_energy_audit(true);
    world
}

fn ball<S: Scalar>(draw: &mut Draw, at: Vec3<f64>, radius: f64, speed: f64) -> Marble<S> {
    let material = Material {
        restitution: S::from_f64(draw.within(0.0, 1.0)),
        friction: S::from_f64(draw.within(0.0, 1.0)),
        ..Material::default()
    };
    Marble {
        velocity: cast(draw.cube(speed)),
        material: Some(material),
        ..Marble::new(Point3::from_vec(cast(at)), S::from_f64(radius))
    }
}

fn place<S: Scalar>(world: &World<S>, id: MarbleId) -> Point3<f64> {
    let at = world.marbles.get(id).unwrap().position;
    Point3::new(at.x.as_f64(), at.y.as_f64(), at.z.as_f64())
}

/// Tells if a ball went from one side of the plate to the other, and not past its edges.
fn crosses(from: Point3<f64>, to: Point3<f64>) -> bool {
    let within = |at: Point3<f64>| at.x.abs() < PLATE.x && at.z.abs() < PLATE.z;
    (from.y > 0.0) != (to.y > 0.0) && within(from) && within(to)
}

const RESPONSES: [Response; 3] =
    [Response::Displacement, Response::Impulse, Response::Penalty(ContactLaw::SpringDashpot)];

/// Asserts that no run failed.
fn all_right(runs: impl Iterator<Item = Result<(), String>>) {
    let wrong: Vec<String> = runs.filter_map(Result::err).collect();
    assert!(wrong.is_empty(), "{} failed:\n{}", wrong.len(), wrong.join("\n"));
}

/// One ball before a plate that comes from any side, at any speed.
fn hit<S: Scalar>(run: u64) -> Result<(), String> {
    let mut draw = Draw(fastrand::Rng::with_seed(run));
    let response = RESPONSES[run as usize % 3];
    let mut world = world::<S>(&mut draw, response);
    let hollow = draw.0.bool();
    let turn = Vec3::unit_x() * draw.within(0.0, 6.3) + draw.cube(0.1);
    let speed = draw.log(5.0, 500.0) * [-1.0, 1.0][draw.0.usize(0..2)];
    let rotation = integrate_rotation(Quat::new(1.0, 0.0, 0.0, 0.0), turn, 1.0);
    let along = Vec3::new(draw.within(-1.0, 1.0), 1.0, draw.within(-1.0, 1.0));
    let mover = Mover {
        from: Pose { rotation, translation: draw.cube(3.0) },
        velocity: rotation * along * speed,
        angular_velocity: Vec3::zero(),
    };
    let wall = world.walls.insert(plate(Vec3::zero(), hollow, mover.pose(0.0))).unwrap();
    let radius = draw.log(0.02, 0.5);
    let ahead = 0.011 + radius + draw.within(0.0, 0.1 * speed.abs());
    let beside = draw.cube(1.0);
    let at = mover.from.transform_point(Point3::from_vec(
        along * (ahead * speed.signum()) + Vec3::new(beside.x, 0.0, beside.z),
    ));
    let speed_of_ball = draw.log(0.1, 300.0);
    let marble = ball(&mut draw, at.to_vec(), radius, speed_of_ball);
    let id = world.marbles.insert(marble).unwrap();
    let (energy, mut work) = (world.energy().total(), 0.0);
    for step in 1..=10 {
        let time = DT * f64::from(step);
        let before = mover.pose(time - DT).inverse_transform_point(place(&world, id));
        world.walls.set(wall, plate(Vec3::zero(), hollow, mover.pose(time))).unwrap();
        world.walls.set_motion(wall, Some(mover.motion(time))).unwrap();
        world.step(S::from_f64(DT)).unwrap();
        let after = mover.pose(time).inverse_transform_point(place(&world, id));
        let passed = crosses(before, after);
        if passed {
            return Err(format!(
                "run {run}, {response:?}, {speed} m/s, {radius} m, hollow {hollow}, step {step}: from {before:?} to {after:?}"
            ));
        }
        work += world.energy_audit().unwrap().walls;
    }
    let gained = world.energy().total() - energy;
    let kinetic = world.energy().kinetic;
    // The audit counts no work of displacements, nor that of lifting what a wall carries along.
    let counted = response != Response::Displacement && world.gravity().is_zero();
    let explained = !counted || gained <= work + 1e-5 * kinetic.max(energy.abs());
    if explained { Ok(()) } else { Err(format!("run {run}, {response:?}: {gained} of {work} J")) }
}

#[test]
fn a_plate_at_any_speed_passes_through_no_ball() {
    all_right((0..3000).flat_map(|run| [hit::<f64>(run), hit::<f32>(run)]));
}

/// One ball in the way of a paddle that turns about an edge of its own.
fn swing<S: Scalar>(run: u64) -> Result<(), String> {
    let mut draw = Draw(fastrand::Rng::with_seed(run));
    let response = RESPONSES[run as usize % 3];
    let mut world = world::<S>(&mut draw, response);
    let hollow = draw.0.bool();
    let center = Vec3::new(3.0, 0.0, 0.0);
    // At most a third of a turn a step, so that it is plain where it came from.
    let speed = draw.log(2.0, 120.0) * [-1.0, 1.0][draw.0.usize(0..2)];
    let rotation = integrate_rotation(Quat::new(1.0, 0.0, 0.0, 0.0), draw.cube(3.0), 1.0);
    let mover = Mover {
        from: Pose { rotation, translation: draw.cube(3.0) },
        velocity: if draw.0.bool() { Vec3::zero() } else { draw.cube(5.0) },
        angular_velocity: rotation * Vec3::unit_z() * speed,
    };
    let wall = world.walls.insert(plate(center, hollow, mover.pose(0.0))).unwrap();
    let radius = draw.log(0.02, 0.5);
    let (far, angle) = (draw.within(2.0, 4.0), draw.within(0.0, 0.5));
    let ahead = 0.011 + radius + far * angle;
    let at = mover.from.transform_point(Point3::new(
        far,
        ahead * speed.signum(),
        draw.within(-1.0, 1.0),
    ));
    let speed_of_ball = draw.log(0.1, 30.0);
    let marble = ball(&mut draw, at.to_vec(), radius, speed_of_ball);
    let id = world.marbles.insert(marble).unwrap();
    // Where the paddle reaches, and how far it has to go to the ball.
    let angle_to = |at: Point3<f64>| {
        let reaches = (1.2..4.8).contains(&at.x.hypot(at.y)) && at.z.abs() < 1.8;
        reaches.then(|| (at.y * speed.signum()).atan2(at.x))
    };
    let (energy, mut work) = (world.energy().total(), 0.0);
    for step in 1..=10 {
        let time = DT * f64::from(step);
        let before = angle_to(mover.pose(time - DT).inverse_transform_point(place(&world, id)));
        world.walls.set(wall, plate(center, hollow, mover.pose(time))).unwrap();
        world.walls.set_motion(wall, Some(mover.motion(time))).unwrap();
        world.step(S::from_f64(DT)).unwrap();
        work += world.energy_audit().unwrap().walls;
        let after = angle_to(mover.pose(time).inverse_transform_point(place(&world, id)));
        let [Some(before), Some(after)] = [before, after] else { break };
        let passed = !(before < 0.0 || after > 0.0);
        if passed {
            return Err(format!(
                "run {run}, {response:?}, {speed} rad/s, {radius} m, hollow {hollow}, step {step}: from {before} to {after}"
            ));
        }
    }
    let gained = world.energy().total() - energy;
    let kinetic = world.energy().kinetic;
    // The audit counts no work of displacements, nor that of lifting what a wall carries along.
    let counted = response != Response::Displacement && world.gravity().is_zero();
    let explained = !counted || gained <= work + 1e-5 * kinetic.max(energy.abs());
    if explained { Ok(()) } else { Err(format!("run {run}, {response:?}: {gained} of {work} J")) }
}

#[test]
fn a_paddle_at_any_speed_passes_through_no_ball() {
    all_right((0..3000).flat_map(|run| [swing::<f64>(run), swing::<f32>(run)]));
}

/// A crowd before a plate, which pushes balls into balls.
fn sweep_up<S: Scalar>(run: u64) -> Result<(), String> {
    let mut draw = Draw(fastrand::Rng::with_seed(run));
    let response = RESPONSES[run as usize % 3];
    let mut world = world::<S>(&mut draw, response);
    let hollow = draw.0.bool();
    let speed = draw.log(5.0, 500.0);
    let rotation = integrate_rotation(Quat::new(1.0, 0.0, 0.0, 0.0), draw.cube(3.0), 1.0);
    let mover = Mover {
        from: Pose { rotation, translation: draw.cube(3.0) },
        velocity: rotation * Vec3::unit_y() * speed,
        angular_velocity: Vec3::zero(),
    };
    let wall = world.walls.insert(plate(Vec3::zero(), hollow, mover.pose(0.0))).unwrap();
    let mut balls: Vec<(Vec3<f64>, f64)> = Vec::new();
    for _ in 0..40 {
        let radius = draw.log(0.02, 0.3);
        let beside = draw.cube(1.0);
        let high = 0.011 + radius + draw.within(0.0, 1.0 + 0.05 * speed);
        let at = Vec3::new(beside.x, high, beside.z);
        if balls.iter().all(|(other, its)| (at - other).magnitude() > radius + its) {
            balls.push((at, radius));
        }
    }
    let mut ids = Vec::new();
    for (at, radius) in balls {
        let at = mover.from.transform_point(Point3::from_vec(at)).to_vec();
        let marble = ball(&mut draw, at, radius, 10.0);
        ids.push(world.marbles.insert(marble).unwrap());
    }
    for step in 1..=10 {
        let time = DT * f64::from(step);
        let local = |world: &World<S>, time: f64| -> Vec<_> {
            let pose = mover.pose(time);
            ids.iter().map(|id| pose.inverse_transform_point(place(world, *id))).collect()
        };
        let before = local(&world, time - DT);
        world.walls.set(wall, plate(Vec3::zero(), hollow, mover.pose(time))).unwrap();
        world.walls.set_motion(wall, Some(mover.motion(time))).unwrap();
        world.step(S::from_f64(DT)).unwrap();
        for (from, to) in before.into_iter().zip(local(&world, time)) {
            if crosses(from, to) {
                return Err(format!(
                    "run {run}, {response:?}, {speed} m/s, hollow {hollow}, step {step}: from {from:?} to {to:?}"
                ));
            }
        }
    }
    Ok(())
}

#[test]
fn a_plate_at_any_speed_passes_through_no_crowd() {
    all_right((0..600).flat_map(|run| [sweep_up::<f64>(run), sweep_up::<f32>(run)]));
}

/// Walls that come, go or are set between the substeps of a step, whose verbs are called one by one, are
/// what they were set to: another one on its way lends them nothing.
#[test]
fn walls_change_between_substeps() {
    let block =
        |x: f32| Aabb { min: Point3::new(x, 5.0, -1.0), max: Point3::new(x + 2.0, 5.2, 1.0) };
    let motion = WallMotion {
        velocity: Vec3::unit_x() * 50.0,
        angular_velocity: Vec3::new(0.0, 0.0, 0.0),
        pivot: Point3::new(0.0, 0.0, 0.0),
    };
    let responses = [Response::SoftStep, Response::Impulse, Response::Displacement];
    for (response, change) in
        responses.into_iter().flat_map(|it| [(it, 0), (it, 1), (it, 2), (it, 3)])
    {
        let mut world = World::<f32>::default();
        world.set_model(Model { response, ..Model::default() }).unwrap();
        let [first, second] = [0.0, 10.0].map(|x| world.walls.insert(block(x)).unwrap());
        world.step(0.02).unwrap();
        for (wall, x) in [(first, 1.0), (second, 11.0)] {
            world.walls.set(wall, block(x)).unwrap();
            world.walls.set_motion(wall, Some(motion)).unwrap();
        }
        world.begin_step();
        world.begin_substep(0.01);
        world.integrate(0.01).unwrap();
        let mut new = None;
        match change {
            0 => drop(world.walls.remove(first).unwrap()),
            1 => {
                world.walls.remove(first).unwrap();
                new = Some(
                    world
                        .walls
                        .insert(Sphere::new(Point3::new(0.0, 9.0, 0.0), 1.0).unwrap())
                        .unwrap(),
                );
            }
            2 => world.walls.set(first, block(-7.0)).unwrap(),
            _ => world.walls.set_motion(first, None).unwrap(),
        }
        world.generate_contacts();
        world.restitute(0.01).unwrap();
        world.begin_substep(0.0);
        world.integrate(0.01).unwrap();
        world.generate_contacts();
        world.restitute(0.01).unwrap();
        world.end_step();
        let is_block = |id: WallId, x: f32| matches!(world.walls.get(id), Ok(WallShape::Solid(Shape::Aabb(it))) if *it == block(x));
        assert!(is_block(second, 11.0), "{response:?} {change}");
        match change {
            0 => assert!(world.walls.get(first).is_err()),
            1 => {
                let shape = world.walls.get(new.unwrap()).unwrap();
                assert!(matches!(shape, WallShape::Solid(Shape::Sphere(_))), "{response:?}");
            }
            2 => assert!(is_block(first, -7.0), "{response:?}"),
            _ => {
                assert!(is_block(first, 1.0), "{response:?}");
                assert_eq!(world.walls.motion(first), Ok(None));
            }
        }
    }
}
