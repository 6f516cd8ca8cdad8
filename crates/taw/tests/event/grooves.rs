//! Balls in grooves of two half-spaces, under `Response::EventDriven`, as gravity presses them into both.

use cgmath::InnerSpace;
use taw::prelude::*;

/// Faces at right angles along the axes, gravity into both, and a frictionless ball that begins at rest
/// at so many radii from each.
fn groove(radius: f64, distance: f64) -> World<f64> {
    let mut world = World::default();
    world.set_model(Model::EXACT).unwrap();
    world.set_gravity(Vec3::new(-6.0, -8.0, 0.0)).unwrap();
    for normal in [Vec3::unit_x(), Vec3::unit_y()] {
        world.walls.insert(Plane::new(normal, 0.0).unwrap()).unwrap();
    }
    let at = distance * radius;
    let mut ball = Marble::new(Point3::new(at, at, 0.0), radius);
    let material = Material { restitution: 0.0, friction: 0.0, ..Material::default() };
    ball.material = Some(material);
    world.marbles.insert(ball).unwrap();
    world
}

/// Deepest that a ball is after any step of a second, in radii.
fn deepest(radius: f64) -> f64 {
    let mut world = groove(radius, 2.0);
    let depth = |_| {
        world.step(1.0 / 60.0).unwrap();
        let at = world.marbles.position()[0];
        1.0 - at.x.min(at.y) / radius
    };
    (0..60).map(depth).fold(0.0, f64::max)
}

#[test]
fn a_large_ball_stays_out_of_both_faces() {
    assert!(deepest(0.1) < 1e-3, "{} radii", deepest(0.1));
}

#[test]
fn a_tiny_ball_stays_out_of_both_faces() {
    for radius in [1e-2, 1e-3, 1e-4] {
        let depth = deepest(radius);
        assert!(depth < 5e-3, "a ball of {radius} m: {depth} radii");
    }
}

#[test]
fn a_ball_in_a_groove_needs_few_events() {
    for i in 1..40 {
        let distance = 1.0 + 0.1 * f64::from(i);
        let mut world = groove(0.1, distance);
        for step in 1..=60 {
            world.step(1.0 / 60.0).unwrap();
            assert_eq!(world.stopped().count(), 0, "from {distance} radii, step {step}");
        }
    }
}

/// Grooves that nobody chose: the angle between the faces, gravity into both or out of the second,
/// material, start and speed are random. No ball sinks deeper than the slop of .004 radii and a
/// little more, none spends its budget of events.
#[test]
fn balls_in_random_grooves_stay_out_and_need_few_events() {
    let mut rng = fastrand::Rng::with_seed(7);
    for case in 0..2_000 {
        let radius = [0.1, 1e-2, 1e-3, 1e-4][case % 4];
        let dt = [1.0 / 60.0, 4e-3, 0.1][case / 4 % 3];
        let count = [1, 1, 1, 3][case / 12 % 4];
        let (lean, opening) = (0.1 + 1.4 * rng.f64(), 0.4 + 2.2 * rng.f64());
        let mut world = World::<f64>::default();
        world.set_model(Model::EXACT).unwrap();
        world.set_gravity(Vec3::new(lean.sin(), lean.cos(), 0.0) * -10.0).unwrap();
        let normals = [Vec3::unit_y(), Vec3::new(opening.sin(), -opening.cos(), 0.0)];
        for normal in normals {
            world.walls.insert(Plane::new(normal, 0.0).unwrap()).unwrap();
        }
        let restitution = [0.0, 0.0, 0.5, 0.9][rng.usize(0..4)];
        let friction = [0.0, 0.0, 1e-9, 0.3][rng.usize(0..4)];
        let material = Material { restitution, friction, ..Material::default() };
        let half = 0.5 * opening;
        for ball in 0..count {
            let at = radius * ((1.0 + 3.0 * rng.f64()) / half.sin() + 2.1 * f64::from(ball));
            let at = Point3::new(at * half.cos(), at * half.sin(), 0.5 * radius * rng.f64());
            let mut ball = Marble::new(at, radius);
            ball.material = Some(material);
            world.marbles.insert(ball).unwrap();
        }
        for step in 0..60 {
            world.step(dt).unwrap();
            assert_eq!(world.stopped().count(), 0, "case {case}, step {step}");
            for at in world.marbles.position() {
                let at = Vec3::new(at.x, at.y, at.z);
                let depth = normals.map(|n| 1.0 - at.dot(n) / radius);
                assert!(depth[0].max(depth[1]) < 1e-2, "case {case}, step {step}: {depth:?}");
            }
        }
    }
}
