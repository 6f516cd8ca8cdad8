//! Impacts within a step are told, with the speed at which they happen.

use cgmath::{InnerSpace, Zero};
use taw::motion::WallMotion;
use taw::prelude::*;
use taw::shape::Aabb;

use super::{floor, world};

/// Marble of this restitution, without friction.
pub fn ball<S: Scalar>(position: [f64; 3], velocity: [f64; 3], radius: f64, e: f64) -> Marble<S> {
    let material =
        Material { restitution: S::from_f64(e), friction: S::zero(), ..Material::default() };
    Marble {
        velocity: Vec3::from(velocity.map(S::from_f64)),
        material: Some(material),
        ..Marble::new(Point3::from(position.map(S::from_f64)), S::from_f64(radius))
    }
}

/// Bounces of a ball that falls by a metre on a half-space or on a box, as speeds in m/s.
fn bounces<S: Scalar>(substeps: u32, restitution: f64, seconds: f64, on_box: bool) -> Vec<f64> {
    let mut world = world::<S>(substeps);
    if on_box {
        let (x, zero) = (S::from_f64(5.0), S::zero());
        let (min, max) = (Point3::new(-x, -x, -x), Point3::new(x, zero, x));
        world.walls.insert(Aabb { min, max }).unwrap();
    } else {
        floor(&mut world);
    }
    world.marbles.insert(ball([0.0, 1.1, 0.0], [0.0; 3], 0.1, restitution)).unwrap();
    let mut told = Vec::new();
    for _ in 0..(seconds * 64.0) as u32 {
        world.step(S::from_f64(1.0 / 64.0)).unwrap();
        assert!(world.impacts().len() <= 1);
        for point in world.impacts().iter().map(|impact| impact.point) {
            assert!(point.y.as_f64().abs() < 1e-3 && point.x == S::zero(), "{point:?}");
        }
        told.extend(world.impacts().iter().map(|impact| impact.approach_speed.as_f64()));
    }
    told
}

#[test]
fn every_bounce_is_told_once_and_how_hard_it_is() {
    for (substeps, on_box) in [(1, false), (2, false), (4, false), (1, true), (4, true)] {
        let single = bounces::<f32>(substeps, 0.8, 2.4, on_box);
        for told in [single, bounces::<f64>(substeps, 0.8, 2.4, on_box)] {
            // After .45, 1.17, 1.75 and 2.21 s.
            assert_eq!(told.len(), 4, "{told:?}");
            for (told, right) in told.iter().zip([4.429, 3.543, 2.835, 2.268]) {
                assert!((told / right - 1.0).abs() < 0.01, "{substeps}: {told} {right}");
            }
        }
        let told = bounces::<f32>(substeps, 0.0, 2.0, on_box);
        // What is left of it may be told in the next step, too.
        assert!(told.len() <= 2 && (told[0] / 4.429 - 1.0).abs() < 0.01, "{told:?}");
    }
}

/// However a bounce lies in its step: one that gravity alone brings to the floor within the step kept
/// none of its speed.
#[test]
fn every_random_bounce_keeps_what_restitution_leaves() {
    let (mut bounces, mut random) = (0, fastrand::Rng::with_seed(1));
    for number in 0..1_000 {
        let mut world = world::<f32>(1 << random.u32(0..3));
        floor(&mut world);
        let (e, height) = (0.3 + 0.7 * random.f64(), 0.2 + 2.0 * random.f64());
        world.marbles.insert(ball([0.0, 0.1 + height, 0.0], [0.0; 3], 0.1, e)).unwrap();
        let dt = [1.0 / 30.0, 1.0 / 60.0, 1.0 / 64.0, 1.0 / 240.0][random.usize(0..4)];
        for _ in 0..(1.5 / dt) as u32 {
            world.step(dt).unwrap();
            let Some(impact) = world.impacts().first() else { continue };
            // Above the speed that counts as rest, and with a flight of more than a step.
            let speed = f64::from(impact.approach_speed);
            if speed * e > 4.0 * 9.81 * f64::from(dt) {
                let rises = f64::from(world.marbles.velocity()[0].y);
                let energy =
                    0.5 * rises * rises + 9.81 * (f64::from(world.marbles.position()[0].y) - 0.1);
                let kept = energy / (0.5 * speed * speed * e * e);
                assert!((kept - 1.0).abs() < 0.02, "{number}: {kept} of the energy, {speed} m/s");
                bounces += 1;
            }
        }
    }
    assert!(bounces > 1_500, "{bounces}");
}

/// Two balls that fly at each other, or past: by the event-driven response and by this one.
#[test]
fn random_pairs_meet_as_the_event_driven_response_says() {
    let (mut met, mut missed) = (0, 0);
    for seed in 0..2_000 {
        let mut random = fastrand::Rng::with_seed(seed);
        let mut within = |low: f64, high: f64| low + (high - low) * random.f64();
        let radii = [within(0.02, 0.2), within(0.02, 0.2)];
        let mut ball = |side: f64, radius: f64| {
            let position = [side * 0.6, within(-0.3, 0.3), within(-0.1, 0.1)];
            let velocity = [-side * within(0.2, 4.0), within(-0.5, 0.5), 0.0];
            let mass = Mass::Density(10_f64.powf(within(1.0, 4.0)));
            Marble { mass, ..ball::<f64>(position, velocity, radius, 0.5) }
        };
        let balls = [ball(-1.0, radii[0]), ball(1.0, radii[1])];
        let run = |response| {
            let mut world = world::<f64>(2);
            world.set_model(Model { response, ..world.model() }).unwrap();
            world.set_gravity(Vec3::zero()).unwrap();
            for ball in &balls {
                world.marbles.insert(*ball).unwrap();
            }
            let mut told = Vec::new();
            for _ in 0..60 {
                world.step(1.0 / 60.0).unwrap();
                told.extend(
                    world.impacts().iter().map(|impact| (impact.approach_speed, impact.normal)),
                );
            }
            told
        };
        let (right, told) = (run(Response::EventDriven), run(Response::SoftStep));
        // What is slower than gravity makes of rest is a contact from the start.
        let grazes = right.first().is_some_and(|(speed, _)| *speed < 0.05);
        assert!(right.len() == told.len() || grazes, "{seed}: {right:?} {told:?}");
        if let ([(speed, normal)], [(other, its)], false) = (&right[..], &told[..], grazes) {
            assert!((speed - other).abs() < 1e-3 * speed, "{seed}: {speed} {other}");
            assert!((normal - its).magnitude() < 1e-3, "{seed}: {normal:?} {its:?}");
        }
        met += right.len();
        missed += usize::from(right.is_empty());
    }
    assert!(met > 300 && missed > 300, "{met} {missed}");
}

#[test]
fn who_is_stopped_on_the_way_has_met_nobody() {
    let mut world = world::<f32>(2);
    world.set_gravity(Vec3::zero()).unwrap();
    let (min, max) = (Point3::new(-0.01, -1.0, -1.0), Point3::new(0.01, 1.0, 1.0));
    world.walls.insert(Aabb { min, max }).unwrap();
    let flies = world.marbles.insert(ball([-0.25, 0.0, 0.0], [20.0, 0.0, 0.0], 0.1, 0.5)).unwrap();
    let waits = world.marbles.insert(ball([0.12, 0.0, 0.0], [0.0; 3], 0.1, 0.5)).unwrap();
    world.step(1.0 / 60.0).unwrap();
    let told: Vec<_> = world.impacts().iter().map(|impact| (impact.on_wall, impact.b)).collect();
    assert_eq!(told, [(true, world.marbles.row(flies).unwrap() as u32)]);
    assert_eq!(world.marbles.get(waits).unwrap().velocity, Vec3::zero());
}

#[test]
fn marbles_that_come_and_go_between_the_verbs_are_no_impacts() {
    for insert in [false, true] {
        let mut world = world::<f32>(1);
        floor(&mut world);
        let other = world.marbles.insert(ball([1.0, 5.0, 0.0], [0.0; 3], 0.1, 0.5)).unwrap();
        let falls = ball([0.0, 0.11, 0.0], [0.0, -3.0, 0.0], 0.1, 0.5);
        world.marbles.insert(falls).unwrap();
        world.begin_step();
        world.integrate(1.0 / 60.0).unwrap();
        world.generate_contacts();
        if insert {
            world.marbles.insert(ball([2.0, 5.0, 0.0], [0.0; 3], 0.1, 0.5)).unwrap();
        } else {
            world.marbles.remove(other).unwrap();
        }
        world.restitute(1.0 / 60.0).unwrap();
        assert!(world.impacts().len() <= 1);
        assert!(world.impacts().iter().all(|impact| impact.on_wall && impact.approach_speed > 2.9));
    }
}

/// A plate that strikes a ball at rest throws it by its restitution, and is told once, with its speed,
/// however it lies in the step.
#[test]
fn what_a_moving_wall_strikes_is_told() {
    for (i, substeps) in [1, 2, 4, 1, 2, 4, 1, 4].into_iter().enumerate() {
        for restitution in [0.0, 0.6] {
            let mut world = world::<f64>(substeps);
            world.set_gravity(Vec3::zero()).unwrap();
            let id = world.marbles.insert(ball([0.0; 3], [0.0; 3], 0.2, restitution)).unwrap();
            let row = world.marbles.row(id).unwrap() as u32;
            let plate = |x: f64| Aabb {
                min: Point3::new(x - 0.1, -1.0, -1.0),
                max: Point3::new(x, 1.0, 1.0),
            };
            let start = -0.6 - 0.01 * i as f64;
            let (dt, speed) = (1.0 / 64.0, 4.0);
            let wall = world.walls.insert(plate(start)).unwrap();
            let mut told = Vec::new();
            for step in 1..=20 {
                let x = start + speed * dt * f64::from(step);
                world.walls.set(wall, plate(x)).unwrap();
                let (velocity, pivot) = (Vec3::unit_x() * speed, Point3::new(x, 0.0, 0.0));
                let motion = WallMotion { velocity, angular_velocity: Vec3::zero(), pivot };
                world.walls.set_motion(wall, Some(motion)).unwrap();
                world.step(dt).unwrap();
                told.extend(world.impacts().iter().filter(|it| it.approach_speed > 0.5).copied());
            }
            let case = format!("{substeps}, {start}, {restitution}: {told:?}");
            assert_eq!(told.len(), 1, "{case}");
            assert_eq!((told[0].on_wall, told[0].b, told[0].normal), (true, row, Vec3::unit_x()));
            assert!((told[0].approach_speed - speed).abs() < 1e-3, "{case}");
            assert!((told[0].point.x + 0.2).abs() < 1e-3, "{case}");
            let leaves = world.marbles.velocity()[row as usize].x;
            assert!((leaves - (1.0 + restitution) * speed).abs() < 1e-3, "{leaves} m/s, {case}");
        }
    }
}
