//! Walls of any shape, at rest and in motion, and marbles that are no balls of the swarm.

use taw::Error;
use taw::prelude::*;
use taw::shape::Mesh;
use taw::swarm::{Ball, Swarm, SwarmModel, Tier};

use super::{DT, model, one, steps, world};

#[test]
fn walls_of_any_shape_hold_balls_without_seams() {
    // A floor of triangles, and a box on it; the balls roll over both.
    let mut world = World::<f32>::default();
    world.swarm.set_model(SwarmModel { sleeps: false, ..model(Tier::Full) }).unwrap();
    let mut points = Vec::new();
    let mut triangles = Vec::new();
    for i in 0..21_u16 {
        for j in 0..21_u16 {
            points.push(Point3::new(f32::from(i) - 10.0, 0.0, f32::from(j) - 10.0));
            if i < 20 && j < 20 {
                let at = u32::from(i * 21 + j);
                triangles.extend([[at, at + 1, at + 21], [at + 1, at + 22, at + 21]]);
            }
        }
    }
    let mesh = Mesh::new(points, triangles).unwrap();
    let pose = taw::frame::Pose::identity();
    world.walls.insert(WallShape::Mesh(std::sync::Arc::new(mesh), pose)).unwrap();
    let mut balls = Vec::new();
    for i in 0..10_u8 {
        let place = Point3::new(-8.0, 0.4, f32::from(i) * 1.5 - 7.0);
        balls.push(Ball { velocity: Vec3::new(5.0, 0.0, 0.0), ..Ball::new(place, 0.4) });
    }
    let ids = world.swarm.insert(&balls).unwrap();
    steps(&mut world, 60);
    for (ball, id) in balls.iter().zip(&ids) {
        let (place, velocity) = one(&world, *id);
        assert!((place.y - 0.4).abs() < 2e-3, "{} m high", place.y);
        assert!(velocity.z.abs() < 1e-3 && (place.z - ball.position.z).abs() < 1e-3);
        assert!((velocity.x - 25.0 / 7.0).abs() < 0.02, "{} m/s", velocity.x);
    }
}

#[test]
fn a_wall_that_moves_takes_balls_along() {
    let mut world = world(SwarmModel { sleeps: true, ..model(Tier::Full) }, None);
    let floor = world.walls.id(0).unwrap();
    let id = world.swarm.insert(&[Ball::new(Point3::new(0.0, 0.5, 0.0), 0.5)]).unwrap()[0];
    for step in 1..=120_u8 {
        let height = f32::from(step) * DT * 2.0;
        world.walls.set(floor, Plane::new(Vec3::unit_y(), height).unwrap()).unwrap();
        let up = taw::motion::WallMotion {
            velocity: Vec3::new(0.0, 2.0, 0.0),
            angular_velocity: Vec3::new(0.0, 0.0, 0.0),
            pivot: Point3::new(0.0, 0.0, 0.0),
        };
        world.walls.set_motion(floor, Some(up)).unwrap();
        steps(&mut world, 1);
    }
    let (place, velocity) = one(&world, id);
    assert!((place.y - 4.5).abs() < 0.02, "{} m", place.y);
    assert!((velocity.y - 2.0).abs() < 0.05, "{} m/s", velocity.y);
}

/// A box that comes from afar pushes a ball that nothing else moves.
#[test]
fn a_box_that_moves_is_noticed_by_balls_at_rest() {
    for tier in [Tier::Full, Tier::Lab] {
        let mut world = world(SwarmModel { sleeps: true, ..model(tier) }, None);
        let id = world.swarm.insert(&[Ball::new(Point3::new(0.0, 0.5, 0.0), 0.5)]).unwrap()[0];
        let at = |x: f32| taw::shape::Aabb3 {
            min: Point3::new(x - 1.0, 0.1, -2.0),
            max: Point3::new(x, 2.0, 2.0),
        };
        let wall = world.walls.insert(at(-5.0)).unwrap();
        steps(&mut world, 60);
        let rebuilds = world.swarm.rebuilds();
        for step in 1..=300_u16 {
            let motion = taw::motion::WallMotion {
                velocity: Vec3::new(1.2, 0.0, 0.0),
                angular_velocity: Vec3::new(0.0, 0.0, 0.0),
                pivot: Point3::new(0.0, 0.0, 0.0),
            };
            world.walls.set(wall, at(-5.0 + 1.2 * f32::from(step) * DT)).unwrap();
            world.walls.set_motion(wall, Some(motion)).unwrap();
            steps(&mut world, 1);
            if step == 200 {
                assert_eq!(world.swarm.rebuilds(), rebuilds, "nothing was sought anew by chance");
            }
        }
        let place = one(&world, id).0;
        assert!(place.x > 1.45 && place.x < 2.5, "{tier:?}: {} m", place.x);
    }
}

#[test]
fn marbles_and_swarms_push_each_other() {
    for tier in [Tier::Full, Tier::Lab] {
        let mut world = World::<f64>::default();
        let elastic = Material { restitution: 1.0, friction: 0.0, ..Material::default() };
        world.swarm.set_model(SwarmModel { material: elastic, ..model(tier) }).unwrap();
        world.set_gravity(Vec3::new(0.0, 0.0, 0.0)).unwrap();
        let ball =
            Ball { mass: Mass::Kilograms(1.0), ..Ball::new(Point3::new(0.0, 0.0, 0.0), 0.5) };
        let id = world.swarm.insert(&[ball]).unwrap()[0];
        let marble = Marble {
            velocity: Vec3::new(2.0, 0.0, 0.0),
            mass: Mass::Kilograms(1.0),
            ..Marble::new(Point3::new(-3.0, 0.0, 0.0), 0.5)
        };
        let marble = world.marbles.insert(marble).unwrap();
        for _ in 0..150 {
            world.step(1.0 / 60.0).unwrap();
        }
        let speed = world.marbles.get(marble).unwrap().velocity.x;
        let row = world.swarm.row(id).unwrap();
        let other = world.swarm.velocities()[row][0];
        if tier == Tier::Full {
            assert!((other - 2.0).abs() < 0.02 && speed.abs() < 0.02, "{speed} and {other} m/s");
        } else {
            let apart = world.swarm.balls()[row][0] - world.marbles.get(marble).unwrap().position.x;
            assert!(apart > 0.95, "{apart} m apart");
        }
        // It is one of the balls, and goes when the marble does.
        assert_eq!(world.swarm.len(), 2);
        assert_eq!((0..2).filter(|row| world.swarm.is_marble(*row)).count(), 1);
        world.marbles.remove(marble).unwrap();
        world.step(1.0 / 60.0).unwrap();
        assert_eq!(world.swarm.len(), 1);
    }
}

#[test]
fn marbles_stay_guests_whatever_is_taken_out() {
    let mut world = world(model(Tier::Full), None);
    let place = |i: usize| Point3::new(2.0 * i as f32, 0.5, 0.0);
    let marbles: Vec<_> =
        (0..4).map(|i| world.marbles.insert(Marble::new(place(i), 0.5)).unwrap()).collect();
    let own = world.swarm.insert(&[Ball::new(place(9), 0.5)]).unwrap()[0];
    let guests = |world: &World<f32>| {
        let rows = (0..world.swarm.len()).filter(|row| world.swarm.is_marble(*row));
        let mut places: Vec<_> =
            rows.map(|row| world.swarm.balls()[row][0].round() as u8).collect();
        places.sort_unstable();
        places
    };
    steps(&mut world, 2);
    assert_eq!(guests(&world), [0, 2, 4, 6]);
    // Who takes the marble takes the ball.
    let row = (0..5).find(|row| world.swarm.balls()[*row][0] == 2.0).unwrap();
    let ball = world.swarm.id(row).unwrap();
    assert_eq!(world.swarm.remove(&[ball]), Err(Error::NoSuchBall(ball)));
    for marble in [marbles[1], marbles[2]] {
        world.marbles.remove(marble).unwrap();
    }
    steps(&mut world, 2);
    assert_eq!(guests(&world), [0, 6]);
    for (i, marble) in [(0, marbles[0]), (3, marbles[3])] {
        assert!(world.marbles.get(marble).unwrap().position.distance(place(i)) < 0.02);
    }
    assert!(one(&world, own).0.distance(place(9).to_vec()) < 0.02);
    // Another swarm in its place has guests of its own.
    world.swarm = Swarm::default();
    let balls: Vec<_> = (10..14).map(|i| Ball::new(place(i), 0.5)).collect();
    let balls = world.swarm.insert(&balls).unwrap();
    steps(&mut world, 2);
    assert_eq!(guests(&world), [0, 6]);
    assert!(balls.iter().all(|ball| world.swarm.row(*ball).is_ok()));
}

/// One lies deep in the floor, where nothing may move it, and a ball falls on it.
#[test]
fn a_marble_of_infinite_mass_in_a_wall_stays_a_number() {
    let responses = [Response::Impulse, Response::SoftStep];
    for (tier, response) in
        [Tier::Full, Tier::Lab].into_iter().flat_map(|t| responses.map(|r| (t, r)))
    {
        let mut world = world(model(tier), None);
        let model = Model { response, rotation: Rotation::Dynamic, ..Model::default() };
        world.set_model(model).unwrap();
        let mass = Mass::Infinite;
        let marble = Marble { mass, ..Marble::new(Point3::new(0.0, 0.3, 0.0), 0.5) };
        let marble = world.marbles.insert(marble).unwrap();
        let id = world.swarm.insert(&[Ball::new(Point3::new(0.05, 1.4, 0.0), 0.5)]).unwrap()[0];
        steps(&mut world, 30);
        let marble = world.marbles.get(marble).unwrap();
        let (place, velocity) = one(&world, id);
        for v in [marble.position.to_vec(), marble.velocity, place, velocity] {
            assert!(v.magnitude2().is_finite(), "{tier:?}, {response:?}: {v:?}");
        }
    }
}

/// It goes as it is told, through a half-space too, whatever balls a swarm has, far away or in its way.
#[test]
fn a_marble_of_infinite_mass_goes_as_it_is_told_among_balls() {
    let responses = [Response::Impulse, Response::EventDriven];
    for (tier, response) in
        [Tier::Full, Tier::Lab].into_iter().flat_map(|t| responses.map(|r| (t, r)))
    {
        let run = |ball: Option<Point3<f32>>| {
            let mut world = world(model(tier), None);
            world.set_model(Model { response, ..Model::default() }).unwrap();
            world.set_gravity(Vec3::new(0.0, 0.0, 0.0)).unwrap();
            world.walls.insert(Plane::new(-Vec3::unit_x(), -1.0).unwrap()).unwrap();
            let marble = Marble {
                mass: Mass::Infinite,
                velocity: Vec3::unit_x() * 5.0,
                ..Marble::new(Point3::new(0.0, 2.0, 0.0), 0.5)
            };
            let marble = world.marbles.insert(marble).unwrap();
            let ball = ball.map(|at| Ball::new(at, 0.3));
            world.swarm.insert(ball.as_slice()).unwrap();
            steps(&mut world, 64);
            world.marbles.get(marble).unwrap()
        };
        let alone = run(None);
        for at in [Point3::new(0.0, 2.0, 50.0), Point3::new(0.9, 2.1, 0.0)] {
            assert!(run(Some(at)) == alone, "{tier:?}, {response:?}: {:?}", run(Some(at)));
        }
    }
}

/// A plate that goes further in a step than it is wide strikes what it meets, whatever steps the
/// marbles.
#[test]
fn no_plate_passes_through_a_ball_of_the_swarm() {
    let mut passed = Vec::new();
    let all =
        [Response::Displacement, Response::Impulse, Response::EventDriven, Response::SoftStep];
    for response in all {
        for speed in [3.0_f32, 8.0, 20.0, 40.0] {
            let mut world = world(model(Tier::Full), None);
            world.set_model(Model { response, ..world.model() }).unwrap();
            world.set_gravity(Vec3::new(0.0, 0.0, 0.0)).unwrap();
            let begin = -0.7 * speed * 5.0 * DT - 0.2;
            let at = |x: f32| taw::shape::Aabb3 {
                min: Point3::new(x - 0.01, -1.0, -1.0),
                max: Point3::new(x, 1.0, 1.0),
            };
            let wall = world.walls.insert(at(begin)).unwrap();
            let ball =
                world.swarm.insert(&[Ball::new(Point3::new(0.0, 0.52, 0.01), 0.05)]).unwrap();
            for step in 1..=30_u8 {
                let x = begin + speed * f32::from(step) * DT;
                let motion = taw::motion::WallMotion {
                    velocity: Vec3::new(speed, 0.0, 0.0),
                    angular_velocity: Vec3::new(0.0, 0.0, 0.0),
                    pivot: Point3::new(0.0, 0.0, 0.0),
                };
                world.walls.set(wall, at(x)).unwrap();
                world.walls.set_motion(wall, Some(motion)).unwrap();
                steps(&mut world, 1);
                if one(&world, ball[0]).0.x < x {
                    passed.push((response, speed, step));
                    break;
                }
            }
        }
    }
    assert!(passed.is_empty(), "{passed:?}");
}
