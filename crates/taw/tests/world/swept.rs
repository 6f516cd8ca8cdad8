//! Swept detection: what is fast does not pass through what it meets.

mod boxes;
mod capsules;

use fastrand::Rng;
use proptest::prelude::*;
use taw::math::Quat;
use taw::prelude::*;
use taw::shape::{Mesh, Obb};

const DT: f32 = 1.0 / 60.0;

/// A world without gravity, which sweeps, with these balls of 0.1 m: place and velocity.
fn world(response: Response, balls: &[([f32; 3], [f32; 3])]) -> (World<f32>, Vec<MarbleId>) {
    let mut world = World::default();
    let model = Model { response, detection: Detection::Swept, ..Model::default() };
    world.set_model(model).unwrap();
    world.set_gravity(Vec3::zero()).unwrap();
    let insert = |(at, velocity): &([f32; 3], [f32; 3])| {
        let marble = Marble::new(Point3::from(*at), 0.1);
        world.marbles.insert(Marble { velocity: Vec3::from(*velocity), ..marble }).unwrap()
    };
    let ids = balls.iter().map(insert).collect();
    (world, ids)
}

const RESPONSES: [Response; 2] = [Response::Displacement, Response::Impulse];

#[test]
fn a_fast_ball_pushes_what_it_meets_and_does_not_pass() {
    for response in RESPONSES {
        // From afar, and from where they touch.
        for at in [-3.0, -0.2] {
            let still = ([0.0; 3], [0.0; 3]);
            let (mut world, ids) = world(response, &[([at, 0.0, 0.0], [300.0, 0.0, 0.0]), still]);
            for _ in 0..4 {
                world.step(DT).unwrap();
            }
            let [a, b] = [ids[0], ids[1]].map(|id| world.marbles.get(id).unwrap());
            assert!(b.position.x - a.position.x > 0.199, "{response:?}, from {at}");
            assert!(b.velocity.x >= a.velocity.x && b.velocity.x > 149.0, "{response:?}: {b:?}");
            assert!((a.velocity.x + b.velocity.x - 300.0).abs() < 1e-3, "{response:?}");
        }
    }
}

#[test]
fn what_was_stopped_is_in_the_way_of_others() {
    for response in RESPONSES {
        // The first two meet at the origin; the third comes by later, and would not have
        // met the first on its whole way.
        let balls = [
            ([-0.6, 0.0, 0.0], [60.0, 0.0, 0.0]),
            ([0.6, 0.0, 0.0], [-60.0, 0.0, 0.0]),
            ([-0.1, 3.0, 0.0], [0.0, -300.0, 0.0]),
        ];
        let (mut world, ids) = world(response, &balls);
        world.integrate(DT).unwrap();
        let third = world.marbles.get(ids[2]).unwrap();
        assert!((third.position.y - 0.2).abs() < 1e-4, "{response:?}: {third:?}");
    }
}

#[test]
fn who_comes_along_stops_behind_whom_is_stopped() {
    for response in RESPONSES {
        let along = |x| ([x, 0.0, 0.0], [300.0, 0.0, 0.0]);
        let (mut world, ids) =
            world(response, &[along(0.0), along(-0.3), along(-0.6), ([2.0, 0.0, 0.0], [0.0; 3])]);
        world.integrate(DT).unwrap();
        let at = |row: usize| world.marbles.get(ids[row]).unwrap().position.x;
        for (row, expected) in [(0, 1.8), (1, 1.6), (2, 1.4), (3, 2.0)] {
            assert!((at(row) - expected).abs() < 1e-4, "{response:?}: {row} is at {}", at(row));
        }
    }
}

#[test]
fn slow_piles_are_left_alone() {
    let balls = [([-0.1, 0.0, 0.0], [0.05, 1.0, 0.0]), ([0.1, 0.0, 0.0], [-0.05, 1.0, 0.0])];
    for response in RESPONSES {
        let (mut world, ids) = world(response, &balls);
        world.integrate(DT).unwrap();
        let first = world.marbles.get(ids[0]).unwrap();
        assert!((first.position.y - DT).abs() < 1e-6, "{response:?}: it slides along, {first:?}");
    }
}

proptest! {
    /// On straight ways up to where they were stopped, no two come closer than they may.
    #[test]
    fn nothing_passes_through_anything(
        places in prop::collection::vec(([-1.0..1.0_f32, -1.0..1.0, -1.0..1.0], [-200.0..200.0_f32, -200.0..200.0, -200.0..200.0]), 2..12)
    ) {
        let mut balls: Vec<([f32; 3], [f32; 3])> = Vec::new();
        let apart = |a: [f32; 3], b: [f32; 3]| (Vec3::from(a) - Vec3::from(b)).magnitude();
        for ball in places {
            if balls.iter().all(|other| apart(other.0, ball.0) > 0.21) {
                balls.push(ball);
            }
        }
        for response in RESPONSES {
            let (mut world, _) = world(response, &balls);
            world.integrate(DT).unwrap();
            let stop = |row: usize| {
                let (from, velocity) = (Vec3::from(balls[row].0), Vec3::from(balls[row].1));
                let moved = world.marbles.position()[row].to_vec() - from;
                moved.magnitude() / (velocity.magnitude() * DT).max(1e-9)
            };
            let stops: Vec<_> = (0..balls.len()).map(stop).collect();
            let at = |row: usize, time: f32| {
                let (from, velocity) = (Vec3::from(balls[row].0), Vec3::from(balls[row].1));
                from + velocity * (DT * time.min(stops[row]))
            };
            for step in 0_u16..=1000 {
                let time = f32::from(step) / 1000.0;
                for a in 0..balls.len() {
                    for b in 0..a {
                        let distance = (at(a, time) - at(b, time)).magnitude();
                        prop_assert!(distance > 0.199, "{response:?}: {distance} m");
                    }
                }
            }
        }
    }
}

/// A world of the default detection with a floor.
fn room(response: Response) -> World<f32> {
    let mut world = World::default();
    let rotation = Rotation::Dynamic;
    world.set_model(Model { response, rotation, ..Model::default() }).unwrap();
    world.walls.insert(Plane::new(Vec3::unit_y(), 0.0).unwrap()).unwrap();
    world
}

#[test]
fn two_balls_dropped_on_a_floor_come_down_and_nothing_hangs() {
    let mut random = Rng::with_seed(7);
    for run in 0..400 {
        let mut world = room(Response::Impulse);
        let ids = [0.0_f32, 1.0].map(|height| {
            let at =
                Point3::new(0.3 * random.f32(), 1.0 + height + random.f32(), 0.3 * random.f32());
            world.marbles.insert(Marble::new(at, 0.1 + 0.2 * random.f32())).unwrap()
        });
        let energy = world.energy().total();
        for _ in 0..300 {
            world.step(DT).unwrap();
        }
        assert!(world.energy().total() < energy, "run {run}");
        for id in ids {
            let Marble { position, velocity, radius, .. } = world.marbles.get(id).unwrap();
            let low = position.y < radius * 1.01 + 0.01 || velocity.y.abs() < 0.2;
            assert!(low, "run {run}: {position:?}, {velocity:?}");
        }
    }
}

#[test]
fn balls_poured_into_a_box_stay_slow_and_in_it() {
    let mut random = Rng::with_seed(8);
    for run in 0..20 {
        let mut world = room(Response::Impulse);
        for normal in [Vec3::unit_x(), -Vec3::unit_x(), Vec3::unit_z(), -Vec3::unit_z()] {
            world.walls.insert(Plane::new(normal, -0.3).unwrap()).unwrap();
        }
        for i in 0..40 {
            let mut any = || 0.2 * (random.f32() - 0.5);
            let at = Point3::new(any(), 0.2 + 0.21 * i as f32, any());
            world.marbles.insert(Marble::new(at, 0.1)).unwrap();
        }
        // Nothing can be faster than what fell from the top.
        let fastest = (2.0 * 9.81 * 9.0_f32).sqrt();
        for step in 0..400 {
            world.step(DT).unwrap();
            for row in 0..world.marbles.len() {
                let (at, speed) =
                    (world.marbles.position()[row], world.marbles.velocity()[row].magnitude());
                assert!(
                    speed < fastest && at.y > 0.0 && at.y < 9.0,
                    "run {run}, step {step}: {at:?} {speed} m/s"
                );
            }
        }
    }
}

#[test]
fn what_is_taken_out_of_the_contacts_stops_nobody() {
    for response in RESPONSES {
        let still = ([0.0; 3], [0.0; 3]);
        let (mut world, ids) = world(response, &[([-3.0, 0.0, 0.0], [300.0, 0.0, 0.0]), still]);
        world.integrate(DT).unwrap();
        world.generate_contacts();
        world.contacts.clear();
        world.restitute(DT).unwrap();
        let [a, b] = [ids[0], ids[1]].map(|id| world.marbles.get(id).unwrap());
        assert!((a.position.x - 2.0).abs() < 1e-4, "{response:?}: {a:?}");
        if response == Response::Impulse {
            assert_eq!((a.velocity.x, b.velocity.x), (300.0, 0.0));
        }
    }
}

#[test]
fn marbles_at_one_point_part_without_speed() {
    for response in [Response::Impulse] {
        for count in [2, 30] {
            let at = vec![([0.0; 3], [0.0; 3]); count];
            let (mut world, _) = world(response, &at);
            for _ in 0..120 {
                world.step(DT).unwrap();
            }
            let fastest =
                world.marbles.velocity().iter().map(|v| v.magnitude()).fold(0.0, f32::max);
            let far =
                world.marbles.position().iter().map(|p| p.to_vec().magnitude()).fold(0.0, f32::max);
            assert!(
                fastest < 1e-3 && far < 0.2 * count as f32,
                "{response:?}, {count}: {fastest} m/s, {far} m"
            );
        }
    }
}

#[test]
fn a_radius_that_grows_throws_nobody() {
    for response in [Response::Impulse] {
        let mut world = room(response);
        let id = world.marbles.insert(Marble::new(Point3::new(0.0, 0.8, 0.0), 0.8)).unwrap();
        world.marbles.set_radius(id, 2.0).unwrap();
        let mut highest = 0.0_f32;
        for _ in 0..240 {
            world.step(DT).unwrap();
            highest = highest.max(world.marbles.get(id).unwrap().position.y);
        }
        assert!(highest < 2.01, "{response:?}: {highest} m");
    }
}

/// A slope of 1 in 20 down toward +x, of flush triangles in cells of 8 mm, or of a half-space.
fn slope(flush: bool) -> World<f32> {
    let mut world = World::default();
    let (response, rotation) = (Response::Impulse, Rotation::Dynamic);
    world.set_model(Model { response, rotation, ..Model::default() }).unwrap();
    if !flush {
        let wall = Plane::through(Point3::new(0.0, 0.0, 0.0), Vec3::new(0.05, 1.0, 0.0)).unwrap();
        world.walls.insert(wall).unwrap();
        return world;
    }
    let (cells, rows) = (500_u32, 3_u32);
    let corner = |i: u32, j: u32| {
        let x = 0.008 * i as f32;
        Point3::new(x, -0.05 * x, 0.03 * (j as f32 - 1.5))
    };
    let points = (0..=cells).flat_map(|i| (0..=rows).map(move |j| corner(i, j))).collect();
    let at = |i: u32, j: u32| i * (rows + 1) + j;
    let cell = |i, j| {
        let [a, b, c, d] = [at(i, j), at(i, j + 1), at(i + 1, j), at(i + 1, j + 1)];
        [[a, b, c], [b, d, c]]
    };
    let triangles = (0..cells).flat_map(|i| (0..rows).flat_map(move |j| cell(i, j))).collect();
    world.walls.insert(Mesh::new(points, triangles).unwrap()).unwrap();
    world
}

#[test]
fn small_balls_roll_over_flush_triangles_as_over_a_plane() {
    for radius in [0.002_f32, 0.003, 0.005, 0.01] {
        let speed = |flush: bool| {
            let mut world = slope(flush);
            let material = Some(Material { friction: 0.5, ..Material::default() });
            let at = Point3::new(0.05, -0.0025 + 1.002 * radius, 0.003);
            let id = world.marbles.insert(Marble { material, ..Marble::new(at, radius) }).unwrap();
            for _ in 0..120 {
                world.step(DT).unwrap();
            }
            world.marbles.get(id).unwrap().velocity.x
        };
        let (flush, plane) = (speed(true), speed(false));
        assert!((flush - plane).abs() < 1e-3 * plane, "{radius} m: {flush} for {plane} m/s");
        // Five sevenths of g sin α, as it rolls.
        assert!((plane - 9.81 * 0.05 * 5.0 / 7.0 * 2.0).abs() < 0.02, "{radius} m: {plane} m/s");
    }
}

#[test]
fn bounces_do_not_carry_a_ball_out_of_a_box_of_half_spaces() {
    let mut random = Rng::with_seed(5);
    for run in 0..200 {
        let mut world = World::<f64>::default();
        world.set_gravity(Vec3::zero()).unwrap();
        world.set_model(Model { response: Response::Impulse, ..Model::default() }).unwrap();
        for axis in 0..3 {
            for side in [-1.0, 1.0] {
                let mut normal = Vec3::zero();
                normal[axis] = side;
                world.walls.insert(Plane::new(normal, -1.0).unwrap()).unwrap();
            }
        }
        let mut any = || 2.0 * random.f64() - 1.0;
        let at = Point3::new(0.8 * any(), 0.8 * any(), 0.8 * any());
        let way = Vec3::new(any(), any(), any()).normalize();
        let speed = [10.0, 100.0, 1000.0, 1e6][run % 4];
        let material = Some(Material { restitution: 1.0, friction: 0.0, ..Material::default() });
        let ball = Marble { velocity: way * speed, material, ..Marble::new(at, 0.1) };
        let id = world.marbles.insert(ball).unwrap();
        for step in 0..30 {
            world.step(1.0 / 60.0).unwrap();
            let at = world.marbles.get(id).unwrap().position;
            let far = at.x.abs().max(at.y.abs()).max(at.z.abs());
            assert!(far < 1.0, "run {run}, {speed} m/s: {at:?} after step {step}");
        }
    }
}

#[test]
fn marbles_taken_out_between_the_verbs_harm_nobody() {
    for response in RESPONSES {
        for late in [false, true] {
            let fast = |z: f32| ([-0.5, 0.0, z], [300.0, 0.0, 0.0]);
            let (mut world, ids) = world(response, &[fast(0.0), fast(1.0), fast(2.0)]);
            let wall = Obb::new(
                Point3::new(0.5, 0.0, 0.0),
                Quat::new(1.0, 0.0, 0.0, 0.0),
                Vec3::new(0.1, 9.0, 9.0),
            );
            world.walls.insert(wall.unwrap()).unwrap();
            world.begin_step();
            world.integrate(DT).unwrap();
            if late {
                world.generate_contacts();
            }
            world.marbles.remove(ids[0]).unwrap();
            if !late {
                world.generate_contacts();
            }
            world.restitute(DT).unwrap();
            assert_eq!(world.marbles.len(), 2, "{response:?}");
        }
    }
}

#[test]
fn walls_taken_out_between_the_verbs_harm_nobody() {
    let all = [RESPONSES[0], RESPONSES[1], Response::EventDriven];
    for response in all {
        for late in [false, true] {
            let (mut world, _) = world(response, &[([0.0; 3], [30.0, -3.0, 0.0])]);
            let walls = [-1.0, 1.0].map(|x| {
                let turned = Quat::new(1.0, 0.0, 0.0, 0.0);
                let half = Vec3::new(0.1, 9.0, 9.0);
                world
                    .walls
                    .insert(Obb::new(Point3::new(x, 0.0, 0.0), turned, half).unwrap())
                    .unwrap()
            });
            for wall in walls {
                world.begin_step();
                world.integrate(DT).unwrap();
                if late {
                    world.generate_contacts();
                }
                world.walls.remove(wall).unwrap();
                if !late {
                    world.generate_contacts();
                }
                world.restitute(DT).unwrap();
                assert_eq!(world.marbles.len(), 1, "{response:?}");
            }
        }
    }
}

#[test]
fn what_is_taken_out_of_the_contacts_falls_through_a_half_space() {
    for response in RESPONSES {
        let mut world = room(response);
        let at = Point3::new(0.0, 0.3, 0.0);
        let id = world.marbles.insert(Marble::new(at, 0.1)).unwrap();
        for _ in 0..60 {
            world.begin_step();
            world.integrate(DT).unwrap();
            world.generate_contacts();
            world.contacts.clear();
            world.restitute(DT).unwrap();
            world.end_step();
        }
        let end = world.marbles.get(id).unwrap();
        assert!(end.position.y < -4.0, "{response:?}: {end:?}");
    }
}

/// The lower of two balls bounces off the floor within the substep, into the upper one.
#[test]
fn balls_that_follow_each_other_onto_a_floor_do_not_pass_through_each_other() {
    for response in [Response::Displacement, Response::Impulse] {
        for (substeps, speed) in [(1, 1.0), (1, 4.0), (2, 4.0), (4, 4.0), (4, 8.0)] {
            for phase in 0_u8..64 {
                let mut world = World::<f32>::default();
                let model = Model { response, substeps, ..Model::default() };
                world.set_model(model).unwrap();
                world.walls.insert(Plane::new(Vec3::unit_y(), 0.0).unwrap()).unwrap();
                let [lower, upper] = [0.3, 0.34].map(|height| {
                    let height = height + f32::from(phase) * (speed / 64.0 / 64.0);
                    let ball = Marble::new(Point3::new(0.0, height, 0.0), 0.01);
                    let velocity = Vec3::new(0.0, -speed, 0.0);
                    world.marbles.insert(Marble { velocity, ..ball }).unwrap()
                });
                for _ in 0..40 {
                    world.step(1.0 / 64.0).unwrap();
                    let [lower, upper] = [lower, upper].map(|id| world.marbles.get(id).unwrap());
                    let offset = (upper.position - lower.position) / 0.01;
                    let (apart, beside) = (offset.magnitude(), offset.x.hypot(offset.z));
                    let name = format!("{response:?}, {substeps}, {speed} m/s, phase {phase}");
                    // What moves by less than half a radius in a substep is not swept. Once they have met, the
                    // upper one tips over.
                    assert!(apart > 1.5, "{name}: {apart} radii apart");
                    assert!(offset.y > 0.0 || beside > 1.0, "{name}: {offset:?} radii");
                }
            }
        }
    }
}
