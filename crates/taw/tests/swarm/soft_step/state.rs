//! Sleep, threads, clones, and marbles that come, go and change.

use cgmath::{InnerSpace, Zero};
use taw::prelude::*;
use taw::shape::Aabb;
use taw::swarm::Ball;

use super::{floor, world};

/// A heap of marbles in a pit, poured and left for so many steps.
fn heap<S: Scalar>(count: u16, steps: usize) -> (World<S>, Vec<MarbleId>) {
    let mut world = world::<S>(2);
    floor(&mut world);
    let number = |x: f32| S::from_f64(f64::from(x));
    for axis in [Vec3::unit_x(), Vec3::unit_z()] {
        for inward in [axis, -axis] {
            world.walls.insert(Plane::new(inward, number(-0.5)).unwrap()).unwrap();
        }
    }
    let place = |i: u16| {
        let [x, y, z] = [i % 4, i / 16, i / 4 % 4].map(f32::from);
        let aside = 0.011 * (f32::from(i) * 0.618).fract();
        Point3::new(x * 0.22 - 0.35 + aside, 0.2 + y * 0.25, z * 0.22 - 0.35 - aside)
    };
    let ids = (0..count)
        .map(|i| {
            let Point3 { x, y, z } = place(i);
            let at = Point3::new(number(x), number(y), number(z));
            world.marbles.insert(Marble::new(at, number(0.1))).unwrap()
        })
        .collect();
    for _ in 0..steps {
        world.step(S::from_f64(1.0 / 60.0)).unwrap();
    }
    (world, ids)
}

type Touch = fn(&mut World<f32>, MarbleId);

#[test]
fn a_heap_sleeps_and_whatever_touches_it_wakes_it() {
    let (asleep, ids) = heap::<f32>(64, 600);
    assert_eq!(asleep.swarm.asleep(), 64, "after ten seconds all lie");
    let touches: [(&str, Touch); 8] = [
        ("gravity", |world, _| world.set_gravity(Vec3::new(3.0, -9.0, 0.0)).unwrap()),
        ("velocity", |world, id| world.marbles.set_velocity(id, Vec3::new(0.0, 5.0, 0.0)).unwrap()),
        ("place", |world, id| {
            world.marbles.set_position(id, Point3::new(0.0, 2.0, 0.0)).unwrap();
        }),
        ("force", |world, id| world.marbles.apply_force(id, Vec3::new(0.0, 900.0, 0.0)).unwrap()),
        ("radius", |world, id| world.marbles.set_radius(id, 0.05).unwrap()),
        ("removal", |world, id| world.marbles.remove(id).map(|_| ()).unwrap()),
        ("scale", |world, id| world.marbles.set_gravity_scale(id, -1.0).unwrap()),
        ("newcomer", |world, _| {
            world.marbles.insert(Marble::new(Point3::new(0.0, 0.9, 0.0), 0.1)).map(|_| ()).unwrap();
        }),
    ];
    for (name, touch) in touches {
        let mut world = asleep.clone();
        touch(&mut world, ids[20]);
        // It falls for a third of a second.
        for _ in 0..if name == "newcomer" { 20 } else { 1 } {
            world.step(1.0 / 60.0).unwrap();
        }
        let others = ids.iter().filter_map(|id| world.marbles.get(*id).ok());
        let moves = others.filter(|marble| marble.velocity.magnitude() > 1e-4).count();
        let awake = world.swarm.len() - world.swarm.asleep();
        assert!(awake > 1, "{name}: {awake} awake, {moves} move");
    }
    // Untouched, it costs no bit and stays.
    let mut world = asleep.clone();
    for _ in 0..60 {
        world.step(1.0 / 60.0).unwrap();
    }
    assert_eq!(world.marbles, asleep.marbles);
}

#[test]
fn nothing_sleeps_in_the_air() {
    for gravity in [-9.81_f32, -0.5] {
        let mut world = world::<f32>(2);
        world.set_gravity(Vec3::new(0.0, gravity, 0.0)).unwrap();
        let up = Vec3::new(0.0, 3.0, 0.0);
        let thrown = Marble { velocity: up, ..Marble::new(Point3::new(0.0, 1.0, 0.0), 0.1) };
        let id = world.marbles.insert(thrown).unwrap();
        for _ in 0..900 {
            world.step(1.0 / 60.0).unwrap();
        }
        let exact = 1.0 + 3.0 * 15.0 + 0.5 * gravity * 225.0;
        let height = world.marbles.get(id).unwrap().position.y;
        assert!((height - exact).abs() < 1e-3 * exact.abs(), "{gravity}: {height}, not {exact}");
    }
}

#[test]
fn threads_and_clones_change_no_bit() {
    let threads = |threads| {
        let (mut world, _) = heap::<f32>(400, 1);
        let model = taw::swarm::SwarmModel { threads, ..world.swarm.model() };
        world.swarm.set_model(model).unwrap();
        for _ in 0..120 {
            world.step(1.0 / 60.0).unwrap();
        }
        world
    };
    let one = threads(1);
    assert_eq!(one.marbles, threads(3).marbles);
    let (mut a, mut b) = (one.clone(), one);
    for _ in 0..60 {
        a.step(1.0 / 60.0).unwrap();
        b.step(1.0 / 60.0).unwrap();
    }
    assert_eq!(a, b);
}

#[test]
fn marbles_come_and_go_in_every_step_and_models_change() {
    let mut seed = 3_u64;
    let mut random = move |below: u64| {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        (seed >> 33) % below
    };
    let responses =
        [Response::SoftStep, Response::Impulse, Response::EventDriven, Response::Displacement];
    let (mut world, mut ids) = heap::<f32>(40, 10);
    for step in 0..600 {
        if step % 50 == 49 {
            let response = responses[random(4) as usize];
            world.set_model(Model { response, ..world.model() }).unwrap();
        }
        if random(2) == 0 && ids.len() > 10 {
            let gone = ids.swap_remove(random(ids.len() as u64) as usize);
            world.marbles.remove(gone).unwrap();
        } else {
            let at =
                Point3::new(random(80) as f32 / 100.0 - 0.4, 1.5, random(80) as f32 / 100.0 - 0.4);
            ids.push(
                world.marbles.insert(Marble::new(at, 0.05 + random(5) as f32 / 100.0)).unwrap(),
            );
        }
        if random(10) == 0 {
            let at = Point3::new(0.0, 2.5, 0.0);
            world.swarm.insert(&[Ball::new(at, 0.06)]).unwrap();
        }
        world.step(1.0 / 60.0).unwrap();
        assert!(world.contacts.wm.iter().all(|c| (c.b as usize) < world.marbles.len()));
        for id in &ids {
            let Marble { position: p, velocity, radius, .. } = world.marbles.get(*id).unwrap();
            let inside = p.x.abs().max(p.z.abs()) < 0.5 && p.y > 0.0 && p.y < 6.0;
            assert!(inside, "{step}: {p:?} {velocity:?} {radius} by {:?}", world.model().response);
        }
    }
}

#[test]
fn in_f64_and_on_a_lift_a_heap_goes_along() {
    let (world, _) = heap::<f64>(64, 600);
    let fastest = world.marbles.velocity().iter().map(|v| v.magnitude()).fold(0.0, f64::max);
    assert!(fastest < 1e-6, "{fastest}");
    let mut world = self::world::<f32>(2);
    let wall = floor(&mut world);
    let taw = Marble::new(Point3::new(0.0, 0.1, 0.0), 0.1);
    let id = world.marbles.insert(Marble { velocity: Vec3::unit_y(), ..taw }).unwrap();
    for step in 1..=300_u16 {
        let height = f32::from(step) / 60.0;
        let motion = taw::world::WallMotion {
            velocity: Vec3::unit_y(),
            angular_velocity: Vec3::zero(),
            pivot: Point3::new(0.0, 0.0, 0.0),
        };
        world.walls.set(wall, Plane::new(Vec3::unit_y(), height).unwrap()).unwrap();
        world.walls.set_motion(wall, Some(motion)).unwrap();
        world.step(1.0 / 60.0).unwrap();
        let gap = world.marbles.get(id).unwrap().position.y - height - 0.1;
        assert!(gap.abs() < 5e-3, "{step}: {gap}");
    }
}

#[test]
fn what_it_cannot_run_is_refused_by_name() {
    let mut world = world::<f32>(2);
    let error = world.set_period([Some(5.0), None, None]).unwrap_err();
    assert!(error.to_string().contains("SoftStep does not support a period"), "{error}");
    let capsule = Marble { half_length: 0.2, ..Marble::new(Point3::new(0.0, 1.0, 0.0), 0.1) };
    world.marbles.insert(capsule).unwrap();
    let before = world.clone();
    assert!(matches!(world.step(0.01), Err(taw::Error::UnsupportedShape(_))));
    assert_eq!(world, before);
}

#[test]
fn verbs_in_any_order_and_swarms_of_other_times_do_no_harm() {
    let (mut world, mut ids) = heap::<f32>(40, 30);
    let before = world.swarm.clone();
    let gone = ids.swap_remove(7);
    world.marbles.remove(gone).unwrap();
    ids.push(world.marbles.insert(Marble::new(Point3::new(0.0, 1.4, 0.0), 0.1)).unwrap());
    world.step(1.0 / 60.0).unwrap();
    world.swarm = before;
    world.step(1.0 / 60.0).unwrap();
    let ball = (0..world.swarm.len()).find_map(|row| world.swarm.id(row)).unwrap();
    assert!(world.swarm.remove(&[ball]).is_err(), "it is a marble's");
    world.restitute(0.01).unwrap();
    world.generate_contacts();
    world.restitute(0.1).unwrap();
    world.integrate(1e-6).unwrap();
    let gone = ids.swap_remove(3);
    world.marbles.remove(gone).unwrap();
    world.generate_contacts();
    world.marbles.insert(Marble::new(Point3::new(0.0, 1.9, 0.0), 0.1)).unwrap();
    world.restitute(0.02).unwrap();
    world.swarm = taw::swarm::Swarm::default();
    world.step(1.0 / 60.0).unwrap();
    World::<f32>::restitute(&mut self::world(2), 0.01).unwrap();
    let mut light = self::world::<f64>(2);
    floor(&mut light);
    let mass = taw::world::Mass::Kilograms(1e-60);
    let tiny = Marble { mass, ..Marble::new(Point3::new(0.0, 1e-3, 0.0), 1e-9) };
    let tiny = light.marbles.insert(tiny).unwrap();
    for _ in 0..120 {
        world.step(1.0 / 60.0).unwrap();
        light.step(1.0 / 60.0).unwrap();
    }
    assert!(light.marbles.get(tiny).unwrap().position.y.abs() < 1e-2);
    for Point3 { x, y, z } in world.marbles.position() {
        assert!(x.abs().max(z.abs()) < 0.5 && (0.0..3.0).contains(y), "{x} {y} {z}");
    }
}

/// A clone compares every marble with its row, the original only those that were set.
#[test]
fn whatever_is_set_of_a_marble_reaches_its_row() {
    for seed in 0..40_u64 {
        let mut random = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
        let mut next = |count: u64| {
            random ^= random << 13;
            random ^= random >> 7;
            random ^= random << 17;
            (random >> 20) % count
        };
        let (mut world, ids) = heap::<f32>(20, 30);
        for step in 0..25 {
            for _ in 0..next(4) {
                let id = ids[next(20) as usize];
                let x = next(100) as f32 * 0.02 + 0.01;
                let v = Vec3::new(x - 1.0, 0.5 * x, 0.3);
                let marbles = &mut world.marbles;
                match next(14) {
                    0 => marbles.set_position(id, Point3::new(x, 3.0, -x)),
                    1 => marbles.set_velocity(id, v),
                    2 => marbles.set_radius(id, 0.05 + 0.05 * x),
                    3 => marbles.set_angular_velocity(id, v * 9.0),
                    4 => marbles.set_mass(id, Mass::Density(100.0 * x)),
                    5 => marbles.set_material(
                        id,
                        Some(Material { friction: 0.1 * x, ..Material::default() }),
                    ),
                    6 => marbles.set_rotation_model(id, Some(Rotation::None)),
                    7 => marbles.apply_impulse(id, v),
                    8 => marbles
                        .apply_angular_impulse(id, taw::frame::Bivector::wedge(v, Vec3::unit_y())),
                    9 => marbles.apply_force(id, v * 1e3),
                    10 => marbles.apply_torque(id, taw::frame::Bivector::wedge(v, Vec3::unit_x())),
                    11 => marbles.set_gravity_scale(id, x - 0.5),
                    12 => world.set_speed_limits(taw::world::SpeedLimits {
                        linear: Some(0.5 + x),
                        angular: None,
                    }),
                    _ => marbles.set_momentum(id, v),
                }
                .unwrap();
            }
            let mut clone = world.clone();
            world.step(1.0 / 60.0).unwrap();
            clone.step(1.0 / 60.0).unwrap();
            assert_eq!(world.marbles, clone.marbles, "seed {seed}, step {step}");
        }
    }
}

#[test]
fn a_spin_beyond_all_numbers_is_stopped_and_named() {
    let mut world = world::<f32>(2);
    world.set_model(Model { rotation: Rotation::Rolling, ..world.model() }).unwrap();
    let id = world.marbles.insert(Marble::new(Point3::new(0.0, 1.0, 0.0), 0.1)).unwrap();
    world.marbles.set_angular_velocity(id, Vec3::new(3e38, 3e38, 0.4)).unwrap();
    world.step(1.0 / 60.0).unwrap();
    let rotation = world.marbles.get(id).unwrap().rotation;
    assert!(rotation.s.is_finite() && rotation.v.x.is_finite(), "{rotation:?}");
    assert_eq!(world.stopped().collect::<Vec<_>>(), [id]);
}

type Change = fn(&mut Marble<f64>);

#[test]
fn numbers_that_rows_cannot_hold_are_refused_by_name() {
    let changes: [(&str, f64, Change); 5] = [
        ("position.y", 1e13, |marble| marble.position.y = 1e13),
        ("velocity.z", -2e12, |marble| marble.velocity.z = -2e12),
        ("angular_velocity.x", 3e13, |marble| marble.angular_velocity.x = 3e13),
        ("radius", 1e-10, |marble| marble.radius = 1e-10),
        ("radius", 1e13, |marble| marble.radius = 1e13),
    ];
    for (field, value, change) in changes {
        let mut world = world::<f64>(2);
        let other = world.marbles.insert(Marble::new(Point3::new(5.0, 0.0, 0.0), 0.1)).unwrap();
        world.step(1.0 / 60.0).unwrap();
        let mut marble = Marble::new(Point3::new(0.0, 0.0, 0.0), 0.1);
        change(&mut marble);
        let id = world.marbles.insert(marble).unwrap();
        let before = world.clone();
        match world.step(1.0 / 60.0) {
            Err(taw::Error::OutOfRange { field: named, value: is, .. }) => {
                assert_eq!((named, is), (field, value));
            }
            other => panic!("{field}: {other:?}"),
        }
        assert!(world == before, "{field}: something has changed");
        assert!(world.integrate(1.0 / 60.0).is_err());
        world.generate_contacts();
        assert!(world.restitute(1.0 / 60.0).is_err(), "{field}: each verb refuses it");
        assert!(world.marbles == before.marbles, "{field}: a verb has changed something");
        world.marbles.remove(id).unwrap();
        world.step(1.0 / 60.0).unwrap();
        assert!(world.marbles.get(other).unwrap().velocity.y < -0.3);
    }
}

#[test]
fn a_marble_is_named_once_however_often_it_was_set() {
    let mut world = world::<f64>(1);
    let ids = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]
        .map(|x| world.marbles.insert(Marble::new(Point3::new(x, 0.0, 0.0), 0.1)).unwrap());
    world.step(1.0 / 60.0).unwrap();
    for speed in [2e12, 3e12] {
        world.marbles.set_velocity(ids[3], Vec3::new(speed, 0.0, 0.0)).unwrap();
    }
    let named: Vec<_> = world.unsupported_marbles().into_iter().map(|(id, _)| id).collect();
    assert_eq!(named, [ids[3]]);
}

#[test]
fn the_least_radius_is_accepted() {
    let mut world = world::<f32>(1);
    world.marbles.insert(Marble::new(Point3::new(0.0, 0.0, 0.0), 1e-9)).unwrap();
    world.step(1.0 / 60.0).unwrap();
}

#[test]
fn a_marble_that_flies_far_may_fly_on() {
    let mut world = world::<f64>(1);
    world.set_gravity(Vec3::zero()).unwrap();
    let far = Marble {
        velocity: Vec3::new(9e11, 0.0, 0.0),
        ..Marble::new(Point3::new(9e11, 0.0, 0.0), 0.1)
    };
    let id = world.marbles.insert(far).unwrap();
    for _ in 0..3 {
        world.step(0.25).unwrap();
        world.marbles.insert(Marble::new(Point3::new(0.0, 0.0, 0.0), 0.1)).unwrap();
    }
    assert!(world.marbles.get(id).unwrap().position.x > 1.5e12);
}

/// The wall in the last row moves into that of the removed one; contacts and their impulses go with it.
#[test]
fn a_wall_may_be_removed_while_marbles_touch_another() {
    let box_ =
        |x: f64| Aabb { min: Point3::new(x - 0.5, 0.0, -0.5), max: Point3::new(x + 0.5, 1.0, 0.5) };
    for rotation in [Rotation::None, Rotation::Rolling, Rotation::Dynamic] {
        for steps in 1..60 {
            let mut world = world::<f64>(2);
            world.set_model(Model { rotation, ..world.model() }).unwrap();
            let ids = [10.0, 20.0, 0.0, 3.0].map(|x| world.walls.insert(box_(x)).unwrap());
            for x in [0.0, 3.0] {
                world.marbles.insert(Marble::new(Point3::new(x, 2.0, 0.0), 0.2)).unwrap();
            }
            (0..steps).for_each(|_| world.step(1.0 / 60.0).unwrap());
            let mut with_all = world.clone();
            world.walls.remove(ids[0]).unwrap();
            world.walls.remove(ids[1]).unwrap();
            for _ in 0..30 {
                world.step(1.0 / 60.0).unwrap();
                with_all.step(1.0 / 60.0).unwrap();
                let named = |world: &World<f64>| -> Vec<_> {
                    let contacts = world.contacts.wm.iter();
                    contacts.map(|c| (world.walls.id(c.a as usize).unwrap(), c.b)).collect()
                };
                assert_eq!(named(&world), named(&with_all), "{rotation:?} after {steps}");
            }
            let places = |world: &World<f64>| world.marbles.position().to_vec();
            assert_eq!(places(&world), places(&with_all), "{rotation:?} after {steps}");
        }
    }
}

/// Of a marble that turns for show only, the listed contact says which way.
#[test]
fn walls_and_marbles_may_be_removed_between_the_verbs() {
    for rotation in [Rotation::Rolling, Rotation::Dynamic] {
        let mut world = world::<f32>(1);
        world.set_model(Model { rotation, ..world.model() }).unwrap();
        let walls: Vec<_> = (0..3).map(|_| floor(&mut world)).collect();
        let marbles: Vec<_> = (0..3_u8)
            .map(|x| Marble::new(Point3::new(f32::from(x), 0.099, 0.0), 0.1))
            .map(|marble| world.marbles.insert(marble).unwrap())
            .collect();
        for (wall, marble) in walls.into_iter().zip(marbles) {
            world.begin_step();
            world.integrate(1.0 / 60.0).unwrap();
            world.generate_contacts();
            world.walls.remove(wall).unwrap();
            world.marbles.remove(marble).unwrap();
            world.restitute(1.0 / 60.0).unwrap();
            world.end_step();
        }
        assert!(world.contacts.is_empty());
    }
}
