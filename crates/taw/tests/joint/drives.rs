//! Hinges, sliders, wheels and gears: limits, motors, and how they break.

use super::*;
use taw::joint::{JointDrive, JointMotor, JointSpring};
use taw::math::Quat;

/// World without gravity, a marble, and a joint of it with the place where it is.
fn on_place(kind: JointKind<f64>, gravity: f64) -> (World<f64>, MarbleId, taw::joint::JointId) {
    let mut world = world::<f64>(4);
    world.set_gravity(vector(0.0, -gravity, 0.0)).unwrap();
    let id = marble(&mut world, 0.0, 0.0, 0.0);
    let ends = [place(0.0, 0.0, 0.0), JointEnd::marble(id, vector(0.0, 0.0, 0.0))];
    let joint = join(&mut world, kind, ends);
    (world, id, joint)
}

fn spin(world: &World<f64>, id: MarbleId) -> Vec3<f64> {
    world.marbles.get(id).unwrap().angular_velocity
}

fn steps(world: &mut World<f64>, count: u32) {
    for _ in 0..count {
        step(world);
    }
}

const INERTIA: f64 = 0.4 * 0.01;

#[test]
fn a_motor_reaches_its_speed_by_its_torque() {
    let motor = Some(JointMotor::Speed { target: 2.0, max: INERTIA });
    let drive = JointDrive { motor, ..JointDrive::default() };
    let (mut world, id, joint) = on_place(JointKind::Hinge(drive), 9.81);
    steps(&mut world, 60);
    // A torque of as much as the moment of inertia: 1 rad/s².
    assert!((spin(&world, id).z - 1.0).abs() < 1e-9, "{:?}", spin(&world, id));
    assert!((world.joints.torque(joint).unwrap() / INERTIA - 1.0).abs() < 1e-9);
    steps(&mut world, 120);
    assert!((spin(&world, id) - Vec3::new(0.0, 0.0, 2.0)).magnitude() < 1e-9);
    assert!(world.joints.torque(joint).unwrap() < 1e-12);
    assert!(position(&world, id).magnitude() < 1e-9);
}

#[test]
fn a_servo_holds_its_angle() {
    let spring = JointSpring { frequency: 2.0, damping_ratio: 1.0 };
    let motor = Some(JointMotor::Position { target: 0.7, spring, max: f64::INFINITY });
    let drive = JointDrive { motor, ..JointDrive::default() };
    let (mut world, id, _) = on_place(JointKind::Hinge(drive), 0.0);
    steps(&mut world, 240);
    let rotation = world.marbles.get(id).unwrap().rotation;
    let angle = 2.0 * rotation.v.z.atan2(rotation.s);
    assert!((angle - 0.7).abs() < 1e-6, "{angle}");
}

#[test]
fn a_hinge_stops_at_its_limits() {
    for (speed, limit) in [(3.0, 0.5), (-3.0, -0.25)] {
        let drive = JointDrive { limits: Some([-0.25, 0.5]), motor: None };
        let (mut world, id, _) = on_place(JointKind::Hinge(drive), 0.0);
        world.marbles.set_angular_velocity(id, vector(0.0, 0.0, speed)).unwrap();
        steps(&mut world, 120);
        let rotation = world.marbles.get(id).unwrap().rotation;
        let angle = 2.0 * rotation.v.z.atan2(rotation.s);
        assert!((angle - limit).abs() < 1e-9 && spin(&world, id).magnitude() < 1e-9, "{angle}");
    }
}

/// Frame whose x axis goes down at 30° to the horizontal.
fn slope() -> Quat<f64> {
    Quat::from_sv((-15.0_f64).to_radians().cos(), Vec3::unit_z() * (-15.0_f64).to_radians().sin())
}

#[test]
fn a_slider_runs_down_its_slope_to_its_stop() {
    let drive = JointDrive { limits: Some([0.0, 2.0]), motor: None };
    let mut world = world::<f64>(4);
    let id = marble(&mut world, 0.0, 0.0, 0.0);
    let ends = [place(0.0, 0.0, 0.0), JointEnd::marble(id, vector(0.0, 0.0, 0.0))];
    join(&mut world, JointKind::Slider(drive), ends.map(|end| end.with_rotation(slope())));
    steps(&mut world, 30);
    let way = 0.5 * 9.81 * 0.5 * 0.25;
    assert!((position(&world, id).magnitude() / way - 1.0).abs() < 1e-9);
    steps(&mut world, 90);
    let stop = slope() * Vec3::new(2.0, 0.0, 0.0);
    assert!((position(&world, id) - stop).magnitude() < 1e-9, "{:?}", position(&world, id));
    assert!(velocity(&world, id).magnitude() < 1e-9);
}

#[test]
fn what_is_fixed_does_not_move() {
    let mut world = world::<f32>(4);
    let id = marble(&mut world, 1.0, 0.0, 0.0);
    let joint = join(
        &mut world,
        JointKind::Fixed,
        [place(0.0, 0.0, 0.0), JointEnd::marble(id, vector(-1.0, 0.0, 0.0))],
    );
    for _ in 0..600 {
        step(&mut world);
    }
    assert!((position(&world, id) - Vec3::new(1.0, 0.0, 0.0)).magnitude() < 1e-6);
    let load = [world.joints.force(joint).unwrap(), world.joints.torque(joint).unwrap()];
    assert!(load.iter().all(|load| (load - 9.81).abs() < 1e-3), "{load:?}");
}

#[test]
fn gears_hold_their_ratio() {
    let mut world = world::<f32>(4);
    world.set_gravity(vector(0.0, 0.0, 0.0)).unwrap();
    let ids = [0.0, 1.0].map(|x| marble(&mut world, x, 0.0, 0.0));
    let center = |id| JointEnd::marble(id, vector(0.0, 0.0, 0.0));
    let motor = Some(JointMotor::Speed { target: 3.0, max: 1.0 });
    let drives = [JointDrive { motor, limits: None }, JointDrive::default()];
    for ((id, x), drive) in ids.into_iter().zip([0.0, 1.0]).zip(drives) {
        join(&mut world, JointKind::Hinge(drive), [place(x, 0.0, 0.0), center(id)]);
    }
    join(&mut world, JointKind::Gear { ratio: 2.5 }, ids.map(center));
    for _ in 0..600 {
        step(&mut world);
    }
    let [a, b] = ids.map(|id| world.marbles.get(id).unwrap().angular_velocity.z);
    assert!((a - 3.0).abs() < 1e-4 && (a + 2.5 * b).abs() < 3e-4, "{a} {b}");
}

#[test]
fn a_wheel_drives_on_its_suspension() {
    let mut world = world::<f64>(4);
    world.walls.insert(Plane::new(Vec3::unit_y(), -0.1).unwrap()).unwrap();
    let [cart, wheel] = [1.0, 0.0].map(|y| marble(&mut world, 0.0, y, 0.0));
    let upright = Quat::from_sv(0.5_f64.sqrt(), Vec3::unit_z() * 0.5_f64.sqrt());
    // The cart does not fall over: it moves up and down on a carrier, which moves along x.
    let carrier = marble(&mut world, 0.0, 3.0, 0.0);
    let center = |id| JointEnd::marble(id, vector(0.0, 0.0, 0.0));
    let rail = JointKind::Slider(JointDrive::default());
    join(&mut world, rail, [place(0.0, 3.0, 0.0), center(carrier)]);
    join(&mut world, rail, [carrier, cart].map(|id| center(id).with_rotation(upright)));
    let spring = JointSpring { frequency: 3.0, damping_ratio: 0.7 };
    let motor = Some(JointMotor::Speed { target: -5.0, max: 1.0 });
    let drive = JointDrive { motor, limits: None };
    let kind = JointKind::Wheel { spring, travel: [-0.3, 0.3], drive };
    let axle = [JointEnd::marble(cart, vector(0.0, -1.0, 0.0)), center(wheel)];
    join(&mut world, kind, axle.map(|end| end.with_rotation(upright)));
    steps(&mut world, 300);
    // It rolls without slip, and the spring bears the cart.
    let speed = velocity(&world, wheel).x;
    assert!((speed - 0.5).abs() < 1e-3, "{speed}");
    assert!((position(&world, wheel).y).abs() < 1e-2, "{:?}", position(&world, wheel));
    let apart = velocity(&world, cart) - velocity(&world, wheel);
    assert!(apart.magnitude() < 1e-2, "{apart:?}");
}

#[test]
fn a_joint_breaks_by_what_is_too_much() {
    let broken_at = |force: f64, torque: f64| {
        let mut world = world::<f64>(4);
        let id = marble(&mut world, 1.0, 0.0, 0.0);
        let ends = [place(0.0, 0.0, 0.0), JointEnd::marble(id, vector(-1.0, 0.0, 0.0))];
        let joint = Joint {
            breaking_force: force,
            breaking_torque: torque,
            ..Joint::new(JointKind::Fixed, ends)
        };
        let joint = world.joints.insert(joint).unwrap();
        step(&mut world);
        let is_broken = world.joints.broken() == [joint];
        assert_eq!(is_broken, world.joints.get(joint).is_err());
        is_broken
    };
    let never = f64::INFINITY;
    assert!(!broken_at(never, never) && !broken_at(20.0, 20.0));
    assert!(broken_at(9.0, never) && broken_at(never, 9.0));
}
