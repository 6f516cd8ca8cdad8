//! Swarms fall asleep whatever their walls are made of, and with marbles of the world among them.

use taw::prelude::*;
use taw::shape::Aabb;
use taw::swarm::{Ball, SwarmModel};

const DT: f32 = 1.0 / 60.0;
/// Half the box's width in metres.
const HALF: f32 = 5.25;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Walls {
    HalfSpaces,
    BoxFloor,
    BoxSides,
    Boxes,
}

/// A box open at its top, 2,000 balls in layers of a hundred above its floor, and in place of some
/// of them marbles.
fn poured(walls: Walls, seed: u64, marbles: usize) -> (World<f32>, Vec<MarbleId>) {
    let mut world = World::default();
    world.swarm.set_model(SwarmModel { threads: 1, ..SwarmModel::default() }).unwrap();
    world.set_gravity(Vec3::new(0.0, -9.81, 0.0)).unwrap();
    let outer = HALF + 1.0;
    let block = |world: &mut World<f32>, min: [f32; 3], max: [f32; 3]| {
        world.walls.insert(Aabb { min: min.into(), max: max.into() }).unwrap();
    };
    if matches!(walls, Walls::HalfSpaces | Walls::BoxSides) {
        world.walls.insert(Plane::new(Vec3::unit_y(), 0.0).unwrap()).unwrap();
    } else {
        block(&mut world, [-outer, -1.0, -outer], [outer, 0.0, outer]);
    }
    for axis in [0, 2] {
        for side in [-1.0, 1.0] {
            if matches!(walls, Walls::HalfSpaces | Walls::BoxFloor) {
                let mut inward = Vec3::new(0.0, 0.0, 0.0);
                inward[axis] = -side;
                world.walls.insert(Plane::new(inward, -HALF).unwrap()).unwrap();
            } else {
                let (mut min, mut max) = ([-outer, 0.0, -outer], [outer, 50.0, outer]);
                (min[axis], max[axis]) = if side < 0.0 { (-outer, -HALF) } else { (HALF, outer) };
                block(&mut world, min, max);
            }
        }
    }
    let mut state = seed;
    let mut random = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        (state >> 40) as f32 / (1 << 24) as f32
    };
    let mut balls = Vec::new();
    for i in 0..2_000_u16 {
        let at = |cell: u16| f32::from(cell) * 1.05 - 4.725;
        let mut aside = || 0.04 * (random() - 0.5);
        let (x, z) = (at(i % 10) + aside(), at(i / 10 % 10) + aside());
        let radius = 0.3 + 0.2 * random();
        balls.push(Ball::new(Point3::new(x, 0.5 + f32::from(i / 100) * 1.05, z), radius));
    }
    let ids = (0..marbles).map(|i| {
        let Ball { position, radius, mass, .. } = balls.remove(505 + 10 * i);
        world.marbles.insert(Marble { mass, ..Marble::new(position, radius) }).unwrap()
    });
    let ids = ids.collect();
    world.swarm.insert(&balls).unwrap();
    (world, ids)
}

fn seconds(world: &mut World<f32>, seconds: u32) {
    (0..60 * seconds).for_each(|_| world.step(DT).unwrap());
}

/// Seconds after which all sleep, within a minute.
fn time_to_sleep(world: &mut World<f32>) -> Option<u32> {
    (1..=60).find(|_| {
        seconds(world, 1);
        world.swarm.asleep() == 2_000
    })
}

/// When the last ball rests is chance: of 32 heaps, half sleep after ten seconds and nine in ten after
/// half a minute. Without rolling resistance, in one heap in some twenty a ball rocks between others for
/// longer.
#[test]
fn two_thousand_balls_fall_asleep_between_boxes_as_between_half_spaces() {
    for walls in [Walls::HalfSpaces, Walls::BoxFloor, Walls::BoxSides, Walls::Boxes] {
        let time = |seed| time_to_sleep(&mut poured(walls, seed, 0).0);
        let mut times: Vec<_> = (1..=32).map(|seed| time(seed).unwrap_or(u32::MAX)).collect();
        times.sort_unstable();
        assert!(times[15] <= 10 && times[28] <= 30, "{walls:?}: {times:?} s");
    }
}

/// Marbles that the world moves stir the balls about them; one heap in some sixty rolls a ball about for
/// more than a minute.
#[test]
fn marbles_among_balls_fall_asleep_with_them_and_sink_no_further() {
    for walls in [Walls::HalfSpaces, Walls::Boxes] {
        let asleep = |marbles| {
            let sleeps = |seed: &u64| sleeps_and_wakes(walls, *seed, marbles);
            (1..=8).filter(sleeps).count()
        };
        for marbles in [1, 3] {
            let count = asleep(marbles);
            assert!(count >= 7, "{walls:?}, {marbles} marbles: {count} of 8");
        }
    }
}

/// Returns whether all sleep within a minute. Then they stay where they are, until one is pushed.
fn sleeps_and_wakes(walls: Walls, seed: u64, marbles: usize) -> bool {
    let (mut world, ids) = poured(walls, seed, marbles);
    let case = format!("{walls:?}, seed {seed}, {marbles} marbles");
    if time_to_sleep(&mut world).is_none() {
        return false;
    }
    let places = |world: &World<f32>| world.marbles.position().to_vec();
    let before = places(&world);
    seconds(&mut world, 10);
    assert_eq!(places(&world), before, "{case}");
    // What pushes one of them wakes those around it.
    let up = Vec3::new(0.0, 6.0, 0.0);
    world.marbles.set_velocity(ids[0], up).unwrap();
    world.step(DT).unwrap();
    world.step(DT).unwrap();
    assert!(world.swarm.asleep() < 2_000, "{case}");
    true
}

#[test]
fn balls_whose_last_marble_is_gone_do_not_fall_asleep_in_flight() {
    let (mut world, ids) = poured(Walls::BoxFloor, 1, 1);
    let floor = world.walls.id(0).unwrap();
    for second in 0..14 {
        let mut falling = world.clone();
        falling.marbles.remove(ids[0]).unwrap();
        falling.step(DT).unwrap();
        falling.walls.remove(floor).unwrap();
        seconds(&mut falling, 2);
        assert_eq!(falling.swarm.asleep(), 0, "the floor goes after {second} s");
        let slowest = falling.swarm.velocities().iter().map(|v| -v[1]).fold(f32::MAX, f32::min);
        assert!(slowest > 1.0, "the floor goes after {second} s: {slowest} m/s");
        seconds(&mut world, 1);
    }
}
