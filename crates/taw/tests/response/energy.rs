//! No energy from nothing, by [`Response::Impulse`] and other models of games: scenes that once made some, and thousands
//! that nobody chose.

use proptest::prelude::*;
use taw::prelude::*;
use taw::shape::Mesh;
use taw::world::{Energy, WallMotion};

/// Metres per second squared.
const G: f64 = 9.81;

/// With the integrator whose velocities are those at the end of the step: the others' are half a
/// step ahead or behind, which would look like energy.
fn impulse(rotation: Rotation, iterations: u32) -> Model {
    let integrator = Integrator::VelocityVerlet;
    Model { response: Response::Impulse, integrator, rotation, iterations, ..Model::default() }
}

/// The other models of games: of discrete detection, and the plugin's. Their velocities are those at
/// the end of the step, too.
fn others() -> [Model; 2] {
    let detection = Detection::Discrete;
    [Model { detection, ..impulse(Rotation::Dynamic, 8) }, Model::GAME]
}

fn world<S: Scalar>(model: Model) -> World<S> {
    let mut world = World::default();
    world.set_model(model).unwrap();
    world
}

fn vector<S: Scalar>(v: [f64; 3]) -> Vec3<S> {
    Vec3::new(S::from_f64(v[0]), S::from_f64(v[1]), S::from_f64(v[2]))
}

fn plane<S: Scalar>(normal: [f64; 3], through: [f64; 3]) -> Plane<S> {
    Plane::through(Point3::from_vec(vector(through)), vector::<S>(normal).normalize()).unwrap()
}

fn surface<S: Scalar>(friction: f64, restitution: f64) -> Material<S> {
    let (friction, restitution) = (S::from_f64(friction), S::from_f64(restitution));
    Material { friction, restitution, ..Material::default() }
}

fn marble<S: Scalar>(at: [f64; 3], radius: f64, velocity: [f64; 3], m: Material<S>) -> Marble<S> {
    let marble = Marble::new(Point3::from_vec(vector(at)), S::from_f64(radius));
    Marble { velocity: vector(velocity), material: Some(m), ..marble }
}

/// Per kilogram: a ball at that speed falls into a corner of floor and wall, which may turn it
/// back but not hasten it. The one step that is looked at begins where it touches neither.
fn leaves_the_corner_at(
    model: Model,
    ball: ([f64; 3], f64, [f64; 3], [f64; 3]),
    m: [f64; 2],
) -> [f64; 2] {
    let (at, radius, velocity, spin) = ball;
    let mut world = world::<f32>(model);
    world.walls.insert(plane([0.0, 1.0, 0.0], [0.0, -1.0, 0.0])).unwrap();
    world.walls.insert(plane([0.0, 0.0, -1.0], [0.0, 0.0, 1.0])).unwrap();
    let marble = marble(at, radius, velocity, surface(m[0], m[1]));
    let id = world.marbles.insert(Marble { angular_velocity: vector(spin), ..marble }).unwrap();
    let mass = world.energy().kinetic / (0.5 * vector::<f64>(velocity).magnitude2());
    let before = world.energy().total();
    world.step(1.0 / 60.0).unwrap();
    let speed = world.marbles.get(id).unwrap().velocity.magnitude();
    [f64::from(speed), (world.energy().total() - before) / mass]
}

#[test]
fn a_ball_leaves_a_corner_no_faster_than_it_came() {
    let ball = (
        [0.322_898_92, -0.845_287_1, 0.845_215_5],
        0.150_487_78,
        [-0.401_609_33, -2.082_149_5, 0.772_253_75],
        [5.131_670_5, 0.0, 2.668_717_1],
    );
    let swept = [1, 2, 4, 8, 20, 50].map(|iterations| impulse(Rotation::Dynamic, iterations));
    let discrete = swept.map(|model| Model { detection: Detection::Discrete, ..model });
    for model in swept.into_iter().chain(discrete).chain([Model::GAME]) {
        let [speed, gain] = leaves_the_corner_at(model, ball, [0.7, 0.9]);
        assert!(speed < 2.4 && gain < 0.05, "{model:?}: {speed} m/s, {gain} J/kg");
    }
}

/// Friction above 1 on both walls: what the ball presses on one, it turns into pressure on the
/// other, without end.
#[test]
fn a_ball_that_two_walls_jam_is_not_lifted_out_with_energy() {
    let bouncing = ([0.0, -0.960_654, 0.933_467], 0.05, [0.0, -0.214_353, 1.789_525], [0.0; 3]);
    let resting = (
        [0.0, -0.554_188, 0.552_828],
        0.445_812,
        [0.0, -0.136_167, 0.026_445],
        [8.472_302, 0.0, 0.0],
    );
    for iterations in 1..30 {
        let model = impulse(Rotation::Dynamic, iterations);
        let [_, gain] = leaves_the_corner_at(model, bouncing, [1.422_485, 1.0]);
        assert!(gain < 0.010_654 * G, "{iterations} iterations: {gain} J/kg");
        let [_, gain] = leaves_the_corner_at(model, resting, [1.323_375, 0.0]);
        assert!(gain < 1e-4, "{iterations} iterations: {gain} J/kg");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(20_000))]

    #[test]
    fn no_ball_leaves_a_corner_faster_than_it_came(
        gap in [-0.02..0.02_f64, -0.02..0.02],
        radius in 0.05..0.5_f64,
        velocity in [-3.0..3.0_f64, -3.0..0.0, 0.0..3.0],
        spin in [-10.0..10.0_f64, -10.0..10.0, -10.0..10.0],
        friction in 0.0..1.5_f64,
        restitution in prop_oneof![Just(0.0), Just(0.9), Just(1.0), 0.0..1.0_f64],
        iterations in 1..20_u32,
    ) {
        let at = [0.0, -1.0 + radius + gap[0], 1.0 - radius - gap[1]];
        let [_, gain] = leaves_the_corner_at(impulse(Rotation::Dynamic, iterations), (at, radius, velocity, spin), [friction, restitution]);
        let energy = 0.5 * vector::<f64>(velocity).magnitude2() + 0.2 * (vector::<f64>(spin) * radius).magnitude2();
        // Overlap of the start is pushed out, against gravity.
        let lift = G * (-gap[0]).max(0.0);
        // What friction holds at the end of a step fell for half of it at most: 2/7 of a rolling
        // ball's energy there.
        let held = (G / 60.0 / 2.0).powi(2) / 7.0;
        prop_assert!(gain <= 1e-4 * energy + lift + held, "{gain} of {energy} J/kg");
    }
}

#[test]
fn no_ball_leaves_a_corner_faster_than_it_came_by_other_models() {
    let mut random = fastrand::Rng::with_seed(1);
    for model in others() {
        for ball in 0..4_000 {
            let model = Model { iterations: [4, 8, 20][ball % 3], ..model };
            let mut any = || random.f64();
            let radius = 0.05 + 0.25 * any();
            // It touches neither wall yet.
            let at = [0.0, -1.0 + radius + 0.01 * any(), 1.0 - radius - 0.01 * any()];
            let velocity = [3.0 * any() - 1.5, -3.0 * any(), 3.0 * any()];
            let spin = [20.0 * any() - 10.0, 20.0 * any() - 10.0, 20.0 * any() - 10.0];
            let m = [[0.3, 0.5, 0.7, 0.8][ball % 4], 0.9];
            let [_, gain] = leaves_the_corner_at(model, (at, radius, velocity, spin), m);
            let energy = 0.5 * vector::<f64>(velocity).magnitude2()
                + 0.2 * (vector::<f64>(spin) * radius).magnitude2();
            // Rounding: a thousand times that of an `f32`.
            assert!(gain < 1e-4 * energy, "ball {ball}, {model:?}: {gain} of {energy} J/kg");
        }
    }
}

/// A mesh cone about the y axis with its vertex at the origin.
fn cone(triangles: u32, slope: f64) -> Mesh<f32> {
    let mut points = vec![vector([0.0; 3])];
    for i in 0..triangles {
        let (sin, cos) = (std::f64::consts::TAU * f64::from(i) / f64::from(triangles)).sin_cos();
        points.push(vector([2.0 * cos, 2.0 * slope, 2.0 * sin]));
    }
    let faces = (0..triangles).map(|i| [0, 1 + (i + 1) % triangles, 1 + i]).collect();
    Mesh::new(points.into_iter().map(Point3::from_vec).collect(), faces).unwrap()
}

#[test]
fn a_ball_at_the_bottom_of_a_cone_is_not_thrown_up() {
    let mut random = fastrand::Rng::with_seed(1);
    for _ in 0..100 {
        let triangles = random.u32(16..100);
        let slope = 0.2 + random.f64();
        let iterations = [1, 2, 4, 8, 50, 200][random.usize(..6)];
        let mut world = world::<f32>(impulse(Rotation::Dynamic, iterations));
        world.walls.insert(cone(triangles, slope)).unwrap();
        let high = 0.25 * (1.0 + slope * slope).sqrt() + 0.05 * random.f64();
        let mut any = || random.f64() - 0.5;
        let velocity = [3.0 * any(), -1.0 + any(), 3.0 * any()];
        let spin = vector([20.0 * any(), 20.0 * any(), 20.0 * any()]);
        let ball =
            marble([0.02 * any(), high, 0.02 * any()], 0.25, velocity, surface(1.0 + any(), 0.0));
        let id = world.marbles.insert(Marble { angular_velocity: spin, ..ball }).unwrap();
        let mass = world.energy().kinetic / (0.5 * vector::<f64>(velocity).magnitude2());
        let begin = world.energy().total() / mass;
        for step in 0..240 {
            world.step(1.0 / 60.0).unwrap();
            let gain = world.energy().total() / mass - begin;
            let at = world.marbles.get(id).unwrap().position;
            assert!(
                gain < 0.01 * G,
                "{triangles} triangles, {iterations} iterations: {gain} J/kg at {at:?} after step {step}"
            );
        }
    }
}

#[test]
fn a_ball_on_the_vertex_of_a_cone_gains_no_height_by_other_models() {
    let mut random = fastrand::Rng::with_seed(3);
    for model in others() {
        for run in 0..40 {
            let model = Model { iterations: [2, 4, 8, 50, 200][run % 5], ..model };
            let slope = 0.2 + random.f64();
            let mut world = world::<f32>(model);
            world.walls.insert(cone(random.u32(16..100), slope)).unwrap();
            let mut any = || random.f64() - 0.5;
            let at = [0.01 * any(), 0.25 * slope.hypot(1.0) + 0.03, 0.01 * any()];
            let velocity = [1.7 * any(), 1.7 * any(), 1.7 * any()];
            let ball = marble(at, 0.25, velocity, surface(0.8 + any(), 0.0));
            let angular_velocity = vector([20.0 * any(), 20.0 * any(), 20.0 * any()]);
            let mass = Mass::Kilograms(1.0);
            world.marbles.insert(Marble { angular_velocity, mass, ..ball }).unwrap();
            let begin = world.energy().total();
            for step in 0..240 {
                world.step(1.0 / 60.0).unwrap();
                let height = (world.energy().total() - begin) / G;
                // A twenty-fifth of its radius; it was kilometres.
                assert!(height < 0.01, "run {run}, {model:?}: {height} m in step {step}");
            }
        }
    }
}

/// A board of a floor and four rails that tilts about the x axis; walls' motions come from
/// differences of poses in `f32`, as an engine knows them.
struct Board {
    walls: Vec<(WallId, [f64; 3], [f64; 3])>,
    from: cgmath::Quaternion<f32>,
}

impl Board {
    fn new(world: &mut World<f32>) -> Self {
        let parts = [
            ([0.0, 1.0, 0.0], [0.0, 0.0, 0.0]),
            ([1.0, 0.0, 0.0], [-2.0, 0.0, 0.0]),
            ([-1.0, 0.0, 0.0], [2.0, 0.0, 0.0]),
            ([0.0, 0.0, 1.0], [0.0, 0.0, -2.0]),
            ([0.0, 0.0, -1.0], [0.0, 0.0, 2.0]),
        ];
        let walls = parts.map(|(n, p)| (world.walls.insert(plane::<f32>(n, p)).unwrap(), n, p));
        Self { walls: walls.to_vec(), from: cgmath::Quaternion::one() }
    }

    fn tilt(&mut self, world: &mut World<f32>, angle: f64, dt: f64) {
        let to = cgmath::Quaternion::from_axis_angle(Vec3::unit_x(), cgmath::Rad(angle as f32));
        let turn = to * self.from.conjugate();
        for (id, normal, through) in &self.walls {
            let (before, after) =
                (self.from * vector::<f32>(*through), to * vector::<f32>(*through));
            let wall =
                Plane::through(Point3::from_vec(after), (to * vector::<f32>(*normal)).normalize())
                    .unwrap();
            world.walls.set(*id, wall).unwrap();
            let spin = turn.v * (2.0 / dt as f32);
            let motion = WallMotion {
                velocity: (after - before) / dt as f32,
                angular_velocity: spin,
                pivot: Point3::from_vec(after),
            };
            world.walls.set_motion(*id, Some(motion)).unwrap();
        }
        self.from = to;
    }
}

#[test]
fn a_board_that_tilts_gently_kicks_no_ball() {
    let mut random = fastrand::Rng::with_seed(2);
    for board in 0..24 {
        let (substeps, iterations) = [(1, 8), (2, 10), (1, 50)][board % 3];
        let model = Model { substeps, ..impulse(Rotation::Dynamic, iterations) };
        let mut world = world::<f32>(model);
        let mut tilting = Board::new(&mut world);
        let m = surface(0.2 + random.f64(), 0.5 * random.f64());
        let ids: Vec<_> = (0..random.usize(1..12))
            .map(|i| {
                let at =
                    [-1.7 + 0.3 * i as f64, 0.1 + 0.05 * random.f64(), 3.0 * random.f64() - 1.5];
                world.marbles.insert(marble(at, 0.1, [0.0; 3], m)).unwrap()
            })
            .collect();
        let mut last = vec![Vec3::new(0.0_f32, 0.0, 0.0); ids.len()];
        for step in 0..1800 {
            let time = f64::from(step) / 60.0;
            let angle = 0.05 * (std::f64::consts::TAU * 0.25 * time).sin();
            tilting.tilt(&mut world, angle, 1.0 / 60.0);
            world.step(1.0 / 60.0).unwrap();
            for (id, last) in ids.iter().zip(&mut last) {
                let velocity = world.marbles.get(*id).unwrap().velocity;
                let kick = velocity.magnitude() - last.magnitude();
                assert!(kick < 0.8, "board {board}, {model:?}: {kick} m/s in step {step}");
                *last = velocity;
            }
        }
    }
}

fn glass_and_lead_gain_nothing<S: Scalar>(model: Model, runs: usize) {
    let mut random = fastrand::Rng::with_seed(3);
    for run in 0..runs {
        let rotation = [Rotation::None, Rotation::Rolling, Rotation::Dynamic][run % 3];
        let iterations = [20, 100, 1000][run / 3 % 3];
        let model = Model { rotation, iterations, ..model };
        let mut world = world::<S>(model);
        world.walls.insert(plane([0.0, 1.0, 0.0], [0.0; 3])).unwrap();
        world.walls.insert(plane([1.0, 0.2 * random.f64(), 0.0], [0.0; 3])).unwrap();
        world.walls.insert(plane([0.0, 0.2 * random.f64(), 1.0], [0.0; 3])).unwrap();
        let mut any = || random.f64();
        for (density, radius) in [(1.16, 0.1 + 0.3 * any()), (2500.0, 0.1 + 0.3 * any())] {
            let at = [radius + 0.3 * any(), radius + 0.6 * any(), radius + 0.3 * any()];
            let velocity = [-2.0 * any(), -2.0 * any(), -2.0 * any()];
            let ball = marble(at, radius, velocity, surface(1.0, 0.9));
            world
                .marbles
                .insert(Marble { mass: Mass::Density(S::from_f64(density)), ..ball })
                .unwrap();
        }
        // What only shows that it rolls has no energy of it.
        let energy = |world: &World<S>| {
            let Energy { kinetic, rotational: spin, potential } = world.energy();
            kinetic + potential + if rotation == Rotation::Dynamic { spin } else { 0.0 }
        };
        let begin = energy(&world);
        // Overlap is no energy, but to part it lifts what lies on it, by no more than it is deep.
        let [a, b] = [0, 1].map(|row| world.marbles.get(world.marbles.id(row).unwrap()).unwrap());
        let apart = (a.position - b.position).magnitude().as_f64();
        let depth = (a.radius.as_f64() + b.radius.as_f64() - apart).max(0.0);
        let weight = |ball: Marble<S>| G * ball.mass.of_capsule(ball.radius, S::zero()).as_f64();
        let weight = weight(a) + weight(b);
        for step in 0..300 {
            world.step(S::from_f64(1.0 / 60.0)).unwrap();
            let gain = energy(&world) - begin;
            assert!(
                gain < 2e-3 * begin + depth * weight,
                "run {run}, {model:?}: {gain} J of {begin} after step {step}"
            );
        }
    }
}

#[test]
fn balls_of_glass_and_lead_bounce_in_a_corner_without_gain() {
    let swept = impulse(Rotation::Dynamic, 8);
    glass_and_lead_gain_nothing::<f64>(swept, 200);
    for model in [swept, Model { detection: Detection::Discrete, ..swept }, Model::EXACT] {
        glass_and_lead_gain_nothing::<f32>(model, 90);
    }
}

#[test]
fn a_ball_beside_a_capsule_gains_nothing() {
    let mut random = fastrand::Rng::with_seed(4);
    for run in 0..200 {
        let mut world = world::<f64>(impulse(Rotation::Dynamic, [4, 8, 50][run % 3]));
        world.walls.insert(plane([0.0, 1.0, 0.0], [0.0; 3])).unwrap();
        let mut any = || random.f64() - 0.5;
        let still = surface(1.0, 0.0);
        let turn = cgmath::Quaternion::from_sv(any(), Vec3::new(any(), any(), any())).normalize();
        let capsule = Marble {
            half_length: 0.3,
            rotation: turn,
            ..marble([0.0, 0.6, 0.0], 0.15, [any(), any(), any()], still)
        };
        world.marbles.insert(capsule).unwrap();
        world
            .marbles
            .insert(marble(
                [0.5 + 0.2 * any(), 0.4, 0.2 * any()],
                0.2,
                [-2.0 + any(), any(), any()],
                still,
            ))
            .unwrap();
        let begin = world.energy().total();
        for step in 0..300 {
            world.step(1.0 / 60.0).unwrap();
            let gain = world.energy().total() - begin;
            assert!(gain < 0.01 * begin, "run {run}: {gain} J of {begin} after step {step}");
        }
    }
}

#[test]
fn elastic_balls_in_a_box_keep_their_energy_under_gravity() {
    for (rate, integrator) in [
        (64.0, Integrator::SemiImplicitEuler),
        (60.0, Integrator::VelocityVerlet),
        (120.0, Integrator::SemiImplicitEuler),
    ] {
        let mut random = fastrand::Rng::with_seed(5);
        let model = Model { integrator, ..impulse(Rotation::None, 8) };
        let mut world = world::<f64>(model);
        for (normal, through) in [
            ([0.0, 1.0, 0.0], 0.0),
            ([0.0, -1.0, 0.0], 3.0),
            ([1.0, 0.0, 0.0], -1.0),
            ([-1.0, 0.0, 0.0], -1.0),
            ([0.0, 0.0, 1.0], -1.0),
            ([0.0, 0.0, -1.0], -1.0),
        ] {
            let n = vector::<f64>(normal);
            let through = if normal[1] < 0.0 { 3.0 } else { through };
            let at = if normal[1] < 0.0 { [0.0, through, 0.0] } else { (n * through).into() };
            world.walls.insert(plane(normal, at)).unwrap();
        }
        for i in 0..12 {
            let at = [
                -0.6 + 0.6 * f64::from(i % 3),
                0.5 + 0.5 * f64::from(i / 3),
                0.1 * f64::from(i % 2),
            ];
            let mut any = || 8.0 * (random.f64() - 0.5);
            world
                .marbles
                .insert(marble(at, 0.1, [any(), any(), any()], surface(0.0, 1.0)))
                .unwrap();
        }
        let begin = world.energy().total();
        let mut most: f64 = 0.0;
        let mut least: f64 = 0.0;
        for _ in 0..(60.0 * rate) as u32 {
            world.step(1.0 / rate).unwrap();
            let gain = world.energy().total() / begin - 1.0;
            most = most.max(gain);
            least = least.min(gain);
        }
        println!("{rate} Hz {integrator:?}: {least} {most}");
        assert!(most < 0.02, "{rate} Hz, {integrator:?}: from {least} to {most}");
    }
}
