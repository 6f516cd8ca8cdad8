//! Forces, impulses, damping and limits of single marbles.

use cgmath::InnerSpace;
use taw::frame::Bivector;
use taw::motion::Medium;
use taw::prelude::*;
use taw::response::Elasticity;
use taw::world::{Damping, SpeedLimits};

/// A world without gravity and a ball of 2 kg and 0.5 m at the origin, whose moment of
/// inertia is 0.2 kg m².
fn one_ball(response: Response) -> (World<f64>, MarbleId) {
    let mut world = World::default();
    let model = Model { response, rotation: Rotation::Dynamic, ..Model::default() };
    world.set_model(model).unwrap();
    world.set_gravity(Vec3::new(0.0, 0.0, 0.0)).unwrap();
    let ball =
        Marble { mass: Mass::Kilograms(2.0), ..Marble::new(Point3::new(0.0, 0.0, 0.0), 0.5) };
    let id = world.marbles.insert(ball).unwrap();
    (world, id)
}

const RESPONSES: [Response; 5] = [
    Response::Displacement,
    Response::Impulse,
    Response::Penalty(ContactLaw::SpringDashpot),
    Response::Penalty(ContactLaw::HertzMindlin),
    Response::EventDriven,
];

#[test]
fn forces_and_torques_add_up_and_last_one_step() {
    for response in RESPONSES {
        let (mut world, id) = one_ball(response);
        world.marbles.apply_force(id, Vec3::new(3.0, 0.0, 0.0)).unwrap();
        world.marbles.apply_force(id, Vec3::new(1.0, 0.0, 0.0)).unwrap();
        let top = Point3::new(0.0, 0.5, 0.0);
        world.marbles.apply_force_at(id, Vec3::new(0.0, 0.0, 2.0), top).unwrap();
        world.marbles.apply_torque(id, Bivector { yz: 0.0, zx: 0.6, xy: 0.0 }).unwrap();
        for _ in 0..2 {
            world.step(0.25).unwrap();
            let ball = world.marbles.get(id).unwrap();
            assert!(
                (ball.velocity - Vec3::new(0.5, 0.0, 0.25)).magnitude() < 1e-15,
                "{response:?}"
            );
            // The lever along y and the force along z turn from y to z, about +x.
            let exact = Vec3::new(1.0 * 0.25 / 0.2, 0.6 * 0.25 / 0.2, 0.0);
            assert!(
                (ball.angular_velocity - exact).magnitude() < 1e-15,
                "{response:?}: {:?}",
                ball.angular_velocity
            );
        }
    }
}

#[test]
fn impulses_change_momentum_by_themselves() {
    let (mut world, id) = one_ball(Response::Impulse);
    let marbles = &mut world.marbles;
    let (impulse, point) = (Vec3::new(3.0, -1.0, 2.0), Point3::new(0.3, 0.1, -0.4));
    marbles.apply_impulse_at(id, impulse, point).unwrap();
    assert_eq!(marbles.momentum(id).unwrap(), impulse);
    let lever = Vec3::new(0.3, 0.1, -0.4);
    let turned = marbles.angular_momentum(id).unwrap() - Bivector::wedge(lever, impulse);
    assert!(turned.dual().magnitude() < 1e-15);
    marbles.apply_angular_impulse(id, -Bivector::wedge(lever, impulse)).unwrap();
    assert!(marbles.get(id).unwrap().angular_velocity.magnitude() < 1e-15);
    marbles.set_momentum(id, Vec3::new(0.0, 8.0, 0.0)).unwrap();
    assert_eq!(marbles.get(id).unwrap().velocity.y, 4.0);
    assert_eq!(world.momentum(), Vec3::new(0.0, 8.0, 0.0));
    assert_eq!(world.energy().total(), 16.0);
}

#[test]
fn what_cannot_be_right_is_refused_by_name_and_changes_nothing() {
    let (mut world, id) = one_ball(Response::Impulse);
    let before = world.clone();
    let bad = Vec3::new(0.0, f64::NAN, 0.0);
    let huge = Vec3::new(f64::MAX, 0.0, 0.0);
    let far = Point3::new(0.0, 1e10, 0.0);
    let origin = Point3::new(0.0, 0.0, 0.0);
    let marbles = &mut world.marbles;
    for (result, field) in [
        (marbles.apply_force(id, bad), "force.y"),
        (marbles.apply_force_at(id, huge, far), "torque.xy"),
        (marbles.apply_torque(id, bad), "torque.zx"),
        (marbles.apply_impulse(id, bad), "impulse.y"),
        (marbles.apply_impulse_at(id, huge, far), "impulse.xy"),
        (marbles.apply_impulse_at(id, bad, origin), "impulse.y"),
        (marbles.apply_angular_impulse(id, bad), "impulse.zx"),
        (marbles.set_momentum(id, bad), "momentum.y"),
        (marbles.set_damping(id, Damping { linear: -1.0, angular: 0.0 }), "damping.linear"),
    ] {
        let error = result.unwrap_err().to_string();
        assert!(error.starts_with(field), "{error}, not {field}");
    }
    let limits = SpeedLimits { linear: Some(0.0), angular: None };
    assert!(world.set_speed_limits(limits).is_err());
    let soft = Elasticity { youngs_modulus: 0.0, poissons_ratio: 0.3 };
    let material = Material { elasticity: soft, ..Material::default() };
    assert!(world.marbles.set_material(id, Some(material)).is_err());
    assert_eq!(world, before);
}

#[test]
fn there_is_no_limit_but_one_that_is_set() {
    for response in RESPONSES {
        let (mut world, id) = one_ball(response);
        let (v, w) = (Vec3::new(3e5, 0.0, 4e5), Vec3::new(0.0, 1e6, 0.0));
        world.marbles.set_velocity(id, v).unwrap();
        world.marbles.set_angular_velocity(id, w).unwrap();
        world.step(1e-3).unwrap();
        let ball = world.marbles.get(id).unwrap();
        assert_eq!((ball.velocity, ball.angular_velocity), (v, w), "{response:?}");
        let limits = SpeedLimits { linear: Some(10.0), angular: Some(100.0) };
        world.set_speed_limits(limits).unwrap();
        world.step(1e-3).unwrap();
        let ball = world.marbles.get(id).unwrap();
        assert!((ball.velocity - Vec3::new(6.0, 0.0, 8.0)).magnitude() < 1e-12, "{response:?}");
        assert!((ball.angular_velocity.y - 100.0).abs() < 1e-12, "{response:?}");
    }
}

#[test]
fn damping_leaves_its_part_whatever_the_step() {
    for response in RESPONSES {
        for steps in [1, 7, 100] {
            let (mut world, id) = one_ball(response);
            world.marbles.set_velocity(id, Vec3::new(4.0, 0.0, 0.0)).unwrap();
            world.marbles.set_angular_velocity(id, Vec3::new(0.0, 3.0, 0.0)).unwrap();
            let damping = Damping { linear: 0.5, angular: 30.0 };
            world.marbles.set_damping(id, damping).unwrap();
            (0..steps).for_each(|_| world.step(1.0 / f64::from(steps)).unwrap());
            let ball = world.marbles.get(id).unwrap();
            assert!((ball.velocity.x - 4.0 * (-0.5_f64).exp()).abs() < 1e-12, "{response:?}");
            assert!(
                (ball.angular_velocity.y - 3.0 * (-30.0_f64).exp()).abs() < 1e-12,
                "{response:?}"
            );
        }
    }
}

#[test]
fn compensated_precision_moves_where_plain_precision_stands() {
    for response in [Response::Displacement, Response::Impulse, Response::EventDriven] {
        let way = |precision| {
            let mut world = World::<f32>::default();
            let model = Model { response, precision, ..Model::default() };
            world.set_model(model).unwrap();
            world.set_gravity(Vec3::new(0.0, 0.0, 0.0)).unwrap();
            let ball = Marble {
                velocity: Vec3::new(1.0, 0.0, 0.0),
                ..Marble::new(Point3::new(1e6, 0.0, 0.0), 0.5)
            };
            let id = world.marbles.insert(ball).unwrap();
            (0..1000).for_each(|_| world.step(1.0 / 1024.0).unwrap());
            world.marbles.get_high_precision(id).unwrap().position.x - 1e6
        };
        assert_eq!(way(Precision::Plain), 0.0, "{response:?}");
        assert!((way(Precision::Compensated) - 1000.0 / 1024.0).abs() < 1e-9, "{response:?}");
    }
}

#[test]
fn drag_of_any_strength_only_slows() {
    let responses = [Response::Displacement, Response::SoftStep, Response::EventDriven];
    for integrator in Integrator::ALL {
        for (response, strength) in responses
            .iter()
            .flat_map(|response| [0.1, 2.0, 50.0, 1e6, 1e30].map(|k| (*response, k)))
        {
            let mut world = World::<f32>::default();
            world.set_model(Model { integrator, response, ..Model::default() }).unwrap();
            let wind = Vec3::new(0.0, 0.0, 0.0);
            world.set_gravity(wind).unwrap();
            let half =
                |linear, quadratic| ForceField::Drag(Medium { velocity: wind, linear, quadratic });
            world.set_forces(vec![half(strength, 0.0), half(0.0, strength)]).unwrap();
            let velocity = Vec3::new(1.0, -2.0, 0.5);
            let thrown = Marble { velocity, ..Marble::new(Point3::new(0.0, 1.0, 0.0), 0.01) };
            let id = world.marbles.insert(thrown).unwrap();
            let mut before = velocity.magnitude();
            for _ in 0..60 {
                world.step(1.0 / 60.0).unwrap();
                let speed = world.marbles.get(id).unwrap().velocity.magnitude();
                assert!(speed <= before * 1.000_001, "{integrator:?} {response:?} {strength}");
                before = speed;
            }
            assert!(before < 2.0, "{integrator:?} {response:?} {strength}: still {before} m/s");
        }
    }
}
