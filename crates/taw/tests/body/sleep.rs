use super::*;
use taw::body::BodyMass;
use taw::motion::WallMotion;
use taw::shape::Obb;
use taw::swarm::Ball;
use taw::world::Marble;

/// Slab asleep on four balls of a swarm or marbles, and these.
pub fn slab_on_balls(of_swarm: bool) -> (World<f32>, BodyId, impl Fn(&mut World<f32>)) {
    let mut world = world::<f32>(true);
    let (mut balls, mut marbles) = (Vec::new(), Vec::new());
    for (x, z) in [(-0.3, -0.3), (-0.3, 0.3), (0.3, -0.3), (0.3, 0.3)] {
        let at = point(x, 0.1, z);
        if of_swarm {
            balls.extend(world.swarm.insert(&[Ball::new(at, 0.1)]).unwrap());
        } else {
            marbles.push(world.marbles.insert(Marble::new(at, 0.1)).unwrap());
        }
    }
    let slab = world.bodies.insert(cuboid([0.5, 0.05, 0.5], point(0.0, 0.25, 0.0))).unwrap();
    run(&mut world, 5.0);
    assert!(world.bodies.is_asleep(slab).unwrap());
    let clear = move |world: &mut World<f32>| {
        if !balls.is_empty() {
            world.swarm.remove(&balls).unwrap();
        }
        for marble in &marbles {
            world.marbles.remove(*marble).unwrap();
        }
    };
    (world, slab, clear)
}

#[test]
fn a_body_falls_when_the_balls_under_it_are_taken_out() {
    for of_swarm in [false, true] {
        let (mut world, slab, clear) = slab_on_balls(of_swarm);
        clear(&mut world);
        run(&mut world, 2.0);
        let height = place(&world, slab).y;
        assert!((height - 0.05).abs() < 2e-3, "of a swarm: {of_swarm}, {height}");
    }
}

#[test]
fn a_body_falls_when_the_marbles_under_it_are_placed_elsewhere() {
    let (mut world, slab, _) = slab_on_balls(false);
    let ids: Vec<_> = (0..4).map(|row| world.marbles.id(row).unwrap()).collect();
    for (at, id) in (0..).zip(ids) {
        world.marbles.set_position(id, point(5.0 + f64::from(at), 0.1, 0.0)).unwrap();
    }
    run(&mut world, 2.0);
    assert!((place(&world, slab).y - 0.05).abs() < 2e-3, "{:?}", place(&world, slab));
}

#[test]
fn a_ball_falls_when_the_body_under_it_goes() {
    type Change = fn(&mut World<f32>, BodyId);
    let changes: [(&str, Change); 3] = [
        ("removed", |world, table| drop(world.bodies.remove(table).unwrap())),
        ("placed elsewhere", |world, table| {
            let pose = world.bodies.pose(table).unwrap();
            let pose = taw::frame::Pose { translation: vector(9.0, 0.2, 0.0), ..pose };
            world.bodies.set_pose(table, pose).unwrap();
        }),
        ("made small", |world, table| {
            let small = cuboid([0.01, 0.2, 0.01], point(0.3, 0.2, 0.3));
            world.bodies.set(table, small).unwrap();
        }),
    ];
    for (name, change) in changes {
        for of_swarm in [false, true] {
            let mut world = world::<f32>(true);
            let table = world.bodies.insert(cuboid([0.5, 0.2, 0.5], point(0.0, 0.2, 0.0))).unwrap();
            let at = point(0.0, 0.45, 0.0);
            let (mut marble, mut ball) = (None, None);
            if of_swarm {
                ball = world.swarm.insert(&[Ball::new(at, 0.05)]).unwrap().first().copied();
            } else {
                marble = Some(world.marbles.insert(Marble::new(at, 0.05)).unwrap());
            }
            run(&mut world, 3.0);
            assert!(world.bodies.is_asleep(table).unwrap());
            change(&mut world, table);
            run(&mut world, 2.0);
            let height = match (marble, ball) {
                (Some(marble), _) => world.marbles.get(marble).unwrap().position.y,
                (_, Some(ball)) => world.swarm.balls()[world.swarm.row(ball).unwrap()][1],
                _ => f32::NAN,
            };
            assert!((height - 0.05).abs() < 2e-3, "{name}, of a swarm {of_swarm}: {height}");
        }
    }
}

/// A surface that moves by 3 cm/s carries a box along, for as long as it runs.
#[test]
fn a_slow_conveyor_carries_a_box_on() {
    let mut world = world::<f32>(true);
    let belt = world.walls.id(0).unwrap();
    let motion = WallMotion {
        velocity: vector(0.03, 0.0, 0.0),
        angular_velocity: vector(0.0, 0.0, 0.0),
        pivot: point(0.0, 0.0, 0.0),
    };
    world.walls.set_motion(belt, Some(motion)).unwrap();
    let body = world.bodies.insert(cuboid([0.2, 0.1, 0.2], point(0.0, 0.1, 0.0))).unwrap();
    run(&mut world, 20.0);
    let way = place(&world, body).x;
    assert!((way - 0.6).abs() < 5e-3, "{way}");
}

/// A body without weight, which nothing bears in the air, goes on.
#[test]
fn what_floats_slowly_floats_on() {
    let mut world = world::<f32>(true);
    let velocity = vector(0.02, 0.0, 0.0);
    let body =
        Body { gravity_scale: 0.0, velocity, ..cuboid([0.2, 0.1, 0.2], point(0.0, 3.0, 0.0)) };
    let body = world.bodies.insert(body).unwrap();
    run(&mut world, 20.0);
    let way = place(&world, body).x;
    assert!((way - 0.4).abs() < 1e-4, "{way}");
}

/// A wall that moves hits a body that stands within its way of one step, as hard as a faster body hits a wall.
#[test]
fn a_wall_that_moves_strikes_a_body() {
    for speed in [5.0, 20.0, 50.0] {
        let mut world = world::<f64>(false);
        world.set_gravity(vector(0.0, 0.0, 0.0)).unwrap();
        let bat = Obb::new(point(-0.5, 0.0, 0.0), about_z(0.0), vector(0.02, 0.3, 0.3)).unwrap();
        let bat = world.walls.insert(bat).unwrap();
        let elastic = material(0.0, 1.0);
        world.walls.set_material(bat, Some(elastic)).unwrap();
        let body = Body { material: elastic, ..cuboid([0.1, 0.1, 0.1], point(0.0, 0.0, 0.0)) };
        let body = world.bodies.insert(body).unwrap();
        let mut at = -0.5;
        for _ in 0..60 {
            at += speed / 60.0;
            if at < 2.0 {
                let moved = Obb::new(point(at, 0.0, 0.0), about_z(0.0), vector(0.02, 0.3, 0.3));
                world.walls.set(bat, moved.unwrap()).unwrap();
            }
            let motion = WallMotion {
                velocity: vector(if at < 2.0 { speed } else { 0.0 }, 0.0, 0.0),
                angular_velocity: vector(0.0, 0.0, 0.0),
                pivot: point(at, 0.0, 0.0),
            };
            world.walls.set_motion(bat, Some(motion)).unwrap();
            step(&mut world);
        }
        let hit = velocity(&world, body).x;
        assert!((hit / (2.0 * speed) - 1.0).abs() < 0.02, "at {speed}: {hit}");
    }
}

/// A box rises with a kinematic platform that rises by 1 cm/s.
#[test]
fn a_kinematic_platform_that_creeps_does_not_freeze_what_lies_on_it() {
    let mut world = world::<f32>(false);
    let platform = Body {
        mass: BodyMass::Uniform(Mass::Infinite),
        velocity: vector(0.0, 0.01, 0.0),
        ..cuboid([0.5, 0.1, 0.5], point(0.0, 0.0, 0.0))
    };
    let platform = world.bodies.insert(platform).unwrap();
    let body = world.bodies.insert(cuboid([0.1, 0.1, 0.1], point(0.0, 0.2, 0.0))).unwrap();
    run(&mut world, 20.0);
    let gap = place(&world, body).y - place(&world, platform).y;
    assert!((gap - 0.2).abs() < 2e-3, "{gap}");
}

/// A heavy ball, or box, that creeps pushes a light crate that sleeps, and is not stopped by it.
#[test]
fn what_is_heavy_and_slow_pushes_a_sleeper_away() {
    for of_ball in [true, false] {
        let mut world = world::<f32>(true);
        world.walls.set_material(world.walls.id(0).unwrap(), Some(material(0.0, 0.0))).unwrap();
        let light = BodyMass::Uniform(Mass::Kilograms(0.1));
        let crate_ = Body { mass: light, ..cuboid([0.1, 0.1, 0.1], point(0.0, 0.1, 0.0)) };
        let crate_ = world.bodies.insert(crate_).unwrap();
        run(&mut world, 2.0);
        assert!(world.bodies.is_asleep(crate_).unwrap());
        let velocity = vector(0.04, 0.0, 0.0);
        let at = point(-0.35, 0.2, 0.0);
        if of_ball {
            let mass = Mass::Kilograms(84.0);
            let sleeping_disabled = true;
            let marble = Marble { mass, velocity, sleeping_disabled, ..Marble::new(at, 0.2) };
            world.marbles.insert(marble).unwrap();
        } else {
            let mass = BodyMass::Uniform(Mass::Kilograms(84.0));
            let sleeping_disabled = true;
            let material = material(0.0, 0.0);
            let cuboid = cuboid([0.2, 0.2, 0.2], at);
            let body = Body { mass, velocity, sleeping_disabled, material, ..cuboid };
            world.bodies.insert(body).unwrap();
        }
        run(&mut world, 5.0);
        let way = place(&world, crate_).x;
        assert!((0.07..0.2).contains(&way), "of a ball: {of_ball}, {way}");
    }
}

/// A body or a wall that turns far away keeps nobody awake.
#[test]
fn what_moves_far_away_keeps_nobody_awake() {
    for of_wall in [false, true] {
        let mut world = world::<f32>(true);
        let at = point(50.0, 5.0, 0.0);
        let half = vector(0.5, 0.1, 0.1);
        let obb = |angle| Obb::new(at, about_z(angle), half).unwrap();
        let wall = of_wall.then(|| world.walls.insert(obb(0.0)).unwrap());
        if !of_wall {
            let spinner = Body {
                mass: BodyMass::Uniform(Mass::Infinite),
                angular_velocity: vector(0.0, 0.0, 1.0),
                ..Body::cuboid(half, at)
            };
            world.bodies.insert(spinner).unwrap();
        }
        let marble = world.marbles.insert(Marble::new(point(0.0, 0.1, 0.0), 0.1)).unwrap();
        let body = world.bodies.insert(cuboid([0.1, 0.1, 0.1], point(1.0, 0.1, 0.0))).unwrap();
        for step_number in 0..180 {
            if let Some(wall) = wall {
                let angle = f64::from(step_number) / 60.0;
                world.walls.set(wall, obb(angle)).unwrap();
                let motion = WallMotion {
                    velocity: vector(0.0, 0.0, 0.0),
                    angular_velocity: vector(0.0, 0.0, 1.0),
                    pivot: at,
                };
                world.walls.set_motion(wall, Some(motion)).unwrap();
            }
            step(&mut world);
        }
        assert!(world.bodies.is_asleep(body).unwrap(), "of a wall: {of_wall}");
        assert!(world.is_asleep(marble).unwrap(), "of a wall: {of_wall}");
    }
}
