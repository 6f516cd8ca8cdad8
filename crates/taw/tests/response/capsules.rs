//! Marbles that are capsules: how they lie, fall over, roll, spin and collide.

use taw::contact::Contact;
use taw::frame::AxisAngle;
use taw::prelude::*;
use taw::shape::{Aabb, Mesh, Shape};

const DT: f64 = 1.0 / 60.0;

fn capsule(position: [f64; 3], tilt: f64) -> Marble<f64> {
    // About z: at a quarter it lies along x.
    let rotation = AxisAngle::new(Vec3::unit_z(), tilt).unwrap().into();
    Marble { half_length: 0.5, rotation, ..Marble::new(Point3::from(position), 0.25) }
}

fn dynamic(response: Response) -> Model {
    let integrator = Integrator::VelocityVerlet;
    Model { response, rotation: Rotation::Dynamic, iterations: 20, integrator, ..Model::default() }
}

fn world(model: Model) -> World<f64> {
    let mut world = World::default();
    world.set_model(model).unwrap();
    world
}

fn material(restitution: f64, friction: f64) -> Material<f64> {
    Material { restitution, friction, ..Material::default() }
}

fn axis(marble: &Marble<f64>) -> Vec3<f64> {
    marble.rotation * Vec3::unit_y()
}

#[test]
fn a_capsule_weighs_and_turns_as_cylinder_and_ball_do() {
    let mut world = world(dynamic(Response::Impulse));
    let id = world.marbles.insert(capsule([0.0; 3], 0.0)).unwrap();
    let pi = std::f64::consts::PI;
    let (r, h, density) = (0.25_f64, 0.5_f64, 2500.0);
    let (cylinder, ball) = (pi * r * r * 2.0 * h * density, 4.0 / 3.0 * pi * r.powi(3) * density);
    let along = cylinder * r * r / 2.0 + ball * 0.4 * r * r;
    let across =
        cylinder * (r * r / 4.0 + h * h / 3.0) + ball * (0.4 * r * r + h * h + 0.75 * h * r);
    for (spin, moment) in [(Vec3::unit_y(), along), (Vec3::unit_x(), across)] {
        world.marbles.set_angular_velocity(id, spin).unwrap();
        let momentum: Vec3<f64> = world.marbles.angular_momentum(id).unwrap().dual();
        assert!((momentum.magnitude() / moment - 1.0).abs() < 1e-12, "{momentum:?} {moment}");
        assert!((world.energy().rotational / (0.5 * moment) - 1.0).abs() < 1e-12);
    }
    world.marbles.set_velocity(id, Vec3::unit_x()).unwrap();
    assert!((world.momentum().x / (cylinder + ball) - 1.0).abs() < 1e-12);
    assert!(matches!(world.marbles.shape(id), Ok(Shape::Capsule(_))));
}

#[test]
fn a_capsule_that_nothing_touches_keeps_its_energy_and_angular_momentum() {
    let mut world = world(dynamic(Response::Impulse));
    world.set_gravity(Vec3::zero()).unwrap();
    let id = world.marbles.insert(capsule([0.0; 3], 0.7)).unwrap();
    world.marbles.set_angular_velocity(id, Vec3::new(3.0, 11.0, -2.0)).unwrap();
    let momentum = |world: &World<f64>| world.marbles.angular_momentum(id).unwrap().dual();
    let (before, energy) = (momentum(&world), world.energy().rotational);
    for _ in 0..6_000 {
        world.step(DT).unwrap();
    }
    let off: Vec3<f64> = momentum(&world) - before;
    assert!(off.magnitude() < 1e-10 * before.magnitude(), "{off:?} in 100 s");
    assert!((world.energy().rotational / energy - 1.0).abs() < 1e-10);
}

/// Floors at zero: a half-space, a box, a mesh.
fn floors() -> Vec<WallShape<f64>> {
    let (min, max) = (Point3::new(-9.0, -1.0, -9.0), Point3::new(9.0, 0.0, 9.0));
    let corners = [[-9.0, -9.0], [9.0, -9.0], [9.0, 9.0], [-9.0, 9.0]];
    let corners = corners.map(|[x, z]| Point3::new(x, 0.0, z));
    vec![
        Plane::new(Vec3::unit_y(), 0.0).unwrap().into(),
        Aabb::new(min, max).unwrap().into(),
        Mesh::new(corners.to_vec(), vec![[0, 2, 1], [0, 3, 2]]).unwrap().into(),
    ]
}

#[test]
fn a_capsule_falls_over_and_lies_still() {
    let soft = Model { substeps: 20, ..dynamic(Response::Penalty(ContactLaw::SpringDashpot)) };
    let hard = Model { substeps: 8, ..dynamic(Response::Impulse) };
    for model in [hard, soft] {
        for floor in floors() {
            for tilt in [0.3, 1.2, std::f64::consts::FRAC_PI_2] {
                let mut world = world(model);
                world.walls.insert(floor.clone()).unwrap();
                let id = world.marbles.insert(capsule([0.0, 1.0, 0.0], tilt)).unwrap();
                world.marbles.set_material(id, Some(material(0.2, 0.5))).unwrap();
                let mut most = world.energy().total();
                for _ in 0..900 {
                    world.step(DT).unwrap();
                    let energy = world.energy().total();
                    // Turning over its end gains 1.7 % in steps of 1/60 s, 0.1 % with sixteen
                    // substeps: the overlap of each is pushed out.
                    // Springs hold energy that is not counted.
                    let springs = matches!(model.response, Response::Penalty(_));
                    assert!(springs || energy < most * 1.003, "{energy} J after {most} J");
                    most = most.min(energy);
                }
                let marble = world.marbles.get(id).unwrap();
                let what = format!("{:?}, from {tilt}: {marble:?}", model.response);
                assert!((marble.position.y - 0.25).abs() < 0.005, "{what}");
                assert!(axis(&marble).y.abs() < 0.02, "{what}");
                assert!(marble.velocity.magnitude() < 0.1, "{what}");
                // It may still roll, for nothing resists that.
                let along = marble.angular_velocity.dot(axis(&marble));
                let across = marble.angular_velocity - axis(&marble) * along;
                assert!(across.magnitude() < 0.05, "{what}");
            }
        }
    }
}

#[test]
fn a_capsule_that_does_not_turn_stays_upright() {
    for response in [Response::Displacement, Response::Impulse] {
        let mut world = world(Model { response, ..Model::default() });
        world.walls.insert(floors().remove(1)).unwrap();
        let id = world.marbles.insert(capsule([0.0, 1.0, 0.0], 0.2)).unwrap();
        for _ in 0..300 {
            world.step(DT).unwrap();
        }
        let marble = world.marbles.get(id).unwrap();
        let lowest = 0.5 * 0.2_f64.cos() + 0.25;
        assert!((marble.position.y - lowest).abs() < 0.02, "{response:?}: {marble:?}");
        assert!((axis(&marble).y - 0.2_f64.cos()).abs() < 1e-12);
    }
}

#[test]
fn a_bounce_turns_back_the_velocity_of_the_point_that_is_touched() {
    for (restitution, tilt) in [(1.0, 0.4), (0.5, 0.4), (0.0, 1.0), (1.0, 1.3)] {
        let mut world = world(dynamic(Response::Impulse));
        world.set_gravity(Vec3::zero()).unwrap();
        world.walls.insert(floors().remove(0)).unwrap();
        let height = 0.5 * f64::cos(tilt) + 0.25 + 0.01;
        let id = world.marbles.insert(capsule([0.0, height, 0.0], tilt)).unwrap();
        world.marbles.set_material(id, Some(material(restitution, 0.0))).unwrap();
        world.marbles.set_velocity(id, Vec3::new(0.0, -2.0, 0.0)).unwrap();
        let energy = world.energy().total();
        world.step(DT).unwrap();
        let marble = world.marbles.get(id).unwrap();
        let lower = if axis(&marble).y > 0.0 { -axis(&marble) } else { axis(&marble) };
        let arm = lower * 0.5 - Vec3::unit_y() * 0.25;
        let touching = marble.velocity + marble.angular_velocity.cross(arm);
        assert!(
            (touching.y - 2.0 * restitution).abs() < 1e-9,
            "{restitution} {tilt}: {touching:?}"
        );
        // Newton and Euler: the impulse acts at that point, and nowhere else.
        let impulse = (marble.velocity.y + 2.0) * world.momentum().y / marble.velocity.y;
        let momentum: Vec3<f64> = world.marbles.angular_momentum(id).unwrap().dual();
        let expected = arm.cross(Vec3::unit_y() * impulse);
        assert!((momentum - expected).magnitude() < 1e-9 * impulse, "{momentum:?} {expected:?}");
        let kept = world.energy().total() / energy;
        assert!(kept < 1.0 + 1e-9 && (restitution < 1.0 || kept > 1.0 - 1e-9), "{kept}");
    }
}

#[test]
fn a_collision_keeps_momentum_and_angular_momentum() {
    let mut random = 1_u64;
    let mut next = || {
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        f64::from((random >> 40) as u32) / f64::from(1 << 24) * 2.0 - 1.0
    };
    let mut collisions = 0;
    for _ in 0..100 {
        let mut world = world(dynamic(Response::Impulse));
        world.set_gravity(Vec3::zero()).unwrap();
        let ids = [-1.0, 1.0].map(|x| {
            let mut marble = capsule([x, 0.2 * next(), 0.2 * next()], 3.0 * next());
            marble.velocity = Vec3::new(-3.0 * x, 0.3 * next(), 0.3 * next());
            marble.angular_velocity = Vec3::new(next(), next(), next());
            marble.half_length = if next() > 0.0 { 0.5 } else { 0.0 };
            marble.material = Some(material(0.7, 0.0));
            world.marbles.insert(marble).unwrap()
        });
        // About the origin, with the marbles at these places.
        let all = |world: &World<f64>, at: &[Point3<f64>]| {
            [0, 1]
                .map(|i| {
                    let momentum = world.marbles.momentum(ids[i]).unwrap();
                    let own: Vec3<f64> = world.marbles.angular_momentum(ids[i]).unwrap().dual();
                    own + at[i].to_vec().cross(momentum)
                })
                .into_iter()
                .fold(Vec3::new(0.0, 0.0, 0.0), |sum, x| sum + x)
        };
        for _ in 0..300 {
            let before = (world.momentum(), world.energy().total());
            world.integrate(DT / 10.0).unwrap();
            world.generate_contacts();
            let places = world.marbles.position().to_vec();
            let turning = all(&world, &places);
            let touches = world.contacts.mm.iter().any(|c| c.separation < 0.0);
            world.restitute(DT / 10.0).unwrap();
            let after = (world.momentum(), world.energy().total());
            // Balls follow from the moment when they met, so they have it where they are.
            let round = ids.iter().all(|id| world.marbles.get(*id).unwrap().half_length == 0.0);
            let now = if round { world.marbles.position().to_vec() } else { places };
            let change = all(&world, &now) - turning;
            // Of momenta of about 1e3 kg m/s.
            assert!((after.0 - before.0).magnitude() < 1e-9);
            assert!(change.magnitude() < 1e-9, "{change:?}");
            assert!(after.1 < before.1 * (1.0 + 1e-9), "{} J after {} J", after.1, before.1);
            collisions += u32::from(touches);
        }
    }
    assert!(collisions > 100, "{collisions} collisions");
}

#[test]
fn a_capsule_rolls_down_a_slope_as_its_moment_says() {
    let mut world = world(dynamic(Response::Impulse));
    let slope = 0.2_f64;
    let normal = Vec3::new(slope.sin(), slope.cos(), 0.0);
    world.walls.insert(Plane::new(normal, 0.0).unwrap()).unwrap();
    let mut marble = capsule([0.0; 3], 0.0);
    marble.position = Point3::from_vec(normal * 0.25);
    // Along z, across the way down.
    marble.rotation = AxisAngle::new(Vec3::unit_x(), std::f64::consts::FRAC_PI_2).unwrap().into();
    let id = world.marbles.insert(marble).unwrap();
    for _ in 0..120 {
        world.step(DT).unwrap();
    }
    let marble = world.marbles.get(id).unwrap();
    world.marbles.set_angular_velocity(id, axis(&marble)).unwrap();
    let moment: Vec3<f64> = world.marbles.angular_momentum(id).unwrap().dual();
    let mass = world.marbles.momentum(id).unwrap().magnitude() / marble.velocity.magnitude();
    let pull = 9.81 * slope.sin() / (1.0 + moment.magnitude() / (mass * 0.25 * 0.25));
    let speed = marble.velocity.magnitude();
    assert!((speed / (pull * 2.0) - 1.0).abs() < 1e-3, "{speed}, not {}", pull * 2.0);
}

#[test]
fn a_heap_of_capsules_and_balls_settles() {
    let mut world = world(Model { substeps: 4, ..dynamic(Response::Impulse) });
    for (normal, offset) in [
        (Vec3::unit_y(), 0.0),
        (Vec3::unit_x(), -1.5),
        (-Vec3::unit_x(), -1.5),
        (Vec3::unit_z(), -1.5),
        (-Vec3::unit_z(), -1.5),
    ] {
        world.walls.insert(Plane::new(normal, offset).unwrap()).unwrap();
    }
    for i in 0..36_u8 {
        let (x, y, z) =
            (f64::from(i % 3) - 1.0, 1.0 + 0.9 * f64::from(i / 9), f64::from(i / 3 % 3) - 1.0);
        let mut marble = capsule([x * 0.9, y, z * 0.9], 0.3 * f64::from(i));
        marble.half_length = if i % 3 == 0 { 0.0 } else { 0.2 };
        marble.material = Some(material(0.1, 0.5));
        world.marbles.insert(marble).unwrap();
    }
    for _ in 0..900 {
        world.step(DT).unwrap();
    }
    for row in 0..world.marbles.len() {
        let marble = world.marbles.get(world.marbles.id(row).unwrap()).unwrap();
        let at = marble.position;
        assert!(at.y > 0.24 && at.y < 3.0 && at.x.abs() < 1.3 && at.z.abs() < 1.3, "{marble:?}");
        assert!(marble.velocity.magnitude() < 0.5, "{marble:?}");
    }
    let deepest = world.contacts.mm.iter().map(Contact::penetration).fold(0.0, f64::max);
    assert!(deepest < 0.02, "{deepest} m of overlap");
}

#[test]
fn what_cannot_be_a_capsule_is_refused_by_name() {
    let mut world = world(dynamic(Response::Impulse));
    let bad = Marble { half_length: -1.0, ..capsule([0.0; 3], 0.0) };
    let error = world.marbles.insert(bad).unwrap_err().to_string();
    assert!(error.starts_with("half_length must be finite and at least 0"), "{error}");
    let id = world.marbles.insert(capsule([0.0; 3], 0.0)).unwrap();
    let events = Model { response: Response::EventDriven, ..world.model() };
    assert_eq!(world.set_model(events), Err(taw::Error::UnsupportedShape(id)));
    world.marbles.set_half_length(id, 0.0).unwrap();
    world.set_model(events).unwrap();
    world.marbles.set_half_length(id, 1.0).unwrap();
    let before = world.clone();
    assert_eq!(world.step(DT), Err(taw::Error::UnsupportedShape(id)));
    assert_eq!(world, before);
    world.marbles.remove(id).unwrap();
    world.step(DT).unwrap();
}

/// The worst part by which energy and angular momentum of a capsule that nothing touches
/// differ from those at the start, in 100 s.
fn drift_in_flight<S: Scalar>(spin: [f64; 3], shape: [f64; 2], substeps: u32) -> [f64; 2] {
    let mut world = World::<S>::default();
    world.set_model(Model { substeps, ..dynamic(Response::Impulse) }).unwrap();
    world.set_gravity(Vec3::zero()).unwrap();
    let rotation = taw::math::Quat::new(0.8, 0.36, -0.48, 0.0);
    let rotation = taw::math::Quat::new(
        S::from_f64(rotation.s),
        S::from_f64(rotation.v.x),
        S::from_f64(rotation.v.y),
        S::from_f64(rotation.v.z),
    );
    let [radius, half_length] = shape.map(S::from_f64);
    let spin = Vec3::from(spin.map(S::from_f64));
    let origin = Point3::new(S::zero(), S::zero(), S::zero());
    let id = world
        .marbles
        .insert(Marble {
            half_length,
            rotation,
            angular_velocity: spin,
            ..Marble::new(origin, radius)
        })
        .unwrap();
    let momentum = |world: &World<S>| -> Vec3<f64> {
        let momentum = world.marbles.angular_momentum(id).unwrap().dual();
        momentum.map(Scalar::as_f64)
    };
    let (before, energy) = (momentum(&world), world.energy().rotational);
    let mut worst = [0.0_f64; 2];
    for _ in 0..6_000 {
        world.step(S::from_f64(DT)).unwrap();
        let off = (momentum(&world) - before).magnitude() / before.magnitude();
        let gained = (world.energy().rotational / energy - 1.0).abs();
        worst = [worst[0].max(gained), worst[1].max(off)];
    }
    worst
}

#[test]
fn capsules_in_flight_keep_energy_and_angular_momentum_to_rounding() {
    for substeps in [1, 16] {
        for spin in [[3.0, 11.0, -2.0], [0.1, 0.2, 30.0], [40.0, -7.0, 5.0], [1e-3, 2.0, 0.5]] {
            for shape in [[0.25, 0.5], [0.1, 0.01], [0.02, 1.0]] {
                // Half an epsilon in every substep, to either side, adds up to the root of their
                // number (a random walk), twice to be sure; in `f64`, where the counting rounds as
                // the state does, the half of one may go to the same side.
                let steps = f64::from(6_000 * substeps);
                let single = drift_in_flight::<f32>(spin, shape, substeps);
                let double = drift_in_flight::<f64>(spin, shape, substeps);
                for [worst, most] in [
                    single.map(|worst| [worst, 2.0 * steps.sqrt() * f64::from(f32::EPSILON)]),
                    double.map(|worst| [worst, 0.5 * steps * f64::EPSILON]),
                ]
                .concat()
                {
                    let what = format!("{spin:?}, {shape:?}, {substeps} substeps");
                    assert!(worst < most, "{what}: {worst}, not {most}");
                }
            }
        }
    }
}

/// The nearest points of almost parallel axes leave the ends by as much as the shift and the angle say.
#[test]
fn capsules_side_by_side_keep_their_features_while_they_shake() {
    let lies = std::f64::consts::FRAC_PI_2;
    for (shift, yaw) in [(0.0, 0.0), (4e-4, -5e-4), (1e-3, 0.0), (-1e-3, 3e-3), (0.3, -3e-3)] {
        let mut world = world(dynamic(Response::Impulse));
        world.marbles.insert(capsule([0.0, 0.0, 0.0], lies)).unwrap();
        let turn: taw::math::Quat<f64> = AxisAngle::new(Vec3::unit_y(), yaw).unwrap().into();
        let other = capsule([shift, 0.0, 0.49], lies);
        world.marbles.insert(Marble { rotation: turn * other.rotation, ..other }).unwrap();
        world.generate_contacts();
        let features: Vec<_> = world.contacts.mm.iter().map(|contact| contact.feature).collect();
        assert_eq!(features, [4 << 16 | 4, 5 << 16 | 5], "{shift} m, {yaw} rad");
    }
}

/// Their ends are farther apart than they are thick, though they are all but parallel.
#[test]
fn long_capsules_that_cross_at_a_small_angle_touch() {
    let mut world = world(dynamic(Response::Impulse));
    world.set_gravity(Vec3::zero()).unwrap();
    for (z, degrees) in [(0.0, 0.0_f64), (0.015, 1.5)] {
        let rotation = AxisAngle::new(Vec3::unit_z(), degrees.to_radians()).unwrap().into();
        let at = Point3::new(0.0, 0.0, z);
        let marble = Marble { half_length: 1.0, rotation, ..Marble::new(at, 0.01) };
        world.marbles.insert(marble).unwrap();
    }
    world.step(1e-3).unwrap();
    assert!(!world.contacts.mm.is_empty());
}

#[test]
fn a_capsule_that_slides_over_the_middle_of_another_one_keeps_its_feature() {
    let quarter = std::f64::consts::FRAC_PI_2;
    for z in [-0.4, -0.1, -1e-16, 0.0, 1e-16, 0.1, 0.4] {
        let mut world = world(dynamic(Response::Impulse));
        world.marbles.insert(capsule([0.0, 0.0, 0.0], quarter)).unwrap();
        let rotation = AxisAngle::new(Vec3::unit_x(), quarter).unwrap().into();
        world.marbles.insert(Marble { rotation, ..capsule([0.0, 0.499, z], 0.0) }).unwrap();
        world.generate_contacts();
        assert_eq!(world.contacts.mm[0].feature, 3 << 16 | 3, "side on side, at {z}");
    }
}

#[test]
fn features_tell_the_ends_and_the_side_of_a_capsule_from_each_other() {
    let mut world = world(dynamic(Response::Impulse));
    world.walls.insert(Plane::new(Vec3::unit_y(), 0.0).unwrap()).unwrap();
    let lies = std::f64::consts::FRAC_PI_2;
    world.marbles.insert(capsule([0.0, 0.249, 0.0], lies)).unwrap();
    for (x, z) in [(-0.7, 0.0), (0.01, 0.499), (0.7, 0.0)] {
        world.marbles.insert(Marble::new(Point3::new(x, 0.249, z), 0.25)).unwrap();
    }
    // Side by side with the first one, half of it beyond an end.
    world.marbles.insert(capsule([0.5, 0.249, -0.499], lies)).unwrap();
    world.generate_contacts();
    let Contacts { wm, mm } = &mut world.contacts;
    wm.sort_by_key(|contact| (contact.b, contact.feature));
    let on_floor: Vec<_> = wm.iter().map(|contact| (contact.b, contact.feature)).collect();
    assert_eq!(on_floor, [(0, 1), (0, 2), (1, 0), (2, 0), (3, 0), (4, 1), (4, 2)]);
    mm.retain(|contact| contact.a == 0);
    mm.sort_by_key(|contact| (contact.b, contact.feature));
    let by_capsule: Vec<_> = mm.iter().map(|contact| (contact.b, contact.feature)).collect();
    // Its axis points to −x, so that its second end is on the left.
    let (first, second, side) = (1, 2, 3);
    let beside = [(4, 4 << 16 | 4), (4, 5 << 16 | 5)];
    let balls = [(1, second << 16), (2, side << 16), (3, first << 16)];
    assert_eq!(by_capsule, [&balls[..], &beside].concat());
}
