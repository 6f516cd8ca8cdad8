//! The scenes of `taw-lab trade` in Rapier and Avian: the same files, judged by the same code,
//! written as the same points.
//!
//! `cargo run --release --bin trade -- FILE` in this folder, then `taw-lab trade --with FILE`.
//! `--quick` runs the settings of a quick sweep; a word after FILE only the scenes whose name contains it.
//! Both engines by default but for what is swept:
//! steps, and solver iterations (Rapier) or substeps (Avian). Nothing sleeps. Fields are forces
//! that are set before each step. Cost is the processor time of all threads; Rapier has one.

use std::time::Duration;

use avian3d::prelude as avian;
use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use cpu_time::ProcessTime;
use rapier3d::prelude as rapier;
use taw::math::Vec3 as Exact;
use taw::scene::{
    ForceFieldDesc, KinematicMotion, MarbleDesc, MaterialDesc, Scene, ShapeDesc, WallDesc,
};
use taw_lab::trade::scenes::{ReferenceCase, SCENES};
use taw_lab::trade::sweep::{STEPS, digits, write_points};
use taw_lab::trade::trace::{Frame, SAMPLE_INTERVAL};
use taw_lab::trade::{COUNTS, Failure, Point};

/// A scene in an engine.
trait Engine {
    const NAME: &'static str;

    fn new(scene: &Scene, step: f32, count: u32) -> Self;

    /// Goes on by a step. Of each ball, the force on it.
    fn step(&mut self, gravity: Vec3, forces: &[Vec3]);

    /// Center and velocity of each ball.
    fn state(&self) -> Vec<[Vec3; 2]>;

    /// Description of its defaults.
    fn defaults() -> String;
}

fn vec(v: [f64; 3]) -> Vec3 {
    Vec3::from_array(v.map(|x| x as f32))
}

fn surface_of(ball: &MarbleDesc, scene: &Scene) -> MaterialDesc {
    ball.material.unwrap_or(scene.material)
}

/// Angular velocity of a wall about its place, in rad/s.
fn turning(wall: &WallDesc) -> Option<Vec3> {
    match (wall.motion?, wall.shape) {
        (
            KinematicMotion::Rotate { pivot, axis, degrees_per_second },
            ShapeDesc::HalfSpace { point, .. },
        ) if pivot == point => Some(vec(axis).normalize() * degrees_per_second.to_radians() as f32),
        other => panic!("no scene of the sweep has {other:?}"),
    }
}

struct Rapier {
    world: rapier::PhysicsWorld,
    balls: Vec<rapier::RigidBodyHandle>,
}

fn theirs(v: Vec3) -> rapier::Vector {
    rapier::Vector::new(v.x, v.y, v.z)
}

impl Engine for Rapier {
    const NAME: &'static str = "Rapier 0.36.1";

    fn new(scene: &Scene, step: f32, count: u32) -> Self {
        let mut world = rapier::PhysicsWorld::default();
        world.integration_parameters.dt = step;
        world.integration_parameters.num_solver_iterations = count as usize;
        let with = |collider: rapier::ColliderBuilder, surface: MaterialDesc| {
            let (friction, restitution) = (surface.friction as f32, surface.restitution as f32);
            collider.friction(friction).restitution(restitution).build()
        };
        for wall in &scene.walls {
            let collider = match wall.shape {
                ShapeDesc::HalfSpace { normal, point } => {
                    let shape = rapier::SharedShape::halfspace(theirs(vec(normal).normalize()));
                    rapier::ColliderBuilder::new(shape).translation(theirs(vec(point)))
                }
                ShapeDesc::Capsule { from, to, radius } => {
                    rapier::ColliderBuilder::capsule_from_endpoints(
                        theirs(vec(from)),
                        theirs(vec(to)),
                        radius as f32,
                    )
                }
                ShapeDesc::Ball { center, radius } => {
                    rapier::ColliderBuilder::ball(radius as f32).translation(theirs(vec(center)))
                }
                ShapeDesc::Box { .. } => panic!("no scene of the sweep has a box"),
            };
            let surface = wall.material.unwrap_or(scene.material);
            let collider = with(collider, surface);
            match turning(wall) {
                None => {
                    world.colliders.insert(collider);
                }
                Some(spin) => {
                    let body = rapier::RigidBodyBuilder::kinematic_velocity_based();
                    world.insert(body.angvel(theirs(spin)).can_sleep(false), collider);
                }
            }
        }
        let mut balls = Vec::new();
        for ball in scene.all_marbles() {
            let body = rapier::RigidBodyBuilder::dynamic()
                .translation(theirs(vec(ball.position)))
                .linvel(theirs(vec(ball.velocity)))
                .angvel(theirs(vec(ball.angular_velocity)))
                .can_sleep(false);
            let shape = rapier::ColliderBuilder::ball(ball.radius as f32);
            let shape = shape.density(ball.density as f32);
            balls.push(world.insert(body, with(shape, surface_of(&ball, scene))).0);
        }
        Self { world, balls }
    }

    fn step(&mut self, gravity: Vec3, forces: &[Vec3]) {
        self.world.gravity = theirs(gravity);
        for (ball, force) in self.balls.iter().zip(forces) {
            let body = &mut self.world.bodies[*ball];
            body.reset_forces(true);
            body.add_force(theirs(*force), true);
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

    fn defaults() -> String {
        let p = rapier::IntegrationParameters::default();
        format!(
            "its defaults but for the step and `num_solver_iterations` ({}): length unit {} m, \
             contacts of {} Hz with damping ratio {} (with fixed bodies {} Hz, {}), warm start {}, \
             allowed error {} m, prediction {} m, corrective velocity {} m/s at most, \
             {} internal and {} stabilizing iterations, {:?} friction, no damping; a spin stops at \
             47.1 rad/s with steps of 1/60 s (`cargo run --release`)",
            p.num_solver_iterations,
            p.length_unit,
            p.contact_softness.natural_frequency,
            p.contact_softness.damping_ratio,
            p.static_contact_softness.natural_frequency,
            p.static_contact_softness.damping_ratio,
            p.warmstart_coefficient,
            p.normalized_allowed_linear_error,
            p.normalized_prediction_distance,
            p.normalized_max_corrective_velocity,
            p.num_internal_pgs_iterations,
            p.num_internal_stabilization_iterations,
            p.friction_model,
        )
    }
}

struct Avian {
    app: App,
    balls: Vec<Entity>,
}

impl Engine for Avian {
    const NAME: &'static str = "Avian 0.7.0";

    fn new(scene: &Scene, step: f32, count: u32) -> Self {
        let mut app = App::new();
        app.add_plugins((
            MinimalPlugins
                .set(TaskPoolPlugin { task_pool_options: TaskPoolOptions::with_num_threads(1) }),
            TransformPlugin,
            avian::PhysicsPlugins::new(Update),
        ));
        app.insert_resource(avian::SubstepCount(count));
        let step = Duration::from_secs_f32(step);
        app.insert_resource(TimeUpdateStrategy::ManualDuration(step));
        app.finish();
        app.update();
        let world = app.world_mut();
        let made_of = |surface: MaterialDesc| {
            let (friction, restitution) = (surface.friction as f32, surface.restitution as f32);
            (avian::Friction::new(friction), avian::Restitution::new(restitution))
        };
        for wall in &scene.walls {
            let (shape, place) = match wall.shape {
                ShapeDesc::HalfSpace { normal, point } => {
                    (avian::Collider::half_space(vec(normal).normalize()), vec(point))
                }
                ShapeDesc::Capsule { from, to, radius } => {
                    let (from, to) = (vec(from), vec(to));
                    (avian::Collider::capsule_endpoints(radius as f32, from, to), Vec3::ZERO)
                }
                ShapeDesc::Ball { center, radius } => {
                    (avian::Collider::sphere(radius as f32), vec(center))
                }
                ShapeDesc::Box { .. } => panic!("no scene of the sweep has a box"),
            };
            let surface = made_of(wall.material.unwrap_or(scene.material));
            let place = Transform::from_translation(place);
            let mut entity = world.spawn((shape, place, surface));
            match turning(wall) {
                None => entity.insert(avian::RigidBody::Static),
                Some(spin) => entity.insert((
                    avian::RigidBody::Kinematic,
                    avian::AngularVelocity(spin),
                    avian::SleepingDisabled,
                )),
            };
        }
        let balls = scene.all_marbles().map(|ball| {
            let shape = avian::Collider::sphere(ball.radius as f32);
            let density = avian::ColliderDensity(ball.density as f32);
            let place = Transform::from_translation(vec(ball.position));
            let body = (
                avian::RigidBody::Dynamic,
                avian::SleepingDisabled,
                avian::LinearVelocity(vec(ball.velocity)),
                avian::AngularVelocity(vec(ball.angular_velocity)),
                avian::ConstantForce::default(),
            );
            world.spawn((body, shape, density, place, made_of(surface_of(&ball, scene)))).id()
        });
        let balls = balls.collect();
        Self { app, balls }
    }

    fn step(&mut self, gravity: Vec3, forces: &[Vec3]) {
        self.app.insert_resource(avian::Gravity(gravity));
        for (ball, force) in self.balls.iter().zip(forces) {
            let mut ball = self.app.world_mut().entity_mut(*ball);
            if let Some(mut to) = ball.get_mut::<avian::ConstantForce>() {
                to.0 = *force;
            }
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

    fn defaults() -> String {
        let solver = avian3d::dynamics::solver::SolverConfig::default();
        let narrow = avian::NarrowPhaseConfig::default();
        format!(
            "its defaults but for the step and `SubstepCount` ({}): length unit 1 m, contacts of \
             damping ratio {} and {} times the substep's frequency, warm start {}, overlap solved \
             at {} m/s at most, no bounce below {} m/s, contact tolerance {} m, speculative margin \
             unbounded, no damping",
            avian::SubstepCount::default().0,
            solver.contact_damping_ratio,
            solver.contact_frequency_factor,
            solver.warm_start_coefficient,
            solver.max_overlap_solve_speed,
            solver.restitution_threshold,
            narrow.contact_tolerance,
        )
    }
}

/// The forces of the scene's fields.
fn forces(scene: &Scene, balls: &[MarbleDesc], state: &[[Vec3; 2]]) -> Vec<Vec3> {
    let of = |(ball, [at, velocity]): (&MarbleDesc, &[Vec3; 2])| {
        let mass = ball.density * 4.0 / 3.0 * std::f64::consts::PI * ball.radius.powi(3);
        let force = |field: &ForceFieldDesc| match *field {
            ForceFieldDesc::Drag { velocity: wind, linear, quadratic } => {
                let relative = vec(wind) - *velocity;
                relative * (linear as f32 + quadratic as f32 * relative.length())
            }
            ForceFieldDesc::Attraction { center, strength } => {
                let way = vec(center) - *at;
                way * ((strength * mass) as f32 / way.length().powi(3))
            }
            ForceFieldDesc::Spring { anchor, rest_length, stiffness } => {
                let way = vec(anchor) - *at;
                way.normalize_or_zero() * (stiffness as f32 * (way.length() - rest_length as f32))
            }
        };
        scene.force_fields.iter().map(force).sum()
    };
    balls.iter().zip(state).map(of).collect()
}

fn frame(time: f64, state: &[[Vec3; 2]]) -> Frame {
    let exact = |v: Vec3| Exact::new(v.x, v.y, v.z).map(f64::from);
    let at = state.iter().map(|[at, _]| exact(*at)).collect::<Vec<_>>();
    let velocity = state.iter().map(|[_, velocity]| exact(*velocity)).collect();
    Frame { time, at, velocity, ..Frame::default() }
}

/// Sum of the overlaps of balls with each other and with walls.
fn overlap(scene: &Scene, balls: &[MarbleDesc], state: &[[Vec3; 2]]) -> f64 {
    let mut there = scene.clone();
    there.lattices.clear();
    let place = |(ball, [at, _]): (&MarbleDesc, &[Vec3; 2])| MarbleDesc {
        position: at.to_array().map(f64::from),
        ..*ball
    };
    there.marbles = balls.iter().zip(state).map(place).collect();
    there
        .run::<f64>(taw::world::Model::default())
        .map_or(f64::NAN, |running| taw_lab::scene::overlaps(&running.world).iter().sum())
}

fn run<E: Engine>(judged: &ReferenceCase, step: (&str, f64), count: u32) -> Point {
    let scene = judged.scene();
    let balls: Vec<_> = scene.all_marbles().collect();
    let steps = (scene.duration / step.1).round() as u64;
    let every = (SAMPLE_INTERVAL / step.1).round() as u64;
    let go = |mut watch: Option<&mut Vec<Frame>>| {
        let mut engine = E::new(scene, step.1 as f32, count);
        let still = |ball: &MarbleDesc| [vec(ball.position), vec(ball.velocity)];
        let mut state: Vec<_> = balls.iter().map(still).collect();
        let mut taken = Duration::ZERO;
        for i in 0..=steps {
            if let Some(frames) = &mut watch
                && (i % every == 0 || i == steps)
            {
                let mut frame = frame(i as f64 * step.1, &state);
                frame.overlap = overlap(scene, &balls, &state);
                frames.push(frame);
            }
            if i < steps {
                let now = (i as f64 + 0.5) * step.1;
                let gravity = vec(scene.gravity_at(now));
                let begin = ProcessTime::now();
                let forces = if scene.force_fields.is_empty() {
                    vec![]
                } else {
                    forces(scene, &balls, &state)
                };
                engine.step(gravity, &forces);
                taken += begin.elapsed();
                state = engine.state();
            }
        }
        taken.as_secs_f64()
    };
    let mut frames = Vec::new();
    go(Some(&mut frames));
    let mut times = [0; 3].map(|_| go(None));
    times.sort_by(f64::total_cmp);
    let error = judged.error(&frames);
    let failure = match error {
        error if !error.is_finite() => Some(Failure::Overflow),
        1.0.. => Some(Failure::Wrong),
        _ => None,
    };
    let (substeps, iterations) = if E::NAME.starts_with("Avian") { (count, 1) } else { (1, count) };
    Point {
        engine: E::NAME.into(),
        scene: judged.name.into(),
        model: "default".into(),
        number: "f32".into(),
        step: step.0.into(),
        seconds: digits(step.1),
        substeps,
        iterations,
        error: error.is_finite().then_some(digits(error.max(1e-16))),
        failure,
        cost: digits(times[1] * 1e9 / scene.duration / balls.len() as f64),
        real_time: digits(scene.duration / times[1]),
        note: E::defaults(),
    }
}

fn main() -> std::io::Result<()> {
    let arguments: Vec<_> = std::env::args().skip(1).collect();
    let quick = arguments.iter().any(|word| word == "--quick");
    let mut words = arguments.iter().filter(|word| !word.starts_with("--"));
    let file = words.next().map_or("peers.jsonl", String::as_str);
    let only = words.next().map_or("", String::as_str);
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global().expect("once");
    eprintln!("{}: {}", Rapier::NAME, Rapier::defaults());
    eprintln!("{}: {}", Avian::NAME, Avian::defaults());
    let mut points = Vec::new();
    for judged in SCENES.iter().filter(|scene| scene.name.contains(only)) {
        for (i, step) in STEPS.into_iter().enumerate() {
            for count in COUNTS {
                if quick && !([1, 3].contains(&i) && [1, 4, 8].contains(&count)) {
                    continue;
                }
                points.push(run::<Rapier>(judged, step, count));
                points.push(run::<Avian>(judged, step, count));
            }
            eprintln!("{} at {}", judged.name, step.0);
        }
    }
    write_points(file.as_ref(), &points)
}
