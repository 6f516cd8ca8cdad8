//! Balls in bulk: the same bits however they are stepped, and the physics of [`Tier`].

mod walls;

use taw::Error;
use taw::prelude::*;
use taw::swarm::{Ball, BallId, SimdLevel, Swarm, SwarmModel, Tier};

const DT: f32 = 1.0 / 60.0;

/// Numbers in [0, 1) that look random.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        (self.0 >> 40) as f32 / (1 << 24) as f32
    }
}

fn number<S: Scalar>(x: f32) -> S {
    S::from_f64(x.into())
}

fn model<S: Scalar>(tier: Tier) -> SwarmModel<S> {
    let (friction, restitution) = (number(0.3), number(0.2));
    let material = Material { friction, restitution, ..Material::default() };
    SwarmModel { tier, threads: 1, material, ..SwarmModel::default() }
}

/// A world with a floor at zero, and four walls if there is room between them.
fn world<S: Scalar>(model: SwarmModel<S>, half: Option<f32>) -> World<S> {
    let mut world = World::default();
    world.swarm.set_model(model).unwrap();
    world.walls.insert(Plane::new(Vec3::unit_y(), S::zero()).unwrap()).unwrap();
    if let Some(half) = half {
        for direction in [Vec3::unit_x(), -Vec3::unit_x(), Vec3::unit_z(), -Vec3::unit_z()] {
            world.walls.insert(Plane::new(direction, number(-half)).unwrap()).unwrap();
        }
    }
    world
}

/// So many balls on a lattice, over a box that fits it, with radii up to a half.
fn pour<S: Scalar>(count: usize, least: f32, model: SwarmModel<S>) -> World<S> {
    let side = (count as f32 / 6.0).sqrt().ceil() as usize;
    let half = side as f32 * 1.05 / 2.0;
    let mut world = world(model, Some(half));
    let mut random = Random(count as u64);
    let balls: Vec<_> = (0..count)
        .map(|i| {
            let at = |cell: usize| (cell as f32 + 0.5) * 1.05;
            let place = [at(i % side) - half, at(i / side / side), at(i / side % side) - half];
            let radius = 0.5 * (least / 0.5).powf(random.next());
            let velocity = Vec3::new(random.next() - 0.5, 0.0, random.next() - 0.5) * 0.1;
            let ball = Ball::new(Point3::from(place.map(number)), number(radius));
            Ball { velocity: velocity.map(number), mass: Mass::Density(S::one()), ..ball }
        })
        .collect();
    world.swarm.insert(&balls).unwrap();
    world
}

fn steps<S: Scalar>(world: &mut World<S>, count: u32) {
    for _ in 0..count {
        world.step(number(DT)).unwrap();
    }
}

fn one(world: &World<f32>, ball: BallId) -> (Vec3<f32>, Vec3<f32>) {
    let row = world.swarm.row(ball).unwrap();
    let ([x, y, z, _], [u, v, w, _]) = (world.swarm.balls()[row], world.swarm.velocities()[row]);
    (Vec3::new(x, y, z), Vec3::new(u, v, w))
}

/// The deepest overlap of any two balls.
fn deepest(swarm: &Swarm) -> f32 {
    let mut grid = taw::broad::Grid::default();
    let at: Vec<Point3<f32>> =
        swarm.balls().iter().map(|b| Point3::new(b[0], b[1], b[2])).collect();
    let radius: Vec<f32> = swarm.balls().iter().map(|ball| ball[3]).collect();
    grid.rebuild(&at, &radius, 0.0);
    let mut deepest = 0.0_f32;
    grid.pairs(&at, |a, b| {
        let (a, b) = (a as usize, b as usize);
        deepest = deepest.max(radius[a] + radius[b] - at[a].distance(at[b]));
    });
    deepest
}

/// Kinetic and potential energy over the weight, as a height in metres.
fn energy(swarm: &Swarm) -> f64 {
    let (mut energy, mut mass) = (0.0, 0.0);
    let rows = swarm.balls().iter().zip(swarm.velocities());
    for (row, (at, velocity)) in rows.enumerate() {
        let m = 1.0 / f64::from(velocity[3].abs());
        let square = |v: &[f32; 4]| v[..3].iter().map(|x| f64::from(*x).powi(2)).sum::<f64>();
        let rim = swarm.spin_velocities().get(row).map_or(0.0, square);
        energy += m * (0.5 * square(velocity) + 0.2 * rim + 9.81 * f64::from(at[1]));
        mass += m;
    }
    energy / mass / 9.81
}

#[test]
fn threads_and_instructions_change_no_bit() {
    change_no_bit::<f32>();
    change_no_bit::<f64>();
}

fn change_no_bit<S: Scalar>() {
    for tier in [Tier::Lab, Tier::Full] {
        for least in [0.3, 0.01] {
            let start = pour::<S>(2_500, least, model(tier));
            let run = |threads: u32, instructions: SimdLevel| {
                let mut world = start.clone();
                world.swarm.set_model(SwarmModel { threads, ..model(tier) }).unwrap();
                world.swarm.set_simd_level(instructions);
                steps(&mut world, 60);
                world
            };
            let reference = run(1, SimdLevel::PORTABLE);
            assert!(reference.swarm.rebuilds() > 5);
            for instructions in SimdLevel::available() {
                for threads in [0, 1, 2, 3, 8] {
                    let other = run(threads, instructions);
                    let what = format!("{tier:?}, {threads} threads, {instructions:?}");
                    assert!(other.swarm == reference.swarm, "{what}");
                }
            }
        }
    }
}

#[test]
fn the_full_tier_comes_to_rest_without_energy_from_nothing() {
    let mut world = pour(2_000, 0.3, SwarmModel { sleeps: false, ..model(Tier::Full) });
    let mut before = energy(&world.swarm);
    let begin = before;
    for step in 0..300 {
        steps(&mut world, 1);
        let now = energy(&world.swarm);
        // What pushes overlap out lifts a little.
        assert!(now < before + 2e-5 * begin, "{now} m after {before} m in step {step}");
        before = now;
    }
    assert!(deepest(&world.swarm) < 0.03, "{} m", deepest(&world.swarm));
    let fast = world.swarm.velocities().iter().filter(|v| v[..3].iter().any(|x| x.abs() > 0.1));
    assert!(fast.count() < 20);
    assert!(world.swarm.balls().iter().all(|[_, y, _, r]| *y > 0.97 * r), "none is in the floor");
}

#[test]
fn the_labs_tier_keeps_balls_apart_and_in_the_box() {
    let mut world = pour(2_000, 0.3, SwarmModel { substeps: 4, ..model(Tier::Lab) });
    let before = energy(&world.swarm);
    steps(&mut world, 300);
    assert!(energy(&world.swarm) < before);
    let overlaps = deepest(&world.swarm);
    assert!(overlaps < 0.15, "{overlaps} m");
    let half = (2_000_f32 / 6.0).sqrt().ceil() * 1.05 / 2.0;
    for [x, y, z, r] in world.swarm.balls() {
        assert!(*y > 0.9 * r && half - x.abs() > 0.9 * r && half - z.abs() > 0.9 * r);
    }
}

#[test]
fn a_bounce_gives_back_the_part_of_the_speed_that_it_should() {
    for e in [0.0, 0.5, 1.0] {
        let material = Material { restitution: e, friction: 0.0, ..Material::default() };
        let mut world = world(SwarmModel { material, ..model(Tier::Full) }, None);
        world.set_gravity(Vec3::new(0.0, 0.0, 0.0)).unwrap();
        let ball = |x: f32, speed: f32, mass: f32| Ball {
            velocity: Vec3::new(speed, 0.0, 0.0),
            mass: Mass::Kilograms(mass),
            ..Ball::new(Point3::new(x, 5.0, 0.0), 0.5)
        };
        let ids = world.swarm.insert(&[ball(-2.0, 3.0, 1.0), ball(2.0, -1.0, 2.0)]).unwrap();
        steps(&mut world, 120);
        // Momentum 1 kg m/s; the relative speed is turned round.
        let (a, b) = (one(&world, ids[0]).1, one(&world, ids[1]).1);
        assert!((a.x + 2.0 * b.x - 1.0).abs() < 1e-5);
        assert!((b.x - a.x - 4.0 * e).abs() < 1e-5, "{} m/s at {e}", b.x - a.x);
    }
}

#[test]
fn what_slides_begins_to_roll_with_five_sevenths() {
    let mut world = world(model(Tier::Full), None);
    let ball =
        Ball { velocity: Vec3::new(7.0, 0.0, 0.0), ..Ball::new(Point3::new(0.0, 0.5, 0.0), 0.5) };
    let id = world.swarm.insert(&[ball]).unwrap()[0];
    steps(&mut world, 120);
    let (place, velocity) = one(&world, id);
    assert!((velocity.x - 5.0).abs() < 0.01, "{} m/s", velocity.x);
    assert!((place.y - 0.5).abs() < 1e-3 && velocity.z.abs() < 1e-5);
}

#[test]
fn a_slope_holds_by_friction_what_it_should() {
    // Rolls down with 5/7 of what would slide; without friction it slides.
    for (friction, part) in [(0.5, 5.0 / 7.0), (0.0, 1.0)] {
        let material = Material { friction, ..Material::default() };
        let mut world = world(SwarmModel { material, ..model(Tier::Full) }, None);
        let (sin, cos) = 10_f32.to_radians().sin_cos();
        world.set_gravity(Vec3::new(9.81 * sin, -9.81 * cos, 0.0)).unwrap();
        let id = world.swarm.insert(&[Ball::new(Point3::new(0.0, 0.5, 0.0), 0.5)]).unwrap()[0];
        steps(&mut world, 120);
        let expected = 9.81 * sin * part * 2.0;
        let speed = one(&world, id).1.x;
        assert!((speed / expected - 1.0).abs() < 2e-3, "{speed} for {expected} m/s");
    }
}

#[test]
fn all_sleep_and_a_kick_wakes_only_what_it_should() {
    // A long trough, so that there are many slabs.
    let mut world = world(model(Tier::Full), None);
    for direction in [Vec3::unit_z(), -Vec3::unit_z()] {
        world.walls.insert(Plane::new(direction, -4.0).unwrap()).unwrap();
    }
    let mut balls = Vec::new();
    for i in 0..400_u16 {
        for j in 0..14_u16 {
            let at = |cell: u16| f32::from(cell);
            let place = Point3::new(at(i) * 1.001, 0.5 + at(j / 7) * 1.001, at(j % 7) - 3.0);
            balls.push(Ball::new(place, 0.5));
        }
    }
    let ids = world.swarm.insert(&balls).unwrap();
    steps(&mut world, 300);
    assert_eq!(world.swarm.asleep(), balls.len());
    let before = world.clone();
    steps(&mut world, 60);
    assert!(world == before, "what sleeps does not change");
    let kicked = ids[200 * 14 + 10];
    world.swarm.set_velocity(kicked, Vec3::new(0.0, 3.0, 0.0)).unwrap();
    steps(&mut world, 30);
    let awake = balls.len() - world.swarm.asleep();
    assert!(awake > 0 && awake < 2_000, "{awake} are awake");
    for (ball, id) in balls.iter().zip(&ids) {
        if (ball.position.x - 200.0).abs() > 100.0 {
            assert_eq!(one(&world, *id), one(&before, *id));
        }
    }
    steps(&mut world, 300);
    assert_eq!(world.swarm.asleep(), balls.len(), "and all sleep again");
    // Without the floor they fall.
    let floor = world.walls.id(0).unwrap();
    world.walls.remove(floor).unwrap();
    steps(&mut world, 10);
    assert_eq!(world.swarm.asleep(), 0);
}

#[test]
fn balls_come_and_go_by_name() {
    let mut world = pour::<f32>(2_000, 0.3, model(Tier::Full));
    let swarm = &world.swarm;
    let ids: Vec<_> = (0..swarm.len()).map(|row| swarm.id(row).unwrap()).collect();
    steps(&mut world, 150);
    let (gone, kept): (Vec<_>, Vec<_>) = ids.iter().enumerate().partition(|(i, _)| i % 2 == 0);
    let [gone, kept] =
        [gone, kept].map(|ids| ids.into_iter().map(|(_, id)| *id).collect::<Vec<_>>());
    let before: Vec<_> = kept.iter().map(|id| one(&world, *id)).collect();
    world.swarm.remove(&gone).unwrap();
    assert_eq!(world.swarm.len(), kept.len());
    assert_eq!(kept.iter().map(|id| one(&world, *id)).collect::<Vec<_>>(), before);
    assert_eq!(world.swarm.row(gone[0]), Err(Error::NoSuchBall(gone[0])));
    let new = world.swarm.insert(&[Ball::new(Point3::new(0.0, 20.0, 0.0), 0.4)]).unwrap();
    assert!(!ids.contains(&new[0]), "a place that is used again has another name");
    steps(&mut world, 60);
    assert!(deepest(&world.swarm) < 0.05);
    // All or none.
    let snapshot = world.clone();
    assert_eq!(world.swarm.remove(&[kept[0], kept[0]]), Err(Error::NoSuchBall(kept[0])));
    assert_eq!(world.swarm.remove(&[kept[0], gone[0]]), Err(Error::NoSuchBall(gone[0])));
    assert!(world == snapshot);
}

#[test]
fn the_tier_changes_while_balls_come_and_go() {
    let mut world = pour(1_000, 0.3, model(Tier::Full));
    for tier in [Tier::Lab, Tier::Full, Tier::Lab, Tier::Full] {
        steps(&mut world, 20);
        world.swarm.set_model(model(tier)).unwrap();
        let count = world.swarm.len();
        let gone: Vec<_> = (0..100).filter_map(|row| world.swarm.id(row)).collect();
        world.swarm.remove(&gone).unwrap();
        steps(&mut world, 20);
        let new = [Ball::new(Point3::new(0.0, 30.0, 0.0), 0.4); 1];
        world.swarm.insert(&new).unwrap();
        world.swarm.remove(&[world.swarm.id(0).unwrap()]).unwrap();
        steps(&mut world, 1);
        assert_eq!(world.swarm.len(), count - 100);
        assert_eq!(
            world.swarm.spin_velocities().len(),
            if tier == Tier::Full { count - 100 } else { 0 }
        );
    }
}

#[test]
fn removing_a_ball_leaves_the_heap_as_it_was() {
    // What contacts bore is remembered while rows move.
    let mut world = pour::<f32>(2_000, 0.3, model(Tier::Full));
    steps(&mut world, 240);
    let top = (0..world.swarm.len())
        .max_by(|a, b| world.swarm.balls()[*a][1].total_cmp(&world.swarm.balls()[*b][1]))
        .unwrap();
    world.swarm.remove(&[world.swarm.id(top).unwrap()]).unwrap();
    steps(&mut world, 2);
    let quick = world.swarm.velocities().iter().filter(|v| v[1].abs() > 0.15).count();
    assert!(quick < 20, "{quick} balls jump");
}

#[test]
fn bad_balls_are_refused_by_name_and_change_nothing() {
    let mut world = world(model(Tier::Full), None);
    let good = Ball::new(Point3::new(0.0, 1.0, 0.0), 0.5);
    world.swarm.insert(&[good]).unwrap();
    let before = world.clone();
    let bad = [
        (Ball { position: Point3::new(0.0, f32::NAN, 0.0), ..good }, "position.y"),
        (Ball { position: Point3::new(1e13, 0.0, 0.0), ..good }, "position.x"),
        (Ball { velocity: Vec3::new(0.0, 0.0, f32::INFINITY), ..good }, "velocity.z"),
        (Ball { radius: 0.0, ..good }, "radius"),
        (Ball { radius: f32::NAN, ..good }, "radius"),
        (Ball { mass: Mass::Kilograms(0.0), ..good }, "mass"),
        (Ball { mass: Mass::Infinite, ..good }, "mass"),
    ];
    for (ball, field) in bad {
        let error = world.swarm.insert(&[good, ball]).unwrap_err().to_string();
        assert!(error.starts_with(field), "{error}");
        assert!(world == before);
    }
    let id = world.swarm.id(0).unwrap();
    assert!(world.swarm.set_velocity(id, Vec3::new(f32::NAN, 0.0, 0.0)).is_err());
    assert!(world.swarm.set_position(id, Point3::new(0.0, 0.0, f32::INFINITY)).is_err());
    let none = SwarmModel { substeps: 0, ..SwarmModel::default() };
    assert!(world.swarm.set_model(none).is_err());
    assert!(world.swarm.set_model(SwarmModel { threads: 65, ..SwarmModel::default() }).is_err());
    assert!(world == before);
}

#[test]
fn what_overflows_is_stopped_and_named_and_no_other_changes() {
    for tier in [Tier::Lab, Tier::Full] {
        let mut calm = world(SwarmModel { sleeps: false, ..model(tier) }, None);
        let ball = |x: f32| Ball::new(Point3::new(x, 0.5, 0.0), 0.5);
        let ids = calm.swarm.insert(&[ball(0.0), ball(50.0), ball(100.0)]).unwrap();
        let mut wild = calm.clone();
        wild.swarm.set_position(ids[2], Point3::new(1e12, 0.5, 0.0)).unwrap();
        wild.swarm.set_velocity(ids[2], Vec3::new(1e12, 1e12, 0.0)).unwrap();
        wild.set_gravity(Vec3::new(0.0, -9.81, 0.0)).unwrap();
        let mut stopped = 0;
        for _ in 0..100_000 {
            wild.step(1.0).unwrap();
            calm.step(1.0).unwrap();
            stopped += wild.swarm.stopped().filter(|id| *id == ids[2]).count();
            if stopped > 0 {
                break;
            }
        }
        assert_eq!(stopped, 1, "{tier:?}");
        for id in &ids[..2] {
            assert_eq!(one(&wild, *id), one(&calm, *id));
        }
        assert!(wild.swarm.balls().iter().flatten().all(|x| x.is_finite()));
    }
}

#[test]
fn extremes_stay_finite() {
    for tier in [Tier::Lab, Tier::Full] {
        for (scale, offset) in [(1e-8, 0.0), (1e-3, 0.0), (1.0, 1e6), (1e6, 0.0), (1e8, 0.0)] {
            let mut world = World::<f32>::default();
            world.swarm.set_model(model(tier)).unwrap();
            world.walls.insert(Plane::new(Vec3::unit_y(), 0.0).unwrap()).unwrap();
            // Coincident, touching, far away, inside of each other.
            let mut balls = vec![Ball::new(Point3::new(offset, scale, 0.0), 0.5 * scale); 100];
            let more = (0..100_u8).map(|i| {
                let x = offset + f32::from(i) * scale;
                Ball::new(Point3::new(x, 3.0 * scale, 0.0), 0.5 * scale)
            });
            balls.extend(more);
            balls.push(Ball::new(Point3::new(offset, scale, 0.0), 5.0 * scale));
            balls.push(Ball::new(Point3::new(-9e11, 9e11, 9e11), scale));
            world.swarm.insert(&balls).unwrap();
            steps(&mut world, 60);
            let numbers = world.swarm.balls().iter().chain(world.swarm.velocities()).flatten();
            assert!(numbers.copied().all(f32::is_finite), "{tier:?} at {scale}");
        }
    }
}

#[test]
fn a_snapshot_goes_on_with_the_same_bits() {
    let mut world = pour::<f32>(1_000, 0.1, model(Tier::Full));
    steps(&mut world, 60);
    let mut copy = world.clone();
    steps(&mut world, 40);
    steps(&mut copy, 40);
    assert!(world == copy);
}

#[test]
fn balls_of_a_hundred_sizes_are_no_special_case() {
    let mut world = pour(3_000, 0.005, SwarmModel { substeps: 4, ..model(Tier::Full) });
    steps(&mut world, 240);
    assert!(deepest(&world.swarm) < 0.05, "{} m", deepest(&world.swarm));
    let half = (3_000_f32 / 6.0).sqrt().ceil() * 1.05 / 2.0;
    for [x, y, z, r] in world.swarm.balls() {
        assert!(*y > -0.02 && x.abs() < half && z.abs() < half, "{x} {y} {z} of {r}");
    }
}
