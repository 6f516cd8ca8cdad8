//! Rigid bodies that joints hold.

use super::*;
use taw::joint::{Joint, JointDrive, JointEnd, JointKind, JointMotor};

fn hinge(drive: JointDrive<f32>) -> JointKind<f32> {
    JointKind::Hinge(drive)
}

/// Complete elliptic integral of the first kind by the arithmetic–geometric mean (Gauss, 1799), of the modulus k.
fn elliptic(k: f64) -> f64 {
    let (mut a, mut b) = (1.0_f64, (1.0 - k * k).sqrt());
    for _ in 0..40 {
        (a, b) = ((a + b) * 0.5, (a * b).sqrt());
    }
    std::f64::consts::FRAC_PI_2 / a
}

/// Compound pendulum: a rod on a hinge at its end. Period to 1e-4 at 60 Hz, small and up to 170°.
#[test]
fn a_rod_on_a_hinge_swings_by_its_elliptic_integral() {
    let (half, wide) = (0.5, 0.05);
    for degrees in [5.0_f64, 60.0, 120.0, 170.0] {
        let angle = degrees.to_radians();
        let mut world = world::<f32>(false);
        let (x, y) = (angle.sin() * half, -angle.cos() * half);
        let rod = Body { rotation: about_z(angle), ..cuboid([wide, half, wide], point(x, y, 0.0)) };
        let rod = world.bodies.insert(rod).unwrap();
        let anchor = vector(0.0, half, 0.0);
        let ends = [JointEnd::world(point(0.0, 0.0, 0.0)), JointEnd::body(rod, anchor)];
        let kind = hinge(JointDrive::default());
        world.joints.insert(Joint::new(kind, ends)).unwrap();
        let inertia = (half * half + wide * wide) / 3.0 + half * half; // over the mass, about the hinge
        let expected = 4.0 * (inertia / (9.81 * half)).sqrt() * elliptic((angle * 0.5).sin());
        // From crossing to crossing of the lowest place, in one direction, over five periods.
        let (mut last, mut time, mut crossings) = (x, 0.0, Vec::new());
        while crossings.len() < 6 {
            step(&mut world);
            time += 1.0 / 60.0;
            let now = place(&world, rod).x;
            if last < 0.0 && now >= 0.0 {
                crossings.push(time - now / (now - last) / 60.0);
            }
            last = now;
            assert!(time < 60.0);
        }
        let period = (crossings[5] - crossings[0]) / 5.0;
        assert!((period / expected - 1.0).abs() < 1e-4, "{degrees}: {period}, not {expected}");
    }
}

/// A chain of 20 boxes bears a thousand times a link.
#[test]
fn a_chain_of_boxes_holds_a_load() {
    let mut world = world::<f32>(false);
    let mut before = JointEnd::world(point(0.0, 0.0, 0.0));
    let mut last = None;
    for i in 0..20 {
        let at = point(0.0, -0.1 - 0.2 * f64::from(i), 0.0);
        let density = if i == 19 { 1e6 } else { 1000.0 };
        let mass = taw::body::BodyMass::Uniform(Mass::Density(density));
        let link = Body { mass, ..cuboid([0.02, 0.1, 0.02], at) };
        let link = world.bodies.insert(link).unwrap();
        let top = JointEnd::body(link, vector(0.0, 0.1, 0.0));
        world.joints.insert(Joint::new(JointKind::BallAndSocket, [before, top])).unwrap();
        before = JointEnd::body(link, vector(0.0, -0.1, 0.0));
        last = Some(link);
    }
    let last = last.unwrap();
    world.bodies.set_velocity(last, vector(2.0, 0.0, 0.0), vector(0.0, 0.0, 0.0)).unwrap();
    for _ in 0..600 {
        step(&mut world);
        let far = place(&world, last).magnitude();
        assert!(far < 3.9 + 0.001, "{far}");
    }
}

/// A motor turns a wheel at its speed, and limits hold a door.
#[test]
fn motors_and_limits_of_bodies() {
    let mut world = world::<f32>(false);
    let wheel = world.bodies.insert(cuboid([0.3, 0.3, 0.05], point(0.0, 0.0, 0.0))).unwrap();
    let center = JointEnd::world(point(0.0, 0.0, 0.0));
    let ends = [center, JointEnd::body(wheel, vector(0.0, 0.0, 0.0))];
    let motor = Some(JointMotor::Speed { target: 3.0, max: 1e4 });
    world.joints.insert(Joint::new(hinge(JointDrive { motor, limits: None }), ends)).unwrap();
    let door = world.bodies.insert(cuboid([0.5, 0.05, 0.05], point(2.5, 0.0, 0.0))).unwrap();
    let ends =
        [JointEnd::world(point(2.0, 0.0, 0.0)), JointEnd::body(door, vector(-0.5, 0.0, 0.0))];
    let limits = Some([-0.5, 0.5]);
    world.joints.insert(Joint::new(hinge(JointDrive { motor: None, limits }), ends)).unwrap();
    run(&mut world, 5.0);
    assert!((spin(&world, wheel).z - 3.0).abs() < 3e-4, "{:?}", spin(&world, wheel));
    let at = place(&world, door);
    let angle = at.y.atan2(at.x - 2.0);
    assert!((angle + 0.5).abs() < 1e-3, "{angle}");
}

/// A marble on a rod to a body, and a joint that goes with its body.
#[test]
fn a_marble_hangs_on_a_body() {
    let mut world = world::<f32>(false);
    let bar = Body {
        mass: taw::body::BodyMass::Uniform(Mass::Infinite),
        ..cuboid([0.5, 0.05, 0.05], point(0.0, 0.0, 0.0))
    };
    let bar = world.bodies.insert(bar).unwrap();
    let marble = world.marbles.insert(taw::world::Marble::new(point(0.5, -1.0, 0.0), 0.1)).unwrap();
    let ends = [
        JointEnd::body(bar, vector(0.5, 0.0, 0.0)),
        JointEnd::marble(marble, vector(0.0, 0.0, 0.0)),
    ];
    world.joints.insert(Joint::new(JointKind::Distance([1.0, 1.0]), ends)).unwrap();
    run(&mut world, 5.0);
    let at = world.marbles.get(marble).unwrap().position;
    assert!((at - point(0.5, -1.0, 0.0)).magnitude() < 1e-3, "{at:?}");
    world.bodies.remove(bar).unwrap();
    step(&mut world);
    assert!(world.joints.is_empty());
}
