//! Islands: marbles that bear each other fall asleep and wake together, and no other one with them.

use std::collections::BTreeSet;

use super::{DT, Random, asleep, block, steps, world};
use taw::prelude::*;
use taw::swarm::SwarmModel;

/// Marbles that overlap this one, or one that does, and so on: soft contacts overlap by what they bear.
pub fn island(world: &World<f32>, id: MarbleId) -> BTreeSet<MarbleId> {
    let marbles = &world.marbles;
    let mut found = BTreeSet::from([id]);
    let mut next = vec![marbles.row(id).unwrap()];
    while let Some(row) = next.pop() {
        for other in 0..marbles.len() {
            let apart = (marbles.position()[other] - marbles.position()[row]).magnitude();
            let touches = apart < marbles.radius()[other] + marbles.radius()[row];
            if touches && found.insert(marbles.id(other).unwrap()) {
                next.push(other);
            }
        }
    }
    found
}

/// A floor with 400 marbles that lie on it, of which one rolls for ever.
pub fn floor_with_roller() -> (World<f32>, Vec<MarbleId>, MarbleId) {
    let mut world = world();
    world.walls.insert(Plane::new(Vec3::unit_y(), 0.0).unwrap()).unwrap();
    let places = (0..20_u16).flat_map(|x| (0..20_u16).map(move |z| [x, z]));
    let ids: Vec<_> = places
        .map(|[x, z]| {
            let [x, z] = [x, z].map(|i| f32::from(i) - 9.5);
            world.marbles.insert(Marble::new(Point3::new(x, 0.2, z), 0.2)).unwrap()
        })
        .collect();
    // Between the rows of the others.
    let roller = Marble {
        velocity: Vec3::new(1.0, 0.0, 0.0),
        ..Marble::new(Point3::new(-9.0, 0.2, 0.0), 0.2)
    };
    let roller = world.marbles.insert(roller).unwrap();
    (world, ids, roller)
}

#[test]
fn one_that_rolls_keeps_no_other_one_awake() {
    let (mut world, ids, roller) = floor_with_roller();
    steps(&mut world, 90);
    assert_eq!(asleep(&world, &ids), ids.len());
    assert!(!world.is_asleep(roller).unwrap());
    for _ in 0..300 {
        steps(&mut world, 1);
        assert_eq!(asleep(&world, &ids), ids.len());
        assert_eq!(world.swarm.asleep(), ids.len());
    }
    let rolled = world.marbles.get(roller).unwrap();
    assert!(rolled.velocity.x > 0.5 && rolled.position.x > -6.0);
}

#[test]
fn who_is_struck_wakes_and_no_other_one() {
    let (mut world, ids, roller) = floor_with_roller();
    steps(&mut world, 90);
    let struck = ids[210];
    let beside = world.marbles.get(struck).unwrap().position - Vec3::unit_z() * 0.5;
    world.marbles.set_position(roller, beside).unwrap();
    world.marbles.set_velocity(roller, Vec3::new(0.2, 0.0, 3.0)).unwrap();
    let mut moved: BTreeSet<MarbleId> = BTreeSet::new();
    for _ in 0..240 {
        steps(&mut world, 1);
        let awake = ids.iter().filter(|id| !world.is_asleep(**id).unwrap());
        moved.extend(awake);
    }
    assert!(moved.contains(&struck) && moved.len() < 40, "{} woke", moved.len());
    for id in &ids {
        let row = world.marbles.row(*id).unwrap();
        let at = world.marbles.position()[row];
        let home = Point3::new((at.x + 0.5).round() - 0.5, 0.2, (at.z + 0.5).round() - 0.5);
        assert!(moved.contains(id) || (at - home).magnitude() < 1e-3);
    }
}

/// A row of bins with a heap in each.
fn bins(count: u16, seed: u64) -> (World<f32>, Vec<Vec<MarbleId>>) {
    let (mut world, mut random) = (world(), Random(seed));
    world.walls.insert(Plane::new(Vec3::unit_y(), 0.0).unwrap()).unwrap();
    for i in 0..=count {
        let x = f32::from(i);
        world.walls.insert(block([x - 0.1, 0.0, -1.0], [x + 0.1, 4.0, 1.0])).unwrap();
    }
    for z in [-0.6, 0.6] {
        let end = f32::from(count);
        world.walls.insert(block([0.0, 0.0, z - 0.1], [end, 4.0, z + 0.1])).unwrap();
    }
    let heap = |bin: u16| {
        let balls = (0..12_u16).map(|i| {
            let place = [random.next(), random.next()].map(|x| 0.4 * x - 0.2);
            let at = [f32::from(bin) + 0.5 + place[0], 0.3 + 0.3 * f32::from(i), place[1]];
            let slows = Material { rolling_resistance: 0.05, ..Material::default() };
            let ball = Marble { material: Some(slows), ..Marble::new(Point3::from(at), 0.15) };
            world.marbles.insert(ball).unwrap()
        });
        balls.collect()
    };
    let heaps = (0..count).map(heap).collect();
    (world, heaps)
}

#[test]
fn a_heap_that_is_stirred_keeps_no_other_one_awake() {
    let (mut world, heaps) = bins(10, 3);
    let stirred = heaps[4][0];
    for step in 0..900 {
        if step % 20 == 0 {
            world.marbles.apply_impulse(stirred, Vec3::new(3.0, 20.0, 2.0)).unwrap();
        }
        steps(&mut world, 1);
        assert!(!world.is_asleep(stirred).unwrap());
        let sleeping = heaps.iter().filter(|heap| asleep(&world, *heap) == 12).count();
        assert!(step < 600 || sleeping == 9, "{sleeping} heaps sleep at step {step}");
    }
    // What fell asleep together wakes together.
    steps(&mut world, 600);
    for heap in &heaps {
        let mut world = world.clone();
        assert_eq!(asleep(&world, heap), 12);
        let island = island(&world, heap[5]);
        world.marbles.set_velocity(heap[5], Vec3::new(0.0, 2.0, 0.0)).unwrap();
        steps(&mut world, 1);
        assert_eq!(asleep(&world, &island), 0);
        let others = heaps.iter().filter(|other| *other != heap).flatten();
        assert_eq!(asleep(&world, others), 108);
    }
}

/// Whoever a marble bears wakes when it is set elsewhere, whenever each of them fell asleep.
#[test]
fn what_lost_its_support_falls() {
    for late in [0, 120] {
        let mut world = world();
        world.walls.insert(Plane::new(Vec3::unit_y(), 0.0).unwrap()).unwrap();
        for x in [-0.45, 0.45] {
            world.walls.insert(block([x - 0.2, 0.0, -1.0], [x + 0.2, 3.0, 1.0])).unwrap();
        }
        for z in [-0.45, 0.45] {
            world.walls.insert(block([-1.0, 0.0, z - 0.2], [1.0, 3.0, z + 0.2])).unwrap();
        }
        let at = |y: f32| Marble::new(Point3::new(0.0, y, 0.0), 0.24);
        let lower = world.marbles.insert(at(0.24)).unwrap();
        steps(&mut world, late);
        assert_eq!(world.is_asleep(lower).unwrap(), late > 0);
        let upper = world.marbles.insert(at(0.7201)).unwrap();
        steps(&mut world, 1);
        assert!(!world.is_asleep(lower).unwrap(), "who comes wakes it");
        steps(&mut world, 120);
        assert!(world.is_asleep(lower).unwrap() && world.is_asleep(upper).unwrap());
        world.marbles.set_position(lower, Point3::new(5.0, 0.24, 0.0)).unwrap();
        steps(&mut world, 60);
        let height = world.marbles.get(upper).unwrap().position.y;
        assert!(height < 0.25, "{late}: at {height}");
    }
}

#[test]
fn bits_are_the_same_on_any_threads_while_islands_sleep_and_wake() {
    let run = |threads: u32| {
        let (mut world, heaps) = bins(200, 9);
        let model = SwarmModel { threads, ..world.swarm.model() };
        world.swarm.set_model(model).unwrap();
        let mut sleepers = Vec::new();
        for step in 0..400_usize {
            if step > 200 && step % 10 == 0 {
                let id = heaps[step * 7 % 200][step % 12];
                world.marbles.apply_impulse(id, Vec3::new(1.0, 9.0, 1.0)).unwrap();
            }
            world.step(DT).unwrap();
            sleepers.push((world.swarm.asleep(), world.sleep_version()));
        }
        (world.marbles.position().to_vec(), world.marbles.velocity().to_vec(), sleepers)
    };
    let alone = run(1);
    assert!(alone.2.iter().any(|(count, _)| (500..2_400).contains(count)));
    for threads in [2, 3, 7] {
        assert!(run(threads) == alone, "{threads} threads");
    }
}

/// Contacts that the first two verbs list are those of all that is awake, also of what wakes in them.
#[test]
fn who_wakes_has_contacts_at_once() {
    let (mut world, heaps) = bins(3, 5);
    steps(&mut world, 900);
    assert_eq!(asleep(&world, heaps.iter().flatten()), 36);
    let id = heaps[1][4];
    let touching = island(&world, id).len();
    world.marbles.set_velocity(id, Vec3::new(0.0, 1e-3, 0.0)).unwrap();
    world.begin_step();
    world.integrate(DT).unwrap();
    world.generate_contacts();
    assert!(touching > 3 && world.contacts.mm.len() >= touching - 1, "{}", world.contacts.mm.len());
}

/// One that is set down between two others that sleep parts them, as it does while they are awake.
#[test]
fn who_is_set_between_sleepers_wakes_them() {
    let mut world = world();
    world.walls.insert(Plane::new(Vec3::unit_y(), 0.0).unwrap()).unwrap();
    let slippery = Some(Material { friction: 0.0, ..Material::default() });
    world.walls.set_material(world.walls.id(0).unwrap(), slippery).unwrap();
    let ball =
        |x: f32, y: f32| Marble { material: slippery, ..Marble::new(Point3::new(x, y, 0.0), y) };
    let light = |x: f32| ball(x, 0.1);
    let pair = [-0.11, 0.11].map(|x| world.marbles.insert(light(x)).unwrap());
    let heavy = Marble { mass: Mass::Kilograms(1e3), ..ball(5.0, 0.3) };
    let heavy = world.marbles.insert(heavy).unwrap();
    steps(&mut world, 120);
    assert_eq!(asleep(&world, &pair), 2);
    // It touches both.
    let height = 0.1 + (0.4_f32 * 0.4 - 0.11 * 0.11).sqrt();
    world.marbles.set_position(heavy, Point3::new(0.0, height, 0.0)).unwrap();
    world.marbles.set_velocity(heavy, Vec3::new(0.0, 0.0, 0.0)).unwrap();
    steps(&mut world, 60);
    let height = world.marbles.get(heavy).unwrap().position.y;
    assert!(height < 0.32, "at {height}");
}
