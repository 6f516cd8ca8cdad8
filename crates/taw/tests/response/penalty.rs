//! Forces that grow with the overlap: what they give back, what they bear, and that they make
//! nothing from nothing.

use cgmath::{EuclideanSpace, InnerSpace, One, Zero};
use taw::math::Quat;
use taw::prelude::*;
use taw::response::Elasticity;
use taw::shape::Obb;

const BOTH: [ContactLaw; 2] = [ContactLaw::SpringDashpot, ContactLaw::HertzMindlin];
const INTEGRATORS: [Integrator; 3] =
    [Integrator::ExplicitEuler, Integrator::SemiImplicitEuler, Integrator::VelocityVerlet];

fn world<S: Scalar>(law: ContactLaw, integrator: Integrator) -> World<S> {
    let response = Response::Penalty(law);
    let rotation = Rotation::Dynamic;
    let mut world = World::default();
    let model = Model { response, rotation, integrator, ..Model::default() };
    world.set_model(model).unwrap();
    world
}

fn material(restitution: f64, friction: f64) -> Material<f64> {
    let elasticity = Elasticity { youngs_modulus: 1e7, poissons_ratio: 0.25 };
    Material { restitution, friction, elasticity, ..Material::default() }
}

#[test]
fn a_collision_gives_back_the_restitution_that_is_asked_for() {
    for law in BOTH {
        for integrator in INTEGRATORS {
            for asked in [0.0, 0.05, 0.1, 0.2, 0.3, 0.5, 0.7, 0.9, 1.0] {
                for (with_wall, ratio) in [(true, 1.0), (false, 1.0), (false, 1e-4), (false, 50.0)]
                {
                    for phase in 0..7 {
                        let mut world = world::<f64>(law, integrator);
                        world.set_gravity(Vec3::zero()).unwrap();
                        let radius = 0.1;
                        let own = material(asked, 0.3);
                        let ball = |x: f64, v: f64, mass: f64| Marble {
                            velocity: Vec3::new(v, 0.0, 0.0),
                            mass: Mass::Kilograms(mass),
                            material: Some(own),
                            ..Marble::new(Point3::new(x, 0.0, 0.0), radius)
                        };
                        let speed = 1.0;
                        // Not always at the same moment of a substep.
                        let apart = 0.01 + f64::from(phase) / 7.0 * 1e-3;
                        if with_wall {
                            let wall = Plane::new(-Vec3::unit_x(), 0.0).unwrap();
                            world.walls.insert(wall).unwrap();
                        } else {
                            world.marbles.insert(ball(radius, 0.0, 2.0)).unwrap();
                        }
                        let mass = 2.0 * ratio;
                        let id = world.marbles.insert(ball(-radius - apart, speed, mass)).unwrap();
                        // A wall is two times as stiff as a ball, and softened by that.
                        let shared = if with_wall { mass } else { mass * 2.0 / (mass + 2.0) };
                        let dt = match law {
                            ContactLaw::SpringDashpot => 1e-3,
                            ContactLaw::HertzMindlin => {
                                let longest =
                                    own.elasticity.max_substep(2.0 * shared, radius, speed);
                                longest.min(1e-3)
                            }
                        };
                        for _ in 0..(0.2 / dt) as u32 {
                            world.step(dt).unwrap();
                        }
                        let first = if with_wall { 0.0 } else { world.marbles.velocity()[0].x };
                        let second = world.marbles.get(id).unwrap().velocity.x;
                        let found = first - second;
                        // Which moment of a substep it begins decides the rest.
                        let tolerance = if asked == 0.0 { 0.02 } else { 0.01 };
                        assert!(
                            (found - asked).abs() < tolerance,
                            "{law:?}, {integrator:?}, wall {with_wall}, masses 1 : {ratio}, phase \
                             {phase}: {found}, not {asked}"
                        );
                    }
                }
            }
        }
    }
}

fn floor(world: &mut World<f64>) {
    world.walls.insert(Plane::new(Vec3::unit_y(), 0.0).unwrap()).unwrap();
}

fn ball(at: [f64; 3], radius: f64, material: Material<f64>) -> Marble<f64> {
    Marble { material: Some(material), ..Marble::new(Point3::from(at), radius) }
}

fn fastest(world: &World<f64>) -> f64 {
    world.marbles.velocity().iter().map(|v| v.magnitude()).fold(0.0, f64::max)
}

#[test]
fn what_lies_reports_no_speed_and_does_not_move() {
    for law in BOTH {
        for integrator in Integrator::ALL {
            let mut world = world::<f64>(law, integrator);
            floor(&mut world);
            for i in 0..3 {
                let at = [0.0, 0.1 + 0.2 * f64::from(i), 0.0];
                world.marbles.insert(ball(at, 0.1, material(0.3, 0.3))).unwrap();
            }
            for _ in 0..3_000 {
                world.step(1e-3).unwrap();
            }
            let before = world.marbles.position().to_vec();
            world.step(1e-3).unwrap();
            for (before, after) in before.iter().zip(world.marbles.position()) {
                assert!((after - before).magnitude() < 1e-9, "{law:?}, {integrator:?}");
            }
            // Of a swing that dies away; g dt is 1e-2.
            assert!(fastest(&world) < 1e-6, "{law:?}, {integrator:?}: {} m/s", fastest(&world));
        }
    }
}

#[test]
fn a_ball_that_touches_many_surfaces_at_once_gains_nothing() {
    for law in BOTH {
        for restitution in [0.0, 0.5, 1.0] {
            for planes in [1, 6, 40] {
                let mut world = world::<f64>(law, Integrator::VelocityVerlet);
                for i in 0..planes {
                    let turn = f64::from(i);
                    let normal = Vec3::new(0.01 * turn.sin(), 1.0, 0.01 * turn.cos()).normalize();
                    world.walls.insert(Plane::new(normal, 0.0).unwrap()).unwrap();
                }
                let own = material(restitution, 0.0);
                world.marbles.insert(ball([0.0, 0.4, 0.0], 0.1, own)).unwrap();
                let start = world.energy().total();
                for _ in 0..3_000 {
                    world.step(1e-3).unwrap();
                    // The phase of a substep in which touches begin: (ω dt)² / 8 of the energy.
                    let energy = world.energy().total();
                    assert!(energy < start * 1.01, "{law:?}, {planes}: {energy} J, not {start}");
                }
            }
        }
    }
}

#[test]
fn masses_and_materials_of_any_size_gain_nothing() {
    for law in BOTH {
        for (ratio, modulus) in [(1e2, 1e7), (1e-2, 1e7), (1e4, 1e9), (1.0, 1e15), (1e2, 1e15)] {
            let mut world = world::<f64>(law, Integrator::VelocityVerlet);
            floor(&mut world);
            let elasticity = Elasticity { youngs_modulus: modulus, poissons_ratio: 0.25 };
            let own = Material { elasticity, ..material(0.5, 0.5) };
            for (i, density) in [1000.0, 1000.0 * ratio, 1000.0].into_iter().enumerate() {
                let at = [0.01 * i as f64, 0.2 + 0.25 * i as f64, 0.0];
                let spin = Vec3::new(3.0, 1.0, -5.0);
                let mass = Mass::Density(density);
                world
                    .marbles
                    .insert(Marble { mass, angular_velocity: spin, ..ball(at, 0.1, own) })
                    .unwrap();
            }
            let start = world.energy().total();
            for _ in 0..2_000 {
                world.step(1e-3).unwrap();
                let energy = world.energy().total();
                assert!(energy < start * 1.01, "{law:?}, 1 : {ratio}, {modulus} Pa: {energy} J");
                assert!(world.stopped().count() == 0);
            }
        }
    }
}

#[test]
fn what_begins_squeezed_parts_slowly() {
    for law in BOTH {
        let mut world = world::<f64>(law, Integrator::SemiImplicitEuler);
        world.set_gravity(Vec3::zero()).unwrap();
        for i in 0..30 {
            let turn = f64::from(i);
            let at = [1e-3 * turn.sin(), 1e-3 * (2.0 * turn).cos(), 1e-3 * (3.0 * turn).sin()];
            world.marbles.insert(ball(at, 0.1, material(1.0, 0.3))).unwrap();
        }
        let mut most = 0.0_f64;
        for _ in 0..3_000 {
            world.step(1e-3).unwrap();
            most = most.max(fastest(&world));
        }
        // Two part at half a radius in a second; each is pushed by up to 29.
        assert!(most < 0.2, "{law:?}: {most} m/s");
    }
}

#[test]
fn a_turning_wall_drives_a_ball_no_faster_than_itself() {
    for law in BOTH {
        for dt in [1e-3, 1.0 / 60.0] {
            let mut world = world::<f64>(law, Integrator::SemiImplicitEuler);
            floor(&mut world);
            let spin = Vec3::new(0.0, 7.0, 0.0);
            let id = world.walls.id(0).unwrap();
            let motion = taw::motion::WallMotion {
                velocity: Vec3::zero(),
                angular_velocity: spin,
                pivot: Point3::origin(),
            };
            world.walls.set_motion(id, Some(motion)).unwrap();
            for i in 0..8 {
                let at = [0.3 * f64::from(i), 0.1, 0.0];
                world.marbles.insert(ball(at, 0.1, material(0.5, 0.8))).unwrap();
            }
            for _ in 0..(2.0 / dt) as u32 {
                world.step(dt).unwrap();
                let is_itself = world == world.clone();
                assert!(is_itself, "nothing remembered is NaN");
                // The surface goes so fast where the ball is; half as much for what rolls off.
                for (at, v) in world.marbles.position().iter().zip(world.marbles.velocity()) {
                    let surface = 7.0 * at.to_vec().magnitude();
                    assert!(v.magnitude() < 1.5 * surface + 1.0, "{law:?}, {dt}: {v:?} at {at:?}");
                }
            }
        }
    }
}

/// A ball over a ring of balls that nothing moves, which are `spread` times as far from each other
/// as if they touched.
fn over_a_ring(law: ContactLaw, count: usize, spread: f64, own: Material<f64>) -> World<f64> {
    let mut world = world::<f64>(law, Integrator::SemiImplicitEuler);
    let (radius, half_angle) = (0.4, std::f64::consts::PI / count as f64);
    let ring = radius * spread / half_angle.sin();
    for i in 0..count {
        let (sin, cos) = (2.0 * half_angle * i as f64).sin_cos();
        let fixed = ball([ring * cos, 0.0, ring * sin], radius, own);
        let mass = Mass::Kilograms(1e12);
        world.marbles.insert(Marble { mass, gravity_scale: 0.0, ..fixed }).unwrap();
    }
    let height = (4.0 * radius * radius - ring * ring).sqrt();
    world.marbles.insert(ball([0.0, height, 0.0], radius, own)).unwrap();
    world
}

#[test]
fn a_ball_on_three_or_four_others_sinks_in_no_further_than_the_docs_say() {
    for law in BOTH {
        for restitution in [0.0, 0.3] {
            for friction in [0.0, 0.5] {
                for (count, spread, dt) in
                    [(3, 1.0, 60.0), (4, 1.0, 60.0), (3, 1.0, 30.0), (4, 1.1, 60.0), (3, 1.4, 60.0)]
                {
                    let dt = 1.0 / dt;
                    let mut world =
                        over_a_ring(law, count, spread, material(restitution, friction));
                    for _ in 0..(10.0 / dt) as u32 {
                        world.step(dt).unwrap();
                    }
                    let [other, ball] = [0, count].map(|row| world.marbles.position()[row]);
                    let distance = (ball - other).magnitude();
                    // Each contact bears its part of the weight along the line of centers.
                    let borne = distance / (count as f64 * ball.y);
                    // And hertz: 3 mm at 1e7 Pa, in series with what the substep allows.
                    let allowed = 26.0 * borne * 9.81 * dt * dt + 3e-3;
                    assert!(
                        0.8 - distance < allowed && ball.y > 0.0,
                        "{law:?}, e {restitution}, µ {friction}, {count} at {spread}, {dt} s: \
                         {} m, not {allowed}, at {ball:?}",
                        0.8 - distance
                    );
                    // Hertz's spring is soft where dashpots bear nearly all: a swing in what gravity
                    // adds in a substep.
                    let swing = fastest(&world);
                    assert!(swing < 0.05 * 9.81 * dt, "{law:?}: {swing} m/s");
                }
            }
        }
    }
}

#[test]
fn what_friction_holds_on_a_slope_stays_there() {
    for law in BOTH {
        for integrator in Integrator::ALL {
            for rolling_resistance in [None, Some(0.5)] {
                let mut world = world::<f64>(law, integrator);
                // A ball that cannot turn, or one whose rolling is resisted.
                let rotation =
                    if rolling_resistance.is_some() { Rotation::Dynamic } else { Rotation::None };
                world.set_model(Model { rotation, ..world.model() }).unwrap();
                world.set_gravity(Vec3::new(3.0, -9.0, 0.0)).unwrap();
                floor(&mut world);
                let rolling_resistance = rolling_resistance.unwrap_or(0.0);
                let own = Material { rolling_resistance, ..material(0.3, 0.8) };
                world.marbles.insert(ball([0.0, 0.1, 0.0], 0.1, own)).unwrap();
                let mut run = || {
                    for _ in 0..600 {
                        world.step(1.0 / 60.0).unwrap();
                    }
                    world.marbles.position()[0].x
                };
                let (before, after) = (run(), run());
                // A swing of the contact's springs dies away; gravity alone would go 150 m.
                assert!(
                    (after - before).abs() < 1e-6,
                    "{law:?}, {integrator:?}: {before}, {after}"
                );
            }
        }
    }
}

#[test]
fn a_ball_that_sinks_beyond_the_middle_of_a_thin_wall_comes_back_on_its_side() {
    for law in BOTH {
        for detection in [Detection::Discrete, Detection::Swept] {
            let mut world = world::<f64>(law, Integrator::SemiImplicitEuler);
            world.set_model(Model { detection, ..world.model() }).unwrap();
            let center = Point3::new(0.0, -0.005, 0.0);
            let sheet = Obb::new(center, Quat::one(), Vec3::new(0.5, 0.005, 0.5));
            world.walls.insert(sheet.unwrap()).unwrap();
            let start = ball([0.0, 0.2, 0.0], 0.1, material(0.9, 0.5));
            // 33 mm in a substep, so 170 mm deep by 16 of them in a collision: beyond the middle.
            let id = world.marbles.insert(Marble { velocity: Vec3::new(0.0, -8.0, 0.0), ..start });
            for _ in 0..240 {
                world.step(1.0 / 240.0).unwrap();
            }
            let ball = world.marbles.get(id.unwrap()).unwrap();
            assert!(ball.position.y > 0.0, "{law:?}, {detection:?}: {:?}", ball.position);
        }
    }
}

/// Largest part by which the energy of a world without gravity is above its start at the end of one
/// of these steps.
fn gained(world: &mut World<f64>, steps: u32) -> f64 {
    let before = world.energy().total();
    let mut gained = 0.0_f64;
    for _ in 0..steps {
        world.step(1.0 / 60.0).unwrap();
        gained = gained.max(world.energy().total() / before - 1.0);
    }
    gained
}

fn elastic_world(law: ContactLaw, integrator: Integrator, substeps: u32) -> World<f64> {
    let mut world = world(law, integrator);
    let model = Model { substeps, ..world.model() };
    world.set_model(model).unwrap();
    world.set_gravity(Vec3::zero()).unwrap();
    world
}

/// Their normal turns while they overlap: a force along that of another moment changes energy.
#[test]
fn elastic_balls_that_meet_obliquely_gain_nothing() {
    let mut random = fastrand::Rng::with_seed(3);
    let mut coordinate = || random.f64() * 2.0 - 1.0;
    let mut vector = || Vec3::new(coordinate(), coordinate(), coordinate());
    for law in BOTH {
        for integrator in INTEGRATORS {
            for speed in [1.0, 3.0, 10.0, 30.0] {
                for pair in 0..100 {
                    let mut world = elastic_world(law, integrator, 16);
                    for _ in 0..2 {
                        let (velocity, aside) = (vector() * speed, vector() * 0.1);
                        let from = aside - velocity * (0.3 / speed);
                        let ball = ball(from.into(), 0.1, material(1.0, 0.0));
                        let angular_velocity = vector() * (speed / 0.1);
                        let spinning = Marble { velocity, angular_velocity, ..ball };
                        world.marbles.insert(spinning).unwrap();
                    }
                    let before = world.energy().total();
                    let [a, b] = [0, 1].map(|row: usize| world.marbles.position()[row]);
                    if (a - b).magnitude() < 0.2 {
                        continue; // they would begin with energy that is not counted
                    }
                    let gained = gained(&mut world, (72.0 / speed) as u32 + 20);
                    let name = format!("{law:?}, {integrator:?}, {speed} m/s, pair {pair}");
                    assert!(gained < 1e-9, "{name}: {gained:e}");
                    // Beyond, they sink in by more than their radius.
                    let lost = 1.0 - world.energy().total() / before;
                    assert!(lost < 0.05 || speed > 3.0, "{name} loses {lost}");
                }
            }
        }
    }
}

#[test]
fn a_crowd_of_elastic_balls_in_a_box_gains_nothing() {
    let mut random = fastrand::Rng::with_seed(3);
    let mut coordinate = || random.f64() * 2.0 - 1.0;
    for law in BOTH {
        for (substeps, speed) in [(1, 3.0), (4, 3.0), (4, 10.0), (16, 3.0), (16, 10.0), (16, 30.0)]
        {
            let mut world = elastic_world(law, Integrator::default(), substeps);
            for axis in 0..3 {
                for side in [-1.0, 1.0] {
                    let mut normal = Vec3::zero();
                    normal[axis] = side;
                    world.walls.insert(Plane::new(normal, -1.0).unwrap()).unwrap();
                }
            }
            for i in 0..64 {
                let at = [i % 4, i / 4 % 4, i / 16].map(|k| 0.4 * f64::from(k) - 0.6);
                let velocity = Vec3::new(coordinate(), coordinate(), coordinate()) * speed;
                let ball = ball(at, 0.1, material(1.0, 0.0));
                world.marbles.insert(Marble { velocity, ..ball }).unwrap();
            }
            let gained = gained(&mut world, 240);
            assert!(gained < 1e-3, "{law:?}, {substeps} substeps, {speed} m/s: {gained:e}");
        }
    }
}

/// The nearest point of the capsule moves along with the ball.
#[test]
fn nothing_brakes_a_ball_without_friction_on_a_capsule() {
    for law in BOTH {
        for integrator in INTEGRATORS {
            let mut world = world::<f64>(law, integrator);
            let lying = ball([0.0; 3], 0.1, material(0.0, 0.0));
            let lying =
                Marble { half_length: 2.0, mass: Mass::Infinite, gravity_scale: 0.0, ..lying };
            let axis = world.marbles.insert(lying).unwrap();
            let along = world.marbles.get(axis).unwrap().rotation * Vec3::unit_y();
            let above = along.cross(Vec3::unit_x()).normalize();
            world.set_gravity(above * -9.81).unwrap();
            let sliding = ball((above * 0.2 - along).into(), 0.1, material(0.0, 0.0));
            let id = world.marbles.insert(Marble { velocity: along, ..sliding }).unwrap();
            for _ in 0..60 {
                world.step(1.0 / 60.0).unwrap();
            }
            let ball = world.marbles.get(id).unwrap();
            let name = format!("{law:?}, {integrator:?}: {ball:?}");
            assert!((ball.velocity.dot(along) - 1.0).abs() < 1e-3, "{name}");
            assert!((ball.position - Point3::origin()).dot(above) > 0.1, "{name}");
        }
    }
}
