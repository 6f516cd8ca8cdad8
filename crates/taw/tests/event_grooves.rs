//! Balls in grooves of two half-spaces, under `Response::EventDriven`, as gravity presses them into both.

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
#[ignore = "not mended: balls of 1 mm sink by .12 radii, of .1 mm by .89"]
fn a_tiny_ball_stays_out_of_both_faces() {
    for radius in [1e-3, 1e-4] {
        let depth = deepest(radius);
        assert!(depth < 1e-2, "a ball of {radius} m: {depth} radii");
    }
}

/// It depends on bits: one start in 39.
#[test]
#[ignore = "not mended: the whole budget of events goes for one ball, for seconds"]
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
