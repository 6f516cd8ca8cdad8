//! Sensors: who enters and leaves, and when.

use cgmath::{Rotation3, Zero};
use taw::broad::CollisionLayers;
use taw::frame::Pose;
use taw::math::Quat;
use taw::motion::WallMotion;
use taw::prelude::*;
use taw::shape::{Aabb, Capsule};

const RESPONSES: [Response; 5] = [
    Response::Displacement,
    Response::Impulse,
    Response::EventDriven,
    Response::SoftStep,
    Response::Penalty(ContactLaw::SpringDashpot),
];

fn world<S: Scalar>(response: Response, substeps: u32) -> World<S> {
    let mut world = World::default();
    world.set_model(Model { response, substeps, ..Model::default() }).unwrap();
    world.set_gravity(Vec3::zero()).unwrap();
    world
}

fn point<S: Scalar>(x: f64, y: f64, z: f64) -> Point3<S> {
    Point3::new(S::from_f64(x), S::from_f64(y), S::from_f64(z))
}

fn ball<S: Scalar>(at: [f64; 3], velocity: [f64; 3], radius: f64) -> Marble<S> {
    let velocity = Vec3::from(velocity.map(S::from_f64));
    Marble { velocity, ..Marble::new(point(at[0], at[1], at[2]), S::from_f64(radius)) }
}

/// Box with these corners.
fn cuboid<S: Scalar>(min: [f64; 3], max: [f64; 3]) -> Aabb<Point3<S>> {
    Aabb { min: point(min[0], min[1], min[2]), max: point(max[0], max[1], max[2]) }
}

/// A number in [0, 1) for each seed (`SplitMix64`, Steele 2014).
fn random(seed: u64) -> f64 {
    let mut z = seed.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    (z >> 11) as f64 / (1_u64 << 53) as f64
}

/// Times at which a ball of constant velocity touches a plate from `near` to `far` along x.
fn exact(x: f64, speed: f64, radius: f64, [near, far]: [f64; 2]) -> [f64; 2] {
    [(near - radius - x) / speed, (far + radius - x) / speed]
}

/// A plate of 2 mm is passed by balls of .1 to 300 m/s, and each enters and leaves once, at its time.
#[test]
fn nothing_passes_unnoticed_at_any_speed() {
    fn pass<S: Scalar>(response: Response, substeps: u32, tolerance: f64) {
        for i in 0..40 {
            let speed = 0.1 * 3000_f64.powf(random(3 * i));
            let (dt, radius) = (1.0 / 64.0, 0.05 + 0.3 * random(3 * i + 1));
            let x = -1.0 - random(3 * i + 2);
            let [enters, leaves] = exact(x, speed, radius, [0.0, 0.002]);
            let mut world = world::<S>(response, substeps);
            let plate = cuboid([0.0, -9.0, -9.0], [0.002, 9.0, 9.0]);
            let gate = world.sensors.insert(plate).unwrap();
            let id = world.marbles.insert(ball([x, 0.0, 0.0], [speed, 0.0, 0.0], radius)).unwrap();
            let mut told = Vec::new();
            let steps = (leaves / dt) as u32 + 2;
            for step in 1..=steps {
                world.step(S::from_f64(dt)).unwrap();
                for event in world.sensors.events() {
                    assert_eq!((event.sensor, event.collider), (gate, id.into()));
                    let time = f64::from(step) * dt - event.time_left.as_f64();
                    told.push((event.entered, time));
                }
            }
            let case = format!("{response:?} {substeps} {speed} m/s: {told:?} {enters} {leaves}");
            assert_eq!(told.iter().map(|it| it.0).collect::<Vec<_>>(), [true, false], "{case}");
            for ((_, told), exact) in told.iter().zip([enters, leaves]) {
                assert!((told - exact).abs() <= tolerance * (1.0 + exact), "{case}");
            }
            assert_eq!(world.sensors.inside(gate).unwrap(), []);
        }
    }
    for response in RESPONSES {
        for substeps in [1, 3] {
            pass::<f32>(response, substeps, 1e-4);
            pass::<f64>(response, substeps, 1e-7);
        }
    }
}

/// Random balls bounce about in a box with sensors of all kinds: after each step, those are inside
/// that overlap, and events are exactly the changes, in turn.
#[test]
fn inside_are_those_that_overlap_and_events_are_the_changes() {
    for response in RESPONSES {
        let mut world = world::<f64>(response, 2);
        world.set_gravity(Vec3::new(0.0, -9.81, 0.0)).unwrap();
        for axis in 0..3 {
            for side in [1.0, -1.0] {
                let mut normal = Vec3::zero();
                normal[axis] = side;
                world.walls.insert(Plane::new(normal, -2.0).unwrap()).unwrap();
            }
        }
        let mut radius_of = Vec::new();
        for i in 0..60 {
            let r = |k: u64| random(1000 + 10 * i + k) * 2.0 - 1.0;
            let radius = 0.03 + 0.1 * random(1000 + 10 * i + 9);
            let id = world
                .marbles
                .insert(ball([r(0), r(1), r(2)], [r(3) * 5.0, r(4) * 5.0, r(5) * 5.0], radius))
                .unwrap();
            radius_of.push((id, radius));
        }
        let capsule = Capsule::new(point(-1.5, -1.0, 0.0), point(1.5, 0.5, 0.3), 0.2).unwrap();
        let gates = [
            world.sensors.insert(Sphere::new(point(0.5, -0.5, 0.0), 0.7).unwrap()).unwrap(),
            world.sensors.insert(cuboid([-2.0, -2.0, -2.0], [0.0, -1.5, 2.0])).unwrap(),
            world.sensors.insert(Plane::new(Vec3::unit_y(), -1.0).unwrap()).unwrap(),
            world.sensors.insert(capsule).unwrap(),
        ];
        let mut inside = vec![Vec::new(); gates.len()];
        let mut changes = 0;
        for _ in 0..200 {
            world.step(1.0 / 60.0).unwrap();
            for event in world.sensors.events() {
                let gate = gates.iter().position(|gate| *gate == event.sensor).unwrap();
                let known: &mut Vec<MarbleId> = &mut inside[gate];
                let ColliderId::Marble(marble) = event.collider else { panic!("{event:?}") };
                let at = known.binary_search(&marble);
                match (event.entered, at) {
                    (true, Err(at)) => known.insert(at, marble),
                    (false, Ok(at)) => drop(known.remove(at)),
                    _ => panic!("{response:?}: {event:?} of {known:?}"),
                }
                assert!((0.0..=1.0 / 60.0 + 1e-12).contains(&event.time_left), "{event:?}");
                changes += 1;
            }
            for (gate, known) in gates.iter().zip(&inside) {
                assert_eq!(world.sensors.inside(*gate).unwrap(), known);
                let shape = world.sensors.shape(*gate).unwrap();
                for (id, radius) in &radius_of {
                    let distance =
                        shape.project_point(world.marbles.get(*id).unwrap().position).distance;
                    if (distance - radius).abs() > 1e-6 {
                        assert_eq!(known.binary_search(id).is_ok(), distance < *radius, "{id:?}");
                    }
                }
            }
        }
        assert!(changes > 100, "{response:?}: {changes} changes say little");
    }
}

/// A sensor that sweeps over a ball at rest notices it, as a ball does that flies through one at rest,
/// however many substeps there are.
#[test]
fn a_sensor_that_moves_sweeps() {
    for (response, substeps) in RESPONSES.into_iter().flat_map(|it| [(it, 1), (it, 3), (it, 4)]) {
        for radius in [0.1, 0.01] {
            let mut world = world::<f64>(response, substeps);
            let plate = |x: f64| cuboid([x, -1.0, -1.0], [x + 0.01, 1.0, 1.0]);
            let gate = world.sensors.insert(plate(-3.0)).unwrap();
            let id = world.marbles.insert(ball([0.0; 3], [0.0; 3], radius)).unwrap();
            let (dt, speed) = (1.0 / 60.0, 90.0);
            let velocity = Vec3::new(speed, 0.0, 0.0);
            let mut told = Vec::new();
            for step in 1..=5 {
                let x = -3.0 + speed * dt * f64::from(step);
                world.sensors.set(gate, plate(x)).unwrap();
                let (angular_velocity, pivot) = (Vec3::zero(), point(x, 0.0, 0.0));
                let motion = WallMotion { velocity, angular_velocity, pivot };
                world.sensors.set_motion(gate, Some(motion)).unwrap();
                world.step(dt).unwrap();
                let time = |left: f64| f64::from(step) * dt - left;
                let events = world.sensors.events().iter();
                told.extend(events.map(|it| (it.collider, it.entered, time(it.time_left))));
            }
            let case = format!("{response:?}, {substeps}, {radius}: {told:?}");
            let [(first, true, enters), (second, false, leaves)] = told[..] else {
                panic!("{case}")
            };
            assert_eq!((first, second), (id.into(), id.into()), "{case}");
            assert!((enters - (2.99 - radius) / speed).abs() < 1e-7, "{case}");
            assert!((leaves - (3.0 + radius) / speed).abs() < 1e-7, "{case}");
        }
    }
}

/// A paddle that turns half a radian a step passes over small balls at rest all around it, each once.
#[test]
fn a_paddle_that_turns_misses_nobody() {
    for (response, substeps) in RESPONSES.into_iter().flat_map(|it| [(it, 1), (it, 4)]) {
        let mut world = world::<f64>(response, substeps);
        let pose = |angle: f64| Pose {
            rotation: Quat::from_angle_y(cgmath::Rad(angle)),
            translation: Vec3::zero(),
        };
        let arm = cuboid::<f64>([0.2, -1.0, -0.005], [2.0, 1.0, 0.005]);
        let arm = |angle: f64| WallShape::from(arm).transformed(pose(angle)).unwrap();
        let gate = world.sensors.insert(arm(0.0)).unwrap();
        for i in 0..40 {
            let (angle, reach) = (0.1 + 0.15 * f64::from(i), 0.3 + 1.6 * random(i as u64));
            let at = [reach * angle.cos(), 0.0, -reach * angle.sin()];
            world.marbles.insert(ball(at, [0.0; 3], 0.005)).unwrap();
        }
        let (dt, speed) = (1.0 / 60.0, 30.0);
        let mut entered = Vec::new();
        let mut left = 0;
        for step in 1..=12 {
            world.sensors.set(gate, arm(speed * dt * f64::from(step))).unwrap();
            let (velocity, pivot) = (Vec3::zero(), point(0.0, 0.0, 0.0));
            let motion = WallMotion { velocity, angular_velocity: Vec3::unit_y() * speed, pivot };
            world.sensors.set_motion(gate, Some(motion)).unwrap();
            world.step(dt).unwrap();
            for event in world.sensors.events() {
                if event.entered {
                    entered.push(event.collider);
                } else {
                    left += 1;
                }
            }
        }
        let count = entered.len();
        entered.sort_unstable();
        entered.dedup();
        let case = format!("{response:?}, {substeps}: {count} entered, {left} left");
        assert_eq!((entered.len(), count), (40, 40), "{case}");
        assert!((39..=40).contains(&left), "{case}");
    }
}

#[test]
fn layers_removals_and_jumps() {
    let mut world = world::<f32>(Response::Impulse, 2);
    let gate = world.sensors.insert(Sphere::new(point(0.0, 0.0, 0.0), 1.0).unwrap()).unwrap();
    let seen = world.marbles.insert(ball([0.2, 0.0, 0.0], [0.0; 3], 0.1)).unwrap();
    let other = CollisionLayers::new(2, u32::MAX);
    let unseen = Marble { layers: other, ..ball([-0.2, 0.0, 0.0], [0.0; 3], 0.1) };
    let unseen = world.marbles.insert(unseen).unwrap();
    world.sensors.set_layers(gate, CollisionLayers::new(u32::MAX, 1)).unwrap();
    let step = |world: &mut World<f32>| {
        world.step(1.0 / 64.0).unwrap();
        world.sensors.events().iter().map(|it| (it.collider, it.entered)).collect::<Vec<_>>()
    };
    assert_eq!(step(&mut world), [(seen.into(), true)]);
    assert_eq!(step(&mut world), []);
    world.sensors.set_layers(gate, CollisionLayers::ALL).unwrap();
    assert_eq!(step(&mut world), [(unseen.into(), true)]);
    // A jump across touches nothing on the way.
    world.marbles.set_position(seen, point(3.0, 0.0, 0.0)).unwrap();
    assert_eq!(step(&mut world), [(seen.into(), false)]);
    world.marbles.set_position(seen, point(-3.0, 0.0, 0.0)).unwrap();
    assert_eq!(step(&mut world), []);
    world.marbles.remove(unseen).unwrap();
    assert_eq!(step(&mut world), [(unseen.into(), false)]);
    assert_eq!(world.sensors.inside(gate).unwrap(), []);
    world.sensors.remove(gate).unwrap();
    assert_eq!(world.sensors.inside(gate), Err(taw::Error::NoSuchSensor(gate)));
    assert_eq!(world.sensors.set_motion(gate, None), Err(taw::Error::NoSuchSensor(gate)));
    assert!(world.sensors.is_empty());
}

/// Sensors change nothing of what marbles do.
#[test]
fn marbles_do_not_feel_sensors() {
    for response in RESPONSES {
        let build = |sensors: bool| {
            let mut world = world::<f32>(response, 2);
            world.set_gravity(Vec3::new(0.0, -9.81, 0.0)).unwrap();
            world.walls.insert(Plane::new(Vec3::unit_y(), 0.0).unwrap()).unwrap();
            for i in 0..30 {
                let at = [random(i), 0.5 + f64::from(i as u32) * 0.2, random(i + 40)];
                world.marbles.insert(ball(at, [0.0; 3], 0.1)).unwrap();
            }
            if sensors {
                world.sensors.insert(cuboid([-1.0; 3], [2.0; 3])).unwrap();
            }
            for _ in 0..60 {
                world.step(1.0 / 60.0).unwrap();
            }
            world.marbles.position().to_vec()
        };
        assert_eq!(build(true), build(false), "{response:?}");
    }
}

fn balls_inside_at_the_end<S: Scalar>(response: Response) {
    let mut world = world::<S>(response, 2);
    // Many far away, so that there are blocks that are passed over, and one ball at each x.
    let at = |x: f32, y: f32| {
        let [x, y, z, radius] = [x, y, 0.0, 0.25].map(|x| S::from_f64(x.into()));
        taw::swarm::Ball::new(Point3::new(x, y, z), radius)
    };
    let far: Vec<_> = (0..600_u16).map(|i| at(f32::from(i) * 2.0, 100.0)).collect();
    world.swarm.insert(&far).unwrap();
    let row: Vec<_> = (-5..=5_i16).map(|x| at(f32::from(x), 0.0)).collect();
    let ids = world.swarm.insert(&row).unwrap();
    let marble = world.marbles.insert(ball([0.5, 0.5, 0.0], [0.0; 3], 0.1)).unwrap();
    let room = world.sensors.insert(cuboid([-2.5, -1.0, -1.0], [2.5, 1.0, 1.0])).unwrap();
    let deaf = world.sensors.insert(cuboid([-2.5, -1.0, -1.0], [2.5, 1.0, 1.0])).unwrap();
    world.sensors.set_layers(deaf, CollisionLayers::new(2, 2)).unwrap();
    let half = world.sensors.insert(Plane::new(Vec3::unit_x(), S::zero()).unwrap()).unwrap();
    world.swarm.set_layers(&ids, CollisionLayers::new(1, 1)).unwrap();
    world.step(S::from_f64(1e-3)).unwrap();
    assert_eq!(world.sensors.balls_inside(room).unwrap(), &ids[3..8], "{response:?}");
    assert_eq!(world.sensors.inside(room).unwrap(), [marble]);
    assert_eq!(world.sensors.balls_inside(deaf).unwrap(), []);
    assert_eq!(world.sensors.balls_inside(half).unwrap().len(), 6 + 1);
    world.swarm.remove(&ids[4..5]).unwrap();
    world.swarm.set_position(ids[0], at(0.0, 0.6).position).unwrap();
    world.step(S::from_f64(1e-3)).unwrap();
    let mut expected = [&ids[..1], &ids[3..4], &ids[5..8]].concat();
    expected.sort_unstable();
    assert_eq!(world.sensors.balls_inside(room).unwrap(), expected, "{response:?}");
}

#[test]
fn balls_of_the_swarm_are_inside_whose_shapes_overlap_at_the_end_of_a_step() {
    for response in RESPONSES {
        balls_inside_at_the_end::<f32>(response);
        balls_inside_at_the_end::<f64>(response);
    }
}
