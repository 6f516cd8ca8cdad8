//! Scenes with a known outcome, under `Response::EventDriven`.

use crate::draw::Draw;
use taw::prelude::*;

const G: f64 = 9.81;

fn world<S: Scalar>(rotation: Rotation) -> World<S> {
    let mut world = World::default();
    let model = Model {
        response: Response::EventDriven,
        precision: Precision::Compensated,
        rotation,
        ..Model::default()
    };
    world.set_model(model).unwrap();
    world
}

fn floor<S: Scalar>(rotation: Rotation) -> World<S> {
    let mut world = world(rotation);
    world.walls.insert(Plane::new(Vec3::unit_y(), S::zero()).unwrap()).unwrap();
    world
}

fn surface<S: Scalar>(restitution: f64, friction: f64) -> Material<S> {
    let (restitution, friction) = (S::from_f64(restitution), S::from_f64(friction));
    Material { restitution, friction, ..Material::default() }
}

fn run<S: Scalar>(world: &mut World<S>, dt: f64, seconds: f64) {
    for _ in 0..(seconds / dt).round() as u32 {
        world.step(S::from_f64(dt)).unwrap();
    }
}

#[test]
fn elastic_bounces_keep_their_height_at_every_step() {
    for dt in [1.0 / 30.0, 1.0 / 60.0, 1.0 / 240.0, 1e-3, 1e-4] {
        let mut world = floor::<f32>(Rotation::None);
        let marble = Marble {
            material: Some(surface(1.0, 0.0)),
            ..Marble::new(Point3::new(0.0, 5.0, 0.0), 0.1)
        };
        let id = world.marbles.insert(marble).unwrap();
        let energy = |world: &World<f32>| {
            let marble = world.marbles.get(id).unwrap();
            let v = f64::from(marble.velocity.y);
            f64::from(9.81_f32) * f64::from(marble.position.y) + 0.5 * v * v
        };
        let start = energy(&world);
        for step in 0..(20.0 / dt) as u32 {
            world.step(dt as f32).unwrap();
            let off = energy(&world) / start - 1.0;
            assert!(off.abs() < 1e-6, "off by {off} after {step} steps of {dt}");
        }
    }
}

#[test]
fn a_zeno_ball_comes_to_rest_at_its_time() {
    for e in [0.5, 0.8_f64] {
        for dt in [1.0 / 60.0, 1e-3] {
            let mut world = floor::<f32>(Rotation::None);
            let marble = Marble {
                material: Some(surface(e, 0.0)),
                ..Marble::new(Point3::new(0.0, 1.5, 0.0), 0.5)
            };
            let id = world.marbles.insert(marble).unwrap();
            let stop = (2.0 / G).sqrt() * (1.0 + e) / (1.0 - e);
            let mut rested = 0.0;
            for step in 1..(6.0 / dt) as u32 {
                world.step(dt as f32).unwrap();
                let marble = world.marbles.get(id).unwrap();
                if marble.velocity.y != 0.0 {
                    rested = f64::from(step) * dt;
                }
            }
            assert!((rested - stop).abs() < dt + 1e-3 * stop, "{rested} s, not {stop} s");
            assert_eq!(world.marbles.get(id).unwrap().position.y, 0.5);
        }
    }
}

#[test]
fn galperin_counts_the_digits_of_pi() {
    for (n, count) in [(0, 3), (1, 31), (2, 314), (3, 3141), (4, 31415)] {
        assert_eq!(galperin::<f32>(n), count, "100^{n}");
    }
    // Nearly all of them in one step, within its budget.
    assert_eq!(galperin::<f64>(6), 3_141_592);
}

/// Number of collisions of a ball with a wall and one that is 100^n times as heavy.
fn galperin<S: Scalar>(n: i32) -> usize {
    let number = S::from_f64;
    let mut world = world::<S>(Rotation::None);
    world.set_gravity(Vec3::new(S::zero(), S::zero(), S::zero())).unwrap();
    world.walls.insert(Plane::new(Vec3::unit_x(), S::zero()).unwrap()).unwrap();
    for (x, mass, v) in [(1.0, 1.0, 0.0), (3.0, 100_f64.powi(n), -1.0)] {
        let marble = Marble {
            velocity: Vec3::new(number(v), S::zero(), S::zero()),
            mass: Mass::Kilograms(number(mass)),
            material: Some(surface(1.0, 0.0)),
            ..Marble::new(Point3::new(number(x), S::zero(), S::zero()), number(0.5))
        };
        world.marbles.insert(marble).unwrap();
    }
    let step = |world: &mut World<S>| {
        world.step(number(1.0 / 60.0)).unwrap();
        world.impacts().len()
    };
    (0..600).map(|_| step(&mut world)).sum()
}

#[test]
fn a_cradle_passes_the_speed_on_whatever_the_gaps() {
    for gap in [0.0, 1e-4, 1e-2] {
        let mut world = world::<f32>(Rotation::None);
        world.set_gravity(Vec3::new(0.0, 0.0, 0.0)).unwrap();
        let ids = [0, 1, 2, 3, 4].map(|i| {
            let marble = Marble {
                velocity: Vec3::new(if i == 0 { 1.0 } else { 0.0 }, 0.0, 0.0),
                material: Some(surface(1.0, 0.0)),
                ..Marble::new(Point3::new(i as f32 * (1.0 + gap), 0.0, 0.0), 0.5)
            };
            world.marbles.insert(marble).unwrap()
        });
        run(&mut world, 1.0 / 60.0, 1.0);
        let speeds = ids.map(|id| world.marbles.get(id).unwrap().velocity.x);
        for (speed, exact) in speeds.into_iter().zip([0.0, 0.0, 0.0, 0.0, 1.0]) {
            assert!((speed - exact).abs() < 1e-6, "{speeds:?}");
        }
    }
}

#[test]
fn a_sliding_ball_rolls_at_its_moment() {
    for dt in [1.0 / 30.0, 1.0 / 60.0, 1.0 / 240.0, 1e-3] {
        for heading in [0.0_f64, 0.3, 0.8, 2.0] {
            let mut world = floor::<f32>(Rotation::Dynamic);
            let toward = Vec3::new(heading.cos(), 0.0, heading.sin());
            let velocity = (toward * 5.0).map(|x| x as f32);
            let marble = Marble {
                velocity,
                material: Some(surface(0.0, 0.3)),
                ..Marble::new(Point3::new(0.0, 0.5, 0.0), 0.5)
            };
            let id = world.marbles.insert(marble).unwrap();
            run(&mut world, dt, 2.0);
            let steps = (2.0 / dt).round();
            let time = steps * f64::from(dt as f32);
            let marble = world.marbles.get(id).unwrap();
            let (v, x) = (marble.velocity.map(f64::from), marble.position.to_vec().map(f64::from));
            let (mu, g) = (f64::from(0.3_f32), f64::from(9.81_f32));
            let stop = 2.0 * 5.0 / (7.0 * mu * g);
            let way = 5.0 * stop - 0.5 * mu * g * stop * stop + 25.0 / 7.0 * (time - stop);
            assert!((v - toward * (25.0 / 7.0)).magnitude() < 1e-6, "{v:?} in steps of {dt}");
            assert!((x.dot(toward) / way - 1.0).abs() < 2e-7, "{x:?}, not {way}, steps of {dt}");
            assert!(v.cross(toward).magnitude() / 5.0 < 1e-7);
        }
    }
}

#[test]
fn a_fast_ball_between_two_walls_bounces_as_often_as_it_must() {
    let mut world = world::<f64>(Rotation::None);
    world.set_gravity(Vec3::new(0.0, 0.0, 0.0)).unwrap();
    for (normal, offset) in [(Vec3::unit_x(), 0.0), (-Vec3::unit_x(), -1.01)] {
        world.walls.insert(Plane::new(normal, offset).unwrap()).unwrap();
    }
    let marble = Marble {
        velocity: Vec3::new(100.0, 0.0, 0.0),
        material: Some(surface(0.99, 0.0)),
        ..Marble::new(Point3::new(0.505, 0.0, 0.0), 0.5)
    };
    let id = world.marbles.insert(marble).unwrap();
    world.step(1.0 / 60.0).unwrap();
    // A centimetre at 100 m/s, and each time a hundredth slower.
    let bounces = world.impacts().len();
    assert!((95..=101).contains(&bounces), "{bounces} bounces");
    let exact = (0..bounces).fold(100.0, |speed, _| speed * 0.99);
    let speed = world.marbles.get(id).unwrap().velocity.x.abs();
    assert!((speed / exact - 1.0).abs() < 1e-12, "{speed} m/s, not {exact}");
}

#[test]
fn no_wall_moves_a_marble_of_infinite_mass() {
    let mut world = floor::<f32>(Rotation::None);
    let at = Point3::new(0.0, 0.1, 0.0);
    let peg = Marble { mass: Mass::Infinite, ..Marble::new(at, 0.5) };
    let id = world.marbles.insert(peg).unwrap();
    run(&mut world, 1.0 / 60.0, 1.0);
    assert_eq!(world.marbles.get(id).unwrap().position, at);
}

/// A marble of any kind, somewhere in a box of two metres, overlapping whatever is there.
fn any_marble(draw: &mut Draw) -> Marble<f32> {
    let mut number = |low, high| draw.between(low, high) as f32;
    let position = Point3::new(number(-1.0, 1.0), number(0.0, 3.0), number(-1.0, 1.0));
    let fast = if number(0.0, 1.0) > 0.9 { 1e4 } else { 3.0 };
    let velocity = Vec3::new(number(-fast, fast), number(-fast, fast), number(-fast, fast));
    let material = Material {
        restitution: number(0.0, 1.0).round() * number(0.0, 1.0),
        friction: number(0.0, 1.0),
        tangential_restitution: number(-1.0, 1.0),
        rolling_resistance: number(0.0, 0.1),
        spinning_resistance: number(0.0, 0.1),
        ..Material::default()
    };
    let kinds = [Mass::default(), Mass::Kilograms(number(1e-6, 1e6)), Mass::Infinite];
    Marble {
        velocity,
        mass: kinds[(number(0.0, 10.0) as usize).saturating_sub(7).min(2)],
        material: Some(material),
        ..Marble::new(position, number(0.05, 0.3))
    }
}

#[test]
fn any_scene_stays_finite_inside_and_the_same_for_clones() {
    for seed in 0..8 {
        let mut draw = Draw(seed);
        let mut world = floor::<f32>(Rotation::Dynamic);
        for normal in [Vec3::unit_x(), -Vec3::unit_x(), Vec3::unit_z(), -Vec3::unit_z()] {
            world.walls.insert(Plane::new(normal, -1.5).unwrap()).unwrap();
        }
        for _ in 0..40 {
            world.marbles.insert(any_marble(&mut draw)).unwrap();
        }
        let mut clone = world.clone();
        for step in 0..120 {
            if step % 7 == 3 {
                let row = draw.between(0.0, world.marbles.len() as f64) as usize;
                let marble = any_marble(&mut draw);
                for world in [&mut world, &mut clone] {
                    let id = world.marbles.id(row).unwrap();
                    world.marbles.remove(id).unwrap();
                    world.marbles.insert(marble).unwrap();
                }
            }
            world.step(1.0 / 60.0).unwrap();
            clone.step(1.0 / 60.0).unwrap();
            assert_eq!(world, clone, "seed {seed}, step {step}");
            assert_eq!(world.stopped().count(), 0, "seed {seed}, step {step}");
        }
        for row in 0..world.marbles.len() {
            let Marble { position, radius, mass, .. } =
                world.marbles.get(world.marbles.id(row).unwrap()).unwrap();
            let inside = position.x.abs() < 1.5 && position.z.abs() < 1.5 && position.y > 0.0;
            // Nothing holds what has infinite mass.
            assert!(inside || mass == Mass::Infinite, "seed {seed}: {position:?}, radius {radius}");
        }
    }
}
