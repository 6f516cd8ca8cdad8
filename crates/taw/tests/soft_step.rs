//! `Response::SoftStep`: marbles on the rows of the swarm.

use cgmath::{InnerSpace, Zero};
use taw::prelude::*;
use taw::swarm::Ball;

fn world<S: Scalar>(substeps: u32) -> World<S> {
    let mut world = World::default();
    let model = Model {
        response: Response::SoftStep,
        rotation: Rotation::Dynamic,
        substeps,
        ..Model::default()
    };
    world.set_model(model).unwrap();
    world
}

fn floor<S: Scalar>(world: &mut World<S>) -> WallId {
    world.walls.insert(Plane::new(Vec3::unit_y(), S::zero()).unwrap()).unwrap()
}

#[test]
fn a_marble_dropped_on_a_floor_comes_to_rest_there() {
    let mut world = world::<f32>(4);
    floor(&mut world);
    let taw = world.marbles.insert(Marble::new(Point3::new(0.0, 2.0, 0.0), 0.5)).unwrap();
    for _ in 0..600 {
        world.step(1.0 / 60.0).unwrap();
    }
    let marble = world.marbles.get(taw).unwrap();
    assert!((marble.position.y - 0.5).abs() < 1e-3, "{marble:?}");
    assert!(marble.velocity.magnitude() < 1e-6, "{marble:?}");
}

#[test]
fn a_bounce_reaches_the_height_that_restitution_leaves() {
    for (substeps, e) in [(1, 0.5), (4, 0.5), (4, 0.9), (8, 1.0), (2, 0.7)] {
        let mut world = world::<f32>(substeps);
        floor(&mut world);
        let material = Material { restitution: e, ..Material::default() };
        let marble =
            Marble { material: Some(material), ..Marble::new(Point3::new(0.0, 1.1, 0.0), 0.1) };
        let taw = world.marbles.insert(marble).unwrap();
        let (mut highest, mut bounced) = (0.0_f32, false);
        for _ in 0..120 {
            world.step(1.0 / 60.0).unwrap();
            let marble = world.marbles.get(taw).unwrap();
            if marble.velocity.y > 0.0 {
                bounced = true;
            } else if bounced && highest > 0.0 {
                break;
            }
            if bounced {
                highest = highest.max(marble.position.y - 0.1);
            }
        }
        let asked = e * e;
        println!("{substeps} {e}: {highest} asked {asked}");
        assert!((highest - asked).abs() < 0.02 * asked, "{substeps}: {highest}, not {asked}");
    }
}

#[test]
fn a_slipping_ball_rolls_at_five_sevenths_of_its_speed() {
    let mut world = world::<f32>(2);
    floor(&mut world);
    let marble = Marble {
        velocity: Vec3::new(3.0, 0.0, 0.0),
        ..Marble::new(Point3::new(0.0, 0.2, 0.0), 0.2)
    };
    let taw = world.marbles.insert(marble).unwrap();
    for _ in 0..120 {
        world.step(1.0 / 60.0).unwrap();
    }
    let marble = world.marbles.get(taw).unwrap();
    println!("{} {}", marble.velocity.x, marble.angular_velocity.z);
    assert!((marble.velocity.x - 15.0 / 7.0).abs() < 1e-3, "{marble:?}");
    assert!((marble.angular_velocity.z * 0.2 + marble.velocity.x).abs() < 1e-3, "{marble:?}");
}

#[test]
fn on_a_slope_it_rolls_with_five_sevenths_of_gravity() {
    for angle in [0.1_f32, 0.3] {
        let mut world = world::<f32>(2);
        let normal = Vec3::new(-angle.sin(), angle.cos(), 0.0);
        world.walls.insert(Plane::new(normal, 0.0).unwrap()).unwrap();
        let material = Material { friction: 0.5, ..Material::default() };
        let marble = Marble {
            material: Some(material),
            ..Marble::new(Point3::new(0.0, 0.0, 0.0) + normal * 0.1, 0.1)
        };
        let taw = world.marbles.insert(marble).unwrap();
        for _ in 0..60 {
            world.step(1.0 / 60.0).unwrap();
        }
        let speed = world.marbles.get(taw).unwrap().velocity.magnitude();
        let asked = 5.0 / 7.0 * 9.81 * angle.sin();
        println!("{angle}: {speed} {asked}");
        assert!((speed - asked).abs() < 2e-3 * asked, "{speed}, not {asked}");
    }
}

#[test]
fn rolling_resistance_holds_a_ball_on_slopes_up_to_its_tangent() {
    for (angle, holds) in [(0.08_f32, true), (0.12, false)] {
        let mut world = world::<f32>(2);
        let normal = Vec3::new(-angle.sin(), angle.cos(), 0.0);
        world.walls.insert(Plane::new(normal, 0.0).unwrap()).unwrap();
        let material = Material { friction: 0.5, rolling_resistance: 0.1, ..Material::default() };
        let marble = Marble {
            material: Some(material),
            ..Marble::new(Point3::new(0.0, 0.0, 0.0) + normal * 0.1, 0.1)
        };
        let taw = world.marbles.insert(marble).unwrap();
        for _ in 0..120 {
            world.step(1.0 / 60.0).unwrap();
        }
        let way =
            world.marbles.get(taw).unwrap().position - (Point3::new(0.0, 0.0, 0.0) + normal * 0.1);
        println!("{angle}: {}", way.magnitude());
        assert_eq!(way.magnitude() < 1e-3, holds, "{}", way.magnitude());
    }
}

#[test]
fn an_elastic_gas_keeps_its_energy() {
    for substeps in [1, 2, 4] {
        let mut world = world::<f32>(substeps);
        world.set_gravity(Vec3::zero()).unwrap();
        for axis in [Vec3::unit_x(), Vec3::unit_y(), Vec3::unit_z()] {
            for n in [axis, -axis] {
                world.walls.insert(Plane::new(n, -3.0).unwrap()).unwrap();
            }
        }
        let material = Material { restitution: 1.0, friction: 0.0, ..Material::default() };
        let mut seed = 1_u64;
        let mut random = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (seed >> 40) as f32 / (1 << 23) as f32 - 1.0
        };
        for i in 0..216_u16 {
            let at = [i % 6, i / 6 % 6, i / 36].map(|k| f32::from(k) * 0.9 - 2.25);
            let velocity = Vec3::new(random(), random(), random()) * 3.0;
            let marble =
                Marble { velocity, material: Some(material), ..Marble::new(Point3::from(at), 0.3) };
            world.marbles.insert(marble).unwrap();
        }
        let before = world.energy().total();
        let mut most = before;
        for _ in 0..600 {
            world.step(1.0 / 60.0).unwrap();
            most = most.max(world.energy().total());
        }
        let after = world.energy().total();
        println!("{substeps}: {} {}", after / before, most / before);
        assert!((after / before - 1.0).abs() < 0.01, "{}", after / before);
        assert!(most / before < 1.0 + 1e-4, "{}", most / before);
    }
}

#[test]
fn marbles_and_balls_of_a_swarm_go_the_same_way() {
    let places = (0..300_u16).map(|i| {
        let [x, y, z] = [i % 6, i / 36, i / 6 % 6].map(f32::from);
        Point3::new(x * 0.22 + y * 0.013, 0.2 + y * 0.25, z * 0.21 + y * 0.017)
    });
    let places: Vec<_> = places.collect();
    let mass = taw::world::Mass::Kilograms(0.5);
    let mut marbles = world::<f32>(2);
    let mut balls = world::<f32>(2);
    for world in [&mut marbles, &mut balls] {
        floor(world);
        for axis in [Vec3::unit_x(), Vec3::unit_z()] {
            world.walls.insert(Plane::new(axis, -0.2).unwrap()).unwrap();
            world.walls.insert(Plane::new(-axis, -1.4).unwrap()).unwrap();
        }
    }
    let ids: Vec<_> = places
        .iter()
        .map(|at| marbles.marbles.insert(Marble { mass, ..Marble::new(*at, 0.1) }).unwrap())
        .collect();
    let all: Vec<_> = places.iter().map(|at| Ball { mass, ..Ball::new(*at, 0.1) }).collect();
    let names = balls.swarm.insert(&all).unwrap();
    for _ in 0..300 {
        marbles.step(1.0 / 60.0).unwrap();
        balls.step(1.0 / 60.0).unwrap();
    }
    for (id, name) in ids.iter().zip(names) {
        let marble = marbles.marbles.get(*id).unwrap();
        let row = balls.swarm.row(name).unwrap();
        let [x, y, z, _] = balls.swarm.balls()[row];
        assert_eq!(Point3::new(x, y, z), marble.position);
    }
}

#[test]
fn a_heavy_ball_hardly_sinks_into_a_light_one() {
    let mut world = world::<f32>(4);
    floor(&mut world);
    let dense = |density| taw::world::Mass::Density(density);
    let light = Marble { mass: dense(1.0), ..Marble::new(Point3::new(0.0, 0.5, 0.0), 0.5) };
    let heavy = Marble { mass: dense(1000.0), ..Marble::new(Point3::new(0.0, 1.5, 0.0), 0.5) };
    let light = world.marbles.insert(light).unwrap();
    let heavy = world.marbles.insert(heavy).unwrap();
    let mut deepest = 0.0_f32;
    for _ in 0..300 {
        world.step(1.0 / 60.0).unwrap();
        let [a, b] = [light, heavy].map(|id| world.marbles.get(id).unwrap().position);
        deepest = deepest.max(1.0 - (b - a).magnitude()).max(0.5 - a.y);
    }
    println!("{deepest}");
    assert!(deepest < 0.005, "{deepest}");
}

#[test]
fn a_marble_without_gravity_stays_and_a_push_moves_it_as_newton_says() {
    let mut world = world::<f32>(3);
    let free = Marble { gravity_scale: 0.0, ..Marble::new(Point3::new(0.0, 2.0, 0.0), 0.5) };
    let free = world.marbles.insert(free).unwrap();
    let half = Marble { gravity_scale: 0.5, ..Marble::new(Point3::new(5.0, 0.0, 0.0), 0.5) };
    let half = world.marbles.insert(half).unwrap();
    let mass = taw::world::Mass::Kilograms(3.0);
    let pushed = Marble { mass, ..Marble::new(Point3::new(9.0, 0.0, 0.0), 0.5) };
    let pushed = world.marbles.insert(pushed).unwrap();
    for _ in 0..60 {
        world.marbles.apply_force(pushed, Vec3::new(6.0, 0.0, 0.0)).unwrap();
        world.step(1.0 / 60.0).unwrap();
    }
    let at = |id| world.marbles.get(id).unwrap();
    assert_eq!(at(free).position.y, 2.0);
    assert!((at(half).velocity.y + 4.905).abs() < 1e-3, "{:?}", at(half));
    assert!((at(pushed).velocity.x - 2.0).abs() < 1e-3, "{:?}", at(pushed));
}

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
        world.step(1.0 / 60.0).unwrap();
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
fn marbles_and_balls_push_each_other_as_equals() {
    for marble_first in [true, false] {
        let mut world = world::<f32>(2);
        world.set_gravity(Vec3::zero()).unwrap();
        let mass = taw::world::Mass::Kilograms(1.0);
        let ends = [Vec3::new(2.0, 0.0, 0.0), Vec3::zero()];
        let [u, v] = if marble_first { ends } else { [ends[1], ends[0]] };
        let [p, q] = if marble_first { [0.0, 1.0] } else { [1.0, 0.0] };
        let marble = Marble { velocity: u, mass, ..Marble::new(Point3::new(p, 0.0, 0.0), 0.1) };
        let id = world.marbles.insert(marble).unwrap();
        let ball = Ball { velocity: v, mass, ..Ball::new(Point3::new(q, 0.01, 0.0), 0.1) };
        let ball = world.swarm.insert(&[ball]).unwrap()[0];
        for _ in 0..60 {
            world.step(1.0 / 60.0).unwrap();
        }
        let row = world.swarm.row(ball).unwrap();
        let [x, ..] = world.swarm.velocities()[row];
        let sum = world.marbles.get(id).unwrap().velocity.x + x;
        assert!((sum - 2.0).abs() < 1e-5, "{sum}");
        let struck = if marble_first { x } else { world.marbles.get(id).unwrap().velocity.x };
        assert!(struck > 1.4, "{struck}");
    }
}

#[test]
fn in_f64_and_on_a_lift_a_heap_goes_along() {
    let (world, _) = heap::<f64>(64, 600);
    let fastest = world.marbles.velocity().iter().map(|v| v.magnitude()).fold(0.0, f64::max);
    assert!(fastest < 1e-6, "{fastest}");
    let mut world = self::world::<f32>(2);
    let wall = floor(&mut world);
    let id = world.marbles.insert(Marble::new(Point3::new(0.0, 0.1, 0.0), 0.1)).unwrap();
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
    let tiny = Marble { mass, ..Marble::new(Point3::new(0.0, 1e-3, 0.0), 1e-60) };
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
