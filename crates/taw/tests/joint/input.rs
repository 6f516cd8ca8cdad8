//! Bad input, and joints that come and go.

use super::*;
use taw::Error;
use taw::joint::{JointDrive, JointMotor, JointSpring};

#[test]
fn bad_numbers_are_refused_by_name() {
    let mut world = world::<f32>(4);
    let id = marble(&mut world, 0.0, 0.0, 0.0);
    let end = JointEnd::marble(id, vector(0.0, 0.0, 0.0));
    let mut field = |kind| {
        let before = world.clone();
        let error = world.joints.insert(Joint::new(kind, [place(0.0, 0.0, 0.0), end])).unwrap_err();
        assert!(world == before, "an error changes nothing");
        error.to_string()
    };
    let spring = JointSpring { frequency: 1.0, damping_ratio: 0.1 };
    let hinge = |motor| JointKind::Hinge(JointDrive { limits: None, motor: Some(motor) });
    let limits = |limits| JointKind::Hinge(JointDrive { limits: Some(limits), motor: None });
    for (kind, name) in [
        (JointKind::Distance([2.0, 1.0]), "range"),
        (JointKind::Distance([-1.0, 1.0]), "range"),
        (JointKind::Distance([f32::NAN, 1.0]), "range"),
        (JointKind::Spring { length: -1.0, spring }, "length"),
        (
            JointKind::Spring { length: 1.0, spring: JointSpring { frequency: 0.0, ..spring } },
            "frequency",
        ),
        (
            JointKind::Spring {
                length: 1.0,
                spring: JointSpring { damping_ratio: -1.0, ..spring },
            },
            "damping_ratio",
        ),
        (JointKind::Gear { ratio: 0.0 }, "ratio"),
        (JointKind::Gear { ratio: f32::INFINITY }, "ratio"),
        (limits([-4.0, 0.0]), "limits"),
        (limits([1.0, 0.0]), "limits"),
        (hinge(JointMotor::Speed { target: f32::NAN, max: 1.0 }), "motor.target"),
        (hinge(JointMotor::Speed { target: 1.0, max: -1.0 }), "motor.max"),
        (hinge(JointMotor::Position { target: 4.0, spring, max: 1.0 }), "motor.target"),
        (JointKind::Wheel { spring, travel: [1.0, 0.0], drive: JointDrive::default() }, "travel"),
    ] {
        let message = field(kind);
        assert!(message.contains(name), "{kind:?}: {message}");
    }
}

#[test]
fn bad_ends_are_refused() {
    let mut world = world::<f32>(4);
    let id = marble(&mut world, 0.0, 0.0, 0.0);
    let end = JointEnd::marble(id, vector(0.0, 0.0, 0.0));
    let mut insert = |ends| world.joints.insert(Joint::new(JointKind::Fixed, ends)).unwrap_err();
    assert_eq!(insert([place(0.0, 0.0, 0.0); 2]), Error::NothingJoined);
    assert_eq!(insert([end, end]), Error::JoinedToItself);
    let nan = JointEnd::marble(id, vector(f64::NAN, 0.0, 0.0));
    assert!(matches!(insert([nan, place(0.0, 0.0, 0.0)]), Error::NotFinite { .. }));
    let long = end.with_rotation(taw::math::Quat::new(2.0, 0.0, 0.0, 0.0));
    assert!(matches!(insert([long, place(0.0, 0.0, 0.0)]), Error::NotUnit { .. }));
}

#[test]
fn other_responses_refuse_joints_and_change_nothing() {
    let mut world = world::<f32>(4);
    let id = marble(&mut world, 0.0, 0.0, 0.0);
    join(
        &mut world,
        JointKind::Fixed,
        [place(0.0, 0.0, 0.0), JointEnd::marble(id, vector(0.0, 0.0, 0.0))],
    );
    for response in [Response::Displacement, Response::Impulse, Response::EventDriven] {
        world.set_model(Model { response, ..Model::GAME }).unwrap();
        let before = world.clone();
        assert!(matches!(world.step(0.01), Err(Error::Unsupported { feature: "joints", .. })));
        assert!(world == before);
    }
}

#[test]
fn a_joint_goes_with_its_marble() {
    let mut world = world::<f32>(4);
    let ids = [0.0, 1.0, 2.0].map(|x| marble(&mut world, x, 0.0, 0.0));
    let joints = [[0, 1], [1, 2]].map(|pair| {
        let ends = pair.map(|i: usize| JointEnd::marble(ids[i], vector(0.0, 0.0, 0.0)));
        join(&mut world, JointKind::Distance([1.0; 2]), ends)
    });
    step(&mut world);
    world.marbles.remove(ids[0]).unwrap();
    step(&mut world);
    assert_eq!(world.joints.ids().collect::<Vec<_>>(), [joints[1]]);
    assert_eq!(world.joints.get(joints[0]), Err(Error::NoSuchJoint(joints[0])));
    assert!(world.joints.broken().is_empty());
    world.joints.remove(joints[1]).unwrap();
    step(&mut world);
    assert!(world.joints.is_empty());
}

#[test]
fn marbles_of_a_joint_pass_through_each_other_unless_they_collide() {
    for collides in [false, true] {
        let mut world = world::<f64>(4);
        world.set_gravity(vector(0.0, 0.0, 0.0)).unwrap();
        let ids = [0.0, 0.15].map(|x| marble(&mut world, x, 0.0, 0.0));
        let ends = ids.map(|id| JointEnd::marble(id, vector(0.0, 0.0, 0.0)));
        let joint = Joint {
            collide_connected: collides,
            ..Joint::new(JointKind::Distance([0.0, 1.0]), ends)
        };
        world.joints.insert(joint).unwrap();
        for _ in 0..60 {
            step(&mut world);
        }
        let apart = (position(&world, ids[1]) - position(&world, ids[0])).magnitude();
        assert_eq!(apart > 0.16, collides, "{apart}");
        assert_eq!(world.may_collide(ids[0], ColliderId::Marble(ids[1])), Ok(collides));
    }
}

/// The hand that holds a marble moves on in each step, turns, and lets it go.
#[test]
fn a_place_that_moves_carries_what_it_holds() {
    let mut world = world::<f32>(4);
    let id = marble(&mut world, 0.0, 0.0, 0.0);
    let ends = [place(0.0, 0.0, 0.0), JointEnd::marble(id, vector(0.0, 0.0, 0.0))];
    let joint = join(&mut world, JointKind::BallAndSocket, ends);
    for count in 1..=60 {
        let to = place(f64::from(count) / 60.0, f64::from(count) / 30.0, 0.0);
        world.joints.set(joint, Joint::new(JointKind::BallAndSocket, [to, ends[1]])).unwrap();
        step(&mut world);
        assert!((position(&world, id) - anchor(&world, to)).magnitude() < 1e-5);
        assert!((velocity(&world, id) - Vec3::new(1.0, 2.0, 0.0)).magnitude() < 1e-4);
    }
    world.joints.remove(joint).unwrap();
    step(&mut world);
    let expected = Vec3::new(1.0 + 1.0 / 60.0, 2.0 + 2.0 / 60.0 - 0.5 * 9.81 / 3600.0, 0.0);
    assert!((position(&world, id) - expected).magnitude() < 1e-4);
}

#[test]
fn a_pendulum_stops_at_a_wall() {
    let mut world = world::<f32>(4);
    world.walls.insert(Plane::new(Vec3::unit_x(), 0.0).unwrap()).unwrap();
    let id = marble(&mut world, 1.0, 0.0, 0.0);
    let ends = [place(0.0, 0.0, 0.0), JointEnd::marble(id, vector(-1.0, 0.0, 0.0))];
    join(&mut world, JointKind::BallAndSocket, ends);
    for _ in 0..1200 {
        step(&mut world);
        assert!(position(&world, id).x > 0.099, "{:?}", position(&world, id));
        let hook = anchor(&world, ends[1]);
        assert!(hook.magnitude() < 1e-3, "{hook:?}");
    }
    assert!(velocity(&world, id).magnitude() < 1e-2);
}

#[test]
fn a_clone_goes_on_with_the_same_bits_on_any_number_of_threads() {
    let mut world = world::<f32>(4);
    super::chains::chain(&mut world, 30, 50.0, Vec3::new(0.6, -0.8, 0.0), CollisionLayers::ALL);
    for _ in 0..30 {
        step(&mut world);
    }
    let mut other = world.clone();
    let model = taw::swarm::SwarmModel { threads: 2, ..other.swarm.model() };
    other.swarm.set_model(model).unwrap();
    for _ in 0..60 {
        step(&mut world);
        step(&mut other);
        assert!(world.marbles == other.marbles && world.joints == other.joints);
    }
}

/// Marbles, and whole lists of joints, come and go between the verbs of a step.
#[test]
fn joints_follow_what_happens_between_the_verbs() {
    let mut world = world::<f32>(4);
    let ids: Vec<_> = (0..4).map(|i| marble(&mut world, f64::from(i), 0.0, 0.0)).collect();
    let rod = |i: usize| {
        let ends = [ids[i], ids[i + 1]].map(|id| JointEnd::marble(id, vector(0.0, 0.0, 0.0)));
        Joint::new(JointKind::Distance([1.0; 2]), ends)
    };
    world.joints.insert(rod(0)).unwrap();
    step(&mut world);
    let saved = world.joints.clone();
    world.joints.insert(rod(1)).unwrap();
    world.joints.insert(rod(2)).unwrap();
    step(&mut world);
    // Fewer joints, with as many changes.
    world.joints = saved;
    world.joints.insert(rod(2)).unwrap();
    world.joints.insert(rod(1)).unwrap();
    let last = world.joints.ids().last().unwrap();
    world.joints.remove(last).unwrap();
    step(&mut world);
    for gone in [0, 3] {
        world.begin_step();
        world.integrate(1.0 / 60.0).unwrap();
        world.marbles.remove(ids[gone]).unwrap();
        world.generate_contacts();
        world.restitute(1.0 / 60.0).unwrap();
        world.end_step();
    }
    assert!(world.joints.is_empty());
    // One of a marble that is gone is taken out as soon as somebody steps.
    world.joints.insert(rod(0)).unwrap();
    world.restitute(1.0 / 60.0).unwrap();
    assert!(world.joints.is_empty());
}

#[test]
fn a_marble_of_infinite_mass_lifts_what_it_holds() {
    let mut world = world::<f32>(4);
    let ids = [0.0, 1.0].map(|x| marble(&mut world, x, 0.0, 0.0));
    world.marbles.set_mass(ids[0], Mass::Infinite).unwrap();
    world.marbles.set_velocity(ids[0], vector(0.0, 1.0, 0.0)).unwrap();
    let ends = [
        JointEnd::marble(ids[0], vector(0.0, 0.0, 0.0)),
        JointEnd::marble(ids[1], vector(-1.0, 0.0, 0.0)),
    ];
    join(&mut world, JointKind::Fixed, ends);
    for _ in 0..120 {
        step(&mut world);
    }
    assert!((position(&world, ids[1]) - Vec3::new(1.0, 2.0, 0.0)).magnitude() < 1e-4);
    assert!((velocity(&world, ids[1]) - Vec3::new(0.0, 1.0, 0.0)).magnitude() < 1e-4);
}

#[test]
fn a_suspension_without_stops_bears() {
    let mut world = world::<f64>(4);
    let id = marble(&mut world, 0.0, 0.0, 0.0);
    let spring = JointSpring { frequency: 2.0, damping_ratio: 1.0 };
    let travel = [f64::NEG_INFINITY, f64::INFINITY];
    let kind = JointKind::Wheel { spring, travel, drive: JointDrive::default() };
    let upright = taw::math::Quat::from_sv(0.5_f64.sqrt(), Vec3::unit_z() * 0.5_f64.sqrt());
    let ends = [place(0.0, 0.0, 0.0), JointEnd::marble(id, vector(0.0, 0.0, 0.0))];
    join(&mut world, kind, ends.map(|end| end.with_rotation(upright)));
    for _ in 0..300 {
        step(&mut world);
    }
    let sag = 9.81 / (2.0 * std::f64::consts::TAU).powi(2);
    assert!((position(&world, id).y / -sag - 1.0).abs() < 2e-3, "{:?}", position(&world, id));
    assert!(velocity(&world, id).magnitude() < 1e-4);
}
