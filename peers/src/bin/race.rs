//! The same heaps in taw, Rapier and Avian: what a step costs, how deep balls are in each other,
//! how much still moves.
//!
//! `cargo run --release --bin race` in this folder; `-- --million` adds the rows of taw with a
//! million balls, `-- pour` runs the scenes whose names begin so. Two threads, f32, 60 Hz, nothing
//! sleeps; means of steps 181 to 240, and of steps 61 to 120, in which most still moves. Rapier with `parallel` and `simd8`, Avian with `parallel`
//! and `simd`, otherwise by default.

use std::time::{Duration, Instant};

use avian3d::prelude as avian;
use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use rapier3d::prelude as rapier;
use taw::prelude as core;
use taw::swarm::{Ball, SwarmModel, Tier};

const DT: f32 = 1.0 / 60.0;
const STEPS: u32 = 240;
const MEASURED: u32 = 60;
const THREADS: usize = 2;
const FRICTION: f32 = 0.3;
const RESTITUTION: f32 = 0.2;

/// Balls of density 1, and what holds them, which turns about the origin.
struct Scene {
    name: &'static str,
    /// Centers and radii.
    balls: Vec<(Vec3, f32)>,
    /// Inward normals, and points of the planes.
    planes: Vec<(Vec3, Vec3)>,
    /// Centers, half sizes, and how they are turned.
    boxes: Vec<(Vec3, Vec3, Quat)>,
    turn: fn(f32) -> Quat,
}

/// Numbers in [0, 1) that look random.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        (self.0 >> 40) as f32 / (1 << 24) as f32
    }
}

fn still(_: f32) -> Quat {
    Quat::IDENTITY
}

/// Balls on a lattice of cells as wide as the largest, so many along x and z, and from a height.
fn lattice(
    count: usize,
    [nx, nz]: [usize; 2],
    from: f32,
    radii: [f32; 2],
    even: bool,
) -> Vec<(Vec3, f32)> {
    let mut random = Random(count as u64);
    let pitch = 2.1 * radii[1];
    let at = |i: usize, n: usize| (i as f32 + 0.5 - n as f32 * 0.5) * pitch;
    let place = |i: usize| {
        let y = from + (i / (nx * nz)) as f32 * pitch + radii[1];
        Vec3::new(at(i % nx, nx), y, at(i / nx % nz, nz))
    };
    let mut radius = || {
        let part = random.next();
        let [least, most] = radii;
        if even { least + (most - least) * part } else { least * (most / least).powf(part) }
    };
    let all: Vec<_> = (0..count).map(|i| (place(i), radius())).collect();
    // Or they would stand on each other's heads.
    let mut aside = || (random.next() - 0.5) * 0.04 * pitch;
    all.into_iter().map(|(at, radius)| (at + Vec3::new(aside(), 0.0, aside()), radius)).collect()
}

fn open_box(half: f32) -> Vec<(Vec3, Vec3)> {
    let sides = [Vec3::X, Vec3::NEG_X, Vec3::Z, Vec3::NEG_Z].map(|up| (up, up * -half));
    [(Vec3::Y, Vec3::ZERO)].into_iter().chain(sides).collect()
}

/// Twelve layers dropped into a box that fits them.
fn pour(count: usize) -> Scene {
    let side = (count as f32 / 12.0).sqrt().ceil() as usize;
    Scene {
        name: "pour",
        balls: lattice(count, [side; 2], 0.0, [0.3, 0.5], true),
        planes: open_box(side as f32 * 1.05 * 0.5),
        boxes: Vec::new(),
        turn: still,
    }
}

/// A drum of 24 faces that turns once in ten seconds.
fn drum() -> Scene {
    let (radius, half) = (10.0, 8.0);
    let faces = (0..24_u8).map(|i| {
        let inward = Quat::from_rotation_z(f32::from(i) * std::f32::consts::TAU / 24.0) * Vec3::Y;
        (inward, inward * -radius)
    });
    let ends = [Vec3::Z, Vec3::NEG_Z].map(|inward| (inward, inward * -half));
    Scene {
        name: "drum, 4,000",
        balls: lattice(4_000, [12, 15], -7.0, [0.3, 0.5], true),
        planes: faces.chain(ends).collect(),
        boxes: Vec::new(),
        turn: |time| Quat::from_rotation_z(time * std::f32::consts::TAU / 10.0),
    }
}

/// A funnel of four boards over a floor.
fn hopper() -> Scene {
    let mut boxes = Vec::new();
    for i in 0..4_u8 {
        let about = Quat::from_rotation_y(f32::from(i) * std::f32::consts::FRAC_PI_2);
        let tilt = about * Quat::from_rotation_z(0.8);
        // Its inner edge leaves a hole of 3 m.
        let center =
            about * (Vec3::new(1.5, 6.0, 0.0) + Quat::from_rotation_z(0.8) * Vec3::X * 8.0);
        boxes.push((center, Vec3::new(8.0, 0.5, 14.0), tilt));
    }
    Scene {
        name: "hopper, 3,000",
        balls: lattice(3_000, [12, 12], 16.0, [0.3, 0.5], true),
        planes: open_box(16.0),
        boxes,
        turn: still,
    }
}

/// A box that tilts to and fro, with radii of one to ten.
fn board() -> Scene {
    Scene {
        name: "board, 5,000 mixed",
        balls: lattice(5_000, [30; 2], 0.5, [0.05, 0.5], false),
        planes: open_box(16.5),
        boxes: Vec::new(),
        turn: |time| {
            let about = |speed: f32| (time * speed).sin() * 0.2;
            Quat::from_rotation_x(about(1.1)) * Quat::from_rotation_z(about(0.7))
        },
    }
}

trait Engine {
    fn new(scene: &Scene) -> Self;
    /// A step at whose end the frame is turned so.
    fn step(&mut self, from: Quat, to: Quat);
    /// Centers and velocities, in the order of the scene.
    fn state(&self) -> Vec<[Vec3; 2]>;
}

struct Taw {
    world: core::World<f32>,
    ids: Vec<taw::swarm::BallId>,
    planes: Vec<(core::WallId, Vec3, Vec3)>,
    boxes: Vec<(core::WallId, Vec3, Vec3, Quat)>,
}

fn vector(v: Vec3) -> core::Vec3<f32> {
    core::Vec3::new(v.x, v.y, v.z)
}

fn plane(up: Vec3, point: Vec3) -> core::Plane<f32> {
    core::Plane::new(vector(up.normalize()), up.normalize().dot(point)).expect("a unit vector")
}

fn cuboid(center: Vec3, half: Vec3, turn: Quat) -> core::WallShape<f32> {
    let turn = taw::math::Quat::new(turn.w, turn.x, turn.y, turn.z);
    let center = taw::math::Point3::new(center.x, center.y, center.z);
    let shape = taw::shape::Obb::new(center, turn, vector(half)).expect("a box");
    core::WallShape::Solid(taw::shape::Shape::Obb(shape))
}

impl Taw {
    fn with(scene: &Scene, tier: Tier, substeps: u32, threads: u32) -> Self {
        let mut world = core::World::default();
        let material =
            core::Material { friction: FRICTION, restitution: RESTITUTION, ..Default::default() };
        let model = SwarmModel { tier, substeps, threads, material, sleeps: false };
        world.swarm.set_model(model).expect("a model");
        let mut place = |shape: core::WallShape<f32>| world.walls.insert(shape).expect("a wall");
        let planes = scene
            .planes
            .iter()
            .map(|(up, at)| (place(core::WallShape::Plane(plane(*up, *at))), *up, *at));
        let planes = planes.collect();
        let boxes = scene.boxes.iter().map(|(c, h, q)| (place(cuboid(*c, *h, *q)), *c, *h, *q));
        let boxes = boxes.collect();
        let ball = |(at, radius): &(Vec3, f32)| Ball {
            mass: core::Mass::Density(1.0),
            ..Ball::new(taw::math::Point3::new(at.x, at.y, at.z), *radius)
        };
        let balls: Vec<_> = scene.balls.iter().map(ball).collect();
        let ids = world.swarm.insert(&balls).expect("balls");
        Self { world, ids, planes, boxes }
    }
}

impl Engine for Taw {
    fn new(scene: &Scene) -> Self {
        Self::with(scene, Tier::Full, 2, THREADS as u32)
    }

    fn step(&mut self, from: Quat, to: Quat) {
        if from != to {
            let spin = vector((to * from.inverse()).to_scaled_axis() / DT);
            let pivot = taw::math::Point3::new(0.0, 0.0, 0.0);
            let motion = taw::motion::WallMotion {
                velocity: vector(Vec3::ZERO),
                angular_velocity: spin,
                pivot,
            };
            for (id, up, at) in &self.planes {
                self.world.walls.set(*id, plane(to * *up, to * *at)).expect("a wall");
                self.world.walls.set_motion(*id, Some(motion)).expect("a wall");
            }
            for (id, center, half, turn) in &self.boxes {
                let shape = cuboid(to * *center, *half, to * *turn);
                self.world.walls.set(*id, shape).expect("a wall");
                self.world.walls.set_motion(*id, Some(motion)).expect("a wall");
            }
        }
        self.world.step(DT).expect("a step");
    }

    fn state(&self) -> Vec<[Vec3; 2]> {
        let swarm = &self.world.swarm;
        let of = |id| {
            let row = swarm.row(id).expect("a ball");
            [swarm.balls()[row], swarm.velocities()[row]].map(|r| Vec3::from_slice(&r[..3]))
        };
        self.ids.iter().map(|id| of(*id)).collect()
    }
}

/// Rapier has another glam.
fn theirs(v: Vec3) -> rapier::Vector {
    rapier::Vector::new(v.x, v.y, v.z)
}

fn their_turn(q: Quat) -> rapier::Rotation {
    rapier::Rotation::from_xyzw(q.x, q.y, q.z, q.w)
}

struct Rapier {
    world: rapier::PhysicsWorld,
    frame: rapier::RigidBodyHandle,
    balls: Vec<rapier::RigidBodyHandle>,
}

impl Engine for Rapier {
    fn new(scene: &Scene) -> Self {
        let mut world = rapier::PhysicsWorld {
            gravity: rapier::Vector::new(0.0, -9.81, 0.0),
            ..Default::default()
        };
        world.integration_parameters.dt = DT;
        let frame = world.bodies.insert(rapier::RigidBodyBuilder::kinematic_position_based());
        let with = |collider: rapier::ColliderBuilder| {
            collider.friction(FRICTION).restitution(RESTITUTION).build()
        };
        for (up, at) in &scene.planes {
            let shape = rapier::SharedShape::halfspace(theirs(*up));
            let collider = rapier::ColliderBuilder::new(shape).translation(theirs(*at));
            world.colliders.insert_with_parent(with(collider), frame, &mut world.bodies);
        }
        for (center, half, turn) in &scene.boxes {
            let collider = rapier::ColliderBuilder::cuboid(half.x, half.y, half.z)
                .position(rapier::Pose::from_parts(theirs(*center), their_turn(*turn)));
            world.colliders.insert_with_parent(with(collider), frame, &mut world.bodies);
        }
        let mut balls = Vec::new();
        for (at, radius) in &scene.balls {
            let body =
                rapier::RigidBodyBuilder::dynamic().translation(theirs(*at)).can_sleep(false);
            let collider = with(rapier::ColliderBuilder::ball(*radius).density(1.0));
            balls.push(world.insert(body, collider).0);
        }
        Self { world, frame, balls }
    }

    fn step(&mut self, from: Quat, to: Quat) {
        if from != to {
            self.world.bodies[self.frame].set_next_kinematic_rotation(their_turn(to));
        }
        self.world.step();
    }

    fn state(&self) -> Vec<[Vec3; 2]> {
        let of = |ball: &rapier::RigidBodyHandle| {
            let body = &self.world.bodies[*ball];
            [body.translation(), body.linvel()].map(|v| Vec3::new(v.x, v.y, v.z))
        };
        self.balls.iter().map(of).collect()
    }
}

struct Avian {
    app: App,
    frame: Entity,
    balls: Vec<Entity>,
}

impl Engine for Avian {
    fn new(scene: &Scene) -> Self {
        let mut app = App::new();
        app.add_plugins((
            MinimalPlugins.set(TaskPoolPlugin {
                task_pool_options: TaskPoolOptions::with_num_threads(THREADS),
            }),
            TransformPlugin,
            avian::PhysicsPlugins::new(Update),
        ));
        app.insert_resource(avian::Gravity(Vec3::NEG_Y * 9.81));
        let step = Duration::from_secs_f32(DT);
        app.insert_resource(TimeUpdateStrategy::ManualDuration(step));
        app.finish();
        app.update();
        let world = app.world_mut();
        let surface = || (avian::Friction::new(FRICTION), avian::Restitution::new(RESTITUTION));
        let frame = world.spawn((avian::RigidBody::Kinematic, Transform::default())).id();
        for (up, at) in &scene.planes {
            let shape = avian::Collider::half_space(*up);
            let place = Transform::from_translation(*at);
            world.spawn((shape, place, surface(), ChildOf(frame)));
        }
        for (center, half, turn) in &scene.boxes {
            let shape = avian::Collider::cuboid(2.0 * half.x, 2.0 * half.y, 2.0 * half.z);
            let place = Transform::from_translation(*center).with_rotation(*turn);
            world.spawn((shape, place, surface(), ChildOf(frame)));
        }
        let balls = scene.balls.iter().map(|(at, radius)| {
            let shape = (avian::Collider::sphere(*radius), avian::ColliderDensity(1.0));
            let place = Transform::from_translation(*at);
            let body = (avian::RigidBody::Dynamic, avian::SleepingDisabled);
            world.spawn((body, shape, place, surface())).id()
        });
        let balls = balls.collect();
        Self { app, frame, balls }
    }

    fn step(&mut self, from: Quat, to: Quat) {
        if from != to {
            let spin = (to * from.inverse()).to_scaled_axis() / DT;
            self.app.world_mut().entity_mut(self.frame).insert(avian::AngularVelocity(spin));
        }
        self.app.update();
    }

    fn state(&self) -> Vec<[Vec3; 2]> {
        let of = |ball: &Entity| {
            let ball = self.app.world().entity(*ball);
            let at = ball.get::<avian::Position>().map_or(Vec3::NAN, |at| at.0);
            [at, ball.get::<avian::LinearVelocity>().map_or(Vec3::NAN, |v| v.0)]
        };
        self.balls.iter().map(of).collect()
    }
}

/// What came out.
struct Result {
    ms: f64,
    early_ms: f64,
    deepest: f32,
    mean: f64,
    kinetic: f64,
}

fn run(scene: &Scene, mut engine: impl Engine) -> Result {
    let (mut time, mut early) = (Duration::ZERO, Duration::ZERO);
    for step in 0..STEPS {
        let at = |step: u32| (scene.turn)(step as f32 * DT);
        let (from, to) = (at(step), at(step + 1));
        let began = Instant::now();
        engine.step(from, to);
        if step >= STEPS - MEASURED {
            time += began.elapsed();
        } else if (MEASURED..2 * MEASURED).contains(&step) {
            early += began.elapsed();
        }
    }
    let state = engine.state();
    let radius: Vec<f32> = scene.balls.iter().map(|ball| ball.1).collect();
    let at: Vec<_> = state.iter().map(|[at, _]| taw::math::Point3::new(at.x, at.y, at.z)).collect();
    let mut grid = taw::broad::Grid::default();
    grid.rebuild(&at, &radius, 0.0);
    let (mut deepest, mut sum, mut count) = (0.0_f32, 0.0, 0_u32);
    grid.pairs(&at, |a, b| {
        let (a, b) = (a as usize, b as usize);
        let overlap = radius[a] + radius[b] - state[a][0].distance(state[b][0]);
        if overlap > 0.0 {
            deepest = deepest.max(overlap);
            sum += f64::from(overlap);
            count += 1;
        }
    });
    let mass = |r: &f32| 4.0 / 3.0 * std::f64::consts::PI * f64::from(*r).powi(3);
    let energy =
        state.iter().zip(&radius).map(|([_, v], r)| 0.5 * mass(r) * f64::from(v.length_squared()));
    let ms = |time: Duration| time.as_secs_f64() * 1e3 / f64::from(MEASURED);
    Result {
        ms: ms(time),
        early_ms: ms(early),
        deepest,
        mean: sum / f64::from(count.max(1)),
        kinetic: energy.sum::<f64>() / state.len() as f64,
    }
}

fn row(scene: &Scene, name: &str, result: &Result, rapier: Option<f64>) {
    let balls = scene.balls.len();
    let times = rapier.map_or("–".into(), |rapier| format!("{:.1}", rapier / result.ms));
    println!(
        "| {}, {balls} | {name} | {:.2} | {:.2} | {:.0} | {times} | {:.4} | {:.5} | {:.1e} |",
        scene.name,
        result.early_ms,
        result.ms,
        result.ms * 1e6 / balls as f64,
        result.deepest,
        result.mean,
        result.kinetic
    );
}

fn main() {
    rayon::ThreadPoolBuilder::new().num_threads(THREADS).build_global().expect("once");
    let arguments: Vec<_> = std::env::args().skip(1).collect();
    let million = arguments.iter().any(|word| word == "--million");
    let wanted = arguments.iter().find(|word| !word.starts_with("--"));
    let mut scenes: Vec<_> = [1_000, 10_000, 100_000].map(pour).into_iter().collect();
    scenes.extend([drum(), hopper(), board()]);
    if let Some(name) = wanted {
        scenes.retain(|scene| scene.name.starts_with(name.as_str()));
    }
    println!(
        "| scene, balls | engine | ms a step while most moves | ms a step | ns a ball | times as fast as Rapier | deepest overlap, m | mean, m | kinetic energy a ball, J |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    for scene in &scenes {
        let rapier = run(scene, Rapier::new(scene));
        row(scene, "Rapier 0.36.1", &rapier, Some(rapier.ms));
        if scene.balls.len() <= 10_000 {
            row(scene, "Avian 0.7.0", &run(scene, Avian::new(scene)), Some(rapier.ms));
        }
        for (name, tier, substeps) in [("taw, full", Tier::Full, 2), ("taw, lab", Tier::Lab, 1)] {
            let result = run(scene, Taw::with(scene, tier, substeps, THREADS as u32));
            row(scene, name, &result, Some(rapier.ms));
        }
        let one = run(scene, Taw::with(scene, Tier::Full, 2, 1));
        row(scene, "taw, full, one thread", &one, Some(rapier.ms));
    }
    if million {
        let scene = pour(1_000_000);
        for (name, tier, substeps, threads) in [
            ("taw, full", Tier::Full, 2, 2),
            ("taw, full, one thread", Tier::Full, 2, 1),
            ("taw, lab", Tier::Lab, 1, 2),
            ("taw, lab, one thread", Tier::Lab, 1, 1),
        ] {
            row(&scene, name, &run(&scene, Taw::with(&scene, tier, substeps, threads)), None);
        }
    }
}
